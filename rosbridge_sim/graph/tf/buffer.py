"""A tree of coordinate frames: transforms in, the pose of any frame in any other out.

A transform says where a child frame stands in its parent; a frame has one parent, and of each transform the latest is
kept. A pose is found by going up from both frames to the first one that they share. There is no history and nothing is
interpolated: where the transforms on the way are of different times, each counts as it was last told, and the pose
carries the oldest of these times.

Frames that were told as static are kept apart from those that move, so that neither can push the other out.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import msgspec

from rosbridge_sim.errors import GraphError
from rosbridge_sim.graph.participant import Guest, Participant
from rosbridge_sim.loose_types import Struct

__all__ = [
    "IDENTITY",
    "MAX_FRAME_NAME",
    "MAX_TF_FRAMES",
    "Placed",
    "Transform",
    "TransformBuffer",
    "compose",
    "frame_name",
    "invert",
    "turn",
]

MAX_TF_FRAMES = 1_000
"""Moving frames that are kept, and as many static ones. The one that was told longest ago goes first, those of clients
before the server's own: static ones are told once, and a client could push them out for good."""

MAX_FRAME_NAME = 256
"""Longest name of a frame [characters]."""

MAX_TREE_DEPTH = 100
"""Longest way up that is followed: three times that of a humanoid's finger, and a bound for a tree made to be slow."""

_ALMOST_UNIT = 1e-12
"""A square of a norm this near to 1 is left as it is: dividing would change bits and better nothing."""


class Transform(NamedTuple):
    """The pose of a frame in another one.

    Attributes:
        x, y, z: of its origin [m].
        qx, qy, qz, qw: its orientation, a unit quaternion.
    """

    x: float
    y: float
    z: float
    qx: float
    qy: float
    qz: float
    qw: float


IDENTITY = Transform(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)


@dataclass(frozen=True, slots=True)
class Placed:
    """A pose that was found.

    Attributes:
        pose: of the source in the target.
        stamp: the oldest time of all that moves on the way, a struct of `time`; None where nothing moves.
    """

    pose: Transform
    stamp: msgspec.Struct | None


@dataclass(frozen=True, slots=True)
class _Edge:
    """One transform: the way from a frame to its parent; `stamp` is None for a static one."""

    parent: str
    pose: Transform
    stamp: msgspec.Struct | None
    sender: Participant


def frame_name(given: str) -> str:
    """The name of a frame without the slash that ROS once put before it: `/map` and `map` are one frame.

    Raises:
        GraphError: it is empty or too long.
    """
    name = given.removeprefix("/")
    if not name:
        raise GraphError("A frame without a name is none")
    if len(name) > MAX_FRAME_NAME:
        raise GraphError(f"The name of a frame has at most {MAX_FRAME_NAME} characters")
    return name


def compose(first: Transform, second: Transform) -> Transform:
    """The pose in A of what has pose `second` in B, where B has pose `first` in A."""
    x, y, z, ax, ay, az, aw = first
    u, v, w, bx, by, bz, bw = second
    # p + q (u, v, w) q*, by way of t = 2 q x (u, v, w)
    tx, ty, tz = 2.0 * (ay * w - az * v), 2.0 * (az * u - ax * w), 2.0 * (ax * v - ay * u)
    return Transform(
        x + u + aw * tx + ay * tz - az * ty,
        y + v + aw * ty + az * tx - ax * tz,
        z + w + aw * tz + ax * ty - ay * tx,
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    )


def invert(pose: Transform) -> Transform:
    """The pose of A in B, where B has this pose in A."""
    back = Transform(0.0, 0.0, 0.0, -pose.qx, -pose.qy, -pose.qz, pose.qw)
    return compose(back, Transform(-pose.x, -pose.y, -pose.z, 0.0, 0.0, 0.0, 1.0))


def turn(first: Transform, second: Transform) -> float:
    """The angle between two orientations, 0 to pi; exactly 0 for the same one [rad]."""
    a, b = first[3:], second[3:]
    if math.fsum(p * q for p, q in zip(a, b, strict=True)) < 0.0:  # q and -q are one orientation
        b = (-b[0], -b[1], -b[2], -b[3])
    apart = math.hypot(*(p - q for p, q in zip(a, b, strict=True)))
    along = math.hypot(*(p + q for p, q in zip(a, b, strict=True)))
    return 4.0 * math.atan2(apart, along)  # unlike acos of the product it sees small angles


class TransformBuffer:
    """All transforms that were told.

    Attributes:
        version: rises with all that is put in.
    """

    def __init__(self) -> None:
        self.version = 0
        self._moving: dict[str, _Edge] = {}  # in the order in which they were told
        self._static: dict[str, _Edge] = {}

    def __len__(self) -> int:
        return len(self._moving) + len(self._static)

    def put(self, stamped: Struct, sender: Participant, *, is_static: bool) -> None:
        """Take a transform in; it takes the place of an older one of the same child.

        Args:
            stamped: a geometry_msgs/TransformStamped.
            sender: who told it.
            is_static: it holds until another one is told.

        Raises:
            GraphError: it is none: a frame without a name or in itself, numbers that are none.
        """
        parent, child = frame_name(stamped.header.frame_id), frame_name(stamped.child_frame_id)
        if parent == child:
            raise GraphError(f"Transform {parent} -> {child}: a frame cannot stand in itself")
        pose = _read(stamped.transform, f"Transform {parent} -> {child}")
        edges, others = (self._static, self._moving) if is_static else (self._moving, self._static)
        others.pop(child, None)
        edges.pop(child, None)
        edges[child] = _Edge(parent, pose, None if is_static else stamped.header.stamp, sender)
        if len(edges) > MAX_TF_FRAMES:
            of_clients = (name for name, edge in edges.items() if isinstance(edge.sender, Guest))
            del edges[next(of_clients, next(iter(edges)))]
        self.version += 1

    def forget(self, is_meant: Callable[[Participant], bool]) -> None:
        """Forget the moving frames of some senders."""
        self._moving = {child: edge for child, edge in self._moving.items() if not is_meant(edge.sender)}
        self.version += 1

    def look_up(self, target: str, source: str) -> Placed | None:
        """Return the pose of `source` in `target`; None where the two do not hang together.

        A frame stands in itself even if nobody ever told of it.
        """
        up = self._climb(source, lambda frame: frame == target)
        if target in up:
            return up[target]
        down = self._climb(target, up.__contains__)
        meeting = next(reversed(down))
        if meeting not in up:
            return None
        here, there = up[meeting], down[meeting]
        return Placed(compose(invert(there.pose), here.pose), _older(here.stamp, there.stamp))

    def _climb(self, frame: str, is_there: Callable[[str], bool]) -> dict[str, Placed]:
        """The pose of a frame in itself and its ancestors, in their order, up to the first that `is_there`."""
        placed = Placed(IDENTITY, None)
        found = {frame: placed}
        while not is_there(frame) and len(found) <= MAX_TREE_DEPTH:
            edge = self._moving.get(frame) or self._static.get(frame)
            if edge is None or edge.parent in found:  # the root, or a circle
                break
            frame = edge.parent
            pose = edge.pose if placed.pose is IDENTITY else compose(edge.pose, placed.pose)
            placed = found[frame] = Placed(pose, _older(placed.stamp, edge.stamp))
        return found


def _read(transform: Struct, what: str) -> Transform:
    """The pose in a geometry_msgs/Transform.

    Raises:
        GraphError: it has numbers that are none, or no orientation.
    """
    shift, q = transform.translation, transform.rotation
    norm2 = q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w
    if not math.isfinite(shift.x + shift.y + shift.z):
        raise GraphError(f"{what}: translation ({shift.x}, {shift.y}, {shift.z}) is no place")
    if not 0.0 < norm2 < math.inf:
        raise GraphError(f"{what}: rotation ({q.x}, {q.y}, {q.z}, {q.w}) is no orientation")
    scale = 1.0 if abs(norm2 - 1.0) < _ALMOST_UNIT else 1.0 / math.sqrt(norm2)
    return Transform(shift.x, shift.y, shift.z, q.x * scale, q.y * scale, q.z * scale, q.w * scale)


def _older(first: msgspec.Struct | None, second: msgspec.Struct | None) -> msgspec.Struct | None:
    """The older of two times; None is none, as of what does not move."""
    if first is None or second is None:
        return second if first is None else first
    return min(first, second, key=msgspec.structs.astuple)
