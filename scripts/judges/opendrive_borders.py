"""Compare lane borders of OpenDRIVE maps with those of another program.

    scripts/judges/opendrive_borders.py FOLDER EXPECTED

FOLDER holds .xodr files; EXPECTED holds `NAME.csv.gz`, the output of esmini's `odrplot NAME.xodr NAME.csv STEP`: for
each lane a line `lane, ROAD, SECTION, LANE, driving|no-driving`, then `x, y, z, heading` of points on its outer border.
Prints for each file the lanes, and how far the points are from the edges that the simulator's lanes have. Exit code 1
if a point is farther than 2 cm, in the plane or in height.
"""

from __future__ import annotations

import gzip
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import numpy.typing as npt

from rosbridge_sim.maps.opendrive.opendrive_map import read_opendrive
from rosbridge_sim.maps.road_map import RoadMap
from rosbridge_sim.world.geometry.planar import nearest_on_polyline

Points = npt.NDArray[np.float64]

LIMIT = 0.02
"""Largest distance [m]."""

NARROW_ENDS = 15.0
"""Points this far beyond the end of a lane's line are counted apart [m]: there the lane is narrower than 0.5 m."""


def read_expected(path: Path) -> Iterator[tuple[tuple[str, int, int], Points]]:
    """Yield road, section and lane, and (n, 3) points of each driving lane."""
    key: tuple[str, int, int] | None = None
    points: list[list[float]] = []
    with gzip.open(path, "rt") as file:
        for line in [*file, "lane, , 0, 0, end"]:
            cells = [cell.strip() for cell in line.split(",")]
            if cells[0] == "lane":
                if key is not None and points:
                    yield key, np.array(points)
                is_driving = cells[4] == "driving"
                key, points = ((cells[1], int(cells[2]), int(cells[3])) if is_driving else None), []
            elif len(cells) >= 3 and key is not None:
                points.append([float(cell) for cell in cells[:3]])


def compare(road_map: RoadMap, expected: Path) -> tuple[str, bool]:
    """Return a line about a map, and whether all is within the limit."""
    roads = road_map.roads
    left, right, _ = roads.edge_lines()
    lines: dict[tuple[str, int, int], list[Points]] = {}
    assert road_map.positions is not None
    for row, name in enumerate(roads.ids):
        road, section, lane = name.split(".")[:3]
        span = road_map.positions.spans[row]
        part = slice(roads.first[row], roads.first[row + 1])
        # The outer edge of a left lane lies to the left along the road.
        is_left = (int(lane) > 0) == span.is_forward
        lines.setdefault((road, int(section), int(lane)), []).append((left if is_left else right)[part])
    num, beyond = 0, 0
    missing: list[str] = []
    aways: list[Points] = []
    rises: list[Points] = []
    for key, their_points in read_expected(expected):
        num += 1
        # odrplot adds the header's offset to all places of one file, and to none of others.
        points = their_points - (road_map.origin if np.abs(their_points[:, :2]).max() > 2e5 else (0.0, 0.0, 0.0))
        if key not in lines:
            missing.append(".".join(map(str, key)))
            continue
        best, height = np.full(len(points), np.inf), np.zeros(len(points))
        for line in lines[key]:
            near = nearest_on_polyline(line, points[:, 0], points[:, 1])
            start, end = line[near.segment], line[near.segment + 1]
            share = np.hypot(near.x - start[:, 0], near.y - start[:, 1]) / np.hypot(*(end - start)[:, :2].T)
            distance = np.hypot(near.x - points[:, 0], near.y - points[:, 1])
            is_nearer = distance < best
            best[is_nearer] = distance[is_nearer]
            z = start[:, 2] + share * (end[:, 2] - start[:, 2])
            height[is_nearer] = (points[:, 2] - z)[is_nearer]
        ends = np.array([line[i, :2] for line in lines[key] for i in (0, -1)])
        to_end = np.hypot(*(points[:, None, :2] - ends).transpose(2, 0, 1)).min(axis=1)
        is_beyond = (best > LIMIT) & (to_end < NARROW_ENDS) & (np.abs(best - to_end) < LIMIT)
        beyond += int(is_beyond.sum())
        aways.append(best[~is_beyond])
        rises.append(np.abs(height[~is_beyond]))
    away, rise = np.concatenate(aways), np.concatenate(rises)
    text = (
        f"{road_map.name}: {num} driving lanes, {len(lines)} here, {len(missing)} missing {missing[:3]}; "
        f"{len(away)} points, median {np.median(away):.4f} m, 99 % {np.quantile(away, 0.99):.4f} m, largest "
        f"{away.max():.4f} m; height {rise.max():.4f} m; {beyond} points beyond narrow ends"
    )
    return text, not missing and float(away.max()) <= LIMIT and float(rise.max()) <= LIMIT


def main() -> int:
    """Run the judge on a folder."""
    folder, expected = map(Path, sys.argv[1:3])
    all_good = True
    for path in sorted(folder.glob("*.xodr")):
        judge = expected / f"{path.stem}.csv.gz"
        if judge.exists():
            text, is_good = compare(read_opendrive([path.read_bytes()], str(path)), judge)
            print(("good " if is_good else "BAD  ") + text)
            all_good &= is_good
    return 0 if all_good else 1


if __name__ == "__main__":
    sys.exit(main())
