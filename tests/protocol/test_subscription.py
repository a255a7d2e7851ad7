"""Throttling: throttled, queued and dropped messages; merged options of several subscriptions."""

from __future__ import annotations

import itertools
from collections.abc import Iterable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rosbridge_sim.errors import FrameError
from rosbridge_sim.protocol.ops import Subscribe
from rosbridge_sim.protocol.subscription import (
    COMPRESSIONS,
    MAX_QOS_DEPTH,
    MAX_QUEUE,
    MergedOptions,
    Qos,
    SubscriptionOptions,
    Throttle,
    read_options,
    read_qos,
)


def paced(interval: float, queue_length: int) -> Throttle[int]:
    pace: Throttle[int] = Throttle()
    pace.set_options(SubscriptionOptions(interval=interval, queue_length=queue_length))
    return pace


def play(pace: Throttle[int], arrivals: list[float], until: float) -> list[tuple[float, int]]:
    """When each of the messages 0, 1, 2, ... that arrive at these times leaves."""
    left = []
    for i, at in enumerate(arrivals):
        while (due := pace.due()) is not None and due <= at:
            left += [(due, message) for message in [pace.release(due)] if message is not None]
        if pace.admit(i, at):
            left.append((at, i))
    while (due := pace.due()) is not None and due <= until:
        left += [(due, message) for message in [pace.release(due)] if message is not None]
    return left


def test_subscription_without_options_sends_at_once() -> None:
    assert play(paced(0, 0), [0.0, 0.0, 0.1], 10) == [(0.0, 0), (0.0, 1), (0.1, 2)]


def test_throttle_without_a_queue_sends_the_first_of_a_burst() -> None:
    pace = paced(1.0, 0)
    assert play(pace, [0.0, 0.3, 0.6, 1.0, 1.5], 10) == [(0.0, 0), (1.0, 3)]
    assert pace.num_dropped == 3


def test_throttle_with_a_queue_sends_the_last_of_a_burst() -> None:
    pace = paced(1.0, 1)
    assert play(pace, [0.0, 0.1, 0.2, 0.3], 10) == [(0.0, 0), (1.0, 3)]
    assert pace.num_dropped == 2


def test_queue_sends_one_per_interval_and_keeps_the_newest() -> None:
    pace = paced(1.0, 3)
    assert play(pace, [i / 100 for i in range(10)], 10) == [(0.0, 0), (1.0, 7), (2.0, 8), (3.0, 9)]


def test_late_timer_and_stall_keep_the_throttle_rate() -> None:
    pace = paced(1.0, 5)
    for i in range(6):
        pace.admit(i, 0.0)
    assert pace.release(1.4) == 1
    assert pace.due() == 2.0
    assert pace.release(7.0) == 2
    assert pace.due() == 7.0
    assert pace.release(7.0) == 3
    assert pace.release(7.5) is None


def test_waiting_message_survives_new_options() -> None:
    pace = paced(10.0, 5)
    for i in range(4):
        pace.admit(i, 0.0)
    pace.set_options(SubscriptionOptions(interval=1.0, queue_length=2))
    assert pace.num_dropped == 1
    assert (pace.due(), pace.release(1.0), pace.release(2.0)) == (1.0, 2, 3)
    pace.admit(4, 2.5)
    pace.set_options(SubscriptionOptions())
    assert pace.due() is None


def test_first_message_after_a_throttle_begins_is_sent_at_once() -> None:
    pace = paced(0.0, 0)
    assert pace.admit(0, 5.0)
    pace.set_options(SubscriptionOptions(interval=1.0))
    assert [pace.admit(i, now) for i, now in enumerate([5.1, 5.2, 6.0, 6.2], 1)] == [True, False, False, True]


@given(
    st.lists(st.floats(0, 10), max_size=30).map(sorted),
    st.sampled_from([0.0, 0.3, 1.0]),
    st.integers(0, 4),
)
def test_interval_between_messages_holds_and_losses_are_counted(
    arrivals: list[float], interval: float, queue_length: int
) -> None:
    pace = paced(interval, queue_length)
    left = play(pace, arrivals, 1e9)
    assert [message for _, message in left] == sorted(message for _, message in left)
    assert all(b - a >= interval - 1e-9 for (a, _), (b, _) in itertools.pairwise(left))
    assert len(left) + pace.num_dropped == len(arrivals)
    if queue_length and arrivals:
        assert left[-1][1] == len(arrivals) - 1


def merge_terms(terms: Iterable[SubscriptionOptions]) -> SubscriptionOptions:
    """The plain meaning of merged terms: all are looked at."""
    each = list(terms)
    sizes = [t.fragment_size for t in each if t.fragment_size is not None]
    return SubscriptionOptions(
        interval=min(t.interval for t in each),
        queue_length=max(t.queue_length for t in each),
        fragment_size=min(sizes, default=None),
        compression=max((t.compression for t in each), key=COMPRESSIONS.index),
    )


def merged(*terms: SubscriptionOptions) -> SubscriptionOptions:
    together = MergedOptions()
    for i, each in enumerate(terms):
        together.put(i, each)
    return together.merged()


def test_subscription_options_merge() -> None:
    assert merged(
        SubscriptionOptions(interval=1.0, queue_length=1, fragment_size=500, compression="png"),
        SubscriptionOptions(interval=0.5, queue_length=7, compression="cbor"),
        SubscriptionOptions(interval=2.0, fragment_size=200),
    ) == SubscriptionOptions(interval=0.5, queue_length=7, fragment_size=200, compression="cbor")
    assert (
        merged(SubscriptionOptions(compression="cbor"), SubscriptionOptions(compression="cbor-raw")).compression
        == "cbor-raw"
    )


SOME_TERMS = st.builds(
    SubscriptionOptions,
    interval=st.sampled_from([0.0, 0.1, 1.0, 2.5]),
    queue_length=st.integers(0, 5),
    fragment_size=st.none() | st.integers(1, 5),
    compression=st.sampled_from(COMPRESSIONS),
)


@given(st.lists(st.tuples(st.integers(0, 8), st.none() | SOME_TERMS), max_size=60))
def test_merged_options_depend_only_on_present_subscriptions(
    changes: list[tuple[int, SubscriptionOptions | None]],
) -> None:
    together, present = MergedOptions(), dict[int, SubscriptionOptions]()
    for sub_id, terms in changes:
        together.put(sub_id, terms)
        if terms is None:
            present.pop(sub_id, None)
        else:
            present[sub_id] = terms
        assert together.by_id == present
        if present:
            assert together.merged() == merge_terms(present.values())


def test_last_subscription_that_is_left_has_its_own_options() -> None:
    together, first = MergedOptions(), SubscriptionOptions(interval=1.0, queue_length=2, compression="cbor")
    together.put("a", first)
    together.put("b", SubscriptionOptions(queue_length=7))
    together.put("b", None)
    assert (together.merged(), together.by_id) == (first, {"a": first})


def test_options_of_a_subscribe_op_are_read() -> None:
    assert read_options(Subscribe(topic="/t")) == SubscriptionOptions()
    op = Subscribe(topic="/t", throttle_rate=250.0, queue_length=3.0, fragment_size=2147483647.0, compression="png")
    assert read_options(op) == SubscriptionOptions(
        interval=0.25, queue_length=3, fragment_size=2147483647, compression="png"
    )
    op = Subscribe(topic="/t", throttle_rate=-5.0, queue_length=-1.0, fragment_size=0.0, compression="zip")
    assert read_options(op) == SubscriptionOptions()
    assert read_options(Subscribe(topic="/t", queue_length=1e300)).queue_length == MAX_QUEUE


@pytest.mark.parametrize(
    ("op", "options"),
    [
        (Subscribe(topic="/t", throttle_rate=250.0), SubscriptionOptions(interval=0.25)),
        (Subscribe(topic="/t", queue_length=3.0), SubscriptionOptions(queue_length=3)),
        (Subscribe(topic="/t", fragment_size=9.0), SubscriptionOptions(fragment_size=9)),
        (Subscribe(topic="/t", compression="cbor"), SubscriptionOptions(compression="cbor")),
    ],
)
def test_each_option_may_be_given_alone(op: Subscribe, options: SubscriptionOptions) -> None:
    assert read_options(op) == options


@pytest.mark.parametrize("qos", [{"k" * 6_000_000: 1}, {"durability": "k" * 6_000_000}, {"depth": "k" * 6_000_000}])
def test_error_about_a_long_policy_shows_its_start(qos: dict[str, object]) -> None:
    with pytest.raises(FrameError, match="kkk") as error:
        read_qos(qos)
    assert len(str(error.value)) < 500


def test_qos_of_a_subscribe_op_is_read() -> None:
    assert read_qos(None) == read_qos({}) == Qos()
    assert read_qos({"durability": "transient_local", "depth": 7}) == Qos(depth=7, is_latching=True)
    assert read_qos({"durability": "volatile", "depth": 0}) == Qos(depth=1, is_latching=False)
    assert read_qos({"history": "keep_all"}).depth == read_qos({"depth": 10**9}).depth == MAX_QOS_DEPTH
    assert read_qos({"deadline": {"secs": 1, "nsecs": 0}, "lifespan": "infinite"}) == Qos()
    wrong: list[dict[str, object]] = [
        {"speed": 1},
        {"durability": "forever"},
        {"durability": ["volatile"]},
        {"history": 5},
        {"history": np.zeros(2)},  # as CBOR brings a typed array
        {"depth": np.zeros(2)},
        {"depth": -1},
        {"depth": "7"},
        {"depth": True},
    ]
    for bad in wrong:
        with pytest.raises(FrameError):
            read_qos(bad)
