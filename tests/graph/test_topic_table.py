"""A topic has one type, and is remembered for a while after its last publisher."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rosbridge_sim.errors import GraphError, Reason
from rosbridge_sim.graph.participant import Participant
from rosbridge_sim.graph.topic_table import TYPE_MEMORY
from rosbridge_sim.protocol.client_memory import Account
from rosbridge_sim.schema.message import Message
from tests.graph.bus_fixture import make_bus
from tests.graph.participants import STRING, Somebody, YieldingParticipant, text


def test_message_beyond_the_account_is_delivered_but_not_latched_and_its_sender_is_warned() -> None:
    bus, sender, listener = make_bus(), Somebody(), Somebody()
    bus.accounts[sender] = Account(0)
    topic = bus.advertise(sender, "/t", STRING, depth=1)
    bus.subscribe(listener, "/t", listener.deliver)
    with pytest.raises(GraphError, match="the message is not latched") as caught:
        bus.publish(sender, topic, text(bus, "x"), 0.0)
    assert caught.value.reason is Reason.TOO_MUCH
    assert (len(listener.heard), list(topic.latched)) == (1, [])


def test_subscriber_of_another_type_is_notified_directly_or_by_its_callback() -> None:
    bus, node, first, second = make_bus(), Somebody("/morai_sim"), YieldingParticipant(), YieldingParticipant()
    told: list[str] = []
    bus.subscribe(first, "/t", first.deliver, type_name="std_msgs/Int32")
    bus.subscribe(
        second, "/t", second.deliver, type_name="std_msgs/Int32", notify=lambda level, _text: told.append(level)
    )
    bus.advertise(node, "/t", STRING)
    assert ([level for level, _ in first.told], second.told, told) == (["error"], [], ["error"])


def test_component_that_accepts_any_type_does_not_settle_a_topics_type() -> None:
    """The recorder listens everywhere: no type of a client may be settled for good by that."""
    bus, client, part = make_bus(), YieldingParticipant(), Somebody("/recorder")
    topic = bus.subscribe(client, "/t", client.deliver, type_name=STRING).topic
    bus.subscribe(part, "/t", part.deliver)
    assert (topic.is_settled, topic.is_bound) == (False, False)
    bus.subscribe(part, "/t", part.deliver, type_name=STRING)
    assert (topic.is_settled, topic.is_bound) == (True, True)


def test_exclusive_topic_has_one_publisher_and_any_subscriber() -> None:
    bus, node, other = make_bus(), Somebody("/morai_sim"), Somebody()
    topic = bus.advertise(node, "/Ego_topic", STRING, is_exclusive=True)
    with pytest.raises(GraphError, match="published by /morai_sim alone"):
        bus.advertise(other, "/Ego_topic", STRING)
    bus.subscribe(other, "/Ego_topic", other.deliver)
    bus.publish(node, topic, text(bus, "x"), 0.0)
    assert len(other.heard) == 1


def test_topic_type_is_remembered_for_a_while() -> None:
    bus, first, second = make_bus(), YieldingParticipant(), YieldingParticipant()
    bus.advertise(first, "/t", STRING)
    bus.leave(first, 100.0)
    assert bus.next_deadline() == 100.0 + TYPE_MEMORY
    bus.expire(100.0 + TYPE_MEMORY - 0.1)
    with pytest.raises(GraphError, match="already established"):
        bus.advertise(second, "/t", "std_msgs/Int32")
    bus.expire(100.0 + TYPE_MEMORY)
    bus.advertise(second, "/t", "std_msgs/Int32")
    assert bus.next_deadline() is None


def test_remembered_topic_can_be_forgotten_at_once() -> None:
    bus, first, second = make_bus(), Somebody(), Somebody()
    topic = bus.advertise(first, "/t", STRING, depth=1)
    bus.publish(first, topic, text(bus, "x"), 0.0)
    bus.topic_table.forget_topic("/t")
    bus.topic_table.forget_topic("/nothing")
    assert topic.latched, "it has a publisher"
    bus.unadvertise(first, "/t", 0.0)
    bus.topic_table.forget_topic("t")
    assert bus.find_topic("/t") is None
    assert bus.topic_table.type_conflict("/t", "std_msgs/Int32") is None
    bus.subscribe(second, "/t", second.deliver, type_name="std_msgs/Int32")
    bus.topic_table.forget_topic("/t")
    conflict = bus.topic_table.type_conflict("t", "std_msgs/msg/String")
    assert conflict == (
        "Tried to register topic /t with type std_msgs/msg/String"
        " but it is already established with type std_msgs/Int32"
    )


def test_latched_message_outlives_its_publisher_as_long_as_the_type() -> None:
    bus, first, second = make_bus(), Somebody(), Somebody()
    topic = bus.advertise(first, "/t", STRING, depth=1)
    message = text(bus, "x")
    bus.publish(first, topic, message, 0.0)
    bus.leave(first, 0.0)
    assert bus.subscribe(second, "/t", second.deliver).topic.latched == [message]
    bus.expire(TYPE_MEMORY)
    assert not topic.latched
    assert bus.find_topic("t") is topic


def test_only_latched_messages_of_publishers_that_are_gone_are_forgotten_for_memory() -> None:
    bus, first, second = make_bus(), Somebody(), Somebody()
    for owner, name in ((first, "/gone"), (second, "/stays")):
        topic = bus.advertise(owner, name, STRING, depth=1)
        bus.publish(owner, topic, text(bus, "x"), 0.0)
    bus.leave(first, 0.0)
    bus.topic_table.forget_orphans()
    latched = {name: len(topic.latched) for name, topic in bus.topics.items()}
    assert (latched["/gone"], latched["/stays"]) == (0, 1)


def test_message_of_a_topic_that_has_a_publisher_again_is_not_forgotten() -> None:
    bus, first, second = make_bus(), Somebody(), Somebody()
    topic = bus.advertise(first, "/t", STRING, depth=1)
    message = text(bus, "x")
    bus.publish(first, topic, message, 0.0)
    bus.leave(first, 0.0)
    bus.advertise(second, "/t", STRING, depth=1)
    bus.topic_table.forget_orphans()
    assert topic.latched == [message]


def test_publishers_do_not_push_out_each_others_latched_messages() -> None:
    bus, first, second, third = make_bus(), Somebody(), Somebody(), Somebody()
    topic = bus.advertise(first, "/t", STRING, depth=1)
    bus.advertise(second, "/t", STRING)
    one, two, three, four = (text(bus, data) for data in ("1", "2", "3", "4"))
    bus.publish(first, topic, one, 0.0)
    bus.publish(second, topic, two, 0.0)
    bus.publish(second, topic, three, 0.0)
    assert topic.latched == [one, three]
    bus.publish(first, topic, four, 0.0)
    assert topic.latched == [three, four]
    bus.leave(second, 0.0)
    assert topic.latched == [four]
    bus.leave(first, 0.0)
    bus.advertise(third, "/t", STRING, depth=2)
    assert topic.latched == [four]  # it is still what was said last
    bus.publish(third, topic, two, 0.0)
    assert topic.latched == [two]


class PlainTopic:
    """What latching means: all advertisements are looked at after each change."""

    def __init__(self) -> None:
        self.publishers: dict[Participant, dict[object, int]] = {}
        self.depth = 0
        self.kept: dict[Participant, list[Message]] = {}

    def advertise(self, owner: Participant, key: object, depth: int) -> None:
        self.publishers.setdefault(owner, {})[key] = depth
        self._settle()

    def unadvertise(self, owner: Participant, key: object) -> None:
        keys = self.publishers.get(owner, {})
        for each in list(keys) if key is None else [key]:
            keys.pop(each, None)
        if owner in self.publishers and not keys:
            del self.publishers[owner]
            if self.publishers:
                self.kept.pop(owner, None)
        self._settle()

    def publish(self, owner: Participant, message: Message) -> None:
        if not self.depth:
            return
        if owner not in self.kept:
            self.kept = {one: old for one, old in self.kept.items() if one in self.publishers}
        self.kept[owner] = [*self.kept.pop(owner, ()), message][-self.depth :]

    def _settle(self) -> None:
        if self.publishers:
            self.depth = max(depth for keys in self.publishers.values() for depth in keys.values())
            self.kept = {one: old[-self.depth :] for one, old in self.kept.items() if self.depth}


@given(
    st.lists(
        st.tuples(st.integers(0, 2), st.sampled_from(["advertise", "unadvertise", "publish"]), st.integers(0, 3)),
        max_size=40,
    )
)
def test_topic_latches_for_each_publisher_the_largest_depth_asked_for(
    changes: list[tuple[int, str, int]],
) -> None:
    bus, owners, plain = make_bus(), [Somebody() for _ in range(3)], PlainTopic()
    topic = bus.advertise(Somebody(), "/t", STRING)
    bus.leave(next(iter(topic.publishers)), 0.0)
    for i, (who, what, number) in enumerate(changes):
        owner = owners[who]
        if what == "advertise":
            bus.advertise(owner, "/t", STRING, depth=number, key=i % 3)
            plain.advertise(owner, i % 3, number)
        elif what == "unadvertise":
            bus.unadvertise(owner, "/t", 0.0, key=number or None)
            plain.unadvertise(owner, number or None)
        elif owner in topic.publishers:
            message = text(bus, str(i))
            bus.publish(owner, topic, message, 0.0)
            plain.publish(owner, message)
        assert (topic.publishers, topic.depth) == (plain.publishers, plain.depth)
        assert [(one, held.messages()) for one, held in topic.kept.items()] == list(plain.kept.items())


def test_name_of_an_exclusive_topic_is_free_after_its_publisher_left() -> None:
    bus, node, other = make_bus(), Somebody("/morai_sim"), Somebody()
    bus.advertise(node, "/Ego_topic", STRING, is_exclusive=True)
    bus.unadvertise(other, "/Ego_topic", 0.0)
    with pytest.raises(GraphError, match="published by /morai_sim alone"):
        bus.advertise(other, "/Ego_topic", STRING)
    bus.unadvertise(node, "/Ego_topic", 0.0)
    assert bus.advertise(other, "/Ego_topic", STRING).publishers.keys() == {other}
