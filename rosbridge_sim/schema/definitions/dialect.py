"""Differences between the two ROS generations, and other names and forms that a store accepts."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated

import msgspec

from rosbridge_sim.records import Record, field
from rosbridge_sim.schema.definitions.names import Generation
from rosbridge_sim.schema.definitions.parse import INT_RANGES

_UInt32 = Annotated[int, msgspec.Meta(ge=0, le=2**32 - 1)]

_Int32 = Annotated[int, msgspec.Meta(ge=-(2**31), le=2**31 - 1)]


class Time(msgspec.Struct, frozen=True, forbid_unknown_fields=True, gc=False):
    """A point in time in the form of ROS 1 [s, ns]."""

    secs: _UInt32 = 0
    nsecs: _UInt32 = 0


class Duration(msgspec.Struct, frozen=True, forbid_unknown_fields=True, gc=False):
    """A span of time in the form of ROS 1 [s, ns]."""

    secs: _Int32 = 0
    nsecs: _Int32 = 0


class Time2(msgspec.Struct, frozen=True, forbid_unknown_fields=True, gc=False):
    """A point in time or a span of time, in the form of ROS 2 [s, ns]."""

    sec: _Int32 = 0
    nanosec: _UInt32 = 0


class Dialect(Record):
    """Types and ranges that differ between the two ROS generations.

    Attributes:
        ros: the generation.
        times: the structs of `time` and `duration`; their two fields have the names that go out.
        time_parts: the integer types of their two fields.
        ints: least and greatest value of each integer type, `byte` and `char` included.
        no_stamp: the default of a header's stamp, recognized by identity, until the present time replaces it.
    """

    ros: Generation
    times: Mapping[str, type[msgspec.Struct]]
    time_parts: Mapping[str, tuple[str, str]]
    ints: Mapping[str, tuple[int, int]]
    no_stamp: msgspec.Struct

    def time(self, stamp_ns: int) -> msgspec.Struct:
        """Return the value of a `time` field at a time [ns]."""
        return self.times["time"](*divmod(stamp_ns, 1_000_000_000))


ROS1 = Dialect(
    ros=1,
    times={"time": Time, "duration": Duration},
    time_parts={"time": ("uint32", "uint32"), "duration": ("int32", "int32")},
    # In ROS 1 `byte` is an old name of int8 and `char` of uint8.
    ints={**INT_RANGES, "byte": INT_RANGES["int8"], "char": INT_RANGES["uint8"]},
    no_stamp=Time(),
)

ROS2 = Dialect(
    ros=2,
    times={"time": Time2, "duration": Time2},
    time_parts={"time": ("int32", "uint32"), "duration": ("int32", "uint32")},
    # In ROS 2 both are unsigned bytes.
    ints={**INT_RANGES, "byte": INT_RANGES["uint8"], "char": INT_RANGES["uint8"]},
    no_stamp=Time2(),
)


class Leniency(Record):
    """Names and forms that documents use in place of those on the wire; they are accepted, and never sent.

    Attributes:
        types: accepted type name -> name of the type.
        fields: type -> {accepted field name: wire name}.
        scalars: type -> array fields that may come as a single element.
        numerals: type -> integer fields that may come as text, such as `"13"` or, with the digits at its end,
            `"IntTL13"`.
        elsewhere: type -> {field that only another release has: where, as the end of an error}; not accepted.
    """

    types: Mapping[str, str] = field(default_factory=dict)
    fields: Mapping[str, Mapping[str, str]] = field(default_factory=dict)
    scalars: Mapping[str, frozenset[str]] = field(default_factory=dict)
    numerals: Mapping[str, frozenset[str]] = field(default_factory=dict)
    elsewhere: Mapping[str, Mapping[str, str]] = field(default_factory=dict)
