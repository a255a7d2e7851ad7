"""Environments for Gymnasium, in the extra `gym`; importing this registers them.

`gymnasium.make("rosbridge_sim.environments:rosbridge_sim/Drive-v0")` imports it by itself.
"""

from __future__ import annotations

from rosbridge_sim.environments.registration import register_all

__all__ = ["register_all"]

register_all()
