"""Lateral wander: drivers do not keep to the line of their lane to the centimetre.

The wander is a displacement in addition to the offset of `lane_change_motion`. The driver aims at an offset that is a
sum of three slow waves in time, with periods and phases of its own by seed and uid, and steers towards it: with y the
displacement to the left, s the way and l a length of preview,

    d2y/ds2 = (aim - y) / l^2 - 2 dy/ds / l

So y is smooth, what stands does not slide, and the heading follows dy/ds: the middle of the rear axle moves along it.
The aim is 0 while a driver changes lanes or swings out in a bend, so y fades there without a jump.

Displacements to the east and to the north are worked out at each decision for the next one, and are linear in between.
So is the slope, as the heading is.
"""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from rosbridge_sim.world.drivers.rule_operators import ARRAYS, RuleOperators, V
from rosbridge_sim.world.geometry.planar import FloatArray, IntArray, of_rows, run_of
from rosbridge_sim.world.roads.roads import Roads
from rosbridge_sim.world.state.chance import bell
from rosbridge_sim.world.state.world import DT, Kind
from rosbridge_sim.world.state.world_rows import WorldRows

USUAL_WANDER: Final = 0.15
"""Standard deviation of the aim [m]. On motorways that of the position is 0.15 to 0.25 m (de Waard 1996; Verster and
Roth 2011); preview takes 5 to 10 % of this one away."""

PERIODS: Final = (11.0, 19.0, 37.0)
"""Mean periods of the waves [s]: the position of drivers changes with less than 0.1 Hz. No one is near a multiple of
another, so the sum does not repeat."""

PERIOD_SPREAD: Final = 0.1
"""Standard deviation of a period, as a share of it."""

MARGIN: Final = 0.1
"""The aim keeps the sides of the vehicle this far within the borders of its lane [m], where it is wide enough."""

PREVIEW_TIME, PREVIEW_WAY = 1.0, 8.0
"""The length l is the way of this time [s], and at least so long [m]."""

_FIRST_QUESTION: Final = 64
"""The first of the questions to `chance` here; those of `driver_parameters` are below."""

_WAVE: Final = (2.0 / len(PERIODS)) ** 0.5
"""Height of each wave for a standard deviation of 1 of their sum."""

_PARABOLA: Final = (15.0 / 16.0) ** 0.5
"""A wave of parabolas of height 1 has a mean square of 8/15 instead of 1/2."""

WAVES: Final = -16.0 * _WAVE * _PARABOLA
"""Factor of the sum of the waves."""


def _waves_of(salt: npt.NDArray[np.uint64]) -> tuple[FloatArray, FloatArray]:
    """Return the waves' rates [1/frame] and phases [periods], (3, k) each, by salts (k,) of `chance.salt_of`."""
    rates, phases = [], []
    for i, period in enumerate(PERIODS):
        spread = bell(salt, _FIRST_QUESTION + 2 * i)
        rates.append(DT / (period * (1.0 + PERIOD_SPREAD * spread)))
        # A bell of one period and more, taken without whole periods, is even enough.
        phases.append(2.0 * bell(salt, _FIRST_QUESTION + 2 * i + 1))
    return np.array(rates), np.array(phases)


def _sum_of_waves(rate: FloatArray, phase: FloatArray, frame: int | IntArray) -> FloatArray:
    """Return the sum of three waves of parabolas, with a standard deviation of 1 and the same bits everywhere, (k,)."""
    turn = rate * frame + phase
    turn -= np.floor(turn) + 0.5
    waves = turn * (0.5 - np.abs(turn))
    return np.asarray((waves[0] + waves[1] + waves[2]) * WAVES)


class LaneWander:
    """The wander of some lane followers. It lives as long as they do, see `lane_following`, and holds no state.

    Attributes:
        which: (m,) int64, which of them wander; indices into the rows.
        half_width: (m,) half of the width of each of these, with `MARGIN` [m].
        rates, phases: (3, m) of the waves of their aims [1/frame], [periods].
        width: (m,) standard deviation of their aims [m].

    Args:
        world: written by the methods.
        rows: (n,) int64, rows of all lane followers.
    """

    def __init__(self, world: WorldRows, rows: IntArray) -> None:
        self._world = world
        may = (world.kind[rows] == int(Kind.VEHICLE)) & (world.lateral_bias[rows] == 0.0)
        self.which = (may & (world.wander_width[rows] > 0.0)).nonzero()[0]
        mine = rows[self.which]
        self._at = run_of(mine) if len(mine) else mine
        self.rates, self.phases = _waves_of(world.salts(mine))
        self._rows = mine
        self.width = world.wander_width[mine]
        self.half_width = world.half_width[mine] + MARGIN
        self._room = world.roads.derived(room_of)

    def plan(self, distance: FloatArray, heading: FloatArray, lane: IntArray, off: IntArray, interval: float) -> None:
        """Work out the displacements until the next decision; add the angles of the wander to the headings.

        Args:
            distance: (n,) that each lane follower will drive until then [m].
            heading: (n,) then, written [rad].
            lane: (n,) int64, the lane of each.
            off: int64, those that change lanes or swing out, of all lane followers.
            interval: until then [s].
        """
        if not len(self.which):
            return
        world, at, which = self._world, self._at, self.which
        is_all = len(which) == len(distance)
        way = distance if is_all else distance[which]
        angle = heading if is_all else heading[which]
        most = np.fmax(self._room[lane if is_all else lane[which]] - self.half_width, 0.0)
        aim = np.fmin(np.fmax(self.aims(), -most), most)
        aim += 0.0  # where there is no room: of 0.0 and -0.0, numpy takes the one or the other, depending on the row
        if len(off):
            is_off = np.zeros(len(distance), dtype=bool)
            is_off[off] = True
            aim[is_off[which]] = 0.0
        then, bend, turn = wander_ahead(ARRAYS, way, aim, world.wander[at], world.wander_slope[at], interval)
        x, y = world.wander_x[at], world.wander_y[at]
        east, north = -then * np.sin(angle), then * np.cos(angle)
        stands = (way <= 0.0).nonzero()[0]
        if len(stands):
            east[stands], north[stands] = x[stands], y[stands]
        world.wander_x_rate[at] = (east - x) / interval
        world.wander_y_rate[at] = (north - y) / interval
        world.wander[at], world.wander_slope_rate[at] = then, bend / interval
        if is_all:
            heading += turn
        else:
            heading[which] += turn

    def aims(self) -> FloatArray:
        """Return where they aim at now, in lanes of any width, (m,) [m]."""
        return np.asarray(self.width * _sum_of_waves(self.rates, self.phases, self._world.frames(self._rows)))

    def move(self, dt: float) -> None:
        """Move the rows by their displacements at the end of a step of `dt` [s]; their places are those without it."""
        if not len(self.which):
            return
        world, at = self._world, self._at
        world.wander_slope[at] += world.wander_slope_rate[at] * dt
        now, rate = world.block("wander_x", "wander_y"), world.block("wander_x_rate", "wander_y_rate")
        by = of_rows(now, at) + of_rows(rate, at) * dt
        now[:, at] = by
        world.block("x", "y")[:, at] += by


def wander_ahead(  # noqa: PLR0917 - numbers of one driver
    do: RuleOperators[V], way: V, aim: V, now: V, slope: V, interval: float
) -> tuple[V, V, V]:
    """Return the displacement at the end of an interval [m], the change of its slope until then, and the slope then.

    Args:
        way: driven until then [m].
        aim: where the driver aims at [m].
        now: the displacement [m].
        slope: of it, for each metre.
        interval: [s].
    """
    preview = do.most(way * (PREVIEW_TIME / interval), PREVIEW_WAY)
    share = way / preview
    bend = share * (aim - now) / preview - 2.0 * share * slope
    return now + way * (slope + 0.5 * bend), bend, slope + bend


def room_of(roads: Roads) -> FloatArray:
    """Return the least distance from the line to a border of each lane, (l,) [m]."""
    return np.asarray(np.minimum.reduceat(np.abs(roads.border).min(axis=1), roads.first[:-1]))
