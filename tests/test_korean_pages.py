"""The Korean pages say what the English ones say: the same headings, code, tables and links, in the same order."""

from __future__ import annotations

import posixpath
import re

import pytest

from tests.support import ROOT

PAGES = {
    "README.ko.md": "README.md",
    "docs/ko/tutorial.md": "docs/tutorial.md",
    "docs/ko/when_nothing_moves.md": "docs/guides/when_nothing_moves.md",
}
"""Korean page -> English page."""

MARK = re.compile(r"^<!-- run: \S+ -->\n", re.MULTILINE)

CODE = re.compile(r"^```[\s\S]*?^```$|(?<=\n\n) {4}\S.*(?:\n {4}.*|\n(?=\n {4}))*", re.MULTILINE)

HANGUL = re.compile(r"[\uac00-\ud7a3]")

of_each_page = pytest.mark.parametrize("korean", PAGES)


def read(name: str) -> str:
    return MARK.sub("", (ROOT / name).read_text("utf-8"))


def shape_of(text: str) -> list[str]:
    """The levels of the headings, and the first character of each row of a table, in their order."""
    return re.findall(r"^(?:#+(?= )|\|)", CODE.sub("", text), re.MULTILINE)


def links_of(name: str) -> list[str]:
    """The targets of links and pictures as paths from the root, those of Korean pages as of their English ones."""
    places = re.findall(r"\]\(([^)\s]+)\)", CODE.sub("", read(name)))
    paths = [posixpath.normpath(posixpath.join(posixpath.dirname(name), place)) for place in places]
    own = PAGES.get(name, name)
    return sorted({PAGES.get(path, path) for path in paths} - {own})


@of_each_page
def test_code_is_the_same_to_the_letter(korean: str) -> None:
    code = CODE.findall(read(korean))
    assert code == CODE.findall(read(PAGES[korean]))
    assert code


@of_each_page
def test_headings_and_rows_of_tables_stand_in_the_same_order(korean: str) -> None:
    assert shape_of(read(korean)) == shape_of(read(PAGES[korean]))


@of_each_page
def test_links_lead_to_the_same_pages(korean: str) -> None:
    assert links_of(korean) == links_of(PAGES[korean])


@of_each_page
def test_each_paragraph_is_in_korean(korean: str) -> None:
    paragraphs = [part for part in CODE.sub("", read(korean)).split("\n\n") if re.search(r"[a-z]{3}", part)]
    assert [part for part in paragraphs if not HANGUL.search(part) and not part.startswith("#")] == []


@of_each_page
def test_both_pages_lead_to_each_other(korean: str) -> None:
    for name, other in ((korean, PAGES[korean]), (PAGES[korean], korean)):
        assert f"]({posixpath.relpath(other, posixpath.dirname(name) or '.')})" in read(name)
