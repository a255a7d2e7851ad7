"""The right of way, decided driver by driver in plain Python, as `right_of_way` and `intruders` decide it for all."""

from __future__ import annotations

import math
import tracemalloc
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from rosbridge_sim.world.drivers.intruders import stop_for_intruders
from rosbridge_sim.world.drivers.lane_entries import Entries
from rosbridge_sim.world.drivers.right_of_way import give_claims, update_holds
from rosbridge_sim.world.roads.lane_conflicts import LaneConflicts
from tests.world.drivers.random_drivers import Situation, situation
from tests.world.road_factory import built_in, line, make


def one_crossing(first: str) -> LaneConflicts:
    """Two streets that cross; the lane with this name has the first row, and the one to the north a stop line."""
    lanes = {
        "we": (line((-10, 0), (10, 0)), "e"),
        "sn": (line((0, -10), (0, 10)), "n"),
        "w": (line((-200, 0), (-10, 0)), "we"),
        "s": (line((0, -200), (0, -10)), "sn"),
        "e": (line((10, 0), (400, 0)), ""),
        "n": (line((0, 10), (0, 400)), ""),
    }
    roads = make(**{first: lanes[first]}, **{name: lanes[name] for name in lanes if name != first})
    roads.is_stop[roads.row("s")] = True
    return LaneConflicts(roads)


@pytest.fixture(scope="module")
def maps() -> list[LaneConflicts]:
    return [LaneConflicts(built_in("town").roads), one_crossing("we"), one_crossing("e")]


@pytest.fixture
def town(maps: list[LaneConflicts], seed: int) -> LaneConflicts:
    """The town, and for two of five situations a single crossing."""
    return maps[max(seed % 5 - 2, 0)]


def rivals_of(conflicts: LaneConflicts, lane: int) -> list[int]:
    """Indices of a lane's pairs."""
    return list(range(conflicts.rivals.first[lane], conflicts.rivals.first[lane + 1]))


def start_yaw(conflicts: LaneConflicts, lane: int) -> float:
    """Direction of a lane at its start [rad]."""
    return float(conflicts.roads.at([lane], [0.0])[1][0])


def nose_lanes(case: Situation, i: int) -> list[int]:
    """The lanes ahead that the nose of a driver has reached."""
    conflicts, lanes = case.conflicts, [lane for lane in case.drivers.lanes[:, i].tolist() if lane >= 0]
    nose, found = float(case.drivers.arc[i] + case.drivers.nose[i]), []
    for here, there in pairwise(lanes):
        nose -= float(conflicts.roads.length[here])
        if nose >= 0.0:
            found.append(there)
    return found


def tail_on_held(case: Situation, i: int) -> float:
    """Where the tail of a driver is on the lane that it holds; -inf if only its nose is there."""
    drivers, held = case.drivers, int(case.drivers.held[i])
    tail = float(drivers.arc[i] - drivers.rear[i])
    if drivers.lanes[0, i] == held:
        return tail
    return -math.inf if held in nose_lanes(case, i) else tail + float(case.conflicts.roads.length[held])


def holds_of(case: Situation, i: int) -> dict[int, float]:
    """The lanes that a driver holds, or that are under its body, with its tail there."""
    drivers, held = case.drivers, int(case.drivers.held[i])
    if held < 0:
        return {}
    found = {held: tail_on_held(case, i)}
    if found[held] == -math.inf:
        lanes = drivers.lanes[:, i].tolist()
        found |= dict.fromkeys(lanes[: lanes.index(held)], -math.inf)
        found[lanes[0]] = float(drivers.arc[i] - drivers.rear[i])
    return found


def update_one_by_one(case: Situation) -> tuple[list[int], list[int]]:
    """Claims and holds after those at their wait points hold what they claim, and those that are out are free."""
    conflicts, drivers = case.conflicts, case.drivers
    claims, holds = drivers.claim.tolist(), drivers.held.tolist()
    for i, lane in enumerate(drivers.lanes[0].tolist()):
        if claims[i] >= 0 and claims[i] == lane and drivers.arc[i] + drivers.nose[i] >= conflicts.wait_point[lane]:
            holds[i], claims[i] = claims[i], -1
            drivers.held[i] = holds[i]
        if holds[i] >= 0 and tail_on_held(case, i) > conflicts.clear_point[holds[i]]:
            holds[i] = -1
    return claims, holds


@pytest.mark.parametrize("seed", range(30))
def test_holds_begin_at_the_wait_point_and_end_where_the_tail_is_out(seed: int, town: LaneConflicts) -> None:
    case, same = situation(town, seed), situation(town, seed)
    same.drivers.held[::3] = case.drivers.held[::3] = case.drivers.lanes[0, ::3]
    claims, holds = update_one_by_one(same)
    update_holds(town, case.drivers)
    assert (case.drivers.claim.tolist(), case.drivers.held.tolist()) == (claims, holds)


class OneByOne:
    """What `give_claims` does, for one driver after another."""

    def __init__(self, case: Situation) -> None:
        self.case, self.drivers, self.requests = case, case.drivers, case.requests
        self.num = len(case.drivers.arc)
        self.first_on = self._first_on()
        self.asks = [i for i in range(self.num) if self._asks(i)]
        self.shut_out = [i for i in self.asks if not self._has_room(i)]
        stands = {int(lane) for lane, is_one in zip(case.others.lane, case.others.stands, strict=True) if is_one}
        self.blocked = {i for i in self.asks if int(self.requests.lane[i]) in stands}
        candidates = [i for i in self.asks if i not in self.shut_out and i not in self.blocked]
        self.place = {i: self._place(i) for i in candidates}
        order = sorted(candidates, key=self._rank)
        stands |= {
            int(self.drivers.held[i])
            for i in range(self.num)
            if self.drivers.held[i] >= 0 and self.drivers.speed[i] < 0.1
        }
        self.taken = self._taken(set(range(self.num)))
        self.given = []
        for rank, i in enumerate(order):
            is_free = True
            for pair in self._pairs(i):
                rival = int(case.conflicts.rivals.other[pair])
                is_taken = self._last(i, pair) < case.conflicts.rivals.figure[pair]
                first = [j for j in order[:rank] if self.requests.lane[j] == rival]
                if is_taken or any(not self._waits_for(j, i) for j in first):
                    is_free = False
                if rival in stands and (is_taken or rival not in holds_of(case, i)):
                    self.blocked.add(i)
            if is_free:
                self.given.append(i)

    def _pairs(self, i: int) -> list[int]:
        return rivals_of(self.case.conflicts, int(self.requests.lane[i]))

    def _waits_for(self, i: int, other: int) -> bool:
        """Whether one driver could not go because of a lane under the body of another one, who is within a crossing."""
        under, rivals = holds_of(self.case, other), self.case.conflicts.rivals
        taken = [pair for pair in self._pairs(i) if self._last(i, pair) < rivals.figure[pair]]
        return any(int(rivals.other[pair]) in under for pair in taken)

    def _last(self, i: int, pair: int) -> float:
        """Where the last tail is on a rival of the lane that a driver asks for; it does not wait for itself."""
        rival = int(self.case.conflicts.rivals.other[pair])
        if rival in holds_of(self.case, i):
            return self._taken(set(range(self.num)) - {i}).get(rival, math.inf)
        return self.taken.get(rival, math.inf)

    def _first_on(self) -> dict[int, tuple[float, float]]:
        """Tail and speed of the first entity on each lane, by the place of its reference point."""
        found: dict[int, tuple[float, float, float]] = {}
        own = self.drivers
        entries = [
            *zip(own.lanes[0], own.arc, own.arc - own.rear, own.speed, strict=True),
            *zip(self.case.others.lane, self.case.others.s, self.case.others.tail, self.case.others.speed, strict=True),
        ]
        for lane, s, tail, speed in entries:
            if int(lane) not in found or s < found[int(lane)][0]:
                found[int(lane)] = (float(s), float(tail), float(speed))
        return {lane: (tail, speed) for lane, (_, tail, speed) in found.items()}

    def _asks(self, i: int) -> bool:
        drivers, lane, distance = self.drivers, int(self.requests.lane[i]), self.requests.distance[i]
        speed = drivers.speed[i]
        if lane < 0 or distance >= speed * (speed / 2.5 + drivers.parameters.headway[i]) + 1.0 + 2.5:
            return False
        lead = int(self.case.perception.lead[i])
        has_way = lead >= 0 and (drivers.claim[lead] >= 0 or self.requests.again[lead])
        if self.case.perception.gap[i] <= distance and not has_way:
            return False
        return not (drivers.claim[i] >= 0 and drivers.claim[i] in drivers.lanes[:, i])

    def _has_room(self, i: int) -> bool:
        drivers, exit_lane = self.drivers, int(self.requests.exit_lane[i])
        if exit_lane < 0 or math.isfinite(self.case.conflicts.wait_point[exit_lane]):
            return True
        tail, speed = self.first_on.get(exit_lane, (math.inf, 0.0))
        coming = [
            j
            for j in range(self.num)
            if (drivers.claim[j] >= 0 or drivers.held[j] >= 0) and drivers.exit_lane[j] == exit_lane
        ]
        reserved = sum(drivers.length[j] + 2.5 for j in coming)
        return bool(tail + 2.0 * speed - reserved >= drivers.length[i] + 2.5)

    def _place(self, i: int) -> tuple[bool, int]:
        """Whether a driver gives way, and how far it is in whole metres."""
        drivers, distance = self.drivers, float(self.requests.distance[i])
        is_let_in = drivers.is_let_in[i] and drivers.speed[i] < 0.1 and distance < 2.0
        gives_way = bool(self.case.conflicts.gives_way[self.requests.lane[i]]) and not is_let_in
        return gives_way, round(distance)

    def _rank(self, i: int) -> tuple[tuple[bool, int], bool, bool, float, int]:
        """First the nearer ones, then those with none at their right, then those that do not turn left."""
        conflicts, lane = self.case.conflicts, int(self.requests.lane[i])
        first = dict[int, tuple[bool, int]]()
        for other, place in self.place.items():
            there = int(self.requests.lane[other])
            first[there] = min(first.get(there, place), place)
        has_right = False
        for pair in rivals_of(conflicts, lane):
            rival = int(conflicts.rivals.other[pair])
            angle = start_yaw(conflicts, rival) - start_yaw(conflicts, lane)
            has_right |= math.sin(angle) > math.sin(math.radians(20.0)) and first.get(rival) == self.place[i]
        turns_left = float(conflicts.roads.turn[lane]) > math.radians(30.0)
        return self.place[i], has_right, turns_left, float(self.requests.distance[i]), lane

    def _taken(self, holders: set[int]) -> dict[int, float]:
        taken: dict[int, float] = {}
        drivers, others = self.drivers, self.case.others
        for i in holders:
            for held, tail in holds_of(self.case, i).items():
                taken[held] = min(taken.get(held, math.inf), tail)
        for lane, tail in zip(others.lane[: self.case.num_moving], others.tail, strict=False):
            taken[int(lane)] = min(taken.get(int(lane), math.inf), float(tail))
        for claim in drivers.claim.tolist():
            if claim >= 0:
                taken[claim] = -math.inf
        return taken


@pytest.mark.parametrize("seed", range(150))
def test_claims_are_given_as_one_by_one(seed: int, town: LaneConflicts) -> None:
    few = 0.1 if seed % 5 < 3 else 0.25
    check_claims(situation(town, seed, few=few), situation(town, seed, few=few))


@pytest.mark.parametrize("seed", range(50))
def test_claims_are_given_to_a_crowd_as_one_by_one(seed: int, town: LaneConflicts) -> None:
    check_claims(crowd(town, seed), crowd(town, seed))


def crowd(conflicts: LaneConflicts, seed: int) -> Situation:
    """All ask, nobody has a claim, and many hold lanes of the crossing, which others wait for."""
    case = situation(conflicts, seed, num=24, few=0.3)
    case.drivers.claim[:] = case.requests.exit_lane[:] = -1
    case.perception.gap[:] = math.inf
    case.requests.distance[:] = np.fmin(case.requests.distance, 3.0)
    case.num_moving = seed % 2
    case.others = case.others.first(case.num_moving)
    return case


@pytest.mark.parametrize("seeds", [range(100 * i, 100 * i + 100) for i in range(4)])
def test_drivers_that_ask_for_a_rival_of_their_own_lane_get_it_as_one_by_one(
    seeds: range, maps: list[LaneConflicts]
) -> None:
    for seed in seeds:
        check_claims(on_rivals(maps[1], seed), on_rivals(maps[1], seed))


def on_rivals(conflicts: LaneConflicts, seed: int) -> Situation:
    """Drivers on two lanes that cross, which most of them hold, ask for either of these, as forged bytes have it."""
    case, rng = situation(conflicts, seed, num=6), np.random.default_rng(seed)
    drivers, requests = case.drivers, case.requests
    drivers.lanes[:2] = rng.choice(np.array([conflicts.roads.row("we"), conflicts.roads.row("sn")]), (2, 6))
    drivers.arc[:] = rng.uniform(0.0, 20.0, 6)
    drivers.held[:] = np.where(rng.random(6) < 0.7, drivers.lanes[0], -1)
    drivers.claim[:] = requests.exit_lane[:] = -1
    requests.lane[:], requests.distance[:] = drivers.lanes[1], rng.uniform(0.5, 3.4, 6)
    case.perception.gap[:] = math.inf
    case.num_moving, case.others = 0, case.others.first(0)
    return case


def check_claims(case: Situation, same: Situation) -> None:
    expected, town = OneByOne(same), case.conflicts
    drivers, perception, requests = case.drivers, case.perception, case.requests
    claims, exits, stops = drivers.claim.copy(), drivers.exit_lane.copy(), perception.stop_distance.copy()
    give_claims(town, drivers, perception, requests, case.queue, others=case.others, num_moving=case.num_moving)
    given = expected.given
    claims[given], exits[given] = requests.lane[given], requests.exit_lane[given]
    assert drivers.claim.tolist() == claims.tolist()
    assert drivers.exit_lane.tolist() == exits.tolist()
    assert perception.is_shut_out.nonzero()[0].tolist() == sorted(expected.shut_out)
    assert set(perception.is_blocked.nonzero()[0].tolist()) == expected.blocked
    for i in range(expected.num):
        if requests.lane[i] >= 0 and claims[i] != requests.lane[i]:
            stops[i] = min(stops[i], requests.distance[i])
    assert perception.stop_distance.tolist() == stops.tolist()


def intruders_of(case: Situation) -> list[tuple[int, int, float, float, float]]:
    """Intruders: entry, lane, tail and nose there, speed; also on the lanes that they cannot stop before."""
    conflicts, others, found = case.conflicts, case.others, []
    for i in range(len(others.lane)):
        lane, tail, speed = int(others.lane[i]), float(others.tail[i]), float(others.speed[i])
        if speed <= 0.5:
            continue
        nose, length = 2.0 * float(others.s[i]) - tail, float(conflicts.roads.length[lane])
        found.append((i, lane, tail, nose, speed))
        if speed**2 > 2.0 * 4.0 * max(length - nose, 0.0):
            first, last = conflicts.onward.first[lane : lane + 2]
            found += [
                (i, int(other), tail - length, nose - length, speed) for other in conflicts.onward.other[first:last]
            ]
    return found


def distance_to(case: Situation, i: int, lane: int, *, is_held: bool) -> float:
    """From the bumper to the start of a lane; negative behind it, and without end for a lane that is not on the way."""
    drivers, length = case.drivers, case.conflicts.roads.length
    ahead = -float(drivers.arc[i] + drivers.nose[i])
    if is_held and drivers.lanes[0, i] != lane and lane not in nose_lanes(case, i):
        return ahead - float(length[lane])
    for here in drivers.lanes[:, i].tolist():
        if here == lane:
            return ahead
        ahead += float(length[here]) if here >= 0 else 0.0
    return -math.inf


@pytest.mark.parametrize("seed", range(60))
def test_drivers_stop_for_intruders_as_one_by_one(seed: int, town: LaneConflicts) -> None:
    case = situation(town, seed, num=40, few=0.7)
    drivers, conflicts = case.drivers, case.conflicts
    stops, seen = case.perception.stop_distance.copy(), [list[tuple[float, float, int]]() for _ in drivers.arc]
    for entry, lane, tail, nose, speed in intruders_of(case):
        for pair in rivals_of(conflicts, lane):
            rival, back = int(conflicts.rivals.other[pair]), int(conflicts.rival_back[pair])
            for i in range(len(drivers.arc)):
                for is_held, mine in [(False, drivers.claim[i]), (True, drivers.held[i])]:
                    if mine != rival:
                        continue
                    ahead = distance_to(case, i, rival, is_held=is_held)
                    enter, leave = ahead + conflicts.rival_from[back], ahead + conflicts.rivals.figure[pair]
                    own = max(float(drivers.speed[i]), 2.0)
                    comes = (conflicts.rival_from[pair] - nose) / speed
                    goes = (conflicts.rivals.figure[back] - tail) / speed
                    is_near = goes > 0.0 and enter / own < goes + 1.5
                    is_near = is_near and comes < (leave + drivers.length[i]) / own + 1.5
                    if is_near and drivers.speed[i] ** 2 < 2.0 * 7.0 * enter:
                        stops[i] = min(stops[i], enter)
                        seen[i].append((enter, comes, entry))
    found = stop_for_intruders(conflicts, drivers, case.perception, case.others)
    assert case.perception.stop_distance == pytest.approx(stops, rel=1e-12)
    # Each gives way at the nearest place, and there to the one that comes first.
    assert found.tolist() == [min(pairs)[2] if pairs else -1 for pairs in seen]


@pytest.mark.parametrize("seed", [11, 12])
def test_crowds_of_intruders_take_no_room_for_each_with_each(seed: int, town: LaneConflicts) -> None:
    case = situation(town, seed, num=3_000, few=0.7)
    alone, crowd = case.perception.stop_distance.copy(), case.perception.stop_distance.copy()
    once = stop_for_intruders(case.conflicts, case.drivers, replace(case.perception, stop_distance=alone), case.others)
    others = Entries.join(*[case.others] * 400)
    tracemalloc.start()
    many = stop_for_intruders(case.conflicts, case.drivers, replace(case.perception, stop_distance=crowd), others)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert len(np.unique(once)) > 2
    assert (alone.tolist(), once.tolist()) == (
        crowd.tolist(),
        np.where(many < 0, -1, many % len(case.others.lane)).tolist(),
    )
    assert peak < 10_000_000  # of 3,600 entries and 3,000 drivers; all pairs would take 600 MB
