"""A simulator and three fuzzed clients: nothing is raised, and an honest client is answered.

This is `scripts/soak/fuzz.py` without sockets and processes: a failing seed fails again at once, with its traceback.
"""

from __future__ import annotations

import json
from typing import NoReturn, get_args

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.peers.peer import Peer
from rosbridge_sim.graph.rosapi_services.rosapi import Rosapi
from rosbridge_sim.graph.tf.web_republisher import WebRepublisher
from rosbridge_sim.maps.road_map import RoadMap
from rosbridge_sim.protocol.outbox import BinaryFrame, Outbox, OutboxLimits
from rosbridge_sim.protocol.session import Session
from rosbridge_sim.scenarios.scenario import Scenario
from rosbridge_sim.schema.definitions.names import Generation
from rosbridge_sim.simulator.node_factory import make_node
from rosbridge_sim.simulator.simulator_node import NodeSettings
from rosbridge_sim.world.state.world import World
from scripts.soak.fuzz_frames import FrameMaker, Interface
from tests.mutations import examples
from tests.simulator.memory_recordings import MemoryRecordings
from tests.simulator.sim_harness import MemoryDataStore, MemoryLibrary, MemoryNetworks, make_store

RELEASES: dict[Generation, str] = {1: "22.R2", 2: "26.R1"}

NAMES = {
    "demo": "crowd",
    "town": "crossing",
    "loop": "elsewhere",
    "busy": "parked",
    "saved": "empty",
    "no_link": "lost",
}
"""The fuzzer's names of scenarios -> those of the test stand, which are read in no time."""


class FuzzLibrary(MemoryLibrary):
    """Scenarios in memory, under the names that the fuzzer has for those on the disk."""

    def scenario(self, name: str) -> Scenario:
        return super().scenario(NAMES.get(name, name))

    def map(self, name: str) -> RoadMap:
        return super().map("tiny" if name == "town" else name)


class FuzzedSimulator:
    """A simulator with all that a server has but its sockets, and clients whose frames are looked at."""

    def __init__(self, ros: Generation) -> None:
        self.bus = Bus(make_store(RELEASES[ros], ros))
        Rosapi(self.bus)
        self.republisher = WebRepublisher(self.bus)
        self.world = World(seed=0)
        shelf, recordings = FuzzLibrary(), MemoryRecordings()
        self.networks = MemoryNetworks()
        self.networks.tables["busy"] = {"publishers": {"/Ego_topic": {"name": "/car/state"}}}
        self.node = make_node(
            *(self.bus, self.world, shelf, shelf.scenario("demo"), NodeSettings()),
            archive=MemoryDataStore(),
            recordings=recordings,
            networks=self.networks,
        )
        recordings.record(self.bus, "drive", "/Ego_topic", "/Object_topic")
        self.now = 100.0
        for _ in range(10):
            self.pass_time()

    def pass_time(self, seconds: float = 0.02) -> None:
        """As the server's clockwork does it."""
        self.now += seconds
        self.bus.expire(self.now)
        for clock in (self.node, self.republisher):
            due = clock.next_due(self.now)
            if due is not None and due <= self.now:
                clock.advance(self.now)

    def interface(self) -> Interface:
        topics = {topic.name: topic.type.name for topic in self.bus.topics.values()}
        services = {service.name: service.type.name for service in self.bus.services.values()}
        return Interface(self.bus.store, topics, services)


class FuzzedClient:
    """One client: a peer whose outbox is emptied after each act."""

    def __init__(self, place: FuzzedSimulator) -> None:
        self.place = place
        self.outbox = Outbox(OutboxLimits(), lambda: None, lambda: None)
        self.peer = Peer(place.bus, Session(self.outbox, lambda _due: None))

    def send(self, data: bytes) -> list[dict[str, object]]:
        """What it hears: all text frames are JSON."""
        place = self.place
        self.peer.receive(data, place.now)
        self.peer.flush(place.now)
        frames = self.outbox.take(2**40)
        return [json.loads(frame, parse_constant=_refuse) for frame in frames if not isinstance(frame, BinaryFrame)]

    def do(self, data: bytes, maker: FrameMaker) -> None:
        """Send a frame, see that an error has changed nothing, and answer whatever asks for it."""
        before = self.place.world.digest()
        heard = self.send(data)
        if is_refused(data, heard):
            assert self.place.world.digest() == before, "what is refused changes nothing"
        for frame in heard:
            answer = maker.answer(frame) if frame["op"] in {"call_service", "send_action_goal"} else None
            if answer is not None:
                self.send(answer.data)


def _refuse(name: str) -> NoReturn:
    raise AssertionError(f"a bare {name} went out, which is not JSON")


def is_refused(data: bytes, heard: list[dict[str, object]]) -> bool:
    """Whether a frame held one op, and all that came of it is an error."""
    try:
        op = json.loads(data)
    except (ValueError, RecursionError):
        return False
    if not isinstance(op, dict) or op.get("op") not in ["publish", "call_service"] or len(heard) != 1:
        return False
    (frame,) = heard
    return frame.get("level") == "error" or (frame["op"] == "service_response" and frame["result"] is False)


@pytest.mark.slow
@examples(12, quick=3)
@given(seed=st.integers(0, 2**32), ros=st.sampled_from(get_args(Generation)))
def test_any_frames_raise_nothing_and_an_honest_client_is_answered(seed: int, ros: Generation) -> None:
    place = FuzzedSimulator(ros)
    honest = FuzzedClient(place)
    honest.send(b'{"op":"subscribe","topic":"/Ego_topic"}')
    maker = FrameMaker(str(seed), place.interface())
    visitors = [FuzzedClient(place) for _ in range(3)]
    for act in maker.acts(80):
        visitor = maker.chance.choice(visitors)
        if act.form == "wait":
            place.pass_time(int(act.data) / 1_000)
        elif act.form in {"text", "binary", "pieces"}:
            visitor.do(act.data, maker)
        if maker.chance.random() < 0.1:
            place.pass_time()
        if maker.chance.random() < 0.02:
            visitor.peer.leave(place.now)
            visitors[visitors.index(visitor)] = FuzzedClient(place)
    heard = honest.send(b'{"op":"call_service","service":"/rosapi/get_time","id":"honest"}')
    (answer_frame,) = (frame for frame in heard if frame["op"] == "service_response")
    assert (answer_frame["id"], answer_frame["result"]) == ("honest", True)
    for column in ("x", "y", "z", "yaw", "speed", "steer"):
        assert np.isfinite(getattr(place.world, column)[place.world.alive]).all(), column
    for visitor in (*visitors, honest):
        visitor.peer.leave(place.now)
    place.pass_time(1_000.0)
    names = {owner.name for owner in place.bus.owners()}
    assert names <= {"/rosapi", "/morai_sim", "/tf2_web_republisher", "/recordings"}
