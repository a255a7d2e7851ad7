"""Services of one client: the calls that it makes and the services that it provides.

If a provider leaves, its calls fail at once. rosbridge_suite ignores the `result` in a provider's answer, and many
providers send a wrong one or none. So an object with a field of the response counts as a success whatever `result`
says, and the provider gets a warning. Any other answer without `result: true` is a failure. (rosbridge_suite turns that
into success, or never answers.)
"""

from __future__ import annotations

import re

import msgspec
import orjson

from rosbridge_sim.errors import GraphError, PeerError, Reason
from rosbridge_sim.graph.participant import decode_body, resolve
from rosbridge_sim.graph.peers.peer_base import CheckRoom, PeerBase, needed_type, split_id
from rosbridge_sim.graph.peers.pending_work import Offers, PendingWork
from rosbridge_sim.graph.topics_services import Answer, Call
from rosbridge_sim.protocol import ops
from rosbridge_sim.protocol.json_encoding import call_head
from rosbridge_sim.protocol.ops import is_absent
from rosbridge_sim.schema.message import Message

_EMPTY = re.compile(rb"\{\s*+\}")
"""JSON text of an object without fields."""


class PeerServices(Offers[Call]):
    """The services of one client."""

    def __init__(self, peer: PeerBase, check_room: CheckRoom) -> None:
        super().__init__(peer, check_room, Call.refuse)
        self._bus = peer.bus
        self._session = peer.session
        self._policy = peer.policy

    def call(self, op: ops.CallService, now: float) -> None:
        """Call a service; a mistake becomes the answer."""
        service, op_id = (op.service, op.id) if op.id is not None else split_id(op)
        if not self._policy.is_open:
            try:
                self._policy.check_call(service)
            except GraphError as error:
                self._peer.refuse(op, str(error), error.reason)
                return

        def on_answer(answer: Answer) -> None:
            values = answer.values
            if answer.reason is not None:
                values = f"{values}{self._peer.suggest(answer.reason, op)}"
                self._peer.note(answer.reason, values, op)
            self._session.answer(op.service, op_id, values, is_ok=answer.is_ok, fragment_size=op.fragment_size)

        self._bus.call(self._peer, service, op.args, on_answer, now=now, timeout=op.timeout)

    def advertise(self, op: ops.AdvertiseService, _now: float) -> None:
        """Offer a service."""
        self._policy.check_offer(op.service)
        self._check_room(None)
        provided = PendingWork[Call]("service_request", op.service)
        name = resolve(op.service)
        head = call_head(op.service)

        def handle(call: Call, _now: float) -> None:
            limit = self._bus.max_calls
            provided.tidy()
            if len(call.service.calls) > limit:  # including this one
                text = f"Service {name} has {limit} calls waiting already"
                raise GraphError(text, reason=Reason.TOO_MUCH)
            call_id = provided.add(call)
            args = Message(call.service.type.request, call.request)
            self._session.outbox.send(b"".join((head, orjson.dumps(call_id), b',"args":', args.json, b"}")))

        service = self._bus.provide(self._peer, op.service, needed_type(op), handle)
        self._provided[service.name] = provided

    def unadvertise(self, op: ops.UnadvertiseService, _now: float) -> None:
        """Stop offering a service."""
        self._bus.withdraw(self._peer, op.service)
        self._provided.pop(resolve(op.service), None)

    def respond(self, op: ops.ServiceResponse, _now: float) -> None:
        """Take the answer to a call of which this client is the provider."""
        name = op.service
        provided = self._provided.get(name)
        if provided is None:
            name = resolve(name)
            provided = self._provided.get(name)
        if provided is None:
            text = f"Service {op.service} has not been advertised via rosbridge."
            raise GraphError(text, reason=Reason.NOT_ADVERTISED)
        call = provided.pop(op.id)
        if call is None:
            text = f"No call of {op.service} with this id waits for an answer"
            self._session.remark("warning", text, op.id)
            self._peer.note(Reason.STRAY_ANSWER, text, op)
            return
        if call.is_done:  # timed out, or the caller has left
            return
        if not op.result and (op.reason is not None or not _is_filled_object(op.values)):
            call.refuse(_read_refusal(op.values, name) if op.reason is None else op.reason)
            if op.result is None and op.reason is None and not _says_anything(op.values):
                # roslib sends this if the provider's function does not return true
                text = f"{name}: the answer has neither a result nor values, so its call has failed."
                text += ' Send "result": true (with roslib, return true)'
                self._session.remark("warning", text, op.id)
                self._peer.note(Reason.BAD_OP, text, op)
            return
        try:
            values = decode_body(call.service.type.response, op.values, self._bus.stamp_ns)
        except PeerError as error:
            if op.result is False:  # the provider's own object with the reason
                call.refuse(_read_refusal(op.values, name))
                return
            call.refuse(str(error))
            raise
        call.answer(values)
        if not op.result:
            said = "no result" if op.result is None else "result false"
            text = f'{name}: the answer has {said}; its values were passed on. Send "result": true'
            self._session.remark("warning", text, op.id)


def _is_empty_object(body: ops.OpBody) -> bool:
    if isinstance(body, (bytes, msgspec.Raw)):
        return _EMPTY.match(memoryview(body)) is not None
    return isinstance(body, dict) and not body


def _is_filled_object(body: ops.OpBody) -> bool:
    """Return True if a body is an object with at least one field. The body may be invalid JSON."""
    if isinstance(body, (bytes, msgspec.Raw)):
        return bytes(memoryview(body)[:1]) == b"{" and not _is_empty_object(body)
    return isinstance(body, dict) and bool(body)


def _says_anything(body: ops.OpBody) -> bool:
    """Return True if a body is present and not an empty object."""
    return not is_absent(body) and not _is_empty_object(body)


def _read_refusal(values: ops.OpBody, service: str) -> object:
    """Return the provider's reason, any JSON value; a text of the server if there is none."""
    if not _says_anything(values):
        return f"Service {service} failed; its provider gave no reason"
    try:
        reason: object = orjson.loads(bytes(values)) if isinstance(values, (bytes, msgspec.Raw)) else values
        orjson.dumps(reason)
    except orjson.JSONDecodeError:
        return "The provider failed, with a reason that is not valid JSON"
    except orjson.JSONEncodeError:  # too deep to be written again
        return "The provider failed, with a reason that is nested too deeply"
    return reason
