"""Values to the bytes that ROS itself sends: ROS 1's serialization, and CDR as ROS 2 has it.

The writing is rosbags' (and so is the reading, where bags are read): this file only tells it our definitions and
turns our structs into the dataclasses it wants, by a function that is made once for each type. rosbags is imported
at the first use: nobody who speaks JSON alone pays for it.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, Literal

import msgspec
import numpy as np
from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_typestore

from rosbridge_sim.schema.check import Shape, Slot

__all__ = ["RosWire"]

_Convert = Callable[[Any], Any]
"""From what our struct's field holds to what rosbags' dataclass wants."""

_OLD_NAMES = {"byte": "int8", "char": "uint8"}
"""ROS 1's old names; in ROS 2 definitions `byte` is an octet and `char` a uint8, of the same width."""

_NUMPY = {
    "bool": np.bool_,
    "float32": np.float32,
    "float64": np.float64,
} | {f"{sign}int{bits}": getattr(np, f"{sign}int{bits}") for sign in ("", "u") for bits in (8, 16, 32, 64)}


class RosWire:
    """The writers of all types that were asked for; one for each store."""

    def __init__(self, ros: Literal[1, 2]) -> None:
        """No types yet.

        Args:
            ros: the generation whose bytes are written.
        """
        self._typestore = get_typestore(Stores.EMPTY)
        self._serialize = self._typestore.serialize_ros1 if ros == 1 else self._typestore.serialize_cdr
        self._converts: dict[str, _Convert] = {}

    def serialize(self, shape: Shape, value: msgspec.Struct) -> bytes:
        """The bytes of a value; CDR begins with its four bytes of encapsulation."""
        convert = self._converts.get(shape.name) or self._learn(shape)
        return bytes(self._serialize(convert(value), _full(shape.name)))

    def _learn(self, shape: Shape) -> _Convert:
        known = self._converts.get(shape.name)
        if known is not None:
            return known
        columns: list[tuple[str, Any]] = []  # Any: rosbags' nested tuples
        converts: list[tuple[str, _Convert]] = []
        for slot in shape.slots.values():
            if slot.shape is not None:
                self._learn(slot.shape)
            columns.append((slot.field.name, _describe(slot, shape)))
            converts.append((slot.attribute, self._converter(slot, shape)))
        # constants are not on the wire
        self._typestore.register({_full(shape.name): ([], columns)})
        make = self._typestore.types[_full(shape.name)]

        def convert(value: Any) -> Any:  # noqa: ANN401 - a generated struct to a generated dataclass
            return make(*[change(getattr(value, attribute)) for attribute, change in converts])

        self._converts[shape.name] = convert
        return convert

    def _converter(self, slot: Slot, shape: Shape) -> _Convert:
        kind, is_array = slot.field.type, slot.field.array is not None
        if slot.shape is not None:
            convert = self._converts[slot.shape.name]
        elif kind in shape.dialect.times:
            make = self._typestore.types[f"builtin_interfaces/msg/{kind.title()}"]

            def convert(value: msgspec.Struct) -> object:
                return make(*msgspec.structs.astuple(value))

        else:
            if not is_array:
                return _same
            if isinstance(slot.make(), bytes):
                return partial(np.frombuffer, dtype=np.uint8)
            dtype = _NUMPY.get(_OLD_NAMES.get(kind, kind))
            return _same if dtype is None else partial(np.asarray, dtype=dtype)
        return partial(_each, convert) if is_array else convert


def _same(value: Any) -> Any:  # noqa: ANN401 - whatever it is
    return value


def _each(convert: _Convert, values: list[Any]) -> list[Any]:
    return [convert(value) for value in values]


def _full(name: str) -> str:
    package, _, short = name.rpartition("/")
    return f"{package}/msg/{short}"


def _describe(slot: Slot, shape: Shape) -> Any:  # noqa: ANN401 - rosbags' nested tuples
    """A field as rosbags describes it."""
    kind = slot.field.type
    if slot.shape is not None:
        element: Any = (Nodetype.NAME, _full(slot.shape.name))
    elif kind in shape.dialect.times:
        element = (Nodetype.NAME, f"builtin_interfaces/msg/{kind.title()}")
    else:
        element = (Nodetype.BASE, (_OLD_NAMES.get(kind, kind), 0))
    count = slot.field.array
    if count is None:
        return element
    is_fixed = count > 0 and not slot.field.is_bounded
    return (Nodetype.ARRAY, (element, count)) if is_fixed else (Nodetype.SEQUENCE, (element, count))
