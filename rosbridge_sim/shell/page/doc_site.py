"""The documentation at `/docs/`: the pages and pictures of the package, read by a browser without any other host.

A page is made at its first request, in a thread, and kept: the files of an installed package do not change. Once all
have been read, they take 2.6 MB of memory and have taken 0.7 s of CPU time.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import partial
from itertools import groupby
from pathlib import Path
from typing import Final

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.shell.page.doc_files import DocPage, find_doc_pages, find_docs_folder
from rosbridge_sim.shell.page.made_once import FileTable
from rosbridge_sim.shell.page.page_file import PageFile, make_page_file

DOCS_PATH: Final = "/docs/"
"""Path of the list of all pages; the page `guides/ci` is at `/docs/guides/ci`."""

_HTML: Final = "text/html; charset=utf-8"

_IMAGES: Final = {".svg": "image/svg+xml", ".png": "image/png", ".jpg": "image/jpeg", ".webp": "image/webp"}
"""Content types of pictures by suffix. Other files of the folder are not served."""

_GROUPS: Final = {"": "Pages", "guides": "Guides", "reference": "Reference", "decisions": "Decisions", "ko": "한국어"}
"""Headings of the list by folder, in their order."""


def make_doc_table() -> FileTable:
    """Return all that is served; nothing in an installation without pages."""
    try:
        folder = find_docs_folder()
    except DocumentError:
        return {}
    pages = find_doc_pages(folder)
    images = {
        path.relative_to(folder).as_posix(): path for path in sorted(folder.glob("images/*")) if path.suffix in _IMAGES
    }
    names = frozenset(page.name for page in pages)
    table: dict[str, Callable[[], PageFile]] = {"": partial(_make_list, pages)}
    table |= {page.name: partial(_make_page, page, names, frozenset(images)) for page in pages}
    return table | {name: partial(_make_image, path) for name, path in images.items()}


def _make_image(path: Path) -> PageFile:
    return make_page_file(_IMAGES[path.suffix], path.read_bytes())


def _make_page(page: DocPage, pages: frozenset[str], images: frozenset[str]) -> PageFile:
    from rosbridge_sim.shell.page.markdown_html import render_markdown  # noqa: PLC0415 - for the first reader of a page

    body = render_markdown(page.path.read_text("utf-8"), page.name, pages, images)
    language = "ko" if page.name.startswith("ko/") else "en"
    return _frame(page.title, "../" * (page.name.count("/") + 1), body, language)


def _make_list(pages: Iterable[DocPage]) -> PageFile:
    """Make the list of all pages."""
    order = list(_GROUPS)
    found = sorted(pages, key=lambda page: (order.index(_group_of(page)), page.name != "index"))
    parts = ["<h1>Documentation</h1>"]
    for folder, group in groupby(found, key=_group_of):
        items = [f'<li><a href="{_html_of(page.name)}">{_html_of(_plain(page.title))}</a></li>' for page in group]
        parts += [f"<h2>{_GROUPS[folder]}</h2>", "<ul>", *items, "</ul>"]
    return _frame("Documentation", "../", "\n".join(parts))


def _group_of(page: DocPage) -> str:
    folder = page.name.rpartition("/")[0]
    return folder if folder in _GROUPS else ""


def _plain(title: str) -> str:
    return title.replace("`", "")


def _html_of(text: str) -> str:
    from html import escape  # noqa: PLC0415 - its table of 2,000 names is for the first reader of a page

    return escape(text)


def _frame(title: str, root: str, body: str, language: str = "en") -> PageFile:
    """Return a whole HTML document.

    Args:
        root: the server's first page, relative to this one: a proxy may put all of them below a folder.
        body: HTML of the page.
    """
    html = f"""<!doctype html>
<html lang="{language}">
<head>
<meta charset="utf-8">
<title>{_html_of(_plain(title))} - rosbridge-sim</title>
<meta name="viewport" content="width=device-width, initial-scale=1, viewport-fit=cover">
<meta name="color-scheme" content="light dark">
<link rel="icon" href="{root}icon.svg" type="image/svg+xml">
<link rel="stylesheet" href="{root}page.css">
<link rel="stylesheet" href="{root}docs.css">
</head>
<body class="docs">
<a class="skip" href="#text">Skip to the text</a>
<nav class="docs-nav" aria-label="Documentation">
<a href="{root}docs/">All pages</a>
<a href="{root}">Simulator</a>
</nav>
<main id="text" class="docs-text">
{body}
</main>
</body>
</html>
"""
    return make_page_file(_HTML, html.encode())
