"""Actions, rewards, observations and starts, in exact figures: on a straight road made by hand, without episodes."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

pytest.importorskip("gymnasium", reason="the extra rosbridge-sim[gym]")

from rosbridge_sim import Worlds
from rosbridge_sim.environments.action_kinds import make_action
from rosbridge_sim.environments.driving_task import CLEAR, DrivingTask
from rosbridge_sim.environments.judgement import Judgement
from rosbridge_sim.environments.observations import achieved_goals, bounds_of, desired_goals, observe, space_of
from rosbridge_sim.environments.rewards import distance_to_goal, goal_cost, judge, stands_in_bay
from rosbridge_sim.environments.starts import Starts
from rosbridge_sim.environments.top_view import draw
from rosbridge_sim.world.many_worlds.batch import OneOfMany
from rosbridge_sim.world.roads.roads import Roads
from rosbridge_sim.world.state.world import Body, Gear, Kind
from rosbridge_sim.worlds.drivable_worlds import DrivableWorlds
from tests.world.road_factory import ego, line, road

EVERY: Any = (slice(None), 0)
"""The first ego of each world."""

CENTRE = float(Body().length / 2 - Body().rear_overhang)


def worlds_of(*egos: dict[str, float]) -> Any:  # noqa: ANN401 - some tests want worlds that move
    """Worlds with one ego each on a road of 1 km to the east."""
    found = []
    for each in egos:
        world = OneOfMany()
        world.lay_roads(road(1000.0))
        world.start_scoring()
        ego(world, **({"x": 100.0, "y": 0.0} | each))
        found.append(world)
    return DrivableWorlds(found)


def task(**options: Any) -> DrivingTask:  # noqa: ANN401 - attributes of a task
    return DrivingTask("loop", **options)


# Actions


def test_numbers_become_angles_and_accelerations() -> None:
    worlds = worlds_of({}, {})
    kind = make_action(worlds, task(), EVERY)
    chosen = kind.check([[0.5, -2.0], [3.0, 0.25]], 2)
    assert chosen.tolist() == [[0.5, -1.0], [1.0, 0.25]]
    command = kind.command(chosen)
    assert command is not None
    assert {name: values.ravel().tolist() for name, values in command.items()} == {
        "steering": [0.25, 0.5],
        "accel": [-4.0, 1.0],
    }
    for wrong, why in (([[0.0, 0.0]], r"shape \(2, 2\)"), ([[0.0, np.nan]] * 2, "finite")):
        with pytest.raises(ValueError, match=f"actions: expected {why}"):
            kind.check(wrong, 2)


def test_pedals_are_pressed_one_at_a_time() -> None:
    kind = make_action(worlds_of({}, {}, {}), task(action="Pedals"), EVERY)
    command = kind.command(np.array([[0.1, 0.7], [0.0, -0.4], [0.0, 0.0]]))
    assert command is not None
    assert command["throttle"].ravel().tolist() == [0.7, 0.0, 0.0]
    assert command["brake"].ravel().tolist() == [0.0, 0.4, 0.0]
    assert command["steering"].ravel().tolist() == [0.05, 0.0, 0.0]


def test_standing_ego_chooses_its_way_and_a_moving_one_keeps_it() -> None:
    worlds = worlds_of({}, {}, {"speed": 3.0}, {"speed": -3.0})
    worlds.world(3).gear[0] = Gear.REVERSE
    kind = make_action(worlds, task(reverses=True), EVERY)
    command = kind.command(np.array([[0.0, 0.5], [0.0, -0.5], [0.0, -0.5], [0.0, -0.5]]))
    assert command is not None
    assert command["gear"].ravel().tolist() == [Gear.DRIVE, Gear.REVERSE, Gear.DRIVE, Gear.REVERSE]
    assert command["accel"].ravel().tolist() == [2.0, 2.0, -2.0, 2.0]


def test_wishes_choose_among_the_speeds_and_stay_within_them() -> None:
    worlds = worlds_of({"speed": 9.0}, {"speed": 30.0})
    kind = make_action(worlds, task(action="DiscreteMeta", target_speeds=(5.0, 10.0, 20.0)), EVERY)
    kind.begin(np.array([True, True]))
    wanted = []
    for actions in ([3, 3], [3, 4], [1, 4], [1, 4], [4, 1]):
        chosen = kind.check(actions, 2)
        assert kind.command(chosen) is None
        wanted.append([float(worlds.world(i).desired_speed[0]) for i in range(2)])
    assert wanted == [[20.0, 20.0], [20.0, 10.0], [20.0, 5.0], [20.0, 5.0], [10.0, 5.0]]
    assert kind.check([0, 2], 2).tolist() == [[1.0, 0.0], [-1.0, 0.0]]
    for wrong in ([5, 0], [[0, 0]], [-1, 0], [0.5, 1]):
        with pytest.raises(ValueError, match=r"actions: expected 2 numbers within 0\.\.4"):
            kind.check(wrong, 2)


def test_wish_for_another_lane_begins_a_change_at_once() -> None:
    world = OneOfMany()
    lines = [line((0, 3.5), (500, 3.5)), line((0, 0), (500, 0))]
    world.roads = Roads(["l", "r"], lines, [[], []], [3.5, 3.5], [15.0, 15.0], left=[-1, 0], right=[1, -1])
    ego(world, 50.0, 0.0, speed=10.0)
    kind = make_action(DrivableWorlds([world]), task(action="DiscreteMeta"), EVERY)  # type: ignore[arg-type]
    kind.begin(np.array([True]))
    lanes = []
    for action in (1, 0):
        kind.command(kind.check([action], 1))
        lanes.append(world.roads.ids[int(world.lane[0])])
    assert lanes == ["r", "l"]


def test_speeds_to_choose_from_are_shares_of_the_wanted_one() -> None:
    assert task(target_speed=20.0).speeds == (10.0, 15.0, 20.0, 25.0)
    assert task(target_speeds=(3.0, 4.0)).speeds == (3.0, 4.0)


# Rewards


def judged(
    worlds: DrivableWorlds,
    options: DrivingTask,
    *,
    actions: list[list[float]] | None = None,
    red_lights: float = 0.0,
    **more: Any,  # noqa: ANN401 - arrays
) -> Judgement:
    num = worlds.num_worlds
    given = {"goals": np.full((num, 1, 3), np.nan), "goal_lanes": np.zeros((num, 0), bool)} | more
    chosen = np.zeros((num, 2)) if actions is None else np.array(actions)
    return judge(worlds, options, chosen, at=EVERY, red_lights=np.full(num, red_lights), **given)  # type: ignore[arg-type]


NOTHING = dict.fromkeys(("speed", "offset", "steering", "failure", "red_light", "near_miss", "arrived", "goal"), 0.0)


@pytest.mark.parametrize(
    ("weight", "ego", "actions", "reward"),
    [
        ("speed", {"speed": 15.0}, None, 1.0),
        ("speed", {"speed": 7.5}, None, 0.5),
        ("speed", {"speed": 22.5}, None, 0.5),
        ("speed", {"speed": 40.0}, None, 0.0),
        ("speed", {"speed": 15.0, "yaw": math.pi / 3}, None, 0.5),
        ("offset", {"y": 0.5}, None, -0.25),
        ("offset", {"y": -0.5}, None, -0.25),
        ("offset", {"y": 5.0}, None, -1.0),
        ("steering", {}, [[0.5, 1.0]], -0.25),
        ("failure", {"speed": -0.6}, None, -1.0),
        ("failure", {"speed": -0.4}, None, 0.0),
    ],
)
def test_each_term_of_the_reward_is_what_it_says(
    weight: str,
    ego: dict[str, float],
    actions: list[list[float]] | None,
    reward: float,
) -> None:
    found = judged(worlds_of(ego), task(weights=NOTHING | {weight: 1.0}), actions=actions)
    assert found.reward == pytest.approx([reward])
    assert found.is_over.tolist() == [weight == "failure" and reward < 0.0]
    assert found.offset.tolist() == [ego.get("y", 0.0)]


def test_scores_count_in_the_reward() -> None:
    worlds = worlds_of({"speed": 5.0}, {"speed": 0.4}, {"speed": 5.0}, {"speed": 5.0})
    first, standing, hit, lost = (worlds.world(i) for i in range(4))
    first.time_to_collision[0] = standing.time_to_collision[0] = 0.75
    first.num_red_lights[0], hit.num_collisions[0], lost.is_off_road[0] = 3, 2, 1
    found = judged(worlds, task(weights=NOTHING | {"near_miss": 1.0}), red_lights=1.0)
    assert found.reward == pytest.approx([-0.5, 0.0, 0.0, 0.0])
    assert (found.has_collided.tolist(), found.is_off_road.tolist()) == (
        [False, False, True, False],
        [False, False, False, True],
    )
    assert found.is_over.tolist() == [False, False, True, True]
    found = judged(worlds, task(weights=NOTHING | {"red_light": 1.0}), red_lights=1.0)
    assert found.reward == pytest.approx([-2.0, 1.0, 1.0, 1.0])


def test_largest_offset_ends_an_episode() -> None:
    found = judged(worlds_of({"y": 1.0}, {"y": -1.2}), task(max_offset=1.1))
    assert found.is_off_road.tolist() == [False, True]


def test_ego_arrives_on_a_lane_of_the_goal_as_far_along_as_wanted() -> None:
    worlds = worlds_of({"x": 100.0}, {"x": 99.0}, {"x": 200.0}, {"x": 200.0, "speed": -1.0})
    options = task(goal="lane", goal_lane="*", goal_s=100.0, weights=NOTHING | {"arrived": 2.0})
    goal_lanes = np.array([[True], [True], [False], [True]])
    found = judged(worlds, options, goal_lanes=goal_lanes)
    assert found.has_arrived.tolist() == [True, False, False, False]  # the last one drives the wrong way
    assert found.is_over.tolist() == [True, False, False, True]
    assert found.reward == pytest.approx([2.0, 0.0, 0.0, 0.0])


def test_own_function_takes_the_place_of_the_terms() -> None:
    worlds = worlds_of({"speed": 15.0}, {})
    assert judged(worlds, task(reward=lambda _w, told, _a: 2.0 * told.speed)).reward.tolist() == [30.0, 0.0]
    with pytest.raises(ValueError, match=r"reward: expected an array of shape \(2,\) from the function, got \(3,\)"):
        judged(worlds, task(reward=lambda *_: [0.0] * 3))


BAY = np.array([[[50.0, 20.0, 0.5]]])


@pytest.mark.parametrize(
    ("away", "turn", "speed", "is_there"),
    [
        (0.0, 0.0, 0.0, True),
        (0.49, 0.0, 0.0, True),
        (0.51, 0.0, 0.0, False),
        (0.0, 0.19, 0.0, True),
        (0.0, -0.21, 0.0, False),
        (0.0, 2 * math.pi - 0.1, 0.0, True),
        (0.0, math.pi, 0.0, False),
        (0.0, 0.0, 0.19, True),
        (0.0, 0.0, -0.21, False),
    ],
)
def test_ego_stands_in_its_bay(away: float, turn: float, speed: float, is_there: bool) -> None:  # noqa: FBT001 - of the table
    yaw = 0.5 + turn
    x, y = 50.0 + away * math.sin(0.5), 20.0 - away * math.cos(0.5)
    worlds = worlds_of({"x": x - CENTRE * math.cos(yaw), "y": y - CENTRE * math.sin(yaw), "yaw": yaw, "speed": speed})
    achieved, desired = achieved_goals(worlds), desired_goals(BAY)
    assert stands_in_bay(achieved, desired).tolist() == [[is_there]]
    assert distance_to_goal(achieved, desired)[0, 0] == pytest.approx(away, abs=1e-4)
    cost = -math.sqrt(
        0.01 * away * (abs(math.sin(0.5)) + math.cos(0.5))
        + 0.02 * (abs(math.cos(yaw) - math.cos(0.5)) + abs(math.sin(yaw) - math.sin(0.5)))
    )
    assert goal_cost(achieved, desired)[0, 0] == pytest.approx(cost, abs=1e-3)
    options = task(goal="bay", goal_lane="*", observation="Goal", max_distance=0.5, weights=NOTHING | {"goal": 1.0})
    found = judged(worlds, options, goals=BAY)
    assert found.has_arrived.tolist() == [is_there]
    assert found.is_off_road.tolist() == [away > 0.5]
    assert found.reward == pytest.approx([cost], abs=1e-3)
    assert not found.is_wrong_way.any()


def test_speed_of_a_goal_is_along_the_axes_of_the_map_with_the_slip_of_the_ego() -> None:
    still, moving = worlds_of({"yaw": 0.5, "speed": 3.0}), worlds_of({"yaw": 0.0, "speed": 1.0})
    world = still.world(0)
    world.lateral_speed[world.rows(Kind.EGO)] = 0.8
    unit = float(achieved_goals(moving)[0, 0, 2])
    cos, sin = math.cos(0.5), math.sin(0.5)
    wanted = [unit * (3.0 * cos - 0.8 * sin), unit * (3.0 * sin + 0.8 * cos)]
    assert achieved_goals(still)[0, 0, 2:4].tolist() == pytest.approx(wanted, rel=1e-5)


def test_goal_without_a_bay_is_refused() -> None:
    for goal in ({}, {"goal": "lane", "goal_lane": "*"}):
        with pytest.raises(ValueError, match="observation: Goal needs goal='bay'"):
            task(observation="Goal", **goal)
    with pytest.raises(ValueError, match="goal_lane: expected the lanes of the goal, got ''"):
        task(observation="Goal", goal="bay")


# Observations


def test_figures_are_divided_by_their_bounds_and_cut_to_them() -> None:
    worlds = worlds_of({"x": 100.0, "y": 0.5, "speed": 50.0})
    exact, scaled = (observe(worlds, task(normalize=normalize))[0, 0] for normalize in (False, True))
    figures = [40.0, 0.5, 0.0, 1.25, 2.25, 0.0, 0.0, 5.0, -0.5, 10.0, -0.5, 20.0, -0.5, 40.0, -0.5]
    assert exact == pytest.approx(figures)
    bounds = [40.0, 4.0, math.pi, 8.0, 8.0, 0.5, 1.0, *([40.0] * 8)]
    assert scaled == pytest.approx(np.array(figures) / bounds)
    space = space_of(task(normalize=False), worlds)
    assert space.high.tolist() == pytest.approx(bounds)
    assert space_of(task(), worlds).low.tolist() == [-1.0] * 15


def test_parts_of_an_observation_have_their_shapes() -> None:
    worlds = worlds_of({})
    options = task(
        observation="Dict", parts=("Others", "OccupancyGrid", "Lidar", "Kinematics"), num_others=2, num_rays=4,
        grid_size=20.0, grid_step=4.0, lights=True, normalize=False,
    )  # fmt: skip
    seen = observe(worlds, options)
    shapes = {"Others": (2, 9), "OccupancyGrid": (4, 5, 5), "Lidar": (4, 2), "Kinematics": (17 + 18,)}
    assert {name: part.shape[2:] for name, part in seen.items()} == shapes
    assert {name: part.shape for name, part in space_of(options, worlds).items()} == shapes
    assert seen["Kinematics"][0, 0, 15:17].tolist() == [100.0, 0.0]  # no light within sight
    assert seen["Lidar"][0, 0, :, 0].tolist() == pytest.approx([50.0, 1.75, 50.0, 1.75])


def test_bounds_of_others_and_of_cells_are_in_metres_and_metres_a_second() -> None:
    options = task(num_others=1, grid_size=4.0, grid_step=4.0, num_rays=1)
    assert bounds_of("Others", options).tolist() == [[1, 100, 100, 40, 40, 1, 1, 20, 5]]
    assert bounds_of("OccupancyGrid", options).ravel().tolist() == [1, 40, 40, 1]
    assert bounds_of("Lidar", options).tolist() == [[50, 40]]


def test_own_observation_has_figures_of_all_egos() -> None:
    worlds = worlds_of({"speed": 2.0}, {})
    options = task(observation=lambda worlds: worlds.egos(("speed",))["speed"][..., None])
    assert observe(worlds, options).tolist() == [[[2.0]], [[0.0]]]
    assert space_of(options, worlds).shape == (1,)
    with pytest.raises(ValueError, match=r"observation: expected shape \(2, 1\) and more"):
        observe(worlds, task(observation=lambda _worlds: [[1.0]]))


# Pictures


def test_top_view_has_the_ego_in_the_middle_with_north_up() -> None:
    worlds = worlds_of({"x": 100.0 - CENTRE, "y": 0.0})
    worlds.world(0).spawn(Kind.PEDESTRIAN, Body.box(2.0, 2.0, 1.7), name="Man", x=110.0, y=5.0)
    image = draw(worlds, 0, np.array([[90.0, -8.0, 0.0], [np.nan] * 3]))
    assert image.shape == (400, 600, 3)
    at = 300 - round(6 * -CENTRE), 200

    def colour(east: float, north: float) -> tuple[int, ...]:
        """At a place relative to the middle of the ego [m]."""
        return tuple(image[at[1] - round(6 * north), at[0] + round(6 * east)].tolist())

    green, red, grey, ground = (20, 120, 60), (180, 60, 40), (200, 202, 205), (235, 238, 230)
    assert colour(0.0, 0.0) == colour(2.0, 0.7) == colour(-2.0, -0.7) == green
    assert colour(10.0, 5.0) == colour(10.8, 5.8) == red
    assert colour(6.0, 0.0) == colour(-8.0, 1.0) == grey
    assert colour(0.0, 4.0) == colour(0.0, -4.0) == colour(10.0, 7.0) == colour(-10.0, -8.0) == ground
    assert colour(-10.0 - 2.5, -8.0) == colour(-10.0, -8.0 + 1.25) == green  # around the bay
    assert not np.array_equal(draw(worlds, 0), image)


# Starts


def test_episode_begins_on_its_lane_with_room_around_it() -> None:
    worlds = Worlds("loop")
    roads = worlds.world(0).roads
    name, length = roads.ids[3], float(roads.length[3])
    places, yaws = roads.at(np.array([3]), np.array([length - 20.0]))
    near, far = (
        worlds.spawn(0, "2015_Kia_K5", x=float(places[0, 0]) + aside, y=float(places[0, 1]))
        for aside in (2.0, CLEAR + 9)
    )
    starts = Starts(worlds, task(start_lane=name, start_s=-20.0, start_speed=3.0))
    starts.begin(0, np.random.default_rng(0))
    egos = {figure: float(values[0, 0]) for figure, values in worlds.egos(("x", "y", "yaw", "speed")).items()}
    assert (egos["x"], egos["y"], egos["speed"]) == pytest.approx((*places[0, :2], 3.0))
    assert math.cos(egos["yaw"] - float(yaws[0])) == pytest.approx(1.0)
    assert (near in worlds.world(0), far in worlds.world(0)) == (False, True)
    with pytest.raises(ValueError, match="start_lane: expected a lane of the map of 'loop'"):
        Starts(worlds, task(start_lane="nowhere*"))
    crowded = Worlds("loop", egos=2)
    with pytest.raises(ValueError, match="start_lane: no place"):
        Starts(crowded, task(start_lane=name, start_s=5.0)).begin(0, np.random.default_rng(0))


def test_goal_is_a_free_bay_entered_nose_first() -> None:
    worlds = Worlds("parking")
    roads, world = worlds.world(0).roads, worlds.world(0)
    options = task(goal="bay", goal_lane="B*")
    names = [name for name in roads.ids if name.startswith("B")]
    rows = [roads.ids.index(name) for name in names]
    places, yaws = roads.at(np.array(rows), 0.5 * roads.length[rows])
    found = set()
    starts = Starts(worlds, options)
    for seed in range(12):
        starts.begin(0, np.random.default_rng(seed))
        x, y, yaw = starts.goals[0, 0]
        k = int(np.hypot(places[:, 0] - x, places[:, 1] - y).argmin())
        assert (x, y) == pytest.approx(tuple(places[k, :2]))
        assert math.cos(yaw - yaws[k]) == pytest.approx(-1.0)
        alive = world.alive.nonzero()[0]
        middles = world.x + world.centre * np.cos(world.yaw), world.y + world.centre * np.sin(world.yaw)
        assert np.hypot(middles[0][alive] - x, middles[1][alive] - y).min() > 2.5
        found.add(k)
    assert len(found) > 1
