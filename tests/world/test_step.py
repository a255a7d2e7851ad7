from __future__ import annotations

import math
from typing import Any

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from rosbridge_sim.world.state.commands import command, shift
from rosbridge_sim.world.state.placement import place_ghost, teleport
from rosbridge_sim.world.state.world import Body, Gear, Kind, Mode, World
from rosbridge_sim.world.step import step
from tests.world.road_factory import signalled

CAR = Body()
PATH = np.array([[0.0, 0.0], [20.0, 0.0], [20.0, 20.0], [0.0, 20.0]])


def test_a_step_is_one_frame() -> None:
    world = World()
    for frame in range(1, 6):
        step(world)
        assert world.frame == frame


def test_command_applies_to_the_next_step() -> None:
    world = World()
    row = world.row(world.spawn(Kind.EGO, CAR, name="ego", x=0.0, y=0.0))
    command(world, row, mode=Mode.PEDALS, throttle=1.0, steer=0.0)
    step(world)
    assert world.speed[row] > 0.0
    assert world.x[row] > 0.0


def test_lights_of_a_frame_are_those_of_its_time() -> None:
    """A client that plans by the signal's timing sees green in the frame in which drivers get it."""
    roads, plan = signalled(green=5, yellow=2)
    world = World()
    world.lay_roads(roads, plan)
    alone = World()
    alone.lay_roads(roads, plan)
    seen = set()
    for frame in range(1, 40):
        step(world)
        alone.signals.advance(frame)
        assert world.signals.frame == world.frame == frame
        assert world.signals.shown.tolist() == alone.signals.shown.tolist()
        seen.add(tuple(world.signals.shown.tolist()))
    assert len(seen) == 4


ACTIONS = st.one_of(
    st.tuples(st.just("step"), st.integers(1, 12)),
    st.tuples(st.just("ego"), st.floats(-50.0, 50.0)),
    st.tuples(st.just("straight"), st.floats(-20.0, 20.0)),
    st.tuples(st.just("path"), st.floats(0.0, 60.0)),
    st.tuples(st.just("loop"), st.floats(0.0, 60.0)),
    st.tuples(st.just("remove"), st.integers(0, 9)),
    st.tuples(st.just("teleport"), st.floats(-9.0, 9.0)),
    st.tuples(st.just("ghost"), st.floats(-9.0, 9.0)),
    st.tuples(st.just("gear"), st.sampled_from(Gear)),
    st.tuples(st.just("pedals"), st.floats(-1.0, 2.0)),
    st.tuples(st.just("speed"), st.floats(-5.0, 50.0)),
    st.tuples(st.just("accel"), st.floats(-12.0, 5.0)),
    st.tuples(st.just("clear"), st.none()),
)


def spawn(world: World, action: str, value: float) -> None:
    if action == "ego":
        world.spawn(Kind.EGO, CAR, name="ego", x=value, y=-value, yaw=value)
    elif action == "straight":
        world.spawn(Kind.VEHICLE, CAR, name="npc", x=value, y=value, speed=value, yaw=value)
    else:
        is_loop = action == "loop"
        world.spawn(Kind.PEDESTRIAN, CAR, name="man", x=0.0, y=9.0, speed=value, path=PATH, is_loop=is_loop)


def handle(world: World, row: int, action: str, value: Any) -> None:  # noqa: ANN401 - as drawn
    if action == "gear":
        shift(world, row, value)
    elif action == "pedals":
        command(world, row, mode=Mode.PEDALS, throttle=value, brake=-value, steer=value)
    elif action == "speed":
        command(world, row, mode=Mode.SPEED, speed=value, steer=-value)
    else:
        command(world, row, mode=Mode.ACCEL, accel=value, steer=value / 10)


def play(world: World, actions: list[tuple[str, Any]]) -> None:
    """Carry out drawn actions; those that name nobody who is there do nothing."""
    for action, value in actions:
        egos = world.rows(Kind.EGO)
        if action == "step":
            for _ in range(value):
                step(world)
        elif action in {"ego", "straight", "path", "loop"}:
            spawn(world, action, value)
        elif action == "clear":
            world.clear()
        elif action in {"remove", "teleport", "ghost"}:
            row = list(world.placed())[int(value) % len(world)] if len(world) else None
            if row is not None and action == "remove":
                world.remove(int(world.uid[row]))
            elif row is not None:
                put = place_ghost if action == "ghost" else teleport
                put(world, row, x=value, y=1.0, z=2.0, yaw=value, speed=value)
        elif len(egos):
            handle(world, int(egos[-1]), action, value)


PLAYS = st.lists(ACTIONS, max_size=25)


@given(PLAYS, PLAYS)
def test_the_same_calls_give_the_same_bits_with_or_without_a_snapshot_between(
    before: list[tuple[str, Any]], after: list[tuple[str, Any]]
) -> None:
    first, second, third = World(seed=1), World(seed=1), World(seed=2)
    play(first, before)
    play(second, before)
    assert first.digest() == second.digest()
    third.restore(first.snapshot())
    for world in (first, second, third):
        play(world, after)
    assert first.digest() == second.digest() == third.digest()


@given(PLAYS)
def test_arrays_stay_valid_after_any_calls(actions: list[tuple[str, Any]]) -> None:
    world = World()
    play(world, actions)
    step(world)
    assert len(world) == np.count_nonzero(world.alive)
    assert sorted(world.placed()) == np.flatnonzero(world.alive).tolist()
    assert all(world.row(int(world.uid[row])) == row for row in world.placed())
    for name in ("x", "y", "z", "yaw", "speed", "accel", "lateral_accel", "yaw_rate", "steer", "throttle", "brake"):
        assert np.isfinite(getattr(world, name)).all(), name
    assert ((world.yaw > -math.pi) & (world.yaw <= math.pi)).all()
    assert (np.abs(world.steer) <= world.max_steer + 1e-12).all()
    assert ((world.throttle >= 0.0) & (world.throttle <= 1.0)).all()
    assert ((world.brake >= 0.0) & (world.brake <= 1.0)).all()
