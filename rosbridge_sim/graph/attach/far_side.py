"""All programs on the far side of one bridge, as one participant of our bus, with notices to it and its mistakes.

The programs there cannot receive notices of our bus, so these go to our log. Input that cannot be used is a mistake of
the bridge. As for any client, it gives a line in our log, with a reason, and an entry on `/sim/refusals`. It has no
other consequence.
The parts of a `Mirror` (`mirror_registry.py`, `announcing.py`, `survey.py`) share this class.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import Final, NoReturn

from rosbridge_sim.errors import Reason
from rosbridge_sim.graph.attach.diagnostics import Diagnostics, refuses_null
from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.participant import Notify, Participant
from rosbridge_sim.graph.refusals import refusal_of
from rosbridge_sim.graph.stamps import Stamps
from rosbridge_sim.protocol import ops
from rosbridge_sim.schema.message import Message

FAR_SIDE_NAME: Final = "/rosbridge_far_side"
"""Node name of all programs on the far side together, because we cannot tell them apart."""


class FarSide(Participant):
    """One far side, without the mirrored items.

    Attributes:
        source: the simulator; its topics and services are mirrored.
        address: address of the bridge, for people.
        diagnostics: findings about the bridge.
        on_connections_changed: called when a connection was added or removed.
        on_attached: called each time everything is announced.
        on_failure: called with an internal error in work for the far side; by default it raises the error.
        stamps: decides which clock our stamps use; None if the far side is not asked.
        why_gone: called with the name of a removed service; returns the reason if the service may come back, else an
            empty text.
        is_synchronous: returns True if only calls move the world now: then the topics of a call are sent before its
            answer, all of them.
        reads_words: it is sent NaN and infinity as words that JSON does not have, because it refuses `null` in a float
            field, as rosbridge_suite does. A bridge of ROS 1 is believed to; one of ROS 2 must show it.
        now: monotonic time of the current event [s].
        op: the current op; None between two ops.
        is_gone: it has left the bus for ever.
    """

    name = FAR_SIDE_NAME

    def __init__(self, bus: Bus, source: Participant, address: str) -> None:
        """Create a far side without findings.

        Args:
            source: the simulator.
            address: address of the bridge, for people.
        """
        self.bus = bus
        self.source = source
        self.address = address
        self.diagnostics = Diagnostics(address, bus.store.ros)
        self.on_connections_changed: Callable[[], None] = lambda: None
        self.on_attached: Callable[[], None] = lambda: None
        self.on_failure: Callable[[Exception], None] = _raise
        self.stamps: Stamps | None = None
        self.why_gone: Callable[[str], str] = lambda _name: ""
        self.is_synchronous: Callable[[], bool] = lambda: True
        self.reads_words = False
        self.forget_reading()
        self.now = 0.0
        self.op: ops.Op | None = None
        self.is_gone = False

    def forget_reading(self) -> None:
        """Forget how the bridge reads, because the next one there may be another."""
        self.reads_words = self.bus.store.ros == 1

    def note_refusal(self, text: str | None) -> None:
        """Send words from now on if an error text of the bridge is about `null`."""
        if not self.reads_words and refuses_null(text):
            self.reads_words = True
            self.diagnostics.report_words()

    def body(self, message: Message) -> bytes:
        """Return the JSON text of a message as this bridge reads it.

        Raises:
            EncodingError: the message cannot be written.
        """
        return message.json_with_words if self.reads_words else message.json

    def framed(self, message: Message, head: bytes) -> bytes:
        """Return the frame of a topic message as this bridge reads it.

        Args:
            head: from `publish_head`.

        Raises:
            EncodingError: the message cannot be written.
        """
        if self.reads_words and (body := message.json_with_words) is not message.json:
            return b"".join((head, body, b"}"))
        return message.framed(head)

    def notify(self, level: str, text: str) -> None:
        """Log a text that a client would be sent; no program there can receive it."""
        self._note_notice(level, text, self.op)

    def explain(self, level: str, text: str, reason: Reason) -> None:
        """See `Participant`. The level is not used, because no program there can receive the text."""
        assert level != "info", "an info is not a mistake"
        self.note_mistake(reason, text, self.op)

    def notifier(self) -> Notify:
        """Return a function like `notify`; see `Participant`."""
        op = self.op
        return lambda level, text: self._note_notice(level, text, op)

    def _note_notice(self, level: str, text: str, op: ops.Op | None) -> None:
        """Note a text that came without a reason, as `Peer` does."""
        if level == "info":
            self.note_now(logging.INFO, f"a program there is told: [{level}] {text}")
        else:
            self.note_mistake(Reason.REFUSED if level == "error" else Reason.WARNING, text, op)

    def note_mistake(self, reason: Reason, text: object, op: ops.Op | None = None) -> None:
        """Report a mistake of a program there, in the log and on `/sim/refusals`.

        Args:
            op: the wrong op, if it is known.
        """
        refusal = refusal_of(self.address, reason, text, op)
        self.bus.guard.attempt("the account of a refusal", self.bus.on_refusal, refusal)

    def fail(self, error: Exception) -> None:
        """See `Guarded`: the connections of the bridge are opened again."""
        self.on_failure(error)

    def note(self, level: int, text: str, now: float) -> None:
        """Log a line, unless there were too many lately.

        Args:
            level: level of `logging`.
        """
        self.diagnostics.log_limited(level, text, now)

    def note_now(self, level: int, text: str) -> None:
        """Do the same as `note`, for the current event.

        Args:
            level: level of `logging`.
        """
        self.note(level, text, self.now)


def _raise(error: Exception) -> NoReturn:
    """Raise a failure to the caller, because this far side has no connection to close."""
    raise error
