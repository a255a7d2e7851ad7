"""Lane changes on their way and at their ends, and who looks at the lanes beside, driver by driver in plain Python."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rosbridge_sim.world.drivers.driver_perception import perceive
from rosbridge_sim.world.drivers.lane_position import headings
from rosbridge_sim.world.drivers.rule_operators import ARRAYS
from rosbridge_sim.world.followers.lane_following import LaneFollowers
from rosbridge_sim.world.geometry.planar import FloatArray
from rosbridge_sim.world.lane_changes.lane_change_model import LaneChange, follow
from rosbridge_sim.world.lane_changes.lane_change_motion import length_of_tight_shift, shift_time
from rosbridge_sim.world.lane_changes.lane_change_passing import Shifts, find_blocked, is_clear
from rosbridge_sim.world.roads.lane_change_map import LEFT, RIGHT, LaneNeighbours
from rosbridge_sim.world.state.world import Body, Kind, World
from tests.world.lane_changes.test_looks_one_by_one import Scene
from tests.world.lane_drives import BUS, world_of
from tests.world.road_factory import CAR, car, ego, keep_lane
from tests.world.wide_roads import wide_ring, wide_road

FRAME = 5_000
IS_OFF, LONG_IS_OFF = 1.0, 0.3
"""A vehicle, or one of more than 7 m, this near to its new line is not on the old lane any more [m]."""

VAN = Body(5.5, 2.0, 2.2, wheelbase=3.2, front_overhang=1.0, rear_overhang=1.3)


def decide(world: World, decision: int, accel: float = 9.0) -> tuple[FloatArray, LaneFollowers]:
    """Have all drivers decide on their changes; the accelerations (n,) that they choose then, and the drivers."""
    followers = LaneFollowers(world)
    drivers = followers.drivers()
    others, _, num_moving = followers.others(lambda: drivers)
    perception = perceive(followers.conflicts, world.signals.may_enter, drivers, others, num_moving)
    desired = np.fmin(drivers.parameters.desired_speed, perception.safe_speed)
    chosen, _ = followers.changes.decide(drivers, perception, desired, np.full(followers.num, accel), decision)
    return chosen, followers


def changes(seed: int) -> World:
    """Drivers in the middle of changes on three lanes, from rest or not, among others and slow egos."""
    rng, world = np.random.default_rng(seed), world_of(wide_road(3, (100.0, 100.0, 100.0)))
    for _ in range(14):
        name = f"{rng.choice(['l', 'm'])}{rng.integers(0, 3)}"
        lane, s = world.roads.row(name), rng.uniform(40.0, 100.0) if name[0] == "l" else rng.uniform(0.0, 40.0)
        speed = float(rng.choice([0.0, 3.0, 10.0, 20.0]) * rng.uniform(0.5, 1.3))
        if rng.random() < 0.2:
            x, y = world.roads.at([lane], [s])[0][0, :2].tolist()
            ego(world, x, y, speed=float(rng.choice([0.0, 5.0, 7.0])))
            continue
        body = [BUS, VAN, CAR, CAR][rng.integers(0, 4)]
        row = world.row(world.spawn(Kind.VEHICLE, body, name="car", x=0.0, y=0.0, speed=speed))
        keep_lane(world, row, lane, s, desired_speed=rng.uniform(5.0, 25.0), changes_lanes=rng.random() < 0.9)
        world.accel[row] = rng.uniform(-2.0, 1.5)
        if rng.random() < 0.6 and not world.keeps_lane[row]:
            world.leaving[row], world.change[row] = rng.integers(1, 3), LaneChange.FASTER
            world.signal[row] = 3 - world.leaving[row]
            away = 3.5 if world.leaving[row] == LEFT + 1 else -3.5
            world.lateral_from[row], world.lateral_left[row] = away, rng.choice([0.0, 0.1, 0.5, 0.9])
            world.lateral[row] = 0.0 if not world.lateral_left[row] else away * rng.choice([0.05, 0.09, 0.2, 0.3, 0.9])
            world.lateral_bend[row] = rng.choice([0.0, -20.0 / 3.0 * away])
        elif rng.random() < 0.3:  # beside its line, but in its lane
            world.lateral[row], world.lateral_left[row] = rng.choice([-1.2, 1.2]), 0.5
    world.frame = FRAME
    return world


class OneByOne(Scene):
    """The acceleration that a driver chooses for its own change, and behind what is slow and follows no lane."""

    def __init__(self, world: World) -> None:
        super().__init__(world)
        queue = self.perception.queue
        assert queue is not None
        columns = (queue.lane, queue.s, queue.tail, queue.speed, queue.source)
        self.entries = [tuple(column[at].item() for column in columns) for at in range(queue.num)]
        self.neighbours = world.roads.derived(LaneNeighbours)

    def follow(self, i: int, gap: float, lead_speed: float) -> float:
        """The model's acceleration behind something."""
        figures = [self.drivers.speed[i], self.desired[i], gap, lead_speed]
        return follow(*(np.array([figure]) for figure in figures)).item()

    def old_place(self, i: int) -> tuple[int, float] | None:
        """Lane and place on the lane that a driver leaves; None once it obstructs that no more."""
        world, row = self.world, int(self.followers.rows[i])
        is_long = 2.0 * world.half_length[row] > 7.0
        off = 0.3 if is_long else 1.0
        if not world.leaving[row] or abs(world.lateral[row] - world.lateral_to[row]) <= off:
            return None
        side, lane = np.array([world.leaving[row] - 1]), self.drivers.lanes[0, [i]]
        beside, s = self.neighbours.cross(side, lane, self.drivers.arc[[i]])
        return None if beside[0] < 0 else (int(beside[0]), float(s[0]))

    def ahead_on_old_lane(self, i: int) -> tuple[float, float]:
        """Gap and speed of the entity ahead on the old lane, or on the one after it."""
        place = self.old_place(i)
        assert place is not None
        lane, s = place
        nose, length = float(self.drivers.nose[i]), float(self.world.roads.length[lane])
        beyond = [entry for entry in self.entries if entry[0] == lane and entry[1] > s and entry[4] != i]
        if beyond:
            return beyond[0][2] - s - nose, beyond[0][3]
        following = int(self.drivers.lanes[1, i])
        side = int(self.world.leaving[self.followers.rows[i]]) - 1
        after = int(self.neighbours.beside[side, following]) if following >= 0 else -1
        there = [entry for entry in self.entries if entry[0] == after and after >= 0]
        return (length - s + there[0][2] - nose, there[0][3]) if there else (math.inf, 0.0)

    def mind_old_lane(self, i: int, accel: float) -> float:
        """It stops to accelerate before it must brake, walks out from rest, and brakes as firmly as it must."""
        world, rows, speed = self.world, self.followers.rows[[i]], float(self.drivers.speed[i])
        gap, lead_speed = self.ahead_on_old_lane(i)
        across = np.abs(world.lateral_from[rows] - world.lateral_to[rows])
        is_tight, change_time = world.lateral_bend[rows] != 0.0, self.drivers.parameters.change_time[[i]]
        shifts = Shifts(
            rows=rows,
            nose=self.drivers.nose[[i]],
            length=self.drivers.length[[i]],
            side=np.where(world.leaving[rows] == LEFT + 1, RIGHT, LEFT),
            done=1.0 - world.lateral_left[rows],
            across=across,
            gap=np.array([gap]),
            lead_speed=np.array([lead_speed]),
            is_tight=is_tight,
            change_time=change_time,
        )
        faster = speed + max(float(self.drivers.accel[i]), 0.0)
        if not is_clear(world, shifts, np.array([faster])).item():
            accel = min(accel, 0.0)
        if is_tight[0] and math.isfinite(gap):
            duration = shift_time(ARRAYS, change_time, np.array([speed])).item()
            walking = length_of_tight_shift(world, rows, across).item() / duration
            accel = min(accel, (walking - speed) / 0.6)
        blocked = find_blocked(world, shifts, np.array([speed])).item()
        if math.isfinite(blocked):
            gap, lead_speed = blocked, lead_speed if blocked <= gap else 0.0
            needed = max(speed**2 - lead_speed**2, 0.0) / (2.0 * max(gap, 0.1))
            accel = min(accel, max(self.follow(i, gap, lead_speed), -min(max(needed, 4.0), 8.0)))
        return accel

    def leave_room(self, i: int, accel: float) -> float:
        """A metre more than in a queue behind what follows no lane and may stay, if there is a lane beside."""
        perception, speed = self.perception, float(self.drivers.speed[i])
        gap, lead_speed = float(perception.gap[i]), float(perception.lead_speed[i])
        has_way = (
            self.neighbours.has_side[self.drivers.lanes[0, i]] and not self.world.keeps_lane[self.followers.rows[i]]
        )
        if gap < 40.0 and perception.lead[i] < 0 and max(lead_speed, speed) < 6.0 and has_way:
            accel = min(accel, max(self.follow(i, gap - 1.0, lead_speed), -4.0))
        return accel


@pytest.mark.parametrize("seed", range(8))
def test_vehicle_is_also_on_the_lane_that_it_leaves_until_it_is_off_it(seed: int) -> None:
    world = changes(seed)
    followers = LaneFollowers(world)
    drivers = followers.drivers()
    expected = []
    for i, row in enumerate(followers.rows.tolist()):
        away = abs(world.lateral[row] - world.lateral_to[row])
        is_on_both = away > (LONG_IS_OFF if world.half_length[row] > 3.5 else IS_OFF)
        part, number = world.roads.ids[world.lane[row]]
        beside = int(number) + (1 if world.leaving[row] == RIGHT + 1 else -1)
        if world.leaving[row] and is_on_both and 0 <= beside < 3:
            arc, lane = float(world.arc[row]), world.roads.row(f"{part}{beside}")
            figures = arc, arc - drivers.rear[i], drivers.speed[i], drivers.accel[i]
            expected.append((lane, i, *figures))
    found = drivers.leaving
    if found is None:
        assert not expected
        return
    columns = found.lane, found.source, found.s, found.tail, found.speed, found.accel
    told = list(zip(*(column.tolist() for column in columns), strict=True))
    assert np.array(told) == pytest.approx(np.array(expected))
    assert not found.stands.any()


@pytest.mark.parametrize("seed", range(70))
def test_drivers_mind_both_lanes_and_leave_room_as_one_by_one(seed: int) -> None:
    world = changes(seed)
    one_by_one = OneByOne(world)
    expected = []
    for i in range(one_by_one.followers.num):
        accel = 9.0 if one_by_one.old_place(i) is None else one_by_one.mind_old_lane(i, 9.0)
        expected.append(one_by_one.leave_room(i, accel))
    arrived = one_by_one.followers.rows[world.lateral_left[one_by_one.followers.rows] == 0.0]
    arrived = arrived[world.leaving[arrived] > 0]
    chosen, _ = decide(world, 1)
    assert chosen == pytest.approx(np.array(expected), rel=1e-9)
    for column in (world.leaving, world.signal, world.change):
        assert not column[arrived].any()
    assert world.change_since[arrived].tolist() == [FRAME] * len(arrived)


@pytest.mark.parametrize("decision", range(20))
def test_each_driver_looks_once_a_second_and_half_of_them_at_a_time(decision: int) -> None:
    world = world_of(wide_road(2))
    for uid in range(1, 9):
        row = world.row(world.spawn(Kind.VEHICLE, CAR, name="car", x=0.0, y=0.0, speed=20.0, uid=uid))
        keep_lane(world, row, world.roads.row("l0"), 100.0 * uid)
    world.frame = FRAME
    decide(world, decision)
    signals = world.uid[world.signal == RIGHT + 1].tolist()  # those that look want to keep right
    assert signals == [uid for uid in range(1, 9) if decision % 5 == 0 and uid % 2 == decision // 5 % 2]


@pytest.mark.parametrize("decision", range(5))
@pytest.mark.parametrize("reason", list(LaneChange)[1:])
def test_driver_that_must_change_looks_at_each_decision_and_one_that_likes_to_at_each_fifth(
    reason: LaneChange, decision: int
) -> None:
    world = world_of(wide_road(2, limit=15.0))
    row = car(world, "l0", 100.0, speed=10.0)
    world.change[row], world.signal[row] = reason, RIGHT + 1
    world.frame = FRAME
    decide(world, decision)
    has_looked = world.signal[row] == 0  # there is no reason any more
    assert has_looked == (reason >= LaneChange.ROUTE or decision == 0)


@pytest.mark.parametrize("speed", [6.0, 0.0])  # a bus in a bend of 60 m is too fast for it with 8 m/s
@pytest.mark.parametrize("side", [LEFT, RIGHT])
def test_vehicle_that_begins_a_change_belongs_to_the_other_lane_where_it_is(side: int, speed: float) -> None:
    world = world_of(wide_ring(3, radius=60.0))
    row = world.row(world.spawn(Kind.VEHICLE, BUS, name="bus", x=0.0, y=0.0, speed=speed))
    keep_lane(world, row, world.roads.row("a1"), 70.0, lateral=0.3)
    stands_at = world.roads.at([world.roads.row("a1")], [100.0])[0][0]
    ego(world, float(stands_at[0]), float(stands_at[1]))
    world.change[row], world.signal[row] = LaneChange.AROUND, side + 1
    world.behind[row] = world.claim[row] = world.exit_lane[row] = 2
    world.yaw[row] += 0.01
    world.wander_x[row], world.wander_y[row], world.wander_slope[row] = 0.07, -0.05, 0.003
    world.frame = FRAME
    x, y, yaw = float(world.x[row]) - 0.07, float(world.y[row]) + 0.05, float(world.yaw[row]) - 0.003
    decide(world, side)
    lane = world.roads.row("a0" if side == LEFT else "a2")
    assert (world.lane[row], world.ahead_1[row]) == (lane, world.roads.successors(lane)[0])
    assert (world.leaving[row], world.came_from[row]) == (2 - side, 2 - side)
    assert (world.behind[row], world.claim[row], world.exit_lane[row]) == (-1, -1, -1)
    assert (world.lateral_left[row], world.lateral_push[row]) == (1.0, 0.0)
    assert world.lateral_to[row] == world.lateral_bias[row] == pytest.approx(0.3)
    # The pose, but for its wander, is that of before: its foot on the new line, and beside the heading there.
    foot = world.roads.at([lane], [float(world.arc[row])])[0][0]
    heading = yaw - float(world.drift[row])
    lateral = float(world.lateral[row])
    assert world.lateral_from[row] == lateral
    assert world.lateral_bend[row] == pytest.approx(0.0 if speed else 20.0 / 3.0 * (0.3 - lateral))
    point = int(world.point[row])
    assert world.roads.first[lane] <= point < world.roads.first[lane + 1]
    assert world.leg_start[row] == world.roads.s[point] <= world.arc[row] < world.leg_end[row]
    assert abs(lateral) == pytest.approx(3.5 + (0.3 if side == RIGHT else -0.3), abs=0.1)
    assert (lateral > 0.0) == (side == RIGHT)
    assert foot[0] - lateral * math.sin(heading) == pytest.approx(x, abs=1e-4)
    assert foot[1] + lateral * math.cos(heading) == pytest.approx(y, abs=1e-4)
    assert abs(float(world.drift[row])) < 0.05
    lanes = world.int_block("lane", "ahead_5")[:, [row]]
    assert heading == pytest.approx(headings(world.roads, lanes, world.arc[[row]], world.wheelbase[[row]]), abs=1e-4)


@pytest.mark.parametrize("is_apart", [False, True])
def test_vehicle_that_begins_a_change_in_a_bend_steers_along_its_new_lane(*, is_apart: bool) -> None:
    world = world_of(wide_ring(3, radius=60.0))
    if is_apart:  # the rows of the drivers are no neighbours
        car(world, "b0", 90.0)
        world.spawn(Kind.OBSTACLE, CAR, name="box", x=900.0, y=0.0)
    row = car(world, "a1", 70.0, speed=8.0)
    stands_at = world.roads.at([1], [100.0])[0][0]
    ego(world, float(stands_at[0]), float(stands_at[1]))
    world.change[row], world.signal[row] = LaneChange.AROUND, LEFT + 1
    followers, decisions = LaneFollowers(world), 0
    while not world.leaving[row]:
        world.frame = FRAME + 5 * decisions
        followers.decide()
        decisions += 1
        assert decisions < 10
    assert world.lane[row] == 0
    assert world.yaw_rate[row] == pytest.approx(8.0 / 61.75, rel=0.2)  # about that of either lane


@pytest.mark.parametrize("num_others", [0, 1])
def test_bus_in_a_bend_goes_on_with_its_change_of_lanes_and_swings_later(num_others: int) -> None:
    """Whether another one swings there, or not."""
    world = world_of(wide_ring(2, radius=30.0))
    row = car(world, "a0", 40.0, speed=6.0, body=BUS)
    for i in range(num_others):
        car(world, "b0", 40.0 + 30.0 * i, speed=6.0, body=BUS)
    world.leaving[row], world.lateral_left[row] = RIGHT + 1, 0.7
    world.lateral[row], world.lateral_from[row] = -2.4, -3.5
    world.frame = FRAME
    LaneFollowers(world).decide()
    assert world.lateral_left[row] < 0.7
    assert world.lateral_from[row] == -3.5


@pytest.mark.parametrize("old", [LEFT, RIGHT])
def test_driver_on_its_way_stops_to_accelerate_before_it_would_have_to_brake(old: int) -> None:
    """What stands is a little on its side of the lane that it leaves."""
    found = []
    sign = 1.0 if old == LEFT else -1.0
    for gap in np.arange(2.0, 30.0, 4.0).tolist():
        world = world_of(wide_road(2))
        row = car(world, "l1" if old == LEFT else "l0", 100.0, speed=10.0)
        world.leaving[row], world.lateral_left[row], world.accel[row] = old + 1, 0.7, 1.5
        world.lateral_from[row], world.lateral[row] = 3.5 * sign, 2.4 * sign
        world.y[row] += 2.4 * sign
        ego(world, 100.0 + CAR.length + gap, -0.4 if old == LEFT else -3.1)
        world.frame = FRAME
        accel = OneByOne(world).mind_old_lane(0, 9.0)
        assert decide(world, 1)[0].item() == pytest.approx(accel)
        found.append(accel)
    assert found == sorted(found), "the farther, the less"
    assert found[0] < -2.0 < 0.0 in found
    assert found[-1] == 9.0
