"""What all commands of the command line share: how they are run and end, their help, their flags and numbers.

Code 0: done. Code 1: whoever was asked says no. Code 2: a mistake in the command line, no rosbridge to talk to, or an
output that takes nothing (a full disk). A command that has no end of its own ends well by Ctrl-C (0); another one was
cut off (130). A reader that has had enough (`| head`) is no mistake. The tools themselves are imported once it is known
which one is wanted.
"""

from __future__ import annotations

import argparse
import errno
import os
import sys
from collections.abc import Callable, Sequence
from io import TextIOWrapper
from typing import TYPE_CHECKING

from rosbridge_sim.cli.tools.text import note
from rosbridge_sim.errors import DocumentError
from rosbridge_sim.shell.config.command_flags import Parser, layout
from rosbridge_sim.shell.config.value_types import SettingError
from rosbridge_sim.shell.websocket.bridge_errors import RefusedError

if TYPE_CHECKING:
    from rosbridge_sim.cli.tools.schema import DefinitionSources

__all__ = [
    "OUTPUT_LOST",
    "Options",
    "add_definitions",
    "add_json",
    "choice_of",
    "drop_output",
    "group_of",
    "make_number",
    "run_command",
]

INTERRUPTED = 130
"""What a shell reports of a program that Ctrl-C has ended."""

OUTPUT_LOST = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO)
"""Errors of a disk, and of a terminal that is gone."""

Options = argparse.Namespace


# What ends a command


def run_command(parser: argparse.ArgumentParser, argv: Sequence[str]) -> int:
    """Run the command that the words name; the exit code."""
    options = Options(end=INTERRUPTED)
    if isinstance(sys.stdout, TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")  # a terminal without Korean still gets an answer
    try:
        parser.parse_args(argv, options)
        code: int = options.run(options)
        sys.stdout.flush()
    except RefusedError as error:
        note(str(error))
        return 1
    except DocumentError as error:
        for line in str(error).splitlines():  # a settings file may have several mistakes
            note(line)
        return 2
    except KeyboardInterrupt:
        end: int = options.end
        return end
    except BrokenPipeError:
        drop_output()
        return 0
    except OSError as error:
        if error.errno not in OUTPUT_LOST or error.filename is not None:  # a write to stdout has no file's name
            raise
        drop_output()
        note(f"the output cannot be written: {os.strerror(error.errno).lower()}")
        return 2
    return code


def drop_output() -> None:
    """Lead stdout nowhere, so that what is left in its buffer does not fail again at the end of the process."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, sys.stdout.fileno())
    os.close(nowhere)


# What they have in common


def group_of(name: str, text: str) -> tuple[Parser, Callable[..., Parser]]:
    """The parser of `rosbridge-sim NAME`, and what adds a command to it."""
    prog = f"rosbridge-sim {name}"
    group = Parser(prog=prog, description=text, allow_abbrev=False, formatter_class=layout)
    commands = group.add_subparsers(title="commands", metavar="COMMAND", dest="command")

    def none_given(_options: Options) -> int:
        raise SettingError(f"{name}: expected a command: {', '.join(commands.choices)}; {prog} --help says more")

    group.set_defaults(run=none_given)

    def add(command: str, run: Callable[[Options], int], text: str) -> Parser:
        parser: Parser = commands.add_parser(
            command, help=text, description=f"{text[0].upper()}{text[1:]}.", allow_abbrev=False, formatter_class=layout
        )
        parser.set_defaults(run=run)
        return parser

    return group, add


def add_json(parser: Parser) -> None:
    """The flag of all that show something."""
    parser.add_argument("--json", action="store_true", help="for programs: one JSON value, or one a line")


def add_definitions(parser: Parser) -> None:
    """What decides which definitions there are."""
    parser.add_argument("--release", help="MORAI SIM release whose messages are meant")
    parser.add_argument(
        "--schema-path", action="append", default=[], metavar="DIR", help="folder with ROS packages; may be repeated"
    )


def choice_of(options: Options) -> DefinitionSources:
    """What these flags have decided; a command without `--ros` leaves that open."""
    from rosbridge_sim.cli.tools.schema import DefinitionSources  # noqa: PLC0415 - with all that knows definitions

    return DefinitionSources(options.release, vars(options).get("ros"), tuple(options.schema_path))


def make_number(low: float, high: float, what: str, as_type: type[int | float]) -> Callable[[str], float]:
    """What reads a flag's number within bounds; `what` is expected of it."""

    def read(text: str) -> float:
        try:
            number = as_type(text)
        except ValueError:
            number = low - 1
        if not low <= number <= high:
            raise argparse.ArgumentTypeError(f"expected {what}; got {text!r}")
        return number

    return read
