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
from tests.world.ego_drives import DRIVES, digest_here
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
        "pedals": "7edb4537bb14714eb53c1f6769be0e9c",
        "speeds": "13c933407017ae6d343b7c437db152fc",
        "backwards": "e1171eaef86973d2cbec0f28827f5bcf",
        "many": "a63d683b5b455e88206128dfbdac8441",
        "placed": "68125970d7dd4bd0a4420fd4fb66ff64",
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
        *(19.008267504216, 4.451060356567, 0.510310287158, 0.07637237513, 0.0),
        *(0.001305598869, 0.0, 0.0, -0.001147548001, 0.0),
    ),
    "speeds": (
        *(84.107517024231, 26.815087401187, 2.839525543434, 8.153890821277, -0.245803763104),
        *(0.818264473861, -0.062656477964, -0.029603943584, -0.030073814109, 0.057397060001),
    ),
    "backwards": (
        *(-4.996749593511, 5.87955991443, 1.471250846732, 6.999086740709, -0.027629922051),
        *(0.123928838677, -0.006168211484, -0.003947468078, -4.2548236e-05, 0.006942894255),
    ),
    "many": (
        *(-9.464415528116, 282.47541837694, 2.989698040491, 20.069814938165, -0.977693711944),
        *(0.411590652014, -0.234990905975, -0.048654803834, -0.005264073752, 0.065527884337),
    ),
    "placed": (
        *(-3.254968297452, 10.288481502433, -0.892294493416, 5.648982979721, -0.231463157692),
        *(1.261431191993, -0.087669975693, -0.0408364249, -0.002131628835, 0.055996901573),
    ),
}
"""Of the last ego of each drive."""


PROGRAM = """
import json
from tests.world.ego_drives import digests_here

print(json.dumps(digests_here()))
"""


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
