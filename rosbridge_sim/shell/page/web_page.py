"""The web page at `/`: its files with their headers. They are static, hold no secret and need no token.

The modules are joined and all texts compressed at the first request, in a thread, and kept: the files of an installed
package do not change.
"""

from __future__ import annotations

import asyncio
import gzip
import hashlib
import threading
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import Final

from rosbridge_sim.shell.page.joining import join_modules

__all__ = ["PATHS", "PageFile", "WebPage", "page_files", "page_source"]

_FOLDER: Final = files("rosbridge_sim") / "page"

PATHS: Final = {
    "/": ("index.html", "text/html; charset=utf-8"),
    "/page.css": ("page.css", "text/css; charset=utf-8"),
    "/page.js": ("js/main.js", "text/javascript; charset=utf-8"),
    "/icon.svg": ("icon.svg", "image/svg+xml"),
}
"""Source file and content type by path. No other file of the folder is served."""


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
    """The page of one server.

    Attributes:
        headers: rules for the browser, in the answer to each request.
    """

    def __init__(self, loop: asyncio.AbstractEventLoop, frame_ancestors: Sequence[str] = ()) -> None:
        """Read nothing yet.

        Args:
            loop: where requests are answered.
            frame_ancestors: origins whose pages may show this one in a frame.
        """
        self._loop = loop
        self._files: asyncio.Future[Mapping[str, PageFile]] | None = None
        self.headers: Mapping[str, str] = {
            "Content-Security-Policy": f"{_POLICY}; frame-ancestors {' '.join(frame_ancestors) or _NOBODY}",
            "X-Content-Type-Options": "nosniff",
            "Referrer-Policy": "no-referrer",
            "Cross-Origin-Resource-Policy": "same-origin",
            "Cache-Control": "no-cache",  # ask again each time: the next version of the server has another page
        }

    def ask(self) -> asyncio.Future[Mapping[str, PageFile]]:
        """Return all files by path, once they are read; after a failure the next request tries again."""
        files = self._files
        if files is None or (files.done() and (files.cancelled() or files.exception() is not None)):
            files = self._files = self._loop.create_future()
            threading.Thread(target=self._read, args=(files,), name="page", daemon=True).start()
        return files

    def _read(self, future: asyncio.Future[Mapping[str, PageFile]]) -> None:
        """Read all files, in the thread."""
        found: Mapping[str, PageFile] | Exception
        try:
            found = page_files()
        except Exception as error:  # noqa: BLE001 - an internal error: the server logs it
            found = error
        with suppress(RuntimeError):  # the loop is closed
            self._loop.call_soon_threadsafe(_settle, future, found)


def _settle(future: asyncio.Future[Mapping[str, PageFile]], found: Mapping[str, PageFile] | Exception) -> None:
    if future.done():
        return
    if isinstance(found, Exception):
        future.set_exception(found)
    else:
        future.set_result(found)


_NOBODY: Final = "'none'"

_POLICY: Final = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data: blob:; connect-src 'self';"
    " base-uri 'none'; form-action 'none'"
)
"""Places from which the page may load. 'self' of `connect-src` includes the socket of the same host and port."""


@cache
def page_files() -> Mapping[str, PageFile]:
    """Return all files of the page by path.

    Raises:
        JoinError: a module cannot be joined.
    """
    return {path: _make(kind, page_source(name)) for path, (name, kind) in PATHS.items()}


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
