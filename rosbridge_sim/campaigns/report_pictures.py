"""Pictures of the report as SVG: a map of the last seconds, and curves over time."""

from __future__ import annotations

import html
import math
from collections.abc import Mapping, Sequence
from typing import Any, Final

from rosbridge_sim.world.geometry.planar import box_at

_WIDTH: Final = 420
_CURVE_HEIGHT: Final = 108
_TOP: Final = 20
_LEFT: Final = 56
_BOTTOM: Final = 16
_VIEW: Final = 60.0
"""Half of the width of the map [m]."""

_MAX_POINTS: Final = 250
"""Points of a curve: half a pixel apart."""


def draw_scene(trace: Mapping[str, Sequence[float]], scene: Mapping[str, Any], label: str) -> str:
    """Return a map: lanes, the way of the ego during the last ten seconds, and the others at the end.

    Args:
        trace: figures over time: time [s], x, y [m].
        scene: `roads`, lines of (x, y) [m]; `neighbours`, (time, boxes) with (uid, x, y, yaw, half length, half width,
            shift of the middle, kind) each.
        label: for readers of screens.
    """
    end = trace["time"][-1]
    way = [(x, y) for time, x, y in zip(trace["time"], trace["x"], trace["y"], strict=True) if time >= end - 10.0]
    x0, y0 = way[-1]
    scale = _WIDTH / (2.0 * _VIEW)

    def at(x: float, y: float) -> str:
        return f"{(x - x0 + _VIEW) * scale:.1f},{(y0 - y + _VIEW * 0.75) * scale:.1f}"

    height = round(_WIDTH * 0.75)
    parts = [f'<svg viewBox="0 0 {_WIDTH} {height}" width="{_WIDTH}" role="img" aria-label="{html.escape(label)}">']
    for line in scene.get("roads", ()):
        points = " ".join(at(x, y) for x, y in line if math.hypot(x - x0, y - y0) < 2.0 * _VIEW)
        if points:
            parts.append(f'<polyline class="lane" stroke-width="{3.0 * scale:.1f}" points="{points}"/>')
    step = max(len(way) // _MAX_POINTS, 1)
    points = " ".join(at(x, y) for x, y in [*way[::step], way[-1]])
    parts.append(f'<polyline class="way" stroke-width="2" points="{points}"/>')
    neighbours = scene.get("neighbours") or [(0.0, ())]
    for uid, x, y, yaw, half_length, half_width, centre, _kind in neighbours[-1][1]:
        corners = box_at((x, y, yaw), half_length, half_width, centre)
        name = "ego" if uid == 0 else "other"
        parts.append(f'<polygon class="{name}" points="{" ".join(at(*corner) for corner in corners)}"/>')
    bar = 20.0 * scale
    parts.append(f'<path class="axis" d="M8 {height - 8}h{bar:.0f}"/><text x="8" y="{height - 12}">20 m</text></svg>')
    return "".join(parts)


def draw_curve(times: Sequence[float], values: Sequence[float], name: str, unit: str, mark: float | None) -> str:
    """Return a curve over time.

    Args:
        times: [s], rising.
        values: at these times; infinite ones are left out.
        mark: time of a vertical line, such as that of the breach [s]; None for none.
    """
    step = max(len(times) // _MAX_POINTS, 1)
    pairs = [(t, v) for t, v in zip(times[::step], values[::step], strict=True) if math.isfinite(v)]
    label = html.escape(f"{name} [{unit}] over time")
    head = f'<svg viewBox="0 0 {_WIDTH} {_CURVE_HEIGHT}" width="{_WIDTH}" role="img" aria-label="{label}">'
    title = f'<text x="{_LEFT}" y="13">{html.escape(name)} [{unit}]</text>'
    if not pairs:
        return f'{head}{title}<text x="{_LEFT + 6}" y="48">none</text></svg>'
    first, last = times[0], max(times[-1], times[0] + 1e-6)
    low, high = min(0.0, *(v for _, v in pairs)), max(v for _, v in pairs)
    high = max(high, low + 1e-6)

    def at(t: float, v: float) -> tuple[float, float]:
        x = _LEFT + (t - first) / (last - first) * (_WIDTH - _LEFT - 4)
        y = _CURVE_HEIGHT - _BOTTOM - (v - low) / (high - low) * (_CURVE_HEIGHT - _BOTTOM - _TOP)
        return x, y

    pieces: list[str] = []
    gap = (times[min(step, len(times) - 1)] - times[0]) * 1.5
    before = -math.inf
    for t, v in pairs:
        x, y = at(t, v)
        pieces.append(f"{'L' if t - before <= gap else 'M'}{x:.1f} {y:.1f}")
        before = t
    bottom = _CURVE_HEIGHT - _BOTTOM
    lines = [f'<path class="axis" d="M{_LEFT} {_TOP}V{bottom}H{_WIDTH - 4}" fill="none"/>']
    if mark is not None:
        x = at(mark, low)[0]
        lines.append(f'<path class="mark" d="M{x:.1f} {_TOP}V{bottom}"/>')
    lines.append(f'<path class="curve" d="{"".join(pieces)}"/>')
    lines.append(f'<text x="{_LEFT - 4}" y="{_TOP + 8}" text-anchor="end">{high:.4g}</text>')
    lines.append(f'<text x="{_LEFT - 4}" y="{bottom}" text-anchor="end">{low:.4g}</text>')
    lines.append(f'<text x="{_WIDTH - 4}" y="{_CURVE_HEIGHT - 3}" text-anchor="end">{last:.4g} s</text>')
    return f"{head}{title}{''.join(lines)}</svg>"
