"""Drives of egos whose digests are known: the same commands must give the same bits for ever."""

from __future__ import annotations

import math
from collections.abc import Callable

from rosbridge_sim.records import replace
from rosbridge_sim.world.state.commands import command, shift, turn_wheels
from rosbridge_sim.world.state.placement import place_ghost, teleport
from rosbridge_sim.world.state.world import Body, Dynamics, Gear, Kind, Mode, World
from rosbridge_sim.world.step import step

__all__ = ["DRIVES", "digest_here", "digests_here"]

CAR = Body()


def _pedals(world: World) -> None:
    row = world.row(world.spawn(Kind.EGO, CAR, name="ego", x=0.0, y=0.0, yaw=0.4))
    for i in range(400):
        command(
            world,
            row,
            mode=Mode.PEDALS,
            throttle=max(0.0, math.sin(i / 60)),
            brake=max(0.0, -math.sin(i / 60)) / 2,
            steer=0.5 * math.sin(i / 25),
        )
        step(world)


def _speeds(world: World) -> None:
    row = world.row(world.spawn(Kind.EGO, CAR, name="ego", x=5.0, y=-3.0, speed=12.0, roll=0.01, pitch=-0.02))
    world.start_scoring()
    for i, speed in enumerate((20.0, 3.0, 0.0, 15.0)):
        command(world, row, mode=Mode.SPEED, speed=speed, steer=0.1 * i)
        for _ in range(150):
            step(world)


def _backwards(world: World) -> None:
    row = world.row(world.spawn(Kind.EGO, CAR, name="ego", x=0.0, y=0.0, gear=Gear.REVERSE))
    command(world, row, mode=Mode.ACCEL, accel=1.5, steer=-0.3)
    for _ in range(200):
        step(world)
    command(world, row, mode=Mode.ACCEL, accel=-3.0, steer=0.3)
    for _ in range(200):
        step(world)
    shift(world, row, Gear.DRIVE)
    command(world, row, mode=Mode.SPEED, speed=7.0, steer=0.05)
    for _ in range(200):
        step(world)


def _many(world: World) -> None:
    """Egos with gaps between their rows, in all modes, and other entities."""
    rows = []
    for i in range(12):
        body = replace(CAR, max_accel=2.0 + 0.3 * i, wheelbase=2.0 + 0.1 * i)
        rows.append(world.row(world.spawn(Kind.EGO, body, name=f"ego {i}", x=0.0, y=20.0 * i, speed=float(i))))
        world.spawn(Kind.VEHICLE, CAR, name="npc", x=50.0, y=20.0 * i, yaw=0.1 * i, speed=3.0)
    for i, row in enumerate(rows):
        figures = {"throttle": 0.3, "brake": 0.01 * i, "speed": 2.0 * i, "accel": 0.2 * i}
        command(world, row, mode=Mode(i % 3 + 1), steer=0.05 * i - 0.3, **figures)
    for _ in range(300):
        step(world)


def _placed(world: World) -> None:
    row = world.row(world.spawn(Kind.EGO, CAR, name="ego", x=0.0, y=0.0))
    other = world.row(world.spawn(Kind.EGO, CAR, name="other", x=0.0, y=9.0))
    command(world, other, mode=Mode.SPEED, speed=30.0, steer=0.6)
    for i in range(100):
        place_ghost(world, row, x=0.3 * i, y=2.0, z=0.1, yaw=0.01 * i, speed=15.0, roll=0.02)
        step(world)
    saved = world.snapshot()
    teleport(world, row, x=100.0, y=0.0, z=0.0, yaw=3.0, speed=25.0, pitch=0.03)
    turn_wheels(world, row, 0.2)
    for _ in range(200):
        step(world)
    digest = world.digest()
    world.restore(saved)
    teleport(world, row, x=100.0, y=0.0, z=0.0, yaw=3.0, speed=25.0, pitch=0.03)
    turn_wheels(world, row, 0.2)
    for _ in range(200):
        step(world)
    assert world.digest() == digest


DRIVES: dict[str, Callable[[World], None]] = {
    "pedals": _pedals,
    "speeds": _speeds,
    "backwards": _backwards,
    "many": _many,
    "placed": _placed,
}


def digest_here(dynamics: Dynamics, name: str) -> str:
    """Return the digest of a drive, computed by this process."""
    world = World(7, dynamics)
    DRIVES[name](world)
    return world.digest()


def digests_here() -> dict[str, dict[str, str]]:
    """Return the digest of each drive, by model."""
    return {dynamics.name: {name: digest_here(dynamics, name) for name in DRIVES} for dynamics in Dynamics}
