"""Warnings of mistakes that a client may repeat fifty times a second: each text once for each client."""

from __future__ import annotations

from rosbridge_sim.graph.participant import Participant

__all__ = ["WarnOnce"]


class WarnOnce:
    """The texts that each participant has been warned with."""

    def __init__(self) -> None:
        """Nobody has been warned."""
        self._texts: dict[Participant, set[str]] = {}

    def __len__(self) -> int:
        """Return how many participants have been warned."""
        return len(self._texts)

    def warn(self, participant: Participant, text: str) -> None:
        """Warn a participant, unless it has been warned with this text before."""
        texts = self._texts.setdefault(participant, set())
        if text not in texts:
            texts.add(text)
            participant.notify("warning", text)

    def forget(self, participant: Participant) -> None:
        """Drop the texts of a participant that has left."""
        self._texts.pop(participant, None)
