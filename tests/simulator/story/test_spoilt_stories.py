"""Spoilt files of OpenSCENARIO: each is refused in a sentence, or told without a failure."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.scenarios.openscenario.story import examine_story
from rosbridge_sim.scenarios.openscenario.story_records import StoryText
from tests.mutations import Edit, Flip, damage, edits, examples, flips
from tests.scenarios.openscenario.test_story import CATALOGUE, REFERENCE
from tests.simulator.story.story_texts import (
    Telling,
    after,
    at,
    by_entity,
    by_value,
    event,
    group,
    lane_change,
    lateral,
    link,
    longitudinal,
    routing,
    scenario_of,
    speed,
    state_of,
    story,
    teleport,
)

MORE = """<ParameterDeclarations><ParameterDeclaration name="v" parameterType="double" value="${3 * 4}"/>
</ParameterDeclarations><VariableDeclarations><VariableDeclaration name="n" variableType="double" value="1"/>
</VariableDeclarations>"""
FOLLOW = routing(
    '<FollowTrajectoryAction><Trajectory name="t" closed="false"><Shape><Polyline>'
    f'<Vertex time="0">{at(50, 3.5)}</Vertex><Vertex time="1">{link("middle", 80)}</Vertex></Polyline></Shape>'
    '</Trajectory><TimeReference><Timing domainAbsoluteRelative="relative" scale="1" offset="0"/></TimeReference>'
    "</FollowTrajectoryAction>"
)
KEEP = longitudinal(
    '<LongitudinalDistanceAction entityRef="Car" continuous="true" freespace="true" timeGap="1.5">'
    '<DynamicConstraints maxAcceleration="3" maxDeceleration="5" maxSpeed="30"/></LongitudinalDistanceAction>'
)
ASIDE = lateral(
    '<LateralDistanceAction entityRef="Ego" continuous="true" freespace="false" distance="2">'
    '<DynamicConstraints maxSpeed="1"/></LateralDistanceAction>'
)
SYNC = (
    '<PrivateAction><SynchronizeAction masterEntityRef="Ego">'
    f"{link('middle', 120).replace('Position>', 'TargetPositionMaster>')}"
    f"{link('right', 155).replace('Position>', 'TargetPosition>')}</SynchronizeAction></PrivateAction>"
)
PROFILE = longitudinal(
    '<SpeedProfileAction followingMode="follow"><SpeedProfileEntry time="1" speed="9"/></SpeedProfileAction>'
)
NEAR = by_entity(
    "Ego",
    '<TimeHeadwayCondition entityRef="Car" value="9" rule="lessThan" freespace="true" coordinateSystem="road"'
    ' relativeDistanceType="longitudinal"/>',
)
SIGNAL = by_value('<TrafficSignalCondition name="light" state="off;off;on"/>')
SET = '<GlobalAction><VariableAction variableRef="n"><SetAction value="2"/></VariableAction></GlobalAction>'
GOOD = story(
    {
        "Ego": teleport(link("middle", 20)) + speed("<AbsoluteTargetSpeed value='$v'/>"),
        "Car": teleport('<Position><RelativeLanePosition entityRef="Ego" dLane="1" ds="25"/></Position>') + speed(8),
        "walker": "",
    },
    group(
        "Car",
        event("a", lane_change('<RelativeTargetLane entityRef="Ego" value="0"/>'), after(0.1), priority="override"),
        event("b", FOLLOW, state_of("event", "a", "runningState", delay=0.1), priority="overwrite", count=2),
        event("c", PROFILE, NEAR),
        event("d", SYNC, after(0.6, edge="rising")),
    ),
    group("Ego", event("e", KEEP, NEAR), event("f", ASIDE, after(0.3)), event("g", SET, SIGNAL), name="g2"),
    group("walker", event("h", teleport(at(40, 3)), after(0.2)), name="g3"),
    more=MORE,
    entities=REFERENCE.format("fast", ""),
)
TEXTS = (
    "",
    "nan",
    "-1",
    "0",
    "1e9",
    "1e400",
    "${1/0}",
    "${$v}",
    "$v",
    "$w",
    "x" * 20_000,
    "Ego",
    "true",
    "\u00fc",
    "$",
)


def spoil(text: str, changes: list[Edit]) -> str:
    """The file with these changes: elements lost, doubled, exchanged and renamed; attributes lost, odd, exchanged."""
    root = ET.fromstring(text)  # noqa: S314 - our own text
    for change in changes:
        elements = list(root.iter())
        one, other = elements[change.where % len(elements)], elements[(change.where * 7919) % len(elements)]
        keys = sorted(one.attrib)
        key = keys[change.where % len(keys)] if keys else "name"
        if change.how == 0 and len(one):
            del one[change.where % len(one)]
        elif change.how == 1 and len(one):
            one.append(one[0])
        elif change.how == 2 and other is not root and one not in list(other.iter()):
            one.append(other)
        elif change.how == 3:
            one.tag = other.tag
        elif change.how == 4:
            one.attrib.pop(key, None)
        elif change.how == 5:
            one.attrib[key] = TEXTS[change.where % len(TEXTS)]
        else:
            one.attrib[key] = next(iter(other.attrib.values()), "")
    return ET.tostring(root, encoding="unicode")


def read(text: bytes, *, is_lenient: bool) -> None:
    """Read it; a refusal is one line with the file."""
    given_text = StoryText("s.xosc", text, (("c.xosc", CATALOGUE.encode()),), is_lenient=is_lenient)
    try:
        _, findings = examine_story(given_text)
    except DocumentError as error:
        lines = [str(error)]
    else:
        lines = [*findings.mistakes, *findings.refused, *findings.idle, *findings.notes]
    for line in lines:
        assert "\n" not in line
        assert re.match(r"[sc]\.xosc: ", line), line


def test_the_file_that_is_spoilt_is_good() -> None:
    found = examine_story(StoryText("s.xosc", GOOD.encode(), (("c.xosc", CATALOGUE.encode()),)))[1]
    assert (found.mistakes, found.refused) == ([], [])


@given(edits(), st.booleans())
@examples(560, quick=20)
def test_a_spoilt_story_is_read_or_refused_in_a_sentence(changes: list[Edit], is_lenient: bool) -> None:  # noqa: FBT001
    read(spoil(GOOD, changes).encode(), is_lenient=is_lenient)


@given(flips())
@examples(560, quick=20)
def test_damaged_bytes_are_read_or_refused_in_a_sentence(changes: list[Flip]) -> None:
    read(damage(GOOD.encode(), changes), is_lenient=False)


@pytest.mark.filterwarnings("error::RuntimeWarning")
@given(edits(2))
@examples(60, quick=5)
def test_a_spoilt_story_that_is_read_is_told(changes: list[Edit]) -> None:
    text = spoil(GOOD.replace(REFERENCE.format("fast", ""), ""), changes)
    try:
        scenario_of(text, is_lenient=True)
        telling = Telling(text, is_lenient=True)
    except DocumentError:
        return
    telling.run(1.0)
