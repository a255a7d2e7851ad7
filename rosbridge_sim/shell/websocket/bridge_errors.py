"""How a tool ends when it cannot do what it was asked for."""

from __future__ import annotations

from rosbridge_sim.errors import DocumentError, RosbridgeSimError

__all__ = ["BridgeError", "RefusedError"]


class BridgeError(DocumentError):
    """There is no rosbridge to talk to, or it does not talk: exit code 2."""


class RefusedError(RosbridgeSimError):
    """Whoever was asked says no, or has gone: exit code 1."""
