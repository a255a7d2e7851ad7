"""Routes, and the chance that chooses where there is none."""

from __future__ import annotations

from rosbridge_sim.world.drivers.lane_position import keep_lane
from rosbridge_sim.world.state.world import Kind
from rosbridge_sim.world.step import step
from tests.world.lane_drives import lane_of, world_of
from tests.world.road_factory import CAR, car, ring


def ways(others: int = 0) -> str:
    """The lanes that somebody comes through in forty seconds."""
    world = world_of(ring())
    row = car(world, "a", 1.0, speed=10.0)
    for i in range(others):
        car(world, "d", 5.0 + 15.0 * i, speed=5.0)
    seen = "a"
    for _ in range(2000):
        step(world)
        seen += lane_of(world, row) if lane_of(world, row) != seen[-1] else ""
    return seen


def planned(seed: int) -> str:
    """The lanes that he has in mind at the start."""
    world = world_of(ring(), seed=seed)
    row = car(world, "a", 1.0)
    return "".join(world.roads.ids[lane] for lane in world.int_block("lane", "ahead_5")[:, row])


def test_random_choices_depend_only_on_the_seed() -> None:
    assert ways().startswith(planned(0)[:4])
    assert ways(others=2).startswith(planned(0)[:4])
    assert len({planned(seed) for seed in range(20)}) == 4, "two choices in five lanes"
    assert planned(2**70) == planned(2**70)


def test_route_is_followed_and_random_choices_go_on_after_it() -> None:
    world = world_of(ring())
    row = car(world, "a", 30.0, speed=10.0, route="a c e a b d")
    seen = "a"
    while len(seen) < 7:
        step(world)
        seen += lane_of(world, row) if lane_of(world, row) != seen[-1] else ""
    assert seen == "aceabda"


def test_route_can_repeat() -> None:
    world = world_of(ring())
    row = world.row(world.spawn(Kind.VEHICLE, CAR, name="car", x=0.0, y=0.0, speed=5.0))
    keep_lane(world, row, 0, 1.0, route=[0, 2, 4], is_loop=True)
    seen = "a"
    while len(seen) < 7:
        step(world)
        seen += lane_of(world, row) if lane_of(world, row) != seen[-1] else ""
    assert seen == "aceacea"
