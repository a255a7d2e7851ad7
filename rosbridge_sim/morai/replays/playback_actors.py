"""Those whom a recording moves: how its scenes get into the world.

Everybody of a scene is a ghost there, under his own number where it is free. Who is not in the next scene goes, and
comes again if he comes again.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import lru_cache
from typing import Final

import numpy as np

from rosbridge_sim.morai.catalogue import Catalogue, default_model
from rosbridge_sim.morai.ego import Ego
from rosbridge_sim.morai.replays.recording import EGO_COLUMNS, OBJECT_COLUMNS, Actor, RecordedMoment
from rosbridge_sim.morai.scene import MAX_ENTITIES, Scene
from rosbridge_sim.world.placement import place_ghost, show_ghosts
from rosbridge_sim.world.state import Body, Kind, Snapshot, World

__all__ = ["EGO", "EVERYBODY", "PEDESTRIANS", "VEHICLES", "PlaybackActors"]

EGO: Final = 1
VEHICLES: Final = 2
PEDESTRIANS: Final = 4
EVERYBODY: Final = EGO | VEHICLES | PEDESTRIANS
"""Whom a recording moves, a sum. Obstacles come and go with the vehicles: they have no number of their own."""

_TARGETS: Final = {Kind.VEHICLE: VEHICLES, Kind.OBSTACLE: VEHICLES, Kind.PEDESTRIAN: PEDESTRIANS}

_log = logging.getLogger("rosbridge_sim.morai")


class PlaybackActors:
    """Who of the world is moved by a recording now; nobody outside of `enter` and `leave`."""

    def __init__(self, world: World, scene: Scene, find_ego: Callable[[int], Ego | None]) -> None:
        """Nobody yet.

        Args:
            world: written.
            scene: gives numbers, and is kept for the recording.
            find_ego: the ego of a number.
        """
        self._world = world
        self._scene = scene
        self._find_ego = find_ego
        self._targets = 0
        self._before: Snapshot | None = None
        self._egos: dict[int, Ego] = {}
        self._uids: dict[Actor, int] = {}
        self._is_full = False

    def enter(self, egos: Iterable[int], targets: int, *, has_objects: bool) -> None:
        """Take the stage from those who are to be moved; they are kept as they are.

        Args:
            egos: numbers of those that there are scenes of.
            targets: who is to be moved.
            has_objects: whether there are scenes of others; if not, they stay and go on by themselves.
        """
        world = self._world
        self._before = world.snapshot()
        self._targets = targets
        self._scene.is_replaying = True
        found = {index: self._find_ego(index) for index in egos} if targets & EGO else {}
        self._egos = {index: ego for index, ego in found.items() if ego is not None}
        for ego in self._egos.values():
            ego.is_replayed = True
            row = ego.row
            place = {axis: getattr(world, axis).item(row) for axis in ("x", "y", "z", "roll", "pitch", "yaw")}
            place_ghost(world, row, **place)  # it leaves its lane, if it drove itself
        if has_objects:
            for uid in [int(world.uid[row]) for row in world.placed()]:
                if targets & _TARGETS.get(Kind(world.kind.item(world.row(uid))), 0):
                    world.remove(uid)

    def retarget(self, egos: Iterable[int], targets: int, *, has_objects: bool) -> None:
        """Have others be moved from now on; the arguments are those of `enter`.

        An ego that is moved neither before nor after drives on. All others who are not moved any longer, or still not,
        are again where they were when the recording took the stage.
        """
        if targets == self._targets:
            return
        world = self._world
        now = world.snapshot()
        free = {uid for uid, row in now.uids if world.kind[row] == Kind.EGO} - {ego.uid for ego in self._egos.values()}
        self.leave()
        self.enter(egos, targets, has_objects=has_objects)
        for uid in free - {ego.uid for ego in self._egos.values()}:
            world.restore_driven(uid, now)

    def show(self, scene: RecordedMoment) -> None:
        """Put everybody where a scene has him."""
        world = self._world
        for index, ego in self._egos.items():
            show_ghosts(world, np.array([ego.row]), EGO_COLUMNS, scene.egos[index][:, None])
        chosen = [i for i, actor in enumerate(scene.cast) if _TARGETS[actor.kind] & self._targets]
        cast = [scene.cast[i] for i in chosen]
        here = dict.fromkeys(cast)
        for actor in [actor for actor in self._uids if actor not in here]:
            world.remove(self._uids.pop(actor))
        new = [(i, actor) for i, actor in zip(chosen, cast, strict=True) if actor not in self._uids]
        if new:
            with world.room_for(max(0, min(len(new), MAX_ENTITIES - len(world)))):
                for i, actor in new:
                    if actor not in self._uids:  # it may be there twice
                        self._bring(actor, *scene.values[:2, i].tolist())
        placed = [i for i, actor in zip(chosen, cast, strict=True) if actor in self._uids]
        if placed:
            rows = np.array([world.row(self._uids[scene.cast[i]]) for i in placed])
            show_ghosts(world, rows, OBJECT_COLUMNS, scene.values[:, placed])

    def leave(self) -> None:
        """Have the world be as it was before; frames, lights and the count of ids have gone on."""
        if self._before is None:
            return
        now = self._world.snapshot()
        next_uid = max(now.next_uid, self._before.next_uid)
        self._world.restore(replace(self._before, frame=now.frame, signals=now.signals, next_uid=next_uid))
        for ego in self._egos.values():
            ego.is_replayed = False
        self._scene.is_replaying = False
        self._before, self._egos, self._uids, self._is_full = None, {}, {}, False

    def _bring(self, actor: Actor, x: float, y: float) -> None:
        """Put somebody into the world, if there is room."""
        if len(self._world) >= MAX_ENTITIES:
            if not self._is_full:
                self._is_full = True
                _log.warning("the world holds %d at most: some of the recording are left out", MAX_ENTITIES)
            return
        body = _body_of(actor, self._scene.catalogue)
        uid = self._scene.add_actor(actor.uid, actor.kind, body, actor.name, x=x, y=y)
        if uid != actor.uid:
            _log.info("%s, number %d of the recording, is %d here", actor.name, actor.uid, uid)
        self._uids[actor] = uid


def _body_of(actor: Actor, catalogue: Catalogue) -> Body:
    """The body of its model, in the recorded size; a vehicle that nobody knows has the proportions of the usual car."""
    model = catalogue.find(actor.name)
    like = (model if model is not None and model.kind is actor.kind else default_model(actor.kind)).body
    return _resize(like, actor.kind, actor.size)


@lru_cache(maxsize=1024)
def _resize(like: Body, kind: Kind, size: tuple[float, float, float]) -> Body:
    """Another body of another length, width and height; the usual one where they make none."""
    length, width, height = size
    try:
        if (length, width, height) == (like.length, like.width, like.height):
            return like
        if kind is not Kind.VEHICLE:
            return Body.box(length, width, height)
        scale = length / like.length
        return replace(
            like,
            length=length,
            width=width,
            height=height,
            wheelbase=like.wheelbase * scale,
            front_overhang=like.front_overhang * scale,
            rear_overhang=like.rear_overhang * scale,
        )
    except ValueError:  # a size that is none
        return like
