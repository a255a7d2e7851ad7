"""Shares of turns, for drivers without a route."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rosbridge_sim.world.drivers.route_choice import RouteChoice
from rosbridge_sim.world.roads.roads import Roads
from rosbridge_sim.world.roads.signal_plan import SignalPlan
from rosbridge_sim.world.roads.turn_shares import TurnShares
from rosbridge_sim.world.saved_world import from_plain, to_plain
from rosbridge_sim.world.state.world import World
from tests.world.road_factory import arc, built_in, car, line, make

NUM = 20_000


def choices(shares: TurnShares | None, roads: Roads, lane: str) -> dict[str, float]:
    """How often each successor of a lane is chosen in many choices of one driver."""
    world = World(5, turn_shares=shares)
    world.lay_roads(roads)
    choice = RouteChoice(world, np.array([car(world, lane, 1.0)]))
    which, turn, at = np.zeros(NUM, dtype=np.int64), np.arange(NUM), np.full(NUM, roads.row(lane))
    chosen = choice.choose(which, at, turn)
    alone = [choice.choose(which[:1], at[:1], turn[i : i + 1])[0] for i in range(50)]
    assert chosen[:50].tolist() == alone, "one by one as all at once"
    return {roads.ids[other]: float((chosen == other).mean()) for other in roads.successors(roads.row(lane))}


def fork() -> Roads:
    """A street with two ways to the left, one straight on and one to the right, and a lane that only turns left."""
    left = arc(0, 12, 12, -90, 90)
    return make(
        street=(line((-50, 0), (0, 0)), "tight wide on right"),
        tight=(arc(0, 8, 8, -90, 90), ""),
        wide=(left, ""),
        on=(line((0, 0), (40, 2)), ""),
        right=(arc(0, -8, 8, 90, -90), ""),
        only=(line((-50, 0), (0, 0)), "wide"),
    )


@pytest.mark.parametrize(
    ("shares", "wanted"),
    [
        (None, {"tight": 0.25, "wide": 0.25, "on": 0.25, "right": 0.25}),
        (TurnShares(1, 2, 1), {"tight": 0.125, "wide": 0.125, "on": 0.5, "right": 0.25}),
        (TurnShares(300, 0, 100), {"tight": 0.375, "wide": 0.375, "on": 0.0, "right": 0.25}),
    ],
)
def test_turns_have_their_shares_and_lanes_of_one_kind_divide_theirs(
    shares: TurnShares | None, wanted: dict[str, float]
) -> None:
    got = choices(shares, fork(), "street")
    assert got == pytest.approx(wanted, abs=4.0 * math.sqrt(0.25 / NUM))
    assert all((got[name] == 0.0) == (share == 0.0) for name, share in wanted.items())


def test_turn_without_a_share_is_chosen_where_there_is_no_other() -> None:
    assert choices(TurnShares(0, 1, 0), fork(), "only") == {"wide": 1.0}


@pytest.mark.parametrize(
    ("name", "lane", "num"), [("town", "R1011L1", 3), ("roundabout", "EA", 3), ("parking", "AS", 2)]
)
def test_shares_hold_on_the_built_in_maps(name: str, lane: str, num: int) -> None:
    roads = built_in(name).roads
    got = choices(TurnShares(1, 2, 1), roads, lane)
    turns = {other: roads.turn[roads.row(other)] for other in got}
    weights = {other: 2.0 if abs(turn) < 0.5 else 1.0 for other, turn in turns.items()}
    assert len(got) == num
    wanted = {other: weight / sum(weights.values()) for other, weight in weights.items()}
    assert got == pytest.approx(wanted, abs=4.0 * math.sqrt(0.25 / NUM))


def test_shares_are_state_of_the_world() -> None:
    worlds = [World(turn_shares=shares) for shares in (None, TurnShares(1, 1, 1), TurnShares(1, 2, 1))]
    assert len({world.digest() for world in worlds}) == len(worlds)
    empty = World()
    for world in worlds:
        plain = to_plain(world.snapshot())
        empty.restore(from_plain(plain, Roads(), SignalPlan(Roads())))
        assert (empty.turn_shares, empty.digest()) == (world.turn_shares, world.digest())
    with pytest.raises(ValueError, match=r"world\.turn_shares: expected three shares, or none"):
        from_plain(plain | {"turn_shares": np.array([1.0])}, Roads(), SignalPlan(Roads()))
    with pytest.raises(ValueError, match="not all 0"):
        from_plain(plain | {"turn_shares": np.zeros(3)}, Roads(), SignalPlan(Roads()))


@pytest.mark.parametrize("shares", [(0, 0, 0), (1, -1, 1), (math.nan, 1, 1), (1, math.inf, 1)])
def test_shares_out_of_bounds_are_refused(shares: tuple[float, float, float]) -> None:
    with pytest.raises(ValueError, match="expected three numbers"):
        TurnShares(*shares)
