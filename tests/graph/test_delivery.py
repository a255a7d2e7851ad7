"""Each listener has a message in its turn, and a mistake of one hurts no other."""

from __future__ import annotations

from collections.abc import Callable
from typing import NoReturn

import pytest

from rosbridge_sim.errors import FieldError, PeerError
from rosbridge_sim.graph.participant import Participant
from rosbridge_sim.graph.topics_services import Topic
from rosbridge_sim.schema.message import Message
from tests.graph.bus_fixture import make_bus
from tests.graph.participants import STRING, Somebody, text


def test_error_of_a_subscriber_is_reported_to_the_sender_after_all_have_received() -> None:
    bus, sender, good = make_bus(), Somebody(), Somebody()
    topic = bus.advertise(sender, "/t", STRING)

    def refuse(_topic: Topic, _message: Message, _sender: Participant, _now: float) -> None:
        raise FieldError("not like this")

    bus.subscribe(good, "/t", refuse)
    bus.subscribe(good, "/t", good.deliver)
    with pytest.raises(PeerError, match="not like this"):
        bus.publish(sender, topic, text(bus, "x"), 0.0)
    assert len(good.heard) == 1


def test_first_of_several_subscriber_errors_is_reported_to_the_sender() -> None:
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


def test_subscriber_error_about_a_message_of_the_simulator_is_logged(caplog: pytest.LogCaptureFixture) -> None:
    bus, node, other = make_bus(), Somebody("/morai_sim"), Somebody()
    topic = bus.advertise(node, "/t", STRING)

    def refuse(*_: object) -> NoReturn:
        raise FieldError("not like this")

    subscription = bus.subscribe(other, "/t", refuse)
    bus.announce(node, topic, text(bus, "x"), 0.0)
    bus.show(node, topic, text(bus, "x"), [subscription], 0.0)
    assert caplog.messages == ["a listener of /t refused a message: not like this"] * 2
    assert bus.guard.num_faults == 0


def test_subscriber_may_leave_during_delivery() -> None:
    bus, sender, other = make_bus(), Somebody(), Somebody()
    topic = bus.advertise(sender, "/t", STRING)
    subscription = bus.subscribe(other, "/t", lambda *_: bus.unsubscribe(subscription, 0.0))
    bus.subscribe(other, "/t", other.deliver)
    bus.publish(sender, topic, text(bus, "x"), 0.0)
    bus.publish(sender, topic, text(bus, "y"), 0.0)
    assert len(other.heard) == 2
    assert len(topic.subscriptions) == 1


def test_failing_subscriber_is_counted_and_others_still_receive() -> None:
    bus, node, good = make_bus(), Somebody("/morai_sim"), Somebody()
    topic = bus.advertise(node, "/t", STRING)

    def break_down(*_: object) -> NoReturn:
        raise ZeroDivisionError

    subscriptions = [bus.subscribe(Somebody(), "/t", break_down), bus.subscribe(good, "/t", good.deliver)]
    bus.show(node, topic, text(bus, "x"), subscriptions, 0.0)
    assert (bus.guard.num_faults, len(good.heard)) == (1, 1)


def test_passive_subscriber_receives_without_counting_as_a_subscriber() -> None:
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
