"""Variants of maps: old and new file names and keys; empty, null and missing sets."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.maps.map_formats import read_map
from rosbridge_sim.maps.mgeo import FILES, INFO_FILE, MAP_FILES
from rosbridge_sim.maps.mgeo_links import LANE_WIDTH
from rosbridge_sim.maps.road_map import RoadMap
from rosbridge_sim.shell.files.library import DiskLibrary
from rosbridge_sim.world.roads.signals import Signals
from tests.simulator.small_maps import KOREAN, ROADRUNNER, Files, read

OPTIONAL = [name for name in MAP_FILES if name not in (INFO_FILE, *FILES)]

CONTROLLERS = {"intersection_controller_set.json": ROADRUNNER["intersection_controller_set.json"]}
"""What the old map lacks to have its lights run."""


def edited(files: Files, name: str, **keys: object) -> Files:
    """The files with these keys in every entry of one."""
    return {**files, name: [{**entry, **keys} for entry in files[name]]}


def without(files: Files, name: str, *keys: str) -> Files:
    return {**files, name: [{k: v for k, v in entry.items() if k not in keys} for entry in files[name]]}


def lanes(road_map: RoadMap) -> tuple[object, ...]:
    roads = road_map.roads
    return roads.ids, roads.points.tolist(), roads.successor.tolist(), roads.left.tolist(), roads.right.tolist()


def shown(road_map: RoadMap, *seconds: float) -> list[list[int]] | None:
    if not road_map.plan.lights:
        return None
    signals = Signals(road_map.plan)
    out = []
    for second in seconds:
        signals.show(round(second * 50))
        out.append(signals.shown.tolist())
    return out


def test_old_and_new_file_names_give_the_same_map() -> None:
    old, new = read({**KOREAN, **CONTROLLERS}), read(ROADRUNNER)
    assert lanes(old) == lanes(new)
    assert old.roads.border.tolist() == new.roads.border.tolist()
    assert shown(old, 0.0, 11.0, 13.0, 16.0) == shown(new, 0.0, 11.0, 13.0, 16.0)
    assert (old.projection.zone, new.projection.zone) == (52, 52)


@pytest.mark.parametrize("name", OPTIONAL)
@pytest.mark.parametrize("files", [ROADRUNNER, KOREAN], ids=["new", "old"])
def test_optional_files_may_be_empty_or_missing(files: Files, name: str) -> None:
    whole = lanes(read(files))
    assert lanes(read({key: value for key, value in files.items() if key != name})) == whole
    assert lanes(read({**files, name: []})) == whole


def test_only_two_files_are_required() -> None:
    bare = read({name: KOREAN[name] for name in FILES})
    assert lanes(bare) == lanes(read(KOREAN))
    assert (bare.plan.lights, bare.crosswalks, len(bare.notes)) == ((), (), 1)


@pytest.mark.parametrize(
    ("name", "keys"),
    [
        ("link_set.json", {"oppTraffic": True}),
        ("link_set.json", {"opp_traffic": True}),
        ("link_set.json", {"speed_start": 0, "speed_end": 0, "speed_list": {}, "recommended_speed": None}),
        ("link_set.json", {"speed_offset": 0, "lane_change_dir": None, "hov": "", "its_link_id": ""}),
        ("link_set.json", {"road_id": 7, "ego_lane": "-1", "link_type": "DRIVABLE_LANE", "link_type_def": ""}),
        ("link_set.json", {"geometry": None, "lane_ch_link_path": None, "related_signal": ""}),
        ("lane_boundary_set.json", {"passRestr": "X"}),
        ("lane_boundary_set.json", {"pass_restr": "X", "lane_type_list": [501], "lane_color_list": ["yellow"]}),
        ("node_set.json", {"node_type": "4", "junction": ["J1", 2]}),
        ("traffic_light_set.json", {"orientation": "+", "dynamic": False, "z_offset": None, "ref_crosswalk_id": None}),
    ],
)
def test_optional_keys_make_no_difference(name: str, keys: dict[str, Any]) -> None:
    files = without(ROADRUNNER, "link_set.json", "opp_traffic", "geometry", "road_id", "ego_lane", "link_type")
    if "related_signal" in keys:  # without it the bends tell
        files = edited(files, "link_set.json", related_signal=None)
    assert lanes(read(edited(files, name, **keys))) == lanes(read(files))
    assert shown(read(edited(files, name, **keys)), 13.0) == shown(read(files), 13.0)


@pytest.mark.parametrize(
    ("name", "keys"),
    [
        ("link_set.json", ("lane_mark_left", "lane_mark_right", "width_start", "force_width_start", "max_speed")),
        ("link_set.json", ("can_move_left_lane", "can_move_right_lane", "lane_ch_link_path")),
        ("link_set.json", ("related_signal", "left_lane_change_dst_link_idx", "right_lane_change_dst_link_idx")),
        ("node_set.json", ("on_stop_line",)),
        ("traffic_light_set.json", ("link_id_list", "type", "sub_type", "point", "heading")),
        ("synced_traffic_light_set.json", ("intersection_controller_id",)),
        ("intersection_controller_state.json", ("yelloduration", "PSState")),
        ("crosswalk_set.json", ("single_crosswalk_list", "ref_traffic_light_list")),
        ("singlecrosswalk_set.json", ("ref_crosswalk_id",)),
    ],
)
def test_null_equals_a_missing_key(name: str, keys: tuple[str, ...]) -> None:
    missing = read(without(ROADRUNNER, name, *keys))
    null = read(edited(ROADRUNNER, name, **dict.fromkeys(keys)))
    assert lanes(missing) == lanes(null)
    assert missing.roads.digest == null.roads.digest
    assert missing.notes == null.notes
    assert missing.plan.digest == null.plan.digest


def test_lane_change_links_need_no_points() -> None:
    *ways, change = ROADRUNNER["link_set.json"]
    for points in ([], [[0, 0, 0]], [[0, 0, 0], [0, 0, 0]]):
        assert lanes(read({**ROADRUNNER, "link_set.json": [*ways, {**change, "points": points}]})) == lanes(
            read(ROADRUNNER)
        )


def test_forced_lane_width_is_used() -> None:
    wide = edited(ROADRUNNER, "link_set.json", width_start=5.0, lane_mark_left=[], lane_mark_right=[])
    assert read(wide).roads.width.tolist() == [LANE_WIDTH] * 5
    forced = read(edited(wide, "link_set.json", force_width_start=True)).roads
    assert forced.width.tolist() == [5.0] * 5
    assert (forced.border == 2.5).all()


def test_user_folder_is_read_from_the_disk(tmp_path: Path) -> None:
    folder = tmp_path / "R_KR_Somewhere"
    folder.mkdir()
    for name, content in {**KOREAN, **CONTROLLERS}.items():  # as a Windows editor leaves them
        text = json.dumps(content, indent=4).replace("\n", "\r\n")
        (folder / name).write_bytes(b"\xef\xbb\xbf" + text.encode())
    (folder / "sim_build_data_traffic_light.csv").write_bytes(b"FolderPath,\xb5")
    (folder / "road_polygon_set.json").write_text("not read")
    (folder / "backup").mkdir()
    for name in ("whatever a scenario asks for", "town"):
        assert lanes(DiskLibrary(own_map=str(folder)).map(name)) == lanes(read(KOREAN))
    assert DiskLibrary(own_map=str(folder)).map("x").name == "R_KR_Somewhere"


def test_files_that_are_not_json_are_named(tmp_path: Path) -> None:
    for name in (*FILES, "traffic_light_set.json", "crosswalk_set.json"):
        files = {key: json.dumps(value).encode() for key, value in ROADRUNNER.items()} | {name: b"[{]"}
        with pytest.raises(DocumentError, match=rf"^{tmp_path.name}/{name}:1:3: not JSON: "):
            read_map(files, str(tmp_path))
