"""Warnings about mistakes that a client may repeat fifty times a second: each text once for each client."""

from __future__ import annotations

from rosbridge_sim.graph.participant import Participant

__all__ = ["WarnOnce"]


class WarnOnce:
    """Record of the texts that each participant has been warned with."""

    def __init__(self) -> None:
        """Start with an empty record."""
        self._texts: dict[Participant, set[str]] = {}

    def __len__(self) -> int:
        """Return the number of participants that have been warned."""
        return len(self._texts)

    def warn(self, participant: Participant, text: str) -> None:
        """Warn a participant, unless it has been warned with this text before.

        Args:
            participant: the client.
            text: the warning; it must come from a small set of texts, because all of them are kept.
        """
        texts = self._texts.setdefault(participant, set())
        if text not in texts:
            texts.add(text)
            participant.notify("warning", text)

    def forget(self, participant: Participant) -> None:
        """Drop the texts of a participant that has left.

        Args:
            participant: the client; one that was never warned is no error.
        """
        self._texts.pop(participant, None)
