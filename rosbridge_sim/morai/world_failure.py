"""A bug of ours in a step: the world stands still for good, because half a step cannot be taken back."""

from __future__ import annotations

import logging

from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.participant import Participant
from rosbridge_sim.morai.interfaces.registry import InterfaceRegistry

__all__ = ["WorldFailure"]

_log = logging.getLogger("rosbridge_sim.morai")


class WorldFailure:
    """Whether the world has failed, and what follows from it.

    Attributes:
        why: a text for peers; None while the world has not failed.
        is_serving_on: the rest of the program goes on, and every call of the simulator is refused.
    """

    def __init__(
        self, participant: Participant, bus: Bus, interfaces: InterfaceRegistry, *, is_serving_on: bool
    ) -> None:
        """The world has not failed.

        Args:
            participant: the owner of the simulator's services.
            bus: where these are.
            interfaces: closed by a failure.
            is_serving_on: whether the program goes on without its world.
        """
        self.why: str | None = None
        self.is_serving_on = is_serving_on
        self._participant = participant
        self._bus = bus
        self._interfaces = interfaces
        self._cause: Exception | None = None

    def note(self, error: Exception) -> str:
        """Refuse, from now on, what waits for an answer and what comes.

        Args:
            error: what a step has raised.

        Returns:
            `why`.
        """
        self._cause = error
        self.why = why = self._interfaces.why_closed = f"the world has failed: {error!r:.200}"
        if self.is_serving_on:
            _log.critical(
                "the world has failed and stands still; this is a bug of ours. Everything else goes on, as"
                " --on-world-failure serve says; restart to have the world again",
                exc_info=error,
            )
            for service in list(self._bus.holdings(self._participant).services):
                for call in list(service.calls):
                    call.refuse(why)
        return why

    def raise_unless_serving(self) -> None:
        """Raise what the step has raised, if there is anything and the program is not to go on without its world.

        Raises:
            Exception: the cause.
        """
        if self._cause is not None and not self.is_serving_on:
            raise self._cause
