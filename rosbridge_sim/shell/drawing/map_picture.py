"""A map as a picture: lanes by their kind, edges, stop lines, lights and crosswalks, with a scale and a north arrow.

The entities of a scenario are drawn as boxes with a mark at the front, and with the path that they follow.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Sequence
from importlib.resources import files
from io import BytesIO
from pathlib import Path
from typing import Final

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from rosbridge_sim.errors import DocumentError, file_errors
from rosbridge_sim.maps.extent import find_bulk, find_far_lanes
from rosbridge_sim.maps.road_map import RoadMap, stripes_of
from rosbridge_sim.records import Record
from rosbridge_sim.scenarios.scenario import Spawn
from rosbridge_sim.suggestions import listing
from rosbridge_sim.world.geometry.planar import BoolArray, FloatArray, outline_at
from rosbridge_sim.world.roads.roads import Roads
from rosbridge_sim.world.state.world import Kind

SIZE: Final = 2000
"""Length of the longer side [pixels]."""

FINE: Final = 2
"""The picture is drawn so many times larger and then reduced, which makes edges smooth."""

PICTURE_MARGIN: Final = 90
"""Margin around the map, with room for scale and legend [pixels]."""

MIN_WIDTH: Final = 900
"""Smallest width, so that a map that is long from south to north has room for its name beside the north arrow [pixels].
"""

LEGEND_LINE: Final = 26
"""Height of a line of the legend [pixels]."""

FORMATS: Final = {".png": "PNG", ".jpg": "JPEG", ".jpeg": "JPEG"}
"""Picture formats by the suffix of a file's name. Others, such as .gif, cannot show all the colours."""

QUALITY: Final = 92
"""Quality of a JPEG, of 100: no visible shadows around thin lines."""

NARROW: Final = 3.0
"""Lanes thinner than this are drawn without edges [pixels]."""

NEAR: Final = 500.0
"""Entities farther from all roads are left out [m], so that a mistake in a scenario does not shrink the map to a dot.
"""

_COLOURS: Final = json.loads((files("rosbridge_sim") / "page" / "colours.json").read_text(encoding="utf-8"))
"""The table of colours that the web page uses, too, so that both show the same map."""

_MAP: Final[dict[str, str]] = _COLOURS["map"]

PAPER: Final = _MAP["paper"]
INK: Final = _MAP["ink"]
LANE: Final = _MAP["lane"]
INSIDE: Final = _MAP["inside"]  # lanes within an intersection
DEAD_END: Final = _MAP["deadEnd"]
EDGE_COLOUR: Final = _MAP["edge"]
ARROW: Final = _MAP["arrow"]
STOP: Final = _MAP["stop"]
STRIPES: Final = _MAP["stripes"]
CAR_LIGHT: Final = _MAP["carLight"]
WALK_LIGHT: Final = _MAP["walkLight"]
WARNING_LIGHT: Final = _MAP["warningLight"]
AGENTS: Final[dict[Kind, tuple[str, str]]] = {
    kind: (_COLOURS["kinds"][kind.name.lower()], kind.name.lower())
    for kind in (Kind.EGO, Kind.VEHICLE, Kind.PEDESTRIAN, Kind.OBSTACLE)
}

Points = list[tuple[float, float]]
"""Positions on the picture [pixels]."""


_Kinds = np.ndarray[tuple[int], np.dtype[np.str_]]
"""(l,) colour of each lane."""


class _View(Record):
    """The transformation from the map to the picture; north is up."""

    west: float
    north: float
    scale: float  # [pixels/m]
    left: float = PICTURE_MARGIN * FINE  # margins [pixels]
    top: float = PICTURE_MARGIN * FINE

    def place(self, points: FloatArray) -> Points:
        """Return the positions on the picture of (k, 2) or (k, 3) points of the map [m]."""
        x = self.left + (points[:, 0] - self.west) * self.scale
        y = self.top + (self.north - points[:, 1]) * self.scale
        return list(zip(x.tolist(), y.tolist(), strict=True))


def draw_map(road_map: RoadMap, path: Path, agents: Sequence[Spawn] = ()) -> str:
    """Write a picture of a map. The suffix of the file's name selects the format: `.png`, `.jpg` or `.jpeg`.

    Args:
        agents: entities to draw; each must have a position.

    Returns:
        What it leaves out because it lies far from the rest, for the user; empty for nothing. The picture says so, too.

    Raises:
        DocumentError: it cannot be written.
    """
    form = FORMATS.get(path.suffix.lower())
    if form is None:
        raise DocumentError(f"--picture: expected a file such as MAP.png or MAP.jpg; got {str(path)!r}")
    agents = [agent for agent in agents if agent.is_placed]
    image = _draw(road_map, agents)
    with file_errors(path, "written"):
        image.save(path, form, quality=QUALITY)  # PNG ignores the quality
    left_out = [name for names in _left_out(road_map.roads, agents) for name in names]
    return f"{path} leaves out what lies far from the rest: {listing(left_out)}" if left_out else ""


def draw_thumbnail(road_map: RoadMap, width: int, height: int, agents: Sequence[Spawn] = ()) -> bytes:
    """Return a small picture of a map as a PNG file, without legend and scale; north is up.

    Args:
        width: [pixels].
        height: [pixels].
    """
    agents = [agent for agent in agents if agent.is_placed]
    low, high = _extent(road_map.roads, agents)
    room = FINE * np.array([width, height])
    size = high - low
    scale = float((room / np.maximum(size, 1.0)).min())
    left, top = (0.5 * (room - scale * size)).tolist()
    view = _View(float(low[0]), float(high[1]), scale, left, top)
    image = Image.new("RGB", (width * FINE, height * FINE), PAPER)
    pen = ImageDraw.Draw(image)
    _draw_ground(pen, view, road_map, _kinds(road_map))
    _draw_agents(pen, view, agents)
    out = BytesIO()
    image.reduce(FINE).save(out, "PNG")
    return out.getvalue()


def _draw(road_map: RoadMap, agents: Sequence[Spawn]) -> Image.Image:
    low, high = _extent(road_map.roads, agents)
    scale = FINE * (SIZE - 2 * PICTURE_MARGIN) / float((high - low).max())
    view = _View(float(low[0]), float(high[1]), scale)
    width, height = (round(length) + 2 * PICTURE_MARGIN * FINE for length in ((high - low) * scale).tolist())
    width = max(width, MIN_WIDTH * FINE)
    kinds = _kinds(road_map)
    legend = list(_legend(road_map, set(kinds.tolist()), agents))
    places = _lay_legend(legend, width, _legend_start(view))
    # The lower margin has room for two lines; the picture grows for more.
    num_lines = 1 + max((line for _, line in places), default=0)
    image = Image.new("RGB", (width, height + max(0, num_lines - 2) * LEGEND_LINE * FINE), PAPER)
    pen = ImageDraw.Draw(image)
    _draw_ground(pen, view, road_map, kinds)
    _draw_agents(pen, view, agents)
    _draw_frame(pen, image.size, road_map)
    _draw_left_out(pen, road_map.roads, agents)
    top = height - 60 * FINE if num_lines > 1 else height - 34 * FINE
    _draw_scale(pen, view, top)
    _draw_legend(pen, legend, places, top)
    return image.reduce(FINE)


def _draw_ground(pen: ImageDraw.ImageDraw, view: _View, road_map: RoadMap, kinds: _Kinds) -> None:
    roads = road_map.roads
    for kind in (LANE, INSIDE, DEAD_END):
        for lane in np.flatnonzero(kinds == kind).tolist():
            _draw_lane(pen, view, roads, lane, kind)
    for lane in range(len(roads)):
        if kinds[lane] != INSIDE:  # inside an intersection edges would cross everything
            _draw_edges(pen, view, roads, lane)
    for crosswalk in road_map.crosswalks:
        for outline in crosswalk.outlines:
            _draw_stripes(pen, view, outline)
    for lane in range(len(roads)):
        _draw_arrows(pen, view, roads, lane, is_inside=bool(kinds[lane] == INSIDE))
    for lane in np.flatnonzero(roads.is_stop).tolist():
        _draw_stop_line(pen, view, roads, lane)
    _draw_lights(pen, view, road_map)


def _extent(roads: Roads, agents: Sequence[Spawn]) -> tuple[FloatArray, FloatArray]:
    """Return the south-west and the north-east corner of the picture: the bulk of the roads, and what is near [m]."""
    points, places = _shown(roads, agents)
    places = np.concatenate([points, places[_are_shown(points, places)]])
    if not len(places):
        places = np.zeros((1, 2))
    return places.min(axis=0) - 10.0, places.max(axis=0) + 10.0


def _shown(roads: Roads, agents: Sequence[Spawn]) -> tuple[FloatArray, FloatArray]:
    """Return the points of the roads that are shown, (k, 2), and the places of all entities, (a, 2) [m]."""
    is_shown = ~find_far_lanes(roads)[roads.lane_of_point]
    places = np.array([(agent.x, agent.y) for agent in agents]).reshape(-1, 2)
    return roads.points[is_shown, :2], places


def _are_shown(points: FloatArray, places: FloatArray) -> BoolArray:
    """Return which entities are shown: those near the roads, or the bulk of them where there are no roads."""
    if not len(points):
        return find_bulk(places, places, np.ones(len(places)))
    return np.asarray(((places >= points.min(axis=0) - NEAR) & (places <= points.max(axis=0) + NEAR)).all(axis=1))


def _left_out(roads: Roads, agents: Sequence[Spawn]) -> tuple[list[str], list[str]]:
    """Return the lanes and the entities that lie too far away to be shown: ids, and places in the document."""
    lanes = [f"lane {roads.ids[lane]}" for lane in np.flatnonzero(find_far_lanes(roads)).tolist()]
    is_shown = _are_shown(*_shown(roads, agents)).tolist()
    return lanes, [agent.where or agent.name for agent, is_in in zip(agents, is_shown, strict=True) if not is_in]


def _kinds(road_map: RoadMap) -> _Kinds:
    """Return the kind of each lane: ordinary, inside an intersection, or dead end."""
    kinds = np.where(road_map.find_inside(), INSIDE, LANE).astype("<U7")
    kinds[np.diff(road_map.roads.first_successor) == 0] = DEAD_END
    return kinds


# Roads


def _line_of(roads: Roads, lane: int) -> FloatArray:
    return roads.points[roads.first[lane] : roads.first[lane + 1]]


def _sides(roads: Roads, lane: int) -> tuple[FloatArray, FloatArray]:
    """Return the left and the right edge of a lane, (k, 2) each [m]."""
    rows, (left, right, _) = slice(roads.first[lane], roads.first[lane + 1]), roads.derived(Roads.edge_lines)
    return left[rows, :2], right[rows, :2]


def _draw_lane(pen: ImageDraw.ImageDraw, view: _View, roads: Roads, lane: int, colour: str) -> None:
    left, right = _sides(roads, lane)
    pen.polygon(view.place(np.concatenate([left, right[::-1]])), fill=colour)
    # On a large map a lane is thinner than a pixel.
    pen.line(view.place(_line_of(roads, lane)), fill=colour, width=FINE)


def _draw_edges(pen: ImageDraw.ImageDraw, view: _View, roads: Roads, lane: int) -> None:
    is_wide = float(roads.width[lane]) * view.scale >= NARROW * FINE
    for side in _sides(roads, lane) if is_wide else ():
        pen.line(view.place(side), fill=EDGE_COLOUR, width=max(1, round(0.15 * view.scale)))


def _draw_stripes(pen: ImageDraw.ImageDraw, view: _View, outline: FloatArray) -> None:
    """Draw a crosswalk: its outline, and stripes along the driving direction if it has four corners."""
    corners = outline[:, :2]
    pen.polygon(view.place(corners), outline=STRIPES, width=FINE)
    stripes = stripes_of(corners, begin=0.15)
    for stripe in () if stripes is None else stripes:
        pen.polygon(view.place(stripe), fill=STRIPES)


def _draw_arrows(pen: ImageDraw.ImageDraw, view: _View, roads: Roads, lane: int, *, is_inside: bool) -> None:
    """Draw the direction of a lane: an arrow in its middle, and more along a long lane.

    If lanes are thin on the picture, one arrow stands for several parallel lanes. Inside an intersection there are few,
    because they would hide it.
    """
    length, width = float(roads.length[lane]), float(roads.width[lane])
    is_thin = width * view.scale < 3.0 * NARROW * FINE
    if is_thin and (is_inside or roads.right[lane] >= 0):
        return
    size = min(9.0 * FINE / view.scale if is_thin else 0.5 * width, 12.0, 0.4 * length)
    apart = max(60.0, 90.0 * FINE / view.scale)
    num = max(1, int(length / apart))
    # Before the middle, so that the arrows of two opposite lanes do not overlap.
    points, yaws = roads.at([lane] * num, [(i + 0.42) * length / num for i in range(num)])
    for point, yaw in zip(points, yaws.tolist(), strict=True):
        pen.polygon(view.place(_shape(point, yaw, size, _ARROW)), fill=ARROW)


_ARROW: Final = ((-0.5, 0.3), (0.5, 0.0), (-0.5, -0.3))
_LIGHT: Final = ((-0.3, 0.5), (0.7, 0.0), (-0.3, -0.5))


def _shape(point: FloatArray, yaw: float, size: float, outline: Sequence[tuple[float, float]]) -> FloatArray:
    """Return an outline, (k, 2), turned by `yaw` and moved to a point of the map [m]."""
    return np.array(outline_at((point.item(0), point.item(1), yaw), [(size * x, size * y) for x, y in outline]))


def _draw_stop_line(pen: ImageDraw.ImageDraw, view: _View, roads: Roads, lane: int) -> None:
    left, right = _sides(roads, lane)
    ends = np.array([left[-1], right[-1]])
    pen.line(view.place(ends), fill=STOP, width=max(FINE * 2, round(0.6 * view.scale)))


def _draw_lights(pen: ImageDraw.ImageDraw, view: _View, road_map: RoadMap) -> None:
    """Draw each light with its direction, and a line to the lanes that it controls."""
    size = min(max(1.6, 8.0 * FINE / view.scale), 6.0)  # visible, but does not hide the crossing
    roads = road_map.roads
    for light in road_map.plan.lights:
        colour = WALK_LIGHT if light.is_pedestrian else WARNING_LIGHT if light.is_warning else CAR_LIGHT
        at = np.array([light.x, light.y])
        starts = {tuple(_line_of(roads, lane)[0, :2].tolist()) for lane in light.lanes}
        for start in sorted(starts):
            pen.line(view.place(np.array([at, start])), fill=colour, width=max(1, FINE // 2))
        pen.polygon(view.place(_shape(at, light.yaw, size, _LIGHT)), fill=colour, outline=INK)


# Entities


def _draw_agents(pen: ImageDraw.ImageDraw, view: _View, agents: Sequence[Spawn]) -> None:
    """Draw all ways below all entities."""
    for agent in agents:
        _draw_path(pen, view, agent)
    for agent in agents:
        _draw_agent(pen, view, agent)


def _draw_path(pen: ImageDraw.ImageDraw, view: _View, agent: Spawn) -> None:
    if agent.path is not None:
        line = agent.path[:, :2]
        line = np.concatenate([line, line[:1]]) if agent.is_loop else line
        pen.line(view.place(line), fill=AGENTS[agent.kind][0], width=FINE)


def _draw_agent(pen: ImageDraw.ImageDraw, view: _View, agent: Spawn) -> None:
    body = agent.model.body
    # Drawn larger than its true size if it would be too small to see.
    size = max(1.0, 5.0 * FINE / (view.scale * max(body.length, body.width)))
    tail, nose, side = -body.rear_overhang, body.length - body.rear_overhang, 0.5 * body.width
    tip = max(tail, nose - side)
    outline = ((tail, -side), (tail, side), (tip, side), (nose, 0.0), (tip, -side))
    shape = _shape(np.array([agent.x, agent.y]), agent.yaw, size, outline)
    pen.polygon(view.place(shape), fill=AGENTS[agent.kind][0], outline=INK)


# Frame and legend


def _draw_frame(pen: ImageDraw.ImageDraw, size: tuple[int, int], road_map: RoadMap) -> None:
    """Draw the map's name at the top, and the north arrow at the top right."""
    font, large = ImageFont.load_default(17 * FINE), ImageFont.load_default(26 * FINE)
    roads = road_map.roads
    pen.text((PICTURE_MARGIN * FINE // 2, 20 * FINE), road_map.name, fill=INK, font=large)
    name_width = pen.textlength(road_map.name, font=large)
    figures = f"{len(roads):,} lanes, {roads.length.sum() / 1000.0:.1f} km"
    pen.text((PICTURE_MARGIN * FINE // 2 + name_width + 20 * FINE, 28 * FINE), figures, fill=INK, font=font)
    x, y = float(size[0] - PICTURE_MARGIN * FINE // 2), 16.0 * FINE
    pen.polygon([(x, y), (x - 11 * FINE, y + 34 * FINE), (x, y + 26 * FINE), (x + 11 * FINE, y + 34 * FINE)], fill=INK)
    pen.text((x, y + 38 * FINE), "N", fill=INK, font=font, anchor="ma")


def _draw_left_out(pen: ImageDraw.ImageDraw, roads: Roads, agents: Sequence[Spawn]) -> None:
    """Write below the name how much lies too far away to be shown."""
    lanes, entities = _left_out(roads, agents)
    parts = [
        f"{len(names):,} of {num:,} {what}"
        for names, num, what in ((lanes, len(roads), "lanes"), (entities, len(agents), "objects"))
        if names
    ]
    if parts:
        text = f"not shown, far away: {', '.join(parts)}"
        pen.text((PICTURE_MARGIN * FINE // 2, 56 * FINE), text, fill=STOP, font=_legend_font())


def _scale_text(view: _View) -> tuple[float, str]:
    """Return the length of the scale [pixels] and its label."""
    metres = _round_length(180.0 * FINE / view.scale)
    text = f"{metres / 1000:g} km" if metres >= 1000 else f"{metres:g} m"  # noqa: PLR2004 - a kilometre
    return metres * view.scale, text


def _draw_scale(pen: ImageDraw.ImageDraw, view: _View, y: float) -> None:
    x = PICTURE_MARGIN * FINE / 2
    length, text = _scale_text(view)
    pen.rectangle((x, y, x + length, y + 7 * FINE), fill=PAPER, outline=INK, width=FINE)
    pen.rectangle((x, y, x + length / 2, y + 7 * FINE), fill=INK)
    pen.text((x + length + 8 * FINE, y + 4 * FINE), text, fill=INK, font=_legend_font(), anchor="lm")


def _legend_font() -> ImageFont.FreeTypeFont | ImageFont.ImageFont:
    return ImageFont.load_default(17 * FINE)


def _legend_start(view: _View) -> float:
    """Return the left edge of the legend, beside the scale [pixels]."""
    length, text = _scale_text(view)
    return PICTURE_MARGIN * FINE / 2 + length + 30 * FINE + _legend_font().getlength(text)


def _lay_legend(legend: Sequence[tuple[str, str]], width: int, start: float) -> list[tuple[float, int]]:
    """Return the start [pixels] and the line of each entry; an entry that does not fit goes to the next line."""
    font = _legend_font()
    places = []
    x, line = start, 0
    for _, what in legend:
        size = 40 * FINE + font.getlength(what)
        if x + size > width - PICTURE_MARGIN * FINE / 2 and x > PICTURE_MARGIN * FINE / 2:
            x, line = PICTURE_MARGIN * FINE / 2, line + 1
        places.append((x, line))
        x += size
    return places


def _draw_legend(
    pen: ImageDraw.ImageDraw, legend: Sequence[tuple[str, str]], places: Sequence[tuple[float, int]], top: float
) -> None:
    """Draw the legend with the meaning of each colour."""
    for (colour, what), (x, line) in zip(legend, places, strict=True):
        y = top + line * LEGEND_LINE * FINE
        pen.rectangle((x, y - 4 * FINE, x + 16 * FINE, y + 12 * FINE), fill=colour, outline=INK)
        pen.text((x + 22 * FINE, y + 4 * FINE), what, fill=INK, font=_legend_font(), anchor="lm")


def _round_length(about: float) -> float:
    """Return the next length with the single digit 1, 2 or 5 that is not longer [m]."""
    power = 10.0 ** math.floor(math.log10(about))
    return next(digit * power for digit in (5.0, 2.0, 1.0) if digit * power <= about * (1.0 + 1e-9))


def _legend(road_map: RoadMap, kinds: set[str], agents: Sequence[Spawn]) -> Iterator[tuple[str, str]]:
    names = {LANE: "lane", INSIDE: "within an intersection", DEAD_END: "dead end"}
    yield from ((colour, name) for colour, name in names.items() if colour in kinds)
    if road_map.roads.is_stop.any():
        yield STOP, "stop line"
    if road_map.crosswalks:
        yield STRIPES, "crosswalk"
    lights = road_map.plan.lights
    if any(not light.is_pedestrian and not light.is_warning for light in lights):
        yield CAR_LIGHT, "light"
    if any(light.is_pedestrian for light in lights):
        yield WALK_LIGHT, "light for people"
    if any(light.is_warning for light in lights):
        yield WARNING_LIGHT, "yellow light"
    drawn = {agent.kind for agent in agents}
    yield from (look for kind, look in AGENTS.items() if kind in drawn)
