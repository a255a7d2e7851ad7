"""Pages in `docs/`: the tests, flags and pages that they name are there, and each promise names a test."""

from __future__ import annotations

import ast
import re
from dataclasses import fields
from functools import cache
from pathlib import Path

import pytest

from rosbridge_sim.shell.config.settings import Settings
from tests.support import ROOT

PAGES = sorted((ROOT / "docs").rglob("*.md"))

NAMED_TEST = re.compile(r"`(tests/[\w/]+\.py)::(test_\w+)`")

LINK = re.compile(r"\]\((?!https?:)([^)#\s]*)(#[^)\s]*)?\)")

FLAG = re.compile(r"(?<![\w-])--[a-z][a-z-]*[a-z](?!-)")

HELD_BY_TESTS = {"differences.md": "The table", "security.md": "What is promised"}
"""Pages of which a section holds nothing without a test, and that section."""

of_each_page = pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)


@cache
def functions_of(path: Path) -> frozenset[str]:
    """Names of the functions in a Python file."""
    tree = ast.parse(path.read_text("utf-8"))
    return frozenset(node.name for node in ast.walk(tree) if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef))


def anchors_of(page: Path) -> set[str]:
    """Anchors that the headings of a page make, as most renderers form them."""
    headings = re.findall(r"^#+ (.+)$", page.read_text("utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


def rows_of(page: Path, section: str) -> list[str]:
    """Rows of all tables in a section of a page, without their heads."""
    text = page.read_text("utf-8").partition(f"\n## {section}\n")[2].partition("\n## ")[0]
    tables = re.findall(r"(?:^\|.*\n)+", text, re.MULTILINE)
    return [row for table in tables for row in table.splitlines()[2:]]


def test_there_are_pages_and_those_with_promises_are_among_them() -> None:
    assert {page.name for page in PAGES} >= set(HELD_BY_TESTS)


@of_each_page
def test_each_test_that_a_page_names_exists(page: Path) -> None:
    for file, name in NAMED_TEST.findall(page.read_text("utf-8")):
        assert name in functions_of(ROOT / file), f"{file}::{name}"


@pytest.mark.parametrize("name", HELD_BY_TESTS)
def test_each_row_of_what_is_held_by_tests_is_whole_and_ends_in_one(name: str) -> None:
    rows = rows_of(ROOT / "docs" / name, HELD_BY_TESTS[name])
    assert rows
    for row in rows:
        cells = [cell.strip() for cell in row.strip().strip("|").split("|")]
        assert all(cells), row
        assert all(NAMED_TEST.fullmatch(one) for one in cells[-1].split(", ")), row


@of_each_page
def test_each_link_of_a_page_leads_somewhere(page: Path) -> None:
    for target, anchor in LINK.findall(page.read_text("utf-8")):
        linked = page.parent / target if target else page
        assert linked.exists(), target
        assert not anchor or anchor[1:] in anchors_of(linked), anchor


@of_each_page
def test_flags_that_a_page_names_exist(page: Path) -> None:
    settings = {f"--{field.name.replace('_', '-')}" for field in fields(Settings)}
    readme = set(FLAG.findall((ROOT / "README.md").read_text("utf-8")))  # other commands' too
    plugin = set(FLAG.findall((ROOT / "rosbridge_sim" / "pytest_plugin.py").read_text("utf-8")))  # pytest's own
    assert set(FLAG.findall(page.read_text("utf-8"))) - settings - readme - plugin == set()
