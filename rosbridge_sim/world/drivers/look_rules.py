"""Rules for the speed of a driver: its own, limits, bends ahead; for arrays and single numbers: `rule_operators`."""

from __future__ import annotations

from typing import Final

from rosbridge_sim.world.drivers.driver_model import GAP, STOP_GAP, gap_wanted
from rosbridge_sim.world.drivers.rule_operators import RuleOperators, V
from rosbridge_sim.world.roads.lane_conflicts import MAX_LATERAL, SETTLING_TIME

MUCH_SLOWER: Final = 8.0
"""A vehicle ahead of the lead vehicle counts if it is slower by this much [m/s], or if the lead vehicle changes lanes.
With the comfortable braking a driver needs 4 s then, longer than its time gap."""


def foresee(  # noqa: PLR0917 - numbers of one driver, and of the place where it is
    do: RuleOperators[V],
    speed: V,
    accel: V,
    nose: V,
    lateral: V,
    speed_factor: V,
    own_accel: V,
    comfort: V,
    headway: V,
    reaction: V,
    arc: V,
    start: V,
    limit: V,
    limit_slope: V,
    bend: V,
    bend_slope: V,
) -> tuple[V, V, V, V, V, V]:
    """Return how a driver looks ahead.

    Args:
        speed: [m/s].
        accel: at present [m/s^2].
        nose: from the reference point to the front bumper [m].
        lateral: the lateral acceleration that it accepts of bends now [m/s^2].
        speed_factor, own_accel, comfort, headway, reaction: see `DriverParameters`.
        arc, start: arc lengths of the driver and of the last point of the roads [m].
        limit, limit_slope, bend, bend_slope: at that point, see `LaneConflicts.speeds_ahead`.

    Returns:
        How far ahead of the reference point it looks, 1.5 times the gap to a standing lead vehicle at which drivers
        begin to brake [m]; the way of a comfortable stop [m]; factors for the squares of the limit's and the bends'
        speeds; what is taken from the latter [m^2/s^2]; and the square of the speed that limit and bends allow here.
    """
    horizon = 1.5 * gap_wanted(do, speed, speed, own_accel, comfort, headway) + GAP + nose
    stop_way = speed * speed / (2.0 * comfort) + STOP_GAP + GAP
    limit_factor, bend_factor = speed_factor * speed_factor, lateral / MAX_LATERAL
    # One that accelerates would be faster at the places that it foresees, as if bends allowed so much less.
    surplus = 2.0 * speed * do.most(accel, 0.0) * (SETTLING_TIME + reaction)
    along = arc - start
    here = do.least(limit_factor * (limit + limit_slope * along), bend_factor * (bend + bend_slope * along) - surplus)
    return horizon, stop_way, limit_factor, bend_factor, surplus, here


def slow_down(  # noqa: PLR0917 - numbers of one driver, and of one lane ahead
    do: RuleOperators[V],
    distance: V,
    reach: V,
    comfort: V,
    limit_factor: V,
    bend_factor: V,
    surplus: V,
    limit: V,
    least_limit: V,
    bend: V,
    least_bend: V,
) -> V:
    """Return the square of the speed that a lane ahead allows now [m^2/s^2].

    Args:
        distance: to its start [m].
        reach: see `lane_conflicts.foresight` [m].
        comfort: of the driver [m/s^2].
        limit_factor, bend_factor, surplus: from `foresee`.
        limit, least_limit, bend, least_bend: at its start, see `LaneConflicts.speeds_ahead`.
    """
    # From the first place on that lane that counts to the whole stretch ahead of its start
    share = do.most(1.0 - distance / reach, 0.0)
    limit, bend = limit + share * (least_limit - limit), bend + share * (least_bend - bend)
    braking = 2.0 * comfort * do.most(distance - reach, 0.0)
    return do.least(limit_factor * limit, bend_factor * bend - surplus) + braking
