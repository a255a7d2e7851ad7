"""The state topics: egos, objects around each ego, and collisions."""

from __future__ import annotations

from functools import partial
from typing import Final

from rosbridge_sim.loose_types import Struct
from rosbridge_sim.simulator.bus.publishers import Publishers
from rosbridge_sim.simulator.egos.ego import Ego
from rosbridge_sim.simulator.kernel.component import Component
from rosbridge_sim.simulator.kernel.context import SimulatorContext
from rosbridge_sim.world.contacts import collisions

MAX_CRASHES: Final = 1_000
"""Largest number of vehicle pairs in one VehicleCollisionData; the message then has 0.5 MB."""


class StatePublishers(Component):
    """Component that publishes the state of the world. It holds no state of its own; the world does."""

    def __init__(self, context: SimulatorContext) -> None:
        self._context = context

    def publish(self, publishers: Publishers) -> None:
        """Publish the collisions between vehicles."""
        publishers.add("/VehicleCollisionData", "morai_msgs/VehicleCollisionData", self._crashes)

    def publish_ego(self, ego: Ego, prefix: str, publishers: Publishers) -> None:
        """Publish the ego's state, the objects around it, and its collisions."""
        publishers.add(prefix + "Ego_topic", "morai_msgs/EgoVehicleStatus", ego.status, is_shown_in_pause=True)
        publishers.add(
            prefix + "Object_topic", "morai_msgs/ObjectStatusList", partial(self._objects, ego), is_shown_in_pause=True
        )
        publishers.add(prefix + "CollisionData", "morai_msgs/CollisionData", partial(self._collisions, ego))

    def _objects(self, ego: Ego) -> Struct:
        context = self._context
        return context.convert.object_status_list(context.world, ego.row, context.egos.unique_id)

    def _collisions(self, ego: Ego) -> Struct:
        context = self._context
        touched = collisions.find_touched(context.world, ego.uid)
        return context.convert.collision_data(context.world, touched, context.egos.unique_id)

    def _crashes(self) -> Struct:
        context = self._context
        pairs = collisions.find_crashes(context.world, MAX_CRASHES)
        return context.convert.vehicle_collision_data(context.world, pairs, context.egos.unique_id)
