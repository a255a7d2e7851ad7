"""All programs on the far side of one bridge, as one participant of our bus: remarks to it and mistakes of it.

No program there can hear what the bus tells it, so that goes into our log. What it sends and what cannot be used is a
mistake of the bridge's, as that of any client: a line in our log, with a reason, and an entry on `/sim/refusals`. It
has no other consequence.

The parts of a `Mirror` (`registry.py`, `announcing.py`, `survey.py`) share this.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import Final, NoReturn

from rosbridge_sim.errors import Reason
from rosbridge_sim.graph.attach.diagnostics import Diagnostics
from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.participant import Notify, Participant
from rosbridge_sim.graph.refusals import refusal_of
from rosbridge_sim.graph.stamps import Stamps
from rosbridge_sim.protocol import ops

__all__ = ["FAR_SIDE_NAME", "FarSide"]

FAR_SIDE_NAME: Final = "/rosbridge_far_side"
"""All programs on the far side are one node here: from here they cannot be told apart."""


class FarSide:
    """One far side, without what is mirrored there.

    Attributes:
        bus: where the simulator is.
        source: the simulator, whose topics and services are mirrored.
        address: of the far side, for people to read.
        diagnostics: what is found out about it.
        on_connections_changed: called when a connection has come or gone.
        on_attached: called each time when everything is announced.
        on_failure: called when something done for the far side has failed by a bug of ours; raises it by itself.
        stamps: which time goes out; None where the far side is not to be asked about it.
        why_gone: called with the name of a service that is not here any more; returns why it is not, if it may come
            back, or an empty text.
        now: monotonic time of what is handled right now [s].
        op: the op in hand; None between two ops.
        is_gone: everything of it is off the bus, for good.
    """

    name = FAR_SIDE_NAME

    def __init__(self, bus: Bus, source: Participant, address: str) -> None:
        """A far side that nothing is known of."""
        self.bus = bus
        self.source = source
        self.address = address
        self.diagnostics = Diagnostics(address, bus.store.ros)
        self.on_connections_changed: Callable[[], None] = lambda: None
        self.on_attached: Callable[[], None] = lambda: None
        self.on_failure: Callable[[Exception], None] = _raise
        self.stamps: Stamps | None = None
        self.why_gone: Callable[[str], str] = lambda _name: ""
        self.now = 0.0
        self.op: ops.Op | None = None
        self.is_gone = False

    def notify(self, level: str, text: str) -> None:
        """Log what would be told to a client: no program there could hear it."""
        self._note_notice(level, text, self.op)

    def explain(self, level: str, text: str, reason: Reason) -> None:
        """See `Explaining`; the level is of no use, since no program there could hear it."""
        assert level != "info", "that is no mistake"
        self.note_mistake(reason, text, self.op)

    def notifier(self) -> Notify:
        """See `Correlating`."""
        op = self.op
        return lambda level, text: self._note_notice(level, text, op)

    def _note_notice(self, level: str, text: str, op: ops.Op | None) -> None:
        """Note what was told without a reason, as `Peer` does."""
        if level == "info":
            self.note_now(logging.INFO, f"a program there is told: [{level}] {text}")
        else:
            self.note_mistake(Reason.REFUSED if level == "error" else Reason.NOT_NOW, text, op)

    def note_mistake(self, reason: Reason, text: object, op: ops.Op | None = None) -> None:
        """Tell the log and `/sim/refusals` of a mistake of a program there.

        Args:
            reason: the kind of mistake.
            text: what a client would be told.
            op: what it is about, where that is known.
        """
        refusal = refusal_of(self.address, reason, text, op)
        self.bus.guard.attempt("the account of a refusal", self.bus.on_refusal, refusal)

    def fail(self, error: Exception) -> None:
        """See `Guarded`: the bridge's connections are made anew."""
        self.on_failure(error)

    def note(self, level: int, text: str, now: float) -> None:
        """Have a line in the log, unless there were too many of late."""
        self.diagnostics.log_limited(level, text, now)

    def note_now(self, level: int, text: str) -> None:
        """Do what `note` does, about what is handled right now."""
        self.note(level, text, self.now)


def _raise(error: Exception) -> NoReturn:
    """Raise a failure in the caller's hands: this far side has no connection that could be cut."""
    raise error
