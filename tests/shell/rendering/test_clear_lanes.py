"""Nothing lies on lanes and on paint: rays from above meet the road first, at its height."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from rosbridge_sim.maps.mgeo import NO_PROJECTION
from rosbridge_sim.maps.road_map import Border, Crosswalk, RoadMap
from rosbridge_sim.scenery.lines import across, take_at
from rosbridge_sim.scenery.mesh import PAINTED, Label, Mesh
from rosbridge_sim.scenery.static.static_mesh import static_mesh
from rosbridge_sim.world.geometry.planar import FloatArray, arc_lengths
from rosbridge_sim.world.roads.roads import Roads
from tests.scenery.static.narrow_gaps import APART, GAPS, LANE, narrow_gaps
from tests.shell.rendering.graphics import built_in, nothing, open_caster
from tests.world.road_factory import MAPS, line, make

ACROSS = (-0.98, -0.7, -0.35, 0.0, 0.35, 0.7, 0.98)
"""Places across a lane, as shares of the distance of its edges."""

ABOVE = 2.0
"""Rays begin so far above a place [m]: below lamps and crowns."""

CENTIMETRE = 0.01


def look_down(mesh: Mesh, places: FloatArray) -> tuple[NDArray[np.uint8], FloatArray]:
    """What lies at places, and how far it is above them."""
    origins = (places - mesh.origin + (0.0, 0.0, ABOVE)).astype(np.float32)
    down = np.tile(np.array([0, 0, -1], np.float32), (len(places), 1))
    hits = open_caster().cast(mesh, nothing(), origins, down, 2.0 * ABOVE)
    return hits.labels, ABOVE - hits.ranges.astype(np.float64)


def places_on_lanes(roads: Roads) -> FloatArray:
    """Places all over the lanes, half a metre apart along them."""
    found = []
    for lane in range(len(roads)):
        rows = slice(int(roads.first[lane]), int(roads.first[lane + 1]))
        points = roads.points[rows]
        whole = np.column_stack([points, across(points), roads.border[rows], roads.bank[rows]])
        values = take_at(whole, np.arange(0.25, float(roads.length[lane]), 0.5))
        for share in ACROSS:
            edge = 0 if share > 0.0 else 1
            aside = share * values[:, 5 + edge]
            flat = values[:, :2] + aside[:, None] * values[:, 3:5]
            found.append(np.column_stack([flat, values[:, 2] + aside * values[:, 7 + edge]]))
    return np.concatenate(found)


def places_along(border: Border) -> FloatArray:
    """Places on a line, half a metre apart."""
    return take_at(border.line, np.arange(0.25, arc_lengths(border.line[:, :2])[-1], 0.5))


@cache
def gaps_mesh() -> Mesh:
    return static_mesh(narrow_gaps(), "gaps", 0)


@pytest.mark.slow
@pytest.mark.parametrize("name", [*sorted(folder.name for folder in MAPS.iterdir() if folder.is_dir()), "gaps"])
def test_nothing_lies_on_the_lanes(name: str) -> None:
    road_map, mesh = built_in(name) if name != "gaps" else (narrow_gaps(), gaps_mesh())
    labels, heights = look_down(mesh, places_on_lanes(road_map.roads))
    assert len(labels) > 1_000
    covered = ~np.isin(labels, [Label.ASPHALT, *PAINTED])
    assert not covered.any(), sorted({Label(label).name for label in labels[covered].tolist()})
    assert heights.max() < CENTIMETRE


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_nothing_lies_on_lanes_that_cross_each_other_anywhere(seed: int) -> None:
    rng = np.random.default_rng(seed)
    lanes, borders = {}, []
    for k in range(12):
        yaw = rng.uniform(0.0, 2.0 * np.pi) + np.cumsum(rng.normal(0.0, 0.06, 40)) * (k % 2)
        flat = 2.0 * np.cumsum(np.column_stack([np.cos(yaw), np.sin(yaw)]), axis=0) + rng.uniform(-40.0, 40.0, 2)
        lanes[f"lane{k}"] = np.column_stack([flat, np.zeros(40)]), ""
        ends = np.column_stack([rng.uniform(-40.0, 40.0, (2, 2)), np.zeros(2)])
        borders.append(Border(f"line{k}", ends, 501, ("Solid",), ("Yellow",)))
    # Without a crosswalk it would have no pavements.
    crosswalk = Crosswalk("", (line((0, 0), (4, 0), (4, 12), (0, 12)),))
    roads = make(**lanes)
    road_map = RoadMap("", NO_PROJECTION, (0.0, 0.0, 0.0), roads, crosswalks=(crosswalk,), borders=tuple(borders))
    mesh = static_mesh(road_map, "", 0, is_dressed=False)
    labels, heights = look_down(mesh, places_on_lanes(roads))
    assert np.isin(labels, [Label.ASPHALT, *PAINTED]).all()
    assert heights.max() < CENTIMETRE
    places = np.concatenate([places_along(border) for border in borders])
    assert np.isin(look_down(mesh, places)[0], PAINTED).all()


@pytest.mark.slow
def test_lines_between_near_carriageways_are_seen_on_asphalt() -> None:
    for border in narrow_gaps().borders:
        labels, heights = look_down(gaps_mesh(), places_along(border))
        assert np.isin(labels, PAINTED).all()
        assert np.abs(heights).max() < CENTIMETRE


@pytest.mark.slow
def test_crosswalks_are_seen_from_end_to_end() -> None:
    for k, gap in enumerate(GAPS):
        y = np.arange(k * APART - 2.4, k * APART + LANE + gap + 2.4, 0.05)
        labels, heights = look_down(gaps_mesh(), np.column_stack([np.full(len(y), 16.0), y, np.zeros(len(y))]))
        assert set(labels.tolist()) <= {Label.ASPHALT, *PAINTED}
        assert 0.3 < (labels == Label.CROSSWALK).mean() < 0.7
        assert np.abs(heights).max() < CENTIMETRE


@pytest.mark.slow
@pytest.mark.parametrize(("k", "is_median"), [(k, gap - 2.0 > 2.6) for k, gap in enumerate(GAPS)])
def test_gaps_wider_than_a_pavement_have_a_kerb(k: int, is_median: bool) -> None:  # noqa: FBT001 - a parameter
    """Shoulders and the asphalt of the far line take about 2 m of a gap."""
    low, high = k * APART + 0.5 * LANE, k * APART + 0.5 * LANE + GAPS[k]
    y = np.arange(low, high, 0.05)
    labels, heights = look_down(gaps_mesh(), np.column_stack([np.full(len(y), 8.0), y, np.zeros(len(y))]))
    assert (Label.KERB in labels) == (Label.PAVEMENT in labels) == is_median
    assert Label.GROUND not in labels
    assert heights.max() == pytest.approx(0.09 if is_median else 0.0, abs=1e-3)
