"""Dataclasses as plain data and back, checked against their annotations."""

from __future__ import annotations

import math
from typing import TypeVar

import msgspec
import numpy as np

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.simulator.plain.plain_bytes import PlainData
from rosbridge_sim.world.state.entity_types import MAX_COORDINATE

T = TypeVar("T")


def as_plain(value: object) -> PlainData:
    """Return a dataclass, or a container of such, as plain data; arrays must be figures."""
    return msgspec.to_builtins(value, builtin_types=(bytes,), enc_hook=_plain_array)


def read_as(kind: type[T], data: object, where: str) -> T:
    """Return plain data as a value of a type: a dataclass, a container or a plain type.

    Args:
        data: from anywhere.
        where: what it is, for errors.

    Raises:
        DocumentError: it is no such value.
    """
    try:
        return msgspec.convert(data, kind, dec_hook=_read_array, builtin_types=(bytes,))
    # msgspec's own errors are ValueErrors; an array in the place of a dict raises numpy's IndexError.
    except (ValueError, TypeError, IndexError, RecursionError) as error:
        raise DocumentError(f"{where}: {(str(error).splitlines() or [''])[0]:.200}") from None


def check_finite(value: object, where: str) -> None:
    """Check that all figures of plain data are finite.

    Raises:
        DocumentError: one is not.
    """
    if isinstance(value, dict):
        for key, item in value.items():
            check_finite(item, f"{where}.{key}")
    elif isinstance(value, (list, tuple)):
        for item in value:
            check_finite(item, where)
    elif isinstance(value, float) and not math.isfinite(value):
        raise DocumentError(f"{where}: expected a finite number")


def _plain_array(value: object) -> PlainData:
    assert isinstance(value, np.ndarray), value
    return {"shape": value.shape, "data": np.asarray(value, dtype=np.float64).tobytes()}


def _read_array(_kind: object, data: object) -> object:
    if not isinstance(data, dict):
        raise TypeError("expected an array of figures")
    shape, content = msgspec.convert(
        (data.get("shape"), data.get("data")), tuple[tuple[int, ...], bytes], builtin_types=(bytes,)
    )
    if len(shape) > 2 or min(shape, default=0) < 0 or math.prod(shape) * 8 != len(content):  # noqa: PLR2004 - a table
        raise ValueError("expected an array of figures")
    array = np.frombuffer(content, dtype=np.float64).reshape(shape).copy()
    if not bool((np.abs(array) <= MAX_COORDINATE).all()):
        raise ValueError(f"expected figures within +-{MAX_COORDINATE:g}")
    return array
