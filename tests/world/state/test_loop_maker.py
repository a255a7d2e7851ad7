"""The places where worlds look for compiled loops."""

from typing import Any

from rosbridge_sim.world.contacts.collisions import PAIR_LOOPS
from rosbridge_sim.world.followers.lane_following import LANE_LOOPS
from rosbridge_sim.world.people.people import PEOPLE_LOOPS
from rosbridge_sim.world.scoring import SCORE_LOOPS
from rosbridge_sim.world.state.loop_maker import LoopMaker
from rosbridge_sim.world.vehicle.dynamics import CAR_LOOPS


def test_each_kind_of_loops_has_a_place_of_its_own_and_arrays_work_without() -> None:
    places: list[LoopMaker[Any]] = [CAR_LOOPS, LANE_LOOPS, PAIR_LOOPS, PEOPLE_LOOPS, SCORE_LOOPS]
    assert len(set(places)) == len(places)
    assert [place.make for place in places] == [None] * len(places)
    place, other = LoopMaker[int](), LoopMaker[int]()
    place.make = 3
    assert other.make is None
