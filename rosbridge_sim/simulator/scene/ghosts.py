"""Ghosts: vehicles that a client places itself, frame by frame, as in a co-simulation.

A vehicle that a client names becomes a ghost, whatever moved it before. An unknown number adds a vehicle of the named
model. Clients choose these numbers themselves. A number may be used again after a scenario removed its ghost.

Release 22.R2 does not send a ghost's speed, but other cars and clients need it. It is computed from the way of the
last tenths of a second. Two successive messages would give a rough speed: in real time two messages may arrive in one
frame and none in the next.
"""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Set as AbstractSet
from typing import Final

import numpy as np

from rosbridge_sim.errors import FieldError
from rosbridge_sim.morai.messages.command_parsing import NpcGhosts
from rosbridge_sim.scenarios.catalogue import Model
from rosbridge_sim.simulator.scene.ghost_trails import GhostTrails
from rosbridge_sim.simulator.scene.scene import Scene
from rosbridge_sim.simulator.scene.scene_limits import FIRST_UID, MAX_ENTITIES, MAX_FILE_UID
from rosbridge_sim.world.geometry.planar import IntArray
from rosbridge_sim.world.state import placement
from rosbridge_sim.world.state.world import Kind, World

_WHOSE: Final = {
    Kind.EGO: "an ego's",
    Kind.VEHICLE: "an ego's, too",
    Kind.PEDESTRIAN: "a pedestrian's",
    Kind.OBSTACLE: "an obstacle's",
}


class Ghosts:
    """Places ghosts.

    Attributes:
        trails: the recent positions of each ghost: its only own state.
    """

    def __init__(self, world: World, scene: Scene, ego_numbers: Callable[[], AbstractSet[int]]) -> None:
        """Start without ghosts.

        Args:
            world: written through `scene` and `placement`.
            ego_numbers: returns the numbers of all egos on the wire.
        """
        self._world = world
        self._scene = scene
        self._ego_numbers = ego_numbers
        self.trails = GhostTrails()

    def place(self, ghosts: NpcGhosts) -> None:
        """Place all ghosts of one message, or none of them.

        Args:
            ghosts: the entries of the message; no two have one number.

        Raises:
            FieldError: a number belongs to something else than a vehicle, a model is unknown, or the world is full.
                Nothing
                has changed.
        """
        world, uids = self._world, ghosts.uids
        new = [uid for uid in uids if uid not in world]
        names = [name for uid, name in zip(uids, ghosts.names, strict=True) if uid not in world]
        models = self._find_models(new, names)
        if len(world) + len(new) > MAX_ENTITIES:
            raise FieldError(f"the world holds {MAX_ENTITIES:,} at most")
        if len(new) < len(uids):
            self._check_vehicles([uid for uid in uids if uid in world])
        self.trails.keep(world.uid[world.alive])
        self._scene.add_all(new, models)
        rows = self._rows(uids)
        x, y, _, yaw, speed, _, _ = ghosts.poses
        if not ghosts.has_speed:
            speed[:] = self.trails.move(np.array(uids, dtype=np.int64), world.frame, x, y, yaw)
        placement.place_ghosts(world, rows, ghosts.poses)

    def _rows(self, uids: list[int]) -> IntArray:
        return np.fromiter(map(self._world.row, uids), dtype=np.int64, count=len(uids))

    def _find_models(self, uids: list[int], names: list[str]) -> list[Model]:
        """Return the models of ghosts that are not in the world yet, by their numbers and the names of the models."""
        egos = self._ego_numbers()
        models: dict[str, Model] = {}  # of this message: nearly all ghosts have one of a few names
        for uid, name in zip(uids, names, strict=True):
            if not FIRST_UID <= uid <= MAX_FILE_UID:
                raise FieldError(f"unique_id: expected {FIRST_UID}..{MAX_FILE_UID}, got {uid}")
            if uid in egos:
                raise FieldError(f"unique_id {uid}: expected a vehicle's, it is an ego's")
            if name not in models:
                models[name] = self._find_model(uid, name)
        return [models[name] for name in names]

    def _find_model(self, uid: int, name: str) -> Model:
        model = self._scene.catalogue.find(name)
        if model is None or model.kind is not Kind.VEHICLE:
            text = f"unique_id {uid}: the catalogue has no vehicle {name[:80]!r}"
            raise FieldError(f"{text}{self._scene.catalogue.suggest(name, Kind.VEHICLE)}")
        return model

    def _check_vehicles(self, uids: list[int]) -> None:
        kinds, egos = self._world.kind[self._rows(uids)], self._ego_numbers()
        if egos.isdisjoint(uids) and (kinds == Kind.VEHICLE).all():
            return
        for uid, kind in zip(uids, kinds.tolist(), strict=True):
            if kind != Kind.VEHICLE or uid in egos:
                raise FieldError(f"unique_id {uid}: expected a vehicle's, it is {_WHOSE[Kind(kind)]}")
