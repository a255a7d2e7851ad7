"""Roads for tests: drawn in a few words, with lights where they are asked for."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from rosbridge_sim.maps.road_map import RoadMap
from rosbridge_sim.shell.files.library import DiskLibrary
from rosbridge_sim.world.drivers.lane_position import LaneStart, keep_lanes
from rosbridge_sim.world.geometry.planar import FloatArray
from rosbridge_sim.world.roads.roads import Roads
from rosbridge_sim.world.roads.signal_plan import Controller, Lamp, Light, Phase, SignalPlan
from rosbridge_sim.world.state.world import Body, Gear, Kind, World

__all__ = ["CAR", "MAPS", "arc", "built_in", "car", "crossing", "ego", "keep_lane", "line", "make", "road", "signalled"]

CAR = Body()
MAPS = Path(__file__).resolve().parents[2] / "rosbridge_sim" / "data" / "maps"


def built_in(name: str) -> RoadMap:
    """A map never changes, and neither does what is computed of its roads: a library keeps it for all."""
    return DiskLibrary().map(name)


def line(*corners: tuple[float, float], z: float = 0.0) -> FloatArray:
    return np.array([(x, y, z) for x, y in corners], dtype=np.float64)


def arc(x: float, y: float, radius: float, start: float, turn: float) -> FloatArray:
    """Points a metre apart on a circle around (x, y), angles in degrees."""
    num = max(2, int(radius * abs(np.radians(turn))) + 1)
    angles = np.radians(start + np.linspace(0.0, turn, num))
    return np.stack((x + radius * np.cos(angles), y + radius * np.sin(angles), 0.0 * angles), axis=-1)


def make(**lanes: tuple[FloatArray, str] | tuple[FloatArray, str, float]) -> Roads:
    """Lanes by name: the line, the names of the successors (a blank between them), the limit [m/s] (15)."""
    names = list(lanes)
    return Roads(
        names,
        [lane[0] for lane in lanes.values()],
        [[names.index(name) for name in lane[1].split()] for lane in lanes.values()],
        [3.5] * len(names),
        [lane[2] if len(lane) > 2 else 15.0 for lane in lanes.values()],
    )


def keep_lane(world: World, row: int, lane: int, s: float, *, route: Sequence[int] = (), **options: Any) -> None:  # noqa: ANN401 - those of LaneStart
    """Put one vehicle onto a lane."""
    keep_lanes(world, [LaneStart(row, lane, s, route=tuple(route), **options)])


def road(length: float = 1000.0, limit: float = 15.0) -> Roads:
    """A single straight to the east."""
    return make(a=(line((0, 0), (length, 0)), "", limit))


def crossing() -> Roads:
    """One-way streets to the east (w, we, e) and to the north (s, sn, n) that cross at (0, 0), ten metres wide."""
    return make(
        w=(line((-200, 0), (-10, 0)), "we"),
        we=(line((-10, 0), (10, 0)), "e"),
        e=(line((10, 0), (400, 0)), ""),
        s=(line((0, -200), (0, -10)), "sn"),
        sn=(line((0, -10), (0, 10)), "n"),
        n=(line((0, 10), (0, 400)), ""),
    )


def ring() -> Roads:
    """A loop with a choice of two ways on half of it."""

    def half(radius: float) -> FloatArray:
        return np.concatenate([arc(60, radius, radius, -90, 180), line((0, 2 * radius))])

    return make(
        a=(line((0, 0), (60, 0)), "b c"),
        b=(half(30.0), "d"),
        c=(half(40.0), "e"),
        d=(arc(0, 30, 30, 90, 180), "a"),
        e=(arc(0, 40, 40, 90, 180), "a"),
    )


def signalled(green: int = 300, yellow: int = 150) -> tuple[Roads, SignalPlan]:
    """The same with lights: first the east has green, then the north; so many frames each."""
    roads = crossing()
    lights = [Light("east", lanes=(1,)), Light("north", lanes=(4,))]
    phases = (Phase(green, (Lamp.GREEN, Lamp.RED)), Phase(green, (Lamp.RED, Lamp.GREEN)))
    return roads, SignalPlan(roads, lights, [Controller("I1", 1, ((0,), (1,)), phases, (yellow, yellow))])


def car(
    world: World,
    lane: str,
    s: float,
    *,
    speed: float = 0.0,
    body: Body = CAR,
    desired_speed: float = np.inf,
    route: str = "",
) -> int:
    """A driver on a lane; returns the row."""
    row = world.row(world.spawn(Kind.VEHICLE, body, name="car", x=0.0, y=0.0, speed=speed))
    keep_lane(
        world,
        row,
        world.roads.row(lane),
        s,
        desired_speed=desired_speed,
        route=[world.roads.row(name) for name in route.split()],
    )
    return row


def ego(world: World, x: float, y: float, *, yaw: float = 0.0, speed: float = 0.0) -> int:
    """Somebody who drives himself; returns the row."""
    return world.row(world.spawn(Kind.EGO, CAR, name="ego", x=x, y=y, yaw=yaw, speed=speed, gear=Gear.NEUTRAL))
