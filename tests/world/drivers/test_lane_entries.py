"""Entries: where boxes that follow no lanes obstruct the lanes, and the order in which all entries stand."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pytest

from rosbridge_sim.world.drivers.lane_entries import Entries, EntryQueue, find_entries, scale_ticks
from rosbridge_sim.world.geometry.planar import FloatArray
from rosbridge_sim.world.roads.roads import Roads
from tests.world.road_factory import line, make

LANES = {"a": (0.0, 0.0, 0.0), "b": (0.0, 5.0, 0.0), "c": (10.0, -20.0, 2.0)}
"""Start, east and north, and heading of straight lanes of 60 m."""


def straights(height: float = 0.0) -> Roads:
    lanes = {
        name: (
            line(*[(x + s * math.cos(yaw), y + s * math.sin(yaw)) for s in range(0, 61, 10)], z=height * (name == "c")),
            "",
        )
        for name, (x, y, yaw) in LANES.items()
    }
    return make(**lanes)


@dataclass
class Boxes:
    """Boxes of all sorts, (n,) each."""

    x: FloatArray
    y: FloatArray
    z: FloatArray
    yaw: FloatArray
    speed: FloatArray
    accel: FloatArray
    half_length: FloatArray
    half_width: FloatArray
    foresight: FloatArray

    @staticmethod
    def random(seed: int, num: int = 40) -> Boxes:
        rng = np.random.default_rng(seed)
        places = [place for place in rng.uniform((-10.0, -12.0), (70.0, 16.0), (9 * num, 2)) if is_plain(*place)]
        x, y = np.array(places[:num]).T
        return Boxes(
            x=x,
            y=y,
            z=np.zeros(num),
            yaw=rng.choice([0.0, 1.0, 1.0], num) * rng.uniform(-3.1, 3.1, num),
            speed=rng.choice([0.0, 1.0], num) * rng.uniform(-2.0, 8.0, num),
            accel=rng.uniform(-4.0, 2.0, num),
            half_length=rng.uniform(0.2, 5.0, num),
            half_width=rng.uniform(0.2, 1.5, num),
            foresight=rng.choice([0.0, 3.0, 1.5], num),
        )


def local(x: float, y: float, name: str) -> complex:
    """A place from the start of a lane: along it, and to the left."""
    start_x, start_y, yaw = LANES[name]
    return complex(x - start_x, y - start_y) * complex(math.cos(yaw), -math.sin(yaw))


def is_plain(x: float, y: float) -> bool:
    """Whether a place is beside each lane, or well beyond its ends."""
    along = [local(x, y, name).real for name in LANES]
    return all(0.0 < s < 60.0 or abs(s - 30.0) > 35.0 for s in along)


def entry_of(boxes: Boxes, i: int, name: str) -> tuple[float, ...] | None:
    """The entry of a box on a lane: place, tail, speed and acceleration along it, and when it is in the way."""
    place, yaw = local(float(boxes.x[i]), float(boxes.y[i]), name), LANES[name][2]
    if not 0.0 <= place.real <= 60.0:
        return None
    turn, speed = float(boxes.yaw[i]) - yaw, float(boxes.speed[i])
    cos, sin = math.cos(turn), math.sin(turn)
    half_across = abs(sin) * float(boxes.half_length[i]) + abs(cos) * float(boxes.half_width[i])
    half_along = abs(cos) * float(boxes.half_length[i]) + abs(sin) * float(boxes.half_width[i])
    there = place.imag + sin * speed * float(boxes.foresight[i])
    if min(place.imag, there) >= 1.4 + half_across or max(place.imag, there) <= -1.4 - half_across:
        return None
    room = max(abs(place.imag) - 1.4 - half_across, 0.0)
    arrival = room / max(abs(sin * speed), 0.01)
    return place.real, place.real - half_along, max(speed * cos, 0.0), float(boxes.accel[i]) * cos, arrival


@pytest.mark.parametrize("seed", range(8))
def test_boxes_obstruct_lanes_that_they_reach_now_or_soon(seed: int) -> None:
    boxes, roads = Boxes.random(seed), straights()
    stands = np.arange(40) % 3 == 0
    found, owner, arrival = find_entries(roads, **vars(boxes), stands=stands)
    expected = {
        (i, lane): entry for i in range(40) for lane, name in enumerate(LANES) if (entry := entry_of(boxes, i, name))
    }
    assert list(zip(owner.tolist(), found.lane.tolist(), strict=True)) == sorted(expected)
    columns = np.stack((found.s, found.tail, found.speed, found.accel, arrival), axis=-1)
    assert columns == pytest.approx(np.array([expected[key] for key in sorted(expected)]), abs=1e-9)
    assert found.source.tolist() == [-1] * len(owner)
    assert found.stands.tolist() == stands[owner].tolist()


def test_box_below_a_bridge_does_not_obstruct_it() -> None:
    boxes = Boxes.random(3)
    boxes.x[:], boxes.y[:] = 10.0, -19.0  # at the start of `c`
    for height, is_in_the_way in [(0.0, True), (1.0, True), (9.0, False)]:
        found, _, _ = find_entries(straights(height), **vars(boxes), stands=np.zeros(40, dtype=np.bool_))
        assert (2 in found.lane) == is_in_the_way


def test_part_of_entries_is_those_entries_and_another_lane_leaves_the_rest_as_it_is() -> None:
    s, tail, speed, accel = np.arange(16.0).reshape(4, 4)
    lane, source = np.array([2, 0, 1, 1]), np.array([3, 2, 1, 0])
    entries = Entries(lane, s, tail, speed, accel, source, np.array([True, False, True, False]))
    assert entries.on_lanes(lane) is entries
    other = entries.on_lanes(lane + 1)
    assert other.lane.tolist() == [3, 1, 2, 2]
    assert other.tail.tolist() == entries.tail.tolist()
    some = entries.at(np.array([3, 0]))
    assert (some.lane.tolist(), some.s.tolist(), some.stands.tolist()) == ([1, 2], [3.0, 0.0], [False, True])


def test_queue_has_each_lane_in_its_order_and_one_entry_far_ahead_for_none() -> None:
    roads = straights()
    lane = np.array([1, 0, 1, 0, 2])
    s = np.array([30.0, -0.5, 10.0, 20.0, 60.5])  # those beyond an end are at it
    index = np.arange(5)
    queue = EntryQueue(roads, Entries(lane, s, s - 2.0, s + 100.0, s + 200.0, index, np.zeros(5, dtype=np.bool_)))
    assert queue.num == 5
    assert queue.source.tolist() == [1, 3, 2, 0, 4, -1]
    assert queue.lane.tolist() == [0, 0, 1, 1, 2, -1]
    assert queue.position.tolist() == [3, 0, 2, 1, 4]
    for column, values, none in [
        (queue.s, s, np.inf),
        (queue.tail, s - 2.0, np.inf),
        (queue.speed, s + 100.0, 0.0),
        (queue.accel, s + 200.0, 0.0),
    ]:
        assert column.tolist() == [*values[queue.source[:-1]], none]
    assert queue.first_on(np.array([0, 1, 2])).tolist() == [0, 2, 4]
    found = queue.find(np.array([0, 0, 0, 1, 1, 2]), np.array([-9.0, 0.1, 20.1, 30.0, 30.1, 99.0]))
    assert found.tolist() == [0, 1, 2, 3, 4, 4]
    nothing, no_lane = np.zeros(0), np.zeros(0, dtype=np.int64)
    empty = EntryQueue(roads, Entries(no_lane, nothing, nothing, nothing, nothing, no_lane, no_lane == 0))
    assert (empty.num, empty.first_on(np.array([1])).tolist()) == (0, [0])


def test_scales_of_many_worlds_do_not_overlap() -> None:
    """The end of the last lane of a world is before the start of the first one of the next world."""
    for length in (10.0, 123.456, 1e4 + 1.0 / 3.0):
        roads = make(a=(line((0, 0), (length, 0)), ""), b=(line((0, 9), (length, 9)), ""))
        assert scale_ticks(roads) > float(roads.chain[-1]) * 65536.0
