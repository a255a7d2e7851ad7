"""`docs`: the pages of the documentation that are in the package."""

from __future__ import annotations

import webbrowser
from pathlib import Path

import pytest

from rosbridge_sim.cli.tools import docs
from rosbridge_sim.shell.page import doc_files
from tests.cli.tool_fixture import run
from tests.support import ROOT


def test_list_names_every_page_with_its_title() -> None:
    done = run("docs")
    assert (done.code, done.err) == (0, "")
    assert any(line.split() == ["guides/ci", "CI"] for line in done.lines)
    pages = run("docs", "--json").json
    assert {page["path"] for page in pages} == {str(path) for path in (ROOT / "docs").rglob("*.md")}


@pytest.mark.parametrize("name", ["guides/when_nothing_moves", "when_nothing_moves", "When-Nothing-Moves.md"])
def test_page_is_printed_under_any_of_its_names(name: str) -> None:
    done = run("docs", name)
    assert (done.code, done.err) == (0, "")
    assert done.out == (ROOT / "docs" / "guides" / "when_nothing_moves.md").read_text("utf-8")


def test_page_is_one_json_value_for_programs() -> None:
    page = run("docs", "tutorial", "--json").json
    assert (page["name"], page["title"]) == ("tutorial", "Tutorial")
    assert page["text"].startswith("# Tutorial")


@pytest.mark.parametrize(
    ("words", "why"),
    [
        (("tutrial",), "there is no page 'tutrial' (did you mean tutorial?)"),
        (("../README",), "there is no page '../README'"),
        (("",), "there is no page ''"),
        (("sync_table",), "expected the name of one page; got that of 2: decisions/sync_table, reference/sync_table"),
        (("tutorial", "--open"), "--open opens the whole site"),
    ],
)
def test_page_that_cannot_be_shown_is_one_line(words: tuple[str, ...], why: str) -> None:
    done = run("docs", *words)
    assert (done.code, done.out) == (2, "")
    assert why in done.complaint


def test_installation_without_pages_is_one_line(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(doc_files, "FOLDERS", (tmp_path,))
    done = run("docs")
    assert (done.code, done.out) == (2, "")
    assert "install the package again" in done.complaint


def test_site_is_opened_where_it_is_built(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    opened: list[str] = []
    page = tmp_path / "index.html"
    monkeypatch.setattr(docs, "SITE", page)

    def note_url(url: str) -> bool:
        opened.append(url)
        return True

    monkeypatch.setattr(webbrowser, "open", note_url)
    done = run("docs", "--open")
    assert (done.code, opened) == (1, [])
    assert "mkdocs build" in done.err
    page.write_text("<p>built</p>")
    assert run("docs", "--open").code == 0
    assert opened == [page.as_uri()]
