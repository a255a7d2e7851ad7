"""A topic's type is its publishers': subscribers do not settle it, and components take precedence over clients."""

from __future__ import annotations

from typing import Any

import pytest

from rosbridge_sim.errors import GraphError
from rosbridge_sim.graph.attach.mirror import Mirror
from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.participant import Participant
from rosbridge_sim.graph.policy import Policy
from rosbridge_sim.graph.rosapi_services.rosapi import Rosapi
from rosbridge_sim.graph.topic_table import TYPE_MEMORY
from rosbridge_sim.graph.topics_services import Topic
from rosbridge_sim.schema.message import Message
from tests.graph.bus_fixture import Wire, make_bus

INT, STRING, IMAGE = "std_msgs/Int32", "std_msgs/String", "sensor_msgs/Image"


class ServerComponent(Participant):
    """A part of the server: it gives way to no client."""

    name = "/morai_sim"

    def __init__(self) -> None:
        self.heard: list[object] = []

    def notify(self, level: str, text: str) -> None:
        del level, text

    def hear(self, _topic: Topic, message: Message, _sender: Participant, _now: float) -> None:
        self.heard.append(message.value)


def error(text: str, op_id: object = None) -> dict[str, Any]:
    status = {"op": "status", "level": "error", "msg": text}
    return status if op_id is None else {**status, "id": op_id}


def misfit(topic: str, has: str, asks: str) -> str:
    return (
        f"{topic} has type {has} now, but this subscription asks for {asks}: it gets no messages;"
        f" subscribe with type {has}"
    )


@pytest.fixture
def bus() -> Bus:
    return make_bus()


def published(topic: str, data: object) -> dict[str, Any]:
    return {"op": "publish", "topic": topic, "msg": {"data": data}}


def test_type_of_the_publisher_holds_and_subscribers_of_another_type_are_warned(bus: Bus) -> None:
    listener, owner = Wire(bus), Wire(bus)
    assert listener.says(op="subscribe", topic="/camera", type=INT, id="s") == []
    assert owner.says(op="advertise", topic="/camera", type=STRING) == []
    assert listener.hears() == [error(misfit("/camera", STRING, INT), "s")]
    assert owner.says(op="publish", topic="/camera", msg={"data": "x"}) == []
    assert listener.hears() == []
    assert listener.peer.num_errors == 1
    assert not bus.topics["/camera"].has_listener, "nothing has to be published for its sake"


def test_latched_message_of_another_type_is_not_delivered(bus: Bus) -> None:
    listener, owner = Wire(bus), Wire(bus)
    listener.says(op="subscribe", topic="/t", type=INT)
    owner.says(op="advertise", topic="/t", type=STRING, latch=True)
    owner.says(op="publish", topic="/t", msg={"data": "kept"})
    assert [frame["op"] for frame in listener.hears()] == ["status"]


@pytest.mark.parametrize("bare", [{"type": STRING, "msg": {"data": "x"}}, {"type": "std_msgs/msg/String", "msg": {}}])
def test_publish_without_advertise_settles_the_type(bus: Bus, bare: dict[str, object]) -> None:
    listener, owner = Wire(bus), Wire(bus)
    listener.says(op="subscribe", topic="/t", type=INT)
    assert owner.says(op="publish", topic="/t", **bare) == []
    assert [frame["op"] for frame in listener.hears()] == ["status"]
    assert bus.topics["/t"].type.name == STRING


def test_publish_without_a_type_takes_the_type_of_the_subscribers(bus: Bus) -> None:
    listener, owner = Wire(bus), Wire(bus)
    listener.says(op="subscribe", topic="/t", type=INT)
    assert owner.says(op="publish", topic="/t", msg={"data": 3}) == []
    assert listener.hears() == [published("/t", 3)]
    (status,) = Wire(bus).says(op="advertise", topic="/t", type=STRING)
    assert "already established with type std_msgs/Int32" in status["msg"]


def test_publish_that_does_not_fit_its_type_settles_nothing(bus: Bus) -> None:
    listener, owner = Wire(bus), Wire(bus)
    listener.says(op="subscribe", topic="/t", type=INT)
    (status,) = owner.says(op="publish", topic="/t", type=STRING, msg={"data": 1})
    assert status["level"] == "error"
    assert (bus.topics["/t"].is_settled, bus.topics["/t"].type.name) == (False, INT)
    assert listener.hears() == []


def test_subscribers_of_different_types_coexist_without_a_publisher(bus: Bus) -> None:
    texts, numbers, owner = Wire(bus), Wire(bus), Wire(bus)
    assert texts.says(op="subscribe", topic="/t", type=STRING) == []
    assert numbers.says(op="subscribe", topic="/t", type=INT) == []
    owner.says(op="publish", topic="/t", type=INT, msg={"data": 1})
    assert texts.hears() == [error(misfit("/t", INT, STRING))]
    assert numbers.hears() == [published("/t", 1)]


def test_subscription_without_a_type_takes_the_publishers_type(bus: Bus) -> None:
    typed, plain, owner = Wire(bus), Wire(bus), Wire(bus)
    typed.says(op="subscribe", topic="/t", type=INT)
    assert plain.says(op="subscribe", topic="/t") == []
    owner.says(op="publish", topic="/t", type=STRING, msg={"data": "x"})
    assert plain.hears() == [published("/t", "x")]


def test_subscriber_of_another_type_than_the_settled_one_is_refused(bus: Bus) -> None:
    listener, owner = Wire(bus), Wire(bus)
    owner.says(op="advertise", topic="/t", type=STRING)
    text = f"Tried to register topic /t with type {INT} but it is already established with type {STRING}"
    assert listener.says(op="subscribe", topic="/t", type=INT, id=1) == [error(text, 1)]
    assert bus.topics["/t"].all_subscriptions == ()


def test_next_publisher_settles_a_forgotten_type(bus: Bus) -> None:
    listener, first, second = Wire(bus), Wire(bus), Wire(bus)
    listener.says(op="subscribe", topic="/t", type=INT)
    first.says(op="publish", topic="/t", type=STRING, msg={"data": "x"})
    first.peer.leave(5.0)
    (status,) = second.says(op="advertise", topic="/t", type=INT)
    assert "already established" in status["msg"], "it is remembered"
    bus.expire(5.0 + TYPE_MEMORY)
    listener.hears()
    assert (bus.topics["/t"].is_settled, bus.topics["/t"].type.name) == (False, INT)
    assert second.says(op="publish", topic="/t", type=INT, msg={"data": 2}) == []
    assert listener.hears() == [published("/t", 2)]


def test_subscriber_that_subscribes_again_with_the_right_type_receives_messages(bus: Bus) -> None:
    listener, owner = Wire(bus), Wire(bus)
    listener.says(op="subscribe", topic="/t", type=INT, id="a")
    owner.says(op="advertise", topic="/t", type=STRING, latch=True)
    owner.says(op="publish", topic="/t", msg={"data": "kept"})
    listener.hears()
    (status,) = listener.says(op="subscribe", topic="/t", type=INT, id="a")
    assert "already established" in status["msg"]
    assert listener.says(op="subscribe", topic="/t", type=STRING, id="a") == [published("/t", "kept")]
    owner.says(op="publish", topic="/t", msg={"data": "live"})
    assert listener.hears() == [published("/t", "live")]


def test_one_client_cannot_subscribe_with_two_types(bus: Bus) -> None:
    client = Wire(bus)
    client.says(op="subscribe", topic="/t", type=INT, id=1)
    text = f"Tried to register topic /t with type {STRING} but it is already established with type {INT}"
    assert client.says(op="subscribe", topic="/t", type=STRING, id=2) == [error(text, 2)]
    assert client.says(op="subscribe", topic="t", type=STRING, id=3) == []


def test_subscription_of_another_type_can_end(bus: Bus) -> None:
    listener, owner = Wire(bus), Wire(bus)
    listener.says(op="subscribe", topic="/t", type=INT)
    owner.says(op="advertise", topic="/t", type=STRING)
    listener.hears()
    assert listener.says(op="unsubscribe", topic="/t") == []
    assert bus.topics["/t"].all_subscriptions == ()


def test_provisional_type_is_that_of_the_first_remaining_subscriber(bus: Bus) -> None:
    first, second, third = Wire(bus), Wire(bus), Wire(bus)
    first.says(op="subscribe", topic="/t", type=INT)
    second.says(op="subscribe", topic="/t")
    third.says(op="subscribe", topic="/t", type=STRING)
    assert bus.topics["/t"].type.name == INT
    first.peer.leave(0.0)
    assert bus.topics["/t"].type.name == STRING
    third.peer.leave(0.0)
    assert bus.topics["/t"].type.name == STRING, "nobody wants another one"


def test_rosapi_shows_the_provisional_type_and_every_subscriber(bus: Bus) -> None:
    """As the master of ROS 1 does."""
    Rosapi(bus, Policy())
    listener, owner = Wire(bus), Wire(bus)
    listener.says(op="subscribe", topic="/t", type=INT)
    assert owner.learns("topic_type", topic="/t") == {"type": INT}
    raw = owner.learns("topics_and_raw_types")
    assert (raw["topics"], raw["types"]) == (["/t"], [INT])
    owner.says(op="advertise", topic="/t", type=STRING)
    assert owner.learns("topic_type", topic="/t") == {"type": STRING}
    assert owner.learns("topics_and_raw_types")["types"] == [STRING]
    assert owner.learns("subscribers", topic="/t") == {"subscribers": ["/rosbridge_websocket"]}
    owner.peer.leave(0.0)
    assert Wire(bus).learns("topics")["topics"] == ["/t"]


def test_type_of_an_unknown_package_is_provisional_too(bus: Bus) -> None:
    listener, owner = Wire(bus), Wire(bus)
    listener.says(op="subscribe", topic="/t", type="strange_msgs/One")
    assert owner.says(op="advertise", topic="/t", type="strange_msgs/Two") == []
    assert listener.hears() == [error(misfit("/t", "strange_msgs/Two", "strange_msgs/One"))]


# The server's own parts


def test_subscription_of_the_simulator_settles_the_type(bus: Bus) -> None:
    part, client = ServerComponent(), Wire(bus)
    bus.subscribe(part, "/ctrl_cmd", part.hear, type_name=INT)
    (status,) = client.says(op="advertise", topic="/ctrl_cmd", type=STRING)
    assert "already established" in status["msg"]
    assert client.says(op="publish", topic="/ctrl_cmd", type=INT, msg={"data": 1}) == []
    assert len(part.heard) == 1


@pytest.mark.parametrize("type_name", [INT, STRING])
def test_later_topic_of_the_simulator_overrides_a_clients_type(bus: Bus, type_name: str) -> None:
    part, client, listener = ServerComponent(), Wire(bus), Wire(bus)
    client.says(op="advertise", topic="/ego", type=type_name, id=1, latch=True)
    client.says(op="advertise", topic="ego", type=type_name, id=2)
    client.says(op="publish", topic="/ego", msg={})
    topic = bus.advertise(part, "/ego", STRING, is_exclusive=True)
    told = client.hears()
    assert [frame["level"] for frame in told] == ["error"]
    assert "/morai_sim" in told[0]["msg"]
    assert list(topic.publishers) == [part]
    assert listener.says(op="subscribe", topic="/ego", type=STRING) == [], "nothing of the client's is latched"
    (status,) = client.says(op="publish", topic="/ego", msg={"data": "x"})
    assert "published by /morai_sim alone" in status["msg"]
    assert client.says(op="unadvertise", topic="/ego", id=1) == []
    assert client.peer.topics.num_held == 0


def test_client_that_published_another_type_on_an_input_of_the_simulator_is_notified(bus: Bus) -> None:
    part, client, other = ServerComponent(), Wire(bus), Wire(bus)
    client.says(op="advertise", topic="/in", type=STRING)
    other.says(op="subscribe", topic="/in", type=STRING)
    bus.subscribe(part, "/in", part.hear, type_name=INT)
    (told,) = client.hears()
    assert told["msg"].startswith(f"/in has type {INT} of /morai_sim from now on, not {STRING}: ")
    assert other.hears() == [error(misfit("/in", INT, STRING))]
    assert client.says(op="publish", topic="/in", type=INT, msg={"data": 4}) == []
    assert len(part.heard) == 1


def test_client_that_published_the_right_type_on_a_later_input_goes_on(bus: Bus) -> None:
    part, client = ServerComponent(), Wire(bus)
    client.says(op="advertise", topic="/in", type=INT)
    bus.subscribe(part, "/in", part.hear, type_name=INT)
    assert client.says(op="publish", topic="/in", msg={"data": 4}) == []
    assert len(part.heard) == 1


def test_components_do_not_change_each_others_types(bus: Bus) -> None:
    one, other = ServerComponent(), ServerComponent()
    bus.subscribe(one, "/in", one.hear, type_name=INT)
    with pytest.raises(GraphError, match="already established"):
        bus.subscribe(other, "/in", other.hear, type_name=STRING)
    bus.advertise(one, "/out", INT)
    with pytest.raises(GraphError, match="already established"):
        bus.advertise(other, "/out", STRING, is_exclusive=True)


def test_remembered_type_does_not_block_a_component(bus: Bus) -> None:
    part, client = ServerComponent(), Wire(bus)
    client.says(op="publish", topic="/t", type=STRING, msg={})
    client.peer.leave(0.0)
    assert bus.advertise(part, "/t", INT, is_exclusive=True).type.name == INT


def test_message_latched_under_a_remembered_type_ends_with_it(bus: Bus) -> None:
    part, publisher, client = ServerComponent(), Wire(bus), Wire(bus)
    publisher.says(op="advertise", topic="/t", type=STRING, latch=True)
    publisher.says(**published("/t", "old"))
    publisher.peer.leave(0.0)
    bus.advertise(part, "/t", INT, depth=1, is_exclusive=True)
    assert client.says(op="subscribe", topic="/t") == []


def test_mirror_announces_the_simulators_types_regardless_of_local_clients(bus: Bus) -> None:
    part, client = ServerComponent(), Wire(bus)
    mirror = Mirror(bus, part, "far")
    client.says(op="subscribe", topic="/out", type=STRING)
    client.says(op="advertise", topic="/in", type=STRING)
    bus.advertise(part, "/out", INT, is_exclusive=True)
    bus.subscribe(part, "/in", part.hear, type_name=INT)
    assert [key[:3] for key in mirror._registry.items] == [("topic", "/out", INT), ("input", "/in", INT)]
    assert len(client.hears()) == 2
