"""Ghosts: vehicles that a client places itself, frame by frame, as in a co-simulation.

A vehicle that a client names becomes a ghost, whatever moved it before. An unknown number adds a vehicle of the named
model. Clients choose these numbers themselves. A number may be used again after a scenario removed its ghost.

Release 22.R2 does not send a ghost's speed, but other cars and clients need it. It is computed from the way of the
last tenths of a second. Two successive messages would give a rough speed: in real time two messages may arrive in one
frame and none in the next.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Sequence
from itertools import islice, pairwise
from typing import Final

import numpy as np

from rosbridge_sim.errors import FieldError
from rosbridge_sim.morai.messages.command_parsing import Ghost, GhostPose
from rosbridge_sim.scenarios.catalogue import Model
from rosbridge_sim.simulator.plain.plain_bytes import PlainData
from rosbridge_sim.simulator.scene.scene import Scene
from rosbridge_sim.simulator.scene.scene_limits import FIRST_UID, MAX_ENTITIES, MAX_FILE_UID
from rosbridge_sim.world.state import placement
from rosbridge_sim.world.state.world import DT, MAX_COORDINATE, Kind, World

__all__ = ["Ghosts"]

SPEED_WINDOW: Final = 10
"""Frames over which a speed is computed: 0.2 s."""

MAX_GHOST_GAP: Final = 50
"""Largest gap in frames between two messages that are one motion: 1 s."""

MAX_GHOST_SPEED: Final = 100.0
"""Highest speed that counts as motion [m/s]. A faster change is a jump."""

_WHOSE: Final = {
    Kind.EGO: "an ego's",
    Kind.VEHICLE: "an ego's, too",
    Kind.PEDESTRIAN: "a pedestrian's",
    Kind.OBSTACLE: "an obstacle's",
}

_Trail = deque[tuple[int, float, float]]  # frame, x, y


class Ghosts:
    """Places ghosts. Its only own state is the recent positions of each ghost."""

    def __init__(self, world: World, scene: Scene, is_ego: Callable[[int], bool]) -> None:
        """Start without ghosts.

        Args:
            world: written through `scene` and `placement`.
            scene: adds vehicles.
            is_ego: returns true if a number on the wire is an ego's.
        """
        self._world = world
        self._scene = scene
        self._is_ego = is_ego
        self._trails: dict[int, _Trail] = {}

    def place(self, ghosts: Sequence[Ghost]) -> None:
        """Place all ghosts of one message, or none of them.

        Args:
            ghosts: the entries of the message; no two have one number.

        Raises:
            FieldError: a number belongs to something else than a vehicle, a model is unknown, or the world is full.
                Nothing
                has changed.
        """
        models = {ghost.unique_id: self._find_model(ghost) for ghost in ghosts if ghost.unique_id not in self._world}
        if len(self._world) + len(models) > MAX_ENTITIES:
            raise FieldError(f"the world holds {MAX_ENTITIES:,} at most")
        for ghost in ghosts:
            if ghost.unique_id not in models:
                self._check_vehicle(ghost.unique_id)
        self._trails = {uid: trail for uid, trail in self._trails.items() if uid in self._world}
        self._scene.add_all(models)
        rows = np.array([self._world.row(ghost.unique_id) for ghost in ghosts], dtype=np.int64)
        speeds = [g.pose.speed if g.has_speed else self._work_out_speed(g.unique_id, g.pose) for g in ghosts]
        poses = [
            (pose.x, pose.y, pose.z, pose.yaw, speed, pose.roll, pose.pitch)
            for pose, speed in zip((ghost.pose for ghost in ghosts), speeds, strict=True)
        ]
        placement.place_ghosts(self._world, rows, np.array(poses, dtype=np.float64).reshape(-1, 7).T)

    def forget(self) -> None:
        """Forget all positions, because the world has been reset."""
        self._trails.clear()

    def save_state(self) -> PlainData:
        """Return where they have been of late: ids, how many places each has, the places' frames, and x and y."""
        places = [place for trail in self._trails.values() for place in trail]
        return (
            np.array(list(self._trails), dtype=np.int64),
            np.array([len(trail) for trail in self._trails.values()], dtype=np.int64),
            np.array([frame for frame, _, _ in places], dtype=np.int64),
            np.array([(x, y) for _, x, y in places], dtype=np.float64).reshape(-1, 2),
        )

    def load_state(self, data: PlainData) -> None:
        """Become what was saved.

        Raises:
            ValueError: it is no such data. Nothing has changed.
        """
        is_four = isinstance(data, (list, tuple)) and len(data) == 4  # noqa: PLR2004 - those named in the next lines
        if not (is_four and all(isinstance(array, np.ndarray) for array in data)):
            raise ValueError("ghosts: expected ids, counts, frames and places")
        uids, counts, frames, places = data
        kinds = [(array.dtype.kind, array.ndim) for array in data]
        if kinds != [("i", 1)] * 3 + [("f", 2)] or not len(uids) == len(counts) <= MAX_ENTITIES:
            raise ValueError("ghosts: expected ids, counts, frames and places")
        is_good = len(places) == len(frames) and places.shape[1] == 2 and bool((counts >= 0).all())  # noqa: PLR2004 - x and y
        is_good = is_good and bool((counts <= len(frames)).all()) and int(counts.sum()) == len(frames)
        if not (is_good and bool((np.abs(places) <= MAX_COORDINATE).all())):
            raise ValueError("ghosts: expected a frame and a place for each count")
        rest = iter(zip(frames.tolist(), places.tolist(), strict=True))
        trails = {
            uid: deque([(frame, x, y) for frame, (x, y) in islice(rest, count)])
            for uid, count in zip(uids.tolist(), counts.tolist(), strict=True)
        }
        if any(later[0] <= earlier[0] for trail in trails.values() for earlier, later in pairwise(trail)):
            raise ValueError("ghosts: expected rising frames")  # a speed is a way divided by their difference
        self._trails = trails

    def _find_model(self, ghost: Ghost) -> Model:
        if not FIRST_UID <= ghost.unique_id <= MAX_FILE_UID:
            raise FieldError(f"unique_id: expected {FIRST_UID}..{MAX_FILE_UID}, got {ghost.unique_id}")
        if self._is_ego(ghost.unique_id):
            raise FieldError(f"unique_id {ghost.unique_id}: expected a vehicle's, it is an ego's")
        model = self._scene.catalogue.find(ghost.name)
        if model is None or model.kind is not Kind.VEHICLE:
            text = f"unique_id {ghost.unique_id}: the catalogue has no vehicle {ghost.name[:80]!r}"
            raise FieldError(f"{text}{self._scene.catalogue.suggest(ghost.name, Kind.VEHICLE)}")
        return model

    def _check_vehicle(self, uid: int) -> None:
        kind = Kind(self._world.kind.item(self._world.row(uid)))
        if kind is not Kind.VEHICLE or self._is_ego(uid):
            raise FieldError(f"unique_id {uid}: expected a vehicle's, it is {_WHOSE[kind]}")

    def _work_out_speed(self, uid: int, pose: GhostPose) -> float:
        """Return the speed along the heading, from the positions within the window [m/s]."""
        frame = self._world.frame
        trail = self._trails.setdefault(uid, deque())
        if trail and not 0 <= frame - trail[-1][0] <= MAX_GHOST_GAP:
            trail.clear()
        if trail and trail[-1][0] == frame:  # two messages in a frame: the later one counts
            trail.pop()
        while len(trail) > 1 and frame - trail[1][0] >= SPEED_WINDOW:
            trail.popleft()
        speed = 0.0
        if trail:
            since, x, y = trail[0]
            along = (pose.x - x) * math.cos(pose.yaw) + (pose.y - y) * math.sin(pose.yaw)
            speed = along / ((frame - since) * DT)
            if abs(speed) > MAX_GHOST_SPEED:
                trail.clear()
                speed = 0.0
        trail.append((frame, pose.x, pose.y))
        return speed
