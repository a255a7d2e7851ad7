"""The first op of a small frame is read, and nothing that is long, packed or not plain JSON."""

from __future__ import annotations

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rosbridge_sim.protocol.first_op import MAX_SMALL, FirstOp, read_first_op, refusal_frame

AUTH = b'{"op":"auth","token":"sesame"}'
OP = FirstOp("auth", token="sesame")  # noqa: S106 - opens nothing


def test_auth_op_is_read_with_ops_glued_behind_it() -> None:
    assert read_first_op(AUTH) == (OP, b"")
    assert read_first_op(b" \n" + AUTH + b"\n") == (OP, b"")
    assert read_first_op(AUTH + b' {"op":"x"} rubbish') == (OP, b'{"op":"x"} rubbish')
    assert read_first_op(AUTH + b"\xff\xfe") == (OP, b"\xff\xfe")


def test_message_bodies_are_skipped() -> None:
    frame = b'{"op":"publish","topic":"/t","msg":{"a":[1,2,{"b":null}]},"id":7}'
    assert read_first_op(frame) == (FirstOp("publish", id=7), b"")


@pytest.mark.parametrize(
    "frame",
    [
        b"",
        b"null",
        b'"auth"',
        b"[]",
        b'{"op":1}',
        b'{"token":"sesame"}',
        b'{"op":"auth","token":7}',
        b'{"op":"auth","token":"\\ud800"}',
        b'{"op":"\xff"}',
        b"\xa2bopdauthetokenfsesame",  # CBOR
        b'{"op":"a","x":' + b"[" * 2_000 + b"]" * 2_000 + b"}",
        b'{"op":"auth","token":"' + b"x" * MAX_SMALL + b'"}',
        AUTH + b" " * MAX_SMALL,
    ],
)
def test_frame_that_is_not_a_small_plain_op_gives_none(frame: bytes) -> None:
    assert read_first_op(frame) is None


def test_the_longest_small_frame_is_read() -> None:
    frame = AUTH[:-1] + b" " * (MAX_SMALL - len(AUTH)) + b"}"
    assert len(frame) == MAX_SMALL
    assert read_first_op(frame) == (OP, b"")


@given(st.binary(max_size=200) | st.text(max_size=100).map(str.encode))
def test_any_bytes_never_raise_and_can_be_answered(frame: bytes) -> None:
    for data in (frame, AUTH + frame, b'{"op":"x","id":"' + frame + b'"}'):
        found = read_first_op(data)
        answer = json.loads(refusal_frame(found[0] if found else None, "no"))
        assert answer["op"] in {"status", "service_response", "action_result"}


@pytest.mark.parametrize(
    ("frame", "answer"),
    [
        ({"op": "subscribe", "id": "s"}, {"op": "status", "level": "error", "msg": "no", "id": "s"}),
        ({"op": "advertise"}, {"op": "status", "level": "error", "msg": "no"}),
        (
            {"op": "call_service", "service": "/s", "id": 1},
            {"op": "service_response", "service": "/s", "values": "no", "result": False, "id": 1},
        ),
        (
            {"op": "call_service", "service": "/s#old"},
            {"op": "service_response", "service": "/s#old", "values": "no", "result": False, "id": "old"},
        ),
        ({"op": "call_service"}, {"op": "status", "level": "error", "msg": "no"}),
        (
            {"op": "send_action_goal", "action": "/a", "id": "g"},
            {"op": "action_result", "action": "/a", "id": "g", "status": 0, "result": False, "values": "no"},
        ),
    ],
)
def test_refusal_has_the_form_of_an_answer_to_the_op(frame: dict[str, object], answer: dict[str, object]) -> None:
    found = read_first_op(json.dumps(frame).encode())
    assert found is not None
    assert json.loads(refusal_frame(found[0], "no")) == answer
