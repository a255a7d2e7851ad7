from __future__ import annotations

import json
from typing import Any

import pytest

from rosbridge_sim.maps.map_check import describe_map, list_files
from rosbridge_sim.maps.map_formats import find_map_mistakes, read_map
from tests.simulator.small_maps import KOREAN, ROADRUNNER, Files, light, node


def encoded(files: Files) -> dict[str, bytes]:
    return {name: json.dumps(value).encode() for name, value in files.items()}


def described(files: Files) -> dict[str, Any]:
    return describe_map(encoded(files), read_map(encoded(files), "maps/tiny"))


def gaps(files: Files) -> dict[str, tuple[str, ...]]:
    return {gap["what"]: tuple(gap["examples"]) for gap in described(files)["gaps"]}


def mistakes(files: Files) -> list[str]:
    return find_map_mistakes(encoded(files), "maps/tiny")


def changed(files: Files, name: str, row: int, **keys: object) -> Files:
    entries = [dict(entry) for entry in files[name]]
    entries[row].update(keys)
    return {**files, name: entries}


def told(files: Files, names: tuple[str, ...] = ()) -> dict[str, tuple[bool, bool, str | None]]:
    listed = list_files(encoded(files), [*files, *names])
    return {one["name"]: (one["is_there"], one["is_read"], one["holds"]) for one in listed}


# -- files


def test_new_file_names_are_recognised() -> None:
    files = told(ROADRUNNER, ("my_notes.txt",))
    assert files["link_set.json"] == (True, True, None)
    assert files["lane_boundary_set.json"] == (True, True, None)
    assert files["lane_marking_set.json"] == (False, False, None)
    assert files["synced_traffic_light_set.json"] == (True, True, "groups")
    assert files["intersection_controller_state.json"] == (True, True, "schedules")
    assert files["road_polygon_set.json"] == files["my_notes.txt"] == (True, False, None)


def test_old_file_names_and_other_contents_are_recognised() -> None:
    files = told(KOREAN)
    assert files["lane_marking_set.json"] == (True, True, None)
    assert files["synced_traffic_light_set.json"] == (True, True, "schedules")
    assert files["intersection_controller_data.json"] == (True, False, None), "the same schedule once more"
    assert told({**KOREAN, "lane_boundary_set.json": []})["lane_boundary_set.json"] == (True, False, None)


@pytest.mark.parametrize("name", ["surface_marking_set.json", "traffic_sign_set.json"])
def test_files_that_are_only_drawn_are_read_too(name: str) -> None:
    assert told({**ROADRUNNER, name: []})[name] == (True, True, None)
    assert told(ROADRUNNER)[name] == (False, False, None)


# -- figures


def test_check_reports_the_figures_of_a_map() -> None:
    account = described(ROADRUNNER)
    assert (account["name"], account["version"], account["projection"]["kind"]) == ("tiny", "2.9", "UTM 52N")
    assert account["extent"] == {"x": [0.0, 120.0], "y": [0.0, 17.0], "z": [0.0, 0.0]}
    assert account["nodes"] == {"num": 7, "on_stop_line": 2}
    lanes = account["lanes"]
    assert (lanes["num"], lanes["num_links_for_changes"], lanes["num_to_stop_lines"]) == (5, 1, 2)
    assert lanes["by_speed_limit"]["50"] == {"num": 2, "length_km": pytest.approx(0.2)}
    assert {key: kind["num"] for key, kind in lanes["by_link_type"].items()} == {"6": 2, "1": 3}
    assert account["borders"] == {"num": 4, "by_type": {"503": 4}}
    assert account["lights"] == {
        "num": 4,
        "by_type": {"car": 3, "pedestrian": 1},
        "by_sub_type": {
            "red, yellow, straight": 1,
            "yellow, yellow, yellow": 1,
            "red, yellow, left": 1,
            "none": 1,
        },
        "by_type_on_the_wire": {"0": 2, "100": 1, "1": 1},
        "num_groups": 3,
    }
    (crossing,) = account["controllers"]
    assert (crossing["name"], crossing["number"], crossing["cycle"]) == ("IntTL13", 13, 20.5)
    assert crossing["groups"] == [["C1", "C2"], ["L1"], ["P1"]]
    assert crossing["phases"] == [{"duration": 10.0, "colours": [16, 1, 1]}, {"duration": 5.5, "colours": [1, 32, 1]}]
    assert (crossing["yellow"], crossing["num_walks"]) == ([3.0, 2.0, 3.0], 1)
    assert account["crosswalks"] == {"num": 2, "num_parts": 2, "num_with_lights": 1}
    assert account["notes"] == []
    json.dumps(account)


def test_check_reports_figures_of_nearly_empty_maps() -> None:
    needed = ("global_info.json", "node_set.json", "link_set.json")
    small = {name: KOREAN[name] for name in needed}
    assert described(small)["lights"]["num"] == 0
    account = described({**small, "global_info.json": {"global_coordinate_system": "UTM52N"}})
    assert (account["version"], account["lanes"]["num"], account["controllers"]) == (None, 5, [])
    assert mistakes({**small, "link_set.json": []}) == [
        "tiny/link_set.json: expected at least one link to drive on, got none"
    ]


def test_map_without_georeference_is_described() -> None:
    files = {name: value for name, value in ROADRUNNER.items() if name != "global_info.json"}
    account = described(files)
    assert account["projection"] == {"text": "", "kind": None, "ellipse": ""}
    assert (account["version"], account["origin"]) == (None, [0.0, 0.0, 0.0])
    assert account["notes"] == ["global_info.json is missing: no georeference, so /gps has no fix"]
    assert mistakes(files) == []
    assert told(files)["global_info.json"] == (False, False, None)


@pytest.mark.parametrize("idx", [5, 5.0, -0.0, 1e30, 2.5])
def test_ids_may_be_numbers(idx: float) -> None:
    points = [[0, 0, 0], [9, 0, 0]]
    link = {"idx": idx, "from_node_idx": 1.0, "to_node_idx": 2, "points": points, "left_lane_change_dst_link_idx": idx}
    files = {**ROADRUNNER, "node_set.json": [{"idx": 1.0}, {"idx": 2.0}], "link_set.json": [link]}
    assert list(described(files)["lanes"]["by_link_type"]) == ["none"]
    assert "nodes without a link" not in gaps(files)
    assert "lanes with a left neighbour that is not there" not in gaps(files)


# -- gaps


def test_links_that_are_no_roads_are_told_and_have_no_gaps() -> None:
    files = changed(changed(ROADRUNNER, LINKS, 3, link_type="sidewalk", width_start=None), LINKS, 4, width_start=None)
    account = described(files)
    assert account["notes"] == ["links of type sidewalk are no road for vehicles and left out: 1 (B2C2)"]
    assert account["lanes"]["by_link_type"].keys() == {"6", "1"}
    assert gaps(files)["lanes without a width (3.5 m is taken)"] == ("B2D",)


def test_ends_of_the_map_are_the_only_gaps() -> None:
    assert gaps(ROADRUNNER) == {
        "lanes that lead nowhere": ("B1C1", "B2C2", "B2D"),
        "lanes that no lane leads to": ("A1B1", "A2B2"),
        "crosswalks with a light that is not there": ("CW1",),
    }


LINKS, LIGHTS, GROUPS = "link_set.json", "traffic_light_set.json", "synced_traffic_light_set.json"


@pytest.mark.parametrize(
    ("files", "what", "names"),
    [
        (changed(ROADRUNNER, LINKS, 2, max_speed=0), "lanes without a speed limit", ("B1C1",)),
        (changed(ROADRUNNER, LINKS, 2, width_start=None), "lanes without a width (3.5 m is taken)", ("B1C1",)),
        (
            changed(ROADRUNNER, LINKS, 2, points=[[101, 0, 0], [120, 0, 0]]),
            "lanes that end away from where the next one begins",
            ("A1B1",),
        ),
        (
            changed(ROADRUNNER, LINKS, 0, left_lane_change_dst_link_idx="gone"),
            "lanes with a left neighbour that is not there",
            ("A1B1",),
        ),
        (changed(ROADRUNNER, LINKS, 1, lane_mark_left=["gone"]), "lanes with a left edge that is not there", ("A2B2",)),
        (
            changed(ROADRUNNER, LINKS, 5, lane_ch_link_path=["A1B1", "gone"]),
            "links for a change to lanes that are not there",
            ("A1B1-A2B2",),
        ),
        (
            {**ROADRUNNER, "node_set.json": [*ROADRUNNER["node_set.json"], node("lonely", 1, 1)]},
            "nodes without a link",
            ("lonely",),
        ),
        (changed(ROADRUNNER, LIGHTS, 2, link_id_list=["gone"]), "lights with a link that is not there", ("L1",)),
        (changed(ROADRUNNER, LIGHTS, 2, link_id_list=[]), "lights for vehicles that serve no lane", ("L1",)),
        (
            {**ROADRUNNER, LIGHTS: [*ROADRUNNER[LIGHTS], light("free", ["B2D"])]},
            "lights that no intersection runs",
            ("free",),
        ),
        ({**ROADRUNNER, LIGHTS: []}, "lanes to a stop line without a light", ("A1B1", "A2B2")),
        (changed(ROADRUNNER, GROUPS, 1, signal_id_list=["x"]), "groups with a light that is not there", ("SSN000001",)),
        (
            {**ROADRUNNER, "intersection_controller_set.json": [{"idx": "IntTL13", "TL": [["C1"], ["x"]]}]},
            "intersection controllers with a light that is not there",
            ("IntTL13",),
        ),
        (
            {**ROADRUNNER, "intersection_controller_state.json": []},
            "intersection controllers without a schedule",
            ("IntTL13",),
        ),
        (KOREAN, "schedules without an intersection controller", ("IntTL13",)),
    ],
)
def test_each_gap_is_reported_with_its_links(files: Files, what: str, names: tuple[str, ...]) -> None:
    assert gaps(files)[what] == names
    assert what not in gaps(ROADRUNNER)


def test_many_remarks_of_one_kind_are_summarised() -> None:
    nodes = [*ROADRUNNER["node_set.json"], *(node(f"n{i}", i, 9) for i in range(50))]
    found = described({**ROADRUNNER, "node_set.json": nodes})["gaps"]
    (gap,) = [gap for gap in found if gap["what"] == "nodes without a link"]
    assert (gap["num"], gap["examples"]) == (50, ["n0", "n1", "n2", "n3", "n4"])


# -- mistakes


def test_good_maps_have_no_errors() -> None:
    assert mistakes(ROADRUNNER) == mistakes(KOREAN) == []


def test_all_errors_of_all_files_are_reported() -> None:
    files = changed(changed(ROADRUNNER, LINKS, 0, max_speed="fast"), LINKS, 3, points=[[0, 0]])
    files = changed(files, LIGHTS, 1, heading="north")
    files["lane_boundary_set.json"] = [{"points": []}]
    files["global_info.json"] = {}
    files["crosswalk_set.json"] = [{"idx": None}]
    assert mistakes(files) == [
        "tiny/global_info.json: global_coordinate_system: missing",
        "tiny/link_set.json: [0].max_speed: expected a number, got 'fast'",
        "tiny/link_set.json: [3].points[0]: expected a list of 3, got a list of 2",
        "tiny/lane_boundary_set.json: [0].idx: missing",
        "tiny/traffic_light_set.json: [1].heading: expected a number, got 'north'",
        "tiny/crosswalk_set.json: [0].idx: expected a text, got null",
    ]


def test_semantic_errors_and_missing_files_are_reported_separately() -> None:
    assert mistakes(changed(ROADRUNNER, LINKS, 0, from_node_idx="gone")) == [
        "tiny/link_set.json: [0].from_node_idx: node_set.json has no node 'gone'"
    ]
    assert mistakes({"node_set.json": []}) == ["maps/tiny: link_set.json is missing"]
    torn = encoded(ROADRUNNER) | {"node_set.json": b"[{]"}
    assert find_map_mistakes(torn, "maps/tiny") == ["tiny/node_set.json:1:3: not JSON: expected a key in double quotes"]


def test_number_of_reported_errors_is_bounded() -> None:
    lines = mistakes({**ROADRUNNER, LINKS: [{}] * 5_000})
    assert len(lines) == 101
    assert lines[-1] == "tiny/link_set.json: ... and 9,900 more"
