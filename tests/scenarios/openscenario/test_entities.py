"""Entities of stories as agents: exact sizes, axles, limits, models, and places at the start."""

from __future__ import annotations

from typing import Any

import pytest

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.records import replace
from rosbridge_sim.scenarios.catalogue import DEFAULT_EGO, Catalogue, Model, default_model
from rosbridge_sim.scenarios.openscenario.entities import place_entities, story_scenario
from rosbridge_sim.scenarios.openscenario.places import StoryMap
from rosbridge_sim.scenarios.openscenario.story import read_story
from rosbridge_sim.scenarios.openscenario.story_records import Story, StoryText
from rosbridge_sim.scenarios.scenario import Scenario
from rosbridge_sim.world.state.world import Body, Kind
from tests.simulator.story.story_texts import CAR, at, lanes, link, story, teleport

AXLE = '<{}Axle maxSteering="0.5" wheelDiameter="0.6" trackWidth="1.6" positionX="{}" positionZ="0.3"/>'


def read(text: str, **more: Any) -> Story:  # noqa: ANN401 - fields of StoryText
    return read_story(StoryText("s.xosc", text.encode(), **more))


def vehicle(
    x: float = 1.4, length: float = 5.0, axles: tuple[float, float] | None = None, more: str = 'vehicleCategory="car"'
) -> Model:
    """The model of a vehicle whose box has its middle at `x`, with the places of its front and rear axle."""
    text = CAR.replace('x="1.4"', f'x="{x}"').replace('length="5"', f'length="{length}"')
    text = text.replace('vehicleCategory="car"', more)
    if axles is not None:
        inner = "".join(AXLE.format(name, place) for name, place in zip(("Front", "Rear"), axles, strict=True))
        text = text.replace("</Vehicle>", f"<Axles>{inner}</Axles></Vehicle>")
    entity = f'<ScenarioObject name="Own">{text}</ScenarioObject>'
    (spawn,) = story_scenario(read(story({"Ego": ""}, entities=entity)), "s", None).vehicles
    return spawn.model


def measures(body: Body) -> tuple[float, float, float]:
    """Wheelbase, overhang behind the rear axle and overhang before the front one, rounded."""
    return round(body.wheelbase, 6), round(body.rear_overhang, 6), round(body.front_overhang, 6)


LIKE = DEFAULT_EGO.body.wheelbase / DEFAULT_EGO.body.length
"""Wheelbase of the model for each metre of length."""


@pytest.mark.parametrize(
    ("x", "axles", "expected"),
    [
        (1.4, (2.8, 0.0), (2.8, 1.1, 1.1)),
        (1.4, (3.0, 0.5), (2.5, 1.1, 1.4)),
        (1.4, (0.0, 0.0), (5.0 * LIKE, 1.1, 3.9 - 5.0 * LIKE)),  # one axle behind the other: those of the model
        (1.4, None, (5.0 * LIKE, 1.1, 3.9 - 5.0 * LIKE)),
        (3.0, (2.0, 0.0), (2.0, 0.0, 3.0)),  # the box begins before the axle
        (-1.5, (4.0, 0.0), (1.0, 4.0, 0.0)),  # the box ends behind the front axle
        (-9.0, (4.0, 0.0), (DEFAULT_EGO.body.wheelbase, 5.0, 0.0)),
    ],
)
def test_overhangs_follow_from_the_middle_of_the_box_and_the_axles(
    x: float, axles: tuple[float, float] | None, expected: tuple[float, float, float]
) -> None:
    assert measures(vehicle(x, axles=axles).body) == tuple(round(each, 6) for each in expected)


@pytest.mark.parametrize(("length", "is_own"), [(0.01, True), (0.009, False)])
def test_size_of_less_than_a_centimetre_is_that_of_the_model(length: float, *, is_own: bool) -> None:
    body = vehicle(0.0, length, (0.005, 0.0)).body
    assert (body.length, body.width) == ((length, 2.0) if is_own else (DEFAULT_EGO.body.length, DEFAULT_EGO.body.width))


@pytest.mark.parametrize(
    ("more", "name"),
    [
        ('vehicleCategory="truck"', "Truck"),
        ('vehicleCategory="bicycle"', "Bicycle"),
        ('vehicleCategory="tram"', DEFAULT_EGO.name),
        ('vehicleCategory="bus" model3d="kia k5"', "2015_Kia_K5"),
        ('vehicleCategory="bus" model3d="Traffic_Cone"', "Bus"),
    ],
)
def test_model_of_a_vehicle_is_that_of_its_name_or_its_category(more: str, name: str) -> None:
    assert vehicle(more=more).name == name


def test_limits_that_are_not_above_0_are_those_of_the_model() -> None:
    text = CAR.replace('maxSpeed="70" maxAcceleration="10"', 'maxSpeed="0" maxAcceleration="-1"')
    entity = f'<ScenarioObject name="Own">{text}</ScenarioObject>'
    body = story_scenario(read(story({"Ego": ""}, entities=entity)), "s", None).vehicles[0].model.body
    like = DEFAULT_EGO.body
    assert (body.top_speed, body.max_accel, body.max_decel) == (like.top_speed, like.max_accel, 10.0)


THING = """<ScenarioObject name="box"><MiscObject name="box" miscObjectCategory="barrier"><BoundingBox>
<Center x="0.5" y="0" z="0.5"/><Dimensions length="3" width="2" height="1"/></BoundingBox></MiscObject>
</ScenarioObject>"""


def test_pedestrians_and_things_have_the_overhangs_of_their_box() -> None:
    scenario = story_scenario(read(story({"Ego": "", "walker": ""}, entities=THING)), "s", None)
    (walker,), (box,) = scenario.pedestrians, scenario.obstacles
    assert (walker.kind, walker.model.name) == (Kind.PEDESTRIAN, default_model(Kind.PEDESTRIAN).name)
    assert (walker.model.body.rear_overhang, walker.model.body.front_overhang) == (0.25, 0.25)
    assert (box.kind, box.model.name) == (Kind.OBSTACLE, default_model(Kind.OBSTACLE).name)
    body = box.model.body
    assert (body.length, body.width, body.height) == (3.0, 2.0, 1.0)
    assert (body.rear_overhang, body.front_overhang) == (1.0, 2.0)


def test_size_that_no_body_can_have_is_told_with_its_line() -> None:
    text = story({"Ego": ""}, entities=THING.replace('x="0.5"', 'x="9"'))
    with pytest.raises(DocumentError, match=r"^s\.xosc: line \d+: MiscObject: "):
        story_scenario(read(text), "s", None)


def test_ego_needs_an_engine_and_brakes() -> None:
    text = story({"Ego": ""}).replace('vehicleCategory="car"', 'vehicleCategory="trailer" model3d="Trailer"')
    still = replace(DEFAULT_EGO, name="Trailer", body=replace(DEFAULT_EGO.body, max_accel=0.0))
    text = text.replace('maxAcceleration="10"', 'maxAcceleration="0"')
    with pytest.raises(
        DocumentError, match=r"^s\.xosc: line \d+: expected an ego with a wheelbase, an engine and brakes$"
    ):
        story_scenario(read(text), "s", None, Catalogue([still]))


def test_lenient_reading_notes_what_is_left_out() -> None:
    text = story({"Ego": "<PrivateAction><RoutingAction><RandomRouteAction/></RoutingAction></PrivateAction>"})
    (note,) = story_scenario(read(text, is_lenient=True), "s", None).notes
    assert note.endswith("RandomRouteAction is not supported; left out")


def placed(init: dict[str, str], more: str = "") -> Scenario:
    text = story(init, entities=THING).replace("<Init><Actions>", f"<Init><Actions>{more}")
    return place_entities(story_scenario(read(text), "s", None), StoryMap.of(lanes()))


def test_entities_are_where_init_teleports_them_and_others_are_not_there() -> None:
    add = f'<EntityAction entityRef="box"><AddEntityAction>{at(7, 8)}</AddEntityAction></EntityAction>'
    relative = '<Position><RelativeObjectPosition entityRef="Other" dx="10" dy="2"/></Position>'
    init = {
        "Ego": "",
        "Other": teleport(link("middle", 30.0)) + teleport(at(5, 6, 7.0)),
        "walker": teleport(relative.replace("Object", "World")),
        "Gone": "",
    }
    scenario = placed(init, f"<GlobalAction>{add}</GlobalAction>")
    assert [(spawn.name, spawn.x, spawn.y) for spawn in scenario.egos] == [("Ego", 0.0, 0.0)]
    assert [(spawn.name, spawn.x, spawn.y) for spawn in scenario.vehicles] == [("Other", 5.0, 6.0)]
    assert scenario.vehicles[0].yaw == pytest.approx(7.0 - 2.0 * 3.141592653589793)
    assert [(spawn.x, spawn.y) for spawn in (*scenario.pedestrians, *scenario.obstacles)] == [(15.0, 8.0), (7.0, 8.0)]


def test_place_relative_to_an_entity_that_has_none_yet_is_told() -> None:
    relative = '<Position><RelativeWorldPosition entityRef="Other" dx="10" dy="2"/></Position>'
    with pytest.raises(DocumentError, match="RelativeWorldPosition: Other has no place yet: place it further above"):
        placed({"Ego": teleport(relative), "Other": teleport(at(1, 2))})
