#!/usr/bin/env python3
"""Drive the car along a path in synchronous mode, and print the largest error.

    ./scripts/serve                                                                      # in one terminal
    python scripts/examples/drive_sync.py --path scripts/examples/course.txt --from-car  # in another

In synchronous mode the world stands still until its master asks for a tick. So each round of the loop is

    1. SyncModeCtrlCmd       command for the car from the next frame on
    2. SyncModeWaitForTick   compute one time step; the answer has the car's new position

and the drive is the same on a slow machine as on a fast one. The car steers by pure pursuit: it chooses the point
of the path a few metres ahead, and drives on the circle that leads there. The reference point of a vehicle is the
middle of its rear axle: the position in its status, pure pursuit and the error all use this point.

A path file holds one point a line, `x y z` in metres, separated by blanks or tabs; text after a `#` is ignored.
Points are in the map's frame; with `--from-car` they are relative to the car, x ahead of it and y to its left.

It needs roslibpy only. Exit codes: 0 success; 1 refused, server lost or roslibpy missing; 2 a mistake in an argument;
130 interrupted. At the end the car brakes and synchronous mode is turned off, in all cases, if the server can still be
reached.
"""

from __future__ import annotations

import argparse
import math
import sys
import time
from bisect import bisect_right
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any, Self

try:
    import roslibpy
except ModuleNotFoundError:
    sys.exit("drive_sync: needs roslibpy; install it: python -m pip install roslibpy")

DRIVE = 4  # a gear, as SyncModeSetGear counts them: 1 P, 2 R, 3 N, 4 D
PEDALS, SPEED = 1, 2  # longlCmdType: the fields of a CtrlCmd that are used

TIMEOUT = 5.0  # longest wait for an answer [s]
LOOK_AHEAD = 2.0  # smallest distance to the point that the car aims at [m] ...
LOOK_AHEAD_TIME = 0.2  # ... and its growth with speed [s]: longer is smoother, shorter cuts corners less
FAR_FROM_PATH = 10.0  # a car further away than this does not start [m]
STUCK_AFTER = 5.0  # simulated time in which the car must have moved after a command to drive [s]


class DriveError(Exception):
    """The drive cannot go on; the text gives the reason."""


# The path


@dataclass(frozen=True)
class Pose:
    """Pose of the car: middle of its rear axle [m], heading [rad, counter-clockwise from east]."""

    x: float
    y: float
    yaw: float

    def to_map(self, ahead: float, left: float) -> tuple[float, float]:
        """Return a point given relative to the pose, in the map.

        Args:
            ahead: distance ahead of the pose [m].
            left: distance to its left [m].

        Returns:
            x, y in the map [m].
        """
        sin, cos = math.sin(self.yaw), math.cos(self.yaw)
        return self.x + ahead * cos - left * sin, self.y + ahead * sin + left * cos


class Track:
    """A path of straight pieces, with the position that was reached on it.

    Attributes:
        length: of the whole path [m].
        reached: distance of the car along the path [m].
        error: distance of the car from the path [m]; None before the path's start.
    """

    def __init__(self, points: list[tuple[float, float]]) -> None:
        """Begin at the start of the path; successive equal points count as one."""
        self._points = points[:1] + [b for a, b in pairwise(points) if math.dist(a, b) > 1e-6]
        if len(self._points) < 2:
            raise DriveError("the points of the path are all the same")
        self._starts = [0.0]  # distance of each point along the path
        for a, b in pairwise(self._points):
            self._starts.append(self._starts[-1] + math.dist(a, b))
        self.length = self._starts[-1]
        self.reached = 0.0
        self.error: float | None = None

    def follow(self, x: float, y: float) -> bool:
        """Note the car's position.

        Only the next few metres are searched, so a path may cross itself or come back.

        Args:
            x: of the car in the map [m].
            y: of the car in the map [m].

        Returns:
            True until the car has passed the end.
        """
        nearest, place, is_before, is_past = math.inf, 0.0, False, False
        first = self._piece_at(self.reached - 5.0)
        last = self._piece_at(self.reached + 10.0)
        for i in range(first, last + 1):
            (ax, ay), (bx, by) = self._points[i], self._points[i + 1]
            length = self._starts[i + 1] - self._starts[i]
            along = ((x - ax) * (bx - ax) + (y - ay) * (by - ay)) / length  # of the foot point, from a [m]
            held = min(max(along, 0.0), length)
            gap = math.hypot(ax + (bx - ax) * held / length - x, ay + (by - ay) * held / length - y)
            if gap < nearest:
                nearest, place = gap, self._starts[i] + held
                is_before = i == 0 and along < 0.0
                is_past = i == len(self._points) - 2 and along > length
        self.reached = place
        self.error = None if is_before or is_past else nearest
        return not is_past

    def point(self, distance: float) -> tuple[float, float]:
        """Return a point of the path; before its start and beyond its end the path is extended straight on.

        Args:
            distance: along the path [m].

        Returns:
            x, y in the map [m].
        """
        i = self._piece_at(distance)
        (ax, ay), (bx, by) = self._points[i], self._points[i + 1]
        part = (distance - self._starts[i]) / (self._starts[i + 1] - self._starts[i])
        return ax + (bx - ax) * part, ay + (by - ay) * part

    def _piece_at(self, distance: float) -> int:
        """Return the index of the straight piece at a distance along the path."""
        return min(max(bisect_right(self._starts, distance) - 1, 0), len(self._points) - 2)


def read_points(file: Path) -> list[tuple[float, float]]:
    """Read a path file; heights are ignored, because the road gives the height.

    Returns:
        x, y of each point [m].

    Raises:
        DriveError: a line is not a point, or there are fewer than two points.
    """
    points = []
    for number, line in enumerate(file.read_text().splitlines(), 1):
        words = line.partition("#")[0].replace(",", " ").split()
        if not words:
            continue
        try:
            x, y = float(words[0]), float(words[1])
        except (ValueError, IndexError):
            raise DriveError(f"{file}:{number}: expected `x y z`, got {line.strip()!r}") from None
        points.append((x, y))
    if len(points) < 2:
        raise DriveError(f"{file}: expected a path of two points at least, got {len(points)}")
    return points


def steer_towards(goal: tuple[float, float], pose: Pose, wheelbase: float) -> float:
    """Return the front wheel angle for the circle from a pose to a goal (pure pursuit).

    The circle is tangent to the heading at the rear axle. Through a point at distance d, seen at angle a from the
    heading, its curvature is 2 sin(a) / d. A car with this wheelbase drives curvature k with its wheels at
    atan(wheelbase * k).

    Args:
        goal: x, y in the map [m].
        pose: of the car.
        wheelbase: [m].

    Returns:
        The angle, left positive [rad].
    """
    dx, dy = goal[0] - pose.x, goal[1] - pose.y
    distance = math.hypot(dx, dy)
    angle = math.atan2(dy, dx) - pose.yaw
    return math.atan(wheelbase * 2.0 * math.sin(angle) / distance)


# The simulator


class SyncMode:
    """Synchronous mode with this program as its master: on inside a `with` block, off after it in all cases.

    Attributes:
        frame: the simulator's frame after the last tick.
        step: simulated time of one tick [s].
        pose, speed: of the car after the last tick; [m/s].
    """

    def __init__(self, ros: roslibpy.Ros, user_id: str, step_ms: int) -> None:
        """Prepare; nothing is sent yet."""
        self._ros = ros
        self._user_id = user_id
        self._step_ms = step_ms
        self.step = step_ms / 1000.0
        self.frame = 0
        self.pose = Pose(0.0, 0.0, 0.0)
        self.speed = 0.0

    def ask(self, service: str, **request: object) -> dict[str, Any]:
        """Call a service of the simulator; every one wraps one message, named `request` and `response`.

        Args:
            request: fields of the request.

        Returns:
            Fields of the response.

        Raises:
            DriveError: the connection is lost.
        """
        if not self._ros.is_connected:
            raise DriveError("the connection to the server is lost")
        call = roslibpy.Service(self._ros, service, "")  # the server knows the type
        values = call.call(roslibpy.ServiceRequest({"request": request}), timeout=TIMEOUT)
        response: dict[str, Any] = values["response"]
        return response

    def __enter__(self) -> Self:
        """Become the master."""
        answer = self.ask("/SyncModeCmd", user_id=self._user_id, start_sync_mode=True, time_step=self._step_ms)
        if not answer["result"]:  # the answer then has the current master's id, if there is one
            master = answer["user_id"]
            why = f"{master!r} is its master" if master else f"a tick of {self._step_ms} ms is not possible"
            raise DriveError(f"synchronous mode was refused: {why}")
        self._user_id = answer["user_id"]  # chosen by the simulator if ours was empty
        self.frame = answer["frame"]
        return self

    def __exit__(self, *_: object) -> None:
        """Brake the car and return to real time."""
        try:
            self.command(longlCmdType=PEDALS, brake=1.0)
            self.tick()
        except (DriveError, roslibpy.core.RosTimeoutError):
            pass  # paused, or lost; the mode must still be ended
        finally:
            self.ask("/SyncModeCmd", user_id=self._user_id, start_sync_mode=False, time_step=self._step_ms)

    def command(self, **command: float) -> None:
        """Command the car from the next frame on.

        Args:
            command: fields of a CtrlCmd.

        Raises:
            DriveError: the command was refused.
        """
        answer = self.ask("/SyncModeCtrlCmd", frame=self.frame + 1, command=command, sensor_capture=False)
        if not answer["result"]:
            raise DriveError("a command was refused: synchronous mode is off")

    def shift(self, gear: int) -> None:
        """Change gear at the next frame; the car must stand still.

        Args:
            gear: 1 P, 2 R, 3 N, 4 D.
        """
        self.ask("/SyncModeSetGear", gear=gear, frame=self.frame + 1)

    def tick(self) -> None:
        """Move the world by one time step, and read the car's new pose and speed.

        Raises:
            DriveError: the tick was refused.
        """
        answer = self.ask("/SyncModeWaitForTick", user_id=self._user_id, frame=self.frame + 1)
        if not answer["tick_status"]:
            why = "the simulation is paused" if answer["pause_status"] else "we are no longer the master"
            raise DriveError(f"a tick was refused: {why}")
        self.frame = answer["frame"]
        car = answer["vehicle_status"]
        self.pose = Pose(car["position"]["x"], car["position"]["y"], math.radians(car["heading"]))
        self.speed = car["velocity"]["x"]  # in the car's own frame: x is forward


def drive(sync: SyncMode, points: list[tuple[float, float]], speed_kmh: float, *, is_from_car: bool) -> None:
    """Drive along a path to its end, stop there, and print a report.

    Args:
        sync: synchronous mode, on.
        points: of the path [m].
        speed_kmh: [km/h].
        is_from_car: the points are relative to the car.

    Raises:
        DriveError: the path is too far away, or the car does not move.
    """
    wheelbase = sync.ask("/Service_MoraiVehicleSpec", unique_id=0)["wheel_base"]
    sync.shift(DRIVE)
    sync.tick()  # gives the position of the car
    track = Track([sync.pose.to_map(*point) for point in points] if is_from_car else points)
    gap = math.dist(track.point(0.0), (sync.pose.x, sync.pose.y))
    if gap > FAR_FROM_PATH:
        raise DriveError(f"the path starts {gap:.0f} m away from the car; --from-car starts it at the car")
    print(f"path of {track.length:.1f} m from ({sync.pose.x:.1f}, {sync.pose.y:.1f}), frame {sync.frame}", flush=True)

    began = time.perf_counter()
    cruise = 0.98 * speed_kmh / 3.6
    num_ticks, largest, slowest, still_since = 0, 0.0, math.inf, 0
    next_report = 100.0
    while track.follow(sync.pose.x, sync.pose.y):
        goal = track.point(track.reached + LOOK_AHEAD + LOOK_AHEAD_TIME * max(sync.speed, 0.0))
        steering = steer_towards(goal, sync.pose, wheelbase)
        sync.command(longlCmdType=SPEED, velocity=speed_kmh, steering=steering)
        sync.tick()
        num_ticks += 1

        largest = max(largest, track.error or 0.0)
        if sync.speed >= cruise or slowest < math.inf:  # the run-up is over
            slowest = min(slowest, sync.speed)
        if abs(sync.speed) > 0.1:
            still_since = num_ticks
        elif (num_ticks - still_since) * sync.step > STUCK_AFTER:
            raise DriveError("the car does not move; is it under external control (/Service_MoraiEventCmd)?")
        if track.reached >= next_report:
            print(
                f"{track.reached:6.0f} m  {sync.speed * 3.6:5.1f} km/h  largest error so far {largest:.3f} m",
                flush=True,
            )
            next_report += 100.0
    took = time.perf_counter() - began

    while sync.speed > 0.1:
        sync.command(longlCmdType=PEDALS, brake=1.0)
        sync.tick()
    simulated = num_ticks * sync.step
    print(f"drove {track.length:.1f} m in {num_ticks} ticks: {simulated:.1f} s simulated, {took:.1f} s by the clock")
    if slowest < math.inf:
        print(f"slowest after the run-up: {slowest * 3.6:.2f} km/h")
    print(f"largest lateral error: {largest:.4f} m")


def main() -> int:
    """Read the command line and drive; an error is one line."""
    parser = argparse.ArgumentParser(description="Drive along a path in synchronous mode.")
    parser.add_argument("--host", default="127.0.0.1")
    parser.add_argument("--port", type=int, default=9090)
    parser.add_argument("--path", type=Path, required=True, help="a file of `x y z` lines [m], in the map's frame")
    parser.add_argument("--from-car", action="store_true", help="the path is relative to where the car stands")
    parser.add_argument("--speed-kmh", type=float, default=32.0, help="target speed [km/h] (%(default)s)")
    parser.add_argument("--step-ms", type=int, default=20, help="one tick [ms], a multiple of 20 (%(default)s)")
    parser.add_argument("--user-id", default="drive_sync", help="name of this program as the master (%(default)s)")
    args = parser.parse_args()

    try:
        points = read_points(args.path)
    except (OSError, UnicodeDecodeError, DriveError) as error:
        print(f"drive_sync: {error}", file=sys.stderr)
        return 2

    ros = roslibpy.Ros(args.host, args.port)
    try:
        ros.run(timeout=TIMEOUT)
        with SyncMode(ros, args.user_id, args.step_ms) as sync:
            drive(sync, points, args.speed_kmh, is_from_car=args.from_car)
    except KeyboardInterrupt:
        print("drive_sync: interrupted; synchronous mode is off", file=sys.stderr)
        return 130
    except DriveError as error:
        print(f"drive_sync: {error}", file=sys.stderr)
    except roslibpy.core.RosTimeoutError:
        print(f"drive_sync: no answer from {args.host}:{args.port}; is the server running?", file=sys.stderr)
    except roslibpy.core.ServiceException as error:  # `result: false`, with the server's text
        print(f"drive_sync: a call was refused: {error}", file=sys.stderr)
    else:
        return 0
    finally:
        ros.terminate()
    return 1


if __name__ == "__main__":
    sys.exit(main())
