"""What a node is put together from: parts that know the node, and that the node knows only as this.

So a subject (lights, sensors, control) is one file that says all that there is of it on the bus, and the node needs no
word of it.
"""

from __future__ import annotations

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
