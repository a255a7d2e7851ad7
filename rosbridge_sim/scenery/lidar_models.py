"""Lidars that are known by name: the angles of their lasers, and how often these fire in a turn.

Sources: Velodyne, VLP-16 User Manual 63-9243 Rev. E (chapters 6 and 9) and HDL-32E User's Manual 63-9113 Rev. M
(appendix E); Ouster, OS1 datasheet Rev. 7 (45 degrees, evenly spread, 1,024 columns a turn).
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np


class LidarModel(NamedTuple):
    """A lidar that turns about its z axis.

    Attributes:
        elevations_deg: of each laser, positive up, the lowest first; its place is the ring [deg].
        columns: directions in a turn in which all lasers fire, at 10 turns a second.
    """

    elevations_deg: tuple[float, ...]
    columns: int


def _evenly(low: float, high: float, num: int) -> tuple[float, ...]:
    return tuple((low + (high - low) * np.arange(num) / (num - 1)).round(4).tolist())


LIDAR_MODELS: Final = {
    "VLP-16": LidarModel(_evenly(-15.0, 15.0, 16), 1800),
    "HDL-32E": LidarModel(_evenly(-30.67, 10.67, 32), 2170),
    "OS1-64": LidarModel(_evenly(-22.5, 22.5, 64), 1024),
    "OS1-128": LidarModel(_evenly(-22.5, 22.5, 128), 1024),
}
"""Models by name. At 10 turns a second a VLP-16 fires each 0.2 deg, an HDL-32E each 46.08 us."""
