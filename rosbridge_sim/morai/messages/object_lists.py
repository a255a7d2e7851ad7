"""Lists of objects for messages: which rows are listed, in which order, and the part of each that does not change."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, Final

import numpy as np

from rosbridge_sim.morai.releases import Profile
from rosbridge_sim.world.geometry.planar import FloatArray, IntArray
from rosbridge_sim.world.state.world import Body, Kind, World

DEGREES: Final = math.degrees(1.0)
"""Degrees in one radian."""


def exact_quotient(product: FloatArray, factor: float) -> FloatArray:
    """Return the number that gives `product` when it is multiplied by a factor, exact to the last bit where possible.

    A plain division sometimes differs in the last bit. A value that was converted for a message must give the same
    message
    again, so the neighbouring numbers are tried too.

    Args:
        product: any shape.
        factor: positive.

    Returns:
        The quotient, of the same shape.
    """
    quotient = product / factor
    for side in (-math.inf, math.inf):
        with np.errstate(over="ignore"):  # the largest number's neighbour, times a factor
            neighbour = np.nextafter(product / factor, side)
            is_better = (quotient * factor != product) & (neighbour * factor == product)
        quotient = np.where(is_better, neighbour, quotient)
    return np.asarray(quotient)


EGO_TYPE: Final = -1
"""`type` of an ego in an ObjectStatus."""


LATE_FROM: Final = 200
"""From this number of objects on, their structs are made when the list is encoded: a list of fewer takes less than a
fifth of a millisecond, and a throttled subscriber leaves most lists out."""


OBJECT_TYPES: Final = {Kind.EGO: EGO_TYPE, Kind.PEDESTRIAN: 0, Kind.VEHICLE: 1, Kind.OBSTACLE: 2}


_LISTED: Final = (Kind.VEHICLE, Kind.PEDESTRIAN, Kind.OBSTACLE)
"""Kinds in the order of ObjectStatusList."""


UniqueId = Callable[[int], int]
"""Returns the id on the wire of the entity in a row: the number of an ego, the world's id of any other entity."""


class ObjectLayout:
    """The constant part of the listed objects: it changes only when an entity is added or removed.

    Attributes:
        rows: all objects, in the order of the lists.
        ends: ends of the lists in `rows`.
        fixed: (unique_id, type, name, size) of each.
        num_egos: in the world.
    """

    def __init__(
        self, world: World, sized: Callable[[Body], Any], seen_from: tuple[int, UniqueId] | None = None
    ) -> None:
        """Lay out the objects.

        Args:
            world: read only.
            seen_from: row of an ego whose list includes the other egos, and the function that returns their ids.
        """
        egos = world.rows(Kind.EGO)
        self.num_egos = len(egos)
        by_kind = [world.rows(kind) for kind in _LISTED]
        if seen_from is not None:
            by_kind[0] = np.concatenate([by_kind[0], egos[egos != seen_from[0]]])
        self.rows: IntArray = np.concatenate(by_kind)
        self.ends = np.cumsum([len(rows) for rows in by_kind]).tolist()
        id_of = seen_from[1] if seen_from else lambda row: int(world.uid[row])
        self.fixed = [
            (id_of(row), OBJECT_TYPES[Kind(world.kind[row])], world.names[row], sized(world.bodies[row]))
            for row in self.rows.tolist()
        ]


def in_lists(entries: list[Any], ends: Sequence[int]) -> tuple[Any, ...]:
    """Return the numbers of vehicles, pedestrians and obstacles, then their lists of structs."""
    lists = entries[: ends[0]], entries[ends[0] : ends[1]], entries[ends[1] :]
    return (*map(len, lists), *lists)


def choose_listed(world: World, rows: IntArray, ego_row: int, profile: Profile) -> IntArray | None:
    """Return positions in `rows` of the entities that a profile lists for an ego, in order; None for all of them.

    Of two equally near ones at the limit the earlier is taken.
    """
    limit, within = profile.object_limit, profile.object_range
    if not within and (not limit or len(rows) <= limit):
        return None
    away: FloatArray = np.hypot(world.x[rows] - world.x[ego_row], world.y[rows] - world.y[ego_row])
    chosen = np.flatnonzero(away <= within) if within else np.arange(len(rows))
    if limit and len(chosen) > limit:
        chosen = np.sort(chosen[np.argsort(away[chosen], kind="stable")[:limit]])
    return chosen
