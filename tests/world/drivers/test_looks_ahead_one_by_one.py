"""The look along the lanes ahead, driver by driver in plain Python, as `driver_perception` does it for all at once."""

from __future__ import annotations

import copy
import math
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import pytest

from rosbridge_sim.world.drivers.driver_perception import DriverSight, Stop, _find_rival, _Look, observe, perceive
from rosbridge_sim.world.drivers.lane_entries import Entries
from rosbridge_sim.world.geometry.planar import BoolArray, FloatArray
from rosbridge_sim.world.roads.lane_conflicts import LaneConflicts
from tests.world.drivers.random_drivers import Situation, situation
from tests.world.road_factory import built_in, crossing, line, make

NONE = -1


def blocks() -> LaneConflicts:
    """Two streets each way that cross in the middle of their lanes, 100 m apart."""
    lanes: dict[str, tuple[FloatArray, str]] = {}
    for k in range(2):
        for i in range(4):
            start, end, aside = 100.0 * i - 150.0, 100.0 * i - 50.0, 100.0 * k
            follows = i < 3
            lanes[f"h{k}{i}"] = line(*[(x, aside) for x in np.arange(start, end + 1, 10)]), f"h{k}{i + 1}" * follows
            lanes[f"v{k}{i}"] = line(*[(aside, y) for y in np.arange(start, end + 1, 10)]), f"v{k}{i + 1}" * follows
    return LaneConflicts(make(**lanes))


@pytest.fixture(scope="module")
def maps() -> list[LaneConflicts]:
    return [LaneConflicts(built_in("town").roads), blocks()]


class Entry(NamedTuple):
    """A place that an entity occupies; `who` counts the drivers first, then the others."""

    lane: int
    s: float
    tail: float
    speed: float
    accel: float
    driver: int
    who: int


@dataclass
class Seen:
    """What one driver perceives along its lanes."""

    gap: float = math.inf
    lead: Entry | None = None
    second: Entry | None = None  # the entity ahead of the lead vehicle, on the same lane
    stop: float = math.inf
    safe: float = math.inf
    request: tuple[int, int, float] = (NONE, NONE, math.inf)
    refused: int = NONE  # the claimed lane whose light does not allow to enter any more, or that it asks for again
    again: bool = False


def a_situation(maps: list[LaneConflicts], seed: int) -> tuple[Situation, BoolArray]:
    """Drivers at an intersection, some of which change lanes; and which lanes their lights allow to enter."""
    conflicts = maps[seed % 5 == 4]
    case = situation(conflicts, seed, num=14, few=0.25)
    rng, drivers, roads = np.random.default_rng(seed), case.drivers, conflicts.roads
    if conflicts is maps[1]:
        drivers.arc *= rng.choice([0.4, 0.5, 1.0], 14)
    ends = rng.random((6, 14)) < 0.08
    drivers.lanes[1:][np.logical_or.accumulate(ends[1:])] = NONE
    drivers.point[:] = roads.locate(drivers.lanes[0], drivers.arc)[0]
    drivers.accel[:] = rng.uniform(-5.0, 2.0, len(drivers.arc))
    drivers.speed[::4] *= 2.0
    drivers.held[1::3] = np.where(
        np.isfinite(conflicts.wait_point[drivers.lanes[0, 1::3]]), drivers.lanes[0, 1::3], NONE
    )
    if seed % 3:
        which = np.arange(0, len(drivers.arc), seed % 3 + 1)
        lane, s = rng.choice(drivers.lanes[0], len(which)), drivers.arc[which]
        no = np.zeros(len(which), dtype=np.bool_)
        drivers.leaving = Entries(
            lane, np.fmin(s, roads.length[lane]), s - 3.0, drivers.speed[which], drivers.accel[which], which, no
        )
    return case, rng.random(len(roads)) < 0.6


def again(case: Situation) -> Situation:
    """The same situation, on the same roads."""
    return copy.deepcopy(case, {id(case.conflicts): case.conflicts})


class OneByOne:
    """The look of each driver."""

    def __init__(self, case: Situation, may_enter: BoolArray) -> None:
        self.case, self.drivers, self.may_enter = case, case.drivers, may_enter
        self.conflicts, self.roads = case.conflicts, case.conflicts.roads
        self.entries = sorted(self._entries(), key=lambda entry: (entry.lane, entry.s))
        self.seen = [self._look(i) for i in range(len(self.drivers.arc))]

    def _entries(self) -> list[Entry]:
        drivers, num = self.drivers, len(self.drivers.arc)
        tail, index = drivers.arc - drivers.rear, np.arange(num)
        no = np.zeros(num, dtype=np.bool_)
        own = self._listed(Entries(drivers.lanes[0], drivers.arc, tail, drivers.speed, drivers.accel, index, no))
        found = [*own, *self._listed(drivers.leaving)]
        siblings = self.conflicts.siblings
        for entry in own:
            links = range(siblings.first[entry.lane], siblings.first[entry.lane + 1])
            shared = [link for link in links if entry.tail < siblings.figure[link]]
            found += [entry._replace(lane=int(siblings.other[link])) for link in shared]
        others = self._listed(self.case.others)
        return found + [entry._replace(who=num + i) for i, entry in enumerate(others)]

    @staticmethod
    def _listed(entries: Entries | None) -> list[Entry]:
        if entries is None:
            return []
        columns = (entries.lane, entries.s, entries.tail, entries.speed, entries.accel, entries.source, entries.source)
        return [Entry(*values) for values in zip(*(column.tolist() for column in columns), strict=True)]

    def _on(self, lane: int) -> list[Entry]:
        return [entry for entry in self.entries if entry.lane == lane]

    def _look(self, i: int) -> Seen:
        drivers, lanes = self.drivers, self.drivers.lanes[:, i].tolist()
        arc, nose, speed = (float(each[i]) for each in (drivers.arc, drivers.nose, drivers.speed))
        accel, comfort, headway = (
            float(each[i])
            for each in (drivers.parameters.accel, drivers.parameters.comfort, drivers.parameters.headway)
        )
        seen = Seen(safe=self._safe_here(i))
        here = self._on(lanes[0])
        at = next(at for at, entry in enumerate(here) if entry.who == i)
        seen.lead, seen.second = [*here[at + 1 :], None, None][:2]
        if seen.lead is not None:
            seen.gap = seen.lead.tail - arc - nose
        wait = float(self.conflicts.wait_point[lanes[0]]) - arc - nose
        if math.isfinite(wait) and wait > 0.0 and lanes[0] != drivers.held[i] and self._may_ask(i, lanes[0], wait):
            self._ask(seen, i, lanes[0], lanes[1], wait)
        wanted = 2.5 + speed * (headway + speed / (2.0 * math.sqrt(accel * comfort)))
        distance = float(self.roads.length[lanes[0]]) - arc
        for lane, after in pairwise([*lanes[1:], NONE]):
            if distance >= 1.5 * wanted + 2.5 + nose:
                break
            if lane < 0:
                seen.stop = min(seen.stop, distance - nose)
                break
            self._pass_line(seen, i, lane, after, distance)
            if seen.lead is None:
                seen.lead, seen.second = [*self._on(lane), None, None][:2]
                seen.gap = math.inf if seen.lead is None else distance + seen.lead.tail - nose
            distance += float(self.roads.length[lane])
        return seen

    def _pass_line(self, seen: Seen, i: int, lane: int, after: int, distance: float) -> None:
        """Mind the light of a lane ahead, ask for it, and slow down for its limit and bend."""
        drivers = self.drivers
        nose, speed, reaction = (float(each[i]) for each in (drivers.nose, drivers.speed, drivers.parameters.reaction))
        to_line, claim = distance - nose, int(drivers.claim[i])
        surplus = reaction * max(float(drivers.accel[i]) + 4.0, 0.0)
        firm_stop = (speed + surplus) ** 2 / 8.0 - surplus * reaction
        if not self.may_enter[lane] and to_line > 0.0 and firm_stop < to_line:
            seen.stop = min(seen.stop, to_line)
            if claim == lane:
                claim, seen.refused = NONE, lane
        wait = float(self.conflicts.wait_point[lane])
        may_ask = claim != drivers.claim[i] or self._may_ask(i, lane, to_line + wait)
        may_ask = may_ask and not self._is_within(i, lane)
        if may_ask and math.isfinite(wait) and seen.request[0] < 0 and math.isinf(seen.stop):
            self._ask(seen, i, lane, after, to_line + wait)
        first = int(self.roads.first[lane])
        reach = speed * (1.2 + reaction) + 2.5
        share = max(1.0 - distance / reach, 0.0)
        enter = []
        for factor, speeds in self._speeds(i):
            here = float(speeds[first]) ** 2
            there = self._least_ahead(speeds, first)
            enter.append(factor**2 * (here + share * (there - here)))
        enter[1] -= self._surplus(i)
        left = max(distance - reach, 0.0)
        square = min(enter) + 2.0 * float(drivers.parameters.comfort[i]) * left
        seen.safe = min(seen.safe, math.sqrt(max(square, 1.5**2)))

    def _may_ask(self, i: int, lane: int, distance: float) -> bool:
        """The driver has no claim for a lane, or could still stop comfortably."""
        comfort = float(self.drivers.parameters.comfort[i])
        way = float(self.drivers.speed[i]) ** 2 / (2.0 * comfort) + 1.0 + 2.5
        return int(self.drivers.claim[i]) != lane or distance > way

    def _is_within(self, i: int, lane: int) -> bool:
        """The driver holds a lane ahead that its nose is on, which is this one or one behind it."""
        held, ahead = int(self.drivers.held[i]), [k for k in self.drivers.lanes[:, i].tolist() if k >= 0]
        nose, entered = float(self.drivers.arc[i] + self.drivers.nose[i]), list[int]()
        for here, there in pairwise(ahead):
            nose -= float(self.roads.length[here])
            entered += [there] if nose >= 0.0 else []
        return held in entered and lane in entered[: len(entered) - entered[::-1].index(held)]

    def _ask(self, seen: Seen, i: int, lane: int, after: int, distance: float) -> None:
        seen.request, seen.again = (lane, after, distance), int(self.drivers.claim[i]) == lane
        seen.refused = lane if seen.again else seen.refused

    def _speeds(self, i: int) -> list[tuple[float, FloatArray]]:
        """Factors of the driver, and the speeds of limits and bends."""
        parameters, conflicts = self.drivers.parameters, self.conflicts
        bend = math.sqrt(float(self.drivers.lateral[i]) / 2.5)
        return [(float(parameters.speed_factor[i]), conflicts.limit_speed), (bend, conflicts.bend_speed)]

    def _least_ahead(self, speeds: FloatArray, point: int) -> float:
        """Least square of the speeds from a point to where a usual driver heeds them there, on the same lane."""
        s, last = self.roads.s, point
        end = float(s[point]) + float(self.conflicts.safe_speed[point]) * (1.2 + 0.4) + 2.5
        least = math.inf
        while True:
            least = min(least, float(speeds[last]) ** 2)
            if last + 1 >= len(s) or s[last + 1] == 0.0:
                return least
            if s[last + 1] > end:
                share = (end - float(s[last])) / float(s[last + 1] - s[last])
                return min(least, (1.0 - share) * float(speeds[last]) ** 2 + share * float(speeds[last + 1]) ** 2)
            last += 1

    def _safe_here(self, i: int) -> float:
        """The speed that limit and bends allow on the own lane, between the points before and behind the driver."""
        drivers, roads = self.drivers, self.roads
        point = int(drivers.point[i])
        is_last = point + 1 == roads.first[drivers.lanes[0, i] + 1]
        along = float(drivers.arc[i]) - float(roads.s[point])
        found = []
        for factor, speeds in self._speeds(i):
            here = there = self._least_ahead(speeds, point)
            share = 0.0
            if not is_last:
                share = along / float(roads.s[point + 1] - roads.s[point])
                there = self._least_ahead(speeds, point + 1)
            found.append(factor**2 * (here + share * (there - here)))
        return math.sqrt(max(min(found[0], found[1] - self._surplus(i)), 1.5**2))

    def _surplus(self, i: int) -> float:
        """By how much the square of the speed is less for bends, for one that accelerates."""
        drivers = self.drivers
        ahead = 0.6 + float(drivers.parameters.reaction[i])
        return 2.0 * float(drivers.speed[i]) * max(float(drivers.accel[i]), 0.0) * ahead

    def is_slow(self, i: int) -> bool:
        """The one ahead of the lead vehicle counts: it is much slower, or the lead vehicle leaves the lane."""
        lead, second = self.seen[i].lead, self.seen[i].second
        if lead is None or second is None:
            return False
        leaving = self.drivers.leaving
        leaves = leaving is not None and lead.driver >= 0 and lead.driver in leaving.source
        return leaves or float(self.drivers.speed[i]) - second.speed > 8.0


@pytest.mark.parametrize("seed", range(60))
def test_drivers_perceive_lead_vehicles_stops_and_speeds_as_one_by_one(seed: int, maps: list[LaneConflicts]) -> None:
    case, may_enter = a_situation(maps, seed)
    expected = OneByOne(again(case), may_enter)
    claims = case.drivers.claim.copy()
    look = _Look(case.conflicts, may_enter, case.drivers, case.others)
    look.look_ahead()
    perception, requests, seen = look.perception, look.requests, expected.seen
    leads = [each.lead or Entry(NONE, 0.0, 0.0, 0.0, 0.0, NONE, NONE) for each in seen]
    assert perception.gap == pytest.approx([each.gap for each in seen])
    assert perception.lead.tolist() == [lead.driver for lead in leads]
    assert perception.lead_speed.tolist() == [lead.speed for lead in leads]
    assert perception.lead_accel.tolist() == [lead.accel for lead in leads]
    assert perception.stop_distance == pytest.approx([each.stop for each in seen])
    assert perception.safe_speed == pytest.approx([each.safe for each in seen])
    assert requests.lane.tolist() == [each.request[0] for each in seen]
    assert requests.exit_lane.tolist() == [each.request[1] for each in seen]
    assert requests.distance == pytest.approx([each.request[2] for each in seen])
    assert requests.again.tolist() == [each.again for each in seen]
    kept = [NONE if each.refused >= 0 else claim for each, claim in zip(seen, claims.tolist(), strict=True)]
    assert case.drivers.claim.tolist() == kept
    slow = [i for i in range(len(seen)) if expected.is_slow(i)]
    assert (perception.slow is None) == (not slow)
    if perception.slow is not None:
        found = [(each.gap, each.lead, each.second) for each in (seen[i] for i in slow)]
        assert perception.slow.seen_by.tolist() == slow
        assert perception.slow.gap == pytest.approx(
            [gap + second.tail - lead.tail for gap, lead, second in found if lead and second]
        )
        assert perception.slow.speed.tolist() == [second.speed for _, _, second in found if second]
        assert perception.slow.accel.tolist() == [second.accel for _, _, second in found if second]


def sight_of(case: Situation, may_enter: BoolArray, i: int) -> DriverSight:
    """What one driver stops for, told from what it perceives and has after claims were given."""
    drivers, conflicts = case.drivers, case.conflicts
    look = _Look(conflicts, may_enter, drivers, case.others)
    ahead = OneByOne(case, may_enter).seen[i]
    look.look_ahead()
    intruder = look.claim(case.num_moving)
    perception, requests = look.perception, look.requests
    a, b = float(drivers.parameters.accel[i]), float(drivers.parameters.comfort[i])
    speed, gap = float(drivers.speed[i]), max(float(perception.gap[i]), 0.1)
    closing = speed - float(perception.lead_speed[i])
    wanted = 2.5 + max(speed * (float(drivers.parameters.headway[i]) + closing / (2.0 * math.sqrt(a * b))), 0.0)
    lost = a * (wanted / gap) ** (2 if wanted > gap else 4)
    distance, lane = float(perception.stop_distance[i]), int(requests.lane[i])
    brakes = speed < 0.1 or speed**2 > 2.0 * 1.25 * max(distance - 1.0, 0.0)
    stop, where, rival = Stop.NONE, NONE, NONE
    waits = lane >= 0 and drivers.claim[i] != lane and requests.distance[i] <= distance
    if math.isinf(distance) or not brakes:
        distance = math.inf
    elif intruder[i] >= 0:
        stop, where = Stop.RIGHT_OF_WAY, int(max(drivers.claim[i], drivers.held[i]))
        rival = len(drivers.arc) + int(intruder[i])
    elif waits:
        stop, where = (Stop.NO_ROOM if perception.is_shut_out[i] else Stop.RIGHT_OF_WAY), lane
        first, last = conflicts.rivals.first[lane : lane + 2]
        rivals = set(conflicts.rivals.other[first:last].tolist())
        have = [k for k in range(len(drivers.arc)) if k != i and {drivers.claim[k], drivers.held[k]} & rivals]
        have += [len(drivers.arc) + k for k in range(case.num_moving) if int(case.others.lane[k]) in rivals]
        rival = [*have, NONE][0]
    else:
        lanes = drivers.lanes[:, i].tolist()
        to_line = float(conflicts.roads.length[lanes[0]] - drivers.arc[i] - drivers.nose[i])
        for here, there in pairwise(lanes):
            if there < 0:
                stop, where = Stop.END, here
                break
            if not may_enter[there] and abs(to_line - distance) < 1e-6:
                stop, where = Stop.LIGHT, there
                break
            to_line += float(conflicts.roads.length[there])
    lead = ahead.lead.who if ahead.lead is not None else NONE
    return DriverSight(lead, float(perception.gap[i]), lost > 0.25, stop, distance, where, rival)


@pytest.mark.parametrize("seed", range(60))
def test_view_of_a_driver_tells_what_it_stops_for_as_one_by_one(seed: int, maps: list[LaneConflicts]) -> None:
    case, may_enter = a_situation(maps, seed)
    case.drivers.held[:] = NONE  # so the look begins with the same holds
    case.drivers.claim[np.isin(case.drivers.claim, case.drivers.lanes[0])] = NONE
    for i in range(seed % 3, len(case.drivers.arc), 3):
        same = again(case)
        found = observe(case.conflicts, may_enter, same.drivers, same.others, same.num_moving, which=i)
        assert found == sight_of(again(case), may_enter, i)


def entries_on(lanes: list[int]) -> Entries:
    """Vehicles on lanes."""
    one = np.ones(len(lanes))
    return Entries(np.array(lanes), 5.0 * one, 3.0 * one, one, 0.0 * one, np.full(len(lanes), NONE), one < 0.0)


def test_rival_of_a_driver_is_another_driver_before_any_other_vehicle_and_never_itself() -> None:
    conflicts = LaneConflicts(crossing())
    through, across = 1, 4
    drivers = situation(conflicts, 0, num=3).drivers
    nobody, vehicles = (entries_on(lanes) for lanes in ([0, 3], [0, across]))
    for held, claim, moving, expected in [
        ([across, NONE, NONE], [NONE, NONE, NONE], nobody, NONE),
        ([across, NONE, NONE], [NONE, NONE, across], vehicles, 2),
        ([NONE, across, NONE], [across, NONE, across], vehicles, 1),
        ([NONE, NONE, NONE], [across, NONE, NONE], vehicles, 4),
    ]:
        drivers.held[:], drivers.claim[:] = held, claim
        assert _find_rival(conflicts, drivers, moving, through, 0) == expected


def test_perception_begins_with_the_holds_of_those_that_have_come_or_gone() -> None:
    conflicts = LaneConflicts(crossing())
    case = situation(conflicts, 0, num=2)
    drivers, nobody = case.drivers, case.others.first(0)
    drivers.lanes[:, 0], drivers.lanes[:, 1] = [1, 2, -1, -1, -1, -1], [5, -1, -1, -1, -1, -1]
    drivers.arc[:], drivers.speed[:] = [5.0, 60.0], 5.0
    drivers.point[:] = conflicts.roads.locate(drivers.lanes[0], drivers.arc)[0]
    drivers.claim[:], drivers.held[:] = [1, NONE], [NONE, 4]
    perceive(conflicts, np.ones(6, dtype=np.bool_), drivers, nobody, 0)
    assert (drivers.claim.tolist(), drivers.held.tolist()) == ([NONE, NONE], [1, NONE])
