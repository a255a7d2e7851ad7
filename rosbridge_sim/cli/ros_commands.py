"""The commands about the graphs of ROS itself: `rosbridge-sim ros1 check` and `ros2 check`."""

from __future__ import annotations

from rosbridge_sim.cli.bridge_flags import SECONDS
from rosbridge_sim.cli.command_line import add_json, group_of, make_number
from rosbridge_sim.link.arguments import Parser

DEFAULT_PATIENCE = 3.0
"""Longest wait for a server [s]; programs of DDS find each other within a second."""

_domain = make_number(0, 232, "a domain from 0 to 232", int)


def make_ros1() -> Parser:
    """Return the parser of `rosbridge-sim ros1 ...`."""
    group, add = group_of("ros1", "The graph of ROS 1; no installation of ROS is needed.")
    parser = add(
        "check",
        "tools.ros_checks.check_ros1",
        "tell why nodes that are started in this terminal see nothing of a server, or see it twice: master, server,"
        " address, own name, types, clock",
    )
    parser.option("--master", "URL", "of the master [ROS_MASTER_URI]", default="env")
    parser.add_argument("--name", default="/rosbridge_sim", help="of the server's node [%(default)s]")
    add_json(parser)
    return group


def make_ros2() -> Parser:
    """Return the parser of `rosbridge-sim ros2 ...`."""
    group, add = group_of("ros2", "The graph of ROS 2; no installation of ROS is needed.")

    parser = add(
        "check",
        "tools.ros_checks.check_ros2",
        "tell why nodes that are started in this terminal see nothing of a server, or see it twice: domain, range,"
        " interface, quality of service, type hash, publishers",
    )
    parser.option("--domain", "N", "of the server [ROS_DOMAIN_ID, or 0]", type=_domain)
    parser.add_argument(
        "--distro",
        choices=("humble", "iron", "jazzy", "kilted", "rolling"),
        help="distribution of the nodes [ROS_DISTRO, or jazzy]",
    )
    about = "for the server [%(default)s]"
    parser.option("--wait", "SECONDS", about, dest="patience", type=SECONDS, default=DEFAULT_PATIENCE)
    add_json(parser)
    return group
