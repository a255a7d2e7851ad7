"""Private actions of a story that take time: how they change speed, offset and place of an actor, frame by frame.

Each kind is a row of `MOTIONS`: its domains, a function that begins it, and one that goes on by a frame and says
whether it is done. What a running action remembers is numbers and points, so it is plain data. A new action ends the
running ones of its domains, of the same actor.

Shapes are those of ASAM OpenSCENARIO 1.3, `DynamicsShape`. A change of speed is no faster than the entity's performance
allows: it takes longer then, as in esmini.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from operator import itemgetter
from typing import Final

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.records import Record
from rosbridge_sim.scenarios.openscenario.places import MapPlace, lane_id
from rosbridge_sim.scenarios.openscenario.story_records import StoryItem
from rosbridge_sim.simulator.story.story_actors import DRIVER, PROGRAM, STORY, STORY_STEP, StoryActor
from rosbridge_sim.simulator.story.story_context import StoryContext
from rosbridge_sim.world.state.world import MAX_COORDINATE, MAX_SPEED

LATERAL_ACCEL: Final = 0.5
"""Greatest lateral acceleration of a change of the offset that gives none [m/s^2]: an unhurried lane change."""

SPRING: Final = 0.4
"""Spring that keeps a distance, as a share of the greatest acceleration [1/m]: that of esmini's logs. The damping is
critical."""

DEFAULT_ACCEL: Final = 3.0
"""Greatest acceleration for the spring where none is given [m/s^2]."""

MAX_PULL: Final = 100.0
"""Greatest acceleration for the spring; steps of the story cannot follow a stiffer one [m/s^2]."""

NEAR: Final = 0.05
"""A distance is reached within this [m]."""

SOON: Final = 1e-3
"""Least time of a change of speed in a profile [s]."""

NO_LIMIT: Final = 1e9

POINT: Final = 6
"""Figures of a point of a trajectory."""


@dataclass(slots=True)
class Running:
    """An action of an actor that goes on.

    Attributes:
        number: of the action's part of the storyboard; negative for those of `Init`.
        entity: name of the actor.
        numbers: what it remembers, by name.
        points: of a trajectory: x, y, z [m], yaw [rad], time [s] and way from the start [m] of each vertex; of a
            profile of speeds, see `_begin_profile`.
    """

    number: int
    entity: str
    numbers: dict[str, float] = field(default_factory=dict)
    points: list[tuple[float, ...]] = field(default_factory=list)


Begin = Callable[[StoryContext, StoryItem, StoryActor, Running], bool]
"""Begins an action; returns whether it is done already. DocumentError: it cannot begin."""

Advance = Callable[[StoryContext, StoryItem, StoryActor, Running], bool]
"""Goes on by a frame; returns whether the action is done."""


class StoryMotion(Record, eq=False):
    """A kind of action: its domains, what it does, and what a running one remembers.

    Attributes:
        memo: names of its numbers.
        num_points: least number of its points; 0 for none.
    """

    domains: tuple[str, ...]
    begin: Begin
    advance: Advance
    memo: tuple[str, ...] = ()
    num_points: int = 0

    def fits(self, running: Running) -> bool:
        """Return whether what a running action remembers, from outside, can be of this kind."""
        num = len(running.points)
        return (
            set(running.numbers) == set(self.memo)
            and max(map(abs, running.numbers.values()), default=0.0) <= NO_LIMIT
            and (num >= self.num_points if self.num_points else num == 0)
            and all(len(point) == POINT and max(map(abs, point)) <= NO_LIMIT for point in running.points)
        )


def shape_at(shape: str, share: float) -> float:
    """Return how far a change has come, 0..1, at a share of its time."""
    share = min(max(share, 0.0), 1.0)
    if shape == "linear":
        return share
    if shape == "sinusoidal":
        return 0.5 - 0.5 * math.cos(math.pi * share)
    return share * share * (3.0 - 2.0 * share) if shape == "cubic" else 1.0


_PEAK: Final = {"linear": 1.0, "sinusoidal": math.pi / 2, "cubic": 1.5, "step": 0.0}
"""Greatest rate of a change, relative to its mean rate."""


def time_of(dynamics: StoryItem, change: float, speed: float) -> float:
    """Return how long a change takes [s].

    Args:
        dynamics: with `dynamicsShape`, `dynamicsDimension` and `value`.
        change: of the speed or of the offset.
        speed: mean speed meanwhile, for changes over a distance [m/s].
    """
    shape, value = dynamics["dynamicsShape"], abs(dynamics["value"])
    if shape == "step":
        return 0.0
    dimension = dynamics["dynamicsDimension"]
    if dimension == "time":
        return float(value)
    if dimension == "rate":
        return _PEAK[shape] * abs(change) / value if value > 0.0 else 0.0
    return value / abs(speed) if abs(speed) > 0.0 else 0.0


# Speed


def _begin_speed(context: StoryContext, item: StoryItem, actor: StoryActor, running: Running) -> bool:
    goal, dynamics = _speed_goal(context, item), item.part("SpeedActionDynamics")
    change = goal - actor.speed
    length = time_of(dynamics, change, 0.5 * (goal + actor.speed))
    body = context.actors.bodies[running.entity]
    most = body.max_accel if change > 0.0 else body.max_decel
    shape = dynamics["dynamicsShape"]
    if shape != "step" and most > 0.0:
        length = max(length, _PEAK[shape] * abs(change) / most)
    running.numbers = {"from": actor.speed, "to": goal, "length": length, "at": 0.0}
    actor.told_speed = goal
    if actor.mode == PROGRAM:
        actor.speed = goal
        return True
    return _advance_speed(context, item, actor, running) if length <= 0.0 else False


def _speed_goal(context: StoryContext, item: StoryItem) -> float:
    target = item.part("SpeedActionTarget").part()
    return _goal_of(target, context.actors.find(target["entityRef"]).speed if "entityRef" in target.values else 0.0)


def _goal_of(target: StoryItem, reference: float) -> float:
    """Return the speed that a target means: absolute, or relative to that of another entity [m/s]."""
    value = target["value"]
    kind = target.get("speedTargetValueType")
    return _bounded({"factor": reference * value, "delta": reference + value}.get(kind, value))


def _go_on(running: Running, shape: str) -> tuple[float, bool]:
    """Return the figure that changes a step later, and whether its change is done."""
    memo = running.numbers
    memo["at"] += STORY_STEP
    share = memo["at"] / memo["length"] if memo["length"] > 0.0 else 1.0
    return memo["from"] + (memo["to"] - memo["from"]) * shape_at(shape, share), share >= 1.0


def _bounded(speed: float) -> float:
    return max(-MAX_SPEED, min(MAX_SPEED, speed))


def _advance_speed(context: StoryContext, item: StoryItem, actor: StoryActor, running: Running) -> bool:
    is_continuous = item.part("SpeedActionTarget").part().get("continuous", False)
    if is_continuous:
        running.numbers["to"] = _speed_goal(context, item)
    actor.speed, is_done = _go_on(running, item.part("SpeedActionDynamics")["dynamicsShape"])
    return is_done and not is_continuous


def _begin_profile(context: StoryContext, item: StoryItem, actor: StoryActor, running: Running) -> bool:
    """Plan the speeds: points are time [s], speed [m/s] and acceleration [m/s^2] of the knots, and zeros."""
    speed, time, lines, is_exact = actor.speed, 0.0, [], item["followingMode"] == "position"
    rates = (_limit(item, key) for key in ("maxAccelerationRate", "maxDecelerationRate"))
    up, down = (NO_LIMIT, NO_LIMIT) if is_exact else rates
    for entry in item.all("SpeedProfileEntry"):
        change, length = _bounded(entry["speed"]) - speed, entry.get("time", -1.0)
        if length < 0.0 or not is_exact:
            # Within the limits; the other root is the greatest acceleration that both rates leave time for.
            most = max(math.sqrt(2.0 * abs(change) * up * down / max(up + down, 1e-9)), 1e-3)
            length = max(length, _fastest(context, item, running, change), abs(change) / most)
        length = max(length, SOON if change else 0.0)
        lines.append((time, speed, change / length if length else 0.0))
        time, speed = time + length, speed + change
    knots = _knots(actor.speed, [*lines, (time, speed, 0.0)], up, down)
    running.points = [(*(max(-NO_LIMIT, min(NO_LIMIT, each)) for each in knot), 0.0, 0.0, 0.0) for knot in knots]
    running.numbers = {"at": 0.0}
    return not lines


def _knots(speed: float, lines: Sequence[tuple[float, ...]], up: float, down: float) -> list[tuple[float, ...]]:
    """Return times, speeds and accelerations between which accelerations change evenly.

    A change of the acceleration lies around the time at which the line of speeds that is left meets the next one, or
    behind the change before it.

    Args:
        lines: time and speed of their begins, and accelerations.
        up, down: how fast accelerations may rise and fall [m/s^3].
    """
    knots = [(0.0, speed, 0.0)]
    for start, at_start, slope in lines:
        time, speed, accel = knots[-1]
        if slope == accel:
            continue
        length = abs(slope - accel) / max(up if slope > accel else down, 1e-3)
        meets = (at_start + slope * (time - start) - speed) / (accel - slope)
        wait = max(meets - 0.5 * length, 0.0)
        speed += accel * wait
        knots += [(time + wait, speed, accel), (time + wait + length, speed + 0.5 * (accel + slope) * length, slope)]
    return [*knots, (knots[-1][0], lines[-1][1], 0.0)]


def _advance_profile(_context: StoryContext, _item: StoryItem, actor: StoryActor, running: Running) -> bool:
    at = running.numbers["at"] = running.numbers["at"] + STORY_STEP
    row = bisect_right(running.points, at, key=itemgetter(0)) - 1
    time, speed, accel = running.points[row][:3]
    if row + 1 >= len(running.points):
        actor.speed = speed
        return True
    later, _, goal = running.points[row + 1][:3]
    since = at - time
    actor.speed = _bounded(speed + accel * since + 0.5 * (goal - accel) * since * since / max(later - time, 1e-9))
    return False


def _fastest(context: StoryContext, item: StoryItem, running: Running, change: float) -> float:
    """Return the least time of a change of speed within the limits [s]."""
    body = context.actors.bodies[running.entity]
    key, most = ("maxAcceleration", body.max_accel) if change > 0.0 else ("maxDeceleration", body.max_decel)
    return abs(change) / max(min(_limit(item, key), most or NO_LIMIT), 1e-3)


def _limit(item: StoryItem, key: str, default: float = NO_LIMIT) -> float:
    """Return a limit of an action's `DynamicConstraints`."""
    limits = item.find("DynamicConstraints")
    return default if limits is None else float(limits.get(key, default))


# Distances


def _begin_gap(context: StoryContext, item: StoryItem, actor: StoryActor, running: Running) -> bool:
    """Keep a distance to another entity; without limits the actor is there at once."""
    running.numbers = {"accel": 0.0}
    return item.find("DynamicConstraints") is None and _jump(context, item, actor, running)


def _jump(context: StoryContext, item: StoryItem, actor: StoryActor, running: Running) -> bool:
    reference = context.actors.find(item["entityRef"])
    error = _gap_error(context, item, running)
    moved, _ = context.actors.map.move(actor.lane_place, actor.direction * error, actor.route)
    if actor.lane >= 0:
        context.actors.put(actor, context.actors.map.at(moved))
    context.actors.show(actor)
    actor.speed = reference.speed if item["continuous"] else actor.speed
    return not item["continuous"]


def _gap_error(context: StoryContext, item: StoryItem, running: Running) -> float:
    """Return how far ahead of its place the actor should be [m]."""
    gap = context.measures.along(running.entity, item["entityRef"], item.get("coordinateSystem", "entity"))
    ahead = _side(item, gap)
    reference = context.actors.find(item["entityRef"])
    wanted = item.get("distance", 0.0) + item.get("timeGap", 0.0) * reference.speed
    if item["freespace"]:
        wanted += context.measures.half_lengths(running.entity, item["entityRef"], ahead)
    return float(gap - ahead * wanted)


def _side(item: StoryItem, measured: float) -> float:
    """Return 1 if the other entity is to be ahead of the actor, or to the left of it, else -1."""
    sides = {"trailing": 1.0, "leading": -1.0, "rightTo": 1.0, "leftTo": -1.0}
    return sides.get(item.get("displacement", "any").removesuffix("ReferencedEntity"), math.copysign(1.0, measured))


def _advance_gap(context: StoryContext, item: StoryItem, actor: StoryActor, running: Running) -> bool:
    if item.find("DynamicConstraints") is None:
        return _jump(context, item, actor, running)
    reference = context.actors.find(item["entityRef"])
    error = _gap_error(context, item, running)
    spring = SPRING * min(_limit(item, "maxAcceleration", DEFAULT_ACCEL), MAX_PULL)
    accel = spring * error + 2.0 * math.sqrt(spring) * (reference.speed - actor.speed)
    accel = max(-_limit(item, "maxDeceleration"), min(_limit(item, "maxAcceleration"), accel))
    before = running.numbers["accel"]
    up, down = (_limit(item, key) * STORY_STEP for key in ("maxAccelerationRate", "maxDecelerationRate"))
    # Brakes and throttle may be released at any rate, as in esmini.
    accel = running.numbers["accel"] = min(before + up, accel) if accel > 0.0 else max(before - down, accel)
    actor.speed = max(0.0, min(_limit(item, "maxSpeed"), _bounded(actor.speed + accel * STORY_STEP)))
    if item["continuous"] or abs(error) >= NEAR or abs(reference.speed - actor.speed) >= NEAR:
        return False
    actor.speed = reference.speed
    return True


def _begin_side(_context: StoryContext, _item: StoryItem, actor: StoryActor, running: Running) -> bool:
    running.numbers = {"rate": 0.0}
    return actor.lane < 0


def _advance_side(context: StoryContext, item: StoryItem, actor: StoryActor, running: Running) -> bool:
    """Keep a distance to the side of another entity, as fast as the limits allow and without overshoot."""
    left = context.measures.aside(running.entity, item["entityRef"], item.get("coordinateSystem", "entity"))
    wanted = item.get("distance", abs(left))
    if item["freespace"]:
        wanted += context.measures.half_widths(running.entity, item["entityRef"])
    error = left - _side(item, left) * wanted
    fastest, most = _limit(item, "maxSpeed"), _limit(item, "maxAcceleration")
    if most < NO_LIMIT:
        spring = SPRING * min(most, MAX_PULL)
        accel = max(-most, min(most, spring * error - 2.0 * math.sqrt(spring) * running.numbers["rate"]))
        rate = running.numbers["rate"] + accel * STORY_STEP
    else:
        rate = error / STORY_STEP
    rate = running.numbers["rate"] = max(-fastest, min(fastest, rate))
    actor.offset += actor.direction * rate * STORY_STEP
    return abs(error) < NEAR and not item["continuous"]


# Lanes


def _begin_change(context: StoryContext, item: StoryItem, actor: StoryActor, running: Running) -> bool:
    if actor.lane < 0:
        raise DocumentError("it is on no lane")
    target = item.part("LaneChangeTarget").part()
    story_map = context.actors.map
    if target.kind == "AbsoluteTargetLane":
        lane, aside = story_map.lane_beside(actor.lane_place, lane_id(target["value"]))
    else:
        reference = context.actors.on_lane(target["entityRef"])
        steps = int(target["value"] * reference.direction)
        lane, aside = story_map.beside(reference.lane_place, steps)
        if reference is not actor:
            aside += context.measures.between_lanes(running.entity, target["entityRef"])
    goal = aside + actor.direction * item.get("targetLaneOffset", 0.0)
    change = goal - actor.offset
    length = time_of(item.part("LaneChangeActionDynamics"), change, actor.speed)
    running.numbers = {"from": actor.offset, "to": goal, "length": length, "at": 0.0, "lane": float(lane)}
    return _advance_change(context, item, actor, running) if length <= 0.0 else False


def _advance_change(_context: StoryContext, item: StoryItem, actor: StoryActor, running: Running) -> bool:
    actor.offset, is_done = _go_on(running, item.part("LaneChangeActionDynamics")["dynamicsShape"])
    actor.is_changing_lane = is_done and running.numbers["lane"] >= 0.0
    return is_done


def _begin_offset(context: StoryContext, item: StoryItem, actor: StoryActor, running: Running) -> bool:
    dynamics, target = item.part("LaneOffsetActionDynamics"), item.part("LaneOffsetTarget").part()
    goal = target["value"] * actor.direction
    if target.kind == "RelativeTargetLaneOffset":
        goal += context.actors.on_lane(target["entityRef"]).offset
    change = abs(goal - actor.offset)
    most, shape = dynamics.get("maxLateralAcc", LATERAL_ACCEL), dynamics["dynamicsShape"]
    # Greatest acceleration of the shapes: pi^2 D / (2 T^2) and 6 D / T^2; a linear change gets the time of a cubic one.
    factor = {"sinusoidal": 0.5 * math.pi**2, "step": 0.0}.get(shape, 6.0)
    length = math.sqrt(factor * change / most) if most > 0.0 else 0.0
    running.numbers = {"from": actor.offset, "to": goal, "length": length, "at": 0.0}
    return False


def _advance_offset(_context: StoryContext, item: StoryItem, actor: StoryActor, running: Running) -> bool:
    actor.offset, is_done = _go_on(running, item.part("LaneOffsetActionDynamics")["dynamicsShape"])
    return is_done and not item["continuous"]


# Trajectories


def _begin_trajectory(context: StoryContext, item: StoryItem, _actor: StoryActor, running: Running) -> bool:
    reference = item.find("TrajectoryRef")
    trajectory = (item if reference is None else reference).find("Trajectory")
    if trajectory is None:
        raise DocumentError("expected a Trajectory or a TrajectoryRef")
    timing = item.part("TimeReference").part()
    is_timed = timing.kind == "Timing"
    vertices = trajectory.part("Shape").part("Polyline").all("Vertex")
    if trajectory.get("closed", False):
        vertices += vertices[:1]
    points: list[tuple[float, ...]] = []
    way = 0.0
    for vertex in vertices:
        place = context.actors.map.find_place(vertex.part("Position"), context.actors.locate)
        if points:
            way += math.dist((place.x, place.y), points[-1][:2])
        time = vertex.get("time", 0.0)
        if is_timed:
            time = time * timing["scale"] + timing["offset"]
        points.append((place.x, place.y, place.z, place.yaw, time, way))
    if len(points) < 2:  # noqa: PLR2004 - a line
        raise DocumentError("expected a Polyline with two vertices or more")
    if is_timed and any(one[4] > other[4] for one, other in pairwise(points)):
        raise DocumentError("expected vertices with rising times")
    start = context.time() if is_timed and timing["domainAbsoluteRelative"] == "relative" else 0.0
    running.points = points
    running.numbers = {"start": start, "way": item.get("initialDistanceOffset", 0.0), "timed": float(is_timed)}
    return False


def _advance_trajectory(context: StoryContext, _item: StoryItem, actor: StoryActor, running: Running) -> bool:
    memo, points = running.numbers, running.points
    key = 4 if memo["timed"] else 5
    if memo["timed"]:
        at = context.time() + STORY_STEP - memo["start"]
    else:
        at = memo["way"] = memo["way"] + abs(actor.speed) * STORY_STEP
    if memo["timed"] and at < points[0][key]:
        return False  # it drives on by itself until then
    row = next((i for i, point in enumerate(points[1:]) if at < point[key]), len(points) - 2)
    first, second = points[row], points[row + 1]
    span = second[key] - first[key]
    share = min((at - first[key]) / span, 1.0) if span > 0.0 else 1.0
    before = actor.x, actor.y
    actor.x, actor.y, actor.z = (a + share * (b - a) for a, b in zip(first[:3], second[:3], strict=True))
    if math.dist(first[:2], second[:2]) > 0.0:
        actor.yaw = math.atan2(second[1] - first[1], second[0] - first[0])
    actor.travelled += math.dist(before, (actor.x, actor.y))
    if memo["timed"] and span > 0.0:
        actor.speed = _bounded((second[5] - first[5]) / span)
    actor.is_placed = True
    context.actors.take_lane(actor)
    return at >= points[-1][key]


# Routes, places, drivers


def _begin_route(context: StoryContext, item: StoryItem, actor: StoryActor, _running: Running) -> bool:
    """Take a route: its first waypoint is where it begins, or the actor's own place."""
    story_map = context.actors.map
    own = [actor.lane_place] if item.kind == "AcquirePositionAction" else []
    goals = [item] if own else item.part("Route").all("Waypoint")
    places = [
        *own,
        *(story_map.project(story_map.find_place(each.part("Position"), context.actors.locate)) for each in goals),
    ]
    if len(places) > 1:
        actor.route = story_map.find_way(places[0], places[1:])
    return True


def _begin_teleport(context: StoryContext, item: StoryItem, actor: StoryActor, _running: Running) -> bool:
    context.actors.put(actor, context.actors.map.find_place(item.part("Position"), context.actors.locate))
    context.actors.show(actor)
    return True


def _begin_controller(context: StoryContext, item: StoryItem, actor: StoryActor, _running: Running) -> bool:
    """Hand an actor over to a driver of the world, or take it back; nothing that is overridden is driven here."""
    for part in (item, *item.parts):
        keys = ("lateral", "longitudinal", "activateLateral", "activateLongitudinal")
        wanted = [part[key] for key in keys if key in part.values]
        if wanted and all(wanted):
            context.actors.hand_over(actor)
        elif wanted and actor.mode == DRIVER:
            actor.mode = STORY
            context.actors.show(actor)
    return True


def _begin_start(context: StoryContext, item: StoryItem, actor: StoryActor, running: Running) -> bool:
    """Have an item that waits start in the next step, wherever the ego is."""
    del item, running
    world = context.actors.world
    row = world.row(actor.uid)
    if world.start_within[row] > 0.0:
        world.start_within[row] = 4.0 * MAX_COORDINATE
    return True


# Synchronize


def _begin_sync(context: StoryContext, item: StoryItem, actor: StoryActor, running: Running) -> bool:
    actors = context.actors
    master = actors.find(item["masterEntityRef"])
    own = actors.map.find_place(item.part("TargetPosition"), actors.locate)
    other = actors.map.find_place(item.part("TargetPositionMaster"), actors.locate)
    running.points = [(own.x, own.y, own.z, own.yaw, 0.0, 0.0), (other.x, other.y, other.z, other.yaw, 0.0, 0.0)]
    running.numbers = {"accel": 0.0}
    return master is actor


def _advance_sync(context: StoryContext, item: StoryItem, actor: StoryActor, running: Running) -> bool:
    """Arrive when the master arrives, with the final speed if one is given, by the least accelerations.

    With T until the master arrives, d to the own target and v now, that is 6 d / T^2 - (4 v + 2 final) / T, and
    3 (d - v T) / T^2 without a final speed. With a steady state the final speed is reached as much earlier, and kept.
    """
    master = context.actors.find(item["masterEntityRef"])
    own, other = (MapPlace(*point[:4]) for point in running.points[:2])
    way = context.measures.way_to(running.entity, own)
    masters = context.measures.way_to(item["masterEntityRef"], other)
    time = masters / max(master.speed, 1e-6)
    is_near = way <= item.get("targetTolerance", 0.0) and masters <= item.get("targetToleranceMaster", 0.0)
    end = item.find("FinalSpeed")
    final = actor.speed if end is None else _goal_of(end.part(), master.speed)
    if time <= STORY_STEP or way <= NEAR or is_near:
        actor.speed = final
        return True
    steady = 0.0 if end is None or not end.part().parts else _steady_way(end.part().part(), final)
    way, time = way - steady, time - steady / max(final, 1e-6)
    if steady and (time <= STORY_STEP or way <= NEAR):
        actor.speed = final
        return False
    if end is None:
        accel = 3.0 * (way - actor.speed * time) / (time * time)
    else:
        accel = 6.0 * way / (time * time) - (4.0 * actor.speed + 2.0 * final) / time
    top = context.actors.bodies[running.entity].top_speed or MAX_SPEED
    actor.speed = max(0.0, min(top, _bounded(actor.speed + accel * STORY_STEP)))
    return False


def _steady_way(item: StoryItem, final: float) -> float:
    return float(item["distance"] if item.kind == "TargetDistanceSteadyState" else item["time"] * final)


def _never(_context: StoryContext, _item: StoryItem, _actor: StoryActor, _running: Running) -> bool:
    return True


_CHANGE: Final = ("from", "to", "length", "at")
_LONG: Final = ("longitudinal",)
_LAT: Final = ("lateral",)

MOTIONS: Final[Mapping[str, StoryMotion]] = {
    "SpeedAction": StoryMotion(_LONG, _begin_speed, _advance_speed, _CHANGE),
    "SpeedProfileAction": StoryMotion(_LONG, _begin_profile, _advance_profile, ("at",), 1),
    "LongitudinalDistanceAction": StoryMotion(_LONG, _begin_gap, _advance_gap, ("accel",)),
    "SynchronizeAction": StoryMotion(_LONG, _begin_sync, _advance_sync, ("accel",), 2),
    "LaneChangeAction": StoryMotion(_LAT, _begin_change, _advance_change, (*_CHANGE, "lane")),
    "LaneOffsetAction": StoryMotion(_LAT, _begin_offset, _advance_offset, _CHANGE),
    "LateralDistanceAction": StoryMotion(_LAT, _begin_side, _advance_side, ("rate",)),
    "FollowTrajectoryAction": StoryMotion(_LAT, _begin_trajectory, _advance_trajectory, ("start", "way", "timed"), 2),
    "AssignRouteAction": StoryMotion((), _begin_route, _never),
    "AcquirePositionAction": StoryMotion((), _begin_route, _never),
    "TeleportAction": StoryMotion((), _begin_teleport, _never),
    "ControllerAction": StoryMotion((), _begin_controller, _never),
    "ActivateControllerAction": StoryMotion((), _begin_controller, _never),
    "StartAction": StoryMotion((), _begin_start, _never),
    "VisibilityAction": StoryMotion((), _never, _never),
    "AppearanceAction": StoryMotion((), _never, _never),
}
"""Kinds of private actions."""
