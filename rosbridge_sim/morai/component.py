"""One subject of the simulator on the bus: what a simulator is put together from.

So a subject (lights, sensors, control) is one file that says all that there is of it on the bus, and the simulator
needs no word of it. A component is made from the `SimulatorContext`, appends to `Hooks` what it has to do at certain
moments, and is asked once for its topics and services.
"""

from __future__ import annotations

from rosbridge_sim.morai.ego import Ego
from rosbridge_sim.morai.interfaces.publishers import Publishers
from rosbridge_sim.morai.interfaces.subscribers_services import SubscribersServices
from rosbridge_sim.morai.plain_bytes import PlainData

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

    def save_state(self) -> PlainData:
        """Return what the component knows that decides future messages, as plain data; None for nothing.

        What follows from the world, the egos or the scene is not in it: they are saved by themselves.
        """
        return None

    def load_state(self, data: PlainData, now: float) -> None:  # noqa: ARG002 - those that publish use it
        """Become what `save_state` has returned; the world, the scene and the egos have been restored before.

        Args:
            data: from `save_state`, perhaps of another process, or made up: it must be checked.
            now: monotonic time [s].

        Raises:
            ValueError: it is no such data. Everything will be restored to what it was.
        """
        if data is not None:
            raise ValueError("expected nothing")
