"""Equations written with `+ - * /`, recorded once as the calls of a row program.

A function that computes with numbers gets `Value`s in their place. Each operation on them adds a call to an
`EquationRecorder`. `finish` gives each value a place in memory and hands the calls over to a `RowProgram`. A place is
used again once the last call that needs its value is made, so a thousand rows stay in the cache of the processor.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, Final

import numpy as np

from rosbridge_sim.world.geometry.planar import BoolArray, FloatArray, wrap_angle
from rosbridge_sim.world.state.row_program import RowProgram

_Function = Callable[..., object]


class Value:
    """One number for each row, which the program will compute."""

    __slots__ = ("_recorder", "index")

    def __init__(self, recorder: EquationRecorder, index: int) -> None:
        self._recorder = recorder
        self.index = index

    def call(self, function: _Function, *others: Value | float) -> Value:
        """Return the result of a function of this value and others; the last argument of the call takes the result."""
        return self._recorder.call(function, self, *others)

    def __add__(self, other: Value | float) -> Value:
        return self.call(np.add, other)

    def __radd__(self, other: float) -> Value:
        return self._recorder.call(np.add, other, self)

    def __sub__(self, other: Value | float) -> Value:
        return self.call(np.subtract, other)

    def __rsub__(self, other: float) -> Value:
        return self._recorder.call(np.subtract, other, self)

    def __mul__(self, other: Value | float) -> Value:
        return self.call(np.multiply, other)

    def __rmul__(self, other: float) -> Value:
        return self._recorder.call(np.multiply, other, self)

    def __truediv__(self, other: Value | float) -> Value:
        return self.call(np.divide, other)

    def __rtruediv__(self, other: float) -> Value:
        return self._recorder.call(np.divide, other, self)

    def __neg__(self) -> Value:
        return self.call(np.negative)


class EquationRecorder:
    """The calls of equations, in order.

    Args:
        num: rows of the program.
    """

    def __init__(self, num: int) -> None:
        self._num = num
        self._arrays: list[FloatArray | None] = []  # by index of the value; None until it has a place
        self._calls: list[tuple[_Function, tuple[int, ...], int]] = []
        self._constants: dict[str, int] = {}

    def given(self, array: FloatArray) -> Value:
        """Return the value of an array (k,) that exists already; it is read and never written."""
        self._arrays.append(array)
        return Value(self, len(self._arrays) - 1)

    def call(self, function: _Function, *args: Value | float) -> Value:
        """Record a call."""
        indices = tuple([arg.index if isinstance(arg, Value) else self._constant(arg) for arg in args])
        self._arrays.append(None)
        result = len(self._arrays) - 1
        self._calls.append((function, indices, result))
        return Value(self, result)

    def finish(self, program: RowProgram, results: Sequence[Value], targets: Sequence[FloatArray]) -> None:
        """Hand the calls over to a program.

        Args:
            program: gets the calls.
            targets: (k,) arrays that take these; written after all other calls.
        """
        last_use = {index: i for i, (_, args, _) in enumerate(self._calls) for index in args}
        last_use |= {result.index: len(self._calls) for result in results}
        free: list[FloatArray] = []
        places = list(self._arrays)
        for i, (function, args, result) in enumerate(self._calls):
            if result not in last_use:
                continue  # nobody reads it
            arrays: list[Any] = [places[index] for index in args]
            ending = {
                index: place
                for index in args
                if self._arrays[index] is None and last_use[index] == i and (place := places[index]) is not None
            }
            if isinstance(function, np.ufunc):  # it may write over what it reads
                free += ending.values()
                ending = {}
            place = places[result] = free.pop() if free else np.empty(self._num)
            program.do(function, *arrays, place)
            free += ending.values()
        for value, target in zip(results, targets, strict=True):
            program.do(np.copyto, target, places[value.index])

    def _constant(self, number: float) -> int:
        key = number.hex()  # 0.0 and -0.0 are different
        if key not in self._constants:
            self._constants[key] = self.given(np.full(self._num, number)).index
        return self._constants[key]


class RecordedOperators:
    """The functions of `single_track.Operators` for values."""

    def least(self, a: Value, b: Value | float, /) -> Value:
        """Return the smaller one; 0 without a sign."""
        return a.call(np.fmin, b) + 0.0

    def most(self, a: Value, b: Value | float, /) -> Value:
        """Return the greater one; 0 without a sign."""
        return a.call(np.fmax, b) + 0.0

    def pick(self, condition: Value, if_positive: Value | float, otherwise: Value | float, /) -> Value:
        """Return the second argument where the first one is positive, else the third one."""
        return condition.call(_pick, if_positive, otherwise)

    def is_any(self, _a: Value, /) -> bool:
        """Return True: the program must serve all values."""
        return True

    def magnitude(self, a: Value, /) -> Value:
        """Return the amount."""
        return a.call(np.absolute)

    def root(self, a: Value, /) -> Value:
        """Return the square root of a number >= 0."""
        return a.call(np.sqrt)

    def sin(self, a: Value, /) -> Value:
        """Return the sine."""
        return a.call(np.sin)

    def cos(self, a: Value, /) -> Value:
        """Return the cosine."""
        return a.call(np.cos)

    def arctan(self, a: Value, /) -> Value:
        """Return the arc tangent."""
        return a.call(np.arctan)

    def wrap(self, a: Value, /) -> Value:
        """Return an angle within (-pi, pi]; one inside keeps its bits."""
        return a.call(_wrap)


RECORDED: Final = RecordedOperators()


def _pick(condition: FloatArray, if_positive: FloatArray, otherwise: FloatArray, out: FloatArray) -> None:
    is_positive: BoolArray = np.greater(condition, 0.0)
    np.copyto(out, otherwise)
    np.copyto(out, if_positive, where=is_positive)


def _wrap(angle: FloatArray, out: FloatArray) -> None:
    np.copyto(out, angle)
    is_outside = (angle <= -math.pi) | (angle > math.pi)
    if np.count_nonzero(is_outside):
        out[is_outside] = wrap_angle(angle[is_outside])
