"""Cells of segments: the nearest segment is that of a search without cells, to the bit."""

from __future__ import annotations

import numpy as np
import pytest

from rosbridge_sim.shell.files.library import DiskLibrary
from rosbridge_sim.world.geometry import segment_cells
from rosbridge_sim.world.geometry.planar import FloatArray, IntArray
from rosbridge_sim.world.geometry.segment_cells import SegmentCells
from rosbridge_sim.world.geometry.segment_search import BESIDE, SegmentSearch
from rosbridge_sim.world.roads.roads import Roads

LIBRARY = DiskLibrary()


def searches_of(roads: Roads) -> tuple[SegmentSearch, SegmentCells]:
    return SegmentSearch(roads.segments, len(roads)), SegmentCells(roads.segments, len(roads))


def places_near(roads: Roads, num: int, seed: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Places up to some ten metres beside the lanes, any headings, and heights about those of the lanes."""
    rng = np.random.default_rng(seed)
    segments = roads.segments
    which = rng.integers(len(segments.lane), size=num)
    aside = rng.normal(size=(num, 2)) * rng.choice([0.5, 4.0, 40.0], size=(num, 1))
    yaw = np.where(rng.random(num) < 0.5, segments.angle[which] + rng.normal(size=num) * 0.1, rng.uniform(-4, 4, num))
    height = segments.height[which] + rng.normal(size=num) * 2.0
    return segments.start[which] + aside, np.stack([np.cos(yaw), np.sin(yaw)], axis=1), height


@pytest.mark.parametrize("name", ["loop", "town", "hills", "motorway"])
def test_cells_find_what_a_search_without_them_finds(name: str) -> None:
    roads = LIBRARY.map(name).roads
    plain, cells = searches_of(roads)
    for seed in range(3):
        place, heading, height = places_near(roads, 200, seed % 2)
        for each in (None, height):
            assert np.array_equal(cells.nearest(place, heading, each), plain.nearest(place, heading, each))


@pytest.mark.parametrize("name", ["loop", "town", "hills", "motorway"])
@pytest.mark.parametrize("most", [0.0, segment_cells.AROUND, 2.0 * segment_cells.AROUND])
def test_cells_find_the_lanes_around_places_that_a_search_without_them_finds(name: str, most: float) -> None:
    roads = LIBRARY.map(name).roads
    plain, cells = searches_of(roads)
    for seed in range(3):
        place = places_near(roads, 250, seed % 2)[0]
        place[::5] = np.round(place[::5] / segment_cells.CELL) * segment_cells.CELL
        radius = np.random.default_rng(seed).uniform(0.0, most, len(place))
        radius[::7] = most
        found, expected = cells.within(place, radius), plain.within(place, radius)
        assert np.array_equal(found[0], expected[0])
        assert np.array_equal(found[1], expected[1])
        assert all(np.array_equal(*pair) for pair in zip(found[2], expected[2], strict=True))


@pytest.mark.parametrize("name", ["hills", "motorway"])
def test_places_of_a_drive_are_found_alike_and_with_few_looks(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    roads = LIBRARY.map(name).roads
    plain, cells = searches_of(roads)
    looks, look, used = [], SegmentCells._look_around, set()

    def count(own: SegmentCells, keys: IntArray) -> tuple[IntArray, IntArray]:
        looks.append(len(keys))
        return look(own, keys)

    monkeypatch.setattr(SegmentCells, "_look_around", count)
    for s in np.arange(0.0, 200.0, 1.0):
        (point,), (yaw,) = roads.at([0], [s])
        place, radius = point[None, :2] + [0.7, -1.3], np.array([segment_cells.AROUND])
        used.add(tuple((place[0] // segment_cells.CELL).tolist()))
        heading, height = np.array([[np.cos(yaw), np.sin(yaw)]]), point[2:]
        for found, expected in (
            (cells.place(place, heading, height), plain.place(place, heading, height)),
            (cells.within(place, radius)[2], plain.within(place, radius)[2]),
        ):
            assert all(np.array_equal(*pair) for pair in zip(found, expected, strict=True))
    assert len(used) > 40
    assert len(looks) < 0.5 * len(used)


def test_lanes_around_a_place_are_the_nearest_segment_of_each_lane() -> None:
    roads = LIBRARY.map("town").roads
    plain, _ = searches_of(roads)
    place, radius = places_near(roads, 60, 3)[0], np.full(60, 6.0)
    owner, segment, _ = plain.within(place, radius)
    segments, expected = roads.segments, []
    for i, point in enumerate(place):
        _, lateral, distance = segments.project(np.tile(point, (len(segments.lane), 1)), np.arange(len(segments.lane)))
        is_near = (distance <= 6.0) & (distance - np.abs(lateral) < BESIDE)
        for lane in np.unique(segments.lane[is_near]).tolist():
            of_lane = (is_near & (segments.lane == lane)).nonzero()[0]
            expected.append((i, int(of_lane[distance[of_lane].argmin()])))
    assert list(zip(owner.tolist(), segment.tolist(), strict=True)) == expected


def test_full_table_is_begun_anew(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(segment_cells, "MAX_CELLS", 50)
    roads = LIBRARY.map("loop").roads
    plain, cells = searches_of(roads)
    for seed in range(6):
        place, heading, _ = places_near(roads, 40, seed)
        assert np.array_equal(cells.nearest(place, heading), plain.nearest(place, heading))
        assert len(cells._table._keys) <= 90


def test_places_beyond_the_numbers_of_cells_are_searched_without_them() -> None:
    plain, cells = searches_of(LIBRARY.map("hills").roads)
    place = np.array([[1e9, 0.0], [0.0, 0.0]])
    heading, height = np.array([[1.0, 0.0], [0.0, 1.0]]), np.array([0.0, 1e6])
    assert np.array_equal(cells.nearest(place, heading, height), plain.nearest(place, heading, height))
    assert np.array_equal(
        cells.nearest(place[1:], heading[1:], height[1:]), plain.nearest(*(place[1:], heading[1:], height[1:]))
    )


def test_places_on_the_edges_of_cells_and_sectors_are_found() -> None:
    roads = LIBRARY.map("town").roads
    plain, cells = searches_of(roads)
    place = np.round(places_near(roads, 300, 7)[0] / segment_cells.CELL) * segment_cells.CELL
    yaw = np.arange(300) % segment_cells.SECTORS * (2.0 * np.pi / segment_cells.SECTORS) - np.pi
    heading = np.stack([np.cos(yaw), np.sin(yaw)], axis=1)
    assert np.array_equal(cells.nearest(place, heading), plain.nearest(place, heading))


@pytest.mark.parametrize("name", ["town", "hills"])
def test_places_one_by_one_are_those_of_a_search_for_all(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(segment_cells, "MAX_COLUMNS", 20)
    roads = LIBRARY.map(name).roads
    plain, cells = searches_of(roads)
    place, heading, height = places_near(roads, 60, 5)
    place[::4] = np.round(place[::4] / segment_cells.CELL) * segment_cells.CELL
    yaw = np.arange(20) % segment_cells.SECTORS * (2.0 * np.pi / segment_cells.SECTORS) - np.pi
    heading[::3] = np.stack([np.cos(yaw), np.sin(yaw)], axis=1)
    place[-1] = 1e9
    for each in (None, height):
        expected = plain.place(place, heading, each)
        for i in range(len(place)):
            found = cells.place(place[[i]], heading[[i]], None if each is None else each[[i]])
            assert all(np.array_equal(one, of_all[[i]]) for one, of_all in zip(found, expected, strict=True))
            assert len(cells._of_cell) <= 20
