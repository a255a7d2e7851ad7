"""The documentation at `/docs/`: every page of the package, and nothing else."""

from __future__ import annotations

import posixpath
import re
from collections.abc import Iterator
from html import unescape
from pathlib import Path
from urllib.parse import unquote

import pytest

from rosbridge_sim import Simulator
from rosbridge_sim.shell.page import doc_files
from rosbridge_sim.shell.page.doc_site import make_doc_table
from scripts.check_site import find_loads_in_html
from tests.shell.page.test_web_page import BROWSER, TOKEN, get
from tests.support import ROOT

DOCS = ROOT / "docs"

PLACE = re.compile(r'(?:href|src)="([^"]*)"')


@pytest.fixture(scope="module")
def sim() -> Iterator[Simulator]:
    """A server whose pages are read alone."""
    with Simulator(port=0, world=False) as sim:
        yield sim


async def test_page_is_html_with_the_policy_of_the_page(sim: Simulator) -> None:
    answer = await get(sim, "/docs/guides/ci", "Host: any.example")
    assert (answer.status, answer.headers["Content-Type"]) == (200, "text/html; charset=utf-8")
    assert b"<title>CI - rosbridge-sim</title>" in answer.body
    page = await get(sim, "/", BROWSER)
    for name in ("Content-Security-Policy", "X-Content-Type-Options", "Referrer-Policy", "Cache-Control"):
        assert answer.headers[name] == page.headers[name]
    etag = answer.headers["ETag"]
    assert (await get(sim, "/docs/guides/ci", f"If-None-Match: {etag}")).status == 304
    assert (await get(sim, "/docs/guides/ci", method="POST")).status == 405


async def test_list_has_all_pages_and_stands_at_both_spellings(sim: Simulator) -> None:
    moved = await get(sim, "/docs")
    assert (moved.status, moved.headers["Location"]) == (308, "docs/")
    names = {path.relative_to(DOCS).with_suffix("").as_posix() for path in DOCS.rglob("*.md")}
    links = re.findall(r'<li><a href="([^"]*)">', (await get(sim, "/docs/")).body.decode())
    assert sorted(links) == sorted(names)


async def test_pictures_are_served_with_their_type(sim: Simulator) -> None:
    for name, kind in (
        ("drive.svg", "image/svg+xml"),
        ("town.png", "image/png"),
        ("camera_town.jpg", "image/jpeg"),
        ("drive.webp", "image/webp"),
    ):
        answer = await get(sim, f"/docs/images/{name}")
        assert (answer.status, answer.headers["Content-Type"]) == (200, kind)
        assert answer.body == (DOCS / "images" / name).read_bytes()


@pytest.mark.parametrize(
    "path",
    [
        "nothing",
        "guides/ci.md",
        "guides",
        "site.css",
        "../README",
        "guides/../guides/ci",
        "..%2f..%2fpyproject.toml",
        "%67uides/ci",
        "/etc/passwd",
        "images/",
        "images/../index",
    ],
)
async def test_other_names_are_not_found_and_the_answer_names_the_list(sim: Simulator, path: str) -> None:
    answer = await get(sim, f"/docs/{path}")
    assert answer.status == 404
    assert b"/docs/ lists all" in answer.body


async def test_pages_need_no_token() -> None:
    async with Simulator(port=0, token=TOKEN) as sim:
        for path in ("/docs/", "/docs/tutorial", "/docs/images/town.png"):
            assert (await get(sim, path)).status == 200


async def test_installation_without_pages_has_no_site(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(doc_files, "FOLDERS", (tmp_path,))
    async with Simulator(port=0, world=False) as sim:
        assert (await get(sim, "/docs/")).status == 404
        assert sim.num_bugs == 0


@pytest.mark.slow
def test_every_page_loads_from_the_server_alone_and_each_link_has_a_target() -> None:
    table = make_doc_table()
    pages = {name: make().body.decode() for name, make in table.items() if not name.startswith("images/")}
    assert len(pages) == len(list(DOCS.rglob("*.md"))) + 1
    for name, html in pages.items():
        assert "style=" not in html, name
        assert "<script" not in html, name
        assert not list(find_loads_in_html(html)), name
        for place in map(unescape, PLACE.findall(html)):
            if place.startswith("https://"):
                continue
            path, _, anchor = place.partition("#")
            target = posixpath.normpath(posixpath.join("/docs", posixpath.dirname(name), path)) if path else ""
            if target in {"/", "/docs", "/icon.svg", "/page.css", "/docs.css"}:
                continue
            there = target.removeprefix("/docs/") if path else name
            assert there in table, (name, place)
            assert not anchor or f'id="{unquote(anchor)}"' in pages[there], (name, place)
