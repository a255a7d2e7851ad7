"""Services or actions by rclpy: those that our node offers, and its clients of others'."""

from __future__ import annotations

import logging
from abc import ABC, abstractmethod
from collections.abc import Mapping
from functools import partial
from typing import Final, Generic, TypeVar

from rosbridge_sim.errors import GraphError
from rosbridge_sim.graph.gateway.far_graph import FarServiceType
from rosbridge_sim.graph.gateway.sentences import OnceLog
from rosbridge_sim.graph.ros2.cdr_types import CdrActionType
from rosbridge_sim.graph.ros2.ros2_graph import ROS2_GRAPH
from rosbridge_sim.shell.ros2.rclpy_node import RclpyNode
from rosbridge_sim.shell.ros2.rclpy_types import RclpyObject

OFFERS_PER_TURN: Final = 10
"""Services or actions that one turn of the loop offers to nodes: one takes about a millisecond."""

Offer = TypeVar("Offer", FarServiceType, CdrActionType)


class RclpyOffers(ABC, Generic[Offer]):
    """Services or actions of our node, by their names on the bus."""

    kind: str

    def __init__(self, node: RclpyNode) -> None:
        self._node = node
        self._loop = node.loop
        self._offered: dict[str, tuple[Offer, RclpyObject]] = {}
        self._clients: dict[str, RclpyObject] = {}
        self._log = OnceLog(ROS2_GRAPH.logger)

    def keep_clients(self, names: set[str]) -> None:
        """End the clients of those that nodes provide no more."""
        for name in self._clients.keys() - names:
            self._node.run(partial(self._destroy, self._clients.pop(name)))

    def offer(self, wanted: Mapping[str, Offer]) -> bool:
        """Offer to nodes what is wanted, a few in one turn, and end others.

        Returns:
            True if there is more to do.
        """
        for name in [name for name, (one, _) in self._offered.items() if wanted.get(name) != one]:
            self._node.run(partial(self._destroy, self._offered.pop(name)[1]))
        failed: dict[str, tuple[GraphError, list[str]]] = {}  # by the package of the type
        num_made = 0
        for name, one in wanted.items():
            if name in self._offered:
                continue
            try:
                found = self._node.types.find(one.name)
                num_made += 1
                if num_made > OFFERS_PER_TURN:
                    return True
                self._offered[name] = one, self._provide(name, found)
            except GraphError as error:
                failed.setdefault(one.name.partition("/")[0], (error, []))[1].append(name)
        for why, names in failed.values():
            more = f" and {len(names) - 1} more of its package" if len(names) > 1 else ""
            self._log.tell(f"{self.kind} {names[0]}{more} cannot be offered to nodes: {why}", logging.INFO)
        return False

    @abstractmethod
    def _provide(self, name: str, found: RclpyObject) -> RclpyObject:
        """Offer one to nodes.

        Args:
            found: the class of its type.

        Raises:
            GraphError: the library refuses it.
        """

    @abstractmethod
    def _destroy(self, one: RclpyObject) -> None:
        """End one that was offered, or a client (in the thread that spins)."""
