"""Frames that are read in one pass give the same as those that are read in two."""

from __future__ import annotations

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rosbridge_sim.errors import PeerError
from rosbridge_sim.graph.participant import decode_body
from rosbridge_sim.graph.peers.publish_reader import LEARN_EACH, MAX_LEARNT, PublishReader
from rosbridge_sim.graph.topics_services import Topic
from rosbridge_sim.long_text import LongText, find_long_text
from rosbridge_sim.protocol.json_decoding import LONG, decode_quickly
from rosbridge_sim.protocol.ops import Publish
from rosbridge_sim.protocol.outbox import Outbox, OutboxLimits
from rosbridge_sim.protocol.session import SHORT, Session
from rosbridge_sim.schema.message import Message
from rosbridge_sim.schema.message_type import MessageType
from rosbridge_sim.schema.opaque_types import OpaqueType
from tests.graph.bus_fixture import Wire, make_bus, make_store
from tests.schema.strategies import STAMP_NS, bodies, broken_texts, every_type, odd_bodies

ODOMETRY = "nav_msgs/Odometry"
COVARIANCE = [0.5] * 36
BODY = {"child_frame_id": "base_link", "pose": {"covariance": COVARIANCE}, "twist": {"covariance": COVARIANCE}}


def frame_of(topic: str = "/t", **changed: object) -> bytes:
    return json.dumps({"op": "publish", "topic": topic, "msg": BODY, **changed}).encode()


PLAIN = frame_of()
TEXT = json.dumps(BODY).encode()

FRAMES = {
    "plain": PLAIN,
    "of roslib": frame_of(id="publish:/t:17", latch=False),
    "without spaces": json.dumps(json.loads(PLAIN), separators=(",", ":")).encode(),
    "message first": b'{"op":"publish","msg":' + TEXT + b',"topic":"/t"}',
    "op last": b'{"topic":"/t","msg":' + TEXT + b',"op":"publish"}',
    "topic with an escape": PLAIN.replace(b'"/t"', b'"\\u002ft"'),
    "topic without its slash": frame_of("t"),
    "unknown topic": frame_of("/other"),
    "topic of another type": frame_of("/text"),
    "topic twice": PLAIN.replace(b'"/t"', b'"/t", "topic": "/text"'),
    "op twice": PLAIN.replace(b'"publish"', b'"publish", "op": "subscribe"', 1),
    "message twice": PLAIN[:-1] + b', "msg": {"child_frame_id": "second"}}',
    "message twice, the first one wrong": PLAIN.replace(b'"msg"', b'"msg": 5, "msg"'),
    "type": frame_of(type=ODOMETRY),
    "another type": frame_of(type="std_msgs/String"),
    "wrong type": frame_of(type=5),
    "wrong id": frame_of(id=[1]),
    "id with half a pair": frame_of(id="\ud800"),
    "null for the message": frame_of(msg=None, more="x" * SHORT),
    "no message": frame_of(more="x" * SHORT).replace(b'"msg"', b'"message"'),
    "null fields": frame_of(id=None, latch=None, type=None, qos=None),
    "qos": frame_of(qos={"depth": 3}),
    "unknown field": frame_of(msg={**BODY, "more": 1}),
    "unknown field of the op": frame_of(more=[1, {"x": None}]),
    "short list": frame_of(msg={"pose": {"covariance": COVARIANCE[1:]}, "child_frame_id": "x" * SHORT}),
    "whole numbers": frame_of(msg={**BODY, "pose": {"covariance": [1] * 36}}),
    "NaN": frame_of(msg={**BODY, "pose": {"covariance": [float("nan")] * 36}}),
    "by position": frame_of(msg=[{}, "base_link" * 50]),
    "empty stamp": frame_of(msg={**BODY, "header": {"stamp": None}}),
    "own stamp": frame_of(msg={**BODY, "header": {"stamp": {"secs": 3, "nsecs": 4}}}),
    "two ops": PLAIN * 2,
    "cut off": PLAIN[:-1],
    "not UTF-8": PLAIN.replace(b"base_link", b"base\xff"),
    "beyond ASCII": PLAIN.replace(b"base_link", "차".encode()),
    "deeply nested": frame_of(msg={**BODY, "more": json.loads("[" * 400 + "]" * 400)}),
}


def hear(frame: bytes, *, may_learn: bool) -> list[list[bytes]]:
    """What the sender of a frame and the listeners get, after the sender has published its topics often."""
    bus = make_bus()
    bus.stamp_ns = STAMP_NS
    sender, *listeners = (Wire(bus) for _ in range(3))
    sender.says(op="set_level", level="info")
    for listener in listeners:
        listener.says(op="subscribe", topic="/t", type=ODOMETRY)
        listener.says(op="subscribe", topic="/text", type="std_msgs/String")
    for topic, kind, usual in (("/t", ODOMETRY, PLAIN), ("/text", "std_msgs/String", frame_of("/text", msg={}))):
        sender.says(op="advertise", topic=topic, type=kind)
        for _ in range(LEARN_EACH):
            sender.peer.receive(usual, 0.0)
    assert sender.peer.session.reader is not None
    if not may_learn:
        sender.peer.session.reader = None
    for wire in (sender, *listeners):
        wire.outbox.take(2**30)
    sender.peer.receive(frame, 0.0)
    return [wire.outbox.take(2**30) for wire in (sender, *listeners)]


@pytest.mark.parametrize("name", FRAMES)
def test_answers_and_messages_are_those_of_the_usual_way(name: str) -> None:
    assert hear(FRAMES[name], may_learn=True) == hear(FRAMES[name], may_learn=False)


@pytest.mark.parametrize("name", ["plain", "of roslib", "without spaces", "message first", "beyond ASCII", "own stamp"])
def test_ordinary_frames_are_read_in_one_pass(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    decode_usually = MessageType.decode_json

    def decode_json(self: MessageType, body: bytes, stamp_ns: int) -> object:
        assert body != FRAMES[name][FRAMES[name].index(b'"msg"') + 6 :], "read in two passes"
        seen.append(body)
        return decode_usually(self, body, stamp_ns)

    seen: list[bytes] = []
    monkeypatch.setattr(MessageType, "decode_json", decode_json)
    sender, first, _ = hear(FRAMES[name], may_learn=True)
    assert (len(sender), len(first)) == (0, 1)
    assert len(seen) == 2 * LEARN_EACH


@pytest.mark.parametrize("number", ["1e308", "1E308"])
def test_slow_numbers_are_not_decoded_twice(number: str) -> None:
    reader = reader_of(make_store().message("std_msgs/Float64MultiArray"))
    head, many = '{"op":"publish","topic":"/t","msg":{"data":[', LONG // 7
    assert reader.read(f"{head}{number}{',0.5' * many}]}}}}".encode()) is not None
    assert reader.read(f"{head}{number}{f',{number}' * many}]}}}}".encode()) is None
    assert reader.read(f"{head}{number}{f',{number}' * (many // 8)}]}}}}".encode()) is not None


def make_reader(publications: dict[str, Topic]) -> tuple[PublishReader, Session]:
    """A reader that has learnt nothing, and its session."""
    bus = make_bus()
    bus.stamp_ns = STAMP_NS
    session = Session(Outbox(OutboxLimits(), print, print), print)
    return PublishReader(publications, bus, session), session


def reader_of(message_type: MessageType) -> PublishReader:
    """A reader that has learnt the topic `/t` of a type."""
    topic = Topic("/t", message_type)
    reader, _ = make_reader({"/t": topic})
    for _ in range(LEARN_EACH):
        reader.note_usual("/t", topic)
    return reader


def compare(message_type: MessageType, text: bytes) -> bool:
    """Whether a message with this text is read in one pass; if it is, the usual way must give the same."""
    frame = b'{"op":"publish","id":"i","topic":"/t","msg":' + text + b',"latch":true}'
    read = reader_of(message_type).read(frame)
    if read is None:
        return False
    op = decode_quickly(frame)
    assert isinstance(op, Publish)
    value = decode_body(message_type, op.msg, STAMP_NS)
    message: object = read.msg
    assert isinstance(message, Message)
    assert message.json == message_type.encode_json(value)
    assert repr(message.value) == repr(value)
    assert (read.id, read.topic, read.latch, read.type, read.qos) == (op.id, op.topic, op.latch, op.type, op.qos)
    return True


@pytest.mark.slow
@given(st.data())
def test_plain_messages_of_any_type_are_read_in_one_pass_with_equal_results(data: st.DataObject) -> None:
    message_type = data.draw(every_type())
    assert compare(message_type, json.dumps(data.draw(bodies(message_type))).encode())


@pytest.mark.slow
@given(st.data())
def test_odd_and_broken_messages_are_read_as_usual_or_not_at_all(data: st.DataObject) -> None:
    message_type = data.draw(every_type())
    if data.draw(st.booleans()):
        text = json.dumps(data.draw(odd_bodies(message_type))).encode()
    else:
        text = data.draw(broken_texts(message_type))
    try:
        compare(message_type, text)
    except PeerError as error:  # only the usual way raises it
        pytest.fail(f"read in one pass, but refused in two: {error}")


def test_topic_is_learnt_after_some_messages_or_one_long_one() -> None:
    topic = Topic("/t", make_store().message(ODOMETRY))
    reader, session = make_reader({"/t": topic})
    for _ in range(LEARN_EACH - 1):
        reader.note_usual("/t", topic)
    assert session.reader is None
    reader.note_usual("/t", topic)
    assert session.reader is reader
    assert reader.read(PLAIN) is not None

    reader, session = make_reader({"/t": topic})
    session.frame_length = LONG
    reader.note_usual("/t", topic)
    assert session.reader is reader


def test_topic_whose_type_is_unknown_is_not_learnt() -> None:
    topic = Topic("/t", OpaqueType("mine/Mine"))
    reader, session = make_reader({"/t": topic})
    for _ in range(2 * LEARN_EACH):
        reader.note_usual("/t", topic)
    assert session.reader is None


DATA = "iVBO" * LONG
IMAGE = {"format": "jpeg", "data": DATA}


def long_text(msg: object, topic: str = "/t") -> LongText:
    found = find_long_text(frame_of(topic, msg=msg, id="i", latch=False))
    assert found is not None
    return found


def test_image_is_read_in_one_pass_with_its_text_as_it_came() -> None:
    image = make_store().message("sensor_msgs/CompressedImage")
    frame = long_text(IMAGE)
    read = reader_of(image).read_long(frame)
    assert read is not None
    assert (read.topic, read.id, read.latch) == ("/t", "i", False)
    message: object = read.msg
    assert isinstance(message, Message)
    value = image.decode_json(json.dumps(IMAGE).encode(), STAMP_NS)
    assert (message.type, message.value, message.text_length) == (image, value, len(frame.text))
    assert message.long_field is not None
    assert message.long_field[1].obj is frame.text
    assert message.json == image.encode_json(value)
    assert message.framed(b"head") == b"head" + image.encode_json(value) + b"}"


@pytest.mark.parametrize(
    ("frame", "kind"),
    [
        (
            long_text({**IMAGE, "data": DATA + "AAB="}),
            "sensor_msgs/CompressedImage",
        ),  # its bits beyond the end are not 0
        (long_text(IMAGE, "/other"), "sensor_msgs/CompressedImage"),
        (long_text({"data": "", "format": DATA}), "sensor_msgs/CompressedImage"),
        (long_text({**IMAGE, "more": 1}), "sensor_msgs/CompressedImage"),
        (long_text({"data": DATA}), "std_msgs/String"),
        (long_text({"data": [DATA]}), "std_msgs/UInt8MultiArray"),
    ],
)
def test_other_long_texts_are_left_to_the_usual_way(frame: LongText, kind: str) -> None:
    assert reader_of(make_store().message(kind)).read_long(frame) is None


def test_topic_that_has_ended_or_has_another_type_is_left_to_the_usual_way() -> None:
    image, odometry = (make_store().message(kind) for kind in ("sensor_msgs/CompressedImage", ODOMETRY))
    for kind in (image, odometry):
        publications = {"/t": Topic("/t", kind)}
        reader, _ = make_reader(publications)
        for _ in range(LEARN_EACH):
            reader.note_usual("/t", publications["/t"])
        assert (reader.read(PLAIN) is None) == (kind is image)
        assert (reader.read_long(long_text(IMAGE)) is None) == (kind is odometry)
        publications["/t"] = Topic("/t", make_store().message("std_msgs/String"))
        assert reader.read(PLAIN) is None
        assert reader.read_long(long_text(IMAGE)) is None
        publications.clear()
        assert reader.read(PLAIN) is None
        assert reader.read_long(long_text(IMAGE)) is None


def test_topic_with_a_new_type_is_read_by_the_new_type() -> None:
    bus = make_bus()
    sender, listener = Wire(bus), Wire(bus)
    for _ in range(LEARN_EACH + 1):
        sender.says(op="publish", topic="/t", type=ODOMETRY, msg=BODY)
    sender.says(op="unadvertise", topic="/t")
    bus.expire(1e9)
    sender.says(op="advertise", topic="/t", type="std_msgs/String")
    listener.says(op="subscribe", topic="/t")
    (refusal,) = sender.says(op="publish", topic="/t", msg=BODY)
    assert "std_msgs/String" in refusal["msg"]
    text = "x" * SHORT
    for _ in range(2 * LEARN_EACH):
        assert sender.says(op="publish", topic="/t", msg={"data": text}) == []
        assert [each["msg"] for each in listener.hears()] == [{"data": text}]
    reader = sender.peer.session.reader
    assert reader is not None
    assert reader.read(frame_of(msg={"data": text})) is not None


def test_publish_of_a_topic_that_the_client_has_left_advertises_it_anew() -> None:
    bus = make_bus()
    sender = Wire(bus)
    for _ in range(2 * LEARN_EACH):
        sender.says(op="publish", topic="/t", type=ODOMETRY, msg=BODY)
    sender.says(op="unadvertise", topic="/t")
    assert sender.peer not in bus.topics["/t"].publishers
    sender.says(op="publish", topic="/t", msg=BODY)
    assert sender.peer in bus.topics["/t"].publishers


def test_few_topics_of_a_client_are_learnt() -> None:
    bus = make_bus()
    sender, listener = Wire(bus), Wire(bus)
    num = 2 * MAX_LEARNT
    for i in range(num):
        listener.says(op="subscribe", topic=f"/{i}", type=ODOMETRY)
        for _ in range(LEARN_EACH + 1):
            sender.peer.receive(frame_of(f"/{i}", type=ODOMETRY), 0.0)
        assert len(listener.hears()) == LEARN_EACH + 1
    reader = sender.peer.session.reader
    assert reader is not None
    learnt = [i for i in range(num) if reader.read(frame_of(f"/{i}")) is not None]
    assert len(learnt) == MAX_LEARNT
