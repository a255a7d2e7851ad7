"""One ego as its clients see it: control mode, lamps, gear, and its state as a message.

Lamps are those that its driver commands, and those that follow from pedals and gear.

The world's row holds motion only. This module holds what MORAI adds to it, so a second ego is a second object with its
own names.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Sequence
from enum import IntEnum
from typing import Any, Final

from rosbridge_sim.graph.participant import Participant
from rosbridge_sim.loose_types import Struct
from rosbridge_sim.morai.messages.command_parsing import GhostPose
from rosbridge_sim.morai.messages.control import Control
from rosbridge_sim.morai.messages.convert import Converter
from rosbridge_sim.records import Record, asdict
from rosbridge_sim.simulator.egos.odometry import Origin, move_origin
from rosbridge_sim.simulator.scene.scene_limits import FIRST_EGO
from rosbridge_sim.world.drivers.lane_position import leave_lane
from rosbridge_sim.world.followers.lamps import BRAKE, BRAKE_LIGHT_DECEL, LEFT, REVERSE, RIGHT
from rosbridge_sim.world.followers.self_driving import start_self_driving
from rosbridge_sim.world.roads.roads import Roads
from rosbridge_sim.world.state import commands, placement
from rosbridge_sim.world.state.world import Gear, Mode, World
from rosbridge_sim.world.vehicle.sensor_readings import Mounting

GHOST_JUMP: Final = 10.0
"""Least distance between two placements of a ghost that is a jump [m]: no car drives so far between two commands."""

_log = logging.getLogger("rosbridge_sim.morai")


def ego_prefix(index: int) -> str:
    """Return the prefix of the topics and services of an ego."""
    return "/" if index == FIRST_EGO else f"/Ego-{index}/"


class CtrlMode(IntEnum):
    """The driver of an ego."""

    KEYBOARD = 1
    GAME_PAD = 2
    EXTERNAL = 3  # /ctrl_cmd
    AUTONOMOUS = 6  # self-driving: it follows the lanes as other vehicles do


class EgoState(Record):
    """State of an ego beside its row in the world.

    Attributes:
        index, uid, ctrl_mode, lamps, mountings, odom_origin: as in `Ego`.
    """

    index: int
    uid: int
    ctrl_mode: CtrlMode
    lamps: tuple[int, int]
    mountings: tuple[tuple[str, Mounting], ...]
    odom_origin: Origin


class Ego:
    """An ego vehicle; its row may change when a scenario is loaded.

    Attributes:
        index: its number among the egos, and its `unique_id` on the wire: 0, then 2, 3, ...
        frame_prefix: before the names of its frames: empty for the first ego, else for example `Ego-2/`.
        uid: its id in the world.
        ctrl_mode: its driver outside synchronous mode.
        turn_signal: 0 none, 1 left, 2 right.
        emergency_signal: 0 off, 1 on.
        mountings: places of its sensors, by their frames, in the order of the table of sensors.
        odom_origin: pose of its frame `odom` in the map; see `odometry`.
        optical_frames: those of the sensors that are cameras: each has a frame of its picture, too.
        moved_by: what moves it while commands are ignored, "recording" or "story"; else "".
        commander: the participant whose command it followed last, for people who watch; None for none that is known.
        command_frame: frame at which the last command of `/ctrl_cmd` came, for leases.
    """

    def __init__(
        self,
        world: World,
        convert: Converter,
        uid: int,
        ctrl_mode: CtrlMode,
        *,
        index: int | None = None,
        roads: Callable[[], Roads] = Roads,
        sensor_frames: tuple[str, ...] = (),
    ) -> None:
        """Represent an ego that stands in the world already.

        Args:
            index: its number; None for the id in the world.
            roads: returns the lanes of the map in use.
        """
        self._world = world
        self._convert = convert
        self._roads = roads
        self.index = uid if index is None else index
        self.frame_prefix = ego_prefix(self.index)[1:]
        self.uid = uid
        self.ctrl_mode = ctrl_mode
        self.turn_signal = 0
        self.emergency_signal = 0
        self.mountings = dict.fromkeys(sensor_frames, Mounting())
        self.odom_origin: Origin = self.pose if self.is_there else (0.0, 0.0, 0.0, 0.0)
        self.optical_frames: tuple[str, ...] = ()
        self.moved_by = ""
        self.commander: Participant | None = None
        self.command_frame = 0
        self._status: Any = None  # a generated struct
        self._refused_gear: Gear | None = None  # a memo for the log, and so no part of the state
        self._idle_gear: Gear | None = None  # likewise: the gear without drive that a client was told of

    @property
    def is_there(self) -> bool:
        """True while it stands in the world; loading a scenario with another ego removes a further ego."""
        return self.uid in self._world

    @property
    def row(self) -> int:
        """Its current index in the world's arrays."""
        return self._world.row(self.uid)

    @property
    def pose(self) -> Origin:
        """Pose in the map: x, y, z [m] and yaw [rad]."""
        world, row = self._world, self.row
        return world.x.item(row), world.y.item(row), world.z.item(row), world.yaw.item(row)

    def keep_odometry(self, before: Origin) -> None:
        """Move `odom` in the map, so that the pose in `odom` stays the same over a jump.

        Args:
            before: pose in the map before the jump.
        """
        self.odom_origin = move_origin(self.odom_origin, before, self.pose)

    @property
    def gear(self) -> Gear:
        """Its gear."""
        return Gear(self._world.gear.item(self.row))

    @property
    def driver(self) -> str:
        """Its driver: story, replay, self-driving, client or nobody."""
        if self.moved_by:
            return "story" if self.moved_by == "story" else "replay"
        if self.ctrl_mode is CtrlMode.AUTONOMOUS:
            return "self-driving"
        return "nobody" if self.commander is None else "client"

    @property
    def lamps(self) -> tuple[int, int]:
        """Its turn and emergency signal."""
        return self.turn_signal, self.emergency_signal

    def status(self) -> Struct:
        """Return its EgoVehicleStatus; the message is made once for each state of the world.

        Returns:
            A struct, shared by all callers.
        """
        if self._status is None:
            world = self._world
            self._status = self._convert.ego_vehicle_status(world, world.row(self.uid), self.index, self._roads())
        return self._status

    def forget_status(self) -> None:
        """Make the status anew at the next call of `status`, because the world has changed."""
        self._status = None

    def reset_controls(self) -> None:
        """Set the controls of a new car: lamps off, and gear D if it drives itself."""
        self.turn_signal = self.emergency_signal = 0
        self.commander = None
        self._refused_gear = self._idle_gear = None
        if self.ctrl_mode is CtrlMode.AUTONOMOUS:
            self.shift(Gear.DRIVE)
        self.forget_status()

    def save_state(self) -> EgoState:
        """Return what decides what it will do, beside its row in the world."""
        mountings = tuple(self.mountings.items())
        return EgoState(self.index, self.uid, self.ctrl_mode, self.lamps, mountings, self.odom_origin)

    def load_state(self, state: EgoState) -> None:
        """Become what was saved; the world has been restored. A recording does not move it."""
        self.uid, self.ctrl_mode = state.uid, state.ctrl_mode
        self.turn_signal, self.emergency_signal = state.lamps
        self._refused_gear = None
        self.mountings = dict(state.mountings)
        self.odom_origin = state.odom_origin
        self.moved_by = ""
        self.commander = None
        self.forget_status()

    def control(self, control: Control) -> None:
        """Apply a control from the next frame on. Ends self-driving. An ego that is gone or has `moved_by` ignores it.

        Args:
            control: in the world's units.
        """
        if not self.is_there or self.moved_by:
            return
        if self.ctrl_mode is CtrlMode.AUTONOMOUS:
            self.set_ctrl_mode(CtrlMode.EXTERNAL)
        commands.command(self._world, self.row, **asdict(control))

    def find_idle(self, control: Control) -> str | None:
        """Return why a control does not move the ego: it is in P or N. It is told once until the gear changes.

        Args:
            control: in the world's units.

        Returns:
            The reason, for a person to read; None if the control moves the ego or does not want to.
        """
        number = self._world.gear.item(self.row)
        if number == Gear.DRIVE or number == Gear.REVERSE:  # noqa: PLR1714 - asked with each command: a set is slower
            return None
        gear = Gear(number)
        wants = {Mode.PEDALS: control.throttle, Mode.SPEED: control.speed, Mode.ACCEL: control.accel}
        if gear is self._idle_gear or wants[control.mode] <= 0.0:
            return None
        self._idle_gear = gear
        return f"the command moves nothing: ego {self.index} is in gear {gear.name}; shift to 4 (D) or 2 (R) first"

    def teleport(self, pose: GhostPose, gear: Gear | None = None) -> None:
        """Place the ego elsewhere, with a speed and in a gear.

        Earlier commands are cancelled; otherwise the car would leave its new place with the old pedals and wheel angle.
        Commands that wait for their frames must be removed with `Sync.drop`. The gear is set at any speed.

        Args:
            pose: the new pose and wheel angle; without an angle the wheels are straight.
            gear: None keeps the current one.

        Raises:
            ValueError: the pose is out of range. Nothing has moved.
        """
        if gear is not None and gear is not self.gear:
            self._place(pose, speed=0.0)
            commands.shift(self._world, self.row, gear)
        self._place(pose, speed=pose.speed)
        commands.release(self._world, self.row)
        if pose.steer is not None:
            commands.turn_wheels(self._world, self.row, pose.steer)
        self._refused_gear = None
        self.resume()
        self.forget_status()

    def place_as_ghost(self, pose: GhostPose) -> None:
        """Place the ego as a ghost: nothing moves it until the next command, and its speed is the given one.

        Raises:
            ValueError: the pose is out of range. Nothing has moved.
        """
        self._place(pose, pose.speed, is_ghost=True)
        if pose.steer is not None:
            commands.turn_wheels(self._world, self.row, pose.steer)
        self.forget_status()

    def _place(self, pose: GhostPose, speed: float, *, is_ghost: bool = False) -> None:
        """Place the ego, which is a jump for its odometry; a ghost that moves less than `GHOST_JUMP` does not jump."""
        before, was_ghost = self.pose, self._world.is_ghost.item(self.row)
        angles = {"roll": pose.roll, "pitch": pose.pitch, "yaw": pose.yaw}
        placement.teleport(
            self._world, self.row, x=pose.x, y=pose.y, z=pose.z, speed=speed, is_ghost=is_ghost, **angles
        )
        if not (is_ghost and was_ghost) or math.dist(before[:3], self.pose[:3]) > GHOST_JUMP:
            self.keep_odometry(before)

    def set_ctrl_mode(self, ctrl_mode: CtrlMode) -> str | None:
        """Change the driver. If a client or the car itself was driving, the pedals are released.

        Returns:
            None if the ego has this mode now, else the reason why not, for a person to read.
        """
        if self.moved_by:
            return f"ctrl_mode {ctrl_mode.name} refused: a {self.moved_by} moves ego {self.index}"
        row = self.row
        if ctrl_mode is CtrlMode.AUTONOMOUS:
            return self.drive_itself()
        leave_lane(self._world, row)
        is_foreign = self.ctrl_mode in {CtrlMode.EXTERNAL, CtrlMode.AUTONOMOUS}
        if is_foreign and self.ctrl_mode is not ctrl_mode:
            commands.command(self._world, row, mode=Mode.PEDALS, steer=0.0)
            self.commander = None
        self.ctrl_mode = ctrl_mode
        return None

    def drive_itself(
        self, *, route: Sequence[int] = (), is_loop: bool = False, desired_speed: float = math.inf
    ) -> str | None:
        """Drive along the lanes from where it stands; `ctrl_mode` is AUTONOMOUS then.

        Args:
            route: rows of lanes, see `start_self_driving`; empty for a drive by chance.
            is_loop: the route begins again.
            desired_speed: speed that the driver wants [m/s].

        Returns:
            None when it does so, else why not, for a person to read.
        """
        mode = CtrlMode.AUTONOMOUS
        if self.moved_by:
            return f"ctrl_mode {mode.name} refused: a {self.moved_by} moves ego {self.index}"
        why = self.shift(Gear.DRIVE)
        if why is not None:
            return why
        has_lane = start_self_driving(self._world, self.row, route=route, is_loop=is_loop, desired_speed=desired_speed)
        if not has_lane:
            return f"ctrl_mode {mode.name} refused: ego {self.index} stands on no lane, or across it"
        self.ctrl_mode = mode
        return None

    def resume(self) -> None:
        """Continue self-driving after a new place or a new map; without a lane, change to KEYBOARD."""
        if self.ctrl_mode is CtrlMode.AUTONOMOUS and not start_self_driving(self._world, self.row):
            _log.info("ego %d stands on no lane: ctrl_mode is %s", self.index, CtrlMode.KEYBOARD.name)
            self.set_ctrl_mode(CtrlMode.KEYBOARD)

    def shift(self, gear: Gear) -> str | None:
        """Change gear.

        Returns:
            None if the ego is in this gear now, else the reason why not, for a person to read.
        """
        why = self.refuse_gear(gear)
        if why is None:
            commands.shift(self._world, self.row, gear)
            self._refused_gear = self._idle_gear = None
        return why

    def refuse_gear(self, gear: Gear) -> str | None:
        """Return why the ego cannot be in a gear now, for a person to read; None if it can."""
        if not self.is_there:
            return f"gear {gear.name} refused: ego {self.index} has been removed"
        if self.moved_by:
            return f"gear {gear.name} refused: a {self.moved_by} moves ego {self.index}"
        speed = self._world.speed.item(self.row)
        if gear is self.gear or abs(speed) < commands.STANDSTILL:
            return None
        why = f"gear {gear.name} refused: the ego moves at {speed:.2f} m/s, expected less than 0.1 m/s"
        if self._refused_gear is not gear:  # clients repeat the request until it works, so it is logged once
            self._refused_gear = gear
            _log.info("%s", why)
        return why


_RIGHT_SIGNAL: Final = 2
"""`turn_signal` of an ego that signals to the right."""


def lamps_of(ego: Ego, world: World) -> int:
    """Return the lamps of an ego that are lit, a sum of the bits of `world.followers.lamps`.

    Args:
        world: read only.
    """
    row = ego.row
    is_braking = world.brake.item(row) > 0.0 or (
        world.has_lane.item(row) and (world.speed.item(row) == 0.0 or world.accel.item(row) < -BRAKE_LIGHT_DECEL)
    )
    return (
        LEFT * (ego.turn_signal == 1 or ego.emergency_signal == 1)
        | RIGHT * (ego.turn_signal == _RIGHT_SIGNAL or ego.emergency_signal == 1)
        | BRAKE * is_braking
        | REVERSE * (world.gear.item(row) == Gear.REVERSE)
    )
