"""Drives of egos end with the same bits as ever; those of the kinematic model had them before there was another model.

The drives run in a process of their own with AVX-512 off, unless this one is such a process: see `processors.py`.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from typing import Final

import pytest

from rosbridge_sim.world.state.world import Dynamics, Kind, World
from tests.world.ego_drives import DRIVES
from tests.world.processors import WITHOUT_AVX_512, is_without_avx_512

DIGESTS: Final = {
    Dynamics.KINEMATIC: {
        "pedals": "30ec711d1a6ebcb823da0d6211cc5355",
        "speeds": "842b115f7acdcb06d4584d71aa1034cd",
        "backwards": "89342cdf14bb653fe18fa8fc464400c2",
        "many": "13277ac83539e3d4c9b42adead6733c6",
        "placed": "aa393684f9a9e3c2751c919b4397f0e8",
    },
    Dynamics.SINGLE_TRACK: {
        "pedals": "61f55fc12a7e3bee24c8f38a6e944fad",
        "speeds": "bc1e5cd49e2cd3db6a0532e008a9eb6b",
        "backwards": "67bb6727a46aaf30957c4fdb5c44b9b7",
        "many": "dfa9dd66b6212176e6179caa3ea8d3fc",
        "placed": "8316de0bd140a8ac4cc0bb66f14a250a",
    },
}

CLOSE: Final = 1e-9
"""Allowed difference of states between processors [m, rad, m/s, rad/s]: rounding of one frame is 1e-14, and the drives
have 400 to 600 frames."""

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


PROGRAM = """
import json
from tests.world.test_ego_drives import digests_here

print(json.dumps(digests_here()))
"""


def digest_here(dynamics: Dynamics, name: str) -> str:
    """Return the digest of a drive, computed by this process."""
    world = World(7, dynamics)
    DRIVES[name](world)
    return world.digest()


def digests_here() -> dict[str, dict[str, str]]:
    """Return the digest of each drive, by model."""
    return {dynamics.name: {name: digest_here(dynamics, name) for name in DRIVES} for dynamics in Dynamics}


@pytest.fixture(scope="module")
def digests() -> dict[str, dict[str, str]]:
    """Those of a process without AVX-512; none if this is one, which needs one drive for each test."""
    if is_without_avx_512():
        return {}
    environment = {**os.environ, **WITHOUT_AVX_512, "PYTHONPATH": os.pathsep.join(sys.path)}
    command = [sys.executable, "-W", "ignore", "-c", PROGRAM]
    done = subprocess.run(command, env=environment, capture_output=True, check=True)
    found: dict[str, dict[str, str]] = json.loads(done.stdout)
    return found


@pytest.mark.parametrize("name", DRIVES)
@pytest.mark.parametrize("dynamics", Dynamics, ids=lambda dynamics: dynamics.name)
def test_drive_has_the_known_bits(dynamics: Dynamics, name: str, digests: dict[str, dict[str, str]]) -> None:
    found = digests[dynamics.name][name] if digests else digest_here(dynamics, name)
    assert found == DIGESTS[dynamics][name]


@pytest.mark.parametrize("name", DRIVES)
def test_single_track_drive_ends_in_the_known_state(name: str) -> None:
    world = World(7, Dynamics.SINGLE_TRACK)
    DRIVES[name](world)
    row = world.rows(Kind.EGO)[-1]
    found = [getattr(world, column).item(row) for column in COLUMNS]
    assert found == pytest.approx(STATES[name], rel=0.0, abs=CLOSE)
