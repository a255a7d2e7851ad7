"""The command line of the tools: `rosbridge-sim topic|service|schema ...`, its flags and its exit codes.

Code 0: done. Code 1: whoever was asked says no. Code 2: a mistake in the command line, or no rosbridge to talk to. A
command that has no end of its own ends well by Ctrl-C (0); another one was cut off (130). A reader that has had enough
(`| head`) is no mistake. The tools themselves are imported once it is known which one is wanted.
"""

from __future__ import annotations

import argparse
import asyncio
import os
import sys
from collections.abc import Awaitable, Callable, Sequence
from io import TextIOWrapper
from typing import TYPE_CHECKING

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.shell.sources import PREFIX, Parser, SettingError, layout
from rosbridge_sim.shell.tools.faults import RefusedError
from rosbridge_sim.shell.tools.text import note, read_body

if TYPE_CHECKING:
    from rosbridge_sim.shell.tools.client import Bridge
    from rosbridge_sim.shell.tools.schema import Choice

__all__ = ["TOOLS"]

DEFAULT_URL = "ws://127.0.0.1:9090"

PATIENCE = 5.0
"""How long an answer may take if nothing is said [s]: rosbridge_suite's own time-out of a call."""

CALL_PATIENCE = 30.0
"""The same for a service that is called [s]: to load a scenario takes a while."""

DEFAULT_RATE = 1.0
"""How often `pub` repeats itself if nothing is said [Hz], as `ros2 topic pub` does."""

INTERRUPTED = 130
"""What a shell reports of a program that Ctrl-C has ended."""

_Options = argparse.Namespace


# What ends a command


def _run(parser: argparse.ArgumentParser, argv: Sequence[str]) -> int:
    """Run the command that the words name; the exit code."""
    options = _Options(end=INTERRUPTED)
    if isinstance(sys.stdout, TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")  # a terminal without Korean still gets an answer
    try:
        parser.parse_args(argv, options)
        code: int = options.run(options)
    except RefusedError as error:
        note(str(error))
        return 1
    except DocumentError as error:
        note(str(error))
        return 2
    except KeyboardInterrupt:
        end: int = options.end
        return end
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # what is left to flush has nowhere to go
        return 0
    return code


def _with_bridge(options: _Options, work: Callable[[Bridge], Awaitable[int]]) -> int:
    """Connect, work, close."""
    from rosbridge_sim.shell.tools.client import open_bridge  # noqa: PLC0415 - --help and a mistake do without it

    async def main() -> int:
        async with open_bridge(options.url, options.token, options.patience) as bridge:
            return await work(bridge)

    return asyncio.run(main())


# What they have in common


def _group(name: str, text: str) -> tuple[Parser, Callable[..., Parser]]:
    """The parser of `rosbridge-sim NAME`, and what adds a command to it."""
    prog = f"rosbridge-sim {name}"
    group = Parser(prog=prog, description=text, allow_abbrev=False, formatter_class=layout)
    commands = group.add_subparsers(title="commands", metavar="COMMAND", dest="command")

    def none_given(_options: _Options) -> int:
        raise SettingError(f"{name}: expected a command: {', '.join(commands.choices)}; {prog} --help says more")

    group.set_defaults(run=none_given)

    def add(command: str, run: Callable[[_Options], int], text: str) -> Parser:
        parser: Parser = commands.add_parser(
            command, help=text, description=f"{text[0].upper()}{text[1:]}.", allow_abbrev=False, formatter_class=layout
        )
        parser.set_defaults(run=run)
        return parser

    return group, add


def _add_bridge(parser: Parser, patience: float = PATIENCE, *, is_call: bool = False) -> None:
    """What every command that talks to a server takes."""
    url = os.environ.get(f"{PREFIX}URL") or DEFAULT_URL
    token = os.environ.get(f"{PREFIX}TOKEN") or None
    _add_json(parser)
    parser.add_argument("--url", default=url, help=f"any rosbridge, also as {PREFIX}URL [{url}]".replace("%", "%%"))
    parser.add_argument("--token", default=token, help=f"what lets us in, also as {PREFIX}TOKEN")
    text = "how long the service may take; 0 is for ever" if is_call else "how long an answer may take"
    parser.add_argument(
        "--timeout",
        dest="patience",
        type=_seconds_or_none if is_call else _seconds,
        default=patience,
        metavar="SECONDS",
        help=f"{text} [{patience:g}]",
    )


def _add_json(parser: Parser) -> None:
    parser.add_argument("--json", action="store_true", help="for programs: one JSON value, or one a line")


def _number(low: float, high: float, what: str, as_type: type[int | float]) -> Callable[[str], float]:
    def read(text: str) -> float:
        try:
            number = as_type(text)
        except ValueError:
            number = low - 1
        if not low <= number <= high:
            raise argparse.ArgumentTypeError(f"expected {what}; got {text!r}")
        return number

    return read


_seconds = _number(0.001, 1e6, "seconds", float)
_seconds_or_none = _number(0, 1e6, "seconds, or 0", float)
_hertz = _number(0.001, 1e4, "times a second, at most 10,000", float)
_count = _number(1, 1e9, "a number from 1 on", int)
_window = _number(2, 1e6, "a number from 2 to 1,000,000", int)


# topic


def _topic(argv: Sequence[str]) -> int:
    group, add = _group("topic", "What is published on a rosbridge, and publishing there.")

    parser = add("list", _list_topics, "the topics that there are")
    parser.add_argument("-v", "--verbose", action="store_true", help="types, publishers and subscribers too")
    parser.add_argument("-t", "--types", action="store_true", help="types too")
    _add_bridge(parser)

    parser = add("info", _show_topic, "type, publishers and subscribers of a topic")
    parser.add_argument("name", metavar="NAME")
    _add_bridge(parser)

    parser = add("echo", _echo, "what is published, as it comes")
    parser.add_argument("name", metavar="NAME")
    parser.add_argument("-n", "--count", type=_count, help="end after so many messages")
    parser.add_argument("--once", action="store_const", const=1, dest="count", help="end after the first")
    parser.add_argument("--field", metavar="PATH", help="one field alone, as a.b or list[0].c")
    parser.add_argument("--type", metavar="TYPE", help="of a topic that is not there yet")
    _add_bridge(parser)
    parser.set_defaults(end=0)

    parser = add("hz", _show_rate, "how often messages come")
    parser.add_argument("name", metavar="NAME")
    parser.add_argument("-w", "--window", type=_window, metavar="N", help="look back on so many messages [all]")
    parser.add_argument("-n", "--count", type=_window, help="end after so many messages")
    parser.add_argument("--type", metavar="TYPE", help="of a topic that is not there yet")
    _add_bridge(parser)
    parser.set_defaults(end=0)

    parser = add("pub", _publish, "publish a message: once a second until Ctrl-C if nothing else is said")
    parser.add_argument("name", metavar="NAME")
    parser.add_argument("type", metavar="TYPE")
    parser.add_argument(
        "message", metavar="MESSAGE", nargs="?", default="{}", help="JSON or YAML; fields may be left out"
    )
    parser.add_argument("-1", "--once", action="store_const", const=1, dest="count", help="once, then end")
    parser.add_argument("-n", "--count", type=_count, help="end after so many times")
    parser.add_argument("-r", "--rate", type=_hertz, metavar="HZ", help=f"so often a second [{DEFAULT_RATE:g}]")
    parser.add_argument(
        "-l", "--latch", action="store_true", help="who subscribes later gets it too; alone: once, then stay for them"
    )
    _add_bridge(parser)
    parser.set_defaults(end=0)
    return _run(group, argv)


def _list_topics(options: _Options) -> int:
    from rosbridge_sim.shell.tools import topic  # noqa: PLC0415 - see above, and so below

    return _with_bridge(
        options,
        lambda bridge: topic.list_topics(
            bridge, is_verbose=options.verbose, has_types=options.types, is_json=options.json
        ),
    )


def _show_topic(options: _Options) -> int:
    from rosbridge_sim.shell.tools import topic  # noqa: PLC0415

    return _with_bridge(options, lambda bridge: topic.show_topic(bridge, options.name, is_json=options.json))


def _echo(options: _Options) -> int:
    from rosbridge_sim.shell.tools import topic  # noqa: PLC0415

    try:
        path = None if options.field is None else topic.FieldPath(options.field)
    except ValueError:
        raise SettingError(f"--field: expected a path such as a.b or list[0].c; got {options.field!r}") from None
    return _with_bridge(
        options,
        lambda bridge: topic.echo(bridge, options.name, options.type, path, options.count, is_json=options.json),
    )


def _show_rate(options: _Options) -> int:
    from rosbridge_sim.shell.tools.rate import show_rate  # noqa: PLC0415

    return _with_bridge(
        options,
        lambda bridge: show_rate(
            bridge, options.name, options.type, options.window, options.count, is_json=options.json
        ),
    )


def _publish(options: _Options) -> int:
    from rosbridge_sim.shell.tools import topic  # noqa: PLC0415

    msg = read_body(options.message, "MESSAGE")
    if not isinstance(msg, dict):
        raise SettingError(f"MESSAGE: expected an object such as '{{data: 1}}'; got {options.message!r}")
    is_kept = options.latch and options.rate is None and options.count is None
    rate = None if is_kept or options.count == 1 else options.rate or DEFAULT_RATE
    return _with_bridge(
        options,
        lambda bridge: topic.publish(
            bridge,
            options.name,
            options.type,
            msg,
            count=options.count,
            rate=rate,
            is_latched=options.latch,
            is_json=options.json,
        ),
    )


# service


def _service(argv: Sequence[str]) -> int:
    group, add = _group("service", "What can be called on a rosbridge, and calling it.")

    parser = add("list", _list_services, "the services that there are")
    parser.add_argument("-v", "--verbose", action="store_true", help="types and providers too")
    _add_bridge(parser)

    parser = add("info", _show_service, "type, provider, request and response of a service")
    parser.add_argument("name", metavar="NAME")
    _add_bridge(parser)

    parser = add("call", _call, "call a service and show what it answers")
    parser.add_argument("name", metavar="NAME")
    parser.add_argument(
        "request", metavar="REQUEST", nargs="?", default="{}", help="JSON or YAML; fields may be left out"
    )
    _add_bridge(parser, CALL_PATIENCE, is_call=True)
    return _run(group, argv)


def _list_services(options: _Options) -> int:
    from rosbridge_sim.shell.tools import service  # noqa: PLC0415

    return _with_bridge(
        options, lambda bridge: service.list_services(bridge, is_verbose=options.verbose, is_json=options.json)
    )


def _show_service(options: _Options) -> int:
    from rosbridge_sim.shell.tools import service  # noqa: PLC0415

    return _with_bridge(options, lambda bridge: service.show_service(bridge, options.name, is_json=options.json))


def _call(options: _Options) -> int:
    from rosbridge_sim.shell.tools import service  # noqa: PLC0415

    args = read_body(options.request, "REQUEST")
    if not isinstance(args, (dict, list)):
        raise SettingError(f"REQUEST: expected an object such as '{{data: 1}}'; got {options.request!r}")
    patience = options.patience or None
    options.patience = PATIENCE  # of everything but the call
    return _with_bridge(
        options, lambda bridge: service.call(bridge, options.name, args, patience, is_json=options.json)
    )


# schema


def _schema(argv: Sequence[str]) -> int:
    group, add = _group("schema", "The definitions of types that are known here; no server is asked.")

    parser = add("list", _list_types, "the types that are known")
    parser.add_argument("package", metavar="PACKAGE", nargs="?", help="those of one package")
    _add_folders(parser)

    parser = add("show", _show_type, "the definition of a type")
    parser.add_argument("type", metavar="TYPE", help="pkg/Type, or Type of any package")
    parser.add_argument("--full", action="store_true", help="with the definitions of all types in it")
    _add_folders(parser)
    return _run(group, argv)


def _add_folders(parser: Parser) -> None:
    _add_json(parser)
    _add_definitions(parser)
    parser.add_argument("--ros", metavar="1|2", help="ROS generation whose standard messages are meant")


def _add_definitions(parser: Parser) -> None:
    parser.add_argument("--release", help="MORAI SIM release whose messages are meant")
    parser.add_argument(
        "--schema-path", action="append", default=[], metavar="DIR", help="folder with ROS packages; may be repeated"
    )


def _list_types(options: _Options) -> int:
    from rosbridge_sim.shell.tools import schema  # noqa: PLC0415

    return schema.list_types(options.package, _choice(options), is_json=options.json)


def _show_type(options: _Options) -> int:
    from rosbridge_sim.shell.tools import schema  # noqa: PLC0415

    return schema.show_type(options.type, _choice(options), is_full=options.full, is_json=options.json)


def _choice(options: _Options) -> Choice:
    from rosbridge_sim.shell.tools.schema import Choice  # noqa: PLC0415

    return Choice(options.release, options.ros, tuple(options.schema_path))


# bag


def _bag(argv: Sequence[str]) -> int:
    group, add = _group("bag", "Bags, as files; no server is asked.")

    parser = add("repair", _repair_bag, "copy what is whole of a bag whose recorder was killed into a new one")
    parser.add_argument("file", metavar="FILE", help="NAME.bag, NAME.mcap, or a folder of rosbag2")
    parser.add_argument("-o", "--output", metavar="FILE", help="the new bag [NAME.repaired.bag, as the old one ends]")
    _add_json(parser)
    return _run(group, argv)


def _repair_bag(options: _Options) -> int:
    from rosbridge_sim.shell.tools import bag  # noqa: PLC0415

    return bag.repair_bag(options.file, options.output, is_json=options.json)


# record


def _record(argv: Sequence[str]) -> int:
    parser = Parser(
        prog="rosbridge-sim record",
        description="Record what is published on a rosbridge into a bag, until Ctrl-C.",
        allow_abbrev=False,
        formatter_class=layout,
    )
    parser.add_argument("file", metavar="FILE", help="NAME.bag is ROS 1, NAME.mcap ROS 2, else a folder of ROS 2")
    parser.add_argument(
        "-t",
        "--topics",
        action="append",
        default=[],
        metavar="PATTERN",
        help="which, such as '/Ego*'; repeatable [all]",
    )
    parser.add_argument("-n", "--count", type=_count, help="end after so many messages")
    _add_bridge(parser)
    _add_definitions(parser)
    parser.set_defaults(run=_run_record, end=0)
    return _run(parser, argv)


def _run_record(options: _Options) -> int:
    from rosbridge_sim.shell.tools import record  # noqa: PLC0415

    options.ros = None
    return _with_bridge(
        options,
        lambda bridge: record.record(
            bridge, options.file, tuple(options.topics), _choice(options), options.count, is_json=options.json
        ),
    )


TOOLS: dict[str, Callable[[Sequence[str]], int]] = {
    "topic": _topic,
    "service": _service,
    "schema": _schema,
    "bag": _bag,
    "record": _record,
}
"""Name -> what runs it with the words behind the name."""
