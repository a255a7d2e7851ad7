"""Isolation of failures: a failure at each boundary of the bus affects only its own participant."""

from __future__ import annotations

import json
import logging
from collections.abc import Callable
from typing import Any, NoReturn, cast

import pytest

from rosbridge_sim.errors import EncodingError, FieldError
from rosbridge_sim.graph.actions import Goal, GoalOutcome, GoalStatus
from rosbridge_sim.graph.attach.mirror import Mirror
from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.guard import Guard
from rosbridge_sim.graph.participant import Participant
from rosbridge_sim.graph.peers.peer import Peer
from rosbridge_sim.graph.tf.web_republisher import WebRepublisher
from rosbridge_sim.graph.topics_services import Answer, Call, Topic
from rosbridge_sim.protocol.outbox import Outbox
from rosbridge_sim.schema.message import Message
from rosbridge_sim.schema.message_type import MessageType
from tests.graph.bus_fixture import make_bus, make_peer

STRING = "std_msgs/String"
SERVICE = "std_srvs/SetBool"
ACTION = "example_interfaces/Fibonacci"


class Fault(Exception):  # noqa: N818 - a bug of ours, planted
    """What no part of the server raises on purpose."""


class ServerComponent(Participant):
    """An owner that serves everybody and cannot end alone."""

    name = "/part"

    def __init__(self, bus: Bus) -> None:
        self.bus = bus
        self.told: list[tuple[str, str]] = []
        self.heard: list[Any] = []
        self.answers: list[Answer] = []
        self.outcomes: list[GoalOutcome] = []

    def notify(self, level: str, text: str) -> None:
        self.told.append((level, text))

    def hear(self, _topic: Topic, message: Message, _sender: Participant, _now: float) -> None:
        self.heard.append(message.value.data)


class FailingClient(ServerComponent):
    """An owner that stands for one client: it leaves the bus when something that is done for it fails."""

    name = "/guest"

    def __init__(self, bus: Bus) -> None:
        super().__init__(bus)
        self.failures: list[Exception] = []

    def fail(self, error: Exception) -> None:
        self.failures.append(error)
        self.bus.leave(self, 0.0)


class FailingAtEnd(FailingClient):
    """One whose end fails too."""

    def fail(self, error: Exception) -> None:
        super().fail(error)
        raise ValueError("it cannot even end")


def break_down(*_: object) -> NoReturn:
    raise Fault


class BrokenType:
    """`std_msgs/String` with something in it that fails: it only looks like a type."""

    def __init__(self, bus: Bus, **broken: Callable[..., object]) -> None:
        real = bus.store.message(STRING)
        self.name = real.name
        self.decode_json = real.decode_json
        self.encode_json = broken.get("encode_json", real.encode_json)
        self.encode_raw = broken.get("encode_raw", real.encode_raw)


def text(bus: Bus, data: object) -> Message:
    message_type = bus.store.message(STRING)
    return Message(message_type, message_type.struct_type(data=data))


def make_client(bus: Bus) -> tuple[Peer, Outbox]:
    """A client that is closed, as by its server, when something that is done for it fails."""
    peer, outbox = make_peer(bus)
    peer.on_failure = lambda _error: peer.leave(0.0)
    return peer, outbox


def say(peer: Peer, op: str, **fields: object) -> None:
    peer.receive(json.dumps({"op": op, **fields}).encode(), 0.0)


def frames(outbox: Outbox) -> list[dict[str, Any]]:
    return [json.loads(frame) for frame in outbox.take(2**30)]


def tracebacks(caplog: pytest.LogCaptureFixture) -> list[str]:
    """The lines of the log that have a traceback."""
    return [record.getMessage() for record in caplog.records if record.exc_info]


# Messages


def test_message_that_cannot_be_encoded_is_dropped_for_its_subscriber_only(caplog: pytest.LogCaptureFixture) -> None:
    bus = make_bus()
    sender, (plain, plain_box), (raw, raw_box), last = (
        ServerComponent(bus),
        make_client(bus),
        make_client(bus),
        FailingClient(bus),
    )
    topic = bus.advertise(sender, "/t", STRING)
    broken = cast("MessageType", BrokenType(bus, encode_raw=break_down))
    say(raw, "subscribe", topic="/t", compression="cbor-raw")
    say(plain, "subscribe", topic="/t")
    bus.subscribe(last, "/t", last.hear)
    for _ in range(3):
        with pytest.raises(EncodingError, match=r"std_msgs/String: cannot be written as cbor-raw: Fault\(\)"):
            bus.publish(sender, topic, Message(broken, text(bus, "half").value), 0.0)
    bus.publish(sender, topic, text(bus, "whole"), 0.0)
    assert [frame["msg"]["data"] for frame in frames(plain_box)] == last.heard == ["half", "half", "half", "whole"]
    assert len(raw_box.take(2**30)) == 1
    assert bus.guard.num_faults == 3
    assert [line[:25] for line in tracebacks(caplog)] == ["/t: a message is dropped:"]


def test_client_that_publishes_an_unencodable_message_is_notified(caplog: pytest.LogCaptureFixture) -> None:
    bus = make_bus()
    (listener, box), (sender, sender_box) = make_client(bus), make_client(bus)
    say(listener, "subscribe", topic="/t", type=STRING)
    bus.topics["/t"].type = cast("MessageType", BrokenType(bus, encode_json=break_down))
    say(sender, "publish", topic="/t", msg={"data": "x"}, id="p")
    (status,) = frames(sender_box)
    assert (status["level"], status["id"]) == ("error", "p")
    assert "cannot be written as JSON: Fault()" in status["msg"]
    assert not box.take(2**30)
    assert bus.holdings(listener).subscriptions
    assert len(tracebacks(caplog)) == 1


def test_failing_encoding_is_tried_once_for_all_subscribers() -> None:
    bus, tried = make_bus(), list[object]()
    sender = ServerComponent(bus)

    def fail(value: object) -> NoReturn:
        tried.append(value)
        raise Fault

    broken = cast("MessageType", BrokenType(bus, encode_json=fail))
    topic = bus.advertise(sender, "/t", STRING)
    for _ in range(1_000):
        say(make_client(bus)[0], "subscribe", topic="/t")
    with pytest.raises(EncodingError):
        bus.publish(sender, topic, Message(broken, text(bus, "x").value), 0.0)
    assert len(tried) == 1
    assert bus.guard.num_faults == 1_000


def test_unencodable_latched_message_does_not_block_other_latched_messages(caplog: pytest.LogCaptureFixture) -> None:
    bus = make_bus()
    sender = ServerComponent(bus)
    topic = bus.advertise(sender, "/t", STRING, depth=3)
    for data in ("a", object(), "b"):
        bus.publish(sender, topic, text(bus, data), 0.0)
    client, box = make_client(bus)
    say(client, "subscribe", topic="/t")
    assert [frame["msg"]["data"] for frame in frames(box)] == ["a", "b"]
    assert bus.guard.num_faults == len(tracebacks(caplog)) == 1


def test_queued_message_that_cannot_be_encoded_is_skipped(caplog: pytest.LogCaptureFixture) -> None:
    bus = make_bus()
    sender, (client, box) = ServerComponent(bus), make_client(bus)
    topic = bus.advertise(sender, "/t", STRING)
    say(client, "subscribe", topic="/t", throttle_rate=100, queue_length=5)
    for data in ("a", object(), "b"):
        bus.publish(sender, topic, text(bus, data), 0.0)
    for now in (0.1, 0.2, 0.3):
        client.flush(now)
    assert [frame["msg"]["data"] for frame in frames(box)] == ["a", "b"]
    assert bus.guard.num_faults == len(tracebacks(caplog)) == 1


# Listeners


def test_failing_subscriber_is_disconnected_and_the_sender_is_not_notified() -> None:
    bus = make_bus()
    sender, first, bad, last = ServerComponent(bus), FailingClient(bus), FailingClient(bus), FailingClient(bus)
    topic = bus.advertise(sender, "/t", STRING)
    bus.subscribe(first, "/t", first.hear)
    bus.subscribe(bad, "/t", break_down)
    bus.subscribe(last, "/t", last.hear)
    for data in ("x", "y"):
        bus.publish(sender, topic, text(bus, data), 0.0)
    assert first.heard == last.heard == ["x", "y"]
    assert [type(error) for error in bad.failures] == [Fault]
    assert not bus.holdings(bad).subscriptions
    assert bus.guard.num_faults == 1


def test_subscriber_that_fails_on_its_own_message_is_disconnected() -> None:
    bus = make_bus()
    (client, box), other = make_client(bus), FailingClient(bus)
    say(client, "subscribe", topic="/t", type=STRING)
    bus.subscribe(other, "/t", other.hear)
    client.topics._subscriptions["/t"].feed._head = 5  # type: ignore[assignment] # as good a bug as any
    say(client, "publish", topic="/t", msg={"data": "x"})
    assert other.heard == ["x"]
    assert client not in bus.owners()
    assert not box.take(2**30)
    assert bus.guard.num_faults == 1


def test_thousand_failing_subscribers_end_and_the_others_still_receive() -> None:
    bus = make_bus()
    sender, last = ServerComponent(bus), FailingClient(bus)
    topic = bus.advertise(sender, "/t", STRING)
    guests = [FailingClient(bus) for _ in range(1_000)]
    for guest in guests:
        bus.subscribe(guest, "/t", break_down)
    bus.subscribe(last, "/t", last.hear)
    bus.publish(sender, topic, text(bus, "x"), 0.0)
    assert all(len(guest.failures) == 1 for guest in guests)
    assert last.heard == ["x"]
    assert len(topic.subscriptions) == 1
    assert bus.guard.num_faults == 1_000


def test_failure_of_a_component_is_raised_after_all_have_received(caplog: pytest.LogCaptureFixture) -> None:
    bus = make_bus()
    sender, part, last = FailingClient(bus), ServerComponent(bus), FailingClient(bus)
    topic = bus.advertise(sender, "/t", STRING)

    def complain(*_: object) -> NoReturn:
        raise FieldError("not like this")

    for deliver in (complain, break_down, break_down):
        bus.subscribe(part, "/t", deliver)
    bus.subscribe(last, "/t", last.hear)
    with pytest.raises(Fault):
        bus.publish(sender, topic, text(bus, "x"), 0.0)
    assert last.heard == ["x"]
    assert len(bus.holdings(part).subscriptions) == 3
    assert [line[:39] for line in tracebacks(caplog)] == ["another listener of the same message ha"]  # of the two


def test_failing_subscriber_does_not_disturb_announcements_of_the_server(
    caplog: pytest.LogCaptureFixture,
) -> None:
    bus = make_bus()
    sender, part, (client, _) = ServerComponent(bus), ServerComponent(bus), make_client(bus)
    topic = bus.advertise(sender, "/t", STRING)
    say(client, "subscribe", topic="/t")
    for _ in range(50):
        bus.announce(sender, topic, text(bus, object()), 0.0)
    assert len(caplog.records) == len(tracebacks(caplog)) == 1
    bus.subscribe(part, "/t", break_down)
    bus.announce(sender, topic, text(bus, "x"), 0.0)
    assert tracebacks(caplog)[1][:29] == "a listener of /t has failed; "
    assert bus.guard.num_faults == 51


def test_failing_disconnect_is_logged_with_its_cause(caplog: pytest.LogCaptureFixture) -> None:
    bus = make_bus()
    sender, bad, last = FailingClient(bus), FailingAtEnd(bus), FailingClient(bus)
    topic = bus.advertise(sender, "/t", STRING)
    bus.subscribe(bad, "/t", break_down)
    bus.subscribe(last, "/t", last.hear)
    bus.publish(sender, topic, text(bus, "x"), 0.0)
    assert last.heard == ["x"]
    assert bus.guard.num_faults == 2
    (record,) = [record for record in caplog.records if record.exc_info]
    assert record.exc_info is not None
    error = record.exc_info[1]
    assert isinstance(error, ValueError)
    assert isinstance(error.__context__, Fault)


@pytest.mark.parametrize("hook", ["on_topic", "on_holdings", "on_leave"])
def test_failing_hook_does_not_stop_later_work(hook: str, caplog: pytest.LogCaptureFixture) -> None:
    bus, seen = make_bus(), list[object]()
    hooks = getattr(bus, hook)
    hooks += [break_down, lambda *about: seen.append(about[0])]
    guest = FailingClient(bus)
    topic = bus.advertise(guest, "/t", STRING)
    bus.leave(guest, 0.0)
    assert not topic.publishers
    assert seen
    assert bus.guard.num_faults == len(tracebacks(caplog)) == len(seen)


# Calls


def call(bus: Bus, caller: ServerComponent, name: str = "/s", timeout: float | None = None) -> None:
    bus.call(caller, name, {"data": True}, caller.answers.append, now=0.0, timeout=timeout)


def test_failing_provider_is_disconnected_and_its_caller_answered() -> None:
    bus = make_bus()
    provider, caller = FailingClient(bus), FailingClient(bus)
    bus.provide(provider, "/s", SERVICE, break_down)
    call(bus, caller)
    assert [(answer.is_ok, answer.values) for answer in caller.answers] == [
        (False, "The provider failed; the server's log says why")
    ]
    assert (len(provider.failures), caller.failures) == (1, [])
    assert "/s" not in bus.services


def test_provider_that_fails_on_its_own_call_is_disconnected_once() -> None:
    bus = make_bus()
    guest = FailingClient(bus)
    bus.provide(guest, "/s", SERVICE, break_down)
    call(bus, guest)
    assert len(guest.failures) == len(guest.answers) == 1
    assert guest not in bus.owners()


def test_component_that_fails_on_a_call_answers_it_and_stays() -> None:
    bus = make_bus()
    bus.provide(ServerComponent(bus), "/s", SERVICE, break_down)
    client, box = make_client(bus)
    with pytest.raises(Fault):  # the server logs and counts it, as any frame that it cannot handle
        say(client, "call_service", service="/s", id="c", args={"data": True})
    (answer,) = frames(box)
    assert (answer["result"], answer["values"]) == (False, "The provider failed; the server's log says why")
    assert "/s" in bus.services


def test_unencodable_answer_becomes_a_refusal(caplog: pytest.LogCaptureFixture) -> None:
    bus = make_bus()
    provider, (client, box) = FailingClient(bus), make_client(bus)

    def answer(call: Call, _now: float) -> None:
        call.answer(call.service.type.response.struct_type(True, object()))  # noqa: FBT003 - the message's fields

    bus.provide(provider, "/s", SERVICE, answer)
    say(client, "call_service", service="/s", id="c", args={"data": True})
    (refusal,) = frames(box)
    assert (refusal["id"], refusal["result"]) == ("c", False)
    assert "cannot be written as JSON" in refusal["values"]
    assert provider.told[0][1].startswith("/s: std_srvs/SetBool")
    assert (provider.failures, client in bus.owners(), bus.guard.num_faults) == ([], True, 1)
    assert len(tracebacks(caplog)) == 1


def test_unencodable_request_is_refused(caplog: pytest.LogCaptureFixture) -> None:
    bus = make_bus()
    (provider, _), caller = make_client(bus), FailingClient(bus)
    say(provider, "advertise_service", service="/s", type=SERVICE)
    handle = bus.services["/s"].handle

    def spoil(call: Call, now: float) -> None:
        call.request = call.service.type.request.struct_type(data=object())
        handle(call, now)

    bus.services["/s"].handle = spoil
    call(bus, caller)
    assert "cannot be written as JSON" in str(caller.answers[0].values)
    assert provider in bus.owners()
    assert bus.guard.num_faults == len(tracebacks(caplog)) == 1


def test_caller_whose_answers_cannot_be_encoded_is_disconnected() -> None:
    bus = make_bus()
    provider, caller = FailingClient(bus), FailingClient(bus)

    def write_nothing(_answer: Answer) -> NoReturn:
        raise EncodingError("never")

    bus.provide(provider, "/s", SERVICE, lambda call, _now: call.answer(call.service.type.response.default()))
    bus.call(caller, "/s", {"data": True}, write_nothing, now=0.0)
    assert (len(caller.failures), provider.failures) == (1, [])


def test_caller_that_fails_on_its_answer_is_disconnected_and_the_provider_not_notified() -> None:
    bus = make_bus()
    (provider, box), caller, other = make_client(bus), FailingClient(bus), FailingClient(bus)
    say(provider, "advertise_service", service="/s", type=SERVICE)
    bus.call(caller, "/s", {"data": True}, break_down, now=0.0)
    call(bus, other)
    for request in frames(box):
        say(provider, "service_response", service="/s", id=request["id"], result=True, values={"success": True})
    assert (len(caller.failures), len(other.answers)) == (1, 1)
    assert not frames(box)
    assert bus.guard.num_faults == 1


@pytest.mark.parametrize("kind", [FailingClient, ServerComponent])
def test_caller_that_fails_on_a_time_out_does_not_block_other_time_outs(
    kind: Callable[[Bus], ServerComponent], caplog: pytest.LogCaptureFixture
) -> None:
    bus = make_bus()
    provider, bad, good = FailingClient(bus), kind(bus), FailingClient(bus)
    bus.provide(provider, "/s", SERVICE, lambda _call, _now: None)
    bus.call(bad, "/s", {"data": True}, break_down, now=0.0, timeout=1.0)
    call(bus, good, timeout=1.0)
    bus.expire(1.0)
    assert len(good.answers) == 1
    assert bus.next_deadline() is None
    assert bus.guard.num_faults == 1
    assert len(tracebacks(caplog)) == (kind is ServerComponent)


def test_all_calls_of_a_leaving_provider_end_although_callers_fail() -> None:
    bus = make_bus()
    provider, bad, good = FailingClient(bus), ServerComponent(bus), FailingClient(bus)
    for name in ("/s", "/s2"):
        bus.provide(provider, name, SERVICE, lambda _call, _now: None)
        bus.call(bad, name, {"data": True}, break_down, now=0.0)
        call(bus, good, name)
    bus.leave(provider, 0.0)
    assert [answer.is_ok for answer in good.answers] == [False, False]
    assert not bus.services
    assert provider not in bus.owners()


# Goals


def test_goal_of_a_failing_provider_ends() -> None:
    bus = make_bus()
    provider, caller = FailingClient(bus), FailingClient(bus)
    bus.actions.provide(provider, "/a", ACTION, break_down, break_down)
    assert bus.actions.send(caller, "/a", {"order": 3}, caller.outcomes.append, None) is None
    assert [outcome.values for outcome in caller.outcomes] == ["The provider failed; the server's log says why"]
    assert len(provider.failures) == 1
    assert "/a" not in bus.actions.by_name


def test_unencodable_feedback_and_results_disconnect_no_client(caplog: pytest.LogCaptureFixture) -> None:
    bus, goals = make_bus(), list[Goal]()
    provider, (client, box) = FailingClient(bus), make_client(bus)
    bus.actions.provide(provider, "/a", ACTION, goals.append, break_down)
    say(client, "send_action_goal", action="/a", action_type=ACTION, id="g", args={"order": 3}, feedback=True)
    kind = goals[0].action.type
    goals[0].report(kind.feedback.struct_type(object()), 0.0)
    goals[0].report(kind.feedback.struct_type([1]), 0.0)
    goals[0].end(GoalStatus.SUCCEEDED, kind.result.struct_type(object()))
    feedback, end = frames(box)
    assert feedback["values"] == {"sequence": [1]}
    assert (end["result"], end["status"], "cannot be written" in end["values"]) == (False, 0, True)
    assert [level for level, _ in provider.told] == ["error", "error"]
    assert provider.failures == []
    assert bus.guard.num_faults == len(tracebacks(caplog)) == 2


def test_caller_that_fails_on_feedback_is_disconnected_and_its_goal_cancelled() -> None:
    bus, goals, cancelled = make_bus(), list[Goal](), list[Goal]()
    provider, caller = FailingClient(bus), FailingClient(bus)
    bus.actions.provide(provider, "/a", ACTION, goals.append, cancelled.append)
    bus.actions.send(caller, "/a", {"order": 3}, caller.outcomes.append, break_down)
    goals[0].report(goals[0].action.type.feedback.default(), 0.0)
    assert (len(caller.failures), caller.outcomes, provider.failures) == (1, [], [])
    assert cancelled == goals


@pytest.mark.parametrize("kind", [FailingClient, ServerComponent])
def test_provider_that_fails_to_cancel_does_not_block_other_goals(kind: Callable[[Bus], ServerComponent]) -> None:
    bus, cancelled = make_bus(), list[Goal]()
    bad, good, caller = kind(bus), FailingClient(bus), FailingClient(bus)
    bus.actions.provide(bad, "/bad", ACTION, lambda _goal: None, break_down)
    bus.actions.provide(good, "/good", ACTION, lambda _goal: None, cancelled.append)
    bus.actions.provide(caller, "/own", ACTION, lambda _goal: None, break_down)
    for name in ("/bad", "/good"):
        bus.actions.send(caller, name, {"order": 3}, caller.outcomes.append, None)
    bus.leave(caller, 0.0)
    assert len(cancelled) == 1
    assert "/own" not in bus.actions.by_name
    assert bus.guard.num_faults == 1


def test_failing_goals_and_calls_do_not_block_others_from_ending() -> None:
    bus, cancelled, goals = make_bus(), list[Goal](), list[Goal]()
    provider, caller = FailingClient(bus), FailingClient(bus)
    bus.actions.provide(provider, "/a", ACTION, goals.append, cancelled.append)
    bus.provide(provider, "/s", SERVICE, lambda _call, _now: None)
    for _ in range(2):
        bus.actions.send(caller, "/a", {"order": 3}, caller.outcomes.append, None)
        call(bus, caller, timeout=1.0)
    goals[0].action = None  # type: ignore[assignment] # as good a bug as any
    next(iter(bus.services["/s"].calls)).service = None  # type: ignore[assignment] # as above
    bus.expire(1.0)
    assert len(caller.answers) == 1
    bus.leave(caller, 0.0)
    assert cancelled == goals[1:]
    assert caller not in bus.owners()


def test_component_that_fails_to_cancel_a_goal_does_not_disconnect_the_caller(caplog: pytest.LogCaptureFixture) -> None:
    bus = make_bus()
    bus.actions.provide(ServerComponent(bus), "/a", ACTION, lambda _goal: None, break_down)
    client, box = make_client(bus)
    say(client, "send_action_goal", action="/a", action_type=ACTION, id="g", args={"order": 3})
    say(client, "cancel_action_goal", action="/a", id="g")
    assert frames(box) == []
    assert bus.guard.num_faults == len(tracebacks(caplog)) == 1


def test_caller_that_fails_on_a_goals_end_does_not_block_other_goals() -> None:
    bus = make_bus()
    provider, bad, good = FailingClient(bus), ServerComponent(bus), FailingClient(bus)
    for name in ("/a", "/a2"):
        bus.actions.provide(provider, name, ACTION, lambda _goal: None, break_down)
        bus.actions.send(bad, name, {"order": 3}, break_down, None)
        bus.actions.send(good, name, {"order": 3}, good.outcomes.append, None)
    bus.leave(provider, 0.0)
    assert len(good.outcomes) == 2
    assert not bus.actions.by_name


# Clients


def test_client_that_fails_while_leaving_is_removed_from_the_bus() -> None:
    bus = make_bus()
    (client, _), caller = make_client(bus), FailingClient(bus)
    say(client, "subscribe", topic="/t", type=STRING)
    say(client, "advertise", topic="/u", type=STRING)
    say(client, "advertise_service", service="/s", type=SERVICE)
    call(bus, caller)
    client.topics._subscriptions = None  # type: ignore[assignment] # as good a bug as any
    with pytest.raises(AttributeError):
        client.leave(0.0)
    assert client not in bus.owners()
    assert not bus.services
    assert not bus.topics["/t"].subscriptions
    assert len(caller.answers) == 1


@pytest.mark.parametrize("seam", ["tell", "notifier", "release"])
def test_client_that_fails_on_a_status_or_a_release_is_disconnected_alone(seam: str) -> None:
    bus = make_bus()
    client, _ = make_client(bus)
    say(client, "subscribe", topic="/t", type=STRING)
    release = client.hold()
    client.on_released = break_down
    client.session.level = None  # type: ignore[assignment] # as good a bug as any
    if seam == "release":
        release()
    else:
        (client.notify if seam == "tell" else client.notifier())("error", "x")
    assert client not in bus.owners()
    assert bus.guard.num_faults == 1


# Parts that listen


def test_republisher_failure_on_a_message_affects_only_its_sender() -> None:
    bus = make_bus()
    republisher = WebRepublisher(bus)
    client, _ = make_client(bus)
    republisher._frames = None  # type: ignore[assignment] # as good a bug as any
    transform = {"header": {"frame_id": "map"}, "child_frame_id": "car"}
    with pytest.raises(AttributeError):
        say(client, "publish", topic="/tf", type="tf2_msgs/TFMessage", msg={"transforms": [transform]})
    assert "/republish_tfs" in bus.services
    assert bus.find_topic("/tf") is not None
    assert any(subscription.owner is republisher for subscription in bus.topics["/tf"].subscriptions)


def have_listed(mirror: Mirror) -> None:
    """Have the bridge list all topics of ours, so that they are published there."""
    for item in list(mirror._registry.items.values()):
        if item.kind == "topic":
            mirror._announcer._confirm(item)


def test_bridge_gets_all_latched_messages_except_the_unencodable_one(caplog: pytest.LogCaptureFixture) -> None:
    bus = make_bus()
    source = ServerComponent(bus)
    topic = bus.advertise(source, "/plate", STRING, depth=2)
    bus.advertise(source, "/state", STRING)
    for data in (object(), "12 GA 3456"):
        bus.publish(source, topic, text(bus, data), 0.0)
    mirror = Mirror(bus, source, "ws://far")
    (connection,) = mirror.connections.values()
    mirror.connected(connection, lambda: None, lambda: None, 0.0)
    have_listed(mirror)
    said = [json.loads(frame) for frame in connection.outbox.take(2**30)]
    assert [frame["topic"] for frame in said if frame["op"] == "advertise"] == ["/plate", "/state"]
    assert [frame["msg"]["data"] for frame in said if frame["op"] == "publish"] == ["12 GA 3456"]
    assert bus.guard.num_faults == len(tracebacks(caplog)) == 1


def test_failure_of_a_bridge_is_reported_to_its_connection_keeper() -> None:
    bus, failures = make_bus(), list[Exception]()
    source, last = ServerComponent(bus), FailingClient(bus)
    topic = bus.advertise(source, "/state", STRING)
    mirror = Mirror(bus, source, "ws://far")
    mirror.on_failure = failures.append
    (connection,) = mirror.connections.values()
    mirror.connected(connection, lambda: None, lambda: None, 0.0)
    have_listed(mirror)
    connection.has_services = True
    bus.subscribe(last, "/state", last.hear)
    connection.fresh = None  # type: ignore[assignment] # as good a bug as any
    bus.publish(source, topic, text(bus, "x"), 0.0)
    assert (len(failures), last.heard) == (1, ["x"])
    release = mirror.hold()
    connection.on_released = break_down
    release()
    assert len(failures) == bus.guard.num_faults == 2


def test_encoding_failure_is_logged_with_a_traceback_once_per_topic(
    caplog: pytest.LogCaptureFixture,
) -> None:
    caplog.set_level(logging.ERROR, "rosbridge_sim.graph")
    bus = make_bus()
    error = EncodingError("no")
    for where in ("/a", "/b", "/a", "/b", "/a"):
        bus.guard.note_encoding(where, error)
    assert tracebacks(caplog) == ["/a: a message is dropped: no", "/b: a message is dropped: no"]
    assert bus.guard.num_faults == 5


def test_encoding_failures_are_all_counted_and_each_is_logged_once_up_to_a_thousand(
    caplog: pytest.LogCaptureFixture,
) -> None:
    guard = Guard()
    for _ in range(2):
        for i in range(1_003):
            guard.note_encoding(f"/t{i}", EncodingError("no"))
    assert guard.num_faults == 2_006
    assert [record.getMessage().partition(":")[0] for record in caplog.records] == [f"/t{i}" for i in range(1_000)]


def test_owner_that_cannot_end_alone_has_its_own_failure_raised() -> None:
    guard, fault = Guard(), Fault()
    with pytest.raises(Fault) as raised:
        guard.blame(object(), fault)
    assert raised.value is fault
    assert guard.num_faults == 0


def test_owner_that_ends_by_raising_the_same_failure_is_not_counted_twice() -> None:
    class Reraising:
        def fail(self, error: Exception) -> None:
            raise error

    guard, fault = Guard(), Fault()
    with pytest.raises(Fault):
        guard.blame(Reraising(), fault)
    assert guard.num_faults == 0
