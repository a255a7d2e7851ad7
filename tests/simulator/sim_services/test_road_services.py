"""`/sim/map`, `/sim/route` and `/sim/nearest_lane`: questions about the map that change nothing."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest

from rosbridge_sim.maps.road_map import Projection, RoadMap
from rosbridge_sim.schema.message import Message
from rosbridge_sim.simulator.markers.map_drawing import MAX_LINE_POINTS, MapDrawing
from rosbridge_sim.simulator.sim_services import road_services
from rosbridge_sim.world.roads.roads import Roads
from tests.simulator.sim_harness import Client, ManualReader, SimHarness, make_store
from tests.world.road_factory import built_in


def values_of(client: Client, service: str, **request: object) -> dict[str, Any]:
    answer = client.call(service, request)
    assert isinstance(answer.values, Message), answer.values
    values: dict[str, Any] = json.loads(answer.values.json)
    return values


@pytest.fixture
def harness() -> SimHarness:
    return SimHarness("crossing")


@pytest.fixture
def client(harness: SimHarness) -> Client:
    return harness.client()


def drawing_of(road_map: RoadMap, page_points: int = 5_000) -> MapDrawing:
    return MapDrawing(make_store(), road_map, page_points)


def page_json(drawing: MapDrawing, number: int) -> dict[str, Any]:
    response = make_store().service("rosbridge_sim_msgs/Map").response
    values: dict[str, Any] = json.loads(response.encode_json(response.struct_type(**drawing.page(number))))
    return values


def whole_json(drawing: MapDrawing) -> dict[str, Any]:
    values: dict[str, Any] = json.loads(b"".join(drawing.write_json()))
    return values


# The map


def test_map_has_all_lanes_with_their_lines_and_neighbours(harness: SimHarness, client: Client) -> None:
    values = values_of(client, "/sim/map")
    roads = harness.world.roads
    assert (values["result"], values["page"], values["num_pages"]) == (True, 0, 1)
    assert [lane["link"] for lane in values["lanes"]] == list(roads.ids)
    for row, lane in enumerate(values["lanes"]):
        line = roads.points[roads.first[row] : roads.first[row + 1]]
        assert np.abs(np.array([lane[axis] for axis in "xyz"]).T - line).max() < 0.001
        assert len(lane["left"]) == len(lane["right"]) == len(line)
        assert lane["successors"] == [roads.ids[i] for i in roads.successors(row)]
    assert values["west"] == round(float(roads.points[:, 0].min()), 3)
    assert len(values["lights"]) == len(harness.world.signals.plan.lights)


def test_map_of_the_town_has_borders_by_type_stop_lines_crosswalks_and_lights() -> None:
    values = whole_json(drawing_of(built_in("town")))
    assert {(one["type"], *one["shape"], *one["colour"]) for one in values["borders"]} == {
        (501, "Solid", "yellow"),
        (503, "Broken", "white"),
        (505, "Solid", "white"),
        (530, "Solid", "white"),
    }
    assert {len(one["x"]) for one in values["stop_lines"]} == {2}
    assert values["crosswalks"][0]["parts"][0]["x"]
    light = next(one for one in values["lights"] if one["controller"])
    controller = next(one for one in values["controllers"] if one["name"] == light["controller"])
    assert all(len(phase["lamps"]) > light["group"] for phase in controller["phases"])
    assert controller["cycle"] > sum(phase["duration"] for phase in controller["phases"])
    named = {lane["light"] for lane in values["lanes"]} - {""}
    assert named <= {one["name"] for one in values["lights"]}


def test_stop_line_lies_across_the_end_of_its_lane() -> None:
    town = built_in("town")
    stop = whole_json(drawing_of(town))["stop_lines"][0]
    row = town.roads.row(stop["link"])
    end = town.roads.points[town.roads.first[row + 1] - 1]
    left, right = np.array([stop["x"], stop["y"]]).T
    assert (left + right) / 2 == pytest.approx(end[:2], abs=1.0)
    assert np.hypot(*(left - right)) == pytest.approx(3.5, abs=1.0)


@pytest.mark.parametrize("name", ["town", "loop", "track"])
@pytest.mark.parametrize("page_points", [1, 300, 5_000, 10**9])
def test_pages_together_are_the_whole_map_in_its_order(name: str, page_points: int) -> None:
    drawing = drawing_of(built_in(name), page_points)
    whole = whole_json(drawing)
    pages = [page_json(drawing, number) for number in range(drawing.num_pages)]
    assert [page["page"] for page in pages] == list(range(len(pages)))
    joined = {key: [one for page in pages for one in page[key]] for key, value in whole.items() if type(value) is list}
    assert whole == {**pages[0], "page": 0, "num_pages": 1, **joined}
    assert list(whole) == list(pages[0])


def test_no_page_has_many_more_points_than_it_may() -> None:
    drawing = drawing_of(built_in("town"), 500)
    assert drawing.num_pages > 10
    for number in range(drawing.num_pages):
        lists = page_json(drawing, number)
        assert sum(len(one["x"]) for one in lists["lanes"] + lists["borders"]) <= 500


def test_long_line_is_thinned_to_its_bound() -> None:
    line = np.stack([np.arange(20_001.0), np.zeros(20_001), np.zeros(20_001)], axis=-1)
    roads = Roads(["a"], [line], [[]], [3.5], [10.0])
    drawing = drawing_of(RoadMap("long", Projection(is_tm=False, zone=52), (0.0, 0.0, 0.0), roads))
    (lane,) = whole_json(drawing)["lanes"]
    assert 4_000 < len(lane["x"]) <= MAX_LINE_POINTS
    assert (lane["x"][0], lane["x"][-1]) == (0.0, 20_000.0)
    assert len(lane["left"]) == len(lane["x"])


def test_map_without_lanes_is_one_empty_page() -> None:
    client = SimHarness().client()
    values = values_of(client, "/sim/map")
    assert (values["result"], values["num_pages"], values["lanes"], values["east"]) == (True, 1, [], 0.0)
    refusal = values_of(client, "/sim/map", page=1)
    assert (refusal["result"], refusal["message"]) == (False, "page: expected 0..0, got 1")
    assert client.told == [("error", "/sim/map: page: expected 0..0, got 1")]


def test_digest_changes_with_the_map_alone() -> None:
    town, loop = built_in("town"), built_in("loop")
    assert drawing_of(town).digest == drawing_of(built_in("town")).digest
    assert drawing_of(town).digest != drawing_of(loop).digest


# Routes


def test_route_has_links_points_and_length(harness: SimHarness, client: Client) -> None:
    roads = harness.world.roads
    last = int(roads.successors(0)[0])
    length = float(roads.length[0])
    goal = {"link": roads.ids[last], "distance": 2.0}
    values = values_of(client, "/sim/route", start={"link": roads.ids[0], "distance": 10.0}, goal=goal)
    assert (values["result"], values["links"]) == (True, [roads.ids[0], roads.ids[last]])
    assert values["length_m"] == pytest.approx(length - 10.0 + 2.0)
    points = np.array([(point["x"], point["y"]) for point in values["points"]])
    assert np.hypot(*np.diff(points, axis=0).T).sum() == pytest.approx(values["length_m"], rel=0.02)


def test_route_begins_on_the_lane_nearest_to_a_point(harness: SimHarness, client: Client) -> None:
    roads = harness.world.roads
    (x, y, _), *_ = roads.at(0, 10.0)[0].tolist()
    values = values_of(client, "/sim/route", start={"x": x, "y": y}, goal={"link": roads.ids[0], "distance": 15.0})
    assert (values["links"], round(values["length_m"], 6)) == ([roads.ids[0]], 5.0)


@pytest.mark.parametrize(
    ("start", "goal", "why"),
    [
        ({"link": "nope"}, {"link": "A1B1"}, "start.link: the map has no link 'nope'"),
        ({"link": "A1B1"}, {"link": "A1B1", "distance": 1e3}, "goal.distance: expected 0.."),
        ({"x": 1e5}, {"link": "A1B1"}, "start: expected a place within 100 m of a lane's line, got (100000, 0), "),
        ({"x": None}, {"link": "A1B1"}, "start.x: expected a number within"),
        ({"use_heading": True, "heading_deg": None}, {"link": "A1B1"}, "start.heading_deg: expected a number within"),
        ({"link": "A1B1", "distance": 2.0}, {"link": "A1B1", "distance": 1.0}, "no way leads from 'A1B1' to 'A1B1'"),
    ],
)
def test_route_that_there_is_not_is_refused_with_the_reason(
    client: Client, start: dict[str, object], goal: dict[str, object], why: str
) -> None:
    values = values_of(client, "/sim/route", start=start, goal=goal)
    assert values["result"] is False
    assert values["message"].startswith(why)
    assert (values["links"], values["points"], values["length_m"]) == ([], [], 0.0)


def test_routes_on_a_large_map_are_found_by_the_reader_and_are_few_at_a_time(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(road_services, "MAX_LANES_AT_ONCE", 1)
    reader = ManualReader()
    harness = SimHarness("crossing", reader=reader)
    client = harness.client()
    answers: list[Any] = []
    request = {"start": {"link": "A1B1"}, "goal": {"link": "A1B1", "distance": 3.0}}
    for _ in range(9):
        harness.bus.call(client, "/sim/route", request, answers.append, now=0.0)
    assert len(answers) == 1
    assert "8 routes are being found" in answers.pop().values.value.message
    harness.bus.leave(client, 0.0)
    other = harness.client()
    harness.bus.call(other, "/sim/nearest_lane", {}, answers.append, now=0.0)
    assert answers.pop().values.value.result
    for _ in range(8):
        reader.hand_over()
    harness.bus.call(other, "/sim/route", request, answers.append, now=0.0)
    reader.hand_over()
    assert answers.pop().values.value.length_m == 3.0


# Lanes


def test_nearest_lane_tells_place_heading_and_limit(harness: SimHarness, client: Client) -> None:
    roads = harness.world.roads
    (x, y, _), *_ = roads.at(0, 10.0)[0].tolist()
    values = values_of(client, "/sim/nearest_lane", x=x, y=y)
    assert (values["result"], values["link"], values["is_on_road"]) == (True, roads.ids[0], True)
    assert (values["distance"], values["lateral"]) == pytest.approx((10.0, 0.0))
    assert (values["speed_limit"], values["length"]) == (roads.speed_limit[0], roads.length[0])
    far = values_of(client, "/sim/nearest_lane", x=x, y=y - 500.0)
    assert (far["result"], far["is_on_road"]) == (True, False)


def test_nearest_lane_of_a_map_without_lanes_is_refused() -> None:
    client = SimHarness().client()
    values = values_of(client, "/sim/nearest_lane", x=1.0)
    assert (values["result"], values["message"]) == (False, "the map has no lanes")
    assert values_of(client, "/sim/nearest_lane", x=1e10)["message"].startswith("x: expected a number within")
