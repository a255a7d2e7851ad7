"""A driver for campaigns: `follow.py:drive` keeps to its lane at 25 m/s, and brakes for what is ahead."""

from __future__ import annotations

from rosbridge_sim.campaign_runs.observation import Observation

WISH = 25.0
"""Speed that it wants [m/s]."""


def drive(seen: Observation) -> dict[str, float]:
    """Return steering [rad] and acceleration [m/s^2]."""
    lane = seen.lane()
    speed = seen.ego["speed"]
    accel = min(max(0.5 * (WISH - speed), -3.0), 1.5)
    for _, forward, left, closing, *_ in seen.others(4):
        gap = forward - 5.0
        if gap > 0.0 and abs(left) < 1.8 and gap < 10.0 - 3.0 * min(closing, 0.0):
            accel = min(accel, -8.0 if gap < 2.0 - 2.0 * min(closing, 0.0) else -3.0)
    return {"steering": -0.02 * lane["offset"] - 0.3 * lane["heading"], "accel": accel}
