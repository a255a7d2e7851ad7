"""Reading of OpenSCENARIO: parameters, expressions, catalogues, mistakes, refusals, and bounds."""

from __future__ import annotations

import re

import pytest

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.scenarios.openscenario import story as story_module
from rosbridge_sim.scenarios.openscenario.entities import story_scenario
from rosbridge_sim.scenarios.openscenario.grammar import GRAMMAR, LEFT_OUT
from rosbridge_sim.scenarios.openscenario.story import (
    catalogue_folders,
    declared_parameters,
    examine_story,
    read_story,
)
from rosbridge_sim.scenarios.openscenario.story_items import evaluate
from rosbridge_sim.scenarios.openscenario.story_records import Story, StoryText
from rosbridge_sim.simulator.story.conditions import OF_ENTITY, OF_VALUE
from rosbridge_sim.simulator.story.motions import MOTIONS
from rosbridge_sim.world.state.world import Kind
from tests.simulator.story.story_texts import CAR, after, at, by_entity, event, group, speed, state_of, story

CATALOGUE = """<OpenSCENARIO><FileHeader revMajor="1" revMinor="2"/><Catalog name="Cars">
<Vehicle name="fast" vehicleCategory="car"><ParameterDeclarations>
<ParameterDeclaration name="Top" parameterType="double" value="${180 / 3.6}"/></ParameterDeclarations>
<BoundingBox><Center x="1.4" y="0" z="0.75"/><Dimensions length="4.2" width="1.9" height="1.4"/></BoundingBox>
<Performance maxSpeed="$Top" maxAcceleration="8" maxDeceleration="9"/><Axles>
<FrontAxle maxSteering="0.5" wheelDiameter="0.6" trackWidth="1.6" positionX="2.6" positionZ="0.3"/>
<RearAxle maxSteering="0" wheelDiameter="0.6" trackWidth="1.6" positionX="0" positionZ="0.3"/></Axles>
<Properties/></Vehicle></Catalog></OpenSCENARIO>"""
REFERENCE = (
    '<ScenarioObject name="Cat"><CatalogReference catalogName="Cars" entryName="{}">{}</CatalogReference>'
    "</ScenarioObject>"
)


def text_of(text: str, **more: object) -> StoryText:
    return StoryText("s.xosc", text.encode(), **more)  # type: ignore[arg-type] # fields of StoryText


def read(text: str, **more: object) -> Story:
    return read_story(text_of(text, **more))


def test_entities_have_the_sizes_and_limits_of_a_catalogue() -> None:
    assign = '<ParameterAssignments><ParameterAssignment parameterRef="Top" value="44"/></ParameterAssignments>'
    text = story({"Ego": ""}, entities=REFERENCE.format("fast", assign))
    scenario = story_scenario(read(text, catalogues=(("c.xosc", CATALOGUE.encode()),)), "s", None)
    body = scenario.vehicles[0].model.body
    assert (body.length, body.width, body.height, body.wheelbase) == (4.2, 1.9, 1.4, 2.6)
    assert body.rear_overhang == pytest.approx(0.7)
    assert body.front_overhang == pytest.approx(0.9)
    assert (body.top_speed, body.max_accel, body.max_decel) == (44.0, 8.0, 9.0)


def test_an_entry_without_assignments_has_its_own_defaults() -> None:
    text = story({"Ego": ""}, entities=REFERENCE.format("fast", ""))
    scenario = story_scenario(read(text, catalogues=(("c.xosc", CATALOGUE.encode()),)), "s", None)
    assert scenario.vehicles[0].model.body.top_speed == 50.0


@pytest.mark.parametrize(
    ("entry", "catalogues", "expected"),
    [
        ("fats", (("c.xosc", CATALOGUE.encode()),), "Cars has no entry 'fats' (did you mean fast?)"),
        ("fast", (), "no catalogue 'Cars'; found are none"),
    ],
)
def test_a_reference_to_nothing_is_a_mistake_with_its_line(
    entry: str, catalogues: tuple[tuple[str, bytes], ...], expected: str
) -> None:
    with pytest.raises(DocumentError, match=r"s.xosc: line \d+: CatalogReference" + ".*" + re.escape(expected)):
        read(story({"Ego": ""}, entities=REFERENCE.format(entry, "")), catalogues=catalogues)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("$v", "12"),
        ("${$v / 3}", "4.0"),
        ("${2 * ($v + 1)}", "26.0"),
        ("${$v > 3 and not $off}", "true"),
        ("${round($v / 5)}", "2"),
        ("${$v % 5}", "2.0"),
        ("${pow($v, 2)}", "144.0"),
        ("\\$v", "$v"),
        ("plain", "plain"),
    ],
)
def test_parameters_and_expressions_have_values(text: str, expected: str) -> None:
    assert evaluate(text, {"v": "12", "off": "false"}, "here") == expected


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("$w", r"here: no parameter \$w"),
        ("${$v / 0}", "here: a division by zero"),
        ("${__import__('os')}", "here: "),
        ("${" + "(" * 300 + ")" * 300 + "}", "here: "),
        ("${9**9**9**9}", "here: "),
        ("${$name + 1}", "here: a text where a number is needed"),
    ],
)
def test_an_expression_that_has_no_value_is_refused(text: str, expected: str) -> None:
    with pytest.raises(DocumentError, match=expected):
        evaluate(text, {"v": "12", "name": "Bob"}, "here")


DECLARED = (
    '<ParameterDeclarations><ParameterDeclaration name="v" parameterType="double" value="{}"/></ParameterDeclarations>'
)


def test_values_from_outside_count_in_place_of_those_of_the_file() -> None:
    text = story({"Ego": speed("<AbsoluteTargetSpeed value='${$v * 2}'/>")}, more=DECLARED.format(3))

    def goal(**more: object) -> float:
        init = read(text, **more).init
        target = init.parts[0].parts[0].part().part("SpeedAction").part("SpeedActionTarget").part()
        return float(target["value"])

    assert goal() == 6.0
    assert goal(parameters={"v": "5"}) == 10.0
    with pytest.raises(DocumentError, match=r"no parameter 'w'"):
        goal(parameters={"w": "5"})


def test_a_mistake_names_file_line_element_and_what_was_expected() -> None:
    text = story({"Ego": speed(3, "lienar")})
    with pytest.raises(
        DocumentError, match=r"s.xosc: line \d+: SpeedActionDynamics.dynamicsShape: expected .*got 'lienar'.*linear"
    ):
        read(text)


def test_all_mistakes_are_found_at_once() -> None:
    text = story({"Ego": speed(3, "lienar") + speed("<AbsoluteTargetSpeed/>")})
    found = examine_story(text_of(text))[1].mistakes
    assert len(found) == 2
    assert "AbsoluteTargetSpeed.value: expected this attribute, there is none" in found[1]


def test_what_is_not_supported_is_refused_by_name_before_anything_moves() -> None:
    clothoid = "<PrivateAction><RoutingAction><RandomRouteAction/></RoutingAction></PrivateAction>"
    text = story({"Ego": ""}, group("Ego", event("a", clothoid, after(1)), event("b", speed(1), after(2))))
    with pytest.raises(DocumentError, match=r"s.xosc: line \d+: RandomRouteAction is not supported; --lenient"):
        read(text)
    lenient = read(text, is_lenient=True)
    events = [item["name"] for item in story_module.each_item(lenient.storyboard) if item.kind == "Event"]
    assert events == ["b"]
    assert "RandomRouteAction is not supported" in lenient.findings.refused[0]


@pytest.mark.parametrize("active", ["true", "false"])
def test_a_pedal_that_a_story_presses_is_refused(active: str) -> None:
    pedal = f'<OverrideControllerValueAction><Brake active="{active}" value="1"/></OverrideControllerValueAction>'
    text = story({"Ego": f"<PrivateAction><ControllerAction>{pedal}</ControllerAction></PrivateAction>"})
    found = examine_story(text_of(text))[1].mistakes
    assert [mistake.partition(": ")[2].partition(": ")[2] for mistake in found] == (
        ["Brake.active: expected false or 0, got 'true'"] if active == "true" else []
    )


def test_an_element_of_no_version_is_refused_with_the_nearest_one() -> None:
    text = story({"Ego": "<PrivateAction><TeleportActoin/></PrivateAction>"})
    with pytest.raises(DocumentError, match=r"no element 'TeleportActoin' is known in PrivateAction \(did you mean"):
        read(text)


def test_attributes_that_are_not_known_are_listed() -> None:
    text = story({"Ego": ""}).replace("vehicleCategory=", 'wheels="5" vehicleCategory=')
    assert "Vehicle has no attribute 'wheels'" in read(text).findings.notes[0]


def test_an_entity_that_is_not_there_is_a_mistake() -> None:
    with pytest.raises(DocumentError, match=r"EntityRef.entityRef: no entity 'Egoo' \(did you mean Ego\?\)"):
        read(story({"Ego": ""}, group("Egoo", event("a", speed(1), after(1)))))


@pytest.mark.parametrize(
    ("names", "wanted", "ego"),
    [
        (["Other", "Ego"], "", "Ego"),
        (["Other", "hero"], "", "hero"),
        (["walker", "First", "Second"], "", "First"),
        (["Other", "Ego"], "Other", "Other"),
        (["walker"], "", ""),
    ],
)
def test_the_ego_is_the_wanted_entity_or_a_usual_name_or_the_first_vehicle(
    names: list[str], wanted: str, ego: str
) -> None:
    found = read(story(dict.fromkeys(names, "")), ego=wanted)
    assert found.ego == ego
    assert len(found.findings.notes) == (ego == "First")
    scenario = story_scenario(found, "s", None)
    assert [spawn.name for spawn in scenario.egos] == ([ego] if ego else [])
    assert all(spawn.kind is Kind.EGO for spawn in scenario.egos)


def test_an_ego_that_is_no_vehicle_is_refused() -> None:
    with pytest.raises(DocumentError, match=r"--ego-entity: no vehicle 'Egoo' \(did you mean Ego\?\)"):
        read(story({"Ego": ""}), ego="Egoo")


def test_a_size_of_nothing_is_that_of_the_model() -> None:
    """MORAI's runner writes sizes of 0, and the name of the model."""
    text = story({"Ego": ""}).replace('length="5" width="2" height="1.5"', 'length="0" width="0" height="0"')
    text = text.replace("vehicleCategory=", 'model3d="Kia K5" vehicleCategory=')
    spawn = story_scenario(read(text), "s", None).egos[0]
    assert spawn.model.name == "2015_Kia_K5"
    assert spawn.model.body.length == 4.845


def test_the_map_is_morais_or_the_logic_file() -> None:
    text = story({"Ego": ""})
    variable = '<VariableDeclaration name="moraiMap" value="Town" variableType="String"/>'
    variable = f"<VariableDeclarations>{variable}</VariableDeclarations>"
    logic = "<RoadNetwork><LogicFile filepath='{}'/></RoadNetwork>"
    found = read(text.replace("<RoadNetwork/>", variable + logic.format("MGeo")))
    assert (found.map_name, found.map_file, found.variables) == ("Town", "", {})
    assert read(text.replace("<RoadNetwork/>", logic.format("../a.xodr"))).map_file == "../a.xodr"


def test_folders_of_catalogues_may_have_parameters() -> None:
    locations = "<CatalogLocations><VehicleCatalog><Directory path='$dir'/></VehicleCatalog></CatalogLocations>"
    text = story({"Ego": ""}, more=DECLARED.replace('"v"', '"dir"').format("../cats") + locations)
    assert catalogue_folders(text.encode(), "s.xosc", {}) == ["../cats"]
    assert catalogue_folders(text.encode(), "s.xosc", {"dir": "x"}) == ["x"]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (b"", "s.xosc: line 1: not XML"),
        (b"<OpenSCENARIO>", "s.xosc: line 1: not XML"),
        (b"<x/>", "expected <OpenSCENARIO>"),
        (b'<!DOCTYPE a [<!ENTITY b "c">]><OpenSCENARIO/>', "a DOCTYPE is refused"),
        (b"<OpenSCENARIO><Catalog name='a'/></OpenSCENARIO>", "expected a scenario, got a catalogue"),
        (b"<OpenSCENARIO>" + b"<a>" * 70 + b"</a>" * 70 + b"</OpenSCENARIO>", "at most 64 elements within"),
        (b"<OpenSCENARIO/>" + b" " * (1 << 21), "expected at most 2,097,152 bytes"),
        (b"<OpenSCENARIO/>", "OpenSCENARIO: expected one Storyboard in it, got none"),
    ],
)
def test_what_is_no_scenario_is_refused_in_a_sentence(text: bytes, expected: str) -> None:
    with pytest.raises(DocumentError, match=re.escape(expected)):
        read_story(StoryText("s.xosc", text))


def test_catalogues_that_refer_to_each_other_end() -> None:
    maneuver = """<OpenSCENARIO><Catalog name="Loop"><Maneuver name="m">
    <CatalogReference catalogName="Loop" entryName="m"/></Maneuver></Catalog></OpenSCENARIO>"""
    text = (
        story({"Ego": ""}, group("Ego"))
        .replace('<Maneuver name="maneuver"></Maneuver>', "")
        .replace("</ManeuverGroup>", '<CatalogReference catalogName="Loop" entryName="m"/></ManeuverGroup>')
    )
    with pytest.raises(DocumentError):
        read(text, catalogues=(("c.xosc", maneuver.encode()),))


def test_each_action_and_condition_of_the_table_is_carried_out_or_refused() -> None:
    """A kind that is read without being known to those that tell stories would fail within a frame."""
    wrapped = {"LongitudinalAction", "LateralAction", "RoutingAction"}
    kinds = [tag for parent in ("PrivateAction", *wrapped) for tag in GRAMMAR[parent].parts[0].tags]
    for tag in kinds:
        assert tag in wrapped or tag in MOTIONS or GRAMMAR[tag].is_refused, tag
    for parent, known in (("EntityCondition", OF_ENTITY), ("ByValueCondition", OF_VALUE)):
        for tag in GRAMMAR[parent].parts[0].tags:
            assert (tag in known) != GRAMMAR[tag].is_refused, tag
    for tag in LEFT_OUT:
        assert tag in GRAMMAR


def test_every_part_in_the_table_is_a_row_of_it() -> None:
    for name, row in GRAMMAR.items():
        for part in row.parts:
            assert set(part.tags) <= GRAMMAR.keys(), name


def test_a_car_of_the_fixture_is_read() -> None:
    assert "Vehicle" in CAR


# Bounds, names and remarks of whole stories


def folders_of(num: int) -> list[str]:
    inner = "".join(f"<Folder{i}><Directory path='p{i % 20}'/></Folder{i}>" for i in range(num))
    return catalogue_folders(story({"Ego": ""}, more=f"<CatalogLocations>{inner}</CatalogLocations>").encode(), "s", {})


def test_there_are_sixteen_folders_of_catalogues_at_most() -> None:
    assert folders_of(16) == [f"p{i}" for i in range(16)]
    with pytest.raises(DocumentError, match="s: expected at most 16 folders of catalogues, got 17"):
        folders_of(17)
    text = story({"Ego": ""}, more="<CatalogLocations><A><File path='x'/><Directory/></A></CatalogLocations>")
    assert catalogue_folders(text.encode(), "s", {}) == []


def test_parameters_of_a_scenario_are_told_by_name() -> None:
    assert declared_parameters(story({"Ego": ""}, more=DECLARED.format(3)).encode(), "s") == {"v"}


def test_error_shows_eight_things_and_the_number_of_the_others() -> None:
    wrong = "".join(f'<Private entityRef="none{i}"/>' for i in range(10))
    text = story({"Ego": ""}).replace("</Actions>", wrong + "</Actions>")
    with pytest.raises(DocumentError) as caught:
        read(text)
    told = str(caught.value)
    assert told.endswith("; and 2 more, see scenario check")
    assert told.count("no entity") == 8
    one = story({"Ego": ""}).replace("</Actions>", wrong[: wrong.index("/>") + 2] + "</Actions>")
    with pytest.raises(DocumentError, match=r"no entity 'none0'$"):
        read(one, is_lenient=True)


def test_what_is_refused_where_nothing_can_be_left_out_is_told_though_reading_is_lenient() -> None:
    text = story({"Ego": ""}).replace("</Entities>", "<Unheard/></Entities>")
    with pytest.raises(DocumentError, match="no element 'Unheard' is known in Entities"):
        read(text, is_lenient=True)


@pytest.mark.parametrize(
    ("path", "map_file"), [("x/MGeo/", ""), ("mgeo", ""), ("a/MGeo.xodr", "a/MGeo.xodr"), ("", "")]
)
def test_map_file_is_the_logic_file_but_a_folder_of_mgeo(path: str, map_file: str) -> None:
    text = story({"Ego": ""}).replace("<RoadNetwork/>", f"<RoadNetwork><LogicFile filepath='{path}'/></RoadNetwork>")
    assert (read(text).map_file, read(text).map_name) == (map_file, "")


def test_map_of_morai_counts_before_that_of_a_variable() -> None:
    variables = "".join(
        f'<VariableDeclaration name="{name}" value="{value}"/>' for name, value in (("moraiMap", "A"), ("other", "3"))
    )
    text = story({"Ego": ""}, more=f"<VariableDeclarations>{variables}</VariableDeclarations>")
    found = read(text, parameters={})
    assert (found.map_name, found.variables) == ("A", {"other": "3"})
    told = read(text.replace("</OpenSCENARIO>", '<SimulatorInfo><Map name="B"/></SimulatorInfo></OpenSCENARIO>'))
    assert told.map_name == "B"


@pytest.mark.parametrize(
    ("init", "wanted", "told"),
    [
        (["walker"], "Ego", "no vehicle 'Ego'; there are none"),
        ([f"c{i}" for i in range(13)], "Egg", f"no vehicle 'Egg'; there are {', '.join(f'c{i}' for i in range(12))}"),
    ],
)
def test_vehicles_that_could_be_the_ego_are_listed(init: list[str], wanted: str, told: str) -> None:
    with pytest.raises(DocumentError) as caught:
        read(story(dict.fromkeys(init, "")), ego=wanted)
    assert str(caught.value) == f"s.xosc: --ego-entity: {told}"


def test_vehicle_with_the_role_of_the_ego_is_the_ego() -> None:
    text = story({"First": "", "Second": ""})
    at = text.rindex("vehicleCategory")
    found = read(f'{text[:at]}role="ego" {text[at:]}')
    assert (found.ego, found.findings.notes) == ("Second", [])


def test_distances_of_a_pedestrian_are_numbers_of_metres() -> None:
    def holds(*values: tuple[str, str]) -> tuple[float, float]:
        inner = "".join(f'<Property name="{name}" value="{value}"/>' for name, value in values)
        text = story({"Ego": "", "walker": ""}).replace(
            "</Pedestrian>", f"<Properties>{inner}</Properties></Pedestrian>"
        )
        return read(text).holds["walker"]

    assert holds(("activeDistance", "25"), ("moveDistance", "3.5"), ("other", "x")) == (25.0, 3.5)
    assert holds() == (0.0, 0.0)
    assert holds(("moveDistance", "1e9"), ("activeDistance", "0")) == (0.0, 1e9)
    for wrong in ("x", "-1", "nan", "1.1e9"):
        with pytest.raises(DocumentError, match=rf"line \d+: moveDistance: expected a distance \[m\], got '{wrong}'"):
            holds(("moveDistance", wrong))


def test_two_of_one_name_are_told() -> None:
    text = story({"Ego": ""}).replace("</Entities>", f'<ScenarioObject name="Ego">{CAR}</ScenarioObject></Entities>')
    with pytest.raises(DocumentError, match=r"^s\.xosc: two entities have the same name$"):
        read(text)
    signals = f"<TrafficSignals>{2 * SIGNAL}</TrafficSignals>"
    text = story({"Ego": ""}).replace("<RoadNetwork/>", f"<RoadNetwork>{signals}</RoadNetwork>")
    with pytest.raises(DocumentError, match=r"^s\.xosc: line \d+: TrafficSignals: two controllers have the same name$"):
        read(text)


SIGNAL = '<TrafficSignalController name="c"><Phase name="p" duration="1"/></TrafficSignalController>'


def bounded(monkeypatch: pytest.MonkeyPatch, name: str, most: int, text: str) -> str:
    """What is told about a story with a bound; empty if nothing is."""
    monkeypatch.setattr(story_module, name, most)
    try:
        read(text)
    except DocumentError as error:
        return str(error)
    return ""


def test_entities_and_events_and_looks_are_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    refs = by_entity("Ego Other", '<StandStillCondition duration="1"/>')
    corners = "".join(f"<Vertex>{at(x, 0)}</Vertex>" for x in (0, 10, 20))
    line = f'<Trajectory name="t"><Shape><Polyline>{corners}</Polyline></Shape></Trajectory>'
    place = f'<Position><TrajectoryPosition s="0"><TrajectoryRef>{line}</TrajectoryRef></TrajectoryPosition></Position>'
    reach = by_entity("Ego", f'<ReachPositionCondition tolerance="1">{place}</ReachPositionCondition>')
    events = [event(f"e{i}", speed(1), start) for i, start in enumerate((after(1), refs, reach))]
    text = story({"Ego": "", "Other": ""}, group("Ego", *events))
    assert bounded(monkeypatch, "MAX_ENTITIES", 2, text) == ""
    assert bounded(monkeypatch, "MAX_EVENTS", 3, text) == ""
    assert bounded(monkeypatch, "MAX_EVENTS", 2, text) == "s.xosc: expected at most 2 events, got 3"
    monkeypatch.undo()
    assert bounded(monkeypatch, "MAX_LOOKS", 7, text) == ""  # a time, two entities, one entity and three vertices
    assert "vertices of positions in them, got 7" in bounded(monkeypatch, "MAX_LOOKS", 6, text)
    monkeypatch.undo()
    assert bounded(monkeypatch, "MAX_ENTITIES", 1, text) == "s.xosc: expected at most 1 entities, got 2"


def test_looks_of_the_evaluation_are_counted_too(monkeypatch: pytest.MonkeyPatch) -> None:
    end = f"<Evaluation><SuccessConditionGroup>{after(1)}{after(2)}</SuccessConditionGroup></Evaluation>"
    text = story({"Ego": ""}, end=end)
    assert bounded(monkeypatch, "MAX_LOOKS", 2, text) == ""
    assert "got 2" in bounded(monkeypatch, "MAX_LOOKS", 1, text)


@pytest.mark.parametrize("is_lenient", [True, False])
def test_element_that_a_condition_names_and_the_story_has_not_is_a_mistake_or_a_note(*, is_lenient: bool) -> None:
    def told(kind: str, name: str) -> list[str]:
        text = story({"Ego": ""}, group("Ego", event("e", speed(1), state_of(kind, name, "runningState"))))
        _, findings = examine_story(text_of(text, is_lenient=is_lenient))
        lines, others = (findings.notes, findings.mistakes) if is_lenient else (findings.mistakes, findings.notes)
        assert others == []
        return [line.partition(": ")[2].partition(": ")[2] for line in lines]

    key = "StoryboardElementStateCondition.storyboardElementRef"
    assert told("event", "e") == told("act", "story::act") == told("maneuverGroup", "group") == []
    assert told("event", "act::ee") == [f"{key}: there is no 'ee'"]
    assert told("action", "e") == [f"{key}: there is no 'e'"]


def test_state_of_a_light_that_no_light_has_is_a_mistake_or_a_note() -> None:
    action = '<TrafficSignalAction><TrafficSignalStateAction name="T" state="blue"/></TrafficSignalAction>'
    act = f"<GlobalAction><InfrastructureAction>{action}</InfrastructureAction></GlobalAction>"
    text = story({"Ego": ""}, group("Ego", event("e", act, after(1))))
    with pytest.raises(DocumentError, match=r"TrafficSignalStateAction\.state: expected a state such as red, .*'blue'"):
        read(text)
    (note,) = read(text, is_lenient=True).findings.notes
    assert note.endswith("got 'blue'")
