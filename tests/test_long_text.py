"""A JSON text that is mostly one base64 text is decoded as any other, only faster."""

from __future__ import annotations

import base64
import json
from typing import Any

import pytest

from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.long_text import LEAST, MARK, MAX_REST, MOST, LongBody, LongText, find_long_text
from rosbridge_sim.protocol import json_decoding, session
from rosbridge_sim.schema.message import Message
from rosbridge_sim.schema.message_type import MessageType
from tests.graph.bus_fixture import Wire, make_bus, make_store

DATA = base64.b64encode(bytes(range(256)) * 200).decode()
IMAGE = {"header": {"frame_id": "camera"}, "format": "jpeg", "data": DATA}


def publish(msg: object, kind: str = "sensor_msgs/CompressedImage", **more: object) -> bytes:
    return json.dumps({"op": "publish", "topic": "/t", "type": kind, "id": "it", "msg": msg, **more}).encode()


def fields(**changed: object) -> dict[str, Any]:
    return {**IMAGE, **changed}


FRAMES = {
    "an image": publish(IMAGE),
    "an image, data first": publish({"data": DATA, "format": "png"}),
    "no padding": publish(fields(data=DATA[:-1])),
    "wrong padding": publish(fields(data=DATA + "=")),
    "no padding needed": publish(fields(data=DATA[:-4])),
    "one byte in the last group": publish(fields(data=DATA[:-4] + "AA==")),
    "bits behind two bytes": publish(fields(data=DATA[:-4] + "AAB=")),
    "bits behind the end": publish(fields(data="A" * 20_001 + "B==")),
    "white space in it": publish(fields(data=DATA[:30_000] + "\n" + DATA[30_000:])),
    "escaped slashes": publish(IMAGE).replace(b"/", b"\\/"),
    "an escape at its start": publish(fields(data='"' + DATA)),
    "two long texts": publish(fields(format=DATA)),
    "in a field of text": publish({"data": DATA}, "std_msgs/String"),
    "in a field of text beside bytes": publish({"format": DATA}),
    "in a field that does not exist": publish(fields(more=DATA, data="")),
    "in a field of numbers": publish(fields(header={"seq": DATA})),
    "in a nested message": publish({"texture": {"data": DATA}}, "visualization_msgs/Marker"),
    "a list of bytes": publish({"data": DATA, "layout": {"data_offset": 3}}, "std_msgs/UInt8MultiArray"),
    "an array of fixed length": publish({"uuid": DATA}, "unique_identifier_msgs/UUID"),
    "of an unknown type": publish({"data": DATA, "x": [1, None]}, "mine/Mine"),
    "the mark beside it": publish(fields(format=MARK)),
    "the mark in its place": publish(fields(data=MARK, format="x" * 20_000)),
    "the mark in the id": publish(IMAGE, id=MARK),
    "in the id": publish(fields(data=""), id=DATA),
    "in the topic": publish(fields(data=""), topic=DATA),
    "in an unknown field": publish(fields(data=""), more=DATA),
    "two ops": publish(IMAGE) * 2,
    "not JSON behind it": publish(IMAGE)[:-1],
    "not JSON before it": b"," + publish(IMAGE),
    "NaN beside it": publish({"data": DATA, "header": {"seq": float("nan")}}),
    "by position": json.dumps({"op": "publish", "topic": "/t", "type": "std_msgs/String", "msg": [DATA]}).encode(),
    "a fragment": json.dumps({"op": "fragment", "id": "f", "num": 0, "total": 2, "data": DATA}).encode(),
    "args of a call": json.dumps({"op": "call_service", "service": "/no", "args": {"x": DATA}, "id": "c"}).encode(),
    "values of an answer": json.dumps({"op": "service_response", "service": "/no", "values": {"x": DATA}}).encode(),
}


def hear(frame: bytes) -> list[list[bytes]]:
    """What the sender of a frame and three listeners get."""
    bus: Bus = make_bus()
    wires = [Wire(bus) for _ in range(4)]
    wires[0].says(op="set_level", level="info")
    for _ in range(2):  # the topic exists now, with its type, and may be read in one pass
        wires[0].peer.receive(frame, 0.0)
    for wire, compression in zip(wires[1:], ("none", "cbor", "cbor-raw"), strict=True):
        wire.says(op="subscribe", topic="/t", compression=compression)
    wires[0].peer.receive(frame, 0.0)
    return [wire.outbox.take(2**30) for wire in wires]


@pytest.mark.parametrize("name", FRAMES)
def test_answers_and_messages_are_those_of_the_usual_way(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    quick = hear(FRAMES[name])
    for module in (json_decoding, session):
        monkeypatch.setattr(module, "find_long_text", lambda _frame: None)
    assert hear(FRAMES[name]) == quick


def test_image_is_decoded_without_its_text(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> None:
        raise AssertionError("the usual way")

    monkeypatch.setattr(json_decoding, "_too_heavy", fail)
    monkeypatch.setattr(MessageType, "_count", fail)
    sent = hear(FRAMES["an image"])[1]
    assert json.loads(sent[0])["msg"]["data"] == DATA


def test_image_of_a_known_topic_is_read_in_one_pass_and_not_copied(monkeypatch: pytest.MonkeyPatch) -> None:
    quick = hear(FRAMES["an image"])

    copy = LongText.body

    def body(self: LongText, short: bytes) -> LongBody | None:
        num_copies.append(1)
        return copy(self, short)

    num_copies: list[int] = []
    monkeypatch.setattr(LongText, "body", body)
    assert hear(FRAMES["an image"]) == quick
    assert len(num_copies) == 2  # of three


def test_base64_of_an_image_is_passed_on_as_it_came() -> None:
    image = make_store().message("sensor_msgs/CompressedImage")
    for data, is_kept in ((DATA, True), (DATA[:-4] + "AAB=", False)):
        text = json.dumps(fields(data=data)).encode()
        found = find_long_text(text)
        assert found is not None
        body = found.body(found.short)
        assert body is not None
        value = image.decode_json(body, 0)
        parts = image.encode_json_parts(value)
        assert b"".join(parts) == image.encode_json(value)
        assert [part.obj for part in parts if isinstance(part, memoryview)] == [text] * is_kept
        assert Message(image, value, len(text)).framed(b"head") == b"head" + image.encode_json(value) + b"}"


@pytest.mark.parametrize(
    ("num_before", "num", "is_found"),
    [
        (100, LEAST, True),
        (100, LEAST - 300, False),
        (100, MOST - 200, True),
        (100, MOST, False),
        (MAX_REST - 100, 2 * LEAST, True),
        (MAX_REST, 2 * LEAST, False),
    ],
)
def test_bounds(num_before: int, num: int, *, is_found: bool) -> None:
    text = json.dumps({"a": "x" * num_before, "b": "A" * (num - num % 4)}).encode()
    assert (find_long_text(text) is not None) == is_found


def test_body_is_the_part_of_the_text_with_its_bytes() -> None:
    text = publish(IMAGE)
    found = find_long_text(text)
    assert found is not None
    short = found.short[found.short.index(b'"msg"') + 7 : -1]
    body = found.body(short)
    assert isinstance(body, LongBody)
    assert json.loads(body) == IMAGE
    assert json.loads(body.short) == {**IMAGE, "data": MARK}
    assert body.data == base64.b64decode(DATA)
    assert found.body(b"{}") is None
    message = make_store().message("sensor_msgs/CompressedImage")
    assert message.decode_json(body, 5) == message.decode_json(bytes(body), 5)
