#!/usr/bin/env python3
"""Draw the pictures of README and of the documentation's first pages.

    python scripts/draw_docs.py    writes docs/images/drive.svg, a PNG for each of five built-in scenes, and
                                   scenario_crossing.jpg and story_*.jpg, for which it needs the extra `sensors`

`town.png` is the built-in scene `town` as `rosbridge-sim scenario check town --picture` draws it, with fewer colours;
so are the scenes `hills`, `motorway`, `roundabout` and `parking`. `opendrive_crossing.png` is a file in OpenDRIVE.
`drive.svg` shows the drive of the Python program in README: 30 km/h in a left bend for five seconds, then the brake.
Other pictures are drawn by `write_docs.py` from the sources and are compared by a test. These are not compared,
because a font or a numpy build may change a pixel.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import re
import sys
import tempfile
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from PIL import Image
from websockets.asyncio.client import ClientConnection, connect

ROOT = Path(__file__).resolve().parent.parent
if __name__ == "__main__":
    sys.path.insert(0, str(ROOT))  # works from a fresh clone, too

from rosbridge_sim import Simulator  # noqa: E402
from rosbridge_sim.cli.command_table import TOOLS  # noqa: E402
from scripts.docs_pages.svg import INK, Point, document, text  # noqa: E402
from scripts.drawing.opendrive_crossing import crossing_file  # noqa: E402

IMAGES: Final = ROOT / "docs" / "images"

COLOURS: Final = 256
"""Number of colours: the maximum of a PNG with a palette. The small lights and cars keep their colours, at a fifth of
the size."""

SIDE: Final = 1_000
"""Width of the scene's picture [px]: enough for a page, and a third of the tool's picture."""

DRIVING_TICKS: Final = 250
"""Ticks before the brake: five seconds, as in README."""


@dataclass(frozen=True, slots=True)
class Moment:
    """State of the ego after a tick.

    Attributes:
        time: since the first tick [s].
        x, y: of the rear axle in the map [m].
        speed: [km/h].
        brake: pedal, 0 to 1.
    """

    time: float
    x: float
    y: float
    speed: float
    brake: float


def draw_scene(name: str, path: Path) -> None:
    """Write the picture of a built-in scene.

    Args:
        name: of the scene.
        path: of the PNG file.
    """
    with tempfile.TemporaryDirectory() as folder:
        large = Path(folder) / f"{name}.png"
        TOOLS["scenario"](["check", name, "--picture", str(large)])
        _save_small(large, path)


def draw_opendrive(path: Path) -> None:
    """Write the picture of a small OpenDRIVE file as `map info` draws it."""
    with tempfile.TemporaryDirectory() as folder:
        file, large = Path(folder) / "crossing.xodr", Path(folder) / "crossing.png"
        file.write_text(crossing_file())
        TOOLS["map"](["info", str(file), "--picture", str(large)])
        _save_small(large, path)


def _save_small(large: Path, path: Path) -> None:
    picture = Image.open(large).convert("RGB")
    picture.thumbnail((SIDE, SIDE), Image.Resampling.LANCZOS)
    picture.quantize(COLOURS, Image.Quantize.FASTOCTREE).save(path, optimize=True)


async def _drive() -> list[Moment]:
    async with Simulator(port=0, start="sync") as sim, connect(sim.url) as client:
        await _ask(client, "/SyncModeCmd", user_id="me", start_sync_mode=True, time_step=20)
        moments: list[Moment] = []
        while len(moments) < DRIVING_TICKS or moments[-1].speed > 0:
            is_driving = len(moments) < DRIVING_TICKS
            command = (
                {"longlCmdType": 2, "velocity": 30.0, "steering": 0.05}
                if is_driving
                else {"longlCmdType": 1, "brake": 1.0}
            )
            await _ask(client, "/SyncModeCtrlCmd", command=command)
            car = (await _ask(client, "/SyncModeWaitForTick", user_id="me"))["vehicle_status"]
            place, speed = car["position"], car["velocity"]["x"] * 3.6
            moments.append(Moment(0.02 * (1 + len(moments)), place["x"], place["y"], speed, car["brake"]))
        return moments


async def _ask(client: ClientConnection, service: str, **request: object) -> dict[str, Any]:
    await client.send(json.dumps({"op": "call_service", "service": service, "args": {"request": request}}))
    answer: dict[str, Any] = json.loads(await client.recv())["values"]["response"]
    return answer


@dataclass(frozen=True, slots=True)
class _Chart:
    """A chart of the picture, with its axes.

    Attributes:
        at: lower left corner [px].
        size: width and height [px].
        xs, ys: first and last value of each axis.
    """

    at: Point
    size: Point
    xs: Point
    ys: Point

    def place(self, x: float, y: float) -> Point:
        """Return the position of a value in the picture."""
        across = (x - self.xs[0]) / (self.xs[1] - self.xs[0])
        up = (y - self.ys[0]) / (self.ys[1] - self.ys[0])
        return self.at[0] + across * self.size[0], self.at[1] - up * self.size[1]

    def line(self, points: Iterable[Point], colour: str) -> str:
        """Return a line through values."""
        placed = " ".join(f"{x:.1f},{y:.1f}" for x, y in (self.place(*point) for point in points))
        return f'<polyline points="{placed}" fill="none" stroke="{colour}" stroke-width="2.5"/>'

    def axes(self, across: Sequence[float], up: Sequence[float], names: tuple[str, str]) -> list[str]:
        """Return the frame, its ticks and the names of both axes."""
        (x0, y0), (width, height) = self.at, self.size
        parts = [
            f'<rect x="{x0:g}" y="{y0 - height:g}" width="{width:g}" height="{height:g}" fill="none" stroke="{INK}"/>'
        ]
        for value in across:
            x, _ = self.place(value, self.ys[0])
            parts.append(text((x, y0 + 18), f"{value:g}", size=12))
        for value in up:
            _, y = self.place(self.xs[0], value)
            parts.append(text((x0 - 8, y + 4), f"{value:g}", size=12, anchor="end"))
            parts.append(f'<path d="M{x0:g},{y:.1f} h{width:g}" stroke="{INK}" stroke-opacity="0.15"/>')
        parts.append(text((x0 + width / 2, y0 + 38), names[0], size=12))
        parts.append(text((x0, y0 - height - 10), names[1], size=12, anchor="start"))
        return parts


def draw_drive(path: Path) -> None:
    """Write the plot of the drive: the path on the map, and the speed and the brake over time.

    Args:
        path: of the SVG file.
    """
    moments = asyncio.run(_drive())
    end = moments[-1]
    way = _Chart((60, 260), (330, 200), (38, 78), (-6, 18.24))
    speed = _Chart((470, 260), (370, 200), (0, 7), (0, 35))
    parts = [
        *way.axes((40, 50, 60, 70), (0, 5, 10, 15), ("x, east [m]", "y, north [m]: path of the rear axle")),
        way.line(((one.x, one.y) for one in moments), "#1f6fb2"),
        *speed.axes(range(8), (0, 10, 20, 30), ("simulated time [s]", "speed [km/h]")),
        speed.line(((one.time, one.speed) for one in moments), "#1f6fb2"),
        speed.line(((one.time, 10 * one.brake) for one in moments), "#c0502a"),
        text(speed.place(4.9, 11), "brake pedal (10 is 1)", size=12, anchor="end"),
        text(way.place(end.x - 1.5, end.y + 1), "stops here", size=12, anchor="end"),
    ]
    title = "A drive of five seconds at 30 km/h in a left bend, and the braking after it"
    path.write_text(document(880, 320, title, parts), encoding="utf-8")


def read_own_scenario() -> dict[str, object]:
    """Return the scenario of `docs/guides/write_scenario.md`, with all that its steps add."""
    page = (ROOT / "docs" / "guides" / "write_scenario.md").read_text("utf-8")
    scenario: dict[str, object] = {}
    for step in re.findall(r"<!-- run: scenario-\w+ -->\n```json\n(.*?)```", page, re.DOTALL):
        scenario |= json.loads(step)
    return scenario


def draw_own_scenario(path: Path) -> None:
    """Write what is seen of that scenario from behind its ego.

    Args:
        path: of the picture.
    """
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "crossing.json"
        file.write_text(json.dumps(read_own_scenario()), "utf-8")
        words = ["--scenario", str(file), "--weather", "dusk", "--at", "5", "--size", "1000x560", "-o", str(path)]
        if TOOLS["shot"](words):
            raise SystemExit(f"{path}: it cannot be drawn")


STORY_MOMENTS: Final = {"cut-in": "3.1", "jaywalker": "8", "red light": "6", "merge": "3.2"}
"""Stories of the same page, and the times of their pictures [s]."""


def draw_stories(folder: Path) -> None:
    """Write what is seen of each story of that page from behind its ego, which drives itself."""
    page = (ROOT / "docs" / "guides" / "write_scenario.md").read_text("utf-8")
    for name, story in re.findall(r"<!-- story: ([^>]+) -->\n```json\n(.*?)```", page, re.DOTALL):
        with tempfile.TemporaryDirectory() as own:
            file = Path(own) / "story.json"
            file.write_text(story, "utf-8")
            path = folder / f"story_{name.replace(' ', '_').replace('-', '_')}.jpg"
            if TOOLS["shot"](
                ["--scenario", str(file), "--at", STORY_MOMENTS[name], "--size", "800x400", "-o", str(path)]
            ):
                raise SystemExit(f"{path}: it cannot be drawn")


def main() -> int:
    """Write all pictures."""
    argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter).parse_args()
    IMAGES.mkdir(parents=True, exist_ok=True)
    for name in ("town", "hills", "motorway", "roundabout", "parking"):
        draw_scene(name, IMAGES / f"{name}.png")
    draw_opendrive(IMAGES / "opendrive_crossing.png")
    draw_drive(IMAGES / "drive.svg")
    draw_own_scenario(IMAGES / "scenario_crossing.jpg")
    draw_stories(IMAGES)
    return 0


if __name__ == "__main__":
    sys.exit(main())
