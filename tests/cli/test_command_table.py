"""All commands name functions that exist, and have the flags that these need."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from functools import partial
from importlib import import_module
from inspect import signature

from rosbridge_sim.cli.command_line import run_tool
from rosbridge_sim.cli.command_table import TOOLS, make_parser

GIVEN = {"bridge", "connect", "sources"}
"""What `run_tool` makes itself."""


def commands_in(parser: argparse.ArgumentParser) -> Iterator[argparse.ArgumentParser]:
    """A parser, and those of its commands."""
    yield parser
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for one in action.choices.values():
                yield from commands_in(one)


def test_each_command_has_the_flags_that_its_function_takes() -> None:
    num_checked = 0
    for parser in (one for name in TOOLS for one in commands_in(make_parser(name))):
        run = parser.get_default("run")
        if not (isinstance(run, partial) and run.func is run_tool):
            continue
        num_checked += 1
        module, _, name = run.args[0].rpartition(".")
        flags = {action.dest for action in parser._actions} | parser._defaults.keys() | GIVEN | {"command"}
        for each in signature(getattr(import_module(f"rosbridge_sim.cli.{module}"), name)).parameters:
            assert {each, each.partition("_")[2]} & flags, (parser.prog, each)
    assert num_checked > 30
