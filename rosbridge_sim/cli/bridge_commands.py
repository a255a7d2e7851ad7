"""The commands that work with any rosbridge: `rosbridge-sim topic`, `service`, `layout`, `wait`."""

from __future__ import annotations

import math
from argparse import SUPPRESS
from collections.abc import Sequence

from rosbridge_sim.cli.bridge_flags import (
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
)
from rosbridge_sim.cli.command_line import ANSWER_PATIENCE, Options, command_of, make_number, run_tool
from rosbridge_sim.cli.tools.text import read_body
from rosbridge_sim.errors import SettingError
from rosbridge_sim.link.arguments import Parser

DEFAULT_RATE = 1.0
"""Default rate of `pub` [Hz], as in `ros2 topic pub`."""

_hertz = make_number(0.001, 1e4, "times a second, at most 10,000", float)
_window = make_number(2, 1e6, "a number from 2 to 1,000,000", int)


def make_topic() -> Parser:
    """Return the parser of `rosbridge-sim topic`."""
    group, add, row = bridge_group("topic", "Topics of a rosbridge: list, show, measure and publish.")

    parser = row("list", "tools.topic.list_topics", "list all topics")
    parser.option("namespace", "NAMESPACE", "only topics in it", nargs="?", default="")
    _add_verbose(parser, "with types, publishers and subscribers")
    add_types(parser)
    add_count(parser, "topics")

    parser = row("info", "tools.topic.show_topic", "show type, publishers and subscribers of a topic", name="NAME")
    _add_verbose(parser, "each node as ros2 topic info -v shows it")
    row("type", "tools.topic.show_topic_type", "print the type of a topic", name="NAME")
    text = "list the topics of a type: pkg/Type or pkg/msg/Type"
    add_count(row("find", "tools.topic.find_topics", text, type_name="TYPE"), "topics")

    parser = add("echo", _echo, "print messages as they come")
    parser.option("name", "NAME", "a topic; or a topic and a field of it, such as /Ego_topic/position")
    _add_type(parser)
    parser.add_argument("-n", "--count", type=COUNT, help="end after so many messages")
    parser.add_argument("--once", action="store_const", const=1, dest="count", help="end after the first")
    parser.option("--field", "PATH", "print only this field, such as a.b or list[0].c")
    parser.switch("--csv", "print all values of a message in a line, with commas")
    parser.switch("-p", "--plot", "the same with time and names, as rostopic echo -p")
    parser.switch("--no-arr", "--noarr", "print lengths in place of lists")
    parser.switch("--no-str", "--nostr", "print lengths in place of texts")
    add_bridge(parser, is_waiting=True)
    parser.set_defaults(end=0)

    for name, text in (
        ("hz", "measure the rate of messages"),
        ("bw", "measure the bandwidth of a topic, with messages as JSON, as they come"),
        ("delay", "measure the age of messages: the server's clock, or the time of day, minus header.stamp"),
    ):
        parser = add(name, "tools.hz.measure", text)
        parser.add_argument("name", metavar="NAME")
        _add_type(parser)
        parser.option("-w", "--window", "N", "measure over the last N messages [all]", type=_window)
        parser.add_argument("-n", "--count", type=_window, help="end after so many messages")
        add_bridge(parser, is_waiting=True)
        parser.set_defaults(end=0)

    _add_pub(add("pub", _publish, "publish a message; by default once a second until Ctrl-C"))
    return group


def _add_verbose(parser: Parser, text: str, flags: Sequence[str] = ("-v", "--verbose")) -> None:
    parser.add_argument(*flags, action="store_true", help=text)


def _add_pub(parser: Parser) -> None:
    parser.add_argument("name", metavar="NAME")
    parser.add_argument("type_name", metavar="TYPE")
    about = "JSON or YAML, fields may be left out; or the values of all fields in order, as for rostopic pub"
    parser.option("message", "MESSAGE", about, nargs="*")
    parser.add_argument("-1", "--once", action="store_const", const=1, dest="count", help="publish once, then end")
    parser.option("-n", "-t", "--count", "--times", "N", "end after so many messages", type=COUNT)
    parser.option("-r", "--rate", "HZ", f"messages per second [{DEFAULT_RATE:g}]", type=_hertz)
    parser.option(
        "-w",
        "--wait-matching-subscriptions",
        "N",
        "wait until so many nodes subscribe; rosapi counts all clients of a rosbridge as one node [0]",
        dest="num_subscribers",
        type=make_number(0, 1e6, "a number of nodes", int),
        default=0,
    )
    about = "longest wait for it [for ever]"
    parser.option("--max-wait-time-secs", "SECONDS", about, dest="wait", type=SECONDS, default=math.inf)
    about = "later subscribers get it, too; alone: publish once, then stay for them"
    parser.switch("-l", "--latch", about, dest="is_latched")
    add_bridge(parser)
    parser.set_defaults(end=0)


def _add_type(parser: Parser) -> None:
    parser.option("type_name", "TYPE", "type of a topic that does not exist yet", nargs="?", default=SUPPRESS)
    parser.option("--type", "TYPE", "the same", dest="type_name")


def _echo(options: Options) -> int:
    from rosbridge_sim.cli.tools import topic  # noqa: PLC0415 - with the client

    try:
        path = None if options.field is None else topic.FieldPath(options.field)
    except ValueError:
        raise SettingError(f"--field: expected a path such as a.b or list[0].c; got {options.field!r}") from None
    form = topic.Echo(
        is_json=options.json,
        is_csv=options.csv,
        has_header=options.plot,
        has_arrays=not options.no_arr,
        has_texts=not options.no_str,
        field=path,
    )
    return run_tool("tools.topic.echo", options, form=form)


def _publish(options: Options) -> int:
    is_kept = options.is_latched and options.rate is None and options.count is None
    return run_tool(
        "tools.topic.publish",
        options,
        values=[read_body(text, "MESSAGE") for text in options.message],
        rate=None if is_kept or options.count == 1 else options.rate or DEFAULT_RATE,
    )


# service


def make_service() -> Parser:
    """Return the parser of `rosbridge-sim service`."""
    absent = {
        "args": "rosbridge-sim service info shows the fields of the request",
        "uri": "a service behind a rosbridge has no address of its own; rosbridge-sim service node shows its node",
        "echo": "a rosbridge does not tell the calls of other clients",
    }
    group, add, row = bridge_group("service", "Services of a rosbridge: list, show and call.", absent)

    parser = row("list", "tools.service.list_services", "list all services")
    _add_verbose(parser, "with types and providers", ("-v", "-n", "--verbose", "--nodes"))
    add_types(parser)
    add_count(parser, "services")

    text = "show type, provider, request and response of a service"
    _add_verbose(row("info", "tools.service.show_service", text, name="NAME"), "the same")
    for name in ("type", "node"):
        row(name, "tools.service.show_service_word", f"print the {name} of a service", name="NAME")
    text = "list the services of a type: pkg/Type or pkg/srv/Type"
    add_count(row("find", "tools.service.find_services", text, type_name="TYPE"), "services")

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
    return group


def _call(options: Options) -> int:
    kind = take_type(options.words)
    values = [read_body(text, "REQUEST") for text in options.words]
    args = {} if not values else values[0] if len(values) == 1 and isinstance(values[0], (dict, list)) else values
    patience = options.patience or None
    options.patience = ANSWER_PATIENCE  # for everything except the call
    return run_tool("tools.service.call", options, type_name=kind, args=args, patience=patience)


# layout, wait


def make_layout() -> Parser:
    """Return the parser of `rosbridge-sim layout`."""
    parser = command_of(
        "layout",
        _layout,
        "Print settings for a viewer that show the simulator there: a layout for Lichtblick, or a"
        " configuration for RViz.",
        epilog="rosbridge-sim layout lichtblick > sim.json, then import it in Lichtblick; or rosbridge-sim layout rviz"
        " > sim.rviz, then rviz -d sim.rviz. RViz 2 needs a server"
        " with --ros2-domain; RViz a bridge in ROS: rosbridge-sim attach URL --scene.",
    )
    parser.option("viewer", "VIEWER", "lichtblick or rviz", choices=("lichtblick", "rviz"))
    parser.add_argument(
        "--ros", type=int, choices=(1, 2), help="generation of ROS: RViz or RViz 2 [1, or the server's]"
    )
    parser.add_argument("--url", help="take the names of topics from this server [the default names]")
    add_token(parser)
    parser.set_defaults(patience=ANSWER_PATIENCE)
    return parser


def _layout(options: Options) -> int:
    return run_tool(
        f"simulator.layout.{'print_layout' if options.url is None else 'print_layout_of'}", options, names=None
    )


def make_wait() -> Parser:
    """Return the parser of `rosbridge-sim wait`."""
    parser = command_of(
        "wait",
        "tools.wait.wait_until_ready",
        "Wait until a rosbridge accepts clients. Exit code 0: it does. 1: it did not in time.",
    )
    add_server(parser)
    about = f"longest wait [{CALL_PATIENCE:g}]"
    parser.option("--timeout", "SECONDS", about, dest="patience", type=SECONDS, default=CALL_PATIENCE)
    return parser
