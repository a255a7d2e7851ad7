#!/usr/bin/env python3
"""Find what stands ahead in the cloud of a lidar: region of interest, DBSCAN, and a box around each cluster.

    ./scripts/serve --scenario town --sensors lidar       # in one terminal
    python scripts/examples/lidar_clusters.py             # in another

The limits are those of MORAI-EDU's clustering: ahead of the lidar, less than 50 m away, between 1.25 m below and 1.5 m
above it; DBSCAN over x and y with eps 0.5 m and 5 points. The road is 1.28 m below the lidar, so it is left out. What
stands beside the road, kerbs among it, gives clusters, too. It needs numpy and rosbridge_sim.
"""

from __future__ import annotations

import argparse
import base64
import sys
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rosbridge_sim.client import Client

REACH, BELOW, ABOVE = 50.0, -1.25, 1.5  # [m]
EPS, MIN_POINTS = 0.5, 5  # [m]

Points = NDArray[np.float32]


class Cluster(NamedTuple):
    """A cluster of points: distance to the nearest one, and the box around all [m]."""

    distance: float
    x: float
    y: float
    length: float
    width: float
    num: int


def decode(message: dict[str, Any]) -> Points:
    """Return the points of a PointCloud2, (n, 4): x, y, z, intensity."""
    data = message["data"]  # bytes, or base64 if the connection is JSON
    content = base64.b64decode(data) if isinstance(data, str) else data
    offsets = {field["name"]: field["offset"] for field in message["fields"]}
    names = ["x", "y", "z", "intensity"]
    kind = np.dtype(
        {
            "names": names,
            "formats": ["<f4"] * 4,
            "offsets": [offsets[name] for name in names],
            "itemsize": message["point_step"],
        }
    )
    points = np.frombuffer(content, dtype=kind)
    return np.asarray(np.column_stack([points[name] for name in names]), dtype=np.float32)


def region_of_interest(points: Points) -> Points:
    """Return the points ahead that are neither road nor sky."""
    x, y, z = points[:, :3].T
    is_wanted = (x > 0.0) & (np.hypot(x, y) < REACH) & (z > BELOW) & (z < ABOVE)
    return np.asarray(points[is_wanted], dtype=np.float32)


def dbscan(places: NDArray[np.float32], eps: float, min_points: int) -> NDArray[np.int64]:
    """Return the cluster of each place, (n,), from 0 on; -1 for none.

    A place with `min_points` within `eps`, itself among them, is the core of a cluster. It takes its neighbours in, and
    those of them that are cores take in theirs.

    Args:
        places: (n, 2) [m].
        eps: radius [m].
        min_points: number of places.
    """
    near = [np.flatnonzero(np.square(places - place).sum(axis=1) <= eps * eps) for place in places]
    clusters = np.full(len(places), -1)
    num = 0
    for first in range(len(places)):
        if clusters[first] >= 0 or len(near[first]) < min_points:
            continue
        clusters[first], waiting = num, [first]
        while waiting:
            neighbours = near[waiting.pop()]
            new = neighbours[clusters[neighbours] < 0]
            clusters[new] = num
            waiting += [place for place in new.tolist() if len(near[place]) >= min_points]
        num += 1
    return clusters


def clusters_of(points: Points) -> Iterator[Cluster]:
    """Yield the clusters of a cloud, the nearest first."""
    seen = region_of_interest(points)
    names = dbscan(seen[:, :2], EPS, MIN_POINTS)
    found = []
    for name in range(names.max(initial=-1) + 1):
        places = seen[names == name, :2]
        low, high = places.min(axis=0), places.max(axis=0)
        nearest = float(np.hypot(*places.T).min())
        (x, y), (length, width) = ((low + high) / 2).tolist(), (high - low).tolist()
        found.append(Cluster(nearest, x, y, length, width, len(places)))
    yield from sorted(found)


def main() -> int:
    """Read the command line, and print the clusters of some turns."""
    parser = argparse.ArgumentParser(description="Find what stands ahead in the cloud of a lidar.")
    parser.add_argument("--url", default="ws://127.0.0.1:9090")
    parser.add_argument("--topic", default="/velodyne_points")
    parser.add_argument("--turns", type=int, default=1, help="clouds that are used (%(default)s)")
    args = parser.parse_args()
    with Client(args.url, timeout=60.0) as client:  # the first cloud of a map takes seconds
        clouds = client.subscribe(args.topic)
        for _ in range(args.turns):
            for cluster in clusters_of(decode(clouds.next())):
                print(
                    f"{cluster.distance:5.1f} m away: middle ({cluster.x:5.1f}, {cluster.y:5.1f}) m,"
                    f" {cluster.length:4.1f} x {cluster.width:3.1f} m, {cluster.num} points"
                )
    return 0


if __name__ == "__main__":
    sys.exit(main())
