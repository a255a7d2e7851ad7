"""Row programs: some rows of the world as arrays without gaps, and the numpy calls that each step makes on them.

With twenty entities, a step is call overhead rather than arithmetic: 0.2 us for each numpy call on small arrays of
equal shape, twice that when an operand is a Python number or an output is named, and as much again to look up modules
and attributes. So a program looks everything up once: a module adds its calls when the program is made (`do`), and a
step only runs them. That is possible because a step has no branches over rows. Everything that changes the list of
calls (entities that come or go, modes) is a `World.touch`, after which the program is made again.

Constants are arrays of the program's own length for the same reason. A single row is taken twice, because numpy (2.4)
needs 0.8 us for an operation in place on one element, and 0.2 us on two.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
import numpy.typing as npt

from rosbridge_sim.world.geometry.planar import FloatArray, IntArray
from rosbridge_sim.world.state.world_rows import WorldRows


class MovedRows:
    """Rows that a program moves. It lives until the next `World.touch`; see there.

    Attributes:
        world: has the rows.
        rows: (num,) int64.
        dt: length of the step that the program is for [s].
        program: its calls.
    """

    program: RowProgram

    def __init__(self, world: WorldRows, rows: IntArray) -> None:
        self.world, self.rows, self.num = world, rows, len(rows)
        self.dt = 0.0

    def advance(self, dt: float) -> None:
        """Move the rows by `dt` [s]."""
        if dt != self.dt:
            self.dt = dt
            self.write_program()
        self.program.run()

    def write_program(self) -> None:
        """Make the program for steps of `dt`."""
        raise NotImplementedError


class RowProgram:
    """The columns `first` to `last` of some rows, and the calls that change them.

    If the rows are neighbours, as in most worlds, the values are a view of the world's arrays. Otherwise they are a
    copy, which `run` takes before its calls and writes back after them. Both give the same bits.

    Attributes:
        rows: (k,) int64, the rows; a single one stands twice.
        num: k, at least 2.
        values: (columns, k) float64.
    """

    __slots__ = ("_calls", "_write_back", "num", "rows", "values")

    def __init__(self, world: WorldRows, rows: IntArray, first: str, last: str, *, written_from: str) -> None:
        """Choose rows and columns.

        Args:
            world: the world whose arrays are read and written.
            rows: (k,) int64, rising, at least one.
            first: name of the first column, see `entity_arrays.FLOATS`.
            last: name of the last column.
            written_from: name of the first column that the calls may write; all after it may be written too.
        """
        first_row, last_row = int(rows[0]), int(rows[-1])
        columns, written = world.block(first, last), world.block(written_from, last)
        self.rows = rows.repeat(2) if len(rows) == 1 else rows
        self.num = len(self.rows)
        self._calls: list[Callable[[], object]] = []
        self._write_back: Callable[[], object] | None = None
        if last_row - first_row + 1 == self.num:
            self.values = columns[:, first_row : last_row + 1]
            return
        self.values = columns[:, self.rows]
        results = self.values[len(columns) - len(written) :]
        if len(rows) == 1:
            row = slice(first_row, first_row + 1)
            self.do(np.copyto, self.values, columns[:, row])
            self._write_back = partial(np.copyto, written[:, row], results[:, :1])
        else:
            self.do(columns.take, self.rows, 1, self.values, "clip")
            self._write_back = partial(written.__setitem__, (slice(None), self.rows), results)

    def constant(self, value: npt.ArrayLike) -> FloatArray:
        """Return a (k,) array that holds a number, or one number for each row."""
        values = np.empty(self.num)
        values[:] = value
        return values

    def do(self, function: Callable[..., object], *args: object) -> None:
        """Add a call. For a ufunc the last argument is the array that takes the result."""
        self._calls.append(partial(function, *args))

    def run(self) -> None:
        """Make the calls in the order in which they were added."""
        for call in self._calls:
            call()
        if self._write_back is not None:
            self._write_back()
