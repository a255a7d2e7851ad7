"""A tree of coordinate frames: it stores transforms and returns the pose of any frame in any other one.

A transform is the pose of a child frame in its parent. A frame has one parent, and only its latest transform is kept. A
pose is found by going up from both frames to their first common ancestor. There is no history and no interpolation: if
the transforms on the path have different times, each is used as it is, and the pose carries the oldest of these times.
Static frames are stored apart from moving ones, so that neither kind can displace the other.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import msgspec

from rosbridge_sim.errors import GraphError
from rosbridge_sim.graph.participant import Participant
from rosbridge_sim.loose_types import Struct
from rosbridge_sim.records import Record

MAX_TF_FRAMES = 1_000
"""Largest number of moving frames, and of static ones. The oldest is removed first, frames of clients before the
server's own. Static frames are sent only once, so a client could otherwise remove them for ever."""

MAX_FRAME_NAME = 256
"""Longest name of a frame [characters]."""

MAX_TREE_DEPTH = 100
"""Longest path to an ancestor: three times that of a humanoid's finger, and a limit for trees made to be slow."""

_ALMOST_UNIT = 1e-12
"""A squared norm this near to 1 counts as 1: a division would change bits without being more exact."""


class Transform(NamedTuple):
    """The pose of a frame in another one.

    Attributes:
        x, y, z: position of its origin [m].
        qx, qy, qz, qw: orientation, a unit quaternion.
    """

    x: float
    y: float
    z: float
    qx: float
    qy: float
    qz: float
    qw: float


IDENTITY = Transform(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)


class Placed(Record):
    """The result of a search for a pose.

    Attributes:
        pose: pose of the source frame in the target frame.
        stamp: oldest time of all moving transforms on the path, a struct of `time`; None if all are static.
    """

    pose: Transform
    stamp: msgspec.Struct | None


class _Edge(Record):
    """One transform, from a frame to its parent; `stamp` is None for a static one."""

    parent: str
    pose: Transform
    stamp: msgspec.Struct | None
    sender: Participant


def frame_name(given: str) -> str:
    """Return the name of a frame without the leading slash of old ROS versions: `/map` and `map` are one frame.

    Raises:
        GraphError: it is empty or too long.
    """
    name = given.removeprefix("/")
    if not name:
        raise GraphError("A frame needs a name; got an empty one")
    if len(name) > MAX_FRAME_NAME:
        raise GraphError(f"The name of a frame has at most {MAX_FRAME_NAME} characters")
    return name


def compose(first: Transform, second: Transform) -> Transform:
    """Return a pose in frame A for a pose in frame B."""
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
    """Return the pose of A in B."""
    back = Transform(0.0, 0.0, 0.0, -pose.qx, -pose.qy, -pose.qz, pose.qw)
    return compose(back, Transform(-pose.x, -pose.y, -pose.z, 0.0, 0.0, 0.0, 1.0))


def turn(first: Transform, second: Transform) -> float:
    """Return the angle between two orientations, from 0 to pi [rad]; exactly 0 if they are equal.

    Args:
        first: pose with the first orientation.
        second: pose with the second orientation.
    """
    a, b = first[3:], second[3:]
    if math.fsum(p * q for p, q in zip(a, b, strict=True)) < 0.0:  # q and -q are the same orientation
        b = (-b[0], -b[1], -b[2], -b[3])
    apart = math.hypot(*(p - q for p, q in zip(a, b, strict=True)))
    along = math.hypot(*(p + q for p, q in zip(a, b, strict=True)))
    return 4.0 * math.atan2(apart, along)  # exact for small angles, unlike acos of the product


class TransformBuffer:
    """All known transforms.

    Attributes:
        version: a number that grows with each change.
    """

    def __init__(self) -> None:
        self.version = 0
        self._moving: dict[str, _Edge] = {}  # in order of arrival
        self._static: dict[str, _Edge] = {}

    def __len__(self) -> int:
        return len(self._moving) + len(self._static)

    def put(self, stamped: Struct, sender: Participant, *, is_static: bool) -> None:
        """Store a transform; it replaces the previous one of the same child frame.

        Args:
            stamped: a geometry_msgs/TransformStamped.
            is_static: it stays valid until it is replaced.

        Raises:
            GraphError: a frame without a name or inside itself, or invalid numbers.
        """
        parent, child = frame_name(stamped.header.frame_id), frame_name(stamped.child_frame_id)
        if parent == child:
            raise GraphError(f"Transform {parent} -> {child}: a frame cannot be its own parent")
        pose = _read(stamped.transform, f"Transform {parent} -> {child}")
        edges, others = (self._static, self._moving) if is_static else (self._moving, self._static)
        others.pop(child, None)
        edges.pop(child, None)
        edges[child] = _Edge(parent, pose, None if is_static else stamped.header.stamp, sender)
        if len(edges) > MAX_TF_FRAMES:
            of_clients = (name for name, edge in edges.items() if edge.sender.is_guest)
            del edges[next(of_clients, next(iter(edges)))]
        self.version += 1

    def forget(self, is_meant: Callable[[Participant], bool]) -> None:
        """Remove the moving frames of some publishers.

        Args:
            is_meant: returns True for these publishers.
        """
        self._moving = {child: edge for child, edge in self._moving.items() if not is_meant(edge.sender)}
        self.version += 1

    def look_up(self, target: str, source: str) -> Placed | None:
        """Return the pose of `source` in `target`; None if no path connects them.

        A frame has a pose in itself even if it is unknown.

        Args:
            target: the frame of the result.
            source: the frame whose pose is wanted.
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
        """Return the pose of a frame in itself and in each ancestor, in order, up to the first that `is_there`."""
        placed = Placed(IDENTITY, None)
        found = {frame: placed}
        while not is_there(frame) and len(found) <= MAX_TREE_DEPTH:
            edge = self._moving.get(frame) or self._static.get(frame)
            if edge is None or edge.parent in found:  # the root, or a loop
                break
            frame = edge.parent
            pose = edge.pose if placed.pose is IDENTITY else compose(edge.pose, placed.pose)
            placed = found[frame] = Placed(pose, _older(placed.stamp, edge.stamp))
        return found


def _read(transform: Struct, what: str) -> Transform:
    """Return the pose in a geometry_msgs/Transform.

    Raises:
        GraphError: a number is not finite, or the quaternion is not an orientation.
    """
    shift, q = transform.translation, transform.rotation
    norm2 = q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w
    if not math.isfinite(shift.x + shift.y + shift.z):
        raise GraphError(f"{what}: translation ({shift.x}, {shift.y}, {shift.z}) is not a position")
    if not 0.0 < norm2 < math.inf:
        raise GraphError(f"{what}: rotation ({q.x}, {q.y}, {q.z}, {q.w}) is not an orientation")
    scale = 1.0 if abs(norm2 - 1.0) < _ALMOST_UNIT else 1.0 / math.sqrt(norm2)
    return Transform(shift.x, shift.y, shift.z, q.x * scale, q.y * scale, q.z * scale, q.w * scale)


def _older(first: msgspec.Struct | None, second: msgspec.Struct | None) -> msgspec.Struct | None:
    """Return the older of two times; None means static, which has no time."""
    if first is None or second is None:
        return second if first is None else first
    return min(first, second, key=msgspec.structs.astuple)
