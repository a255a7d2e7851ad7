"""Errors that end a command-line tool."""

from __future__ import annotations

from rosbridge_sim.errors import DocumentError, RosbridgeSimError


class BridgeError(DocumentError):
    """There is no rosbridge at the URL, or it does not answer: exit code 2."""


class RefusedError(RosbridgeSimError):
    """The server refused a request, or the connection has ended: exit code 1."""
