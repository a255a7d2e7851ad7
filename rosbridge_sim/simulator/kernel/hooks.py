"""Moments of a simulation that components act on; each is a list of functions.

A component appends functions in its `__init__`. They are called in that order. An empty list costs nothing, so a moment
of every frame needs no call for each component.
"""

from __future__ import annotations

from collections.abc import Callable

from rosbridge_sim.graph.participant import Participant
from rosbridge_sim.records import Record, field
from rosbridge_sim.simulator.bus.subscribers_services import SubscribersServices
from rosbridge_sim.simulator.kernel.ego import Ego

__all__ = ["Hooks"]


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

    place: list[Callable[[], object]] = field(default_factory=list)
    once_after_frame: list[Callable[[float], object]] = field(default_factory=list)
    after_frame: list[Callable[[float], object]] = field(default_factory=list)
    after_move: list[Callable[[float], object]] = field(default_factory=list)
    on_mode_change: list[Callable[[float], object]] = field(default_factory=list)
    on_scene_change: list[Callable[[float], object]] = field(default_factory=list)
    on_new_scene: list[Callable[[float], object]] = field(default_factory=list)
    on_reset: list[Callable[[], object]] = field(default_factory=list)
    on_restore: list[Callable[[], object]] = field(default_factory=list)
    on_new_ego: list[Callable[[Ego, SubscribersServices], object]] = field(default_factory=list)
    on_leave: list[Callable[[Participant, float], object]] = field(default_factory=list)
