"""A bug of ours in a step. The world stops for good, because half a step cannot be undone."""

from __future__ import annotations

import logging

from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.participant import Participant
from rosbridge_sim.simulator.bus.interface_registry import InterfaceRegistry

_log = logging.getLogger("rosbridge_sim.morai")


class WorldFailure:
    """Record of a failed step, and its effects.

    Attributes:
        why: a text for peers; None while the world has not failed.
        is_serving_on: the program goes on after a failure, and the simulator refuses every call.
    """

    def __init__(
        self, participant: Participant, bus: Bus, interfaces: InterfaceRegistry, *, is_serving_on: bool
    ) -> None:
        """Start without a failure.

        Args:
            participant: the owner of the simulator's services.
            is_serving_on: true if the program goes on without its world.
        """
        self.why: str | None = None
        self.is_serving_on = is_serving_on
        self._participant = participant
        self._bus = bus
        self._interfaces = interfaces
        self._cause: Exception | None = None

    def note(self, error: Exception) -> str:
        """Record a failure, and refuse all waiting and future calls.

        Returns:
            The text for peers, `why`.
        """
        self._cause = error
        self.why = why = self._interfaces.why_closed = f"the world has failed: {error!r:.200}"
        if self.is_serving_on:
            _log.critical(
                "the world has failed and stands still; this is a bug of rosbridge_sim. The rest of the server goes on,"
                " because of --on-world-failure serve. Restart the server to get the world back",
                exc_info=error,
            )
            for service in list(self._bus.holdings(self._participant).services):
                for call in list(service.calls):
                    call.refuse(why)
        return why

    def raise_unless_serving(self) -> None:
        """Raise the exception of a failed step, unless the program goes on without its world.

        Raises:
            Exception: the one that the step raised.
        """
        if self._cause is not None and not self.is_serving_on:
            raise self._cause
