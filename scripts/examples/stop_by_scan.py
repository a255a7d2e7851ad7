#!/usr/bin/env python3
"""Drive straight ahead, and stop in an emergency by a 2D lidar.

    ./scripts/serve --scenario demo --sensors all      # in one terminal
    python scripts/examples/stop_by_scan.py            # in another

`/lidar2D` is a LaserScan of 360 values, and index 180 looks ahead. The program looks at the sector ahead, as wide as
the car at each distance, and brakes fully when the way to the nearest thing there is shorter than it needs to stop.
It needs numpy and rosbridge_sim.
"""

from __future__ import annotations

import argparse
import sys
from typing import Any

import numpy as np

from rosbridge_sim.client import Client

HALF_WIDTH = 1.1  # of the car, with something to spare [m]
DECELERATION = 6.0  # of an emergency stop; the tyres hold about 8 [m/s2]
REACTION = 0.2  # two turns of the lidar [s]
SPARE = 2.0  # where the car is to stand before the obstacle [m]


def free_way(scan: dict[str, Any]) -> float:
    """Return the way ahead of the sensor that is free [m]."""
    ranges = np.array([np.inf if value is None else value for value in scan["ranges"]])  # JSON has no infinity
    angles = scan["angle_min"] + scan["angle_increment"] * np.arange(len(ranges))
    is_seen = np.isfinite(ranges) & (ranges >= scan["range_min"]) & (np.cos(angles) > 0.0)
    x, y = ranges[is_seen] * np.cos(angles[is_seen]), ranges[is_seen] * np.sin(angles[is_seen])
    return float(x[np.abs(y) < HALF_WIDTH].min(initial=np.inf))


def must_stop(way: float, speed: float) -> bool:
    """Return whether the car must brake now.

    Args:
        way: that is free [m].
        speed: of the car [m/s].
    """
    return way < SPARE + speed * REACTION + speed * speed / (2.0 * DECELERATION)


def main() -> int:
    """Drive until something is in the way, or the time is over."""
    parser = argparse.ArgumentParser(description="Drive straight ahead, and stop in an emergency by a 2D lidar.")
    parser.add_argument("--url", default="ws://127.0.0.1:9090")
    parser.add_argument("--speed-kmh", type=float, default=30.0, help="[km/h] (%(default)s)")
    parser.add_argument("--seconds", type=float, default=60.0, help="longest drive, in simulated time (%(default)s)")
    args = parser.parse_args()
    with Client(args.url, timeout=60.0) as client:  # the first scan of a map takes seconds
        scans = client.subscribe("/lidar2D")
        client.start_sync()
        way, speed, is_stopping = np.inf, 0.0, False
        for _ in range(round(args.seconds / 0.1)):
            is_stopping = is_stopping or must_stop(way, speed)
            drive = {"longlCmdType": 2, "velocity": args.speed_kmh}
            stop = {"longlCmdType": 1, "brake": 1.0}
            car = client.step(5, commands={0: stop if is_stopping else drive}).ego
            speed = car["velocity"]["x"]
            for scan in scans.take():
                way = free_way(scan)
            if is_stopping and speed < 0.05:
                print(f"stopped {way:.1f} m before an obstacle")
                return 0
    print("nothing was in the way")
    return 0


if __name__ == "__main__":
    sys.exit(main())
