"""The commands `rosbridge-sim contract ...`."""

from __future__ import annotations

from pathlib import Path

from rosbridge_sim.cli.bridge_flags import SECONDS, add_patience, add_token
from rosbridge_sim.cli.command_line import add_json, group_of, make_number
from rosbridge_sim.link.arguments import Parser

WATCHING = 5.0
"""Default of the time that a system is watched [s]."""

_SHARE = make_number(0, 1000, "a share such as 0.1", float)


def make_contract() -> Parser:
    """Return the parser of `rosbridge-sim contract ...`."""
    text = (
        "What an app relies on, as a file: topics with type, rate and ranges of fields, and services. The same file"
        " is checked against a robot, a simulator and a mock."
    )
    group, add = group_of("contract", text)
    work = "contracts.contract_run.record_contract_file"
    parser = add("record", work, "watch a rosbridge, and write the contract for what was seen")
    _add_server(parser, "the new file, such as robot.contract.yaml")
    add_patterns(parser)
    about = "share of its width by which a range is wider than what was seen, on both sides [0.1]"
    parser.option("--margin", "SHARE", about, type=_SHARE, default=0.1)
    parser.option("--tolerance", "SHARE", "share by which rates may differ [0.2]", type=_SHARE, default=0.2)

    parser = add("check", "contracts.contract_run.check_contract", "judge a rosbridge by a contract")
    _add_server(parser, "the contract")
    parser.epilog = "The exit code is 1 if a term is broken, and 2 after a mistake in the file or without a connection."
    parser.switch("-v", "--verbose", "print the terms that are kept, too")
    parser.option("--junit", "FILE", "write JUnit XML, for CI", dest="junit_path", type=Path)
    return group


def _add_server(parser: Parser, file: str) -> None:
    parser.option("url", "URL", "any rosbridge, such as ws://robot:9090")
    parser.option("file", "FILE", file)
    add_watching(parser)


def add_watching(parser: Parser) -> None:
    """Add the flags of commands that watch a system, but its URL."""
    about = f"time of watching; longer for topics that are slower [{WATCHING:g}]"
    parser.option("-d", "--duration", "SECONDS", about, type=SECONDS, default=WATCHING)
    add_token(parser)
    add_patience(parser)
    add_json(parser)


def add_patterns(parser: Parser) -> None:
    """Add the flags that select topics and services."""
    for what, other in (("topic", "service"), ("service", "topic")):
        default = f"all but those of ROS itself; none with --{other} alone"
        about = f"{what}s to take, such as '/camera/*'; may be repeated [{default}]"
        parser.repeated(f"-{what[0]}", f"--{what}", "PATTERN", about, dest=f"{what}s")
