"""The commands that talk to a rosbridge (`rosbridge-sim topic`, `tick`, `record` ...), and the table of all tools."""

from __future__ import annotations

import asyncio
import math
import os
from argparse import ArgumentTypeError, BooleanOptionalAction
from collections.abc import Awaitable, Callable, Sequence
from pathlib import Path
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
"""Default of the longest wait for an answer [s]: rosbridge_suite's own time-out of a call."""

CALL_PATIENCE = 30.0
"""Default of the longest wait for the answer of a called service [s]: loading a scenario takes a while."""

TICK_ID = "rosbridge-sim"
"""Default user id of `tick`: always the same, so that a second run is the same master."""

DEFAULT_RATE = 1.0
"""Default rate of `pub` [Hz], as in `ros2 topic pub`."""


# Common parts


def _with_bridge(options: Options, work: Callable[[Bridge], Awaitable[int]]) -> int:
    """Connect, run the work, and close."""
    from rosbridge_sim.cli.tools.client import open_bridge  # noqa: PLC0415 - not needed for --help or after a mistake

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
        parser: parser of the command.
        patience: default of the longest wait for an answer [s].
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
    text = "longest time for the service; 0 is no limit" if is_call else "longest wait for an answer"
    parser.add_argument(
        "--timeout",
        dest="patience",
        type=_seconds_or_none if is_call else _seconds,
        default=patience,
        metavar="SECONDS",
        help=f"{text} [{patience:g}]",
    )


def _add_server(parser: Parser) -> None:
    """Add the flags that select the server."""
    url = os.environ.get(f"{PREFIX}URL") or DEFAULT_URL
    token = os.environ.get(f"{PREFIX}TOKEN") or None
    text = f"any rosbridge, also as {PREFIX}URL [{shown_url(url)}]"  # a token may stand in it
    parser.add_argument("--url", default=url, help=text.replace("%", "%%"))
    parser.add_argument("--token", default=token, help=f"token of the server, also as {PREFIX}TOKEN")


_seconds = make_number(0.001, 1e6, "seconds", float)
_seconds_or_none = make_number(0, 1e6, "seconds, or 0", float)
_hertz = make_number(0.001, 1e4, "times a second, at most 10,000", float)
_count = make_number(1, 1e9, "a number from 1 on", int)
_step_ms = make_number(20, 1_000, "milliseconds, from 20 to 1,000", int)
_steps = make_number(1, 1_000, "a number from 1 to 1,000", int)
_ego = make_number(0, 2**31 - 1, "the number of an ego", int)
_pedal = make_number(0, 1, "a number from 0 to 1", float)
_angle = make_number(-2, 2, "an angle in radians, within +-2", float)
_kmh = make_number(-1_000, 1_000, "a speed in km/h, within +-1,000", float)
_metres = make_number(0, 1e9, "a number of metres", float)
_window = make_number(2, 1e6, "a number from 2 to 1,000,000", int)


# topic


def _topic(argv: Sequence[str]) -> int:
    group, add = group_of("topic", "Topics of a rosbridge: list, show, measure and publish.")

    parser = add("list", _list_topics, "list all topics")
    parser.add_argument("-v", "--verbose", action="store_true", help="with types, publishers and subscribers")
    parser.add_argument("-t", "--types", action="store_true", help="with types")
    _add_bridge(parser)

    parser = add("info", _show_topic, "show type, publishers and subscribers of a topic")
    parser.add_argument("name", metavar="NAME")
    _add_bridge(parser)

    parser = add("echo", _echo, "print messages as they come")
    parser.add_argument("name", metavar="NAME")
    parser.add_argument("-n", "--count", type=_count, help="end after so many messages")
    parser.add_argument("--once", action="store_const", const=1, dest="count", help="end after the first")
    parser.add_argument("--field", metavar="PATH", help="print only this field, such as a.b or list[0].c")
    parser.add_argument("--type", metavar="TYPE", help="of a topic that is not there yet")
    _add_bridge(parser, is_waiting=True)
    parser.set_defaults(end=0)

    parser = add("hz", _show_rate, "measure the rate of messages")
    parser.add_argument("name", metavar="NAME")
    parser.add_argument("-w", "--window", type=_window, metavar="N", help="measure over the last N messages [all]")
    parser.add_argument("-n", "--count", type=_window, help="end after so many messages")
    parser.add_argument("--type", metavar="TYPE", help="of a topic that is not there yet")
    _add_bridge(parser, is_waiting=True)
    parser.set_defaults(end=0)

    parser = add("pub", _publish, "publish a message; by default once a second until Ctrl-C")
    parser.add_argument("name", metavar="NAME")
    parser.add_argument("type", metavar="TYPE")
    parser.add_argument(
        "message", metavar="MESSAGE", nargs="?", default="{}", help="JSON or YAML; fields may be left out"
    )
    parser.add_argument("-1", "--once", action="store_const", const=1, dest="count", help="publish once, then end")
    parser.add_argument("-n", "--count", type=_count, help="end after so many messages")
    parser.add_argument("-r", "--rate", type=_hertz, metavar="HZ", help=f"messages per second [{DEFAULT_RATE:g}]")
    parser.add_argument(
        "-l",
        "--latch",
        action="store_true",
        help="later subscribers get it, too; alone: publish once, then stay for them",
    )
    _add_bridge(parser)
    parser.set_defaults(end=0)
    return run_command(group, argv)


def _list_topics(options: Options) -> int:
    from rosbridge_sim.cli.tools import topic  # noqa: PLC0415 - see above; the same below

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
    group, add = group_of("service", "Services of a rosbridge: list, show and call.")

    parser = add("list", _list_services, "list all services")
    parser.add_argument("-v", "--verbose", action="store_true", help="with types and providers")
    _add_bridge(parser)

    parser = add("info", _show_service, "show type, provider, request and response of a service")
    parser.add_argument("name", metavar="NAME")
    _add_bridge(parser)

    parser = add("call", _call, "call a service and print its answer")
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
    options.patience = ANSWER_PATIENCE  # for everything except the call
    return _with_bridge(
        options, lambda bridge: service.call(bridge, options.name, args, patience, is_json=options.json)
    )


# record


def _record(argv: Sequence[str]) -> int:
    parser = Parser(
        prog="rosbridge-sim record",
        description="Record topics of a rosbridge into a bag, until Ctrl-C.",
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
        help="topics to record, such as '/Ego*'; repeatable [all]",
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


# tick, step, score, snapshot, restore, wait


def _tick(argv: Sequence[str]) -> int:
    parser = Parser(
        prog="rosbridge-sim tick",
        description="Move a simulator in synchronous mode by N ticks, and print the frame and the ego after each.",
        epilog="With --start, the mode is ended afterwards if it was off before. If it was on, only the connection is"
        " closed, and the server's --sync-on-loss applies (wait: the world stands until the next tick --start).",
        allow_abbrev=False,
        formatter_class=layout,
    )
    parser.add_argument("count", metavar="N", nargs="?", type=_count, default=1, help="ticks [1]")
    parser.add_argument("--start", action="store_true", help="become the master first; end the mode afterwards")
    parser.add_argument("--id", default=TICK_ID, metavar="ID", help=f"user id of the master [{TICK_ID}]")
    parser.add_argument(
        "--step", type=_step_ms, default=20, metavar="MS", help="length of a tick, a multiple of 20 [20]"
    )
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


def _step(argv: Sequence[str]) -> int:
    parser = Parser(
        prog="rosbridge-sim step",
        description="Move a simulator in synchronous mode by so many ticks in one call, and show what came of it.",
        epilog="Each step is a tick of the master's time step. With --start the mode is ended again, unless it was on"
        " before; see rosbridge-sim tick --help.",
        allow_abbrev=False,
        formatter_class=layout,
    )
    parser.add_argument("-n", "--n", type=_steps, default=1, metavar="N", help="steps, 1 to 1,000 [1]")
    parser.add_argument("--start", action="store_true", help="become the master first, and end the mode at the end")
    text = f"user id of the master [{TICK_ID}]"
    parser.add_argument("--user", "--id", default=TICK_ID, metavar="ID", help=text)
    parser.add_argument("--step", type=_step_ms, default=20, metavar="MS", help="length of a step with --start [20]")
    parser.add_argument("--ego", type=_ego, default=0, metavar="N", help="number of the ego that is driven [0]")
    parser.add_argument("--throttle", type=_pedal, metavar="0..1", help="drive by pedals in all steps")
    parser.add_argument("--brake", type=_pedal, metavar="0..1", help="the same")
    parser.add_argument("--steering", type=_angle, metavar="RAD", help="angle of the front wheels, left positive")
    parser.add_argument("--velocity", type=_kmh, metavar="KM/H", help="drive at a speed, in place of the pedals")
    parser.add_argument(
        "--topic", action="append", default=[], metavar="TOPIC", help="show its last message, too; repeatable"
    )
    parser.add_argument(
        "--stop-on",
        action="append",
        default=[],
        choices=("collision", "red-light", "off-road"),
        help="end with the step in which this happens to an ego; repeatable",
    )
    parser.add_argument(
        "--stop-after", type=_metres, default=0.0, metavar="M", help="end when an ego has driven so far"
    )
    parser.add_argument("--stop-at", metavar="X,Y,RADIUS", help="end when an ego is so near to a place [m]")
    _add_bridge(parser, CALL_PATIENCE)
    parser.set_defaults(run=_run_step)
    return run_command(parser, argv)


def _run_step(options: Options) -> int:
    from rosbridge_sim.cli.tools.sync import step  # noqa: PLC0415

    if options.step % 20:
        raise SettingError(f"--step: expected a multiple of 20 milliseconds; got {options.step:g}")
    if options.velocity is not None and (options.throttle is not None or options.brake is not None):
        raise SettingError("--velocity: expected it alone, or --throttle and --brake; got both")
    figures = {
        "longlCmdType": 1 if options.velocity is None else 2,
        "accel": options.throttle,
        "brake": options.brake,
        "steering": options.steering,
        "velocity": options.velocity,
    }
    command = {name: figure for name, figure in figures.items() if figure is not None}
    x, y, radius = _read_place(options.stop_at)
    request: dict[str, object] = {
        "user_id": options.user,
        "n": options.n,
        "commands": [{"ego": options.ego, "commands": [command]}] if len(command) > 1 else [],
        "topics": options.topic,
        "stop_on_collision": "collision" in options.stop_on,
        "stop_on_red_light": "red-light" in options.stop_on,
        "stop_off_road": "off-road" in options.stop_on,
        "stop_after_m": options.stop_after,
        "stop_at_x": x,
        "stop_at_y": y,
        "stop_within_m": radius,
    }
    return _with_bridge(
        options,
        lambda bridge: step(bridge, request, options.step if options.start else None, is_json=options.json),
    )


def _read_place(text: str | None) -> tuple[float, float, float]:
    """Return x, y and radius of a place; zeros for none.

    Raises:
        SettingError: the text has another form.
    """
    if text is None:
        return 0.0, 0.0, 0.0
    try:
        x, y, radius = (float(part) for part in text.split(","))
    except ValueError:
        x = y = radius = 0.0
    if not (math.isfinite(x) and math.isfinite(y) and 0.0 < radius < math.inf):
        raise SettingError(f"--stop-at: expected X,Y,RADIUS in metres, such as 120.5,3,2; got {text!r}")
    return x, y, radius


def _score(argv: Sequence[str]) -> int:
    parser = Parser(
        prog="rosbridge-sim score",
        description="Show what the driver of each ego is judged by: distance, collisions, red lights, lanes, comfort.",
        epilog="A simulator keeps scores from the first question on, or from its start with serve --score.",
        allow_abbrev=False,
        formatter_class=layout,
    )
    parser.add_argument("--follow", action="store_true", help="go on, with a line for each ego once a second")
    parser.add_argument("-n", "--count", type=_count, help="end after so many messages; with --follow")
    parser.add_argument("--reset", action="store_true", help="begin all counts anew, after showing them")
    _add_bridge(parser)
    parser.set_defaults(run=_run_score, end=0)
    return run_command(parser, argv)


def _run_score(options: Options) -> int:
    from rosbridge_sim.cli.tools import score  # noqa: PLC0415

    if options.follow and options.reset:
        raise SettingError("--reset: expected alone; --follow shows the scores as they come")
    if options.follow:
        return _with_bridge(options, lambda bridge: score.follow(bridge, options.count, is_json=options.json))
    if options.count is not None:
        raise SettingError("--count: expected with --follow")
    return _with_bridge(options, lambda bridge: score.show(bridge, is_reset=options.reset, is_json=options.json))


def _sync(argv: Sequence[str]) -> int:
    parser = Parser(
        prog="rosbridge-sim sync",
        description="Show the state of synchronous mode: the master, or the members of the barrier.",
        allow_abbrev=False,
        formatter_class=layout,
    )
    _add_bridge(parser)
    parser.set_defaults(run=_run_sync)
    return run_command(parser, argv)


def _run_sync(options: Options) -> int:
    from rosbridge_sim.cli.tools.sync import show_sync  # noqa: PLC0415

    return _with_bridge(options, lambda bridge: show_sync(bridge, is_json=options.json))


def _snapshot(argv: Sequence[str]) -> int:
    parser = Parser(
        prog="rosbridge-sim snapshot",
        description="Save the state of a simulator, so that `restore` can go back to it; or list what is saved.",
        allow_abbrev=False,
        formatter_class=layout,
    )
    parser.add_argument("--id", default="", metavar="ID", help="name of the snapshot [one that the server chooses]")
    parser.add_argument("--out", type=Path, metavar="FILE", help="write it into a file, too, such as start.rbsim")
    parser.add_argument("--list", action="store_true", help="show the snapshots that are kept, and take none")
    parser.add_argument("--remove", action="append", default=[], metavar="ID", help="remove one, then list; repeatable")
    _add_bridge(parser, CALL_PATIENCE)
    parser.set_defaults(run=_run_snapshot)
    return run_command(parser, argv)


def _run_snapshot(options: Options) -> int:
    from rosbridge_sim.cli.tools.snapshot import list_snapshots, take_snapshot  # noqa: PLC0415

    if options.list or options.remove:
        if options.id or options.out:
            raise SettingError("--list, --remove: expected without --id and --out, which take a snapshot")
        return _with_bridge(options, lambda bridge: list_snapshots(bridge, options.remove, is_json=options.json))
    return _with_bridge(options, lambda bridge: take_snapshot(bridge, options.id, options.out, is_json=options.json))


def _restore(argv: Sequence[str]) -> int:
    parser = Parser(
        prog="rosbridge-sim restore",
        description="Return a simulator to a snapshot. In synchronous mode only its master may do so.",
        allow_abbrev=False,
        formatter_class=layout,
    )
    parser.add_argument(
        "snapshot", metavar="ID|FILE", help="name of a snapshot that the server keeps, or a file of `snapshot --out`"
    )
    parser.add_argument("--user", default=TICK_ID, metavar="ID", help=f"user id of the master [{TICK_ID}]")
    _add_bridge(parser, CALL_PATIENCE)
    parser.set_defaults(run=_run_restore)
    return run_command(parser, argv)


def _run_restore(options: Options) -> int:
    from rosbridge_sim.cli.tools.snapshot import restore  # noqa: PLC0415

    return _with_bridge(options, lambda bridge: restore(bridge, options.snapshot, options.user, is_json=options.json))


def _watch(argv: Sequence[str]) -> int:
    parser = Parser(
        prog="rosbridge-sim watch",
        description="Show the scene in a terminal, from above: map, objects, lights, the ego and its figures.",
        epilog="Keys: q quits, + and - zoom, the arrows move the picture, f follows the ego again, h puts its heading"
        " up, m shows the whole map. Any rosbridge with /Ego_topic will do; the map needs this simulator. If the output"
        " is no terminal, one picture is printed.",
        allow_abbrev=False,
        formatter_class=layout,
    )
    _add_server(parser)
    parser.add_argument("address", metavar="URL", nargs="?", help="the same as --url")
    parser.add_argument("--once", action="store_true", help="print one picture, then end")
    parser.add_argument("--rate", type=_pictures, default=10.0, metavar="HZ", help="pictures a second, at most 60 [10]")
    text = "draw in colours [if it is a terminal that has them, and NO_COLOR is not set]"
    parser.add_argument("--colour", "--color", action=BooleanOptionalAction, default=True, help=text)
    parser.add_argument(
        "--timeout",
        dest="patience",
        type=_seconds,
        default=ANSWER_PATIENCE,
        metavar="SECONDS",
        help=f"longest wait for a connection or an answer [{ANSWER_PATIENCE:g}]",
    )
    parser.set_defaults(run=_run_watch, end=0)
    return run_command(parser, argv)


_pictures = make_number(0.1, 60, "pictures a second, 0.1 to 60", float)


def _run_watch(options: Options) -> int:
    from rosbridge_sim.cli.watch.command import watch  # noqa: PLC0415 - see above

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


def _layout(argv: Sequence[str]) -> int:
    parser = Parser(
        prog="rosbridge-sim layout",
        description="Print settings for a viewer that show the simulator there: a layout for Lichtblick, or a"
        " configuration for RViz.",
        epilog="rosbridge-sim layout lichtblick > sim.json, then import it in Lichtblick; or rosbridge-sim layout rviz"
        " > sim.rviz, then rviz -d sim.rviz. RViz needs a bridge in ROS: rosbridge-sim attach URL --scene.",
        allow_abbrev=False,
        formatter_class=layout,
    )
    parser.add_argument("viewer", metavar="VIEWER", choices=("lichtblick", "rviz"), help="lichtblick or rviz")
    parser.add_argument(
        "--ros", type=int, choices=(1, 2), help="generation of ROS: RViz or RViz 2 [1, or the server's]"
    )
    parser.add_argument("--url", help="take the names of topics from this server [the default names]")
    token = os.environ.get(f"{PREFIX}TOKEN") or None
    parser.add_argument("--token", default=token, help=f"token of the server, also as {PREFIX}TOKEN")
    parser.set_defaults(run=_run_layout, patience=ANSWER_PATIENCE)
    return run_command(parser, argv)


def _run_layout(options: Options) -> int:
    from rosbridge_sim.cli.tools import layout as tool  # noqa: PLC0415 - see above

    if options.url is None:
        return tool.print_layout(options.viewer, tool.choose_names({}), options.ros or 1)

    async def work(bridge: Bridge) -> int:
        names, ros = await tool.seen_names(bridge)
        return tool.print_layout(options.viewer, names, options.ros or ros)

    return _with_bridge(options, work)


def _wait(argv: Sequence[str]) -> int:
    parser = Parser(
        prog="rosbridge-sim wait",
        description="Wait until a rosbridge accepts clients. Exit code 0: it does. 1: it did not in time.",
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
    "sync": _sync,
    "tick": _tick,
    "step": _step,
    "score": _score,
    "snapshot": _snapshot,
    "restore": _restore,
    "spawn": _spawn,
    "watch": _watch,
    "layout": _layout,
    "wait": _wait,
}
"""Name -> function that runs the command with the words behind the name."""
