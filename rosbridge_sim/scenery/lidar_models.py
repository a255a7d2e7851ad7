"""Tables of angles of lidars: in which direction each laser looks, and when it fires within a turn.

Sources of the vertical angles and of the times: Velodyne, VLP-16 User Manual 63-9243 Rev. E (chapter 6 and 9) and
HDL-32E User's Manual 63-9113 Rev. M (appendix E); Ouster, OS1 datasheet Rev. 7 (45 degrees, evenly spread, 1,024
columns a turn).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import NDArray

from rosbridge_sim.world.geometry.planar import FloatArray

__all__ = ["LIDAR_MODELS", "LidarModel"]

MAX_RAYS: Final = 300_000
"""Rays of a turn at most: 128 lasers at 2,048 columns are 262,144."""


@dataclass(frozen=True)
class LidarModel:
    """A lidar that turns about its z axis, clockwise as seen from above, as those of Velodyne and Ouster do.

    Attributes:
        name: as users write it.
        elevations_deg: of each laser, positive up, the lowest first; its place is the `ring` [deg].
        columns: directions in a turn in which all lasers fire.
        max_range: [m].
        fire_s: time of each laser after the first one of its column [s]; None for all at once.

    Raises:
        ValueError: there are no rays, too many, or an angle is out of bounds.
    """

    name: str
    elevations_deg: tuple[float, ...]
    columns: int
    max_range: float = 100.0
    fire_s: tuple[float, ...] | None = None

    def __post_init__(self) -> None:
        """Check the values."""
        if not (len(self.elevations_deg) >= 1 and self.columns >= 1):
            raise ValueError(f"lidar {self.name}: expected at least one laser and one column")
        if len(self.elevations_deg) * self.columns > MAX_RAYS:
            raise ValueError(f"lidar {self.name}: expected at most {MAX_RAYS:,} rays a turn, got {self.num_rays:,}")
        if not all(abs(angle) <= 90.0 for angle in self.elevations_deg):  # noqa: PLR2004 - straight up and down
            raise ValueError(f"lidar {self.name}: expected elevations of -90..90 deg")
        if self.fire_s is not None and len(self.fire_s) != len(self.elevations_deg):
            raise ValueError(f"lidar {self.name}: expected a time for each of {len(self.elevations_deg)} lasers")
        if not 0.0 < self.max_range < math.inf:
            raise ValueError(f"lidar {self.name}: expected a positive range, got {self.max_range!r}")

    @property
    def num_rays(self) -> int:
        """Rays of a turn."""
        return len(self.elevations_deg) * self.columns

    @cached_property
    def rings(self) -> NDArray[np.uint16]:
        """(rays,) number of the laser of each ray, 0 for the lowest; the rays of a column lie together."""
        return np.tile(np.arange(len(self.elevations_deg), dtype=np.uint16), self.columns)

    @cached_property
    def directions(self) -> FloatArray:
        """(rays, 3) unit vectors in the axes of the lidar; the turn begins and ends at the back."""
        elevation = np.radians(np.tile(np.array(self.elevations_deg), self.columns))
        share = np.repeat((np.arange(self.columns) + 0.5) / self.columns, len(self.elevations_deg))
        azimuth = math.pi - 2.0 * math.pi * share
        flat = np.cos(elevation)
        return np.column_stack([flat * np.cos(azimuth), flat * np.sin(azimuth), np.sin(elevation)])

    def times(self, period: float) -> NDArray[np.float32]:
        """Return when each ray fires after the beginning of the turn, (rays,), less than the period [s].

        Args:
            period: of a turn [s].
        """
        start = period * np.arange(self.columns) / self.columns
        fire = np.zeros(len(self.elevations_deg)) if self.fire_s is None else np.array(self.fire_s)
        times = np.repeat(start, len(fire)) + np.tile(np.minimum(fire, period / self.columns * 0.999), self.columns)
        fired: NDArray[np.float32] = times.astype(np.float32)
        return fired


def _evenly(low: float, high: float, num: int) -> tuple[float, ...]:
    return tuple((low + (high - low) * np.arange(num) / (num - 1)).round(4).tolist())


def _vlp16_times() -> tuple[float, ...]:
    """Return when the lasers of a VLP-16 fire, by rising elevation: that of -15 deg first, then 1, -13, 3."""
    order = [k // 2 if k % 2 == 0 else 8 + k // 2 for k in range(16)]  # ring of each laser in the order of firing
    times = [0.0] * 16
    for k, ring in enumerate(order):
        times[ring] = 2.304e-6 * k
    return tuple(times)


LIDAR_MODELS: Final = {
    model.name: model
    for model in (
        LidarModel("VLP-16", _evenly(-15.0, 15.0, 16), 1800, 100.0, _vlp16_times()),
        LidarModel("HDL-32E", _evenly(-30.67, 10.67, 32), 2170, 100.0, tuple(1.152e-6 * k for k in range(32))),
        LidarModel("OS1-64", _evenly(-22.5, 22.5, 64), 1024, 120.0),
        LidarModel("OS1-128", _evenly(-22.5, 22.5, 128), 1024, 120.0),
    )
}
"""Models that are known by name, at 10 turns a second."""
