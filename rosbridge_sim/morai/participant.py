"""The simulator as a participant of the bus: the owner of all its topics and services."""

from __future__ import annotations

import logging
from typing import Final

__all__ = ["SIMULATOR_NAME", "SimulatorParticipant"]

SIMULATOR_NAME: Final = "/morai_sim"

_log = logging.getLogger("rosbridge_sim.morai")


class SimulatorParticipant:
    """The owner of the simulator's topics and services; a `Participant` without state.

    It is built before everything that is on the bus, so that nothing has to know the whole simulator to be there.

    Attributes:
        name: as rosapi shows it.
    """

    name = SIMULATOR_NAME

    def notify(self, level: str, text: str) -> None:
        """Write what the bus has to say to the simulator into the log."""
        _log.log(logging.getLevelNamesMapping().get(level.upper(), logging.WARNING), "%s", text)
