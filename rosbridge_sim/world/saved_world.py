"""A snapshot of the world as plain data and back, for bytes that leave the process.

Roads and signal plans are not in it: they are known by their digests and given by the caller. Bytes from outside may
hold anything, so `from_plain` checks every figure that a step reads as an index or a bound: a snapshot that it returns
can be restored and stepped.
"""

from __future__ import annotations

import math
from dataclasses import astuple, fields
from hashlib import blake2b
from typing import Any, Final, TypeVar

import numpy as np

from rosbridge_sim.world.drivers.lane_position import MAX_WANDER
from rosbridge_sim.world.geometry.planar import BoolArray, FloatArray, IntArray
from rosbridge_sim.world.lane_changes.lane_change_model import MAX_REASON
from rosbridge_sim.world.roads.lane_conflicts import LaneConflicts
from rosbridge_sim.world.roads.paths import END, NUM_COLUMNS, PathsSnapshot
from rosbridge_sim.world.roads.roads import Roads
from rosbridge_sim.world.roads.signal_plan import SignalPlan
from rosbridge_sim.world.roads.signals import FREE, SignalsSnapshot
from rosbridge_sim.world.roads.turn_shares import TurnShares
from rosbridge_sim.world.state.commands import MAX_COMMAND_ACCEL
from rosbridge_sim.world.state.control_columns import BODY_COLUMNS, CONTROL_COLUMNS, update_control_columns
from rosbridge_sim.world.state.entity_arrays import BOOLS, FLOATS, INTS, LANE_CHANGE_COLUMNS, NUM_CORE, EntityArrays
from rosbridge_sim.world.state.entity_types import (
    GRAVITY,
    MAX_COORDINATE,
    MAX_SPEED,
    MIN_FRICTION_SHARE,
    NO_BODY,
    Body,
    Dynamics,
    Gear,
    Kind,
    Mode,
)
from rosbridge_sim.world.state.labels import BOX_COLUMNS, labels_and_boxes
from rosbridge_sim.world.state.world import DT, MAX_UID, Snapshot

Plain = dict[str, Any]  # values of the kinds that `to_plain` writes

LAYOUT: Final = blake2b(repr((FLOATS, INTS, BOOLS, Body.__slots__)).encode(), digest_size=8).digest()
"""Stands for the columns and their order: arrays of another version would be read wrongly."""

MAX_FIGURE: Final = 1e15
"""Bound of a finite figure in the arrays: squares and sums of such figures stay finite."""

MAX_COUNT: Final = 2**62
"""Bound of frames, ids and counters, so that sums stay within int64."""

_MAY_BE_INFINITE: Final = frozenset(
    {
        *("leg_end", "desired_speed", "accel_max", "accel_min", "throttle_max", "target", "jerk_limit"),
        *("time_to_collision", "min_time_to_collision"),
    }
)
_POSITIVE: Final = (
    *("wheelbase", "max_accel", "max_decel", "dynamic_index", "front_stiffness", "rear_stiffness", "grip"),
    "grip_along",
)
"""Columns that the equations of driven rows divide by."""

_LANE_COLUMNS: Final = ("claim", "held", "exit_lane", "behind", "lane", *(f"ahead_{i}" for i in range(1, 6)))
_LANE_CHANGE_CODES: Final = {"signal": 2, "leaving": 2, "came_from": 2, "change": MAX_REASON, "change_since": MAX_COUNT}
MAX_OFFSET: Final = 1e4
"""Bound of offsets from a lane [m], and of their rates and slopes: far beyond any lane beside, but still on the map."""

MOST_SPEED: Final = 2e5
"""Bound of speeds [m/s]. Clients, recordings and impacts give at most `MAX_SPEED` along each axis. No driver, engine or
slope adds more than free fall from one end of the map to the other, sqrt(2 g 2 MAX_COORDINATE) = 1.98e5 m/s."""

MOST_RATE: Final = 1e12
"""Bound of accelerations and rates of turn [m/s^2, rad/s]. Recordings show half a turn in a nanosecond, 3e9 rad/s; in
the kinematic model a car of 1,000 m/s with wheels at 89.9 degrees, 1 mm behind each other, has 6e11 m/s^2."""

_MOST: Final = {
    **dict.fromkeys(("speed", "lateral_speed", "climb", "start_speed"), MOST_SPEED),
    **dict.fromkeys(("accel", "lateral_accel", "climb_accel", "yaw_rate"), MOST_RATE),
    **dict.fromkeys(("yaw_accel", "pitch_rate", "roll_rate"), MOST_RATE / DT),
    **dict.fromkeys(("drive_lag", "brake_lag"), 1.0),
    "grade": GRAVITY,
    "speed_cmd": MAX_SPEED,
    "accel_cmd": MAX_COMMAND_ACCEL,
}
"""Greatest amounts of figures of all entities."""

_MOST_DRIVEN: Final = {
    **dict.fromkeys(("steer", "rear_steer", "steer_cmd", "rear_steer_cmd"), math.pi / 2),
    **dict.fromkeys(("throttle", "brake"), 1.0),
}
"""The same of all but ghosts, which show what was recorded: a `Body` turns its wheels by less, and pedals are 0..1."""

T = TypeVar("T")


def to_plain(saved: Snapshot) -> Plain:
    """Return a snapshot as plain data: numbers, texts, dicts and arrays."""
    names, name_of = _index(saved.names)
    bodies, body_of = _index(saved.bodies)
    paths, signals = saved.paths, saved.signals
    return {
        "frame": saved.frame,
        "seed": saved.seed,
        "next_uid": saved.next_uid,
        "uids": np.array(saved.uids, dtype=np.int64).reshape(-1, 2),
        "names": names,
        "name_of": name_of,
        "bodies": np.array([astuple(body) for body in bodies], dtype=np.float64).reshape(-1, len(fields(Body))),
        "body_of": body_of,
        "floats": saved.floats,
        "ints": saved.ints,
        "bools": saved.bools,
        "segments": paths.segments,
        "keys": paths.keys,
        "spans": np.array([(uid, *span) for uid, span in paths.spans.items()], dtype=np.int64).reshape(-1, 3),
        "next_base": paths.next_base,
        "contacts": saved.contacts,
        "signals_frame": signals.frame,
        "origin": signals.origin,
        "forced": signals.forced,
        "until": signals.until,
        "routes": dict(saved.routes),
        "is_scoring": int(saved.is_scoring),
        "score_digest": _digest_scores(saved.floats, saved.ints, saved.bools, is_scoring=saved.is_scoring),
        "friction_share": saved.friction_share,
        "dynamics": int(saved.dynamics),
        "is_creeping": int(saved.is_creeping),
        "has_stability_control": int(saved.has_stability_control),
        "has_impacts": int(saved.has_impacts),
        "passing": saved.passing,
        "placed_uids": np.array(saved.placed_uids, dtype=np.int64),
        "turn_shares": np.array([] if saved.turn_shares is None else astuple(saved.turn_shares), dtype=np.float64),
    }


def _digest_scores(floats: FloatArray, ints: IntArray, bools: BoolArray, *, is_scoring: bool) -> bytes:
    """Return a digest of the scores: those of bytes from outside are checked by it, because no state hash has them."""
    blocks = [block[num:].tobytes() for block, num in zip((floats, ints, bools), NUM_CORE, strict=True)]
    return blake2b(b"".join([bytes([is_scoring]), *blocks]), digest_size=16).digest()


def from_plain(data: object, roads: Roads, plan: SignalPlan) -> Snapshot:
    """Return the snapshot that `to_plain` was given.

    Args:
        data: from anywhere.
        roads: those that the snapshot was taken on.
        plan: their traffic lights.

    Raises:
        ValueError: it is no such data, or a figure is out of its bounds; the text names it.
    """
    return _Reader(data, roads, plan).snapshot()


def _index(values: tuple[T, ...]) -> tuple[list[T], IntArray]:
    """Return the different values, and for each value its place among them."""
    places: dict[T, int] = {}
    known: dict[int, int] = {}  # by identity, because a body is slow to look up, and many are the same object
    index = []
    for value in values:
        place = known.get(id(value))
        if place is None:
            place = known[id(value)] = places.setdefault(value, len(places))
        index.append(place)
    return list(places), np.array(index, dtype=np.int64)


class _Reader:
    """One snapshot read from plain data; the methods raise ValueError."""

    def __init__(self, data: object, roads: Roads, plan: SignalPlan) -> None:
        _expect(isinstance(data, dict), "world", "a dict")
        assert isinstance(data, dict)
        self._data = data
        self._roads = roads
        self._plan = plan

    def snapshot(self) -> Snapshot:
        """Read all of it."""
        # The blocks first, since all others are judged by them.
        floats = self._array("floats", np.float64, (len(FLOATS), None))
        n = floats.shape[1]
        ints = self._array("ints", np.int64, (len(INTS), n))
        bools = self._array("bools", np.bool_, (len(BOOLS), n))
        frame = self._int("frame", 0, MAX_COUNT)
        uids = self._array("uids", np.int64, (None, 2))
        paths = self._paths()
        routes = self._routes()
        next_uid = self._int("next_uid", 0, MAX_UID + 1)
        self._check_rows(uids, ints, bools, next_uid)
        self._check_floats(floats)
        _check_divisors(floats[:, bools[BOOLS.index("alive")] & (ints[INTS.index("kind")] == Kind.EGO)])
        self._check_ints(ints, bools, paths)
        self._check_legs(floats, ints, bools)
        names, bodies = self._names(n), self._bodies(n)
        self._check_labels(names, bodies, floats, ints, bools)
        _check_amounts(names, floats, ints, bools)
        self._check_controls(floats, ints, bools)
        # Scores: only while they are kept, and only those that this program has written.
        is_scoring = self._int("is_scoring", 0, 1) == 1
        if not is_scoring:
            scores = [block[num:].any() for block, num in zip((floats, ints, bools), NUM_CORE, strict=True)]
            _expect(not any(scores), "is_scoring", "zeros in the columns of scores while none are kept")
        digest = _digest_scores(floats, ints, bools, is_scoring=is_scoring)
        _expect(self._data.get("score_digest") == digest, "score_digest", "that of the scores")
        # Pairs that touch, and what impacts add to them.
        contacts = self._array("contacts", np.int64, (None, 2))
        _expect(bool(np.isin(contacts, uids[:, 0]).all()), "contacts", "ids of entities")
        passing, placed = self._array("passing", np.int64, (None, 2)), self._array("placed_uids", np.int64, (None,))
        _expect(bool(np.isin(passing, contacts).all()), "passing", "pairs of contacts")
        _expect(bool(np.isin(placed, uids[:, 0]).all()), "placed_uids", "ids of entities")
        has_impacts = self._int("has_impacts", 0, 1) == 1
        is_plain = not (len(passing) or len(placed) or floats[FLOATS.index("loose")].any())
        _expect(has_impacts or is_plain, "has_impacts", "nothing of impacts without them")
        loose = floats[FLOATS.index("loose")] != 0.0
        kind = ints[INTS.index("kind")]
        is_driving = bools[BOOLS.index("has_lane")] | bools[BOOLS.index("has_path")]
        is_wrong = loose & (kind != Kind.EGO) & ((kind != Kind.VEHICLE) | is_driving)
        _expect(not bool(is_wrong.any()), "floats.loose", "egos, and vehicles off lanes and paths")
        followers = ints[INTS.index("uid")][bools[BOOLS.index("has_lane")]]
        _expect(set(routes) <= set(followers.tolist()), "routes", "ids of lane followers")
        ahead = ints[INTS.index("ahead_1") : INTS.index("ahead_5") + 1, bools[BOOLS.index("has_lane")]]
        _expect(not bool(((ahead[:-1] < 0) & (ahead[1:] >= 0)).any()), "ints.ahead", "lanes without a gap")
        return Snapshot(
            frame=frame,
            seed=self._int("seed", 0, 2**63 - 1),
            next_uid=next_uid,
            uids=tuple([(uid, row) for uid, row in uids.tolist()]),
            names=names,
            bodies=bodies,
            floats=floats,
            ints=ints,
            bools=bools,
            paths=paths,
            contacts=contacts,
            roads=self._roads,
            signals=self._signals(frame),
            routes=routes,
            dynamics=Dynamics(self._int("dynamics", min(Dynamics), max(Dynamics))),
            is_creeping=self._int("is_creeping", 0, 1) == 1,
            has_stability_control=self._int("has_stability_control", 0, 1) == 1,
            has_impacts=has_impacts,
            passing=passing,
            placed_uids=tuple(placed.tolist()),
            turn_shares=self._turn_shares(),
            is_scoring=is_scoring,
            friction_share=self._friction_share(),
        )

    # Parts

    def _check_rows(self, uids: IntArray, ints: IntArray, bools: Any, next_uid: int) -> None:  # noqa: ANN401 - of bools
        alive = bools[BOOLS.index("alive")]
        rows, ids = uids[:, 1], uids[:, 0]
        n = len(alive)
        is_good = (
            len(np.unique(rows)) == len(rows) == int(alive.sum())
            and len(np.unique(ids)) == len(ids)
            and bool(((rows >= 0) & (rows < n)).all())
            and bool(((ids >= 0) & (ids < max(next_uid, 1))).all())
            and bool(alive[rows].all())
            and bool((ints[INTS.index("uid"), rows] == ids).all())
        )
        _expect(is_good, "uids", "each id with the row that it is in")
        free = ~alive
        _expect(not (ints[:, free].any() or bools[:, free].any()), "ints", "zeros in free rows")

    def _check_labels(
        self,
        names: tuple[str, ...],
        bodies: tuple[Body, ...],
        floats: FloatArray,
        ints: IntArray,
        bools: Any,  # noqa: ANN401 - of bools
    ) -> None:
        """Check labels, of which alone a digest knows names and bodies, and the columns that follow from bodies."""
        alive = bools[BOOLS.index("alive")]
        rows, free = alive.nonzero()[0], (~alive).nonzero()[0].tolist()
        labels, boxes = labels_and_boxes([names[i] for i in rows.tolist()], [bodies[i] for i in rows.tolist()])
        is_good = bool((ints[INTS.index("label"), rows] == labels).all())
        is_good = is_good and all((names[i], bodies[i]) == ("", NO_BODY) for i in free)
        _expect(is_good, "bodies", "names and bodies with the labels of their rows")
        for name, values in zip(BOX_COLUMNS, boxes, strict=True):
            _expect(bool((floats[FLOATS.index(name), rows] == values).all()), f"floats.{name}", "boxes of bodies")
        egos = (alive & (ints[INTS.index("kind")] == Kind.EGO)).nonzero()[0].tolist()
        for name, figure in BODY_COLUMNS.items():
            values = [getattr(bodies[i], figure) for i in egos]
            _expect(floats[FLOATS.index(name), egos].tolist() == values, f"floats.{name}", "figures of egos' bodies")

    def _check_floats(self, floats: FloatArray) -> None:
        _expect(not bool(np.isnan(floats).any()), "floats", "numbers")
        is_finite = np.abs(floats) <= MAX_FIGURE
        for i in np.flatnonzero(~is_finite.all(axis=1)).tolist():
            is_allowed = FLOATS[i] in _MAY_BE_INFINITE and bool((is_finite[i] | np.isinf(floats[i])).all())
            _expect(is_allowed, f"floats.{FLOATS[i]}", f"figures within +-{MAX_FIGURE:g}")
        way = floats[FLOATS.index("arc")] - floats[FLOATS.index("leg_start")]
        for name in "xyz":
            by_leg = floats[FLOATS.index(f"leg_{name}")] + way * floats[FLOATS.index(f"leg_d{name}")]
            for place in (floats[FLOATS.index(name)], by_leg):
                # A step may move an entity past the bound that holds for a placement.
                is_near = np.abs(place) <= 2 * MAX_COORDINATE
                _expect(bool(is_near.all()), f"floats.{name}", "a place on the map")
        for name in LANE_CHANGE_COLUMNS:
            is_near = np.abs(floats[FLOATS.index(name)]) <= MAX_OFFSET
            _expect(bool(is_near.all()), f"floats.{name}", f"figures within +-{MAX_OFFSET:g}")
        _expect(not bool((floats[FLOATS.index("desired_speed")] < 0.0).any()), "floats.desired_speed", "speeds >= 0")
        width = floats[FLOATS.index("wander_width")]
        _expect(bool(((width >= 0.0) & (width <= MAX_WANDER)).all()), "floats.wander_width", f"0..{MAX_WANDER:g} m")
        left = floats[FLOATS.index("lateral_left")]
        _expect(bool(((left >= 0.0) & (left <= 1.0)).all()), "floats.lateral_left", "shares 0..1")

    def _check_ints(self, ints: IntArray, bools: Any, paths: PathsSnapshot) -> None:  # noqa: ANN401 - of bools
        alive, has_lane = bools[BOOLS.index("alive")], bools[BOOLS.index("has_lane")]
        has_path = bools[BOOLS.index("has_path")]

        def column(name: str) -> IntArray:
            return np.asarray(ints[INTS.index(name)])

        def within(name: str, low: int, high: int, rows: Any = alive) -> None:  # noqa: ANN401 - of bools
            values = column(name)[rows]
            _expect(bool(((values >= low) & (values <= high)).all()), f"ints.{name}", f"{low}..{high}")

        within("kind", min(Kind), max(Kind))
        within("gear", min(Gear), max(Gear))
        within("mode", min(Mode), max(Mode))
        within("label", 0, 2**63 - 1)
        within("turns", 0, MAX_COUNT)
        within("yields", 0, MAX_COUNT)
        within("yields", 0, 0, alive & ~has_path)
        for name, most in _LANE_CHANGE_CODES.items():
            within(name, 0, most)
        for name in _LANE_COLUMNS:
            within(name, -1, len(self._roads) - 1, has_lane)
            within(name, -1, max(0, len(self._roads) - 1))
        within("lane", 0, len(self._roads) - 1, has_lane)
        for name in ("near_lane", "open_line"):
            within(name, 0, len(self._roads))
        for name in INTS[NUM_CORE[1] : INTS.index("near_lane")]:
            within(name, 0, MAX_COUNT)
        for name in INTS[INTS.index("contact_1") :]:
            within(name, 0, MAX_UID + 1)
        within("point", 0, max(0, len(self._roads.points) - 2))
        followers = set(column("uid")[has_path].tolist())
        _expect(set(paths.spans) == followers, "spans", "a path for each entity on one")
        for uid, base in zip(column("uid")[has_path].tolist(), column("path_base")[has_path].tolist(), strict=True):
            _expect(base == int(paths.keys[paths.spans[uid][0]]), "ints.path_base", "the keys of paths")
        within("path_base", 0, 0, alive & ~has_path)

    def _check_legs(self, floats: FloatArray, ints: IntArray, bools: Any) -> None:  # noqa: ANN401 - of bools
        """Check that lane followers are on legs of their lanes: a step takes the leg at the next point unseen."""
        roads = self._roads
        # An ego that has begun to drive itself is on an endless leg until the next decision.
        waits = (ints[INTS.index("kind")] == Kind.EGO) & np.isinf(floats[FLOATS.index("leg_end")])
        rows = (bools[BOOLS.index("has_lane")] & ~waits).nonzero()[0]
        if not len(rows):
            return
        lane, point = ints[INTS.index("lane"), rows], ints[INTS.index("point"), rows]
        is_on = (roads.first[lane] <= point) & (point <= roads.last_leg[lane])
        _expect(bool(is_on.all()), "ints.point", "points of the lanes, with another one behind each")
        legs = floats[FLOATS.index("leg_start") : FLOATS.index("leg_dz") + 1, rows]
        is_own = legs == roads.derived(LaneConflicts).legs.take(point, axis=0).T
        _expect(bool(is_own.all()), "floats.leg", "the legs at the points")

    def _check_controls(self, floats: FloatArray, ints: IntArray, bools: Any) -> None:  # noqa: ANN401 - of bools
        """Check the columns of egos that follow from gears, modes and commands: equations have no bounds for them."""
        egos = (bools[BOOLS.index("alive")] & (ints[INTS.index("kind")] == Kind.EGO)).nonzero()[0]
        arrays = EntityArrays(len(egos))
        arrays.block(FLOATS[0], FLOATS[-1])[:] = floats[:, egos]
        arrays.int_block(INTS[0], INTS[-1])[:] = ints[:, egos]
        for i in range(len(egos)):
            update_control_columns(arrays, i, is_creeping=self._int("is_creeping", 0, 1) == 1)
        for name in CONTROL_COLUMNS:
            is_own = getattr(arrays, name) == floats[FLOATS.index(name), egos]
            _expect(bool(is_own.all()), f"floats.{name}", "figures of gears, modes and commands")

    def _paths(self) -> PathsSnapshot:
        segments = self._array("segments", np.float64, (None, NUM_COLUMNS))
        keys = self._array("keys", np.int64, (len(segments),))
        spans = self._array("spans", np.int64, (None, 3))
        _expect(not bool(np.isnan(segments).any()), "segments", "numbers")
        _expect(bool((np.abs(segments) <= MAX_FIGURE).all()), "segments", "finite figures")
        next_base = self._int("next_base", 0, MAX_COUNT)
        is_rising = bool((np.diff(keys) >= 0).all())
        is_within = not len(keys) or (int(keys[0]) >= 0 and int(keys[-1]) < max(next_base, 1))
        _expect(is_rising and is_within, "keys", "rising keys")
        first, count = spans[:, 1], spans[:, 2]
        is_good = bool(((first >= 0) & (count > 0) & (first + count <= len(keys))).all())
        is_good = is_good and bool((first[1:] >= (first + count)[:-1]).all())
        is_good = is_good and len(np.unique(spans[:, 0])) == len(spans)
        _expect(is_good, "spans", "one run of segments for each path")
        if len(spans):
            _expect(bool((segments[first + count - 1, END] > 0.0).all()), "segments", "paths with a length")
        return PathsSnapshot(segments, keys, {uid: (start, num) for uid, start, num in spans.tolist()}, next_base)

    def _routes(self) -> dict[int, IntArray]:
        routes = self._data.get("routes")
        _expect(isinstance(routes, dict), "routes", "a dict")
        assert isinstance(routes, dict)
        for uid, lanes in routes.items():
            is_good = isinstance(uid, int) and isinstance(lanes, np.ndarray) and lanes.dtype == np.int64
            is_good = is_good and lanes.ndim == 1 and len(lanes) > 0
            is_good = is_good and bool(((lanes >= 0) & (lanes < len(self._roads))).all())
            _expect(is_good, "routes", "rows of lanes")
        return routes

    def _names(self, n: int) -> tuple[str, ...]:
        names = self._data.get("names")
        _expect(isinstance(names, list) and all(isinstance(name, str) for name in names), "names", "texts")
        assert isinstance(names, list)
        return tuple([names[i] for i in self._places("name_of", n, len(names))])

    def _bodies(self, n: int) -> tuple[Body, ...]:
        rows = self._array("bodies", np.float64, (None, len(fields(Body)))).tolist()
        bodies = [Body(*row) for row in rows]  # it checks its figures
        bodies = [NO_BODY if body == NO_BODY else body for body in bodies]
        return tuple([bodies[i] for i in self._places("body_of", n, len(bodies))])

    def _places(self, name: str, n: int, num: int) -> list[int]:
        places = self._array(name, np.int64, (n,))
        _expect(bool(((places >= 0) & (places < num)).all()), name, f"places below {num}")
        found: list[int] = places.tolist()
        return found

    def _signals(self, frame: int) -> SignalsSnapshot:
        plan = self._plan
        origin = self._array("origin", np.int64, (len(plan.controllers),))
        forced = self._array("forced", np.int64, (plan.num_groups,))
        until = self._array("until", np.int64, (plan.num_groups,))
        for name, values in (("origin", origin), ("forced", forced), ("until", until)):
            _expect(bool((np.abs(values) <= MAX_COUNT).all()), name, "frames and lamps")
        _expect(self._int("signals_frame", 0, MAX_COUNT) == frame, "signals_frame", "the frame of the world")
        into, is_forced = frame - origin, until > frame
        _expect(bool(((into >= 0) & (into < plan.cycle)).all()), "origin", "a begin of the present cycle")
        _expect(bool((is_forced | (until == FREE)).all()), "until", f"a later frame, or {FREE}")
        _expect(bool((is_forced | (forced == 0)).all()), "forced", "0 for a light that is not forced")
        return SignalsSnapshot(plan, frame, origin, forced, until)

    def _friction_share(self) -> float:
        share = self._data.get("friction_share")
        is_good = type(share) is float and MIN_FRICTION_SHARE <= share <= 1.0
        _expect(is_good, "friction_share", f"{MIN_FRICTION_SHARE:g}..1")
        assert isinstance(share, float)
        return share

    def _turn_shares(self) -> TurnShares | None:
        shares = self._array("turn_shares", np.float64, (None,)).tolist()
        if not shares:
            return None
        _expect(len(shares) == len(fields(TurnShares)), "turn_shares", "three shares, or none")
        return TurnShares(*shares)  # it checks its figures

    # Values

    def _int(self, name: str, low: int, high: int) -> int:
        value = self._data.get(name)
        _expect(type(value) is int and low <= value <= high, name, f"{low}..{high}")
        assert isinstance(value, int)
        return value

    def _array(self, name: str, kind: Any, shape: tuple[int | None, ...]) -> Any:  # noqa: ANN401 - numpy's types
        value = self._data.get(name)
        is_good = isinstance(value, np.ndarray) and value.dtype == kind and value.ndim == len(shape)
        _expect(is_good, name, f"an array of {np.dtype(kind).name}")
        assert isinstance(value, np.ndarray)
        is_good = all(want is None or want == got for want, got in zip(shape, value.shape, strict=True))
        _expect(is_good, name, f"the shape {shape}, got {value.shape}")
        return value


def _expect(is_good: bool, name: str, expected: str) -> None:  # noqa: FBT001 - an assertion
    if not is_good:
        raise ValueError(f"world.{name}: expected {expected}")


def _check_amounts(names: tuple[str, ...], floats: FloatArray, ints: IntArray, bools: BoolArray) -> None:
    """Check that no figure is greater than it can become in any world."""
    is_ghost, ids = bools[BOOLS.index("is_ghost")], ints[INTS.index("uid")]
    for name, most in (_MOST | _MOST_DRIVEN).items():
        figures = floats[FLOATS.index(name)]
        for row in np.flatnonzero((np.abs(figures) > most) & ~(is_ghost & (name in _MOST_DRIVEN))).tolist():
            told = f"a figure within +-{most:g} of entity {ids[row]} {names[row][:80]!r}, got {figures[row]:g}"
            _expect(is_good=False, name=f"floats.{name}", expected=told)


def _check_divisors(egos: FloatArray) -> None:
    """Check the columns of egos that equations divide by."""
    for name in _POSITIVE:
        _expect(bool((egos[FLOATS.index(name)] > 0.0).all()), f"floats.{name}", "positive figures of egos")
    load = egos[FLOATS.index("front_load")]
    _expect(bool(((load > 0.0) & (load < 1.0)).all()), "floats.front_load", "shares of egos")
