"""What a node is put together from: parts that know the node, and that the node knows only as this.

So a subject (lights, sensors, control) is one file that says all that there is of it on the bus, and the node needs no
word of it.
"""

from __future__ import annotations

from rosbridge_sim.graph.bus import Owner
from rosbridge_sim.morai.bindings import Bindings
from rosbridge_sim.morai.ego import Ego
from rosbridge_sim.morai.outputs import Outputs

__all__ = ["Part"]


class Part:
    """One subject of the simulator on the bus. Each method does nothing where a part has nothing to do."""

    def show(self, outputs: Outputs) -> None:
        """Publish what the world has once."""

    def show_ego(self, ego: Ego, prefix: str, outputs: Outputs) -> None:
        """Publish what each ego has of its own, under `prefix`."""

    def bind(self, bindings: Bindings) -> None:
        """Offer the services and take the topics that the world has once."""

    def bind_ego(self, ego: Ego, bindings: Bindings) -> None:
        """Offer the services and take the topics that each ego has of its own."""

    def forget(self) -> None:
        """The world has begun anew, at frame 0."""

    def place(self) -> None:
        """Within a step, when all others have moved: put whom this part moves where they are to stand."""

    def settle(self, now: float) -> None:
        """A frame has gone out, or the mode may have changed."""

    def make_way(self, now: float) -> None:
        """A scenario is about to take the stage: what this part has put there is to go."""

    def see_off(self, owner: Owner, now: float) -> None:
        """A peer has left the bus."""
