"""State of the scene on the server that `watch` shows, as its last messages tell it.

Any rosbridge may send anything, so each value is checked where it is read, and a wrong one counts as missing.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np

from rosbridge_sim.client.frames import Frame
from rosbridge_sim.units import MPS_TO_KMH
from rosbridge_sim.world.geometry.planar import FloatArray
from rosbridge_sim.world.roads.signal_plan import GREENS, Lamp

__all__ = ["MapLines", "Thing", "TimeMeter", "WatchedScene", "lamp_word", "number_of"]

TRAIL: Final = 600
"""Places of the ego that are kept for its trail: a minute at 10 Hz."""

TRAIL_STEP: Final = 1.0
"""Distance between two places of the trail [m]: nearer ones are not seen apart."""

JUMP: Final = 50.0
"""The ego was placed elsewhere if it has moved this far between two messages [m]: 100 ms at 500 m/s."""

MAX_VALUE: Final = 1e9
"""Greatest amount of a coordinate [m]: no map is larger, and squares stay finite."""

MAX_THINGS: Final = 2_000
"""Objects that are drawn: more do not fit on a terminal."""

MIN_SPAN: Final = 1.0
"""Shortest time for a measurement [s]: no message for so long means a pause."""

METER_SPAN: Final = 3.0
"""Time over which the real-time factor is measured [s]: long enough for a steady figure, short enough to follow."""


def number_of(message: object, *path: str) -> float:
    """Return a number within a message; 0 for anything else."""
    for name in path:
        message = message.get(name) if isinstance(message, Mapping) else None
    if isinstance(message, bool) or not isinstance(message, (int, float)):
        return 0.0
    return float(message) if abs(message) <= MAX_VALUE else 0.0


def text_of(message: object, name: str) -> str:
    """Return a text within a message; empty for anything else."""
    value = message.get(name) if isinstance(message, Mapping) else None
    return value if isinstance(value, str) else ""


def list_of(message: object, name: str) -> list[Any]:
    """Return a list within a message; empty for anything else."""
    value = message.get(name) if isinstance(message, Mapping) else None
    return value if isinstance(value, list) else []


def stamp_of(message: object) -> float:
    """Return the stamp of a message in either generation's form [s]; 0 without one."""
    header = message.get("header") if isinstance(message, Mapping) else None
    seconds = number_of(header, "stamp", "secs") or number_of(header, "stamp", "sec")
    return seconds + 1e-9 * (number_of(header, "stamp", "nsecs") or number_of(header, "stamp", "nanosec"))


def lamp_word(status: int) -> str:
    """Return the colours of a light in words; empty for a light that shows nothing."""
    words = []
    if status > 0:
        words += ["red"] if status & Lamp.RED else []
        words += ["yellow"] if status & Lamp.YELLOW else []
        words += ["green"] if status & Lamp.GREEN else []
        words += ["arrow"] if status & (GREENS - Lamp.GREEN) else []
    return " and ".join(words)


@dataclass(frozen=True, slots=True)
class Thing:
    """An object.

    Attributes:
        number: its id.
        kind: `vehicle`, `pedestrian` or `obstacle`.
        x, y: its middle [m].
        heading: counter-clockwise from east [rad].
        length, width: [m].
        speed: [km/h].
    """

    number: int
    kind: str
    x: float
    y: float
    heading: float
    length: float
    width: float
    speed: float


@dataclass(slots=True)
class MapLines:
    """Lines of a map, (k, 4) each: x and y of both ends [m].

    Attributes:
        name, digest: of the map.
        lanes: middle lines.
        edges: edges of the lanes outside of intersections.
        stop_lines, crosswalks: as they say.
        extent: west, south, east and north [m].
    """

    name: str = ""
    digest: str = ""
    lanes: FloatArray = field(default_factory=lambda: np.empty((0, 4)))
    edges: FloatArray = field(default_factory=lambda: np.empty((0, 4)))
    stop_lines: FloatArray = field(default_factory=lambda: np.empty((0, 4)))
    crosswalks: FloatArray = field(default_factory=lambda: np.empty((0, 4)))
    extent: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)

    @classmethod
    def read(cls, pages: list[Frame]) -> MapLines:
        """Return the lines of the pages of `/sim/map`.

        Args:
            pages: one or more.
        """
        lanes = [lane for page in pages for lane in list_of(page, "lanes")]
        stops = [line for page in pages for line in list_of(page, "stop_lines")]
        behind_stop = {text_of(line, "link") for line in stops}
        inside = {
            after
            for lane in lanes
            if text_of(lane, "link") in behind_stop
            for after in map(str, list_of(lane, "successors"))
        }
        edges = []
        for lane in lanes:
            if text_of(lane, "link") not in inside:
                edges += _edges(lane)
        areas = [part for page in pages for walk in list_of(page, "crosswalks") for part in list_of(walk, "parts")]
        first = pages[0]
        west, south, east, north = (number_of(first, side) for side in ("west", "south", "east", "north"))
        return cls(
            text_of(first, "name"),
            text_of(first, "digest"),
            _join([_points(lane) for lane in lanes]),
            _join(edges),
            _join([_points(line) for line in stops]),
            _join([_closed(_points(area)) for area in areas]),
            (west, south, max(east, west), max(north, south)),
        )


def _points(line: object) -> FloatArray:
    """Return the points of a line, (k, 2) [m]; empty for anything else."""
    columns = [[number_of({"": value}, "") for value in list_of(line, axis)] for axis in "xy"]
    if len(columns[0]) != len(columns[1]):
        return np.empty((0, 2))
    return np.array(columns).T.reshape(-1, 2)


def _edges(lane: object) -> list[FloatArray]:
    points = _points(lane)
    sides = [[number_of({"": value}, "") for value in list_of(lane, side)] for side in ("left", "right")]
    if len(points) < 2 or any(len(side) != len(points) for side in sides):  # noqa: PLR2004 - a line has two points
        return []
    ahead = np.gradient(points, axis=0)
    ahead /= np.maximum(np.hypot(ahead[:, 0], ahead[:, 1]), 1e-9)[:, None]
    across = np.stack([-ahead[:, 1], ahead[:, 0]], axis=-1)
    return [points + np.array(sides[0])[:, None] * across, points - np.array(sides[1])[:, None] * across]


def _closed(points: FloatArray) -> FloatArray:
    return np.concatenate([points, points[:1]])


def _join(lines: list[FloatArray]) -> FloatArray:
    """Return all segments of polylines, (k, 4)."""
    segments = [np.concatenate([line[:-1], line[1:]], axis=1) for line in lines if len(line) > 1]
    return np.concatenate(segments) if segments else np.empty((0, 4))


class TimeMeter:
    """Measures how fast simulated time runs, from the stamps of messages."""

    def __init__(self) -> None:
        self._times: deque[tuple[float, float]] = deque()

    def add(self, now: float, stamp: float) -> None:
        """Take note of a message; times in [s]."""
        if self._times and stamp < self._times[-1][1]:  # the world was reset
            self._times.clear()
        self._times.append((now, stamp))
        while len(self._times) > 2 and now - self._times[0][0] > METER_SPAN:  # noqa: PLR2004 - a span has two ends
            self._times.popleft()

    def factor(self, now: float) -> float | None:
        """Return simulated seconds in a second; None while that is not known."""
        if not self._times or now - self._times[0][0] < MIN_SPAN:
            return None
        (start, first), (end, last) = self._times[0], self._times[-1]
        # While messages come, up to the last of them; in a pause, up to now.
        return (last - first) / (end - start if now - end < MIN_SPAN else now - start)


@dataclass(slots=True)
class WatchedScene:
    """Everything that is known.

    Attributes:
        ego: last `/Ego_topic`; None before the first one.
        things: objects around the ego.
        lamps: (k, 2) places of lit lamps [m], and the colour of each as a word.
        light_ahead: lamps of the light ahead of the ego; None for no light.
        light_ahead_at: time at which that was said [s].
        sync: last `/SyncModeInfo`; None before the first one.
        event: last state of the ego's gear and mode; None where the server does not say.
        map: lines of the map; None where the server has none.
        trail: places of the ego [m].
        meter: measures time.
        problem: why there is no connection; empty while there is one.
        has_jumped: the ego was placed elsewhere, or time began anew; the map may be another one.
    """

    ego: Frame | None = None
    things: tuple[Thing, ...] = ()
    lamps: tuple[tuple[float, float, str], ...] = ()
    light_ahead: int | None = None
    light_ahead_at: float = -math.inf
    sync: Frame | None = None
    event: Frame | None = None
    map: MapLines | None = None
    trail: deque[tuple[float, float]] = field(default_factory=lambda: deque(maxlen=TRAIL))
    meter: TimeMeter = field(default_factory=TimeMeter)
    problem: str = ""
    has_jumped: bool = False

    @property
    def place(self) -> tuple[float, float]:
        """East and north of the ego [m]."""
        return number_of(self.ego, "position", "x"), number_of(self.ego, "position", "y")

    @property
    def heading(self) -> float:
        """Heading of the ego, counter-clockwise from east [rad]."""
        return math.radians(number_of(self.ego, "heading"))

    def take_ego(self, message: Frame, now: float) -> None:
        """Take a message of `/Ego_topic`; `now` is monotonic [s]."""
        before = self.place if self.ego is not None else None
        if stamp_of(message) < stamp_of(self.ego):
            self.has_jumped = True
        self.ego = message
        self.meter.add(now, stamp_of(message))
        place = self.place
        if before is not None and math.dist(before, place) > JUMP:
            self.trail.clear()
            self.has_jumped = True
        if not self.trail or math.dist(self.trail[-1], place) >= TRAIL_STEP:
            self.trail.append(place)

    def take_objects(self, message: Frame) -> None:
        """Take a message of `/Object_topic`."""
        lists = (("vehicle", "npc_list"), ("pedestrian", "pedestrian_list"), ("obstacle", "obstacle_list"))
        found = [_thing(kind, one) for kind, name in lists for one in list_of(message, name)]
        self.things = tuple(found[:MAX_THINGS])

    def take_light(self, message: Frame, now: float) -> None:
        """Take a message of `/GetTrafficLightStatus`."""
        self.light_ahead, self.light_ahead_at = int(number_of(message, "trafficLightStatus")), now

    def take_markers(self, message: Frame) -> None:
        """Take the lights of a message of `/sim/scene/objects`."""
        for marker in list_of(message, "markers"):
            if text_of(marker, "ns") == "lights":
                pairs = zip(list_of(marker, "points"), list_of(marker, "colors"), strict=False)
                self.lamps = tuple(_lamps(pairs))

    def forget(self, problem: str) -> None:
        """Take note that the connection was lost; the last picture stays."""
        self.problem = problem
        self.meter = TimeMeter()


def _thing(kind: str, message: object) -> Thing:
    length, width = number_of(message, "size", "x"), number_of(message, "size", "y")
    # The order of length and width differs between servers; all bodies but pedestrians are longer than wide.
    speed = math.hypot(number_of(message, "velocity", "x"), number_of(message, "velocity", "y"))
    return Thing(
        int(number_of(message, "unique_id")),
        kind,
        number_of(message, "position", "x"),
        number_of(message, "position", "y"),
        math.radians(number_of(message, "heading")),
        min(max(length, width, 0.5), 100.0),
        min(max(min(length, width), 0.5), 100.0),
        speed,
    )


def _lamps(pairs: Iterator[tuple[object, object]]) -> Iterator[tuple[float, float, str]]:
    for point, colour in pairs:
        red, green, blue = (number_of(colour, channel) for channel in "rgb")
        word = "" if max(red, green, blue) < 0.5 else "red" if green < 0.5 else "yellow" if red > 0.5 else "green"  # noqa: PLR2004 - the middle
        yield number_of(point, "x"), number_of(point, "y"), word


def speed_of(ego: Frame | None) -> float:
    """Return the ego's speed [km/h], negative backwards."""
    return number_of(ego, "velocity", "x") * MPS_TO_KMH
