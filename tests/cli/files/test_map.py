"""`map info`: a report on a folder of MGeo files, as text, JSON and picture."""

from __future__ import annotations

import json
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from PIL import Image

from rosbridge_sim.maps.map_formats import read_map
from rosbridge_sim.maps.road_map import RoadMap
from rosbridge_sim.scenarios.scenario import Spawn
from rosbridge_sim.scenarios.scenario_reader import read_scenario
from rosbridge_sim.shell.drawing.map_picture import (
    AGENTS,
    CAR_LIGHT,
    DEAD_END,
    FINE,
    LANE,
    STOP,
    STRIPES,
    WALK_LIGHT,
    WARNING_LIGHT,
    _lay_legend,
    _legend_font,
    draw_map,
)
from rosbridge_sim.shell.files.other_formats import MAP_IS
from rosbridge_sim.world.roads.roads import Roads
from tests.cli.tool_fixture import run
from tests.maps.opendrive.xodr_texts import document, lane, road, section
from tests.simulator.small_maps import KOREAN, ROADRUNNER

MAP_NAMES = "hills, loop, motorway, parking, roundabout, town, track"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A map of the user's, with a note beside its files."""
    for name, content in ROADRUNNER.items():
        (tmp_path / name).write_text(json.dumps(content))
    (tmp_path / "notes.txt").write_text("mine")
    return tmp_path


def test_map_info_describes_a_map(folder: Path) -> None:
    done = run("map", "info", str(folder))
    assert (done.code, done.err) == (0, "")
    assert done.lines[0] == f"{folder}: 3 remarks"
    at = done.lines.index("remarks:")
    assert (at, done.lines[at + 1]) == (2, "  3 lanes that lead nowhere: B1C1, B2C2, B2D")
    at = done.lines.index("", at)
    assert done.lines[at + 1].startswith(
        "  read: global_info.json, node_set.json, link_set.json, lane_boundary_set.json,"
    )
    for line in (
        "  present, but not needed: lane_node_set.json, road_polygon_set.json, notes.txt",
        "version: 2.9",
        "projection: UTM 52N, WGS84 (+proj=utm +zone=52 +ellps=WGS84)",
        "origin: 300,000.000 east, 4,000,000.000 north, 0.000 up",
        "nodes: 7, 2 of them on a stop line",
        "borders: 4 (4 type 503)",
        "lights: 4 (3 car, 1 pedestrian); 3 groups",
        "crosswalks: 2, 1 of them with lights",
        "IntTL13       13      3       4       20.5       10 5.5      3 2 3",
        "  3 lanes that lead nowhere: B1C1, B2C2, B2D",
    ):
        assert line in done.lines


def test_json_output_holds_the_same_facts(folder: Path) -> None:
    account = run("map", "info", str(folder), "--json").json
    assert (account["is_good"], account["mistakes"], account["folder"]) == (False, [], str(folder))
    assert account["remarks"][0] == "3 lanes that lead nowhere: B1C1, B2C2, B2D"
    assert account["lanes"]["num"] == 5
    assert account["gaps"][0] == {"what": "lanes that lead nowhere", "num": 3, "examples": ["B1C1", "B2C2", "B2D"]}
    assert {"name": "notes.txt", "is_there": True, "is_read": False, "holds": None, "is_known": False} in account[
        "files"
    ]


def test_map_with_errors_gives_exit_code_1(folder: Path) -> None:
    (folder / "node_set.json").write_text('[{"idx": null}, {}]')
    (folder / "link_set.json").unlink()
    done = run("map", "info", str(folder))
    assert (done.code, done.err) == (1, "")
    assert done.lines[0] == f"{folder}: 1 mistake"
    assert done.lines[1:4] == ["", "mistakes:", f"  {folder}: link_set.json is missing"]
    (folder / "link_set.json").write_text(json.dumps(ROADRUNNER["link_set.json"]))
    done = run("map", "info", str(folder), "--json")
    assert done.code == 1
    account = json.loads(done.out)
    assert account["is_good"] is False
    assert [line.partition(": ")[2] for line in account["mistakes"]] == [
        "[0].idx: expected a text, got null",
        "[1].idx: missing",
    ]


def test_map_without_georeference_is_explained(folder: Path) -> None:
    (folder / "global_info.json").unlink()
    done = run("map", "info", str(folder))
    assert (done.code, done.err) == (0, "")
    assert "  global_info.json is missing: no georeference, so /gps has no fix" in done.lines
    assert "projection: none" in done.lines
    assert not any(line.startswith("origin") for line in done.lines)


@pytest.mark.parametrize("name", ["track", "town", "loop", "motorway", "roundabout", "parking"])
def test_built_in_maps_have_no_errors_and_no_gaps(name: str) -> None:
    account = run("map", "info", name, "--json").json
    assert (account["is_good"], account["gaps"], account["notes"]) == (True, [], [])


def test_strict_turns_remarks_into_exit_code_1(folder: Path) -> None:
    assert run("map", "info", str(folder)).code == 0
    assert run("map", "info", str(folder), "--strict").code == 1
    assert run("map", "info", "track", "--strict").code == 0


def test_each_of_several_maps_gets_its_own_verdict(folder: Path, tmp_path: Path) -> None:
    all_maps = tmp_path / "maps"
    all_maps.mkdir()
    folder.joinpath("notes.txt").unlink()
    variants: dict[str, dict[str, Any]] = {"a": {}, "b": {"link_set.json": []}}
    for name, changes in variants.items():
        (all_maps / name).mkdir()
        for file, content in {**ROADRUNNER, **changes}.items():
            (all_maps / name / file).write_text(json.dumps(content))
    (all_maps / "no map").mkdir()
    done = run("map", "info", str(all_maps), "track")
    assert (done.code, done.err) == (1, "")
    assert done.lines[0] == f"{all_maps}/a: 3 remarks"
    assert done.lines[1] == "  remark: 3 lanes that lead nowhere: B1C1, B2C2, B2D"
    at = done.lines.index(f"{all_maps}/b: 1 mistake")
    assert done.lines[at + 1] == "  mistake: b/link_set.json: expected at least one link to drive on, got none"
    assert done.lines[-2].endswith("maps/track: good")
    assert done.lines[-1] == "3 files: 1 good, 1 with remarks, 1 with mistakes"
    done = run("map", "info", str(all_maps), "track", "--json")
    assert [json.loads(line)["is_good"] for line in done.lines] == [False, False, True]


@pytest.mark.parametrize(("name", "form"), [("x.jpg", "JPEG"), ("x.JPEG", "JPEG"), ("x.PNG", "PNG")])
@pytest.mark.slow
def test_picture_format_follows_the_file_suffix(name: str, form: str, tmp_path: Path) -> None:
    assert run("map", "info", "track", "--picture", str(tmp_path / name)).code == 0
    with Image.open(tmp_path / name) as image:
        assert image.format == form


@pytest.mark.slow
@pytest.mark.parametrize("files", [ROADRUNNER, KOREAN], ids=["new", "old"])
def test_any_map_can_be_drawn(files: dict[str, object], tmp_path: Path) -> None:
    encoded = {name: json.dumps(value).encode() for name, value in files.items()}
    draw_map(read_map(encoded, "tiny"), tmp_path / "map.png")
    with Image.open(tmp_path / "map.png") as image:
        assert (image.format, max(image.size)) == ("PNG", 2000)
        colours = image.convert("P").getcolors(256)
        assert colours is not None
        assert len(colours) > 5


@pytest.mark.slow
def test_picture_of_the_town_shows_its_lanes_lights_and_crosswalks(tmp_path: Path) -> None:
    path = tmp_path / "town.png"
    assert run("map", "info", "town", "--picture", str(path), "--json").json["name"] == "town"
    with Image.open(path) as image:
        assert image.size == (2000, 2000)
        shown = {colour for _, colour in image.getcolors(2**20) or []}
    for colour in ("#f4f2ec", "#b9bec4", "#d8c7a3", "#c4161c", "#0a7d32", "#1f5fbf", "#222222", "#5d6670"):
        assert tuple(bytes.fromhex(colour[1:])) in shown, colour


@pytest.mark.parametrize(
    ("words", "line"),
    [
        ((), "map: expected a command: info; see rosbridge-sim map --help"),
        (("info",), "the following arguments are required: DIR|NAME"),
        (("info", "track", "town", "--picture", "x.png"), "--picture: expected a single map to draw, got 2"),
        (("info", "track", "--picture", "x.gif"), "--picture: expected a file such as MAP.png or MAP.jpg; got 'x.gif'"),
        (
            ("info", "nowhere"),
            f"nowhere: {MAP_IS}, or one of {MAP_NAMES}; there is none",
        ),
        (("info", "track", "--picture", "x.doc"), "--picture: expected a file such as MAP.png or MAP.jpg; got 'x.doc'"),
    ],
)
def test_usage_error_is_one_line_and_exit_code_2(words: tuple[str, ...], line: str) -> None:
    done = run("map", *words)
    assert (done.code, done.out) == (2, "")
    assert done.complaint.startswith(line)


@pytest.mark.slow
def test_unwritable_picture_gives_one_error_line() -> None:
    done = run("map", "info", "track", "--picture", "/nowhere/x.png")
    assert (done.code, done.out) == (2, "")
    assert done.complaint.startswith("/nowhere/x.png: cannot be written: No such file")


def test_map_in_another_format_is_refused_by_its_name(tmp_path: Path) -> None:
    (tmp_path / "city.osm").write_text("<osm/>")
    names = f"or one of {MAP_NAMES}"
    for name, line in (
        ("city.osm", f"OpenStreetMap is not read; {MAP_IS}, {names}"),
        ("gone.net.xml", f"SUMO net is not read; {MAP_IS}, {names}"),
        ("", f"OpenStreetMap is not read (city.osm); {MAP_IS}"),
    ):
        done = run("map", "info", str(tmp_path / name))
        assert (done.code, done.complaint) == (2, f"{tmp_path / name}: {line}")


# OpenDRIVE


def test_opendrive_file_is_described_like_any_map(tmp_path: Path) -> None:
    kinds = '<type s="0" type="town"><speed max="50" unit="km/h"/></type>'
    lanes = section([lane(1), lane(0, '<roadMark type="broken"/>'), lane(-1), lane(-2, kind="sidewalk")])
    (tmp_path / "small.xodr").write_bytes(document(road(sections=lanes, more=kinds)))
    (tmp_path / "bad.xodr").write_bytes(document(road(sections=section([lane(0)]))))
    done = run("map", "info", str(tmp_path / "small.xodr"))
    assert (done.code, done.err) == (0, "")
    for line in (
        "  there is no <geoReference>, so /gps has no fix",
        "  lanes that are no road for vehicles are left out: 1 of type sidewalk",
        "  2 lanes that lead nowhere: 1.0.1, 1.0.-1",
        "  read: small.xodr",
        "  speed limit [km/h]: 50 (2, 0.20 km)",
        "borders: 1 (1 type 501)",
    ):
        assert line in done.lines
    assert not any(line.startswith("nodes:") or "links for lane changes" in line for line in done.lines)
    done = run("map", "info", str(tmp_path), "--json")
    named = {Path(one["file"]).name: one for one in map(json.loads, done.out.splitlines()[:2])}
    assert named["bad.xodr"]["mistakes"] == ["bad.xodr: expected at least one lane to drive on, got none"]
    assert not named["small.xodr"]["mistakes"]


def test_many_widths_are_folded_and_a_missing_limit_is_none(tmp_path: Path) -> None:
    lanes = [lane(-i, width=f'<width sOffset="0" a="{3 + i / 100}" b="0" c="0" d="0"/>') for i in range(1, 13)]
    (tmp_path / "wide.xodr").write_bytes(document(road(sections=section([lane(0), *lanes]))))
    lines = run("map", "info", str(tmp_path / "wide.xodr")).lines
    assert "  speed limit [km/h]: none (12, 1.20 km)" in lines
    assert any(line.endswith("3.1 (1, 0.10 km); 2 others (2, 0.20 km)") for line in lines)


# What lies kilometres away


@pytest.mark.slow
def test_picture_fits_to_the_map_and_names_what_lies_kilometres_away(tmp_path: Path) -> None:
    files = json.loads(json.dumps(ROADRUNNER))
    stray = {**files["link_set.json"][0], "idx": "STRAY", "points": [[9e5, 0, 0], [9e5 + 50, 0, 0]]}
    (tmp_path / "torn").mkdir()
    for name, content in {**files, "link_set.json": [*files["link_set.json"], stray]}.items():
        (tmp_path / "torn" / name).write_text(json.dumps(content))
    path = tmp_path / "x.png"
    done = run("map", "info", str(tmp_path / "torn"), "--picture", str(path))
    assert done.code == 0
    assert done.err == f"rosbridge-sim: {path} leaves out what lies far from the rest: lane STRAY\n"
    assert "  1 lanes that lie kilometres away from all others: STRAY" in done.lines
    with Image.open(path) as image:
        lanes = sum(n for n, colour in image.getcolors(2**20) or [] if colour == tuple(bytes.fromhex(LANE[1:])))
        shown = sum(n for n, colour in image.getcolors(2**20) or [] if colour == tuple(bytes.fromhex(STOP[1:])))
    assert lanes > 1000, "the map is no dot"
    assert shown > 100, "it says so"


@pytest.mark.slow
def test_picture_of_a_scenario_fits_to_the_map_or_to_its_bulk(tmp_path: Path) -> None:
    places = [{"pos": {"x": x, "y": 3 * x / 100}} for x in (0, 40, 90, 5e6)]
    roads = narrow_map()
    scenario = read_scenario(json.dumps({"objectList": places}).encode(), "x.json")
    bare = RoadMap("bare", roads.projection, (0.0, 0.0, 0.0), Roads())
    for ground in (roads, bare):
        said = draw_map(ground, tmp_path / "x.png", scenario.obstacles)
        assert said == f"{tmp_path}/x.png leaves out what lies far from the rest: objectList[3]"
        assert draw_map(ground, tmp_path / "x.png", scenario.obstacles[:3]) == ""


# The legend


def narrow_map() -> RoadMap:
    """A map of one long street to the north with everything that a legend names."""
    files = json.loads(json.dumps(ROADRUNNER))
    for name in ("node_set.json", "link_set.json"):
        for entry in files[name]:
            if "point" in entry:
                x, y, z = entry["point"]
                entry["point"] = [y, 40.0 * x, z]
            for point in entry.get("points", ()):
                point[:2] = [point[1], 40.0 * point[0]]
    return read_map({name: json.dumps(value).encode() for name, value in files.items()}, "narrow")


def agents_of_all_kinds() -> tuple[Spawn, ...]:
    """One of each kind, on the street."""
    place = {"pos": {"x": 0, "y": 50}}
    document = {
        "egoVehicle": {"initPosition": place},
        "vehicleList": [{"initPosition": place}],
        "pedestrianList": [place],
        "objectList": [place],
    }
    scenario = read_scenario(json.dumps(document).encode(), "x.json")
    return (*scenario.egos, *scenario.vehicles, *scenario.pedestrians, *scenario.obstacles)


@pytest.mark.slow
def test_legend_of_a_narrow_map_is_complete(tmp_path: Path) -> None:
    path = tmp_path / "narrow.png"
    draw_map(narrow_map(), path, agents_of_all_kinds())
    with Image.open(path) as image:
        width, height = image.size
        assert width == 900, "it is as narrow as a picture can be"
        # Below the map there is nothing but the scale and the legend: the colour of each entry fills a square.
        below = image.crop((0, height - 85, width, height))
        pixels = list(below.get_flattened_data()) if hasattr(below, "get_flattened_data") else list(below.getdata())
    for colour in (LANE, DEAD_END, STOP, STRIPES, CAR_LIGHT, WALK_LIGHT, WARNING_LIGHT):
        assert pixels.count(tuple(bytes.fromhex(colour[1:]))) > 60, colour
    for colour, name in AGENTS.values():
        assert pixels.count(tuple(bytes.fromhex(colour[1:]))) > 60, name


@pytest.mark.parametrize("width", [900, 2000, 200, 1])
def test_legend_entries_stay_on_the_paper_and_do_not_overlap(width: int) -> None:
    legend = [("#000000", what) for what in ("lane", "within an intersection", "dead end", "stop line") * 3]
    places = _lay_legend(legend, width * FINE, 300.0)
    lines = [line for _, line in places]
    assert lines == sorted(lines)
    for (x, line), (next_x, next_line) in pairwise(places):
        assert next_line == line + 1 or (next_line == line and next_x > x)
    size = [40 * FINE + _legend_font().getlength(what) for _, what in legend]
    ends = [x + one for (x, _), one in zip(places, size, strict=True)]
    if width >= 900:
        assert max(ends) <= width * FINE
