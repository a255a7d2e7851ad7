"""The graph of ROS 2, for the gateway."""

from __future__ import annotations

from typing import Final

from rosbridge_sim.graph.gateway.far_graph import FarGraph
from rosbridge_sim.graph.ros2.network_check import ONE_TOO_MANY
from rosbridge_sim.graph.ros2.ros2_names import dds_type, is_name, type_of

ROS2_GRAPH: Final = FarGraph(
    title="ROS 2",
    name="/ros2",
    logger="rosbridge_sim.ros2",
    # logs and parameters of nodes, and clients of a server
    own_topics=frozenset({"/rosout", "/parameter_events", "/client_count", "/connected_clients"}),
    # topics of an action of ROS 1, which ROS 2 does not have in this form; and services for clients, not for nodes
    own_folders=("/tf2_web_republisher/", "/rosapi/"),
    is_name=is_name,
    type_of=type_of,
    spell_type=dds_type,
    one_too_many=ONE_TOO_MANY,
    endpoints_per_turn=1,  # the DDS library takes up to 40 ms for a new type
    keeps_latched=True,
)
