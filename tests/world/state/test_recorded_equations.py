"""Recorded equations: what they compute, and that their places in memory are used again."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rosbridge_sim.world.state.recorded_equations import RECORDED, EquationRecorder
from rosbridge_sim.world.state.row_program import RowProgram
from rosbridge_sim.world.state.world import Body, Kind, World


def program_of(num: int) -> RowProgram:
    world = World()
    for i in range(num):
        world.spawn(Kind.EGO, Body(), name="ego", x=float(i), y=1.0)
    return RowProgram(world, world.rows(Kind.EGO), "x", "speed", written_from="x")


def test_recorded_equations_give_what_they_say() -> None:
    program = program_of(3)
    recorder = EquationRecorder(3)
    x, y = recorder.given(program.values[0]), recorder.given(program.values[1])
    twice = 2.0 * x
    results = [
        (twice - y) / (1.0 + y * 3.0) - 0.5,
        RECORDED.pick(x - 1.0, y, -x),
        RECORDED.least(x, 1.0),
        RECORDED.most(x, y),
        1.0 / (x + 1.0) + RECORDED.root(x) - RECORDED.magnitude(-x),
        RECORDED.sin(x) + RECORDED.cos(x) * RECORDED.arctan(x),
        RECORDED.wrap(x * 3.0),
    ]
    targets = list(np.empty((len(results), 3)))
    recorder.finish(program, results, targets)
    program.run()
    for row, at in enumerate((0.0, 1.0, 2.0)):
        assert [target[row] for target in targets] == pytest.approx(
            [
                (2.0 * at - 1.0) / 4.0 - 0.5,
                1.0 if at > 1.0 else -at,
                min(at, 1.0),
                max(at, 1.0),
                1.0 / (at + 1.0) + math.sqrt(at) - at,
                math.sin(at) + math.cos(at) * math.atan(at),
                (3.0 * at + math.pi) % (2.0 * math.pi) - math.pi,
            ]
        )


def test_result_may_replace_what_others_still_read() -> None:
    """Targets are written last, even if they are inputs."""
    program = program_of(3)
    recorder = EquationRecorder(3)
    x, y = recorder.given(program.values[0]), recorder.given(program.values[1])
    recorder.finish(program, [y + 1.0, x + 10.0], [program.values[0], program.values[1]])
    program.run()
    assert program.values[:2].tolist() == [[2.0, 2.0, 2.0], [10.0, 11.0, 12.0]]


def test_smaller_and_greater_zero_has_no_sign() -> None:
    program = program_of(2)
    recorder = EquationRecorder(2)
    zero = recorder.given(np.array([0.0, -0.0]))
    targets = list(np.empty((2, 2)))
    recorder.finish(program, [RECORDED.least(zero, -0.0), RECORDED.most(-zero, -0.0)], targets)
    program.run()
    assert not np.signbit(np.array(targets)).any()
