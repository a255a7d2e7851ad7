"""A publisher of a misspelt topic gets one late hint, and no other publisher gets one."""

from __future__ import annotations

import json
import logging
import sys
from types import FrameType

import pytest

from rosbridge_sim.graph import topic_table
from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.peers.peer import Peer
from rosbridge_sim.graph.peers.peer_topics import MAX_WATCHED_TOPICS as MAX_OF_CLIENT
from rosbridge_sim.graph.policy import Policy, Rule
from rosbridge_sim.graph.unheard import MAX_TOLD_PUBLISHERS, UNHEARD_AFTER
from rosbridge_sim.protocol.outbox import Outbox, OutboxLimits
from rosbridge_sim.protocol.session import Session
from tests.graph.bus_fixture import make_bus, make_peer


def send(peer: Peer, now: float = 0.0, /, **op: object) -> None:
    peer.receive(json.dumps(op).encode(), now)


def talker(bus: Bus, level: str = "info") -> tuple[Peer, Outbox]:
    peer, outbox = make_peer(bus)
    send(peer, op="set_level", level=level)
    return peer, outbox


def told(outbox: Outbox) -> list[str]:
    frames = map(json.loads, outbox.take(2**30))
    return [frame["msg"] for frame in frames if frame["op"] == "status" and frame["level"] == "info"]


def publish(peer: Peer, topic: str, now: float = 0.0) -> None:
    send(peer, now, op="publish", topic=topic, type="std_msgs/String", msg={"data": "a"})


def listened(*topics: str) -> Bus:
    bus = make_bus()
    listener, _ = make_peer(bus)
    for topic in topics:
        send(listener, op="subscribe", topic=topic, type="std_msgs/String")
    return bus


def test_publisher_of_a_misspelt_topic_is_told_once_after_five_seconds(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.INFO, "rosbridge_sim")
    bus = listened("/ctrl_cmd")
    peer, outbox = talker(bus)
    bus.unpublished.take_due(1e9)
    publish(peer, "/ctrl_cmdd", 1.0)
    publish(peer, "/ctrl_cmdd", 3.0)
    assert bus.next_deadline() == 1.0 + UNHEARD_AFTER
    bus.expire(5.9)
    assert told(outbox) == []
    bus.expire(1.0 + UNHEARD_AFTER)
    text = "/ctrl_cmdd (std_msgs/String) is published, but has no subscriber (did you mean /ctrl_cmd?)"
    assert told(outbox) == [text]
    send(peer, 7.0, op="unadvertise", topic="/ctrl_cmdd")
    publish(peer, "/ctrl_cmdd", 8.0)
    bus.expire(1e9)
    assert (told(outbox), bus.unheard.next_due()) == ([], None)
    assert [(record.levelname, record.getMessage()) for record in caplog.records] == [("INFO", f": {text}")]
    assert peer.num_errors == 0


@pytest.mark.parametrize("level", ["none", "error", "warning"])
def test_client_below_info_level_gets_no_hint(level: str) -> None:
    bus = listened("/ctrl_cmd")
    peer, outbox = talker(bus, level)
    publish(peer, "/ctrl_cmdd")
    bus.expire(UNHEARD_AFTER)
    assert outbox.take(2**30) == []


@pytest.mark.parametrize("topic", ["/mine", "/ctrl_cmd_7", "/ctrl_cmd_extra", "/my/ctrl_cmd", "/ctrl"])
def test_topic_of_its_own_gets_no_hint(topic: str) -> None:
    bus = listened("/ctrl_cmd", "/ctrl_cmd_0")
    peer, outbox = talker(bus)
    publish(peer, topic)
    bus.expire(UNHEARD_AFTER)
    assert told(outbox) == []


def test_topic_that_is_heard_in_time_or_gone_gets_no_hint() -> None:
    bus = listened("/chatter", "/talk")
    peer, outbox = talker(bus)
    other, _ = make_peer(bus)
    publish(peer, "/chater")
    send(other, op="subscribe", topic="/chater")
    publish(peer, "/talkk")
    send(peer, op="unadvertise", topic="/talkk")
    gone, outbox_of_gone = talker(bus)
    publish(gone, "/tallk")
    gone.leave(1.0)
    assert bus.unheard.next_due() == UNHEARD_AFTER
    bus.expire(UNHEARD_AFTER)
    assert told(outbox) == told(outbox_of_gone) == []


def test_two_topics_of_one_client_are_not_each_others_misspelling() -> None:
    bus = listened("/ctrl_cmd", "/ctrl_cmd_0")  # the second one is near, too, but not meant
    peer, outbox = talker(bus)
    for topic in ("/ctrl_cmd", "/ctrl_cmdd"):
        publish(peer, topic)
    bus.expire(UNHEARD_AFTER)
    assert told(outbox) == []


def test_hint_does_not_name_denied_topics() -> None:
    bus = listened("/secret_topic")
    rule = Rule(deny=("/secret_topic",))
    outbox = Outbox(OutboxLimits(), lambda: None, lambda: None)
    peer = Peer(bus, Session(outbox, lambda _due: None), policy=Policy(publish=rule, subscribe=rule))
    send(peer, op="set_level", level="info")
    publish(peer, "/secret_topicc")
    bus.expire(UNHEARD_AFTER)
    assert told(outbox) == []


def test_hints_for_many_publishers_are_spread_and_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    num_watched = 2 * MAX_OF_CLIENT  # in place of MAX_WATCHED_PUBLISHERS: enough for more than one client
    monkeypatch.setattr(topic_table, "MAX_WATCHED_PUBLISHERS", num_watched)
    names = [f"/topic_{chr(97 + i // 26)}{chr(97 + i % 26)}_long" for i in range(MAX_OF_CLIENT + 10)]
    bus = listened(*names)
    clients = [talker(bus) for _ in range(num_watched // len(names) + 2)]
    for peer, _ in clients:
        for name in names:
            publish(peer, f"{name}X")
    bus.expire(UNHEARD_AFTER)
    assert len(told(clients[0][1])) == MAX_TOLD_PUBLISHERS
    while bus.unheard.next_due() is not None:
        bus.expire(UNHEARD_AFTER)
    assert len(told(clients[0][1])) <= len(names) - MAX_TOLD_PUBLISHERS
    assert told(clients[-1][1]) == []


def test_topics_without_a_listener_are_passed_over_at_once() -> None:
    bus = listened("/ctrl_cmd")
    other, _ = make_peer(bus)
    for i in range(1_000):
        send(other, 100.0, op="advertise", topic=f"/many{i:04}", type="std_msgs/String")
    while (due := bus.unheard.next_due()) is not None:
        bus.expire(due)
    peer, outbox = talker(bus)
    publish(peer, "/ctrl_cmdd", 200.0)
    num_calls = 0

    def count(_frame: FrameType, event: str, _argument: object) -> None:
        nonlocal num_calls
        num_calls += event == "call"

    sys.setprofile(count)
    try:
        bus.expire(200.0 + UNHEARD_AFTER)
    finally:
        sys.setprofile(None)
    assert told(outbox)
    assert num_calls < 500, "not one for each topic, or a client with thousands of topics stops the server"
