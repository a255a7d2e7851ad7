"""The table of all commands but `serve` and `attach`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from importlib import import_module

from rosbridge_sim.link.arguments import Parser

_PLACES = {
    "bridge_commands": ("topic", "service", "layout", "wait"),
    "graph_commands": ("node", "param", "action"),
    "file_commands": ("schema", "interface", "scenario", "map", "docs"),
    "bag_commands": ("bag", "record"),
    "campaign_commands": ("campaign",),
    "contract_commands": ("contract",),
    "doctor_command": ("doctor",),
    "mock_command": ("mock",),
    "ros_commands": ("ros1", "ros2"),
    "simulator_commands": ("sync", "tick", "step", "score", "snapshot", "restore", "spawn", "sensor"),
    "picture_commands": ("shot", "clip"),
}
"""Module of `cli` -> its commands. Each has a function `make_NAME` there, which returns its parser."""


def make_parser(name: str) -> Parser:
    """Return the parser of a command. Only its module is imported."""
    place = next(place for place, names in _PLACES.items() if name in names)
    parser: Parser = getattr(import_module(f"rosbridge_sim.cli.{place}"), f"make_{name}")()
    return parser


def _run(name: str, argv: Sequence[str]) -> int:
    from rosbridge_sim.cli.command_line import run_command  # noqa: PLC0415 - not needed for the names

    return run_command(make_parser(name), argv)


TOOLS: dict[str, Callable[[Sequence[str]], int]] = {
    name: partial(_run, name) for names in _PLACES.values() for name in names
}
"""Name -> function that runs the command with the words behind the name."""
