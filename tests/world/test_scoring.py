"""Scores of the egos: each figure against a drive whose figures are known."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from rosbridge_sim.records import replace
from rosbridge_sim.world.roads.roads import Roads
from rosbridge_sim.world.roads.signal_plan import Controller, Lamp, Light, Phase, SignalPlan
from rosbridge_sim.world.scoring import BACK_INSIDE, NO_EDGES, NUM_IDS, Score, read_score
from rosbridge_sim.world.state.commands import command
from rosbridge_sim.world.state.commands import shift as shift_gear
from rosbridge_sim.world.state.placement import place_ghost, show_ghosts, teleport
from rosbridge_sim.world.state.world import DT, Body, Gear, Kind, Mode, World
from rosbridge_sim.world.step import step
from tests.world.lane_drives import world_of
from tests.world.road_factory import CAR, arc, crossing, line, make, road, signalled

pytestmark = pytest.mark.usefixtures("loops")

NOSE = CAR.length - CAR.rear_overhang
MAN = Body.box(0.45, 0.55, 1.7)


def ego(world: World, x: float, y: float, *, yaw: float = 0.0, speed: float = 0.0) -> int:
    """An ego in D; returns the row."""
    return world.row(world.spawn(Kind.EGO, CAR, name="ego", x=x, y=y, yaw=yaw, speed=speed))


def drive(world: World, row: int, speed: float, steer: float = 0.0) -> None:
    """Have an ego hold a speed, as it does already."""
    command(world, row, mode=Mode.SPEED, speed=speed, steer=steer)


def run(world: World, seconds: float, watch: Callable[[], object] = lambda: None) -> None:
    for _ in range(round(seconds / DT)):
        step(world)
        watch()


def two_lanes(*, may_change_back: bool = True) -> Roads:
    """Two lanes to the east, the left one at y = 3.5, each 3.5 m wide; one may change to the left."""
    return Roads(
        ["right", "left"],
        [line((0, 0), (500, 0)), line((0, 3.5), (500, 3.5))],
        [[], []],
        [3.5, 3.5],
        [15.0, 15.0],
        left=[1, -1],
        right=[-1, 0 if may_change_back else -1],
    )


def scored(roads: Roads | None = None, plan: SignalPlan | None = None) -> World:
    world = world_of(roads or Roads(), plan)
    world.start_scoring()
    return world


# When


def test_world_without_scoring_keeps_no_scores_and_its_digest() -> None:
    plain, scoring = world_of(road()), world_of(road())
    for world in (plain, scoring):
        drive(world, ego(world, 0.0, 0.0, speed=10.0), 10.0)
    before = plain.digest()
    assert before == scoring.digest()
    scoring.start_scoring()
    assert scoring.digest() != before, "what is counted from now on is part of the state"
    run(plain, 1.0)
    assert not plain.is_scoring
    assert plain.score_distance[0] == plain.score_frames[0] == 0


def test_scoring_moves_nothing() -> None:
    plain, scoring = (world_of(*signalled()) for _ in range(2))
    scoring.start_scoring()
    for world in (plain, scoring):
        drive(world, ego(world, -60.0, 0.0, speed=10.0), 10.0)
        world.spawn(Kind.PEDESTRIAN, MAN, name="man", x=-30.0, y=0.0)
        run(world, 8.0)
    assert [column.tolist() for column in plain.block("x", "z")] == [
        column.tolist() for column in scoring.block("x", "z")
    ]


def test_scores_count_from_the_frame_of_the_start_or_of_the_ego() -> None:
    world = world_of(road())
    first = ego(world, 0.0, 0.0, speed=10.0)
    drive(world, first, 10.0)
    run(world, 1.0)
    world.start_scoring()
    run(world, 1.0)
    second = ego(world, 100.0, 0.0)
    world.start_scoring()  # twice is no error, and changes nothing
    run(world, 1.0)
    scores = [read_score(world, row) for row in (first, second)]
    assert [score.since for score in scores] == [50, 100]
    assert scores[0].distance == pytest.approx(20.0)
    assert scores[1].distance == 0.0


def test_frame_of_an_impact_counts_as_any_other() -> None:
    world = World(has_impacts=True)
    world.lay_roads(road())
    row = ego(world, 0.0, 0.1, speed=10.0)
    world.spawn(Kind.VEHICLE, CAR, name="car", x=20.0, y=0.1, yaw=0.0)
    drive(world, row, 10.0)
    world.start_scoring()
    while not world.has_collided[row]:
        before = world.score_distance.item(row)
        step(world)
    assert world.score_distance[row] - before == pytest.approx(10.0 * DT, rel=0.1)
    assert world.lane_offset[row] == pytest.approx(0.1, abs=0.02)


def test_reset_of_scores_counts_anew_and_reset_of_the_world_ends_scoring() -> None:
    world = scored(road())
    drive(world, ego(world, 0.0, 0.0, speed=10.0), 10.0)
    run(world, 1.0)
    world.reset_scores()
    assert read_score(world, 0).since == 50
    assert read_score(world, 0).distance == 0.0
    run(world, 0.5)
    assert read_score(world, 0).distance == pytest.approx(5.0)
    world.reset()
    assert not world.is_scoring
    world.reset_scores()
    assert not world.is_scoring


def test_snapshot_restores_scores_to_the_bit() -> None:
    world = scored(*signalled())
    drive(world, ego(world, -60.0, 0.0, speed=10.0), 12.0, 0.001)
    world.spawn(Kind.OBSTACLE, MAN, name="post", x=-30.0, y=0.5)
    run(world, 2.0)
    saved = world.snapshot()
    run(world, 2.0)
    end, score = world.digest(), read_score(world, 0)
    other = World()
    other.restore(saved)
    assert other.is_scoring
    run(other, 2.0)
    assert other.digest() == end
    assert score.num_stop_lines == score.num_collisions == 1
    assert read_score(other, 0) == score
    other.restore(world_of(road()).snapshot())
    assert not other.is_scoring


# Distance, jerk, lateral acceleration


def test_distance_counts_forward_and_backward() -> None:
    world = scored()
    row = ego(world, 0.0, 0.0, speed=5.0)
    drive(world, row, 5.0)
    run(world, 2.0)
    assert read_score(world, row).distance == pytest.approx(10.0)
    teleport(world, row, x=1e3, y=0.0, z=0.0, yaw=0.0)
    assert shift_gear(world, row, Gear.REVERSE)
    drive(world, row, 5.0)
    run(world, 1.0)
    assert world.x[row] < 999.0
    assert read_score(world, row).distance == pytest.approx(10.0 + 1e3 - float(world.x[row]))


def test_circle_has_its_lateral_acceleration_and_no_jerk() -> None:
    world = scored()
    row = ego(world, 0.0, 0.0, speed=8.0)
    world.steer[row] = 0.1
    drive(world, row, 8.0, 0.1)
    run(world, 1.0)
    score = read_score(world, row)
    lateral = 64.0 * math.tan(0.1) / CAR.wheelbase
    assert score.lateral_accel == pytest.approx(lateral)
    assert score.max_lateral_accel == pytest.approx(lateral)
    assert score.rms_lateral_accel == pytest.approx(lateral)
    assert score.max_jerk == pytest.approx(0.0, abs=1e-6)


def test_jerk_is_the_change_of_the_acceleration_between_two_frames() -> None:
    world = scored()
    row = ego(world, 0.0, 0.0, speed=8.0)
    jerks, before = [], 0.0
    for accel in (0.0, 1.0, 1.0, -2.0, 0.5):
        command(world, row, mode=Mode.ACCEL, accel=accel, steer=0.0)
        step(world)
        jerks.append((float(world.accel[row]) - before) / DT)
        before = float(world.accel[row])
        assert read_score(world, row).jerk == pytest.approx(jerks[-1], abs=1e-9)
    score = read_score(world, row)
    assert score.max_jerk == pytest.approx(150.0, rel=1e-6)
    assert score.rms_jerk == pytest.approx(math.sqrt(sum(jerk * jerk for jerk in jerks) / 5))


def test_restored_sum_of_squares_that_cannot_be_reads_as_zero() -> None:
    world = scored()
    row = ego(world, 0.0, 0.0)
    world.jerk_square_sum[row] = world.lateral_accel_square_sum[row] = -1.0
    assert (read_score(world, row).rms_jerk, read_score(world, row).rms_lateral_accel) == (0.0, 0.0)


def test_teleport_is_no_jerk() -> None:
    world = scored()
    row = ego(world, 0.0, 0.0, speed=8.0)
    command(world, row, mode=Mode.ACCEL, accel=2.0, steer=0.0)
    run(world, 0.1)
    world.reset_scores()
    teleport(world, row, x=0.0, y=50.0, z=0.0, yaw=1.0)
    command(world, row, mode=Mode.PEDALS, steer=0.0)
    step(world)
    assert read_score(world, row).max_jerk == 0.0


# Collisions


def test_contact_counts_once_for_as_long_as_it_lasts() -> None:
    world = scored()
    row = ego(world, 0.0, 0.0, speed=10.0)
    drive(world, row, 10.0)
    posts = [world.spawn(Kind.OBSTACLE, MAN, name="post", x=x, y=0.0) for x in (20.0, 22.0, 40.0)]
    events: list[int] = []
    run(world, 6.0, lambda: events.append(int(world.has_collided[row])))
    score = read_score(world, row)
    assert score.num_collisions == sum(events) == 3
    assert score.contact_ids == tuple(posts)


def test_both_egos_of_a_contact_count_it_and_others_do_not() -> None:
    world = scored()
    rows = [ego(world, x, y) for x, y in ((0.0, 0.0), (1.0, 0.0), (50.0, 0.0))]
    step(world)
    assert [read_score(world, row).num_collisions for row in rows] == [1, 1, 0]
    assert [read_score(world, row).contact_ids for row in rows] == [(2,), (1,), ()]
    assert world.has_collided[rows].tolist() == [True, True, False]
    step(world)
    assert world.has_collided[rows].tolist() == [False, False, False]


def test_ids_of_the_latest_contacts_are_kept_in_order() -> None:
    world = scored()
    row = ego(world, 0.0, 0.0, speed=10.0)
    drive(world, row, 10.0)
    world.spawn(Kind.OBSTACLE, MAN, name="first", x=8.0, y=0.0)
    crowd = [world.spawn(Kind.OBSTACLE, MAN, name="post", x=20.0, y=0.0) for _ in range(NUM_IDS + 3)]
    last = world.spawn(Kind.OBSTACLE, MAN, name="last", x=30.0, y=0.0)
    run(world, 4.0)
    score = read_score(world, row)
    assert score.num_collisions == NUM_IDS + 5
    assert score.contact_ids == (*crowd[-NUM_IDS + 1 :], last)


# Lanes


def test_offset_is_that_of_the_middle_of_the_box_left_positive() -> None:
    world = scored(road())
    row = ego(world, 100.0, 0.4, speed=10.0)
    drive(world, row, 10.0)
    run(world, 1.0)
    teleport(world, row, x=200.0, y=-0.8, z=0.0, yaw=0.0, speed=10.0)
    drive(world, row, 10.0)
    run(world, 1.0)
    score = read_score(world, row)
    assert score.lane_offset == pytest.approx(-0.8)
    assert score.mean_lane_offset == pytest.approx(0.6)
    assert score.max_lane_offset == pytest.approx(0.8)


def test_off_road_time_counts_while_the_middle_is_on_no_lane() -> None:
    world = scored(road())
    row = ego(world, 100.0, 1.7)
    run(world, 1.0)
    assert not read_score(world, row).is_off_road
    teleport(world, row, x=100.0, y=1.8, z=0.0, yaw=0.0)
    run(world, 0.5)
    score = read_score(world, row)
    assert score.is_off_road
    assert score.off_road_time == pytest.approx(0.5)
    assert score.lane_offset == 0.0
    assert score.max_lane_offset == pytest.approx(1.7)
    teleport(world, row, x=1010.0, y=0.0, z=0.0, yaw=0.0)  # behind the end
    step(world)
    assert read_score(world, row).is_off_road


def test_lane_of_the_other_direction_is_road_too() -> None:
    world = scored(make(there=(line((0, 0), (500, 0)), ""), back=(line((500, 3.5), (0, 3.5)), "")))
    row = ego(world, 100.0, 3.5)
    run(world, 1.0)
    assert read_score(world, row).off_road_time == 0.0


def test_map_without_lanes_has_no_road_to_leave() -> None:
    world = scored()
    row = ego(world, 5.0, 5.0, speed=10.0)
    drive(world, row, 10.0)
    run(world, 1.0)
    score = read_score(world, row)
    assert (score.off_road_time, score.num_lane_invasions, score.num_stop_lines) == (0.0, 0, 0)


def shift(world: World, row: int, *ys: float) -> list[int]:
    """Slide a ghost sideways from place to place, as a recording would, and return its lane invasions."""
    place_ghost(world, row, x=100.0, y=ys[0], z=0.0, yaw=0.0)
    step(world)
    counts = []
    for y in ys[1:]:
        for way in np.linspace(float(world.y[row]), y, 20):
            show_ghosts(world, np.array([row]), ["y"], np.array([[way]]))
            step(world)
        counts.append(read_score(world, row).num_lane_invasions)
    return counts


def test_reaching_over_an_outer_edge_counts_once_until_back_inside() -> None:
    world = scored(road())
    edge = 1.75 - CAR.width / 2
    row = ego(world, 100.0, 0.0)
    barely = edge - 0.5 * BACK_INSIDE
    assert shift(world, row, 0.0, edge + 0.01, barely, edge + 0.01, 0.0, edge + 0.01, 0.0, -edge - 0.01) == [
        *(1, 1, 1, 1, 2, 2, 3)
    ]


def test_permitted_lane_change_is_no_invasion() -> None:
    world = scored(two_lanes())
    assert shift(world, ego(world, 100.0, 0.0), 0.0, 3.5, 0.0) == [0, 0]
    world = scored(two_lanes(may_change_back=False))
    row = ego(world, 100.0, 0.0)
    assert shift(world, row, 0.0, 3.5, 0.0) == [0, 1], "the same line may be crossed from one side alone"


def test_edge_behind_the_lane_changed_to_counts() -> None:
    world = scored(two_lanes())
    assert shift(world, ego(world, 100.0, 0.0), 0.0, 5.0) == [1]


def test_ego_that_is_placed_on_an_edge_has_not_crossed_it() -> None:
    world = scored(road())
    row = ego(world, 100.0, 1.6)
    run(world, 0.2)
    teleport(world, row, x=200.0, y=-1.6, z=0.0, yaw=0.0)
    run(world, 0.2)
    assert read_score(world, row).num_lane_invasions == 0


def test_lanes_have_no_edges_where_they_fork_and_join() -> None:
    world = scored(
        make(
            a=(line((0, 0), (100, 0)), "b c"),
            b=(line((100, 0), (200, 0)), "d"),
            c=(arc(100, 200, 200, -90, 20), ""),
            d=(line((200, 0), (300, 0)), ""),
        )
    )
    for x, num in ((100.0 + 0.5 * NO_EDGES, 0), (100.0 + 1.5 * NO_EDGES, 1)):
        row = ego(world, x, 0.0)
        place_ghost(world, row, x=x, y=0.0, z=0.0, yaw=0.0)
        step(world)
        show_ghosts(world, np.array([row]), ["y"], np.array([[-1.2]]))
        step(world)
        assert read_score(world, row).num_lane_invasions == num
        world.remove(int(world.uid[row]))


# Stop lines and red lights


@pytest.mark.parametrize(("start", "num_red"), [("s", 1), ("w", 0)])
def test_red_light_is_judged_as_the_bumper_comes_over_the_line(start: str, num_red: int) -> None:
    world = scored(*signalled())
    x, y, yaw = {"s": (0.0, -40.0, math.pi / 2), "w": (-40.0, 0.0, 0.0)}[start]
    row = ego(world, x, y, yaw=yaw, speed=10.0)
    drive(world, row, 10.0)
    frames: list[int] = []
    lines: list[int] = []

    def watch() -> None:
        lines.append(int(world.num_stop_lines[row]))
        if world.has_passed_red[row]:
            frames.append(world.frame)

    run(world, 6.0, watch)
    score = read_score(world, row)
    assert (score.num_stop_lines, score.num_red_lights) == (1, num_red)
    passed = math.ceil((30.0 - NOSE) / 10.0 / DT)
    assert lines.index(1) + 1 == pytest.approx(passed, abs=1)
    assert frames == ([lines.index(1) + 1] if num_red else [])


def test_yellow_is_no_red_and_dark_is_none() -> None:
    for value in (Lamp.YELLOW, 0, Lamp.RED | Lamp.GREEN):
        world = scored(*signalled())
        world.signals.force(1, int(value))
        row = ego(world, 0.0, -20.0, yaw=math.pi / 2, speed=10.0)
        drive(world, row, 10.0)
        run(world, 3.0)
        assert (read_score(world, row).num_stop_lines, read_score(world, row).num_red_lights) == (1, 0)


def test_marked_line_without_a_light_is_a_stop_line() -> None:
    roads = Roads(
        ["a", "b"],
        [line((0, 0), (50, 0)), line((50, 0), (99, 0))],
        [[1], []],
        [3.5] * 2,
        [9.0] * 2,
        is_stop=[True, False],
    )
    for roads_, num in ((roads, 1), (crossing(), 0)):
        world = scored(roads_)
        row = ego(world, 20.0 if num else -40.0, 0.0, speed=10.0)
        drive(world, row, 10.0)
        run(world, 4.0)
        assert read_score(world, row).num_stop_lines == num


def test_line_is_not_passed_beside_it_backwards_or_by_a_teleport() -> None:
    world = scored(*signalled())
    beside = ego(world, 3.0, -40.0, yaw=math.pi / 2, speed=10.0)
    against = ego(world, 0.0, 20.0, yaw=-math.pi / 2, speed=10.0)
    for row in (beside, against):
        drive(world, row, 10.0)
    run(world, 3.5)
    placed = ego(world, 0.0, -40.0, yaw=math.pi / 2)
    teleport(world, placed, x=0.0, y=5.0, z=0.0, yaw=math.pi / 2)
    run(world, 0.1)
    assert [read_score(world, row).num_stop_lines for row in (beside, against, placed)] == [0, 0, 0]


def fork(*, left_is_red: bool) -> tuple[Roads, SignalPlan]:
    """A lane to the east whose line has two lanes behind it, straight on and to the left, with lights of their own."""
    roads = make(
        a=(line((0, 0), (50, 0)), "on left"),
        on=(line((50, 0), (80, 0)), ""),
        left=(arc(50, 12, 12, -90, 90), ""),
    )
    lights = [Light("on", lanes=(1,)), Light("left", lanes=(2,))]
    colours = (Lamp.GREEN, Lamp.RED) if left_is_red else (Lamp.RED, Lamp.GREEN)
    return roads, SignalPlan(roads, lights, [Controller("I", 1, ((0,), (1,)), (Phase(9_999, colours),), (150, 150))])


@pytest.mark.parametrize("left_is_red", [False, True])
@pytest.mark.parametrize("turns_left", [False, True])
def test_light_of_the_lane_really_taken_counts(*, left_is_red: bool, turns_left: bool) -> None:
    world = scored(*fork(left_is_red=left_is_red))
    row = ego(world, 44.0, 0.0, speed=5.0)
    drive(world, row, 5.0)

    def steer() -> None:
        if turns_left and world.x[row] > 50.0:
            drive(world, row, 5.0, math.atan(CAR.wheelbase / 12.0))

    run(world, 4.0, steer)
    score = read_score(world, row)
    assert score.num_stop_lines == 1
    assert score.num_red_lights == int(turns_left == left_is_red)
    assert world.open_line[row] == world.open_reds[row] == 0


def test_car_that_backs_off_behind_the_line_has_taken_no_lane() -> None:
    world = scored(*fork(left_is_red=True))
    row = ego(world, 50.0 - NOSE - 0.5, 0.0, speed=2.0)
    drive(world, row, 2.0)
    run(world, 0.5)
    assert world.open_line[row] == 1
    teleport(world, row, x=20.0, y=0.0, z=0.0, yaw=0.0)
    assert world.open_line[row] == 0
    run(world, 0.5)
    assert read_score(world, row).num_red_lights == 0


def test_new_map_forgets_the_lines_of_the_old_one() -> None:
    world = scored(*fork(left_is_red=True))
    row = ego(world, 50.0 - NOSE - 0.5, 0.0, speed=2.0)
    drive(world, row, 2.0)
    run(world, 0.5)
    world.lay_roads(road(10.0))
    assert world.near_lane[row] == world.open_line[row] == 0
    run(world, 1.0)
    world.lay_roads(Roads())
    run(world, 0.1)


# Many


def on_many_floors(chosen: list[int]) -> World:
    """Egos that drive over one crossing, each on a floor of its own with a post there, so that none meets another."""
    rng = np.random.default_rng(3)
    world = world_of(*signalled())
    world.start_scoring()
    for i in range(max(chosen) + 1):
        x, y, yaw, speed, steer = rng.uniform([-60, -60, -3, 0, -0.1], [60, 60, 3, 15, 0.1]).tolist()
        if i in chosen:
            row = world.row(
                world.spawn(Kind.EGO, CAR, name="ego", x=x, y=y, z=50.0 * i, yaw=yaw, speed=speed, uid=2 * i)
            )
            drive(world, row, speed, steer)
            ahead = (x + 9.0 * math.cos(yaw), y + 9.0 * math.sin(yaw))
            world.spawn(Kind.OBSTACLE, MAN, name="post", x=ahead[0], y=ahead[1], z=50.0 * i, uid=2 * i + 1)
    return world


def test_egos_together_get_the_bits_that_each_alone_gets() -> None:
    together = on_many_floors(list(range(20)))
    run(together, 1.0)
    for i in (0, 7, 19):
        alone = on_many_floors([i])
        run(alone, 1.0)
        assert read_score(alone, alone.row(2 * i)) == read_score(together, together.row(2 * i))
    assert together.num_collisions.sum() > 5
    assert together.off_road_frames.sum() > 0 < together.road_frames.sum()


@pytest.mark.slow
def test_thousand_egos_together_get_the_bits_that_each_alone_gets() -> None:
    together = on_many_floors(list(range(1_000)))
    run(together, 0.4)
    for i in range(0, 1_000, 125):
        alone = on_many_floors([i])
        run(alone, 0.4)
        # Of so many above one another, the collision detector looks at a part of the pairs.
        pair = [
            replace(read_score(world, world.row(2 * i)), num_collisions=0, contact_ids=())
            for world in (alone, together)
        ]
        assert pair[0] == pair[1]


def test_world_of_no_egos_and_an_ego_that_is_removed_do_no_harm() -> None:
    world = scored(road())
    step(world)
    row = ego(world, 0.0, 0.0)
    step(world)
    world.remove(int(world.uid[row]))
    step(world)
    row = ego(world, 0.0, 0.0)
    step(world)
    assert isinstance(read_score(world, row), Score)
    assert read_score(world, row).since == 3
