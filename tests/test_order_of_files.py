"""The order in which files of tests begin."""

from __future__ import annotations

from tests.conftest import LONGEST, PROGRAMS
from tests.support import ROOT


def test_files_and_folders_that_begin_first_exist() -> None:
    assert [name for name in LONGEST if not (ROOT / "tests" / name).is_file()] == []
    assert [name for name in PROGRAMS if not (ROOT / "tests" / name).is_dir()] == []
