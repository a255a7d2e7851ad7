"""Plans in a recording: decoded for listeners alone, in parts that delay nobody."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import pytest

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.participant import Participant
from rosbridge_sim.graph.policy import Guest, Policy, Rule
from rosbridge_sim.graph.topics_services import Topic
from rosbridge_sim.schema.message import Message
from rosbridge_sim.simulator.replays.recorded_drive import Recording
from rosbridge_sim.simulator.replays.recorded_plans import RecordedPlan
from rosbridge_sim.simulator.replays.recording_builder import RecordingBuilder, Then
from rosbridge_sim.simulator.replays.replayed_plans import AT_ONCE
from tests.simulator.replays.replay_harness import FILE, PAUSE, PLAY, STOP, replay
from tests.simulator.sim_harness import Client, ManualReader, SimHarness, make_store

FRAME_NS = 20_000_000
STRING = "std_msgs/String"


class PlanRecordings:
    """A recording of a second with plans that are texts, one in each frame.

    Attributes:
        decoded: what has been decoded, in order.
        bulk: bytes that each message has beside its text.
    """

    def __init__(self, *topics: str) -> None:
        self.topics = topics
        self.decoded: list[str] = []
        self.bulk = 0

    def read(self, name: str, reading: RecordingBuilder, then: Then) -> None:
        del name
        ego = make_store().message("morai_msgs/EgoVehicleStatus")
        for i in range(50):
            stamps = (0, (i + 1) * FRAME_NS)
            reading.take_ego(0, ego.check({"position": {"x": float(i)}}, 0), stamps)
        drive = reading.finish()
        times = [i * FRAME_NS for i in range(50)]
        plans = tuple(
            [
                RecordedPlan(
                    topic, STRING, times, [f"{i:3}".encode() + bytes(self.bulk) for i in range(50)], self._decode
                )
                for topic in self.topics
            ]
        )
        then(Recording(drive.name, drive.egos, plans=plans), 100.0)

    def _decode(self, raw: bytes) -> object:
        self.decoded.append(raw[:3].decode().strip())
        if raw.startswith(b"  7"):
            raise DocumentError("it does not fit its type")
        return {"data": self.decoded[-1]}


class PlanFixture:
    """A simulator in synchronous mode that replays such a recording, and its master."""

    def __init__(self, *topics: str, bulk: int = 0) -> None:
        self.reader = ManualReader()
        self.recordings = PlanRecordings(*topics)
        self.recordings.bulk = bulk
        self.harness = SimHarness("parked", start="sync", recordings=self.recordings, reader=self.reader)
        self.client = self.harness.client()
        self.client.start()

    def play(self) -> None:
        assert replay(self.client, PLAY, FILE, "drive")


def texts(client: Client, topic: str = "/plan") -> list[str]:
    return [message["data"] for message in client.messages(topic)]


def subscribe(client: Client, bus: Bus, topic: str = "/plan") -> None:
    """Subscribe as a peer does: what is kept comes first."""

    def hear(topic: Topic, message: Message, _sender: Participant, _now: float) -> None:
        client.heard.append((topic.name, {"data": message.value.data}))

    subscription = bus.subscribe(client, topic, hear, type_name=STRING)
    for message in subscription.topic.latched:
        hear(subscription.topic, message, client, 0.0)


def test_nothing_is_decoded_while_nobody_listens() -> None:
    fixture = PlanFixture("/plan", "/other")
    fixture.play()
    for _ in range(5):
        fixture.client.tick()
    assert fixture.recordings.decoded == []
    assert fixture.harness.bus.find_topic("/plan") is not None


def test_listener_gets_each_message_with_its_frame_and_others_are_not_decoded() -> None:
    fixture = PlanFixture("/plan", "/other")
    listener = fixture.harness.client()
    subscribe(listener, fixture.harness.bus)
    fixture.play()
    for _ in range(9):
        fixture.client.tick()
    assert texts(listener) == ["0", "1", "2", "3", "4", "5", "6", "8"]  # the one that is broken is left out
    assert fixture.recordings.decoded == [str(i) for i in range(9)]


def test_newcomer_gets_the_last_message_once_and_goes_on_with_the_next() -> None:
    fixture = PlanFixture("/plan")
    early, late = fixture.harness.client(), fixture.harness.client()
    subscribe(early, fixture.harness.bus)
    fixture.play()
    fixture.client.tick()
    early.leave()
    for _ in range(3):
        fixture.client.tick()
    assert fixture.recordings.decoded == ["0"]
    assert replay(fixture.client, PAUSE)
    subscribe(late, fixture.harness.bus)  # nothing moves, and it has it at once
    third = fixture.harness.client()
    subscribe(third, fixture.harness.bus)
    assert texts(late) == texts(third) == ["3"]
    assert fixture.recordings.decoded == ["0", "3"]
    assert replay(fixture.client, PLAY)
    fixture.client.tick()
    assert texts(late) == texts(third) == ["3", "4"]


def test_tick_waits_for_messages_that_the_reader_decodes() -> None:
    fixture = PlanFixture("/plan", bulk=AT_ONCE)
    listener, bus = fixture.harness.client(), fixture.harness.bus
    subscribe(listener, bus)
    fixture.play()
    fixture.reader.hand_over()
    fixture.client.tick()  # it shows the same position
    answers: list[object] = []
    for i in range(3):
        bus.call(fixture.client, "/SyncModeWaitForTick", {"request": {"user_id": "me"}}, answers.append, now=0.0)
        assert len(answers) == i
        fixture.reader.hand_over()
        assert len(answers) == i + 1
    assert texts(listener) == ["0", "1", "2", "3"]


def test_many_messages_are_decoded_in_parts_that_take_turns() -> None:
    fixture = PlanFixture(*(f"/plan/{i}" for i in range(10)), bulk=90_000)
    listener = fixture.harness.client()
    for i in range(10):
        subscribe(listener, fixture.harness.bus, f"/plan/{i}")
    fixture.play()
    sizes = []
    while fixture.reader.waiting:
        before = len(listener.heard)
        fixture.reader.hand_over()
        sizes.append(len(listener.heard) - before)
    assert sizes == [3, 3, 3, 1]


def test_end_of_the_replay_drops_what_is_being_decoded_and_opens_the_gate() -> None:
    fixture = PlanFixture("/plan", bulk=AT_ONCE)
    listener = fixture.harness.client()
    subscribe(listener, fixture.harness.bus)
    fixture.play()
    assert replay(fixture.client, STOP)
    fixture.reader.hand_over()
    assert not fixture.reader.waiting
    assert texts(listener) == []
    assert fixture.client.tick()["tick_status"]


def test_in_real_time_the_replay_goes_on_and_only_the_newest_message_waits() -> None:
    reader, recordings = ManualReader(), PlanRecordings("/plan")
    recordings.bulk = AT_ONCE
    harness = SimHarness("parked", recordings=recordings, reader=reader)
    client, listener = harness.client(), harness.client()
    subscribe(listener, harness.bus)
    assert replay(client, PLAY, FILE, "drive")
    harness.run(0.5)  # the thread decodes the first one
    assert len(reader.waiting) == 1
    reader.hand_over()
    reader.hand_over()
    assert not reader.waiting
    shown = [int(text) for text in texts(listener)]
    assert len(shown) == 2
    assert shown[1] > 20


@pytest.mark.parametrize("name", ["/bad name", "/" + "x" * 9_001, "/a\0b", ""])
def test_bad_name_of_a_topic_is_left_out(name: str) -> None:
    fixture = PlanFixture(name, "/plan")
    listener = fixture.harness.client()
    subscribe(listener, fixture.harness.bus)
    fixture.play()
    fixture.client.tick()
    assert texts(listener) == ["0"]


class RestrictedClient(Client, Guest):
    """A client that may not publish everywhere."""

    policy = Policy(publish=Rule(deny=("/closed/*",)))


def test_plan_is_not_replayed_where_the_caller_may_not_publish() -> None:
    fixture = PlanFixture("/closed/plan", "/plan")
    caller = RestrictedClient(fixture.harness.bus, "/restricted")
    assert replay(caller, PLAY, FILE, "drive")
    assert publishers(fixture.harness.bus, "/closed/plan") == []
    assert publishers(fixture.harness.bus, "/plan") == ["/replay"]
    assert any("1 topics with plans are left out: not allowed to publish there" in text for _, text in caller.told)


def publishers(bus: Bus, name: str) -> Sequence[str]:
    topic: Any = bus.find_topic(name)
    return [] if topic is None else [owner.name for owner in topic.publishers]
