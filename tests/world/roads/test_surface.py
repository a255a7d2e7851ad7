"""The surface of the ground: beside the lanes' lines, beyond their edges and ends, and where roads lie above others."""

from __future__ import annotations

import numpy as np
import pytest

from rosbridge_sim.world.geometry.planar import FloatArray
from rosbridge_sim.world.roads.roads import Roads
from rosbridge_sim.world.roads.surface import BEYOND, Surface
from tests.world.road_factory import built_in, line, make


def sloping(*, bank: FloatArray | None = None) -> Roads:
    """A road to the east, 100 m, that rises by 10 %."""
    points = line((0.0, 0.0), (50.0, 0.0), (100.0, 0.0))
    points[:, 2] = 0.1 * points[:, 0]
    banks = None if bank is None else {0: np.tile(bank, (3, 1))}
    return Roads(["a"], [points], [[]], [3.5], [15.0], banks=banks)


def height(roads: Roads, x: float, y: float, z: float | None = None) -> float:
    found = Surface(roads).find(np.array([x]), np.array([y]), None if z is None else np.array([z]))
    return found.height.item()


@pytest.mark.parametrize(
    ("x", "y", "expected"),
    [
        (30.0, 0.0, 3.0),
        (30.0, 1.5, 3.0),
        (30.0, -40.0, 3.0),
        (-10.0, 0.0, -1.0),
        (110.0, 2.0, 11.0),
        (100.0 + 3.0 * BEYOND, 0.0, 10.0 + 0.1 * BEYOND),
    ],
)
def test_plane_of_the_nearest_lane_goes_on_beside_and_beyond_it(x: float, y: float, expected: float) -> None:
    assert height(sloping(), x, y) == pytest.approx(expected)


def test_bank_raises_each_half_of_a_lane() -> None:
    roads = sloping(bank=np.array([0.05, -0.02]))
    assert height(roads, 30.0, 1.0) == pytest.approx(3.05)
    assert height(roads, 30.0, -1.0) == pytest.approx(3.02)
    assert height(roads, 30.0, 500.0) == pytest.approx(3.0 + 0.05 * BEYOND)
    assert roads.digest != sloping().digest


def test_slope_changes_evenly_near_a_point_of_the_line() -> None:
    points = line((0.0, 0.0), (50.0, 0.0), (100.0, 0.0))
    points[2, 2] = 5.0
    x = np.arange(40.0, 60.0, 0.25)
    found = Surface(make(a=(points, ""))).find(x, np.zeros(len(x)))
    assert np.diff(found.east).max() < 0.02
    assert found.east[[0, -1]].tolist() == pytest.approx([0.0, 0.1])
    assert found.height.tolist() == pytest.approx((0.1 * np.maximum(x - 50.0, 0.0)).tolist())


@pytest.mark.parametrize("z", [0.0, 6.5])
def test_all_places_of_the_hills_are_at_the_height_of_their_lane(z: float) -> None:
    roads = built_in("hills").roads
    near = np.abs(roads.points[:, :2]).max(axis=1) < 60.0  # the roads that cross
    x, y, height = roads.points[near & (np.abs(roads.points[:, 2] - z) < 2.0)].T
    found = Surface(roads).find(x, y, height + 0.3)
    assert np.abs(found.height - height).max() < 0.02
    assert len(x) > 20


def test_places_together_have_the_bits_of_each_alone() -> None:
    roads = built_in("hills").roads
    rng = np.random.default_rng(4)
    (x, y), z = rng.uniform(-220.0, 220.0, (2, 100)), rng.uniform(-2.0, 18.0, 100)
    surface = Surface(roads)
    together = surface.find(x, y, z)
    for i in range(100):
        alone = surface.find(x[i : i + 1], y[i : i + 1], z[i : i + 1])
        got = alone.height.item(), alone.east.item(), alone.north.item()
        assert got == (together.height[i], together.east[i], together.north[i])


def test_no_places_have_no_ground() -> None:
    assert len(Surface(sloping()).find(np.zeros(0), np.zeros(0)).height) == 0


@pytest.mark.parametrize(("z", "lane"), [(0.0, "below"), (6.0, "above"), (-50.0, "below"), (90.0, "above")])
def test_nearest_lane_is_that_of_the_given_height(z: float, lane: str) -> None:
    roads = make(
        below=(line((-300.0, 0.4), (300.0, 0.4)), ""),
        above=(line((-300.0, 0.0), (0.0, 0.0), (300.0, 0.0), z=6.0), ""),
    )
    place = roads.nearest(10.0, 0.3, 0.0, z)
    assert roads.ids[place.lane[0]] == lane
    many = roads.nearest([10.0, 20.0], [0.3, 0.3], [0.0, 0.0], [z, z])
    assert many.lane.tolist() == [place.lane[0]] * 2


def test_place_beside_a_slope_is_at_the_height_of_the_line_next_to_it_whatever_height_is_given() -> None:
    points = line(*[(float(x), 0.0) for x in range(0, 101, 5)])
    points[:, 2] = 0.1 * points[:, 0]
    roads = make(a=(points, ""))
    for z in (None, -100.0, 0.0, 5.0, 60.0):
        assert height(roads, 50.3, 6.0, z) == pytest.approx(5.03)
