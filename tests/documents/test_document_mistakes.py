"""The two ways to read a document: our own for those without a mistake, and pydantic for all."""

from __future__ import annotations

import json
from collections.abc import Iterator
from functools import cache
from typing import Any, Literal, get_args, get_origin

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rosbridge_sim.campaigns import campaign_model
from rosbridge_sim.contracts.contract import CONTRACT
from rosbridge_sim.documents.document_mistakes import MAX_WRONG_OBJECTS, judge_document
from rosbridge_sim.documents.document_model import Document, DocumentType, Place, Table, fields_of, split_marks
from rosbridge_sim.documents.document_reading import _document_reader, find_mistakes
from rosbridge_sim.maps import mgeo, mgeo_lights, mgeo_links, mgeo_markings, signal_plan_file
from rosbridge_sim.mock import mock_model
from rosbridge_sim.scenarios import scenario_model
from rosbridge_sim.shell.files import catalogue_file
from rosbridge_sim.simulator.bus import morai_network
from rosbridge_sim.simulator.sensor_rigs import morai_sensor_file, sensor_presets
from rosbridge_sim.simulator.sensors import sensor_noise
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
    {"\n": "lanes"},
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
    campaign = {
        "scenario": ["a", "b"],
        "seeds": [0, 7],
        "parameters": {"speed": [1, 2.5, "rain", True], "gap": {"low": 0, "high": 9.5, "num": 3}},
        "set": {"vehicle": "2 * speed"},
        "drivers": {"ours": "lanes", "mine": {"command": ["a", "{url}"], "environment": {"A": "b"}, "timeout": 5}},
        "limits": {"collisions": 0, "arrival": {"x": 1, "y": 2.5}, "own": {"slow": {"always": "speed < 9"}}},
        "search": {"budget": 10},
        "output": {"keep": "all"},
    }
    topics = {"/speed": {"type": "std_msgs/Float64", "rate": 10, "fields": {"data": {"min": 0, "max": 9.5}}}}
    contract = {"topics": topics, "services": {"/enable": "std_srvs/SetBool"}}
    mock = {
        "topics": {"/speed": {"type": "std_msgs/Float64", "rate": 10, "value": {"data": 1.5}}},
        "subscribers": {"/cmd_vel": "geometry_msgs/Twist"},
        "services": {"/enable": {"type": "std_srvs/SetBool", "answers": [{"when": {"data": True}, "delay": 0.5}]}},
        "actions": {"/dock": {"type": "example_interfaces/Fibonacci", "goals": [{"outcome": "aborted"}]}},
        "transforms": [{"parent": "map", "child": "base", "x": 1}],
        "faults": {"lost": {"kind": "drop", "clients": [1, "127.0.0.*"], "topics": ["/speed"], "end": 5}},
    }
    plan = {"junctions": {"1": {"phases": [{"green": ["a"], "seconds": 20}], "yellow": 3}}}
    network = {"egoNetworkData": [{"UNIQUEID": "1", "listEgoNetworkInfo": [{"PUBSUB_TYPE": 2, "config": {}}]}]}
    row = {"DataID": "1 2", "name": "Sonata", "class": "car", "length": "4.9", "width": 1.8, "height": 1.4, "mass": 9}
    return [
        (campaign_model.CAMPAIGN, campaign),
        (CONTRACT, contract),
        (catalogue_file._ROW, row),
        (mock_model.MOCK, mock),
        (morai_network._FILE, network),
        (signal_plan_file.PLAN_FILE, plan),
        *((scenario_model.SCENARIO, scene) for scene in scenes),
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
        (sensor_presets.SENSOR_FILE, {"gps": {"z": 1}, "imu": None, **rig}),
        (sensor_noise.NOISE, {"gps": {"horizontal": {"white": "0.1"}}, "lidar": {"lost": 0.5}}),
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


def where(place: Place) -> str:
    return f"x: {place}"


@pytest.mark.parametrize("number", range(len(documents())))
def test_document_without_a_mistake_needs_no_search_for_mistakes(number: int) -> None:
    kind, value = documents()[number]
    assert judge_document(kind, value, where) == (_document_reader(kind)(value), [])


@given(st.data())
def test_both_ways_to_read_a_document_agree(data: st.DataObject) -> None:
    kind, value = data.draw(st.sampled_from(documents()))
    for _ in range(data.draw(st.integers(1, 2))):
        value = replaced(value, data.draw(st.sampled_from(places_of(value))), data.draw(st.sampled_from(ODD)))
    try:
        read = _document_reader(kind)(value)
    except ValueError:
        told = judge_document(kind, value, where)[1]
        assert all(mistake.text.isprintable() for mistake in told)
        return
    assert repr(judge_document(kind, value, where)) == repr((read, []))


def forms_in(form: Any) -> Iterator[Any]:  # noqa: ANN401 - type forms
    """The types of all fields of a document, at any depth, with their marks."""
    yield form
    base = split_marks(form)[0]
    inner = fields_of(base).values() if isinstance(base, type) and issubclass(base, Document) else get_args(base)
    if get_origin(base) is not Literal:
        for each in inner:
            yield from forms_in(each)


def test_both_ways_to_read_each_field_agree_on_odd_values_and_beside_its_bounds() -> None:
    forms = {
        repr(form): form for kind, _ in documents() for form in forms_in(kind.form) if form not in {type(None), ...}
    }
    for form in forms.values():
        mark = split_marks(form)[1]
        bounds = [bound + step for bound in (mark.ge, mark.gt, mark.le) if bound is not None for step in (-1, 0, 1)]
        lengths = [
            num + step for num in (mark.min_length, mark.max_length) if num and num < 2_000 for step in (-1, 0, 1)
        ]
        longs = [each for num in lengths for each in ("x" * num, ["x"] * num, {str(i): "x" for i in range(num)})]
        kind = DocumentType[Any](form)
        for odd in [*ODD, *bounds, *longs]:
            try:
                read = _document_reader(kind)(odd)
            except ValueError:
                continue
            assert repr(judge_document(kind, odd, where)) == repr((read, [])), (form, odd)


class Item(Table, frozen=True, kw_only=True):
    size: int


def test_number_of_mistakes_that_are_looked_for_is_bounded() -> None:
    text = json.dumps([{}] * (MAX_WRONG_OBJECTS + 1_000)).encode()
    found = find_mistakes(DocumentType[Any](list[Item]), text, "x", 100_000)
    assert [found[0].text, found[-1].text] == ["x: [0].size: missing", "x: ... and at least 9,901 more"]
