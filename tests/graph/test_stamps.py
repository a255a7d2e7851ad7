"""Choice of the time source of stamps, without a far bridge."""

from __future__ import annotations

from typing import Literal

import pytest

from rosbridge_sim.graph.stamps import Stamps, says_simulated


@pytest.mark.parametrize(("choice", "began_at"), [("sim", []), ("wall", [0.0])])
def test_setting_of_the_user_takes_precedence_over_a_bridge(
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
def test_first_answer_of_a_bridge_decides(*, first: bool) -> None:
    seen: list[float] = []
    stamps = Stamps("auto", seen.append)
    assert (stamps.is_open, stamps.is_wall, seen) == (True, False, [])
    stamps.settle(3.0, is_simulated=first)
    stamps.settle(4.0, is_simulated=not first)
    assert (stamps.is_open, stamps.is_wall) == (False, not first)
    assert seen == [3.0] * (not first)


@pytest.mark.parametrize("value", ["true", " true ", "1", "1.0"])
def test_truthy_use_sim_time_values_mean_simulated_time(value: str) -> None:
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
def test_other_use_sim_time_values_mean_wall_clock_time(value: object) -> None:
    assert not says_simulated(value)
