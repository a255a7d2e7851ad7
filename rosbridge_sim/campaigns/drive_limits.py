"""Judging: the limits of a campaign against the trace of a drive.

Each limit is judged alone and gives at most one breach, at the first frame that broke it. The verdict of a drive is
`fail` if there is a breach, and the earliest one is its reason. Nothing here depends on the order or number of other
runs. The user's own expressions are judged while the drive goes on, see `own_limits`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Final

from rosbridge_sim.campaigns.campaign_model import LimitsItem, Place
from rosbridge_sim.campaigns.run_results import Breach
from rosbridge_sim.campaigns.trace import FIGURES, Trace
from rosbridge_sim.errors import DocumentError
from rosbridge_sim.expressions import Expression, TopicField, parse_expression
from rosbridge_sim.printable import printable
from rosbridge_sim.records import Record

OwnCheck = Callable[[Trace], object]
"""A function of the user: returns None, or what is wrong."""

_MOST: Final = {
    "collisions": ("collisions", ""),
    "red_lights": ("red_lights", ""),
    "stop_lines": ("stop_lines", ""),
    "lane_invasions": ("lane_invasions", ""),
    "off_road": ("off_road", " s"),
    "lane_error": ("max_lane_offset", " m"),
    "jerk": ("max_jerk", " m/s^3"),
    "lateral_accel": ("max_lateral_accel", " m/s^2"),
}
"""Limit -> figure that must not be greater, and its unit."""


class Limits(Record):
    """The limits of a campaign, parsed.

    Attributes:
        item: those of the scores, and the place to reach.
        always: name -> expression, and the time from which on it must hold [s].
        end: name -> expression of the last frame.
        python: name -> name of the user's function.
    """

    item: LimitsItem
    always: Mapping[str, tuple[Expression, float]]
    end: Mapping[str, Expression]
    python: Mapping[str, str]

    @property
    def fields(self) -> frozenset[TopicField]:
        """Fields of topics that its expressions read."""
        expressions = [*(each for each, _ in self.always.values()), *self.end.values()]
        return frozenset(field for each in expressions for field in each.fields)


def read_limits(item: LimitsItem, known: frozenset[str], numbers: frozenset[str], source: str) -> Limits:
    """Parse the limits of a campaign.

    Args:
        known: names that its expressions may use.
        source: name of the file, for errors.

    Raises:
        DocumentError: an expression cannot be read, or is no condition.
    """

    def parse(text: str, where: str) -> Expression:
        return parse_expression(text, where, known, is_followed=True, numbers=numbers)

    always: dict[str, tuple[Expression, float]] = {}
    end: dict[str, Expression] = {}
    python: dict[str, str] = {}
    for name, own in item.own.items():
        where = f"{source}: limits.own.{name}"
        if own.always is not None:
            always[name] = (parse(own.always, f"{where}.always"), own.after)
        elif own.end is not None:
            end[name] = parse(own.end, f"{where}.end")
        elif own.python is not None:
            python[name] = own.python
    return Limits(item, always, end, python)


def judge_trace(
    trace: Trace, limits: Limits, checks: Mapping[str, OwnCheck], own: Sequence[Breach] = ()
) -> tuple[Breach, ...]:
    """Return the limits that a drive did not keep, the earliest first.

    Args:
        trace: of at least one frame.
        checks: the user's functions by the name of the limit.
        own: breaches of the user's expressions, see `OwnLimits`.

    Raises:
        DocumentError: a function returns something else than None or a text.
    """
    found = [*_standard(trace, limits.item), *own, *_checked(trace, checks)]
    return tuple(sorted(found, key=lambda breach: breach.time))


def _standard(trace: Trace, limits: LimitsItem) -> Iterator[Breach]:
    for name, (figure, unit) in _MOST.items():
        i, most = FIGURES.index(figure), getattr(limits, name)
        if most is not None and trace.rows[-1][i] > most + _SLACK:  # these figures never become less
            first = next(k for k, row in enumerate(trace.rows) if row[i] > most + _SLACK)
            yield _breach(trace, first, name, f"expected at most {most:g}{unit}, got {trace.rows[-1][i]:.4g}{unit}")
    if limits.time_to_collision is not None:
        i, now = FIGURES.index("min_time_to_collision"), FIGURES.index("time_to_collision")
        if trace.rows[-1][i] < limits.time_to_collision:
            first = next(k for k, row in enumerate(trace.rows) if min(row[i], row[now]) < limits.time_to_collision)
            text = f"expected at least {limits.time_to_collision:g} s, got {trace.rows[-1][i]:.4g} s"
            yield _breach(trace, first, "time_to_collision", text)
    if limits.distance is not None:
        got = trace.rows[-1][FIGURES.index("distance")]
        if got < limits.distance:
            yield _breach(trace, -1, "distance", f"expected at least {limits.distance:g} m, got {got:.4g} m")
    if limits.arrival is not None:
        yield from _arrival(trace, limits.arrival)


_SLACK: Final = 1e-9
"""Sums of frames of 0.02 s are not exact."""


def _arrival(trace: Trace, place: Place) -> Iterator[Breach]:
    latest = math.inf if place.within is None else place.within
    away = [math.hypot(row[1] - place.x, row[2] - place.y) for row in trace.rows if row[0] <= latest + _SLACK]
    if not away or min(away) > place.radius:
        nearest = f"{min(away):.4g} m" if away else "nothing"
        at = max(len(away) - 1, 0)
        when = "" if place.within is None else f" within {place.within:g} s"
        where = f"({place.x:g}, {place.y:g})"
        text = f"expected to be within {place.radius:g} m of {where}{when}, got {nearest} at the nearest"
        yield _breach(trace, at, "arrival", text)


def _checked(trace: Trace, checks: Mapping[str, OwnCheck]) -> Iterator[Breach]:
    for name, check in checks.items():
        told = check(trace)
        if told is None or told is True:
            continue
        if not isinstance(told, str):
            raise DocumentError(
                f"limits.own.{name}: expected None, or a text that says what is wrong, from the function; got"
                f" {printable(repr(told), 60)}"
            )
        yield _breach(trace, -1, name, printable(told, 200))


def _breach(trace: Trace, i: int, limit: str, text: str) -> Breach:
    row = trace.rows[i]
    return Breach(limit, text, round(row[0], 2), round(row[1], 2), round(row[2], 2))
