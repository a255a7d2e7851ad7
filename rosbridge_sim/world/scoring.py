"""Scores: what a driving stack is judged by, kept for each ego while `World.is_scoring`.

Everything is judged once for each frame, at its end, from the motion within it; a row that is placed elsewhere between
two frames has driven over nothing. All counts begin at `score_since`: the frame at which scoring began, or the ego
came. The figures are columns of the world, so they are part of snapshots and digests. Definitions:

- *Distance* [m]: |v0 + v1| / 2 * dt, which is exactly the arc that `dynamics` drives; forward and backward alike.
- *Collision*: a new contact: another entity is in contact with the ego (see `collisions`) and was not in the frame
  before. The ids of the latest `NUM_IDS` are kept.
- *Stop line*: the middle of the front bumper has come over it, forward and within the edges of its lane (see
  `stop_lines`). *Red light*: the light of the lane really taken was red in that frame. Yellow is no red.
- *Lane*: that nearest to the middle of the box, where another direction counts as farther away (`Roads.nearest`). The
  *distance to the lane's middle* [m] is that of the middle of the box from the lane's line, left positive; 0 off the
  road. Mean and greatest amount are over the frames on the road.
- *Lane invasion*: the box begins to reach over an edge of its lane that one may not cross: there is no lane on that
  side that one may change into. It counts once, until the box is back by `BACK_INSIDE`. A change over an edge that one
  may cross is none. Within `NO_EDGES` of a place where lanes fork or join, and on the lanes of an intersection with
  lights, no edges are painted, and nothing is counted.
- *Off the road*: the middle of the box is within the edges of no lane, of any direction. A map without lanes has no
  road to leave.
- *Time to collision* [s] (Hayward 1972): see `time_to_collision`.
- *Jerk* [m/s^3]: change of the forward acceleration over the step, divided by dt. Pedals act here within a frame, so a
  sudden pedal is a single high peak. For comfort the root mean square says more; ISO 15622 allows 2.5 to 5 m/s^3.
- *Lateral acceleration* [m/s^2]: speed * yaw rate at the rear axle; above 2 to 3 it is uncomfortable.

Nothing depends on rows or on the other egos: many egos together get the bits that each alone would get.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final, Protocol

import numpy as np

from rosbridge_sim.records import Record
from rosbridge_sim.world.contacts.collisions import POSE_SPEED, POSE_X, POSE_Y, POSE_YAW, CollisionDetector, pair_codes
from rosbridge_sim.world.contacts.time_to_collision import find_times_to_collision
from rosbridge_sim.world.geometry.planar import BoolArray, ComplexArray, FloatArray, IntArray, is_among, run_of
from rosbridge_sim.world.roads.roads import LanePlaces, Roads
from rosbridge_sim.world.roads.stop_lines import StopLines, find_red_lanes, settle
from rosbridge_sim.world.state.loop_maker import LoopMaker
from rosbridge_sim.world.state.world import DT, MAX_UID, Kind
from rosbridge_sim.world.state.world_rows import WorldRows
from rosbridge_sim.world.vehicle.ground import are_on_road

NUM_IDS: Final = 8
"""Ids of contacts that are kept for each ego: enough to see what it has run into, and bounded."""

BACK_INSIDE: Final = 0.1
"""A box is back within an edge if it is this far from it [m], so that one that drives on the edge counts once."""

SIDEWAYS: Final = 1.0
"""A lane whose line is farther to one side by this than the lane before is beside that one [m]; lanes that follow one
another or fork lead on from the same point."""

NO_EDGES: Final = 30.0
"""Length of a lane, from where it forks off or up to where it joins others, on which it has no painted edges [m]: the
width of a large intersection."""

LANES_AHEAD: Final = 5
"""Lanes straight on that a look along the lane of an ego reaches."""

BESIDE: Final = 0.5
"""A place farther than this beyond the end of a lane is not on it [m]."""


class Before:
    """State of the world before the step, which `judge` compares with the state after it.

    It lives until the next `World.touch`; until then rows keep their ids.

    Attributes:
        uid: (n,) int64.
        accel: (n,) [m/s^2].
        contacts: (m, 2) int64, the pairs of the last step.
    """

    __slots__ = ("accel", "contacts", "uid")

    def __init__(self, world: WorldRows) -> None:
        self.uid, self.accel, self.contacts = world.uid.copy(), world.accel.copy(), world.contacts


class Score(Record):
    """The score of one ego; see the head of this file.

    Attributes:
        since: the frame from which on all this counts.
        distance: driven [m].
        num_collisions: new contacts.
        contact_ids: ids of the latest `NUM_IDS` of these at most, the latest last.
        num_red_lights, num_stop_lines: passed.
        num_lane_invasions: edges crossed.
        off_road_time: [s].
        is_off_road: now.
        time_to_collision, min_time_to_collision: now and least; inf for none [s].
        lane_offset, mean_lane_offset, max_lane_offset: now, left positive; amounts [m].
        jerk, max_jerk, rms_jerk: now; amounts [m/s^3].
        lateral_accel, max_lateral_accel, rms_lateral_accel: now, left positive; amounts [m/s^2].
    """

    since: int
    distance: float
    num_collisions: int
    contact_ids: tuple[int, ...]
    num_red_lights: int
    num_stop_lines: int
    num_lane_invasions: int
    off_road_time: float
    is_off_road: bool
    time_to_collision: float
    min_time_to_collision: float
    lane_offset: float
    mean_lane_offset: float
    max_lane_offset: float
    jerk: float
    max_jerk: float
    rms_jerk: float
    lateral_accel: float
    max_lateral_accel: float
    rms_lateral_accel: float


class Loops(Protocol):
    """Compiled loops that do the work of arrays for one set of rows, to the last bit."""

    def judge(self, before: Before) -> bool:
        """Do what `judge` does; return False if arrays must do it, and nothing has changed."""

    def look(
        self, rows: IntArray, ahead: FloatArray, straight_on: IntArray
    ) -> tuple[dict[str, FloatArray], FloatArray] | None:
        """Return where rows are on their lanes, and places ahead, as `worlds.surroundings.find_lanes` does.

        Args:
            rows: (k,) int64.
            ahead: (p,) distances along the lanes [m].
            straight_on: (l,) int64, for each lane of the map the one after it; -1 at a dead end.

        Returns:
            Arrays that the next look overwrites; None if arrays must do it.
        """

    def see_others(self, rows: IntArray, num: int) -> FloatArray | None:
        """Return the entities nearest to rows, as `worlds.surroundings.find_others` does; None if arrays must do it."""


_TOLD: Final = (
    *("num_collisions", "num_red_lights", "num_stop_lines", "num_lane_invasions", "is_off_road", "time_to_collision"),
    *("min_time_to_collision", "lane_offset", "max_lane_offset", "jerk", "max_jerk", "lateral_accel"),
    "max_lateral_accel",
)
"""Columns that a `Score` has as they are."""

SCORE_LOOPS: Final = LoopMaker[Callable[[WorldRows], Loops]]()
"""The loops that judge egos, from the next step on."""


def remember(world: WorldRows) -> Before:
    """Store what `judge` wants of the world as a step begins."""
    before = world.derived(Before)
    np.copyto(before.accel, world.accel)
    before.contacts = world.contacts
    return before


def judge(world: WorldRows, before: Before) -> None:
    """Bring the scores of all egos up to the end of a step, behind `collisions.find`.

    Args:
        world: its columns of scores are written.
        before: what `remember` has returned.
    """
    rows = world.rows(Kind.EGO)
    if not len(rows):
        return
    if SCORE_LOOPS.make is not None and len(world.roads) and world.derived(SCORE_LOOPS.make).judge(before):
        return
    at = run_of(rows)
    poses = world.derived(CollisionDetector).poses[:, :, at]
    start, end = poses
    world.score_frames[at] += 1
    world.score_distance[at] += np.abs(start[POSE_SPEED] + end[POSE_SPEED]) * (0.5 * DT)
    count_contacts(world, rows, before.contacts)
    _judge_comfort(world, rows, at, before)
    times = find_times_to_collision(world, rows)
    world.time_to_collision[at] = times
    world.min_time_to_collision[at] = np.fmin(world.min_time_to_collision[at], times)
    if len(world.roads):
        headings, places = unit(poses[:, POSE_YAW].copy()), poses[:, POSE_X] + 1j * poses[:, POSE_Y]
        centre = world.centre[at]
        _judge_lanes(world, rows, at, places[1] + centre * headings[1], headings[1])
        noses = places + (world.half_length[at] + centre) * headings
        judge_lines(world, rows, (noses[0], noses[1]), headings[1])


def read_score(world: WorldRows, row: int) -> Score:
    """Return the score of one ego.

    Args:
        world: read only.
        row: row of an EGO.
    """
    num, num_on_road = max(world.score_frames.item(row), 1), max(world.road_frames.item(row), 1)
    contacts = world.int_block("contact_1", f"contact_{NUM_IDS}")[:, row]
    return Score(
        since=world.score_since.item(row),
        distance=world.score_distance.item(row),
        contact_ids=tuple(uid - 1 for uid in reversed(contacts.tolist()) if uid),
        off_road_time=world.off_road_frames.item(row) * DT,
        mean_lane_offset=world.lane_offset_sum.item(row) / num_on_road,
        rms_jerk=_root(world.jerk_square_sum.item(row) / num),
        **{name: getattr(world, name).item(row) for name in _TOLD},
        rms_lateral_accel=_root(world.lateral_accel_square_sum.item(row) / num),
    )


def _root(mean_square: float) -> float:
    """Return the root of a mean of squares; a snapshot from elsewhere may hold a negative one."""
    return math.sqrt(max(mean_square, 0.0))


def count_contacts(world: WorldRows, rows: IntArray, before: IntArray) -> None:
    """Count the contacts that were not there one step before, and keep the ids."""
    world.has_collided[rows] = False
    now = world.contacts
    if not len(now):
        return
    is_new = ~is_among(pair_codes(now), pair_codes(before)) if world.world_of_row is None else ~_are_among(now, before)
    new = now[is_new]
    both = np.concatenate([new, new[:, ::-1]])  # each pair once from either side
    order = np.lexsort((both[:, 1], both[:, 0]))
    own, other = both[order].T
    ids = world.ids()[rows]
    place = ids.argsort()
    at = np.minimum(ids[place].searchsorted(own), len(rows) - 1)
    is_ego = ids[place][at] == own
    mine, other = rows[place[at[is_ego]]], other[is_ego]
    num = np.bincount(mine, minlength=world.n)[rows]
    world.num_collisions[rows] += num
    world.has_collided[rows] = num > 0
    latest = world.int_block("contact_1", f"contact_{NUM_IDS}")
    # Those of one ego are neighbours: `left` more follow each.
    left = _num_after(mine)
    for i in range(min(NUM_IDS, int(left.max(initial=-1)) + 1) - 1, -1, -1):
        those = left == i
        latest[1:, mine[those]] = latest[:-1, mine[those]]
        latest[0, mine[those]] = (other[those] & MAX_UID) + 1


def _num_after(values: IntArray) -> IntArray:
    """Return for each of some values, in which equal ones are neighbours, how many equal ones follow."""
    is_last = np.ones(len(values), dtype=bool)
    is_last[:-1] = values[1:] != values[:-1]
    last = is_last.nonzero()[0]
    index = np.arange(len(values))
    return np.asarray(last[last.searchsorted(index)] - index)


def _are_among(pairs: IntArray, others: IntArray) -> BoolArray:
    """Return which pairs of ids of many worlds, (m, 2), are among other pairs, (k, 2)."""
    ids, index = np.unique(np.concatenate([pairs, others]), return_inverse=True)
    keys = index.reshape(-1, 2) @ np.array([len(ids), 1])
    return is_among(keys[: len(pairs)], keys[len(pairs) :])


def _judge_comfort(world: WorldRows, rows: IntArray, at: slice | IntArray, before: Before) -> None:
    """Bring jerk and lateral acceleration up to date."""
    accel, lateral = world.accel[at], world.lateral_accel[at]
    num = len(before.uid)
    known = at if num > rows[-1] else np.minimum(rows, num - 1)
    is_known = before.uid[known] == world.uid[at]  # the others have just come
    if known is not at:
        is_known &= rows < num
    jerk = np.where(is_known, (accel - before.accel[known]) / DT, 0.0)
    world.jerk[at] = jerk
    world.max_jerk[at] = np.fmax(world.max_jerk[at], np.abs(jerk))
    world.jerk_square_sum[at] += jerk * jerk
    world.max_lateral_accel[at] = np.fmax(world.max_lateral_accel[at], np.abs(lateral))
    world.lateral_accel_square_sum[at] += lateral * lateral


def _judge_lanes(
    world: WorldRows, rows: IntArray, at: slice | IntArray, middle: ComplexArray, heading: ComplexArray
) -> None:
    """Bring off-road time, lane invasions and the distance to the lane's middle up to date.

    Args:
        world: written.
        rows: (k,) int64, the egos.
        at: the same, as `run_of` returns them.
        middle: (k,) of their boxes, east + i north [m].
        heading: (k,) unit vectors.
    """
    roads = world.roads.alone
    x, y = middle.real.copy(), middle.imag.copy()
    z = world.z[at]
    places = world.roads.nearest(x, y, world.yaw[at], z)
    to_left, to_right = roads.beside(places)
    is_on = (to_left >= 0.0) & (to_right >= 0.0) & (places.distance - np.abs(places.lateral) < BESIDE)
    if np.count_nonzero(is_on) < len(is_on):
        doubtful = (~is_on).nonzero()[0]
        is_on[doubtful] = are_on_road(world.roads, x[doubtful], y[doubtful], z[doubtful])
    is_off = ~is_on
    world.is_off_road[at] = is_off
    world.off_road_frames[at] += is_off
    world.road_frames[at] += is_on

    # Edges
    turned = heading * np.exp(-1j * places.yaw)
    across = np.abs(turned.imag) * world.half_length[at] + np.abs(turned.real) * world.half_width[at]
    was_left, was_right = world.is_over_left[at], world.is_over_right[at]
    former, offset = world.near_lane[at] - 1, places.lateral
    is_other = former != places.lane
    if np.count_nonzero(is_other):
        moved = np.where(is_other, offset - world.lane_offset[at], 0.0)
        # The right edge of the lane to the left is the left edge of the former one.
        to_the_left, to_the_right = moved < -SIDEWAYS, moved > SIDEWAYS
        was_left, was_right = (
            (was_left & ~to_the_left & ~to_the_right) | (was_right & to_the_right),
            (was_right & ~to_the_left & ~to_the_right) | (was_left & to_the_left),
        )
        world.near_lane[at] = places.lane + 1
    over_left, over_right = across - to_left, across - to_right
    is_left = (over_left > 0.0) | (was_left & (over_left > -BACK_INSIDE))
    is_right = (over_right > 0.0) | (was_right & (over_right > -BACK_INSIDE))
    comes_left, comes_right = is_left & ~was_left, is_right & ~was_right
    if np.count_nonzero(comes_left | comes_right):  # rare
        comes_left &= roads.left[places.lane] < 0
        comes_right &= roads.right[places.lane] < 0
        counts = roads.derived(Edges).are_at(world, places) & (former >= 0)
        world.num_lane_invasions[rows] += (comes_left & counts).astype(np.int64) + (comes_right & counts)
    world.is_over_left[at], world.is_over_right[at] = is_left, is_right

    offset = np.where(is_on, offset, 0.0)
    world.lane_offset[at] = offset
    amount = np.abs(offset)
    world.lane_offset_sum[at] += amount
    world.max_lane_offset[at] = np.fmax(world.max_lane_offset[at], amount)


class Edges:
    """Painted edges of the lanes of a map.

    Attributes:
        first, last: (l,) between these arc lengths there are edges, where no lights are [m].
    """

    def __init__(self, roads: Roads) -> None:
        num = np.diff(roads.first_successor)
        num_before = np.bincount(roads.successor, minlength=len(roads))
        is_fork = np.bincount(roads.successor, num[roads.predecessor] > 1, len(roads)) > 0.0
        is_join = np.bincount(roads.predecessor, num_before[roads.successor] > 1, len(roads)) > 0.0
        self.first = np.where(is_fork, NO_EDGES, 0.0)
        self.last = roads.length - np.where(is_join, NO_EDGES, 0.0)

    def are_at(self, world: WorldRows, places: LanePlaces) -> BoolArray:
        """Return (k,) whether there are edges at places on lanes."""
        lane = places.lane
        is_outside = world.signals.plan.controller_of_lane[lane] < 0
        return (places.s >= self.first[lane]) & (places.s <= self.last[lane]) & is_outside


def judge_lines(
    world: WorldRows, rows: IntArray, nose: tuple[ComplexArray, ComplexArray], heading: ComplexArray
) -> None:
    """Count stop lines and red lights passed.

    Args:
        world: written.
        rows: (k,) int64, the egos.
        nose: (k,) middles of the front bumpers before and after the step, east + i north [m].
        heading: (k,) unit vectors after the step.
    """
    world.has_passed_red[rows] = False
    roads, signals = world.roads.alone, world.signals
    index, lane = roads.derived(StopLines).find_passed(signals, *nose, heading, world.z[rows])
    open_lines = world.open_line[rows]
    if open_lines.any():
        at = open_lines.nonzero()[0]
        those = rows[at]
        is_last = np.isin(at, index)  # the next line is passed already
        is_decided, is_red = settle(roads, world.open_line[those] - 1, world.open_reds[those], nose[1][at], is_last)
        world.has_passed_red[those[is_red]] = True
        world.num_red_lights[those[is_red]] += 1
        done = those[is_decided]
        world.open_line[done] = world.open_reds[done] = 0
    if not len(index):
        return
    those = rows[index]
    world.num_stop_lines[those] += 1
    red, every = find_red_lanes(roads, signals, lane, world.own_lights(those, np.zeros_like(those)))
    is_red = (red == every) & (red != 0)
    world.has_passed_red[those[is_red]] = True
    world.num_red_lights[those[is_red]] += 1
    is_open = (red != 0) & (red != every)
    world.open_line[those[is_open]] = lane[is_open] + 1
    world.open_reds[those[is_open]] = red[is_open]


def unit(yaw: FloatArray) -> ComplexArray:
    """Return headings [rad] as complex unit vectors."""
    return np.asarray(np.cos(yaw) + 1j * np.sin(yaw))
