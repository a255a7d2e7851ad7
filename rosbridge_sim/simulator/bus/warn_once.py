"""Warnings about mistakes that a client may repeat fifty times a second: each text once for each client."""

from __future__ import annotations

from rosbridge_sim.errors import Reason
from rosbridge_sim.graph.participant import Participant


class WarnOnce:
    """Record of the texts, or subjects, that each participant has been warned with."""

    def __init__(self) -> None:
        self._texts: dict[Participant, set[str]] = {}

    def __len__(self) -> int:
        """Return the number of participants that have been warned."""
        return len(self._texts)

    def warn(
        self, participant: Participant, text: str, about: str | None = None, reason: Reason = Reason.NOT_NOW
    ) -> None:
        """Warn a participant, unless it has been warned with this text, or about this, before.

        Args:
            about: what it is about; None for the text itself. It must come from a small set, because all are kept.
        """
        texts = self._texts.setdefault(participant, set())
        about = text if about is None else about
        if about not in texts:
            texts.add(about)
            participant.explain("warning", text, reason)

    def forget(self, participant: Participant) -> None:
        """Drop the texts of a participant that has left.

        Args:
            participant: the client; one that was never warned is no error.
        """
        self._texts.pop(participant, None)
