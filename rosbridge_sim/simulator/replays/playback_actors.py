"""Entities that a recording moves, and how they get into the world.

Each object of a recording is a ghost in the world, under its recorded id where that is free. An object that is missing
in the next moment is removed, and added again if it comes back.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable
from functools import lru_cache
from typing import Final

import numpy as np

from rosbridge_sim.records import replace
from rosbridge_sim.scenarios.catalogue import Catalogue, default_model
from rosbridge_sim.simulator.egos.ego import Ego
from rosbridge_sim.simulator.plain.plain_bytes import PlainData, decode, encode
from rosbridge_sim.simulator.replays.recorded_drive import (
    EGO_COLUMNS,
    OBJECT_COLUMNS,
    Actor,
    RecordedMoment,
    actor_from_plain,
    actor_to_plain,
)
from rosbridge_sim.simulator.scene.scene import Scene
from rosbridge_sim.simulator.scene.scene_limits import MAX_ENTITIES
from rosbridge_sim.world.saved_world import from_plain, to_plain
from rosbridge_sim.world.state.placement import place_ghost, show_ghosts
from rosbridge_sim.world.state.world import Body, Kind, Snapshot, World

EGO: Final = 1
VEHICLES: Final = 2
PEDESTRIANS: Final = 4
ALL_TARGETS: Final = EGO | VEHICLES | PEDESTRIANS
"""All targets of a replay. Obstacles belong to the vehicles, because MORAI has no bit for them."""

_TARGETS: Final = {Kind.VEHICLE: VEHICLES, Kind.OBSTACLE: VEHICLES, Kind.PEDESTRIAN: PEDESTRIANS}

_log = logging.getLogger("rosbridge_sim.morai")


class PlaybackActors:
    """Entities that a recording moves; none before `enter` and after `leave`."""

    def __init__(self, world: World, scene: Scene, find_ego: Callable[[int], Ego | None]) -> None:
        """Start without entities.

        Args:
            world: is written.
            scene: gives ids; nothing else is added to it or removed from it meanwhile.
            find_ego: returns the ego of a number, or None.
        """
        self._world = world
        self._scene = scene
        self._find_ego = find_ego
        self._targets = 0
        self._before: Snapshot | None = None
        self._packed_before: bytes | None = None  # the same, once it was saved
        self._egos: dict[int, Ego] = {}
        self._uids: dict[Actor, int] = {}
        self._is_full = False

    def enter(self, egos: Iterable[int], targets: int, *, has_objects: bool) -> None:
        """Make the egos ghosts and remove the objects that the recording replaces, until `leave`.

        Args:
            targets: a sum of EGO, VEHICLES and PEDESTRIANS.
            has_objects: whether objects are recorded; if not, those of the world stay and go on by themselves.
        """
        world = self._world
        self._before, self._packed_before = world.snapshot(), None
        self._targets = targets
        self._scene.is_replaying = True
        found = {index: self._find_ego(index) for index in egos} if targets & EGO else {}
        self._egos = {index: ego for index, ego in found.items() if ego is not None}
        for ego in self._egos.values():
            ego.moved_by = "recording"
            row = ego.row
            place = {axis: getattr(world, axis).item(row) for axis in ("x", "y", "z", "roll", "pitch", "yaw")}
            place_ghost(world, row, **place)  # it leaves its lane, if it was self-driving
        if has_objects:
            for uid in [int(world.uid[row]) for row in world.placed()]:
                if targets & _TARGETS.get(Kind(world.kind.item(world.row(uid))), 0):
                    world.remove(uid)

    def retarget(self, egos: Iterable[int], targets: int, *, has_objects: bool) -> None:
        """Change the targets; the arguments are those of `enter`.

        An ego that is moved neither before nor after drives on. All other entities that are not moved from now on
        return to the places that they had at the first `enter`.
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

    def show(self, moment: RecordedMoment) -> None:
        """Place all entities as they are at a recorded moment; add and remove objects as needed.

        Args:
            moment: the state of all replayed entities.
        """
        world = self._world
        for index, ego in self._egos.items():
            show_ghosts(world, np.array([ego.row]), EGO_COLUMNS, moment.egos[index][:, None])
        chosen = [i for i, actor in enumerate(moment.actors) if _TARGETS[actor.kind] & self._targets]
        actors = [moment.actors[i] for i in chosen]
        present = dict.fromkeys(actors)
        for actor in [actor for actor in self._uids if actor not in present]:
            world.remove(self._uids.pop(actor))
        new = [(i, actor) for i, actor in zip(chosen, actors, strict=True) if actor not in self._uids]
        if new:
            with world.room_for(max(0, min(len(new), MAX_ENTITIES - len(world)))):
                for i, actor in new:
                    if actor not in self._uids:  # it may be there twice
                        self._add(actor, *moment.values[:2, i].tolist())
        placed = [i for i, actor in zip(chosen, actors, strict=True) if actor in self._uids]
        if placed:
            rows = np.array([world.row(self._uids[moment.actors[i]]) for i in placed])
            show_ghosts(world, rows, OBJECT_COLUMNS, moment.values[:, placed])

    def leave(self) -> None:
        """Restore the world as it was at `enter`, except for the frame, the traffic lights and the next free id."""
        if self._before is None:
            return
        now = self._world.snapshot()
        next_uid = max(now.next_uid, self._before.next_uid)
        self._world.restore(replace(self._before, frame=now.frame, signals=now.signals, next_uid=next_uid))
        if now.is_scoring:  # begun meanwhile
            self._world.start_scoring()
        self._world.set_friction_share(now.friction_share)  # the weather may have changed meanwhile
        for ego in self._egos.values():
            ego.moved_by = ""
        self._scene.is_replaying = False
        self.forget()

    def save_state(self) -> PlainData:
        """Return what they are and what the world was before them; None before `enter` and after `leave`."""
        before = self._before
        if before is None:
            return None
        if self._packed_before is None:
            self._packed_before = encode(to_plain(before))
        uids = [(*actor_to_plain(actor), uid) for actor, uid in self._uids.items()]
        return (self._targets, self._packed_before, list(self._egos), uids, self._is_full)

    def load_state(self, data: PlainData) -> None:
        """Become what was saved; the world and the egos have been restored.

        Raises:
            ValueError: it is no such data.
            DocumentError: the same.
        """
        if data is None:
            self.forget()
            return
        world = self._world
        targets, packed, indices, uids, is_full = data
        before = from_plain(decode(packed), world.roads, world.signals.plan)
        egos = {index: self._find_ego(index) for index in indices}
        found = {actor_from_plain(entry[:4]): entry[4] for entry in uids}
        rows = [world.row(uid) for uid in found.values() if uid in world]
        uids_before = dict(before.uids)
        is_good = (
            type(targets) is int
            and 0 < targets <= ALL_TARGETS
            and len(rows) == len(set(rows)) == len(found)
            and not any(world.kind[row] == Kind.EGO for row in rows)
            and all(ego.uid in uids_before for ego in egos.values() if ego is not None)
        )
        if not is_good or None in egos.values():
            raise ValueError("replay: expected egos and objects of the world")
        self._targets, self._before, self._packed_before = targets, before, packed
        self._egos = {index: ego for index, ego in egos.items() if ego is not None}
        self._uids, self._is_full = found, bool(is_full)
        self._scene.is_replaying = True
        for ego in self._egos.values():
            ego.moved_by = "recording"

    @property
    def is_entered(self) -> bool:
        """Return whether a recording moves entities: between `enter` and `leave`."""
        return self._before is not None

    @property
    def indices(self) -> set[int]:
        """Return the numbers of the egos that are moved."""
        return set(self._egos)

    def forget(self) -> None:
        """Move nothing any longer, and leave the world as it is."""
        self._before, self._packed_before = None, None
        self._egos, self._uids, self._is_full = {}, {}, False

    def _add(self, actor: Actor, x: float, y: float) -> None:
        """Add an object to the world, if there is room."""
        if len(self._world) >= MAX_ENTITIES:
            if not self._is_full:
                self._is_full = True
                _log.warning(
                    "the world is full (%d entities): some objects of the recording are left out", MAX_ENTITIES
                )
            return
        body = _body_of(actor, self._scene.catalogue)
        uid = self._scene.add_actor(actor.uid, actor.kind, body, actor.name, x=x, y=y)
        if uid != actor.uid:
            _log.info("%s: unique_id %d of the recording is in use, it gets %d", actor.name, actor.uid, uid)
        self._uids[actor] = uid


def _body_of(actor: Actor, catalogue: Catalogue) -> Body:
    """Return the body of its model in the recorded size; a vehicle of an unknown model has the default car's shape."""
    model = catalogue.find(actor.name)
    like = (model if model is not None and model.kind is actor.kind else default_model(actor.kind)).body
    return _resize(like, actor.kind, actor.size)


@lru_cache(maxsize=1024)
def _resize(like: Body, kind: Kind, size: tuple[float, float, float]) -> Body:
    """Return a body of this length, width and height; the given one if they are not a valid size."""
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
    except ValueError:  # not a valid size
        return like
