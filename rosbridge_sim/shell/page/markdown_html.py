"""Markdown of the documentation as HTML: headings with anchors, links between the pages, no HTML of the text itself.

HTML in a text is shown as it is written. Nothing has a `style` attribute, because the page's policy forbids them. Links
to files that the server does not have are plain text.
"""

from __future__ import annotations

import posixpath
import re
from collections.abc import Iterable
from html import escape
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from markdown_it.token import Token

_API_BLOCK: Final = re.compile(r"^::: ([\w.]+)\n(?:    .*\n?)*", re.MULTILINE)
"""A place where the built site has the documentation of a Python name."""

_API_TEXT: Final = r"`python -m pydoc \1` prints `\1`.\n\n"

_MARK: Final = re.compile(r"^<!-- run: [\w-]+ -->\n", re.MULTILINE)
"""A mark for the tests, which run the example below it."""


def render_markdown(text: str, name: str, pages: frozenset[str], images: frozenset[str]) -> str:
    """Return a page as HTML, without the frame around it.

    Args:
        name: its path below the folder of the pages, without suffix.
        images: paths of all pictures below the folder of the pages.
    """
    from markdown_it import MarkdownIt  # noqa: PLC0415 - at the first page alone: the server needs it for nothing else
    from markdown_it.token import Token  # noqa: PLC0415 - the same

    def raw(html: str) -> Token:
        return Token("html_block", "", 0, content=html)

    markdown = MarkdownIt("commonmark", {"html": False}).enable("table")
    links = _Links(posixpath.dirname(name), pages, images)
    anchors = _Anchors()
    tokens: list[Token] = []
    heading: Token | None = None
    for token in markdown.parse(_MARK.sub("", _API_BLOCK.sub(_API_TEXT, text))):
        _set_classes(token)
        if token.type == "heading_open":
            heading = token
        elif token.type == "inline":
            token.children = links.follow(token.children or [])
            if heading is not None:
                heading.attrSet("id", anchors.make(_text_of(token.children)))
        elif token.type == "heading_close" and heading is not None:
            tokens.append(raw(f'<a class="anchor" href="#{heading.attrGet("id")}" aria-label="Link to this">#</a>'))
            heading = None
        elif token.type == "table_open":
            tokens.append(raw('<div class="table">'))  # scrolls if the table is wider than the page
        tokens.append(token)
        if token.type == "table_close":
            tokens.append(raw("</div>"))
    return str(markdown.renderer.render(tokens, markdown.options, {}))


def _set_classes(token: Token) -> None:
    """Replace the style of a table's cell by a class: `text-align:right` by `right`."""
    style = token.attrs.pop("style", None)
    if style is not None:
        token.attrSet("class", str(style).rpartition(":")[2])


def _text_of(tokens: Iterable[Token]) -> str:
    return "".join(token.content for token in tokens if token.type in {"text", "code_inline"})


class _Anchors:
    """Anchors of one page, each of them once."""

    def __init__(self) -> None:
        self._counts: dict[str, int] = {}

    def make(self, heading: str) -> str:
        """Return the anchor of a heading, as most renderers form it; a repeated one gets a number."""
        anchor = re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-")
        count = self._counts[anchor] = self._counts.get(anchor, -1) + 1
        return escape(f"{anchor}-{count}" if count else anchor)


class _Links:
    """Links and pictures of one page.

    Attributes:
        folder: folder of the page below that of all pages.
        pages: names of all pages.
        images: paths of all pictures.
    """

    def __init__(self, folder: str, pages: frozenset[str], images: frozenset[str]) -> None:
        self.folder = folder
        self.pages = pages
        self.images = images

    def follow(self, tokens: Iterable[Token]) -> list[Token]:
        """Return the parts of a paragraph with links as the server has them, and without those that lead nowhere."""
        kept: list[Token] = []
        is_open: list[bool] = []
        for token in tokens:
            if token.type == "link_open":
                target = self._page(str(token.attrGet("href") or ""))
                is_open.append(target is not None)
                if target is None:
                    continue
                token.attrSet("href", target)
            elif token.type == "link_close" and not is_open.pop():
                continue
            elif token.type == "image" and not self._is_image(str(token.attrGet("src") or "")):
                token.type, token.tag = "text", ""
            kept.append(token)
        return kept

    def _page(self, href: str) -> str | None:
        """Return a link's target; None for a file that the server does not have."""
        if href.startswith(("#", "https://", "http://")):
            return href
        path, sign, anchor = href.partition("#")
        stem, dot, suffix = path.rpartition(".")
        if dot and suffix == "md" and self._resolve(stem) in self.pages:
            return f"{stem}{sign}{anchor}"
        return href if self._is_image(path) else None

    def _is_image(self, src: str) -> bool:
        return self._resolve(src) in self.images

    def _resolve(self, path: str) -> str:
        return posixpath.normpath(posixpath.join(self.folder, path))
