"""The commands that work with any rosbridge: `rosbridge-sim topic`, `service`, `layout`, `wait`."""

from __future__ import annotations

import asyncio
import math
from collections.abc import Awaitable, Sequence
from typing import TYPE_CHECKING

from rosbridge_sim.cli.bridge_flags import (
    ANSWER_PATIENCE,
    CALL_PATIENCE,
    COUNT,
    SECONDS,
    add_bridge,
    add_count,
    add_server,
    add_token,
    add_types,
    bridge_group,
    take_type,
    with_bridge,
)
from rosbridge_sim.cli.command_line import (
    LazyTool,
    Options,
    command_of,
    make_number,
    run_command,
)
from rosbridge_sim.cli.tools.text import read_body
from rosbridge_sim.errors import SettingError
from rosbridge_sim.link.arguments import Parser

if TYPE_CHECKING:
    from rosbridge_sim.cli.tools import service, topic
    from rosbridge_sim.cli.tools.tool_client import Bridge
else:
    service, topic = LazyTool("service"), LazyTool("topic")

DEFAULT_RATE = 1.0
"""Default rate of `pub` [Hz], as in `ros2 topic pub`."""

_hertz = make_number(0.001, 1e4, "times a second, at most 10,000", float)
_window = make_number(2, 1e6, "a number from 2 to 1,000,000", int)


def run_topic(argv: Sequence[str]) -> int:
    """Run `rosbridge-sim topic`."""
    group, add, row = bridge_group("topic", "Topics of a rosbridge: list, show, measure and publish.")

    def list_topics(bridge: Bridge, o: Options) -> Awaitable[int]:
        return topic.list_topics(
            bridge, o.namespace, is_verbose=o.verbose, has_types=o.types, is_count=o.is_count, is_json=o.json
        )

    parser = row("list", list_topics, "list all topics")
    parser.add_argument("namespace", metavar="NAMESPACE", nargs="?", default="", help="only topics in it")
    parser.add_argument("-v", "--verbose", action="store_true", help="with types, publishers and subscribers")
    add_types(parser)
    add_count(parser, "topics")

    parser = row(
        "info",
        lambda bridge, o: topic.show_topic(bridge, o.name, is_verbose=o.verbose, is_json=o.json),
        "show type, publishers and subscribers of a topic",
        "NAME",
    )
    parser.add_argument("-v", "--verbose", action="store_true", help="each node as ros2 topic info -v shows it")
    row(
        "type",
        lambda bridge, o: topic.show_topic_type(bridge, o.name, is_json=o.json),
        "print the type of a topic",
        "NAME",
    )
    parser = row(
        "find",
        lambda bridge, o: topic.find_topics(bridge, o.type, is_count=o.is_count, is_json=o.json),
        "list the topics of a type: pkg/Type or pkg/msg/Type",
        "TYPE",
    )
    add_count(parser, "topics")

    parser = add("echo", _echo, "print messages as they come")
    parser.add_argument(
        "name", metavar="NAME", help="a topic; or a topic and a field of it, such as /Ego_topic/position"
    )
    _add_type(parser)
    parser.add_argument("-n", "--count", type=COUNT, help="end after so many messages")
    parser.add_argument("--once", action="store_const", const=1, dest="count", help="end after the first")
    parser.add_argument("--field", metavar="PATH", help="print only this field, such as a.b or list[0].c")
    parser.add_argument("--csv", action="store_true", help="print all values of a message in a line, with commas")
    parser.add_argument("-p", "--plot", action="store_true", help="the same with time and names, as rostopic echo -p")
    parser.add_argument("--no-arr", "--noarr", action="store_true", help="print lengths in place of lists")
    parser.add_argument("--no-str", "--nostr", action="store_true", help="print lengths in place of texts")
    add_bridge(parser, is_waiting=True)
    parser.set_defaults(end=0)

    for name, text in (
        ("hz", "measure the rate of messages"),
        ("bw", "measure the bandwidth of a topic, with messages as JSON, as they come"),
        ("delay", "measure the age of messages: the server's clock, or the time of day, minus header.stamp"),
    ):
        parser = add(name, _measure, text)
        parser.add_argument("name", metavar="NAME")
        _add_type(parser)
        parser.add_argument("-w", "--window", type=_window, metavar="N", help="measure over the last N messages [all]")
        parser.add_argument("-n", "--count", type=_window, help="end after so many messages")
        add_bridge(parser, is_waiting=True)
        parser.set_defaults(end=0)

    _add_pub(add("pub", _publish, "publish a message; by default once a second until Ctrl-C"))
    return run_command(group, argv)


def _add_pub(parser: Parser) -> None:
    parser.add_argument("name", metavar="NAME")
    parser.add_argument("type", metavar="TYPE")
    parser.add_argument(
        "message",
        metavar="MESSAGE",
        nargs="*",
        help="JSON or YAML, fields may be left out; or the values of all fields in order, as for rostopic pub",
    )
    parser.add_argument("-1", "--once", action="store_const", const=1, dest="count", help="publish once, then end")
    parser.add_argument("-n", "-t", "--count", "--times", type=COUNT, metavar="N", help="end after so many messages")
    parser.add_argument("-r", "--rate", type=_hertz, metavar="HZ", help=f"messages per second [{DEFAULT_RATE:g}]")
    parser.add_argument(
        "-w",
        "--wait-matching-subscriptions",
        type=make_number(0, 1e6, "a number of nodes", int),
        default=0,
        metavar="N",
        help="wait until so many nodes subscribe; rosapi counts all clients of a rosbridge as one node [0]",
    )
    parser.add_argument(
        "--max-wait-time-secs", type=SECONDS, default=math.inf, metavar="SECONDS", help="longest wait for it [for ever]"
    )
    parser.add_argument(
        "-l",
        "--latch",
        action="store_true",
        help="later subscribers get it, too; alone: publish once, then stay for them",
    )
    add_bridge(parser)
    parser.set_defaults(end=0)


def _add_type(parser: Parser) -> None:
    text = "type of a topic that does not exist yet"
    parser.add_argument("type", metavar="TYPE", nargs="?", help=text)
    parser.add_argument("--type", dest="other_type", metavar="TYPE", help="the same")


def _echo(options: Options) -> int:
    try:
        path = None if options.field is None else topic.FieldPath(options.field)
    except ValueError:
        raise SettingError(f"--field: expected a path such as a.b or list[0].c; got {options.field!r}") from None
    kind = options.type or options.other_type
    form = topic.Echo(
        options.json, options.csv, options.plot, has_arrays=not options.no_arr, has_texts=not options.no_str
    )
    return with_bridge(
        options,
        lambda bridge: topic.echo(bridge, options.name, kind, path, options.count, patience=options.wait, form=form),
    )


def _measure(options: Options) -> int:
    from rosbridge_sim.cli.tools.hz import MAX_WINDOW, METERS, measure  # noqa: PLC0415

    meter = METERS[options.command](options.window or MAX_WINDOW)
    kind = options.type or options.other_type
    return with_bridge(
        options,
        lambda bridge: measure(
            bridge, meter, options.name, kind, options.count, patience=options.wait, is_json=options.json
        ),
    )


def _publish(options: Options) -> int:
    values = [read_body(text, "MESSAGE") for text in options.message]
    msg = {} if not values else values[0] if len(values) == 1 and isinstance(values[0], dict) else None
    is_kept = options.latch and options.rate is None and options.count is None
    rate = None if is_kept or options.count == 1 else options.rate or DEFAULT_RATE

    async def work(bridge: Bridge) -> int:
        return await topic.publish(
            bridge,
            options.name,
            options.type,
            await topic.positional_message(bridge, options.type, values) if msg is None else msg,
            count=options.count,
            rate=rate,
            is_latched=options.latch,
            num_subscribers=options.wait_matching_subscriptions,
            patience=options.max_wait_time_secs,
            is_json=options.json,
        )

    return with_bridge(options, work)


# service


def run_service(argv: Sequence[str]) -> int:
    """Run `rosbridge-sim service`."""
    absent = {
        "args": "rosbridge-sim service info shows the fields of the request",
        "uri": "a service behind a rosbridge has no address of its own; rosbridge-sim service node shows its node",
        "echo": "a rosbridge does not tell the calls of other clients",
    }
    group, add, row = bridge_group("service", "Services of a rosbridge: list, show and call.", absent)

    def list_services(bridge: Bridge, o: Options) -> Awaitable[int]:
        return service.list_services(
            bridge, is_verbose=o.verbose, has_types=o.types, is_count=o.is_count, is_json=o.json
        )

    parser = row("list", list_services, "list all services")
    parser.add_argument("-v", "-n", "--verbose", "--nodes", action="store_true", help="with types and providers")
    add_types(parser)
    add_count(parser, "services")

    parser = row(
        "info",
        lambda bridge, o: service.show_service(bridge, o.name, is_json=o.json),
        "show type, provider, request and response of a service",
        "NAME",
    )
    parser.add_argument("-v", "--verbose", action="store_true", help="the same")
    for name in ("type", "node"):
        row(
            name,
            lambda bridge, o: service.show_service_word(bridge, o.name, o.command, is_json=o.json),
            f"print the {name} of a service",
            "NAME",
        )
    parser = row(
        "find",
        lambda bridge, o: service.find_services(bridge, o.type, is_count=o.is_count, is_json=o.json),
        "list the services of a type: pkg/Type or pkg/srv/Type",
        "TYPE",
    )
    add_count(parser, "services")

    parser = add("call", _call, "call a service and print its answer")
    parser.add_argument("name", metavar="NAME")
    parser.add_argument(
        "words",
        metavar="[TYPE] REQUEST",
        nargs="*",
        help="JSON or YAML, fields may be left out; or the values of all fields in order, as for rosservice call."
        " A type, such as std_srvs/srv/Trigger, may stand before it",
    )
    add_bridge(parser, CALL_PATIENCE, is_call=True)
    return run_command(group, argv)


def _call(options: Options) -> int:
    kind = take_type(options.words)
    values = [read_body(text, "REQUEST") for text in options.words]
    args = {} if not values else values[0] if len(values) == 1 and isinstance(values[0], (dict, list)) else values
    patience = options.patience or None
    options.patience = ANSWER_PATIENCE  # for everything except the call
    return with_bridge(
        options, lambda bridge: service.call(bridge, options.name, kind, args, patience, is_json=options.json)
    )


# layout, wait


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
    add_token(parser)
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
