"""Drives of the single track model end in known states.

Digests of bits would be stricter. But sines and arc tangents of numpy may differ in their last bit from processor to
processor, and so these are states: numbers that agree to `CLOSE`.
"""

from __future__ import annotations

from typing import Final

import pytest

from rosbridge_sim.world.state.world import Dynamics, Kind, World
from tests.world.kinematic_drives import DRIVES

CLOSE: Final = 1e-9
"""Allowed difference [m, rad, m/s, rad/s]: rounding of one frame is 1e-14, and the drives have 400 to 600 frames."""

COLUMNS: Final = (
    *("x", "y", "yaw", "speed", "lateral_speed", "yaw_rate"),
    *("front_slip", "rear_slip", "pitch", "roll"),
)

STATES: Final = {
    "pedals": (
        *(19.261903612717, 5.103644986006, 0.453554460554, 0.080694890622, 0.0),
        *(0.001379493014, 0.0, 0.0, -0.001189126057, 0.0),
    ),
    "speeds": (
        *(83.863987363347, 28.156051540601, 2.955166720973, 7.956217260933, -0.23752428648),
        *(0.803307356701, -0.061173629586, -0.029418944239, -0.027985599501, 0.05611508475),
    ),
    "backwards": (
        *(-4.999016620393, 5.880429413721, 1.471442769309, 6.999086740781, -0.027629888673),
        *(0.123928690461, -0.00616826387, -0.003947463301, -4.2548203e-05, 0.006942885613),
    ),
    "many": (
        *(-7.376608027912, 273.1021721414, 3.117216220157, 17.11988325515, -0.717902710267),
        *(0.453857450226, -0.209601932886, -0.041897474319, -0.004186417545, 0.061843622303),
    ),
    "placed": (
        *(-3.267108547608, 10.291101201848, -0.895634245513, 5.649052758788, -0.23057740035),
        *(1.258604867108, -0.088574026215, -0.04068226578, -0.002124735903, 0.055889171798),
    ),
}
"""Of the last ego of each drive."""


@pytest.mark.parametrize("name", DRIVES)
def test_single_track_drive_ends_in_the_known_state(name: str) -> None:
    world = World(7, Dynamics.SINGLE_TRACK)
    DRIVES[name](world)
    row = world.rows(Kind.EGO)[-1]
    found = [getattr(world, column).item(row) for column in COLUMNS]
    assert found == pytest.approx(STATES[name], rel=0.0, abs=CLOSE)
