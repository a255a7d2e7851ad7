"""`ros1 check`: why a node of ROS 1 sees nothing of a server."""

from __future__ import annotations

import os

from rosbridge_sim.cli.tools.findings import put_findings
from rosbridge_sim.graph.ros1.master_check import check_master
from rosbridge_sim.shell.ros1.ros1_looking import look_at_master


def check_ros1(master: str, name: str, *, is_json: bool) -> int:
    """Print the result of each step, and return the exit code: 0 if all is well, else 1.

    Args:
        master: URI of the master, or `env` for that of the variables.
        name: name of the server's node.
        is_json: print a JSON value.
    """
    return put_findings(check_master(look_at_master(master, name, os.environ)), is_json=is_json)
