"""A client as a participant of the bus: what it is told, what is noted of its mistakes, and what its next op waits for.

The parts of a `Peer` (`peer_topics.py`, `peer_services.py`, `peer_actions.py`) share this, and act in this client's
name. A mistake gives one remark to the client, or a refusal to its call, and an entry in the log and on
`/sim/refusals`.

An op may take longer than its turn: a scenario is read from a disk. Then the client is *held*: the reader of its
frames asks `is_held` after each op, stops there, and goes on when `on_released` is called. So a client's ops take
effect in the order in which they were sent, and no other client waits.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import NoReturn

from rosbridge_sim.errors import Reason
from rosbridge_sim.graph.actions import GoalStatus
from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.participant import Notify, resolve
from rosbridge_sim.graph.policy import OPEN, Policy
from rosbridge_sim.graph.refusals import refusal_of
from rosbridge_sim.protocol import ops
from rosbridge_sim.protocol.session import Session
from rosbridge_sim.suggestions import hint

__all__ = ["WEBSOCKET_NODE_NAME", "CheckRoom", "PeerBase", "split_id"]

WEBSOCKET_NODE_NAME = "/rosbridge_websocket"
"""All clients are one ROS node, as behind rosbridge_suite; Lichtblick looks for it."""

CheckRoom = Callable[[ops.Id], None]
"""Raises GraphError if the client may not hold one more thing, under that id."""


class PeerBase:
    """One client, without what its ops mean.

    Attributes:
        bus: where it meets the others.
        session: its wire.
        policy: what it may do.
        address: where it comes from, for people to read.
        num_errors: mistakes it was told of.
        on_failure: called when something that is done for this client has failed by a bug of ours; raises it by itself.
        num_holds: reasons for its next op to wait; see `hold`.
        on_released: called when the last hold has ended; not after `leave`.
        op, op_id: the op in hand and its id; None between two ops.
    """

    name = WEBSOCKET_NODE_NAME

    def __init__(self, bus: Bus, session: Session, address: str, policy: Policy) -> None:
        """A client that holds nothing yet; the arguments are its attributes."""
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

    # What it is told

    def fail(self, error: Exception) -> None:
        """See `Guarded`: the owner of the socket closes it."""
        self.on_failure(error)

    def note(self, reason: Reason, text: object, op: ops.Op | None = None) -> None:
        """Tell the log and `/sim/refusals` of a mistake of this client's.

        Args:
            reason: the kind of mistake.
            text: what the client was told.
            op: what it is about, where that is known.
        """
        refusal = refusal_of(self.address, reason, text, op)
        self.bus.guard.attempt("the account of a refusal", self.bus.on_refusal, refusal)

    def suggest(self, reason: Reason, op: ops.Op) -> str:
        """Return the nearest name that this client may use, for the end of an error; perhaps nothing."""
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
        return hint(resolve(name), names if self.policy == OPEN else filter(may_know, names))

    def may_see(self, name: str) -> bool:
        """Return whether a topic that is there may be seen by this client."""
        return self.policy.may_see(name, self.bus.topics[name].type.name)

    def refuse(self, op: ops.Op, why: str, reason: Reason = Reason.REFUSED) -> bool:
        """Answer an op that is not to be done, if it waits for an answer; else False, and it gets no answer."""
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
        """Remark something that answers no request."""
        self.remark(level, text)
        self._note_notice(level, text, self.op)

    def explain(self, level: str, text: str, reason: Reason) -> None:
        """See `Explaining`."""
        self.remark(level, text)
        self.note(reason, text, self.op)

    def _note_notice(self, level: str, text: str, op: ops.Op | None) -> None:
        """Note what was told without a reason; an `info` is no mistake."""
        if level == "error":
            self.note(Reason.REFUSED, text, op)
        elif level != "info":
            self.note(Reason.NOT_NOW, text, op)

    def remark(self, level: str, text: str, op_id: ops.Id = None) -> None:
        """Remark something on behalf of others, who must not hear of a failure of this client's."""
        try:
            self.session.remark(level, text, op_id)
        except Exception as error:  # noqa: BLE001 - a bug of ours in this client's own state
            self.bus.guard.blame(self, error)

    def notifier(self) -> Notify:
        """See `Correlating`."""
        op_id, op = self.op_id, self.op

        def notify(level: str, text: str) -> None:
            self.num_errors += level == "error"
            self.remark(level, text, op_id)
            self._note_notice(level, text, op)

        return notify

    # What its next op waits for

    @property
    def is_held(self) -> bool:
        """Return whether the next op has to wait until `on_released` is called."""
        return self.num_holds > 0

    def hold(self) -> Callable[[], None]:
        """See `Holdable`."""
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
                    except Exception as error:  # noqa: BLE001 - a bug of ours in this client's own state
                        self.bus.guard.blame(self, error)

        return release

    def forget_release(self) -> None:
        """Call `on_released` no more: the client is gone."""
        self.on_released = _do_nothing


def _do_nothing() -> None:
    """Do nothing: no op of this client waits for its release."""


def _raise(error: Exception) -> NoReturn:
    """Raise a failure in the caller's hands: this client has no socket that could be closed."""
    raise error


def split_id(op: ops.CallService) -> tuple[str, ops.Id]:
    """The name and the id of a call; an old form has both in one: `service#id`."""
    if op.id is None and "#" in op.service:
        service, _, op_id = op.service.partition("#")
        return service, op_id
    return op.service, op.id
