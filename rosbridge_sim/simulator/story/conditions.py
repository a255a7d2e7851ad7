"""Conditions of a story: each returns the figure that it compares, and whether it holds.

Each kind is a row of `OF_ENTITY` (for one triggering entity) or `OF_VALUE`. An entity that is not in the world fulfils
no condition. A time to collision or a headway that is not defined (the other is behind, or is not approached) fulfils
none either.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Final

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.scenarios.openscenario.story import ELEMENT_TYPES
from rosbridge_sim.scenarios.openscenario.story_records import StoryItem
from rosbridge_sim.simulator.story.measures import Target
from rosbridge_sim.simulator.story.story_actors import StoryActor
from rosbridge_sim.simulator.story.story_context import StoryContext
from rosbridge_sim.world.state.world import Kind

EQUAL: Final = 1e-6
"""Numbers that differ by less than this are equal."""

TOUCHES: Final[Mapping[str, Kind]] = {
    "pedestrian": Kind.PEDESTRIAN,
    "vehicle": Kind.VEHICLE,
    "miscellaneous": Kind.OBSTACLE,
    "external": Kind.EGO,
}
"""Types of `ByType`."""

OfEntity = Callable[[StoryContext, StoryItem, str, StoryActor], float]
"""Returns the figure that a condition compares for a triggering entity, which is in the world; NaN for none."""


def compare(rule: str, figure: float, value: float) -> bool:
    """Return whether a figure fulfils a rule; NaN fulfils none."""
    if math.isnan(figure):
        return False
    if abs(figure - value) < EQUAL:
        return rule in {"equalTo", "greaterOrEqual", "lessOrEqual"}
    return rule == "notEqualTo" or rule.startswith("greater" if figure > value else "less")


def measure(context: StoryContext, condition: StoryItem) -> tuple[bool, float]:
    """Return whether a `Condition` holds now, without edge and delay, and the figure that it compares; NaN for none."""
    item = condition.part("ByEntityCondition", "ByValueCondition")
    if item.kind == "ByValueCondition":
        return OF_VALUE[item.part().kind](context, item.part())
    triggering, inner = item.part("TriggeringEntities"), item.part("EntityCondition").part()
    figures = [_figure(context, inner, each["entityRef"]) for each in triggering.parts]
    holds = [holds_for(inner, figure) for figure in figures]
    choose = any if triggering["triggeringEntitiesRule"] == "any" else all
    figure = next((each for each, is_so in zip(figures, holds, strict=True) if is_so), [*figures, math.nan][0])
    return bool(holds) and choose(holds), figure


def _figure(context: StoryContext, item: StoryItem, name: str) -> float:
    """Return the figure of a triggering entity; NaN where it, another entity or a place is not there."""
    try:
        return OF_ENTITY[item.kind](context, item, name, context.actors.find(name))
    except DocumentError:
        return math.nan


def holds_for(item: StoryItem, figure: float) -> bool:
    """Return whether a figure fulfils a condition: its rule, its duration, its tolerance, or else its least value."""
    if "rule" in item.values:
        return compare(item["rule"], figure, item["value"])
    if "duration" in item.values:
        return figure >= max(float(item["duration"]), EQUAL) - EQUAL
    least: float = item.get("value", 1.0)
    return figure <= float(item["tolerance"]) if "tolerance" in item.values else figure >= least


def _speed_of(context: StoryContext, name: str, item: StoryItem) -> float:
    actor, direction = context.actors.find(name), item.get("direction")
    if direction == "lateral":
        return actor.aside * context.actors.on_lane(name).direction
    return 0.0 if direction == "vertical" else actor.speed


def _speed(context: StoryContext, item: StoryItem, name: str, _: StoryActor) -> float:
    return _speed_of(context, name, item)


def _relative_speed(context: StoryContext, item: StoryItem, name: str, _: StoryActor) -> float:
    return _speed_of(context, name, item) - _speed_of(context, item["entityRef"], item)


def _acceleration(_: StoryContext, item: StoryItem, _name: str, actor: StoryActor) -> float:
    return actor.accel if item.get("direction", "longitudinal") == "longitudinal" else 0.0


def _own(key: str) -> OfEntity:
    """Return a condition that compares an attribute of the actor itself."""
    return lambda _context, _item, _name, actor: float(getattr(actor, key))


def _collision(context: StoryContext, item: StoryItem, _: str, actor: StoryActor) -> float:
    world, touched = context.actors.world, context.actors.touching.get(actor.uid, [])
    reference, kind = item.find("EntityRef"), item.find("ByType")
    if reference is not None:
        touched = [uid for uid in touched if uid == context.actors.by_name[reference["entityRef"]].uid]
    elif kind is not None:
        touched = [uid for uid in touched if uid in world and world.kind[world.row(uid)] == TOUCHES[kind["type"]]]
    return float(len(touched))


def _target(context: StoryContext, item: StoryItem) -> Target:
    """Return the name of the entity, or the place, that a condition measures to."""
    reference = item.get("entityRef") or (item.find("EntityRef") or item).get("entityRef")
    return reference or context.actors.map.find_place(item.part("Position"), context.actors.locate)


def _reach(context: StoryContext, item: StoryItem, _: str, actor: StoryActor) -> float:
    place = context.actors.map.find_place(item.part("Position"), context.actors.locate)
    return math.dist((actor.x, actor.y, actor.z), (place.x, place.y, place.z))


def _distance(context: StoryContext, item: StoryItem, name: str, _: StoryActor) -> float:
    return abs(context.measures.distance(name, _target(context, item), item))


def _headway(context: StoryContext, item: StoryItem, name: str, actor: StoryActor) -> float:
    away = context.measures.distance(name, item["entityRef"], item)
    return away / actor.speed if away >= 0.0 and actor.speed > EQUAL else math.nan


def _time_to_collision(context: StoryContext, item: StoryItem, name: str, actor: StoryActor) -> float:
    target = _target(context, item.part("TimeToCollisionConditionTarget"))
    away, closing = context.measures.distance(name, target, item), actor.speed
    if isinstance(target, str):
        other = context.actors.find(target)
        closing -= other.speed * math.cos(other.yaw - actor.yaw)
    return away / closing if away >= 0.0 and closing > EQUAL else math.nan


# By value


def _as_number(text: str) -> float:
    try:
        return {"true": 1.0, "false": 0.0}[text] if text in {"true", "false"} else float(text)
    except ValueError:
        return math.nan


def _value(context: StoryContext, item: StoryItem) -> tuple[bool, float]:
    text = context.values[item.get("variableRef", item.get("parameterRef", ""))]
    figure, wanted = _as_number(text), _as_number(item["value"])
    if math.isnan(figure) or math.isnan(wanted):
        is_same = text == item["value"]
        return {"equalTo": is_same, "notEqualTo": not is_same}.get(item["rule"], False), math.nan
    return compare(item["rule"], figure, wanted), figure


def _is_seen(context: StoryContext, item: StoryItem) -> bool:
    kind = ELEMENT_TYPES[item["storyboardElementType"]]
    return context.board.seen(kind, item["storyboardElementRef"], item["state"])


OF_ENTITY: Final[Mapping[str, OfEntity]] = {
    "SpeedCondition": _speed,
    "RelativeSpeedCondition": _relative_speed,
    "AccelerationCondition": _acceleration,
    "StandStillCondition": _own("still"),
    "EndOfRoadCondition": _own("at_end"),
    "OffroadCondition": _own("off_road"),
    "TraveledDistanceCondition": _own("travelled"),
    "CollisionCondition": _collision,
    "ReachPositionCondition": _reach,
    "DistanceCondition": _distance,
    "RelativeDistanceCondition": _distance,
    "TimeHeadwayCondition": _headway,
    "TimeToCollisionCondition": _time_to_collision,
}
OF_VALUE: Final[Mapping[str, Callable[[StoryContext, StoryItem], tuple[bool, float]]]] = {
    "ParameterCondition": _value,
    "VariableCondition": _value,
    "SimulationTimeCondition": lambda context, item: (holds_for(item, context.time()), context.time()),
    "StoryboardElementStateCondition": lambda context, item: (_is_seen(context, item), math.nan),
    "TrafficSignalCondition": lambda context, item: (context.light(item["name"], item["state"]), math.nan),
    "TrafficSignalControllerCondition": lambda context, item: (
        context.phase(item["trafficSignalControllerRef"], item["phase"]),
        math.nan,
    ),
}
