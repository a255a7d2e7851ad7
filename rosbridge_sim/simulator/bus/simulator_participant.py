"""The simulator as a participant of the bus: the owner of all its topics and services."""

from __future__ import annotations

import logging
from typing import Final

from rosbridge_sim.graph.participant import Participant

SIMULATOR_NAME: Final = "/morai_sim"

_log = logging.getLogger("rosbridge_sim.morai")


class SimulatorParticipant(Participant):
    """The owner of the simulator's topics and services; it has no state.

    It is built before everything else on the bus. So the parts need only this owner, not the whole simulator.

    Attributes:
        name: the node name that rosapi shows.
    """

    name = SIMULATOR_NAME

    def notify(self, level: str, text: str) -> None:
        """Write a message from the bus to the simulator into the log.

        Args:
            level: `error`, `warning`, `info` or `none`; an unknown level is logged as a warning.
        """
        _log.log(logging.getLevelNamesMapping().get(level.upper(), logging.WARNING), "%s", text)
