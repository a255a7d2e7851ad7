"""Errors of lidars: noise of the range, and points that are lost.

A point is lost with the probability p = dropout + far_dropout (r / R)^2 (1 - s): r is the range, R the greatest one,
and s the strength of the echo, which is its intensity as a share of `STRONG`, at most 1. Less light comes back from far
away, from dark things and at flat angles.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from rosbridge_sim.scenery.pictures import Hits

__all__ = ["LidarNoise", "spoil"]

STRONG: Final = 100.0
"""Intensity of an echo that is never lost for its weakness: that of a white wall, on Velodyne's scale."""


@dataclass(frozen=True, slots=True)
class LidarNoise:
    """Errors of a lidar; the defaults are none.

    Attributes:
        range_sigma: standard deviation of the range [m]; 0.01 to 0.03 for real lidars.
        dropout: share of points that are lost at any range.
        far_dropout: share that is lost beside these at the greatest range, of echoes without strength.

    Raises:
        ValueError: a share is not within 0..1, or the deviation is negative or not finite.
    """

    range_sigma: float = 0.0
    dropout: float = 0.0
    far_dropout: float = 0.0

    def __post_init__(self) -> None:
        """Check the values."""
        if not 0.0 <= self.range_sigma < math.inf:
            raise ValueError(f"lidar noise: range_sigma: expected at least 0 m, got {self.range_sigma!r}")
        for name in ("dropout", "far_dropout"):
            if not 0.0 <= getattr(self, name) <= 1.0:
                raise ValueError(f"lidar noise: {name}: expected 0..1, got {getattr(self, name)!r}")


def spoil(
    hits: Hits, intensities: NDArray[np.float32], max_range: float, noise: LidarNoise, rng: np.random.Generator
) -> Hits:
    """Return hits with noise; the range of a lost point is inf.

    Args:
        hits: of k rays.
        intensities: (k,) 0..255.
        max_range: of the lidar [m].
        noise: the errors.
        rng: chance. It gives two numbers for each ray, met or not: one hit more changes no other point.
    """
    chance, bell = rng.random(len(hits.ranges)), rng.standard_normal(len(hits.ranges))
    share = np.minimum(hits.ranges / max_range, 1.0)
    weakness = 1.0 - np.minimum(intensities / STRONG, 1.0)
    is_lost = chance < noise.dropout + noise.far_dropout * share**2 * weakness
    ranges = np.where(is_lost, np.inf, hits.ranges + noise.range_sigma * bell).astype(np.float32)
    return replace(hits, ranges=ranges)
