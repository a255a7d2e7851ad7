"""What a node is put together from: parts that know the node, and that the node knows only as this.

So a subject (lights, sensors, control) is one file that says all that there is of it on the bus, and the node needs no
word of it.
"""

from __future__ import annotations

from rosbridge_sim.graph.participant import Participant
from rosbridge_sim.morai.ego import Ego
from rosbridge_sim.morai.interfaces.publishers import Publishers
from rosbridge_sim.morai.interfaces.subscribers_services import SubscribersServices

__all__ = ["Component"]


class Component:
    """One subject of the simulator on the bus. Each method does nothing where a part has nothing to do."""

    def show(self, outputs: Publishers) -> None:
        """Publish what the world has once."""

    def show_ego(self, ego: Ego, prefix: str, outputs: Publishers) -> None:
        """Publish what each ego has of its own, under `prefix`."""

    def bind(self, bindings: SubscribersServices) -> None:
        """Offer the services and take the topics that the world has once."""

    def bind_ego(self, ego: Ego, bindings: SubscribersServices) -> None:
        """Offer the services and take the topics that each ego has of its own."""

    def forget(self) -> None:
        """The world has begun anew, at frame 0."""

    def place(self) -> None:
        """Within a step, when all others have moved: put whom this part moves where they are to stand."""

    def settle(self, now: float) -> None:
        """A frame has gone out, or the mode may have changed."""

    def on_scene_change(self, now: float) -> None:
        """A scenario is about to take the stage: what this part has put there is to go."""

    def on_leave(self, owner: Participant, now: float) -> None:
        """A peer has left the bus."""
