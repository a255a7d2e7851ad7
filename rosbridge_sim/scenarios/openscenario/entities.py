"""Entities of a story -> agents of a scenario: models by name, category and size, and places at the start."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Final

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.printable import printable
from rosbridge_sim.records import replace
from rosbridge_sim.scenarios.catalogue import BUILT_IN, DEFAULT_EGO, Catalogue, Model, default_model
from rosbridge_sim.scenarios.openscenario.places import MapPlace, OnLane, StoryMap
from rosbridge_sim.scenarios.openscenario.story_records import Story, StoryItem
from rosbridge_sim.scenarios.scenario import Scenario, Spawn
from rosbridge_sim.world.state.world import Body, Kind

_MODELS: Final = {"van": "Van", "truck": "Truck", "bus": "Bus", "motorbike": "Motorcycle", "bicycle": "Bicycle"}
"""Categories of vehicles -> models of the catalogue; all others have that of a car."""

MIN_SIZE: Final = 0.01
"""A smaller length, width or height counts as not given [m]: MORAI writes 0."""


def story_scenario(story: Story, name: str, map_name: str | None, catalogue: Catalogue = BUILT_IN) -> Scenario:
    """Return the scenario of a story: its entities without places, which `place_entities` gives them.

    Raises:
        DocumentError: an entity has a size that no body can have.
    """
    spawns = {key: _spawn(item, catalogue, is_ego=key == story.ego) for key, item in story.entities.items()}
    of = {kind: tuple([each for each in spawns.values() if each.kind is kind]) for kind in Kind}
    notes = (*story.findings.idle, *story.findings.notes)
    if story.text.is_lenient:
        notes += tuple([f"{line}; left out" for line in story.findings.refused])
    spawned = of[Kind.EGO], of[Kind.VEHICLE], of[Kind.PEDESTRIAN], of[Kind.OBSTACLE]
    return Scenario(name, map_name, *spawned, notes=notes, story=story)


def place_entities(scenario: Scenario, story_map: StoryMap) -> Scenario:
    """Return the scenario with its entities where the file's `Init` teleports them; without those that it does not.

    An ego stays in any case: at the map's origin, if the file does not say where.

    Raises:
        DocumentError: the map has no such place.
    """
    story = scenario.story
    assert story is not None
    places: dict[str, MapPlace] = {}

    def find(name: str) -> tuple[MapPlace, OnLane]:
        if name not in places:
            raise DocumentError(f"{printable(name, 60)} has no place yet: place it further above")
        return places[name], story_map.project(places[name])

    for name, position in first_positions(story):
        places[name] = story_map.find_place(position, find)

    def put(spawn: Spawn) -> Spawn:
        place = places.get(spawn.name, MapPlace(0.0, 0.0, 0.0, 0.0))
        yaw, roll, pitch = (math.remainder(angle, math.tau) for angle in (place.yaw, place.roll, place.pitch))
        return replace(spawn, x=place.x, y=place.y, z=place.z, yaw=yaw, roll=roll, pitch=pitch)

    parts = {part: getattr(scenario, part) for part in ("vehicles", "pedestrians", "obstacles")}
    there = {part: tuple([put(each) for each in of if each.name in places]) for part, of in parts.items()}
    return replace(scenario, egos=tuple(map(put, scenario.egos)), **there)


def first_positions(story: Story) -> Iterator[tuple[str, StoryItem]]:
    """Yield the names of entities and the positions that `Init` gives them, in order."""
    for action in story.init.parts:
        if action.kind == "Private":
            for each in action.parts:
                teleport = each.find("TeleportAction")
                if teleport is not None:
                    yield action["entityRef"], teleport.part("Position")
        elif (entity := action.find("EntityAction")) and (add := entity.find("AddEntityAction")):
            yield entity["entityRef"], add.part("Position")


def _spawn(item: StoryItem, catalogue: Catalogue, *, is_ego: bool) -> Spawn:
    object_ = item.part("Vehicle", "Pedestrian", "MiscObject")
    model = _model(object_, catalogue)
    try:
        model = replace(model, body=_body(object_, model))
    except ValueError as error:
        raise DocumentError(f"{object_.where}: {object_.kind}: {error}") from None
    kind = Kind.EGO if is_ego else model.kind
    if is_ego and min(model.body.wheelbase, model.body.max_accel, model.body.max_decel) <= 0.0:
        raise DocumentError(f"{object_.where}: expected an ego with a wheelbase, an engine and brakes")
    return Spawn(kind, model, item["name"], None, 0.0, 0.0, 0.0, 0.0, where=object_.where)


def _model(item: StoryItem, catalogue: Catalogue) -> Model:
    """Return the model of the catalogue that something is like."""
    kind = {"Vehicle": Kind.VEHICLE, "Pedestrian": Kind.PEDESTRIAN}.get(item.kind, Kind.OBSTACLE)
    for name in (item.get("model3d", ""), item["name"]):
        found = catalogue.find(name)
        if name and found is not None and found.kind is kind:
            return found
    if kind is not Kind.VEHICLE:
        return default_model(kind)
    return catalogue.find(_MODELS.get(item["vehicleCategory"], "")) or DEFAULT_EGO


def _body(item: StoryItem, model: Model) -> Body:
    """Return the body of a model with the size, the axles and the limits of the file.

    Raises:
        ValueError: no body can have them.
    """
    like = model.body
    box = item.part("BoundingBox")
    size = [box.part("Dimensions")[key] for key in ("length", "width", "height")]
    changes: dict[str, float] = {}
    if min(size) >= MIN_SIZE:
        length, width, height = size
        ahead = box.part("Center")["x"]
        changes |= {"length": length, "width": width, "height": height}
        if model.kind is Kind.VEHICLE:
            changes |= _axles(item.find("Axles"), length, length / 2 - ahead, like)
        else:
            changes |= {"front_overhang": length / 2 + ahead, "rear_overhang": length / 2 - ahead}
    changes |= _limits(item.find("Performance"))
    return replace(like, **changes)


def _axles(axles: StoryItem | None, length: float, rear: float, like: Body) -> dict[str, float]:
    """Return wheelbase and overhangs; the overhang behind the rear axle follows from the middle of the box."""
    front_axle, rear_axle = (None if axles is None else axles.find(kind) for kind in ("FrontAxle", "RearAxle"))
    wheelbase = like.wheelbase * length / like.length
    if front_axle is not None and rear_axle is not None and front_axle["positionX"] > rear_axle["positionX"]:
        wheelbase = front_axle["positionX"] - rear_axle["positionX"]
    rear = min(max(rear, 0.0), length)
    wheelbase = min(wheelbase, length - rear) or like.wheelbase
    return {"wheelbase": wheelbase, "rear_overhang": rear, "front_overhang": max(length - rear - wheelbase, 0.0)}


def _limits(performance: StoryItem | None) -> Mapping[str, float]:
    keys = {"maxSpeed": "top_speed", "maxAcceleration": "max_accel", "maxDeceleration": "max_decel"}
    values = {} if performance is None else performance.values
    return {own: values[key] for key, own in keys.items() if values.get(key, 0.0) > 0.0}
