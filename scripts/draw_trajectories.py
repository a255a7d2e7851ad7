#!/usr/bin/env python3
"""Draw the trajectories of vehicles over the lanes of a map, to look at how they drive.

    python scripts/draw_trajectories.py FILE.png --scenario motorway --box 200,-30,600,30 [--seconds 30]
    python scripts/draw_trajectories.py FILE.png --map town --num 100 --people 40 --box=-30,-30,30,30 --uids 4,7
    python scripts/draw_trajectories.py DIRECTORY --cases

With `--cases` it draws the small scenes of `trajectory_cases.py`, each into a file of its own.

Without `--uids` it draws all that come into the box; of a crowd, those that come first. Bodies are drawn at each
interval, paler the earlier they are, with the seconds beside some of them. Below are the speeds; dots mark a braking
harder than 3 m/s^2. Vehicles are drawn in colours, egos in black, what never moves in grey. Pedestrians are filled.
"""

from __future__ import annotations

import argparse
import colorsys
import math
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from PIL import Image, ImageDraw, ImageFont

ROOT = Path(__file__).resolve().parent.parent
if __name__ == "__main__":
    sys.path.insert(0, str(ROOT))  # works from a fresh clone, too

from rosbridge_sim.shell.files.library import DiskLibrary  # noqa: E402
from rosbridge_sim.simulator.scene.scene import Scene  # noqa: E402
from rosbridge_sim.world.geometry.planar import FloatArray  # noqa: E402
from rosbridge_sim.world.state.world import DT, Gear, Kind, World  # noqa: E402
from rosbridge_sim.world.step import step  # noqa: E402
from scripts.soak.traffic_cells import Cell, world_of  # noqa: E402
from scripts.trajectory_cases import CASES, Box  # noqa: E402

WIDTH: Final = 1600
STRIP: Final = 260
"""Width of the picture, and height of the speeds below it [px]."""

MAX_TRACES: Final = 14
"""More trajectories than this cannot be told apart."""

FIRM: Final = -3.0
"""A harder braking is marked [m/s^2]."""

Colour = tuple[int, int, int]
COLOURS: Final = 96
"""Colours of a picture that is written: enough for all lines, and a small file."""


@dataclass(slots=True)
class Trace:
    """The trajectory of one entity.

    Attributes:
        uid: its id.
        kind: its kind.
        size: half length, half width, and distance from the reference point to the middle [m].
        rows: (n, 6) time [s], x, y [m], yaw [rad], speed [m/s] and acceleration [m/s^2].
    """

    uid: int
    kind: Kind
    size: tuple[float, float, float]
    rows: FloatArray

    @property
    def is_still(self) -> bool:
        """True if it never moves."""
        return not self.rows[:, 4].any()


def record(world: World, begin: float, seconds: float, every: float) -> list[Trace]:
    """Return the trajectories of all entities that are there at the beginning.

    Args:
        world: it moves on.
        begin: time to wait first [s].
        seconds: length of the trajectories.
        every: time from one place to the next [s].
    """
    for _ in range(round(begin / DT)):
        step(world)
    uids = [int(world.uid[row]) for row in np.flatnonzero(world.alive)]
    places: dict[int, list[tuple[float, ...]]] = {uid: [] for uid in uids}
    columns = ("x", "y", "yaw", "speed", "accel")
    for _ in range(max(1, round(seconds / every))):
        present = {int(world.uid[row]): int(row) for row in np.flatnonzero(world.alive)}
        for uid in uids:
            if uid in present:
                figures = (float(getattr(world, name)[present[uid]]) for name in columns)
                places[uid].append((world.frame * DT, *figures))
        for _ in range(max(1, round(every / DT))):
            step(world)
    rows = {int(world.uid[row]): int(row) for row in np.flatnonzero(world.alive)}
    return [
        Trace(
            uid,
            Kind(world.kind.item(rows[uid])),
            (world.half_length.item(rows[uid]), world.half_width.item(rows[uid]), world.centre.item(rows[uid])),
            np.array(places[uid]),
        )
        for uid in uids
        if uid in rows
    ]


def draw(world: World, traces: list[Trace], box: Box) -> Image.Image:
    """Return the picture.

    Args:
        world: has the lanes.
        traces: to draw; those that do not come into the box are left out.
        box: part of the map.
    """
    west, south, east, north = box
    scale = WIDTH / (east - west)
    height = round((north - south) * scale)
    image = Image.new("RGB", (WIDTH, height + STRIP), "white")
    pen, font = ImageDraw.Draw(image, "RGBA"), ImageFont.load_default(13)

    def place(x: FloatArray, y: FloatArray) -> list[tuple[float, float]]:
        return list(zip(((x - west) * scale).tolist(), ((north - y) * scale).tolist(), strict=True))

    roads = world.roads
    for lane in range(len(roads)):
        line = roads.points[roads.first[lane] : roads.first[lane + 1]]
        width = max(1, round(float(roads.width[lane]) * scale))
        pen.line(place(line[:, 0], line[:, 1]), fill=(228, 230, 232, 255), width=width, joint="curve")
    for lane in range(len(roads)):
        line = roads.points[roads.first[lane] : roads.first[lane + 1]]
        pen.line(place(line[:, 0], line[:, 1]), fill=(170, 175, 180, 255), width=1)
    inside = [trace for trace in traces if _first_inside(trace, box) is not None]
    inside.sort(key=lambda trace: (_first_inside(trace, box), trace.uid))
    still = [trace for trace in inside if trace.is_still]
    moving = [trace for trace in inside if not trace.is_still][:MAX_TRACES]
    for trace in still:
        fill = (0, 0, 0, 220) if trace.kind == Kind.EGO else (110, 110, 110, 160)
        pen.polygon(_corners(trace, trace.rows[0], place), fill=fill)
    for number, trace in enumerate(moving):
        colour = _colour(trace, number, len(moving))
        pen.line(place(trace.rows[:, 1], trace.rows[:, 2]), fill=(*colour, 200), width=2)
        for i, row in enumerate(trace.rows):
            alpha = 30 + round(130 * i / len(trace.rows))
            strength = alpha + 60 if trace.kind == Kind.PEDESTRIAN else alpha // 2
            pen.polygon(_corners(trace, row, place), fill=(*colour, strength), outline=(*colour, alpha))
            if i % 5 == 0:
                pen.text(place(row[1:2], row[2:3])[0], f"{row[0]:g}", fill=(*colour, 255), font=font)
    pen.rectangle((0, height, WIDTH, height + STRIP), fill="white")
    _draw_speeds(pen, moving, height)
    metres = 10.0 if east - west < 150.0 else 50.0
    pen.line([(20, height - 14), (20 + metres * scale, height - 14)], fill="black", width=3)
    pen.text((20, height - 32), f"{metres:g} m", fill="black", font=font)
    return image


def _draw_speeds(pen: ImageDraw.ImageDraw, traces: list[Trace], top: int) -> None:
    """Draw the speeds over the time, below the map."""
    if not traces:
        return
    font = ImageFont.load_default(13)
    begin = min(trace.rows[0, 0] for trace in traces)
    end = max(trace.rows[-1, 0] for trace in traces) + 1e-9
    most = max(float(trace.rows[:, 4].max()) for trace in traces) + 1.0
    left, right, low = 60, WIDTH - 200, top + STRIP - 30

    def at(time: float, speed: float) -> tuple[float, float]:
        return left + (right - left) * (time - begin) / (end - begin), low - (STRIP - 50) * speed / most

    for speed in range(0, int(most) + 1, 5):
        pen.line([at(begin, speed), at(end, speed)], fill=(220, 220, 220, 255))
        pen.text((5, at(begin, speed)[1] - 8), f"{speed} m/s", fill="black", font=font)
    for time in range(math.ceil(begin), math.floor(end) + 1, max(1, round((end - begin) / 6))):
        pen.text(at(time, 0.0), f"{time} s", fill="black", font=font)
    for number, trace in enumerate(traces):
        colour = _colour(trace, number, len(traces))
        pen.line([at(*row[[0, 4]].tolist()) for row in trace.rows], fill=(*colour, 255), width=2)
        for row in trace.rows[trace.rows[:, 5] < FIRM]:
            x, y = at(*row[[0, 4]].tolist())
            pen.ellipse((x - 4, y - 4, x + 4, y + 4), fill=(*colour, 255))
        hardest = float(trace.rows[:, 5].min())
        words = f"{trace.kind.name.lower()} {trace.uid}, least {hardest:.1f} m/s^2"
        pen.text((right + 10, top + 10 + 16 * number), words, fill=(*colour, 255), font=font)


def _corners(trace: Trace, row: FloatArray, place: object) -> list[tuple[float, float]]:
    assert callable(place)
    half_length, half_width, centre = trace.size
    forward = np.array([half_length, half_length, -half_length, -half_length]) + centre
    left = np.array([half_width, -half_width, -half_width, half_width])
    cos, sin = np.cos(row[3]), np.sin(row[3])
    corners: list[tuple[float, float]] = place(row[1] + forward * cos - left * sin, row[2] + forward * sin + left * cos)
    return corners


def _first_inside(trace: Trace, box: Box) -> float | None:
    """Return the time at which an entity is in the box for the first time; None for never."""
    west, south, east, north = box
    x, y = trace.rows[:, 1], trace.rows[:, 2]
    inside = np.flatnonzero((x > west) & (x < east) & (y > south) & (y < north))
    return float(trace.rows[inside[0], 0]) if len(inside) else None


def _colour(trace: Trace, number: int, num: int) -> Colour:
    if trace.kind == Kind.EGO:
        return 0, 0, 0
    red, green, blue = colorsys.hsv_to_rgb(number / max(num, 1), 0.9, 0.75)
    return round(red * 255), round(green * 255), round(blue * 255)


def _save(image: Image.Image, file: Path) -> None:
    image.quantize(COLOURS, kmeans=1, dither=Image.Dither.NONE).save(file, optimize=True)


def _numbers(text: str) -> list[float]:
    return [float(part) for part in text.split(",") if part]


def main() -> int:
    """Run, draw and write the file; return the exit code."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("file", type=Path, help="picture to write; with --cases, the directory of the pictures")
    what = parser.add_mutually_exclusive_group(required=True)
    what.add_argument("--scenario", help="name or file of a scenario")
    what.add_argument("--map", help="name of a map, with --num vehicles at random places")
    what.add_argument("--cases", action="store_true", help="draw the small scenes")
    parser.add_argument("--num", type=int, default=100, help="[%(default)s]")
    parser.add_argument("--people", type=int, default=0, help="of the map's scenario, with --map [%(default)s]")
    parser.add_argument("--seed", type=int, default=0, help="[%(default)s]")
    parser.add_argument("--box", default="", help="west,south,east,north of the picture [m]")
    parser.add_argument("--uids", help="ids to draw; without them, all that come into the box")
    parser.add_argument("--begin", type=float, default=0.0, help="first second [%(default)s]")
    parser.add_argument("--seconds", type=float, default=30.0, help="length [%(default)s]")
    parser.add_argument("--every", type=float, default=0.5, help="time from one body to the next [%(default)s]")
    options = parser.parse_args()
    if options.cases:
        for name, case in CASES.items():
            world = case.make()
            image = draw(world, record(world, case.begin, case.seconds, case.every), case.box)
            _save(image, options.file / f"trajectory_{name}.png")
        return 0
    box = _numbers(options.box)
    if len(box) != 4 or box[0] >= box[2] or box[1] >= box[3]:
        parser.error(f"--box: expected west,south,east,north; got {options.box!r}")
    if options.map:
        world = world_of(Cell(options.map, options.num, options.seed, options.people))
    else:
        library = DiskLibrary()
        world = World(options.seed)
        Scene(world, library, library.opening_scenario(options.scenario), ego_gear=Gear.DRIVE)
    traces = record(world, options.begin, options.seconds, options.every)
    if options.uids:
        wanted = set(_numbers(options.uids))
        traces = [trace for trace in traces if trace.uid in wanted or trace.is_still]
    _save(draw(world, traces, (box[0], box[1], box[2], box[3])), options.file)
    return 0


if __name__ == "__main__":
    sys.exit(main())
