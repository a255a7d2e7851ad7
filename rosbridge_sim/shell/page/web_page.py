"""The web page at `/`: its files with their headers. They are static, hold no secret and need no token.

The modules are joined and all texts compressed at the first request, and kept: the files of an installed package do not
change.
"""

from __future__ import annotations

import gzip
import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import Final

from rosbridge_sim.shell.page.joining import join_modules

__all__ = ["PageFile", "WebPage", "page_files", "page_source"]

_FOLDER: Final = files("rosbridge_sim") / "page"

_KINDS: Final = {
    "/": ("text/html; charset=utf-8", "index.html"),
    "/page.css": ("text/css; charset=utf-8", "page.css"),
    "/page.js": ("text/javascript; charset=utf-8", "js/main.js"),
    "/icon.svg": ("image/svg+xml", "icon.svg"),
}
"""Content type and file of each path."""


@dataclass(frozen=True, slots=True)
class PageFile:
    """A file of the page.

    Attributes:
        kind: its content type.
        body: its bytes.
        gzipped: the same, compressed.
        etag: stands for the body, with its quotes.
    """

    kind: str
    body: bytes
    gzipped: bytes
    etag: str


class WebPage:
    """The page with the rules for its browser."""

    def __init__(self, frame_ancestors: Sequence[str] = ()) -> None:
        """Read nothing yet.

        Args:
            frame_ancestors: origins whose pages may show this one in a frame.
        """
        ancestors = " ".join(frame_ancestors) or "'none'"
        self.headers: Mapping[str, str] = {
            "Content-Security-Policy": f"{_POLICY}; frame-ancestors {ancestors}",
            "X-Content-Type-Options": "nosniff",
            "Referrer-Policy": "no-referrer",
            "Cross-Origin-Opener-Policy": "same-origin",
            "Cross-Origin-Resource-Policy": "same-origin",
            "Cache-Control": "no-cache",  # ask again each time: the next version of the server has another page
        }

    def find(self, path: str) -> PageFile | None:
        """Return the file at a path; None if there is none.

        Args:
            path: path of the request, such as `/page.css`.
        """
        return page_files().get(path or "/")


_POLICY: Final = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data: blob:; connect-src 'self';"
    " base-uri 'none'; form-action 'none'"
)
"""What the page may load. 'self' of `connect-src` includes the socket of the same host and port."""


@cache
def page_files() -> Mapping[str, PageFile]:
    """Return all files of the page by path."""
    return {path: _make(kind, page_source(name)) for path, (kind, name) in _KINDS.items()}


def page_source(name: str) -> bytes:
    """Return the bytes of a file of the page; for a module, with all that it imports.

    Args:
        name: path in the page's folder.

    Raises:
        JoinError: a module cannot be joined.
    """
    if name.endswith(".js"):
        return join_modules(name, lambda path: (_FOLDER / path).read_text(encoding="utf-8")).encode()
    return (_FOLDER / name).read_bytes()


def _make(kind: str, body: bytes) -> PageFile:
    etag = f'"{hashlib.sha256(body).hexdigest()[:32]}"'
    return PageFile(kind, body, gzip.compress(body, mtime=0), etag)
