"""One peer's wire: what is received, and what is said at which level."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any, TypeVar

import pytest

from rosbridge_sim.errors import FrameError
from rosbridge_sim.protocol.feed import Terms
from rosbridge_sim.protocol.flow import Outbox, OutboxLimits
from rosbridge_sim.protocol.ops import Advertise, Op, Subscribe
from rosbridge_sim.protocol.session import Feed, Session

T = TypeVar("T")


def make_session(*, is_talkative: bool = True) -> Session:
    return Session(Outbox(OutboxLimits(), lambda: None, lambda: None), lambda _due: None, is_talkative=is_talkative)


def said(session: Session) -> list[Any]:
    return [json.loads(frame) for frame in session.outbox.take(2**30)]


def receive(session: Session, frame: bytes) -> list[Op]:
    """The ops of a frame, as whoever reads a session gets them."""
    op = session.receive_plain(frame)
    return [op] if op is not None else [op for op in session.receive(frame, 0.0) if op is not None]


class Body:
    json = b'{"data":"hi"}'
    cbor = b"\xa1\x64data\x62hi"
    raw = b"\2\0\0\0hi"
    num_bytes = 100
    text_length = 0

    def framed(self, head: bytes) -> bytes:
        return head + self.json + b"}"

    def shared(self, _key: object, make: Callable[[], T]) -> T:
        return make()


def test_ops_come_in_order_and_the_rest_is_told() -> None:
    session = make_session()
    ops = receive(
        session,
        b'{"op":"advertise","topic":"/t","type":"std_msgs/String"}{"op":"fly","id":1}{"op":"subscribe","topic":"/t"}',
    )
    assert [type(op) for op in ops] == [Advertise, Subscribe]
    (status,) = said(session)
    assert (status["op"], status["level"], status["id"]) == ("status", "error", 1)
    assert (session.num_received, session.num_refused) == (1, 1)


def test_levels() -> None:
    session = make_session()
    heard = {}
    for level in ("none", "error", "warning", "warn", "info"):
        session.set_level(level)
        for remark in ("error", "warning", "info"):
            session.remark(remark, "x")
        heard[level] = [status["level"] for status in said(session)]
    assert heard == {
        "none": [],
        "error": ["error"],
        "warning": ["error", "warning"],
        "warn": ["error", "warning"],
        "info": ["error", "warning", "info"],
    }


def test_a_word_that_is_no_level_changes_nothing() -> None:
    session = make_session()
    session.set_level("loud")
    session.remark("error", "x")
    session.remark("warning", "y")
    assert len(said(session)) == 1


def test_a_silent_session_makes_no_remarks_and_still_answers() -> None:
    session = make_session(is_talkative=False)
    assert receive(session, b"rubbish") == []
    session.answer("/s", "1", "no", is_ok=False)
    (answer,) = said(session)
    assert answer == {"op": "service_response", "service": "/s", "values": "no", "result": False, "id": "1"}


def test_messages_answers_and_calls() -> None:
    session = make_session()
    feed = Feed(session, "/t")
    feed.set_terms(None, Terms())
    feed.deliver(Body(), 0.0, 0)
    session.answer("/s", None, Body(), is_ok=True)
    session.say("call_service", {"args": Body()}, service="/s", id="service_request:/s:1")
    assert said(session) == [
        {"op": "publish", "topic": "/t", "msg": {"data": "hi"}},
        {"op": "service_response", "service": "/s", "values": {"data": "hi"}, "result": True},
        {"op": "call_service", "service": "/s", "id": "service_request:/s:1", "args": {"data": "hi"}},
    ]


@pytest.mark.parametrize("op", ["[]", "{}", "7", "null", '["service_response"]'])
def test_an_op_whose_name_is_no_text_is_refused(op: str) -> None:
    session = make_session()
    lost: list[FrameError] = []
    session.on_lost_answer = lost.append
    assert receive(session, f'{{"op":{op},"id":"1"}}'.encode()) == []
    assert [frame["id"] for frame in said(session)] == ["1"]
    assert lost == []


@pytest.mark.parametrize(
    ("frame", "op", "op_id"),
    [
        ('{"op":"service_response","id":"service_request:/s:1","values":{', "service_response", "service_request:/s:1"),
        ('{"op":"action_result","id":"action_goal:/a:1","values":{', "action_result", "action_goal:/a:1"),
        ('{"op":"service_response","values":[', "service_response", None),
        (
            '{"op":"service_response","values":{"id":"service_request:/s:2"},"id":"service_request:/s:1"',
            "service_response",
            None,
        ),
        ('{"op":"service_response","id":"1","service":"/s","result":1}', "service_response", "1"),
    ],
)
def test_an_unreadable_answer_says_as_far_as_it_can_whose_it_is(frame: str, op: str, op_id: str | None) -> None:
    session = make_session()
    lost: list[FrameError] = []
    session.on_lost_answer = lost.append
    glued = '{"op":"call_service","service":"/x","id":"service_request:/s:9"}' + frame
    assert len(receive(session, glued.encode())) == 1
    assert [(error.op, error.op_id) for error in lost] == [(op, op_id)]


def test_others_have_their_turn_between_pieces_that_make_nothing_whole() -> None:
    session = make_session()
    piece = b'{"op":"fragment","id":"f","num":%d,"total":9,"data":"x"}'
    steps = session.receive(b"".join(piece % i for i in range(8)), 0.0)
    assert list(steps) == [None] * 8
