"""What cars on lanes tell in bends is smooth: on all built-in maps, and on copies of them with fewer points."""

from __future__ import annotations

import json
import math
from functools import cache
from itertools import pairwise
from typing import Final, NamedTuple

import numpy as np
import pytest

from rosbridge_sim.maps.map_formats import MAP_FILES, read_map
from rosbridge_sim.maps.road_map import RoadMap
from rosbridge_sim.world.drivers.lane_position import LaneStart, keep_lanes
from rosbridge_sim.world.followers.motion import motion
from rosbridge_sim.world.geometry.planar import BoolArray, ComplexArray, FloatArray, IntArray
from rosbridge_sim.world.roads.lane_conflicts import LaneConflicts
from rosbridge_sim.world.roads.roads import Roads
from rosbridge_sim.world.state.world import DT, Kind, World
from rosbridge_sim.world.step import step
from tests.world.road_factory import CAR, MAPS, built_in

pytestmark = pytest.mark.usefixtures("loops")

NAMES: Final = ("track", "town", "loop", "hills", "motorway", "roundabout", "parking")
THINNED: Final = ("track", "loop", "hills", "motorway", "roundabout")
FRAMES: Final = 110


class Told(NamedTuple):
    """Lanes and places on them, positions and velocities in the map, accelerations across; (frames, cars) each."""

    lane: IntArray
    s: FloatArray
    place: ComplexArray
    velocity: ComplexArray
    left: FloatArray

    def each_third(self) -> Told:
        """The same with each third frame."""
        return Told(self.lane[::3], self.s[::3], self.place[::3], self.velocity[::3], self.left[::3])


@pytest.mark.parametrize("wander", [0.0, 0.15])
@pytest.mark.parametrize("name", NAMES)
def test_told_velocity_is_that_of_the_told_positions(name: str, wander: float) -> None:
    told = drive(name, wander=wander)
    derivative = np.diff(told.place, axis=0) / DT
    assert np.abs(0.5 * (told.velocity[1:] + told.velocity[:-1]) - derivative).max() < 0.05


@pytest.mark.parametrize("name", NAMES)
def test_acceleration_in_a_steady_bend_is_that_of_the_circle(name: str) -> None:
    built = built_in(name)
    told = drive(name)
    is_steady, curvature = steady_bends(built.roads, told, 5.0, 5.0)
    assert is_steady.sum() > 20
    wanted = np.abs(told.velocity) ** 2 * curvature
    assert np.abs(told.left - wanted)[is_steady].max() < 0.5


@pytest.mark.parametrize("spacing", [0.0, 20.0])
@pytest.mark.parametrize("name", THINNED)
def test_acceleration_on_a_map_with_few_points_is_that_of_the_circle(name: str, spacing: float) -> None:
    built, coarse = built_in(name), thinned(name, spacing)
    assert len(coarse.roads.points) < 0.3 * len(built.roads.points)
    told = drive(name, spacing).each_third()
    is_steady, curvature = steady_bends(built.roads, on_lanes(built.roads, told), 6.0, 30.0)
    assert is_steady.sum() > 20
    wanted = np.abs(told.velocity) ** 2 * curvature
    assert np.abs(told.left - wanted)[is_steady].max() < 1.0


@pytest.mark.parametrize("wander", [0.0, 0.15])
@pytest.mark.parametrize("name", THINNED)
def test_told_velocity_on_a_map_with_few_points_is_that_of_the_told_positions(name: str, wander: float) -> None:
    assert thinned(name, 0.0).roads.has_long_legs
    told = drive(name, 0.0, wander)
    derivative = np.diff(told.place, axis=0) / DT
    assert np.abs(0.5 * (told.velocity[1:] + told.velocity[:-1]) - derivative).max() < 0.05


@cache  # two tests look at the same drive
def drive(name: str, spacing: float | None = None, wander: float = 0.0) -> Told:
    """Cars each 40 m, at 80 % of the safe speed at first, on a map or on its `thinned` form."""
    built = built_in(name) if spacing is None else thinned(name, spacing)
    world, roads = World(1), built.roads
    world.lay_roads(roads, built.plan)
    safe = roads.derived(LaneConflicts).safe_speed
    ends = enumerate(roads.length.tolist())
    places = [(lane, s) for lane, end in ends for s in np.arange(2.0, end - 2.0, 40.0).tolist()]
    places = places[:: math.ceil(len(places) / 150)]
    starts = []
    for lane, s in places:
        at = slice(roads.first[lane], roads.first[lane + 1])
        speed = 0.8 * float(np.interp(s, roads.s[at], safe[at]))
        row = world.row(world.spawn(Kind.VEHICLE, CAR, name="npc", x=0.0, y=0.0, speed=speed))
        starts.append(LaneStart(row, lane, float(s), wander=wander, changes_lanes=False))
    keep_lanes(world, starts)
    rows = np.flatnonzero(world.has_lane)
    told = []
    for _ in range(FRAMES):
        step(world)
        figures = motion(world, rows)
        to_map = np.exp(1j * world.yaw[rows])
        velocity, accel = (figures[0] + 1j * figures[1]) * to_map, (figures[3] + 1j * figures[4]) * to_map
        left = (accel * velocity.conj()).imag / np.fmax(np.abs(velocity), 1e-9)
        told.append((world.lane[rows], world.arc[rows], world.x[rows] + 1j * world.y[rows], velocity, left))
    return Told(*(np.array(column) for column in zip(*told, strict=True)))


@cache
def thinned(name: str, spacing: float) -> RoadMap:
    """The map with points so far apart, but four in each bend at least, and one for each 30 degrees."""
    files = {file: (MAPS / name / file).read_bytes() for file in MAP_FILES if (MAPS / name / file).exists()}
    links = json.loads(files["link_set.json"])
    for link in links:
        kept = points_kept(np.array(link["points"])[:, :2], spacing)
        link["points"] = [link["points"][i] for i in kept]
    files["link_set.json"] = json.dumps(links).encode()
    return read_map(files, name)


def points_kept(points: FloatArray, spacing: float) -> list[int]:
    """Which points of a link are kept: its ends, those of its bends, and some within these."""
    s = np.append(0.0, np.hypot(*np.diff(points, axis=0).T).cumsum())
    if len(points) < 9:
        return list(range(len(points)))
    places = np.interp(s[:, None] + np.array([-8.0, 0.0, 8.0]), s, np.arange(len(s)))
    a, b, c = (points[places[:, i].round().astype(int)] for i in range(3))
    ab, bc, ac = b - a, c - b, c - a
    size = np.hypot(*ab.T) * np.hypot(*bc.T) * np.hypot(*ac.T)
    curvature = 2.0 * (ab[:, 0] * bc[:, 1] - ab[:, 1] * bc[:, 0]) / np.maximum(size, 1e-9)
    curvature[0], curvature[-1] = curvature[1], curvature[-2]
    # Bends of one curvature; what lies between them is another piece.
    sort = np.round(np.log(np.maximum(np.abs(curvature), 1e-4)) / 0.4) * np.sign(curvature)
    cuts = [0, *(np.flatnonzero(np.diff(sort)) + 1).tolist(), len(points) - 1]
    kept = set(cuts)
    for i, j in pairwise(cuts):
        turn = abs(float(np.median(curvature[i : j + 1]))) * (s[j] - s[i])
        num = max(4, math.ceil(turn / math.radians(30.0)) + 1, math.ceil((s[j] - s[i]) / spacing) if spacing else 0)
        kept.update(s.searchsorted(np.linspace(s[i], s[j], num)).tolist())
    return sorted(kept)


def on_lanes(roads: Roads, told: Told) -> Told:
    """The same with the places of the cars on the same lanes of another map."""
    place = told.place.ravel()
    near = roads.nearest(place.real, place.imag)
    is_same = near.lane == told.lane.ravel()
    s = np.where(is_same, near.s, -1.0)
    return told._replace(s=s.reshape(told.s.shape))


def steady_bends(roads: Roads, told: Told, reach: float, least_radius: float) -> tuple[BoolArray, FloatArray]:
    """Whether a bend is the same so far on both sides, and its curvature: of circles through points of the lanes."""
    lane, s = told.lane.ravel(), told.s.ravel()
    part = min(reach / 2.0, 4.0)

    def curvature(middle: FloatArray) -> FloatArray:
        a, b, c = (roads.at(lane, middle + away)[0][:, :2] for away in (-part, 0.0, part))
        ab, bc, ac = b - a, c - b, c - a
        cross = ab[:, 0] * bc[:, 1] - ab[:, 1] * bc[:, 0]
        return np.asarray(2.0 * cross / np.maximum(np.hypot(*ab.T) * np.hypot(*bc.T) * np.hypot(*ac.T), 1e-9))

    found = np.array([curvature(s + away) for away in np.linspace(part - reach, reach - part, 5)])
    here = found[2]
    is_steady = (s > reach) & (s < roads.length[lane] - reach) & (np.abs(here) > 1.0 / 1000.0)
    is_steady &= (np.ptp(found, axis=0) < 0.05 * np.abs(here)) & (np.abs(here) < 1.0 / (0.95 * least_radius))
    return is_steady.reshape(told.lane.shape), here.reshape(told.lane.shape)
