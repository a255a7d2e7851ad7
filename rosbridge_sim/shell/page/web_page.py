"""The web page at `/`: its files with their headers. They are static, hold no secret and need no token.

The modules are joined and all texts compressed in a thread, at the first request or before (`prepare`), and kept: the
files of an installed package do not change.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Mapping, Sequence
from functools import cache, partial
from importlib.resources import files
from typing import Final

from rosbridge_sim.schema.store import Store
from rosbridge_sim.shell.page.doc_site import DOCS_PATH, make_doc_table
from rosbridge_sim.shell.page.made_once import Folder, MadeOnce
from rosbridge_sim.shell.page.page_file import PageFile, make_page_file
from rosbridge_sim.shell.page.type_files import TYPES_PATH, make_type_table

_FOLDER: Final = files("rosbridge_sim") / "page"

PATHS: Final = {
    "/": ("index.html", "text/html; charset=utf-8"),
    "/page.css": ("page.css", "text/css; charset=utf-8"),
    "/docs.css": ("docs.css", "text/css; charset=utf-8"),
    "/page.js": ("js/main.js", "text/javascript; charset=utf-8"),
    "/texts_ko.js": ("js/texts_ko.js", "text/javascript; charset=utf-8"),
    "/icon.svg": ("icon.svg", "image/svg+xml"),
}
"""Source file and content type by path. No other file of the folder is served."""


class WebPage:
    """The page of one server.

    Attributes:
        folders: what is served beside it, by the path of its folder: the documentation, and declarations of messages.
        headers: rules for the browser, in the answer to each request.
    """

    def __init__(
        self, loop: asyncio.AbstractEventLoop, make_store: Callable[[], Store], frame_ancestors: Sequence[str] = ()
    ) -> None:
        """Read nothing yet.

        Args:
            loop: where requests are answered.
            make_store: makes the store of the declared types, in a thread; nobody else may use it.
            frame_ancestors: origins whose pages may show this one in a frame.
        """
        self.folders = {
            DOCS_PATH: Folder(loop, DOCS_PATH, make_doc_table),
            TYPES_PATH: Folder(loop, TYPES_PATH, partial(make_type_table, make_store)),
        }
        self._files: MadeOnce[Mapping[str, PageFile]] = MadeOnce(loop)
        self.headers: Mapping[str, str] = {
            "Content-Security-Policy": f"{_POLICY}; frame-ancestors {' '.join(frame_ancestors) or _NOBODY}",
            "X-Content-Type-Options": "nosniff",
            "Referrer-Policy": "no-referrer",
            "Cross-Origin-Resource-Policy": "same-origin",
            "Cache-Control": "no-cache",  # ask again each time: the next version of the server has another page
        }

    def folder_of(self, path: str) -> str | None:
        """Return the folder of `folders` that a path lies in; None if it lies in none of them."""
        return next((folder for folder in self.folders if path.startswith(folder)), None)

    def ask(self) -> asyncio.Future[Mapping[str, PageFile]]:
        """Return all files by path, once they are read; after a failure the next request tries again."""
        return self._files.ask("", page_files)

    async def prepare(self) -> None:
        """Wait until all files are read, or reading has failed; the first request tells of the failure."""
        asked = self.ask()
        await asyncio.wait([asked])
        asked.exception()  # so that the loop does not report it


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
    return {path: make_page_file(kind, page_source(name)) for path, (name, kind) in PATHS.items()}


def page_source(name: str) -> bytes:
    """Return the bytes of a file of the page; for the main module, with all that it imports.

    Args:
        name: path in the page's folder.

    Raises:
        JoinError: a module cannot be joined.
    """
    if name == PATHS["/page.js"][0]:
        from rosbridge_sim.shell.page.module_joining import join_modules  # noqa: PLC0415 - for the first reader of the page

        return join_modules(name, lambda path: (_FOLDER / path).read_text(encoding="utf-8")).encode()
    return (_FOLDER / name).read_bytes()
