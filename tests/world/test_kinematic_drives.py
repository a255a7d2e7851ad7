"""Drives of the kinematic model: the bits are those of the version before there was another model.

The drives run in a process of their own with AVX-512 off, unless this one is such a process: see `processors.py`.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys

import pytest

from rosbridge_sim.world.state.world import Dynamics, World
from tests.world.kinematic_drives import DRIVES
from tests.world.processors import WITHOUT_AVX_512, is_without_avx_512

DIGESTS = {
    "pedals": "30ec711d1a6ebcb823da0d6211cc5355",
    "speeds": "842b115f7acdcb06d4584d71aa1034cd",
    "backwards": "89342cdf14bb653fe18fa8fc464400c2",
    "many": "13277ac83539e3d4c9b42adead6733c6",
    "placed": "aa393684f9a9e3c2751c919b4397f0e8",
}

PROGRAM = """
import json
from tests.world.test_kinematic_drives import digests_here

print(json.dumps(digests_here()))
"""


def digests_here() -> dict[str, str]:
    """Return the digest of each drive, computed by this process."""
    found = {}
    for name, drive in DRIVES.items():
        world = World(7, Dynamics.KINEMATIC)
        drive(world)
        found[name] = world.digest()
    return found


@pytest.fixture(scope="module")
def digests() -> dict[str, str]:
    if is_without_avx_512():
        return digests_here()
    environment = {**os.environ, **WITHOUT_AVX_512, "PYTHONPATH": os.pathsep.join(sys.path)}
    command = [sys.executable, "-W", "ignore", "-c", PROGRAM]
    done = subprocess.run(command, env=environment, capture_output=True, check=True)
    found: dict[str, str] = json.loads(done.stdout)
    return found


@pytest.mark.parametrize("name", DRIVES)
def test_kinematic_drive_has_the_known_bits(name: str, digests: dict[str, str]) -> None:
    assert digests[name] == DIGESTS[name]


@pytest.mark.parametrize("name", DRIVES)
def test_the_models_differ(name: str) -> None:
    kinematic, single_track = World(7, Dynamics.KINEMATIC), World(7, Dynamics.SINGLE_TRACK)
    DRIVES[name](kinematic)
    DRIVES[name](single_track)
    assert single_track.digest() != kinematic.digest()
