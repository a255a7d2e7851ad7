"""The choice of stamps, without a far side."""

from __future__ import annotations

from typing import Literal

import pytest

from rosbridge_sim.graph.stamps import Stamps, says_simulated


@pytest.mark.parametrize(("choice", "began_at"), [("sim", []), ("wall", [0.0])])
def test_choice_of_the_user_holds_from_the_start_whatever_a_bridge_says(
    choice: Literal["sim", "wall"], began_at: list[float]
) -> None:
    seen: list[float] = []
    stamps = Stamps(choice, seen.append)
    assert not stamps.is_open
    for is_simulated in (True, False):
        stamps.settle(3.0, is_simulated=is_simulated)
    assert seen == began_at
    assert stamps.is_wall is (choice == "wall")


@pytest.mark.parametrize("first", [True, False])
def test_first_word_of_a_bridge_holds(*, first: bool) -> None:
    seen: list[float] = []
    stamps = Stamps("auto", seen.append)
    assert (stamps.is_open, stamps.is_wall, seen) == (True, False, [])
    stamps.settle(3.0, is_simulated=first)
    stamps.settle(4.0, is_simulated=not first)
    assert (stamps.is_open, stamps.is_wall) == (False, not first)
    assert seen == [3.0] * (not first)


@pytest.mark.parametrize("value", ["true", " true ", "1", "1.0"])
def test_value_that_programs_take_for_true(value: str) -> None:
    assert says_simulated(value)


@pytest.mark.parametrize(
    "value",
    [
        "",
        '""',
        "null",
        "false",
        "0",
        "2",
        '"true"',
        "[1]",
        "{}",
        "nonsense",
        "9" * 5_000,
        "[" * 100_000,
        None,
        True,
        1,
        [],
    ],
)
def test_value_that_is_not_true(value: object) -> None:
    assert not says_simulated(value)
