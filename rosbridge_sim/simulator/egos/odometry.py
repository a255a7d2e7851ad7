"""The frame `odom` of REP 105, for an odometry without drift.

An ego starts at zero in `odom`, and drives there without jumps. A jump in the map, such as a teleport, moves `odom`
in the map instead: the pose in `odom` stays, and `map -> odom` jumps. A reset starts anew. The z axis of `odom`
is that of the map, so roll and pitch are the same in both, as an inertial unit would tell them.

An `Origin` is the pose of `odom` in the map: x, y, z [m] and yaw [rad]. Source: https://www.ros.org/reps/rep-0105.html
"""

from __future__ import annotations

import math
from typing import TypeAlias

Origin: TypeAlias = tuple[float, float, float, float]


def seen_from(origin: Origin, pose: Origin) -> Origin:
    """Return a pose as it is in `odom`.

    Args:
        origin: of `odom`.
    """
    cos, sin = math.cos(origin[3]), math.sin(origin[3])
    x, y = pose[0] - origin[0], pose[1] - origin[1]
    return cos * x + sin * y, cos * y - sin * x, pose[2] - origin[2], math.remainder(pose[3] - origin[3], math.tau)


def move_origin(origin: Origin, before: Origin, after: Origin) -> Origin:
    """Return the origin with which a pose after a jump is the same in `odom` as the one before it.

    Args:
        origin: before the jump.
        before, after: x, y, z and yaw of the ego in the map.
    """
    if before == after:  # to the bit
        return origin
    turn = after[3] - before[3]
    cos, sin = math.cos(turn), math.sin(turn)
    x, y = origin[0] - before[0], origin[1] - before[1]
    return (
        after[0] + cos * x - sin * y,
        after[1] + sin * x + cos * y,
        after[2] + origin[2] - before[2],
        math.remainder(origin[3] + turn, math.tau),
    )
