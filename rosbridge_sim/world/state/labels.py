"""Labels of bodies, and checks of poses: pure functions for the population of the world."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields
from functools import lru_cache
from hashlib import blake2b
from operator import attrgetter
from typing import Final

import numpy as np

from rosbridge_sim.world.geometry.planar import FloatArray, IntArray
from rosbridge_sim.world.state.entity_types import MAX_COORDINATE, MAX_SPEED, Body, Kind

LOOK_AHEAD: Final = 0.5
"""Length over which a body without axles turns at a corner of its path [m]: a pedestrian's step."""


MAX_KNOWN_NAME: Final = 80
"""Longest name whose label is cached [characters]: names come from clients, and may be megabytes."""


_LABELLED: Final = attrgetter(*[each.name for each in fields(Body) if each.repr])
"""Figures of a body that its label stands for: those of the kinematic model, whose digests never change. The others are
columns of egos."""


def check_pose(**values: float) -> None:
    """Check that pose and speed are finite and within the bounds of the world.

    Args:
        values: by name, in the world's units; `speed` has a bound of its own.

    Raises:
        ValueError: names the first value that is not finite or out of bounds.
    """
    for name, value in values.items():
        limit = MAX_SPEED if name == "speed" else MAX_COORDINATE
        if not -limit <= value <= limit:
            raise ValueError(f"{name}: expected a number within +-{limit:g}, got {value!r}")


def reach_of(kind: Kind, body: Body) -> float:
    """Return the length over which a body turns on its path [m]; for a vehicle it puts the front axle on the path."""
    return usual_wheelbase(body) if kind == Kind.VEHICLE else LOOK_AHEAD


def usual_wheelbase(body: Body) -> float:
    """Return the wheelbase of a body, or that of a usual vehicle of its length where none is given [m]."""
    return body.wheelbase or 0.6 * body.length


def in_space(path: FloatArray, z: float) -> FloatArray:
    """Return waypoints with three columns; those of two columns get the height z [m]."""
    points = np.asarray(path, dtype=np.float64)
    if points.ndim == 2 and points.shape[1] == 2:  # noqa: PLR2004 - x and y
        return np.column_stack([points, np.full(len(points), z)])
    return points


BOX_COLUMNS: Final = ("half_length", "half_width", "height", "centre")
"""Columns of a row that `box_of` gives."""


def box_of(body: Body) -> tuple[float, float, float, float]:
    """Return half length, half width, height and centre of a body's box; see `Body` [m]."""
    return body.length / 2, body.width / 2, body.height, body.centre


def labels_and_boxes(names: Sequence[str], bodies: Sequence[Body]) -> tuple[IntArray, FloatArray]:
    """Return the labels, (m,), and the boxes, (4, m) as `box_of`, of many entities; nearly all are of a few models.

    Args:
        names: (m) of the entities.
        bodies: (m) their bodies.
    """
    known: dict[tuple[str, int], int] = {}  # a body itself would be slow to look up
    pairs = zip(names, map(id, bodies), strict=True)
    which = np.fromiter((known.setdefault(pair, len(known)) for pair in pairs), dtype=np.int64, count=len(names))
    firsts = np.unique(which, return_index=True)[1].tolist()
    labels = np.array([label_of(names[i], bodies[i]) for i in firsts], np.int64)
    boxes = np.array([box_of(bodies[i]) for i in firsts], np.float64).reshape(-1, 4)
    return labels[which], boxes[which].T


def label_of(name: str, body: Body) -> int:
    """Return 63 bits that stand for name and body, so that a digest needs only an array of integers."""
    return _label_once(name, body) if len(name) <= MAX_KNOWN_NAME else _label(name, body)


@lru_cache(1_000)
def figures_of(body: Body) -> bytes:
    """Return all figures of a body as bytes, for digests."""
    return repr(tuple(float(getattr(body, each.name)) for each in fields(Body))).encode()


def figures_of_all(bodies: Sequence[Body]) -> bytes:
    """Return the figures of many bodies, of which many are the same object."""
    figures = {id(body): figures_of(body) for body in {id(body): body for body in bodies}.values()}
    return b"".join([figures[id(body)] for body in bodies])


def _label(name: str, body: Body) -> int:
    figures = tuple(map(float, _LABELLED(body)))  # 4 and 4.0 are the same length, and the cache knows them as one
    return int.from_bytes(blake2b(repr((name, figures)).encode(), digest_size=8).digest()) >> 1


_label_once = lru_cache(maxsize=1024)(_label)
