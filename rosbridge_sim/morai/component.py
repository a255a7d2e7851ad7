"""One subject of the simulator on the bus: what a simulator is put together from.

So a subject (lights, sensors, control) is one file that says all that there is of it on the bus, and the simulator
needs no word of it. A component is made from the `SimulatorContext`, appends to `Hooks` what it has to do at certain
moments, and is asked once for its topics and services.
"""

from __future__ import annotations

from rosbridge_sim.morai.ego import Ego
from rosbridge_sim.morai.interfaces.publishers import Publishers
from rosbridge_sim.morai.interfaces.subscribers_services import SubscribersServices

__all__ = ["Component"]


class Component:
    """One subject. Each method adds nothing where a component has nothing to add."""

    def publish_ego(self, ego: Ego, prefix: str, publishers: Publishers) -> None:
        """Publish what each ego has of its own, under `prefix`; called for each ego that comes."""

    def publish(self, publishers: Publishers) -> None:
        """Publish what the world has once."""

    def bind(self, bindings: SubscribersServices) -> None:
        """Offer the services and take the topics that the world has once."""

    def bind_ego(self, ego: Ego, bindings: SubscribersServices) -> None:
        """Offer the services and take the topics that each ego has of its own; called for each ego that comes."""
