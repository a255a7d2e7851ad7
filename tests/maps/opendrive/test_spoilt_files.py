"""Spoilt files give a map or one sentence, with element, id and line where there is one."""

from __future__ import annotations

import pytest

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.maps.opendrive import opendrive_map
from rosbridge_sim.maps.opendrive.opendrive_map import read_opendrive
from rosbridge_sim.world.roads.lane_conflicts import LaneConflicts
from tests.maps.opendrive.spoilt_files import spoil
from tests.maps.opendrive.xodr_texts import document, geometry, joined, lane, link, read, road, section

LANES = section([lane(1, link(before=1)), lane(0, '<roadMark sOffset="0" type="broken"/>'), lane(-1, link(after=-1))])
SIGNALS = '<signals><signal id="7" s="60" t="-4" type="1000001" orientation="+" dynamic="yes"/></signals>'
GOOD = document(
    road("1", sections=LANES, links=joined("successor", "road", "2"), more=SIGNALS),
    road("2", plan=geometry('<spiral curvStart="0" curvEnd="0.01"/>', x=100.0), sections=LANES),
)


@pytest.mark.parametrize("first", range(0, 240, 40))
def test_spoilt_file_gives_a_map_or_a_sentence(first: int) -> None:
    for seed in range(first, first + 40):
        try:
            read_opendrive([spoil(GOOD, seed)], "a.xodr").roads.derived(LaneConflicts)
        except DocumentError as error:
            text = str(error)
            assert text.startswith("a.xodr: "), seed
            assert "\n" not in text, seed
            assert len(text) < 600, seed


@pytest.mark.parametrize(
    ("part", "told"),
    [
        (road("1") + road("1"), "line 5: <road '1'>: id: expected each road once, got '1'"),
        (road("1", length=-5.0), "<road '1'>: length: expected a number 0..1e+06, got '-5.0'"),
        (
            road("1", plan=geometry("<circle/>")),
            "<geometry>: expected one of line, arc, spiral, poly3, paramPoly3, got 'circle'",
        ),
        (road("1", rule="RTH"), "<road '1'>: rule: expected one of RHT, LHT, got 'RTH'"),
        (
            road("1", sections=section([lane(0), lane(-2)])),
            "<laneSection>: expected lanes without gaps; lane -1 is missing",
        ),
        (
            road("1", sections=section([lane(0), lane(-1), lane(-1)])),
            "<laneSection>: expected each lane id once in a section",
        ),
        (
            road("1", sections=section([lane(0), lane(-1, width='<border sOffset="0" a="3"/>')])),
            "<lane '-1'>: border: expected <width> records; lanes with <border> alone are not read",
        ),
        (road("1", plan=geometry(x=9.5e6, length=1e6), length=1e6), "expected lanes within 10,000,000 m"),
        (
            road("1") + '<junction id="9" type="virtual"/>',
            "<junction '9'>: type: expected one of default, direct, got 'virtual'",
        ),
    ],
)
def test_what_cannot_be_used_is_told_with_element_and_id(part: str, told: str) -> None:
    with pytest.raises(DocumentError) as caught:
        read(part)
    assert told in str(caught.value)
    assert str(caught.value).startswith("small.xodr: line ")


@pytest.mark.parametrize(("name", "most"), [("MAX_POINTS", 50), ("MAX_LANES", 1), ("MAX_METRES", 150.0)])
def test_size_of_a_map_is_bounded(monkeypatch: pytest.MonkeyPatch, name: str, most: float) -> None:
    monkeypatch.setattr(opendrive_map, name, most)
    with pytest.raises(DocumentError, match=r"<road '2'>: expected a map of at most .*; this road is"):
        read(road("1"), road("2", sections=LANES))


def test_elements_that_mean_nothing_are_counted() -> None:
    more = "<surface/><railroad/><objects><tunnel/><object id='1' type='tree' s='0'><repeat/></object></objects>"
    notes = read(road(more=more + "<userData><own><deep/></own></userData>"), "<station/>").notes
    kinds = "1 road/surface, 1 road/railroad, 1 objects/tunnel, 1 object/repeat, 1 userData, 1 station"
    assert f"elements that have no meaning here: {kinds}" in notes
