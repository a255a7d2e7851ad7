"""A client as a participant of the bus: notices to it, records of its mistakes, and waiting for long ops.

The parts of a `Peer` (`peer_topics.py`, `peer_services.py`, `peer_actions.py`) share this class and act in the client's
name. A mistake gives a status frame to the client, or a refusal of its call, and an entry in the log and on
`/sim/refusals`.
An op may take longer than its turn, for example to read a scenario from disk. Then the client is *held*: the reader of
its frames checks `is_held` after each op, pauses, and goes on when `on_released` is called. So a client's ops take
effect in the order in which they were sent, and no other client waits.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import NoReturn

from rosbridge_sim.errors import GraphError, Reason
from rosbridge_sim.graph.actions import GoalStatus
from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.participant import Notify, resolve
from rosbridge_sim.graph.policy import OPEN, Guest, Policy
from rosbridge_sim.graph.refusals import refusal_of
from rosbridge_sim.protocol import ops
from rosbridge_sim.protocol.session import Session
from rosbridge_sim.suggestions import hint

WEBSOCKET_NODE_NAME = "/rosbridge_websocket"
"""One ROS node name for all clients, as with rosbridge_suite; Lichtblick searches for it."""

CheckRoom = Callable[[ops.Id], None]
"""Raises GraphError if the client must not hold another thing, with that id."""


class PeerBase(Guest):
    """One client, without the meaning of its ops.

    Attributes:
        session: its wire.
        address: its network address, for people.
        num_errors: number of mistakes that it was told about.
        on_failure: called with an internal error in work for this client; by default it raises the error.
        num_holds: number of reasons for its next op to wait; see `hold`.
        on_released: called when the last hold has ended, but not after `leave`.
        op, op_id: the current op and its id; None between two ops.
    """

    name = WEBSOCKET_NODE_NAME

    def __init__(self, bus: Bus, session: Session, address: str, policy: Policy) -> None:
        """Create a client that holds nothing yet; the arguments are its attributes.

        Args:
            address: its network address, for people.
            policy: its rights.
        """
        self.bus = bus
        self.session = session
        self.policy = policy
        self.address = address
        self.num_errors = 0
        self.on_failure: Callable[[Exception], None] = _raise
        self.num_holds = 0
        self.on_released: Callable[[], None] = _do_nothing
        self.op: ops.Op | None = None
        self.op_id: ops.Id = None
        session.on_mistake = lambda error: self.note(error.reason, str(error))
        session.on_unsent = bus.guard.note_encoding

    # Notices and mistakes

    def fail(self, error: Exception) -> None:
        """See `Guarded`: the owner of the socket closes it."""
        self.on_failure(error)

    def note(self, reason: Reason, text: object, op: ops.Op | None = None) -> None:
        """Report a mistake of this client in the log and on `/sim/refusals`.

        Args:
            text: text that the client was sent.
            op: the wrong op, if it is known.
        """
        refusal = refusal_of(self.address, reason, text, op)
        self.bus.guard.attempt("the account of a refusal", self.bus.on_refusal, refusal)

    def suggest(self, reason: Reason, op: ops.Op) -> str:
        """Return the nearest name that this client may use, or where a name exists, for the end of an error text.

        Returns:
            The end of a sentence; may be empty.
        """
        advise = self.bus.unpublished.advise_name
        if reason is Reason.UNKNOWN_TYPE:
            return advise(getattr(op, "type", None) or "")
        names: Iterable[str]
        may_know: Callable[[str], bool]
        if reason is Reason.UNKNOWN_TOPIC and isinstance(op, (ops.Publish, ops.Subscribe)):
            name, names, may_know = op.topic, self.bus.topics, self.may_see
        elif reason is Reason.NO_SUCH_SERVICE and isinstance(op, ops.CallService):
            name, names, may_know = split_id(op)[0], self.bus.services, self.policy.may_call
        elif reason is Reason.NO_SUCH_ACTION and isinstance(op, ops.SendActionGoal):
            name, names, may_know = op.action, self.bus.actions.by_name, self.policy.may_send_goal
        else:
            return ""
        return advise(resolve(name)) or hint(resolve(name), names if self.policy == OPEN else filter(may_know, names))

    def may_see(self, name: str) -> bool:
        """Return True if this client may see an existing topic."""
        return self.policy.may_see(name, self.bus.topics[name].type.name)

    def refuse(self, op: ops.Op, why: str, reason: Reason = Reason.REFUSED) -> bool:
        """Refuse an op, if it waits for an answer.

        Args:
            why: reason, for the client.

        Returns:
            True if the op got an answer; False if it is of a kind that has none.
        """
        self.num_errors += 1
        self.note(reason, why, op)
        if isinstance(op, ops.CallService):
            self.session.answer(op.service, split_id(op)[1], why, is_ok=False)
        elif isinstance(op, ops.SendActionGoal):
            status = GoalStatus.UNKNOWN
            self.session.say("action_result", {}, action=op.action, id=op.id, status=status, result=False, values=why)
        else:
            return False
        return True

    def notify(self, level: str, text: str) -> None:
        """Send a status frame that is not an answer to a request."""
        self.remark(level, text)
        self._note_notice(level, text, self.op)

    def explain(self, level: str, text: str, reason: Reason) -> None:
        """See `Participant`."""
        self.remark(level, text, None if self.op is None else self.op_id)
        self.note(reason, text, self.op)

    def _note_notice(self, level: str, text: str, op: ops.Op | None) -> None:
        """Report a text that was sent without a reason; an `info` is not a mistake."""
        if level == "error":
            self.note(Reason.REFUSED, text, op)
        elif level != "info":
            self.note(Reason.WARNING, text, op)

    def remark(self, level: str, text: str, op_id: ops.Id = None) -> None:
        """Send a status frame on behalf of others. A failure of this client does not reach them.

        Args:
            level: `info`, `warning` or `error`.
        """
        try:
            self.session.remark(level, text, op_id)
        except Exception as error:  # noqa: BLE001 - an internal error in this client's own state
            self.bus.guard.blame(self, error)

    def notifier(self) -> Notify:
        """Return a function like `notify` that adds the id of the current op."""
        op_id, op = self.op_id, self.op

        def notify(level: str, text: str) -> None:
            self.num_errors += level == "error"
            self.remark(level, text, op_id)
            self._note_notice(level, text, op)

        return notify

    # Holds

    @property
    def is_held(self) -> bool:
        """True if the next op must wait until `on_released` is called."""
        return self.num_holds > 0

    def hold(self) -> Callable[[], None]:
        """Hold this client; see `Participant`."""
        self.num_holds += 1
        is_holding = True

        def release() -> None:
            nonlocal is_holding
            if is_holding:
                is_holding = False
                self.num_holds -= 1
                if not self.num_holds:
                    try:
                        self.on_released()
                    except Exception as error:  # noqa: BLE001 - an internal error in this client's own state
                        self.bus.guard.blame(self, error)

        return release

    def forget_release(self) -> None:
        """Stop calling `on_released`, because the client is gone."""
        self.on_released = _do_nothing


def _do_nothing() -> None:
    """Do nothing: no op of this client waits."""


def _raise(error: Exception) -> NoReturn:
    """Raise a failure to the caller, because this client has no socket to close."""
    raise error


def needed_type(op: ops.Advertise | ops.AdvertiseService | ops.AdvertiseAction) -> str:
    """Return the type of an offer; an empty one means, as in other ops, that it was left out.

    Raises:
        GraphError: it was left out.
    """
    if not op.type:
        text = f"{type(op).__struct_config__.tag}: Expected a type field but none was found."
        raise GraphError(text, reason=Reason.BAD_OP)
    return op.type


def split_id(op: ops.CallService) -> tuple[str, ops.Id]:
    """Return name and id of a call; an old form has both in one text: `service#id`."""
    if op.id is None and "#" in op.service:
        service, _, op_id = op.service.partition("#")
        return service, op_id
    return op.service, op.id
