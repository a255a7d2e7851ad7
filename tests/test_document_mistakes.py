"""The two ways to read a document: our own for those without a mistake, and that of `document_mistakes` for all."""

from __future__ import annotations

import json
from functools import cache
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rosbridge_sim.document_mistakes import list_mistakes, read_slowly
from rosbridge_sim.documents import DocumentType, sort_keys
from rosbridge_sim.errors import DocumentError
from rosbridge_sim.maps import mgeo, mgeo_lights, mgeo_links, mgeo_markings
from rosbridge_sim.scenarios import scenario_model
from rosbridge_sim.simulator.sensors import morai_sensor_file, sensor_noise, sensor_presets
from tests.support import ROOT

MAP = ROOT / "rosbridge_sim" / "data" / "maps" / "town"
ODD: list[Any] = [None, True, False, 0, 1, -1, 2.0, 2.5, -0.0, 1e13, 2**40, 2**70, 1e300, "", "7", " -1,234.5 ", "1,2"]
ODD += [
    "nan",
    "1e999",
    "1e-999",
    "True",
    "false ",
    "x" * 1001,
    "a b",
    [],
    [1],
    ["a"],
    [None] * 3,
    {},
    {"x": 1},
    {"_z": "2"},
]


def document(kind: DocumentType[Any], name: str) -> tuple[DocumentType[Any], Any]:
    """A document, cut to its first entries."""
    value = json.loads((MAP / name).read_text())
    return kind, value[:2] if isinstance(value, list) else value


@cache
def documents() -> list[tuple[DocumentType[Any], Any]]:
    """Documents without a mistake, of each kind, with their types."""
    data = ROOT / "rosbridge_sim" / "data" / "scenarios"
    scenes = [json.loads((data / f"{name}.json").read_text()) for name in ("demo", "rush_hour")]
    rig = {kind: [{"frame_id": "a", "topic": "/b", "x": 1}] for kind in ("camera", "lidar3d", "lidar2d", "radar")}
    rig["lidar3d"][0] |= {"model": "own", "elevations": [-1, "2.5"]}
    rig["camera"][0] |= {"distortion": [0, 0, 0.1, 0, 0], "detections": True, "quality": "80"}
    saved = {"cameraList": [{"pos": {"x": "1.5"}, "rot": {}, "cc": {"principalPoint": {"x": 320, "y": 240}}}]}
    mark = {"idx": 1, "points": [[0, 0, 0], [1, 0, 0], [1, 1, 0]], "sub_type": "5371"}
    sign = {"idx": "s", "point": ["0", 1, 2.5], "heading": "90.0", "type": "1", "width": 0.6, "height": 0.6}
    return [
        *((scenario_model._DOCUMENT, scene) for scene in scenes),
        document(mgeo._GLOBAL_INFO, "global_info.json"),
        document(mgeo_links._NODES, "node_set.json"),
        document(mgeo_links._LINKS, "link_set.json"),
        document(mgeo_links._BORDERS, "lane_boundary_set.json"),
        document(mgeo_lights._LIGHTS, "traffic_light_set.json"),
        document(mgeo_lights._SYNCED, "synced_traffic_light_set.json"),
        document(mgeo_lights._CONTROLLERS, "intersection_controller_set.json"),
        document(mgeo_lights._SCHEDULES, "intersection_controller_state.json"),
        document(mgeo_lights._CROSSWALKS, "crosswalk_set.json"),
        document(mgeo_lights._STRIPES, "singlecrosswalk_set.json"),
        (mgeo_markings._MARKINGS, [mark]),
        (mgeo_markings._SIGNS, [sign]),
        (sensor_presets._DOCUMENT, {"gps": {"z": 1}, "imu": None, **rig}),
        (sensor_noise._DOCUMENT, {"gps": {"horizontal": {"white": "0.1"}}, "lidar": {"lost": 0.5}}),
        (morai_sensor_file._DOCUMENT, saved),
    ]


def places_of(value: object, place: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """The places of all values in a document."""
    inner = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    return [place, *(each for key, one in inner for each in places_of(one, (*place, key)))]


def replaced(value: Any, place: tuple[Any, ...], odd: object) -> object:  # noqa: ANN401 - JSON
    """The document with another value at a place."""
    if not place:
        return odd
    copy = dict(value) if isinstance(value, dict) else list(value)
    copy[place[0]] = replaced(value[place[0]], place[1:], odd)
    return copy


@pytest.mark.parametrize("number", range(len(documents())))
def test_document_without_a_mistake_needs_no_search_for_mistakes(number: int) -> None:
    kind, value = documents()[number]
    assert repr(kind.read(value)) == repr(read_slowly(kind, json.dumps(value).encode(), "x"))


@given(st.data())
def test_both_ways_to_read_a_document_agree(data: st.DataObject) -> None:
    kind, value = data.draw(st.sampled_from(documents()))
    for _ in range(data.draw(st.integers(1, 2))):
        value = replaced(value, data.draw(st.sampled_from(places_of(value))), data.draw(st.sampled_from(ODD)))
    try:
        read = kind.read(json.loads(json.dumps(value)))
    except ValueError:
        return
    text = json.dumps(value).encode()
    assert repr(read) == repr(read_slowly(kind, text, "x"))
    assert list_mistakes(kind, text, "x") == []


def test_key_that_is_missing_or_twice_is_judged_alike() -> None:
    kind = scenario_model._DOCUMENT
    twice = b'{"mapInfo": {"mapName": "a", "mapName": "b"}}'
    assert read_slowly(kind, twice, "x").mapInfo == scenario_model.read_scenario_document(twice, "x").mapInfo
    with pytest.raises(DocumentError, match=r"^x: egoVehicle\.initPosition: missing$"):
        scenario_model.read_scenario_document(b'{"egoVehicle": {}}', "x")


def test_long_key_is_shortened_where_a_document_is_told_of() -> None:
    """A client may send sensors with a key of megabytes, which the answer must not repeat."""
    key = "k\u202e" * 3_000_000
    kind: DocumentType[dict[str, int]] = DocumentType(dict[str, int])
    with pytest.raises(DocumentError, match="should be a valid integer") as error:
        read_slowly(kind, json.dumps({key: "x"}).encode(), "f.json")
    assert len(str(error.value)) < 500
    assert "\u202e" not in str(error.value)
    [path] = sort_keys(scenario_model.ScenarioDocument, {key: 1}).passed_over
    assert len(path) < 500
