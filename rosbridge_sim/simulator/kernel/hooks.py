"""Moments of a simulation that components act on; each is a list of functions.

A component appends functions in its `__init__`. They are called in that order. Those of each frame may rest: a
component that has nothing to do costs nothing then.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Generic, TypeVar

from rosbridge_sim.graph.participant import Participant
from rosbridge_sim.records import Record, field
from rosbridge_sim.simulator.bus.subscribers_services import SubscribersServices
from rosbridge_sim.simulator.egos.ego import Ego

F = TypeVar("F", bound=Callable[..., object])


class Moment(Generic[F]):
    """Functions of a moment of each frame, in the order in which they were appended.

    Attributes:
        awake: those that are called. A change within the moment holds from the next one on.
    """

    def __init__(self) -> None:
        self.awake: tuple[F, ...] = ()
        self._is_awake: dict[F, bool] = {}

    def append(self, act: F) -> None:
        """Add a function, which is awake."""
        self._set(act, is_awake=True)

    def remove(self, act: F) -> None:
        """Remove a function."""
        del self._is_awake[act]
        self._set()

    def rest(self, act: F) -> None:
        """Do not call a function until `wake`, because it has nothing to do. It may rest already."""
        if self._is_awake[act]:
            self._set(act, is_awake=False)

    def wake(self, act: F) -> None:
        """Call a function again, in its place. It may be awake already."""
        if not self._is_awake[act]:
            self._set(act, is_awake=True)

    def _set(self, *acts: F, is_awake: bool = True) -> None:
        self._is_awake.update(dict.fromkeys(acts, is_awake))
        self.awake = tuple([act for act, is_awake in self._is_awake.items() if is_awake])


class Hooks(Record):
    """Functions to call at each moment. `now` is monotonic time [s].

    Attributes:
        place: `()` within a step, after all motion and before collision detection: place entities.
        once_after_frame: `(now)` after the frame in progress, before `after_frame`. Each is called once, then the list
            is emptied. Commands append to it.
        after_frame: `(now)` after each frame, when its topics have been published.
        after_move: `(now)` after the frames of a turn: of a tick or several, of a part of one, or those that real time
            owed.
        on_mode_change: `(now)` after synchronous mode was started, stopped, paused, resumed or lost, or after a client
            tried to do so.
        on_scene_change: `(now)` before a scenario is loaded or the world is reset: give back what was taken.
        on_new_scene: `(now)` after a scenario was loaded, or the world was reset.
        on_reset: `()` after the world was reset to frame 0.
        on_restore: `()` after the world was restored from a snapshot: drop what was meant for the world before.
        on_new_ego: `(ego, its topics and services)` after a further ego was added: add the ego's own topics and
            services.
        on_leave: `(participant, now)` after a participant left the bus.
    """

    place: Moment[Callable[[], object]] = field(default_factory=Moment)
    once_after_frame: list[Callable[[float], object]] = field(default_factory=list)
    after_frame: Moment[Callable[[float], object]] = field(default_factory=Moment)
    after_move: Moment[Callable[[float], object]] = field(default_factory=Moment)
    on_mode_change: list[Callable[[float], object]] = field(default_factory=list)
    on_scene_change: list[Callable[[float], object]] = field(default_factory=list)
    on_new_scene: list[Callable[[float], object]] = field(default_factory=list)
    on_reset: list[Callable[[], object]] = field(default_factory=list)
    on_restore: list[Callable[[], object]] = field(default_factory=list)
    on_new_ego: list[Callable[[Ego, SubscribersServices], object]] = field(default_factory=list)
    on_leave: list[Callable[[Participant, float], object]] = field(default_factory=list)
