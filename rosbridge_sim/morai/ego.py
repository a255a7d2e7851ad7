"""One ego as its clients see it: who may drive it, its lamps, its gear, its state as a message.

The row in the world knows motion alone. What MORAI adds to it for each ego is here, so that a second ego is a second
object and a second set of names.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from enum import IntEnum
from typing import Any, Final

from rosbridge_sim.loose_types import Struct
from rosbridge_sim.morai.command_parsing import GhostPose
from rosbridge_sim.morai.convert import Control, Converter
from rosbridge_sim.world import commands, placement
from rosbridge_sim.world.lane_position import leave_lane
from rosbridge_sim.world.roads import Roads
from rosbridge_sim.world.self_driving import start_self_driving
from rosbridge_sim.world.sensors import Mounting
from rosbridge_sim.world.state import Gear, Mode, World

__all__ = ["GPS", "IMU", "SENSORS", "CtrlMode", "Ego"]

GPS: Final = "gps_link"
IMU: Final = "imu_link"

SENSORS: Final = (GPS, IMU)
"""The frames of an ego's sensors; a client calls a sensor by its place here."""

_log = logging.getLogger("rosbridge_sim.morai")


class CtrlMode(IntEnum):
    """Who drives."""

    KEYBOARD = 1
    GAME_PAD = 2
    EXTERNAL = 3  # /ctrl_cmd
    AUTONOMOUS = 6  # itself: it keeps to the lanes as other vehicles do


class Ego:
    """An ego vehicle; its row may be another one after a scenario was loaded.

    Attributes:
        index: its number among the egos, and its `unique_id` on the wire: 0, then 2, 3, ...
        uid: in the world.
        ctrl_mode: who drives it outside synchronous mode.
        turn_signal: 0 none, 1 left, 2 right.
        emergency_signal: 0 off, 1 on.
        mountings: where its sensors sit, by their frames, in the order of `SENSORS`.
        is_replayed: a recording moves it, and what anybody commands meanwhile is not carried out.
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
    ) -> None:
        """An ego that stands in the world already.

        Args:
            world: where it is.
            convert: what makes its messages.
            uid: in the world.
            ctrl_mode: who drives.
            index: None for the id in the world.
            roads: gives the lanes that it drives on.
        """
        self.index = uid if index is None else index
        self.uid = uid
        self.ctrl_mode = ctrl_mode
        self.turn_signal = 0
        self.emergency_signal = 0
        self.mountings = dict.fromkeys(SENSORS, Mounting())
        self.is_replayed = False
        self._world = world
        self._convert = convert
        self._roads = roads
        self._status: Any = None  # a generated struct
        self._refused_gear: Gear | None = None

    @property
    def is_there(self) -> bool:
        """Whether it stands in the world: a further ego goes when a scenario with another ego is loaded."""
        return self.uid in self._world

    @property
    def row(self) -> int:
        """Where it is in the world's arrays now."""
        return self._world.row(self.uid)

    @property
    def gear(self) -> Gear:
        """The gear it is in."""
        return Gear(self._world.gear.item(self.row))

    @property
    def lamps(self) -> tuple[int, int]:
        """Turn and emergency signal."""
        return self.turn_signal, self.emergency_signal

    def status(self) -> Struct:
        """Its EgoVehicleStatus, made once for each state of the world."""
        if self._status is None:
            self._status = self._convert.ego_vehicle_status(self._world, self.row, self.index, self._roads())
        return self._status

    def forget_status(self) -> None:
        """The world has changed."""
        self._status = None

    def reset_controls(self) -> None:
        """Have the controls of a new car: lamps off, and in D if it drives itself, as when it was told to."""
        self.turn_signal = self.emergency_signal = 0
        self._refused_gear = None
        if self.ctrl_mode is CtrlMode.AUTONOMOUS:
            self.shift(Gear.DRIVE)
        self.forget_status()

    def control(self, control: Control) -> None:
        """Apply a control from the next frame on. Ends self-driving; ignored if the ego is gone or is replayed."""
        if not self.is_there or self.is_replayed:
            return
        if self.ctrl_mode is CtrlMode.AUTONOMOUS:
            self.set_ctrl_mode(CtrlMode.EXTERNAL)
        commands.command(
            self._world,
            self.row,
            mode=control.mode,
            steer=control.steer,
            throttle=control.throttle,
            brake=control.brake,
            speed=control.speed,
            accel=control.accel,
        )

    def teleport(self, pose: GhostPose, gear: Gear | None = None) -> None:
        """Stand somewhere else, at that speed, and in that gear whatever the speed was.

        What was commanded before is forgotten, or the car would leave its new place with the old pedals and wheels.
        Commands that wait for their frames are `Sync.drop`'s.

        Args:
            pose: where to, and how the wheels are to stand; straight where it does not say.
            gear: None leaves it.

        Raises:
            ValueError: beyond all bounds. Nothing has moved.
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
        """Stand somewhere as a ghost: nothing moves it until the next command, and its speed is what is said.

        Raises:
            ValueError: beyond all bounds. Nothing has moved.
        """
        self._place(pose, pose.speed, is_ghost=True)
        if pose.steer is not None:
            commands.turn_wheels(self._world, self.row, pose.steer)
        self.forget_status()

    def _place(self, pose: GhostPose, speed: float, *, is_ghost: bool = False) -> None:
        place = placement.place_ghost if is_ghost else placement.teleport
        place(
            self._world,
            self.row,
            x=pose.x,
            y=pose.y,
            z=pose.z,
            yaw=pose.yaw,
            speed=speed,
            roll=pose.roll,
            pitch=pose.pitch,
        )

    def set_ctrl_mode(self, ctrl_mode: CtrlMode) -> str | None:
        """Change who drives; the pedals of a client or of the car itself are released.

        Returns:
            None when the mode is this one now, else why not, for a person to read.
        """
        if self.is_replayed:
            return f"ctrl_mode {ctrl_mode.name} refused: a recording moves ego {self.index}"
        row = self.row
        if ctrl_mode is CtrlMode.AUTONOMOUS:
            why = self.shift(Gear.DRIVE)
            if why is None and not start_self_driving(self._world, row):
                why = f"ctrl_mode {ctrl_mode.name} refused: ego {self.index} stands on no lane, or across it"
            if why is not None:
                return why
        else:
            leave_lane(self._world, row)
            is_foreign = self.ctrl_mode in {CtrlMode.EXTERNAL, CtrlMode.AUTONOMOUS}
            if is_foreign and self.ctrl_mode is not ctrl_mode:
                commands.command(self._world, row, mode=Mode.PEDALS, steer=0.0)
        self.ctrl_mode = ctrl_mode
        return None

    def resume(self) -> None:
        """It stands somewhere else, or on another map: if it drove itself it goes on, or not, where no lane is."""
        if self.ctrl_mode is CtrlMode.AUTONOMOUS and not start_self_driving(self._world, self.row):
            _log.info("ego %d stands on no lane: ctrl_mode is %s", self.index, CtrlMode.KEYBOARD.name)
            self.set_ctrl_mode(CtrlMode.KEYBOARD)

    def shift(self, gear: Gear) -> str | None:
        """Change gear.

        Returns:
            None when it is in that gear now, else why not, for a person to read.
        """
        if not self.is_there:
            return f"gear {gear.name} refused: ego {self.index} is gone"
        if self.is_replayed:
            return f"gear {gear.name} refused: a recording moves ego {self.index}"
        row = self.row
        if commands.shift(self._world, row, gear):
            self._refused_gear = None
            return None
        speed = self._world.speed.item(row)
        why = f"gear {gear.name} refused: the ego moves at {speed:.2f} m/s, it must nearly stand (0.1 m/s)"
        if self._refused_gear is not gear:  # clients ask again and again until it works
            self._refused_gear = gear
            _log.info("%s", why)
        return why
