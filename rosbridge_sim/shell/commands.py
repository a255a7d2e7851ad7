"""The commands that talk to a rosbridge, `rosbridge-sim topic|service|record ...`, and the table of all tools."""

from __future__ import annotations

import asyncio
import os
from collections.abc import Awaitable, Callable, Sequence
from typing import TYPE_CHECKING

from rosbridge_sim.shell.command_line import (
    Options,
    add_definitions,
    add_json,
    choice_of,
    group_of,
    make_number,
    run_command,
)
from rosbridge_sim.shell.file_commands import run_bag, run_map, run_scenario, run_schema
from rosbridge_sim.shell.sources import PREFIX, Parser, SettingError, layout
from rosbridge_sim.shell.tools.text import read_body
from rosbridge_sim.shell.urls import shown_url

if TYPE_CHECKING:
    from rosbridge_sim.shell.tools.client import Bridge

__all__ = ["TOOLS"]

DEFAULT_URL = "ws://127.0.0.1:9090"

PATIENCE = 5.0
"""How long an answer may take if nothing is said [s]: rosbridge_suite's own time-out of a call."""

CALL_PATIENCE = 30.0
"""The same for a service that is called [s]: to load a scenario takes a while."""

DEFAULT_RATE = 1.0
"""How often `pub` repeats itself if nothing is said [Hz], as `ros2 topic pub` does."""


# What they share


def _with_bridge(options: Options, work: Callable[[Bridge], Awaitable[int]]) -> int:
    """Connect, work, close."""
    from rosbridge_sim.shell.tools.client import open_bridge  # noqa: PLC0415 - --help and a mistake do without it

    async def main() -> int:
        async with open_bridge(options.url, options.token, options.patience) as bridge:
            return await work(bridge)

    return asyncio.run(main())


def _add_bridge(parser: Parser, patience: float = PATIENCE, *, is_call: bool = False) -> None:
    """What every command that talks to a server takes."""
    url = os.environ.get(f"{PREFIX}URL") or DEFAULT_URL
    token = os.environ.get(f"{PREFIX}TOKEN") or None
    add_json(parser)
    text = f"any rosbridge, also as {PREFIX}URL [{shown_url(url)}]"  # a token may stand in it
    parser.add_argument("--url", default=url, help=text.replace("%", "%%"))
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


_seconds = make_number(0.001, 1e6, "seconds", float)
_seconds_or_none = make_number(0, 1e6, "seconds, or 0", float)
_hertz = make_number(0.001, 1e4, "times a second, at most 10,000", float)
_count = make_number(1, 1e9, "a number from 1 on", int)
_window = make_number(2, 1e6, "a number from 2 to 1,000,000", int)


# topic


def _topic(argv: Sequence[str]) -> int:
    group, add = group_of("topic", "What is published on a rosbridge, and publishing there.")

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
    return run_command(group, argv)


def _list_topics(options: Options) -> int:
    from rosbridge_sim.shell.tools import topic  # noqa: PLC0415 - see above, and so below

    return _with_bridge(
        options,
        lambda bridge: topic.list_topics(
            bridge, is_verbose=options.verbose, has_types=options.types, is_json=options.json
        ),
    )


def _show_topic(options: Options) -> int:
    from rosbridge_sim.shell.tools import topic  # noqa: PLC0415

    return _with_bridge(options, lambda bridge: topic.show_topic(bridge, options.name, is_json=options.json))


def _echo(options: Options) -> int:
    from rosbridge_sim.shell.tools import topic  # noqa: PLC0415

    try:
        path = None if options.field is None else topic.FieldPath(options.field)
    except ValueError:
        raise SettingError(f"--field: expected a path such as a.b or list[0].c; got {options.field!r}") from None
    return _with_bridge(
        options,
        lambda bridge: topic.echo(bridge, options.name, options.type, path, options.count, is_json=options.json),
    )


def _show_rate(options: Options) -> int:
    from rosbridge_sim.shell.tools.rate import show_rate  # noqa: PLC0415

    return _with_bridge(
        options,
        lambda bridge: show_rate(
            bridge, options.name, options.type, options.window, options.count, is_json=options.json
        ),
    )


def _publish(options: Options) -> int:
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
    group, add = group_of("service", "What can be called on a rosbridge, and calling it.")

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
    return run_command(group, argv)


def _list_services(options: Options) -> int:
    from rosbridge_sim.shell.tools import service  # noqa: PLC0415

    return _with_bridge(
        options, lambda bridge: service.list_services(bridge, is_verbose=options.verbose, is_json=options.json)
    )


def _show_service(options: Options) -> int:
    from rosbridge_sim.shell.tools import service  # noqa: PLC0415

    return _with_bridge(options, lambda bridge: service.show_service(bridge, options.name, is_json=options.json))


def _call(options: Options) -> int:
    from rosbridge_sim.shell.tools import service  # noqa: PLC0415

    args = read_body(options.request, "REQUEST")
    if not isinstance(args, (dict, list)):
        raise SettingError(f"REQUEST: expected an object such as '{{data: 1}}'; got {options.request!r}")
    patience = options.patience or None
    options.patience = PATIENCE  # of everything but the call
    return _with_bridge(
        options, lambda bridge: service.call(bridge, options.name, args, patience, is_json=options.json)
    )


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
    add_definitions(parser)
    parser.set_defaults(run=_run_record, end=0)
    return run_command(parser, argv)


def _run_record(options: Options) -> int:
    from rosbridge_sim.shell.tools import record  # noqa: PLC0415

    return _with_bridge(
        options,
        lambda bridge: record.record(
            bridge, options.file, tuple(options.topics), choice_of(options), options.count, is_json=options.json
        ),
    )


TOOLS: dict[str, Callable[[Sequence[str]], int]] = {
    "topic": _topic,
    "service": _service,
    "schema": run_schema,
    "bag": run_bag,
    "scenario": run_scenario,
    "map": run_map,
    "record": _record,
}
"""Name -> what runs it with the words behind the name."""
