"""`schema list` and `show`: the definitions of the package and of the user's folders; no server is needed."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

from rosbridge_sim.cli.tools.text import put, put_json, put_table
from rosbridge_sim.errors import TypeNameError
from rosbridge_sim.link.arguments import PREFIX
from rosbridge_sim.link.bridge_errors import RefusedError
from rosbridge_sim.link.terminal_text import safe
from rosbridge_sim.morai.releases import LENIENCY
from rosbridge_sim.schema.definitions.parse import Definition
from rosbridge_sim.schema.store import Store
from rosbridge_sim.schema.typescript import declare_package
from rosbridge_sim.shell.config.loading import read_settings
from rosbridge_sim.shell.files.definitions import read_definitions
from rosbridge_sim.suggestions import hint

__all__ = ["DefinitionSources", "list_types", "open_store", "show_type", "write_typescript"]

Kind = Literal["msg", "srv", "action"]

KINDS: tuple[Kind, ...] = ("msg", "srv", "action")

_VARIABLES = frozenset(PREFIX + name for name in ("CONFIG", "RELEASE", "ROS", "SCHEMA_PATH"))
"""Environment variables about definitions. Mistakes in others do not matter to this command."""


@dataclass(frozen=True, slots=True)
class DefinitionSources:
    """The choice of definitions; None, or an empty value, uses the environment or the default.

    Attributes:
        release: release of `morai_msgs`.
        ros: ROS generation of the standard messages.
        folders: the user's folders.
    """

    release: str | None = None
    ros: str | None = None
    folders: tuple[str, ...] = ()


def open_store(choice: DefinitionSources) -> Store:
    """Return all types that a server with these settings knows.

    Raises:
        DocumentError: a setting, a folder or a file cannot be used.
    """
    flags = [f"--{name}={value}" for name, value in (("release", choice.release), ("ros", choice.ros)) if value]
    flags += [f"--schema-path={folder}" for folder in choice.folders]
    settings = read_settings(flags, {name: value for name, value in os.environ.items() if name in _VARIABLES})
    return Store(read_definitions(settings.release, settings.schema_path), leniency=LENIENCY, ros=settings.ros)


# list


def list_types(package: str | None, choice: DefinitionSources, *, is_json: bool) -> int:
    """Print all types, or those of one package, sorted by name.

    Args:
        package: name of the package; None means all.

    Raises:
        DocumentError: a setting, a folder or a file cannot be used.
        RefusedError: the package is unknown.
    """
    store = open_store(choice)
    if package is not None:
        _check_package(store, package)
    types = sorted(
        (name, kind)
        for kind in KINDS
        for name in store.names(kind)
        if package is None or name.partition("/")[0] == package
    )
    if is_json:
        put_json([{"type": name, "kind": kind} for name, kind in types])
    else:
        put_table(("TYPE", "KIND"), types)
    return 0


def _check_package(store: Store, package: str) -> None:
    if package not in store.packages():
        raise RefusedError(f"no package {safe(package)} is known{hint(package, store.packages())}")


# typescript


def write_typescript(package: str, choice: DefinitionSources) -> int:
    """Print the TypeScript declarations of a package.

    Raises:
        DocumentError: a setting, a folder or a file cannot be used, or a definition names an unknown type.
        RefusedError: the package is unknown.
    """
    store = open_store(choice)
    _check_package(store, package)
    try:
        put(declare_package(store, package).rstrip("\n"))
    except TypeNameError as error:
        raise RefusedError(str(error)) from None
    return 0


# show


def show_type(name: str, choice: DefinitionSources, *, is_full: bool, is_json: bool) -> int:
    """Print a definition; several if the name has no package or no kind and fits more than one.

    Args:
        name: `pkg/Type`, or `Type` of any package.
        is_full: also print the definitions of all types in it.

    Raises:
        DocumentError: a setting, a folder or a file cannot be used.
        RefusedError: the type is unknown.
    """
    store = open_store(choice)
    found = list(_find(store, name))
    if not found:
        raise RefusedError(_why_not(store, name))
    accounts = [
        {"type": type_name, "kind": kind, "text": _text(store, type_name, kind, is_full=is_full)}
        for type_name, kind in found
    ]
    if is_json:
        put_json(accounts[0] if len(accounts) == 1 else accounts)
        return 0
    for i, account in enumerate(accounts):
        if len(accounts) > 1:
            package, _, short = account["type"].partition("/")
            put(f"{chr(10) if i else ''}[{package}/{account['kind']}/{short}]")
        put(account["text"])
    return 0


_NAME = re.compile(r"(?:(?P<package>\w+)/)?(?:(?P<kind>msg|srv|action)/)?(?P<short>\w+)")


def _find(store: Store, name: str) -> Iterator[tuple[str, Kind]]:
    """Yield type and kind of each definition that a name can mean: `Type`, `pkg/Type`, `pkg/msg/Type`."""
    match = _NAME.fullmatch(name)
    if match is None:
        return
    wanted = store.canonical(name) if match["package"] else ""  # `canonical` knows the other spellings of a type
    for kind in KINDS:
        if match["kind"] in {None, kind}:
            for one in store.names(kind):
                if one == wanted or (not wanted and one.partition("/")[2] == match["short"]):
                    yield one, kind


def _why_not(store: Store, name: str) -> str:
    known = [one for kind in KINDS for one in store.names(kind)]
    if "/" not in name:
        return f"no type {safe(name)} is known{hint(name, [one.partition('/')[2] for one in known])}"
    try:
        canonical = store.canonical(name)
    except TypeNameError as error:
        return safe(str(error))
    return f"no type {safe(name)} is known{hint(canonical, known)}"


def _text(store: Store, name: str, kind: Kind, *, is_full: bool) -> str:
    """Return the source of a definition, with its parts separated by `---`; `is_full` adds those of all types in it."""
    parts = _parts(store, name, kind)
    text = "\n---\n".join(part.text.strip("\n") for part in parts)
    if not is_full:
        return text
    nested: dict[str, Definition] = {}
    for part in parts:
        _collect(store, part, nested)
    border = "=" * 80
    return "\n".join([text, *(f"{border}\nMSG: {one.name}\n{one.text.strip()}" for one in nested.values())])


def _parts(store: Store, name: str, kind: Kind) -> list[Definition]:
    if kind == "msg":
        return [store.message(name).definition]
    if kind == "srv":
        service = store.service(name)
        return [service.request.definition, service.response.definition]
    action = store.action(name)
    return [action.goal.definition, action.result.definition, action.feedback.definition]


def _collect(store: Store, definition: Definition, nested: dict[str, Definition]) -> None:
    """Add each message type inside a definition, once, depth first."""
    for field in definition.fields:
        if "/" in field.type and field.type not in nested:
            inner = nested[field.type] = store.message(field.type).definition
            _collect(store, inner, nested)
