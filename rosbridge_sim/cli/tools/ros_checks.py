"""`ros1 check` and `ros2 check`: why a node sees nothing of a server."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import Final, cast, get_args

from rosbridge_sim.cli.tools.text import put, put_json
from rosbridge_sim.graph.gateway.finding import Finding
from rosbridge_sim.graph.ros1.master_check import check_master
from rosbridge_sim.graph.ros2.discovery_info import Distro
from rosbridge_sim.graph.ros2.network_check import check_graph, domain_of
from rosbridge_sim.shell.ros1.ros1_looking import look_at_master
from rosbridge_sim.shell.ros2.looking import look_at_domain

DEFAULT_DISTRO: Final = "jazzy"


def check_ros1(master: str, name: str, *, is_json: bool) -> int:
    """Print the result of each step, and return the exit code: 0 if all is well, else 1.

    Args:
        master: URI of the master, or `env` for that of the variables.
        name: name of the server's node.
        is_json: print a JSON value.
    """
    return _put_findings(check_master(look_at_master(master, name, os.environ)), is_json=is_json)


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
    return _put_findings(check_graph(seen, environment), is_json=is_json)


def _put_findings(findings: Sequence[Finding], *, is_json: bool) -> int:
    """Print the result of each step, and return the exit code: 0 if all is well, else 1.

    Args:
        findings: in the order of the steps.
        is_json: print a JSON value.
    """
    if is_json:
        put_json([one._asdict() for one in findings])
    else:
        for i, one in enumerate(findings, 1):
            first, *rest = one.text.splitlines()
            put(f"{i}. {one.step}: {'ok' if one.is_good else 'WRONG'}: {first}")
            for line in rest:
                put(f"   {line}")
            if one.advice:
                put(f"   -> {one.advice}")
    return 0 if all(one.is_good for one in findings) else 1
