"""Deployments of the simulator: in the server itself, or behind a bridge that it dials.

- `serve`: one process, `rosbridge-sim serve`.
- `attach`: `rosbridge-sim attach`, and as its bridge our own server without a world.
- `quirks`: the same, and as its bridge the far side, with the manners of rosbridge_suite.

A bridge is asked to nothing but carrying, so one of them serves many simulators, one after another.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Literal, TypeAlias

from tests.support import AttachProcess, FarSideProcess, Process, ServerProcess

__all__ = ["Bridges", "Kind", "Place"]

Kind: TypeAlias = Literal["serve", "attach", "quirks"]

_OF_TYPES = ("--release", "--ros")
"""Flags that decide what a type looks like: both ends have to agree on them."""


class Bridges:
    """Bridges that are started when they are first wanted, and kept."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._kept: dict[tuple[str, ...], FarSideProcess | ServerProcess] = {}

    def get(self, kind: Kind, flags: Sequence[str]) -> FarSideProcess | ServerProcess:
        """The bridge for simulators with such flags."""
        agreed = [word for pair in pairwise(flags) if pair[0] in _OF_TYPES for word in pair]
        key = (kind, *agreed)
        if key not in self._kept:
            log = self._folder / f"{'-'.join(key)}.txt"
            if kind == "quirks":
                self._kept[key] = FarSideProcess(log, agreed)
            else:
                self._kept[key] = ServerProcess(log, ["--no-world", *agreed])
        return self._kept[key]

    def stop_cleanly(self) -> None:
        """Stop them all."""
        for bridge in self._kept.values():
            bridge.stop_cleanly()


class Place:
    """A running simulator as its clients know it.

    Attributes:
        kind: of place.
        url: where clients connect.
        port: the same, the number alone.
        simulator: the process in which the world is.
    """

    def __init__(self, kind: Kind, log: Path, flags: Sequence[str], bridges: Bridges) -> None:
        """Start it and wait until clients can find it.

        Args:
            kind: of place.
            log: where the simulator's stderr goes.
            flags: of the simulator.
            bridges: for those that dial one.
        """
        where: FarSideProcess | ServerProcess
        self.kind: Kind = kind
        self.simulator: Process
        if kind == "serve":
            self.simulator = where = ServerProcess(log, flags)
        else:
            where = bridges.get(kind, flags)
            # simulated time, so that a drive is the same in each place
            self.simulator = AttachProcess(log, [where.url], ["--stamps", "sim", *flags])
        self.url, self.port = where.url, where.port

    @property
    def is_attached(self) -> bool:
        """Whether a bridge stands between the simulator and its clients."""
        return self.kind != "serve"
