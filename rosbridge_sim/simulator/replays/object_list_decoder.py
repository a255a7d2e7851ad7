"""Decoder of object lists that reads a message's bytes directly, because a library takes ten times as long.

The bytes of an ObjectStatusList or ReplayInfo, as ROS 1 writes them or as CDR, little-endian:

    header                       ROS 1: seq, secs, nsecs, frame_id; CDR: four bytes in front, sec, nanosec, frame_id
    13 float64                   of a ReplayInfo alone: pedals, wheels, orientation, acceleration, turn
    3 int32                      lengths of the lists; not read, since each list has its own length
    3 lists, each of             uint32, then as many entries
        int32, int32, string     unique_id, type, name
        13 float64               heading, then x, y, z of velocity, acceleration, size, position

A string is its length and its bytes, in CDR with a zero at the end. In CDR, numbers stand at multiples of their size,
counted from the end of the four bytes. The caller must check that the definition is this one: see `LAYOUT`.
"""

from __future__ import annotations

import struct
from types import SimpleNamespace
from typing import Final

from rosbridge_sim.morai.messages.object_lists import EGO_TYPE
from rosbridge_sim.records import Record
from rosbridge_sim.world.state.world import Kind

LAYOUT: Final = frozenset(
    f"morai_msgs/msg/{name}" for name in ("ObjectStatusList", "ReplayInfo", "ObjectStatus")
) | frozenset(f"geometry_msgs/msg/{name}" for name in ("Vector3", "Quaternion"))
"""Types whose definitions must equal ours, so that the bytes are as above."""

_KINDS: Final = (Kind.VEHICLE, Kind.PEDESTRIAN, Kind.OBSTACLE)
_CDR_LITTLE: Final = b"\0\1"
_STAMP, _COUNT, _ENTRY, _PEDALS = (struct.Struct(form) for form in ("<II", "<I", "<iiI", "<13d"))
_FIGURES: Final = 13 * 8


class DecodedObjectLists(Record):
    """Content of a message.

    Attributes:
        stamp_ns: the header's stamp.
        pedals: the ego's part of a ReplayInfo, under the message's own names; None for an ObjectStatusList.
        who: (unique_id, kind, name) of each object. Egos are left out: they have their own topics.
        figures: 13 float64 of each, as bytes.
    """

    stamp_ns: int
    pedals: SimpleNamespace | None
    who: list[tuple[int, Kind, str]]
    figures: bytes


def decode_object_lists(raw: bytes, *, is_cdr: bool, has_pedals: bool) -> DecodedObjectLists:
    """Read an ObjectStatusList, or with `has_pedals` a ReplayInfo.

    Args:
        raw: the bytes of one message.
        is_cdr: the bytes are CDR; otherwise ROS 1.

    Returns:
        The content; figures in the message's units.

    Raises:
        ValueError: the bytes are not a message of this type.
    """
    try:
        return _decode(raw, is_cdr=is_cdr, has_pedals=has_pedals)
    except struct.error as error:
        raise ValueError(f"too short: {error}") from None


def _decode(raw: bytes, *, is_cdr: bool, has_pedals: bool) -> DecodedObjectLists:
    origin = at = 4 if is_cdr else 0
    if is_cdr and raw[:2] != _CDR_LITTLE:
        raise ValueError("expected plain CDR, little-endian")
    if not is_cdr:
        at += 4  # seq
    seconds, nanoseconds = _STAMP.unpack_from(raw, at)
    (size,) = _COUNT.unpack_from(raw, at + 8)
    at += 12 + size
    pedals = None
    if has_pedals:
        at = _align(at, origin, 8) if is_cdr else at
        pedals = _name_figures(_PEDALS.unpack_from(raw, at))
        at += _FIGURES
    at = _align(at, origin, 4) + 12 if is_cdr else at + 12
    who: list[tuple[int, Kind, str]] = []
    figures: list[bytes] = []
    for kind in _KINDS:
        at = _align(at, origin, 4) if is_cdr else at
        (num,) = _COUNT.unpack_from(raw, at)
        at += 4
        for _ in range(num):
            if is_cdr:
                at = _align(at, origin, 4)
            uid, type_number, size = _ENTRY.unpack_from(raw, at)
            at += 12
            name = raw[at : at + size - 1 if is_cdr and size else at + size].decode()
            at += size
            if is_cdr:
                at = _align(at, origin, 8)
            entry = raw[at : at + _FIGURES]
            at += _FIGURES
            if at > len(raw):
                raise ValueError("too short")
            if type_number != EGO_TYPE:
                who.append((uid, kind, name))
                figures.append(entry)
    return DecodedObjectLists(seconds * 1_000_000_000 + nanoseconds, pedals, who, b"".join(figures))


def _align(at: int, origin: int, size: int) -> int:
    return at + (origin - at) % size


def _name_figures(figures: tuple[float, ...]) -> SimpleNamespace:
    acc, brake, steer, x, y, z, w, *vectors = figures
    accel, turn = (SimpleNamespace(x=v[0], y=v[1], z=v[2]) for v in (vectors[:3], vectors[3:]))
    return SimpleNamespace(
        ego_acc=acc,
        ego_brake=brake,
        ego_steer=steer,
        orientation=SimpleNamespace(x=x, y=y, z=z, w=w),
        linear_acceleration=accel,
        angular_velocity=turn,
    )
