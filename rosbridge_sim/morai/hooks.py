"""The moments of a simulation that components act on, each a list of functions.

A component appends a function to the lists that it needs, in its `__init__`; they are called in that order. A list that
nobody appends to costs nothing, so a moment of every frame can be had without a call for each component.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from rosbridge_sim.graph.participant import Participant
from rosbridge_sim.morai.ego import Ego
from rosbridge_sim.morai.interfaces.subscribers_services import SubscribersServices

__all__ = ["Hooks"]


@dataclass(frozen=True, slots=True)
class Hooks:
    """What is called, and when. `now` is monotonic time [s].

    Attributes:
        place: `()` within a step, when all entities have moved and before collisions are looked for: put entities where
            they are to stand.
        once_after_frame: `(now)` behind the frame that is being computed, before `after_frame`; called once, and the
            list is emptied. Commands append to it.
        after_frame: `(now)` behind each frame, when its topics have gone out.
        after_move: `(now)` when all frames of a tick, or all that real time owed, have been computed.
        on_mode_change: `(now)` when synchronous mode was started, stopped, paused, resumed or lost, or a client has
            tried to.
        on_scene_change: `(now)` before a scenario is loaded, or the world is reset: give back what was taken.
        on_reset: `()` when the world has begun anew, at frame 0.
        on_restore: `()` when the world has become that of a snapshot: drop what was meant for the world before.
        on_new_ego: `(ego, its topics and services)` when a further ego has come: give it what each ego has of its own.
        on_leave: `(participant, now)` when a participant has left the bus.
    """

    place: list[Callable[[], object]] = field(default_factory=list)
    once_after_frame: list[Callable[[float], object]] = field(default_factory=list)
    after_frame: list[Callable[[float], object]] = field(default_factory=list)
    after_move: list[Callable[[float], object]] = field(default_factory=list)
    on_mode_change: list[Callable[[float], object]] = field(default_factory=list)
    on_scene_change: list[Callable[[float], object]] = field(default_factory=list)
    on_reset: list[Callable[[], object]] = field(default_factory=list)
    on_restore: list[Callable[[], object]] = field(default_factory=list)
    on_new_ego: list[Callable[[Ego, SubscribersServices], object]] = field(default_factory=list)
    on_leave: list[Callable[[Participant, float], object]] = field(default_factory=list)
