"""A subscriber of an unpublished topic gets one late hint, and no error."""

from __future__ import annotations

import json
import logging
from typing import Any

import pytest

from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.peers.peer import Peer
from rosbridge_sim.graph.peers.peer_topics import MAX_WATCHED_TOPICS as MAX_OF_CLIENT
from rosbridge_sim.graph.policy import Policy, Rule
from rosbridge_sim.graph.unpublished import MAX_TOLD_AT_ONCE, MAX_WATCHED_SUBSCRIPTIONS, UNPUBLISHED_AFTER
from rosbridge_sim.protocol.outbox import Outbox, OutboxLimits
from rosbridge_sim.protocol.session import Session
from tests.graph.bus_fixture import make_bus, make_peer


def send(peer: Peer, now: float = 0.0, /, **op: object) -> None:
    peer.receive(json.dumps(op).encode(), now)


def listener(bus: Bus) -> tuple[Peer, Outbox]:
    peer, outbox = make_peer(bus)
    send(peer, op="set_level", level="info")
    return peer, outbox


def told(outbox: Outbox) -> list[dict[str, Any]]:
    return [frame for frame in map(json.loads, outbox.take(2**30)) if frame["op"] == "status"]


def subscribe(peer: Peer, topic: str, now: float = 0.0, type_name: str = "std_msgs/String") -> None:
    send(peer, now, op="subscribe", topic=topic, type=type_name)


def test_delay_of_the_hint_is_five_seconds_as_in_the_readme() -> None:
    assert UNPUBLISHED_AFTER == 5.0


def test_subscriber_of_an_unpublished_topic_is_told_once_after_five_seconds(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.INFO)
    bus = make_bus()
    peer, outbox = listener(bus)
    subscribe(peer, "/chater", 1.0)
    assert bus.next_deadline() == 1.0 + UNPUBLISHED_AFTER
    bus.expire(UNPUBLISHED_AFTER)
    assert told(outbox) == []
    bus.expire(1.0 + UNPUBLISHED_AFTER)
    text = "/chater (std_msgs/String) is subscribed to, but has no publisher"
    assert told(outbox) == [{"op": "status", "level": "info", "msg": text}]
    bus.expire(1e9)
    assert (told(outbox), bus.next_deadline()) == ([], None)
    assert [(record.levelname, record.getMessage()) for record in caplog.records] == [("INFO", f": {text}")]
    assert peer.num_errors == 0


def test_hint_names_the_nearest_topic_and_topics_of_the_same_type() -> None:
    bus = make_bus()
    peer, outbox = listener(bus)
    other, _ = make_peer(bus)
    send(other, op="advertise", topic="/chatter", type="std_msgs/String")
    send(other, op="advertise", topic="/chatar", type="std_msgs/Int8")
    subscribe(peer, "chater")
    bus.expire(UNPUBLISHED_AFTER)
    (status,) = told(outbox)
    assert status["msg"].endswith("has no publisher (did you mean /chatter?); of this type there is /chatter")


def test_client_below_info_level_gets_no_hint() -> None:
    bus = make_bus()
    peer, outbox = make_peer(bus)
    subscribe(peer, "/chatter")
    bus.expire(UNPUBLISHED_AFTER)
    assert told(outbox) == []


@pytest.mark.parametrize("when", ["before", "after"])
def test_subscriber_of_a_published_topic_gets_no_hint(when: str) -> None:
    bus = make_bus()
    peer, outbox = listener(bus)
    other, _ = make_peer(bus)
    if when == "before":
        send(other, op="advertise", topic="/chatter", type="std_msgs/String")
    subscribe(peer, "/chatter")
    if when == "after":
        send(other, op="advertise", topic="/chatter", type="std_msgs/String")
    bus.expire(UNPUBLISHED_AFTER)
    assert told(outbox) == []


def test_subscriber_that_unsubscribed_or_left_gets_no_hint() -> None:
    bus = make_bus()
    peer, outbox = listener(bus)
    subscribe(peer, "/a")
    send(peer, op="unsubscribe", topic="/a")
    gone, outbox_of_gone = listener(bus)
    subscribe(gone, "/b")
    gone.leave(1.0)
    bus.expire(UNPUBLISHED_AFTER)
    assert told(outbox) == told(outbox_of_gone) == []
    assert bus.unpublished.next_due() is None


def test_hints_for_many_subscriptions_are_spread_and_bounded() -> None:
    bus = make_bus()
    clients = [listener(bus) for _ in range(MAX_WATCHED_SUBSCRIPTIONS // MAX_OF_CLIENT + 1)]
    for peer, _ in clients:
        for i in range(MAX_OF_CLIENT + 10):
            subscribe(peer, f"/topic{i}")
    bus.expire(UNPUBLISHED_AFTER)
    assert len(told(clients[0][1])) == MAX_TOLD_AT_ONCE
    while bus.unpublished.next_due() is not None:
        bus.expire(UNPUBLISHED_AFTER)
    assert len(told(clients[0][1])) == MAX_OF_CLIENT - MAX_TOLD_AT_ONCE
    assert told(clients[-1][1]) == []


def test_hint_does_not_name_denied_topics() -> None:
    bus = make_bus()
    other, _ = make_peer(bus)
    send(other, op="advertise", topic="/secret_topic", type="std_msgs/String")
    secret = Rule(deny=("/secret*",))
    outbox = Outbox(OutboxLimits(), lambda: None, lambda: None)
    peer = Peer(bus, Session(outbox, lambda _due: None), policy=Policy(publish=secret, subscribe=secret))
    send(peer, op="set_level", level="info")
    subscribe(peer, "/_secret_topic")
    bus.expire(UNPUBLISHED_AFTER)
    (status,) = told(outbox)
    assert status["msg"].endswith("has no publisher")
