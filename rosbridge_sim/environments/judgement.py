"""The worth of a step, and the end of an episode, as `rewards` determines them."""

from __future__ import annotations

from rosbridge_sim.records import Record
from rosbridge_sim.world.geometry.planar import BoolArray, FloatArray

Index = tuple[slice | int, slice | int]
"""Which egos count: the first one of each world, or all of one world; the arrays are one-dimensional then."""


class Judgement(Record):
    """Reward and end of one step; (num_worlds,) each.

    Attributes:
        reward: sum of the terms.
        is_over: bool, the episode has ended: by a failure, or the ego has arrived.
        has_collided, is_off_road, is_wrong_way: bool, the failure.
        has_arrived: bool.
        speed: [m/s].
        offset: from the line of the lane, left positive [m].
        scores: those of `Worlds.scores`.
    """

    reward: FloatArray
    is_over: BoolArray
    has_collided: BoolArray
    is_off_road: BoolArray
    is_wrong_way: BoolArray
    has_arrived: BoolArray
    speed: FloatArray
    offset: FloatArray
    scores: dict[str, FloatArray]
