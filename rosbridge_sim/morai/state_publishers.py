"""What the simulator tells of the world: each ego, the objects around it, and who touches whom."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Final

from rosbridge_sim.loose_types import Struct
from rosbridge_sim.morai.component import Component
from rosbridge_sim.morai.ego import Ego
from rosbridge_sim.morai.interfaces.publishers import Publishers
from rosbridge_sim.world import collisions

if TYPE_CHECKING:
    from rosbridge_sim.morai.simulator_node import SimulatorNode

__all__ = ["StatePublishers"]

MAX_CRASHES: Final = 1_000
"""Pairs of vehicles in one VehicleCollisionData at most: 0.5 MB."""


class StatePublishers(Component):
    """The part of a node that publishes what is. It holds no state: that is the world's."""

    def __init__(self, node: SimulatorNode) -> None:
        self._node = node

    def show(self, outputs: Publishers) -> None:
        """Publish what the world has once."""
        outputs.add("/VehicleCollisionData", "morai_msgs/VehicleCollisionData", self._crashes)

    def show_ego(self, ego: Ego, prefix: str, outputs: Publishers) -> None:
        """Publish what each ego has of its own."""
        outputs.add(prefix + "Ego_topic", "morai_msgs/EgoVehicleStatus", ego.status, is_shown_in_pause=True)
        outputs.add(
            prefix + "Object_topic", "morai_msgs/ObjectStatusList", partial(self._objects, ego), is_shown_in_pause=True
        )
        outputs.add(prefix + "CollisionData", "morai_msgs/CollisionData", partial(self._collisions, ego))

    def _objects(self, ego: Ego) -> Struct:
        node = self._node
        return node.convert.object_status_list(node.world, ego.row, node.unique_id)

    def _collisions(self, ego: Ego) -> Struct:
        node = self._node
        return node.convert.collision_data(node.world, collisions.find_touched(node.world, ego.uid), node.unique_id)

    def _crashes(self) -> Struct:
        node = self._node
        pairs = collisions.find_crashes(node.world, MAX_CRASHES)
        return node.convert.vehicle_collision_data(node.world, pairs, node.unique_id)
