"""Files of the documentation: inside the wheel, or beside the package in a checkout."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.records import Record

_PACKAGE: Final = Path(__file__).resolve().parents[2]

FOLDERS: Final = (_PACKAGE / "docs", _PACKAGE.parent / "docs")
"""Folders of the pages: inside the wheel, or beside the package in a checkout."""


class DocPage(Record):
    """One page.

    Attributes:
        name: path below the folder of the pages, without suffix, such as `guides/ci`.
        title: its first heading.
        path: path of its file.
    """

    name: str
    title: str
    path: Path


def find_docs_folder() -> Path:
    """Return the folder of the pages.

    Raises:
        DocumentError: this installation has no pages.
    """
    folder = next((one for one in FOLDERS if (one / "index.md").is_file()), None)
    if folder is None:
        raise DocumentError(f"docs: expected pages in {FOLDERS[0]}; there are none: install the package again")
    return folder


def find_doc_pages(folder: Path) -> list[DocPage]:
    """Return all pages, sorted by name.

    Args:
        folder: from `find_docs_folder`.
    """
    pages = []
    for path in sorted(folder.rglob("*.md")):
        with path.open(encoding="utf-8") as file:
            title = file.readline().strip().lstrip("# ")
        pages.append(DocPage(path.relative_to(folder).with_suffix("").as_posix(), title, path))
    return pages
