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
from rosbridge_sim.world.contacts.collisions import POSE_SPEED, CollisionDetector
from rosbridge_sim.world.state.world import DT, MAX_COORDINATE, World

COLLISION: Final = "collision"
RED_LIGHT: Final = "red_light"
OFF_ROAD: Final = "off_road"
DISTANCE: Final = "distance"
PLACE: Final = "place"

MAX_DISTANCE: Final = 1e9
"""Greatest distance that a request may name [m]."""


def has_conditions(request: Struct) -> bool:
    """Check the conditions of a request of `/sim/step`.

    Returns:
        Whether there is something to look at.

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
    return bool(has_event or distance or within)


class StopWatch:
    """Watches the egos of one call.

    Attributes:
        met: the condition that was met first, as the wire calls it; empty while none is.
    """

    def __init__(self, request: Struct, world: World, find_uids: Callable[[], Sequence[int]]) -> None:
        """Begin to watch; nothing is met yet.

        Args:
            request: of `/sim/step`; a condition that it does not name is 0 or false.
            world: its scores are kept if a condition needs them.
            find_uids: gives the ids of the egos in the world.
        """
        self.met = ""
        self._request = request
        self._world = world
        self._find_uids = find_uids
        self._driven: dict[int, float] = {}

    def begin_tick(self) -> None:
        """Have the world judge what the conditions need, in the frames that follow."""
        if self._request.stop_on_red_light or self._request.stop_off_road:
            self._world.start_scoring()

    def look(self) -> None:
        """Look at the frame that was just computed."""
        if self.met:
            return
        request, world = self._request, self._world
        uids = self._find_uids()
        rows = [world.row(uid) for uid in uids]
        if request.stop_on_collision and len(world.contacts) and np.isin(world.contacts, uids).any():
            self.met = COLLISION
        elif request.stop_on_red_light and world.has_passed_red[rows].any():
            self.met = RED_LIGHT
        elif request.stop_off_road and world.is_off_road[rows].any():
            self.met = OFF_ROAD
        elif self._has_driven(uids, rows):
            self.met = DISTANCE
        elif request.stop_within_m > 0.0 and self._is_there(rows):
            self.met = PLACE

    def _has_driven(self, uids: Sequence[int], rows: Sequence[int]) -> bool:
        """Add the way of the last frame, along the heading: an ego that was put somewhere else has not driven there."""
        limit = self._request.stop_after_m
        if not limit:
            return False
        driven, speeds = self._driven, self._world.derived(CollisionDetector).poses[:, POSE_SPEED, rows]
        ways = (np.abs(speeds[0] + speeds[1]) * (0.5 * DT)).tolist()
        for uid, way in zip(uids, ways, strict=True):
            driven[uid] = driven.get(uid, 0.0) + way
        return any(way >= limit for way in driven.values())

    def _is_there(self, rows: Sequence[int]) -> bool:
        x, y, within = self._request.stop_at_x, self._request.stop_at_y, self._request.stop_within_m
        places = zip(self._world.x[rows].tolist(), self._world.y[rows].tolist(), strict=True)
        return any(math.hypot(here_x - x, here_y - y) <= within for here_x, here_y in places)
