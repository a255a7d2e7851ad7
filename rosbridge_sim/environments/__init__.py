"""Environments for Gymnasium, in the extra `gym`; importing this registers them.

`gymnasium.make` finds them by itself once the package is installed.
"""

from __future__ import annotations

from rosbridge_sim.environments.registration import register_all

__all__ = ["register_all"]

register_all()
