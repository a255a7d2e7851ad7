"""The Korean pages say what the English ones say, in the terms of the Korean glossary, and none of them lags behind."""

from __future__ import annotations

import hashlib
import posixpath
import re
from functools import cache

import pytest

from tests.support import ROOT

PAGES = {
    "README.ko.md": ("README.md", "0d8cbc2e84e4"),
    "docs/ko/tutorial.md": ("docs/tutorial.md", "fd53abea78f8"),
    "docs/ko/page.md": ("docs/guides/page.md", "ff73d1138240"),
    "docs/ko/write_scenario.md": ("docs/guides/write_scenario.md", "42377c715bce"),
    "docs/ko/roslibpy.md": ("docs/guides/roslibpy.md", "b980737d1a0f"),
    "docs/ko/synchronous_mode.md": ("docs/reference/synchronous_mode.md", "cbece9e7da5a"),
    "docs/ko/sensors.md": ("docs/reference/sensors.md", "7b0548e24c1a"),
    "docs/ko/teaching.md": ("docs/guides/teaching.md", "428edd7fa52c"),
    "docs/ko/when_nothing_moves.md": ("docs/guides/when_nothing_moves.md", "8efa5cf6737d"),
}
"""Korean page -> English page, and the digest of the English text that the Korean one was last compared with."""

GLOSSARY = "docs/ko/glossary.md"

ENGLISH = {korean: english for korean, (english, _) in PAGES.items()} | {GLOSSARY: "docs/glossary.md"}

MARK = re.compile(r"^<!-- run: \S+ -->\n", re.MULTILINE)

CODE = re.compile(r"^ *```[\s\S]*?^ *```$|(?<=\n\n) {4}\S.*(?:\n {4}.*|\n(?=\n {4}))*", re.MULTILINE)

SPAN = re.compile(r"`([^`]+)`")

NUMBER = re.compile(r"\d+(?:[.,]\d+)*")

TARGET = re.compile(r"\]\([^)\s]*\)")

LABEL = re.compile(r"(?<![*\w])\*([^*\n]{1,24})\*(?!\*)")

HANGUL = re.compile(r"[\uac00-\ud7a3]")

of_each_page = pytest.mark.parametrize("korean", PAGES)


@cache
def read(name: str) -> str:
    return MARK.sub("", (ROOT / name).read_text("utf-8"))


def prose_of(name: str) -> str:
    """A page without its code and the targets of its links."""
    return TARGET.sub("]", SPAN.sub("", CODE.sub("", read(name))))


def digest_of(name: str) -> str:
    """Digest of a page that stays if only lines are broken elsewhere."""
    return hashlib.sha256(" ".join(read(name).split()).encode()).hexdigest()[:12]


def shape_of(text: str) -> list[str]:
    """The levels of the headings, and the first character of each row of a table, in their order."""
    return re.findall(r"^(?:#+(?= )|\|)", CODE.sub("", text), re.MULTILINE)


def facts_of(name: str) -> list[tuple[set[str], set[str]]]:
    """Inline code and figures of each section."""
    sections = re.split(r"^#+ ", CODE.sub("", read(name)), flags=re.MULTILINE)
    return [
        (
            {" ".join(span.split()) for span in SPAN.findall(section)},
            set(NUMBER.findall(TARGET.sub("]", SPAN.sub("", section)))),
        )
        for section in sections
    ]


def links_of(name: str) -> list[str]:
    """The targets of links and pictures as paths from the root, those of Korean pages as of their English ones."""
    places = [place.partition("#")[0] for place in re.findall(r"\]\(([^)\s]+)\)", CODE.sub("", read(name)))]
    paths = [posixpath.normpath(posixpath.join(posixpath.dirname(name), place)) for place in places if place]
    return sorted({ENGLISH.get(path, path) for path in paths} - {ENGLISH.get(name, name)})


def wrong_terms_in(text: str) -> list[str]:
    """Words of a Korean text for which the glossary has another one."""
    forbidden = [word for row in rows_of_glossary() for word in row[2].split(", ") if word]
    assert len(forbidden) > 20
    return [word for word in forbidden if re.search(rf"(?<![A-Za-z가-힣]){re.escape(word)}(?![A-Za-z])", text)]


def rows_of_glossary() -> list[list[str]]:
    """The cells of each row: Korean term, English term, words that no page has."""
    rows = re.findall(r"^\| (.+) \|$", read(GLOSSARY), re.MULTILINE)
    return [[cell.strip() for cell in row.split("|")] for row in rows[1:]]


@of_each_page
def test_korean_page_is_in_step_with_the_english_text(korean: str) -> None:
    english, digest = PAGES[korean]
    now = digest_of(english)
    assert digest == now, f"{english} has changed: bring {korean} in step, and note {now} in PAGES"


@of_each_page
def test_code_is_the_same_to_the_letter(korean: str) -> None:
    code = CODE.findall(read(korean))
    assert code == CODE.findall(read(ENGLISH[korean]))
    assert code


@of_each_page
def test_headings_and_rows_of_tables_stand_in_the_same_order(korean: str) -> None:
    assert shape_of(read(korean)) == shape_of(read(ENGLISH[korean]))


@of_each_page
def test_each_section_has_the_same_inline_code_and_no_figure_less(korean: str) -> None:
    for (spans, figures), (english_spans, english_figures) in zip(
        facts_of(korean), facts_of(ENGLISH[korean]), strict=True
    ):
        assert spans == english_spans
        assert figures >= english_figures


@of_each_page
def test_links_lead_to_the_same_pages(korean: str) -> None:
    assert links_of(korean) == links_of(ENGLISH[korean])


@of_each_page
def test_links_lead_to_the_korean_page_where_there_is_one(korean: str) -> None:
    places = TARGET.findall(CODE.sub("", read(korean)))
    paths = [posixpath.normpath(posixpath.join(posixpath.dirname(korean), re.split(r"[()#]", at)[1])) for at in places]
    translated = set(ENGLISH.values()) - {ENGLISH[korean]}
    assert translated.isdisjoint(paths)


@of_each_page
def test_each_paragraph_is_in_korean(korean: str) -> None:
    paragraphs = [part for part in CODE.sub("", read(korean)).split("\n\n") if re.search(r"[a-z]{3}", part)]
    assert [part for part in paragraphs if not HANGUL.search(part) and not part.startswith("#")] == []


@pytest.mark.parametrize("korean", ENGLISH)
def test_both_pages_lead_to_each_other(korean: str) -> None:
    for name, other in ((korean, ENGLISH[korean]), (ENGLISH[korean], korean)):
        assert f"]({posixpath.relpath(other, posixpath.dirname(name) or '.')})" in read(name)


@of_each_page
def test_each_term_is_the_one_of_the_glossary(korean: str) -> None:
    assert wrong_terms_in(prose_of(korean)) == []


def test_each_term_of_the_web_page_is_the_one_of_the_glossary() -> None:
    texts = (ROOT / "rosbridge_sim/page/js/texts_ko.js").read_text("utf-8")
    assert wrong_terms_in(re.sub(r"^\s*\w+: |\b\w+(?=: [\"{\[(])|\$\{[^}]*\}", "", texts, flags=re.MULTILINE)) == []


def test_labels_of_the_page_are_those_that_it_shows() -> None:
    texts = (ROOT / "rosbridge_sim/page/js/texts_ko.js").read_text("utf-8")
    labels = LABEL.findall(prose_of("docs/ko/page.md"))
    assert len(labels) > 10
    assert [label for label in labels if not re.search(rf'"{re.escape(label)}(?: …)?"', texts)] == []
