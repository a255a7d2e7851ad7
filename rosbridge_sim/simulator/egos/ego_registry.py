"""The egos of a simulator, by their numbers on the wire."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import Final

from rosbridge_sim.morai.messages.convert import Converter
from rosbridge_sim.simulator.egos.ego import CtrlMode, Ego
from rosbridge_sim.simulator.egos.odometry import Origin
from rosbridge_sim.simulator.scene.scene_limits import FIRST_EGO
from rosbridge_sim.world.roads.roads import Roads
from rosbridge_sim.world.state.world import World

FIRST_NUMBER: Final = -1
"""Another number of the first ego, sent by clients that know of only one ego."""


class EgoRegistry:
    """The egos in order: the first one has topics without a prefix, ego 2 those under `/Ego-2/`.

    There is one registry for the whole life of a simulator; its content changes.

    Attributes:
        first: the ego that is always there.
        sensor_frames: frames of the sensors of each ego.
    """

    def __init__(
        self,
        world: World,
        convert: Converter,
        ctrl_mode: CtrlMode,
        roads: Callable[[], Roads],
        sensor_frames: tuple[str, ...],
    ) -> None:
        """Add the first ego, which stands in the world already.

        Args:
            convert: makes their messages.
            ctrl_mode: driver of a new ego, and of the first one after a reset.
            roads: returns the lanes of the map in use.
            sensor_frames: frames of the sensors of each ego.
        """
        self.sensor_frames = sensor_frames
        self._world = world
        self._convert = convert
        self._ctrl_mode = ctrl_mode
        self._roads = roads
        self.first = self.create(FIRST_EGO, FIRST_EGO)
        self._egos = [self.first]

    def __len__(self) -> int:
        """Return the number of egos."""
        return len(self._egos)

    def __iter__(self) -> Iterator[Ego]:
        """Return the egos in order."""
        return iter(self._egos)

    def __getitem__(self, i: int) -> Ego:
        """Return the ego at an index in the order."""
        return self._egos[i]

    def find(self, unique_id: int) -> Ego | None:
        """Return the ego of a number.

        Args:
            unique_id: its number on the wire; -1 is the first ego too.

        Returns:
            The ego, or None.
        """
        wanted = FIRST_EGO if unique_id == FIRST_NUMBER else unique_id
        for ego in self._egos:  # a generator costs more than the search
            if ego.index == wanted:
                return ego
        return None

    def numbers(self) -> set[int]:
        """Return all numbers that mean an ego on the wire; -1 is the first ego too."""
        return {FIRST_NUMBER, *(ego.index for ego in self._egos)}

    def unique_id(self, row: int) -> int:
        """Return the number on the wire of an entity; an ego's differs from its uid."""
        uid: int = self._world.uid.item(row)
        return next((ego.index for ego in self._egos if ego.uid == uid), uid)

    def create(self, index: int, uid: int) -> Ego:
        """Return an ego for an entity of the world; it is not in the registry before `add`.

        Args:
            uid: id of the entity in the world.
        """
        return Ego(
            self._world,
            self._convert,
            uid,
            self._ctrl_mode,
            index=index,
            roads=self._roads,
            sensor_frames=self.sensor_frames,
        )

    def add(self, egos: Iterable[Ego]) -> None:
        """Add further egos, after the present ones."""
        self._egos.extend(egos)

    def drop(self, egos: Iterable[Ego]) -> None:
        """Remove these egos; the first one stays."""
        gone = [ego for ego in egos if ego is not self.first]
        self._egos[:] = [ego for ego in self._egos if ego not in gone]

    def reset(self) -> None:
        """Keep only the first ego, with the controls of a simulator's start."""
        self.drop(self._egos)
        self.first.ctrl_mode = self._ctrl_mode
        self.first.reset_controls()
        self.first.odom_origin = self.first.pose

    def keep_odometry(self, poses: Iterable[Origin]) -> None:
        """Note that the egos that are still there have jumped; see `Ego.keep_odometry`.

        Args:
            poses: of all egos before that.
        """
        for ego, before in zip(self._egos, poses, strict=True):
            if ego.is_there:
                ego.keep_odometry(before)

    def replace(self, egos: Iterable[Ego]) -> None:
        """Have these egos, in this order; the first one is `first`."""
        self._egos[:] = egos
        assert self._egos[0] is self.first

    def forget_statuses(self) -> None:
        """Make each EgoVehicleStatus anew when it is needed, because the world has changed."""
        for ego in self._egos:
            ego.forget_status()
