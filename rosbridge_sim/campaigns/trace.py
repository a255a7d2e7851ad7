"""The trace of a drive: figures of the ego in each frame, and the entities near it during the last seconds."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, Protocol

import numpy as np

from rosbridge_sim.campaigns.run_results import SCORES
from rosbridge_sim.campaigns.topic_values import TopicValues
from rosbridge_sim.errors import DocumentError
from rosbridge_sim.expressions import Expression, Following, Value
from rosbridge_sim.records import Record
from rosbridge_sim.world.state.world import DT, Kind, World

_COLUMNS: Final = {
    **{name: name for name in ("x", "y", "z", "yaw", "speed", "lateral_speed", "accel", "lateral_accel", "yaw_rate")},
    **{name: name for name in ("steer", "throttle", "brake")},
    "distance": "score_distance",
    "collisions": "num_collisions",
    "red_lights": "num_red_lights",
    "stop_lines": "num_stop_lines",
    "lane_invasions": "num_lane_invasions",
    "off_road": "off_road_frames",
    **{name: name for name in ("time_to_collision", "min_time_to_collision", "lane_offset", "max_lane_offset")},
    **{name: name for name in ("jerk", "max_jerk", "max_lateral_accel")},
}
"""Figure -> column of the world."""

FIGURES: Final = ("time", *_COLUMNS)
"""Figures of the first ego in a frame: time [s]; place of the middle of its rear axle [m]; yaw [rad]; speeds [m/s];
accelerations [m/s^2]; yaw rate [rad/s]; steer, angle of the front wheels [rad]; throttle and brake 0..1; distance
driven [m]; counts; off_road, time off the road [s]; times to collision, now and least [s], inf for none; offsets from
the lane's line, now (left positive) and greatest [m]; jerk, now and greatest [m/s^3]; greatest lateral acceleration
[m/s^2]."""

_COUNTS: Final = frozenset({"collisions", "red_lights", "stop_lines", "lane_invasions"})

NEAR: Final = 120.0
"""Entities within this distance of the ego are kept for pictures [m]."""

KEPT_SECONDS: Final = 10.0
_EVERY: Final = 5
"""Frames from one picture of the neighbours to the next."""

_PATH_POINTS: Final = 40
"""Most points of the small picture of a path."""


class Neighbours(Record):
    """Entities near the ego in one frame.

    Attributes:
        time: simulated time [s].
        boxes: (uid, x, y, yaw, half length, half width, shift of the box's middle, kind) of each; m and rad.
    """

    time: float
    boxes: tuple[tuple[float, ...], ...]


@dataclass(slots=True)
class Trace:
    """Figures of the ego, a row for each frame from the first step on.

    Attributes:
        rows: `FIGURES` each.
        parameters: of the run, and `seed`.
        neighbours: of the last ten seconds.
    """

    rows: list[tuple[float, ...]]
    parameters: Mapping[str, Value]
    neighbours: deque[Neighbours]

    def column(self, name: str) -> list[float]:
        """Return one figure over all frames.

        Args:
            name: one of `FIGURES`.
        """
        i = FIGURES.index(name)
        return [row[i] for row in self.rows]

    def at(self, i: int) -> dict[str, Value]:
        """Return the figures of a frame, with the parameters of the run."""
        return {**self.parameters, **dict(zip(FIGURES, self.rows[i], strict=True))}

    def scores(self) -> dict[str, float]:
        """Return `SCORES` of the whole drive; empty without a frame."""
        if not self.rows:
            return {}
        last = dict(zip(FIGURES, self.rows[-1], strict=True))
        speeds = self.column("speed")
        last["mean_speed"], last["max_speed"] = last["distance"] / last["time"], max(speeds)
        return {name: int(last[name]) if name in _COUNTS else round(last[name], 6) for name in SCORES}

    def path(self) -> list[tuple[float, float]]:
        """Return at most forty places of the ego, evenly in time, for a small picture [m]."""
        num = len(self.rows)
        steps = min(num, _PATH_POINTS)
        places = [self.rows[i * (num - 1) // max(steps - 1, 1)] for i in range(steps)]
        return [(round(row[1], 1), round(row[2], 1)) for row in places]


class Judge(Protocol):
    """Judges frames as they come."""

    @property
    def is_judging(self) -> bool:
        """True if it wants frames."""

    def take(self, values: Mapping[str, Value]) -> None:
        """Judge one frame; the values are those of expressions."""


class TraceRecorder:
    """Follows the first ego of a world, frame by frame, and says when the drive has ended.

    Attributes:
        trace: so far.

    Args:
        seconds: simulated time of the drive [s].
        end_when: ends it earlier; None for never.
        parameters: of the run, and `seed`.
        judge: gets the values of each frame.
    """

    def __init__(
        self,
        seconds: float,
        end_when: Expression | None,
        parameters: Mapping[str, Value],
        judge: Judge,
        topics: TopicValues,
    ) -> None:
        self.trace = Trace([], parameters, deque(maxlen=int(KEPT_SECONDS / DT / _EVERY)))
        self._frames = max(round(seconds / DT), 1)
        self._end_when = None if end_when is None else Following(end_when)
        self._judge, self._topics = judge, topics
        self._last = 0

    def take(self, world: World) -> bool:
        """Note one frame; return whether the drive has ended.

        Args:
            world: after a frame.

        Raises:
            DocumentError: there is no ego, the frames were not one after another, `end_when` cannot be computed, or a
                topic lacks a field.
        """
        rows = world.rows(Kind.EGO)
        if not len(rows):
            raise DocumentError("the scenario has no ego")
        if world.frame != self._last + 1:
            raise DocumentError(
                f"expected frame {self._last + 1} of the drive, got frame {world.frame}: the driver has reset the world"
                " or loaded another scenario"
            )
        self._last, row = world.frame, rows.item(0)
        figures = [world.frame * DT, *(getattr(world, column).item(row) for column in _COLUMNS.values())]
        figures[_OFF_ROAD] *= DT
        self.trace.rows.append(tuple(figures))
        if world.frame % _EVERY == 0:
            self.trace.neighbours.append(_look_around(world, row))
        is_over = self._last >= self._frames
        if self._topics.trouble:
            raise DocumentError(self._topics.trouble)
        if self._end_when is None and not self._judge.is_judging:
            return is_over
        values = self.trace.at(-1) | self._topics.values
        if self._judge.is_judging:
            self._judge.take(values)
        if self._end_when is not None:
            self._end_when.take(values)
            is_over = bool(self._end_when.value(values)) or is_over
        return is_over


_OFF_ROAD: Final = FIGURES.index("off_road")


def _look_around(world: World, ego: int) -> Neighbours:
    n = world.n
    x, y = world.x[:n], world.y[:n]
    near = (np.hypot(x - x[ego], y - y[ego]) <= NEAR) & world.alive[:n]
    names = ("uid", "x", "y", "yaw", "half_length", "half_width", "centre", "kind")
    boxes = np.stack([getattr(world, name)[:n][near].astype(np.float64) for name in names], axis=1)
    return Neighbours(round(world.frame * DT, 2), tuple(map(tuple, boxes.round(3).tolist())))
