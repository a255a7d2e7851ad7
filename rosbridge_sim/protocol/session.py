"""One connection as a state machine: frames in, ops out; messages, answers and remarks in, frames out.

A session knows one peer's wire and nothing else: how it spells topics, from which level on it wants to hear
remarks, what waits in its outbox. `receive` never raises for anything that a peer can send; what is no op is
told to the peer and gone. What the ops *mean* is `graph/peer.py`'s business.
"""

from __future__ import annotations

import orjson

from rosbridge_sim.errors import FrameError
from rosbridge_sim.protocol.codec import Encoded, call_frame, decode_frame, response_frame, status_frame
from rosbridge_sim.protocol.flow import Outbox
from rosbridge_sim.protocol.ops import Id, Op

__all__ = ["LEVELS", "Session"]

LEVELS = {"none": 0, "error": 1, "warning": 2, "warn": 2, "info": 3}
"""Levels of remarks; a peer hears those up to its own. `warn` is what C++ servers' clients write."""


class Session:
    """The wire of one peer.

    Attributes:
        outbox: what is on its way to the peer.
        level: remarks up to this one are sent; `error` until the peer asks otherwise.
        num_received, num_refused: frames in, and those among them that held something that is no op.
    """

    __slots__ = ("_is_talkative", "level", "num_received", "num_refused", "outbox")

    def __init__(self, outbox: Outbox, *, is_talkative: bool = True) -> None:
        """A session at its start.

        Args:
            outbox: where frames for the peer go.
            is_talkative: whether remarks are sent at all (an option for clients that choke on them).
        """
        self.outbox = outbox
        self.level = LEVELS["error"]
        self.num_received = 0
        self.num_refused = 0
        self._is_talkative = is_talkative

    def receive(self, frame: bytes) -> list[Op]:
        """The ops in a frame, in order. The peer is told of whatever else was in it. Never raises."""
        self.num_received += 1
        ops: list[Op] = []
        for op in decode_frame(frame):
            if isinstance(op, FrameError):
                self.num_refused += 1
                self.remark("error", str(op), op.op_id)
            else:
                ops.append(op)
        return ops

    def set_level(self, level: str) -> None:
        """Hear remarks up to `level` from now on; a word that is no level changes nothing."""
        self.level = LEVELS.get(level, self.level)

    def remark(self, level: str, text: str, op_id: object = None) -> None:
        """Send a status frame, if the peer wants to hear of that level."""
        if self._is_talkative and LEVELS[level] <= self.level:
            self.outbox.send(status_frame(level, text, op_id))

    def message(self, topic: str, head: bytes, message: Encoded) -> None:
        """Send a topic's message; `topic` and `head` in the peer's spelling."""
        self.outbox.offer(topic, message.framed(head))

    def answer(self, service: str, op_id: Id, values: Encoded | object, *, is_ok: bool) -> None:
        """Answer a call of the peer's: with a message, or with whatever JSON value says why not."""
        body = values.json if is_ok else orjson.dumps(values)  # type: ignore[union-attr] # is_ok: Encoded
        self.outbox.send(response_frame(service, body, is_ok=is_ok, op_id=op_id))

    def call(self, service: str, call_id: str, args: Encoded) -> None:
        """Ask the peer, who provides the service."""
        self.outbox.send(call_frame(service, call_id, args.json))
