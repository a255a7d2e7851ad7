"""The order in which files of tests begin, and the tests of the long run."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.conftest import LONGEST, LONGEST_LONG, PROGRAMS, is_in_run
from tests.support import ROOT


def test_files_and_folders_that_begin_first_exist() -> None:
    assert [name for name in (*LONGEST, *LONGEST_LONG) if not (ROOT / "tests" / name).is_file()] == []
    assert [name for name in PROGRAMS if not (ROOT / "tests" / name).is_dir()] == []


@given(st.booleans())
def examples(_: bool) -> None:  # noqa: FBT001 - as hypothesis calls it
    """Be a test of hypothesis."""


@pytest.mark.long
def long() -> None:
    """Be a long test."""


def ordinary() -> None:
    """Be an ordinary test."""


@pytest.mark.parametrize(("function", "runs"), [(examples, [False, True]), (long, [True]), (ordinary, [False])])
def test_long_run_has_the_long_tests_and_those_of_hypothesis(
    request: pytest.FixtureRequest, function: Callable[[], None], runs: list[bool]
) -> None:
    item = pytest.Function.from_parent(request.node.parent, name="test", callobj=function)
    assert [is_long for is_long in (False, True) if is_in_run(item, is_long=is_long)] == runs
