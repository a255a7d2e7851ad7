"""TypeScript declarations at `/types/PACKAGE.d.ts`, for programs with roslib.js.

They are those of the server's own release and ROS generation. The user's definitions (`--schema-path`) are not served,
because these files need no token. `rosbridge-sim schema typescript` prints them.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from functools import partial
from typing import Final

from rosbridge_sim.schema.store import Store
from rosbridge_sim.schema.typescript import declare_package
from rosbridge_sim.shell.page.made_once import MadeOnce
from rosbridge_sim.shell.page.page_file import PageFile, make_page_file

TYPES_PATH: Final = "/types/"
"""Folder of the files, and the path of the list of all."""

_SUFFIX: Final = ".d.ts"


class TypeFiles:
    """The declarations of one server."""

    def __init__(self, loop: asyncio.AbstractEventLoop, make_store: Callable[[], Store]) -> None:
        """Read nothing yet.

        Args:
            loop: where requests are answered.
            make_store: makes the store of the declared types, in a thread; nobody else may use it.
        """
        self._make_store = make_store
        self._store: MadeOnce[Store] = MadeOnce(loop)
        self._files: MadeOnce[PageFile] = MadeOnce(loop)

    async def read(self, path: str) -> PageFile | None:
        """Return the file of a package, or the list of all files; None if there is none of this name.

        Args:
            path: path of the request, such as `/types/morai_msgs.d.ts`.

        Raises:
            DefinitionError: a definition of the package cannot be read.
            TypeNameError: a definition of the package names a type that does not exist.
        """
        name = path.removeprefix(TYPES_PATH)
        store = await asyncio.shield(self._store.ask("", self._make_store))
        if name and (not name.endswith(_SUFFIX) or name.removesuffix(_SUFFIX) not in store.packages()):
            return None
        return await asyncio.shield(self._files.ask(name, partial(_make, store, name)))


def _make(store: Store, name: str) -> PageFile:
    if not name:
        names = "".join(f"{package}{_SUFFIX}\n" for package in store.packages())
        return make_page_file("text/plain; charset=utf-8", names.encode())
    text = declare_package(store, name.removesuffix(_SUFFIX))
    return make_page_file("application/typescript; charset=utf-8", text.encode())
