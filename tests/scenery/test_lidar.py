"""Tables of lidars, turns, and points."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rosbridge_sim.scenery.camera_geometry import Pose
from rosbridge_sim.scenery.lidar import LidarNoise, aim, collect
from rosbridge_sim.scenery.lidar_models import LIDAR_MODELS, LidarModel
from rosbridge_sim.scenery.mesh import Label
from rosbridge_sim.scenery.pictures import Hits

VLP = LIDAR_MODELS["VLP-16"]


def hits_at(model: LidarModel, distance: float, label: Label) -> Hits:
    num = model.num_rays
    return Hits(
        np.full(num, distance, np.float32),
        np.full(num, label, np.uint8),
        np.zeros(num, np.int32),
        (-model.directions).astype(np.float32),
    )


def test_models_have_lasers_and_columns_of_their_data_sheets() -> None:
    assert {name: (len(m.elevations_deg), m.columns) for name, m in LIDAR_MODELS.items()} == {
        "VLP-16": (16, 1800),
        "HDL-32E": (32, 2170),
        "OS1-64": (64, 1024),
        "OS1-128": (128, 1024),
    }
    assert VLP.elevations_deg == tuple(range(-15, 16, 2))
    assert np.diff(LIDAR_MODELS["HDL-32E"].elevations_deg) == pytest.approx(1.333, abs=1e-3)


def test_turn_goes_clockwise_from_the_back_over_the_left_side() -> None:
    azimuth = np.arctan2(VLP.directions[:, 1], VLP.directions[:, 0])[:: len(VLP.elevations_deg)]
    assert azimuth[0] == pytest.approx(math.pi, abs=0.01)
    assert azimuth[450] == pytest.approx(math.pi / 2, abs=0.01)
    assert azimuth[900] == pytest.approx(0.0, abs=0.01)
    assert np.linalg.norm(VLP.directions, axis=1) == pytest.approx(1.0)


def test_lasers_of_a_column_fire_one_after_the_other_within_its_time() -> None:
    times = VLP.times(0.1).reshape(VLP.columns, 16).astype(np.float64)
    first = times[0] - times[0, 0]
    # Laser 1 of a VLP-16 looks up by 1 degree (ring 8) and fires 2.304 us after laser 0 (ring 0).
    assert first[8] == pytest.approx(2.304e-6, rel=1e-3)
    assert len(set(first.round(9).tolist())) == 16
    assert (times[1:] > times[:-1]).all()
    assert times.max() < 0.1


def test_moving_lidar_aims_from_its_place_at_each_column() -> None:
    model = LidarModel("own", (0.0,), 4)
    origins, directions = aim(model, Pose(0, 0, 1, yaw=3.1), Pose(4, 0, 1, yaw=-3.1), np.zeros(3))
    assert origins[:, 0] == pytest.approx([0.5, 1.5, 2.5, 3.5])
    headings = np.arctan2(directions[:, 1], directions[:, 0])
    # The shorter way round passes pi: the heading changes by 0.08 rad in all.
    expected = np.pi - (np.arange(4) + 0.5) * np.pi / 2 + 3.1 + (2 * np.pi - 6.2) * (np.arange(4) + 0.5) / 4
    assert np.cos(headings - expected) == pytest.approx(1.0)


def test_paint_is_brighter_than_50_and_asphalt_darker() -> None:
    paint, asphalt = (
        collect(VLP, hits_at(VLP, 10.0, label), VLP.directions.astype(np.float32), 0.1)
        for label in (Label.PAINT_WHITE, Label.ASPHALT)
    )
    assert paint.intensity.min() > 100.0
    assert asphalt.intensity.max() < 50.0


def test_points_that_are_too_near_or_too_far_are_left_out() -> None:
    directions = VLP.directions.astype(np.float32)
    for distance, num in ((0.2, 0), (10.0, VLP.num_rays), (100.5, 0), (math.inf, 0)):
        assert len(collect(VLP, hits_at(VLP, distance, Label.ASPHALT), directions, 0.1)) == num


def test_far_points_of_dark_things_are_lost_more_often() -> None:
    directions = VLP.directions.astype(np.float32)
    noise = LidarNoise(far_dropout=0.8)
    kept = [
        len(collect(VLP, hits_at(VLP, distance, label), directions, 0.1, noise=noise, rng=np.random.default_rng(0)))
        for distance, label in ((10.0, Label.ASPHALT), (90.0, Label.PAINT_WHITE), (90.0, Label.ASPHALT))
    ]
    assert kept[0] > kept[2]
    assert kept[1] > kept[2]
    assert kept[0] > 0.98 * VLP.num_rays


def test_noise_without_a_generator_is_refused() -> None:
    with pytest.raises(ValueError, match="rng"):
        collect(
            VLP, hits_at(VLP, 5.0, Label.ASPHALT), VLP.directions.astype(np.float32), 0.1, noise=LidarNoise(dropout=0.1)
        )


@pytest.mark.parametrize(
    "bad",
    [
        {"elevations_deg": ()},
        {"elevations_deg": (91.0,)},
        {"elevations_deg": (math.nan,)},
        {"columns": 0},
        {"columns": 1_000_000},
        {"max_range": 0.0},
        {"max_range": math.nan},
        {"fire_s": (0.0, 1.0)},
    ],
)
def test_impossible_lidar_is_refused(bad: dict[str, object]) -> None:
    with pytest.raises(ValueError, match="lidar own: expected"):
        LidarModel(**{"name": "own", "elevations_deg": (0.0,), "columns": 100, **bad})  # type: ignore[arg-type]


@pytest.mark.parametrize("bad", [{"range_sigma": -1.0}, {"dropout": 1.5}, {"far_dropout": math.nan}])
def test_impossible_noise_is_refused(bad: dict[str, float]) -> None:
    with pytest.raises(ValueError, match="lidar noise"):
        LidarNoise(**bad)
