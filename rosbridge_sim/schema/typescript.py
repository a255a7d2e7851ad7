"""TypeScript declarations of a package of message definitions, for programs with roslib.js.

They describe messages as they arrive in JSON. Each package is a namespace, so that names of two packages cannot meet:
`morai_msgs.CtrlCmd`, `std_msgs.Header`. Comments of the definitions, with their units, become comments of the fields.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import groupby
from typing import Final

from rosbridge_sim.schema.definitions.names import Generation
from rosbridge_sim.schema.definitions.parse import Constant, Definition, Field
from rosbridge_sim.schema.store import Store

_TIME_PARTS: Final = {1: ("secs", "nsecs"), 2: ("sec", "nanosec")}
"""Names of the parts of a time by ROS generation."""

_TEXTS: Final = frozenset(["string", "wstring"])

_LONG: Final = frozenset(["int64", "uint64"])


def declare_package(store: Store, package: str) -> str:
    """Return the text of a `.d.ts` file with all messages, services and actions of a package, and all types in them.

    Args:
        store: knows the definitions; its ROS generation decides how a time looks.

    Raises:
        TypeNameError: a definition names a type that does not exist.
        DefinitionError: a definition cannot be read.
    """
    found: dict[str, Definition] = {}
    queue = store.definitions(package)
    while queue:
        definition = queue.pop()
        if definition.name not in found:
            found[definition.name] = definition
            queue += [store.definition(f.type) for f in definition.fields if "/" in f.type]
    parts = sorted(found.values(), key=lambda definition: definition.name)
    lines = [
        f"// Messages of {package} as they arrive in JSON over rosbridge, in the forms of ROS {store.ros}.",
        "// NaN and infinity arrive as null. Fields may be left out of what is sent; they are 0, false or empty then.",
    ]
    for name, group in groupby(parts, key=lambda definition: definition.package):
        lines += ["", f"export namespace {name} {{"]
        for i, definition in enumerate(group):
            lines += [""] if i else []
            lines += [f"  {line}" if line else "" for line in _interface(definition, store.ros)]
        lines.append("}")
    return "\n".join(lines) + "\n"


def _interface(definition: Definition, ros: Generation) -> Iterator[str]:
    comments = _comments(definition)
    head = [comments.get(0, ""), *map(_constant, definition.constants)]
    yield from _note(head)
    yield f"export interface {definition.name.partition('/')[2]} {{"
    for f in definition.fields:
        yield from (f"  {line}" for line in _note([comments.get(f.line, ""), _remark(f)]))
        yield f"  {f.name}: {_type(f, definition.package, ros)};"
    yield "}"


def _comments(definition: Definition) -> dict[int, str]:
    """Return the comment behind each field by the number of its line, and with number 0 that before the first field."""
    lines = [one.line for one in definition.fields] + [one.line for one in definition.constants]
    first = min(lines, default=2**31)
    comments: dict[int, str] = {}
    opening = []
    for number, line in enumerate(definition.text.splitlines(), definition.first_line):
        _, mark, comment = line.partition("#")
        if mark and number < first and line.lstrip().startswith("#"):
            opening.append(comment.strip())
        elif mark:
            comments[number] = comment.strip()
    comments[0] = " ".join(filter(None, opening))
    return comments


def _note(texts: Iterable[str]) -> Iterator[str]:
    """Return a comment with the texts that are not empty, one a line; without such texts nothing."""
    lines = [text.replace("*/", "* /") for text in texts if text]
    if len(lines) == 1:
        yield f"/** {lines[0]} */"
    elif lines:
        yield "/**"
        yield from (f" * {line}" for line in lines)
        yield " */"


def _constant(constant: Constant) -> str:
    return f"{constant.name} = {constant.text}"


def _remark(f: Field) -> str:
    """Return what the type does not say of a field."""
    if f.is_bytes:
        return "bytes: base64; a Uint8Array with compression 'cbor'"
    if f.type in _LONG:
        return "64 bit: rounded beyond 2^53"
    return ""


def _type(f: Field, package: str, ros: Generation) -> str:
    if f.is_bytes:
        return "string"
    if "/" in f.type:
        own, _, name = f.type.partition("/")
        plain = name if own == package else f"{own}.{name}"
    elif f.type in {"time", "duration"}:
        plain = "{ " + "; ".join(f"{part}: number" for part in _TIME_PARTS[ros]) + " }"
    else:
        plain = "string" if f.type in _TEXTS else "boolean" if f.type == "bool" else "number"
    return plain if f.array is None else f"{plain}[]"
