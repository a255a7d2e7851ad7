"""State that a step reads and writes: columns of all rows; frame, chance, lanes and lights of the world of each row.

A step never asks how many worlds the rows are of. `World` has the rows of one world, so that most answers are the same
for all of them, as here. `many_worlds.Batch` has the rows of many worlds, and answers for each row.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from typing import Any, Final, Self, TypeVar

import numpy as np
import numpy.typing as npt

from rosbridge_sim.world.geometry.planar import FloatArray, IntArray
from rosbridge_sim.world.roads.paths import Paths, Segments
from rosbridge_sim.world.roads.roads import Roads
from rosbridge_sim.world.roads.signal_plan import SignalPlan
from rosbridge_sim.world.roads.signals import ShownLights
from rosbridge_sim.world.roads.turn_shares import TurnShares
from rosbridge_sim.world.state.entity_arrays import EntityArrays
from rosbridge_sim.world.state.entity_types import Body, Dynamics, Kind

T = TypeVar("T")

NO_CONTACTS: Final[IntArray] = np.empty((0, 2), dtype=np.int64)


class WorldRows(EntityArrays, ABC):
    """The columns of all entities of one world or of many, and what decides how a step moves them.

    Attributes:
        num_worlds: number of worlds that have rows; row r of world w is row r * num_worlds + w.
        world_of_row: (n,) int64, which world a row belongs to; None where all rows are of one world.
        frame: steps done since the last reset; simulated time is frame * 20 ms. Of many worlds, what they have in
            common; see `frames`.
        roads: the lanes.
        contacts: (m, 2) int64, pairs of `ids` that touched during the last step; see `collisions`.
        is_scoring: steps keep the scores of all egos; see `World.start_scoring`.
        friction_share: friction of the ground, relative to a dry one; see `World.set_friction_share`.
        on_heap: called when entities lie on top of one another, so that a part of their pairs is judged alone
            (`near_pairs`); None for nothing.

    Args:
        dynamics: the model that moves all egos.
        is_creeping: egos under the control of pedals creep in D and R, and roll on slopes; for SINGLE_TRACK only.
        has_stability_control: of all egos; for SINGLE_TRACK only, see `stability`.
        has_impacts: collisions change motion; see `impacts`.
        turn_shares: how often drivers without a route turn; with None all lanes that follow are equally likely.
    """

    num_worlds: int = 1
    world_of_row: IntArray | None = None
    frame: int
    roads: Roads
    _signals: ShownLights
    on_heap: Callable[[], object] | None = None

    def __init__(
        self,
        dynamics: Dynamics,
        *,
        is_creeping: bool,
        has_stability_control: bool,
        has_impacts: bool,
        turn_shares: TurnShares | None,
    ) -> None:
        super().__init__()
        self.dynamics, self.is_creeping = dynamics, is_creeping
        self.has_stability_control, self.has_impacts = has_stability_control, has_impacts
        self.turn_shares = turn_shares
        self.is_scoring, self.friction_share = False, 1.0
        self.contacts = NO_CONTACTS
        self._derived: dict[object, Any] = {}

    def touch(self) -> None:
        """Drop what was derived from the arrays: an entity has come or gone, stopped or started, or been placed."""
        self._derived.clear()

    def derived(self, make: Callable[[Self], T]) -> T:
        """Return `make(self)`, made once and kept until the next `touch`."""
        value: T | None = self._derived.get(make)  # the key says what the value is
        if value is None:
            value = self._derived[make] = make(self)
        return value

    @property
    def signals(self) -> ShownLights:
        """The traffic lights at this frame."""
        return self._signals

    @property
    def plan(self) -> SignalPlan:
        """The plan of the traffic lights."""
        return self._signals.plan

    @abstractmethod
    def rows(self, kind: Kind) -> IntArray:
        """Return the rows of a kind, (k,) int64; do not write into the array."""

    @abstractmethod
    def body_of(self, row: int) -> Body:
        """Return the body of the entity in a row."""

    @abstractmethod
    def world_with(self, row: int) -> Any:  # noqa: ANN401 - `World`, which stands above this module
        """Return the `World` that a row belongs to."""

    @abstractmethod
    def struck(self) -> Iterator[Any]:
        """Yield each `World` in which pairs touch, touched, or were placed since the last step."""

    # -- what a step writes beside the columns

    def count_frame(self) -> None:
        """Count the step that has been made."""
        self.frame += 1

    def keep_contacts(self, pairs: IntArray) -> None:
        """Keep the pairs that touched in this step: (m, 2) int64 of `ids`, the lower first, in rising order."""
        self.contacts = pairs

    # -- answers for each row

    def frames(self, _rows: IntArray) -> int | IntArray:
        """Return the frame of the world of each row, (k,) int64, or one frame for all."""
        return self.frame

    @abstractmethod
    def salts(self, rows: IntArray) -> npt.NDArray[np.uint64]:
        """Return the `salt_of` the entities in rows, (k,) uint64."""

    def ids(self) -> IntArray:
        """Return numbers that tell all entities of all worlds apart, (n,) int64; rising by world, then by id."""
        return self.uid

    @abstractmethod
    def routes_of(self, rows: IntArray) -> list[IntArray]:
        """Return the routes of rows, in rows of the lanes of `roads`; an empty list if no entity has one."""

    def own_lanes(self, _rows: IntArray, lane: IntArray) -> IntArray:
        """Return lanes of the map as lanes of `roads`: of the worlds of rows (k,); -1 stays -1."""
        return lane

    def own_lights(self, _rows: IntArray, light: IntArray) -> IntArray:
        """Return lights of the plan as lights of `signals.shown`: of the worlds of rows (k,); -1 stays -1."""
        return light

    def worlds_of(self, _rows: IntArray, _others: IntArray) -> tuple[IntArray, IntArray] | None:
        """Return the worlds of rows, (k,) int64, and of other rows, (m,) int64; None where all are of one world."""
        return None

    def most_of_world(self, values: FloatArray, _rows: IntArray, _others: IntArray) -> float | FloatArray:
        """Return the greatest of values, at least 0, or for each other row, (m,), the greatest in its world.

        Args:
            values: (k,) of rows.
            _rows: (k,) int64.
            _others: (m,) int64, rows.
        """
        return float(values.max(initial=0.0))

    def path_bases(self, rows: IntArray) -> IntArray:
        """Return for the paths of rows, (k,) int64, what `find_legs` takes."""
        return self.path_base[rows]

    @property
    @abstractmethod
    def path_store(self) -> Paths:
        """The store of the paths of all rows."""

    def find_legs(self, bases: IntArray, arc: FloatArray) -> Segments:
        """Return the legs at arc lengths of paths; see `Paths.find`."""
        return self.path_store.find(bases, arc)
