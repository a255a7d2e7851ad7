"""Rays from egos: against a walk along each ray in small steps, and for egos of many worlds at once."""

from __future__ import annotations

import numpy as np
import pytest

from rosbridge_sim import Worlds
from rosbridge_sim.shell.files.library import DiskLibrary
from rosbridge_sim.world.many_worlds.batch import OneOfMany
from rosbridge_sim.world.roads.roads import Roads
from rosbridge_sim.world.state.world import Body, Kind
from rosbridge_sim.world.vehicle.ground import are_on_road
from rosbridge_sim.worlds.drivable_worlds import DrivableWorlds
from tests.world.road_factory import ego, line, make, road

LIBRARY = DiskLibrary()
"""The borders of a map are found once."""

STEP = 0.1
"""Of the walk along a ray [m]."""


def walk(worlds: Worlds, num: int, reach: float) -> np.ndarray:
    """The distances of the rays of world 0, by small steps."""
    world = worlds.world(0)
    row = 0
    away = np.arange(0.0, reach, STEP)
    yaw = float(world.yaw[row])
    x0, y0 = world.x[row] + world.centre[row] * np.cos(yaw), world.y[row] + world.centre[row] * np.sin(yaw)
    angle = yaw + 2.0 * np.pi * np.arange(num)[:, None] / num
    x, y = x0 + away * np.cos(angle), y0 + away * np.sin(angle)
    is_hit = ~are_on_road(world.roads, x.ravel(), y.ravel(), np.full(x.size, world.z[row])).reshape(x.shape)
    for other in np.flatnonzero(world.alive):
        if other != row:
            cos, sin = np.cos(world.yaw[other]), np.sin(world.yaw[other])
            east, north = x - world.x[other], y - world.y[other]
            along, left = east * cos + north * sin - world.centre[other], north * cos - east * sin
            is_hit |= (np.abs(along) <= world.half_length[other]) & (np.abs(left) <= world.half_width[other])
    return np.where(is_hit.any(axis=1), away[is_hit.argmax(axis=1)], reach)


@pytest.mark.slow
@pytest.mark.parametrize("scenario", ["motorway", "parking", "hills"])
def test_rays_end_where_a_walk_along_them_meets_something(scenario: str) -> None:
    worlds = Worlds(scenario, library=LIBRARY, traffic=15 if scenario == "motorway" else 0)
    worlds.step({"steering": 0.0, "accel": 0.0}, 10)
    found = worlds.rays(24, 40.0)[0, 0, :, 0]
    # Across the ends of lanes places up to 2.5 m beyond count as on the road.
    assert found == pytest.approx(walk(worlds, 24, 40.0), abs=1.3 if scenario == "parking" else 0.3)
    assert (found < 40.0).sum() > 5


def test_ray_tells_how_fast_a_box_moves_away() -> None:
    worlds = Worlds("loop", library=LIBRARY)
    x, y, yaw = (float(worlds.egos()[name][0, 0]) for name in ("x", "y", "yaw"))
    worlds.place(0, x=x, y=y, yaw=yaw, speed=3.0)
    ahead, left = 15.0, 0.0
    where = (x + ahead * np.cos(yaw) - left * np.sin(yaw), y + ahead * np.sin(yaw) + left * np.cos(yaw))
    worlds.spawn(0, "2016_Hyundai_Ioniq", x=where[0], y=where[1], yaw=yaw, speed=5.0)
    forward, back = worlds.rays(2, 60.0)[0, 0]
    centre = float(worlds.egos()["centre"][0, 0])
    row = int(np.flatnonzero(np.abs(worlds.world(0).x - where[0]) < 1e-6)[0])
    nose = worlds.world(0).half_length[row] - worlds.world(0).centre[row]
    assert forward[0] == pytest.approx(ahead - nose - centre)
    assert forward[1] == pytest.approx(2.0)
    assert back.tolist() == [60.0, 0.0]


def test_border_moves_away_as_fast_as_the_ego_leaves_it() -> None:
    worlds = Worlds("loop", library=LIBRARY)
    x, y, yaw = (float(worlds.egos()[name][0, 0]) for name in ("x", "y", "yaw"))
    worlds.place(0, x=x, y=y, yaw=yaw + 0.5, speed=3.0)
    ahead = worlds.rays(1, 60.0)[0, 0, 0]
    assert ahead[0] < 60.0
    assert ahead[1] == pytest.approx(-3.0)


def test_rays_of_many_worlds_equal_those_of_each_alone() -> None:
    many = Worlds("hills", 3, library=LIBRARY, seed=2, traffic=8)
    many.step({"steering": 0.1, "accel": 1.0}, 5)
    for i in range(3):
        one = Worlds("hills", library=LIBRARY, seed=2 + i, traffic=8)
        one.step({"steering": 0.1, "accel": 1.0}, 5)
        assert one.rays(16, 50.0).tobytes() == many.rays(16, 50.0)[i : i + 1].tobytes()
        assert one.grids(40.0, 2.0).tobytes() == many.grids(40.0, 2.0)[i : i + 1].tobytes()


def test_wrong_rays_are_refused() -> None:
    worlds = Worlds("loop", library=LIBRARY)
    with pytest.raises(ValueError, match="num: expected a whole number from 1 on, got 0"):
        worlds.rays(0, 10.0)
    with pytest.raises(ValueError, match="reach: expected a positive number, got inf"):
        worlds.rays(4, float("inf"))


def straight(*egos: dict[str, float], roads: Roads | None = None) -> DrivableWorlds:
    """Worlds with one ego each, on a road of 1 km to the east if there is no other."""
    found = []
    for each in egos:
        world = OneOfMany()
        world.lay_roads(roads or road(1000.0))
        ego(world, **({"x": 100.0, "y": 0.0} | each))
        found.append(world)
    return DrivableWorlds(found)


CENTRE = float(Body().length / 2 - Body().rear_overhang)


@pytest.mark.parametrize("corners", [((0, 0), (1000, 0)), ((0, 0), (300, 0), (700, 0), (1000, 0))])
def test_rays_meet_both_edges_of_a_road_and_the_lines_across_its_ends(corners: tuple[tuple[float, float], ...]) -> None:
    roads = make(a=(line(*corners), ""))
    worlds = straight({"x": 10.0 - CENTRE}, {"x": 990.0 - CENTRE, "y": 0.5}, {"x": 500.0}, roads=roads)
    first, second, middle = (worlds.rays(8, 70.0)[i, 0, :, 0] for i in range(3))
    slanted = 1.75 * np.sqrt(2.0)
    assert first.tolist() == pytest.approx([70.0, slanted, 1.75, slanted, 10.0, slanted, 1.75, slanted])
    left, right = 1.25 * np.sqrt(2.0), 2.25 * np.sqrt(2.0)
    assert second.tolist() == pytest.approx([10.0, left, 1.25, left, 70.0, right, 2.25, right])
    assert middle.tolist() == pytest.approx([70.0, slanted, 1.75, slanted, 70.0, slanted, 1.75, slanted])
    assert straight({"x": 100.0}).rays(1, 900.0 - CENTRE + 0.1)[0, 0, 0, 0] == pytest.approx(900.0 - CENTRE)


def test_edges_between_lanes_and_on_other_levels_are_no_borders() -> None:
    beside = make(a=(line((0, 0), (1000, 0)), ""), b=(line((0, 3.5), (1000, 3.5)), ""))
    assert straight({}, roads=beside).rays(4, 70.0)[0, 0, :, 0].tolist() == pytest.approx([70.0, 5.25, 70.0, 1.75])
    crossing = {
        z: make(a=(line((0, 0), (1000, 0)), ""), b=(line((120, -200), (120, 200), z=z), "")) for z in (0.0, 9.0)
    }
    below = straight({"x": 118.0, "y": 1.0}, roads=crossing[9.0]).rays(4, 70.0)[0, 0, :, 0]
    level = straight({"x": 118.0, "y": 1.0}, roads=crossing[0.0]).rays(4, 70.0)[0, 0, :, 0]
    assert below.tolist() == pytest.approx([70.0, 0.75, 70.0, 2.75])
    assert level.tolist() == pytest.approx([70.0, 70.0, 70.0, 70.0])


def test_borders_are_found_again_with_another_reach() -> None:
    worlds = straight({"x": 10.0 - CENTRE})
    for reach in (5.0, 64.0, 65.0, 200.0, 5.0):
        back = float(worlds.rays(2, reach)[0, 0, 1, 0])
        assert back == pytest.approx(min(reach, 10.0))


@pytest.mark.parametrize(
    ("ahead", "left", "met"),
    [(20.0, 0.0, True), (20.0, 0.9, True), (20.0, 1.0, False), (20.0, -0.9, True), (20.0, -1.0, False)],
)
def test_ray_meets_a_box_within_its_width_alone(ahead: float, left: float, met: bool) -> None:  # noqa: FBT001 - of the table
    world = OneOfMany()
    world.lay_roads(make(a=(line((0, 0), (1000, 0)), ""), b=(line((0, 3.5), (1000, 3.5)), "")))
    ego(world, x=100.0 - CENTRE, y=0.0)
    world.spawn(Kind.OBSTACLE, Body.box(2.0, 1.9, 1.5), name="box", x=100.0 + ahead, y=left, speed=0.0)
    found = DrivableWorlds([world]).rays(1, 60.0)[0, 0, 0]
    assert found.tolist() == pytest.approx([ahead - 1.0 if met else 60.0, 0.0])
