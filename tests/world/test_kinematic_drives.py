"""Drives of the kinematic model: the bits are those of the version before there was another model."""

from __future__ import annotations

import pytest

from rosbridge_sim.world.state import Dynamics, World
from tests.world.kinematic_drives import DRIVES

DIGESTS = {
    "pedals": "788ea4fb7b85763189ed8f9ab3f01e37",
    "speeds": "d0dbb2ffea2024ad120d6a07993f8cf5",
    "backwards": "b077de0c9cb5b5f545085bc866b422ac",
    "many": "bbd985276563e40ef2759a5d63ba2675",
    "placed": "88a23d407acfdf97873be4e6166a828b",
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
