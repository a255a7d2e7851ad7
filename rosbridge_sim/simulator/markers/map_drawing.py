"""All that a drawing of a map needs, as messages: in pages for `/sim/map`, and as one JSON text for `/map.json`.

A page is made when it is asked for, since the messages of a whole city would take more memory than its arrays. It has
a bounded number of points, so making and writing it takes a few milliseconds. The JSON text is written piece by piece,
one lane after the other, so a thread that does it never holds the interpreter for long.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Callable, Iterator
from hashlib import blake2b
from itertools import accumulate
from typing import Any, Final

import numpy as np

from rosbridge_sim.loose_types import Struct
from rosbridge_sim.maps.road_map import Border, Crosswalk, RoadMap
from rosbridge_sim.schema.store import Store
from rosbridge_sim.world.geometry.planar import FloatArray
from rosbridge_sim.world.roads.roads import Roads
from rosbridge_sim.world.roads.signal_plan import Controller, Light, SignalPlan
from rosbridge_sim.world.state.world import DT

PAGE_POINTS: Final = 5_000
"""Points of lines in a page, five numbers each: about 200 kB of JSON, made and written in some 5 ms.

A thing without a line counts as `PLAIN_COST` of them.
"""

PLAIN_COST: Final = 10
"""Points that a light, a stop line or a controller's phase counts as: it is as long in JSON."""

MAX_LINE_POINTS: Final = 5_000
"""Points of one line at most; of more each second, third, ... is given, and the last: a drawing shows no difference."""

DIGITS: Final = 3
"""Decimals of lengths: 1 mm, a third of the text."""

_LISTS: Final = {
    "lanes": "MapLane",
    "borders": "MapBorder",
    "stop_lines": "MapStopLine",
    "crosswalks": "MapCrosswalk",
    "lights": "MapLight",
    "controllers": "MapController",
}
"""Field of the response -> its type, in the order of the pages."""

_PARTS: Final = ("MapArea", "MapPhase", "MapWalk")
"""Types of parts of these."""


class MapDrawing:
    """The drawing of one map.

    Attributes:
        digest: 32 hexadecimal digits that stand for all of it.
        num_pages: 1 or more.
    """

    def __init__(self, store: Store, road_map: RoadMap, page_points: int = PAGE_POINTS) -> None:
        """Divide a map into pages; nothing is drawn yet.

        Args:
            road_map: never changed.
            page_points: see `PAGE_POINTS`.
        """
        self._map = road_map
        self._plan = plan = road_map.plan
        self._stops = np.flatnonzero(road_map.roads.is_stop).tolist()
        self._groups = _groups_of(plan)
        # All types are looked up here: `write_json` runs in a thread, and the store may make a type when it is asked.
        self._response = store.service("rosbridge_sim_msgs/Map").response
        self._types = {name: store.message(f"rosbridge_sim_msgs/{name}") for name in (*_LISTS.values(), *_PARTS)}
        self._makers: dict[str, tuple[int, Callable[[int], Struct]]] = {
            "lanes": (len(road_map.roads), self._lane),
            "borders": (len(road_map.borders), lambda i: self._border(road_map.borders[i])),
            "stop_lines": (len(self._stops), lambda i: self._stop_line(self._stops[i])),
            "crosswalks": (len(road_map.crosswalks), lambda i: self._crosswalk(road_map.crosswalks[i])),
            "lights": (len(plan.lights), lambda i: self._light(plan.lights[i], i)),
            "controllers": (len(plan.controllers), lambda i: self._controller(plan.controllers[i])),
        }
        self._starts = self._divide(page_points)
        self.num_pages = len(self._starts) - 1
        self.digest = self._hash()

    def page(self, number: int) -> dict[str, Any]:
        """Return the fields of the response for a page.

        Args:
            number: 0 to `num_pages` - 1.
        """
        fields: dict[str, Any] = {**self._head(number, self.num_pages), **{field: [] for field in _LISTS}}
        first, end = self._starts[number], self._starts[number + 1]
        for field, i in self._items(first, end):
            fields[field].append(self._makers[field][1](i))
        return fields

    def write_json(self) -> Iterator[bytes]:
        """Yield the whole map as one JSON text, piece by piece: the values of the service, as if it had one page."""
        response = self._response
        head = response.encode_json(response.struct_type(**self._head(0, 1)))
        # The lists come last in the definition, and are empty here.
        empty = b",".join(b'"%s":[]' % field.encode() for field in _LISTS)
        assert head.endswith(empty + b"}"), "the definition ends with the lists"
        yield head.removesuffix(empty + b"}")
        for k, field in enumerate(_LISTS):
            yield (b"," if k else b"") + b'"%s":[' % field.encode()
            num, make = self._makers[field]
            encode = self._types[_LISTS[field]].encode_json
            for i in range(num):
                yield (b"," if i else b"") + encode(make(i))
            yield b"]"
        yield b"}"

    # Pages

    def _items(self, first: int, end: int) -> Iterator[tuple[str, int]]:
        """Yield list and index of the things from `first` to `end`, counted through all lists."""
        base = 0
        for field, (num, _) in self._makers.items():
            for i in range(max(first - base, 0), min(end - base, num)):
                yield field, i
            base += num

    def _divide(self, page_points: int) -> list[int]:
        """Return the first thing of each page, and their count at the end."""
        roads = self._map.roads
        costs = np.minimum(np.diff(roads.first), MAX_LINE_POINTS).tolist()
        costs += [min(len(border.line), MAX_LINE_POINTS) for border in self._map.borders]
        costs += [PLAIN_COST] * len(self._stops)
        costs += [PLAIN_COST + sum(map(len, each.outlines)) for each in self._map.crosswalks]
        costs += [PLAIN_COST] * len(self._plan.lights)
        costs += [PLAIN_COST * (1 + len(each.phases)) for each in self._plan.controllers]
        ends = list(accumulate(costs))
        starts = [0]
        while starts[-1] < len(ends):
            first = starts[-1]
            done = ends[first - 1] if first else 0
            starts.append(max(first + 1, bisect_right(ends, done + page_points)))
        return starts if len(starts) > 1 else [0, 0]

    def _head(self, number: int, num_pages: int) -> dict[str, Any]:
        points = self._map.roads.points
        low, high = (points.min(axis=0), points.max(axis=0)) if len(points) else (np.zeros(3), np.zeros(3))
        west, south, east, north = (round(float(value), DIGITS) for value in (*low[:2], *high[:2]))
        return {
            "result": True,
            "message": "",
            "name": self._map.name,
            "digest": self.digest,
            "page": number,
            "num_pages": num_pages,
            "west": west,
            "south": south,
            "east": east,
            "north": north,
        }

    def _hash(self) -> str:
        state = blake2b(digest_size=16)
        state.update(repr((self._map.name, self._starts)).encode())
        state.update(self._map.roads.digest + self._plan.digest)
        for light in self._plan.lights:
            state.update(repr((light.name, light.x, light.y, light.z, light.yaw)).encode())
        for border in self._map.borders:
            state.update(repr((border.name, border.type, border.shape, border.colour)).encode() + border.line.tobytes())
        for crosswalk in self._map.crosswalks:
            state.update(repr((crosswalk.name, crosswalk.lights)).encode())
            for outline in crosswalk.outlines:
                state.update(outline.tobytes())
        return state.hexdigest()

    # Things

    def _make(self, type_name: str, /, **fields: object) -> Struct:
        return self._types[type_name].struct_type(**fields)

    def _lane(self, lane: int) -> Struct:
        roads, plan = self._map.roads, self._plan
        rows = _thin(int(roads.first[lane]), int(roads.first[lane + 1]))
        left, right = roads.border[rows].T.round(DIGITS).tolist()
        light = int(plan.light_of_lane[lane])
        return self._make(
            "MapLane",
            link=roads.ids[lane],
            **_columns(roads.points[rows]),
            left=left,
            right=right,
            length=round(float(roads.length[lane]), DIGITS),
            width=round(float(roads.width[lane]), DIGITS),
            speed_limit=float(roads.speed_limit[lane]),
            successors=[roads.ids[row] for row in roads.successors(lane).tolist()],
            left_link=_name_of(roads, int(roads.left[lane])),
            right_link=_name_of(roads, int(roads.right[lane])),
            light=plan.lights[light].name if light >= 0 else "",
        )

    def _border(self, border: Border) -> Struct:
        line = border.line[_thin(0, len(border.line))]
        return self._make(
            "MapBorder",
            name=border.name,
            **_columns(line),
            type=border.type,
            shape=list(border.shape),
            colour=list(border.colour),
        )

    def _stop_line(self, lane: int) -> Struct:
        roads = self._map.roads
        last = int(roads.first[lane + 1]) - 1
        end, (left, right) = roads.points[last], roads.border[last].tolist()
        _, yaw = roads.at(lane, roads.length[lane])
        across = np.array([-math.sin(float(yaw[0])), math.cos(float(yaw[0])), 0.0])
        return self._make(
            "MapStopLine", link=roads.ids[lane], **_columns(np.stack([end + left * across, end - right * across]))
        )

    def _crosswalk(self, crosswalk: Crosswalk) -> Struct:
        parts = [self._make("MapArea", **_columns(outline)) for outline in crosswalk.outlines]
        lights = [self._plan.lights[row].name for row in crosswalk.lights]
        return self._make("MapCrosswalk", name=crosswalk.name, parts=parts, lights=lights)

    def _light(self, light: Light, row: int) -> Struct:
        controller, group = self._groups.get(row, ("", -1))
        return self._make(
            "MapLight",
            name=light.name,
            **{axis: round(getattr(light, axis), DIGITS) for axis in "xyz"},
            heading_deg=round(math.degrees(light.yaw), DIGITS),
            lamps=int(light.lamps),
            is_pedestrian=light.is_pedestrian,
            is_warning=light.is_warning,
            links=[self._map.roads.ids[lane] for lane in light.lanes],
            controller=controller,
            group=group,
        )

    def _controller(self, controller: Controller) -> Struct:
        row = self._plan.controllers.index(controller)
        phases = [
            self._make("MapPhase", duration=_seconds(phase.duration), lamps=[int(lamps) for lamps in phase.colours])
            for phase in controller.phases
        ]
        walks = [
            self._make(
                "MapWalk",
                phase=walk.phase,
                group=walk.group,
                before=_seconds(walk.before),
                green=_seconds(walk.green),
                flashing=_seconds(walk.flashing),
            )
            for walk in controller.walks
        ]
        return self._make(
            "MapController",
            name=controller.name,
            number=controller.number,
            cycle=_seconds(int(self._plan.cycle[row])) if controller.phases else 0.0,
            phases=phases,
            yellow=[_seconds(frames) for frames in controller.yellow],
            walks=walks,
        )


def _groups_of(plan: SignalPlan) -> dict[int, tuple[str, int]]:
    """Return row of a light -> name of the first controller that names it, and the number of its group there."""
    groups: dict[int, tuple[str, int]] = {}
    for controller in plan.controllers:
        for number, rows in enumerate(controller.groups):
            for row in rows:
                groups.setdefault(row, (controller.name, number))
    return groups


def _thin(first: int, end: int) -> slice | list[int]:
    """Return MAX_LINE_POINTS rows at most, from `first` to before `end`: the first and the last are among them."""
    num = end - first
    if num <= MAX_LINE_POINTS:
        return slice(first, end)
    stride = -(-(num - 1) // (MAX_LINE_POINTS - 1))
    return [*range(first, end - 1, stride), end - 1]


def _columns(points: FloatArray) -> dict[str, list[float]]:
    """Return x, y and z of (k, 3) points, rounded."""
    x, y, z = points.T.round(DIGITS).tolist()
    return {"x": x, "y": y, "z": z}


def _name_of(roads: Roads, lane: int) -> str:
    return roads.ids[lane] if lane >= 0 else ""


def _seconds(frames: int) -> float:
    return round(frames * DT, 2)
