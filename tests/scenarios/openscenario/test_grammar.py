"""The table of elements: rows that stand for all forms of a line."""

from __future__ import annotations

import pytest

from rosbridge_sim.scenarios.openscenario.grammar import GRAMMAR, POSITIONS, AttributeRow, PartRow, Row, read_table


def test_line_of_the_table_has_attributes_and_parts() -> None:
    rows = read_table(
        "A B: x:number y?:bool z=on|off w?=1|2\n    One Two? Three* (One\n    |Two) (POSITIONS)\n! C D\n~ E"
    )
    assert list(rows) == list("ABCDE")
    assert rows["A"] is rows["B"]
    assert rows["A"] == Row(
        {
            "x": AttributeRow("number", (), is_needed=True),
            "y": AttributeRow("bool", (), is_needed=False),
            "z": AttributeRow("text", ("on", "off"), is_needed=True),
            "w": AttributeRow("text", ("1", "2"), is_needed=False),
        },
        (
            PartRow(("One",), is_needed=True, is_many=False),
            PartRow(("Two",), is_needed=False, is_many=False),
            PartRow(("Three",), is_needed=False, is_many=True),
            PartRow(("One", "Two"), is_needed=True, is_many=False),
            PartRow(POSITIONS, is_needed=True, is_many=False),
        ),
    )
    assert rows["C"] is rows["D"]
    assert rows["C"] == Row({}, (), is_refused=True)
    assert rows["E"] == Row({}, (), is_idle=True)


@pytest.mark.parametrize(
    ("name", "tag", "is_there"),
    [("Position", "LanePosition", True), ("Position", "Position", False), ("Act", "Event", False)],
)
def test_part_of_an_element_is_found_by_its_tag(name: str, tag: str, *, is_there: bool) -> None:
    part = GRAMMAR[name].part_of(tag)
    assert (part is not None and tag in part.tags) == is_there
