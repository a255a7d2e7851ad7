"""World w of a batch is equal, to the bit, to the same world alone, whatever is done to both."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from copy import copy, deepcopy
from typing import Any

import numpy as np
import pytest

from rosbridge_sim.scenarios.catalogue import BUILT_IN
from rosbridge_sim.shell.files.library import DiskLibrary
from rosbridge_sim.simulator.scene.scene import Scene
from rosbridge_sim.world.demand import LaneSlots, keep_clear
from rosbridge_sim.world.drivers.lane_position import LaneStart, keep_lanes
from rosbridge_sim.world.many_worlds.batch import MAX_ROWS, OneOfMany
from rosbridge_sim.world.many_worlds.world_set import WorldSet
from rosbridge_sim.world.state.commands import command
from rosbridge_sim.world.state.placement import teleport
from rosbridge_sim.world.state.world import Body, Dynamics, Gear, Kind, Mode, Snapshot, World
from rosbridge_sim.world.step import step

LIBRARY = DiskLibrary()
CAR = BUILT_IN.find("2015_Kia_K5")
WANDER = 0.15


def open_scene(world: World, scenario: str, traffic: int) -> Scene:
    scene = Scene(world, LIBRARY, LIBRARY.scenario(scenario), ego_gear=Gear.DRIVE)
    add_traffic(scene, traffic)
    return scene


def add_traffic(scene: Scene, num: int) -> None:
    world, slots = scene.world, scene.world.roads.derived(LaneSlots.of)
    assert CAR is not None
    free = np.flatnonzero(keep_clear(world, slots, 8.0))
    chosen = free[np.random.default_rng(world.seed).permutation(len(free))[:num]]
    with world.room_for(len(chosen)):
        rows = scene.add_vehicles([CAR] * len(chosen), slots.speed[chosen])
        places = zip(rows.tolist(), slots.lane[chosen].tolist(), slots.s[chosen].tolist(), strict=True)
        keep_lanes(world, [LaneStart(row, lane, s, wander=WANDER) for row, lane, s in places])


class Hand:
    """Does the same random things to a world, wherever its columns are."""

    def __init__(self, scene: Scene, seed: int, traffic: int) -> None:
        self.scene, self.world, self.traffic = scene, scene.world, traffic
        self._rng = np.random.default_rng(seed)
        self._saved: Snapshot = self.world.snapshot()

    def act(self) -> None:
        what = self._rng.integers(14)
        world, rng = self.world, self._rng
        if what == 0:
            self.scene.reset(int(rng.integers(5)))
            add_traffic(self.scene, self.traffic)
        elif what == 1:
            self._saved = world.snapshot()
        elif what == 2:
            world.restore(self._saved)
        elif what == 3 and len(world) < 2 * self.traffic + 40:
            x, y = (float(each) for each in rng.normal(size=2) * 30.0)
            world.spawn(Kind.OBSTACLE, Body(length=2.0, width=2.0), name="box", x=x, y=y)
        elif what == 4:
            uids = [uid for uid in world.uid[world.alive].tolist() if uid]
            if uids:
                world.remove(uids[int(rng.integers(len(uids)))])
        elif what == 5:
            world.start_scoring()
        elif what == 6 and len(world.rows(Kind.EGO)):
            row = int(world.rows(Kind.EGO)[0])
            car = next((row for row in np.flatnonzero(world.has_lane).tolist()), row)
            x, y = float(world.x[car]), float(world.y[car])
            teleport(world, row, x=x, y=y + 1.0, z=float(world.z[car]), yaw=float(world.yaw[car]), speed=5.0)
        for row in world.rows(Kind.EGO).tolist():
            steer, throttle, brake, speed, accel = rng.random(5).tolist()
            command(
                world,
                row,
                mode=Mode(int(rng.integers(1, 4))),
                steer=0.2 * steer - 0.1,
                throttle=throttle,
                brake=brake * (brake > 0.8),
                speed=15.0 * speed,
                accel=3.0 * accel - 1.0,
            )


def compare(
    scenario: str,
    *,
    num: int,
    rounds: int,
    traffic: int,
    most_frames: int = 11,
    num_alone: int | None = None,
    **options: object,
) -> None:
    """Do random things to worlds together and to each alone; all states are equal after each round.

    Args:
        num_alone: worlds that are driven alone, too, from the first to the last one evenly; None for all. A world alone
            costs five times its share of the worlds together.
    """
    numbers = np.linspace(0, num - 1, num_alone or num).round().astype(int).tolist()
    alone = {i: World(seed=i, **options) for i in numbers}  # type: ignore[arg-type]
    many = [OneOfMany(seed=seed, **options) for seed in range(num)]  # type: ignore[arg-type]
    hands = [Hand(open_scene(world, scenario, traffic), world.seed, traffic) for world in (*alone.values(), *many)]
    worlds = WorldSet(many)
    frames = np.random.default_rng(num).integers(1, most_frames + 1, rounds)
    for round_, num_frames in enumerate(frames.tolist()):
        for hand in hands:
            hand.act()
        worlds.advance(num_frames)
        for i, world in alone.items():
            for _ in range(num_frames):
                step(world)
            assert many[i].digest() == world.digest(), f"round {round_}, world {i}"
            assert many[i].model_figures() == world.model_figures(), f"round {round_}, world {i}"


CASES = [
    ("loop", {"has_impacts": True}),
    ("town", {}),
    ("hills", {"dynamics": Dynamics.SINGLE_TRACK, "is_creeping": True}),
    ("motorway", {"dynamics": Dynamics.SINGLE_TRACK}),
]


@pytest.mark.slow
@pytest.mark.parametrize(("scenario", "options"), CASES)
def test_worlds_of_a_batch_equal_the_same_worlds_alone(scenario: str, options: dict[str, Any]) -> None:
    compare(scenario, num=3, rounds=12, traffic=8, most_frames=7, num_alone=2, **options)


@pytest.mark.long
@pytest.mark.parametrize(("scenario", "options"), [*CASES, ("roundabout", {}), ("demo", {}), ("parking", {})])
def test_many_worlds_of_a_batch_equal_the_same_worlds_alone(scenario: str, options: dict[str, object]) -> None:
    compare(scenario, num=64, rounds=80, traffic=12, most_frames=40, num_alone=8, **options)  # 1,600 frames


@pytest.mark.slow
@pytest.mark.parametrize("num", [1, 7])
def test_number_of_worlds_changes_no_bit(num: int) -> None:
    compare("roundabout", num=num, rounds=4, traffic=6, num_alone=min(num, 3))


@pytest.mark.slow
@pytest.mark.parametrize("scenario", ["loop", "motorway"])
def test_world_that_forgets_in_each_frame_what_it_has_derived_does_the_same(scenario: str) -> None:
    kept, forgetful = World(seed=1), World(seed=1)
    for world in (kept, forgetful):
        open_scene(world, scenario, 12)
        world.start_scoring()
    for _ in range(80):
        step(kept)
        step(forgetful)
        forgetful.touch()
    assert kept.digest() == forgetful.digest()


def test_crowded_world_steps_alone_and_the_others_together() -> None:
    worlds = [OneOfMany(seed=seed) for seed in range(3)]
    for world in worlds:
        open_scene(world, "loop", 2)
    for i in range(MAX_ROWS):
        worlds[1].spawn(Kind.OBSTACLE, Body(), name="box", x=100.0 + 9.0 * i, y=500.0)
    together = WorldSet(worlds)
    together.advance(2)
    assert [world.batch is None for world in worlds] == [False, True, False]
    worlds[1].clear()
    together.advance()
    assert all(world.batch is not None for world in worlds)
    assert [world.frame for world in worlds] == [3, 3, 3]


def test_only_world_of_a_set_steps_alone_and_does_the_same_beside_another() -> None:
    worlds = [OneOfMany(seed=3) for _ in range(3)]
    for world in worlds:
        open_scene(world, "loop", 5)
    for together in (WorldSet(worlds[:1]), WorldSet(worlds[1:])):
        together.advance(12)
    assert [world.batch is None for world in worlds] == [True, False, False]
    assert worlds[0].digest() == worlds[1].digest()


def test_worlds_of_different_phases_are_in_different_batches() -> None:
    worlds = [OneOfMany(seed=seed) for seed in range(4)]
    scenes = [open_scene(world, "loop", 2) for world in worlds]
    together = WorldSet(worlds)
    together.advance(3)
    scenes[2].reset(7)
    together.advance()
    assert [world.frame for world in worlds] == [4, 4, 1, 4]
    assert worlds[2].batch is not worlds[0].batch
    assert worlds[1].batch is worlds[0].batch


def test_worlds_of_different_maps_move_in_one_set() -> None:
    names = ("loop", "hills", "loop")
    many, alone = [OneOfMany(seed=1) for _ in names], [World(seed=1) for _ in names]
    for worlds in (many, alone):
        for world, name in zip(worlds, names, strict=True):
            open_scene(world, name, 3)
    together = WorldSet(many)
    together.advance(12)
    for world in alone:
        for _ in range(12):
            step(world)
    assert [world.digest() for world in many] == [world.digest() for world in alone]
    assert many[0].batch is many[2].batch


def test_change_of_one_world_leaves_the_others_as_they_are() -> None:
    worlds = [OneOfMany(seed=seed) for seed in range(3)]
    scenes = [open_scene(world, "town", 4) for world in worlds]
    WorldSet(worlds).advance(5)
    before = [worlds[i].digest() for i in (0, 2)]
    scenes[1].reset(9)
    worlds[1].spawn(Kind.OBSTACLE, Body(), name="box", x=0.0, y=0.0)
    worlds[1].clear()
    assert [worlds[i].digest() for i in (0, 2)] == before


def pickled(world: OneOfMany) -> OneOfMany:
    again: OneOfMany = pickle.loads(pickle.dumps(world))  # noqa: S301 - our own
    return again


@pytest.mark.parametrize("make", [copy, deepcopy, pickled])
def test_copy_of_a_world_leaves_its_set_and_goes_on_as_it_does(make: Callable[[OneOfMany], OneOfMany]) -> None:
    worlds = [OneOfMany(seed=seed) for seed in range(2)]
    for world in worlds:
        open_scene(world, "loop", 5)
    together = WorldSet(worlds)
    together.advance(7)
    copied = make(worlds[1])
    together.advance(12)
    assert (type(copied), copied.batch, copied.frame) == (OneOfMany, None, 7)
    for _ in range(12):
        step(copied)
    assert copied.digest() == worlds[1].digest()


def test_pickle_of_a_world_is_as_small_after_a_drive_as_before_it() -> None:
    world = OneOfMany()
    open_scene(world, "town", 5)
    sizes = []
    for num in (0, 60):
        for _ in range(num):
            step(world)
        sizes.append(len(pickle.dumps(world)))
    assert max(sizes) < 1_000_000
    assert sizes[1] < sizes[0] + 10_000
    copied = pickled(world)
    for _ in range(20):
        step(world)
        step(copied)
    assert copied.digest() == world.digest()


def test_world_with_fewer_rows_than_another_has_its_impacts() -> None:
    alone = [World(seed=seed, has_impacts=True) for seed in range(2)]
    many = [OneOfMany(seed=seed, has_impacts=True) for seed in range(2)]
    for worlds in (alone, many):
        for world in worlds:
            open_scene(world, "loop", 2)
        x, y = (float(each[worlds[1].rows(Kind.EGO)[0]]) for each in (worlds[1].x, worlds[1].y))
        worlds[1].spawn(Kind.OBSTACLE, Body(length=2.0, width=2.0), name="box", x=x + 6.0, y=y)
        for _ in range(3):
            worlds[0].spawn(Kind.OBSTACLE, Body(length=2.0, width=2.0), name="box", x=x, y=y + 500.0)
        command(worlds[1], int(worlds[1].rows(Kind.EGO)[0]), mode=Mode.PEDALS, steer=0.0, throttle=1.0)
    WorldSet(many).advance(60)
    for world in alone:
        for _ in range(60):
            step(world)
    assert alone[1].speed[alone[1].rows(Kind.EGO)[0]] < 0.5  # it was thrown back
    assert [world.digest() for world in many] == [world.digest() for world in alone]


def test_world_that_comes_back_into_a_batch_has_its_lights() -> None:
    worlds = [OneOfMany(seed=seed) for seed in range(2)]
    scenes = [open_scene(world, "town", 2) for world in worlds]
    together, start = WorldSet(worlds), worlds[1].snapshot()
    together.advance(3)
    scenes[1].reset(3)
    together.advance(2)  # its slot is empty
    worlds[1].restore(start)
    worlds[1].signals.set_phase(0, 1)
    together.advance(5)
    batch = worlds[1].batch
    assert batch is not None
    assert batch is worlds[0].batch
    num = len(worlds[1].lights.shown)
    shown = batch.signals.shown[worlds[1].slot * num : (worlds[1].slot + 1) * num]
    assert shown.tolist() == worlds[1].signals.shown.tolist()
