"""One connection to a dialled bridge: questions, probes, and their end with the socket."""

from __future__ import annotations

import json
from typing import Any

import pytest

from rosbridge_sim.errors import FrameError
from rosbridge_sim.graph.attach.connection import PROBE, PROBE_PATIENCE, BridgeConnection, Values
from rosbridge_sim.graph.attach.flow_control import MAX_IN_FLIGHT
from rosbridge_sim.protocol import ops
from rosbridge_sim.protocol.outbox import OutboxLimits

Frame = dict[str, Any]

FAT = b"x" * (MAX_IN_FLIGHT // 2)
"""A frame that takes half of what may be on its way."""


class Wire:
    """A connection with a socket that takes everything, and what went over it."""

    def __init__(self) -> None:
        self.refused: list[FrameError] = []
        self.num_woken = 0
        self.connection = BridgeConnection("", OutboxLimits(), 10_000, self.refused.append)
        self.open()

    def open(self) -> None:
        self.connection.open(self._schedule_flush, lambda: None)

    def _schedule_flush(self) -> None:
        self.num_woken += 1

    def sent(self, now: float = 0.0) -> list[bytes]:
        frames: list[bytes] = []
        while taken := self.connection.take(1_000, now):
            frames += taken
        return frames

    def calls(self, now: float = 0.0) -> list[Frame]:
        return [json.loads(frame) for frame in self.sent(now) if frame.startswith(b'{"op":"call_service"')]

    def answer(self, probe: str, values: object = None, *, is_ok: bool = True, now: float = 0.0) -> list[ops.Op]:
        frame = {"op": "service_response", "service": "/x", "id": probe, "values": values or {}, "result": is_ok}
        return self.receive(json.dumps(frame).encode(), now)

    def receive(self, frame: bytes, now: float = 0.0) -> list[ops.Op]:
        return [op for op in self.connection.receive(frame, now) if op is not None]


class ReceivedAnswers:
    """What was heard."""

    def __init__(self) -> None:
        self.heard: list[tuple[Values | None, float]] = []

    def __call__(self, values: Values | None, now: float) -> None:
        self.heard.append((values, now))


def test_question_is_sent_as_a_call_and_its_answer_is_delivered_once() -> None:
    wire, words = Wire(), ReceivedAnswers()
    wire.connection.ask("/rosapi/topics", words, 1.0)
    (call,) = wire.calls()
    assert call == {"op": "call_service", "id": call["id"], "service": "/rosapi/topics", "args": {}}
    assert wire.connection.due == 1.0 + PROBE_PATIENCE
    assert wire.answer(call["id"], {"topics": []}, now=2.0) == []
    assert wire.answer(call["id"], {"topics": ["/late"]}, now=3.0) == []
    assert words.heard == [({"topics": []}, 2.0)]
    assert wire.connection.due is None


def test_refused_or_unanswered_question_gives_none() -> None:
    wire, words = Wire(), ReceivedAnswers()
    wire.connection.ask("/a", words, 0.0)
    wire.connection.ask("/b", words, 0.5)
    first, second = wire.calls()
    wire.answer(first["id"], "no", is_ok=False, now=0.1)
    wire.connection.expire(0.5 + PROBE_PATIENCE)
    assert words.heard == [(None, 0.1), (None, 0.5 + PROBE_PATIENCE)]
    assert wire.answer(second["id"]) == []  # too late, and not taken for anybody else's


def test_question_of_a_lost_socket_is_never_answered() -> None:
    wire, words = Wire(), ReceivedAnswers()
    wire.connection.ask("/a", words, 0.0)
    (call,) = wire.calls()
    wire.connection.shut()
    wire.connection.expire(100.0)
    wire.open()
    wire.answer(call["id"])
    assert words.heard == []


def test_waiting_frames_do_not_outlive_their_socket() -> None:
    wire = Wire()
    wire.connection.offer("/t", b"{}", 0.0)
    wire.connection.say("unsubscribe", topic="/t")
    wire.connection.shut()
    wire.open()
    assert wire.sent() == []


def test_other_frames_are_handed_on() -> None:
    wire = Wire()
    (op,) = wire.answer("of somebody else")
    assert isinstance(op, ops.ServiceResponse)
    (op,) = wire.receive(b'{"op":"service_response","service":"/x","result":true}')
    assert isinstance(op, ops.ServiceResponse)


def test_malformed_frame_is_reported_here_and_not_to_the_far_bridge() -> None:
    wire = Wire()
    assert wire.receive(b"{]") == []
    assert len(wire.refused) == 1
    assert wire.sent() == []


def test_probe_is_sent_after_half_a_window_and_its_answer_continues_sending() -> None:
    wire = Wire()
    wire.connection.offer("/t", FAT, 0.0, is_ordered=True)
    (probe,) = wire.calls(5.0)
    assert probe["service"] == PROBE
    for _ in range(2):
        wire.connection.offer("/t", FAT, 0.0, is_ordered=True)
    assert len(wire.sent()) == 1
    assert wire.sent() == []  # a window is full
    woken = wire.num_woken
    wire.answer(probe["id"])
    assert wire.num_woken == woken + 1
    assert [frame[:6] for frame in wire.sent()] == [b'{"op":', FAT[:6]]  # the next probe first


@pytest.mark.parametrize("number", ["7", "²", "9" * 5_000, "-1", "1.5", ""])
def test_answer_to_an_unknown_probe_is_ignored(number: str) -> None:
    wire = Wire()
    for _ in range(4):
        wire.connection.offer("/t", FAT, 0.0, is_ordered=True)
    wire.sent()
    wire.answer(f"mark:{number}")
    assert wire.connection.flow_control.is_on
    assert FAT not in wire.sent()


def test_silence_allows_more_frames_and_continues_sending() -> None:
    wire = Wire()
    for _ in range(4):
        wire.connection.offer("/t", FAT, 0.0, is_ordered=True)
    wire.sent()
    woken, due = wire.num_woken, wire.connection.due
    assert due is not None
    wire.connection.expire(due)
    assert wire.num_woken == woken + 1
    assert wire.sent(due)


@pytest.mark.parametrize("probe", ["mark:1", "mark:x", "mark:"])
def test_refused_or_odd_probe_stops_probing_for_a_while(probe: str) -> None:
    wire = Wire()
    for _ in range(4):
        wire.connection.offer("/t", FAT, 0.0, is_ordered=True)
    wire.sent()
    wire.answer(probe, "there is no such service", is_ok=False)
    assert len(wire.sent()) >= 1
    for _ in range(10):
        wire.connection.offer("/t", FAT, 0.0, is_ordered=True)
        assert wire.sent() == [FAT]
    assert wire.connection.due is not None
    wire.connection.expire(wire.connection.due)  # they are tried again
    wire.connection.offer("/t", FAT, 0.0, is_ordered=True)
    assert len(wire.calls()) == 1
