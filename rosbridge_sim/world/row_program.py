"""Some rows of the world as arrays without gaps, and the list of numpy calls that each step makes on them.

With twenty entities a step is not arithmetic but call overhead: 0.2 us for each numpy call on small arrays of equal
shape, twice that when an operand is a Python number or an output is named, and as much again for looking up modules
and attributes on the way. So a block looks everything up once: a module *lays down* its calls when the block is made
(`do`), and a step only *runs* them. That is possible because a step has no branches over rows; whatever changes the
list of calls (who is there, in which mode) is a `World.touch`, after which the block is made anew.

Constants are arrays of the block's own length for the same reason; and a row that is alone is taken twice, since numpy
(2.4) needs 0.8 us for an operation in place on one element and 0.2 us on two.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
import numpy.typing as npt

from rosbridge_sim.world.geometry import FloatArray, IntArray
from rosbridge_sim.world.state import World

__all__ = ["RowProgram"]


class RowProgram:
    """The columns `first` to `last` of some rows, (columns, k), and what is done to them.

    Where the rows are neighbours, as in most worlds, the block is a view of the world's arrays; else a copy, which
    `run` takes before and brings back after its calls. Both give the same bits.

    Attributes:
        rows: (k,) the rows, a lone one twice, int64.
        num: k, at least 2.
        values: (columns, k) float64.
    """

    __slots__ = ("_bring_back", "_calls", "num", "rows", "values")

    def __init__(self, world: World, rows: IntArray, first: str, last: str, *, written_from: str) -> None:
        """Choose rows and columns; those from `written_from` to `last` are the ones that the calls may write.

        Args:
            world: whose.
            rows: (k,) rising, at least one, int64.
            first: the first column, see `state.FLOATS`.
            last: the last one.
            written_from: the first one that is written.
        """
        first_row, last_row = int(rows[0]), int(rows[-1])
        columns, written = world.block(first, last), world.block(written_from, last)
        self.rows = rows.repeat(2) if len(rows) == 1 else rows
        self.num = len(self.rows)
        self._calls: list[Callable[[], object]] = []
        self._bring_back: Callable[[], object] | None = None
        if last_row - first_row + 1 == self.num:
            self.values = columns[:, first_row : last_row + 1]
            return
        self.values = columns[:, self.rows]
        results = self.values[len(columns) - len(written) :]
        if len(rows) == 1:
            row = slice(first_row, first_row + 1)
            self.do(np.copyto, self.values, columns[:, row])
            self._bring_back = partial(np.copyto, written[:, row], results[:, :1])
        else:
            self.do(columns.take, self.rows, 1, self.values, "clip")
            self._bring_back = partial(written.__setitem__, (slice(None), self.rows), results)

    def constant(self, value: npt.ArrayLike) -> FloatArray:
        """Return a (k,) array of a number, or of one number for each row."""
        values = np.empty(self.num)
        values[:] = value
        return values

    def do(self, function: Callable[..., object], *args: object) -> None:
        """Lay down a call. For a ufunc the last argument is the array that takes the result."""
        self._calls.append(partial(function, *args))

    def run(self) -> None:
        """Make the calls in the order in which they were laid down."""
        for call in self._calls:
            call()
        if self._bring_back is not None:
            self._bring_back()
