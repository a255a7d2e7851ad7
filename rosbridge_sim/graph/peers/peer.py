"""The ops of one client, done on the bus in that client's name.

A `Peer` connects a session (one wire) with the bus (all participants). It reads frames and does their ops one by one,
by a table. Its parts `peer_topics.py`, `peer_services.py` and `peer_actions.py` store what the wire knows and the bus
does not. A mistake gives a status frame to this client, or a refusal of its call. It changes nothing else
(`peer_base.py`).
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator
from operator import attrgetter
from typing import Any, Protocol, TypeAlias

from rosbridge_sim.errors import FrameError, GraphError, PeerError, Reason
from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.participant import OfferKind
from rosbridge_sim.graph.peers.peer_actions import PeerActions
from rosbridge_sim.graph.peers.peer_base import PeerBase
from rosbridge_sim.graph.peers.peer_services import PeerServices
from rosbridge_sim.graph.peers.peer_topics import PeerTopics
from rosbridge_sim.graph.policy import OPEN, Policy
from rosbridge_sim.protocol import ops
from rosbridge_sim.protocol.op_keys import describe_strange_keys
from rosbridge_sim.protocol.roslibpy_status import OPS_WITH_ID, is_id_of_roslibpy
from rosbridge_sim.protocol.session import LEVELS, Session
from rosbridge_sim.suggestions import hint

MAX_OP_ID = 1_024
"""Longest id of anything that is stored [characters]; other ids are only echoed."""

LOOKS = 200
"""So many first frames of each kind of op, and after each `set_level`, are searched for keys that nobody reads.
Programs repeat their mistakes, and later frames should cost nothing."""

MAX_STRANGE = 100
"""Lines about such keys that are kept of one client, so that each is in the log once."""

_log = logging.getLogger("rosbridge_sim.graph")


class Work(Protocol):
    """Work for a frame, in steps."""

    def step(self, now: float) -> bool:
        """Do the next op, or the next slice of reading.

        Returns:
            True if anything was left to do.
        """


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
    """One client on the bus."""

    def __init__(self, bus: Bus, session: Session, address: str = "", policy: Policy = OPEN) -> None:
        """Create a client that holds nothing yet.

        Args:
            address: its network address, for people.
            policy: its rights.
        """
        super().__init__(bus, session, address, policy)
        check_room = self._check_room
        self.topics = PeerTopics(self, check_room)
        self.services = PeerServices(self, check_room)
        self.actions = PeerActions(self, check_room)
        session.on_lost_answer = self._lose_answer
        if not policy.is_open:
            policy.ways.on_change[self.topics.recheck] = None
        self._looks: dict[type, int] = {}  # frames of each kind of op that were searched
        self._strange: frozenset[str] = frozenset()  # lines about keys that nobody reads
        self._act: dict[type, _Act] = {}  # the acts of the kinds of ops that came so far: most clients send few kinds

    def receive(self, frame: bytes, now: float) -> None:
        """Do all ops of a frame at once, however long that takes.

        Args:
            frame: content of a text or binary frame.
        """
        work = self.begin(frame, now)
        while work is not None and work.step(now):
            pass

    def begin(self, frame: bytes, now: float) -> Work | None:
        """Do the only op of an ordinary frame at once, or return the work for any other frame.

        Args:
            frame: content of a text or binary frame.

        Returns:
            None if everything is done. Otherwise the work for a long frame or one with several ops; none of it is done
            yet. Call `step` to its end before the next frame. One op is done completely; others may have their turn
            between two ops.
        """
        op = self.session.receive_plain(frame)
        if op is None:
            return FrameWork(self.session.receive(frame, now), self.do)
        act = self._act.get(type(op))
        self._carry_out(op, self._look(frame, op) if act is None else act, now)
        return None

    def _look(self, frame: bytes, op: ops.Op) -> _Act:
        """Tell a client that wants warnings about keys that nobody reads, and write each into the log once.

        The first op with an id tells whether the client is roslibpy.

        Returns:
            Does the op. It is kept when enough frames of this kind were looked at; then this is not called for them.
        """
        kind = type(op)
        self._looks[kind] = num = self._looks.get(kind, 0) + 1
        act = _ACTS[kind](self)
        if num >= LOOKS:
            self._act[kind] = act
        if self.session.is_roslibpy is None and (name := kind.__struct_config__.tag) in OPS_WITH_ID:
            self.session.is_roslibpy = is_id_of_roslibpy(name, op.id)
        for text in describe_strange_keys(frame, op):
            self.session.remark("warning", text, op.id)
            if text not in self._strange and len(self._strange) < MAX_STRANGE:
                self._strange |= {text}
                self.note(Reason.BAD_OP, text, op)
        return act

    def flush(self, now: float) -> None:
        """Send the messages whose time has come, as announced by the session's alarm."""
        self.session.flush(now, self.bus.stamp_ns)

    def do(self, op: ops.Op, now: float) -> None:
        """Do one op; tell the client about a mistake in it."""
        self._carry_out(op, self._act.get(type(op)) or _ACTS[type(op)](self), now)

    def _carry_out(self, op: ops.Op, act: _Act, now: float) -> None:
        self.op_id = op.id
        self.op = op
        if type(op) is not ops.Publish:  # a message touches the agenda only if the simulator takes it
            self.bus.agenda.is_touched = True
        try:
            act(op, now)
        except PeerError as error:
            self.num_errors += 1
            text = f"{error}{self.suggest(error.reason, op)}"
            self.session.remark("error", text, op.id)
            self.note(error.reason, text, op)
        self.op = None

    def lose(self, kind: OfferKind, name: str, why: str) -> None:
        """See `Participant`.

        Args:
            name: absolute name.
            why: a line of text for the user of the client.
        """
        if kind == "topic":
            self.topics.lose(name)
        elif kind == "service":
            self.services.lose(name)
        else:
            self.actions.lose(name)
        self.remark("error", why)

    def leave(self, now: float) -> None:
        """Remove everything of this client from the bus. A second call does nothing."""
        self.forget_release()
        self.policy.ways.on_change.pop(self.topics.recheck, None)
        try:
            self.topics.forget()
            self.services.forget()
            self.actions.forget()
            self.session.leave()
        finally:  # after an error, too: anything left on the bus would fail again with each message
            self.bus.leave(self, now)

    def _lose_answer(self, error: FrameError) -> None:
        """Fail the call or the goal whose answer cannot be read."""
        part = self.services if error.op == "service_response" else self.actions
        part.fail_unreadable(error)

    def set_level(self, op: ops.SetLevel, _now: float) -> None:
        """Send status frames up to another level from now on."""
        if op.level not in LEVELS:
            got = f"{op.level[:MAX_OP_ID]!r}{hint(op.level, LEVELS)}"
            text = f"set_level: expected one of {', '.join(LEVELS)}; got {got}"
            self.session.remark("warning", text, op.id)  # an error would be more than rosbridge_suite's silence
            self.note(Reason.WRONG_VALUE, text, op)
        self.session.set_level(op.level)
        self._looks.clear()
        self._act.clear()
        self.topics.is_searching = self.session.level >= LEVELS["warning"]

    def log_status(self, op: ops.Status, _now: float) -> None:
        """Write a status of the client to the log."""
        _log.info("%s says: [%s] %s", self.address, op.level, op.msg, extra={"client": self.address})

    def take_token(self, op: ops.Auth, _now: float) -> None:
        """Do nothing: this server has no token."""

    def _check_room(self, op_id: ops.Id) -> None:
        """See `CheckRoom`."""
        if isinstance(op_id, str) and len(op_id) > MAX_OP_ID:
            raise GraphError(f"The id of a topic has at most {MAX_OP_ID} characters", reason=Reason.TOO_MUCH)
        limit = self.policy.max_held
        if self.topics.num_held + self.services.num_held + self.actions.num_held >= limit:
            text = f"At most {limit} topics, services and actions can be held by one client"
            raise GraphError(text, reason=Reason.TOO_MUCH)


_Act: TypeAlias = Callable[[Any, float], None]
"""Does an op; its argument is the struct of that op."""

_ACTS: dict[type, attrgetter[_Act]] = {
    ops.Publish: attrgetter("topics.publish"),
    ops.CallService: attrgetter("services.call"),
    ops.ServiceResponse: attrgetter("services.respond"),
    ops.Subscribe: attrgetter("topics.subscribe"),
    ops.Unsubscribe: attrgetter("topics.unsubscribe"),
    ops.Advertise: attrgetter("topics.advertise"),
    ops.Unadvertise: attrgetter("topics.unadvertise"),
    ops.AdvertiseService: attrgetter("services.advertise"),
    ops.UnadvertiseService: attrgetter("services.unadvertise"),
    ops.AdvertiseAction: attrgetter("actions.advertise"),
    ops.UnadvertiseAction: attrgetter("actions.unadvertise"),
    ops.SendActionGoal: attrgetter("actions.send_goal"),
    ops.CancelActionGoal: attrgetter("actions.cancel_goal"),
    ops.ActionFeedback: attrgetter("actions.report"),
    ops.ActionResult: attrgetter("actions.end_goal"),
    ops.SetLevel: attrgetter("set_level"),
    ops.Status: attrgetter("log_status"),
    ops.Auth: attrgetter("take_token"),
}
