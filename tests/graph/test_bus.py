"""Who talks to whom: what the vectors cannot show, and any order of events at all."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from typing import Any, NoReturn

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.stateful import Bundle, RuleBasedStateMachine, consumes, invariant, rule

from rosbridge_sim.errors import FieldError, GraphError, PeerError, Reason, UnknownPackageError
from rosbridge_sim.graph.actions import Action
from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.participant import OfferKind, Participant, resolve
from rosbridge_sim.graph.service_table import MAX_CALLS, MAX_STALE
from rosbridge_sim.graph.topic_table import TYPE_MEMORY
from rosbridge_sim.graph.topics_services import Answer, Call, Topic
from rosbridge_sim.graph.unpublished import UNPUBLISHED_AFTER
from rosbridge_sim.protocol.account import Account
from rosbridge_sim.schema.message import Message
from tests.graph.bus_fixture import make_bus, make_store

STRING = "std_msgs/String"
ADD = "rospy_tutorials/AddTwoInts"


class Somebody:
    """An owner that remembers what it is told and what it hears."""

    def __init__(self, name: str = "/somebody") -> None:
        self.name = name
        self.told: list[tuple[str, str]] = []
        self.heard: list[tuple[str, Any]] = []
        self.answers: list[Answer] = []
        self.calls: list[Call] = []

    def notify(self, level: str, text: str) -> None:
        self.told.append((level, text))

    def deliver(self, topic: Topic, message: Message, _sender: Participant, _now: float) -> None:
        self.heard.append((topic.name, message.value))

    def hold(self, call: Call, _now: float) -> None:
        self.calls.append(call)


class Visitor(Somebody):
    """An owner that gives way to the server's own parts, as clients do."""

    def lose(self, kind: OfferKind, name: str, why: str) -> None:
        self.told.append((f"{kind} {name}", why))


def text(bus: Bus, data: str) -> Message:
    message_type = bus.store.message(STRING)
    return Message(message_type, message_type.struct_type(data=data))


def test_names_are_resolved_against_the_root() -> None:
    assert resolve("a/b") == resolve("/a/b") == "/a/b"
    for bad in ("", " ", "/a b", "a\n", "x" * 257):
        with pytest.raises(GraphError):
            resolve(bad)


def test_a_listeners_complaint_reaches_the_sender_after_everybody_has_heard() -> None:
    bus, sender, good = make_bus(), Somebody(), Somebody()
    topic = bus.advertise(sender, "/t", STRING)

    def refuse(_topic: Topic, _message: Message, _sender: Participant, _now: float) -> None:
        raise FieldError("not like this")

    bus.subscribe(good, "/t", refuse)
    bus.subscribe(good, "/t", good.deliver)
    with pytest.raises(PeerError, match="not like this"):
        bus.publish(sender, topic, text(bus, "x"), 0.0)
    assert len(good.heard) == 1


def test_first_complaint_of_several_listeners_is_the_senders_answer() -> None:
    """The rest often follows from the first; and which one it is must not depend on how many listen."""
    bus, sender = make_bus(), Somebody()
    topic = bus.advertise(sender, "/t", STRING)

    def refuse(number: int) -> Callable[..., NoReturn]:
        def complain(*_: object) -> NoReturn:
            raise FieldError(f"complaint {number}")

        return complain

    for number in (1, 2, 3):
        bus.subscribe(Somebody(), "/t", refuse(number))
    with pytest.raises(PeerError, match="complaint 1"):
        bus.publish(sender, topic, text(bus, "x"), 0.0)


def test_complaint_about_something_of_the_simulators_own_is_a_line_in_the_log(caplog: pytest.LogCaptureFixture) -> None:
    bus, node, other = make_bus(), Somebody("/morai_sim"), Somebody()
    topic = bus.advertise(node, "/t", STRING)

    def refuse(*_: object) -> NoReturn:
        raise FieldError("not like this")

    subscription = bus.subscribe(other, "/t", refuse)
    bus.announce(node, topic, text(bus, "x"), 0.0)
    bus.show(node, topic, text(bus, "x"), [subscription], 0.0)
    assert caplog.messages == ["a listener of /t refused a message: not like this"] * 2
    assert bus.guard.num_faults == 0


def test_message_that_the_account_has_no_room_for_is_heard_and_not_latched_and_its_sender_is_told() -> None:
    bus, sender, listener = make_bus(), Somebody(), Somebody()
    bus.accounts[sender] = Account(0)
    topic = bus.advertise(sender, "/t", STRING, depth=1)
    bus.subscribe(listener, "/t", listener.deliver)
    with pytest.raises(GraphError, match="the message is not latched") as caught:
        bus.publish(sender, topic, text(bus, "x"), 0.0)
    assert caught.value.reason is Reason.TOO_MUCH
    assert (len(listener.heard), list(topic.latched)) == (1, [])


def test_listener_of_another_type_is_told_itself_or_by_the_way_it_has_given() -> None:
    bus, node, first, second = make_bus(), Somebody("/morai_sim"), Visitor(), Visitor()
    told: list[str] = []
    bus.subscribe(first, "/t", first.deliver, type_name="std_msgs/Int32")
    bus.subscribe(
        second, "/t", second.deliver, type_name="std_msgs/Int32", notify=lambda level, _text: told.append(level)
    )
    bus.advertise(node, "/t", STRING)
    assert ([level for level, _ in first.told], second.told, told) == (["error"], [], ["error"])


def test_part_of_the_server_that_takes_any_type_binds_a_topic_to_none() -> None:
    """The recorder listens everywhere: no type of a client may be settled for good by that."""
    bus, client, part = make_bus(), Visitor(), Somebody("/recorder")
    topic = bus.subscribe(client, "/t", client.deliver, type_name=STRING).topic
    bus.subscribe(part, "/t", part.deliver)
    assert (topic.is_settled, topic.is_bound) == (False, False)
    bus.subscribe(part, "/t", part.deliver, type_name=STRING)
    assert (topic.is_settled, topic.is_bound) == (True, True)


def test_a_listener_may_leave_while_it_is_spoken_to() -> None:
    bus, sender, other = make_bus(), Somebody(), Somebody()
    topic = bus.advertise(sender, "/t", STRING)
    subscription = bus.subscribe(other, "/t", lambda *_: bus.unsubscribe(subscription, 0.0))
    bus.subscribe(other, "/t", other.deliver)
    bus.publish(sender, topic, text(bus, "x"), 0.0)
    bus.publish(sender, topic, text(bus, "y"), 0.0)
    assert len(other.heard) == 2
    assert len(topic.subscriptions) == 1


def test_an_exclusive_topic_has_one_publisher_and_any_listener() -> None:
    bus, node, other = make_bus(), Somebody("/morai_sim"), Somebody()
    topic = bus.advertise(node, "/Ego_topic", STRING, is_exclusive=True)
    with pytest.raises(GraphError, match="published by /morai_sim alone"):
        bus.advertise(other, "/Ego_topic", STRING)
    bus.subscribe(other, "/Ego_topic", other.deliver)
    bus.publish(node, topic, text(bus, "x"), 0.0)
    assert len(other.heard) == 1


def test_an_exclusive_service_cannot_be_taken_over() -> None:
    bus, node, other = make_bus(), Somebody("/morai_sim"), Somebody()
    service = bus.provide(node, "/s", ADD, node.hold, is_exclusive=True)
    with pytest.raises(GraphError, match="provided by /morai_sim alone"):
        bus.provide(other, "/s", ADD, other.hold)
    with pytest.raises(GraphError, match="can't unadvertise"):
        bus.withdraw(other, "/s")
    assert bus.services["/s"] is service


def test_a_type_is_remembered_for_a_while_and_then_forgotten() -> None:
    bus, first, second = make_bus(), Visitor(), Visitor()
    bus.advertise(first, "/t", STRING)
    bus.leave(first, 100.0)
    assert bus.next_deadline() == 100.0 + TYPE_MEMORY
    bus.expire(100.0 + TYPE_MEMORY - 0.1)
    with pytest.raises(GraphError, match="already established"):
        bus.advertise(second, "/t", "std_msgs/Int32")
    bus.expire(100.0 + TYPE_MEMORY)
    bus.advertise(second, "/t", "std_msgs/Int32")
    assert bus.next_deadline() is None


def test_what_is_remembered_of_a_topic_can_be_forgotten_at_once() -> None:
    bus, first, second = make_bus(), Somebody(), Somebody()
    topic = bus.advertise(first, "/t", STRING, depth=1)
    bus.publish(first, topic, text(bus, "x"), 0.0)
    bus.forget_topic("/t")
    bus.forget_topic("/nothing")
    assert topic.latched, "it has a publisher"
    bus.unadvertise(first, "/t", 0.0)
    bus.forget_topic("t")
    assert bus.find_topic("/t") is None
    assert bus.type_conflict("/t", "std_msgs/Int32") is None
    bus.subscribe(second, "/t", second.deliver, type_name="std_msgs/Int32")
    bus.forget_topic("/t")
    conflict = bus.type_conflict("t", "std_msgs/msg/String")
    assert conflict == (
        "Tried to register topic /t with type std_msgs/msg/String"
        " but it is already established with type std_msgs/Int32"
    )


def test_a_service_may_be_withdrawn_with_or_without_an_answer_to_those_who_wait() -> None:
    bus, provider, caller = make_bus(), Somebody(), Somebody()
    for answers_calls in (True, False):
        bus.provide(provider, "/add", ADD, provider.hold)
        bus.call(caller, "/add", {}, caller.answers.append, now=0.0)
        bus.withdraw(provider, "/add", answers_calls=answers_calls)
        provider.calls[-1].refuse("later")
    assert [answer.values for answer in caller.answers] == ["later", "Service /add was unadvertised"]


def test_a_latched_message_outlives_its_publisher_as_long_as_the_type_does() -> None:
    bus, first, second = make_bus(), Somebody(), Somebody()
    topic = bus.advertise(first, "/t", STRING, depth=1)
    message = text(bus, "x")
    bus.publish(first, topic, message, 0.0)
    bus.leave(first, 0.0)
    assert bus.subscribe(second, "/t", second.deliver).topic.latched == [message]
    bus.expire(TYPE_MEMORY)
    assert not topic.latched
    assert bus.find_topic("t") is topic


def test_what_one_publisher_latched_is_not_pushed_out_by_another() -> None:
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
def test_a_topic_keeps_as_many_messages_of_each_publisher_as_the_one_that_asks_for_most(
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


@pytest.mark.parametrize("timeout", [1.0, TYPE_MEMORY - 1.0, TYPE_MEMORY + 1.0])
def test_next_deadline_is_the_earliest_of_a_call_and_a_topic_without_holders(timeout: float) -> None:
    """A later one would leave the caller without an answer, or the topic with its old type, for too long."""
    bus, provider, caller, visitor = make_bus(), Somebody(), Somebody(), Visitor()
    bus.provide(provider, "/add", ADD, provider.hold)
    bus.call(caller, "/add", {}, caller.answers.append, now=0.0, timeout=timeout)
    bus.advertise(visitor, "/t", STRING)
    bus.leave(visitor, 0.0)
    assert bus.next_deadline() == min(timeout, TYPE_MEMORY)


def test_ended_calls_do_not_wait_for_a_deadline_that_is_far_away() -> None:
    bus, provider, caller = make_bus(), Somebody(), Somebody()
    bus.provide(provider, "/add", ADD, provider.hold)
    bus.call(caller, "/add", {}, caller.answers.append, now=0.0, timeout=5.0)
    for _ in range(10 * MAX_STALE):
        bus.call(caller, "/add", {}, caller.answers.append, now=0.0, timeout=1e9)
        provider.calls.pop().refuse("no")
    assert len(bus._service_table._deadlines) <= 2 * MAX_STALE
    bus.expire(5.0)
    assert caller.answers[-1].values == "Timeout exceeded while waiting for service response"
    assert provider.calls[0].request is None
    assert bus.next_deadline() is None


def test_next_deadline_is_that_of_a_listener_without_a_publisher_where_it_comes_first() -> None:
    bus, provider, caller, listener = make_bus(), Somebody(), Somebody(), Somebody()
    bus.provide(provider, "/add", ADD, provider.hold)
    bus.call(caller, "/add", {}, caller.answers.append, now=0.0, timeout=UNPUBLISHED_AFTER + 1.0)
    subscription = bus.subscribe(listener, "/t", listener.deliver, type_name=STRING)
    bus.unpublished.watch(subscription, lambda _topic: None, 0.0)
    assert bus.next_deadline() == UNPUBLISHED_AFTER
    bus.expire(UNPUBLISHED_AFTER)
    assert bus.next_deadline() == UNPUBLISHED_AFTER + 1.0


def test_account_of_an_owner_that_has_left_is_forgotten() -> None:
    bus, client = make_bus(), Somebody()
    account = bus.accounts[client] = Account(10)
    assert bus.account_of(client) is account
    bus.leave(client, 0.0)
    assert client not in bus.accounts


def test_call_in_flight_is_on_the_account_of_its_caller_until_it_has_ended() -> None:
    bus, provider, caller = make_bus(), Somebody(), Somebody()
    account = bus.accounts[caller] = Account(10_000)
    bus.provide(provider, "/add", ADD, provider.hold)
    bus.provide(provider, "/own", ADD, provider.hold, is_exclusive=True)
    bus.call(caller, "/own", {}, caller.answers.append, now=0.0)
    assert account.num_bytes == 0  # the simulator's own services answer at once
    for end in ("answer", "refuse", "expire", "leave"):
        bus.call(caller, "/add", {}, caller.answers.append, now=0.0, timeout=1.0)
        assert account.num_bytes > 0
        if end == "answer":
            provider.calls[-1].answer(bus.store.service(ADD).response.default())
        elif end == "refuse":
            provider.calls[-1].refuse("no")
        elif end == "expire":
            bus.expire(1.0)
        else:
            bus.withdraw(provider, "/add")
        assert account.num_bytes == 0


def test_call_that_the_account_has_no_room_for_is_refused_and_not_handed_on() -> None:
    bus, provider, caller = make_bus(), Somebody(), Somebody()
    bus.accounts[caller] = Account(1)
    bus.provide(provider, "/add", ADD, provider.hold)
    bus.call(caller, "/add", {}, caller.answers.append, now=0.0)
    (answer,) = caller.answers
    assert (answer.is_ok, answer.reason, provider.calls) == (False, Reason.TOO_MUCH, [])
    assert str(answer.values).startswith("Too much in flight: ")


def test_name_of_an_exclusive_topic_is_free_after_its_owner_has_left() -> None:
    bus, node, other = make_bus(), Somebody("/morai_sim"), Somebody()
    bus.advertise(node, "/Ego_topic", STRING, is_exclusive=True)
    bus.unadvertise(other, "/Ego_topic", 0.0)
    with pytest.raises(GraphError, match="published by /morai_sim alone"):
        bus.advertise(other, "/Ego_topic", STRING)
    bus.unadvertise(node, "/Ego_topic", 0.0)
    assert bus.advertise(other, "/Ego_topic", STRING).publishers.keys() == {other}


def test_owner_may_offer_its_own_service_anew_without_a_word_and_others_with_one() -> None:
    bus, node, other = make_bus(), Somebody("/morai_sim"), Somebody()
    for is_exclusive in (True, False):
        service = bus.provide(node, "s", ADD, node.hold, is_exclusive=is_exclusive)
        assert bus.services == {"/s": service}
    assert node.told == []
    bus.provide(other, "/s", ADD, other.hold)
    assert other.told == [("warning", "Duplicate service advertised. Overwriting /s.")]


def test_watchers_hear_of_all_that_an_owner_begins_and_ceases_to_hold() -> None:
    """The bridges announce from this: what they do not hear of is missing on the far side, or stays there for ever."""
    bus, owner = make_bus(), Somebody()
    heard: list[Participant] = []
    bus.on_holdings.append(heard.append)
    steps: list[Callable[[], object]] = [
        lambda: bus.advertise(owner, "/t", STRING),
        lambda: bus.unadvertise(owner, "/t", 0.0),
        lambda: bus.provide(owner, "/s", ADD, owner.hold),
        lambda: bus.withdraw(owner, "/s"),
    ]
    for step in steps:
        step()
        assert set(heard) == {owner}
        heard.clear()
    subscription = bus.subscribe(owner, "/t", owner.deliver, type_name=STRING)
    assert set(heard) == {owner}
    heard.clear()
    bus.unsubscribe(subscription, 0.0)
    assert set(heard) == {owner}


def test_watchers_hear_of_a_client_whose_advertisement_a_part_of_the_server_has_ended() -> None:
    bus, node, client = make_bus(), Somebody("/morai_sim"), Visitor()
    bus.advertise(client, "/t", STRING)
    heard: list[Participant] = []
    bus.on_holdings.append(heard.append)
    bus.advertise(node, "/t", STRING, is_exclusive=True)
    assert set(heard) == {client, node}


def test_failure_of_one_listener_that_is_shown_something_is_counted_and_the_others_have_it() -> None:
    bus, node, good = make_bus(), Somebody("/morai_sim"), Somebody()
    topic = bus.advertise(node, "/t", STRING)

    def break_down(*_: object) -> NoReturn:
        raise ZeroDivisionError

    subscriptions = [bus.subscribe(Somebody(), "/t", break_down), bus.subscribe(good, "/t", good.deliver)]
    bus.show(node, topic, text(bus, "x"), subscriptions, 0.0)
    assert (bus.guard.num_faults, len(good.heard)) == (1, 1)


def test_who_leaves_costs_nothing_for_the_actions_of_others() -> None:
    bus, provider, other = make_bus(), Somebody(), Somebody()
    for number in range(3):
        bus.actions.provide(provider, f"/a{number}", "action_tutorials_interfaces/Fibonacci", print, print)
    bus.actions.withdraw(provider, "/a0")

    class Unwalked(dict[str, Action]):
        def values(self) -> NoReturn:
            raise AssertionError("all actions were gone through")

    bus.actions.by_name = Unwalked(bus.actions.by_name)
    bus.leave(other, 0.0)
    bus.leave(provider, 0.0)
    assert len(bus.actions.by_name) == 0


def test_who_only_overhears_is_no_listener_but_hears() -> None:
    bus, sender, listener = make_bus(), Somebody(), Somebody()
    topic = bus.advertise(sender, "/t", STRING, is_on_demand=True)
    subscription = bus.subscribe(listener, "/t", listener.deliver, is_idle=True)
    assert not topic.has_listener
    assert list(topic.on_demand) == [sender]
    bus.publish(sender, topic, text(bus, "x"), 0.0)
    assert len(listener.heard) == 1
    subscription.is_idle = False
    assert topic.has_listener
    bus.leave(sender, 0.0)
    assert not topic.on_demand


def test_a_call_is_given_up_at_its_deadline() -> None:
    bus, provider, caller = make_bus(), Somebody(), Somebody()
    bus.provide(provider, "/add", ADD, provider.hold)
    bus.call(caller, "/add", {"a": 1}, caller.answers.append, now=0.0, timeout=2.0)
    bus.call(caller, "/add", {"a": 2}, caller.answers.append, now=0.0, timeout=0.0)
    bus.call(caller, "/add", {"a": 3}, caller.answers.append, now=0.0)
    assert bus.next_deadline() == 2.0
    bus.expire(1.9)
    assert caller.answers == []
    bus.expire(2.0)
    assert [a.values for a in caller.answers] == ["Timeout exceeded while waiting for service response"]
    assert bus.next_deadline() is None
    provider.calls[0].answer(bus.store.service(ADD).response.default())
    assert len(caller.answers) == 1


def test_the_buss_own_timeout_holds_where_a_call_gives_none() -> None:
    bus = Bus(make_store(), service_timeout=5.0)
    provider, caller = Somebody(), Somebody()
    bus.provide(provider, "/add", ADD, provider.hold)
    bus.call(caller, "/add", None, caller.answers.append, now=1.0)
    assert bus.next_deadline() == 6.0
    provider.calls[0].refuse("no")
    assert bus.next_deadline() is None


def test_a_provider_that_fails_by_our_own_fault_still_gives_an_answer() -> None:
    bus, provider, caller = make_bus(), Somebody(), Somebody()

    def fail(_call: Call, _now: float) -> None:
        raise ZeroDivisionError

    bus.provide(provider, "/add", ADD, fail)
    with pytest.raises(ZeroDivisionError):
        bus.call(caller, "/add", None, caller.answers.append, now=0.0)
    assert [a.is_ok for a in caller.answers] == [False]


def test_calls_in_flight_are_bounded() -> None:
    bus, provider, caller = make_bus(), Somebody(), Somebody()
    bus.provide(provider, "/add", ADD, provider.hold)
    for _ in range(MAX_CALLS + 1):
        bus.call(caller, "/add", None, caller.answers.append, now=0.0)
    assert len(provider.calls) == MAX_CALLS
    assert [a.is_ok for a in caller.answers] == [False]
    provider.calls[0].refuse("no")
    bus.call(caller, "/add", None, caller.answers.append, now=0.0)
    assert len(provider.calls) == MAX_CALLS + 1


def test_strict_types_refuse_what_nobody_knows() -> None:
    bus = Bus(make_store(), is_strict=True)
    with pytest.raises(UnknownPackageError):
        bus.advertise(Somebody(), "/t", "my_msgs/Thing")
    assert bus.topics == {}


def test_strict_types_refuse_services_and_actions_that_nobody_knows() -> None:
    bus = Bus(make_store(), is_strict=True)
    with pytest.raises(UnknownPackageError):
        bus.provide(Somebody(), "/s", "my_msgs/Thing", lambda _call, _now: None)
    with pytest.raises(UnknownPackageError):
        bus.actions.provide(Somebody(), "/a", "my_msgs/Thing", lambda _goal: None, lambda _goal: None)
    assert bus.services == {}
    assert bus.actions.by_name == {}


def test_package_that_is_perhaps_misspelt_is_named_with_the_nearest_one(caplog: pytest.LogCaptureFixture) -> None:
    bus, owner = make_bus(), Somebody()
    bus.advertise(owner, "/t", "std_msg/String")
    bus.provide(owner, "/s", "std_srv/Empty", lambda _call, _now: None)
    assert [record.getMessage().partition(";")[0] for record in caplog.records] == [
        "std_msg/String: its package is unknown (did you mean std_msgs?)",
        "std_srv/Empty: its package is unknown (did you mean std_srvs?)",
    ]


def test_services_of_rosbag2_count_as_unknown_for_we_have_its_messages_alone() -> None:
    bus = make_bus()
    service = bus.provide(Somebody(), "/s", "rosbag2_interfaces/Seek", lambda _call, _now: None)
    assert service.type.name == "rosbag2_interfaces/Seek"
    assert bus.store.message("rosbag2_interfaces/ReadSplitEvent").default() is not None


def test_watchers_hear_who_left() -> None:
    bus, somebody = make_bus(), Somebody()
    left: list[tuple[Participant, float]] = []
    bus.on_leave.append(lambda owner, now: left.append((owner, now)))
    bus.leave(somebody, 3.0)
    assert left == [(somebody, 3.0)]


def test_a_topic_is_told_of_when_somebody_begins_to_publish_or_to_listen() -> None:
    bus = make_bus()
    told: list[tuple[str, int, int]] = []
    bus.on_topic.append(lambda topic: told.append((topic.name, len(topic.publishers), len(topic.subscriptions))))
    one, two = Somebody("/one"), Somebody("/two")
    bus.advertise(one, "chatter", "std_msgs/String")
    bus.subscribe(two, "/chatter", two.deliver)
    assert told == [("/chatter", 1, 0), ("/chatter", 1, 1)]


class BusMachine(RuleBasedStateMachine):
    """A part of the server and two clients do anything in any order."""

    calls = Bundle("calls")
    people = st.sampled_from(range(3))
    topics = st.sampled_from(["/a", "b"])
    services = st.sampled_from(["/s", "r"])
    types = st.sampled_from([STRING, "std_msgs/msg/String", "std_msgs/Int32"])

    def __init__(self) -> None:
        super().__init__()
        self.bus = make_bus()
        self.owners = [Somebody("/n0"), Visitor("/n1"), Visitor("/n2")]
        self.asked = self.answered = self.abandoned = 0
        self.now = 0.0

    @rule(who=people, topic=topics, kind=types, latch=st.booleans(), key=st.sampled_from([None, "k"]))
    def advertise(self, who: int, topic: str, kind: str, latch: bool, key: str | None) -> None:  # noqa: FBT001 - drawn
        known = self.bus.find_topic(topic)
        try:
            self.bus.advertise(self.owners[who], topic, kind, depth=int(latch), key=key)
        except GraphError:
            assert known is not None
            is_other = known.is_settled and known.type.name != self.bus.store.canonical(kind)
            assert is_other or known.owner not in {None, self.owners[who]}
            assert who != 0 or known.is_bound, "a part of the server is kept out by parts alone"

    @rule(topic=topics, kind=types)
    def advertise_alone(self, topic: str, kind: str) -> None:
        part = self.owners[0]
        try:
            known = self.bus.advertise(part, topic, kind, key="alone", is_exclusive=True)
        except GraphError:
            return
        assert list(known.publishers) == [part]

    @rule(who=people, topic=topics, key=st.sampled_from([None, "k", "other"]))
    def unadvertise(self, who: int, topic: str, key: str | None) -> None:
        self.bus.unadvertise(self.owners[who], topic, self.now, key=key)

    @rule(who=people, topic=topics, kind=st.none() | types)
    def subscribe(self, who: int, topic: str, kind: str | None) -> None:
        owner, known = self.owners[who], self.bus.find_topic(topic)
        if known is None and kind is None:
            return
        try:
            self.bus.subscribe(owner, topic, owner.deliver, type_name=kind)
        except GraphError:
            assert known is not None
            assert known.is_settled
            assert who != 0 or known.is_bound

    @rule(who=st.sampled_from([1, 2]), kind=types)
    def subscribe_again(self, who: int, kind: str) -> None:
        for topic in self.bus.topics.values():
            for subscription in topic.all_subscriptions:
                if subscription.owner is self.owners[who]:
                    with suppress(GraphError):
                        self.bus.retype(subscription, kind)
                        assert subscription in topic.subscriptions
                    return

    @rule(who=people)
    def unsubscribe(self, who: int) -> None:
        for topic in self.bus.topics.values():
            for subscription in topic.all_subscriptions:
                if subscription.owner is self.owners[who]:
                    self.bus.unsubscribe(subscription, self.now)
                    self.bus.unsubscribe(subscription, self.now)
                    return

    @rule(who=people, name=topics)
    def publish(self, who: int, name: str) -> None:
        topic = self.bus.find_topic(name)
        if topic is None or self.owners[who] not in topic.publishers:
            return
        before = [len(owner.heard) for owner in self.owners]
        self.bus.publish(self.owners[who], topic, Message(topic.type, topic.type.default()), self.now)
        for owner, count in zip(self.owners, before, strict=True):
            assert len(owner.heard) - count == sum(s.owner is owner for s in topic.subscriptions)

    @rule(who=people, name=services)
    def provide(self, who: int, name: str) -> None:
        owner = self.owners[who]
        self.bus.provide(owner, name, ADD, owner.hold)

    @rule(who=people, name=services)
    def withdraw(self, who: int, name: str) -> None:
        service = self.bus.services.get(resolve(name))
        if service is not None and service.owner is self.owners[who]:
            self.bus.withdraw(self.owners[who], name)

    @rule(target=calls, who=people, name=services, timeout=st.sampled_from([None, 1.0, 5.0]))
    def call(self, who: int, name: str, timeout: float | None) -> Call | None:
        service = self.bus.services.get(resolve(name))
        self.asked += 1
        self.bus.call(self.owners[who], name, None, self.count_answer, now=self.now, timeout=timeout)
        provider = service.owner if service else None
        return provider.calls[-1] if isinstance(provider, Somebody) else None

    def count_answer(self, _answer: Answer) -> None:
        self.answered += 1

    @rule(call=consumes(calls), is_ok=st.booleans())
    def answer(self, call: Call | None, is_ok: bool) -> None:  # noqa: FBT001 - drawn
        if call is not None and is_ok:
            call.answer(call.service.type.response.default())
        elif call is not None:
            call.refuse("no")

    @rule(seconds=st.sampled_from([0.5, 3.0, 11.0]))
    def wait(self, seconds: float) -> None:
        self.now += seconds
        self.bus.expire(self.now)

    @rule(who=people)
    def leave(self, who: int) -> None:
        owner = self.owners[who]
        others = self.in_flight() - self.in_flight(owner)
        mine_elsewhere = sum(
            c.caller is owner and c.service.owner is not owner for s in self.bus.services.values() for c in s.calls
        )
        mine_here = self.in_flight(owner) - mine_elsewhere
        answered = self.answered
        self.bus.leave(owner, self.now)
        self.bus.leave(owner, self.now)
        # one's own calls are dropped; strangers' calls to one's services are answered
        self.abandoned += mine_elsewhere + mine_here
        assert self.in_flight() == others - (self.answered - answered)
        assert owner not in self.bus.owners()

    def in_flight(self, caller: Somebody | None = None) -> int:
        return sum(caller in {None, c.caller} for s in self.bus.services.values() for c in s.calls)

    @invariant()
    def every_call_is_answered_once_or_in_flight(self) -> None:
        assert self.asked == self.answered + self.in_flight() + self.abandoned

    @invariant()
    def both_sides_of_the_books_agree(self) -> None:
        for topic in self.bus.topics.values():
            assert all(topic.publishers.values())
            if topic.publishers:
                assert topic.is_latching == any(any(keys.values()) for keys in topic.publishers.values())
            else:  # what is latched stays as long as the type does
                assert topic.orphaned_at is not None or topic.all_subscriptions

    @invariant()
    def types_are_settled_by_publishers_and_hold_for_all_that_is_delivered(self) -> None:
        for topic in self.bus.topics.values():
            assert topic.is_settled or not (topic.publishers or topic.kept or topic.is_bound)
            fitting = tuple(each for each in topic.all_subscriptions if each.fits)
            assert topic.subscriptions == (fitting if topic.is_settled else topic.all_subscriptions)
            assert all(topic in self.bus.holdings(owner).published for owner in topic.publishers)
        for owner in self.bus.owners():
            assert all(owner in topic.publishers for topic in self.bus.holdings(owner).published)

    def teardown(self) -> None:
        for owner in self.owners:
            self.bus.leave(owner, self.now)
        self.bus.expire(self.now + TYPE_MEMORY)
        assert self.bus.topics == {}
        assert self.bus.services == {}
        assert self.bus.owners() == []
        assert self.bus.next_deadline() is None


TestBusMachine = BusMachine.TestCase
TestBusMachine.settings = settings(max_examples=50, stateful_step_count=40, deadline=None)
