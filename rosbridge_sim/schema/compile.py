"""Definitions to functions that are made once: decode a JSON body, check it, fill it, encode it.

Each message type gets a struct class of its own whose fields bear the wire's names, and a decoder that reads JSON
straight into it and refuses what is plainly wrong. That alone does for nearly every body that real clients send (0.5 us
for a CtrlCmd). What the decoder cannot see is done by a small function that is generated for those types alone that
need it: headers without a stamp, float32 rounding, the upper bound of uint64. Whatever is refused on the way gets its
second chance, and its error text, from `check`.

The structs take any trick of `msgspec` but one: nothing is renamed on the wire. Field names that Python cannot have
(`from`, `class`, `__init__`) get another attribute name, never another wire name.
"""

from __future__ import annotations

import json
import keyword
import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property, partial
from types import GenericAlias
from typing import Annotated, Any, ClassVar, Final

import msgspec
import numpy as np
import orjson
import pybase64

from rosbridge_sim.errors import DefinitionError, FieldError
from rosbridge_sim.loose_types import Struct
from rosbridge_sim.schema.cbor import CborWriters, encode_plain
from rosbridge_sim.schema.names import Generation, ros2_names
from rosbridge_sim.schema.parse import Definition, Field
from rosbridge_sim.schema.ros_serialization import RosWire
from rosbridge_sim.schema.skeleton import Skeleton
from rosbridge_sim.schema.validate import Dialect, FieldSpec, Leniency, MessageSpec, check, round32, round32_list
from rosbridge_sim.weight import LIGHT, claim, weigh

__all__ = [
    "ActionType",
    "MessageType",
    "OpaqueActionType",
    "OpaqueServiceType",
    "OpaqueType",
    "ServiceType",
    "compile_message",
]

_After = Callable[[Any, int], None]
"""`(value, stamp_ns)`: finishes a decoded value in place."""

_MAX_UINT64: Final = 2**64 - 1

_NO_LIMIT: Final = 2**63
"""More bytes than any array has."""

_REFUSALS = (msgspec.DecodeError, ValueError, OverflowError, RecursionError)
"""What the fast way may raise; bad UTF-8 is a ValueError."""

_LARGE: Final = 2**20
"""A body from here on may hold a text for which no memory is left [bytes]; below, Python itself has hardly any more."""


class MessageType:
    """A message type: checks, fills and encodes its values. Made by `compile_message`, once for each type.

    Attributes:
        name: `pkg/Type`.
        definition: what it was made from.
        struct: the class of its values; takes the fields by keyword and fills in the defaults.
        shape: the same as the slow rules see it.
    """

    __slots__ = ("_after", "_decode", "_encoders", "_skeleton", "definition", "name", "shape", "struct")

    def __init__(self, shape: MessageSpec, encoders: Encoders) -> None:
        self.name = shape.name
        self.definition = shape.definition
        self.struct = shape.struct
        self.shape = shape
        self._after = shape.finish
        self._skeleton: Skeleton | None = None
        self._encoders = encoders
        self._decode = msgspec.json.Decoder(shape.struct).decode

    def __repr__(self) -> str:
        return f"MessageType({self.name})"

    @property
    def after(self) -> _After | None:
        """What is left to do on a decoded value, `(value, stamp_ns)`; None where nothing is."""
        return self._after

    def decode_json(self, body: bytes | msgspec.Raw, stamp_ns: int) -> Struct:
        """The checked and filled value of a JSON body.

        Args:
            body: the text of one JSON object.
            stamp_ns: the time that headers without a stamp get [ns].

        Raises:
            FieldError: it is no JSON, or does not fit the type.
            MemoryError: there is none for it.
        """
        try:
            if len(body) >= _COUNTED:
                self._count(body)
            value = self._decode(body)
            if self._after is not None:
                self._after(value, stamp_ns)
        except _REFUSALS as refusal:
            return self.check(_parse_json(self.name, body, refusal), stamp_ns)
        return value

    def _count(self, body: bytes | msgspec.Raw) -> None:
        """Refuse a long body that stands for too much, or for which there is no memory."""
        if len(body) > _LARGE:
            claim(len(body))
        if self._skeleton is None:
            self._skeleton = Skeleton(self.shape)
        self._skeleton.check(self.name, body)

    def check(self, value: object, stamp_ns: int, root: str | None = None) -> Struct:
        """The checked and filled value of a body that is there as Python objects; see `check.check`.

        Raises:
            FieldError: it does not fit the type.
        """
        return check(self.shape, value, stamp_ns, root)

    def encode_json(self, value: Struct) -> bytes:
        """The JSON text of a value; NaN and infinity are `null`, bytes are base64, numpy arrays are lists."""
        return _encode(value)

    def encode_cbor(self, value: Struct) -> bytes:
        """The CBOR map of a value: NaN and infinity stay, numeric arrays are typed arrays."""
        return self._encoders.cbor.encode(self.shape, value)

    def encode_raw(self, value: Struct) -> bytes:
        """The bytes that ROS itself sends: ROS 1's, or CDR with its four bytes in front."""
        return self._encoders.ros.serialize(self.shape, value)

    def default(self) -> Struct:
        """A value whose fields all have their defaults."""
        return self.struct()


class Encoders:
    """What the types of one store write with besides JSON; made when somebody first asks.

    Args:
        ros: the generation whose bytes are written.
    """

    def __init__(self, ros: Generation = 1) -> None:
        self._ros_generation = ros
        self.cbor = CborWriters()

    @cached_property
    def ros(self) -> RosWire:
        """The writers of ROS's own bytes."""
        return RosWire(self._ros_generation)


@dataclass(frozen=True, slots=True)
class ServiceType:
    """A service type: two message types, `<name>Request` and `<name>Response`."""

    name: str
    request: MessageType
    response: MessageType


@dataclass(frozen=True, slots=True)
class ActionType:
    """An action type: three message types, `<name>Goal`, `<name>Result` and `<name>Feedback`."""

    name: str
    goal: MessageType
    result: MessageType
    feedback: MessageType


class OpaqueType:
    """A type of a package that nobody knows: any JSON object passes, nothing is checked or filled.

    Attributes:
        name: `pkg/Type`.
        struct: makes a value from fields by keyword, as `MessageType.struct` does.
    """

    __slots__ = ("name",)

    struct: ClassVar[Callable[..., dict[str, Any]]] = dict

    def __init__(self, name: str) -> None:
        self.name = name

    def __repr__(self) -> str:
        return f"OpaqueType({self.name})"

    def decode_json(self, body: bytes | msgspec.Raw, stamp_ns: int) -> dict[str, Any]:
        """The object that the text holds.

        Raises:
            FieldError: it is no JSON object, or nested too deeply to be sent on.
        """
        view = memoryview(body)
        try:
            value = orjson.loads(view)
        except orjson.JSONDecodeError as refusal:
            value = _parse_json(self.name, body, refusal)
        else:
            if isinstance(value, dict) and _is_shallow(bytes(view)):
                return value
        return self.check(value, stamp_ns)

    def check(self, value: object, stamp_ns: int, root: str | None = None) -> dict[str, Any]:  # noqa: ARG002 - as MessageType
        """The object itself.

        Raises:
            FieldError: it is no object, or JSON cannot hold it.
        """
        if not isinstance(value, dict):
            raise FieldError(f"Expected a JSON object for type {root or self.name} but received a {type(value)}")
        try:
            orjson.dumps(value, default=_no_array)  # arrays can always be written, and need not be for this
        except orjson.JSONEncodeError as error:
            raise FieldError(f"{root or self.name}: {error}") from None
        return value

    def encode_json(self, value: Mapping[str, Any]) -> bytes:
        """The JSON text of an object that was accepted."""
        return orjson.dumps(value, option=orjson.OPT_SERIALIZE_NUMPY)

    def encode_cbor(self, value: Mapping[str, Any]) -> bytes:
        """The CBOR map of an object that was accepted; nothing is known of arrays, so none is typed."""
        return encode_plain(value)

    def encode_raw(self, value: Mapping[str, Any]) -> bytes:  # noqa: ARG002 - as MessageType
        """Nobody knows its bytes.

        Raises:
            FieldError: always.
        """
        raise FieldError(f"{self.name} is not known here, so it cannot be sent as cbor-raw")

    def default(self) -> dict[str, Any]:
        """The empty object: nothing is known of any field."""
        return {}


class OpaqueServiceType:
    """A service type of a package that nobody knows: requests and responses are any JSON objects.

    Attributes:
        name: `pkg/Type`.
        request, response: see `ServiceType`.
    """

    __slots__ = ("name", "request", "response")

    def __init__(self, name: str) -> None:
        self.name = name
        self.request = OpaqueType(f"{name}Request")
        self.response = OpaqueType(f"{name}Response")


class OpaqueActionType:
    """An action type of a package that nobody knows: goals, results and feedback are any JSON objects.

    Attributes:
        name: `pkg/Type`.
        goal, result, feedback: see `ActionType`.
    """

    __slots__ = ("feedback", "goal", "name", "result")

    def __init__(self, name: str) -> None:
        self.name = name
        self.goal = OpaqueType(f"{name}Goal")
        self.result = OpaqueType(f"{name}Result")
        self.feedback = OpaqueType(f"{name}Feedback")


_COUNTED = 32 * 1024
"""The elements of a body from here on are counted before it is decoded [bytes]; less costs 20 ms at most."""

_WEIGHED = 4 * 1024
"""A text from here on is weighed before it is read by Python's own decoder [bytes]; less is light in any case."""

_MAX_ORJSON_DEPTH = 250
"""orjson writes 254 levels, but reads 1,024."""


def _is_shallow(body: bytes) -> bool:
    """Whether a text cannot be nested more deeply than orjson writes: brackets in strings are counted too."""
    return body.count(b"{") + body.count(b"[") <= _MAX_ORJSON_DEPTH


def _no_array(value: object) -> None:
    """Pass over a typed array.

    Raises:
        TypeError: it is something else.
    """
    if not isinstance(value, np.ndarray):
        raise TypeError(f"{type(value)} is no JSON")


def _parse_json(name: str, body: bytes | msgspec.Raw, refusal: Exception) -> object:
    """The Python objects of a JSON text, the words NaN and Infinity included.

    Args:
        name: of the type.
        body: the text.
        refusal: what was wrong with it, for an error: a heavy text is not looked at any closer.

    Raises:
        FieldError: it is no JSON, or heavy.
    """
    if len(body) >= _WEIGHED:
        too_much = LIGHT.excess(weigh(memoryview(body)))
        if too_much is not None:
            raise FieldError(
                f"{name}: {refusal}. A message of this size must fit its type as it is: its own field names, numbers of"
                f" the right kind, no NaN; of others {too_much}"
            )
    try:
        # `json` would guess UTF-16 and 32 from bytes: decoded by us, it is UTF-8 or nothing.
        text = bytes(body).decode()
        # A function for each number costs more than all the rest: only where one may be out of range.
        parse_float = _parse_float if _FAR.search(text) is not None else None
        return json.loads(text, parse_float=parse_float)
    except (ValueError, OverflowError) as error:
        raise FieldError(f"{name}: the body is no JSON: {error}") from None
    except RecursionError:
        raise FieldError(f"{name}: the body is nested too deeply") from None


_FAR = re.compile(r"[eE]\+?[0-9]{3}|[0-9]{300}")
"""What a number must hold to be beyond what float64 has."""


def _parse_float(text: str) -> float:
    value = float(text)
    if math.isinf(value):
        # Only the word Infinity means infinity; 1e400 is a mistake.
        raise OverflowError(f"the number {text[:40]} is out of range")
    return value


def _encode_other(value: object) -> object:
    """What `msgspec` does not know: our bytes, and numpy's arrays and scalars, which the world's own code may use."""
    if isinstance(value, _Bytes):
        return msgspec.Raw(b'"' + pybase64.b64encode(value) + b'"')
    if isinstance(value, np.ndarray) and value.dtype == np.uint8:
        return value.tobytes()
    if isinstance(value, (np.ndarray, np.generic)):
        return msgspec.Raw(
            orjson.dumps(np.ascontiguousarray(value) if value.ndim else value, option=orjson.OPT_SERIALIZE_NUMPY)
        )
    raise TypeError(f"{type(value)} is no value of a field")


_encode = msgspec.json.Encoder(enc_hook=_encode_other).encode


# Definition to type


def compile_message(
    definition: Definition,
    nested: Callable[[Field], MessageType],
    dialect: Dialect,
    leniency: Leniency,
    encoders: Encoders,
) -> MessageType:
    """The compiled type of a definition.

    Args:
        definition: what it is made from.
        nested: gives the compiled type of a field's nested message; raises DefinitionError when there is none.
        dialect: the personality.
        leniency: other names and shapes that it accepts.
        encoders: what the types of its store share.

    Raises:
        DefinitionError: a nested type is unknown or contains itself.
    """
    name = definition.name
    slots: dict[str, FieldSpec] = {}
    columns: list[tuple[str, Any, Any]] = []
    afters: dict[str, _After] = {}
    is_header = name == "std_msgs/Header" and any(
        f.name == "stamp" and f.full_type == "time" for f in definition.fields
    )
    for f in definition.fields:
        inner = nested(f) if "/" in f.type else None
        if inner is not None and inner.after is not None:
            afters[f.name] = inner.after
        attribute = _attribute(f.name, definition)
        default = _default(f, inner, definition, dialect)
        slots[f.name] = FieldSpec(
            field=f,
            attribute=attribute,
            make=default if callable(default) else partial(_same, default),
            zero=None if inner is not None else _zero(f.type, dialect),
            shape=None if inner is None else inner.shape,
            is_single=f.array is not None and f.name in leniency.scalars.get(name, ()),
            is_numeral=f.name in leniency.numerals.get(name, ()),
        )
        annotation = _annotation(f, inner, dialect)
        if is_header and f.name == "stamp":
            # `null` passes the fast way, as roslibpy's empty header has it; `after` finds it, and the default.
            annotation, default = annotation | None, dialect.no_stamp
        columns.append(
            (attribute, annotation, msgspec.field(default_factory=default) if callable(default) else default)
        )
    struct = msgspec.defstruct(
        name.rpartition("/")[2],
        columns,
        rename={slot.attribute: wire for wire, slot in slots.items() if slot.attribute != wire},
        forbid_unknown_fields=True,
        gc=False,  # a message is a tree: it never holds itself
        module=__name__,
    )
    aliases = {
        alias: wire for alias, wire in leniency.fields.get(name, {}).items() if wire in slots and alias not in slots
    }
    for other, own in ros2_names([*slots, *aliases]).items():
        aliases.setdefault(other, aliases.get(own, own))
    after = _make_after(name, slots, dialect, is_header=is_header, afters=afters)
    shape = MessageSpec(name, definition, dialect, struct, slots, aliases, is_header, after)
    return MessageType(shape, encoders)


def _same(value: object) -> object:
    return value


def _attribute(name: str, definition: Definition) -> str:
    """The name of a field in Python: its own, unless Python needs that name."""
    if not keyword.iskeyword(name) and not name.startswith("__"):
        return name
    taken = {f.name for f in definition.fields}
    attribute = "f" + name if name.startswith("__") else name + "_"
    while attribute in taken:
        attribute += "_"
    return attribute


def _default(
    f: Field, inner: MessageType | None, definition: Definition, dialect: Dialect
) -> object | Callable[[], object]:
    """A field's default: the value itself when it may be shared, else what makes a new one."""
    count = 0 if f.array is None or f.is_bounded else f.array
    if inner is not None:
        struct = inner.struct
        if f.array is None:
            return struct
        return (lambda: [struct() for _ in range(count)]) if count else list
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


def _annotation(f: Field, inner: MessageType | None, dialect: Dialect) -> Any:  # noqa: ANN401 - a type form
    """The type that `msgspec` shall hold a field to."""
    element: Any
    if inner is not None:
        element = inner.struct
    elif f.type in dialect.ints:
        low, high = dialect.ints[f.type]
        # Bounds beyond int64 are not supported by msgspec 0.22; `after` closes the gap.
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
        # `after` reads the base64, five times as fast as msgspec would, and makes bytes of a list.
        return str | GenericAlias(list, (element,))
    form = GenericAlias(list, (element,))
    if f.array == 0:
        return form
    return _annotate[form, msgspec.Meta(min_length=None if f.is_bounded else f.array, max_length=f.array)]


_annotate: Any = Annotated
"""`Annotated`, with types that are known at run time only."""


# What is left to do after the decoder


def _make_after(
    name: str, slots: Mapping[str, FieldSpec], dialect: Dialect, *, is_header: bool, afters: Mapping[str, _After]
) -> _After | None:
    """The function that does to a decoded value what `msgspec` cannot; None where there is nothing to do.

    It is generated, one line for each field that needs it: a loop over descriptions of the fields would cost more than
    the decoder does. It raises ValueError or OverflowError for what does not fit; `check` then finds the words.
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
    for i, (wire, slot) in enumerate(slots.items()):
        item = f"value.{slot.attribute}"
        is_array = slot.field.array is not None
        if wire in afters:
            names[f"after_{i}"] = afters[wire]
            lines.append(
                f"for item in {item}: after_{i}(item, stamp_ns)" if is_array else f"after_{i}({item}, stamp_ns)"
            )
        elif is_header and wire == "stamp":
            lines.append(f"if {item} is no_stamp or {item} is None: {item} = now(stamp_ns)")
        elif slot.field.is_bytes:
            high = slot.field.array or _NO_LIMIT
            low = 0 if slot.field.is_bounded or not slot.field.array else high
            lines.append(f"if {item}.__class__ is not bytes: {item} = read_bytes({item}, {low}, {high})")
        elif slot.field.type == "float32":
            lines.append(f"if {item}: {item} = round32{'_list' if is_array else ''}({item})")
        elif slot.field.type == "uint64":
            lines.append(f"check_uint64({item})" if is_array else f"if {item} > {_MAX_UINT64}: raise OverflowError")
    if not lines:
        return None
    source = "def after(value, stamp_ns):\n" + "".join(f"    {line}\n" for line in lines)
    # Nothing of a definition gets into the source but names that the parser has matched against [A-Za-z_][A-Za-z0-9_]*.
    exec(compile(source, f"<after {name}>", "exec"), names)  # noqa: S102
    after: _After = names["after"]  # type: ignore[assignment] # made by the line above
    return after


class _Bytes(bytes):
    """Bytes that came from JSON; `msgspec` leaves the writing of a class that it does not know to us."""

    __slots__ = ()


def _read_bytes(given: str | list[int], low: int, high: int) -> _Bytes:
    """The bytes of a base64 text, or of a list of them; there must be so many."""
    value = _Bytes(pybase64.b64decode(given, validate=True) if given.__class__ is str else given)  # type: ignore[arg-type] # the checker does not see it
    if not low <= len(value) <= high:
        raise ValueError
    return value


def _check_uint64(values: list[int]) -> None:
    if values and max(values) > _MAX_UINT64:
        raise OverflowError
