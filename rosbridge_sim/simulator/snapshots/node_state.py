"""The whole state of the simulator as plain data: all that decides what the same calls will lead to.

    world        entities, lights, the generator of chance, the frame (and with it `header.seq` and simulated time)
    scene        the map and the scenario that `stop` of a replay loads again, the next id
    egos         control mode, lamps, sensors' places
    waiting      commands of synchronous mode that wait for their frames
    components   what each component says of itself (`Component.save_state`)

Not in it, because it belongs to the process and its connections: subscriptions, the master and the mode, the pause,
network settings, the pace of real time, stamps of the time of day, the opening scene.

`NodeState` saves, hashes and restores. A restore is whole or not at all: what can be checked is checked first, and what
fails later is undone.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from hashlib import blake2b
from typing import Any, Final, TypeAlias

import numpy as np

from rosbridge_sim.errors import DocumentError, PeerError
from rosbridge_sim.graph.participant import Participant
from rosbridge_sim.maps.road_map import RoadMap
from rosbridge_sim.records import Record
from rosbridge_sim.simulator.egos.ego import Ego, EgoState, ego_prefix
from rosbridge_sim.simulator.kernel.component import Component
from rosbridge_sim.simulator.kernel.context import SimulatorContext
from rosbridge_sim.simulator.plain.plain_bytes import PlainData, encode
from rosbridge_sim.simulator.plain.typed_plain import as_plain, check_finite, read_as
from rosbridge_sim.simulator.scene.load import FoundMap, Load, MapKey
from rosbridge_sim.simulator.scene.scene_commands import LoadScenario, SceneAction, SceneCommand
from rosbridge_sim.simulator.snapshots.saved_loads import Maps, pack_action, unpack_action, unpack_load
from rosbridge_sim.simulator.snapshots.snapshot_checks import check_egos, check_numbers
from rosbridge_sim.world.saved_world import from_plain, to_plain
from rosbridge_sim.world.state.world import Snapshot, World

NUM_TRIALS: Final = 2
"""Steps that a world from outside is tried out with: the first one makes what is derived, the second one uses it."""

ROW_SIZE: Final = 100
"""Memory of a row beside the arrays [bytes]: a name, a body and an id, most of them shared."""

BASE_SIZE: Final = 4_000
"""Memory of the smallest state [bytes]: its objects, the egos."""

_log = logging.getLogger("rosbridge_sim.morai")


class SavedState(Record, eq=False):
    """A state of the simulator; nothing in it changes any longer, and it can be restored any number of times.

    Attributes:
        world: on the roads of `found`.
        loaded, next_uid: of the scene.
        egos: in order, the first one first.
        waiting: what waits, each with its frame and the name of its source.
        components: by name.
    """

    world: Snapshot
    found: FoundMap
    loaded: Load
    next_uid: int
    egos: tuple[EgoState, ...]
    waiting: tuple[tuple[int, str, SceneAction], ...]
    components: dict[str, PlainData]

    @property
    def maps(self) -> dict[MapKey, RoadMap]:
        """Return the maps that it needs: that in use, and those of scenarios."""
        loads = [self.loaded, *(action.load for _, _, action in self.waiting if isinstance(action, LoadScenario))]
        return {self.found.key: self.found.road_map} | {load.map_key: load.road_map for load in loads}

    @property
    def size(self) -> int:
        """Return about how much memory it takes [bytes]."""
        world = self.world
        blocks = (world.floats, world.ints, world.bools, world.paths.segments, world.paths.keys, *world.routes.values())
        waiting = sum(len(encode(pack_action(action))) for _, _, action in self.waiting)
        return (
            sum(block.nbytes for block in blocks)
            + ROW_SIZE * len(world.names)
            + len(self.loaded.packed.data)
            + len(encode(self.components))
            + waiting
            + BASE_SIZE
        )

    def to_plain(self) -> PlainData:
        """Return it as plain data; see `NodeState.parse`."""
        return {
            "world": to_plain(self.world),
            "map": tuple(self.found.key),
            "loaded": tuple(self.loaded.packed),
            "next_uid": self.next_uid,
            "egos": as_plain(self.egos),
            "waiting": [(frame, source, pack_action(action)) for frame, source, action in self.waiting],
            "components": self.components,
        }


class NodeState:
    """Saves and restores one simulator."""

    def __init__(self, context: SimulatorContext, components: Sequence[Component]) -> None:
        """Save nothing yet.

        Args:
            components: all of them; their names in the state are those of their classes.
        """
        self._context = context
        self._components = components

    # Out

    def save(self) -> SavedState:
        """Return the state; call it between two frames, and with no command that is not ready."""
        context, scene = self._context, self._context.scene
        waiting = [(frame, command.source, command.action) for frame, command in context.sync.waiting()]
        ready = [(frame, source, action) for frame, source, action in waiting if action is not None]
        return SavedState(
            world=context.world.snapshot(),
            found=scene.found_map,
            loaded=scene.loaded,
            next_uid=scene.next_uid,
            egos=tuple([ego.save_state() for ego in context.egos]),
            waiting=tuple(ready),
            components=self._save_components(),
        )

    def hash(self) -> str:
        """Return 32 hexadecimal digits: equal states have equal ones, in any process.

        Scores are not in it: a subscription or a question begins them, and they move nothing.
        """
        context, scene = self._context, self._context.scene
        waiting = [(frame, command.source, command.action) for frame, command in context.sync.waiting()]
        egos = [ego.save_state() for ego in context.egos]
        rest = (scene.next_uid, egos, waiting, self._save_components())
        return _hash(context.world, scene.found_map, scene.loaded, rest)

    def hash_of(self, saved: SavedState) -> str:
        """Return what `hash` was when this state was saved. This may be called in any thread."""
        world = World()
        world.restore(saved.world)
        rest = (saved.next_uid, saved.egos, saved.waiting, saved.components)
        return _hash(world, saved.found, saved.loaded, rest)

    def _save_components(self) -> dict[str, PlainData]:
        return {type(one).__name__: one.save_state() for one in self._components}

    # In

    def restore(
        self, saved: SavedState, now: float, *, expected_hash: str = "", before_undo: Callable[[], None]
    ) -> None:
        """Become what was saved: the same calls from here on give the same messages.

        Args:
            saved: from `save`, or from `parse` and tried out.
            expected_hash: what `hash` must be then; empty for a state of this process, which need not be checked.
            before_undo: called if the restore fails, before the state of now is put back: a component may need to be
                given again what is not in its state.

        Raises:
            DocumentError: it is a state that this simulator cannot have. Nothing has changed.
            GraphError: a client has a topic that an ego of the state needs. The same.
        """
        before = self.save()
        new = self._bind_egos(saved, now)
        try:
            self._apply(saved, new, now)
            if expected_hash and self.hash() != expected_hash:
                raise DocumentError("state_hash: it is that of another state")  # noqa: TRY301 - undone as all failures
        except Exception as error:
            before_undo()
            self._apply(before, self._bind_egos(before, now), now)
            if not expected_hash:
                raise
            if not isinstance(error, (ValueError, DocumentError, PeerError)):
                _log.info("a snapshot was refused: a component fails on it", exc_info=error)
            raise DocumentError(f"state: {error!s:.200}") from None

    def check_allowed(self, saved: SavedState, caller: Participant) -> None:
        """Check that a client may have this state restored; nothing changes.

        Raises:
            DocumentError: it is a state that this simulator cannot have.
            GraphError: the client must not have it.
        """
        try:
            for component in self._components:
                component.check_state(saved.components[type(component).__name__], caller)
        except ValueError as error:
            raise DocumentError(f"state: {error!s:.200}") from None

    def parse(self, state: PlainData, maps: Maps) -> SavedState:
        """Return the state that `SavedState.to_plain` was given. This may be called in any thread.

        Args:
            state: from anywhere.

        Raises:
            DocumentError: it is no state of a simulator like this one.
        """
        fields = read_as(dict[str, Any], state, "state")
        key = MapKey(*read_as(tuple[str, bytes], fields.get("map"), "map"))
        road_map = maps(key)
        known = [self._context.scene.loaded]
        loaded = unpack_load(fields.get("loaded"), maps, known)
        plan = (loaded if loaded.road_map is road_map else road_map).plan
        try:
            world = from_plain(fields.get("world"), road_map.roads, plan)
        except (ValueError, TypeError) as error:
            raise DocumentError(f"{error!s:.200}") from None
        here = self._context.world
        if _models_of(world) != _models_of(here):
            flags = "--dynamics, --creep, --stability-control and --on-collision"
            raise DocumentError(f"world: expected the settings {flags} of this simulator")
        next_uid = read_as(int, fields.get("next_uid"), "next_uid")
        entries = read_as(tuple[tuple[int, str, tuple[Any, ...]], ...], fields.get("waiting"), "waiting")
        check_numbers([frame for frame, _, _ in entries], world, next_uid)
        components = read_as(dict[str, Any], fields.get("components"), "components")
        names = [type(one).__name__ for one in self._components]
        if list(components) != names:
            raise DocumentError(f"components: expected {', '.join(names)}")
        if loaded.spawn_points and not loaded.is_on(road_map):
            raise DocumentError("loaded: expected spawn points on the map in use")
        check_finite(fields.get("egos"), "egos")
        egos = read_as(tuple[EgoState, ...], fields.get("egos"), "egos")
        check_egos(egos, world, self._context.egos.sensor_frames)
        return SavedState(
            world=world,
            found=FoundMap(key.name, road_map),
            loaded=loaded,
            next_uid=next_uid,
            egos=egos,
            waiting=tuple([(frame, source, unpack_action(action, maps, known)) for frame, source, action in entries]),
            components=components,
        )

    def try_out(self, saved: SavedState) -> None:
        """Step a copy of a world that came from outside. This may be called in any thread.

        Its figures are checked one by one, but a step may rely on more: a failure within the simulator would end it.

        Raises:
            DocumentError: a step fails.
        """
        try:
            # No step of a world of ours warns. What is no number once would spread, and no message could carry it.
            with np.errstate(divide="raise", over="raise", invalid="raise"):
                world = World()
                world.restore(saved.world)
                for _ in range(NUM_TRIALS):
                    self._context.stepper.step(world, None)
        except Exception as error:  # noqa: BLE001 - figures from outside, whatever they do
            _log.info("a snapshot was refused: a step of its world fails", exc_info=error)
            raise DocumentError(f"world: a step of it fails: {error!r:.200}") from None

    def _bind_egos(self, saved: SavedState, now: float) -> list[Ego]:
        """Give those egos their topics and services that are not here; return all of them, in order.

        Raises:
            GraphError: a client has given one of the topics another type. Nothing has changed.
        """
        context = self._context
        egos, added = [context.egos.first], []
        try:
            for state in saved.egos[1:]:
                ego = context.egos.find(state.index)
                if ego is None:
                    ego = context.egos.create(state.index, state.uid)
                    added.append(ego)
                    context.ego_interfaces.bind(ego)
                egos.append(ego)
        except PeerError:
            for ego in added:
                context.ego_interfaces.drop(ego, now)
            raise
        return egos

    def _apply(self, saved: SavedState, egos: Sequence[Ego], now: float) -> None:
        """Put a state in place of the present one."""
        context = self._context
        for ego in list(context.egos):
            if ego not in egos:
                context.ego_interfaces.drop(ego, now)
        context.scene.restore(saved.world, loaded=saved.loaded, found=saved.found, next_uid=saved.next_uid)
        for ego, state in zip(egos, saved.egos, strict=True):
            ego.load_state(state)
        context.egos.replace(egos)
        context.publishers.order([ego_prefix(ego.index) for ego in egos[1:]])
        context.sync.replace_waiting(
            [(frame, SceneCommand(action, source, _notify_nobody)) for frame, source, action in saved.waiting]
        )
        context.publishers.forget_repeats()
        context.time.follow()
        for component in self._components:
            component.load_state(saved.components[type(component).__name__], now)
        for forget in context.hooks.on_restore:
            forget()
        context.egos.forget_statuses()
        context.sync_info.announce(now)
        context.static_tf.announce_again(now)


_Rest: TypeAlias = tuple[int, Sequence[EgoState], Sequence[tuple[int, str, SceneAction | None]], dict[str, PlainData]]
"""The next id, the egos, the commands that wait, and the components."""


def _hash(world: World, found: FoundMap, loaded: Load, rest: _Rest) -> str:
    next_uid, egos, waiting, components = rest
    state = blake2b(world.digest(has_scores=False).encode(), digest_size=16)
    state.update(world.model_figures())
    state.update(found.road_map.digest + loaded.packed.digest)
    packed = [(frame, source, None if action is None else pack_action(action)) for frame, source, action in waiting]
    state.update(encode([found.name, next_uid, as_plain(list(egos)), packed, components]))
    return state.hexdigest()


def _models_of(world: World | Snapshot) -> tuple[object, ...]:
    """Return the settings of a world's models, which no snapshot changes."""
    return world.dynamics, world.is_creeping, world.has_stability_control, world.has_impacts


def _notify_nobody(level: str, text: str) -> None:
    """Take what is told about a command of a snapshot: its sender is not known any longer."""
    _log.info("a command of a snapshot: %s: %s", level, text)
