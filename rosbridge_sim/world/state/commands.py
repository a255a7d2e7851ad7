"""Commands of driven rows: pedals, speed or acceleration, steering and gears.

A command holds until the next one. `dynamics` carries it out.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from rosbridge_sim.world.geometry.planar import FloatArray, IntArray
from rosbridge_sim.world.state.control_columns import update_all_control_columns, update_control_columns
from rosbridge_sim.world.state.placement import set_ghost
from rosbridge_sim.world.state.world import MAX_SPEED, Gear, Kind, Mode
from rosbridge_sim.world.state.world_rows import WorldRows

MAX_COMMAND_ACCEL: Final = 100.0
"""Commanded accelerations are clipped at this [m/s^2]: beyond any brake, and it keeps the controller's sums finite."""

STANDSTILL: Final = 0.1
"""A gear change takes hold below this speed [m/s]."""


def command(
    world: WorldRows,
    row: int,
    *,
    mode: Mode,
    steer: float,
    rear_steer: float = 0.0,
    throttle: float = 0.0,
    brake: float = 0.0,
    speed: float = 0.0,
    accel: float = 0.0,
) -> None:
    """Command a driven row from the next step on, until the next command. A ghost stops being one.

    Only the arguments of the mode count; the others are not read.

    Args:
        world: written in place.
        row: row of an EGO.
        mode: which longitudinal arguments count.
        steer: front wheels, left positive, clipped at the body's limit [rad].
        rear_steer: rear wheels, likewise; only the single track model turns them.
        throttle: 0..1, clipped; for PEDALS.
        brake: 0..1, clipped; for PEDALS.
        speed: in the direction of the gear; for SPEED. Negative is a stop, in R the same as positive [m/s].
        accel: in the direction of the gear, negative to brake; for ACCEL [m/s^2].

    Raises:
        ValueError: an argument that counts is not finite, or the row is not driven. The old command stays in force.
    """
    if not _is_driven(world, row):
        raise ValueError(f"row {row} is not driven by commands")
    before = world.mode.item(row)
    is_held = before == mode  # the columns that follow from the command stay as they are
    if mode == Mode.PEDALS:
        _check(steer=steer, rear_steer=rear_steer, throttle=throttle, brake=brake)
        world.throttle[row], world.brake[row] = min(max(throttle, 0.0), 1.0), min(max(brake, 0.0), 1.0)
    elif mode == Mode.SPEED:
        _check(steer=steer, rear_steer=rear_steer, speed=speed)
        speed = min(max(speed, -MAX_SPEED), MAX_SPEED)
        is_held = is_held and speed == world.speed_cmd.item(row) != 0.0  # zeros have signs
        world.speed_cmd[row] = speed
    elif mode == Mode.ACCEL:
        _check(steer=steer, rear_steer=rear_steer, accel=accel)
        accel = min(max(accel, -MAX_COMMAND_ACCEL), MAX_COMMAND_ACCEL)
        is_held = is_held and accel == world.accel_cmd.item(row) != 0.0
        world.accel_cmd[row] = accel
    else:
        raise ValueError(f"mode: expected 1 (pedals), 2 (speed) or 3 (acceleration), got {mode!r}")
    limit = world.max_steer.item(row)
    world.steer_cmd[row] = min(max(steer, -limit), limit)
    limit = world.body_of(row).max_rear_steer
    world.rear_steer_cmd[row] = min(max(rear_steer, -limit), limit)
    if not is_held:
        world.mode[row] = mode
        update_control_columns(world, row, is_creeping=world.is_creeping)
    set_ghost(world, row, is_ghost=False)
    if (before == Mode.PEDALS) != (mode == Mode.PEDALS):
        world.touch()  # the controller's calls are only in the programs that need them


def command_all(
    world: WorldRows,
    rows: IntArray,
    *,
    mode: Mode,
    steer: FloatArray,
    throttle: FloatArray | None = None,
    brake: FloatArray | None = None,
    speed: FloatArray | None = None,
    accel: FloatArray | None = None,
) -> None:
    """Command many driven rows, each as `command` does; all arguments but the mode are (k,) finite numbers.

    Args:
        world: written in place.
        rows: (k,) int64, rows of EGOs, each once.
        mode: of all of them; only its arguments count.
        steer: front wheels, left positive, clipped at the bodies' limits [rad]. Rear wheels stand straight.
        throttle: 0..1, clipped; for PEDALS.
        brake: 0..1, clipped; for PEDALS.
        speed: in the direction of the gear; for SPEED [m/s].
        accel: in the direction of the gear; for ACCEL [m/s^2].
    """
    limit = world.max_steer[rows]
    world.steer_cmd[rows] = np.minimum(np.maximum(steer, -limit), limit)
    world.rear_steer_cmd[rows] = 0.0
    if throttle is not None and brake is not None and mode == Mode.PEDALS:
        world.throttle[rows] = np.minimum(np.maximum(throttle, 0.0), 1.0)
        world.brake[rows] = np.minimum(np.maximum(brake, 0.0), 1.0)
    elif speed is not None and mode == Mode.SPEED:
        world.speed_cmd[rows] = np.minimum(np.maximum(speed, -MAX_SPEED), MAX_SPEED)
    elif accel is not None and mode == Mode.ACCEL:
        world.accel_cmd[rows] = np.minimum(np.maximum(accel, -MAX_COMMAND_ACCEL), MAX_COMMAND_ACCEL)
    switches = (world.mode[rows] == int(Mode.PEDALS)) != (mode == Mode.PEDALS)
    world.mode[rows] = mode
    update_all_control_columns(world, rows, mode, is_creeping=world.is_creeping)
    for row in rows[world.is_ghost[rows]].tolist():
        set_ghost(world, row, is_ghost=False)
    if np.count_nonzero(switches):
        world.touch()


def shift(world: WorldRows, row: int, gear: Gear) -> bool:
    """Change the gear of a driven row.

    Args:
        world: written in place.
        row: row of an EGO.

    Returns:
        True when the row is in that gear now, which it may have been before. False when it is too fast for a change.

    Raises:
        ValueError: the row is not driven, or there is no such gear. Nothing has changed.
    """
    if not _is_driven(world, row):
        raise ValueError(f"row {row} has no gears")
    gear = Gear(gear)
    if world.gear.item(row) == gear:
        return True
    if abs(world.speed[row]) >= STANDSTILL:
        return False
    world.gear[row] = gear
    update_control_columns(world, row, is_creeping=world.is_creeping)
    world.touch()
    return True


def speed_in_gear(speed: float, gear: Gear) -> float:
    """Return the speed along the heading of a car that is placed with a speed in a gear: in R it drives backwards.

    Args:
        speed: in R of either sign [m/s].
        gear: P and N say no direction.

    Raises:
        ValueError: it would drive backwards in D.
    """
    if gear == Gear.REVERSE:
        return -abs(speed)
    if gear == Gear.DRIVE and speed < 0.0:
        raise ValueError(f"speed: expected 0 or more in gear 4 (D), got {speed:g} m/s; gear 2 (R) drives backwards")
    return speed


def turn_wheels(world: WorldRows, row: int, steer: float) -> None:
    """Set the angle of the front wheels of a driven row at once; it stays until the next command.

    Args:
        world: written in place.
        row: row of an EGO.
        steer: left positive, clipped at the body's limit [rad].

    Raises:
        ValueError: not a finite angle, or the row is not driven. Nothing has changed.
    """
    if not _is_driven(world, row):
        raise ValueError(f"row {row} has no wheels to turn")
    _check(steer=steer)
    limit = world.max_steer.item(row)
    world.steer[row] = world.steer_cmd[row] = min(max(steer, -limit), limit)


def release(world: WorldRows, row: int) -> None:
    """Cancel the command of a driven row: no pedal is pressed, and the wheels stand straight at once.

    Gear, place and speed stay. Until the next command it rolls on in pedals mode. A ghost stops being one.

    Args:
        world: written in place.
        row: row of an EGO.

    Raises:
        ValueError: the row is not driven. Nothing has changed.
    """
    command(world, row, mode=Mode.PEDALS, steer=0.0)
    world.speed_cmd[row] = world.accel_cmd[row] = 0.0
    update_control_columns(world, row, is_creeping=world.is_creeping)
    world.steer[row] = world.rear_steer[row] = 0.0


def _is_driven(world: WorldRows, row: int) -> bool:
    # `item`, here and in all that a command does: comparing numpy's scalars with an enum costs microseconds.
    return bool(world.kind.item(row) == Kind.EGO and world.alive.item(row))


def _check(**arguments: float) -> None:
    if math.isfinite(sum(arguments.values())):
        return
    for name, value in arguments.items():
        if not math.isfinite(value):
            raise ValueError(f"{name}: expected a finite number, got {value!r}")
