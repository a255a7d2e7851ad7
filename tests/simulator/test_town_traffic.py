"""Drives through the town over the bus, with and without regard to lights; and its traffic."""

from __future__ import annotations

import json
from functools import cache
from typing import Any

import numpy as np
import pytest

from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.participant import Participant
from rosbridge_sim.graph.topics_services import Topic
from rosbridge_sim.schema.message import Message
from rosbridge_sim.world.scoring import read_score
from tests.simulator.sim_harness import Client
from tests.simulator.town import Crossroads, Driver, RouteLine, StopLineObserver
from tests.world.traffic_observers import RedRuns, Waits

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("loops")]

LEFT_ROUND = ["R1222L1", "J22W1N", "R2223L1", "J23S1W", "R2313L1", "J13E1S", "R1312L1", "J12N1E"]

LEGS_PAST_ONE, LEGS_PAST_TWO = 3, 4
"""Lanes of the round up to behind the first and the second of its four lights: a client that waits at each light takes
twice the time of one that does not."""


class LatestMessages(Client):
    """A client that hears only what is said last, and reads it only when asked."""

    def __init__(self, bus: Bus, name: str) -> None:
        super().__init__(bus, name)
        self._last: dict[str, Message] = {}

    def _hear(self, topic: Topic, message: Message, _sender: Participant, _now: float) -> None:
        self._last[topic.name] = message

    def take(self) -> list[tuple[str, dict[str, Any]]]:
        """What was said last on each topic since the last time."""
        heard = [(topic, json.loads(message.json)) for topic, message in self._last.items()]
        self._last.clear()
        return heard


class Rounds:
    """Somebody who drives around the block north of the avenue, in the traffic of the built-in scene, over the bus."""

    def __init__(self, *, heeds_lights: bool, way: list[str] | None = None) -> None:
        self.town = Crossroads.built_in("town")
        self._road_map = self.town.node.scene.road_map
        self._way = RouteLine(self._road_map, LEFT_ROUND if way is None else way)
        self._heeds_lights = heeds_lights
        self.town.put(-86.0, -1.75)
        self._ears = LatestMessages(self.town.bus, "/ears")
        self._ears.listen("/GetTrafficLightStatus", "/Object_topic")
        self.reds, self.waits = RedRuns(self.town.world), Waits(self.town.world)
        self.num_rounds = 0
        self.start()
        self.town.bus.subscribe(self._ears, "/clock", self._watch)
        self.town.client.start(time_step=100)
        self._tick: dict[str, Any] = self.town.client.tick()

    def start(self) -> None:
        """Begin a round."""
        self.driver = Driver(self.town.client, self._road_map, self._way, heeds_lights=self._heeds_lights)
        self.judge = StopLineObserver(self.town.world, self._way)

    def _watch(self, *_: object) -> None:
        """After each frame."""
        assert not len(self.town.world.contacts), "nobody touches anybody"
        self.judge.watch()
        self.reds.watch()
        self.waits.watch()

    def go_on(self) -> None:
        """Drive for five frames; whoever watches looks at each."""
        self.driver.hear(self._ears.take())
        self.driver.drive(self._tick["vehicle_status"])
        self._tick = self.town.client.tick()


@cache  # a round takes as long as ten other tests, and several tests look at it
def drive_round(heeds_lights: bool, num_legs: int) -> Rounds:  # noqa: FBT001 - the key of the cache
    rounds = Rounds(heeds_lights=heeds_lights, way=LEFT_ROUND[:num_legs] if heeds_lights else LEFT_ROUND)
    rounds.town.world.start_scoring()
    while not rounds.driver.is_done and rounds.town.world.frame < 25_000:
        rounds.go_on()
    assert rounds.driver.is_done
    return rounds


def drive_rounds(num_frames: int) -> Rounds:
    rounds = Rounds(heeds_lights=True)
    while rounds.town.world.frame < num_frames:
        rounds.go_on()
        if rounds.driver.is_done:
            assert rounds.judge.red == []
            rounds.num_rounds += 1
            rounds.start()
    return rounds


LIGHTS = ["TL22WL", "TL23SL", "TL13E", "TL12N"]


@pytest.mark.parametrize(
    ("num_legs", "num_lights", "most_seconds", "fewest_others"),
    [(LEGS_PAST_ONE, 1, 100.0, 10), pytest.param(LEGS_PAST_TWO, 2, 200.0, 20, marks=pytest.mark.long)],
)
def test_client_that_obeys_the_lights_runs_no_red_light(
    num_legs: int, num_lights: int, most_seconds: float, fewest_others: int
) -> None:
    rounds = drive_round(True, num_legs)  # noqa: FBT003
    judge = rounds.judge
    assert [name for name, _ in judge.passed] == LIGHTS[:num_lights]
    assert judge.red == [], judge.passed
    assert rounds.reds.num == 0
    assert rounds.reds.num_passed > fewest_others
    assert read_score(rounds.town.world, rounds.town.world.row(0)).num_stop_lines == num_lights
    assert rounds.town.world.frame * 0.02 < most_seconds


def test_client_that_ignores_the_lights_is_detected() -> None:
    judge = drive_round(False, LEGS_PAST_ONE).judge  # noqa: FBT003
    assert [name for name, _ in judge.passed] == LIGHTS
    assert len(judge.red) >= 2, judge.passed


@pytest.mark.parametrize("heeds_lights", [True, False])
def test_score_agrees_with_the_observer_and_drives_lanes_without_invasion(*, heeds_lights: bool) -> None:
    rounds = drive_round(heeds_lights, LEGS_PAST_ONE)
    judge, world = rounds.judge, rounds.town.world
    score = read_score(world, world.row(0))
    assert score.num_stop_lines == len(judge.passed) == (1 if heeds_lights else 4)
    assert score.num_red_lights == len(judge.red)
    assert (score.num_collisions, score.num_lane_invasions, score.off_road_time) == (0, 0, 0.0)
    assert score.distance > 150.0
    assert score.max_lane_offset < 0.5
    assert score.min_time_to_collision > 0.0


@pytest.mark.parametrize("num_frames", [0, pytest.param(9_000, marks=pytest.mark.long)])
def test_self_driving_ego_runs_no_red_light_and_its_score_agrees_with_the_observer(num_frames: int) -> None:
    """Until the second stop line; three minutes in the long form."""
    town = Crossroads.built_in("town")
    town.client.start(time_step=100)
    town.client.ask("/Service_MoraiEventCmd", option=1, ctrl_mode=6)
    world = town.world
    world.start_scoring()
    judge = RedRuns(world, np.array([0]))
    hits = 0

    def watch(_now: float) -> None:
        nonlocal hits
        judge.watch()
        hits += bool((world.contacts == 0).any())

    town.node.context.hooks.after_frame.append(watch)
    while world.frame < num_frames or (judge.num_passed < 2 and world.frame < 9_000):
        town.client.tick()
    score = read_score(world, 0)
    assert hits == score.num_collisions == 0
    assert score.distance > 150.0
    assert score.num_stop_lines >= judge.num_passed >= 2
    assert (score.num_red_lights, judge.num) == (0, 0)
    assert (score.num_lane_invasions, score.off_road_time) == (0, 0.0)


@pytest.mark.parametrize(
    ("num_frames", "fewest_passed", "shortest_way", "fewest_rounds"),
    [(0, 10, 20.0, 0), pytest.param(30_000, 400, 1_000.0, 2, marks=pytest.mark.long)],
    ids=["a-round", "ten-minutes"],
)
def test_town_traffic_runs_no_red_light_and_never_gets_stuck(
    num_frames: int, fewest_passed: int, shortest_way: float, fewest_rounds: int
) -> None:
    rounds = drive_rounds(num_frames) if num_frames else drive_round(True, LEGS_PAST_ONE)  # noqa: FBT003
    reds, waits = rounds.reds, rounds.waits
    assert (len(waits.distance), reds.num) == (24, 0)
    assert reds.num_passed > fewest_passed
    assert waits.longest.max() < 100.0, "two cycles"
    assert waits.distance.min() > shortest_way
    assert rounds.num_rounds >= fewest_rounds
