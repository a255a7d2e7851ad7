"""The page of differences names a test for each of its rows, and each of these is there."""

from __future__ import annotations

import re

import pytest

from tests.support import ROOT

PAGE = (ROOT / "docs" / "differences.md").read_text()
TEST = re.compile(r"`(tests/[\w/]+\.py)::(test_\w+)`")
ROWS = [
    line for line in PAGE.partition("## The table")[2].splitlines() if line.startswith("| ") and "| what |" not in line
]
RULE = "|---|---|---|---|---|"


@pytest.mark.parametrize("row", ROWS, ids=[row.split("|")[1].strip() for row in ROWS])
def test_row_says_all_and_ends_in_a_test(row: str) -> None:
    cells = [cell.strip() for cell in row.strip().strip("|").split("|")]
    assert len(cells) == 5
    assert all(cells)
    assert TEST.fullmatch(cells[-1])


@pytest.mark.parametrize(("file", "name"), sorted(set(TEST.findall(PAGE))))
def test_named_test_is_there(file: str, name: str) -> None:
    assert re.search(rf"^(async )?def {name}\(", (ROOT / file).read_text(), re.MULTILINE)


def test_flags_that_the_page_names_exist() -> None:
    readme = (ROOT / "README.md").read_text()
    for flag in set(re.findall(r"--[a-z][a-z-]+", PAGE)):
        assert flag in readme, flag
