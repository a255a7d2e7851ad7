"""Chance that depends on the seed of the world and on numbers given by the caller, and on nothing else.

It draws nothing from the world's random generator. So a new entity does not change the chances of the others, and the
order of the questions does not matter.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
import numpy.typing as npt

from rosbridge_sim.world.geometry.planar import FloatArray, IntArray

_SEED_FACTOR: Final = 0x632BE59BD9B4E019
"""An odd number, so that worlds with neighbouring seeds get unrelated choices."""

_GOLDEN_GAMMA: Final = np.uint64(0x9E3779B97F4A7C15)
"""The odd number nearest to 2^64 / golden ratio, as SplitMix64 has it (Steele, Lea, Flood 2014)."""

_NUM_PARTS: Final = 4
_PART_BITS: Final = np.uint64(16)
_PART_MASK: Final = np.uint64(0xFFFF)
_DEVIATION: Final = (_NUM_PARTS / 12.0) ** 0.5
"""A sum of four uniform numbers in 0..1 has this standard deviation, and a mean of 2 (the Irwin-Hall distribution)."""


def mix(value: npt.NDArray[np.uint64]) -> npt.NDArray[np.uint64]:
    """Return 64 well-mixed bits for each number: the finalizer of SplitMix64 (Steele, Lea, Flood 2014)."""
    value = value * _GOLDEN_GAMMA
    value = (value ^ (value >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    value = (value ^ (value >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return value ^ (value >> np.uint64(31))


def salt_of(seed: int, uid: IntArray) -> npt.NDArray[np.uint64]:
    """Return 64 bits for each entity, in which worlds of different seeds differ.

    Args:
        uid: (k,) int64, ids of entities.
    """
    return mix(uid.astype(np.uint64) + np.uint64(seed * _SEED_FACTOR % 2**64))


def salt_of_seeds(seeds: Sequence[int], which: IntArray, uid: IntArray) -> npt.NDArray[np.uint64]:
    """Return the same for entities of many worlds.

    Args:
        which: (k,) int64, the world of each entity.
        uid: (k,) int64, ids of entities.
    """
    offset = np.array([seed * _SEED_FACTOR % 2**64 for seed in seeds], dtype=np.uint64)
    return mix(uid.astype(np.uint64) + offset[which])


def bell(salt: npt.NDArray[np.uint64], question: int) -> FloatArray:
    """Return numbers with a bell-shaped distribution: mean 0, standard deviation 1, within +-3.47.

    The sum of four uniform numbers takes no logarithm, so it has the same bits on every machine.

    Args:
        salt: (k,) uint64; see `salt_of`.
        question: numbers for different questions are independent of one another.
    """
    bits = mix(salt ^ mix(np.full(1, question + 1, dtype=np.uint64)))
    total = np.zeros(len(salt))
    for part in range(_NUM_PARTS):
        total += ((bits >> (_PART_BITS * np.uint64(part))) & _PART_MASK).astype(np.float64)
    scale = float(1 << 16)
    return np.asarray(((total + 0.5 * _NUM_PARTS) / scale - 0.5 * _NUM_PARTS) / _DEVIATION)
