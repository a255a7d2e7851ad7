"""The command about the graph of ROS 1: `rosbridge-sim ros1 check`."""

from __future__ import annotations

from rosbridge_sim.cli.command_line import add_json, group_of
from rosbridge_sim.link.arguments import Parser


def make_ros1() -> Parser:
    """Return the parser of `rosbridge-sim ros1 ...`."""
    group, add = group_of("ros1", "The graph of ROS 1; no installation of ROS is needed.")
    parser = add(
        "check",
        "tools.ros1_check.check_ros1",
        "tell why nodes that are started in this terminal see nothing of a server, or see it twice: master, server,"
        " address, own name, types, clock",
    )
    parser.option("--master", "URL", "of the master [ROS_MASTER_URI]", default="env")
    parser.add_argument("--name", default="/rosbridge_sim", help="of the server's node [%(default)s]")
    add_json(parser)
    return group
