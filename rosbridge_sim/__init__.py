"""A rosbridge v2 server without ROS, with a driving world inside that answers like MORAI SIM: Drive."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

from rosbridge_sim.version import __version__

if TYPE_CHECKING:
    from rosbridge_sim.errors import DocumentError, RosbridgeSimError, SettingError
    from rosbridge_sim.shell.app import AddressError, Simulator
    from rosbridge_sim.shell.clocks.scheduler import WorldFailedError
    from rosbridge_sim.shell.config.options import SimulatorOptions
    from rosbridge_sim.worlds.worlds import Worlds

__all__ = [
    "AddressError",
    "DocumentError",
    "RosbridgeSimError",
    "SettingError",
    "Simulator",
    "SimulatorOptions",
    "WorldFailedError",
    "Worlds",
    "__version__",
]

_MODULES = {
    "AddressError": "rosbridge_sim.shell.app",
    "DocumentError": "rosbridge_sim.errors",
    "RosbridgeSimError": "rosbridge_sim.errors",
    "SettingError": "rosbridge_sim.errors",
    "Simulator": "rosbridge_sim.shell.app",
    "SimulatorOptions": "rosbridge_sim.shell.config.options",
    "WorldFailedError": "rosbridge_sim.shell.clocks.scheduler",
    "Worlds": "rosbridge_sim.worlds.worlds",
}
"""Module of each public name."""


def __getattr__(name: str) -> object:
    """Import a public name when it is first used, because `rosbridge-sim --help` needs none of them."""
    if name in _MODULES:
        return getattr(import_module(_MODULES[name]), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
