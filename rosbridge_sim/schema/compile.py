"""Compile definitions into message types: a struct class, its defaults, and a function that completes its values.

Each message type gets its own `msgspec` struct class, whose fields have the wire's names. The decoder reads JSON
straight into it and refuses what is plainly wrong. That is enough for nearly every body that real clients send (0.5 us
for a CtrlCmd). A small function, generated only for types that need it, does what the decoder cannot: it stamps
headers without a stamp, rounds float32, and checks the upper bound of uint64. A body that is refused here goes to
`complete_check.check`, which accepts more and writes the error texts.

Nothing is renamed on the wire. Field names that Python does not allow (`from`, `class`, `__init__`) get another
attribute name, but keep their wire name.
"""

from __future__ import annotations

import keyword
from collections.abc import Callable, Mapping
from functools import partial
from types import GenericAlias
from typing import Annotated, Any, Final

import msgspec
import pybase64

from rosbridge_sim.errors import DefinitionError
from rosbridge_sim.schema.definitions.dialect import Dialect, Leniency
from rosbridge_sim.schema.definitions.message_spec import FieldSpec, MessageSpec
from rosbridge_sim.schema.definitions.names import ros2_names
from rosbridge_sim.schema.definitions.parse import Definition, Field
from rosbridge_sim.schema.float32 import round32, round32_list
from rosbridge_sim.schema.message_type import Finalize, JsonBytes

_MAX_UINT64: Final = 2**64 - 1

_NO_LENGTH_LIMIT: Final = 2**63
"""A length beyond that of any array."""


def compile_message(
    definition: Definition, nested: Callable[[Field], MessageSpec], dialect: Dialect, leniency: Leniency
) -> MessageSpec:
    """Return the fields of a definition as tables, with the struct class of its values.

    Args:
        nested: returns those of a field's nested message; raises DefinitionError when there is none.
        dialect: of the ROS generation.
        leniency: other names and forms to accept.

    Raises:
        DefinitionError: a nested type is unknown or contains itself.
    """
    name = definition.name
    fields: dict[str, FieldSpec] = {}
    columns: list[tuple[str, Any, Any]] = []
    finalizers: dict[str, Finalize] = {}
    is_header = name == "std_msgs/Header" and any(
        f.name == "stamp" and f.full_type == "time" for f in definition.fields
    )
    for f in definition.fields:
        inner = nested(f) if "/" in f.type else None
        if inner is not None and inner.finalize is not None:
            finalizers[f.name] = inner.finalize
        attribute = _attribute(f.name, definition)
        default = _default(f, inner, definition, dialect)
        fields[f.name] = FieldSpec(
            definition=f,
            attribute=attribute,
            make=default if callable(default) else partial(_same, default),
            zero=None if inner is not None else _zero(f.type, dialect),
            nested=inner,
            is_single=f.array is not None and f.name in leniency.scalars.get(name, ()),
            is_numeral=f.name in leniency.numerals.get(name, ()),
        )
        annotation = _annotation(f, inner, dialect)
        if is_header and f.name == "stamp":
            # The decoder accepts `null`, which roslibpy's empty header has; `finalize` replaces it, and the default.
            annotation, default = annotation | None, dialect.no_stamp
        columns.append(
            (attribute, annotation, msgspec.field(default_factory=default) if callable(default) else default)
        )
    struct_type = msgspec.defstruct(
        name.rpartition("/")[2],
        columns,
        rename={field_spec.attribute: wire for wire, field_spec in fields.items() if field_spec.attribute != wire},
        forbid_unknown_fields=True,
        gc=False,  # a message is a tree: it never holds itself
        module=__name__,
    )
    aliases = {
        alias: wire for alias, wire in leniency.fields.get(name, {}).items() if wire in fields and alias not in fields
    }
    for other, own in ros2_names([*fields, *aliases]).items():
        aliases.setdefault(other, aliases.get(own, own))
    finalize = _make_finalize(name, fields, dialect, is_header=is_header, finalizers=finalizers)
    has_floats = any(each.has_floats for each in fields.values())
    elsewhere = leniency.elsewhere.get(name, {})
    return MessageSpec(
        name, definition, dialect, struct_type, fields, aliases, is_header, has_floats, finalize, elsewhere
    )


def _same(value: object) -> object:
    """Return the argument; it makes defaults that may be shared."""
    return value


def _attribute(name: str, definition: Definition) -> str:
    """Return the name of a field in Python: its wire name, unless Python reserves that."""
    if not keyword.iskeyword(name) and not name.startswith("__"):
        return name
    taken = {f.name for f in definition.fields}
    attribute = "f" + name if name.startswith("__") else name + "_"
    while attribute in taken:
        attribute += "_"
    return attribute


def _default(
    f: Field, inner: MessageSpec | None, definition: Definition, dialect: Dialect
) -> object | Callable[[], object]:
    """Return a field's default: the value itself if it may be shared, else a function that makes a new one."""
    count = f.count
    if inner is not None:
        struct_type = inner.struct_type
        if f.array is None:
            return struct_type
        return (lambda: [struct_type() for _ in range(count)]) if count else list
    if f.default is None:
        zero = _zero(f.type, dialect)
        if f.is_bytes:
            return bytes(count)
        return zero if f.array is None else ([zero] * count).copy
    values: list[Any] = list(f.default) if isinstance(f.default, tuple) else [f.default]
    if f.type == "float32":
        values = [round32(value) for value in values]
    elif f.type in dialect.ints:
        low, high = dialect.ints[f.type]
        if not low <= min(values, default=0) <= max(values, default=0) <= high:
            raise DefinitionError(
                definition.source, f.line, 1, f"the default of {f.name} is out of the range of {f.type}"
            )
    if f.is_bytes:
        return bytes(values)
    return values.copy if isinstance(f.default, tuple) else values[0]


def _zero(kind: str, dialect: Dialect) -> object:
    if kind in dialect.times:
        return dialect.times[kind]()
    return {"string": "", "wstring": "", "bool": False, "float32": 0.0, "float64": 0.0}.get(kind, 0)


def _annotation(f: Field, inner: MessageSpec | None, dialect: Dialect) -> Any:  # noqa: ANN401 - a type form
    """Return the type by which `msgspec` checks a field."""
    element: Any
    if inner is not None:
        element = inner.struct_type
    elif f.type in dialect.ints:
        low, high = dialect.ints[f.type]
        # msgspec (0.22) does not support bounds beyond int64; `finalize` checks the rest.
        element = _annotate[int, msgspec.Meta(ge=low, le=high) if high < 2**63 else msgspec.Meta(ge=low)]
    elif f.type in dialect.times:
        element = dialect.times[f.type]
    elif f.type in {"string", "wstring"}:
        element = str if f.max_chars is None else _annotate[str, msgspec.Meta(max_length=f.max_chars)]
    else:
        element = bool if f.type == "bool" else float
    if f.array is None:
        return element
    if f.is_bytes:
        # `finalize` reads the base64, five times as fast as msgspec does, and makes bytes of a list.
        return str | GenericAlias(list, (element,))
    form = GenericAlias(list, (element,))
    if f.array == 0:
        return form
    return _annotate[form, msgspec.Meta(min_length=None if f.is_bounded else f.array, max_length=f.array)]


_annotate: Any = Annotated
"""`Annotated`, for types that are known only at run time."""


def _make_finalize(
    name: str, fields: Mapping[str, FieldSpec], dialect: Dialect, *, is_header: bool, finalizers: Mapping[str, Finalize]
) -> Finalize | None:
    """Return the function that does to a decoded value what `msgspec` cannot; None where nothing is left to do.

    It is generated, with one line for each field that needs it: a loop over field specs would cost more than the
    decoder itself. It raises ValueError or OverflowError for a value that does not fit; `check` then writes the text.
    """
    names: dict[str, object] = {
        "no_stamp": dialect.no_stamp,
        "now": dialect.time,
        "round32": round32,
        "round32_list": round32_list,
        "check_uint64": _check_uint64,
        "read_bytes": _read_bytes,
    }
    lines = []
    for i, (wire, field_spec) in enumerate(fields.items()):
        item = f"value.{field_spec.attribute}"
        is_array = field_spec.definition.array is not None
        if wire in finalizers:
            names[f"finalize_{i}"] = finalizers[wire]
            lines.append(
                f"for item in {item}: finalize_{i}(item, stamp_ns)" if is_array else f"finalize_{i}({item}, stamp_ns)"
            )
        elif is_header and wire == "stamp":
            lines.append(f"if {item} is no_stamp or {item} is None: {item} = now(stamp_ns)")
        elif field_spec.definition.is_bytes:
            high = field_spec.definition.array or _NO_LENGTH_LIMIT
            low = field_spec.definition.count
            lines.append(f"if {item}.__class__ is not bytes: {item} = read_bytes({item}, {low}, {high})")
        elif field_spec.definition.type == "float32":
            lines.append(f"if {item}: {item} = round32{'_list' if is_array else ''}({item})")
        elif field_spec.definition.type == "uint64":
            lines.append(f"check_uint64({item})" if is_array else f"if {item} > {_MAX_UINT64}: raise OverflowError")
    if not lines:
        return None
    source = "def finalize(value, stamp_ns):\n" + "".join(f"    {line}\n" for line in lines)
    # Of a definition only field names get into the source. The parser has matched them with [A-Za-z_][A-Za-z0-9_]*.
    exec(compile(source, f"<finalize {name}>", "exec"), names)  # noqa: S102
    finalize: Finalize = names["finalize"]  # type: ignore[assignment] # made by the line above
    return finalize


def _read_bytes(given: str | list[int], low: int, high: int) -> JsonBytes:
    """Return the bytes of a base64 text or of a list.

    Raises:
        ValueError: it is no base64, or there are fewer than `low` or more than `high` bytes.
    """
    value = JsonBytes(pybase64.b64decode(given, validate=True) if given.__class__ is str else given)  # type: ignore[arg-type] # the checker does not see it
    if not low <= len(value) <= high:
        raise ValueError
    return value


def _check_uint64(values: list[int]) -> None:
    """Raise OverflowError if a number is beyond uint64."""
    if values and max(values) > _MAX_UINT64:
        raise OverflowError
