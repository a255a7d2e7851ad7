from __future__ import annotations

import json
import math

import pytest

from rosbridge_sim.maps.mgeo import INFO_FILE, read_mgeo
from rosbridge_sim.maps.mgeo_markings import MARKING_FILE, SIGN_FILE
from rosbridge_sim.maps.road_map import RoadMap
from tests.maps.test_mgeo import INFO, LINKS, NODES

SQUARE = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]


def read(**more: object) -> RoadMap:
    files = {INFO_FILE: INFO, "node_set.json": NODES, "link_set.json": LINKS}
    files |= {f"{name}.json": value for name, value in more.items()}  # type: ignore[misc]
    return read_mgeo({name: json.dumps(value).encode() for name, value in files.items()}, "maps/tiny/")


def test_markings_are_read_but_those_of_crosswalks() -> None:
    found = read(
        surface_marking_set=[
            {"idx": "arrow", "points": SQUARE, "type": "5", "sub_type": "5371"},
            {"idx": "zebra", "points": SQUARE, "type": "5", "sub_type": "5321"},
            {"idx": "line", "points": SQUARE[:2]},
        ]
    )
    assert [marking.name for marking in found.markings] == ["arrow"]
    assert found.markings[0].outline.tolist() == SQUARE
    assert found.notes == (f"{MARKING_FILE}: 1 markings without 3 to 200 corners are not drawn",)


def test_signs_are_read_with_their_place_and_direction() -> None:
    (sign,) = read(
        traffic_sign_set=[{"idx": 7, "point": [1, 2, 3], "heading": 270, "type": "2", "width": 0.9, "height": 0}]
    ).signs
    assert (sign.name, sign.x, sign.y, sign.z, sign.kind, sign.width, sign.height) == ("7", 1, 2, 3, "2", 0.9, 0.6)
    assert sign.yaw == pytest.approx(-math.pi / 2)


@pytest.mark.parametrize("name", [MARKING_FILE, SIGN_FILE])
def test_mistake_in_what_nothing_drives_by_is_a_remark(name: str) -> None:
    found = read(**{name.removesuffix(".json"): [{"idx": "a"}]})
    assert len(found.roads) == 3
    assert not found.markings
    assert not found.signs
    assert "nothing is drawn of it" in found.notes[0]
    assert name in found.notes[0]
