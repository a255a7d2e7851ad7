"""Frames to ops: the fast path against the slow one, and any bytes at all."""

from __future__ import annotations

import json
from typing import Any

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rosbridge_sim.errors import FrameError, Reason
from rosbridge_sim.protocol import json_decoding
from rosbridge_sim.protocol.json_decoding import decode_frame
from rosbridge_sim.protocol.json_encoding import status_frame
from rosbridge_sim.protocol.ops import OPS, CallService, Fragment, Op, Publish, Subscribe, is_absent

json_values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False) | st.text(),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(), inner, max_size=3),
    max_leaves=8,
)
field_names = sorted({field.name for op in OPS.values() for field in msgspec.structs.fields(op)})
frames_of_ops = st.fixed_dictionaries(
    {"op": st.sampled_from(sorted(OPS))},
    optional={
        name: st.text() | json_values
        if name in {"id", "msg", "args", "values"}
        else st.text() | st.booleans() | json_values
        for name in field_names
    },
)


def only_op(frame: bytes) -> Op | FrameError:
    (op,) = (op for op in decode_frame(frame) if op is not None)
    return op


def slowly(frame: bytes) -> Op | FrameError:
    (op,) = (op for op in json_decoding._decode_slowly(frame) if op is not None)
    return op


def plain(op: Op | FrameError) -> object:
    """What an op says, its bodies as values; what an error says."""
    if isinstance(op, FrameError):
        return str(op), op.op_id
    fields = {f.name: getattr(op, f.name) for f in msgspec.structs.fields(op)}
    for body in op.bodies:
        fields[body] = None if is_absent(fields[body]) else json.loads(bytes(fields[body]))
    return type(op), fields


@given(frames_of_ops)
def test_fast_path_equals_slow_path(frame: dict[str, Any]) -> None:
    text = json.dumps(frame).encode()
    assert plain(only_op(text)) == plain(slowly(text))


@given(st.binary() | st.text().map(str.encode) | json_values.map(lambda v: json.dumps(v).encode()))
def test_any_bytes_give_ops_or_errors(frame: bytes) -> None:
    for op in decode_frame(frame):
        assert isinstance(op, (FrameError, *OPS.values()))


@given(frames_of_ops, st.data())
def test_any_mutation_of_a_frame_gives_ops_or_errors(frame: dict[str, Any], data: st.DataObject) -> None:
    text = bytearray(json.dumps(frame).encode())
    for _ in range(data.draw(st.integers(1, 4))):
        at = data.draw(st.integers(0, len(text) - 1))
        text[at : at + data.draw(st.integers(0, 2))] = data.draw(st.binary(max_size=2))
        text = text or bytearray(b"{")
    for op in decode_frame(bytes(text)):
        assert isinstance(op, (FrameError, *OPS.values()))


def test_valid_frame_takes_the_fast_path(monkeypatch: pytest.MonkeyPatch) -> None:
    def never(_frame: bytes) -> None:
        raise AssertionError

    monkeypatch.setattr(json_decoding, "_decode_slowly", never)
    op = only_op(b'{"op":"publish","id":"publish:/ctrl_cmd:1","topic":"/ctrl_cmd","msg":{"accel":1},"latch":false}')
    assert isinstance(op, Publish)
    assert bytes(op.msg) == b'{"accel":1}'
    # roslib 1.4 and ROS#
    op = only_op(
        b'{"op":"subscribe","id":"s:1","type":"std_msgs/String","topic":"/t","compression":"none","throttle_rate":0,'
        b'"queue_length":0}'
    )
    assert isinstance(op, Subscribe)
    nulls = b'{"op":"call_service","service":"/s","args":null,"id":null,"fragment_size":2147483647,"compression":null}'
    op = only_op(nulls)
    assert isinstance(op, CallService)
    assert is_absent(op.args)


@pytest.mark.parametrize(
    "frame",
    [
        b"\xff\xfe",
        b"{" * 200_000,
        b'{"op":"publish","topic":"/t","msg":' + b"[" * 200_000,
        b'{"op":"publish","topic":"/t","id":' + b"9" * 10_000 + b"}",
        b'{"op":"publish","topic":"\\ud800","msg":{}}',
        b'{"op":"publish","topic":"/t","id":"\\ud800","msg":5,"latch":3}',
        b"\xef\xbb\xbf{}",
    ],
    ids=["no-utf-8", "deep", "deep-body", "long-id", "surrogate", "surrogate-id", "byte-order-mark"],
)
def test_rubbish_gets_one_readable_error(frame: bytes) -> None:
    error = only_op(frame)
    assert isinstance(error, FrameError)
    assert len(str(error)) < 800
    assert msgspec.json.decode(status_frame("error", str(error), error.op_id))["op"] == "status"


def test_number_beyond_float64_is_refused_for_a_float() -> None:
    call = {"op": "call_service", "service": "/s", "id": "c", "timeout": 10**400}
    error = only_op(json.dumps(call).encode())
    assert isinstance(error, FrameError)
    assert str(error) == "call_service: field timeout is out of range"
    assert error.op_id == "c"
    as_id = only_op(json.dumps({"op": "call_service", "service": "/s", "id": 10**400}).encode())
    assert isinstance(as_id, CallService)
    assert as_id.id == 10**400


def test_long_text_is_quoted_in_part() -> None:
    error = only_op(b'{"op":"' + b"x" * 100_000 + b'"}')
    assert len(str(error)) < 800


def test_long_fragment_may_end_in_half_a_surrogate_pair() -> None:
    data = "x" * 20_000
    op = only_op(b'{"op":"fragment","id":"f","num":0,"total":2,"data":"' + data.encode() + b'\\ud83d"}')
    assert isinstance(op, Fragment)
    assert op.data == data + "\ud83d"


def test_a_long_object_without_an_op_is_not_quoted_in_full() -> None:
    steps = list(decode_frame(b'{"a":"' + b"x" * 100_000 + b'"}'))
    assert len(steps) > 2  # others have their turn in between
    assert "without an op" in str(steps[-1])
    assert len(str(steps[-1])) < 1_000


@pytest.mark.parametrize("length", [1, json_decoding.LONG])
def test_message_without_an_op_is_quoted_as_it_came(length: int) -> None:
    error = only_op(json.dumps({"topic": "/t", "msg": {"data": "x" * length}, "id": 5}).encode())
    quoted = str(error).partition("Original message was: ")[2].replace('"', "'")
    assert quoted.startswith("{'topic': '/t', 'msg': {'data': 'x")
    assert "object at" not in quoted  # an address of memory, which helps an attacker


@pytest.mark.parametrize(
    "frame",
    [
        b'{"op":"auth","token":"s3same","x":',
        b'{"op": "auth", "token" : "s3same"} rubbish',
        b'["op", {"token": "s3same"}]',
        b'{"token": "s3same"}',
        b'{"op": ["token", {"token": "s3same"}]}',
        b'{"op":"auth","token":"' + b"s3same" * 100 + b'",}',
    ],
)
def test_unusable_frame_is_quoted_without_its_token(frame: bytes) -> None:
    errors = [str(one) for one in decode_frame(frame) if isinstance(one, FrameError)]
    assert errors
    assert "s3same" not in "".join(errors)


@pytest.mark.parametrize(
    ("op", "end"),
    [
        ("publsh", "(did you mean publish?)"),
        ("callService", "(did you mean call_service?)"),
        ("nothing like it", "]"),
        (7, "]"),
    ],
)
def test_nearest_op_is_suggested_after_the_list(op: object, end: str) -> None:
    (error,) = decode_frame(json.dumps({"op": op}).encode())
    assert isinstance(error, FrameError)
    assert str(error).endswith(end)
    assert error.reason is Reason.UNKNOWN_OP


HEAVY_LIST = b"[" + b'"",' * 800_001 + b'""]'


@pytest.mark.parametrize(
    ("head", "named"),
    [
        (b'{"op":"call_service","id":"c","service":"/s","args":', ("c", "/s")),
        (b'{"id": -7, "service": "/s", "op": "call_service", "args":', (-7, "/s")),
        (b'{"op":"call_service","service":"/s","args":', (None, "/s")),
        (b'{"op":"publish","id":"p","topic":"/t","msg":', ("p", None)),
        (b'{"op":"publish","id":"p","topic":"/t","note":{"op":"call_service","service":"/s"},"msg":', ("p", None)),
        (b'{"op":"call_service","id":"c","service":"/s","note":{"service":"/other"},"args":', ("c", None)),
    ],
)
def test_heavy_call_is_named_so_that_it_can_be_answered(head: bytes, named: tuple[object, str | None]) -> None:
    *_, error = decode_frame(head + HEAVY_LIST + b"}")
    assert isinstance(error, FrameError)
    assert (error.op_id, error.service) == named
