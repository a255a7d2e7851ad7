"""Standard messages of ROS beside MORAI's, so that a node without `morai_msgs` can drive an ego.

    /odom            nav_msgs/Odometry                      out   pose of the ego in map or odom, and its velocity
    /fix             sensor_msgs/NavSatFix                  out   what /gps tells
    /cmd_vel         geometry_msgs/Twist, or TwistStamped   in    speed and yaw rate
    /ackermann_cmd   ackermann_msgs/AckermannDriveStamped   in    speed and angle of the front wheels
    /sim/pause       std_msgs/Bool                          in    stops the world, or lets it go on
    /sim/reset       std_msgs/Empty                         in    returns to the opening scene, as the service does

`/clock`, `/tf`, `/tf_static` and `/imu` are standard messages anyway. The commands follow the rules of `/ctrl_cmd`: the
last one holds, and synchronous mode ignores them. A negative speed is a drive backwards: the ego brakes to a stand
first, and changes its gear at the next command.
"""

from __future__ import annotations

import logging
import math
from functools import partial
from typing import Final, Literal, TypeAlias

from rosbridge_sim.errors import FieldError
from rosbridge_sim.graph.participant import Participant
from rosbridge_sim.loose_types import Struct
from rosbridge_sim.morai.messages.control import Control
from rosbridge_sim.morai.messages.convert import maker
from rosbridge_sim.simulator.bus.publishers import Publishers
from rosbridge_sim.simulator.bus.subscribers_services import SubscribersServices
from rosbridge_sim.simulator.egos.ego import Ego
from rosbridge_sim.simulator.egos.tf_publisher import BASE, TfFrames, pose_of_base
from rosbridge_sim.simulator.kernel.component import Component
from rosbridge_sim.simulator.kernel.context import SimulatorContext
from rosbridge_sim.simulator.morai_services.command_topics import CommandTopics
from rosbridge_sim.simulator.sensors.gps import GpsSpec
from rosbridge_sim.simulator.sensors.sensor_context import SensorContext
from rosbridge_sim.simulator.sensors.sensor_noise import SensorNoise
from rosbridge_sim.world.state.world import Dynamics, Gear, Mode

CmdVel: TypeAlias = Literal["Twist", "TwistStamped"]
"""Type of `/cmd_vel`; a topic has one."""

_log = logging.getLogger("rosbridge_sim.morai")

LEAST_SPEED: Final = 0.1
"""Below this speed a yaw rate asks for no angle of the wheels [m/s]: standing, a car cannot turn."""

_HAS_FIX: Final = 0
_NO_FIX: Final = -1
"""`NavSatStatus.status`."""

_GPS: Final = 1
"""`NavSatStatus.service`."""


class StandardTopics(Component):
    """Component of these topics. It holds no state."""

    def __init__(
        self,
        context: SimulatorContext,
        commands: CommandTopics,
        noise: SensorNoise | None = None,
        *,
        frames: TfFrames = "map",
        cmd_vel: CmdVel = "Twist",
    ) -> None:
        """Make the makers of messages.

        Args:
            noise: errors of the GPS, the same as on `/gps`; None for exact readings.
            frames: as on `/tf`; `/odom` has the pose in the frame above `base_link`.
            cmd_vel: type of `/cmd_vel`.
        """
        self._context = context
        self._gps, self._shared = GpsSpec(), SensorContext(context, noise)
        self._frames = frames
        self._cmd_vel = cmd_vel
        self._commands = commands
        make = partial(maker, context.bus.store)
        self._vector = make("geometry_msgs/Vector3", "x y z")
        self._point = make("geometry_msgs/Point", "x y z")
        self._axes = make("geometry_msgs/Quaternion", "x y z w")
        self._pose = make("geometry_msgs/Pose", "position orientation")
        self._twist = make("geometry_msgs/Twist", "linear angular")
        self._some_pose = make("geometry_msgs/PoseWithCovariance", "pose")
        self._some_twist = make("geometry_msgs/TwistWithCovariance", "twist")
        self._odometry = make("nav_msgs/Odometry", "header child_frame_id pose twist")
        self._status = make("sensor_msgs/NavSatStatus", "status service")
        self._fix = make("sensor_msgs/NavSatFix", "header status latitude longitude altitude")

    def bind(self, bindings: SubscribersServices) -> None:
        """Subscribe to what services do for other clients: nodes of ROS 2 cannot call them."""
        bindings.listen("sim/pause", "std_msgs/Bool", self._take_pause)
        bindings.listen("sim/reset", "std_msgs/Empty", self._take_reset)

    def _take_pause(self, message: Struct, _sender: Participant, now: float) -> None:
        driver = self._context.sync_driver
        (driver.pause if message.data else driver.resume)(now)

    def _take_reset(self, _message: Struct, sender: Participant, now: float) -> None:
        self._context.scene_changes.reset(None, now)
        _log.info("reset by %s, seed %d", sender.name, self._context.world.seed)

    def publish_ego(self, ego: Ego, prefix: str, publishers: Publishers) -> None:
        """Publish where an ego is."""
        publishers.add(prefix + "odom", "nav_msgs/Odometry", partial(self._make_odometry, ego))
        publishers.add(prefix + "fix", "sensor_msgs/NavSatFix", partial(self._make_fix, ego))

    def bind_ego(self, ego: Ego, bindings: SubscribersServices) -> None:
        """Subscribe to the commands of an ego."""
        bindings.listen("cmd_vel", f"geometry_msgs/{self._cmd_vel}", partial(self._take_twist, ego, bindings))
        bindings.listen(
            "ackermann_cmd", "ackermann_msgs/AckermannDriveStamped", partial(self._take_ackermann, ego, bindings)
        )

    def _make_odometry(self, ego: Ego) -> Struct:
        """Return pose and velocity of `base_link`."""
        world, row, prefix = self._context.world, ego.row, ego.frame_prefix
        frame_id, place, axes = pose_of_base(world, ego, self._frames)
        pose = self._pose(self._point(*place), self._axes(*axes))
        climb = world.climb.item(row) if world.dynamics == Dynamics.SINGLE_TRACK else 0.0
        twist = self._twist(
            self._vector(world.speed.item(row), world.lateral_speed.item(row), climb),
            self._vector(0.0, 0.0, world.yaw_rate.item(row)),
        )
        header = self._context.convert.header(world.frame, frame_id)
        return self._odometry(header, prefix + BASE, self._some_pose(pose), self._some_twist(twist))

    def _make_fix(self, ego: Ego) -> Struct | None:
        """Return the reading of the GPS as a message that all of ROS knows; None as for `/gps`."""
        gps = self._gps.read(self._shared, ego)
        if gps is None:
            return None
        status = self._status(_HAS_FIX if gps.status else _NO_FIX, _GPS)
        return self._fix(gps.header, status, gps.latitude, gps.longitude, gps.altitude)

    def _take_twist(
        self, ego: Ego, bindings: SubscribersServices, message: Struct, sender: Participant, _now: float
    ) -> None:
        twist, at = (message, "") if self._cmd_vel == "Twist" else (message.twist, "twist.")
        speed, yaw_rate = twist.linear.x, twist.angular.z
        _check(f"geometry_msgs/{self._cmd_vel}", {f"{at}linear.x": speed, f"{at}angular.z": yaw_rate})
        wheelbase = self._context.world.bodies[ego.row].wheelbase
        steer = math.atan(wheelbase * yaw_rate / speed) if abs(speed) >= LEAST_SPEED else 0.0
        if self._commands.drive(ego, bindings, "cmd_vel", _standstill(steer), sender, message=message):
            _set_off(ego, speed, steer)

    def _take_ackermann(
        self, ego: Ego, bindings: SubscribersServices, message: Struct, sender: Participant, _now: float
    ) -> None:
        drive = message.drive
        _check(
            "ackermann_msgs/AckermannDriveStamped",
            {"drive.speed": drive.speed, "drive.steering_angle": drive.steering_angle},
        )
        steer = drive.steering_angle
        if self._commands.drive(ego, bindings, "ackermann_cmd", _standstill(steer), sender, message=message):
            _set_off(ego, drive.speed, steer)


def _standstill(steer: float) -> Control:
    return Control(Mode.SPEED, steer, throttle=0.0, brake=0.0, speed=0.0, accel=0.0)


def _set_off(ego: Ego, speed: float, steer: float) -> None:
    """Drive an ego, which was told to stop, at a signed speed [m/s], as soon as it is in the gear for it."""
    gear = Gear.DRIVE if speed > 0.0 else Gear.REVERSE
    if speed and (ego.gear is gear or ego.shift(gear) is None):
        ego.control(Control(Mode.SPEED, steer, throttle=0.0, brake=0.0, speed=abs(speed), accel=0.0))


def _check(type_name: str, values: dict[str, float]) -> None:
    """Refuse numbers that are not finite.

    Raises:
        FieldError: one of them is not.
    """
    for field, value in values.items():
        if not math.isfinite(value):
            raise FieldError(f"{type_name}.{field}: expected a finite number, got {value}")
