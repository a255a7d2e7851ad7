"""A stack of one file, as a student writes it for MORAI: pure pursuit, a PID, a brake for what is ahead.

    python planner.py PORT PATH SPEED_KMH            hears /Ego_topic and /Object_topic, publishes /ctrl_cmd, 30 Hz
    python planner.py PORT PATH SPEED_KMH --sync     the same in synchronous mode, a tick of 20 ms each time

It drives the path to its end and stops there. For another release of the simulator only `STEERING` changes.
"""

from __future__ import annotations

import argparse
import math
import sys
import threading
from pathlib import Path
from typing import Any

import roslibpy

STEERING = "steering"  # what CtrlCmd calls the front wheels

WHEELBASE = 2.7  # [m]
NOSE = 3.58  # from the rear axle to the front bumper [m]
PERIOD = 1 / 30  # between two commands in real time [s]
PATIENCE = 60.0  # with the simulator [s]
GAP = 3.0  # room that is left before whatever is ahead [m]
COMFORT = 2.0  # what the brake plans with [m/s^2]
LANE = 1.6  # how far beside the path an object is in the way [m]
SIGHT = 60.0  # how far ahead objects are looked at [m]

Point = tuple[float, float]


class Pid:
    """Speed error in, pedals out: above 0 the accelerator, below the brake."""

    def __init__(self, p: float = 0.6, i: float = 0.05, d: float = 0.01) -> None:
        self.p, self.i, self.d = p, i, d
        self.sum = self.before = 0.0

    def output(self, error: float, dt: float) -> float:
        self.sum = min(max(self.sum + error * dt, -4.0), 4.0)
        rate, self.before = (error - self.before) / dt, error
        return self.p * error + self.i * self.sum + self.d * rate


class Planner:
    """What the car shall do, from what is known of it and of the others."""

    def __init__(self, path: list[Point], speed_kmh: float) -> None:
        self.path, self.cruise = path, speed_kmh / 3.6
        self.pid = Pid()
        self.at = 0  # index of the nearest point of the path
        self.objects: list[dict[str, Any]] = []

    def see(self, objects: dict[str, Any]) -> None:
        """Take an ObjectStatusList."""
        self.objects = objects["npc_list"] + objects["pedestrian_list"] + objects["obstacle_list"]

    def command(self, ego: dict[str, Any], dt: float) -> dict[str, float]:
        """The CtrlCmd for an EgoVehicleStatus."""
        here = (ego["position"]["x"], ego["position"]["y"])
        speed = ego["velocity"]["x"]
        ahead = range(self.at, min(self.at + 40, len(self.path)))
        self.at = min(ahead, key=lambda i: math.dist(self.path[i], here))
        error = self.target(here) - speed
        pedal = self.pid.output(error, dt)
        if self.target(here) < 0.3 and speed < 1.0:
            pedal, self.pid.sum = -1.0, 0.0  # the last bit is stood on
        steer = self.steer(here, math.radians(ego["heading"]), speed)
        return {"longlCmdType": 1, "accel": max(pedal, 0.0), "brake": max(-pedal, 0.0), STEERING: steer}

    def target(self, here: Point) -> float:
        """The speed to drive at [m/s]: the wish, and what can still be braked before the end and whatever is ahead."""
        room = min(self.room_before_others(here), math.dist(self.path[self.at], self.path[-1]) - 0.5)
        return min(self.cruise, math.sqrt(2.0 * COMFORT * max(room, 0.0)))

    def room_before_others(self, here: Point) -> float:
        """How far the bumper may go on the path [m]."""
        room, way = math.inf, 0.0
        for i in range(self.at + 1, len(self.path)):
            way += math.dist(self.path[i - 1], self.path[i])
            if way > SIGHT:
                break
            for other in self.objects:
                place = (other["position"]["x"], other["position"]["y"])
                if math.dist(place, self.path[i]) < LANE and math.dist(place, here) > 1.0:
                    half = 0.5 * max(other["size"]["x"], other["size"]["y"])
                    room = min(room, way - NOSE - half - GAP)
        return room

    def steer(self, here: Point, yaw: float, speed: float) -> float:
        """Pure pursuit."""
        reach = max(3.0, 0.4 * speed)
        i = self.at
        while i < len(self.path) - 1 and math.dist(self.path[i], here) < reach:
            i += 1
        dx, dy = self.path[i][0] - here[0], self.path[i][1] - here[1]
        angle = math.atan2(dy, dx) - yaw
        return math.atan2(2.0 * WHEELBASE * math.sin(angle), math.hypot(dx, dy))

    def has_arrived(self, ego: dict[str, Any]) -> bool:
        """Whether it stands at the end."""
        place = (ego["position"]["x"], ego["position"]["y"])
        return math.dist(place, self.path[-1]) < 2.0 and abs(ego["velocity"]["x"]) < 0.05


def drive(ros: roslibpy.Ros, planner: Planner) -> None:
    """In real time, over topics."""
    has_arrived, latest = threading.Event(), threading.Event()
    ego: dict[str, Any] = {}

    def on_ego(status: dict[str, Any]) -> None:
        ego.update(status)
        latest.set()
        if planner.has_arrived(status):
            has_arrived.set()

    control = roslibpy.Topic(ros, "/ctrl_cmd", "morai_msgs/CtrlCmd")
    roslibpy.Topic(ros, "/Ego_topic", "morai_msgs/EgoVehicleStatus").subscribe(on_ego)
    roslibpy.Topic(ros, "/Object_topic", "morai_msgs/ObjectStatusList").subscribe(planner.see)
    control.advertise()
    assert latest.wait(PATIENCE)
    while not has_arrived.wait(PERIOD):
        control.publish(roslibpy.Message(planner.command(dict(ego), PERIOD)))


def drive_synchronously(ros: roslibpy.Ros, planner: Planner) -> None:
    """In synchronous mode: a command, a tick, and what the tick has brought."""

    def ask(service: str, **request: object) -> dict[str, Any]:
        call = roslibpy.Service(ros, service, "")
        answer: dict[str, Any] = call.call(roslibpy.ServiceRequest({"request": request}), timeout=PATIENCE)["response"]
        return answer

    roslibpy.Topic(ros, "/Object_topic", "morai_msgs/ObjectStatusList").subscribe(planner.see)
    frame = ask("/SyncModeCmd", user_id="planner", start_sync_mode=True, time_step=20)["frame"]
    ask("/SyncModeSetGear", gear=4, frame=frame + 1)
    ego = ask("/SyncModeWaitForTick", user_id="planner", frame=frame + 1)["vehicle_status"]
    while not planner.has_arrived(ego):
        frame += 1
        ask("/SyncModeCtrlCmd", frame=frame + 1, command=planner.command(ego, 0.02), sensor_capture=False)
        ego = ask("/SyncModeWaitForTick", user_id="planner", frame=frame + 1)["vehicle_status"]
    ask("/SyncModeCmd", user_id="planner", start_sync_mode=False, time_step=20)


def main() -> int:
    parser = argparse.ArgumentParser()
    parser.add_argument("port", type=int)
    parser.add_argument("path", type=Path)
    parser.add_argument("speed_kmh", type=float)
    parser.add_argument("--sync", action="store_true")
    args = parser.parse_args()
    points = [(float(x), float(y)) for x, y, *_ in (line.split() for line in args.path.read_text().splitlines())]
    ros = roslibpy.Ros("127.0.0.1", args.port)
    ros.run(timeout=PATIENCE)
    try:
        (drive_synchronously if args.sync else drive)(ros, Planner(points, args.speed_kmh))
    finally:
        ros.terminate()
    return 0


if __name__ == "__main__":
    sys.exit(main())
