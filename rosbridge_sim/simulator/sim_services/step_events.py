"""The conditions that end a call of `/sim/step` early, each looked at after every frame.

Red lights and the road are judged by the scores of the world room, which are kept from the first such call on.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Final

import numpy as np

from rosbridge_sim.errors import FieldError
from rosbridge_sim.loose_types import Struct
from rosbridge_sim.records import Record
from rosbridge_sim.world.contacts.collisions import POSE_SPEED, CollisionDetector
from rosbridge_sim.world.state.world import DT, MAX_COORDINATE, World

COLLISION: Final = "collision"
RED_LIGHT: Final = "red_light"
OFF_ROAD: Final = "off_road"
DISTANCE: Final = "distance"
PLACE: Final = "place"

MAX_DISTANCE: Final = 1e9
"""Greatest distance that a request may name [m]."""


class StopConditions(Record):
    """Conditions that end a call early.

    Attributes:
        on_collision: an ego has touched something.
        on_red_light: an ego has passed a stop line at red.
        off_road: an ego stands beside the road.
        distance: an ego has driven so far since the call began [m]; inf for no limit.
        place: (x, y), map frame [m].
        within: an ego's reference point is so near to that place [m]; 0.0 for no place.
    """

    on_collision: bool = False
    on_red_light: bool = False
    off_road: bool = False
    distance: float = math.inf
    place: tuple[float, float] = (0.0, 0.0)
    within: float = 0.0


def read_conditions(request: Struct) -> StopConditions | None:
    """Read the conditions of a request of `/sim/step`.

    Returns:
        The conditions; None where there is nothing to look at.

    Raises:
        FieldError: a number that is none, negative or beyond all bounds.
    """
    distance, within, x, y = request.stop_after_m, request.stop_within_m, request.stop_at_x, request.stop_at_y
    for name, figure in (("stop_after_m", distance), ("stop_within_m", within)):
        if not 0.0 <= figure <= MAX_DISTANCE:
            raise FieldError(f"{name}: expected a number of metres from 0 to {MAX_DISTANCE:g}, got {figure}")
    for name, figure in (("stop_at_x", x), ("stop_at_y", y)):
        if not -MAX_COORDINATE <= figure <= MAX_COORDINATE:
            raise FieldError(f"{name}: expected a number within +-{MAX_COORDINATE:g}, got {figure}")
    has_event = request.stop_on_collision or request.stop_on_red_light or request.stop_off_road
    if not (has_event or distance or within):
        return None
    return StopConditions(
        on_collision=request.stop_on_collision,
        on_red_light=request.stop_on_red_light,
        off_road=request.stop_off_road,
        distance=distance or math.inf,
        place=(x, y),
        within=within,
    )


class StopWatch:
    """Watches the egos of one call.

    Attributes:
        met: the condition that was met first, as the wire calls it; empty while none is.
    """

    def __init__(self, conditions: StopConditions, world: World, find_uids: Callable[[], Sequence[int]]) -> None:
        """Begin to watch; nothing is met yet.

        Args:
            world: its scores are kept if a condition needs them.
            find_uids: gives the ids of the egos in the world.
        """
        self.met = ""
        self._conditions = conditions
        self._world = world
        self._find_uids = find_uids
        self._driven: dict[int, float] = {}

    def begin_tick(self) -> None:
        """Have the world judge what the conditions need, in the frames that follow."""
        if self._conditions.on_red_light or self._conditions.off_road:
            self._world.start_scoring()

    def look(self) -> None:
        """Look at the frame that was just computed."""
        if self.met:
            return
        conditions, world = self._conditions, self._world
        uids = self._find_uids()
        rows = [world.row(uid) for uid in uids]
        if conditions.on_collision and len(world.contacts) and np.isin(world.contacts, uids).any():
            self.met = COLLISION
        elif conditions.on_red_light and world.has_passed_red[rows].any():
            self.met = RED_LIGHT
        elif conditions.off_road and world.is_off_road[rows].any():
            self.met = OFF_ROAD
        elif self._has_driven(uids, rows):
            self.met = DISTANCE
        elif conditions.within > 0.0 and self._is_there(rows):
            self.met = PLACE

    def _has_driven(self, uids: Sequence[int], rows: Sequence[int]) -> bool:
        """Add the way of the last frame, along the heading: an ego that was put somewhere else has not driven there."""
        if self._conditions.distance == math.inf:
            return False
        driven, speeds = self._driven, self._world.derived(CollisionDetector).poses[:, POSE_SPEED, rows]
        ways = (np.abs(speeds[0] + speeds[1]) * (0.5 * DT)).tolist()
        for uid, way in zip(uids, ways, strict=True):
            driven[uid] = driven.get(uid, 0.0) + way
        return any(way >= self._conditions.distance for way in driven.values())

    def _is_there(self, rows: Sequence[int]) -> bool:
        (x, y), world = self._conditions.place, self._world
        return any(math.hypot(world.x.item(row) - x, world.y.item(row) - y) <= self._conditions.within for row in rows)
