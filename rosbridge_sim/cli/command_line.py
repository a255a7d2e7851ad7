"""The common parts of all commands: running and ending them, help, flags and numbers.

Exit code 0: done. 1: the server, or the check, says no. 2: a mistake in the command line, no rosbridge to talk to, or
an output that cannot be written (a full disk). Endless commands exit with 0 on Ctrl-C, others with 130. A closed output
pipe (`| head`) is not an error. The tools are imported only when the command is known.
"""

from __future__ import annotations

import argparse
import asyncio
import errno
import os
import sys
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from importlib import import_module
from inspect import iscoroutine, signature
from io import TextIOWrapper
from typing import Any

from rosbridge_sim.cli.tools.text import note
from rosbridge_sim.errors import DocumentError, SettingError
from rosbridge_sim.link.arguments import Parser, layout
from rosbridge_sim.link.bridge_errors import RefusedError

INTERRUPTED = 130
"""Exit code of a program that Ctrl-C has ended, as in a shell."""

ANSWER_PATIENCE = 5.0
"""Default of the longest wait for an answer [s]: rosbridge_suite's own time-out of a call."""

OUTPUT_LOST = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO)
"""Errors of a disk, or of a terminal that is closed."""

Options = argparse.Namespace


# Running and ending


def run_command(parser: argparse.ArgumentParser, argv: Sequence[str]) -> int:
    """Run the command that the words name.

    Args:
        argv: words behind the command's name.

    Returns:
        The exit code.
    """
    options = Options(end=INTERRUPTED)
    if isinstance(sys.stdout, TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")  # for a terminal that has no Korean characters
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
        if error.errno not in OUTPUT_LOST or error.filename is not None:  # one with a file name is not about stdout
            raise
        drop_output()
        note(f"the output cannot be written: {os.strerror(error.errno).lower()}")
        return 2
    return code


def drop_output() -> None:
    """Send stdout to nowhere, so that the data in its buffer causes no second error at the end of the process."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, sys.stdout.fileno())
    os.close(nowhere)


def run_tool(place: str, options: Options, **more: Any) -> int:  # noqa: ANN401 - of any function
    """Run a function of `rosbridge_sim.cli`, which is imported only now: help needs no connection.

    Each of its parameters gets the flag of the same name, `is_json` that of `--json`, and `num_jobs` that of `--jobs`.
    `sources` are the message definitions that flags select; `bridge` is a connection to the server at `url`, open while
    a coroutine runs; `connect` opens one to a URL.

    Args:
        place: module and function, such as `tools.node.list_nodes`.
        more: values of parameters that are no flags, or that differ from them.

    Returns:
        The exit code.
    """
    module, _, name = place.rpartition(".")
    work = getattr(import_module(f"rosbridge_sim.cli.{module}"), name)
    names = signature(work).parameters
    given = {**vars(options), **more}
    if "sources" in names:
        from rosbridge_sim.cli.tools.schema import DefinitionSources  # noqa: PLC0415 - with all that knows definitions

        given["sources"] = DefinitionSources(options.release, given.get("ros"), tuple(options.schema_path))

    if "connect" in names:
        from rosbridge_sim.cli.tools.tool_client import open_bridge  # noqa: PLC0415 - as above

        given["connect"] = partial(open_bridge, token=options.token, patience=options.patience)

    def run(**opened: object) -> Any:  # noqa: ANN401 - as above
        chosen = given | opened
        return work(**{each: chosen[each if each in chosen else each.partition("_")[2]] for each in names})

    async def run_connected() -> int:
        from rosbridge_sim.cli.tools.tool_client import open_bridge  # noqa: PLC0415 - not needed after a mistake

        async with open_bridge(options.url, options.token, options.patience or ANSWER_PATIENCE) as bridge:
            return await run(bridge=bridge) or 0

    done: Any = run_connected() if "bridge" in names else run()
    code: int | None = asyncio.run(done) if iscoroutine(done) else done
    return code or 0


def words_of(options: Options, *flags: str) -> list[str]:
    """Return flags that `serve` has, too, as words of a command line; without those that were not given.

    Args:
        flags: names of options, such as `scenario_path` for `--scenario-path`.
    """
    words: list[str] = []
    for name in flags:
        given, flag = getattr(options, name), f"--{name.replace('_', '-')}"
        words += [flag] if given is True else []
        values = given if isinstance(given, list) else [given]
        words += [f"{flag}={each}" for each in values if each is not None and not isinstance(each, bool)]
    return words


# Common flags


Work = Callable[[Options], int] | str
"""Does a command's work and returns the exit code; a text is a place for `run_tool`."""


def _set_work(parser: Parser, work: Work) -> None:
    parser.set_defaults(run=partial(run_tool, work) if isinstance(work, str) else work)


def command_of(name: str, work: Work, text: str, epilog: str | None = None) -> Parser:
    """Return the parser of `rosbridge-sim NAME`.

    Args:
        text: description for the help.
        epilog: what stands below the flags.
    """
    prog = f"rosbridge-sim {name}"
    parser = Parser(prog=prog, description=text, epilog=epilog, allow_abbrev=False, formatter_class=layout)
    _set_work(parser, work)
    return parser


def group_of(name: str, text: str, absent: Mapping[str, str] | None = None) -> tuple[Parser, Callable[..., Parser]]:
    """Return the parser of `rosbridge-sim NAME`, and a function that adds a command to it.

    Args:
        text: description for the help.
        absent: see `Parser`.
    """

    def none_given(_options: Options) -> int:
        raise SettingError(f"{name}: expected a command: {', '.join(commands.choices)}; see {group.prog} --help")

    group = command_of(name, none_given, text)
    group.absent = absent or {}
    commands = group.add_subparsers(title="commands", metavar="COMMAND", dest="command")

    def add(command: str, work: Work, text: str) -> Parser:
        parser: Parser = commands.add_parser(
            command, help=text, description=f"{text[0].upper()}{text[1:]}.", allow_abbrev=False, formatter_class=layout
        )
        _set_work(parser, work)
        return parser

    return group, add


def add_json(parser: Parser) -> None:
    """Add the flag `--json`, for commands that print something."""
    parser.switch("--json", "print JSON for programs: one value, or one per line")


def add_definitions(parser: Parser) -> None:
    """Add the flags that select message definitions."""
    parser.add_argument("--release", help="MORAI SIM release of the messages")
    parser.repeated("--schema-path", "DIR", "folder with ROS packages; may be repeated")


def make_number(low: float, high: float, what: str, as_type: type[int | float]) -> Callable[[str], float]:
    """Return a function that reads a flag's number within limits.

    Args:
        what: description of valid values, for errors.
        as_type: int for whole numbers.
    """

    def read(text: str) -> float:
        try:
            number = as_type(text)
        except ValueError:
            number = low - 1
        if not low <= number <= high:
            raise argparse.ArgumentTypeError(f"expected {what}; got {text!r}")
        return number

    return read
