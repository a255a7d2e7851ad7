"""Written equations: what the functions compute, and that recorded equations give the same bits."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import pytest

from rosbridge_sim.world.state.recorded_equations import RECORDED, EquationRecorder
from rosbridge_sim.world.state.row_program import RowProgram
from rosbridge_sim.world.state.world import Body, Kind, World
from rosbridge_sim.world.state.written_equations import Script, WrittenOperators

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rosbridge_sim.world.vehicle.operators import Operators, V

NUMBERS = (-7.25, -math.pi, -1.0, -0.1, -0.0, 0.0, 0.3, 1.0, 2.0 / 3.0, math.pi, 9.5)


def equations(do: Operators[V], x: V, y: V) -> Sequence[V]:
    """Return something of each function and operation."""
    return [
        (2.0 * x - y) / (20.0 + y * 3.0) - 0.5,
        1.0 / (x + 30.0) + (4.0 - y) * (x - 1.0) - -x,
        do.pick(x - 0.5, y, -x),
        do.pick(y, 1.0, 0.0),
        do.least(x, y) / 7.0,
        do.most(do.least(x, 1.0), -1.0),
        do.root(do.magnitude(x)),
        do.sin(x) + do.cos(y) * do.arctan(x),
        do.wrap(x * 3.0),
        do.wrap(x),
    ]


def test_functions_give_the_bits_of_arrays() -> None:
    script = Script(2)
    function = script.compile(equations(WrittenOperators(script, is_any=True), *script.given))
    world = World()
    for _ in NUMBERS:
        world.spawn(Kind.EGO, Body(), name="ego", x=0.0, y=0.0)
    program = RowProgram(world, world.rows(Kind.EGO), "x", "speed", written_from="x")
    for other in NUMBERS:
        program.values[0], program.values[1] = NUMBERS, other
        recorder = EquationRecorder(program.num)
        results = equations(RECORDED, recorder.given(program.values[0]), recorder.given(program.values[1]))
        targets = list(np.empty((len(results), program.num)))
        fresh = RowProgram(world, world.rows(Kind.EGO), "x", "speed", written_from="x")
        recorder.finish(fresh, results, targets)
        fresh.run()
        written = [function([number, other], np.zeros(1)) for number in NUMBERS]
        assert np.array(written).T.tobytes() == np.array(targets).tobytes()


def test_only_numbers_that_are_used_again_get_names() -> None:
    script = Script(2)
    x, y = script.given
    total = 2.0 * x + y
    function = script.compile_rule([total * total - 1.0 / (y + 3.0)])
    assert function.__code__.co_varnames == ("a0", "a1", total.name)
    assert function(0.1, 0.3) == ((2.0 * 0.1 + 0.3) * (2.0 * 0.1 + 0.3) - 1.0 / (0.3 + 3.0),)


def test_function_may_be_called_again_and_again() -> None:
    script = Script(2)
    x, y = script.given
    function = script.compile([x + y, x])
    assert function([1.0, 2.0], np.zeros(1)) == (3.0, 1.0)
    assert function((0.1, 0.2), np.zeros(1)) == (0.1 + 0.2, 0.1)


def test_function_refuses_another_count_of_numbers() -> None:
    script = Script(2)
    function = script.compile([script.given[0]])
    with pytest.raises(ValueError, match="unpack"):
        function([1.0], np.zeros(1))


def test_smaller_and_greater_zero_has_no_sign() -> None:
    script = Script(1)
    do = WrittenOperators(script, is_any=True)
    (zero,) = script.given
    function = script.compile([do.least(zero, -0.0), do.most(-zero, -0.0)])
    assert not np.signbit(function([0.0], np.zeros(1)) + function([-0.0], np.zeros(1))).any()


def test_any_is_what_the_script_is_written_for() -> None:
    script = Script(1)
    for is_any in (False, True):
        assert WrittenOperators(script, is_any=is_any).is_any(script.given[0]) is is_any
