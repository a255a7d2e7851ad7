"""The commands that talk to a rosbridge (`rosbridge-sim topic`, `tick`, `record` ...), and the table of all tools."""

from __future__ import annotations

import asyncio
import os
from argparse import ArgumentTypeError
from collections.abc import Awaitable, Callable, Sequence
from typing import TYPE_CHECKING

from rosbridge_sim.cli.command_line import (
    Options,
    add_definitions,
    add_json,
    definition_sources_of,
    group_of,
    make_number,
    run_command,
)
from rosbridge_sim.cli.file_commands import run_bag, run_docs, run_map, run_scenario, run_schema
from rosbridge_sim.cli.tools.text import read_body
from rosbridge_sim.shell.config.command_flags import Parser, layout
from rosbridge_sim.shell.config.keys import PREFIX
from rosbridge_sim.shell.config.value_types import SettingError
from rosbridge_sim.shell.websocket.urls import shown_url

if TYPE_CHECKING:
    from rosbridge_sim.cli.tools.client import Bridge

__all__ = ["TOOLS"]

DEFAULT_URL = "ws://127.0.0.1:9090"

ANSWER_PATIENCE = 5.0
"""How long an answer may take if nothing is said [s]: rosbridge_suite's own time-out of a call."""

CALL_PATIENCE = 30.0
"""The same for a service that is called [s]: to load a scenario takes a while."""

TICK_ID = "rosbridge-sim"
"""User id of `tick` if nothing is said: the same in each run, so that a second run is the same master."""

DEFAULT_RATE = 1.0
"""How often `pub` repeats itself if nothing is said [Hz], as `ros2 topic pub` does."""


# What they share


def _with_bridge(options: Options, work: Callable[[Bridge], Awaitable[int]]) -> int:
    """Connect, work, close."""
    from rosbridge_sim.cli.tools.client import open_bridge  # noqa: PLC0415 - --help and a mistake do without it

    async def main() -> int:
        patience = vars(options).get("wait") or options.patience
        async with open_bridge(options.url, options.token, patience) as bridge:
            return await work(bridge)

    return asyncio.run(main())


def _add_bridge(
    parser: Parser, patience: float = ANSWER_PATIENCE, *, is_call: bool = False, is_waiting: bool = False
) -> None:
    """Add the flags of every command that talks to a server.

    Args:
        parser: of the command.
        patience: how long an answer may take if nothing is said [s].
        is_call: the answer is that of a service.
        is_waiting: the command waits for messages, by default for ever.
    """
    add_json(parser)
    _add_server(parser)
    if is_waiting:
        text = "longest wait for a message, and for an answer; then end with code 1 and the reason"
        parser.add_argument("--timeout", dest="wait", type=_seconds, metavar="SECONDS", help=f"{text} [for ever]")
        parser.set_defaults(patience=patience)
        return
    text = "how long the service may take; 0 is for ever" if is_call else "how long an answer may take"
    parser.add_argument(
        "--timeout",
        dest="patience",
        type=_seconds_or_none if is_call else _seconds,
        default=patience,
        metavar="SECONDS",
        help=f"{text} [{patience:g}]",
    )


def _add_server(parser: Parser) -> None:
    """Add the flags that say which server is meant."""
    url = os.environ.get(f"{PREFIX}URL") or DEFAULT_URL
    token = os.environ.get(f"{PREFIX}TOKEN") or None
    text = f"any rosbridge, also as {PREFIX}URL [{shown_url(url)}]"  # a token may stand in it
    parser.add_argument("--url", default=url, help=text.replace("%", "%%"))
    parser.add_argument("--token", default=token, help=f"what lets us in, also as {PREFIX}TOKEN")


_seconds = make_number(0.001, 1e6, "seconds", float)
_seconds_or_none = make_number(0, 1e6, "seconds, or 0", float)
_hertz = make_number(0.001, 1e4, "times a second, at most 10,000", float)
_count = make_number(1, 1e9, "a number from 1 on", int)
_step = make_number(20, 1_000, "milliseconds, from 20 to 1,000", int)
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
    _add_bridge(parser, is_waiting=True)
    parser.set_defaults(end=0)

    parser = add("hz", _show_rate, "how often messages come")
    parser.add_argument("name", metavar="NAME")
    parser.add_argument("-w", "--window", type=_window, metavar="N", help="look back on so many messages [all]")
    parser.add_argument("-n", "--count", type=_window, help="end after so many messages")
    parser.add_argument("--type", metavar="TYPE", help="of a topic that is not there yet")
    _add_bridge(parser, is_waiting=True)
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
    from rosbridge_sim.cli.tools import topic  # noqa: PLC0415 - see above, and so below

    return _with_bridge(
        options,
        lambda bridge: topic.list_topics(
            bridge, is_verbose=options.verbose, has_types=options.types, is_json=options.json
        ),
    )


def _show_topic(options: Options) -> int:
    from rosbridge_sim.cli.tools import topic  # noqa: PLC0415

    return _with_bridge(options, lambda bridge: topic.show_topic(bridge, options.name, is_json=options.json))


def _echo(options: Options) -> int:
    from rosbridge_sim.cli.tools import topic  # noqa: PLC0415

    try:
        path = None if options.field is None else topic.FieldPath(options.field)
    except ValueError:
        raise SettingError(f"--field: expected a path such as a.b or list[0].c; got {options.field!r}") from None
    return _with_bridge(
        options,
        lambda bridge: topic.echo(
            bridge, options.name, options.type, path, options.count, patience=options.wait, is_json=options.json
        ),
    )


def _show_rate(options: Options) -> int:
    from rosbridge_sim.cli.tools.hz import show_rate  # noqa: PLC0415

    return _with_bridge(
        options,
        lambda bridge: show_rate(
            bridge,
            options.name,
            options.type,
            options.window,
            options.count,
            patience=options.wait,
            is_json=options.json,
        ),
    )


def _publish(options: Options) -> int:
    from rosbridge_sim.cli.tools import topic  # noqa: PLC0415

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
    from rosbridge_sim.cli.tools import service  # noqa: PLC0415

    return _with_bridge(
        options, lambda bridge: service.list_services(bridge, is_verbose=options.verbose, is_json=options.json)
    )


def _show_service(options: Options) -> int:
    from rosbridge_sim.cli.tools import service  # noqa: PLC0415

    return _with_bridge(options, lambda bridge: service.show_service(bridge, options.name, is_json=options.json))


def _call(options: Options) -> int:
    from rosbridge_sim.cli.tools import service  # noqa: PLC0415

    args = read_body(options.request, "REQUEST")
    if not isinstance(args, (dict, list)):
        raise SettingError(f"REQUEST: expected an object such as '{{data: 1}}'; got {options.request!r}")
    patience = options.patience or None
    options.patience = ANSWER_PATIENCE  # of everything but the call
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
    _add_bridge(parser, is_waiting=True)
    add_definitions(parser)
    parser.set_defaults(run=_run_record, end=0)
    return run_command(parser, argv)


def _run_record(options: Options) -> int:
    from rosbridge_sim.cli.tools import record  # noqa: PLC0415

    return _with_bridge(
        options,
        lambda bridge: record.record(
            bridge,
            options.file,
            tuple(options.topics),
            definition_sources_of(options),
            options.count,
            patience=options.wait,
            is_json=options.json,
        ),
    )


# tick, wait


def _tick(argv: Sequence[str]) -> int:
    parser = Parser(
        prog="rosbridge-sim tick",
        description="Move a simulator in synchronous mode by so many ticks, and show the frame and the ego after each.",
        epilog="With --start the mode is ended again, unless it was on before: then the connection is closed, and the"
        " server's --sync-on-loss says what follows (wait: the world stands until the next tick --start).",
        allow_abbrev=False,
        formatter_class=layout,
    )
    parser.add_argument("count", metavar="N", nargs="?", type=_count, default=1, help="ticks [1]")
    parser.add_argument("--start", action="store_true", help="become the master first, and end the mode at the end")
    parser.add_argument("--id", default=TICK_ID, metavar="ID", help=f"user id of the master [{TICK_ID}]")
    parser.add_argument("--step", type=_step, default=20, metavar="MS", help="length of a tick, a multiple of 20 [20]")
    _add_bridge(parser, CALL_PATIENCE)
    parser.set_defaults(run=_run_tick)
    return run_command(parser, argv)


def _run_tick(options: Options) -> int:
    from rosbridge_sim.cli.tools.sync import tick  # noqa: PLC0415

    if options.step % 20:
        raise SettingError(f"--step: expected a multiple of 20 milliseconds; got {options.step:g}")
    return _with_bridge(
        options,
        lambda bridge: tick(
            bridge, options.count, options.id, options.step, is_starting=options.start, is_json=options.json
        ),
    )


def _wait(argv: Sequence[str]) -> int:
    parser = Parser(
        prog="rosbridge-sim wait",
        description="Wait until a rosbridge takes clients. Code 0: it does. Code 1: it does not in time.",
        allow_abbrev=False,
        formatter_class=layout,
    )
    _add_server(parser)
    parser.add_argument(
        "--timeout",
        type=_seconds,
        default=CALL_PATIENCE,
        metavar="SECONDS",
        help=f"longest wait [{CALL_PATIENCE:g}]",
    )
    parser.set_defaults(run=_run_wait)
    return run_command(parser, argv)


def _run_wait(options: Options) -> int:
    from rosbridge_sim.cli.tools.wait import wait_until_ready  # noqa: PLC0415

    return asyncio.run(wait_until_ready(options.url, options.token, options.timeout))


# spawn


def _spawn(argv: Sequence[str]) -> int:
    parser = Parser(
        prog="rosbridge-sim spawn",
        description="Place an object into a running simulator, and show its number (unique_id).",
        epilog="For example: rosbridge-sim spawn 'kia k5' --lane R0010L1 --distance 20 --behaviour lane;"
        " rosbridge-sim spawn Pedestrian --at 10,5,90 --speed 1.2",
        allow_abbrev=False,
        formatter_class=layout,
    )
    parser.add_argument("model", metavar="MODEL", help="name of the catalogue; 'service call /sim/catalogue' lists all")
    where = parser.add_mutually_exclusive_group(required=True)
    where.add_argument(
        "--at",
        type=_pose,
        metavar="X,Y[,HEADING]",
        help="on the map, in metres and degrees; write --at=-5,2 for a minus",
    )
    where.add_argument("--lane", metavar="LINK", help="on this link of the map")
    parser.add_argument(
        "--distance", type=_number, default=0.0, metavar="M", help="from the beginning of the link, with --lane [0]"
    )
    parser.add_argument(
        "--lateral", type=_number, default=0.0, metavar="M", help="to the left of the link's line, with --lane [0]"
    )
    parser.add_argument("--speed", type=_number, default=0.0, metavar="M/S", help="at the start [0]")
    parser.add_argument("--behaviour", choices=BEHAVIOURS, help="[straight with a speed, else stand]")
    parser.add_argument("--route", type=_links, default=[], metavar="LINK,...", help="for lane: links to follow")
    parser.add_argument("--ego", action="store_true", help="a further ego, with topics of its own; MODEL is a vehicle")
    _add_bridge(parser)
    parser.set_defaults(run=_run_spawn)
    return run_command(parser, argv)


BEHAVIOURS = ("stand", "straight", "lane")
"""Of those that the service knows; a path has too many numbers for a command line."""


def _run_spawn(options: Options) -> int:
    from rosbridge_sim.cli.tools.spawn import spawn  # noqa: PLC0415 - see above

    if options.lane is None and (options.distance or options.lateral):
        raise SettingError("--distance and --lateral: expected --lane with them")
    place = {"link": options.lane, "distance": options.distance, "lateral": options.lateral}
    request = {
        "model": options.model,
        "place": place if options.lane is not None else options.at,
        "speed": options.speed,
        "behaviour": options.behaviour or "",
        "route": options.route,
        "is_ego": options.ego,
    }
    return _with_bridge(options, lambda bridge: spawn(bridge, request, is_json=options.json))


_number = make_number(-1e9, 1e9, "a number", float)


def _pose(text: str) -> dict[str, float]:
    """Read X,Y or X,Y,HEADING."""
    try:
        numbers = [_number(word) for word in text.split(",")]
    except ArgumentTypeError:
        numbers = []
    if not 2 <= len(numbers) <= len(_POSE):  # noqa: PLR2004 - x and y
        raise ArgumentTypeError(f"expected X,Y or X,Y,HEADING, such as 10,5,90; got {text!r}")
    return dict(zip(_POSE, numbers, strict=False))


_POSE = ("x", "y", "heading_deg")


def _links(text: str) -> list[str]:
    """Read names between commas."""
    return [word.strip() for word in text.split(",") if word.strip()]


TOOLS: dict[str, Callable[[Sequence[str]], int]] = {
    "topic": _topic,
    "service": _service,
    "schema": run_schema,
    "bag": run_bag,
    "scenario": run_scenario,
    "map": run_map,
    "docs": run_docs,
    "record": _record,
    "tick": _tick,
    "spawn": _spawn,
    "wait": _wait,
}
"""Name -> what runs it with the words behind the name."""
