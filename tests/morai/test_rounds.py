"""Who drives through the town by its lights, over the bus, and who does not; and how everybody else drives there."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

import pytest

from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.participant import Participant
from rosbridge_sim.graph.topics_services import Topic
from rosbridge_sim.schema.message import Message
from tests.morai.sim_harness import Client
from tests.morai.town import Crossroads, Driver, Judge, Way
from tests.world.traffic_observers import RedRuns, Waits

pytestmark = pytest.mark.slow

LEFT_ROUND = "R1222L1 J22W1N R2223L1 J23S1W R2313L1 J13E1S R1312L1 J12N1E"


class Ears(Client):
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

    def __init__(self, *, heeds_lights: bool) -> None:
        self.town = Crossroads.built_in("town")
        self._road_map = self.town.node.scene.road_map
        self._way = Way(self._road_map, LEFT_ROUND.split())
        self._heeds_lights = heeds_lights
        self.town.put(-86.0, -1.75)
        self._ears = Ears(self.town.bus, "/ears")
        self._ears.listen("/GetTrafficLightStatus", "/Object_topic")
        self.watchers: list[Callable[[], None]] = []
        self.start()
        self.town.bus.subscribe(self._ears, "/clock", self._watch)
        self.town.client.start(time_step=100)
        self._tick: dict[str, Any] = self.town.client.tick()

    def start(self) -> None:
        """Begin a round."""
        self.driver = Driver(self.town.client, self._road_map, self._way, heeds_lights=self._heeds_lights)
        self.judge = Judge(self.town.world, self._way)

    def _watch(self, *_: object) -> None:
        """After each frame."""
        assert not len(self.town.world.contacts), "nobody touches anybody"
        self.judge.watch()
        for watch in self.watchers:
            watch()

    def go_on(self) -> None:
        """Drive for five frames; whoever watches looks at each."""
        self.driver.hear(self._ears.take())
        self.driver.drive(self._tick["vehicle_status"])
        self._tick = self.town.client.tick()


def drive_round(*, heeds_lights: bool) -> Rounds:
    rounds = Rounds(heeds_lights=heeds_lights)
    while not rounds.driver.is_done and rounds.town.world.frame < 25_000:
        rounds.go_on()
    assert rounds.driver.is_done
    return rounds


LIGHTS = ["TL22WL", "TL23SL", "TL13E", "TL12N"]


def test_client_that_obeys_the_lights_runs_no_red_light() -> None:
    rounds = drive_round(heeds_lights=True)
    judge = rounds.judge
    assert [name for name, _ in judge.passed] == LIGHTS
    assert judge.red == [], judge.passed
    assert rounds.town.world.frame * 0.02 < 400.0


def test_client_that_ignores_the_lights_is_detected() -> None:
    judge = drive_round(heeds_lights=False).judge
    assert [name for name, _ in judge.passed] == LIGHTS
    assert len(judge.red) >= 2, judge.passed


def test_town_traffic_runs_no_red_light_and_never_gets_stuck_in_ten_minutes() -> None:
    rounds = Rounds(heeds_lights=True)
    world = rounds.town.world
    reds, waits = RedRuns(world), Waits(world)
    num_rounds = 0
    rounds.watchers += [reds.watch, waits.watch]
    while world.frame < 30_000:
        rounds.go_on()
        if rounds.driver.is_done:
            assert rounds.judge.red == []
            num_rounds += 1
            rounds.start()
    assert (len(waits.distance), reds.num) == (24, 0)
    assert reds.num_passed > 400
    assert waits.longest.max() < 100.0, "two cycles"
    assert waits.distance.min() > 1_000.0
    assert num_rounds >= 2
