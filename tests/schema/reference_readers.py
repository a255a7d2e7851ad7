"""Simple and slow reference readers of the compiled encoders' output, as Python objects.

`plain` reads a struct, `read_cbor` a CBOR item by cbor2, `Rosbags` the bytes of either ROS by rosbags. A float32 is
what four bytes leave of it, since ROS's bytes have no more.
"""

from __future__ import annotations

import base64
import math
from typing import Any

import cbor2
import msgspec
import numpy as np
from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_typestore

from rosbridge_sim.loose_types import Struct
from rosbridge_sim.schema.definitions.message_spec import FieldSpec, MessageSpec
from rosbridge_sim.schema.definitions.names import Generation

__all__ = ["ARRAY_TAGS", "Rosbags", "alike", "as_json", "plain", "read_cbor"]

ARRAY_TAGS = {
    "uint16": 69, "uint32": 70, "uint64": 71, "int8": 72, "int16": 77, "int32": 78, "int64": 79,
    "float32": 85, "float64": 86,
}  # fmt: skip
"""The tags of the RFC that roslib reads, by element type."""

_NUMPY = {64: "u1", 69: "<u2", 70: "<u4", 71: "<u8", 72: "i1", 77: "<i2", 78: "<i4", 79: "<i8", 85: "<f4", 86: "<f8"}


def plain(spec: MessageSpec, value: Struct) -> dict[str, Any]:
    """A value as Python objects: lists, dicts, numbers, text, bytes."""
    return {
        name: _plain(field_spec, getattr(value, field_spec.attribute), spec) for name, field_spec in spec.fields.items()
    }


def _plain(field_spec: FieldSpec, value: Any, spec: MessageSpec) -> Any:  # noqa: ANN401 - any value
    if isinstance(value, bytes):
        return value
    if field_spec.definition.array is not None:
        return [_element(field_spec, item, spec) for item in value]
    return _element(field_spec, value, spec)


def _element(field_spec: FieldSpec, value: Any, spec: MessageSpec) -> Any:  # noqa: ANN401 - any value
    if field_spec.nested is not None:
        return plain(field_spec.nested, value)
    return msgspec.structs.asdict(value) if field_spec.definition.type in spec.dialect.times else value


def as_json(value: Any, *, has_words: bool = False) -> Any:  # noqa: ANN401 - any value
    """What is left of Python objects in JSON; NaN and infinity stay if it has words for them."""
    if isinstance(value, dict):
        return {key: as_json(item, has_words=has_words) for key, item in value.items()}
    if isinstance(value, list):
        return [as_json(item, has_words=has_words) for item in value]
    if isinstance(value, bytes):
        return base64.b64encode(value).decode()
    return None if isinstance(value, float) and not math.isfinite(value) and not has_words else value


def read_cbor(data: bytes) -> Any:  # noqa: ANN401 - any value
    """The Python objects of one CBOR item; typed arrays are lists."""
    return cbor2.loads(data, tag_hook=lambda tag, *_: np.frombuffer(tag.value, _NUMPY[tag.tag]).tolist())


def alike(a: Any, b: Any) -> bool:  # noqa: ANN401 - any value
    """Whether Python objects are the same; floats may also be the same float32, and NaN is NaN."""
    if isinstance(a, dict) and isinstance(b, dict):
        return list(a) == list(b) and all(alike(item, b[key]) for key, item in a.items())
    if isinstance(a, list) and isinstance(b, list):
        return len(a) == len(b) and all(map(alike, a, b))
    if isinstance(a, float) and isinstance(b, float):
        return repr(a) == repr(b) or repr(np.float32(a)) == repr(np.float32(b))
    return type(a) is type(b) and bool(a == b)


class Rosbags:
    """What rosbags reads from the bytes of a generation."""

    def __init__(self, ros: Generation) -> None:
        self._ros = ros
        self._types = get_typestore(Stores.EMPTY)
        for kind, parts in (("Time", ("uint32", "uint32")), ("Duration", ("int32", "int32"))):
            columns: Any = [
                (name, (Nodetype.BASE, (part, 0))) for name, part in zip(("secs", "nsecs"), parts, strict=True)
            ]
            self._types.register({f"ros1/msg/{kind}": ([], columns)})

    def read(self, spec: MessageSpec, data: bytes) -> dict[str, Any]:
        """The value as Python objects."""
        name = self._learn(spec)
        read = self._types.deserialize_ros1 if self._ros == 1 else self._types.deserialize_cdr
        return self._plain(read(data, name), spec)

    def _learn(self, spec: MessageSpec) -> str:
        name = spec.name.replace("/", "/msg/")
        if name not in self._types.types:
            columns = [(field_spec.attribute, self._describe(field_spec)) for field_spec in spec.fields.values()]
            if not columns and self._ros != 1:
                columns = [("structure_needs_at_least_one_member", (Nodetype.BASE, ("uint8", 0)))]
            self._types.register({name: ([], columns)})
        return name

    def _describe(self, field_spec: FieldSpec) -> Any:  # noqa: ANN401 - rosbags' nested tuples
        kind = field_spec.definition.type
        package = "ros1" if self._ros == 1 else "builtin_interfaces"
        old = {"byte": "int8" if self._ros == 1 else "uint8", "char": "uint8", "wstring": "string"}
        element: Any = (Nodetype.BASE, (old.get(kind, kind), 0))
        if field_spec.nested is not None:
            element = (Nodetype.NAME, self._learn(field_spec.nested))
        elif kind in {"time", "duration"}:
            element = (Nodetype.NAME, f"{package}/msg/{kind.title()}")
        count = field_spec.definition.array
        if count is None:
            return element
        return (
            Nodetype.ARRAY if count and not field_spec.definition.is_bounded else Nodetype.SEQUENCE,
            (element, count),
        )

    def _plain(self, value: Any, spec: MessageSpec) -> dict[str, Any]:  # noqa: ANN401 - a dataclass of rosbags'
        return {
            name: self._field(getattr(value, field_spec.attribute), field_spec, spec)
            for name, field_spec in spec.fields.items()
        }

    def _field(self, value: Any, field_spec: FieldSpec, spec: MessageSpec) -> Any:  # noqa: ANN401 - any value
        if field_spec.definition.is_bytes:
            return bytes(value)
        if isinstance(value, np.ndarray):
            return value.tolist()
        if field_spec.definition.array is not None:
            return [self._element(item, field_spec, spec) for item in value]
        return self._element(value, field_spec, spec)

    def _element(self, value: Any, field_spec: FieldSpec, spec: MessageSpec) -> Any:  # noqa: ANN401 - any value
        if field_spec.nested is not None:
            return self._plain(value, field_spec.nested)
        kind = field_spec.definition.type
        if kind in spec.dialect.times:
            names = spec.dialect.times[kind].__struct_fields__
            theirs = ("secs", "nsecs") if self._ros == 1 else ("sec", "nanosec")
            return {name: getattr(value, their) for name, their in zip(names, theirs, strict=True)}
        return value
