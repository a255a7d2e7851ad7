"""A simulator behind somebody else's rosbridge, both sides in memory: what each hears, and when."""

from __future__ import annotations

import json
import logging
from collections.abc import Callable
from contextlib import suppress
from typing import Any, Literal

import pytest

from rosbridge_sim.errors import GraphError, Reason
from rosbridge_sim.graph.attach.announcing import UNREGISTER_TIME
from rosbridge_sim.graph.attach.connection import MAX_WAITING_BYTES, PROBE, PROBE_PATIENCE, BridgeConnection
from rosbridge_sim.graph.attach.diagnostics import MAX_LINES, PERIOD
from rosbridge_sim.graph.attach.flow_control import MAX_IN_FLIGHT
from rosbridge_sim.graph.attach.mirror import OPS_PER_TURN, Mirror
from rosbridge_sim.graph.attach.rosapi_watch import LOOK_PERIOD
from rosbridge_sim.graph.attach.survey import SURVEY_DELAYS
from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.participant import Notify, Participant, explain, hold, notifier
from rosbridge_sim.graph.peer import Peer
from rosbridge_sim.graph.refusals import RefusedRequest
from rosbridge_sim.graph.rosapi import Rosapi
from rosbridge_sim.graph.stamps import Stamps
from rosbridge_sim.graph.topics_services import Call, Topic
from rosbridge_sim.protocol.outbox import Outbox, OutboxLimits
from rosbridge_sim.schema.message import Message
from tests.graph.bus_fixture import make_bus, make_peer, make_store

Frame = dict[str, Any]


class Car:
    """A node as the simulator is one: a topic, a latched topic, an input and a service."""

    name = "/car"

    def __init__(self, bus: Bus) -> None:
        self.bus = bus
        self.heard: list[object] = []
        self.callers: list[Participant] = []
        self.refusal = ""
        self.on_call: Callable[[Call], None] = lambda _call: None
        self.state = bus.advertise(self, "/state", "std_msgs/Int32", is_exclusive=True, is_on_demand=True)
        self.plate = bus.advertise(self, "/plate", "std_msgs/String", depth=1, is_exclusive=True)
        bus.subscribe(self, "/pedal", self._hear, type_name="std_msgs/Float64")
        bus.provide(self, "/honk", "std_srvs/SetBool", self._honk, is_exclusive=True)
        self.show("/plate", data="12 GA 3456")

    def notify(self, level: str, text: str) -> None:
        """Nothing is said to it."""

    def show(self, name: str, **fields: object) -> None:
        topic = self.bus.topics[name]
        self.bus.publish(self, topic, Message(topic.type, topic.type.check(fields, 0)), 0.0)

    def _hear(self, _topic: Topic, message: Message, sender: Participant, _now: float) -> None:
        if message.value.data < 0:
            sender.notify("warning", "the pedal goes down only")
            raise GraphError("a pedal is not negative")
        self.heard.append(message.value.data)

    def _honk(self, call: Call, _now: float) -> None:
        self.callers.append(call.caller)
        self.on_call(call)
        if self.refusal:
            raise GraphError(self.refusal)
        request: Any = call.request
        self.show("/state", data=len(self.callers))
        call.answer(call.service.type.response.struct_type(request.data, "beep"))


class FarBridge:
    """The far side of one mirror: a gateway of our own kind, with a client for each of the mirror's connections.

    Attributes:
        bus: what there is on the far side.
        frames: all that the mirror has sent, oldest first.
        mute: services that are never answered.
    """

    def __init__(self, *, has_rosapi: bool = True) -> None:
        self.bus = make_bus()
        if has_rosapi:
            Rosapi(self.bus)
        self.frames: list[Frame] = []
        self.mute: set[str] = set()
        self._wires: dict[BridgeConnection, tuple[Peer, Outbox]] = {}

    def connect(self, mirror: Mirror, connection: BridgeConnection, now: float = 0.0) -> None:
        self._wires[connection] = make_peer(self.bus)
        mirror.connected(connection, lambda: None, lambda: None, now)

    def cut(self, mirror: Mirror, connection: BridgeConnection, now: float = 0.0) -> None:
        peer, _ = self._wires.pop(connection)
        peer.leave(now)
        mirror.lost(connection, now)

    def pump(self, mirror: Mirror, now: float = 0.0) -> None:
        """Carry frames both ways until neither side has any."""
        is_moving = True
        while is_moving:
            is_moving = False
            for connection, (peer, outbox) in list(self._wires.items()):
                for frame in connection.take(8_192, now):
                    is_moving = True
                    self._receive(peer, frame, now)
                for frame in outbox.take(2**30):
                    is_moving = True
                    mirror.receive(connection, frame, now)

    def _receive(self, peer: Peer, frame: bytes, now: float) -> None:
        op = json.loads(frame)
        self.frames.append(op)
        if op.get("service") not in self.mute or op["op"] != "call_service":
            peer.receive(frame, now)

    def ops(self, name: str) -> list[Frame]:
        return [frame for frame in self.frames if frame["op"] == name]


class Program:
    """A program on the far side, by rosbridge too."""

    def __init__(self, far: FarBridge) -> None:
        self._peer, self._outbox = make_peer(far.bus)

    def send(self, op: str, **fields: object) -> None:
        self._peer.receive(json.dumps({"op": op, **fields}).encode(), 0.0)

    def received(self, op: str | None = None) -> list[Frame]:
        frames = [json.loads(frame) for frame in self._outbox.take(2**30)]
        return [frame for frame in frames if op in (None, frame["op"])]


class SimHarness:
    """A car, its mirror and the far side.

    Attributes:
        noted: mistakes of programs there.
    """

    def __init__(self, *, has_connection_each: bool = False, has_rosapi: bool = True) -> None:
        self.bus = make_bus()
        self.noted: list[RefusedRequest] = []
        self.bus.on_refusal = self.noted.append
        self.car = Car(self.bus)
        self.far = FarBridge(has_rosapi=has_rosapi)
        self.num_attached = 0
        self.mirror = Mirror(self.bus, self.car, "ws://far:9090", has_connection_each=has_connection_each)
        self.mirror.on_attached = self._count

    def _count(self) -> None:
        self.num_attached += 1

    @property
    def connection(self) -> BridgeConnection:
        return self.mirror.connections[""]

    def attach(self, now: float = 0.0) -> None:
        for connection in self.mirror.connections.values():
            self.far.connect(self.mirror, connection, now)
        self.pump(now)

    def pump(self, now: float = 0.0) -> None:
        self.far.pump(self.mirror, now)

    def cut(self, now: float = 0.0) -> None:
        for connection in self.mirror.connections.values():
            self.far.cut(self.mirror, connection, now)

    def flood(self, num_messages: int = 5_000) -> None:
        """Publish more than a far side handles that stands still, carrying whenever it may be."""
        for i in range(num_messages):
            self.car.show("/state", data=i)
            if i % 50 == 49:
                self.pump()

    def run(self, until: float) -> None:
        """Let time pass for the mirror."""
        now = 0.0
        while True:
            due = self.mirror.next_due(now)
            if due is None or due > until:
                return
            now = max(now, due)
            self.mirror.advance(now)
            self.pump(now)

    def receive(self, frame: Frame | bytes, now: float = 0.0) -> None:
        data = frame if isinstance(frame, bytes) else json.dumps(frame).encode()
        self.mirror.receive(self.connection, data, now)


@pytest.fixture
def harness() -> SimHarness:
    harness = SimHarness()
    harness.attach()
    return harness


@pytest.fixture
def lines(caplog: pytest.LogCaptureFixture) -> Callable[[], list[str]]:
    """What was logged since the last look."""
    caplog.set_level(logging.INFO, "rosbridge_sim.attach")

    def look() -> list[str]:
        found = [record.getMessage() for record in caplog.records if record.name == "rosbridge_sim.attach"]
        caplog.clear()
        return found

    return look


# At the beginning


def test_everything_is_announced_with_services_last(harness: SimHarness) -> None:
    told = [(frame["op"], frame.get("topic") or frame.get("service")) for frame in harness.far.frames]
    assert (
        told[:8]
        == [
            ("advertise", "/state"),
            ("advertise", "/plate"),
            ("publish", "/plate"),
            ("subscribe", "/pedal"),
            ("call_service", "/rosapi/services"),
            ("advertise_service", "/honk"),
            ("call_service", PROBE),
            ("call_service", "/rosapi/topics"),
        ][:7]
        + told[7:8]
    )
    assert harness.num_attached == 1
    assert [frame["latch"] for frame in harness.far.ops("advertise")] == [False, True]
    assert {frame["type"] for frame in harness.far.ops("advertise_service")} == {"std_srvs/SetBool"}


def test_types_are_spelled_as_the_personality_has_them() -> None:
    bus = Bus(make_store_of_ros2())
    owner = Car(bus)
    mirror = Mirror(bus, owner, "ws://far:9090")
    mirror.connected(mirror.connections[""], lambda: None, lambda: None, 0.0)
    frames = [json.loads(frame) for frame in mirror.connections[""].take(2**30, 0.0)]
    assert [frame["type"] for frame in frames if frame["op"] == "advertise"] == [
        "std_msgs/msg/Int32",
        "std_msgs/msg/String",
    ]


def make_store_of_ros2() -> Any:  # noqa: ANN401 - a store
    store = make_store()
    return type(store)(store._texts, ros=2)


def test_only_what_the_simulator_has_is_mirrored(harness: SimHarness) -> None:
    other, _ = make_peer(harness.bus)
    other.receive(b'{"op":"advertise","topic":"/mine","type":"std_msgs/String"}', 0.0)
    other.receive(b'{"op":"advertise_service","service":"/my","type":"std_srvs/Empty"}', 0.0)
    other.receive(b'{"op":"subscribe","topic":"/state"}', 0.0)
    harness.pump()
    assert harness.far.bus.find_topic("/mine") is None
    assert "/my" not in harness.far.bus.services


def test_a_topic_on_which_the_simulator_hears_itself_is_no_input() -> None:
    harness = SimHarness()
    harness.bus.subscribe(harness.car, "/state", lambda *_: None)
    harness.attach()
    assert [frame["topic"] for frame in harness.far.ops("subscribe")] == ["/pedal"]


def test_nothing_is_published_for_a_far_side_that_is_not_there() -> None:
    harness = SimHarness()
    assert not harness.car.state.has_listener
    harness.attach()
    assert harness.car.state.has_listener
    harness.cut()
    assert not harness.car.state.has_listener
    harness.car.show("/state", data=1)
    assert len(harness.connection.outbox) == 0


# What goes over it


def test_messages_and_what_is_latched_reach_programs_there(harness: SimHarness) -> None:
    program = Program(harness.far)
    program.send("subscribe", topic="/state")
    program.send("subscribe", topic="/plate")
    harness.car.show("/state", data=5)
    harness.pump()
    assert [(frame["topic"], frame["msg"]) for frame in program.received()] == [
        ("/plate", {"data": "12 GA 3456"}),
        ("/state", {"data": 5}),
    ]


def test_bytes_are_shared_with_a_client_of_ours(harness: SimHarness) -> None:
    client, outbox = make_peer(harness.bus)
    client.receive(b'{"op":"subscribe","topic":"/state"}', 0.0)
    harness.car.show("/state", data=5)
    (ours,) = outbox.take(2**30)
    assert harness.connection.take(2**30, 0.0)[-1] is ours


def test_others_messages_on_a_topic_of_the_simulator_stay_here() -> None:
    harness = SimHarness()
    shared = harness.bus.advertise(harness.car, "/shared", "std_msgs/Int32")
    harness.attach()
    stranger, _ = make_peer(harness.bus)
    stranger.receive(b'{"op":"advertise","topic":"/shared","type":"std_msgs/Int32"}', 0.0)
    stranger.receive(b'{"op":"publish","topic":"/shared","msg":{"data":1}}', 0.0)
    assert shared.has_listener
    harness.pump()
    assert [frame["topic"] for frame in harness.far.ops("publish")] == ["/plate"]


def test_a_command_there_drives_here(harness: SimHarness) -> None:
    program = Program(harness.far)
    program.send("advertise", topic="/pedal", type="std_msgs/Float64")
    program.send("publish", topic="/pedal", msg={"data": 0.5})
    harness.pump()
    assert harness.car.heard == [0.5]


def test_a_call_there_is_answered_after_what_it_has_moved(harness: SimHarness) -> None:
    program = Program(harness.far)
    program.send("subscribe", topic="/state")
    program.send("call_service", service="/honk", id="7", args={"data": True})
    harness.pump()
    state, answer = program.received()
    assert state["msg"] == {"data": 1}
    assert answer["values"] == {"success": True, "message": "beep"}
    assert (answer["id"], answer["result"]) == ("7", True)


def test_all_programs_there_are_one_caller_that_stays_when_the_bridge_is_lost(harness: SimHarness) -> None:
    gone: list[Participant] = []
    harness.bus.on_leave.append(lambda owner, _now: gone.append(owner))
    for _ in range(2):
        Program(harness.far).send("call_service", service="/honk", args={})
        harness.pump()
    harness.cut()
    harness.attach()
    Program(harness.far).send("call_service", service="/honk", args={})
    harness.pump()
    assert harness.car.callers == [harness.mirror] * 3
    assert gone == []


def test_a_refusal_has_an_object_for_its_values_and_says_why_beside_it(harness: SimHarness) -> None:
    program = Program(harness.far)
    harness.car.refusal = "the horn is broken"
    program.send("call_service", service="/honk", id="7", args={})
    harness.pump()
    (answer,) = program.received()
    assert (answer["result"], answer["values"]) == (False, "the horn is broken")  # our gateway knows `reason`
    (sent,) = harness.far.ops("service_response")
    assert sent["values"] == {}  # rosbridge_suite takes nothing else
    assert harness.noted == [
        RefusedRequest("ws://far:9090", Reason.REFUSED, "call_service", "/honk", "the horn is broken")
    ]


def test_a_call_that_the_simulator_cannot_answer_is_a_line_and_no_mistake(
    harness: SimHarness, lines: Callable[[], list[str]]
) -> None:
    harness.bus.provide(harness.car, "/fail", "std_srvs/Empty", lambda call, _now: call.refuse("no more world"))
    harness.pump()
    Program(harness.far).send("call_service", service="/fail", id="7")
    harness.pump()
    assert "a call of /fail is refused: no more world" in lines()[-1]
    assert harness.noted == []


def test_a_call_of_what_is_not_ours_is_refused(harness: SimHarness) -> None:
    harness.receive({"op": "call_service", "service": "/rosapi/topics", "id": "service_request:x:1", "args": {}})
    harness.pump()
    assert harness.far.ops("service_response")[-1]["result"] is False


def test_an_answer_is_not_sent_over_another_socket() -> None:
    harness = SimHarness()
    late: list[Call] = []
    harness.bus.provide(harness.car, "/slow", "std_srvs/Empty", lambda call, _now: late.append(call))
    harness.attach()
    Program(harness.far).send("call_service", service="/slow", args={})
    harness.pump()
    harness.cut()
    harness.attach()
    late[0].answer(late[0].service.type.response.struct_type())
    harness.pump()
    assert harness.far.ops("service_response") == []


# What comes and goes


def test_what_comes_and_goes_here_comes_and_goes_there(harness: SimHarness) -> None:
    harness.bus.advertise(harness.car, "/Ego-2/state", "std_msgs/Int32")
    pedal = harness.bus.subscribe(harness.car, "/Ego-2/pedal", lambda *_: None, type_name="std_msgs/Float64")
    harness.bus.provide(harness.car, "/Ego-2/honk", "std_srvs/Empty", lambda *_: None)
    harness.pump()
    assert "/Ego-2/honk" in harness.far.bus.services
    program = Program(harness.far)
    program.send("subscribe", topic="/Ego-2/state")
    harness.car.show("/Ego-2/state", data=2)
    harness.pump()
    assert [frame["msg"] for frame in program.received()] == [{"data": 2}]
    harness.bus.unadvertise(harness.car, "/Ego-2/state", 0.0)
    harness.bus.unsubscribe(pedal, 0.0)
    harness.bus.withdraw(harness.car, "/Ego-2/honk")
    harness.pump()
    assert "/Ego-2/honk" not in harness.far.bus.services
    assert not harness.far.bus.topics["/Ego-2/state"].publishers
    assert not harness.far.bus.topics["/Ego-2/pedal"].subscriptions
    assert "/Ego-2/state" not in [topic.name for topic in harness.bus.holdings(harness.mirror).published]


@pytest.mark.parametrize("has_connection_each", [False, True])
def test_a_service_that_gets_another_name_while_it_is_called_answers_first(*, has_connection_each: bool) -> None:
    harness = SimHarness(has_connection_each=has_connection_each)
    harness.attach()
    calls: list[Call] = []
    harness.bus.provide(harness.car, "/rename", "std_srvs/SetBool", lambda call, _now: calls.append(call))
    harness.attach() if has_connection_each else harness.pump()
    program = Program(harness.far)
    program.send("call_service", service="/rename", id="1")
    program.send("call_service", service="rename", id="2")
    harness.pump()
    harness.bus.withdraw(harness.car, "/rename", answers_calls=True)
    harness.bus.provide(harness.car, "/renamed", "std_srvs/SetBool", lambda call, _now: calls.append(call))
    for call in calls:
        assert "/rename" in harness.far.bus.services
        call.answer(call.service.type.response.default())
        harness.pump()
    assert [frame["result"] for frame in program.received("service_response")] == [True, True]
    assert "/rename" not in harness.far.bus.services


def test_leaving_takes_everything_away_on_both_sides(harness: SimHarness) -> None:
    harness.mirror.leave(0.0)
    harness.pump()
    assert "/honk" not in harness.far.bus.services
    assert harness.mirror not in harness.bus.owners()
    harness.bus.advertise(harness.car, "/later", "std_msgs/Int32")  # nobody looks any more
    assert harness.far.bus.find_topic("/later") is None


def test_everything_is_announced_again_after_each_loss(harness: SimHarness) -> None:
    harness.cut()
    harness.car.show("/plate", data="34 NA 5678")
    harness.far.frames.clear()
    harness.attach()
    assert harness.num_attached == 2
    assert (
        "/rosapi/services" not in [f["service"] for f in harness.far.ops("call_service")][:1]
    )  # ours are known by now
    program = Program(harness.far)
    program.send("subscribe", topic="/plate")
    program.send("call_service", service="/honk", args={})
    harness.pump()
    assert [frame["op"] for frame in program.received()] == ["publish", "service_response"]
    assert harness.far.ops("publish")[0]["msg"] == {"data": "34 NA 5678"}


# A connection for each


def test_with_a_line_for_each_everything_has_one_of_its_own() -> None:
    harness = SimHarness(has_connection_each=True)
    names = list(harness.mirror.connections)
    assert names == ["", "topic /state", "topic /plate", "input /pedal", "service /honk"]
    harness.attach()
    assert harness.num_attached == 1
    program = Program(harness.far)
    program.send("subscribe", topic="/state")
    program.send("call_service", service="/honk", args={"data": True})
    harness.pump()
    assert sorted(frame["op"] for frame in program.received()) == ["publish", "service_response"]


def test_connections_come_and_go_with_their_topics() -> None:
    harness = SimHarness(has_connection_each=True)
    looks: list[list[str]] = []
    harness.mirror.on_connections_changed = lambda: looks.append(list(harness.mirror.connections)[5:])
    harness.bus.advertise(harness.car, "/Ego-2/state", "std_msgs/Int32")
    harness.bus.unadvertise(harness.car, "/Ego-2/state", 0.0)
    assert looks == [["topic /Ego-2/state"], []]


def test_a_line_that_ends_with_what_it_carried_is_no_loss() -> None:
    harness = SimHarness(has_connection_each=True)
    harness.bus.advertise(harness.car, "/Ego-2/state", "std_msgs/Int32")
    harness.attach()
    connection = harness.mirror.connections["topic /Ego-2/state"]
    harness.bus.unadvertise(harness.car, "/Ego-2/state", 0.0)
    harness.pump()
    assert not harness.far.bus.topics["/Ego-2/state"].publishers
    harness.far.cut(harness.mirror, connection)
    harness.far.cut(harness.mirror, harness.mirror.connections["topic /state"])
    harness.far.connect(harness.mirror, harness.mirror.connections["topic /state"])
    harness.pump()
    assert harness.num_attached == 2


def test_one_line_that_waits_delays_no_other() -> None:
    harness = SimHarness(has_connection_each=True)
    harness.attach()
    harness.far.mute.add(PROBE)
    harness.flood(1_000)
    assert harness.mirror.connections["topic /state"].flow_control.is_blocked
    program = Program(harness.far)
    program.send("call_service", service="/honk", args={"data": True})
    harness.pump()
    assert len(program.received("service_response")) == 1


# A far side that is slow


def test_no_more_is_sent_than_the_far_side_handles(harness: SimHarness) -> None:
    harness.far.mute.add(PROBE)
    harness.far.frames.clear()
    harness.flood()
    assert len(harness.far.ops("publish")) < MAX_IN_FLIGHT / 1_500 + 100
    assert len(harness.connection.outbox) <= 2 * OutboxLimits().burst
    harness.far.mute.clear()
    harness.run(until=PROBE_PATIENCE + 0.1)  # the next mark is answered
    assert harness.far.ops("publish")[-1]["msg"] == {"data": 4_999}
    assert not harness.connection.flow_control.is_late


def test_a_far_side_that_stands_still_is_told_of_once_and_again_when_it_goes_on(
    harness: SimHarness, lines: Callable[[], list[str]]
) -> None:
    harness.far.mute.add(PROBE)
    harness.flood()
    harness.run(until=10.0)
    assert [line for line in lines() if "keep" in line] == [
        "ws://far:9090: it does not keep up: topics wait, the newest are kept"
    ]
    harness.far.mute.clear()
    harness.flood()
    harness.run(until=60.0)
    harness.mirror.advance(60.0)
    (line,) = [line for line in lines() if "keep" in line]
    assert f"it keeps up again; {harness.connection.outbox.dropped.total():,} messages" in line


def test_an_answer_stays_behind_its_topics_when_both_wait(harness: SimHarness) -> None:
    harness.far.mute.add(PROBE)
    harness.flood()
    program = Program(harness.far)
    program.send("subscribe", topic="/state")
    program.send("call_service", service="/honk", args={"data": True})
    harness.pump()
    assert program.received() == []
    harness.far.mute.clear()
    harness.run(until=10.0)
    *_, state, answer = program.received()
    assert state["msg"] == {"data": 1}
    assert answer["op"] == "service_response"


def test_a_far_side_without_rosapi_gets_everything_at_once(lines: Callable[[], list[str]]) -> None:
    harness = SimHarness(has_rosapi=False)
    harness.attach()
    assert harness.num_attached == 1
    harness.flood(1_000)
    assert len(harness.far.ops("publish")) == 1_001  # and the plate
    harness.run(until=sum(SURVEY_DELAYS))
    assert sum("rosapi does not answer there" in line for line in lines()) == 1


def test_rosapi_that_starts_after_its_bridge_is_asked_all_the_same(lines: Callable[[], list[str]]) -> None:
    """It is a program of its own: a bridge that was started again is dialled before it is there."""
    harness = SimHarness(has_rosapi=False)
    deaf(harness, "/honk")
    harness.attach()
    harness.flood(1_000)
    Rosapi(harness.far.bus)
    harness.run(until=sum(SURVEY_DELAYS) + PROBE_PATIENCE)
    said = lines()
    assert any("does not know the package std_srvs" in line for line in said)
    assert not any("rosapi" in line for line in said)
    num_probes = len(harness.far.ops("call_service"))
    harness.flood(1_000)
    assert len(harness.far.ops("call_service")) > num_probes  # from now on it is known how far it is


def test_a_far_side_that_answers_nothing_is_attached_all_the_same() -> None:
    harness = SimHarness()
    harness.far.mute.update({PROBE, "/rosapi/services", "/rosapi/topics"})
    harness.attach()
    assert harness.num_attached == 0
    harness.run(until=3 * PROBE_PATIENCE)
    assert harness.num_attached == 1
    assert "/honk" in harness.far.bus.services


# What it lacks


def test_services_that_it_has_already_are_one_line_and_are_taken_over(lines: Callable[[], list[str]]) -> None:
    harness = SimHarness()
    other = Program(harness.far)
    other.send("advertise_service", service="/honk", type="std_srvs/SetBool")
    harness.attach()
    taken = [line for line in lines() if "already" in line]
    assert taken == [
        "ws://far:9090: it has /honk already, of another program or of one that is gone; ours take their place"
    ]
    harness.cut()
    harness.attach()
    assert [line for line in lines() if "already" in line] == []


def deaf(harness: SimHarness, *names: str) -> None:
    """Have the far side pass over advertisements, as rosbridge_suite does of types that it does not know."""
    receive = harness.far._receive

    def pass_over(peer: Peer, frame: bytes, now: float) -> None:
        op = json.loads(frame)
        if op["op"] in {"advertise", "advertise_service"} and (op.get("topic") or op.get("service")) in names:
            return
        receive(peer, frame, now)

    harness.far._receive = pass_over  # type: ignore[method-assign]


def test_a_package_that_it_does_not_know_is_one_line_that_names_it(lines: Callable[[], list[str]]) -> None:
    harness = SimHarness()
    deaf(harness, "/honk")
    harness.attach()
    assert not any("package" in line for line in lines())  # it may take a while
    harness.run(until=sum(SURVEY_DELAYS) + 1.0)
    found = [line for line in lines() if "package" in line]
    text = (
        "it does not know the package std_srvs, and so not /honk: build the package where it runs, and start it again"
    )
    assert found == [f"ws://far:9090: {text}"]
    harness.cut()
    harness.attach()
    harness.run(until=10.0)
    assert not any("package" in line for line in lines())
    assert harness.car.state.has_listener  # the others go on


def test_a_topic_that_it_alone_does_not_have_may_be_denied(lines: Callable[[], list[str]]) -> None:
    harness = SimHarness()
    deaf(harness, "/state")
    harness.attach()
    harness.run(until=10.0)
    (line,) = [line for line in lines() if "globs" in line]
    assert "it does not have /state (std_msgs/Int32): its std_msgs may be of another release" in line


def test_a_topic_that_is_of_another_type_there_is_told(lines: Callable[[], list[str]]) -> None:
    harness = SimHarness()
    Program(harness.far).send("advertise", topic="/state", type="std_msgs/String")
    harness.attach()
    harness.run(until=10.0)
    assert any("/state is std_msgs/String there and not std_msgs/Int32" in line for line in lines())


def test_a_status_about_a_package_is_the_same_line(harness: SimHarness, lines: Callable[[], list[str]]) -> None:
    text = "Unable to import std_msgs.msg from package std_msgs. Caused by: no module"
    for name in ("/state", "/plate"):
        harness.receive({"op": "status", "level": "error", "msg": text, "id": f"advertise:{name}"})
    (line,) = lines()
    assert "it does not know the package std_msgs, and so not /state, /plate, /pedal: build the package" in line


def test_a_package_of_which_we_have_nothing_is_told_in_its_own_words(
    harness: SimHarness, lines: Callable[[], list[str]]
) -> None:
    """What ours is made of, or something of somebody else's."""
    lines()
    text = "Unable to import geometry_msgs.msg from package geometry_msgs. Caused by: no module"
    harness.receive({"op": "status", "level": "error", "msg": text, "id": "advertise:/state"})
    assert lines() == [f"ws://far:9090: it says of advertise:/state: [error] {text}"]


def test_a_simulator_that_is_there_already_is_one_line(lines: Callable[[], list[str]]) -> None:
    harness = SimHarness()
    Car(harness.far.bus)
    harness.attach()
    warnings = [line for line in lines() if "attached" not in line]
    assert len(warnings) == 1
    assert "it has a simulator of its own (/car)" in warnings[0]


def test_the_other_generation_of_ros_is_told(lines: Callable[[], list[str]]) -> None:
    harness = SimHarness()
    harness.far.mute.add(PROBE)
    harness.attach()
    question = harness.far.ops("call_service")[-1]
    values = {"time": {"sec": 1, "nanosec": 2}}
    harness.receive(
        {"op": "service_response", "service": PROBE, "id": question["id"], "values": values, "result": True}
    )
    assert any("it is of ROS 2" in line and "--ros 2" in line for line in lines())


# What makes no sense


@pytest.mark.parametrize(
    ("frame", "words"),
    [
        ({"op": "publish", "topic": "/nobody", "msg": {}}, "a message of /nobody, for which nobody asked"),
        ({"op": "advertise", "topic": "/x", "type": "std_msgs/String"}, "means nothing here: Advertise"),
        ({"op": "service_response", "service": "/x", "result": True, "id": "of another"}, "means nothing here"),
        ({"op": "status", "level": "error", "msg": "hm"}, "it says: [error] hm"),
    ],
)
def test_nonsense_is_a_line_in_the_log(
    harness: SimHarness,
    lines: Callable[[], list[str]],
    frame: Any,  # noqa: ANN401 - bytes or an object
    words: str,
) -> None:
    lines()
    harness.far.frames.clear()
    harness.receive(frame)
    assert any(words in line for line in lines())
    harness.pump()
    assert [f["op"] for f in harness.far.frames] == []  # there is no op to tell it
    assert harness.noted == []


@pytest.mark.parametrize(
    ("frame", "expected", "words"),
    [
        (b"\xff\xfe", (Reason.BAD_FRAME, "", ""), ""),
        (b"{]", (Reason.BAD_FRAME, "", ""), ""),
        (b'{"op":"publish"}', (Reason.BAD_OP, "", ""), "publish"),
        (b'{"op":"bake"}', (Reason.UNKNOWN_OP, "", ""), "bake"),
        (
            {"op": "publish", "topic": "/pedal", "msg": {"data": "much"}},
            (Reason.WRONG_TYPE, "publish", "/pedal"),
            "std_msgs/Float64",
        ),
        (
            {"op": "publish", "topic": "/pedal", "msg": {"dat": 1}},
            (Reason.UNKNOWN_FIELD, "publish", "/pedal"),
            "did you mean data?",
        ),
        (
            {"op": "publish", "topic": "/pedal", "msg": {"data": -1.0}},
            (Reason.REFUSED, "publish", "/pedal"),
            "a pedal is not negative",
        ),
        ({"op": "publish", "topic": "a b", "msg": {}}, (Reason.BAD_NAME, "publish", "a b"), "valid graph name"),
        ({"op": "call_service", "service": "a b", "id": "1"}, (Reason.BAD_NAME, "call_service", "a b"), ""),
        (
            {"op": "call_service", "service": "/honk", "id": "1", "args": {"dat": True}},
            (Reason.UNKNOWN_FIELD, "call_service", "/honk"),
            "did you mean data?",
        ),
    ],
)
def test_mistake_of_a_program_there_is_noted_as_that_of_a_client(
    harness: SimHarness,
    frame: Any,  # noqa: ANN401 - bytes or an object
    expected: tuple[Reason, str, str],
    words: str,
) -> None:
    harness.receive(frame)
    noted = harness.noted[-1]
    assert (noted.client, noted.reason, noted.op, noted.subject) == ("ws://far:9090", *expected)
    assert words in noted.text


@pytest.mark.parametrize(
    "values", [b"", b"null", b"3", b'"text"', b"{]", b'{"services":3}', b'{"time":4}', b'{"topics":[1]}']
)
def test_answers_that_make_no_sense_are_none(values: bytes) -> None:
    harness = SimHarness()
    harness.far.mute.update({PROBE, "/rosapi/services", "/rosapi/topics"})
    harness.attach()
    for _ in range(6):
        calls = harness.far.ops("call_service")
        mark = calls[-1]["id"].encode()
        tail = b',"values":' + values if values else b""
        with suppress(IndexError):
            harness.receive(b'{"op":"service_response","service":"/x","result":true,"id":"' + mark + b'"' + tail + b"}")
        harness.pump()
    harness.run(until=10.0)
    assert harness.num_attached == 1


def test_a_flood_of_nonsense_is_a_few_lines(harness: SimHarness, lines: Callable[[], list[str]]) -> None:
    lines()
    for _ in range(1_000):
        harness.receive({"op": "publish", "topic": "/nobody", "msg": {}})
    assert len(lines()) == MAX_LINES
    harness.receive({"op": "publish", "topic": "/nobody", "msg": {}}, now=PERIOD + 1.0)
    assert f"and {1_000 - MAX_LINES} lines more" in lines()[0]


def test_names_that_a_far_side_makes_up_fill_neither_memory_nor_log(
    harness: SimHarness, lines: Callable[[], list[str]]
) -> None:
    lines()
    for i in range(1_000):
        text = f"Unable to import made_up_{i}.msg from package made_up_{i}. " + "x" * 10_000
        harness.receive({"op": "status", "level": "error", "msg": text})
        harness.receive({"op": "status", "level": "error", "msg": text[10:]})
    said = lines()
    assert len(said) <= 100 + MAX_LINES
    assert max(map(len, said)) < 600


def test_pieces_that_nobody_asked_for_are_put_together(harness: SimHarness) -> None:
    """With a float for the total and the number 0 for the id, as rosbridge_suite sends them."""
    text = json.dumps({"op": "publish", "topic": "/pedal", "msg": {"data": 0.25}})
    for num, piece in enumerate((text[:20], text[20:40], text[40:])):
        harness.receive({"op": "fragment", "id": 0, "data": piece, "num": num, "total": 2.6 + 0.8})
    assert harness.car.heard == [0.25]


def test_what_a_program_there_would_be_told_is_noted(harness: SimHarness, lines: Callable[[], list[str]]) -> None:
    harness.receive({"op": "publish", "topic": "/pedal", "msg": {"data": -1.0}})
    told, _ = harness.noted
    assert (told.reason, told.subject, told.text) == (Reason.NOT_NOW, "/pedal", "the pedal goes down only")
    explain(harness.mirror, "warning", "another master", Reason.NOT_MASTER)
    harness.mirror.notify("error", "lost")
    assert [(each.reason, each.op) for each in harness.noted[2:]] == [(Reason.NOT_MASTER, ""), (Reason.REFUSED, "")]
    harness.mirror.notify("info", "by the way")
    assert lines()[-1].endswith("a program there is told: [info] by the way")
    assert len(harness.noted) == 4


def test_what_is_told_later_is_noted_with_the_op_that_it_is_about(harness: SimHarness) -> None:
    tells: list[Notify] = []
    harness.car.on_call = lambda call: tells.append(notifier(call.caller))
    harness.receive(HONK)
    harness.receive(pedal(0.1))
    tells[0]("error", "no such scenario")
    assert [(each.op, each.subject, each.text) for each in harness.noted] == [
        ("call_service", "/honk", "no such scenario")
    ]


# What has to wait


class Slow:
    """Holds whoever calls the car, until a test says that it is over."""

    def __init__(self, car: Car) -> None:
        self.releases: list[Callable[[], None]] = []
        self._car = car
        car.on_call = self._hold

    def _hold(self, call: Call) -> None:
        self.releases.append(hold(call.caller))

    def end(self) -> None:
        self.releases.pop(0)()


HONK: Frame = {"op": "call_service", "service": "/honk", "id": "service_request:/honk:1", "args": {"data": True}}


def pedal(value: float) -> Frame:
    return {"op": "publish", "topic": "/pedal", "msg": {"data": value}}


def test_what_comes_behind_a_call_that_takes_its_time_waits_on_its_line(harness: SimHarness) -> None:
    slow = Slow(harness.car)
    released: list[BridgeConnection] = []
    harness.connection.on_released = lambda: released.append(harness.connection)
    harness.receive(pedal(0.1))
    harness.receive(HONK)
    harness.receive(pedal(0.2))
    harness.receive(HONK)
    harness.receive(pedal(0.3))
    assert harness.car.heard == [0.1]
    for heard in ([0.1, 0.2], [0.1, 0.2, 0.3]):
        slow.end()
        assert released.pop() is harness.connection
        assert harness.mirror.go_on(harness.connection, 0.0) is False
        assert harness.car.heard == heard


def test_held_line_still_hears_how_far_the_far_side_has_got(harness: SimHarness) -> None:
    slow = Slow(harness.car)
    harness.receive(HONK)
    harness.flood()
    harness.pump()
    assert harness.far.ops("publish")[-1]["msg"] == {"data": 4_999}
    assert harness.connection.outbox.dropped.total() == 0
    slow.end()


def test_other_connections_go_on_while_one_is_held() -> None:
    harness = SimHarness(has_connection_each=True)
    harness.attach()
    slow = Slow(harness.car)
    horn, pedals = harness.mirror.connections["service /honk"], harness.mirror.connections["input /pedal"]
    harness.mirror.receive(horn, json.dumps(HONK).encode(), 0.0)
    assert (horn.is_held, pedals.is_held) == (True, False)
    harness.mirror.receive(pedals, json.dumps(pedal(0.5)).encode(), 0.0)
    assert harness.car.heard == [0.5]
    slow.end()


def test_socket_that_is_lost_takes_with_it_what_waited_and_the_next_one_is_not_held(harness: SimHarness) -> None:
    slow = Slow(harness.car)
    harness.receive(HONK)
    harness.receive(pedal(0.1))
    harness.cut()
    harness.attach()
    harness.receive(pedal(0.2))
    assert harness.car.heard == [0.2]
    harness.receive(HONK)
    slow.end()  # that of the socket before
    harness.receive(pedal(0.3))
    assert harness.car.heard == [0.2]
    slow.end()
    harness.mirror.go_on(harness.connection, 0.0)
    assert harness.car.heard == [0.2, 0.3]


def test_mirror_that_has_left_does_nothing_of_what_waited(harness: SimHarness) -> None:
    slow = Slow(harness.car)
    harness.receive(HONK)
    harness.receive(pedal(0.1))
    harness.mirror.leave(0.0)
    slow.end()
    assert harness.mirror.go_on(harness.connection, 0.0) is False
    assert harness.car.heard == []


def test_long_backlog_is_done_in_turns_and_stops_the_reading_before_it_grows_without_end(harness: SimHarness) -> None:
    slow = Slow(harness.car)
    harness.receive(HONK)
    num = 0
    while not harness.connection.is_full:
        harness.receive({**pedal(num), "note": "x" * 10_000})
        num += 1
    assert MAX_WAITING_BYTES / 11_000 < num < MAX_WAITING_BYTES / 10_000 + 1
    slow.end()
    assert harness.mirror.go_on(harness.connection, 0.0) is True
    assert len(harness.car.heard) == OPS_PER_TURN
    assert harness.connection.is_full
    while harness.mirror.go_on(harness.connection, 0.0):
        pass
    assert harness.car.heard == list(range(num))
    assert not harness.connection.is_full


# Which time goes out


class Wall:
    """Counts how often the time of day was begun with."""

    def __init__(self) -> None:
        self.began_at: list[float] = []

    def stamps(self, choice: Literal["sim", "wall", "auto"] = "auto") -> Stamps:
        return Stamps(choice, self.began_at.append)


class TimeStand(SimHarness):
    """A stand whose stamps may depend on its far side.

    Attributes:
        wall: what happened to the time of day.
        stamps: the choice.
    """

    def __init__(self, choice: Literal["sim", "wall", "auto"], **options: bool) -> None:
        super().__init__(**options)
        self.wall = Wall()
        self.stamps = self.mirror.stamps = self.wall.stamps(choice)


def use_sim_time(harness: SimHarness, value: str) -> None:
    """Set the far side's parameter."""
    harness.far.bus.parameters.put("/use_sim_time", value, make_peer(harness.far.bus)[0])


def time_stand(value: object = None, *, choice: Literal["sim", "wall", "auto"] = "auto", **options: bool) -> TimeStand:
    """A stand whose far side has this `/use_sim_time`, not attached yet."""
    harness = TimeStand(choice, **options)
    if value is not None:
        use_sim_time(harness, json.dumps(value))
    return harness


@pytest.mark.parametrize("has_connection_each", [False, True])
@pytest.mark.parametrize(
    ("value", "is_wall"), [(True, False), (1, False), (False, True), (0, True), (None, True), ("yes", True)]
)
def test_time_is_that_of_the_far_side_before_anything_is_announced(
    value: object, *, is_wall: bool, has_connection_each: bool, lines: Callable[[], list[str]]
) -> None:
    harness = time_stand(value, has_connection_each=has_connection_each)
    assert harness.stamps.is_open
    harness.attach()
    assert harness.num_attached == 1
    assert harness.far.frames[0]["op"] == "call_service"
    assert harness.far.frames[0]["args"] == {"name": "/use_sim_time", "default": ""}
    assert (harness.stamps.is_open, harness.stamps.is_wall) == (False, is_wall)
    assert harness.wall.began_at == [0.0] * is_wall
    said = [line for line in lines() if "/use_sim_time" in line]
    text = "is not true: stamps are the time of day" if is_wall else "is true: stamps are simulated"
    assert said == [f"ws://far:9090: its /use_sim_time {text}"]


def test_what_the_far_side_says_later_changes_nothing_and_is_one_warning(lines: Callable[[], list[str]]) -> None:
    harness = time_stand()
    harness.attach()
    lines()
    use_sim_time(harness, "true")
    for _ in range(3):
        harness.cut()
        harness.attach()
    assert harness.stamps.is_wall
    text = (
        "its /use_sim_time is true, and our stamps are the time of day: programs there may find no transforms;"
        " --stamps sim makes both simulated"
    )
    assert [line for line in lines() if "/use_sim_time" in line] == [f"ws://far:9090: {text}"]


def test_second_bridge_that_disagrees_is_one_warning(lines: Callable[[], list[str]]) -> None:
    first, second = time_stand(value=True), SimHarness()
    second.mirror.stamps = first.mirror.stamps
    first.attach()
    lines()
    second.attach()
    assert not first.stamps.is_wall
    text = (
        "its /use_sim_time is not true, and our stamps are simulated time: programs there may find no transforms;"
        " --stamps wall gives the time of day, or set the parameter before they start"
    )
    assert [line for line in lines() if "/use_sim_time" in line] == [f"ws://far:9090: {text}"]


@pytest.mark.parametrize(("choice", "value"), [("sim", True), ("wall", False), ("wall", None)])
def test_bridge_that_agrees_with_the_user_is_no_line(
    choice: Literal["sim", "wall"], value: object, lines: Callable[[], list[str]]
) -> None:
    harness = time_stand(value, choice=choice)
    harness.attach()
    assert not [line for line in lines() if "/use_sim_time" in line]


def test_far_side_that_tells_no_time_is_waited_for_no_longer_than_for_any_answer() -> None:
    harness = time_stand()
    harness.far.mute.add("/rosapi/get_param")
    harness.attach()
    assert harness.num_attached == 0
    harness.run(until=PROBE_PATIENCE)
    assert harness.num_attached == 1
    assert harness.wall.began_at == [PROBE_PATIENCE]


def test_rosapi_that_starts_later_and_disagrees_is_one_warning(lines: Callable[[], list[str]]) -> None:
    harness = time_stand(has_rosapi=False)
    harness.attach()
    assert harness.wall.began_at == [0.0]
    use_sim_time(harness, "true")
    Rosapi(harness.far.bus)
    lines()
    harness.run(until=sum(SURVEY_DELAYS))
    assert sum("--stamps sim makes both simulated" in line for line in lines()) == 1


def test_socket_that_is_lost_before_the_time_is_told_settles_nothing() -> None:
    harness = time_stand(value=True)
    harness.far.connect(harness.mirror, harness.connection)
    harness.far.cut(harness.mirror, harness.connection)
    assert harness.stamps.is_open
    harness.attach()
    assert not harness.stamps.is_open
    assert harness.num_attached == 1


def test_mirror_that_has_left_announces_nothing_when_the_time_is_told() -> None:
    harness = time_stand(value=True)
    harness.far.connect(harness.mirror, harness.connection)
    harness.mirror.leave(0.0)
    harness.pump()
    assert not harness.far.ops("advertise")
    assert not harness.far.ops("advertise_service")


def test_in_ros_2_nobody_is_asked_and_stamps_are_the_time_of_day() -> None:
    bus = Bus(make_store_of_ros2())
    far, wall = FarBridge(), Wall()
    mirror = Mirror(bus, Car(bus), "ws://far:9090")
    mirror.stamps = wall.stamps()
    far.connect(mirror, mirror.connections[""])
    far.pump(mirror)
    assert mirror.stamps.is_wall
    assert not [frame for frame in far.ops("call_service") if frame["service"] == "/rosapi/get_param"]


# What has gone and may come back


def test_service_of_what_may_come_back_stays_announced_and_says_why_it_does_not_serve(harness: SimHarness) -> None:
    harness.mirror.why_gone = lambda name: "ego 2 has left" if name == "/honk" else ""
    program = Program(harness.far)
    harness.bus.withdraw(harness.car, "/honk")
    harness.pump()
    assert not harness.far.ops("unadvertise_service")
    program.send("call_service", service="/honk", args={"data": True})
    harness.pump()
    (answer,) = program.received("service_response")
    assert answer["result"] is False
    (told,) = harness.far.ops("service_response")
    assert told["reason"] == "Service /honk is not served: ego 2 has left"
    harness.bus.provide(harness.car, "/honk", "std_srvs/SetBool", harness.car._honk, is_exclusive=True)
    program.send("call_service", service="/honk", args={"data": True})
    harness.pump()
    (answer,) = program.received("service_response")
    assert answer["values"]["message"] == "beep"
    assert len(harness.far.ops("advertise_service")) == 1


def test_service_of_what_may_come_back_is_announced_to_a_bridge_that_was_restarted() -> None:
    for has_connection_each in (False, True):
        harness = SimHarness(has_connection_each=has_connection_each)
        harness.mirror.why_gone = lambda _name: "ego 2 has left"
        harness.attach()
        harness.bus.withdraw(harness.car, "/honk")
        harness.pump()
        harness.cut()
        harness.attach()
        assert "/honk" in harness.far.bus.services
        assert harness.num_attached == 2
        harness.mirror.leave(0.0)
        harness.pump()
        assert "/honk" not in harness.far.bus.services


def test_service_that_is_remembered_no_longer_is_taken_back_there(harness: SimHarness) -> None:
    why = "ego 2 has left"
    harness.mirror.why_gone = lambda _name: why
    harness.bus.withdraw(harness.car, "/honk")
    harness.pump()
    why = ""
    harness.bus.advertise(harness.car, "/other", "std_msgs/Int32")
    harness.pump()
    assert [frame["service"] for frame in harness.far.ops("unadvertise_service")] == ["/honk"]


# A master that is restarted behind a bridge that lives on


def lose_rosapi(harness: SimHarness, *, seconds: float = 10.0) -> float:
    """Take the far side's rosapi away for so long; when it is [s]."""
    (rosapi,) = {service.owner for name, service in harness.far.bus.services.items() if name.startswith("/rosapi/")}
    harness.far.bus.leave(rosapi, 0.0)
    harness.run(until=seconds)
    return seconds


def test_rosapi_that_is_lost_is_one_warning_and_its_return_has_everything_announced_anew(
    harness: SimHarness, lines: Callable[[], list[str]]
) -> None:
    harness.run(until=sum(SURVEY_DELAYS))
    lines()
    num_before = len(harness.far.frames)
    lose_rosapi(harness)
    text = "rosapi does not answer there any more: was its ROS master restarted? All is announced when it does"
    assert [line for line in lines() if "rosapi" in line] == [f"ws://far:9090: {text}"]
    assert not [f for f in harness.far.frames[num_before:] if f["op"] != "call_service"], "the stream goes on as it was"
    num_before = len(harness.far.frames)
    Rosapi(harness.far.bus)
    harness.run(until=30.0)
    anew = [(f["op"], f.get("topic", f.get("service"))) for f in harness.far.frames[num_before:]]
    assert [one for one in anew if one[0] not in {"call_service", "publish"}] == [
        ("unadvertise", "/state"),
        ("advertise", "/state"),
        ("unadvertise", "/plate"),
        ("advertise", "/plate"),
        ("unsubscribe", "/pedal"),
        ("subscribe", "/pedal"),
        ("advertise_service", "/honk"),
    ]
    assert ("publish", "/plate") in anew, "what is latched"
    assert [line for line in lines() if "rosapi" in line] == [
        "ws://far:9090: rosapi answers again: everything is announced anew"
    ]
    program = Program(harness.far)
    program.send("call_service", service="/honk", args={"data": True})
    harness.pump()
    assert program.received("service_response")[0]["values"]["message"] == "beep"


def test_topics_that_the_bridge_does_not_register_anew_are_taken_back_for_long_enough(harness: SimHarness) -> None:
    harness.run(until=sum(SURVEY_DELAYS))
    lose_rosapi(harness)
    Rosapi(harness.far.bus)
    bus, topics = harness.far.bus, harness.far.bus.topics
    forgotten = {name: topics[name] for name in ("/state", "/plate")}
    for name in forgotten:  # the new master does not know them, and what is advertised again is not registered
        del topics[name]
    deaf(harness, *forgotten)
    num_before = len(harness.far.frames)
    harness.run(until=10.0 + 1.0 + sum(SURVEY_DELAYS) + 1.0)
    taken = [f for f in harness.far.frames[num_before:] if f["op"] == "unadvertise"]
    assert len(taken) == 4, "at once, and for good when they were missing all the same"
    num_before = len(harness.far.frames)
    harness.car.show("/state", data=5)
    harness.pump()
    assert not [f for f in harness.far.frames[num_before:] if f["op"] == "publish"], (
        "that would register them as before"
    )
    harness.far._receive = lambda peer, frame, now: FarBridge._receive(harness.far, peer, frame, now)  # type: ignore[method-assign]
    harness.run(until=10.0 + 1.0 + sum(SURVEY_DELAYS) + UNREGISTER_TIME + 1.0)
    assert {"/state", "/plate"} <= set(bus.topics)
    program = Program(harness.far)
    program.send("subscribe", topic="/state")
    harness.car.show("/state", data=6)
    harness.pump()
    assert [f["msg"] for f in program.received("publish")] == [{"data": 6}]


def test_far_side_that_is_silent_has_not_lost_its_rosapi(harness: SimHarness, lines: Callable[[], list[str]]) -> None:
    harness.run(until=sum(SURVEY_DELAYS))
    harness.far.mute.add(PROBE)
    harness.run(until=60.0)
    harness.far.mute.clear()
    harness.run(until=120.0)
    assert not [line for line in lines() if "any more" in line]
    assert len(harness.far.ops("advertise")) == 2


def test_one_refusal_is_no_loss(harness: SimHarness, lines: Callable[[], list[str]]) -> None:
    harness.run(until=sum(SURVEY_DELAYS))
    lose_rosapi(harness, seconds=LOOK_PERIOD + 0.5)
    Rosapi(harness.far.bus)
    harness.run(until=60.0)
    assert not [line for line in lines() if "any more" in line]
    assert len(harness.far.ops("advertise")) == 2


def test_bridge_that_dies_without_its_rosapi_is_announced_to_once(harness: SimHarness) -> None:
    harness.run(until=sum(SURVEY_DELAYS))
    lose_rosapi(harness)
    harness.cut()
    Rosapi(harness.far.bus)
    harness.attach()
    harness.run(until=60.0)
    assert len(harness.far.ops("advertise")) == 4, "two topics on each of two sockets"


def test_topics_that_were_taken_back_return_though_the_first_socket_was_lost_meanwhile() -> None:
    harness = SimHarness(has_connection_each=True)
    harness.attach()
    harness.run(until=sum(SURVEY_DELAYS))
    harness.mirror._announcer.take_back(10.0)
    harness.pump()
    assert "/state" not in {name for name, topic in harness.far.bus.topics.items() if topic.publishers}
    harness.far.cut(harness.mirror, harness.connection, 11.0)
    harness.far.connect(harness.mirror, harness.connection, 12.0)
    harness.pump()
    harness.run(until=10.0 + UNREGISTER_TIME)
    assert {name for name, topic in harness.far.bus.topics.items() if topic.publishers} >= {"/state", "/plate"}
    program = Program(harness.far)
    program.send("subscribe", topic="/state")
    harness.car.show("/state", data=6)
    harness.pump()
    assert [f["msg"] for f in program.received("publish")] == [{"data": 6}]
