"""Traffic of ours for the comparison with SUMO: the same starts and routes for both, and our side of the figures.

A *demand* is a list of starts, each with the lanes that the vehicle is going to drive on. `ours` builds the world for
it. Nothing here needs SUMO.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from rosbridge_sim.world.drivers.lane_position import LaneStart, keep_lanes
from rosbridge_sim.world.drivers.route_choice import RouteChoice
from rosbridge_sim.world.geometry.planar import FloatArray
from rosbridge_sim.world.roads.roads import Roads
from rosbridge_sim.world.roads.signal_plan import Controller, Lamp, Light, Phase, SignalPlan
from rosbridge_sim.world.state.world import DT, Body, Kind, World
from rosbridge_sim.world.step import step
from scripts.bench.sumo_network import Network

CAR = Body()

QUEUE_LINE = 300.0
"""Place of the stop line of `queue_roads`, east [m]."""

QUEUE_RED = 40.0
"""Length of its red, in which the queue comes to rest [s]."""

QUEUE_GREEN = 90.0
"""Length of its green [s]: enough for thirty cars."""

QUEUE_SPACING = 7.5
"""Distance from car to car as they are put down [m]: SUMO's 5 m and 2.5 m between them."""

START_SPEED = 5.0
"""Speed at the start where nothing else is said [m/s]."""

SAMPLE = 10
"""Frames from one look at the lanes to the next: 0.2 s, in which no car crosses a junction."""


@dataclass(frozen=True, slots=True)
class Start:
    """A vehicle at its start.

    Attributes:
        lane: row of a lane that is no way through a junction.
        s: arc length of the middle of the rear axle [m].
        speed: [m/s].
        route: rows of the lanes that it takes, the first one `lane`.
    """

    lane: int
    s: float
    speed: float = START_SPEED
    route: tuple[int, ...] = ()


Demand = Sequence[Start]


@dataclass(frozen=True, slots=True)
class Flow:
    """Figures of traffic over some time.

    Attributes:
        speed: mean over all vehicles and all of the time [m/s].
        edges_per_hour: ends of edges that all vehicles together have passed in an hour.
        removed: vehicles that the simulator has taken out because they were stuck; ours takes out none.
    """

    speed: float
    edges_per_hour: float
    removed: int = 0


def queue_roads(kmh: float = 50.0) -> tuple[Roads, SignalPlan]:
    """Return a straight road to the east with a stop line at `QUEUE_LINE`, and its light.

    Args:
        kmh: speed limit [km/h].
    """
    ends = [0.0, QUEUE_LINE, QUEUE_LINE + 20.0, QUEUE_LINE + 1500.0]
    lines = [np.array([(a, 0.0, 0.0), (b, 0.0, 0.0)]) for a, b in pairwise(ends)]
    roads = Roads(
        ["before", "inside", "behind"], lines, [[1], [2], []], [3.5] * 3, [kmh / 3.6] * 3, is_stop=[True, False, False]
    )
    phases = (
        Phase(round(QUEUE_RED / DT), (int(Lamp.RED),)),
        Phase(round(QUEUE_GREEN / DT), (int(Lamp.GREEN),)),
    )
    light = Light("light", lanes=(1,), x=QUEUE_LINE)
    return roads, SignalPlan(roads, [light], [Controller("light", 1, ((0,),), phases, (round(3.0 / DT),))])


def queue_at_light(num: int) -> list[Start]:
    """Return vehicles that stand in a row before the light of `queue_roads`, the first one first.

    Args:
        num: number of vehicles, at most 30.
    """
    first = QUEUE_LINE - 2.0 - CAR.length
    return [Start(0, first - QUEUE_SPACING * i, 0.0, (0, 1, 2)) for i in range(num)]


def spread(
    network: Network, num: int, *, seed: int = 0, apart: float = 12.0, speed: float = START_SPEED
) -> list[Start]:
    """Return starts at random places on the edges of a map, without routes.

    Args:
        network: the map.
        num: number of vehicles.
        seed: of the choice.
        apart: least distance from one to the next on a lane [m].
        speed: at the start [m/s].

    Raises:
        ValueError: there is not so much room.
    """
    roads = network.roads
    lanes = [lane for edge in network.edges for lane in edge.lanes]
    places = [(lane, float(s)) for lane in lanes for s in np.arange(6.0, roads.length[lane] - 6.0, apart)]
    if num > len(places):
        raise ValueError(f"expected at most {len(places)} vehicles on this map, got {num}")
    chosen = np.random.default_rng(seed).permutation(len(places))[:num]
    return [Start(lane, s, speed) for lane, s in (places[i] for i in chosen.tolist())]


def evenly(network: Network, num: int, speed: float) -> list[Start]:
    """Return starts with equal distances on all lanes of a loop, without routes.

    Args:
        network: the map.
        num: number of vehicles.
        speed: at the start [m/s].
    """
    roads = network.roads
    lanes = np.array([lane for edge in network.edges for lane in edge.lanes])
    end = np.cumsum(roads.length[lanes])
    at = (np.arange(num) + 0.5) * end[-1] / num
    which = end.searchsorted(at, side="right")
    before = end[which] - roads.length[lanes[which]]
    return [Start(int(lanes[i]), float(s), speed) for i, s in zip(which, at - before, strict=True)]


def ours(roads: Roads, plan: SignalPlan | None, demand: Demand, seed: int = 0) -> World:
    """Return a world with the vehicles of a demand; without routes, chance chooses theirs.

    Args:
        plan: their lights.
        demand: where the vehicles start.
        seed: of the world.
    """
    world = World(seed)
    world.lay_roads(roads, plan)
    with world.room_for(len(demand)):
        uids = [world.spawn(Kind.VEHICLE, CAR, name="npc", x=0.0, y=0.0, speed=each.speed) for each in demand]
    keep_lanes(
        world,
        [LaneStart(world.row(uid), each.lane, each.s) for uid, each in zip(uids, demand, strict=True)],
    )
    return world


def plan_routes(world: World, demand: Demand, length: float) -> list[Start]:
    """Return a demand with the routes that our drivers are going to choose.

    Args:
        world: from `ours`, before its first step.
        demand: the same.
        length: of the routes, at least [m].
    """
    rows = np.arange(len(demand))
    choice = RouteChoice(world, rows)
    lanes = [np.array([each.lane for each in demand], dtype=np.int64)]
    left = np.full(len(demand), float(length))
    for turn in range(1, 100_000):
        following = choice.choose(rows, lanes[-1], np.full(len(demand), turn))
        lanes.append(following)
        left -= np.where(following >= 0, world.roads.length[following], np.inf)
        if (left < 0.0).all():
            break
    routes = np.stack(lanes, axis=1).tolist()
    return [
        Start(each.lane, each.s, each.speed, tuple(lane for lane in route if lane >= 0))
        for each, route in zip(demand, routes, strict=True)
    ]


def measure_flow(world: World, network: Network, *, settle: float, seconds: float) -> Flow:
    """Return the figures of our traffic.

    Args:
        world: from `ours`; it moves on.
        network: its map.
        settle: time before the measurement [s].
        seconds: time of the measurement.
    """
    for _ in range(round(settle / DT)):
        step(world)
    edge_of = np.array(network.edge_of_lane)
    rows = world.rows(Kind.VEHICLE)
    total, passed = 0.0, 0
    num = round(seconds / DT / SAMPLE)
    for _ in range(num):
        before = edge_of[world.lane[rows]]
        for _ in range(SAMPLE):
            step(world)
            total += float(world.speed[rows].mean())
        passed += int(np.count_nonzero((before >= 0) & (edge_of[world.lane[rows]] != before)))
    return Flow(total / (num * SAMPLE), passed * 3600.0 / seconds)


def discharge(num: int, kmh: float = 50.0, seed: int = 0) -> FloatArray:
    """Return when the front bumpers of a queue pass the stop line after the light turns green, (num,) [s].

    Args:
        num: number of vehicles.
        kmh: speed limit [km/h].
        seed: of the world.
    """
    roads, plan = queue_roads(kmh)
    world = ours(roads, plan, queue_at_light(num), seed)
    rows = world.rows(Kind.VEHICLE)
    nose = CAR.length / 2 + CAR.centre
    times = np.full(num, np.nan)
    for _ in range(round(QUEUE_RED / DT)):
        step(world)
    before = world.x[rows] + nose
    for frame in range(1, round(QUEUE_GREEN / DT)):
        step(world)
        after = world.x[rows] + nose
        at = np.flatnonzero((before < QUEUE_LINE) & (after >= QUEUE_LINE))
        times[at] = (frame - (after[at] - QUEUE_LINE) / (after[at] - before[at])) * DT
        before = after
        if not np.isnan(times).any():
            break
    return times
