"""A turn of a lidar by pure arithmetic: where its beams look and when, what they give, and what a point holds."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rosbridge_sim.scenery.camera_geometry import Pose, rotation
from rosbridge_sim.scenery.mesh import Label
from rosbridge_sim.scenery.pictures import Hits
from rosbridge_sim.simulator.sensor_data.lidar_sweep import (
    POINT_TYPE,
    Beams,
    Echoes,
    Motion,
    beams_2d,
    beams_3d,
    echoes_of,
    fade,
    pack_points,
    sweep,
)

LEVEL = Pose(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def test_turning_lidar_begins_behind_goes_clockwise_and_ends_with_the_frame() -> None:
    beams = beams_3d(np.radians([-30.0, 0.0, 10.0]), 4, 0.1)
    ways = [(-1, 0), (0, 1), (1, 0), (0, -1)]  # behind, left, ahead, right
    rings = [(math.cos(angle), math.sin(angle)) for angle in np.radians([-30.0, 0.0, 10.0])]
    expected = [(x * flat, y * flat, up) for x, y in ways for flat, up in rings]
    assert beams.directions == pytest.approx(np.array(expected), abs=1e-12)
    assert beams.times == pytest.approx(np.repeat([-0.075, -0.05, -0.025, 0.0], 3), abs=1e-12)
    assert beams.rings.tolist() == [0, 1, 2] * 4
    assert beams.rings_per_column == 3


def test_flat_lidar_turns_the_other_way_and_has_its_named_value_ahead() -> None:
    beams = beams_2d(8, 3, 0.2)
    angle = np.radians(45.0 * (np.arange(8) - 3))
    assert beams.directions == pytest.approx(np.column_stack([np.cos(angle), np.sin(angle), 0 * angle]), abs=1e-12)
    assert beams.times == pytest.approx(np.arange(-0.175, 0.01, 0.025), abs=1e-12)
    assert (set(beams.rings.tolist()), beams.rings_per_column) == ({0}, 1)


@pytest.mark.parametrize("turn", [0.0, 0.8])
def test_beams_begin_where_the_sensor_was_on_the_arc_of_its_vehicle(turn: float) -> None:
    vehicle, mounting = Pose(100.0, -20.0, 3.0, 0.02, 0.05, 0.7), Pose(1.5, -0.5, 2.0, 0.03, 0.2, -0.4)
    beams, origin = beams_3d(np.radians([-10.0, 5.0]), 8, 0.1), np.array([90.0, 0.0, 1.0])
    places, directions = sweep(Motion(vehicle, mounting, 20.0, turn), beams, origin)
    for k in range(len(beams.times)):
        time = beams.times[k]
        place, yaw = np.array(vehicle[:3]), vehicle.yaw
        for _ in range(300):  # back along the heading of each moment
            step = time / 300
            forward = rotation(0.0, vehicle.pitch, yaw + 0.5 * turn * step) @ (1.0, 0.0, 0.0)
            place, yaw = place + 20.0 * step * forward, yaw + turn * step
        axes = rotation(vehicle.roll, vehicle.pitch, yaw)
        assert places[k] == pytest.approx(place + axes @ np.array(mounting[:3]) - origin, abs=2e-3)
        seen = axes @ rotation(*mounting[3:]) @ beams.directions[k]
        assert directions[k] == pytest.approx(seen, abs=1e-5)


def hits(labels: list[int], normals: list[tuple[float, float, float]], away: float = 10.0) -> Hits:
    num = len(labels)
    return Hits(
        np.full(num, away, dtype=np.float32),
        np.array(labels, dtype=np.uint8),
        np.zeros(num, dtype=np.int32),
        np.array(normals, dtype=np.float32),
    )


def test_diffuse_material_gets_darker_where_a_beam_grazes_it_and_paint_does_not() -> None:
    slant = 0.6, 0.0, 0.8
    square, grazing = (-0.6, 0.0, -0.8), (0.8, 0.0, -0.6)
    found = echoes_of(
        hits(
            [Label.VEHICLE, Label.VEHICLE, Label.PAINT_WHITE, Label.PAINT_WHITE, 0], [square, grazing] * 2 + [(0, 0, 0)]
        ),
        np.array([slant] * 5, dtype=np.float32),
    )
    assert found.intensities.tolist() == [60.0, 30.0, 160.0, 160.0, 0.0]
    assert found.slants == pytest.approx(np.array([1.0, 0.0, 1.0, 0.0, 0.0]), abs=1e-6)
    assert found.ranges.tolist() == [10.0] * 5
    across = np.array([(0.36, 0.48, 0.8)], dtype=np.float32)
    slants = [echoes_of(hits([Label.POLE], [normal]), across).slants[0] for normal in ((1, 0, 0), (0, 1, 0), (0, 0, 1))]
    assert slants == pytest.approx([0.36, 0.48, 0.8])


def test_asphalt_is_darker_than_fifty_and_paint_on_it_brighter_at_any_angle() -> None:
    labels = [label for label in Label if label != Label.NONE]
    for slant in (0.0, 1.0):
        normal = (0.0, math.sqrt(1.0 - slant * slant), slant)
        found = echoes_of(hits(list(labels), [normal] * len(labels)), np.array([(0, 0, -1)] * len(labels), np.float32))
        bright = {label for label, value in zip(labels, found.intensities, strict=True) if value >= 100.0}
        assert bright == {
            *(Label.PAINT_WHITE, Label.PAINT_YELLOW, Label.PAINT_BLUE),
            *(Label.CROSSWALK, Label.STOP_LINE, Label.SIGN),
        }
        assert 0.0 < found.intensities[labels.index(Label.ASPHALT)] < 50.0


def test_fog_takes_light_both_ways() -> None:
    echoes = Echoes(*(np.array(values, np.float32) for values in ([10.0, 20.0, 50.0, np.inf], [60.0] * 4, [1.0] * 4)))
    found = fade(echoes, 0.02, 100.0)
    assert found.intensities[:2].tolist() == [round(60.0 * math.exp(-0.4)), round(60.0 * math.exp(-0.8))]
    # Of 7, the darkest at 100 m in clear air: 60 exp(-4 a r) at 20 m is above 7 (20 / 100)^2.
    assert np.isfinite(found.ranges).tolist() == [True, True, True, False]
    assert np.isfinite(fade(echoes, 0.05, 100.0).ranges).tolist() == [True, True, False, False]
    assert fade(echoes, 0.0, 100.0).ranges.tolist()[:3] == [10.0, 20.0, 50.0]
    close = Echoes(*(np.array([value], np.float32) for value in (0.0, 60.0, 1.0)))
    assert fade(close, 1.0, 100.0).ranges.tolist() == [0.0]


def test_point_has_the_place_on_its_beam_to_a_hundredth_of_a_millimetre() -> None:
    beams = Beams(
        np.array([(0.6, 0.0, -0.8), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)]),
        np.array([-0.3, -0.2, -0.1, 0.0]),
        np.array([3, 2, 1, 0], dtype=np.uint16),
        1,
    )
    ranges = np.array([1.0000012, 0.4, 100.0, 100.1], np.float32)
    data, num = pack_points(Echoes(ranges, np.array([9, 8, 7, 6], np.float32), ranges), beams, 0.4, 100.0)
    points = np.frombuffer(data, POINT_TYPE)
    assert num == len(points) == 3
    assert points["x"].tolist() == pytest.approx([np.float32(0.6), np.float32(0.4), 0.0], abs=0.0)
    assert points["z"].tolist() == pytest.approx([np.float32(-0.8), 0.0, 0.0], abs=0.0)
    assert points["y"].tolist() == [0.0, 0.0, 100.0]
    assert points["intensity"].tolist() == [9.0, 8.0, 7.0]
    assert points["ring"].tolist() == [3, 2, 1]
    assert points["time"].tolist() == pytest.approx([-0.3, -0.2, -0.1])
