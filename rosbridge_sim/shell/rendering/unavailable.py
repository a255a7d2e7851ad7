"""The error of a machine that cannot draw or cast rays."""

from __future__ import annotations


class RenderingUnavailableError(RuntimeError):
    """A library that sensors need is missing or cannot be used; the text says what to install."""


def missing_library(what: str, library: str) -> RenderingUnavailableError:
    """Return the error for a Python library that is not installed."""
    return RenderingUnavailableError(f"{what} need the library {library}: pip install 'rosbridge-sim[sensors]'")
