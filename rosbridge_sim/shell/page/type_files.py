"""TypeScript declarations at `/types/PACKAGE.d.ts`, for programs with roslib.js.

They are those of the server's own release and ROS generation. The user's definitions (`--schema-path`) are not served,
because these files need no token. `rosbridge-sim schema typescript` prints them.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Final

from rosbridge_sim.schema.store import Store
from rosbridge_sim.schema.typescript import declare_package
from rosbridge_sim.shell.page.made_once import FileTable
from rosbridge_sim.shell.page.page_file import PageFile, make_page_file

TYPES_PATH: Final = "/types/"
"""Folder of the files, and the path of the list of all."""


def make_type_table(make_store: Callable[[], Store]) -> FileTable:
    """Return the list of all files, and the file of each package.

    Args:
        make_store: makes the store of the declared types; nobody else may use it.
    """
    store = make_store()
    files = {f"{package}.d.ts": partial(_declare, store, package) for package in store.packages()}
    names = "".join(f"{name}\n" for name in files)
    return {"": partial(make_page_file, "text/plain; charset=utf-8", names.encode()), **files}


def _declare(store: Store, package: str) -> PageFile:
    """Return the file of a package.

    Raises:
        DefinitionError: a definition of the package cannot be read.
        TypeNameError: a definition of the package names a type that does not exist.
    """
    return make_page_file("application/typescript; charset=utf-8", declare_package(store, package).encode())
