"""One session: received frames, and statuses by level."""

from __future__ import annotations

import json
import weakref
from collections.abc import Callable
from typing import Any, NoReturn, TypeVar

import cbor2
import pytest

from rosbridge_sim.errors import EncodingError, FieldError, FrameError
from rosbridge_sim.long_text import LongText, find_long_text
from rosbridge_sim.protocol.client_memory import Account
from rosbridge_sim.protocol.json_decoding import HEAVY, LONG
from rosbridge_sim.protocol.ops import Advertise, Op, Publish, Subscribe
from rosbridge_sim.protocol.outbox import Outbox, OutboxLimits
from rosbridge_sim.protocol.png import PngFrame
from rosbridge_sim.protocol.session import SHORT, Session
from rosbridge_sim.protocol.subscription import Feed, SubscriptionOptions

T = TypeVar("T")


def make_session(*, is_talkative: bool = True, account: Account | None = None) -> Session:
    outbox = Outbox(OutboxLimits(), lambda: None, lambda: None)
    return Session(outbox, lambda _due: None, is_talkative=is_talkative, account=account)


def make_feed(session: Session, terms: SubscriptionOptions, topic: str = "/t") -> Feed:
    feed = Feed(session, topic)
    feed.set_options(None, terms)
    return feed


def said(session: Session) -> list[Any]:
    return [json.loads(frame) for frame in session.outbox.take(2**30)]


def png_of(frame: bytes) -> bytes:
    """An op with an image that holds a frame."""
    picture = PngFrame(frame)
    while not picture.work():
        pass
    assert picture.frame is not None
    return picture.frame


def receive(session: Session, frame: bytes) -> list[Op]:
    """The ops of a frame, as whoever reads a session gets them."""
    op = session.receive_plain(frame)
    return [op] if op is not None else [op for op in session.receive(frame, 0.0) if op is not None]


class Learnt:
    """A reader that knows one topic, and notes what it was asked to read."""

    def __init__(self, topic: str) -> None:
        self._topic = topic
        self.short: list[bytes] = []
        self.long: list[LongText] = []

    def read(self, frame: bytes) -> Op | None:
        self.short.append(frame)
        return self._op_of(frame)

    def read_long(self, frame: LongText) -> Op | None:
        self.long.append(frame)
        return self._op_of(frame.short)

    def _op_of(self, text: bytes) -> Op | None:
        return Publish(topic=self._topic, id="read") if json.loads(text)["topic"] == self._topic else None


class Body:
    """A message as `schema/` encodes it."""

    json = b'{"data":"hi"}'
    cbor = b"\xa1\x64data\x62hi"
    raw = b"\2\0\0\0hi"
    num_bytes = 100
    text_length = 0

    def framed(self, head: bytes) -> bytes:
        return head + self.json + b"}"

    def shared(self, _key: object, make: Callable[[], T]) -> T:
        return make()


class Numbered(Body):
    """A message that holds a number."""

    def __init__(self, number: int) -> None:
        self.json = b'{"data":%d}' % number


class Heavy(Body):
    """A message that is encoded when it is taken from the outbox."""

    text_length = HEAVY


class Unwritable(Heavy):
    """A heavy message whose encoder breaks down."""

    def __init__(self, error: Exception) -> None:
        self.error = error

    def framed(self, _head: bytes) -> NoReturn:
        raise self.error


class Unfit(Body):
    """A message that CBOR cannot hold."""

    @property
    def cbor(self) -> NoReturn:  # type: ignore[override] # that it cannot be had is the point
        raise FieldError("not in cbor")


def publish(size: int, topic: str = "/learnt", filler: str = "A") -> bytes:
    """A frame of so many bytes, with a text of whole groups of base64."""
    start, end = f'{{"op":"publish","topic":"{topic}","msg":{{"data":"', '"}}'
    num = (size - len(start) - len(end)) // 4 * 4
    return (start + filler * num + end).encode().ljust(size)


def body_of(frame: bytes) -> bytes:
    return frame[frame.index(b'"msg":') + 6 : frame.rindex(b"}")]


@pytest.mark.parametrize("size", [SHORT - 1, SHORT, SHORT + 1, LONG - 1])
def test_short_frames_are_read_in_the_usual_way_and_longer_ones_by_the_reader(size: int) -> None:
    session = make_session()
    reader = session.reader = Learnt("/learnt")
    learnt, other = publish(size), publish(size, "/other")
    ops = [session.receive_plain(frame) for frame in (learnt, other)]
    assert reader.short == ([] if size < SHORT else [learnt, other])
    assert [getattr(op, "id", None) for op in ops] == ([None, None] if size < SHORT else ["read", None])
    assert isinstance(ops[1], Publish)
    assert bytes(ops[1].msg) == body_of(other)
    assert (session.num_received, session.frame_length, reader.long) == (2, 0, [])


@pytest.mark.parametrize("size", [LONG, 2 * LONG, HEAVY - 1])
def test_long_texts_are_read_by_the_reader_or_in_the_usual_way(size: int) -> None:
    session = make_session()
    reader = session.reader = Learnt("/learnt")
    for topic, expected in (("/learnt", "read"), ("/other", None)):
        frame = publish(size, topic)
        op = session.receive_plain(frame)
        assert isinstance(op, Publish)
        assert (op.topic, op.id, session.frame_length) == (topic, expected, size)
        assert reader.long[-1].text is frame
        assert expected or bytes(op.msg) == body_of(frame)
    assert (session.num_received, len(reader.long), reader.short) == (2, 2, [])


def test_long_frames_without_a_long_text_and_heavy_ones_are_no_plain_frames() -> None:
    session = make_session()
    reader = session.reader = Learnt("/learnt")
    for frame in (publish(2 * LONG, filler="-"), publish(HEAVY), publish(HEAVY + 1)):
        assert session.receive_plain(frame) is None
    assert session.num_received == 0
    assert (reader.short, reader.long) == ([], [])


def test_long_text_is_looked_for_where_its_owner_says() -> None:
    session = make_session()
    frame = publish(LONG)
    assert session.receive_plain(frame) is not None
    asked: list[bytes] = []

    def look(text: bytes) -> LongText | None:
        asked.append(text)
        return find_long_text(text)

    session.find_long_text = look
    assert session.receive_plain(frame) is not None
    assert asked == [frame]
    session.find_long_text = lambda _text: None
    assert session.receive_plain(frame) is None


def test_ops_are_delivered_in_order_and_errors_reported() -> None:
    session = make_session()
    ops = receive(
        session,
        b'{"op":"advertise","topic":"/t","type":"std_msgs/String"}{"op":"fly","id":1}{"op":"subscribe","topic":"/t"}',
    )
    assert [type(op) for op in ops] == [Advertise, Subscribe]
    (status,) = said(session)
    assert (status["op"], status["level"], status["id"]) == ("status", "error", 1)
    assert (session.num_received, session.num_refused) == (1, 1)


def test_status_level_filters_statuses() -> None:
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


def test_unknown_status_level_changes_nothing() -> None:
    session = make_session()
    session.set_level("loud")
    session.remark("error", "x")
    session.remark("warning", "y")
    assert len(said(session)) == 1


def test_session_with_level_none_sends_answers_and_no_status() -> None:
    session = make_session(is_talkative=False)
    assert receive(session, b"rubbish") == []
    session.answer("/s", "1", "no", is_ok=False)
    (answer,) = said(session)
    assert answer == {"op": "service_response", "service": "/s", "values": "no", "result": False, "id": "1"}


def test_session_sends_messages_answers_and_calls() -> None:
    session = make_session()
    feed = Feed(session, "/t")
    feed.set_options(None, SubscriptionOptions())
    feed.deliver(Body(), 0.0, 0)
    session.answer("/s", None, Body(), is_ok=True)
    session.say("call_service", {"args": Body()}, service="/s", id="service_request:/s:1")
    assert said(session) == [
        {"op": "publish", "topic": "/t", "msg": {"data": "hi"}},
        {"op": "service_response", "service": "/s", "values": {"data": "hi"}, "result": True},
        {"op": "call_service", "service": "/s", "id": "service_request:/s:1", "args": {"data": "hi"}},
    ]


@pytest.mark.parametrize("op", ["[]", "{}", "7", "null", '["service_response"]'])
def test_op_that_is_not_a_text_is_refused(op: str) -> None:
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
def test_unreadable_answer_keeps_its_readable_id_and_service(frame: str, op: str, op_id: str | None) -> None:
    session = make_session()
    lost: list[FrameError] = []
    session.on_lost_answer = lost.append
    glued = '{"op":"call_service","service":"/x","id":"service_request:/s:9"}' + frame
    assert len(receive(session, glued.encode())) == 1
    assert [(error.op, error.op_id) for error in lost] == [(op, op_id)]


def test_session_yields_between_incomplete_fragments() -> None:
    session = make_session()
    piece = b'{"op":"fragment","id":"f","num":%d,"total":9,"data":"x"}'
    steps = session.receive(b"".join(piece % i for i in range(8)), 0.0)
    assert list(steps) == [None] * 8


# What waits for its turn


def test_timer_is_set_for_the_first_waiting_message_and_cleared_after() -> None:
    """Without it the last value of a burst stays in the queue until the next one comes."""
    alarms: list[float] = []
    session = Session(Outbox(OutboxLimits(), lambda: None, lambda: None), alarms.append)
    feeds = [make_feed(session, SubscriptionOptions(each, 1), f"/{each}") for each in (0.3, 0.1)]
    for feed in feeds:
        feed.deliver(Body(), 0.0, 0)
    assert (len(said(session)), alarms) == (2, [])
    for feed in feeds:
        feed.deliver(Body(), 0.0, 0)
        feed.deliver(Body(), 0.0, 0)  # it waits already
    assert (said(session), alarms) == ([], [0.3, 0.1])
    session.flush(0.1, 0)
    assert [message["topic"] for message in said(session)] == ["/0.1"]
    assert alarms == [0.3, 0.1, 0.3]
    session.flush(0.3, 0)
    assert [message["topic"] for message in said(session)] == ["/0.3"]
    assert alarms == [0.3, 0.1, 0.3]
    assert list(session.waiting()) == []


def test_timer_is_set_for_the_earliest_waiting_message() -> None:
    alarms: list[float] = []
    session = Session(Outbox(OutboxLimits(), lambda: None, lambda: None), alarms.append)
    for interval in (0.2, 0.5, 0.3):
        feed = make_feed(session, SubscriptionOptions(interval, 1), f"/{interval}")
        feed.deliver(Body(), 0.0, 0)
        feed.deliver(Body(), 0.0, 0)
    assert alarms == [0.2, 0.5, 0.3]
    session.flush(0.1, 0)
    assert alarms[3:] == [0.2]


def test_queue_length_without_throttling_is_the_outbox_burst() -> None:
    """With a throttle, `queue_length` is about what waits in the feed, and the outbox keeps its usual burst."""
    session = make_session()
    feed = make_feed(session, SubscriptionOptions(queue_length=3))
    assert session.outbox.bursts == {"/t": 3}
    feed.set_options(None, SubscriptionOptions(interval=0.1, queue_length=3))
    assert session.outbox.bursts == {}
    feed.set_options(None, SubscriptionOptions(queue_length=4))
    assert session.outbox.bursts == {"/t": 4}
    feed.set_options(None, SubscriptionOptions())
    assert session.outbox.bursts == {}
    feed.set_options(None, SubscriptionOptions(queue_length=4))
    session.drop_feed(feed)
    assert session.outbox.bursts == {}


def test_ended_subscription_neither_waits_nor_sends_nor_sets_a_timer() -> None:
    """A client that unsubscribes must not get what had waited, and its feed must not be kept."""
    alarms: list[float] = []
    session = Session(Outbox(OutboxLimits(), lambda: None, lambda: None), alarms.append)
    feed = make_feed(session, SubscriptionOptions(0.1, 1))
    feed.deliver(Body(), 0.0, 0)
    feed.deliver(Body(), 0.0, 0)
    assert len(list(session.waiting())) == 1
    session.drop_feed(feed)
    assert (list(session.waiting()), list(session._waiting)) == ([], [])
    session.flush(0.1, 0)
    assert (len(said(session)), alarms) == (1, [0.1])


# How messages go out


@pytest.mark.parametrize("body", [Body(), Heavy()])
@pytest.mark.parametrize("compression", ["none", "cbor", "cbor-raw"])
def test_each_sent_message_is_counted_once(body: Body, compression: str) -> None:
    session = make_session()
    feed = make_feed(session, SubscriptionOptions(compression=compression))
    for num in (1, 2, 3):
        feed.deliver(body, 0.0, 0)
        assert (session.num_sent, len(session.outbox)) == (num, num)


@pytest.mark.parametrize("body", [Body(), Heavy()])
def test_cbor_raw_is_stamped_with_the_time_at_which_the_message_was_sent(body: Body) -> None:
    session = make_session()
    feed = make_feed(session, SubscriptionOptions(compression="cbor-raw"))
    feed.deliver(body, 0.0, 7_000_000_005)
    frames: list[bytes] = []
    while len(session.outbox):
        frames += session.outbox.take(2**30)
    (value,) = map(cbor2.loads, frames)
    assert value["msg"] == {"secs": 7, "nsecs": 5, "bytes": Body.raw}


@pytest.mark.parametrize("compression", ["cbor", "none"])
def test_large_message_is_encoded_when_it_is_sent(compression: str) -> None:
    session = make_session()
    feed = make_feed(session, SubscriptionOptions(compression=compression))
    feed.deliver(Unwritable(ZeroDivisionError()), 0.0, 0)  # nothing is raised: nobody reads yet
    assert len(session.outbox) == 1


@pytest.mark.parametrize("error", [EncodingError("not this one"), ZeroDivisionError("not this one")])
def test_unencodable_large_message_is_reported_with_its_topic(error: Exception) -> None:
    """Its publisher hears of it; the connection and the other messages live on."""
    session = make_session()
    unsent: list[tuple[str, EncodingError]] = []
    session.on_unsent = lambda spelling, why: unsent.append((spelling, why))
    feed = make_feed(session, SubscriptionOptions())
    feed.deliver(Unwritable(error), 0.0, 0)
    session.remark("error", "after")
    assert [status["msg"] for status in said(session)] == ["after"]
    ((spelling, why),) = unsent
    assert (spelling, isinstance(why, EncodingError), "not this one" in str(why)) == ("/t", True, True)
    assert why is error or why.__cause__ is error


@pytest.mark.parametrize("error", [EncodingError("not this one"), ZeroDivisionError("not this one")])
def test_failed_fragments_are_reported_with_their_topic(error: Exception) -> None:
    session = make_session()
    unsent: list[tuple[str, EncodingError]] = []
    session.on_unsent = lambda spelling, why: unsent.append((spelling, why))
    session.outbox.on_unmade("/t", error)
    ((spelling, why),) = unsent
    assert (spelling, isinstance(why, EncodingError), "not this one" in str(why)) == ("/t", True, True)


def test_queued_message_that_cannot_be_encoded_is_reported_with_its_topic() -> None:
    class Broken(Unwritable):
        text_length = 0

    session = make_session()
    unsent: list[str] = []
    session.on_unsent = lambda spelling, _why: unsent.append(spelling)
    feed = make_feed(session, SubscriptionOptions(interval=0.1, queue_length=1))
    feed.deliver(Body(), 0.0, 0)
    feed.deliver(Broken(EncodingError("not this one")), 0.0, 0)
    session.flush(0.1, 0)
    assert unsent == ["/t"]


@pytest.mark.parametrize("text_length", [0, HEAVY])
def test_subscriber_is_told_once_that_its_encoding_is_impossible(text_length: int) -> None:
    """Not with each of a thousand messages; but again when it has asked anew."""
    body = Unfit()
    body.text_length = text_length
    session = make_session()
    feed = make_feed(session, SubscriptionOptions(compression="cbor"))
    told: list[int] = []
    for _ in range(2):
        for _ in range(3):
            feed.deliver(body, 0.0, 0)
            told.append(0)
            while len(session.outbox):
                told[-1] += len(session.outbox.take(2**30))
        feed.set_options(None, SubscriptionOptions(compression="cbor"))
    assert told == [1, 0, 0, 1, 0, 0]


def test_frame_below_the_fragment_size_is_sent_whole() -> None:
    session = make_session()
    feed = make_feed(session, SubscriptionOptions(fragment_size=1_000))
    feed.deliver(Body(), 0.0, 0)
    session.answer("/s", None, Body(), is_ok=True, fragment_size=1_000)
    session.answer("/s", None, Body(), is_ok=True, fragment_size=0)
    assert [frame["op"] for frame in said(session)] == ["publish", "service_response", "service_response"]


@pytest.mark.parametrize(("spare", "op"), [(0, "publish"), (-1, "fragment")])
def test_frame_of_exactly_the_fragment_size_is_sent_whole(spare: int, op: str) -> None:
    frame = b'{"op":"publish","topic":"/t","msg":{"data":"hi"}}'
    session = make_session()
    make_feed(session, SubscriptionOptions(fragment_size=len(frame) + spare)).deliver(Body(), 0.0, 0)
    assert said(session)[0]["op"] == op


@pytest.mark.parametrize("size", [1, 40])
def test_answers_and_feedback_come_in_fragments_of_the_wanted_size_with_an_id_for_each_frame(size: int) -> None:
    session = make_session()
    for i in range(2):
        session.answer("/s", None, Body(), is_ok=True, fragment_size=size)
        session.say("action_feedback", {"values": Body()}, size, action="/a", id=str(i))
    frames: list[Any] = []
    while len(session.outbox):
        frames += said(session)
    assert {frame["op"] for frame in frames} == {"fragment"}
    ids = list(dict.fromkeys(frame["id"] for frame in frames))
    whole = [json.loads("".join(frame["data"] for frame in frames if frame["id"] == each)) for each in ids]
    assert [frame["op"] for frame in whole] == ["service_response", "action_feedback"] * 2


@pytest.mark.parametrize("op", ["png", "fragment"])
def test_image_in_an_image_is_refused_with_the_id_of_the_inner_one(op: str) -> None:
    session = make_session()
    inner = {"op": op, "id": "inner", "data": "x", "num": 0, "total": 2}
    assert receive(session, png_of(json.dumps(inner).encode())) == []
    (status,) = said(session)
    assert (status["id"], status["msg"]) == ("inner", "A fragment or a png may not hold another one")


def test_image_that_cannot_be_read_is_refused_with_its_id() -> None:
    session = make_session()
    assert receive(session, b'{"op":"png","id":"p","data":"AAAA"}') == []
    (status,) = said(session)
    assert (status["level"], status["id"], session.num_refused) == ("error", "p", 1)


def test_messages_that_wait_count_on_the_account_of_the_client() -> None:
    account = Account(1_000)
    session = make_session(account=account)
    feed = make_feed(session, SubscriptionOptions(interval=1.0, queue_length=5))
    for i in range(3):
        feed.deliver(Numbered(i), 0.0, 0)
    assert account.num_bytes >= 2 * Body.num_bytes
    session.drop_feed(feed)
    assert account.num_bytes == 0


def test_messages_that_wait_are_sent_first_when_the_throttle_ends() -> None:
    session = make_session()
    feed = make_feed(session, SubscriptionOptions(interval=1.0, queue_length=3))
    for i in range(3):
        feed.deliver(Numbered(i), 0.0, 0)
    feed.set_options(None, SubscriptionOptions(queue_length=3))
    feed.deliver(Numbered(3), 0.5, 0)
    session.flush(1.0, 0)
    assert [frame["msg"]["data"] for frame in said(session)] == [0, 1, 2, 3]
    assert session.num_sent == 4


def test_large_message_is_let_go_when_its_fragments_are_made() -> None:
    """A peer that reads slowly holds the fragments, and not the message beside them."""
    session = make_session()
    feed, message = make_feed(session, SubscriptionOptions(fragment_size=20)), Heavy()
    held = weakref.ref(message)
    feed.deliver(message, 0.0, 0)
    del message
    assert held() is not None
    session.outbox.take(1)
    assert held() is None
    assert len(session.outbox) == 1


def test_large_message_is_fragmented_completely() -> None:
    session = make_session()
    make_feed(session, SubscriptionOptions(fragment_size=20)).deliver(Heavy(), 0.0, 0)
    frames: list[Any] = []
    while len(session.outbox):
        frames += said(session)
    assert len(frames) > 1
    whole = "".join(frame["data"] for frame in frames)
    assert json.loads(whole) == {"op": "publish", "topic": "/t", "msg": {"data": "hi"}}


def test_length_of_a_packed_frame_is_known_until_the_next_one() -> None:
    session = make_session()
    assert session.frame_length == 0
    receive(session, b"rubbish")
    assert session.frame_length == 7
    receive(session, b'{"op":"subscribe","topic":"/t"}')
    assert session.frame_length == 0


def test_length_of_a_frame_inside_another_one_counts() -> None:
    session = make_session()
    frame = b'{"op":"subscribe","topic":"/t"}'.ljust(1_000_000)
    image = png_of(frame)
    assert len(image) < 10_000
    assert [type(op) for op in receive(session, image)] == [Subscribe]
    assert session.frame_length >= 1_000_000
    for num in range(2):
        part = frame[num * 500_000 : (num + 1) * 500_000].decode()
        receive(session, json.dumps({"op": "fragment", "id": "a", "num": num, "total": 2, "data": part}).encode())
    assert session.frame_length == 1_000_000


def test_each_received_frame_is_counted_once() -> None:
    session = make_session()
    image = b'{"op":"publish","topic":"/t","msg":{"data":"%s"}}' % (b"A" * LONG)
    for num, frame in enumerate(
        [b'{"op":"subscribe","topic":"/t"}', b"rubbish", image, b'{"op":"unsubscribe","topic":"/t"}'], 1
    ):
        receive(session, frame)
        assert session.num_received == num


def test_received_fragments_count_on_the_clients_account() -> None:
    account = Account(1_000)
    session = make_session(account=account)
    receive(session, b'{"op":"fragment","id":"f","num":0,"total":2,"data":"xxxx"}')
    assert account.num_bytes > 0
    session.leave()
    assert account.num_bytes == 0
