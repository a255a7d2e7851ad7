"""The drawing of the learning curves in the guide *Train drivers*.

The figures are those that `scripts/examples/train_lane_keeping.py --seed S --curve learning_curve_S.csv` wrote.
"""

from __future__ import annotations

import csv
import math
from pathlib import Path
from typing import Final

from scripts.docs_pages.svg import INK, Point, document, text

SIZE: Final = (640, 320)
LEFT, RIGHT, TOP, BOTTOM = 64.0, 616.0, 24.0, 264.0
"""Sides of the plot [px]."""

SECONDS, REWARD = 20.0, 150.0
"""Ends of the axes: CPU time [s], and the greatest reward of an episode."""

COLOURS: Final = ("#1565c0", "#c25700")


def draw_learning_curve() -> str:
    """Return the picture: the reward of the best policies over CPU time, a line for each seed, and the first lap."""
    parts = [*_axes()]
    for seed, colour in enumerate(COLOURS):
        rows = _read(seed)
        points = [_at(float(row["cpu_seconds"]), float(row["reward"])) for row in rows]
        line = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
        parts.append(f'<polyline points="{line}" fill="none" stroke="{colour}" stroke-width="2.5"/>')
        parts += [f'<circle cx="{x:.1f}" cy="{y:.1f}" r="3" fill="{colour}"/>' for x, y in points]
        last = rows[-1]
        lap = "no lap" if math.isnan(float(last["metres"])) else f"lap of {int(last['metres']):,} m"
        y = BOTTOM - 64.0 + 22.0 * seed
        parts.append(f'<line x1="264" y1="{y - 5:g}" x2="288" y2="{y - 5:g}" stroke="{colour}" stroke-width="2.5"/>')
        label = f"seed {seed}: {lap}, at most {last['offset']} m aside"
        parts.append(text((296.0, y), label, size=13, anchor="start"))
    return document(*SIZE, "Reward of the best policies over CPU time, for two seeds", parts)


def _read(seed: int) -> list[dict[str, str]]:
    path = Path(__file__).parent / f"learning_curve_{seed}.csv"
    return list(csv.DictReader(path.read_text("utf-8").splitlines()))


def _at(seconds: float, reward: float) -> Point:
    return LEFT + (RIGHT - LEFT) * seconds / SECONDS, BOTTOM - (BOTTOM - TOP) * reward / REWARD


def _axes() -> list[str]:
    """Return grid, numbers and names of the axes."""
    parts = []
    for reward in range(0, 151, 50):
        y = _at(0.0, reward)[1]
        parts.append(f'<line x1="{LEFT:g}" y1="{y:g}" x2="{RIGHT:g}" y2="{y:g}" stroke="{INK}" stroke-opacity="0.25"/>')
        parts.append(text((LEFT - 8.0, y + 5.0), f"{reward}", size=13, anchor="end"))
    parts += [text((_at(each, 0.0)[0], BOTTOM + 20.0), f"{each}", size=13) for each in range(0, 21, 5)]
    parts.append(text((0.5 * (LEFT + RIGHT), BOTTOM + 44.0), "CPU time [s]"))
    middle = 0.5 * (TOP + BOTTOM)
    turned = text((20.0, middle), "reward of the best policies")
    return [*parts, turned.replace("<text ", f'<text transform="rotate(-90 20 {middle:g})" ', 1)]
