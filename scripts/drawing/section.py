"""A reference line of straights and arcs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Section:
    """A section of the reference line: a straight or an arc, with the pose at its start."""

    length: float  # of the reference line [m]
    curvature: float  # left positive [1/m]
    max_speed_kmh: int
    x: float = 0.0
    y: float = 0.0
    yaw: float = 0.0

    def at(self, s: float, offset: float = 0.0) -> tuple[float, float]:
        """Return a point beside the reference line.

        Args:
            s: arc length from the section's start [m].
            offset: to the left of the line [m].

        Returns:
            East and north [m].
        """
        yaw = self.yaw + self.curvature * s
        if self.curvature == 0.0:
            x, y = self.x + s * math.cos(yaw), self.y + s * math.sin(yaw)
        else:
            x = self.x + (math.sin(yaw) - math.sin(self.yaw)) / self.curvature
            y = self.y - (math.cos(yaw) - math.cos(self.yaw)) / self.curvature
        return x - offset * math.sin(yaw), y + offset * math.cos(yaw)

    def points(self, offset: float, step: float) -> list[tuple[float, float]]:
        """Return points of a line beside the reference line, with both ends.

        Args:
            offset: to the left of the reference line [m].
            step: largest distance between points [m].

        Returns:
            Points at equal distances, east and north [m].
        """
        num = max(1, math.ceil(self.length * (1.0 - offset * self.curvature) / step - 1e-9))
        return [self.at(self.length * i / num, offset) for i in range(num + 1)]


def bend(radius: float, degrees: float, max_speed_kmh: int) -> Section:
    """Return an arc.

    Args:
        radius: [m].
        degrees: its angle; left is positive.
        max_speed_kmh: [km/h].

    Returns:
        The section, at the origin.
    """
    turn = math.radians(degrees)
    return Section(radius * abs(turn), math.copysign(1.0 / radius, turn), max_speed_kmh)


def straight(length: float, max_speed_kmh: int) -> Section:
    """Return a straight.

    Args:
        length: [m].
        max_speed_kmh: [km/h].

    Returns:
        The section, at the origin.
    """
    return Section(length, 0.0, max_speed_kmh)


def lay(way: Sequence[Section], to_west: int, to_south: int) -> list[Section]:
    """Join sections to a closed loop, counter-clockwise, from (0, 0) to the east.

    The lengths of two straights follow from the loop being closed; they are given as 0.

    Args:
        way: the sections.
        to_west: index of the straight to the west.
        to_south: index of the straight to the south.

    Returns:
        The sections with their poses.
    """
    way = list(way)
    x, y = _end(way)
    for i, length in ((to_west, x), (to_south, y)):
        way[i] = straight(length, way[i].max_speed_kmh)
    laid = chain(way)
    x, y = laid[-1].at(laid[-1].length)
    if math.hypot(x, y) > 1e-9 or min(section.length for section in laid) <= 0.0:
        raise AssertionError("the loop is not closed")
    return laid


def chain(way: Sequence[Section], x: float = 0.0, y: float = 0.0, yaw: float = 0.0) -> list[Section]:
    """Join sections end to end.

    Args:
        way: the sections.
        x: start, east [m].
        y: start, north [m].
        yaw: direction at the start, counter-clockwise from east [rad].

    Returns:
        The sections with their poses.
    """
    laid: list[Section] = []
    for section in way:
        here = Section(section.length, section.curvature, section.max_speed_kmh, x, y, yaw)
        (x, y), yaw = here.at(here.length), yaw + here.curvature * here.length
        laid.append(here)
    return laid


def _end(way: Sequence[Section]) -> tuple[float, float]:
    last = chain(way)[-1]
    return last.at(last.length)
