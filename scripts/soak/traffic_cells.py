"""The cells of the traffic soak: maps, numbers of vehicles and people, and the worlds that begin with them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rosbridge_sim.records import replace
from rosbridge_sim.scenarios.catalogue import BUILT_IN, default_model
from rosbridge_sim.shell.files.library import DiskLibrary
from rosbridge_sim.simulator.scene.scene import Scene
from rosbridge_sim.simulator.scene.scene_limits import FIRST_EGO
from rosbridge_sim.world.drivers.lane_position import LaneStart, keep_lanes
from rosbridge_sim.world.drivers.lane_wander import USUAL_WANDER
from rosbridge_sim.world.geometry.planar import IntArray
from rosbridge_sim.world.roads.lane_conflicts import LaneConflicts
from rosbridge_sim.world.roads.roads import Roads
from rosbridge_sim.world.roads.signal_plan import SignalPlan
from rosbridge_sim.world.state.world import Body, Gear, Kind, World

MINUTES = 10.0
"""Length of a cell."""

CELLS: dict[str, tuple[tuple[int, int], ...]] = {
    "town": ((3, 0), (24, 0), (100, 0), (200, 0), (300, 0), (60, 40), (200, 40)),
    "loop": ((50, 0), (200, 0), (500, 0)),
    "motorway": ((50, 0), (200, 0), (500, 0)),
    "track": ((10, 0), (60, 0)),
    "hills": ((6, 0), (20, 0)),
    "roundabout": ((16, 0), (40, 0), (80, 0)),
    "parking": ((4, 0), (10, 0)),
}
"""Map -> numbers of vehicles and of people: from free to jammed."""

SPACE = 8.0
"""Between two vehicles at the start [m]."""

OTHERS = ("Van", "Bus", "Truck")
"""Words in the names of models that every fifth vehicle has."""

NARROW = ("parking",)
"""Maps whose lanes are too narrow for more than cars."""


@dataclass(frozen=True, slots=True)
class Cell:
    """Ten minutes of traffic.

    Attributes:
        map_name: of a built-in map.
        num: number of vehicles.
        seed: of the world and of the places.
        people: number of pedestrians: the first ones of the scenario with the name of the map.
    """

    map_name: str
    num: int
    seed: int
    people: int = 0


def world_of(cell: Cell) -> World:
    """Return the world in which a cell begins.

    Args:
        cell: what is wanted.
    """
    library = DiskLibrary()
    road_map = library.map(cell.map_name)
    world = World(cell.seed)
    if cell.people or cell.map_name in NARROW:
        scenario = library.scenario(cell.map_name)
        parked = tuple(spawn for spawn in scenario.vehicles if spawn.driver is None and cell.map_name in NARROW)
        kept = replace(scenario, vehicles=parked, pedestrians=scenario.pedestrians[: cell.people])
        Scene(world, library, kept, ego_gear=Gear.PARK)
        world.remove(FIRST_EGO)
    return populate(road_map.roads, road_map.plan, cell, world)


def populate(roads: Roads, plan: SignalPlan | None, cell: Cell, world: World | None = None) -> World:
    """Return a world with the vehicles of a cell, or as many as there is room for, all at rest.

    Args:
        plan: their lights.
        cell: what is wanted.
        world: one with these lanes, to add to; None for a new one.
    """
    chance = np.random.default_rng(cell.seed)
    if world is None:
        world = World(cell.seed)
    if world.roads is not roads:
        world.lay_roads(roads, plan)
    conflicts = roads.derived(LaneConflicts)
    others = [
        model.body
        for model in BUILT_IN.models
        if model.kind == Kind.VEHICLE and any(word in model.name for word in OTHERS)
    ]
    car = default_model(Kind.VEHICLE).body
    share = 0.0 if cell.map_name in NARROW else 0.2
    starts: list[tuple[int, float, Body]] = []
    for lane in np.flatnonzero(np.isinf(conflicts.wait_point) & (conflicts.shared == 0.0)).tolist():
        s = 0.5 * SPACE
        while True:
            body = others[int(chance.integers(len(others)))] if others and chance.random() < share else car
            if s + body.length + 0.5 * SPACE > roads.length[lane]:
                break
            starts.append((lane, s + 0.5 * body.length - body.centre, body))
            s += body.length + SPACE
    chosen: IntArray = chance.permutation(len(starts))[: cell.num]
    with world.room_for(len(chosen)):
        rows = [world.row(world.spawn(Kind.VEHICLE, starts[i][2], name="npc", x=0.0, y=0.0)) for i in chosen.tolist()]
    places = [(row, starts[i][0], starts[i][1]) for row, i in zip(rows, chosen.tolist(), strict=True)]
    keep_lanes(world, [LaneStart(row, lane, s, wander=USUAL_WANDER) for row, lane, s in places])
    return world


def cells_of(hours: float, maps: Sequence[str], first_seed: int) -> list[Cell]:
    """Return the cells of a run: all maps and densities with one seed after the other, until the time is full.

    Args:
        hours: simulated, in all.
        maps: names of maps.
        first_seed: of the first round.
    """
    sorts = [(name, *nums) for name in maps for nums in CELLS[name]]
    num = max(1, math.ceil(hours * 60.0 / MINUTES - 1e-9))
    chosen = [(*sorts[i % len(sorts)], first_seed + i // len(sorts)) for i in range(num)]
    return [Cell(name, vehicles, seed, people) for name, vehicles, people, seed in chosen]
