"""The commands that work with any rosbridge: `rosbridge-sim topic`, `service`, `record`, `watch`, `layout`, `wait`."""

from __future__ import annotations

import asyncio
import os
from argparse import BooleanOptionalAction
from collections.abc import Sequence
from typing import TYPE_CHECKING

from rosbridge_sim.cli.bridge_flags import (
    ANSWER_PATIENCE,
    CALL_PATIENCE,
    COUNT,
    SECONDS,
    add_bridge,
    add_server,
    with_bridge,
)
from rosbridge_sim.cli.command_line import (
    Options,
    add_definitions,
    command_of,
    definition_sources_of,
    group_of,
    make_number,
    run_command,
)
from rosbridge_sim.cli.tools.text import read_body
from rosbridge_sim.errors import SettingError
from rosbridge_sim.link.arguments import PREFIX

if TYPE_CHECKING:
    from rosbridge_sim.cli.tools.tool_client import Bridge

__all__ = ["run_layout", "run_record", "run_service", "run_topic", "run_wait", "run_watch"]

DEFAULT_RATE = 1.0
"""Default rate of `pub` [Hz], as in `ros2 topic pub`."""

_hertz = make_number(0.001, 1e4, "times a second, at most 10,000", float)
_window = make_number(2, 1e6, "a number from 2 to 1,000,000", int)


def run_topic(argv: Sequence[str]) -> int:
    """Run `rosbridge-sim topic`."""
    group, add = group_of("topic", "Topics of a rosbridge: list, show, measure and publish.")

    parser = add("list", _list_topics, "list all topics")
    parser.add_argument("-v", "--verbose", action="store_true", help="with types, publishers and subscribers")
    parser.add_argument("-t", "--types", action="store_true", help="with types")
    add_bridge(parser)

    parser = add("info", _show_topic, "show type, publishers and subscribers of a topic")
    parser.add_argument("name", metavar="NAME")
    add_bridge(parser)

    parser = add("echo", _echo, "print messages as they come")
    parser.add_argument("name", metavar="NAME")
    parser.add_argument("-n", "--count", type=COUNT, help="end after so many messages")
    parser.add_argument("--once", action="store_const", const=1, dest="count", help="end after the first")
    parser.add_argument("--field", metavar="PATH", help="print only this field, such as a.b or list[0].c")
    parser.add_argument("--type", metavar="TYPE", help="of a topic that is not there yet")
    add_bridge(parser, is_waiting=True)
    parser.set_defaults(end=0)

    parser = add("hz", _show_rate, "measure the rate of messages")
    parser.add_argument("name", metavar="NAME")
    parser.add_argument("-w", "--window", type=_window, metavar="N", help="measure over the last N messages [all]")
    parser.add_argument("-n", "--count", type=_window, help="end after so many messages")
    parser.add_argument("--type", metavar="TYPE", help="of a topic that is not there yet")
    add_bridge(parser, is_waiting=True)
    parser.set_defaults(end=0)

    parser = add("pub", _publish, "publish a message; by default once a second until Ctrl-C")
    parser.add_argument("name", metavar="NAME")
    parser.add_argument("type", metavar="TYPE")
    parser.add_argument(
        "message", metavar="MESSAGE", nargs="?", default="{}", help="JSON or YAML; fields may be left out"
    )
    parser.add_argument("-1", "--once", action="store_const", const=1, dest="count", help="publish once, then end")
    parser.add_argument("-n", "--count", type=COUNT, help="end after so many messages")
    parser.add_argument("-r", "--rate", type=_hertz, metavar="HZ", help=f"messages per second [{DEFAULT_RATE:g}]")
    parser.add_argument(
        "-l",
        "--latch",
        action="store_true",
        help="later subscribers get it, too; alone: publish once, then stay for them",
    )
    add_bridge(parser)
    parser.set_defaults(end=0)
    return run_command(group, argv)


def _list_topics(options: Options) -> int:
    from rosbridge_sim.cli.tools import topic  # noqa: PLC0415 - see above; the same below

    return with_bridge(
        options,
        lambda bridge: topic.list_topics(
            bridge, is_verbose=options.verbose, has_types=options.types, is_json=options.json
        ),
    )


def _show_topic(options: Options) -> int:
    from rosbridge_sim.cli.tools import topic  # noqa: PLC0415

    return with_bridge(options, lambda bridge: topic.show_topic(bridge, options.name, is_json=options.json))


def _echo(options: Options) -> int:
    from rosbridge_sim.cli.tools import topic  # noqa: PLC0415

    try:
        path = None if options.field is None else topic.FieldPath(options.field)
    except ValueError:
        raise SettingError(f"--field: expected a path such as a.b or list[0].c; got {options.field!r}") from None
    return with_bridge(
        options,
        lambda bridge: topic.echo(
            bridge, options.name, options.type, path, options.count, patience=options.wait, is_json=options.json
        ),
    )


def _show_rate(options: Options) -> int:
    from rosbridge_sim.cli.tools.hz import show_rate  # noqa: PLC0415

    return with_bridge(
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
    return with_bridge(
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


def run_service(argv: Sequence[str]) -> int:
    """Run `rosbridge-sim service`."""
    group, add = group_of("service", "Services of a rosbridge: list, show and call.")

    parser = add("list", _list_services, "list all services")
    parser.add_argument("-v", "--verbose", action="store_true", help="with types and providers")
    add_bridge(parser)

    parser = add("info", _show_service, "show type, provider, request and response of a service")
    parser.add_argument("name", metavar="NAME")
    add_bridge(parser)

    parser = add("call", _call, "call a service and print its answer")
    parser.add_argument("name", metavar="NAME")
    parser.add_argument(
        "request", metavar="REQUEST", nargs="?", default="{}", help="JSON or YAML; fields may be left out"
    )
    add_bridge(parser, CALL_PATIENCE, is_call=True)
    return run_command(group, argv)


def _list_services(options: Options) -> int:
    from rosbridge_sim.cli.tools import service  # noqa: PLC0415

    return with_bridge(
        options, lambda bridge: service.list_services(bridge, is_verbose=options.verbose, is_json=options.json)
    )


def _show_service(options: Options) -> int:
    from rosbridge_sim.cli.tools import service  # noqa: PLC0415

    return with_bridge(options, lambda bridge: service.show_service(bridge, options.name, is_json=options.json))


def _call(options: Options) -> int:
    from rosbridge_sim.cli.tools import service  # noqa: PLC0415

    args = read_body(options.request, "REQUEST")
    if not isinstance(args, (dict, list)):
        raise SettingError(f"REQUEST: expected an object such as '{{data: 1}}'; got {options.request!r}")
    patience = options.patience or None
    options.patience = ANSWER_PATIENCE  # for everything except the call
    return with_bridge(options, lambda bridge: service.call(bridge, options.name, args, patience, is_json=options.json))


# record


def run_record(argv: Sequence[str]) -> int:
    """Run `rosbridge-sim record`."""
    parser = command_of(
        "record",
        _record,
        "Record topics of a rosbridge into a bag, until Ctrl-C.",
    )
    parser.add_argument("file", metavar="FILE", help="NAME.bag is ROS 1, NAME.mcap ROS 2, else a folder of ROS 2")
    parser.add_argument(
        "-t",
        "--topics",
        action="append",
        default=[],
        metavar="PATTERN",
        help="topics to record, such as '/Ego*'; repeatable [all]",
    )
    parser.add_argument("-n", "--count", type=COUNT, help="end after so many messages")
    add_bridge(parser, is_waiting=True)
    add_definitions(parser)
    parser.set_defaults(end=0)
    return run_command(parser, argv)


def _record(options: Options) -> int:
    from rosbridge_sim.cli.tools import record  # noqa: PLC0415

    return with_bridge(
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


def run_watch(argv: Sequence[str]) -> int:
    """Run `rosbridge-sim watch`."""
    parser = command_of(
        "watch",
        _watch,
        "Show the scene in a terminal, from above: map, objects, lights, the ego and its figures.",
        epilog="Keys: q quits, + and - zoom, the arrows move the picture, f follows the ego again, h puts its heading"
        " up, m shows the whole map. Any rosbridge with /Ego_topic will do; the map needs this simulator. If the output"
        " is no terminal, one picture is printed.",
    )
    add_server(parser)
    parser.add_argument("address", metavar="URL", nargs="?", help="the same as --url")
    parser.add_argument("--once", action="store_true", help="print one picture, then end")
    parser.add_argument("--rate", type=_pictures, default=10.0, metavar="HZ", help="pictures a second, at most 60 [10]")
    text = "draw in colours [if it is a terminal that has them, and NO_COLOR is not set]"
    parser.add_argument("--colour", "--color", action=BooleanOptionalAction, default=True, help=text)
    parser.add_argument(
        "--timeout",
        dest="patience",
        type=SECONDS,
        default=ANSWER_PATIENCE,
        metavar="SECONDS",
        help=f"longest wait for a connection or an answer [{ANSWER_PATIENCE:g}]",
    )
    parser.set_defaults(end=0)
    return run_command(parser, argv)


_pictures = make_number(0.1, 60, "pictures a second, 0.1 to 60", float)


def _watch(options: Options) -> int:
    from rosbridge_sim.cli.watch.watch_command import watch  # noqa: PLC0415 - see above

    return asyncio.run(
        watch(
            options.address or options.url,
            options.token,
            options.patience,
            rate=options.rate,
            is_once=options.once,
            has_colour=options.colour,
        )
    )


def run_layout(argv: Sequence[str]) -> int:
    """Run `rosbridge-sim layout`."""
    parser = command_of(
        "layout",
        _layout,
        "Print settings for a viewer that show the simulator there: a layout for Lichtblick, or a"
        " configuration for RViz.",
        epilog="rosbridge-sim layout lichtblick > sim.json, then import it in Lichtblick; or rosbridge-sim layout rviz"
        " > sim.rviz, then rviz -d sim.rviz. RViz 2 needs a server"
        " with --ros2-domain; RViz a bridge in ROS: rosbridge-sim attach URL --scene.",
    )
    parser.add_argument("viewer", metavar="VIEWER", choices=("lichtblick", "rviz"), help="lichtblick or rviz")
    parser.add_argument(
        "--ros", type=int, choices=(1, 2), help="generation of ROS: RViz or RViz 2 [1, or the server's]"
    )
    parser.add_argument("--url", help="take the names of topics from this server [the default names]")
    token = os.environ.get(f"{PREFIX}TOKEN") or None
    parser.add_argument("--token", default=token, help=f"token of the server, also as {PREFIX}TOKEN")
    parser.set_defaults(patience=ANSWER_PATIENCE)
    return run_command(parser, argv)


def _layout(options: Options) -> int:
    from rosbridge_sim.cli.tools import layout as tool  # noqa: PLC0415 - see above

    if options.url is None:
        return tool.print_layout(options.viewer, tool.choose_names({}), options.ros or 1)

    async def work(bridge: Bridge) -> int:
        names, ros = await tool.seen_names(bridge)
        return tool.print_layout(options.viewer, names, options.ros or ros)

    return with_bridge(options, work)


def run_wait(argv: Sequence[str]) -> int:
    """Run `rosbridge-sim wait`."""
    parser = command_of(
        "wait",
        _wait,
        "Wait until a rosbridge accepts clients. Exit code 0: it does. 1: it did not in time.",
    )
    add_server(parser)
    parser.add_argument(
        "--timeout",
        type=SECONDS,
        default=CALL_PATIENCE,
        metavar="SECONDS",
        help=f"longest wait [{CALL_PATIENCE:g}]",
    )
    return run_command(parser, argv)


def _wait(options: Options) -> int:
    from rosbridge_sim.cli.tools.wait import wait_until_ready  # noqa: PLC0415

    return asyncio.run(wait_until_ready(options.url, options.token, options.timeout))
