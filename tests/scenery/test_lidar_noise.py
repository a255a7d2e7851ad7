"""Errors of lidars."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rosbridge_sim.scenery.lidar_noise import LidarNoise, spoil
from rosbridge_sim.scenery.pictures import Hits

NUM = 20_000


def hits_at(distance: float) -> Hits:
    ranges = np.full(NUM, distance, np.float32)
    return Hits(ranges, np.ones(NUM, np.uint8), np.zeros(NUM, np.int32), np.zeros((NUM, 3), np.float32))


def spoiled(distance: float, intensity: float, noise: LidarNoise, seed: int = 0) -> np.ndarray:
    intensities = np.full(NUM, intensity, np.float32)
    return spoil(hits_at(distance), intensities, 100.0, noise, np.random.default_rng(seed)).ranges


def test_ranges_scatter_by_the_deviation_that_is_set() -> None:
    ranges = spoiled(20.0, 50.0, LidarNoise(range_sigma=0.03))
    assert ranges.mean() == pytest.approx(20.0, abs=0.002)
    assert ranges.std() == pytest.approx(0.03, rel=0.03)


def test_dropout_is_the_share_of_lost_points_at_any_range() -> None:
    for distance in (1.0, 99.0):
        assert np.isinf(spoiled(distance, 20.0, LidarNoise(dropout=0.1))).mean() == pytest.approx(0.1, abs=0.01)


@pytest.mark.parametrize(
    ("distance", "intensity", "lost"), [(100.0, 0.0, 0.8), (50.0, 0.0, 0.2), (100.0, 150.0, 0.0), (5.0, 10.0, 0.0018)]
)
def test_weak_echoes_from_far_away_are_lost_more_often(distance: float, intensity: float, lost: float) -> None:
    found = np.isinf(spoiled(distance, intensity, LidarNoise(far_dropout=0.8))).mean()
    assert found == pytest.approx(lost, abs=0.01)


def test_noise_follows_from_the_seed_and_no_noise_changes_nothing() -> None:
    noise = LidarNoise(0.02, 0.1, 0.1)
    assert np.array_equal(spoiled(20.0, 50.0, noise, 1), spoiled(20.0, 50.0, noise, 1))
    assert not np.array_equal(spoiled(20.0, 50.0, noise, 1), spoiled(20.0, 50.0, noise, 2))
    assert (spoiled(20.0, 50.0, LidarNoise()) == 20.0).all()
    assert np.isinf(spoiled(math.inf, 0.0, noise)).all()


@pytest.mark.parametrize(
    "bad", [{"range_sigma": -1.0}, {"range_sigma": math.inf}, {"dropout": 1.5}, {"far_dropout": math.nan}]
)
def test_impossible_noise_is_refused(bad: dict[str, float]) -> None:
    with pytest.raises(ValueError, match="lidar noise"):
        LidarNoise(**bad)
