"""The egos of a simulator, by the numbers that clients call them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import Final

from rosbridge_sim.morai.convert import Converter
from rosbridge_sim.morai.ego import CtrlMode, Ego
from rosbridge_sim.morai.scene import FIRST_EGO
from rosbridge_sim.world.roads import Roads
from rosbridge_sim.world.state import World

__all__ = ["FIRST_NUMBER", "EgoRegistry"]

FIRST_NUMBER: Final = -1
"""Another number of the first ego: clients that know of one ego only send it."""


class EgoRegistry:
    """The egos in order: the first one has the bare names, ego 2 those under `/Ego-2/`.

    One object for the whole life of a simulator; what changes is who is in it.

    Attributes:
        first: the ego that is always there.
    """

    def __init__(self, world: World, convert: Converter, ctrl_mode: CtrlMode, roads: Callable[[], Roads]) -> None:
        """Have the first ego, which stands in the world already.

        Args:
            world: where they are.
            convert: makes their messages.
            ctrl_mode: who drives an ego that is new, and the first one after a reset.
            roads: gives the lanes that they drive on.
        """
        self._world = world
        self._convert = convert
        self._ctrl_mode = ctrl_mode
        self._roads = roads
        self.first = self.create(FIRST_EGO, FIRST_EGO)
        self._egos = [self.first]

    def __len__(self) -> int:
        """Return how many there are."""
        return len(self._egos)

    def __iter__(self) -> Iterator[Ego]:
        """Return the egos in order."""
        return iter(self._egos)

    def __getitem__(self, i: int) -> Ego:
        """Return the ego at this place of the order."""
        return self._egos[i]

    def find(self, unique_id: int) -> Ego | None:
        """Return the ego that a client calls by this number (-1 is the first one too), or None."""
        wanted = FIRST_EGO if unique_id == FIRST_NUMBER else unique_id
        return next((ego for ego in self._egos if ego.index == wanted), None)

    def unique_id(self, row: int) -> int:
        """Return the number that clients have for the entity in this row of the world: an ego's is not its uid."""
        uid: int = self._world.uid.item(row)
        return next((ego.index for ego in self._egos if ego.uid == uid), uid)

    def create(self, index: int, uid: int) -> Ego:
        """Return an ego for an entity of the world; it is not in the registry before `add`."""
        return Ego(self._world, self._convert, uid, self._ctrl_mode, index=index, roads=self._roads)

    def add(self, egos: Iterable[Ego]) -> None:
        """Have further egos, behind those that are here."""
        self._egos.extend(egos)

    def drop(self, egos: Iterable[Ego]) -> None:
        """Have these egos no longer; the first one stays."""
        gone = [ego for ego in egos if ego is not self.first]
        self._egos[:] = [ego for ego in self._egos if ego not in gone]

    def reset(self) -> None:
        """Have the first ego alone, as a simulator starts with it."""
        self.drop(self._egos)
        self.first.ctrl_mode = self._ctrl_mode
        self.first.reset_controls()

    def replace(self, egos: Iterable[Ego]) -> None:
        """Have these egos, in this order; the first one is `first`."""
        self._egos[:] = egos
        assert self._egos[0] is self.first

    def forget_statuses(self) -> None:
        """Have each EgoVehicleStatus made again when it is needed: the world has changed."""
        for ego in self._egos:
            ego.forget_status()
