"""Definitions of messages and their compiled types, kept for the next simulators of a process.

To read them, and to compile those of the ego, is a third of what a further simulator costs at its start. A compiled
type has no state, so simulators that share them share nothing that one could change for the others.
"""

from __future__ import annotations

from rosbridge_sim.morai.releases import LENIENCY
from rosbridge_sim.schema.store import Store
from rosbridge_sim.shell.config.settings import Settings
from rosbridge_sim.shell.files.definitions import Texts, read_definitions


def read_types(settings: Settings) -> tuple[Texts, Store]:
    """Return all definitions, and the types that are compiled from them when they are needed.

    Raises:
        DocumentError: a folder of the user has no definitions, or a file cannot be used.
    """
    texts = read_definitions(settings.release, settings.schema_path)
    # The package's own definitions are compiled by its tests, those of the user's folders at their first use.
    return texts, Store(texts, leniency=LENIENCY, ros=settings.ros, is_checked=not settings.schema_path)


class MessageTypes:
    """Types of simulators in one process, by release and ROS generation. Those of the user's folders are not kept."""

    def __init__(self) -> None:
        self._kept: dict[tuple[str, int], tuple[Texts, Store]] = {}

    def read(self, settings: Settings) -> tuple[Texts, Store]:
        """Return the same as `read_types`, from before if possible. Errors are the same, too."""
        if settings.schema_path:
            return read_types(settings)
        key = settings.release, settings.ros
        if key not in self._kept:
            self._kept[key] = read_types(settings)
        return self._kept[key]
