"""A simulator behind a foreign rosbridge, both in memory: messages in both directions, and their order."""

from __future__ import annotations

import json
from collections.abc import Callable
from contextlib import suppress
from typing import Any

import pytest

from rosbridge_sim.errors import Reason
from rosbridge_sim.graph.attach.connection import MAX_WAITING_BYTES, PROBE, PROBE_PATIENCE, BridgeConnection
from rosbridge_sim.graph.attach.diagnostics import MAX_LINES, PERIOD
from rosbridge_sim.graph.attach.flow_control import MAX_IN_FLIGHT
from rosbridge_sim.graph.attach.mirror import OPS_PER_TURN
from rosbridge_sim.graph.attach.survey import SURVEY_DELAYS
from rosbridge_sim.graph.participant import Notify, Participant
from rosbridge_sim.graph.refusals import RefusedRequest
from rosbridge_sim.graph.rosapi_services.rosapi import Rosapi
from rosbridge_sim.graph.topics_services import Call
from rosbridge_sim.protocol.outbox import OutboxLimits
from tests.graph.attach.mirror_harness import Car, Frame, Program, SimHarness, make_deaf
from tests.graph.bus_fixture import make_peer

# What goes over it


def test_plain_and_latched_messages_reach_programs_at_the_far_bridge(harness: SimHarness) -> None:
    program = Program(harness.far)
    program.send("subscribe", topic="/state")
    program.send("subscribe", topic="/plate")
    harness.car.show("/state", data=5)
    harness.pump()
    assert [(frame["topic"], frame["msg"]) for frame in program.received()] == [
        ("/plate", {"data": "12 GA 3456"}),
        ("/state", {"data": 5}),
    ]


def test_encoded_bytes_are_shared_with_local_clients(harness: SimHarness) -> None:
    client, outbox = make_peer(harness.bus)
    harness.car.show("/state", data=4)
    harness.pump()  # the first answer of the bridge makes room
    client.receive(b'{"op":"subscribe","topic":"/state"}', 0.0)
    harness.car.show("/state", data=5)
    (ours,) = outbox.take(2**30)
    assert harness.connection.take(2**30, 0.0)[-1] is ours


def test_messages_of_local_clients_on_a_topic_of_the_simulator_are_not_mirrored() -> None:
    harness = SimHarness()
    shared = harness.bus.advertise(harness.car, "/shared", "std_msgs/Int32")
    harness.attach()
    stranger, _ = make_peer(harness.bus)
    stranger.receive(b'{"op":"advertise","topic":"/shared","type":"std_msgs/Int32"}', 0.0)
    stranger.receive(b'{"op":"publish","topic":"/shared","msg":{"data":1}}', 0.0)
    assert shared.has_listener
    harness.pump()
    assert [frame["topic"] for frame in harness.far.ops("publish")] == ["/plate"]


def test_command_at_the_far_bridge_drives_the_car(harness: SimHarness) -> None:
    program = Program(harness.far)
    program.send("advertise", topic="/pedal", type="std_msgs/Float64")
    program.send("publish", topic="/pedal", msg={"data": 0.5})
    harness.pump()
    assert harness.car.heard == [0.5]


def test_call_at_the_far_bridge_is_answered_after_the_topics_it_caused(harness: SimHarness) -> None:
    program = Program(harness.far)
    program.send("subscribe", topic="/state")
    program.send("call_service", service="/honk", id="7", args={"data": True})
    harness.pump()
    state, answer = program.received()
    assert state["msg"] == {"data": 1}
    assert answer["values"] == {"success": True, "message": "beep"}
    assert (answer["id"], answer["result"]) == ("7", True)


def test_programs_at_the_far_bridge_are_one_caller_that_outlives_a_lost_bridge(harness: SimHarness) -> None:
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


def test_refusal_has_an_empty_object_for_values_and_a_reason(harness: SimHarness) -> None:
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


def test_call_that_cannot_be_answered_is_one_log_line(harness: SimHarness, lines: Callable[[], list[str]]) -> None:
    harness.bus.provide(harness.car, "/fail", "std_srvs/Empty", lambda call, _now: call.refuse("no more world"))
    harness.pump()
    Program(harness.far).send("call_service", service="/fail", id="7")
    harness.pump()
    assert "a call of /fail is refused: no more world" in lines()[-1]
    assert harness.noted == []


def test_call_of_an_unknown_service_is_refused(harness: SimHarness) -> None:
    harness.receive({"op": "call_service", "service": "/rosapi/topics", "id": "service_request:x:1", "args": {}})
    harness.pump()
    assert harness.far.ops("service_response")[-1]["result"] is False


def test_answer_is_not_sent_over_a_later_socket() -> None:
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


# A far side that is slow


def test_sending_stops_at_the_window_of_the_far_bridge(harness: SimHarness) -> None:
    harness.far.mute.add(PROBE)
    harness.far.frames.clear()
    harness.flood()
    assert len(harness.far.ops("publish")) < MAX_IN_FLIGHT / 1_500 + 100
    assert len(harness.connection.outbox) <= 2 * OutboxLimits().burst
    harness.far.mute.clear()
    harness.run(until=PROBE_PATIENCE + 0.1)  # the next mark is answered
    assert harness.far.ops("publish")[-1]["msg"] == {"data": 4_999}
    assert not harness.connection.flow_control.is_late


def test_stalled_far_bridge_is_logged_once_and_once_when_it_resumes(
    harness: SimHarness, lines: Callable[[], list[str]]
) -> None:
    harness.far.mute.add(PROBE)
    harness.flood()
    harness.run(until=10.0)
    (line,) = [line for line in lines() if "it is too slow" in line]
    num_lost = harness.connection.num_dropped
    assert f": it is too slow: {num_lost:,} of 5,000 topic messages of the last 5 s were left out" in line
    assert "data was up to 5.00 s old there" in line
    harness.far.mute.clear()
    harness.run(until=70.0)
    harness.flood(1)
    harness.run(until=140.0)
    (line,) = [line for line in lines() if "it is fast enough again" in line]
    assert f": 0 of 1 topic messages of the last 5 s were left out, {num_lost:,} since it connected" in line


def test_answer_at_a_stalled_bridge_follows_its_own_topics_and_no_older_ones(harness: SimHarness) -> None:
    harness.far.mute.add(PROBE)
    harness.flood()
    program = Program(harness.far)
    program.send("subscribe", topic="/state")
    program.send("call_service", service="/honk", args={"data": True})
    harness.pump()
    state, answer = program.received()
    assert state["msg"] == {"data": 1}
    assert answer["op"] == "service_response"
    harness.far.mute.clear()
    harness.run(until=10.0)
    assert program.received() == [], "what had waited is older than what the call caused"


def test_far_bridge_without_rosapi_gets_all_announcements_at_once(lines: Callable[[], list[str]]) -> None:
    harness = SimHarness(has_rosapi=False)
    harness.attach()
    assert harness.num_attached == 1
    harness.flood(1_000)
    assert len(harness.far.ops("publish")) == 1_001  # and the plate
    harness.run(until=sum(SURVEY_DELAYS))
    assert sum("rosapi does not answer there" in line for line in lines()) == 1


def test_rosapi_that_starts_after_its_bridge_is_asked(lines: Callable[[], list[str]]) -> None:
    """It is a program of its own: a bridge that was started again is dialled before it is there."""
    harness = SimHarness(has_rosapi=False)
    make_deaf(harness, "/honk")
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


def test_silent_far_bridge_is_attached() -> None:
    harness = SimHarness()
    harness.far.mute.update({PROBE, "/rosapi/services", "/rosapi/topics"})
    harness.attach()
    assert harness.num_attached == 0
    harness.run(until=3 * PROBE_PATIENCE)
    assert harness.num_attached == 1
    assert "/honk" in harness.far.bus.services


# What makes no sense


@pytest.mark.parametrize(
    ("frame", "words"),
    [
        ({"op": "publish", "topic": "/nobody", "msg": {}}, "a message of /nobody, which has no subscription here"),
        ({"op": "advertise", "topic": "/x", "type": "std_msgs/String"}, "this side does not support: Advertise"),
        ({"op": "service_response", "service": "/x", "result": True, "id": "of another"}, "this side does not support"),
        ({"op": "status", "level": "error", "msg": "hm"}, "it says: [error] hm"),
    ],
)
def test_malformed_frame_is_one_log_line(
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
def test_error_of_a_program_at_the_far_bridge_is_recorded_as_a_client_refusal(
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
def test_malformed_answers_are_ignored(values: bytes) -> None:
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


def test_flood_of_malformed_frames_is_a_few_log_lines(harness: SimHarness, lines: Callable[[], list[str]]) -> None:
    lines()
    for _ in range(1_000):
        harness.receive({"op": "publish", "topic": "/nobody", "msg": {}})
    assert len(lines()) == MAX_LINES
    harness.receive({"op": "publish", "topic": "/nobody", "msg": {}}, now=PERIOD + 1.0)
    assert f"and {1_000 - MAX_LINES} more lines" in lines()[0]


def test_invented_names_of_a_far_bridge_fill_neither_memory_nor_log(
    harness: SimHarness, lines: Callable[[], list[str]]
) -> None:
    lines()
    for i in range(300):
        text = f"Unable to import made_up_{i}.msg from package made_up_{i}. " + "x" * 10_000
        harness.receive({"op": "status", "level": "error", "msg": text})
        harness.receive({"op": "status", "level": "error", "msg": text[10:]})
    said = lines()
    assert len(said) <= 100 + MAX_LINES
    assert max(map(len, said)) < 600


def test_unrequested_fragments_are_joined(harness: SimHarness) -> None:
    """With a float for the total and the number 0 for the id, as rosbridge_suite sends them."""
    text = json.dumps({"op": "publish", "topic": "/pedal", "msg": {"data": 0.25}})
    for num, piece in enumerate((text[:20], text[20:40], text[40:])):
        harness.receive({"op": "fragment", "id": 0, "data": piece, "num": num, "total": 2.6 + 0.8})
    assert harness.car.heard == [0.25]


def test_refusals_of_programs_at_the_far_bridge_are_recorded(
    harness: SimHarness, lines: Callable[[], list[str]]
) -> None:
    harness.receive({"op": "publish", "topic": "/pedal", "msg": {"data": -1.0}})
    told, _ = harness.noted
    assert (told.reason, told.subject, told.text) == (Reason.WARNING, "/pedal", "the pedal goes down only")
    harness.mirror.explain("warning", "another master", Reason.NOT_MASTER)
    harness.mirror.notify("error", "lost")
    assert [(each.reason, each.op) for each in harness.noted[2:]] == [(Reason.NOT_MASTER, ""), (Reason.REFUSED, "")]
    harness.mirror.notify("info", "by the way")
    assert lines()[-1].endswith("a program there is told: [info] by the way")
    assert len(harness.noted) == 4


def test_late_refusal_is_recorded_with_its_op(harness: SimHarness) -> None:
    tells: list[Notify] = []
    harness.car.on_call = lambda call: tells.append(call.caller.notifier())
    harness.receive(HONK)
    harness.receive(pedal(0.1))
    tells[0]("error", "no such scenario")
    assert [(each.op, each.subject, each.text) for each in harness.noted] == [
        ("call_service", "/honk", "no such scenario")
    ]


# What has to wait


class SlowService:
    """Holds whoever calls the car, until a test says that it is over."""

    def __init__(self, car: Car) -> None:
        self.releases: list[Callable[[], None]] = []
        self._car = car
        car.on_call = self._hold

    def _hold(self, call: Call) -> None:
        self.releases.append(call.caller.hold())

    def end(self) -> None:
        self.releases.pop(0)()


HONK: Frame = {"op": "call_service", "service": "/honk", "id": "service_request:/honk:1", "args": {"data": True}}


def pedal(value: float) -> Frame:
    return {"op": "publish", "topic": "/pedal", "msg": {"data": value}}


def test_what_comes_behind_a_call_that_takes_its_time_waits_on_its_connection(harness: SimHarness) -> None:
    slow = SlowService(harness.car)
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


def test_held_connection_still_hears_how_far_the_far_side_has_got(harness: SimHarness) -> None:
    slow = SlowService(harness.car)
    harness.receive(HONK)
    harness.flood()
    harness.pump()
    assert harness.far.ops("publish")[-1]["msg"] == {"data": 4_999}
    assert harness.connection.outbox.dropped.total() == 0
    slow.end()


def test_other_connections_go_on_while_one_is_held() -> None:
    harness = SimHarness(has_connection_each=True)
    harness.attach()
    slow = SlowService(harness.car)
    horn, pedals = harness.mirror.connections["service /honk"], harness.mirror.connections["input /pedal"]
    harness.mirror.receive(horn, json.dumps(HONK).encode(), 0.0)
    assert (horn.is_held, pedals.is_held) == (True, False)
    harness.mirror.receive(pedals, json.dumps(pedal(0.5)).encode(), 0.0)
    assert harness.car.heard == [0.5]
    slow.end()


def test_lost_socket_drops_its_waiting_frames_and_the_next_one_is_not_held(harness: SimHarness) -> None:
    slow = SlowService(harness.car)
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


def test_frames_that_waited_are_dropped_once_the_mirror_has_left(harness: SimHarness) -> None:
    slow = SlowService(harness.car)
    harness.receive(HONK)
    harness.receive(pedal(0.1))
    harness.mirror.leave(0.0)
    slow.end()
    assert harness.mirror.go_on(harness.connection, 0.0) is False
    assert harness.car.heard == []


def test_long_backlog_is_handled_in_turns_and_pauses_reading(harness: SimHarness) -> None:
    slow = SlowService(harness.car)
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
