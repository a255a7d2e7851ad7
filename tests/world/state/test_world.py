from __future__ import annotations

import math
import pickle
import tracemalloc
from typing import Any

import numpy as np
import pytest

from rosbridge_sim.records import replace
from rosbridge_sim.shell.files.library import DiskLibrary
from rosbridge_sim.world.state.commands import command
from rosbridge_sim.world.state.entity_arrays import BOOLS, FLOATS, INTS, LARGE, EntityArrays
from rosbridge_sim.world.state.placement import teleport
from rosbridge_sim.world.state.world import MAX_UID, Body, Dynamics, Gear, Kind, Mode, World
from rosbridge_sim.world.step import step

CAR = Body()
MAN = Body.box(0.5, 0.6, 1.75)
CIRCLE = np.array([[math.cos(a), math.sin(a)] for a in np.linspace(0.0, 2 * math.pi, 40, endpoint=False)]) * 30.0


def populate(world: World) -> None:
    """One of everything: an ego, a car on a loop, a car that goes straight, a walker on a short path, a box."""
    ego = world.spawn(Kind.EGO, Body(), name="ego", x=0.0, y=0.0, uid=0)
    command(world, world.row(ego), mode=Mode.SPEED, steer=0.1, speed=8.0)
    world.spawn(Kind.VEHICLE, Body(), name="round", x=30.0, y=0.0, speed=9.0, path=CIRCLE, is_loop=True)
    world.spawn(Kind.VEHICLE, Body(), name="straight", x=0.0, y=50.0, yaw=0.3, speed=12.0)
    world.spawn(Kind.PEDESTRIAN, MAN, name="walker", x=5.0, y=5.0, speed=1.4, path=np.array([[5.0, 5.0], [9.0, 5.0]]))
    world.spawn(Kind.OBSTACLE, Body.box(1.0, 1.0, 1.0), name="box", x=-5.0, y=5.0)


def car(world: World, **figures: Any) -> int:  # noqa: ANN401 - whatever spawn takes
    usual: dict[str, Any] = {"name": "car", "x": 0.0, "y": 0.0}
    return world.spawn(Kind.VEHICLE, CAR, **(usual | figures))


def run(world: World, num: int) -> None:
    for _ in range(num):
        step(world)


def test_spawned_entity_has_its_values() -> None:
    world = World()
    uid = car(world, name="taxi", x=1.0, y=2.0, z=3.0, yaw=3 * math.pi, speed=4.0)
    row = world.row(uid)
    assert uid in world
    assert len(world) == 1
    assert (world.x[row], world.y[row], world.z[row], world.speed[row]) == (1.0, 2.0, 3.0, 4.0)
    assert world.yaw[row] == pytest.approx(math.pi)
    assert (world.names[row], world.bodies[row], world.kind[row], world.uid[row]) == ("taxi", Body(), Kind.VEHICLE, uid)
    assert world.alive.all()


def test_every_column_is_declared_and_as_long_as_the_world() -> None:
    world = World()
    populate(world)
    for names, kind in ((FLOATS, np.float64), (INTS, np.int64), (BOOLS, np.bool_)):
        for name in names:
            column = getattr(world, name)
            assert column.dtype == kind
            assert column.shape == (world.n,)
            assert name in EntityArrays.__annotations__


def test_ids_count_up_and_leave_zero_to_the_ego() -> None:
    world = World()
    assert [car(world), car(world), car(world, uid=0), car(world)] == [1, 2, 0, 3]


def test_id_is_not_reused_until_reset() -> None:
    world = World()
    seen = set()
    for i in range(100):
        uid = car(world, uid=500 if i == 50 else None)
        assert uid not in seen
        seen.add(uid)
        world.remove(uid)
    world.clear()
    assert car(world) not in seen
    world.reset()
    assert car(world) == 1


def test_free_explicit_id_can_be_used_again() -> None:
    world = World()
    assert car(world, uid=7) == 7
    with pytest.raises(ValueError, match="7 is in use"):
        car(world, uid=7)
    world.remove(7)
    assert car(world, uid=7) == 7


def test_ids_end_with_int32() -> None:
    world = World()
    assert car(world, uid=MAX_UID) == MAX_UID
    with pytest.raises(ValueError, match="reset"):
        car(world)
    assert car(world, uid=3) == 3


@pytest.mark.parametrize(
    "wrong",
    [
        {"x": math.nan},
        {"y": math.inf},
        {"z": -math.inf},
        {"x": 1e10},
        {"yaw": math.nan},
        {"speed": math.nan},
        {"speed": 2e3},
        {"uid": -1},
        {"uid": MAX_UID + 1},
        {"uid": 0},
        {"path": [[0.0, 0.0]]},
        {"path": [[0.0, 0.0], [math.nan, 1.0]]},
        {"path": [1.0, 2.0]},
        {"path": [[0.0, 0.0], [1.0, 1.0]], "speed": -1.0},
        {"kind": Kind.EGO, "path": [[0.0, 0.0], [1.0, 1.0]]},
        {"kind": Kind.EGO, "body": MAN},
        {"kind": Kind.EGO, "gear": 5},
        {"kind": 4},
    ],
)
def test_invalid_argument_changes_nothing(wrong: dict[str, Any]) -> None:
    world = World()
    populate(world)
    before = world.digest()
    right: dict[str, Any] = {"kind": Kind.VEHICLE, "body": Body(), "name": "wrong", "x": 1.0, "y": 1.0}
    with pytest.raises(ValueError):  # noqa: PT011 - each names its own figure
        world.spawn(**(right | wrong))
    assert world.digest() == before


def test_unknown_ids_are_key_errors() -> None:
    world = World()
    with pytest.raises(KeyError):
        world.row(1)
    with pytest.raises(KeyError):
        world.remove(1)


def test_rows_of_a_kind_come_in_order_of_spawning() -> None:
    world = World()
    first, second, third = car(world, uid=9), car(world, uid=3), car(world, uid=6)
    world.remove(first)
    fourth = car(world, uid=1)  # in the row of the first
    assert world.row(fourth) == 0
    assert world.uid[world.rows(Kind.VEHICLE)].tolist() == [second, third, fourth]
    assert world.rows(Kind.EGO).tolist() == []


def test_rows_are_stable_and_free_rows_are_reused() -> None:
    world = World()
    uids = [car(world) for _ in range(100)]
    rows = {uid: world.row(uid) for uid in uids}
    for uid in uids[10:90]:
        world.remove(uid)
    assert all(world.row(uid) == rows[uid] for uid in uids[:10] + uids[90:])
    for _ in range(80):
        car(world)
    assert world.n == 100
    assert sorted(world.placed()) == list(range(100))


def test_free_rows_at_the_end_are_dropped() -> None:
    world = World()
    uids = [car(world) for _ in range(50)]
    world.remove(uids[48])
    world.remove(uids[49])
    assert world.n == 48
    for uid in uids[:48]:
        world.remove(uid)
    assert (world.n, len(world)) == (0, 0)
    step(world)
    assert car(world) == 51


def test_growing_keeps_all_values() -> None:
    world = World()
    for i in range(1000):
        car(world, x=float(i), name=str(i))
    assert world.x.tolist() == list(range(1000))
    assert world.names == [str(i) for i in range(1000)]


def test_growth_of_a_large_world_moves_nothing() -> None:
    def place_in_memory() -> int:
        where: int = world.x.__array_interface__["data"][0]
        return where

    world = World(0)
    with world.room_for(LARGE):
        pass
    before = place_in_memory()
    with world.room_for(20_000):
        assert place_in_memory() == before
        assert not world.x.any()


def test_free_row_holds_zeros() -> None:
    world = World()
    populate(world)
    run(world, 10)
    row = world.row(1)
    world.remove(1)
    assert not world.alive[row]
    for block in (world._floats, world._ints, world._bools):
        assert not block[:, row].any()
    assert world.paths.num_live == 1


def test_removal_does_not_change_other_entities() -> None:
    """To the bit, whatever happens to memory: neighbours in the arrays become gaps, the paths move together."""
    with_all, without = World(), World()
    for world in (with_all, without):
        populate(world)
        for i in range(20):
            car(world, x=30.0, y=float(i), path=CIRCLE, is_loop=True, speed=5.0 + i)
        run(world, 30)
    gone = [2, *range(5, 24, 3), *range(6, 24, 3)]
    for uid in gone:
        without.remove(uid)
    for _ in range(100):
        step(with_all)
        step(without)
    for uid in (0, 1, 3, 4, 7, 10, 22):
        a, b = with_all.row(uid), without.row(uid)
        for name in ("x", "y", "z", "yaw", "speed", "accel", "yaw_rate", "arc", "steer", "throttle"):
            assert getattr(with_all, name)[a] == getattr(without, name)[b], (uid, name)


def test_same_calls_give_the_same_digest_and_others_a_different_one() -> None:
    def played(*, speed: float = 5.0, seed: int = 0, name: str = "x", num: int = 20) -> str:
        world = World(seed)
        populate(world)
        car(world, speed=speed, name=name)
        run(world, num)
        return world.digest()

    assert played() == played()
    others = {played(), played(speed=math.nextafter(5.0, 6.0)), played(seed=1), played(name="y"), played(num=21)}
    assert len(others) == 5


def test_restored_world_goes_on_to_the_bit() -> None:
    world = World(seed=5)
    populate(world)
    run(world, 37)
    world.remove(2)
    saved = pickle.loads(pickle.dumps(world.snapshot()))  # noqa: S301 - our own
    start = world.digest()
    run(world, 120)
    car(world, path=CIRCLE, speed=3.0)
    run(world, 10)
    end = world.digest()
    for target in (world, world, World(seed=9)):
        target.restore(saved)
        assert target.digest() == start
        run(target, 120)
        car(target, path=CIRCLE, speed=3.0)
        run(target, 10)
        assert target.digest() == end


def test_reset_is_a_new_world() -> None:
    world = World(seed=4)
    empty = world.digest()
    populate(world)
    run(world, 5)
    world.reset()
    assert (world.frame, len(world), world.digest()) == (0, 0, empty)
    with pytest.raises(ValueError, match="non-negative"):
        world.reset(seed=-1)
    assert world.digest() == empty
    world.reset(seed=6)
    assert world.digest() == World(seed=6).digest()


def test_clear_keeps_time_and_ids() -> None:
    world = World()
    populate(world)
    run(world, 5)
    world.clear()
    assert (world.frame, len(world), world.n, world.paths.num) == (5, 0, 0, 0)
    assert car(world) == 5


def test_ego_starts_in_the_given_gear() -> None:
    world = World()
    uid = world.spawn(Kind.EGO, Body(), name="ego", x=0.0, y=0.0, gear=Gear.PARK)
    assert (world.gear[world.row(uid)], world.mode[world.row(uid)]) == (Gear.PARK, Mode.PEDALS)


def test_entity_joins_its_path_at_the_nearest_point() -> None:
    world = World()
    path = np.array([[0.0, 0.0, 0.0], [10.0, 0.0, 0.0], [18.0, 0.0, 6.0]])  # the second half climbs
    row = world.row(car(world, x=14.0, y=3.0, path=path, speed=1.0, yaw=2.0))
    assert (world.x[row], world.y[row], world.z[row]) == pytest.approx((14.0, 0.0, 3.0))
    assert (world.arc[row], world.path_length[row], world.yaw[row]) == pytest.approx((15.0, 20.0, 0.0))


def test_flat_path_has_the_given_height() -> None:
    world = World()
    row = world.row(car(world, z=7.0, path=np.array([[0.0, 0.0], [10.0, 0.0]]), speed=1.0))
    run(world, 10)
    assert world.z[row] == 7.0


def test_adding_and_removing_keeps_memory_constant() -> None:
    world = World()
    populate(world)

    def cycle(num: int) -> None:
        for i in range(num):
            uid = car(world, path=CIRCLE if i % 2 else None, is_loop=True, speed=3.0)
            if i % 10 == 0:
                step(world)
            world.remove(uid)

    tracemalloc.start()
    try:
        cycle(40)
        before = tracemalloc.get_traced_memory()[0]
        cycle(80)
        grown = tracemalloc.get_traced_memory()[0] - before
    finally:
        tracemalloc.stop()
    assert grown < 4_000
    assert world._floats.shape[1] == 32
    assert len(world.paths._keys) <= 512


@pytest.mark.slow
def test_adding_and_removing_thousands_keeps_the_arrays_small() -> None:
    world = World()
    populate(world)
    for i in range(2_000):
        world.remove(car(world, path=CIRCLE if i % 2 else None, speed=3.0))
    assert world._floats.shape[1] == 32
    assert len(world.paths._keys) <= 512
    assert world._next_uid == 2_005


def test_teleporting_off_a_path_frees_it() -> None:
    world = World()
    row = world.row(car(world, path=CIRCLE, is_loop=True, speed=3.0))
    teleport(world, row, x=1.0, y=2.0, z=0.0, yaw=0.0, speed=5.0)
    assert world.paths.num_live == 0
    step(world)
    assert (world.x[row], world.y[row]) == (1.1, 2.0)
    world.remove(1)
    assert len(world) == 0


@pytest.mark.parametrize("num_free", [0, 3])
def test_reserved_room_changes_only_the_cost(num_free: int) -> None:
    one, other = World(), World()
    for world in (one, other):
        for i in range(40):
            world.spawn(Kind.VEHICLE, Body(), name="x", x=10.0 * i, y=0.0)
        for uid in range(5, 5 + num_free):
            world.remove(uid)
    with one.room_for(100):
        assert one.n == 140 - num_free
        for world in (one, other):
            for i in range(90):
                world.spawn(Kind.VEHICLE, Body(), name="y", x=10.0 * i, y=5.0, yaw=4.0)
    assert one.n == other.n == 130 - num_free
    for _ in range(2):
        assert one.digest() == other.digest()
        step(one)
        step(other)


def test_unused_reserved_room_is_released() -> None:
    world = World()
    world.spawn(Kind.VEHICLE, Body(), name="x", x=0.0, y=0.0)
    before = world.digest()
    with pytest.raises(ValueError, match="x"), world.room_for(1_000):
        world.spawn(Kind.VEHICLE, Body(), name="x", x=math.nan, y=0.0)
    assert (world.n, world.digest()) == (1, before)


def test_names_are_released_with_their_entities() -> None:
    world = World()
    tracemalloc.start()
    for i in range(5):
        world.remove(world.spawn(Kind.VEHICLE, Body(), name=f"{i}" * 1_000_000, x=0.0, y=0.0))
    size, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert size < 1_000_000


@pytest.mark.parametrize("dynamics", list(Dynamics))
@pytest.mark.parametrize("is_hilly", [False, True])
def test_many_entities_at_once_are_those_spawned_one_by_one(dynamics: Dynamics, *, is_hilly: bool) -> None:
    worlds = [World(3, dynamics, has_impacts=is_hilly) for _ in range(2)]
    for world in worlds:
        if is_hilly:
            world.lay_roads(DiskLibrary().map("hills").roads)
        for uid in range(1, 6):
            world.spawn(Kind.VEHICLE, CAR, name="old", x=1.0, y=uid, uid=uid, speed=1.0)
        world.remove(2)
        world.remove(4)
    one, other = worlds
    models = [("car", CAR), ("other", replace(CAR, length=9.0)), ("car", CAR), ("car", CAR)]
    uids, speed = [40, 7, 2, 41], np.array([0.0, 3.5, -2.0, 1.0])
    names, bodies = [name for name, _ in models], [body for _, body in models]
    rows = one.spawn_all(Kind.VEHICLE, names, bodies, uids, speed=speed)
    for uid, (name, body), v in zip(uids, models, speed.tolist(), strict=True):
        other.spawn(Kind.VEHICLE, body, name=name, x=0.0, y=0.0, z=0.0, speed=v, uid=uid)
    assert rows.tolist() == [other.row(uid) for uid in uids]
    assert one.digest() == other.digest()
    assert one.placed_uids == other.placed_uids
    assert one.spawn(Kind.VEHICLE, CAR, name="next", x=0.0, y=0.0) == 42


@pytest.mark.parametrize(
    ("uids", "speed", "why"),
    [([1, 50], 0.0, "in use"), ([50, 50], 0.0, "twice"), ([50, -1], 0.0, "expected 0"), ([50, 51], np.nan, "speed")],
)
def test_many_entities_are_all_added_or_none(uids: list[int], speed: float, why: str) -> None:
    world = World()
    world.spawn(Kind.VEHICLE, CAR, name="old", x=0.0, y=0.0, uid=1)
    before = world.digest()
    with pytest.raises(ValueError, match=why):
        world.spawn_all(Kind.VEHICLE, ["car"] * 2, [CAR] * 2, uids, speed=np.array([0.0, speed]))
    assert world.digest() == before
