"""The outbox: order, bounds and dropped messages."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rosbridge_sim.protocol.outbox import Outbox, OutboxLimits

ALL = 2**40


class Socket:
    """Takes everything while it is open, as a transport with room does."""

    def __init__(self, limits: OutboxLimits, *, is_open: bool) -> None:
        self.is_open = is_open
        self.taken: list[bytes] = []
        self.num_wakes = 0
        self.outbox = Outbox(limits, self.wake, self.carry)

    def wake(self) -> None:
        self.num_wakes += 1

    def carry(self) -> None:
        if self.is_open:
            while len(self.outbox):
                self.taken += self.outbox.take(100)


def test_frames_leave_in_order_of_arrival() -> None:
    outbox = Socket(OutboxLimits(), is_open=False).outbox
    outbox.offer("/a", b"1")
    outbox.send(b"2")
    outbox.offer("/b", b"3")
    assert outbox.take(ALL) == [b"1", b"2", b"3"]
    assert len(outbox) == 0
    assert outbox.num_bytes == 0


def test_outbox_wakes_the_writer_once() -> None:
    socket = Socket(OutboxLimits(), is_open=False)
    socket.outbox.offer("/a", b"1")
    socket.outbox.send(b"2")
    assert socket.num_wakes == 1
    socket.outbox.take(ALL)
    socket.outbox.send(b"3")
    assert socket.num_wakes == 2


def test_take_returns_about_the_requested_bytes_and_at_least_one_frame() -> None:
    outbox = Socket(OutboxLimits(), is_open=False).outbox
    for i in range(5):
        outbox.send(bytes([i]) * 10)
    assert outbox.take(1) == [b"\0" * 10]
    assert len(outbox.take(15)) == 2
    assert outbox.num_bytes == 20
    assert len(outbox.take(ALL)) == 2


def test_long_burst_is_complete_while_the_socket_accepts_it() -> None:
    socket = Socket(OutboxLimits(burst=10), is_open=True)
    frames = [str(i).encode() for i in range(10_000)]
    for frame in frames:
        socket.outbox.offer("/t", frame)
    socket.carry()
    assert socket.taken == frames
    assert not socket.outbox.dropped


def test_stalled_client_keeps_the_newest_of_each_topic_and_all_answers() -> None:
    outbox = Socket(OutboxLimits(burst=10), is_open=False).outbox
    outbox.offer("/rare", b"once")
    for i in range(1_000):
        outbox.offer("/t", str(i).encode())
        if i % 100 == 0:
            outbox.send(b"answer %d" % i)
    assert len(outbox) <= 2 * (10 + 10 + 1) + 10
    left = outbox.take(ALL)
    assert left[0] == b"once"
    assert left[-10:] == [str(i).encode() for i in range(990, 1_000)]
    assert [f for f in left if f.startswith(b"answer")] == [b"answer %d" % i for i in range(0, 1_000, 100)]
    assert outbox.dropped["/t"] == 1_000 - sum(f.isdigit() for f in left)
    assert outbox.dropped["/rare"] == 0


def test_stalled_client_keeps_exactly_the_burst_of_a_topic() -> None:
    """A client that asks for `queue_length` 5 gets the five newest, not six: one more is a stale pose."""
    outbox = Socket(OutboxLimits(burst=5), is_open=False).outbox
    outbox.bursts["/few"] = 2
    for i in range(2):
        outbox.offer("/few", b"f%d" % i)
    for i in range(4):  # with the sixth message the outbox is over its limit, and is trimmed
        outbox.offer("/few", b"g%d" % i)
    assert outbox.take(ALL) == [b"g2", b"g3"]
    for i in range(6):
        outbox.offer("/t", b"t%d" % i)
    assert outbox.take(ALL) == [b"t1", b"t2", b"t3", b"t4", b"t5"]
    assert outbox.dropped == {"/few": 4, "/t": 1}


def test_byte_limit_keeps_the_newest_of_each_topic() -> None:
    outbox = Socket(OutboxLimits(topic_bytes=1_000), is_open=False).outbox
    outbox.offer("/big", b"x" * 5_000)
    for i in range(200):
        outbox.offer("/t", b"%03d" % i * 40)
        assert outbox.num_bytes <= 5_000 + 2 * 1_000
    left = outbox.take(ALL)
    assert left[0] == b"x" * 5_000
    assert left[-1] == b"199" * 40
    assert not outbox.is_overfull


def test_answers_beyond_the_hard_limit_overfill_the_outbox() -> None:
    outbox = Socket(OutboxLimits(topic_bytes=1_000, hard_bytes=5_000), is_open=False).outbox
    for _ in range(49):
        outbox.send(b"x" * 100)
    assert not outbox.is_overfull
    for _ in range(100):
        outbox.send(b"x" * 100)
    assert outbox.is_overfull
    assert not outbox.dropped


def test_outbox_is_overfull_beyond_the_hard_limit_and_not_at_it() -> None:
    outbox = Socket(OutboxLimits(topic_bytes=10, hard_bytes=100), is_open=False).outbox
    assert not outbox.is_overfull
    outbox.send(b"x" * 100)
    assert not outbox.is_overfull
    outbox.send(b"x" * 100)
    assert outbox.is_overfull


def test_stalled_client_keeps_half_of_the_byte_limit_when_it_is_passed() -> None:
    """Less would lose more than needed; more would have to be trimmed again at once."""
    outbox = Socket(OutboxLimits(topic_bytes=1_000), is_open=False).outbox
    for _ in range(11):
        outbox.offer("/t", b"x" * 100)
    assert outbox.num_bytes == 500


def test_outbox_of_a_stalled_client_is_searched_rarely() -> None:
    """Else each frame to a client that does not read costs as much as all that wait for it."""
    num_carried = 0

    def carry() -> None:
        nonlocal num_carried
        num_carried += 1

    outbox = Outbox(OutboxLimits(burst=10, topic_bytes=1_000), lambda: None, carry)
    for _ in range(1_000):
        outbox.send(b"x")
        outbox.offer("/t", b"x" * 10)
    assert num_carried < 30


def test_answers_are_flushed_before_they_exceed_the_limit_by_much() -> None:
    socket = Socket(OutboxLimits(topic_bytes=1_000), is_open=True)
    socket.outbox.send(b"x" * 1_000)
    assert socket.taken == []
    socket.outbox.send(b"x")
    assert len(socket.taken) == 2


@given(st.lists(st.tuples(st.sampled_from(["/a", "/b", None]), st.integers(1, 300))), st.integers(1, 20))
def test_order_is_kept_and_only_topic_messages_are_dropped(frames: list[tuple[str | None, int]], burst: int) -> None:
    outbox = Socket(OutboxLimits(burst=burst, topic_bytes=2_000, hard_bytes=10**9), is_open=False).outbox
    for i, (topic, size) in enumerate(frames):
        frame = b"%d:" % i + b"." * size
        if topic is None:
            outbox.send(frame)
        else:
            outbox.offer(topic, frame)
    left = [int(frame.split(b":")[0]) for frame in outbox.take(ALL)]
    assert left == sorted(left)
    answers = [i for i, (topic, _) in enumerate(frames) if topic is None]
    assert [i for i in left if frames[i][0] is None] == answers
    for name in ("/a", "/b"):
        sent = [i for i, (topic, _) in enumerate(frames) if topic == name]
        kept = [i for i in left if frames[i][0] == name]
        assert len(sent) - len(kept) == outbox.dropped[name]
        assert kept[-1:] == sent[-1:]  # the newest is there, whatever went


# Frames that are made late


class LateFrames:
    """Three frames that are made one at a time; making one of them may fail."""

    num_bytes = 3
    identity = 0

    def __init__(self, letter: str, fails_at: int | None = None) -> None:
        self._letter = letter
        self._fails_at = fails_at
        self._num = 0

    @property
    def is_finished(self) -> bool:
        return self._num == 3

    def take(self, _max_bytes: int) -> list[bytes]:
        if self._num == self._fails_at:
            raise ZeroDivisionError
        self._num += 1
        return [f"{self._letter}{self._num}".encode()]


@pytest.mark.parametrize("fails_at", [0, 1, 2])
def test_message_whose_frames_fail_is_dropped_and_reported(fails_at: int) -> None:
    outbox = Socket(OutboxLimits(), is_open=False).outbox
    told: list[tuple[str, Exception]] = []
    outbox.on_unmade = lambda topic, error: told.append((topic, error))
    outbox.send(b"before")
    outbox.offer("/bad", LateFrames("b", fails_at))
    outbox.offer("/good", LateFrames("g"))
    outbox.send(b"after")
    taken = []
    while len(outbox):
        taken += outbox.take(10)
    made = [b"b1", b"b2"][:fails_at]
    assert taken == [b"before", *made, b"g1", b"g2", b"g3", b"after"]
    assert [(topic, type(error)) for topic, error in told] == [("/bad", ZeroDivisionError)]
    outbox.offer("/t", b"plain")
    assert (outbox.num_bytes, outbox.take(ALL)) == (5, [b"plain"])


@pytest.mark.parametrize("fails_at", [0, 2])
def test_answer_whose_frames_fail_is_not_dropped_silently(fails_at: int) -> None:
    outbox = Socket(OutboxLimits(), is_open=False).outbox
    outbox.offer("/good", LateFrames("g"))
    outbox.send(LateFrames("a", fails_at))
    for _ in range(3 + fails_at):  # "g" three times, then what can be made of the answer
        outbox.take(2)
    with pytest.raises(ZeroDivisionError):
        outbox.take(10)


def test_frames_added_while_dropping_a_message_are_kept() -> None:
    outbox = Socket(OutboxLimits(), is_open=False).outbox
    outbox.on_unmade = lambda _topic, _error: outbox.send(b"said")
    outbox.offer("/bad", LateFrames("b", 0))
    outbox.send(b"after")
    assert outbox.take(ALL) == [b"after", b"said"]
    assert (len(outbox), outbox.num_bytes) == (0, 0)


def test_frames_made_late_count_towards_the_requested_bytes() -> None:
    """Else a picture and all that waits behind it go to the socket at once, however little room it has."""

    class Whole(LateFrames):
        is_finished = True

    outbox = Socket(OutboxLimits(), is_open=False).outbox
    outbox.offer("/l", Whole("a"))
    outbox.send(b"after")
    assert (outbox.take(2), outbox.take(2)) == ([b"a1"], [b"after"])


def test_slice_of_work_that_makes_no_frame_is_all_that_one_turn_does() -> None:
    """Else a picture is made in one go, while all other clients wait."""

    class InSlices(LateFrames):
        num_slices = 0

        def take(self, max_bytes: int) -> list[bytes]:
            self.num_slices += 1
            return super().take(max_bytes) if self.num_slices > 2 else []

    outbox = Socket(OutboxLimits(), is_open=False).outbox
    outbox.offer("/a", InSlices("a"))
    assert [outbox.take(ALL) for _ in range(5)] == [[], [], [b"a1"], [b"a2"], [b"a3"]]


def test_message_that_is_made_late_is_sent_although_another_one_was_dropped() -> None:
    outbox = Socket(OutboxLimits(burst=4), is_open=False).outbox
    outbox.bursts["/t"] = 3
    outbox.offer("/a", LateFrames("a"))
    for i in range(4):
        outbox.offer("/t", b"%d" % i)
    assert outbox.dropped == {"/t": 1}
    assert [outbox.take(ALL) for _ in range(3)] == [[b"a1"], [b"a2"], [b"a3", b"1", b"2", b"3"]]


def test_closed_outbox_holds_nothing_not_even_the_rest_of_a_message() -> None:
    outbox = Socket(OutboxLimits(), is_open=False).outbox
    outbox.offer("/a", LateFrames("a"))
    outbox.send(b"after")
    assert outbox.take(1) == [b"a1"]
    outbox.close()
    assert (len(outbox), outbox.num_bytes, outbox.take(ALL)) == (0, 0, [])
    outbox.send(LateFrames("b", 0))  # an answer, not the rest of that message
    with pytest.raises(ZeroDivisionError):
        outbox.take(ALL)


def test_partly_sent_message_of_a_stalled_client_is_not_dropped() -> None:
    """Pieces without their rest would be waited for by the client, and paid for, until it gives up."""
    outbox = Socket(OutboxLimits(burst=2), is_open=False).outbox
    outbox.offer("/t", LateFrames("a"))
    assert outbox.take(1) == [b"a1"]
    for i in range(9):
        outbox.offer("/t", b"%d" % i)
    left = []
    while len(outbox):
        left += outbox.take(1)
    assert left[:2] == [b"a2", b"a3"]
    assert left[-2:] == [b"7", b"8"]


def test_frames_that_outboxes_share_have_one_identity() -> None:
    """The server's memory budget counts a message once, however many clients wait for it."""
    frame, late = b"shared", LateFrames("l")
    outboxes = [Socket(OutboxLimits(), is_open=False).outbox for _ in range(2)]
    for outbox in outboxes:
        outbox.offer("/t", frame)
        outbox.offer("/t", late)
    assert list(outboxes[0].frames()) == list(outboxes[1].frames()) == [(id(frame), 6), (late.identity, 3)]


def test_frames_are_not_made_when_they_are_added() -> None:
    taken: list[bytes] = []
    outbox = Outbox(OutboxLimits(topic_bytes=3), lambda: None, lambda: taken.extend(outbox.take(ALL)))
    outbox.offer("/t", b"plain")
    outbox.offer("/t", LateFrames("a"))
    outbox.offer("/s", LateFrames("b"))
    assert taken == [b"plain"]
    while len(outbox):
        taken += outbox.take(ALL)
    assert taken == [b"plain", b"a1", b"a2", b"a3", b"b1", b"b2", b"b3"]
