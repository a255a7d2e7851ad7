"""Frames with JSON text that are made from ops."""

from __future__ import annotations

import json

import msgspec
from hypothesis import given
from hypothesis import strategies as st

from rosbridge_sim.protocol.json_encoding import op_frame, publish_head, response_frame, status_frame
from rosbridge_sim.protocol.ops import Id


def test_status_has_no_character_that_changes_the_direction_of_its_text() -> None:
    frame = status_frame("error", "Unknown operation: \u202eevas\u2066", None)
    assert msgspec.json.decode(frame)["msg"] == "Unknown operation: \\u202eevas\\u2066"


def test_ops_are_encoded_as_frames() -> None:
    assert publish_head('/a"b') == b'{"op":"publish","topic":"/a\\"b","msg":'
    assert json.loads(
        op_frame("call_service", {"args": b"{}"}, service="/s", id="service_request:/s:1", gone=None)
    ) == {
        "op": "call_service",
        "service": "/s",
        "id": "service_request:/s:1",
        "args": {},
    }
    assert json.loads(response_frame("/s", b'{"a":1}', is_ok=True, op_id=None)) == {
        "op": "service_response",
        "service": "/s",
        "values": {"a": 1},
        "result": True,
    }


@given(st.text() | st.integers() | st.booleans() | st.floats(allow_nan=False, allow_infinity=False))
def test_ids_are_returned_unchanged(op_id: Id) -> None:
    echoed = json.loads(response_frame("/s", b'""', is_ok=False, op_id=op_id))["id"]
    assert echoed == op_id
    assert type(echoed) is type(op_id)


def test_status_text_may_hold_characters_that_no_frame_can() -> None:
    assert json.loads(status_frame("error", "no \ud800 here", "x:1"))["msg"] == "no \\ud800 here"
