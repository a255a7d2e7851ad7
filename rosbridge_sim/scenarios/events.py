"""Blocks `rosbridge_sim` of MORAI's scenario JSON -> a story, told like one of OpenSCENARIO.

The items stay those of the document: the world drives them by MORAI's keys, and the story takes a vehicle for the time
of an event. A snapshot has the blocks as text.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Final

import msgspec

from rosbridge_sim.documents.document_model import DocumentType
from rosbridge_sim.documents.document_reading import read_document
from rosbridge_sim.errors import DocumentError
from rosbridge_sim.maps.road_map import RoadMap
from rosbridge_sim.printable import printable
from rosbridge_sim.records import replace
from rosbridge_sim.scenarios.event_model import (
    EventBlocks,
    ItemBlock,
    LightEvent,
    PlaceToPass,
    ScenarioBlock,
    VehicleBlock,
    VehicleEvent,
    VehicleWhen,
    When,
)
from rosbridge_sim.scenarios.openscenario.places import MapPlace, OnLane, StoryMap
from rosbridge_sim.scenarios.openscenario.story import check_story, each_item, read_story
from rosbridge_sim.scenarios.openscenario.story_records import (
    BLOCKS,
    MAX_STORY_BYTES,
    Story,
    StoryItem,
    StoryText,
)
from rosbridge_sim.scenarios.scenario_model import ScenarioDocument, blocks_of
from rosbridge_sim.suggestions import hint
from rosbridge_sim.units import KMH_TO_MPS

EGO: Final = "egoVehicle"

_BLOCKS: Final = DocumentType[EventBlocks](EventBlocks)


def document_story(document: ScenarioDocument, source: str) -> Story | None:
    """Return the story of the blocks of a document; None if they hold no event.

    Raises:
        DocumentError: there are too many events.
    """
    vehicles: dict[str, VehicleBlock] = {}
    items: dict[str, ItemBlock] = {}
    for at, block in blocks_of(document):
        if isinstance(block, VehicleBlock) and (block.events or block.start_when):
            vehicles[at] = block
        elif isinstance(block, ItemBlock) and block.start_when:
            items[at] = block
    scenario = document.rosbridge_sim or ScenarioBlock()
    if not (vehicles or items or scenario.events):
        return None
    blocks = EventBlocks(vehicles=vehicles, items=items, scenario=scenario)
    return blocks_story(StoryText(source, msgspec.json.encode(blocks)))


def read_saved_story(text: StoryText) -> Story:
    """Return the story of the text that a snapshot has: blocks, or OpenSCENARIO.

    Raises:
        DocumentError: it is none.
    """
    return blocks_story(text) if text.text.startswith(BLOCKS) else read_story(text)


def blocks_story(text: StoryText) -> Story:
    """Return the story of blocks.

    Args:
        text: `EventBlocks` as JSON.

    Raises:
        DocumentError: it is something else, or there are too many events.
    """
    blocks = read_document(_BLOCKS, text.text, text.source, MAX_STORY_BYTES)
    groups: list[StoryItem] = []
    for at, block in {**blocks.vehicles, **blocks.items}.items():
        path = f"{at}.rosbridge_sim"
        if block.start_when is not None:
            groups.append(_group(text, f"{path}.start_when", block.start_when, at, [_item("StartAction")], key=""))
        for number, event in enumerate((block.events or ()) if isinstance(block, VehicleBlock) else ()):
            groups.append(_group(text, f"{path}.events[{number}]", event.when, at, list(_changes(event, at))))
    for number, light in enumerate(blocks.scenario.events or ()):
        path = f"rosbridge_sim.events[{number}]"
        groups.append(_group(text, path, light.when, "", [_shows(light, f"{text.source}: {path}.light")]))
    act = _item("Act", *groups, name="events")
    story = Story(
        text=text,
        entities={at: _item("ScenarioObject", name=at) for at in (EGO, *blocks.vehicles, *blocks.items)},
        ego=EGO,
        init=_item("Actions"),
        storyboard=_item("Storyboard", _item("Story", act, name="rosbridge_sim")),
    )
    check_story(story)
    for mistake in story.findings.mistakes:
        raise DocumentError(mistake)
    return story


def check_places(story: Story, road_map: RoadMap) -> None:
    """Check that a map has the links and the lights of events.

    Raises:
        DocumentError: it has not; the text has the place in the document.
    """
    story_map = StoryMap.of(road_map)
    lights = [light.name for light in road_map.plan.lights]

    def find(name: str) -> tuple[MapPlace, OnLane]:
        raise DocumentError(f"no place of {name}")

    for item in each_item(story.storyboard):
        if item.kind == "Position":
            story_map.find_place(item, find)
        elif item.kind == "TrafficSignalStateAction" and item["name"] not in lights:
            name = item["name"]
            raise DocumentError(f"{item.where}: the map has no light {printable(name, 60)!r}{hint(name, lights)}")


# Blocks -> items of a story


def _item(kind: str, *parts: StoryItem, where: str = "", **values: Any) -> StoryItem:  # noqa: ANN401 - see `StoryItem`
    return StoryItem(kind, values, parts, where)


def _group(
    text: StoryText, path: str, when: When, actor: str, actions: list[StoryItem], *, key: str = ".when"
) -> StoryItem:
    """Return the group of an event, which has the path of its place in the document as name.

    Args:
        key: of the trigger within it.
    """
    where = f"{text.source}: {path}"
    start = _item("StartTrigger", _item("ConditionGroup", *_conditions(when, actor, where + key)))
    parts = [_item("Action", replace(each, where=where), name=path) for each in actions]
    event = _item("Event", *parts, start, name=path, priority="parallel")
    actors = _item("Actors", *([_item("EntityRef", entityRef=actor)] if actor else []))
    return _item("ManeuverGroup", actors, _item("Maneuver", event, name=path), name=path)


def _conditions(when: When, actor: str, where: str) -> Iterator[StoryItem]:
    """Yield the conditions of a trigger."""
    if when.time is not None:
        time = _item("SimulationTimeCondition", value=when.time, rule="greaterOrEqual")
        yield _item("Condition", _item("ByValueCondition", time), name=f"time {when.time:g} s")
    if when.ego_passes is not None:
        yield _passes("ego_passes", when.ego_passes, EGO, where)
    if isinstance(when, VehicleWhen) and when.passes is not None:
        yield _passes("passes", when.passes, actor, where)
    if isinstance(when, VehicleWhen) and when.ego_within is not None:
        values = {"value": when.ego_within, "rule": "lessOrEqual", "entityRef": actor}
        near = StoryItem("RelativeDistanceCondition", {**values, "relativeDistanceType": "euclidianDistance"}, (), "")
        yield _by_entity(EGO, near, f"ego_within {when.ego_within:g} m")


def _passes(key: str, place: PlaceToPass, actor: str, where: str) -> StoryItem:
    at = f"{where}.{key}"
    if place.link is not None:
        position = _item("LinkPosition", where=at, linkId=place.link, s=place.s)
    else:
        position = _item("WorldPosition", where=at, x=place.x, y=place.y)
    reach = _item("ReachPositionCondition", _item("Position", position), tolerance=place.within)
    return _by_entity(actor, reach, key)


def _by_entity(actor: str, condition: StoryItem, name: str) -> StoryItem:
    triggering = _item("TriggeringEntities", _item("EntityRef", entityRef=actor), triggeringEntitiesRule="any")
    return _item("Condition", _item("ByEntityCondition", triggering, _item("EntityCondition", condition)), name=name)


def _changes(event: VehicleEvent, actor: str) -> Iterator[StoryItem]:
    """Yield the actions of a vehicle's event."""
    over = {"dynamicsDimension": "time", "value": event.seconds}
    smooth, even = ({**over, "dynamicsShape": shape} for shape in ("sinusoidal", "linear"))
    if event.change_lane is not None:
        steps = 1 if event.change_lane == "left" else -1
        target = _item("LaneChangeTarget", _item("RelativeTargetLane", entityRef=actor, value=steps))
        yield _item("LaneChangeAction", StoryItem("LaneChangeActionDynamics", smooth, (), ""), target)
    if event.speed_kmh is not None:
        goal = _item("SpeedActionTarget", _item("AbsoluteTargetSpeed", value=event.speed_kmh * KMH_TO_MPS))
        yield _item("SpeedAction", StoryItem("SpeedActionDynamics", even, (), ""), goal)


def _shows(event: LightEvent, where: str) -> StoryItem:
    state = _item("TrafficSignalStateAction", where=where, name=event.light, state=event.state)
    return _item("GlobalAction", _item("InfrastructureAction", _item("TrafficSignalAction", state)))
