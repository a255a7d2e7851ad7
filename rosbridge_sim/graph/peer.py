"""What one client's ops mean on the bus, in that client's name.

A `Peer` joins a session (one wire) to the bus (all who talk). It keeps what the wire knows and the bus does
not: the client's own spelling of each topic, its several subscriptions to one topic, the ids under which calls
went out to it as a provider. A mistake gives one remark to this client, or a refusal to its call, and leaves
everything as it was.

Where rosbridge_suite and the protocol's text differ, we take: one message for each spelling of a topic,
whatever the number of subscription ids; latched messages once for each new id; `result: false` of a provider
is passed on (rosbridge_suite turns it into success); a lost provider fails its calls at once.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import orjson

from rosbridge_sim.errors import GraphError, PeerError
from rosbridge_sim.graph.bus import MAX_CALLS, Answer, Bus, Call, Owner, Subscription, Topic, decode_body, resolve
from rosbridge_sim.protocol import ops
from rosbridge_sim.protocol.codec import is_absent, publish_head
from rosbridge_sim.protocol.session import Session
from rosbridge_sim.schema.store import Message

__all__ = ["NODE_NAME", "Peer"]

NODE_NAME = "/rosbridge_websocket"
"""All clients are one ROS node, as behind rosbridge_suite; Lichtblick looks for it."""

_IMPLICIT = object()
"""The key of the advertisement that a bare publish makes; no client can spell it."""

MAX_HELD = 10_000
"""Advertisements, subscriptions and services that one client may hold: far beyond any program, far below memory."""

_log = logging.getLogger("rosbridge_sim.graph")


class _Feed:
    """One spelling of a topic that a client listens to, with all its subscription ids."""

    __slots__ = ("head", "ids", "session", "spelling", "subscription")

    def __init__(self, session: Session, spelling: str) -> None:
        self.session = session
        self.spelling = spelling
        self.head = publish_head(spelling)
        self.ids: dict[ops.Id, None] = {}
        self.subscription: Subscription | None = None

    def deliver(self, _topic: Topic, message: Message, _sender: Owner, _now: float) -> None:
        self.session.message(self.spelling, self.head, message)


@dataclass(slots=True)
class _Provision:
    """One service that a client provides, and the calls that wait for its answer."""

    name: str
    spelling: str
    num_calls: int = 0
    calls: dict[str, Call] = field(default_factory=dict)


class Peer:
    """One client on the bus.

    Attributes:
        session: its wire.
        address: where it comes from, for people to read.
        num_errors: mistakes it was told of.
    """

    name = NODE_NAME

    def __init__(self, bus: Bus, session: Session, address: str = "") -> None:
        self.session = session
        self.address = address
        self.num_errors = 0
        self._bus = bus
        self._publications: dict[str, Topic] = {}
        self._feeds: dict[str, _Feed] = {}
        self._provisions: dict[str, _Provision] = {}
        self._act: dict[type, Callable[[Any, float], None]] = {
            ops.Publish: self._publish,
            ops.CallService: self._call,
            ops.ServiceResponse: self._respond,
            ops.Subscribe: self._subscribe,
            ops.Unsubscribe: self._unsubscribe,
            ops.Advertise: self._advertise,
            ops.Unadvertise: self._unadvertise,
            ops.AdvertiseService: self._advertise_service,
            ops.UnadvertiseService: self._unadvertise_service,
            ops.SetLevel: self._set_level,
            ops.Status: self._status,
            ops.Auth: self._auth,
        }

    def receive(self, frame: bytes, now: float) -> None:
        """Do all that a frame asks, to its end: our transaction."""
        for op in self.session.receive(frame):
            self.do(op, now)

    def do(self, op: ops.Op, now: float) -> None:
        """Do one op; a mistake in it is told to the client."""
        try:
            self._act[type(op)](op, now)
        except PeerError as error:
            self.num_errors += 1
            self.session.remark("error", str(error), op.id)

    def tell(self, level: str, text: str) -> None:
        """Remark something that answers no request."""
        self.session.remark(level, text)

    def leave(self, now: float) -> None:
        """Take everything of this client's off the bus; twice is no error."""
        self._publications.clear()
        self._feeds.clear()
        self._provisions.clear()
        self._bus.leave(self, now)

    # Topics

    def _advertise(self, op: ops.Advertise, _now: float) -> None:
        self._check_room()
        topic = self._bus.advertise(self, op.topic, op.type, latch=bool(op.latch), key=op.id)
        self._publications[op.topic] = topic

    def _unadvertise(self, op: ops.Unadvertise, now: float) -> None:
        self._bus.unadvertise(self, op.topic, now, key=op.id)
        self._publications = {s: t for s, t in self._publications.items() if self in t.publishers}

    def _publish(self, op: ops.Publish, now: float) -> None:
        topic = self._publications.get(op.topic)
        if topic is None:
            topic = self._advertise_implicitly(op)
        bus = self._bus
        message_type = topic.type
        value = decode_body(message_type, op.msg, bus.stamp_ns)
        bus.publish(self, topic, Message(message_type, value), now)

    def _advertise_implicitly(self, op: ops.Publish) -> Topic:
        """A publish without an advertise is one, where the type is known or given."""
        self._check_room()
        known = self._bus.find_topic(op.topic)
        type_name = op.type or (known and known.type.name)
        if not type_name:
            raise GraphError(f"Cannot infer topic type for topic {op.topic} as it is not yet advertised")
        topic = self._bus.advertise(self, op.topic, type_name, latch=bool(op.latch), key=_IMPLICIT)
        self._publications[op.topic] = topic
        return topic

    def _subscribe(self, op: ops.Subscribe, _now: float) -> None:
        feed = self._feeds.get(op.topic)
        if feed is None:
            self._check_room()
            feed = _Feed(self.session, op.topic)
            feed.subscription = self._bus.subscribe(self, op.topic, feed.deliver, type_name=op.type)
            self._feeds[op.topic] = feed
        elif op.type is not None:
            self._bus.check_type(op.topic, op.type)
        is_new = op.id not in feed.ids
        feed.ids[op.id] = None
        latched = feed.subscription.topic.latched if feed.subscription else None
        if is_new and latched is not None:
            self.session.message(op.topic, feed.head, latched)

    def _unsubscribe(self, op: ops.Unsubscribe, now: float) -> None:
        feed = self._feeds.get(op.topic)
        if feed is None:
            return
        if op.id is None:
            feed.ids.clear()
        feed.ids.pop(op.id, None)
        if not feed.ids and feed.subscription is not None:
            del self._feeds[op.topic]
            self._bus.unsubscribe(feed.subscription, now)

    # Services

    def _call(self, op: ops.CallService, now: float) -> None:
        service, op_id = op.service, op.id
        if op_id is None and "#" in service:  # an old form: `service#id`
            service, _, op_id = service.partition("#")

        def on_answer(answer: Answer) -> None:
            self.session.answer(op.service, op_id, answer.values, is_ok=answer.is_ok)

        self._bus.call(self, service, op.args, on_answer, now=now, timeout=op.timeout)

    def _advertise_service(self, op: ops.AdvertiseService, _now: float) -> None:
        self._check_room()
        provision = _Provision("", op.service)

        def handle(call: Call, _now: float) -> None:
            if len(provision.calls) >= MAX_CALLS:  # what timed out or was abandoned is kept for its late answer
                provision.calls = {i: c for i, c in provision.calls.items() if not c.is_done}
                if len(provision.calls) >= MAX_CALLS:
                    raise GraphError(f"Service {provision.name} has {MAX_CALLS} calls waiting already")
            provision.num_calls += 1
            call_id = f"service_request:{provision.spelling}:{provision.num_calls}"
            provision.calls[call_id] = call
            self.session.call(provision.spelling, call_id, Message(call.service.type.request, call.request))

        service = self._bus.provide(self, op.service, op.type, handle)
        provision.name = service.name
        self._provisions[service.name] = provision

    def _unadvertise_service(self, op: ops.UnadvertiseService, _now: float) -> None:
        self._bus.withdraw(self, op.service)
        self._provisions.pop(resolve(op.service), None)

    def _respond(self, op: ops.ServiceResponse, _now: float) -> None:
        provision = self._provisions.get(resolve(op.service))
        if provision is None:
            raise GraphError(f"Service {op.service} has not been advertised via rosbridge.")
        call = provision.calls.pop(op.id, None) if isinstance(op.id, str) else None
        if call is None:
            self.session.remark("warning", f"Nobody waits for an answer of {op.service} with this id", op.id)
            return
        if call.is_done:  # timed out, or the caller has left
            return
        if not op.result:
            call.refuse(_read_refusal(op.values))
            return
        try:
            values = decode_body(call.service.type.response, op.values, self._bus.stamp_ns)
        except PeerError as error:
            call.refuse(str(error))
            raise
        call.answer(values)

    # The rest

    def _set_level(self, op: ops.SetLevel, _now: float) -> None:
        self.session.set_level(op.level)

    def _status(self, op: ops.Status, _now: float) -> None:
        _log.info("%s says: [%s] %s", self.address, op.level, op.msg)

    def _auth(self, op: ops.Auth, _now: float) -> None:
        """Nothing to check: no token is wanted here."""

    def _check_room(self) -> None:
        if len(self._publications) + len(self._feeds) + len(self._provisions) >= MAX_HELD:
            raise GraphError(f"At most {MAX_HELD} topics and services can be held by one client")


def _read_refusal(values: Any) -> object:  # noqa: ANN401 - JSON text of a stranger
    """What a provider gave as its reason: any JSON value; an empty text where it gave none."""
    if is_absent(values):
        return ""
    try:
        return orjson.loads(bytes(values))
    except orjson.JSONDecodeError:
        return "The provider failed, with a reason that is not valid JSON"
