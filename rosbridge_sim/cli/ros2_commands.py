"""The command about the graph of ROS 2: `rosbridge-sim ros2 check`."""

from __future__ import annotations

from collections.abc import Sequence

from rosbridge_sim.cli.bridge_flags import SECONDS
from rosbridge_sim.cli.command_line import Options, add_json, group_of, make_number, run_command

DEFAULT_PATIENCE = 3.0
"""Longest wait for a server [s]; programs of DDS find each other within a second."""

_domain = make_number(0, 232, "a domain from 0 to 232", int)


def run_ros2(argv: Sequence[str]) -> int:
    """Run `rosbridge-sim ros2 ...`."""
    group, add = group_of("ros2", "The graph of ROS 2; no installation of ROS is needed.")

    parser = add(
        "check",
        _check,
        "tell why nodes that are started in this terminal see nothing of a server, or see it twice: domain, range,"
        " interface, quality of service, type hash, publishers",
    )
    parser.add_argument("--domain", type=_domain, metavar="N", help="of the server [ROS_DOMAIN_ID, or 0]")
    parser.add_argument(
        "--distro",
        choices=("humble", "iron", "jazzy", "kilted", "rolling"),
        help="distribution of the nodes [ROS_DISTRO, or jazzy]",
    )
    parser.add_argument(
        "--wait", type=SECONDS, default=DEFAULT_PATIENCE, metavar="SECONDS", help="for the server [%(default)s]"
    )
    add_json(parser)
    return run_command(group, argv)


def _check(options: Options) -> int:
    from rosbridge_sim.cli.tools import ros2_check  # noqa: PLC0415 - for this command alone

    return ros2_check.check_ros2(options.domain, options.distro, options.wait, is_json=options.json)
