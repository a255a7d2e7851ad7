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
    parser.option("--ros", "1|2", "ROS generation of the standard messages")
    _add_capture(
        add("capture", "mock.capture_run.capture_mock", "watch a running system or a bag, and write a mock of it")
    )

    parser = add(
        "fault", "mock.mock_fault.switch_fault", "switch a fault of a running mock, or add one, and list all faults"
    )
    parser.option("name", "NAME", "of the fault; without it only list them", nargs="?")
    about = "on, off, or a new fault such as '{kind: drop, topics: [/scan], probability: 0.5}'"
    parser.option("words", "on|off|RULE", about, nargs="*")
    add_bridge(parser)
    add("run", _run_elsewhere, "run a mock: mock run FILE; its flags are those of serve")
    return group


def _add_capture(parser: Parser) -> None:
    parser.option("source", "URL|BAG", "a rosbridge; or NAME.bag, NAME.mcap or a folder of rosbag2")
    parser.option("-o", "--output", "FILE", "the new file", dest="file", required=True)
    add_watching(parser)
    add_patterns(parser)
    about = "call this service, which must only read, without arguments, and write its answer; may be repeated"
    parser.repeated("--call", "NAME", about, dest="calls")
    add_definitions(parser)
    parser.option("--ros", "1|2", "ROS generation of the standard messages [that of the types]")
