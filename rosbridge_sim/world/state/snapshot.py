"""A copy of a whole world."""

from __future__ import annotations

from rosbridge_sim.records import Record
from rosbridge_sim.world.geometry.planar import BoolArray, FloatArray, IntArray
from rosbridge_sim.world.roads.paths import PathsSnapshot
from rosbridge_sim.world.roads.roads import Roads
from rosbridge_sim.world.roads.signals import SignalsSnapshot
from rosbridge_sim.world.roads.turn_shares import TurnShares
from rosbridge_sim.world.state.entity_types import Body, Dynamics


class Snapshot(Record):
    """A copy of a whole world. It can be restored any number of times, into any world."""

    frame: int
    seed: int
    next_uid: int
    uids: tuple[tuple[int, int], ...]  # (uid, row) in order of spawning
    names: tuple[str, ...]
    bodies: tuple[Body, ...]
    floats: FloatArray
    ints: IntArray
    bools: BoolArray
    paths: PathsSnapshot
    contacts: IntArray
    roads: Roads
    signals: SignalsSnapshot
    routes: dict[int, IntArray]
    is_scoring: bool
    friction_share: float
    dynamics: Dynamics
    is_creeping: bool
    has_stability_control: bool
    has_impacts: bool
    passing: IntArray
    placed_uids: tuple[int, ...]
    turn_shares: TurnShares | None
