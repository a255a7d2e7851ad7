"""Drives of the kinematic model: the bits are those of the version before there was another model."""

from __future__ import annotations

import pytest

from rosbridge_sim.world.state import Dynamics, World
from tests.world.kinematic_drives import DRIVES

DIGESTS = {
    "pedals": "b75696f0dce1ce17241a5ec99b16d6a0",
    "speeds": "a84385a15eee89baca3c6c00beec8287",
    "backwards": "c921dfdb16005611ce530b75bbe200aa",
    "many": "d375623284dc12aeaf8378993f62edee",
    "placed": "433094ddf9358e705fa82319f5da2f93",
}


@pytest.mark.parametrize("name", DRIVES)
def test_kinematic_drive_has_the_known_bits(name: str) -> None:
    world = World(7, Dynamics.KINEMATIC)
    DRIVES[name](world)
    assert world.digest() == DIGESTS[name]


@pytest.mark.parametrize("name", DRIVES)
def test_the_models_differ(name: str) -> None:
    world = World(7, Dynamics.SINGLE_TRACK)
    DRIVES[name](world)
    assert world.digest() != DIGESTS[name]
