"""The commands that make pictures: `rosbridge-sim shot` and `clip`."""

from __future__ import annotations

import re
from argparse import ArgumentTypeError
from pathlib import Path

from rosbridge_sim.cli.bridge_flags import add_bridge
from rosbridge_sim.cli.command_line import Options, add_json, command_of, make_number, run_tool, words_of
from rosbridge_sim.errors import SettingError
from rosbridge_sim.link.arguments import Parser

CHASE = "chase"
"""View from behind the ego."""

MIN_SIDE, MAX_WIDTH, MAX_HEIGHT = 16, 3_840, 2_160
"""Smallest and largest pictures [pixels]: a software renderer needs a second for a large one."""

MAX_SECONDS = 600.0
"""Longest clip [s]; its pixels have a limit of their own."""

_seconds = make_number(0.02, MAX_SECONDS, f"seconds, from 0.02 to {MAX_SECONDS:g}", float)
_at = make_number(0, 36_000, "seconds, from 0 to 36,000", float)
_rate = make_number(0.1, 50, "pictures a second, from 0.1 to 50", float)
_quality = make_number(1, 100, "a number from 1 to 100", int)
_ego = make_number(0, 2**31 - 1, "the number of an ego", int)

_WORLD_FLAGS = ("scenario", "map", "scenario_path", "sensors", "weather", "traffic", "seed")
"""Flags of `serve` that these commands have, too."""


def make_shot() -> Parser:
    """Return the parser of `rosbridge-sim shot`."""
    parser = command_of(
        "shot",
        _shot,
        "Save a picture: of a scenario or a recording, without a server, or the next one of a camera of a"
        " running simulator.",
        epilog="For example: rosbridge-sim shot --scenario town --at 20 -o town.png; and of a running simulator:"
        " rosbridge-sim shot --camera Camera -o out.png",
    )
    _add_picture(parser, "a scenario; without it and without --recording a camera of the simulator at --url")
    parser.option("-o", "--out", "FILE", "*.png, *.jpg, *.webp or another picture", type=Path, required=True)
    add_bridge(parser)
    return parser


def make_clip() -> Parser:
    """Return the parser of `rosbridge-sim clip`."""
    parser = command_of(
        "clip",
        _clip,
        "Save a moving picture of a scenario or a recording, from behind the ego or by its camera. No"
        " server and no browser is needed.",
        epilog="For example: rosbridge-sim clip --scenario town --traffic 60 --at 20 -o town.webp",
    )
    _add_picture(parser, "scenario, as for serve")
    parser.option("--seconds", "S", "length, in simulated time [6]", type=_seconds, default=6.0)
    parser.option("--fps", "N", "pictures a second [10]", type=_rate, default=10.0)
    parser.option("-o", "--out", "FILE", "*.webp, *.gif or *.png (APNG)", type=Path, required=True)
    add_json(parser)
    return parser


def _add_picture(parser: Parser, scenario: str) -> None:
    """Add the flags of both commands."""
    add = parser.add_argument
    add("--scenario", metavar="NAME|FILE", help=scenario)
    add("--recording", type=Path, metavar="FILE", help="*.bag, *.mcap or folder that moves the scenario's world")
    add("--map", metavar="NAME|DIR", help="map in place of the scenario's")
    add("--scenario-path", action="append", default=[], metavar="DIR", help="folder with scenarios; repeatable")
    add("--camera", metavar="NAME|INDEX", help=f"{CHASE}, a camera, or 0, 1, ... among the cameras [{CHASE}]")
    add("--sensors", metavar="NAME|FILE", help="cameras of the ego, as for serve [camera]")
    add("--weather", metavar="NAME", help="noon, dusk, night, rain or fog [noon]")
    add("--traffic", metavar="N", help="vehicles besides those of the scenario [0]")
    add("--seed", metavar="N", help="random seed [0]")
    add("--ego", type=_ego, default=0, metavar="N", help="number of the ego [0]")
    add("--drive", choices=("self", "none"), help="the ego drives itself, or stands [self]")
    add("--at", type=_at, metavar="S", help="begin after so much simulated time [0]")
    add("--size", type=_size, metavar="WxH", help=f"of a picture [that of the camera; {CHASE}: 1280x720]")
    add("--quality", type=_quality, metavar="N", help="of WebP and JPEG, 1 to 100 [80]")


def _shot(options: Options) -> int:
    if options.scenario is not None or options.recording is not None:
        return run_tool("files.film.film_shot", options, choice=_choice_of(options))
    names = ("map", "scenario_path", "sensors", "weather", "traffic", "seed", "drive", "at", "size", "quality")
    given = [name for name in names if getattr(options, name) not in (None, [])]
    if given:
        flag = given[0].replace("_", "-")
        raise SettingError(f"--{flag}: expected with --scenario or --recording; a running simulator has its own")
    if options.camera == CHASE:
        raise SettingError("--camera chase: expected with --scenario or --recording; a running simulator has its page")
    return run_tool("simulator.sensor_tool.take_shot", options, camera=options.camera or "", path=options.out)


def _clip(options: Options) -> int:
    return run_tool("files.film.film_clip", options, choice=_choice_of(options), rate=options.fps)


def _choice_of(options: Options):  # type: ignore[no-untyped-def] # noqa: ANN202 - of a module that is imported late
    """Return what the flags choose."""
    from rosbridge_sim.cli.files.film import FilmChoice  # noqa: PLC0415 - with the world

    sensors = [] if options.sensors else ["--sensors=camera"]
    return FilmChoice(
        words=[*sensors, *words_of(options, *_WORLD_FLAGS)],
        camera=options.camera or CHASE,
        size=options.size,
        ego=options.ego,
        recording=options.recording,
        is_driving=options.drive != "none",
        at=options.at or 0.0,
        out=options.out,
        quality=options.quality or 80,
        is_json=options.json,
    )


def _size(text: str) -> tuple[int, int]:
    """Read WxH."""
    found = re.fullmatch(r"(\d{1,5})[xX*](\d{1,5})", text)
    width, height = (int(found[1]), int(found[2])) if found is not None else (0, 0)
    if not (MIN_SIDE <= width <= MAX_WIDTH and MIN_SIDE <= height <= MAX_HEIGHT):
        expected = f"WIDTHxHEIGHT in pixels, from {MIN_SIDE}x{MIN_SIDE} to {MAX_WIDTH}x{MAX_HEIGHT}, such as 1280x720"
        raise ArgumentTypeError(f"expected {expected}; got {text!r}")
    return width, height
