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
from rosbridge_sim.scenarios.openscenario.places import MapPlace
from rosbridge_sim.scenarios.openscenario.story import ELEMENT_TYPES
from rosbridge_sim.scenarios.openscenario.story_records import StoryItem
from rosbridge_sim.simulator.story.cast import StoryActor
from rosbridge_sim.simulator.story.stage import Stage
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


def compare(rule: str, figure: float, value: float) -> bool:
    """Return whether a figure fulfils a rule; NaN fulfils none."""
    if math.isnan(figure):
        return False
    if abs(figure - value) < EQUAL:
        return rule in {"equalTo", "greaterOrEqual", "lessOrEqual"}
    return rule == "notEqualTo" or rule.startswith("greater" if figure > value else "less")


def measure(scene: Stage, condition: StoryItem) -> tuple[bool, float]:
    """Return whether a `Condition` holds now, without edge and delay, and the figure that it compares; NaN for none."""
    item = condition.part("ByEntityCondition", "ByValueCondition")
    if item.kind == "ByValueCondition":
        return OF_VALUE[item.part().kind](scene, item.part())
    triggering, inner = item.part("TriggeringEntities"), item.part("EntityCondition").part()
    results = []
    for each in triggering.parts:
        actor = scene.cast.actors[each["entityRef"]]
        try:
            results.append(
                OF_ENTITY[inner.kind](scene, inner, each["entityRef"], actor) if actor.uid >= 0 else (False, math.nan)
            )
        except DocumentError:  # another entity or a place that is not there
            results.append((False, math.nan))
    holds = [is_so for is_so, _ in results]
    choose = any if triggering["triggeringEntitiesRule"] == "any" else all
    figure = next((value for is_so, value in results if is_so), results[0][1] if results else math.nan)
    return bool(results) and choose(holds), figure


def _by_rule(item: StoryItem, figure: float) -> tuple[bool, float]:
    return compare(item["rule"], figure, item["value"]), figure


def _speed_of(actor: StoryActor, direction: str | None) -> float:
    if direction == "lateral":
        return actor.aside * actor.direction
    return 0.0 if direction == "vertical" else actor.speed


def _speed(_: Stage, item: StoryItem, _name: str, actor: StoryActor) -> tuple[bool, float]:
    return _by_rule(item, _speed_of(actor, item.get("direction")))


def _relative_speed(scene: Stage, item: StoryItem, _: str, actor: StoryActor) -> tuple[bool, float]:
    other = scene.cast.find(item["entityRef"])
    direction = item.get("direction")
    return _by_rule(item, _speed_of(actor, direction) - _speed_of(other, direction))


def _acceleration(_: Stage, item: StoryItem, _name: str, actor: StoryActor) -> tuple[bool, float]:
    return _by_rule(item, actor.accel if item.get("direction", "longitudinal") == "longitudinal" else 0.0)


def _stand_still(_: Stage, item: StoryItem, _name: str, actor: StoryActor) -> tuple[bool, float]:
    return actor.still >= max(item["duration"], EQUAL) - EQUAL, actor.still


def _end_of_road(_: Stage, item: StoryItem, _name: str, actor: StoryActor) -> tuple[bool, float]:
    return actor.at_end >= max(item["duration"], EQUAL) - EQUAL, actor.at_end


def _off_road(_: Stage, item: StoryItem, _name: str, actor: StoryActor) -> tuple[bool, float]:
    return actor.off_road >= max(item["duration"], EQUAL) - EQUAL, actor.off_road


def _travelled(_: Stage, item: StoryItem, _name: str, actor: StoryActor) -> tuple[bool, float]:
    return actor.travelled >= item["value"], actor.travelled


def _collision(scene: Stage, item: StoryItem, _: str, actor: StoryActor) -> tuple[bool, float]:
    world, touched = scene.cast.world, scene.cast.touching.get(actor.uid, [])
    reference, kind = item.find("EntityRef"), item.find("ByType")
    if reference is not None:
        touched = [uid for uid in touched if uid == scene.cast.actors[reference["entityRef"]].uid]
    elif kind is not None:
        touched = [uid for uid in touched if uid in world and world.kind[world.row(uid)] == TOUCHES[kind["type"]]]
    return bool(touched), float(len(touched))


def _place_of(scene: Stage, item: StoryItem) -> MapPlace:
    return scene.cast.map.find_place(item.part("Position"), scene.cast.locate)


def _reach(scene: Stage, item: StoryItem, _: str, actor: StoryActor) -> tuple[bool, float]:
    place = _place_of(scene, item)
    away = math.dist((actor.x, actor.y, actor.z), (place.x, place.y, place.z))
    return away <= item["tolerance"], away


def _distance(scene: Stage, item: StoryItem, name: str, _: StoryActor) -> tuple[bool, float]:
    return _by_rule(item, abs(scene.measures.to_place(name, _place_of(scene, item), item)))


def _relative_distance(scene: Stage, item: StoryItem, name: str, _: StoryActor) -> tuple[bool, float]:
    return _by_rule(item, abs(scene.measures.to_entity(name, item["entityRef"], item)))


def _headway(scene: Stage, item: StoryItem, name: str, actor: StoryActor) -> tuple[bool, float]:
    away = scene.measures.to_entity(name, item["entityRef"], item)
    return _by_rule(item, away / actor.speed if away >= 0.0 and actor.speed > EQUAL else math.nan)


def _time_to_collision(scene: Stage, item: StoryItem, name: str, actor: StoryActor) -> tuple[bool, float]:
    target = item.part("TimeToCollisionConditionTarget").part()
    if target.kind == "EntityRef":
        away = scene.measures.to_entity(name, target["entityRef"], item)
        other = scene.cast.find(target["entityRef"])
        closing = actor.speed - other.speed * math.cos(other.yaw - actor.yaw)
    else:
        away = scene.measures.to_place(name, scene.cast.map.find_place(target, scene.cast.locate), item)
        closing = actor.speed
    return _by_rule(item, away / closing if away >= 0.0 and closing > EQUAL else math.nan)


# By value


def _as_number(text: str) -> float:
    try:
        return {"true": 1.0, "false": 0.0}[text] if text in {"true", "false"} else float(text)
    except ValueError:
        return math.nan


def _value(scene: Stage, item: StoryItem) -> tuple[bool, float]:
    text = scene.values[item.get("variableRef", item.get("parameterRef", ""))]
    figure, wanted = _as_number(text), _as_number(item["value"])
    if math.isnan(figure) or math.isnan(wanted):
        is_same = text == item["value"]
        return {"equalTo": is_same, "notEqualTo": not is_same}.get(item["rule"], False), math.nan
    return compare(item["rule"], figure, wanted), figure


def _time(scene: Stage, item: StoryItem) -> tuple[bool, float]:
    return _by_rule(item, scene.time())


def _state(scene: Stage, item: StoryItem) -> tuple[bool, float]:
    kind = ELEMENT_TYPES[item["storyboardElementType"]]
    return scene.board.seen(kind, item["storyboardElementRef"], item["state"]), math.nan


def _light(scene: Stage, item: StoryItem) -> tuple[bool, float]:
    return scene.light(item["name"], item["state"]), math.nan


def _phase(scene: Stage, item: StoryItem) -> tuple[bool, float]:
    return scene.phase(item["trafficSignalControllerRef"], item["phase"]), math.nan


OF_ENTITY: Final[Mapping[str, Callable[[Stage, StoryItem, str, StoryActor], tuple[bool, float]]]] = {
    "SpeedCondition": _speed,
    "RelativeSpeedCondition": _relative_speed,
    "AccelerationCondition": _acceleration,
    "StandStillCondition": _stand_still,
    "EndOfRoadCondition": _end_of_road,
    "OffroadCondition": _off_road,
    "TraveledDistanceCondition": _travelled,
    "CollisionCondition": _collision,
    "ReachPositionCondition": _reach,
    "DistanceCondition": _distance,
    "RelativeDistanceCondition": _relative_distance,
    "TimeHeadwayCondition": _headway,
    "TimeToCollisionCondition": _time_to_collision,
}
OF_VALUE: Final[Mapping[str, Callable[[Stage, StoryItem], tuple[bool, float]]]] = {
    "ParameterCondition": _value,
    "VariableCondition": _value,
    "SimulationTimeCondition": _time,
    "StoryboardElementStateCondition": _state,
    "TrafficSignalCondition": _light,
    "TrafficSignalControllerCondition": _phase,
}
