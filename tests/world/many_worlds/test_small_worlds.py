"""Worlds of all sorts of entities on a small map: each of a batch does what it does alone."""

from __future__ import annotations

import numpy as np

from rosbridge_sim.world.many_worlds.batch import OneOfMany
from rosbridge_sim.world.many_worlds.world_set import WorldSet
from rosbridge_sim.world.roads.lane_conflicts import LaneConflicts
from rosbridge_sim.world.roads.roads import Roads
from rosbridge_sim.world.state.commands import command
from rosbridge_sim.world.state.world import Body, Kind, Mode, World
from rosbridge_sim.world.step import step
from tests.world.lane_drives import BUS
from tests.world.road_factory import CAR, keep_lane, line, make

MAN = Body.box(0.45, 0.55, 1.7)
NUM_FRAMES = 60


def joined_streets() -> Roads:
    """Two pairs of lanes, each of which joins into one at x = 80."""
    return make(
        a=(line((0, 0), (80, 0)), "c"),
        b=(line((0, 5.6), (80, 0)), "c"),
        c=(line((80, 0), (400, 0)), ""),
        d=(line((0, 50), (80, 50)), "f"),
        e=(line((0, 55.6), (80, 50)), "f"),
        f=(line((80, 50), (400, 50)), ""),
    )


def fill(world: World, roads: Roads, seed: int) -> None:
    """Drivers before the joins, an ego that comes to some who wait for it, and people at and on the road."""
    rng = np.random.default_rng(seed)
    world.lay_roads(roads)
    for lane in range(6):
        for s in (8.0 + rng.uniform(0.0, 4.0), 40.0 + rng.uniform(0.0, 6.0)):
            body = BUS if rng.random() < 0.3 else CAR
            row = world.row(world.spawn(Kind.VEHICLE, body, name="car", x=0.0, y=0.0, speed=rng.uniform(3.0, 9.0)))
            keep_lane(world, row, lane, s, wander=0.15)
    ego = world.row(world.spawn(Kind.EGO, CAR, name="ego", x=rng.uniform(20.0, 40.0), y=24.0, speed=8.0))
    command(world, ego, mode=Mode.PEDALS, steer=0.0, throttle=0.3)
    for x in rng.uniform(30.0, 90.0, 4):
        world.spawn(Kind.PEDESTRIAN, MAN, name="one", x=x, y=26.5, speed=1.5, start_within=rng.uniform(5.0, 30.0))
        world.spawn(Kind.PEDESTRIAN, MAN, name="one", x=x, y=3.0, yaw=-1.5, speed=1.5)
        path = np.array([[x + 60.0, -6.0], [x + 60.0, 9.0]])
        world.spawn(Kind.PEDESTRIAN, MAN, name="two", x=x + 60.0, y=-6.0, path=path, speed=1.3, yields=True)
    world.spawn(Kind.OBSTACLE, Body.box(1.0, 1.0, 1.0), name="box", x=180.0, y=51.0)


def test_each_world_of_a_batch_joins_waits_and_crosses_as_it_does_alone() -> None:
    roads, seeds = joined_streets(), (3, 4, 5)
    alone, many = [World(seed=seed) for seed in seeds], [OneOfMany(seed=seed) for seed in seeds]
    for worlds in (alone, many):
        for world, seed in zip(worlds, seeds, strict=True):
            fill(world, roads, seed)
    waiting = [int(np.count_nonzero(world.start_within)) for world in alone]
    WorldSet(many).advance(NUM_FRAMES)
    assert all(world.batch is not None for world in many)
    for world in alone:
        for _ in range(NUM_FRAMES):
            step(world)
    assert roads.derived(LaneConflicts).joins.lanes.tolist() == [[0, 1], [3, 4]]
    assert [world.digest() for world in many] == [world.digest() for world in alone]
    started = [int(np.count_nonzero(world.start_within)) for world in alone]
    assert any(0 < now < before for now, before in zip(started, waiting, strict=True))
    assert len({tuple(world.accel[world.has_lane].tolist()) for world in alone}) == 3
