"""A rosbridge v2 server without ROS, with a driving world inside that answers like MORAI SIM: Drive."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rosbridge_sim.version import __version__

if TYPE_CHECKING:
    from rosbridge_sim.errors import DocumentError, RosbridgeSimError
    from rosbridge_sim.shell.app import Simulator

__all__ = ["DocumentError", "RosbridgeSimError", "Simulator", "__version__"]


def __getattr__(name: str) -> object:
    """The public names, imported when asked for: `rosbridge-sim --help` needs none of what they need."""
    if name == "Simulator":
        from rosbridge_sim.shell.app import Simulator  # noqa: PLC0415

        return Simulator
    if name in {"DocumentError", "RosbridgeSimError"}:
        from rosbridge_sim import errors  # noqa: PLC0415

        return getattr(errors, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
