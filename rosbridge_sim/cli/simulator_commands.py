"""The commands that move or change a simulator: `rosbridge-sim tick`, `step`, `score`, `snapshot`, `spawn` ..."""

from __future__ import annotations

import math
from argparse import ArgumentTypeError
from pathlib import Path

from rosbridge_sim.cli.bridge_flags import CALL_PATIENCE, COUNT, add_bridge
from rosbridge_sim.cli.command_line import Options, command_of, make_number, run_tool
from rosbridge_sim.errors import SettingError
from rosbridge_sim.link.arguments import Parser

TICK_ID = "rosbridge-sim"
"""Default user id of `tick`: always the same, so that a second run is the same master."""

_milliseconds = make_number(20, 1_000, "milliseconds, from 20 to 1,000", int)
_steps = make_number(1, 1_000, "a number from 1 to 1,000", int)
_ego = make_number(0, 2**31 - 1, "the number of an ego", int)
_pedal = make_number(0, 1, "a number from 0 to 1", float)
_angle = make_number(-2, 2, "an angle in radians, within +-2", float)
_kmh = make_number(-1_000, 1_000, "a speed in km/h, within +-1,000", float)
_metres = make_number(0, 1e9, "a number of metres", float)


def make_tick() -> Parser:
    """Return the parser of `rosbridge-sim tick`."""
    parser = command_of(
        "tick",
        "tools.sync_commands.tick",
        "Move a simulator in synchronous mode by N ticks, and print the frame and the ego after each.",
        epilog="With --start, the mode is ended afterwards if it was off before. If it was on, only the connection is"
        " closed, and the server's --sync-on-loss applies (wait: the world stands until the next tick --start).",
    )
    parser.option("count", "N", "ticks [1]", nargs="?", type=COUNT, default=1)
    parser.switch("--start", "become the master first; end the mode afterwards", dest="is_starting")
    parser.option("--id", "ID", f"user id of the master [{TICK_ID}]", dest="user_id", default=TICK_ID)
    parser.option("--step", "MS", "length of a tick, a multiple of 20 [20]", dest="step_ms", type=_step_ms, default=20)
    add_bridge(parser, CALL_PATIENCE)
    return parser


def _step_ms(text: str) -> float:
    """Read the length of a step [ms]."""
    step_ms = _milliseconds(text)
    if step_ms % 20:
        raise ArgumentTypeError(f"expected a multiple of 20 milliseconds; got {step_ms:g}")
    return step_ms


def make_step() -> Parser:
    """Return the parser of `rosbridge-sim step`."""
    parser = command_of(
        "step",
        _step,
        "Move a simulator in synchronous mode by so many ticks in one call, and show what came of it.",
        epilog="Each step is a tick of the master's time step. With --start the mode is ended again, unless it was on"
        " before; see rosbridge-sim tick --help.",
    )
    parser.option("-n", "--n", "N", "steps, 1 to 1,000 [1]", type=_steps, default=1)
    parser.switch("--start", "become the master first, and end the mode at the end")
    parser.option("--user", "--id", "ID", f"user id of the master [{TICK_ID}]", default=TICK_ID)
    parser.option("--step", "MS", "length of a step with --start [20]", type=_step_ms, default=20)
    parser.option("--ego", "N", "number of the ego that is driven [0]", type=_ego, default=0)
    parser.option("--throttle", "0..1", "drive by pedals in all steps", type=_pedal)
    parser.option("--brake", "0..1", "the same", type=_pedal)
    parser.option("--steering", "RAD", "angle of the front wheels, left positive", type=_angle)
    parser.option("--velocity", "KM/H", "drive at a speed, in place of the pedals", type=_kmh)
    parser.repeated("--topic", "TOPIC", "show its last message, too; repeatable")
    parser.add_argument(
        "--stop-on",
        action="append",
        default=[],
        choices=("collision", "red-light", "off-road"),
        help="end with the step in which this happens to an ego; repeatable",
    )
    parser.option("--stop-after", "M", "end when an ego has driven so far", type=_metres, default=0.0)
    parser.option("--stop-at", "X,Y,RADIUS", "end when an ego is so near to a place [m]")
    add_bridge(parser, CALL_PATIENCE)
    return parser


def _step(options: Options) -> int:
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
    step_ms = options.step if options.start else None
    return run_tool("tools.sync_commands.step", options, request=request, step_ms=step_ms)


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


def make_score() -> Parser:
    """Return the parser of `rosbridge-sim score`."""
    parser = command_of(
        "score",
        _score,
        "Show what the driver of each ego is judged by: distance, collisions, red lights, lanes, comfort.",
        epilog="A simulator keeps scores from the first question on, or from its start with serve --score.",
    )
    parser.switch("--follow", "go on, with a line for each ego once a second")
    parser.add_argument("-n", "--count", type=COUNT, help="end after so many messages; with --follow")
    parser.switch("--reset", "begin all counts anew, after showing them")
    add_bridge(parser)
    parser.set_defaults(end=0)
    return parser


def _score(options: Options) -> int:
    if options.follow and options.reset:
        raise SettingError("--reset: expected alone; --follow shows the scores as they come")
    if options.follow:
        return run_tool("simulator.score_command.follow", options)
    if options.count is not None:
        raise SettingError("--count: expected with --follow")
    return run_tool("simulator.score_command.show", options, is_reset=options.reset)


def make_sync() -> Parser:
    """Return the parser of `rosbridge-sim sync`."""
    parser = command_of(
        "sync",
        "tools.sync_commands.show_sync",
        "Show the state of synchronous mode: the master, or the members of the barrier.",
    )
    add_bridge(parser)
    return parser


def make_snapshot() -> Parser:
    """Return the parser of `rosbridge-sim snapshot`."""
    parser = command_of(
        "snapshot",
        _snapshot,
        "Save the state of a simulator, so that `restore` can go back to it; or list what is saved.",
    )
    parser.option("--id", "ID", "name of the snapshot [one that the server chooses]", default="")
    parser.option("--out", "FILE", "write it into a file, too, such as start.rbsim", type=Path)
    parser.switch("--list", "show the snapshots that are kept, and take none")
    parser.repeated("--remove", "ID", "remove one, then list; repeatable")
    add_bridge(parser, CALL_PATIENCE)
    return parser


def _snapshot(options: Options) -> int:
    if options.list or options.remove:
        if options.id or options.out:
            raise SettingError("--list, --remove: expected without --id and --out, which take a snapshot")
        return run_tool("simulator.snapshot_tool.list_snapshots", options)
    return run_tool("simulator.snapshot_tool.take_snapshot", options, name=options.id, path=options.out)


def make_restore() -> Parser:
    """Return the parser of `rosbridge-sim restore`."""
    parser = command_of(
        "restore",
        "simulator.snapshot_tool.restore",
        "Return a simulator to a snapshot. In synchronous mode only its master may do so.",
    )
    parser.option("name", "ID|FILE", "name of a snapshot that the server keeps, or a file of `snapshot --out`")
    parser.option("--user", "ID", f"user id of the master [{TICK_ID}]", dest="user_id", default=TICK_ID)
    add_bridge(parser, CALL_PATIENCE)
    return parser


def make_spawn() -> Parser:
    """Return the parser of `rosbridge-sim spawn`."""
    parser = command_of(
        "spawn",
        _spawn,
        "Place an object into a running simulator, and show its number (unique_id).",
        epilog="For example: rosbridge-sim spawn 'kia k5' --lane R0010L1 --distance 20 --behaviour lane;"
        " rosbridge-sim spawn Pedestrian --at 10,5,90 --speed 1.2",
    )
    parser.option("model", "MODEL", "name of the catalogue; 'service call /sim/catalogue' lists all")
    where = parser.add_mutually_exclusive_group(required=True)
    where.add_argument(
        "--at",
        type=_pose,
        metavar="X,Y[,HEADING]",
        help="on the map, in metres and degrees; write --at=-5,2 for a minus",
    )
    where.add_argument("--lane", metavar="LINK", help="on this link of the map")
    parser.option("--distance", "M", "from the beginning of the link, with --lane [0]", type=_number, default=0.0)
    parser.option("--lateral", "M", "to the left of the link's line, with --lane [0]", type=_number, default=0.0)
    parser.option("--speed", "M/S", "at the start [0]", type=_number, default=0.0)
    parser.add_argument("--behaviour", choices=BEHAVIOURS, help="[straight with a speed, else stand]")
    parser.option("--route", "LINK,...", "for lane: links to follow", type=_links, default=[])
    parser.switch("--ego", "a further ego, with topics of its own; MODEL is a vehicle")
    add_bridge(parser)
    return parser


BEHAVIOURS = ("stand", "straight", "lane")
"""Of those that the service knows; a path has too many numbers for a command line."""


def _spawn(options: Options) -> int:
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
    return run_tool("simulator.spawn.spawn", options, request=request)


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


def make_sensor() -> Parser:
    """Return the parser of `rosbridge-sim sensor`."""
    parser = command_of(
        "sensor",
        "simulator.sensor_tool.list_sensors",
        "List the cameras, lidars and radars of a running simulator: number, rate, place, topics.",
        epilog="For example: rosbridge-sim sensor list",
    )
    parser.add_argument("what", choices=("list",), help="what to do")
    parser.option("--ego", "N", "number of the ego [0]", type=int, default=0)
    add_bridge(parser)
    return parser
