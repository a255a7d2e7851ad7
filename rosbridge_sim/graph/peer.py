"""The ops of one client, done on the bus in that client's name.

A `Peer` joins a session (one wire) to the bus (all who talk). It reads frames, does their ops one by one by a table,
and keeps what the wire knows and the bus does not in its parts: `peer_topics.py`, `peer_services.py` and
`peer_actions.py`. A mistake gives one remark to this client, or a refusal to its call, and leaves everything as it
was (`peer_base.py`).
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator
from typing import Any, Protocol

from rosbridge_sim.errors import FrameError, GraphError, PeerError, Reason
from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.participant import OfferKind
from rosbridge_sim.graph.peer_actions import PeerActions
from rosbridge_sim.graph.peer_base import PeerBase
from rosbridge_sim.graph.peer_services import PeerServices
from rosbridge_sim.graph.peer_topics import PeerTopics
from rosbridge_sim.graph.policy import OPEN, Policy
from rosbridge_sim.protocol import ops
from rosbridge_sim.protocol.session import LEVELS, Session

__all__ = ["MAX_OP_ID", "FrameWork", "Peer", "Work"]

MAX_OP_ID = 1_024
"""Longest id of what is held [characters]; any other id is only echoed."""

_log = logging.getLogger("rosbridge_sim.graph")


class Work(Protocol):
    """The work that a frame makes, in steps."""

    def step(self, now: float) -> bool:
        """Do the next op, or the next slice of finding it; return whether there was anything left to do."""


class FrameWork:
    """The ops of one frame, read and done one by one."""

    __slots__ = ("_do", "_ops")

    def __init__(self, ops_of_frame: Iterator[ops.Op | None], do: Callable[[ops.Op, float], None]) -> None:
        self._ops = ops_of_frame
        self._do = do

    def step(self, now: float) -> bool:
        """See `Work`."""
        for op in self._ops:
            if op is not None:
                self._do(op, now)
            return True
        return False


class Peer(PeerBase):
    """One client on the bus.

    Attributes:
        topics, services, actions: what it has of each.
    """

    def __init__(self, bus: Bus, session: Session, address: str = "", policy: Policy = OPEN) -> None:
        """A client that holds nothing yet.

        Args:
            bus: where it meets the others.
            session: its wire.
            address: where it comes from.
            policy: what it may do.
        """
        super().__init__(bus, session, address, policy)
        topics = self.topics = PeerTopics(self, self._check_room)
        services = self.services = PeerServices(self, self._check_room)
        actions = self.actions = PeerActions(self, self._check_room)
        session.on_lost_answer = self._lose_answer
        if not policy.is_open:
            policy.ways.on_change[topics.recheck] = None
        self._act: dict[type, Callable[[Any, float], None]] = {
            ops.Publish: topics.publish,
            ops.CallService: services.call,
            ops.ServiceResponse: services.respond,
            ops.Subscribe: topics.subscribe,
            ops.Unsubscribe: topics.unsubscribe,
            ops.Advertise: topics.advertise,
            ops.Unadvertise: topics.unadvertise,
            ops.AdvertiseService: services.advertise,
            ops.UnadvertiseService: services.unadvertise,
            ops.AdvertiseAction: actions.advertise,
            ops.UnadvertiseAction: actions.unadvertise,
            ops.SendActionGoal: actions.send_goal,
            ops.CancelActionGoal: actions.cancel_goal,
            ops.ActionFeedback: actions.report,
            ops.ActionResult: actions.end_goal,
            ops.SetLevel: self._set_level,
            ops.Status: self._status,
            ops.Auth: self._auth,
        }

    def receive(self, frame: bytes, now: float) -> None:
        """Do all that a frame asks, to its end, however long that takes."""
        work = self.begin(frame, now)
        while work is not None and work.step(now):
            pass

    def begin(self, frame: bytes, now: float) -> Work | None:
        """Do what an ordinary frame asks: its one op is done, and nothing is left.

        Args:
            frame: what came.
            now: monotonic time [s].

        Returns:
            None where all is done. Else the work that a long or glued frame makes, none of it done yet: `step` it to
            its end before the next frame. An op is done to its end; between two of them others may have their turn.
        """
        op = self.session.receive_plain(frame)
        if op is None:
            return FrameWork(self.session.receive(frame, now), self.do)
        self.do(op, now)
        return None

    def flush(self, now: float) -> None:
        """Send the messages whose turn has come; the session's alarm says when."""
        self.session.flush(now, self.bus.stamp_ns)

    def do(self, op: ops.Op, now: float) -> None:
        """Do one op; a mistake in it is told to the client."""
        self.op_id = op.id
        self.op = op
        try:
            self._act[type(op)](op, now)
        except PeerError as error:
            self.num_errors += 1
            text = f"{error}{self.suggest(error.reason, op)}"
            self.session.remark("error", text, op.id)
            self.note(error.reason, text, op)
        self.op = None

    def lose(self, kind: OfferKind, name: str, why: str) -> None:
        """See `Guest`."""
        if kind == "topic":
            self.topics.lose(name)
        elif kind == "service":
            self.services.lose(name)
        else:
            self.actions.lose(name)
        self.remark("error", why)

    def leave(self, now: float) -> None:
        """Take everything of this client's off the bus; twice is no error."""
        self.forget_release()
        self.policy.ways.on_change.pop(self.topics.recheck, None)
        try:
            self.topics.forget()
            self.services.forget()
            self.actions.forget()
            self.session.leave()
        finally:  # whatever is wrong with it: what stays on the bus would fail again with each message
            self.bus.leave(self, now)

    def _lose_answer(self, error: FrameError) -> None:
        """Fail the call or the goal whose answer cannot be read."""
        part = self.services if error.op == "service_response" else self.actions
        part.fail_unreadable(error, f"The provider's answer cannot be read: {error}")

    def _set_level(self, op: ops.SetLevel, _now: float) -> None:
        if op.level not in LEVELS:  # the protocol has no answer for it; its author sees the log
            expected = ", ".join(LEVELS)
            self.note(Reason.WRONG_VALUE, f"set_level: expected one of {expected}; got {op.level[:MAX_OP_ID]!r}", op)
        self.session.set_level(op.level)

    def _status(self, op: ops.Status, _now: float) -> None:
        _log.info("%s says: [%s] %s", self.address, op.level, op.msg, extra={"client": self.address})

    def _auth(self, op: ops.Auth, _now: float) -> None:
        """Nothing to check: no token is wanted here."""

    def _check_room(self, op_id: ops.Id) -> None:
        """See `CheckRoom`."""
        if isinstance(op_id, str) and len(op_id) > MAX_OP_ID:
            raise GraphError(f"The id of a topic has at most {MAX_OP_ID} characters", reason=Reason.TOO_MUCH)
        limit = self.policy.max_held
        if self.topics.num_held + self.services.num_held + self.actions.num_held >= limit:
            text = f"At most {limit} topics, services and actions can be held by one client"
            raise GraphError(text, reason=Reason.TOO_MUCH)
