"""`ros2 check`: why a node of ROS 2 sees nothing of a server."""

from __future__ import annotations

import os
from typing import Final, cast, get_args

from rosbridge_sim.cli.tools.findings import put_findings
from rosbridge_sim.graph.ros2.discovery_info import Distro
from rosbridge_sim.graph.ros2.network_check import check_graph, domain_of
from rosbridge_sim.shell.ros2.looking import look_at_domain

DEFAULT_DISTRO: Final = "jazzy"


def check_ros2(domain: int | None, distro: str | None, patience: float, *, is_json: bool) -> int:
    """Print the result of each step.

    Args:
        domain: of the server; None for that of the variables.
        distro: distribution of the nodes; None for that of the variables.
        patience: longest wait for the server [s].
        is_json: print a JSON value.

    Returns:
        The exit code: 0 if all is well, else 1.

    Raises:
        DocumentError: the DDS library is missing.
    """
    environment = dict(os.environ)
    own = domain_of(environment)
    chosen = domain if domain is not None else own if own is not None else 0
    known = distro or environment.get("ROS_DISTRO", "")
    seen = look_at_domain(chosen, cast("Distro", known if known in get_args(Distro) else DEFAULT_DISTRO), patience)
    return put_findings(check_graph(seen, environment), is_json=is_json)
