"""Elements as items: values by their types, parts, catalogues, and each mistake as a line."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import pytest

from rosbridge_sim.documents.xml_documents import Element, read_whole
from rosbridge_sim.scenarios.openscenario import story_items
from rosbridge_sim.scenarios.openscenario.story_items import StoryItemReader
from rosbridge_sim.scenarios.openscenario.story_records import StoryItem

LONG = "x" * 100
"""A name of which an error shows 60 characters."""


class Reading:
    """One element that is read."""

    def __init__(
        self,
        text: str,
        parameters: Mapping[str, str] | None = None,
        *,
        is_lenient: bool = False,
        entities: frozenset[str] | None = None,
        catalogues: Mapping[str, str] | None = None,
    ) -> None:
        entries = {name: self._element(entry) for name, entry in (catalogues or {}).items()}
        reader = StoryItemReader({"Cat": entries} if entries else {}, is_lenient=is_lenient)
        reader.entities = entities
        self.item: StoryItem | None = reader.read(self._element(text), parameters or {})
        found = reader.findings
        self.mistakes, self.refused, self.idle, self.notes = (
            [line.partition(": ")[2].partition(": ")[2] for line in lines]
            for lines in (found.mistakes, found.refused, found.idle, found.notes)
        )

    @staticmethod
    def _element(text: str) -> Element:
        return read_whole(text.encode(), "s.xosc", text[1:].split(None, 1)[0].rstrip("/>").split(">")[0])

    @property
    def values(self) -> dict[str, Any]:
        assert self.item is not None, self.mistakes
        return dict(self.item.values)


def test_values_have_the_types_of_the_table() -> None:
    found = Reading('<Event name="e" priority="skip" maximumExecutionCount="3"/>').values
    assert found == {"name": "e", "priority": "skip", "maximumExecutionCount": 3}
    assert isinstance(found["maximumExecutionCount"], int)
    assert Reading('<Event name="e" maximumExecutionCount="0"/>').values["maximumExecutionCount"] == 0
    assert Reading('<Timing domainAbsoluteRelative="relative" scale="-1e9" offset="1e9"/>').values == {
        "domainAbsoluteRelative": "relative",
        "scale": -1e9,
        "offset": 1e9,
    }
    for text, truth in (("true", True), ("1", True), ("false", False), ("0", False)):
        assert Reading(f'<ActivateControllerAction lateral="{text}"/>').values == {"lateral": truth}
    lane = Reading('<RelativeLanePosition entityRef="a" dLane="-2"/>', entities=frozenset("a"))
    assert lane.values == {"entityRef": "a", "dLane": -2}
    assert lane.item is not None
    assert lane.item.where == "s.xosc: line 1"


@pytest.mark.parametrize(
    ("text", "told"),
    [
        (
            '<ActivateControllerAction lateral="yes"/>',
            "ActivateControllerAction.lateral: expected true or false, got 'yes'",
        ),
        ('<Fog visualRange="far"/>', "Fog.visualRange: expected a number, got 'far'"),
        ('<Fog visualRange="1.1e9"/>', "Fog.visualRange: expected a number within +-1e+09, got '1.1e9'"),
        ('<Fog visualRange="nan"/>', "Fog.visualRange: expected a number within +-1e+09, got 'nan'"),
        ("<Fog/>", "Fog.visualRange: expected this attribute, there is none"),
        (
            '<Event name="e" maximumExecutionCount="-1"/>',
            "Event.maximumExecutionCount: expected a whole number, 0 or more, got '-1'",
        ),
        (
            '<Event name="e" maximumExecutionCount="1.5"/>',
            "Event.maximumExecutionCount: expected a whole number, 0 or more, got '1.5'",
        ),
        (
            '<RelativeLanePosition entityRef="a" dLane="1.5"/>',
            "RelativeLanePosition.dLane: expected a whole number, got '1.5'",
        ),
        ('<EntityRef entityRef="b"/>', "EntityRef.entityRef: no entity 'b'"),
        (
            '<Event name="e" priority="skipp"/>',
            "Event.priority: expected overwrite or override or skip or parallel, got 'skipp' (did you mean skip?)",
        ),
        (f'<EntityRef entityRef="{LONG}"/>', f"EntityRef.entityRef: no entity '{LONG[:60]}...'"),
    ],
)
def test_value_of_another_type_is_a_mistake(text: str, told: str) -> None:
    found = Reading(text, entities=frozenset({"a"}))
    assert (found.item, found.mistakes) == (None, [told])


def test_label_may_be_any_text() -> None:
    inner = '<ByValueCondition><SimulationTimeCondition value="1" rule="lessThan"/></ByValueCondition>'
    for label, name in (("$a", "b"), ("$b", "$b"), ("${1 +}", "${1 +}"), ("${1 + 1}", "2")):
        found = Reading(f'<Condition name="{label}">{inner}</Condition>', {"a": "b"})
        assert (found.values["name"], found.mistakes) == (name, [])


def test_attributes_of_other_name_spaces_are_no_misspellings() -> None:
    text = '<Fog xmlns="urn:x" xmlns:xsi="urn:y" xsi:near="1" visualRange="5" visualrange="6"/>'
    found = Reading(text)
    assert found.notes == ["Fog has no attribute 'visualrange' (did you mean visualRange?); it is not read"]
    assert found.values == {"visualRange": 5.0}


def test_parameters_that_an_element_declares_hold_within_it() -> None:
    declared = "".join(
        f"<ParameterDeclaration {words}/>"
        for words in (
            'name="a" value="1"',
            'name="b" value="${$a + 1}"',
            'value="9"',
            'name="c"',
            'name="d" value="$e"',
        )
    )
    text = f"<ParameterDeclarations>{declared}</ParameterDeclarations>"
    reader = StoryItemReader({}, is_lenient=False)
    element = read_whole(f'<Route name="r">{text}</Route>'.encode(), "s.xosc", "Route")
    assert reader.declare(element, {"a": "0", "z": "9"}, {"c": "5"}) == {
        "a": "1",
        "b": "2.0",
        "c": "5",
        "d": "",
        "z": "9",
    }
    assert reader.declare(element, {}, {"a": "7"})["b"] == "8.0"
    assert reader.findings.mistakes == ["s.xosc: line 1: d: no parameter $e"]


def test_lines_are_told_once_and_at_most_two_hundred() -> None:
    twice = '<EntityRef entityRef="b"/>' * 2
    found = Reading(
        f'<TriggeringEntities triggeringEntitiesRule="any">{twice}</TriggeringEntities>', entities=frozenset()
    )
    assert found.mistakes == ["EntityRef.entityRef: no entity 'b'"]
    many = " ".join(f'odd{i}="1"' for i in range(250))
    assert len(Reading(f'<Fog visualRange="5" {many}/>').notes) == 200


@pytest.mark.parametrize(("most", "is_told"), [(3, False), (2, True)])
def test_elements_are_counted_those_within_others_too(
    monkeypatch: pytest.MonkeyPatch, most: int, *, is_told: bool
) -> None:
    monkeypatch.setattr(story_items, "MAX_ITEMS", most)
    inner = '<Fog visualRange="5"/><Sun elevation="1"/>'
    reader = StoryItemReader({}, is_lenient=False)
    reader.read(read_whole(f"<Weather>{inner}</Weather>".encode(), "s.xosc", "Weather"), {})
    assert reader.findings.mistakes == ([f"s.xosc: expected at most {most} elements"] if is_told else [])


def test_elements_without_effect_are_told_but_for_those_that_nobody_misses() -> None:
    found = Reading('<Weather><Wind/><DomeImage odd="1"><Odd/></DomeImage></Weather>')
    assert found.idle == ["Wind has no effect", "DomeImage has no effect"]
    assert (found.notes, found.mistakes, found.refused) == ([], [], [])
    assert found.item is not None
    assert [(part.kind, part.values, part.parts) for part in found.item.parts] == [
        ("Wind", {}, ()),
        ("DomeImage", {}, ()),
    ]
    assert Reading('<FileHeader revMajor="1" revMinor="2"><License/></FileHeader>').idle == []


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("<Clothoid/>", ["Clothoid is not supported"]),
        ("<Odd/>", ["no element 'Odd' is known"]),
        (f"<{LONG}/>", [f"no element '{LONG[:60]}...' is known"]),
        (
            "<Position><WorldPositon/></Position>",
            ["no element 'WorldPositon' is known in Position (did you mean WorldPosition?)"],
        ),
        ("<Rule><Zzzz/></Rule>", ["no element 'Zzzz' is known in Rule; expected AddValue, MultiplyByValue"]),
        ("<Rule><Fog/></Rule>", ["no element 'Fog' is known in Rule; expected AddValue, MultiplyByValue"]),
    ],
)
def test_element_that_has_no_meaning_is_refused_with_those_that_have(text: str, told: list[str]) -> None:
    found = Reading(text)
    assert (found.item, found.refused, found.mistakes) == (None, told, [])


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("<Rule/>", ["Rule: expected one AddValue or MultiplyByValue in it, got none"]),
        (
            '<Rule><AddValue value="1"/><MultiplyByValue value="1"/></Rule>',
            ["Rule: expected one AddValue or MultiplyByValue in it, got 2"],
        ),
        ("<Weather><Fog/></Weather>", ["Fog.visualRange: expected this attribute, there is none"]),
        ('<Weather><Fog visualRange="1"/><Fog visualRange="2"/></Weather>', ["Weather: expected one Fog in it, got 2"]),
    ],
)
def test_parts_are_there_as_often_as_the_table_says(text: str, told: list[str]) -> None:
    found = Reading(text)
    assert (found.item, found.mistakes) == (None, told)


CONDITION = '<Condition name="c"><ByValueCondition>{}</ByValueCondition></Condition>'
TIME = CONDITION.format('<SimulationTimeCondition value="1" rule="lessThan"/>')
REFUSED = CONDITION.format("<TimeOfDayCondition/>")


def test_trigger_of_which_nothing_is_left_goes_with_its_element() -> None:
    def read(tag: str, *conditions: str) -> StoryItem | None:
        groups = "".join(f"<ConditionGroup>{each}</ConditionGroup>" for each in conditions)
        return Reading(f"<{tag}>{groups}</{tag}>", is_lenient=True).item

    assert read("StartTrigger", REFUSED) is None
    for found, num in (
        (read("StartTrigger"), 0),
        (read("StartTrigger", REFUSED, TIME), 1),
        (read("StopTrigger", REFUSED), 0),
    ):
        assert found is not None
        assert len(found.parts) == num


# Catalogues


def reference(entry: str, catalogue: str = "Cat", inner: str = "") -> str:
    return f'<CatalogReference catalogName="{catalogue}" entryName="{entry}">{inner}</CatalogReference>'


def trajectory(name: str, inner: str) -> str:
    """A trajectory with one vertex, which is on another trajectory."""
    place = (
        f'<Position><TrajectoryPosition s="0"><TrajectoryRef>{inner}</TrajectoryRef></TrajectoryPosition></Position>'
    )
    return f'<Trajectory name="{name}"><Shape><Polyline><Vertex>{place}</Vertex></Polyline></Shape></Trajectory>'


@pytest.mark.parametrize(("num", "is_told"), [(8, False), (9, True)])
def test_catalogues_refer_to_one_another_eight_times(num: int, *, is_told: bool) -> None:
    chain = {f"t{i}": trajectory(f"t{i}", reference(f"t{i + 1}")) for i in range(num - 1)}
    chain[f"t{num - 1}"] = '<Trajectory name="last"><Shape><Polyline/></Shape></Trajectory>'
    found = Reading(f"<TrajectoryRef>{reference('t0')}</TrajectoryRef>", catalogues=chain)
    assert found.mistakes == (["CatalogReference: catalogues refer to each other without end"] if is_told else [])
    assert (found.item is None) == is_told
    loop = {"t0": trajectory("t0", reference("t0"))}
    assert "without end" in Reading(f"<TrajectoryRef>{reference('t0')}</TrajectoryRef>", catalogues=loop).mistakes[0]


def test_two_references_beside_one_another_are_not_deep() -> None:
    fog = {"f": '<Waypoint><Position><WorldPosition x="$x" y="0"/></Position></Waypoint>'}
    assign = '<ParameterAssignments><ParameterAssignment parameterRef="$x" value="${{2 * {}}}"/></ParameterAssignments>'
    many = "".join(reference("f", inner=assign.format(i)) for i in range(12))
    found = Reading(f'<Route name="r">{many}</Route>', catalogues=fog)
    assert found.item is not None
    assert [each.part().part()["x"] for each in found.item.parts] == [2.0 * i for i in range(12)]


@pytest.mark.parametrize(
    ("text", "told"),
    [
        (reference("f", LONG), f"CatalogReference.catalogName: no catalogue '{LONG[:60]}...'; found are Cat"),
        (
            reference("f", "Cats"),
            "CatalogReference.catalogName: no catalogue 'Cats' (did you mean Cat?); found are Cat",
        ),
        (reference(LONG), f"CatalogReference.entryName: Cat has no entry '{LONG[:60]}...'"),
        ("<CatalogReference/>", "CatalogReference.catalogName: expected this attribute, there is none"),
        (
            reference("f", inner='<ParameterAssignments><A parameterRef="p" value="$q"/></ParameterAssignments>'),
            "p: no parameter $q",
        ),
    ],
)
def test_reference_that_cannot_be_followed_is_a_mistake(text: str, told: str) -> None:
    entry = {"f": '<Waypoint><Position><WorldPosition x="0" y="0"/></Position></Waypoint>'}
    assert told in Reading(f'<Route name="r">{text}</Route>', catalogues=entry).mistakes
