"""Checks of the arguments of `Worlds`."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from rosbridge_sim.world.geometry.planar import FloatArray


def check_number(name: str, value: object, least: int = 1) -> None:
    """Check that an argument is a whole number from 1 on.

    Args:
        least: 1, or another least number.

    Raises:
        ValueError: it is not.
    """
    if not isinstance(value, int | np.integer) or isinstance(value, bool) or value < least:
        raise ValueError(f"{name}: expected a whole number from {least} on, got {value!r}")


def broadcast(name: str, values: npt.ArrayLike, shape: tuple[int, ...]) -> FloatArray:
    """Return an argument in a shape.

    Raises:
        ValueError: it has another shape.
    """
    array = np.asarray(values, dtype=np.float64)
    if array.shape == shape:
        return array
    try:
        return np.broadcast_to(array, shape)
    except ValueError:
        raise ValueError(f"{name}: expected an array of shape {shape}, got {array.shape}") from None


def make_out(out: FloatArray | None, shape: tuple[int, ...]) -> FloatArray:
    """Return zeros, or the caller's array as zeros."""
    if out is None:
        return np.zeros(shape)
    if out.shape != shape:
        raise ValueError(f"out: expected shape {shape}, got {out.shape}")
    out[:] = 0.0
    return out
