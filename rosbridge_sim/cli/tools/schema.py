"""`schema` and `interface`: the definitions of the package and of the user's folders; no server is needed."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

from rosbridge_sim.cli.tools.text import put, put_json, put_names, put_table, render
from rosbridge_sim.errors import TypeNameError
from rosbridge_sim.link.arguments import PREFIX
from rosbridge_sim.link.bridge_errors import RefusedError
from rosbridge_sim.link.terminal_text import safe
from rosbridge_sim.morai.releases import LENIENCY
from rosbridge_sim.printable import printable
from rosbridge_sim.schema.definitions.parse import Definition
from rosbridge_sim.schema.store import Store
from rosbridge_sim.schema.typescript import declare_package
from rosbridge_sim.shell.config.loading import read_settings
from rosbridge_sim.shell.config.settings import Settings
from rosbridge_sim.shell.files.definitions import SCHEMAS, Texts, read_definitions
from rosbridge_sim.suggestions import hint

Kind = Literal["msg", "srv", "action"]

KINDS: tuple[Kind, ...] = ("msg", "srv", "action")

SUFFIX = ".schema.json"

_VARIABLES = frozenset(PREFIX + name for name in ("CONFIG", "RELEASE", "ROS", "SCHEMA_PATH"))
"""Environment variables about definitions. Mistakes in others do not matter to this command."""


@dataclass(frozen=True, slots=True)
class DefinitionSources:
    """The sources of definitions; None, or an empty value, uses the environment or the default.

    Attributes:
        release: release of `morai_msgs`.
        ros: ROS generation of the standard messages.
        folders: the user's folders.
    """

    release: str | None = None
    ros: str | None = None
    folders: tuple[str, ...] = ()


def show_file_schema(name: str) -> int:
    """Print the JSON Schema (draft 2020-12) of a kind of files.

    Raises:
        RefusedError: there is no such kind.
    """
    files = {path.name.removesuffix(SUFFIX): path for path in sorted(SCHEMAS.glob(f"*{SUFFIX}"))}
    if name not in files:
        raise RefusedError(f"expected one of {', '.join(files)}, got {printable(safe(name), 60)!r}{hint(name, files)}")
    put(files[name].read_text("utf-8").rstrip())
    return 0


def open_store(sources: DefinitionSources) -> Store:
    """Return all types that a server with these settings knows.

    Raises:
        DocumentError: a setting, a folder or a file cannot be used.
    """
    settings = _settings_of(sources)
    return Store(read_definitions(settings.release, settings.schema_path), leniency=LENIENCY, ros=settings.ros)


def read_texts(sources: DefinitionSources) -> Texts:
    """Return the definitions of these types, for readers of bags; see `open_store` for errors."""
    settings = _settings_of(sources)
    return read_definitions(settings.release, settings.schema_path)


def _settings_of(sources: DefinitionSources) -> Settings:
    flags = [f"--{name}={value}" for name, value in (("release", sources.release), ("ros", sources.ros)) if value]
    flags += [f"--schema-path={folder}" for folder in sources.folders]
    return read_settings(flags, {name: value for name, value in os.environ.items() if name in _VARIABLES})


# list


def list_types(package: str | None, sources: DefinitionSources, *, is_json: bool) -> None:
    """Print all types, or those of one package, sorted by name.

    Args:
        package: name of the package; None means all.

    Raises:
        DocumentError: a setting, a folder or a file cannot be used.
        RefusedError: the package is unknown.
    """
    store = open_store(sources)
    types = sorted((name, kind) for kind in KINDS for name in _names(store, kind, package))
    if is_json:
        put_json([{"type": name, "kind": kind} for name, kind in types])
    else:
        put_table(("TYPE", "KIND"), types)


def _check_package(store: Store, package: str) -> None:
    if package not in store.packages():
        raise RefusedError(f"no package {safe(package)} is known{hint(package, store.packages())}")


def _names(store: Store, kind: Kind, package: str | None) -> list[str]:
    """Return all types of a kind, or those of a package, which must be known."""
    if package is not None:
        _check_package(store, package)
    return [name for name in store.names(kind) if package in {None, name.partition("/")[0]}]


# typescript


def write_typescript(package: str, sources: DefinitionSources) -> None:
    """Print the TypeScript declarations of a package.

    Raises:
        DocumentError: a setting, a folder or a file cannot be used, or a definition names an unknown type.
        RefusedError: the package is unknown.
    """
    store = open_store(sources)
    _check_package(store, package)
    try:
        put(declare_package(store, package).rstrip("\n"))
    except TypeNameError as error:
        raise RefusedError(str(error)) from None


# show


def show_type(name: str, sources: DefinitionSources, *, is_full: bool, is_json: bool) -> None:
    """Print a definition; several if the name has no package or no kind and fits more than one.

    Args:
        name: `pkg/Type`, or `Type` of any package.
        is_full: also print the definitions of all types in it.

    Raises:
        DocumentError: a setting, a folder or a file cannot be used.
        RefusedError: the type is unknown.
    """
    store = open_store(sources)
    found = list(_find(store, name))
    if not found:
        raise RefusedError(_why_not(store, name))
    accounts = [
        {"type": type_name, "kind": kind, "text": _text(store, type_name, kind, is_full=is_full)}
        for type_name, kind in found
    ]
    if is_json:
        put_json(accounts[0] if len(accounts) == 1 else accounts)
        return
    for i, account in enumerate(accounts):
        if len(accounts) > 1:
            package, _, short = account["type"].partition("/")
            put(f"{chr(10) if i else ''}[{package}/{account['kind']}/{short}]")
        put(account["text"])


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


# interface


def list_interfaces(
    command: str, package: str | None, kinds: Sequence[Kind] | None, sources: DefinitionSources
) -> None:
    """Print types or packages in the form of `ros2 interface`, with the names of the ROS generation.

    Args:
        command: `list` prints types below titles, `package` the types of a package, `packages` their packages.
        package: name of the package; None means all.
        kinds: only types of these kinds; None means all.

    Raises:
        DocumentError: a setting, a folder or a file cannot be used.
        RefusedError: the package is unknown.
    """
    store = open_store(sources)
    types = {kind: [store.spelled(name, kind) for name in _names(store, kind, package)] for kind in kinds or KINDS}
    if command != "list":
        names = [name for found in types.values() for name in found]
        put_names(names if command == "package" else sorted({name.partition("/")[0] for name in names}))
        return
    for kind, found in types.items():
        put_names([_TITLES[kind], *(f"    {name}" for name in found)])


_TITLES: dict[Kind, str] = {"msg": "Messages:", "srv": "Services:", "action": "Actions:"}


def _find_one(store: Store, name: str) -> tuple[str, Kind]:
    """Return type and kind of the first definition that a name can mean.

    Raises:
        RefusedError: the type is unknown.
    """
    found = next(_find(store, name), None)
    if found is None:
        raise RefusedError(_why_not(store, name))
    return found


def show_interface(name: str, sources: DefinitionSources) -> None:
    """Print a definition, and below each field of another message the fields of that, behind tabs.

    Raises:
        DocumentError: a setting, a folder or a file cannot be used.
        RefusedError: the type is unknown.
    """
    store = open_store(sources)
    for i, part in enumerate(_parts(store, *_find_one(store, name))):
        lines = part.text.split("\n")
        for field in sorted(part.fields, key=lambda one: -one.line):
            lines[field.line : field.line] = _nested(store, field.type, "\t")
        put("---\n" * (i > 0) + "\n".join(lines).strip("\n"))


def _nested(store: Store, name: str, pad: str) -> list[str]:
    """Return the lines of the fields of a message; none for a type that is no message."""
    fields = store.message(name).definition.fields if "/" in name else ()
    return [line for f in fields for line in (f"{pad}{f.full_type} {f.name}", *_nested(store, f.type, f"{pad}\t"))]


def show_prototype(name: str, sources: DefinitionSources) -> None:
    """Print a message with its default values, in quotes for `topic pub`, as `ros2 interface proto` does.

    Raises:
        DocumentError: a setting, a folder or a file cannot be used.
        RefusedError: the type is unknown.
    """
    store = open_store(sources)
    found, kind = _find_one(store, name)
    if kind == "msg":
        part = store.message(found)
    else:
        part = store.service(found).request if kind == "srv" else store.action(found).goal
    put(f'"{render(json.loads(part.encode_json(part.default())))}\n"')
