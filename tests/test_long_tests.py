"""The table of long tests: it names tests that exist, and each promise keeps a quick test."""

from __future__ import annotations

from tests.long_tests import GROUPS, find_mistakes, is_long, table
from tests.support import ROOT

PROGRAM = "page/test_code.py::test_program_does_what_the_page_does"


def test_case_that_stays_is_quick_and_the_others_of_its_test_are_long() -> None:
    assert [is_long(f"{PROGRAM}[{name}]") for name in ("controlMessage", "gearRequest")] == [False, True]
    assert not is_long("page/test_code.py::test_each_request_of_the_page_has_an_effect_here")
    assert is_long("page/test_documentation.py::test_page_fits_the_window_and_its_pictures_and_links_work[1280-light]")


def test_name_that_no_test_has_and_case_that_no_longer_stays_are_mistakes() -> None:
    mistakes = find_mistakes([f"{PROGRAM}[gearRequest]"])
    assert f"{PROGRAM}[controlMessage]: no test has this name" in mistakes
    assert all(mistake.startswith("page/test_code.py") for mistake in mistakes)


def test_each_group_names_the_tests_that_stay() -> None:
    assert [group.what for group in GROUPS if not group.long or not group.quick] == []


def test_contributing_has_the_table_of_the_groups() -> None:
    assert table() in (ROOT / "CONTRIBUTING.md").read_text("utf-8"), "python -m tests.long_tests prints it"
