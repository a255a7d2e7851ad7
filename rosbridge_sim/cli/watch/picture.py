"""The picture of a scene in characters: a title, the scene from above, and lines about the ego, lights and time."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from rosbridge_sim.cli.watch.canvas import DOTS_X, DOTS_Y, Canvas, Ink, columns, fit, paint
from rosbridge_sim.cli.watch.watched_scene import Thing, WatchedScene, lamp_word, number_of, speed_of, text_of
from rosbridge_sim.link.terminal_text import safe
from rosbridge_sim.world.geometry.planar import FloatArray

__all__ = ["View", "draw", "pan", "show_whole_map", "zoom"]

START_SCALE: Final = 0.75
"""Metres in a dot at the start: 120 m across 80 characters, and a car is six dots long."""

MIN_SCALE: Final = 0.05
MAX_SCALE: Final = 100.0
"""Limits of the zoom [m/dot]: a wheel, and a country."""

ZOOM: Final = 1.3
"""Factor of a step of the zoom: three steps are about twice as large."""

FAR_SCALE: Final = 1.5
"""From here on [m/dot] a lane is about two dots wide, and its middle line is drawn in place of its edges."""

LAMP_SCALE: Final = 2.5
"""Lights are drawn up to this scale [m/dot]: farther out, those of a crossing hide it."""

LABEL_SCALE: Final = 0.6
"""Objects have labels up to this scale [m/dot]: farther out, texts hide the scene."""

GLYPH_LENGTH: Final = 5.0
"""An ego shorter than this is drawn as an arrow [dots]: the direction of a smaller box cannot be seen."""

MAX_LABELS: Final = 60
"""Objects with a label, the nearest ones: more of them overlap."""

LIGHT_SECONDS: Final = 1.5
"""The light ahead is shown for so long after its last message [s]: the topic is silent where there is no light."""

EGO_SIZE: Final = (4.5, 1.9, 1.4)
"""Length and width of the ego, and from its reference point to the middle [m]; `/Ego_topic` does not say."""

MIN_WIDTH: Final = 20
MIN_HEIGHT: Final = 8
"""The smallest terminal that has room for the scene; a smaller one gets the ego's line."""

NUM_LINES: Final = 5
"""Rows beside the scene: the title above it, and four below."""

GEARS: Final = {1: "P", 2: "R", 3: "N", 4: "D"}
MODES: Final = {1: "keyboard", 2: "game pad", 3: "external control", 6: "self-driving"}
"""Numbers of `morai_msgs/EventInfo`."""

_ARROWS: Final = "→↗↑↖←↙↓↘"
_PLAIN_ARROWS: Final = ">/^\\</v\\"

_INK_OF: Final = {"vehicle": Ink.VEHICLE, "pedestrian": Ink.PEDESTRIAN, "obstacle": Ink.OBSTACLE}
_INK_OF_LAMP: Final = {"red": Ink.RED, "yellow": Ink.YELLOW, "green": Ink.GREEN, "": Ink.GRID}
_LETTERS: Final = {"red": "R", "yellow": "Y", "green": "G", "": "o"}


@dataclass(slots=True)
class View:
    """The part of the scene that is shown.

    Attributes:
        scale: metres in a dot.
        x, y: middle of the picture [m]; while `is_following`, the ego's place.
        is_following: the ego stays in the middle.
        is_heading_up: the ego's heading is up; otherwise north is.
        num_colours: 0, 16 or 256.
        has_unicode: the terminal can show Braille and arrows.
    """

    scale: float = START_SCALE
    x: float = 0.0
    y: float = 0.0
    is_following: bool = True
    is_heading_up: bool = False
    num_colours: int = 0
    has_unicode: bool = True


def zoom(view: View, steps: int) -> None:
    """Zoom in by so many steps, or out by negative ones."""
    view.scale = min(max(view.scale * ZOOM**-steps, MIN_SCALE), MAX_SCALE)


def show_whole_map(view: View, scene: WatchedScene, width: int, height: int) -> None:
    """Show all of the map, or of the trail where there is no map.

    Args:
        view: changed.
        width: columns of the terminal.
        height: rows of the terminal.
    """
    if scene.map is not None:
        west, south, east, north = scene.map.extent
    else:
        places = np.array([*scene.trail, scene.place])
        (west, south), (east, north) = places.min(axis=0).tolist(), places.max(axis=0).tolist()
    view.is_following = view.is_heading_up = False
    view.x, view.y = (west + east) / 2, (south + north) / 2
    wide = 1.05 * (east - west) / (max(width, 1) * DOTS_X)
    high = 1.05 * (north - south) / (max(height - NUM_LINES, 1) * DOTS_Y)
    view.scale = min(max(wide, high, MIN_SCALE), MAX_SCALE)


def pan(view: View, scene: WatchedScene, right: float, up: float) -> None:
    """Move the view by so many dots; it follows the ego no longer.

    Args:
        view: changed.
        scene: has the ego's heading.
        up: towards the top.
    """
    turn = scene.heading - math.pi / 2 if view.is_heading_up else 0.0
    view.x += view.scale * (right * math.cos(turn) - up * math.sin(turn))
    view.y += view.scale * (right * math.sin(turn) + up * math.cos(turn))
    view.is_following = False


def draw(
    scene: WatchedScene, view: View, size: tuple[int, int], *, now: float, title: str, has_keys: bool = True
) -> list[str]:
    """Return the rows of the picture.

    Args:
        scene: what is known.
        view: what is shown of it; its middle follows the ego.
        size: columns and rows of the terminal.
        title: text of the first row, such as the address of the server.
        has_keys: show the row about the keys.

    Returns:
        `height` rows of at most `width` columns.
    """
    width, height = size
    if view.is_following and scene.ego is not None:
        view.x, view.y = scene.place
    if width < MIN_WIDTH or height < MIN_HEIGHT:
        return [fit(_ego_text(scene), width), *[""] * (height - 1)][:height]
    canvas = Canvas(width, height - NUM_LINES)
    if scene.ego is None and scene.map is None:
        text = "waiting for /Ego_topic"
        canvas.text((width - len(text)) // 2, canvas.height // 2, text, Ink.STRONG)
    else:
        _draw_scene(canvas, scene, view)
    rows = canvas.rows(num_colours=view.num_colours, has_braille=view.has_unicode)
    last = _KEYS if has_keys else ""
    lines = (
        (_title_text(scene, title, width), Ink.BAR),
        *((row, None) for row in rows),
        (scene.problem or _ego_text(scene), Ink.WARNING if scene.problem else Ink.STRONG),
        (_place_text(scene), Ink.NONE),
        (_time_text(scene, now), Ink.NONE),
        (last, Ink.ROAD),
    )
    return [text if ink is None else _painted(text, ink, width, view) for text, ink in lines]


_KEYS: Final = " q quit  +- zoom  arrows move  f follow  h heading up  m whole map"


def _painted(text: str, ink: Ink, width: int, view: View) -> str:
    text = fit(safe(text), width)
    if not view.has_unicode:
        text = text.replace("°", " deg").encode("ascii", "replace").decode()[:width]
    if not view.num_colours or ink is Ink.NONE:
        return text
    filled = text + " " * (width - columns(text)) if ink is Ink.BAR else text
    return f"{paint(ink, view.num_colours)}{filled}\x1b[0m"


# Texts


def _title_text(scene: WatchedScene, title: str, width: int) -> str:
    left, right = f" rosbridge-sim watch  {title}", ""
    if scene.map is not None and scene.map.name:
        right = f"{scene.map.name} "
    return left + " " * max(2, width - columns(left) - columns(right)) + right


def _ego_text(scene: WatchedScene) -> str:
    if scene.ego is None:
        return " no /Ego_topic yet"
    ego = scene.ego
    steer = number_of(ego, "front_steer_angle")
    if "wheel_angle" in ego:
        steer = math.degrees(number_of(ego, "wheel_angle"))
    side = "left" if steer > 0.05 else "right" if steer < -0.05 else ""  # noqa: PLR2004 - it shows as 0.0
    parts = [
        f"ego {int(number_of(ego, 'unique_id'))}",
        f"{speed_of(ego):6.1f} km/h",
        f"steer {abs(steer):4.1f}° {side:5}",
    ]
    if scene.event is not None:
        parts.append(f"gear {GEARS.get(int(number_of(scene.event, 'gear')), '?')}")
        parts.append(MODES.get(int(number_of(scene.event, "ctrl_mode")), "?"))
    return f" {'  '.join(parts)}"


def _place_text(scene: WatchedScene) -> str:
    ego, (x, y) = scene.ego, scene.place
    if ego is None:
        return ""
    pedals = f"throttle {100 * number_of(ego, 'accel'):3.0f} %  brake {100 * number_of(ego, 'brake'):3.0f} %"
    return f" {pedals}  at {x:.1f}, {y:.1f}  heading {number_of(ego, 'heading') % 360.0:.0f}°"


def _time_text(scene: WatchedScene, now: float) -> str:
    parts = []
    if scene.sync is not None:
        parts.append(f"frame {int(number_of(scene.sync, 'frame')):,}")
        if scene.sync.get("status") is True:
            master = text_of(scene.sync, "master_id")
            parts.append(f"synchronous, master {master!r}" if master else "synchronous, no master")
    if scene.event is not None and scene.event.get("set_pause") is True:
        parts.append("paused")
    factor = scene.meter.factor(now)
    if factor is not None:
        parts.append(f"{factor:.2f} x real time")
    if scene.light_ahead is not None and now - scene.light_ahead_at <= LIGHT_SECONDS:
        parts.append(f"light ahead: {lamp_word(scene.light_ahead) or 'dark'}")
    parts.append(f"{len(scene.things):,} objects" if len(scene.things) != 1 else "1 object")
    return f" {'  '.join(parts)}"


# The scene


class _Lens:
    """The transformation from the map to the dots of a canvas."""

    def __init__(self, canvas: Canvas, scene: WatchedScene, view: View) -> None:
        turn = scene.heading - math.pi / 2 if view.is_heading_up else 0.0
        self._cos, self._sin = math.cos(turn), math.sin(turn)
        self._view = view
        self.middle = (canvas.width * DOTS_X / 2, canvas.height * DOTS_Y / 2)
        self.turn = turn

    def places(self, points: FloatArray) -> FloatArray:
        """Return (k, 2) points of the map [m] as dots."""
        x, y = points[:, 0] - self._view.x, points[:, 1] - self._view.y
        right, up = x * self._cos + y * self._sin, y * self._cos - x * self._sin
        scale = self._view.scale
        return np.stack([self.middle[0] + right / scale, self.middle[1] - up / scale], axis=-1)

    def lines(self, ends: FloatArray) -> FloatArray:
        """Return (k, 4) ends of lines [m] as dots."""
        return np.concatenate([self.places(ends[:, :2]), self.places(ends[:, 2:])], axis=1)

    def cell(self, x: float, y: float) -> tuple[int, int]:
        """Return column and row of a point [m]."""
        place = self.places(np.array([[x, y]]))[0]
        column, row = np.clip(place, -1e6, 1e6) / (DOTS_X, DOTS_Y)
        return math.floor(column), math.floor(row)


def _draw_scene(canvas: Canvas, scene: WatchedScene, view: View) -> None:
    lens = _Lens(canvas, scene, view)
    _draw_ground(canvas, scene, view, lens)
    if len(scene.trail) > 1:
        trail = np.array(scene.trail)
        canvas.lines(lens.lines(np.concatenate([trail[:-1], trail[1:]], axis=1)), Ink.TRAIL)
    for x, y, word in scene.lamps if view.scale <= LAMP_SCALE else ():
        canvas.text(*lens.cell(x, y), "●" if view.has_unicode else _LETTERS[word], _INK_OF_LAMP[word])
    for thing in scene.things:
        _draw_thing(canvas, lens, thing)
    if scene.ego is not None:
        _draw_ego(canvas, scene, view, lens)
    if view.scale <= LABEL_SCALE:
        _draw_labels(canvas, scene, view, lens)
    _draw_scale(canvas, view)


def _draw_ground(canvas: Canvas, scene: WatchedScene, view: View, lens: _Lens) -> None:
    if scene.map is None:
        _draw_grid(canvas, view, lens)
        return
    canvas.lines(lens.lines(scene.map.lanes if view.scale > FAR_SCALE else scene.map.edges), Ink.ROAD)
    if view.scale <= FAR_SCALE:
        canvas.lines(lens.lines(scene.map.crosswalks), Ink.WHITE)
        canvas.lines(lens.lines(scene.map.stop_lines), Ink.RED)


def _draw_grid(canvas: Canvas, view: View, lens: _Lens) -> None:
    """Draw a grid of dots, which shows motion where there is no map."""
    step = _round_length(12.0 * DOTS_X * view.scale)
    reach = math.hypot(canvas.width * DOTS_X, canvas.height * DOTS_Y) / 2 * view.scale
    x, y = (
        np.arange(math.floor((middle - reach) / step), math.ceil((middle + reach) / step) + 1) * step
        for middle in (view.x, view.y)
    )
    points = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    canvas.dots(np.floor(lens.places(points)).astype(np.int64), Ink.GRID)


def _corners(place: tuple[float, float], heading: float, size: tuple[float, float]) -> FloatArray:
    """Return the four corners of a box, (4, 2) [m]: front left first, counter-clockwise."""
    ahead = np.array([math.cos(heading), math.sin(heading)])
    across = np.array([-ahead[1], ahead[0]])
    signs = ((1, 1), (-1, 1), (-1, -1), (1, -1))
    return np.array([place + 0.5 * a * size[0] * ahead + 0.5 * b * size[1] * across for a, b in signs])


def _draw_thing(canvas: Canvas, lens: _Lens, thing: Thing) -> None:
    corners = _corners((thing.x, thing.y), thing.heading, (thing.length, thing.width))
    sides = np.concatenate([corners, np.roll(corners, -1, axis=0)], axis=1)
    canvas.lines(lens.lines(sides), _INK_OF[thing.kind])


def _draw_ego(canvas: Canvas, scene: WatchedScene, view: View, lens: _Lens) -> None:
    (x, y), heading = scene.place, scene.heading
    length, width, ahead = EGO_SIZE
    if length / view.scale < GLYPH_LENGTH:
        arrows = _ARROWS if view.has_unicode else _PLAIN_ARROWS
        sector = round((heading - lens.turn) / (math.pi / 4)) % len(arrows)
        canvas.text(*lens.cell(x, y), arrows[sector], Ink.EGO)
        return
    middle = (x + ahead * math.cos(heading), y + ahead * math.sin(heading))
    a, b, c, d = _corners(middle, heading, (length, width))
    num = math.ceil(length / view.scale) + 1  # one for each dot fills the box
    nose = (a + d) / 2 + (a - b) * 0.35
    rungs = [np.concatenate([a + t * (b - a), d + t * (c - d)]) for t in np.linspace(0.0, 1.0, num)]
    tip = [np.concatenate([a, nose]), np.concatenate([d, nose])]
    canvas.lines(lens.lines(np.array([*rungs, *tip])), Ink.EGO)


def _draw_labels(canvas: Canvas, scene: WatchedScene, view: View, lens: _Lens) -> None:
    near = sorted(scene.things, key=lambda thing: math.hypot(thing.x - view.x, thing.y - view.y))[:MAX_LABELS]
    for thing in near:
        column, row = lens.cell(thing.x, thing.y)
        rise = math.ceil(0.5 * max(thing.length, thing.width) / view.scale / DOTS_Y)
        canvas.text(column, row - rise, _label(thing), _INK_OF[thing.kind])


def _label(thing: Thing) -> str:
    return str(thing.number) if thing.kind == "obstacle" else f"{thing.number} {thing.speed:.0f} km/h"


def _draw_scale(canvas: Canvas, view: View) -> None:
    """Draw a length with its figure in the top right corner."""
    length = _round_length(12.0 * DOTS_X * view.scale)
    num = max(2, round(length / view.scale / DOTS_X))
    bar, name = ("├" + "─" * (num - 2) + "┤", "N ↑") if view.has_unicode else ("|" + "-" * (num - 2) + "|", "N ^")
    text = f"{length / 1000:g} km" if length >= 1000.0 else f"{length:g} m"  # noqa: PLR2004 - a kilometre
    text = f"{text} {bar}" if view.is_heading_up else f"{name}  {text} {bar}"
    canvas.text(canvas.width - len(text) - 1, 0, text, Ink.NONE)


def _round_length(about: float) -> float:
    """Return the next length with the single digit 1, 2 or 5 that is not longer [m]."""
    power = 10.0 ** math.floor(math.log10(about))
    return next(digit * power for digit in (5.0, 2.0, 1.0) if digit * power <= about * (1.0 + 1e-9))
