"""The structures that compiled loops get, as arrays of words: whole numbers, and the addresses of arrays."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from rosbridge_sim.world.kernels.c_source import names_in

_TYPES: Final = {"D": np.float64, "I": np.int64, "B": np.bool_}


class LoopFields:
    """A structure of `c_source` that loops get; it keeps the arrays whose addresses it holds.

    Attributes:
        address: of the structure.
        arrays: by name.

    Args:
        place_of: the places of the fields in the structure.
    """

    def __init__(self, place_of: Mapping[str, int]) -> None:
        self._place_of, self._words = place_of, np.zeros(len(place_of), np.int64)
        self.address = _address(self._words)
        self.arrays: dict[str, npt.NDArray[Any]] = {}

    def __getitem__(self, number: str) -> int:
        return self._words.item(self._place_of[number])

    def __setitem__(self, number: str, value: int) -> None:
        self._words[self._place_of[number]] = value

    def take(self, **arrays: npt.NDArray[Any]) -> None:
        """Take arrays, whose last axis is contiguous."""
        for name, array in arrays.items():
            if self.arrays.get(name) is not array:
                self.arrays[name], self._words[self._place_of[name]] = array, _address(array)

    def copy(self, source: object, table: Mapping[str, str]) -> None:
        """Take the attributes of an object that a table names; None is none."""
        arrays = {name: getattr(source, name) for name in names_in(table)}
        self.take(**{name: array for name, array in arrays.items() if array is not None})

    def make(self, table: Mapping[str, str], num: int) -> None:
        """Make arrays of zeros."""
        for kind, names in table.items():
            self.take(**{name: np.zeros(max(num, 1), _TYPES[kind]) for name in names.split()})


def _address(array: npt.NDArray[Any]) -> int:
    address: int = array.__array_interface__["data"][0]
    return address
