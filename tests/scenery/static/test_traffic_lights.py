"""Traffic lights: housings, lenses in the order of their drivers, poles and arms; in exact places."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rosbridge_sim.scenery.mesh import Label, Lit, Mesh
from rosbridge_sim.scenery.mesh_builder import MeshBuilder
from rosbridge_sim.scenery.static.road_cover import RoadCover
from rosbridge_sim.scenery.static.terrain import BELOW, Terrain
from rosbridge_sim.scenery.static.traffic_lights import SignalLamps, add_lights
from rosbridge_sim.world.roads.signal_plan import Lamp, Light, SignalPlan
from tests.scenery.solid_figures import is_closed, parts_of, volume_of
from tests.scenery.static.small_scenes import corners
from tests.world.road_factory import line, make, road

ORIGIN = np.array([100.0, 0.0, 0.0])
RED, YELLOW, GREEN = Lamp.RED, Lamp.YELLOW, Lamp.GREEN


def drawn(*lights: Light) -> Mesh:
    roads = road(100.0)
    cover = RoadCover(roads)
    builder = MeshBuilder(np.zeros(3))
    add_lights(builder, lights, cover, Terrain(roads, cover))
    return builder.finish()


def boxes(mesh: Mesh, label: Label) -> list[tuple[list[float], list[float]]]:
    """Lowest and highest corner of each part of a class, rounded to millimetres."""
    parts = parts_of(mesh.triangles[mesh.label == label])
    places = [mesh.vertices[np.unique(part)].astype(np.float64) for part in parts]
    return [(np.round(each.min(axis=0), 3).tolist(), np.round(each.max(axis=0), 3).tolist()) for each in places]


def test_housing_lies_behind_its_lenses_across_the_way_it_shows() -> None:
    mesh = drawn(Light("a", x=50.0, y=0.0, z=5.0, yaw=0.0))
    assert boxes(mesh, Label.TRAFFIC_LIGHT) == [([49.78, -0.57, 4.79], [50.0, 0.57, 5.21])]
    turned = drawn(Light("a", x=50.0, y=0.0, z=5.0, yaw=math.pi / 2))
    assert boxes(turned, Label.TRAFFIC_LIGHT) == [([49.43, -0.22, 4.79], [50.57, 0.0, 5.21])]
    for each in (mesh, turned):
        part = each.triangles[each.label == Label.TRAFFIC_LIGHT]
        assert is_closed(part)
        assert volume_of(each.vertices, part) == pytest.approx(0.22 * 1.14 * 0.42, rel=1e-4)


def test_housing_of_people_stands_upright_and_is_smaller() -> None:
    share = 0.11 / 0.15
    high = 0.5 * (0.36 * 2 + 0.06) * share
    mesh = drawn(Light("a", RED | GREEN, is_pedestrian=True, x=50.0, y=4.0, z=2.5, yaw=0.0))
    (low, top) = boxes(mesh, Label.TRAFFIC_LIGHT)[0]
    assert low == pytest.approx([49.78, 4.0 - 0.21 * share, 2.5 - high], abs=1e-3)
    assert top == pytest.approx([50.0, 4.0 + 0.21 * share, 2.5 + high], abs=1e-3)


@pytest.mark.parametrize(("y", "foot"), [(1.0, 2.5), (-1.0, -2.5), (4.0, 4.0)])
def test_pole_stands_at_the_nearest_place_beside_the_road_with_an_arm_to_the_light(y: float, foot: float) -> None:
    mesh = drawn(Light("a", x=50.0, y=y, z=5.0, yaw=0.0))
    parts = boxes(mesh, Label.POLE)
    (low, high) = parts[-1]
    assert low == pytest.approx([49.89 - 0.09, foot - 0.09, -BELOW - 0.2], abs=0.001)
    assert high == pytest.approx([49.89 + 0.09, foot + 0.09, 5.35], abs=0.001)
    assert len(parts) == (1 if y == foot else 2)
    if y != foot:
        low, high = parts[0]
        assert low == pytest.approx([49.83, min(y, foot), 5.04], abs=0.001)
        assert high == pytest.approx([49.95, max(y, foot), 5.16], abs=0.001)
        arm = parts_of(mesh.triangles[mesh.label == Label.POLE])[0]
        assert volume_of(mesh.vertices, arm) == pytest.approx(1.5 * 0.12 * 0.12, rel=1e-3)


def test_lights_above_one_another_share_a_pole_up_to_the_highest() -> None:
    lights = [Light(f"{z}", x=50.0, y=3.0, z=z, yaw=0.0) for z in (3.0, 5.0, 4.0)]
    apart = [Light("c", x=50.0, y=3.6, z=4.0, yaw=0.0)]
    assert [high[2] for _, high in boxes(drawn(*lights), Label.POLE)] == [5.35]
    assert len(boxes(drawn(*lights, *apart), Label.POLE)) == 2
    assert len(drawn()) == 0


def test_light_far_from_any_place_beside_the_road_has_no_pole() -> None:
    wide = make(**{f"lane{i}": (line((0, 3.5 * i), (100, 3.5 * i)), "") for i in range(-5, 6)})
    cover = RoadCover(wide)
    builder = MeshBuilder(np.zeros(3))
    add_lights(builder, [Light("a", x=50.0, y=0.0, z=5.0)], cover, Terrain(wide, cover))
    assert set(builder.finish().label.tolist()) == {Label.TRAFFIC_LIGHT}


def lamps(light: Light) -> tuple[SignalLamps, list[np.ndarray]]:
    """The lenses, and the middle of each in the map frame."""
    found = SignalLamps(SignalPlan(road(), [light], []), ORIGIN)
    mesh = found.show(np.array([0]))
    parts = parts_of(mesh.triangles)
    return found, [mesh.vertices[np.unique(part)].astype(np.float64).mean(axis=0) + ORIGIN for part in parts]


def lit(found: SignalLamps, signal: int) -> list[bool]:
    mesh = found.show(np.array([signal]))
    parts = parts_of(mesh.triangles)
    return [bool((mesh.lit[np.isin(mesh.triangles[:, 0], part)] == Lit.NOW).all()) for part in parts]


def test_first_lens_is_red_and_on_the_left_of_those_who_look_at_it() -> None:
    found, middles = lamps(Light("a", x=50.0, y=2.0, z=5.0, yaw=math.pi))  # seen by drivers to the east
    assert np.array(middles) == pytest.approx(np.array([(49.98, y, 5.0) for y in (2.36, 2.0, 1.64)]), abs=1e-5)
    assert lit(found, RED) == [True, False, False]
    assert lit(found, YELLOW | GREEN) == [False, True, True]
    assert lit(found, -1) == [False] * 3
    radius = np.linalg.norm(found._vertices[:8] - found._vertices[:8].mean(axis=0), axis=1)
    assert radius == pytest.approx(0.15, rel=1e-4)
    mesh = found.show(np.array([RED]))
    assert (mesh.normals @ (-1.0, 0.0, 0.0) > 0.999).all()


def test_arrows_stand_between_red_and_green_in_their_order() -> None:
    whole = RED | YELLOW | GREEN | Lamp.LEFT | Lamp.RIGHT
    found, _ = lamps(Light("a", whole, yaw=0.0))
    for i, lamp in enumerate((RED, YELLOW, Lamp.LEFT, GREEN, Lamp.RIGHT)):
        assert lit(found, lamp) == [k == i for k in range(5)]


def test_lenses_of_people_are_above_one_another_red_on_top() -> None:
    found, middles = lamps(Light("a", RED | GREEN, is_pedestrian=True, x=0.0, y=0.0, z=2.0, yaw=0.0))
    step = 0.36 * 0.11 / 0.15
    assert np.array(middles) == pytest.approx(np.array([(0.02, 0.0, 2.0 + s * step / 2) for s in (1, -1)]), abs=1e-5)
    assert lit(found, RED) == [True, False]
    assert np.ptp(found._vertices[:8, 2]) == pytest.approx(0.22)


def test_light_that_warns_has_two_yellow_lenses() -> None:
    found, middles = lamps(Light("a", YELLOW, x=0.0, y=0.0, z=5.0, yaw=0.0))
    assert sorted(round(float(middle[1]), 3) for middle in middles) == [-0.18, 0.18]
    assert lit(found, YELLOW) == [True, True]
    assert len(lamps(Light("b", GREEN))[1]) == 1


def test_lenses_that_are_lit_are_bright_and_the_others_dark_in_their_own_colour() -> None:
    found, _ = lamps(Light("a"))
    dark, bright = (np.unique(found.show(np.array([signal])).colour, axis=0) for signal in (0, RED | YELLOW | GREEN))
    assert dark.max() <= 60
    assert (bright.max(axis=1) >= 240).all()
    for signal, channels in ((RED, (0,)), (GREEN, (1,)), (YELLOW, (0, 1))):
        mesh = found.show(np.array([int(signal)]))
        colour = mesh.colour[mesh.lit == Lit.NOW][0]
        assert [k for k in range(3) if colour[k] > 200] == list(channels)
        unlit = found.show(np.array([0])).colour[mesh.lit == Lit.NOW][0]
        assert unlit.argmax() == colour.argmax() or signal == YELLOW


def test_map_without_lights_has_no_lenses() -> None:
    mesh = SignalLamps(SignalPlan(road(), [], []), ORIGIN).show(np.zeros(0, dtype=np.int64))
    assert len(mesh) == 0
    assert len(corners(mesh, Label.TRAFFIC_LIGHT)) == 0
