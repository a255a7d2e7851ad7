#!/usr/bin/env python3
"""Overtake with a lattice planner in rospy, in synchronous mode: a node of ROS 1, and no rosbridge between.

    roscore
    rosbridge-sim serve --ros1-master http://localhost:11311 --scenario motorway    # in a second terminal
    python3 scripts/examples/plan_ros1.py                                           # in a third one

The planner follows a path: straight ahead from the car, or points of a file (`--path`, a point a line: `x y z` in
metres). Each 0.2 s it compares the lanes beside the path: how long could the car drive there, before it would touch
one of the objects in `/Object_topic`? It changes to the lane with the longest time, and steers by pure pursuit. Its
plan is on `/plan/path` (nav_msgs/Path, in the frame `map`).

The world stands still until the planner asks for a tick, so the drive is the same on a slow machine. It needs rospy,
nav_msgs, and `morai_msgs` in a catkin workspace. It runs with Python 3.8 of ROS Noetic, too.
"""

from __future__ import annotations

import argparse
import math
import sys
from bisect import bisect_right
from pathlib import Path as File
from typing import NamedTuple

import rospy
from geometry_msgs.msg import PoseStamped
from morai_msgs.msg import CtrlCmd, EgoVehicleStatus, ObjectStatusList, SyncModeCmd, SyncModeCtrlCmd, WaitForTick
from morai_msgs.srv import MoraiSyncModeCmdSrv, MoraiSyncModeCtrlCmdSrv, MoraiWaitForTickSrv
from nav_msgs.msg import Path

STEP_MS = 20  # simulated time of a tick
TICKS_PER_PLAN = 10
LEAST_LENGTH, CHANGE_TIME = 25.0, 3.5  # of a lane change [m, s]
HORIZON = 6.0  # of a plan [s]
BODY, SIDE = 8.5, 2.3  # two vehicles closer than this along the road and across it touch, with some space [m]
WHEELBASE = 2.7  # [m]
SIGHT = 250.0  # objects further away are left out [m]


class Thing(NamedTuple):
    """An object: ahead of the car along the path, to the left of the path [m], and its speed [m/s]."""

    ahead: float
    left: float
    speed: float


class Plan(NamedTuple):
    """A way: it begins at a place along the path and at an offset to its left, and ends at another offset [m]."""

    begin: float
    start: float
    goal: float
    length: float

    def offset(self, s: float) -> float:
        """Return the offset to the left at a place along the path [m]."""
        x = min(max((s - self.begin) / self.length, 0.0), 1.0)
        return self.start + (self.goal - self.start) * (10.0 * x**3 - 15.0 * x**4 + 6.0 * x**5)


class Course:
    """A path of straight pieces; places on it are distances from its start [m]."""

    def __init__(self, points: list[tuple[float, float]]) -> None:
        """Take the points, x and y [m]."""
        self._points = points
        self._starts = [0.0]
        for i in range(len(points) - 1):
            self._starts.append(self._starts[-1] + math.dist(points[i], points[i + 1]))

    def find(self, x: float, y: float, begin: float, end: float) -> tuple[float, float]:
        """Return the place along the path, and the offset to its left, of a point [m].

        Args:
            x: of the point [m].
            y: of the point [m].
            begin: first place that is looked at: a path may cross itself [m].
            end: the last one [m].
        """
        best = (math.inf, 0.0, 0.0)
        first, last = (bisect_right(self._starts, one) for one in (begin, end))
        for i in range(max(first - 1, 0), min(last, len(self._points) - 1)):
            (ax, ay), (ux, uy) = self._points[i], self._way(i)
            along = (x - ax) * ux + (y - ay) * uy
            held = min(max(along, 0.0), self._starts[i + 1] - self._starts[i])
            gap = math.hypot(x - ax - held * ux, y - ay - held * uy)
            best = min(best, (gap, self._starts[i] + held, ux * (y - ay) - uy * (x - ax)))
        return best[1:]

    def place(self, s: float, left: float) -> tuple[float, float]:
        """Return the point at a place along the path and to its left, x and y [m]."""
        i = min(max(bisect_right(self._starts, s) - 1, 0), len(self._points) - 2)
        (ax, ay), (ux, uy) = self._points[i], self._way(i)
        return ax + (s - self._starts[i]) * ux - left * uy, ay + (s - self._starts[i]) * uy + left * ux

    def _way(self, i: int) -> tuple[float, float]:
        """Return the direction of a piece."""
        (ax, ay), (bx, by) = self._points[i], self._points[i + 1]
        length = self._starts[i + 1] - self._starts[i]
        return (bx - ax) / length, (by - ay) / length


def free_time(speed: float, left: float, goal: float, things: list[Thing]) -> tuple[float, float]:
    """Return the time until the car would touch something on its way to an offset [s], and the speed of that [m/s].

    Args:
        speed: of the car [m/s].
        left: its offset now [m].
        goal: its offset at the end [m].
        things: all objects, which keep their speed and their offset.
    """
    low, high = sorted((left, goal))
    found = (HORIZON, math.inf)
    for one in things:
        gap, closing = abs(one.ahead) - BODY, math.copysign(1.0, one.ahead) * (speed - one.speed)
        if low - SIDE < one.left < high + SIDE and closing > 0.0:
            time = max(gap / closing, 0.0)
            if abs(one.left - goal) < SIDE or time < CHANGE_TIME:  # later the car has left its lane
                found = min(found, (time, one.speed))
    return found


class Planner:
    """The node: it is the master of synchronous mode while it drives."""

    def __init__(self, offsets: list[float], wanted: float) -> None:
        """Become a node, and wait for the simulator.

        Args:
            offsets: of the lanes, to the left of the path [m].
            wanted: speed [m/s].
        """
        rospy.init_node("planner")
        self._offsets = offsets
        self._wanted = wanted
        self._objects = ObjectStatusList()
        self._path = rospy.Publisher("/plan/path", Path, queue_size=1)
        rospy.Subscriber("/Object_topic", ObjectStatusList, self._note_objects)
        self._mode = rospy.ServiceProxy("/SyncModeCmd", MoraiSyncModeCmdSrv)
        self._control = rospy.ServiceProxy("/SyncModeCtrlCmd", MoraiSyncModeCtrlCmdSrv, persistent=True)
        self._tick = rospy.ServiceProxy("/SyncModeWaitForTick", MoraiWaitForTickSrv, persistent=True)
        self._mode.wait_for_service(30)
        self._user, self._frame = "planner", 0
        self.num_changes = 0

    def _note_objects(self, message: ObjectStatusList) -> None:
        self._objects = message

    def switch(self, *, is_on: bool) -> None:
        """Begin or end synchronous mode."""
        answer = self._mode(SyncModeCmd(self._user, is_on, STEP_MS)).response
        if not answer.result:
            sys.exit(f"plan_ros1: synchronous mode was refused; its master is {answer.user_id!r}")
        self._user, self._frame = answer.user_id, answer.frame

    def step(self, command: CtrlCmd) -> EgoVehicleStatus:
        """Move the world by a tick, and return the car."""
        self._control(SyncModeCtrlCmd(frame=self._frame + 1, command=command))
        answer = self._tick(WaitForTick(self._user, self._frame + 1)).response
        if not answer.tick_status:
            sys.exit("plan_ros1: a tick was refused: the simulation is paused, or another program is the master")
        self._frame = answer.frame
        return answer.vehicle_status

    def drive(self, seconds: float, points: list[tuple[float, float]]) -> float:
        """Drive for a time, and return the last speed [m/s].

        Args:
            points: of the path [m]; without any it goes straight ahead.
        """
        car = self.step(CtrlCmd(longlCmdType=1, brake=1.0))
        x, y, yaw = car.position.x, car.position.y, math.radians(car.heading)
        course = Course(points or [(x, y), (x + 5e3 * math.cos(yaw), y + 5e3 * math.sin(yaw))])
        s, left = course.find(x, y, 0.0, math.inf)
        plan, target = Plan(s, left, min(self._offsets, key=lambda lane: abs(lane - left)), LEAST_LENGTH), self._wanted
        for i in range(int(seconds * 1000 / STEP_MS)):
            s, left = course.find(car.position.x, car.position.y, s - 5.0, s + 20.0)
            if i % TICKS_PER_PLAN == 0:
                plan, target = self._choose(course, plan, (s, left), car.velocity.x)
                self._publish(course, plan, s)
            angle = self._steering(course, plan, s, car)
            car = self.step(CtrlCmd(longlCmdType=2, velocity=3.6 * target, steering=angle))
        return float(car.velocity.x)

    def _choose(self, course: Course, plan: Plan, here: tuple[float, float], speed: float) -> tuple[Plan, float]:
        """Return the best plan and the speed for it [m/s]. A change must gain 0.5 s, and 0.05 s for each metre."""
        s, left = here
        things = []
        for one in (*self._objects.npc_list, *self._objects.obstacle_list, *self._objects.pedestrian_list):
            if math.dist((one.position.x, one.position.y), course.place(s, left)) < SIGHT:
                place, offset = course.find(one.position.x, one.position.y, s - SIGHT, s + SIGHT)
                things.append(Thing(place - s, offset, one.velocity.x / 3.6))  # of objects in km/h
        free = {goal: free_time(speed, left, goal, things) for goal in self._offsets}
        best = max(
            self._offsets,
            key=lambda goal: free[goal][0] - 0.5 * (goal != plan.goal) - 0.05 * abs(goal - plan.goal),
        )
        time, lead = free[best]
        target = self._wanted if time >= HORIZON else min(self._wanted, lead)
        if best == plan.goal:
            return plan, target
        self.num_changes += 1
        return Plan(s, left, best, max(LEAST_LENGTH, CHANGE_TIME * speed)), target

    @staticmethod
    def _steering(course: Course, plan: Plan, s: float, car: EgoVehicleStatus) -> float:
        """Return the angle of the wheels towards a point of the plan, left positive [rad]."""
        ahead = s + 4.0 + 0.5 * car.velocity.x
        x, y = course.place(ahead, plan.offset(ahead))
        dx, dy = x - car.position.x, y - car.position.y
        bearing = math.atan2(dy, dx) - math.radians(car.heading)
        return math.atan(2.0 * WHEELBASE * math.sin(bearing) / math.hypot(dx, dy))

    def _publish(self, course: Course, plan: Plan, s: float) -> None:
        message = Path()
        message.header.frame_id, message.header.stamp = "map", self._objects.header.stamp
        for i in range(40):
            pose = PoseStamped(header=message.header)
            pose.pose.position.x, pose.pose.position.y = course.place(s + 2.0 * i, plan.offset(s + 2.0 * i))
            pose.pose.orientation.w = 1.0
            message.poses.append(pose)
        self._path.publish(message)


def read_points(file: File) -> list[tuple[float, float]]:
    """Return the points of a file, x and y [m]."""
    lines = [line.partition("#")[0].split() for line in file.read_text().splitlines()]
    return [(float(words[0]), float(words[1])) for words in lines if words]


def main() -> None:
    """Drive for a time."""
    parser = argparse.ArgumentParser(description="Overtake with a lattice planner in rospy, in synchronous mode.")
    parser.add_argument("--path", type=File, help="file with the points of a path (straight ahead of the car)")
    parser.add_argument("--lanes", type=float, nargs="+", default=[0.0, 3.5, 7.0], metavar="M", help="offsets of lanes")
    parser.add_argument("--speed-kmh", type=float, default=130.0, help="wanted speed [km/h] (%(default)s)")
    parser.add_argument("--seconds", type=float, default=30.0, help="length of the drive, simulated (%(default)s)")
    arguments = parser.parse_args(rospy.myargv()[1:])
    points = read_points(arguments.path) if arguments.path else []
    planner = Planner(arguments.lanes, arguments.speed_kmh / 3.6)
    planner.switch(is_on=True)
    try:
        speed = planner.drive(arguments.seconds, points)
    finally:
        planner.switch(is_on=False)
    print(f"drove {arguments.seconds:.0f} s, {planner.num_changes} lane changes, now at {3.6 * speed:.0f} km/h")


if __name__ == "__main__":
    main()
