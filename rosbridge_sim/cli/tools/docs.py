"""Documentation pages in the package: listed, printed, or opened as a site.

The Markdown pages are part of the wheel, because some users work in closed networks. The built site is not, because it
is ten times as large. In a checkout it can be opened after `mkdocs build`.
"""

from __future__ import annotations

import webbrowser
from pathlib import Path
from typing import Final

from rosbridge_sim.cli.tools.text import note, put, put_json, put_table, show
from rosbridge_sim.errors import DocumentError
from rosbridge_sim.shell.page.doc_files import find_doc_pages, find_docs_folder
from rosbridge_sim.suggestions import hint

SITE: Final = Path(__file__).resolve().parents[3] / "build" / "site" / "index.html"
"""First page of a site that `mkdocs build` has made in a checkout."""


def list_pages(*, is_json: bool) -> None:
    """Print name and title of each page.

    Raises:
        DocumentError: this installation has no pages.
    """
    folder = find_docs_folder()
    pages = find_doc_pages(folder)
    if is_json:
        put_json([{"name": page.name, "title": page.title, "path": str(page.path)} for page in pages])
        return
    put_table(["PAGE", "TITLE"], [[page.name, page.title] for page in pages])
    put(f"\nrosbridge-sim docs PAGE prints one of them. The files are in {folder}")


def show_page(name: str, *, is_json: bool) -> None:
    """Print the source of one page.

    Args:
        name: name of the page. Folder and suffix may be left out if the name is still unique, and of a page in two
            languages it is then the English one.

    Raises:
        DocumentError: no page has that name, or several have.
    """
    pages = find_doc_pages(find_docs_folder())
    wanted = name.strip("/").removesuffix(".md").lower().replace("-", "_")
    found = [page for page in pages if page.name == wanted] or [
        page for page in pages if page.name.rpartition("/")[2] == wanted and not page.name.startswith("ko/")
    ]
    if len(found) > 1:
        names = ", ".join(page.name for page in found)
        raise DocumentError(f"docs: {name}: expected the name of one page; got that of {len(found)}: {names}")
    if not found:
        known = [word for page in pages for word in (page.name, page.name.rpartition("/")[2])]
        raise DocumentError(f"docs: there is no page {name!r}{hint(wanted, known)}; rosbridge-sim docs lists all")
    page = found[0]
    text = page.path.read_text("utf-8")
    show({"name": page.name, "title": page.title, "text": text}, text.rstrip("\n"), is_json=is_json)


def open_site() -> int:
    """Open the built site in a browser.

    Returns:
        The exit code: 1 if there is no site or no browser.
    """
    if not SITE.is_file():
        note("no site is built here. In a checkout: pip install -e '.[docs]' && mkdocs build")
        note("rosbridge-sim docs lists the pages that are in the package")
        return 1
    if not webbrowser.open(SITE.as_uri()):
        note(f"no browser could be started; open {SITE.as_uri()}")
        return 1
    return 0
