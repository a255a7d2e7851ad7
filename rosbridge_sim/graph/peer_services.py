"""Services of one client: the calls that it makes, and the services that it provides.

A lost provider fails its calls at once. rosbridge_suite ignores the `result` of a provider's answer, and many
providers send it wrong or not at all. So an object with a field of the response is an answer whatever `result` says,
with a warning to the provider; anything else without `result: true` is a failure (rosbridge_suite turns that into
success, too, or never answers).
"""

from __future__ import annotations

import re

import msgspec
import orjson

from rosbridge_sim.errors import FrameError, GraphError, PeerError, Reason
from rosbridge_sim.graph.participant import decode_body, resolve
from rosbridge_sim.graph.peer_base import CheckRoom, PeerBase, split_id
from rosbridge_sim.graph.pending_work import PendingWork, find_awaited
from rosbridge_sim.graph.topics_services import Answer, Call
from rosbridge_sim.protocol import ops
from rosbridge_sim.protocol.codec import is_absent
from rosbridge_sim.schema.message import Message

__all__ = ["PeerServices"]

_EMPTY = re.compile(rb"\{\s*+\}")
"""JSON text of an object without fields."""


class PeerServices:
    """The services of one client."""

    def __init__(self, peer: PeerBase, check_room: CheckRoom) -> None:
        """No services yet.

        Args:
            peer: the client.
            check_room: called before it offers one more.
        """
        self._peer = peer
        self._check_room = check_room
        self._provided: dict[str, PendingWork[Call]] = {}

    @property
    def num_held(self) -> int:
        """Services that it provides."""
        return len(self._provided)

    def call(self, op: ops.CallService, now: float) -> None:
        """Call a service; a mistake is the answer."""
        service, op_id = split_id(op)
        try:
            self._peer.policy.check_call(service)
        except GraphError as error:
            self._peer.refuse(op, str(error), error.reason)
            return

        def on_answer(answer: Answer) -> None:
            values = answer.values
            if answer.reason is not None:
                values = f"{values}{self._peer.suggest(answer.reason, op)}"
                self._peer.note(answer.reason, values, op)
            self._peer.session.answer(op.service, op_id, values, is_ok=answer.is_ok, fragment_size=op.fragment_size)

        self._peer.bus.call(self._peer, service, op.args, on_answer, now=now, timeout=op.timeout)

    def advertise(self, op: ops.AdvertiseService, _now: float) -> None:
        """Offer a service."""
        self._peer.policy.check_offer(op.service)
        self._check_room(None)
        provided = PendingWork[Call]("service_request", op.service)
        name = resolve(op.service)

        def handle(call: Call, _now: float) -> None:
            limit = self._peer.bus.max_calls
            provided.tidy()
            if len(call.service.calls) > limit:  # this one is among them
                text = f"Service {name} has {limit} calls waiting already"
                raise GraphError(text, reason=Reason.TOO_MUCH)
            call_id = provided.add(call)
            args = Message(call.service.type.request, call.request)
            self._peer.session.say("call_service", {"args": args}, service=provided.spelling, id=call_id)

        service = self._peer.bus.provide(self._peer, op.service, op.type, handle)
        self._provided[service.name] = provided

    def unadvertise(self, op: ops.UnadvertiseService, _now: float) -> None:
        """Stop offering it."""
        self._peer.bus.withdraw(self._peer, op.service)
        self._provided.pop(resolve(op.service), None)

    def respond(self, op: ops.ServiceResponse, _now: float) -> None:
        """Take the answer to a call that this client was given as a provider."""
        name = resolve(op.service)
        provided = self._provided.get(name)
        if provided is None:
            text = f"Service {op.service} has not been advertised via rosbridge."
            raise GraphError(text, reason=Reason.NOT_ADVERTISED)
        call = provided.pop(op.id)
        if call is None:
            text = f"Nobody waits for an answer of {op.service} with this id"
            self._peer.session.remark("warning", text, op.id)
            self._peer.note(Reason.STRAY_ANSWER, text, op)
            return
        if call.is_done:  # timed out, or the caller has left
            return
        if not op.result and (op.reason is not None or not _is_filled_object(op.values)):
            call.refuse(_read_refusal(op.values, name) if op.reason is None else op.reason)
            if op.result is None and op.reason is None and not _says_anything(op.values):
                # what roslib sends for a provider whose function forgets to return true
                text = f"{name}: the answer has neither a result nor values, so its call has failed."
                text += ' Send "result": true (with roslib, return true)'
                self._peer.session.remark("warning", text, op.id)
                self._peer.note(Reason.BAD_OP, text, op)
            return
        try:
            values = decode_body(call.service.type.response, op.values, self._peer.bus.stamp_ns)
        except PeerError as error:
            if op.result is False:  # an object of the provider's own that says why not
                call.refuse(_read_refusal(op.values, name))
                return
            call.refuse(str(error))
            raise
        call.answer(values)
        if not op.result:
            said = "no result" if op.result is None else "result false"
            text = f'{name}: the answer has {said}; its values were passed on. Send "result": true'
            self._peer.session.remark("warning", text, op.id)

    def fail_unreadable(self, error: FrameError, why: str) -> None:
        """Fail the call whose answer cannot be read: its caller would wait for ever.

        Where the frame has no id of ours left in it, it is clear whose answer it is only if one alone is awaited.

        Args:
            error: what is wrong with the frame.
            why: for the caller.
        """
        call = find_awaited(self._provided, error.op_id)
        if call is not None:
            call.refuse(why)

    def lose(self, name: str) -> None:
        """Strike a service, by absolute name, that another owner takes."""
        self._provided.pop(name, None)

    def forget(self) -> None:
        """Forget all of them; the bus forgets its part by itself."""
        self._provided.clear()


def _is_empty_object(body: ops.OpBody) -> bool:
    if isinstance(body, (bytes, msgspec.Raw)):
        return _EMPTY.match(memoryview(body)) is not None
    return isinstance(body, dict) and not body


def _is_filled_object(body: ops.OpBody) -> bool:
    """Return whether a body is an object with anything in it. It may be no JSON at all."""
    if isinstance(body, (bytes, msgspec.Raw)):
        return bytes(memoryview(body)[:1]) == b"{" and not _is_empty_object(body)
    return isinstance(body, dict) and bool(body)


def _says_anything(body: ops.OpBody) -> bool:
    """Return whether a body is there and is no empty object."""
    return not is_absent(body) and not _is_empty_object(body)


def _read_refusal(values: ops.OpBody, service: str) -> object:
    """The reason that a provider gave: any JSON value; a text of ours where it gave none."""
    if not _says_anything(values):
        return f"Service {service} failed; its provider gave no reason"
    try:
        reason: object = orjson.loads(bytes(values)) if isinstance(values, (bytes, msgspec.Raw)) else values
        orjson.dumps(reason)
    except orjson.JSONDecodeError:
        return "The provider failed, with a reason that is not valid JSON"
    except orjson.JSONEncodeError:  # deeper than can be written again
        return "The provider failed, with a reason that is nested too deeply"
    return reason
