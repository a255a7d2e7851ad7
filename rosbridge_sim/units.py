"""Factors between SI units and the units of MORAI's files and messages; defined here only."""

from __future__ import annotations

from typing import Final

MPS_TO_KMH: Final = 3.6
"""Kilometres an hour in one metre a second."""

KMH_TO_MPS: Final = 1.0 / 3.6
"""Metres a second in one kilometre an hour."""
