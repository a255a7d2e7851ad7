"""A world of one ego, and what its pedals do."""

from __future__ import annotations

from typing import Any

from rosbridge_sim.records import replace
from rosbridge_sim.world.state.commands import command
from rosbridge_sim.world.state.world import DT, Body, Kind, Mode, World
from rosbridge_sim.world.vehicle.dynamics import drive

CAR = Body()
# No drag at all: so that circles and ways have closed forms.
SLICK = replace(CAR, rolling=0.0, drag=0.0, max_steer_rate=1e6)


def ego(body: Body = CAR, **figures: Any) -> World:  # noqa: ANN401 - whatever spawn takes
    """A world of one ego, in row 0, at the origin and looking east unless `figures` says otherwise."""
    world = World()
    usual: dict[str, Any] = {"x": 0.0, "y": 0.0}
    world.spawn(Kind.EGO, body, name="ego", **(usual | figures))
    return world


def pedals(world: World, throttle: float = 0.0, brake: float = 0.0, steer: float = 0.0, row: int = 0) -> None:
    command(world, row, mode=Mode.PEDALS, throttle=throttle, brake=brake, steer=steer)


def move(world: World) -> None:
    """Move the driven rows by a step, which is half of what a whole step of a world costs."""
    drive(world, DT)


def speeds(world: World, seconds: float) -> list[float]:
    trace = []
    for _ in range(round(seconds / DT)):
        move(world)
        trace.append(float(world.speed[0]))
    return trace
