"""Traffic that comes and goes: the spawn points of the scenario, and `--traffic N`.

Both make vehicles that follow the lanes, and take them away again: at the goal of their spawn point, or where a road
ends. They act five times a second behind a frame. What chance decides is a function of the world's seed, the number of
the spawn point and the number of the vehicle. So a run repeats, and no other chance in the world changes.

The component's state is when the next vehicle is due at each point, how many each has made, and which vehicles are
whose. Spawn points are those of the load that made the scene; a load that removes nothing brings none.
"""

from __future__ import annotations

import logging
import math
from collections import Counter
from collections.abc import Callable
from functools import partial
from hashlib import blake2b
from typing import Final

import numpy as np

from rosbridge_sim.scenarios.catalogue import Catalogue, Model
from rosbridge_sim.scenarios.scenario import Spawn
from rosbridge_sim.scenarios.spawn_points import SpawnPoint
from rosbridge_sim.simulator.kernel.component import Component
from rosbridge_sim.simulator.kernel.hooks import Hooks
from rosbridge_sim.simulator.plain.plain_bytes import PlainData
from rosbridge_sim.simulator.scene.load import Load
from rosbridge_sim.simulator.scene.scene import Scene
from rosbridge_sim.simulator.scene.scene_limits import MAX_ENTITIES
from rosbridge_sim.world.demand import LaneSlots, has_room, keep_clear, safe_speed_at, stand_at_ends
from rosbridge_sim.world.drivers.lane_position import LaneStart, keep_lanes
from rosbridge_sim.world.drivers.lane_wander import USUAL_WANDER
from rosbridge_sim.world.roads.routing import KnownRoutes
from rosbridge_sim.world.state.world import Kind, in_frames

MAX_TRAFFIC: Final = 10_000
"""Largest `--traffic`: what one step is made for."""

INTERVAL: Final = 10
"""Frames from one look to the next: 0.2 s, in which a vehicle on a motorway drives 7 m."""

COUNT_INTERVAL: Final = 50
"""Frames from one count of the vehicles to the next: others may remove some, too."""

RETRY: Final = 25
"""Frames until a point tries again that had no room: half a second, in which a queue moves by a metre or two."""

MAX_DUE: Final = 100
"""Points that are looked at in one frame, at most: about 20 ms. The others wait for the next look."""

MEAN_ABSENCE: Final = 10.0
"""A vehicle of `--traffic` that has left is replaced after this time on average [s]; arrivals are a Poisson process."""

ARRIVAL_GAP: Final = 10.0
"""Room before and behind a replacement [m]."""

ARRIVAL_TIME: Final = 3.0
"""Its least time to a collision [s]: nobody brakes firmly for it."""

OUT_OF_SIGHT: Final = 60.0
"""A replacement appears at least this far from all egos [m], unless it comes in at the edge of the map."""

TRIES: Final = 8
"""Slots that a replacement tries at once."""

CLEAR: Final = 8.0
"""Room between a slot and what is there already [m]."""

AT_END: Final = 3.0
"""A vehicle at rest this near to the end of a road has come to it [m]."""

MAX_COUNT: Final = 2**62
"""Bound of frames and counts in a state, as in `world.saved_world`: what is added to them stays within int64."""

MIX: Final = (
    # Names of the catalogue and shares in percent: about the traffic counts of towns, with fewer trucks.
    *(("2015_Kia_K5", 18), ("2016_Kia_Niro(HEV)", 14), ("2021_VW_Golf_GTI", 14), ("Hyundai_Ioniq_5", 12)),
    *(("2016_Hyundai_Ioniq", 10), ("2014_Kia_K7", 8), ("2016_Genesis_DH", 8), ("2020_Kia_Stinger", 4)),
    *(("Van", 5), ("Truck", 3), ("Bus", 2), ("Motorcycle", 2)),
)

NUM_PARTS: Final = 4
"""The mean of four uniform numbers is nearly Gaussian, and stays within its bounds."""

_FILL: Final = -1
"""Number of `--traffic` where spawn points have theirs."""

_log = logging.getLogger("rosbridge_sim.morai")


class Traffic(Component):
    """The component of spawn points and of `--traffic`."""

    def __init__(
        self, scene: Scene, hooks: Hooks, on_change: Callable[[], None], num: int = 0, *, wanders: bool = True
    ) -> None:
        """Fill the opening scene.

        Args:
            scene: the opening one.
            hooks: the moments at which traffic acts.
            on_change: called when vehicles have come or gone: messages about them are to be made anew.
            num: vehicles on the lanes besides those of the scenario, at most; 0 for none.
            wanders: these vehicles wander within their lanes.
        """
        self._scene, self._world, self._hooks, self._on_change = scene, scene.world, hooks, on_change
        self._wander = USUAL_WANDER if wanders else 0.0
        self._wanted = num
        self._mix = _read_mix(scene.catalogue)
        self._load: Load | None = None
        self._due: list[int] = []
        self._num_made: list[int] = []
        self._fill_due, self._fill_made, self._target = 0, 0, 0
        self._owner: dict[int, int] = {}
        self._routes: dict[int, tuple[int, ...]] = {}
        hooks.after_frame.append(self._act)
        hooks.on_reset.append(self._forget)
        hooks.on_new_scene.append(self._begin)
        self._begin(0.0)

    # State

    @property
    def is_active(self) -> bool:
        """True if vehicles come and go."""
        return bool(self._points or self._target)

    @property
    def is_settled(self) -> bool:
        """True if nothing is due: a look changes nothing until a vehicle comes to the end of its road, or is removed.

        A vehicle that something else has removed is missed at a frame of `COUNT_INTERVAL`.
        """
        return self._fill_due == 0 and not self._points and self._num_filled() == self._target

    def save_state(self) -> PlainData:
        """Return when each point is due, what it has made, and which vehicles are whose."""
        if not self.is_active:
            return None
        return (
            np.array(self._due, dtype=np.int64),
            np.array(self._num_made, dtype=np.int64),
            np.array([self._fill_due, self._fill_made, self._target], dtype=np.int64),
            np.array(list(self._owner.items()), dtype=np.int64).reshape(-1, 2),
        )

    def load_state(self, data: PlainData, now: float) -> None:  # noqa: ARG002 - the interface has it
        """Become what was saved."""
        self._hooks.after_frame.wake(self._act)
        self._load = self._scene.loaded
        self._routes = {}
        num = len(self._points)
        if data is None:
            self._due, self._num_made, self._owner = [0] * num, [0] * num, {}
            self._fill_due = self._fill_made = self._target = 0
            if num:
                raise ValueError("expected the state of the spawn points")
            return
        if not isinstance(data, (tuple, list)) or not all(isinstance(part, np.ndarray) for part in data):
            raise ValueError("expected arrays")
        parts = [part for part in data if isinstance(part, np.ndarray)]
        if len(parts) != 4:  # noqa: PLR2004 - as `save_state` returns them
            raise ValueError("expected four arrays")
        due, made, fill, owner = parts
        shapes = [part.shape for part in parts]
        if any(part.dtype != np.int64 for part in parts) or shapes[:3] != [(num,), (num,), (3,)]:
            raise ValueError(f"expected whole numbers for {num} spawn points")
        if len(shapes[3]) != 2 or shapes[3][1] != 2 or shapes[3][0] > MAX_ENTITIES:  # noqa: PLR2004 - id and owner
            raise ValueError("expected pairs of an id and the number of a spawn point")
        counts = [*due.tolist(), *made.tolist(), *fill.tolist()]
        if not (min(counts) >= 0 and max(counts) <= MAX_COUNT and fill[2] <= MAX_TRAFFIC):
            raise ValueError(f"expected frames and counts 0..{MAX_COUNT}, and at most {MAX_TRAFFIC} vehicles")
        if len(owner) and not (owner[:, 1].min() >= _FILL and owner[:, 1].max() < num):
            raise ValueError("expected numbers of spawn points")
        self._due, self._num_made = due.tolist(), made.tolist()
        self._fill_due, self._fill_made, self._target = fill.tolist()
        self._owner = dict(owner.tolist())

    @property
    def _points(self) -> tuple[SpawnPoint, ...]:
        return self._scene.loaded.spawn_points

    def _forget(self) -> None:
        """Begin anew: the world is that of frame 0."""
        self._load = None

    def _begin(self, _now: float) -> None:
        """Follow a new scene; a load that left the scene as it was changes nothing but the number of vehicles."""
        scene, world = self._scene, self._world
        self._hooks.after_frame.wake(self._act)
        if self._load is None:
            self._owner = {}
            self._fill_made = 0
        self._owner = {uid: owner for uid, owner in self._owner.items() if uid in world}
        if scene.loaded is not self._load:
            self._load = scene.loaded
            self._routes = {}
            self._owner = {uid: owner for uid, owner in self._owner.items() if owner == _FILL}
            self._num_made = [0] * len(self._points)
            self._due = [world.frame + self._first_wait(i, point) for i, point in enumerate(self._points)]
            self._fill()

    # Spawn points

    def _act(self, _now: float) -> None:
        """Take away what has arrived, and add what is due."""
        if not self._points and not self._target:
            self._hooks.after_frame.rest(self._act)
            return
        world = self._world
        if world.frame % INTERVAL or self._scene.is_replaying:
            return
        if world.frame % COUNT_INTERVAL == 0:
            self._owner = {uid: owner for uid, owner in self._owner.items() if uid in world}
        num = len(world)
        self._remove_arrived()
        if self._points:
            self._serve_due()
        if self._target:
            self._replace_missing()
        if len(world) != num:
            self._on_change()

    def _serve_due(self) -> None:
        """Add the vehicles of the spawn points that are due."""
        frame = self._world.frame
        due = [i for i in range(len(self._points)) if frame >= self._due[i]]
        if len(due) > MAX_DUE:  # those that have waited longest come first, so all have their turn
            due = sorted(sorted(due, key=self._due.__getitem__)[:MAX_DUE])
        there = Counter(self._owner.values()) if due else Counter[int]()
        for i in due:
            self._serve(i, self._points[i], there[i])

    def _first_wait(self, number: int, point: SpawnPoint) -> int:
        """Return the frames until the first vehicle of a point."""
        return in_frames(point.wait) if point.wait >= 0.0 else self._period(number, point)

    def _period(self, number: int, point: SpawnPoint) -> int:
        """Return the frames from a vehicle to the next one; the number of vehicles made so far chooses."""
        return max(in_frames(_between(*point.period, self._chance(number, "period"))), 1)

    def _chance(self, number: int, question: str) -> float:
        """Return a number from 0 to below 1 for the next vehicle of a point."""
        made = self._fill_made if number == _FILL else self._num_made[number]
        text = f"{self._world.seed} {number} {made} {question}"
        return int.from_bytes(blake2b(text.encode(), digest_size=6).digest()) / 2.0**48

    def _bell(self, number: int) -> float:
        """Return a number from 0 to below 1 for the next vehicle's offset, with a bell-shaped distribution."""
        return sum(self._chance(number, f"offset {i}") for i in range(NUM_PARTS)) / NUM_PARTS

    def _serve(self, number: int, point: SpawnPoint, num_there: int) -> None:
        """Add the vehicle that is due at a point, of which some are there; without room it has to wait."""
        world = self._world
        roads = world.roads
        model = point.models[int(self._chance(number, "model") * len(point.models))]
        low, high = point.desired_speed
        desired = _between(low, high, self._chance(number, "desired speed"))
        limit = safe_speed_at(roads, point.lane, point.s)
        speed = min(_between(*point.speed, self._chance(number, "speed")), desired, limit)
        has_place = num_there < point.num
        if not has_place or not has_room(world, point.lane, point.s, model.body, speed, gap=point.gap, time=point.time):
            self._due[number] = world.frame + RETRY
            return
        route, lateral = self._route(number, point), _between(*point.lateral, self._bell(number))
        start = partial(LaneStart, changes_lanes=point.changes_lanes, lateral=lateral)
        uid = self._add(model, speed, lambda row: start(row, point.lane, point.s, desired, route))
        if uid is None:
            self._due[number] = world.frame + RETRY
            return
        self._owner[uid] = number
        self._num_made[number] += 1
        self._due[number] = world.frame + self._period(number, point)

    def _route(self, number: int, point: SpawnPoint) -> tuple[int, ...]:
        """Return the lanes from a point to its goal; none if it has no goal or no way leads there."""
        if number not in self._routes:
            way = None
            if point.goal_lane >= 0:
                routes = self._world.roads.derived(KnownRoutes)
                way = routes.find(point.lane, point.s, point.goal_lane, point.goal_s)
                if way is None:
                    _log.warning("%s: no way leads to its destination; its vehicles turn at random", point.where)
            self._routes[number] = () if way is None else way.lanes
        return self._routes[number]

    def _remove_arrived(self) -> None:
        """Take away the vehicles that have come to their goal, or to the end of a road."""
        world, points = self._world, self._points
        if not self._owner:
            return
        rows = stand_at_ends(world).nonzero()[0]
        if not points and not len(rows):
            return
        length = world.roads.length[world.lane[rows]]
        rows = rows[world.arc[rows] + world.half_length[rows] + world.centre[rows] > length - AT_END]
        gone = [uid for uid in world.uid[rows].tolist() if uid in self._owner]
        for uid, number in self._owner.items() if points else ():
            if number < 0 or points[number].goal_lane < 0 or uid not in world:
                continue
            row, point = world.row(uid), points[number]
            num = len(self._route(number, point))
            is_there = world.lane[row] == point.goal_lane and world.arc[row] >= point.goal_s
            # On a way that comes back to its first lane, the goal on that lane is reached at the end of the way alone.
            if num and world.has_lane[row] and (world.turns[row] >= num or (is_there and world.turns[row] >= num - 1)):
                gone.append(uid)
        for uid in dict.fromkeys(gone):
            self._scene.remove(uid)
            del self._owner[uid]

    def _add(self, model: Model, speed: float, start: Callable[[int], LaneStart]) -> int | None:
        """Add a vehicle to a lane, by its row; return its id, or None if the world is full."""
        scene, world = self._scene, self._world
        if len(world) >= MAX_ENTITIES:
            return None
        # It is put onto its lane afterwards.
        uid = scene.add_agent(Spawn(Kind.VEHICLE, model, model.name, None, 0.0, 0.0, 0.0, 0.0, speed))
        keep_lanes(world, [start(world.row(uid))])
        return uid

    # --traffic

    def _fill(self) -> None:
        """Put vehicles onto the lanes, up to the wanted number, and tell how many there are."""
        if not self._wanted:
            return
        scene, world = self._scene, self._world
        slots = world.roads.derived(LaneSlots.of)
        num_there = self._num_filled()
        free = np.flatnonzero(keep_clear(world, slots, CLEAR))
        order = np.random.Generator(np.random.PCG64((world.seed, world.frame))).permutation(len(free))
        num = min(self._wanted - num_there, len(free), MAX_ENTITIES - len(world))
        chosen = free[order[: max(num, 0)]]
        models = []
        for _ in range(len(chosen)):
            models.append(self._choose_model())
            self._fill_made += 1
        wander = self._wander
        with scene.all_or_none(), world.room_for(len(chosen)):
            rows = scene.add_vehicles(models, slots.speed[chosen])
            places = zip(rows.tolist(), slots.lane[chosen].tolist(), slots.s[chosen].tolist(), strict=True)
            keep_lanes(world, [LaneStart(row, lane, s, wander=wander) for row, lane, s in places])
        self._owner.update(dict.fromkeys(world.uid[rows].tolist(), _FILL))
        self._target = num_there + len(chosen)
        self._fill_due = 0
        level = logging.INFO if self._target == self._wanted else logging.WARNING
        _log.log(level, "traffic: %d of %d fit on the lanes of %s", self._target, self._wanted, scene.road_map.name)

    def _num_filled(self) -> int:
        """Return the number of vehicles of `--traffic`."""
        return list(self._owner.values()).count(_FILL)

    def _replace_missing(self) -> None:
        """Bring a vehicle for one that has left, some time later; its place is random and out of sight."""
        world = self._world
        num_missing = self._target - self._num_filled()
        if num_missing <= 0:
            self._fill_due = 0
            return
        if self._fill_due == 0:
            wait = -math.log(1.0 - self._chance(_FILL, "arrival")) * MEAN_ABSENCE / num_missing
            self._fill_due = world.frame + max(in_frames(wait), 1)
        if world.frame < self._fill_due:
            return
        slots = world.roads.derived(LaneSlots.of)
        model = self._choose_model()
        places = np.flatnonzero(slots.is_entry) if slots.is_entry.any() else np.arange(len(slots.lane))
        for i in range(TRIES if len(places) else 0):
            slot = int(places[int(self._chance(_FILL, f"slot {i} {world.frame}") * len(places))])
            lane, s, speed = int(slots.lane[slot]), float(slots.s[slot]), float(slots.speed[slot])
            if (slots.is_entry[slot] or self._is_out_of_sight(slots, slot)) and has_room(
                world, lane, s, model.body, speed, gap=ARRIVAL_GAP, time=ARRIVAL_TIME
            ):
                place = partial(LaneStart, lane=lane, s=s, wander=self._wander)
                uid = self._add(model, speed, place)
                if uid is not None:
                    self._owner[uid] = _FILL
                    self._fill_made += 1
                    self._fill_due = 0
                return
        self._fill_due = world.frame + RETRY

    def _is_out_of_sight(self, slots: LaneSlots, slot: int) -> bool:
        world = self._world
        egos = world.rows(Kind.EGO)
        away = np.hypot(world.x[egos] - slots.x[slot], world.y[egos] - slots.y[slot])
        return not (away < OUT_OF_SIGHT).any()

    def _choose_model(self) -> Model:
        share = self._chance(_FILL, "model") * self._mix[-1][1]
        return next(model for model, upto in self._mix if share < upto)


def _read_mix(catalogue: Catalogue) -> list[tuple[Model, float]]:
    """Return the models of `--traffic`, each with the sum of the shares up to it."""
    total, found = 0.0, []
    for name, share in MIX:
        model = catalogue.find(name)
        if model is not None and model.kind is Kind.VEHICLE:  # a table of the user's may give the name another meaning
            total += share
            found.append((model, total))
    return found


def _between(low: float, high: float, share: float) -> float:
    return low if low == high else low + (high - low) * share
