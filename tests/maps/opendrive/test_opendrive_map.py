"""Whole OpenDRIVE files: header, notes, and errors of files without any lane."""

from __future__ import annotations

import pytest

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.maps.opendrive.opendrive_map import read_opendrive
from tests.maps.opendrive.xodr_texts import LINE, document, geometry, lane, read, road, section


@pytest.mark.parametrize(
    ("source", "name"),
    [("a/b.xodr", "b"), ("c:\\maps\\Town.one.XODR", "Town.one"), ("b.xodr.bak", "b.xodr.bak")],
)
def test_map_has_the_name_of_its_file(source: str, name: str) -> None:
    assert read_opendrive([document(road())], source).name == name


def test_header_has_the_origin_and_the_projection() -> None:
    plain = read(road())
    assert (plain.origin, plain.projection.is_known) == ((0.0, 0.0, 0.0), False)
    assert plain.notes == ("there is no <geoReference>, so /gps has no fix",)
    offset = '<offset x="302459.5" y="-2" hdg="0"/>'
    told = read(road(), header=offset + "<geoReference><![CDATA[ +proj=utm +zone=52 +ellps=WGS84 ]]></geoReference>")
    assert (told.origin, told.projection.zone, told.notes) == ((302459.5, -2.0, 0.0), 52, ())


def test_header_that_cannot_be_used_is_noted() -> None:
    turned = read(road(), header='<offset x="1" y="2" z="3" hdg="0.1"/><geoReference>+proj=laea</geoReference>')
    assert turned.origin == (1.0, 2.0, 3.0)
    heading, fix = turned.notes
    assert heading == "the header's offset has a heading, which is not used: positions of GPS are turned"
    assert fix.startswith("no fix of /gps: <geoReference>: ")


@pytest.mark.parametrize(
    ("parts", "got"),
    [
        ([], "none"),
        (
            [road(sections=section([lane(2, kind="sidewalk"), lane(1, kind="border"), lane(0)]))],
            "1 of type sidewalk, 1 of type border",
        ),
    ],
)
def test_map_without_lanes_for_vehicles_is_refused(parts: list[str], got: str) -> None:
    with pytest.raises(DocumentError) as caught:
        read(*parts)
    assert str(caught.value) == f"small.xodr: expected at least one lane to drive on, got {got}"


def test_junction_of_an_id_that_there_is_already_is_refused() -> None:
    with pytest.raises(DocumentError, match=r"<junction '9'>: id: expected each junction once, got '9'"):
        read(road(), '<junction id="9"/>', '<junction id="9"/>')


def test_notes_name_twenty_kinds_of_unused_elements_the_commonest_first() -> None:
    others = [f"<kind{i}/>" for i in range(20)]
    assert read(road(), *others).notes[-1].endswith(", 1 kind18, 1 kind19")
    notes = read(road(), *others, "<kind20/>", "<kind20/>").notes
    assert notes[-1].startswith("elements that have no meaning here: 2 kind20, 1 kind0, ")
    assert notes[-1].endswith(", 1 kind17, 1 kind18, ...")


def test_worst_joints_are_named_first_and_lanes_left_out_are_counted() -> None:
    def torn(name: str, gap: float, kink: float) -> str:
        plan = geometry(LINE, 50.0) + geometry(LINE, 50.0, 50.0, x=50.0 + gap, hdg=kink)
        lanes = [lane(0), lane(-1), lane(-2, width=""), lane(-3, kind="sidewalk")]
        return road(name, plan=plan, sections=section(lanes))

    notes = read(torn("1", 0.02, 0.0), torn("2", 0.5, 0.1), torn("3", 0.0, 0.0)).notes
    what = "2 places at which two shapes of a reference line do not meet, by more than 1 cm or 1 degree: "
    assert what + "road 2 at 50.00 m: 50 cm, 6 degrees, road 1 at 50.00 m: 2 cm, 0 degrees" in notes
    assert "3 lanes without width or length are left out: 1.0.-2, 2.0.-2, 3.0.-2" in notes
    assert "lanes that are no road for vehicles are left out: 3 of type sidewalk" in notes
    many = read(*(torn(str(i), 0.1 + 0.01 * i, 0.0) for i in range(6))).notes
    assert any(
        note.startswith("6 places at which") and note.endswith("road 1 at 50.00 m: 11 cm, 0 degrees, ...")
        for note in many
    )
