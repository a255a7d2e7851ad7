"""Names of the transform republisher, for itself and for the table of ways."""

from __future__ import annotations

from typing import Final

__all__ = ["REPUBLISHER_NAME", "REPUBLISH_SERVICE"]

REPUBLISHER_NAME: Final = "/tf2_web_republisher"

REPUBLISH_SERVICE: Final = "/republish_tfs"
