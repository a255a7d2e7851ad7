"""The commands `rosbridge-sim mock ...`."""

from __future__ import annotations

from rosbridge_sim.cli.bridge_flags import add_bridge
from rosbridge_sim.cli.command_line import Options, add_definitions, add_json, group_of
from rosbridge_sim.cli.contract_commands import add_patterns, add_watching
from rosbridge_sim.errors import SettingError
from rosbridge_sim.link.arguments import Parser


def _run_elsewhere(_options: Options) -> int:
    raise SettingError("mock run: expected directly behind rosbridge-sim")


def make_mock() -> Parser:
    """Return the parser of `rosbridge-sim mock ...`."""
    group, add = group_of("mock", "A robot that a YAML file describes, to test programs and web pages without one.")

    parser = add("check", "mock.mock_check.check_files", "find the mistakes in files of mocks")
    parser.add_argument("files", metavar="FILE.yaml", nargs="+")
    add_json(parser)
    add_definitions(parser)
    parser.add_argument("--ros", metavar="1|2", help="ROS generation of the standard messages")
    _add_capture(
        add("capture", "mock.capture_run.capture_mock", "watch a running system or a bag, and write a mock of it")
    )

    parser = add(
        "fault", "mock.mock_fault.switch_fault", "switch a fault of a running mock, or add one, and list all faults"
    )
    parser.add_argument("name", metavar="NAME", nargs="?", help="of the fault; without it only list them")
    about = "on, off, or a new fault such as '{kind: drop, topics: [/scan], probability: 0.5}'"
    parser.add_argument("words", metavar="on|off|RULE", nargs="*", help=about)
    add_bridge(parser)
    add("run", _run_elsewhere, "run a mock: mock run FILE; its flags are those of serve")
    return group


def _add_capture(parser: Parser) -> None:
    parser.add_argument("source", metavar="URL|BAG", help="a rosbridge; or NAME.bag, NAME.mcap or a folder of rosbag2")
    parser.add_argument("-o", "--output", dest="file", metavar="FILE", required=True, help="the new file")
    add_watching(parser)
    add_patterns(parser)
    about = "call this service, which must only read, without arguments, and write its answer; may be repeated"
    parser.add_argument("--call", dest="calls", action="append", default=[], metavar="NAME", help=about)
    add_definitions(parser)
    parser.add_argument("--ros", metavar="1|2", help="ROS generation of the standard messages [that of the types]")
