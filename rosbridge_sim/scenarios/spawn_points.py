"""Spawn points of a scenario (`spawnPointList`): places on lanes where vehicles appear again and again."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Final

from rosbridge_sim.records import Record, replace
from rosbridge_sim.scenarios.catalogue import Model
from rosbridge_sim.scenarios.scenario_model import LinkInfo, SpawnPointItem
from rosbridge_sim.units import KMH_TO_MPS
from rosbridge_sim.world.roads.roads import Roads

MAX_TO_LANE: Final = 5.0
"""Largest distance from a lane's line for a point that is on the lane [m]: people click beside the line."""

USUAL_PERIOD: Final = (5.0, 10.0)
"""Seconds from one vehicle to the next where a file gives none, as MORAI's own files have it."""

USUAL_GAP: Final = 5.0
"""SafetyDist where a file gives none, as MORAI's own files have it [m]."""

USUAL_TIME: Final = 1.0
"""TTC where a file gives none, as MORAI's own files have it [s]."""

MAX_AT_ONCE: Final = 999
"""Vehicles of one point at the same time, at most: MORAI's own default."""

OWN_SPEED: Final = 2
"""SpawnVelocityType and DesiredVelocityType: a range of the file's own; any other number means the link's speed."""


class SpawnPoint(Record):
    """A place where vehicles appear.

    Attributes:
        where: its place in the document, for messages.
        uid: its id there; -1 for none.
        link, link_point: id of the link that it is on, "" for none, and number of a point of that link.
        place: east and north [m]; None where the file gives no position.
        goal_link, goal_point: the same of the place where its vehicles leave.
        goal_uid: id of the spawn point where they leave; -1 for none.
        models: one is chosen for each vehicle.
        num: vehicles at the same time, at most.
        period: least and greatest time from one vehicle to the next [s].
        wait: time until the first one [s]; -1 for a period.
        speed: least and greatest speed at which they appear [m/s]; inf for the speed limit.
        desired_speed: least and greatest speed that they want [m/s]; inf for the speed limit.
        gap: room before and behind a new vehicle [m].
        time: least time to a collision of a new vehicle with others [s].
        changes_lanes: its vehicles change lanes where that helps them.
        lateral: least and greatest offset from the line of the lane that they keep, left positive [m].
        lane, s: row of the lane, and the arc length on it [m]; -1 before `find_places` and where there is none.
        goal_lane, goal_s: the same of the place where they leave.
    """

    where: str
    uid: int
    link: str
    link_point: int
    place: tuple[float, float] | None
    goal_link: str
    goal_point: int
    goal_uid: int
    models: tuple[Model, ...]
    num: int
    period: tuple[float, float]
    wait: float
    speed: tuple[float, float]
    desired_speed: tuple[float, float]
    gap: float
    time: float
    changes_lanes: bool = True
    lateral: tuple[float, float] = (0.0, 0.0)
    lane: int = -1
    s: float = 0.0
    goal_lane: int = -1
    goal_s: float = 0.0


def read_spawn_point(where: str, item: SpawnPointItem, models: tuple[Model, ...]) -> SpawnPoint:
    """Return the spawn point of an item of a document.

    Args:
        models: those that it may choose from.
    """
    low, high = _range(item.minSpawnPeriod, item.maxSpawnPeriod, USUAL_PERIOD)
    start, goal = item.startLinkInfo or LinkInfo(), item.endLinkInfo or LinkInfo()
    speed = item.MinSpawnVelocity_Custom, item.MaxSpawnVelocity_Custom
    desired = item.MinDesiredVelocity_Custom, item.MaxDesiredVelocity_Custom
    return SpawnPoint(
        where=where,
        uid=-1 if item.UNIQUEID is None else item.UNIQUEID,
        link=start.linkIdx or "",
        link_point=start.pointIdx or 0,
        place=None if item.pos is None else (item.pos.x, item.pos.y),
        goal_link=goal.linkIdx or "",
        goal_point=goal.pointIdx or 0,
        goal_uid=-1 if item.destinationObjUniqueID is None else item.destinationObjUniqueID,
        models=models,
        num=MAX_AT_ONCE if item.maximumSpawnVehicle is None else min(item.maximumSpawnVehicle, MAX_AT_ONCE),
        period=(low, high),
        wait=-1.0 if item.waitSpawnTime is None else item.waitSpawnTime,
        speed=_speeds(*speed, is_own=item.SpawnVelocityType == OWN_SPEED),
        desired_speed=_speeds(*desired, is_own=item.DesiredVelocityType == OWN_SPEED),
        gap=USUAL_GAP if item.SafetyDist is None else item.SafetyDist,
        time=USUAL_TIME if item.TTC is None else item.TTC,
    )


def _range(low: float | None, high: float | None, usual: tuple[float, float]) -> tuple[float, float]:
    """Return two bounds in their order; one that is missing is the other one."""
    found = sorted(value for value in (low, high) if value is not None)
    return (found[0], found[-1]) if found else usual


def _speeds(low: float | None, high: float | None, *, is_own: bool) -> tuple[float, float]:
    """Return the bounds of a speed in m/s; inf for that of the link."""
    if not is_own or (low is None and high is None):
        return math.inf, math.inf
    low, high = _range(low, high, (0.0, 0.0))
    return low * KMH_TO_MPS, high * KMH_TO_MPS


def find_places(points: Sequence[SpawnPoint], roads: Roads, note: Callable[[str], None]) -> tuple[SpawnPoint, ...]:
    """Return the points that are on a lane, with lane and goal.

    A link that the map lacks is ignored if the document also gives a position.

    Args:
        points: as they were read.
        note: takes a remark about a point without a lane, or without its goal.
    """
    placed = []
    for point in points:
        place = _on_link(roads, point.link, point.link_point) or _nearest(roads, point.place)
        if place is None:
            note(f"{point.where}: it is on no lane; no vehicle appears there")
        else:
            placed.append(replace(point, lane=place[0], s=place[1]))
    of_uid = {point.uid: (point.lane, point.s) for point in placed if point.uid >= 0}
    found = []
    for point in placed:
        goal = _on_link(roads, point.goal_link, point.goal_point)
        if goal is None and point.goal_uid != point.uid:
            goal = of_uid.get(point.goal_uid)
        if goal is None and point.goal_link:
            note(f"{point.where}.endLinkInfo: the map has no link {point.goal_link!r}; its vehicles turn at random")
        found.append(point if goal is None else replace(point, goal_lane=goal[0], goal_s=goal[1]))
    return tuple(found)


def _on_link(roads: Roads, link: str, point: int) -> tuple[int, float] | None:
    try:
        lane = roads.row(link)
    except KeyError:
        return None
    first, last = int(roads.first[lane]), int(roads.first[lane + 1]) - 1
    return lane, float(roads.s[min(max(first + point, first), last)])


def _nearest(roads: Roads, point: tuple[float, float] | None) -> tuple[int, float] | None:
    if point is None or not len(roads):
        return None
    place = roads.nearest(*point)
    if place.distance[0] > MAX_TO_LANE:
        return None
    return int(place.lane[0]), float(place.s[0])
