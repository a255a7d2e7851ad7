#!/usr/bin/env python3
"""Check the built documentation: no page loads anything from another host, and its search finds the names of the field.

    mkdocs build --strict && python scripts/check_site.py [build/site]

Users work in closed networks, so a page must be complete without the internet. The script checks everything that a
browser loads by itself: scripts, styles, pictures, fonts, frames and media of HTML, `url(...)` and `@import` of CSS.
A link for a person to click may lead anywhere. With exit code 1 each load is listed.

Addresses within scripts are not checked. The theme's script has some, for features that `mkdocs.yml` leaves off
(mermaid, figures of a repository). A browser's network log showed that none of them is called.

The search splits pages and queries at the separator of its index. A word that keeps a `/` is found by no shorter name.
So each name of `NAMES` must be a word of the page where readers look for it.
"""

from __future__ import annotations

import argparse
import json
import re
import sys
from collections.abc import Iterator, Mapping
from html import unescape
from html.parser import HTMLParser
from pathlib import Path
from typing import Final

LOADING: Final[dict[str, tuple[str, ...]]] = {
    "audio": ("src",),
    "embed": ("src",),
    "iframe": ("src",),
    "image": ("href", "xlink:href"),
    "img": ("src", "srcset"),
    "input": ("src",),
    "link": ("href",),
    "object": ("data",),
    "script": ("src",),
    "source": ("src", "srcset"),
    "track": ("src",),
    "use": ("href", "xlink:href"),
    "video": ("src", "poster"),
}
"""Element -> attributes whose address a browser loads by itself."""

LAZY_LINKS: Final = frozenset({"alternate", "author", "canonical", "help", "license", "next", "prev", "search"})
"""Values of `rel` for a `<link>` that a browser does not load."""

ELSEWHERE: Final = re.compile(r"(?:https?:|wss?:)?//", re.IGNORECASE)
"""The beginning of an address on another host."""

TAG: Final = re.compile(r"<[^>]*>")

CSS_ADDRESS: Final = re.compile(r"(?:url\(\s*|@import\s+)['\"]?((?:https?:)?//[^'\")\s;]+)", re.IGNORECASE)


NAMES: Final = {
    "ctrl_cmd": "reference/topics_services.html",
    "Ego_topic": "reference/topics_services.html",
    "SyncModeWaitForTick": "reference/synchronous_mode.html",
    "traffic": "reference/flags.html",
    "snapshot": "guides/snapshots.html",
}
"""Name that a reader types into the search -> page that must be among the results."""


class _Loads(HTMLParser):
    """Collector of the addresses of other hosts that a page loads."""

    def __init__(self) -> None:
        super().__init__()
        self.found: list[str] = []
        self._is_style = False

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Check one element; `HTMLParser` calls this.

        Args:
            tag: the element's name.
            attrs: its attributes.
        """
        values = {name: value or "" for name, value in attrs}
        self._is_style = tag == "style"
        self.found += find_loads_in_css(values.get("style", ""))
        if tag == "link" and LAZY_LINKS.issuperset(values.get("rel", "").lower().split() or ["stylesheet"]):
            return
        for name in LOADING.get(tag, ()):
            parts = values.get(name, "").split(",") if name == "srcset" else [values.get(name, "")]
            self.found += [part.strip() for part in parts if ELSEWHERE.match(part.strip())]

    def handle_endtag(self, tag: str) -> None:
        """Note the end of a style; `HTMLParser` calls this.

        Args:
            tag: the element's name.
        """
        self._is_style = self._is_style and tag != "style"

    def handle_data(self, data: str) -> None:
        """Check the text of a style; `HTMLParser` calls this.

        Args:
            data: the text.
        """
        if self._is_style:
            self.found += find_loads_in_css(data)


def find_loads_in_html(text: str) -> list[str]:
    """Return the addresses of other hosts that a page makes a browser load.

    Args:
        text: HTML or SVG.

    Returns:
        The addresses, in the page's order.
    """
    parser = _Loads()
    parser.feed(text)
    parser.close()
    return parser.found


def find_loads_in_css(text: str) -> list[str]:
    """Return the addresses of other hosts that a style sheet makes a browser load.

    Args:
        text: CSS.

    Returns:
        The addresses, in order.
    """
    return CSS_ADDRESS.findall(text)


def find_loads(site: Path) -> Iterator[str]:
    """Find the loads from other hosts in all pages, styles and pictures of a folder.

    Args:
        site: the folder.

    Yields:
        A line for each.
    """
    readers = {".html": find_loads_in_html, ".svg": find_loads_in_html, ".css": find_loads_in_css}
    for path in sorted(site.rglob("*")):
        if path.suffix in readers:
            for address in readers[path.suffix](path.read_text("utf-8")):
                yield f"{path.relative_to(site)}: loads {address}"


def find_lost_names(site: Path, names: Mapping[str, str] = NAMES) -> Iterator[str]:
    """Find the names that the search does not find on their page.

    Args:
        site: the folder.
        names: name -> page that must have it as a word of its own.

    Yields:
        A line for each.
    """
    index = json.loads((site / "search" / "search_index.json").read_bytes())
    separator = re.compile(index["config"]["separator"])
    words: dict[str, set[str]] = {}
    for part in index["docs"]:
        text = unescape(TAG.sub(" ", f"{part['title']} {part['text']}"))
        words.setdefault(part["location"].partition("#")[0], set()).update(separator.split(text.lower()))
    for name, page in names.items():
        if name.lower() not in words.get(page, ()):
            yield f"search: expected {page} among the results of {name!r}, got none there"


def main() -> int:
    """Run the command."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("site", nargs="?", type=Path, default=Path("build/site"), help="folder of the built site")
    site = parser.parse_args().site
    if not (site / "index.html").is_file():
        print(f"check_site: {site}: expected a built site; run mkdocs build first", file=sys.stderr)
        return 2
    faults = [*find_loads(site), *find_lost_names(site)]
    for line in faults:
        print(line, file=sys.stderr)
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
