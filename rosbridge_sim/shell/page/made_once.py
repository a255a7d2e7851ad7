"""Values and files that threads make at the first request, one at a time, and that are kept."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import partial
from typing import Generic, TypeAlias, TypeVar

from rosbridge_sim.shell.page.page_file import PageFile

FileTable: TypeAlias = Mapping[str, Callable[[], PageFile]]
"""By path below a folder: makes the file."""

_Value = TypeVar("_Value")


class MadeOnce(Generic[_Value]):
    """Values by name. The caller bounds the number of names; so many values are kept, and so many threads wait."""

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        """Make nothing yet.

        Args:
            loop: where requests are answered.
        """
        self._loop = loop
        self._values: dict[str, asyncio.Future[_Value]] = {}
        self._turn = threading.Lock()  # one thread at work, so that many requests at once do not slow the world down

    def ask(self, name: str, make: Callable[[], _Value]) -> asyncio.Future[_Value]:
        """Return a value, once it is made; after a failure the next request tries again."""
        value = self._values.get(name)
        if value is None or (value.done() and (value.cancelled() or value.exception() is not None)):
            value = self._values[name] = self._loop.create_future()
            threading.Thread(target=self._make, args=(value, make), name="page", daemon=True).start()
        return value

    def _make(self, value: asyncio.Future[_Value], make: Callable[[], _Value]) -> None:
        """Make a value, in the thread."""
        try:
            with self._turn:
                settle = partial(value.set_result, make())
        except Exception as error:  # noqa: BLE001 - an internal error: the server logs it
            settle = partial(value.set_exception, error)
        with suppress(RuntimeError):  # the loop is closed
            self._loop.call_soon_threadsafe(lambda: None if value.done() else settle())


class Folder:
    """Files below a path. Only names of a table are served, and it is made once, too."""

    def __init__(self, loop: asyncio.AbstractEventLoop, path: str, make_table: Callable[[], FileTable]) -> None:
        """Read nothing yet.

        Args:
            loop: where requests are answered.
            path: of the folder, such as `/docs/`.
            make_table: makes the table, in a thread.
        """
        self._path = path
        self._make_table = make_table
        self._table: MadeOnce[FileTable] = MadeOnce(loop)
        self._files: MadeOnce[PageFile] = MadeOnce(loop)

    async def read(self, path: str) -> PageFile | None:
        """Return a file; None if there is none of this name.

        Args:
            path: path of the request, such as `/docs/guides/ci`.

        Raises:
            Exception: the table or the file could not be made; the next request tries again.
        """
        name = path.removeprefix(self._path)
        make = (await asyncio.shield(self._table.ask("", self._make_table))).get(name)
        return None if make is None else await asyncio.shield(self._files.ask(name, make))
