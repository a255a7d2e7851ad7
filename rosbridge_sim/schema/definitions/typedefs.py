"""Descriptions of a type for rosapi: its fields as parallel lists, and its text with those of all types in it.

Tools build their readers from the text (Lichtblick needs it). So the text is always in the grammar of the ROS
generation that is spoken: ROS 1 has no bounds, defaults and wide strings; ROS 2 has no upper case in field names and no
time but that of `builtin_interfaces`. Nested names are written in full.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator

from rosbridge_sim.records import Record
from rosbridge_sim.schema.definitions.message_spec import MessageSpec
from rosbridge_sim.schema.definitions.names import Generation, ros2_names, snake_case
from rosbridge_sim.schema.definitions.parse import TYPE_TOKEN, Constant, Definition, Field

_TIMES = {
    1: {"time": "time", "duration": "duration"},
    2: {"time": "builtin_interfaces/Time", "duration": "builtin_interfaces/Duration"},
}
"""The names in each generation of the two types that are base types in ROS 1 and messages in ROS 2."""

_BORDER = "=" * 80


class TypeDef(Record):
    """One type in the form of rosapi/TypeDef, with parallel lists.

    Attributes:
        type: `pkg/Type`.
        fieldnames, fieldtypes: of each field.
        fieldarraylen: -1 for no array, 0 for any length (bounded or not), else the length.
        examples: default value of each field as text; `[]` for arrays, `{}` for messages.
        constnames, constvalues: of each constant.
    """

    type: str
    fieldnames: list[str]
    fieldtypes: list[str]
    fieldarraylen: list[int]
    examples: list[str]
    constnames: list[str]
    constvalues: list[str]


def typedefs(root: MessageSpec) -> list[TypeDef]:
    """Return a type, then each type in it once, depth first."""
    return list(_typedefs(root, set()))


def _typedefs(spec: MessageSpec, seen: set[str]) -> Iterator[TypeDef]:
    seen.add(spec.name)
    times = _TIMES[spec.dialect.ros]
    fields = [field_spec.definition for field_spec in spec.fields.values()]
    yield TypeDef(
        type=spec.name,
        fieldnames=[f.name for f in fields],
        fieldtypes=[times.get(f.type, f.type) for f in fields],
        fieldarraylen=[-1 if f.array is None else 0 if f.is_bounded else f.array for f in fields],
        examples=[_example(f, field_spec.make) for f, field_spec in zip(fields, spec.fields.values(), strict=True)],
        constnames=[c.name for c in spec.definition.constants],
        constvalues=[str(c.value) for c in spec.definition.constants],
    )
    for f, field_spec in zip(fields, spec.fields.values(), strict=True):
        if field_spec.nested is not None:
            if field_spec.nested.name not in seen:
                yield from _typedefs(field_spec.nested, seen)
        elif f.type in times and times[f.type] not in seen:
            seen.add(times[f.type])
            names = list(spec.dialect.times[f.type].__struct_fields__)
            parts = list(spec.dialect.time_parts[f.type])
            yield TypeDef(times[f.type], names, parts, [-1, -1], ["0", "0"], [], [])


def _example(f: Field, make: Callable[[], object]) -> str:
    if f.array is not None:
        return "[]"
    return "{}" if "/" in f.type or f.type in _TIMES[1] else str(make())


# Texts


def full_text(root: MessageSpec) -> str:
    """Return a type's text, then for each type in it, depth first: 80 equal signs, `MSG: pkg/Type`, its text."""
    parts = dict(_texts(root, root.dialect.ros))
    return "\n".join([parts.pop(root.name), *(f"{_BORDER}\nMSG: {name}\n{text}" for name, text in parts.items())])


def _texts(spec: MessageSpec, ros: Generation) -> Iterator[tuple[str, str]]:
    """Yield name and text of a type and of those in it; some come twice."""
    yield spec.name, _text(spec.definition, ros)
    for field_spec in spec.fields.values():
        if field_spec.nested is not None:
            yield from _texts(field_spec.nested, ros)
        elif ros != 1 and field_spec.definition.type in _TIMES[2]:
            yield _TIMES[2][field_spec.definition.type], "int32 sec\nuint32 nanosec"


def _text(definition: Definition, ros: Generation) -> str:
    """Return a definition's text, with the lines rewritten that the grammar of a generation does not have."""
    lines = definition.text.split("\n")
    names = {name: other for other, name in ros2_names(f.name for f in definition.fields).items()} if ros != 1 else {}
    for f in definition.fields:
        at = f.line - definition.first_line
        lines[at] = _field_line(lines[at], f, names.get(f.name, f.name), ros)
    for constant in definition.constants:
        at = constant.line - definition.first_line
        lines[at] = _constant_line(lines[at], constant, ros)
    return "\n".join(lines).strip()


def _field_line(line: str, f: Field, name: str, ros: Generation) -> str:
    start = len(line) - len(line.lstrip())
    kind = TYPE_TOKEN.match(line, start)
    if kind is None:
        raise AssertionError(f"this line was parsed before: {line}")
    gap = len(line) - len(line[kind.end() :].lstrip())
    tail = line[gap + len(f.name) :]
    if f.default is not None:
        default = _literal(f.default) if ros != 1 else None
        tail = ("" if default is None else f" {default}") + ("" if _is_text(f) else _comment(tail))
    return f"{line[:start]}{_type_text(f, ros)}{line[kind.end() : gap]}{name}{tail}"


def _type_text(f: Field, ros: Generation) -> str:
    base = _TIMES[ros].get(f.type, f.type)
    return ros1_type(f) if ros == 1 else base + f.full_type.removeprefix(f.type)


def ros1_type(f: Field) -> str:
    """Return the type of a field as a text of ROS 1 writes it, with its array suffix."""
    base = "string" if f.type == "wstring" else f.type
    if f.array is None:
        return base
    return f"{base}[]" if f.is_bounded or not f.array else f"{base}[{f.array}]"


def _constant_line(line: str, constant: Constant, ros: Generation) -> str:
    name, value = constant.name, constant.text
    if isinstance(constant.value, float) and not math.isfinite(constant.value):
        return f"# {line.strip()}"  # neither grammar can write it
    if isinstance(constant.value, int) and not isinstance(constant.value, bool):
        value = str(constant.value)
    if ros != 1:
        name = name if name.isupper() else snake_case(name).upper()
        value = _literal(constant.value) or value
    kind = "string" if constant.type == "wstring" and ros == 1 else constant.type
    return f"{kind} {name}={value}" + ("" if isinstance(constant.value, str) else _comment(line))


def _literal(value: object) -> str | None:
    """Return a value as ROS 2 text writes it; None for a value that its grammar cannot write."""
    if isinstance(value, tuple):
        texts = [_literal(item) or "#" for item in value]
        # A reader would take these for an empty list or for a comment.
        return f"[{', '.join(texts)}]" if texts and "#" not in "".join(texts) else None
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return json.dumps(value, ensure_ascii=False)  # JSON has the same quotes, booleans and numbers


def _is_text(f: Field) -> bool:
    return f.type in {"string", "wstring"}


def _comment(text: str) -> str:
    _, sign, comment = text.partition("#")
    return f"  #{comment}" if sign else ""
