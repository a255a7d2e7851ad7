#!/usr/bin/env python3
"""Overtake on a road with several lanes, and publish the plans: the page draws them.

    ./scripts/serve --scenario loop                    # in one terminal
    python scripts/examples/plan_lanes.py              # in another

Each 0.2 s the planner makes one candidate for each lane, and one between two lanes: a curve that begins where the car
is and ends in the middle of the lane. It predicts all vehicles at constant speed, and takes the candidate on which the
car drives longest before it would touch one. It publishes

    /plan/candidates   visualization_msgs/MarkerArray: all candidates, green where the way is free, red where it is not
    /plan/path         nav_msgs/Path: the chosen one

in the frame `map`. Any viewer of ROS shows them, too. The car follows the path by pure pursuit in synchronous mode.
It needs numpy and rosbridge_sim.
"""

from __future__ import annotations

import argparse
import math
import sys
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rosbridge_sim.client import Client

Points = NDArray[np.float64]

PERIOD = 0.2  # from plan to plan [s]
LEAST_LENGTH, CHANGE_TIME = 25.0, 3.5  # of a lane change [m, s]
HORIZON = 6.0  # of a plan [s]
BODY = 6.5  # two vehicles closer than this along the road ...
SIDE = 2.3  # ... and this across it touch [m]
SPARE = 2.0  # kept to other vehicles, along the road [m]
WHEELBASE = 2.7  # [m]


class Road:
    """The middle of a lane as far as it goes, and the lanes beside it.

    Attributes:
        points: of the middle, (n, 2), about 1 m apart [m].
        offsets: of the middles of the lanes, to the left [m].
        is_closed: the end leads to the beginning.
    """

    def __init__(self, lanes: list[dict[str, Any]], link: str) -> None:
        """Follow a lane, by the first successor each time.

        Args:
            lanes: of the map.
            link: the lane's name.
        """
        by_link = {lane["link"]: lane for lane in lanes}
        first, parts, seen = by_link[link], [], set()
        while link and link not in seen:
            seen.add(link)
            lane = by_link[link]
            parts.append(np.column_stack([lane["x"], lane["y"]]))
            link = lane["successors"][0] if lane["successors"] else ""
        line = np.concatenate([part[:-1] for part in parts] + [parts[-1][-1:]])
        self.is_closed = link == first["link"]
        along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))])
        self.length = float(along[-1])
        even = np.linspace(0.0, self.length, math.ceil(self.length) + 1)
        self.points = np.column_stack([np.interp(even, along, line[:, i]) for i in range(2)])
        way = np.gradient(self.points, axis=0)
        self._left = np.column_stack([-way[:, 1], way[:, 0]]) / np.hypot(*way.T)[:, None]
        self._step = self.length / (len(even) - 1)
        self.offsets = sorted([0.0, *self._beside(by_link, first, "left"), *self._beside(by_link, first, "right")])

    @staticmethod
    def _beside(by_link: dict[str, dict[str, Any]], lane: dict[str, Any], side: str) -> list[float]:
        """Return the offsets of the lanes on a side [m]."""
        found, offset = [], 0.0
        while lane[f"{side}_link"]:
            beside = by_link[lane[f"{side}_link"]]
            offset += 0.5 * (lane["width"] + beside["width"]) * (1.0 if side == "left" else -1.0)
            found.append(offset)
            lane = beside
        return found

    def place(self, s: Points, d: Points) -> Points:
        """Return places, (n, 2) [m].

        Args:
            s: (n,) along the lane [m].
            d: (n,) to its left [m].
        """
        at = np.asarray(s) / self._step
        at = at % (len(self.points) - 1) if self.is_closed else np.clip(at, 0, len(self.points) - 1)
        i = np.minimum(at.astype(int), len(self.points) - 2)
        part = (at - i)[:, None]
        middle = self.points[i] * (1.0 - part) + self.points[i + 1] * part
        places: Points = middle + np.asarray(d)[:, None] * self._left[i]
        return places

    def along(self, places: Points) -> tuple[Points, Points]:
        """Return where places are along the lane and to its left, (n,) each [m]."""
        away = places[:, None, :] - self.points[None, :, :]
        i = np.argmin((away**2).sum(axis=2), axis=1)
        return i * self._step, (away[np.arange(len(i)), i] * self._left[i]).sum(axis=1)

    def ahead(self, s: Points, start: float) -> Points:
        """Return distances from a place on, negative behind it [m]."""
        gap = np.asarray(s) - start
        return (gap + 0.5 * self.length) % self.length - 0.5 * self.length if self.is_closed else gap


@dataclass(frozen=True)
class Candidate:
    """One way that the car may take.

    Attributes:
        s, d: (n,) along the lane and to its left [m].
        begin: where it begins, along the lane and to its left [m].
        goal: offset at its end [m].
        free: time until it would touch a vehicle [s]; `HORIZON` if it touches none.
        speed: of the vehicle that it would touch [m/s]; infinite without one.
    """

    s: Points
    d: Points
    begin: tuple[float, float]
    goal: float
    free: float
    speed: float


@dataclass(frozen=True)
class Others:
    """The other vehicles: ahead of the car, to the left of the lane's middle [m], and their speeds [m/s], (n,) each."""

    ahead: Points
    d: Points
    speed: Points


def candidate(
    s: float, begin: tuple[float, float], goal: float, *, speed: float, road: Road, others: Others
) -> Candidate:
    """Return the way to an offset: d(x) = d + (goal - d) (10 x^3 - 15 x^4 + 6 x^5), without a jump of the curvature.

    Args:
        s: of the car [m].
        begin: the car's own place, or where this change began: a plan that began anew each time would forget its error.
        goal: offset at the end [m].
        speed: of the car [m/s].
        others: the other vehicles.
    """
    change = max(LEAST_LENGTH, CHANGE_TIME * speed)
    ahead = np.arange(0.0, change + HORIZON * speed * 0.5, 2.0)
    x = np.clip((ahead + road.ahead(np.array([s]), begin[0])) / change, 0.0, 1.0)
    way = begin[1] + (goal - begin[1]) * x**3 * (10.0 - 15.0 * x + 6.0 * x * x)
    times = np.arange(0.0, HORIZON, 0.2)
    own = np.interp(speed * times, ahead, way)
    gap = others.ahead[:, None] + (others.speed[:, None] - speed) * times
    touches = (np.abs(gap) < BODY + SPARE) & (np.abs(others.d[:, None] - own) < SIDE)
    first = np.where(touches.any(axis=1), times[touches.argmax(axis=1)], np.inf) if len(gap) else np.array([np.inf])
    nearest = int(np.argmin(first))
    lead = float(others.speed[nearest]) if np.isfinite(first[nearest]) else math.inf
    return Candidate(s + ahead, way, begin, goal, float(min(first[nearest], HORIZON)), lead)


def choose(candidates: list[Candidate], before: float) -> Candidate:
    """Return the best one: the longest free time. A change of the plan must gain 0.5 s, and 0.05 s for each metre.

    Args:
        candidates: to choose from; only those that end in a lane.
        before: goal of the last plan [m].
    """
    return max(candidates, key=lambda one: one.free - 0.5 * (one.goal != before) - 0.05 * abs(one.goal - before))


def steering(points: Points, x: float, y: float, yaw: float, speed: float) -> float:
    """Return the angle of the wheels towards a point of the path, left positive [rad]."""
    reach = 4.0 + 0.5 * speed
    away = points - (x, y)
    aim = away[int(np.argmax(np.hypot(*away.T) >= reach))]
    left = -math.sin(yaw) * aim[0] + math.cos(yaw) * aim[1]
    return math.atan(2.0 * WHEELBASE * left / float(aim @ aim))


def marker(number: int, header: dict[str, Any], points: Points, free: float) -> dict[str, Any]:
    """Return a candidate as a line, from red to green."""
    green = free / HORIZON
    return {
        "header": header,
        "ns": "candidates",
        "id": number,
        "type": 4,  # LINE_STRIP
        "action": 0,
        "pose": {"orientation": {"w": 1.0}},
        "scale": {"x": 0.2},
        "color": {"r": 0.85 * (1.0 - green) + 0.05, "g": 0.65 * green, "b": 0.1, "a": 0.9},
        "points": [{"x": x, "y": y, "z": 0.1} for x, y in points.round(3).tolist()],
        "lifetime": {"secs": 1, "nsecs": 0},
    }


def path(header: dict[str, Any], points: Points) -> dict[str, Any]:
    """Return the chosen way."""
    yaws = np.arctan2(*np.gradient(points, axis=0).T[::-1])
    poses = [
        {
            "header": header,
            "pose": {
                "position": {"x": x, "y": y, "z": 0.1},
                "orientation": {"z": math.sin(a / 2), "w": math.cos(a / 2)},
            },
        }
        for (x, y), a in zip(points.round(3).tolist(), yaws.tolist(), strict=True)
    ]
    return {"header": header, "poses": poses}


def others_of(scene: dict[str, Any], own: int, road: Road, start: float) -> Others:
    """Return the vehicles of a message of `/sim/scene/state` but the car itself."""
    is_other = np.arange(len(scene["id"])) != own
    places = np.column_stack([scene["x"], scene["y"]])[is_other]
    s, d = road.along(places) if len(places) else (np.zeros(0), np.zeros(0))
    return Others(road.ahead(s, start), d, np.array(scene["speed"])[is_other])


def step(client: Client, frames: int, commands: dict[int, dict[str, float]]) -> dict[str, Any]:
    """Move the world, and return the message of `/sim/scene/state`."""
    scene = client.step(frames, commands=commands, topics=["/sim/scene/state"]).topics["/sim/scene/state"]
    if scene is None:
        sys.exit("plan_lanes: expected /sim/scene/state; got nothing: a server of rosbridge-sim publishes it")
    return scene


def main() -> int:
    """Drive for a time."""
    parser = argparse.ArgumentParser(description="Overtake on a road with several lanes, and publish the plans.")
    parser.add_argument("--url", default="ws://127.0.0.1:9090")
    parser.add_argument("--speed-kmh", type=float, default=100.0, help="wanted speed [km/h] (%(default)s)")
    parser.add_argument("--seconds", type=float, default=90.0, help="length of the drive, simulated (%(default)s)")
    args = parser.parse_args()
    wanted = args.speed_kmh / 3.6
    with Client(args.url, timeout=60.0) as client:
        client.start_sync()
        scene = step(client, 1, {})
        car = scene["id"].index(min(scene["id"]))  # egos have the lowest numbers
        nearest = client.nearest_lane(scene["x"][car], scene["y"][car])
        road = Road(client.map()["lanes"], nearest["link"])
        goal, begin, changes = 0.0, (0.0, 0.0), 0
        command = {"longlCmdType": 2, "velocity": 0.0, "steering": 0.0}
        for _ in range(round(args.seconds / PERIOD)):
            scene = step(client, round(PERIOD / 0.02), {0: command})
            x, y, yaw, speed = (scene[name][car] for name in ("x", "y", "heading", "speed"))
            (s,), (d,) = road.along(np.array([[x, y]]))
            others = others_of(scene, car, road, s)
            middles = [(a + b) / 2.0 for a, b in pairwise(road.offsets)]
            every = [
                candidate(
                    s, begin if goal == offset else (s, d), offset, speed=max(speed, 5.0), road=road, others=others
                )
                for offset in (*road.offsets, *middles)
            ]
            best = choose(every[: len(road.offsets)], goal)
            changes += best.goal != goal
            goal, begin = best.goal, best.begin
            header = {"stamp": scene["header"]["stamp"], "frame_id": "map"}
            marks = [marker(i, header, road.place(one.s, one.d), one.free) for i, one in enumerate(every)]
            chosen = road.place(best.s, best.d)
            client.publish("/plan/candidates", {"markers": marks}, "visualization_msgs/MarkerArray")
            client.publish("/plan/path", path(header, chosen), "nav_msgs/Path")
            target = wanted if best.free >= HORIZON else min(wanted, best.speed)
            command = {"longlCmdType": 2, "velocity": 3.6 * target, "steering": steering(chosen, x, y, yaw, speed)}
        print(f"drove {args.seconds:.0f} s, {changes} lane changes, now at {3.6 * speed:.0f} km/h")
    return 0


if __name__ == "__main__":
    sys.exit(main())
