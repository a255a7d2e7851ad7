"""The driver of `follow.py` as a program: `command = ["{python}", "program.py", "{url}"]` in the file of a campaign."""

from __future__ import annotations

import math
import sys

from rosbridge_sim.client import Client

WISH = 25.0
"""Speed that it wants [m/s]."""


def main() -> None:
    """Drive until the campaign ends the run."""
    with Client(sys.argv[1]) as client:
        client.start_sync(step_ms=100)
        accel = 0.0
        while True:
            command = {"longlCmdType": 3, "acceleration": accel}
            seen = client.step(1, commands={0: command}, topics=["/Ego_topic", "/Object_topic"]).topics
            ego, others = seen["/Ego_topic"] or {}, (seen["/Object_topic"] or {}).get("npc_list", [])
            speed = float(ego["velocity"]["x"])
            accel = min(max(0.5 * (WISH - speed), -3.0), 1.5)
            yaw = math.radians(ego["heading"])
            for other in others:
                east = other["position"]["x"] - ego["position"]["x"]
                north = other["position"]["y"] - ego["position"]["y"]
                gap = east * math.cos(yaw) + north * math.sin(yaw) - 5.0
                left = north * math.cos(yaw) - east * math.sin(yaw)
                closing = other["velocity"]["x"] / 3.6 - speed  # told in km/h
                if gap > 0.0 and abs(left) < 1.8 and gap < 10.0 - 3.0 * min(closing, 0.0):
                    accel = min(accel, -8.0 if gap < 2.0 - 2.0 * min(closing, 0.0) else -3.0)


if __name__ == "__main__":
    main()
