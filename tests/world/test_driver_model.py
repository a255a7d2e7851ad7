"""The intelligent driver model, and how drivers brake for what stands still."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rosbridge_sim.world.driver_model import Perception, accelerate
from rosbridge_sim.world.lane_conflicts import COMFORT


@pytest.mark.parametrize(("speed", "lead", "gap"), [(20.0, 15.0, 60.0), (15.0, 0.0, 80.0), (10.0, 12.0, 20.0)])
def test_following_equals_the_intelligent_driver_model(speed: float, lead: float, gap: float) -> None:
    """Treiber, Hennecke, Helbing 2000: a weaker closing term brakes late and hard, a stronger one much too early."""
    wanted = 2.0 + 1.2 * speed + speed * (speed - lead) / (2.0 * math.sqrt(1.5 * COMFORT))
    accel = 1.5 * (1.0 - (speed / 30.0) ** 4 - (wanted / gap) ** 2)
    one, none = np.ones(1), np.full(1, np.inf)
    seen = Perception(gap * one, lead * one, np.zeros(1, dtype=np.int64), none, none, np.zeros(1, dtype=np.bool_))
    assert accelerate(speed * one, 30.0 * one, seen) == pytest.approx(accel)
