"""The structure that compiled loops get, as an array of words: whole numbers, and the addresses of arrays."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final, Literal

import numpy as np
import numpy.typing as npt

from rosbridge_sim.world.kernels.c_source import NUMBERS, PLACE_OF, names_in
from rosbridge_sim.world.state.entity_arrays import FLOATS, INTS
from rosbridge_sim.world.state.world_rows import WorldRows

_TYPES: Final = {"D": np.float64, "I": np.int64, "B": np.bool_, "V": np.complex128}


_OfDecisions = Literal["begin_decision", "perceive", "accelerate", "look_at_lanes_beside", "signal_changes"]
_OfHeadings = Literal["follow_wishes", "look_at_headings", "take_headings", "plan_aside", "steer"]
_OfSteps = Literal["find_slants", "move", "nudge", "drive_cars", "find_places", "look_at_kerbs", "mind_kerbs"]
_OfPairs = Literal["watch_pairs", "list_pairs", "judge_pairs"]
_OfScores = Literal["list_headings", "judge_egos", "look_at_lanes", "find_others", "describe_others", "measure"]
LoopName = Literal[_OfDecisions, _OfHeadings, _OfSteps, _OfPairs, _OfScores]

CompiledLoops = Mapping[LoopName, Callable[..., int]]
"""The compiled loops: functions of the address of the structure, see `compiler.load_library`."""


class LoopFields:
    """The structure of `c_source`; it keeps the arrays whose addresses it holds.

    Attributes:
        address: of the structure.
        arrays: by name, without columns of the world.
    """

    def __init__(self) -> None:
        self._words = np.zeros(len(PLACE_OF), np.int64)
        self.address = _address(self._words)
        self.arrays: dict[str, npt.NDArray[Any]] = {}
        self._blocks: Sequence[npt.NDArray[Any]] = ()

    def __getitem__(self, number: str) -> int:
        return self._words.item(PLACE_OF[number])

    def __setitem__(self, number: str, value: int) -> None:
        self._words[PLACE_OF[number]] = value

    def take_columns(self, world: WorldRows) -> None:
        """Take all columns of a world."""
        self._blocks = world.block(FLOATS[0], FLOATS[-1]), world.int_block(INTS[0], INTS[-1]), world.bool_block()
        first = len(NUMBERS)
        for block in self._blocks:
            last = first + len(block)
            self._words[first:last] = _address(block) + np.arange(len(block)) * block.strides[0]
            first = last

    def take(self, **arrays: npt.NDArray[Any]) -> None:
        """Take arrays, whose last axis is contiguous."""
        for name, array in arrays.items():
            if self.arrays.get(name) is not array:
                self.arrays[name], self._words[PLACE_OF[name]] = array, _address(array)

    def copy(self, source: object, names: Mapping[str, str] | str, prefix: str = "") -> None:
        """Take attributes of an object, whose names have a prefix in the structure; None is none."""
        every = names.split() if isinstance(names, str) else names_in(names)
        arrays = {prefix + name: getattr(source, name) for name in every}
        self.take(**{name: array for name, array in arrays.items() if array is not None})

    def make(self, table: Mapping[str, str], num: int) -> None:
        """Make arrays of zeros."""
        for kind, names in table.items():
            self.take(**{name: np.zeros(max(num, 1), _TYPES[kind]) for name in names.split()})


def _address(array: npt.NDArray[Any]) -> int:
    address: int = array.__array_interface__["data"][0]
    return address
