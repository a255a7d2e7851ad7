"""Errors that end a command-line tool."""

from __future__ import annotations

from rosbridge_sim.errors import DocumentError, RosbridgeSimError

__all__ = ["BridgeError", "RefusedError"]


class BridgeError(DocumentError):
    """There is no rosbridge to talk to, or it does not talk: exit code 2."""


class RefusedError(RosbridgeSimError):
    """The server refused a request, or is gone: exit code 1."""
