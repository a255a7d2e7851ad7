"""Base class of the components that a simulator is made of; each covers one subject on the bus.

One subject (lights, sensors, control) is one file with all its topics and services, so the simulator need not know it.
A component is made from the `SimulatorContext`. It appends functions to `Hooks` for the moments that it acts on. The
simulator asks it once for its topics and services.
"""

from __future__ import annotations

from rosbridge_sim.graph.participant import Participant
from rosbridge_sim.simulator.bus.publishers import Publishers
from rosbridge_sim.simulator.bus.subscribers_services import SubscribersServices
from rosbridge_sim.simulator.egos.ego import Ego
from rosbridge_sim.simulator.plain.plain_bytes import PlainData


class Component:
    """One subject of the simulator. A method that a component does not override adds nothing."""

    def publish_ego(self, ego: Ego, prefix: str, publishers: Publishers) -> None:
        """Publish the topics of one ego; called for each ego that is added.

        Args:
            prefix: before the topics' names: `/`, or `/Ego-2/` for a further ego.
        """

    def publish(self, publishers: Publishers) -> None:
        """Publish the topics that exist once, not for each ego."""

    def bind(self, bindings: SubscribersServices) -> None:
        """Offer the services and subscribe to the topics that exist once, not for each ego.

        Args:
            bindings: take the services and input topics.
        """

    def bind_ego(self, ego: Ego, bindings: SubscribersServices) -> None:
        """Offer the services and subscribe to the topics of one ego; called for each ego that is added.

        Args:
            bindings: take the services and input topics; the prefix of their names is the ego's.
        """

    def save_state(self) -> PlainData:
        """Return what the component knows that decides future messages, as plain data; None for nothing.

        What follows from the world, the egos or the scene is not in it: they are saved by themselves.
        """
        return None

    def check_state(self, data: PlainData, caller: Participant) -> None:
        """Check that a client may have this state restored; nothing has changed yet.

        Args:
            data: from `save_state`, perhaps of another process, or made up.

        Raises:
            GraphError: it must not.
            ValueError: it is no such data.
            DocumentError: the same.
        """

    def load_state(self, data: PlainData, now: float) -> None:  # noqa: ARG002 - those that publish use it
        """Become what `save_state` has returned; the world, the scene and the egos have been restored before.

        Args:
            data: from `save_state`, perhaps of another process, or made up: it must be checked.

        Raises:
            ValueError: it is no such data. Everything will be restored to what it was.
        """
        if data is not None:
            raise ValueError("expected nothing")
