"""The commands `rosbridge-sim mock ...`."""

from __future__ import annotations

from rosbridge_sim.cli.command_line import add_definitions, add_json, group_of
from rosbridge_sim.link.arguments import Parser


def make_mock() -> Parser:
    """Return the parser of `rosbridge-sim mock ...`."""
    group, add = group_of("mock", "A robot that a YAML file describes, to test programs and web pages without one.")

    parser = add("check", "mock.mock_check.check_files", "find the mistakes in files of mocks")
    parser.add_argument("files", metavar="FILE.yaml", nargs="+")
    add_json(parser)
    add_definitions(parser)
    parser.add_argument("--ros", metavar="1|2", help="ROS generation of the standard messages")
    return group
