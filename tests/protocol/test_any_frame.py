"""Damaged frames of every encoding: ops or statuses, within bounds, and the next frame is read."""

from __future__ import annotations

import base64
import json
import math
from io import BytesIO
from random import Random
from typing import Any

import cbor2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from rosbridge_sim.loose_types import JsonValue
from rosbridge_sim.protocol.ops import Fragment, Op, Png, Publish
from rosbridge_sim.protocol.outbox import Outbox, OutboxLimits
from rosbridge_sim.protocol.session import Session
from tests.mutations import Edit, Flip, damage, edits, examples, flips, spoil

OPS: list[dict[str, Any]] = [
    {"op": "publish", "topic": "/t", "msg": {"data": [1, 2.5, "x"], "deep": {"a": [{}]}}, "id": "p", "latch": True},
    {"op": "subscribe", "topic": "/t", "type": "std_msgs/String", "throttle_rate": 10, "qos": {"depth": 1}},
    {"op": "call_service", "service": "/s", "args": {"a": 1}, "id": 7, "timeout": 0.5},
    {"op": "action_result", "action": "/a", "id": "g", "values": {}, "status": 4, "result": True},
    {"op": "fragment", "id": "f", "num": 0, "total": 2, "data": "{"},
    {"op": "status", "level": "info", "msg": "\u00fc"},
]

MAX_REMARK = 2_000
"""Bytes that answer one thing that is no op: it is quoted in part, and the ops that there are take 400."""


ESCAPED = 6
"""Bytes of an answer for each of the frame: its id comes back whole, with control characters escaped."""


def make_session() -> Session:
    return Session(Outbox(OutboxLimits(), lambda: None, lambda: None), lambda _due: None, max_frame_size=2**20)


def take(session: Session, frame: bytes) -> list[Op]:
    """The ops of a frame; what is said about the rest is bounded."""
    num_refused = session.num_refused
    ops = [op for op in session.receive(frame, 0.0) if op is not None]
    said = sum(map(len, session.outbox.take(2**30)))
    assert said <= MAX_REMARK * (session.num_refused - num_refused) + ESCAPED * len(frame)
    assert not any(isinstance(op, (Fragment, Png)) for op in ops)
    return ops


def check_next(session: Session) -> None:
    """See that a good frame is read as if nothing had been."""
    (op,) = take(session, b'{"op":"publish","topic":"/next","msg":{}}')
    assert isinstance(op, Publish)


def picture(data: bytes, mode: str = "RGB") -> bytes:
    width = max(1, math.isqrt(len(data) // 3))
    height = math.ceil(len(data) / 3 / width)
    file = BytesIO()
    Image.frombytes("RGB", (width, height), data.ljust(width * height * 3, b"\n")).convert(mode).save(file, "PNG")
    return file.getvalue()


def with_arrays(value: JsonValue) -> JsonValue:
    """The value with lists of numbers as typed arrays, as far as they can be."""
    if isinstance(value, dict):
        return {key: with_arrays(inner) for key, inner in value.items()}
    if isinstance(value, list) and value and all(type(one) in (int, float) and abs(one) < 1e300 for one in value):
        return cbor2.CBORTag(86, np.array(value, "<f8").tobytes())
    return [with_arrays(inner) for inner in value] if isinstance(value, list) else value


@pytest.mark.slow
@examples(80)
@given(op=st.sampled_from(OPS), changes=edits(), bends=st.just([]) | flips(2))
def test_json_with_odd_values_gives_ops_or_status(op: dict[str, Any], changes: list[Edit], bends: list[Flip]) -> None:
    session = make_session()
    take(session, damage(json.dumps(spoil(op, changes)).encode(), bends))
    check_next(session)


@pytest.mark.slow
@examples(80)
@given(op=st.sampled_from(OPS), changes=st.just([]) | edits(), bends=st.just([]) | flips())
def test_cbor_with_odd_values_gives_ops_or_status(op: dict[str, Any], changes: list[Edit], bends: list[Flip]) -> None:
    session = make_session()
    take(session, damage(cbor2.dumps(with_arrays(spoil(op, changes))), bends))
    check_next(session)


@pytest.mark.slow
@examples(60)
@given(op=st.sampled_from(OPS), changes=flips(), mode=st.sampled_from(["RGB", "RGB", "RGBA", "L", "P", "1", "I;16"]))
def test_damaged_png_gives_ops_or_status(op: dict[str, Any], changes: list[Flip], mode: str) -> None:
    session = make_session()
    text = json.dumps(op).encode() * 3
    data = damage(picture(text, "RGB" if mode == "I;16" else mode), changes)
    take(session, json.dumps({"op": "png", "data": base64.b64encode(data).decode()}).encode())
    check_next(session)


@pytest.mark.slow
@examples(60)
@given(
    op=st.sampled_from(OPS),
    size=st.integers(1, 60),
    order=st.randoms(use_true_random=False),
    changes=st.lists(st.tuples(st.integers(0, 20), edits(1)), max_size=3),
)
def test_odd_fragments_in_any_order_give_ops_or_status(
    op: dict[str, Any],
    size: int,
    order: Random,
    changes: list[tuple[int, list[Edit]]],
) -> None:
    session = make_session()
    text = json.dumps(op)
    cuts = [text[i : i + size] for i in range(0, len(text), size)]
    pieces = [{"op": "fragment", "id": "x", "num": i, "total": len(cuts), "data": cut} for i, cut in enumerate(cuts)]
    for at, spoiling in changes:
        pieces[at % len(pieces)] = spoil(pieces[at % len(pieces)], spoiling)
    order.shuffle(pieces)
    for piece in pieces:
        take(session, json.dumps(piece).encode())
    check_next(session)
