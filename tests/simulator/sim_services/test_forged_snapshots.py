"""Everything that a snapshot holds counts: each value, changed alone, is noticed when the snapshot is restored."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any, TypeAlias

import numpy as np
import pytest

from rosbridge_sim.simulator.plain.plain_bytes import decode
from rosbridge_sim.simulator.plain.snapshot_bytes import pack, unpack
from tests.simulator.sim_services.snapshot_fixture import hash_of, restore, snapshot
from tests.simulator.sim_services.test_any_snapshot import Run

ACTS: dict[str, list[tuple[Any, ...]]] = {
    "": [
        *[("egos", [0, 2]), ("mode", 6), ("put", "a car on a path", 1.0), ("put", "a walker", 9.0)],
        *[("put", "a driver", 3.0), ("light", 4), ("control", 9, 0.5), ("gear", 12, 2), ("lamps", 1), ("sensor", 1.0)],
        *[("load later", "crowd", 14), ("spawn", "Box", 11), ("remove", 3, 12), ("ghost", 40, 3.0), ("tick", 5)],
    ],
    "world": [("score", False), ("put", "a box", 50.0), ("egos", [0, 3]), ("load", "crowd", True), ("tick", 4)],
    "components": [("mirror", 1), ("tick", 1)],
}
"""Part of the state of which each value is changed, empty for all, and what is done before."""

Path: TypeAlias = tuple[Any, ...]


def leaves(value: Any, path: Path = (), *, is_whole: bool) -> Iterator[Path]:  # noqa: ANN401 - plain data
    """Paths to all values that hold no others; of an array to all columns of its first row and of its last one.

    If it is not whole, one of these two rows is taken for each column, in turn.
    """
    if isinstance(value, dict):
        for key, item in value.items():
            yield from leaves(item, (*path, key), is_whole=is_whole)
    elif isinstance(value, (list, tuple)):
        for i, item in enumerate(value):
            yield from leaves(item, (*path, i), is_whole=is_whole)
    elif isinstance(value, np.ndarray):
        if value.size:
            if value.ndim == 1:
                places: list[Any] = _some(len(value))
            elif path[-1] in {"floats", "ints", "bools"}:  # here the columns are the first axis
                rows = _some(value.shape[1])
                places = [(i, j) for i in range(len(value)) for j in (rows if is_whole else [rows[i % len(rows)]])]
            else:
                rows = _some(len(value))
                places = [(i, j) for j in range(value.shape[1]) for i in (rows if is_whole else [rows[j % len(rows)]])]
            yield from ((*path, place) for place in places)
    else:
        yield path


def _some(num: int) -> list[int]:
    """The first row or item and the last one."""
    return sorted({0, num - 1})


def another(value: Any) -> Any:  # noqa: ANN401 - plain data
    """A value near one, of its type."""
    if isinstance(value, (bool, np.bool_)):
        return not value
    if isinstance(value, (int, np.integer)):
        return value + 1
    if isinstance(value, (float, np.floating)):
        return math.nextafter(value, math.inf) if math.isfinite(value) else -value
    if isinstance(value, str):
        return value + "x"
    if isinstance(value, bytes):
        return value[:-1] + bytes([value[-1] ^ 1]) if value else b"x"
    assert value is None, value
    return 0


def changed(value: Any, path: Path, new: Any) -> Any:  # noqa: ANN401 - plain data
    """A copy with another value at a path."""
    if not path:
        return new
    key, rest = path[0], path[1:]
    if isinstance(value, np.ndarray):
        array = value.copy()
        array[key] = new
        return array
    result: Any = dict(value) if isinstance(value, dict) else list(value)
    result[key] = changed(value[key], rest, new)
    return tuple(result) if isinstance(value, tuple) else result


def at(value: Any, path: Path) -> Any:  # noqa: ANN401 - plain data
    for key in path:
        value = value[key]
    return value


@pytest.mark.slow
@pytest.mark.parametrize("is_whole", [False, pytest.param(True, marks=pytest.mark.long)], ids=["in turn", "whole"])
@pytest.mark.parametrize(("part", "acts"), ACTS.items(), ids=["traffic", "scores", "a replay"])
def test_each_changed_value_of_a_snapshot_is_refused(part: str, acts: list[tuple[Any, ...]], *, is_whole: bool) -> None:
    run = Run("22.R2")
    for act in acts:
        run.do(*act)
    data = bytes(snapshot(run.client).data)
    head, packed = unpack(data)
    state = decode(packed)
    before = hash_of(run.client)
    unnoticed = []
    for path in leaves(state, is_whole=is_whole):
        if not path[0].startswith(part):
            continue
        response = restore(run.client, pack(head, changed(state, path, another(at(state, path)))))
        if response.result:
            unnoticed.append(path)
            assert restore(run.client, data).result
    assert hash_of(run.client) == before
    assert unnoticed == []
