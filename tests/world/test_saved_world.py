"""Bytes from outside: figures of lane followers that a step would read as an index are refused."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rosbridge_sim.world.roads.lane_conflicts import LaneConflicts
from rosbridge_sim.world.saved_world import from_plain, to_plain
from rosbridge_sim.world.state.commands import command
from rosbridge_sim.world.state.entity_arrays import BOOLS, FLOATS, INTS
from rosbridge_sim.world.state.placement import show_ghosts, teleport
from rosbridge_sim.world.state.world import Kind, Mode, World
from rosbridge_sim.world.step import step
from tests.world.road_factory import CAR, car, crossing, keep_lane, road


def test_point_of_a_lane_follower_is_one_of_its_lane() -> None:
    """Motion goes on to the points after it, and those of another lane may lead beyond the last one of the map."""
    world = World(0)
    world.lay_roads(crossing())
    roads = world.roads
    car(world, "we", 1.0, speed=3.0)
    data, lane = to_plain(world.snapshot()), roads.row("we")
    legs = roads.derived(LaneConflicts).legs
    is_refused = []
    for point in range(len(roads.points)):
        data["ints"][INTS.index("point"), 0] = point
        data["floats"][FLOATS.index("leg_start") : FLOATS.index("leg_dz") + 1, 0] = legs[point]
        try:
            from_plain(data, roads, world.signals.plan)
        except ValueError as error:
            assert "ints.point: expected" in str(error)  # noqa: PT017 - one of many
            is_refused.append(point)
    assert is_refused == [i for i in range(len(roads.points)) if not roads.first[lane] <= i <= roads.last_leg[lane]]


@pytest.mark.parametrize(
    ("column", "figure"),
    [("leg_end", -1.0), ("leg_start", 5.0), ("leg_dx", 0.5), ("leg_z", 1.0), ("leg_dz", -1000.0), ("leg_dz", 5e-324)],
)
def test_leg_of_a_lane_follower_is_that_at_its_point(column: str, figure: float) -> None:
    """Else arrays and loops could differ: on a level map they keep heights in different ways."""
    world = World(0)
    world.lay_roads(road())
    car(world, world.roads.ids[0], 1.0, speed=3.0)
    data = to_plain(world.snapshot())
    data["floats"][FLOATS.index(column), 0] = figure
    with pytest.raises(ValueError, match=r"floats\.leg: expected the legs at the points"):
        from_plain(data, world.roads, world.signals.plan)


BOX, DRIVER, EGO = range(3)
"""Rows of `some_world`."""


def some_world() -> World:
    """A box, a driver on a lane and an ego."""
    world = World(0)
    world.lay_roads(road())
    world.spawn(Kind.OBSTACLE, CAR, name="box", x=0.0, y=30.0)
    car(world, world.roads.ids[0], 1.0, speed=3.0)
    world.spawn(Kind.EGO, CAR, name="ego", x=0.0, y=60.0)
    return world


@pytest.mark.parametrize(
    ("column", "row", "figure"),
    [
        *[("half_length", row, -2.0) for row in (BOX, DRIVER, EGO)],
        *[("half_width", BOX, 1e12), ("height", BOX, 0.0), ("centre", DRIVER, 1e6)],
        *[("drag", EGO, -1e4), ("grip", EGO, 1e-300), ("top_speed", EGO, 1e15), ("wheelbase", EGO, 1e-300)],
        ("desired_speed", DRIVER, -math.inf),
    ],
)
def test_columns_that_follow_from_others_are_theirs(column: str, row: int, figure: float) -> None:
    """Else a step might divide by zero, or drive an ego to no number."""
    world = some_world()
    data = to_plain(world.snapshot())
    from_plain(data, world.roads, world.signals.plan)
    data["floats"][FLOATS.index(column), row] = figure
    with pytest.raises(ValueError, match=rf"floats\.{column}"):
        from_plain(data, world.roads, world.signals.plan)


@pytest.mark.parametrize("mode", list(Mode))
@pytest.mark.parametrize(
    ("column", "figure"),
    [("drive", 1e9), ("holding", -1e9), ("throttle_max", -10.0), ("sense", 5.0), ("jerk_limit", 1e9), ("grade", -1e9)],
)
def test_control_of_an_ego_is_that_of_its_gear_mode_and_command(column: str, figure: float, mode: Mode) -> None:
    """A step adds them to accelerations, so that some frames later nobody could restore the state that it gives."""
    world = some_world()
    command(world, EGO, mode=mode, steer=0.0, speed=5.0, accel=1.0)
    step(world)
    data = to_plain(world.snapshot())
    from_plain(data, world.roads, world.signals.plan)
    data["floats"][FLOATS.index(column), EGO] = figure
    with pytest.raises(ValueError, match=rf"floats\.{column}: expected"):
        from_plain(data, world.roads, world.signals.plan)


@pytest.mark.parametrize(
    ("column", "figure", "told"),
    [("arc", -1e15, "x"), ("leg_start", 1e15, "x"), ("leg_x", 3e9, "x"), ("leg_dy", 1e14, "y"), ("leg_z", -1e15, "z")],
)
def test_leg_of_a_path_leads_along_places_on_the_map(column: str, figure: float, told: str) -> None:
    """Else a step would put the driver where no snapshot may have it, and that one could not be restored."""
    world = some_world()
    step(world)
    data = to_plain(world.snapshot())
    from_plain(data, world.roads, world.signals.plan)
    data["floats"][FLOATS.index(column), DRIVER] = figure
    with pytest.raises(ValueError, match=rf"floats\.{told}: expected a place on the map"):
        from_plain(data, world.roads, world.signals.plan)


def test_lane_follower_without_any_road_is_refused() -> None:
    world = World(0)
    world.spawn(Kind.VEHICLE, CAR, name="car", x=0.0, y=0.0)
    data = to_plain(world.snapshot())
    data["bools"][BOOLS.index("has_lane"), 0] = True
    with pytest.raises(ValueError, match=r"world\.ints\."):
        from_plain(data, world.roads, world.signals.plan)


@pytest.mark.parametrize("route", [[], [0]])
def test_lanes_ahead_of_a_driver_have_no_gap(route: list[int]) -> None:
    """Arrays and loops look over one in different ways."""
    world = some_world()
    keep_lane(world, DRIVER, 0, 1.0, route=route)
    data = to_plain(world.snapshot())
    from_plain(data, world.roads, world.signals.plan)
    for name, lane in (("ahead_1", -1), ("ahead_2", 0)):
        data["ints"][INTS.index(name), DRIVER] = lane
    with pytest.raises(ValueError, match=r"ints\.ahead: expected lanes without a gap"):
        from_plain(data, world.roads, world.signals.plan)


@pytest.mark.parametrize(
    ("column", "row", "figure"),
    [
        *[("speed", row, figure) for row in (BOX, DRIVER, EGO) for figure in (1e6, -2.1e5)],
        *[("lateral_speed", EGO, 1e6), ("climb", BOX, -1e6), ("start_speed", DRIVER, 1e6), ("speed_cmd", EGO, 1001.0)],
        *[("accel", DRIVER, 2e12), ("lateral_accel", EGO, -2e12), ("accel_cmd", EGO, 101.0), ("yaw_rate", EGO, 2e12)],
        *[("yaw_accel", EGO, 1e14), ("pitch_rate", EGO, 1e14), ("climb_accel", BOX, 1e14)],
        *[("steer", EGO, 1.6), ("rear_steer", EGO, -1.6), ("steer_cmd", EGO, 7.0), ("rear_steer_cmd", EGO, 7.0)],
        *[("drive_lag", EGO, 1.1), ("brake_lag", EGO, 2.0), ("throttle", EGO, 1.1), ("brake", EGO, -1.1)],
    ],
)
def test_figure_that_no_world_reaches_is_refused_by_its_name_and_that_of_its_entity(
    column: str, row: int, figure: float
) -> None:
    world = some_world()
    step(world)
    data = to_plain(world.snapshot())
    data["floats"][FLOATS.index(column), row] = figure
    whose = f"of entity {world.uid[row]} '{world.names[row]}', got "
    with pytest.raises(ValueError, match=rf"world\.floats\.{column}: expected a figure within \+-.* {whose}"):
        from_plain(data, world.roads, world.signals.plan)


def test_ghost_that_is_driven_on_has_wheels_and_pedals_of_its_car() -> None:
    world = some_world()
    shown = ("steer", "throttle", "brake")
    show_ghosts(world, np.array([EGO]), shown, np.array([[-1e8], [1e8], [-3.0]]))
    from_plain(to_plain(world.snapshot()), world.roads, world.signals.plan)
    teleport(world, EGO, x=0.0, y=60.0, z=0.0, yaw=0.0)
    assert [getattr(world, name)[EGO] for name in shown] == [-CAR.max_steer, 1.0, 0.0]
    from_plain(to_plain(world.snapshot()), world.roads, world.signals.plan)


def test_ego_that_was_placed_with_several_turns_of_roll_can_be_restored() -> None:
    """`/ego_setting` takes any angle."""
    world = some_world()
    teleport(world, EGO, x=0.0, y=60.0, z=0.0, yaw=0.0, pitch=-7.0, roll=1e6)
    for _ in range(3):
        data = to_plain(world.snapshot())
        from_plain(data, world.roads, world.signals.plan)
        step(world)
