"""The graph of ROS 1, for the gateway: names of nodes, topics and services."""

from __future__ import annotations

import re
from typing import Final

from rosbridge_sim.graph.gateway.far_graph import FarGraph

_NAME: Final = re.compile(r"(/[A-Za-z_]\w*)+", re.ASCII)
_TYPE: Final = re.compile(r"[A-Za-z]\w*/[A-Za-z]\w*", re.ASCII)

MAX_NAME: Final = 256
"""Longest name [characters]."""

ONE_TOO_MANY: Final = "give a second simulator a --ros1-namespace; end or rename any other"
"""Advice if two programs publish the same topic, which may have one publisher only."""


def is_name(name: str) -> bool:
    """Return True if something may have a name in ROS 1: letters, digits and `_`, and no token begins with a digit.

    Args:
        name: absolute name.
    """
    return len(name) <= MAX_NAME and _NAME.fullmatch(name) is not None


def type_of(name: str) -> str | None:
    """Return the name of a type; None if it is none, such as `*`."""
    return name if _TYPE.fullmatch(name) else None


ROS1_GRAPH: Final = FarGraph(
    title="ROS 1",
    name="/ros1",
    logger="rosbridge_sim.ros1",
    own_topics=frozenset({"/client_count", "/connected_clients"}),  # of each rosbridge server
    own_folders=(),
    is_name=is_name,
    type_of=type_of,
    spell_type=str,
    one_too_many=ONE_TOO_MANY,
    endpoints_per_turn=20,  # a type that is new is compiled in 2 ms
    keeps_latched=False,
)
