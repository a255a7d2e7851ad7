from __future__ import annotations

import json
import math
import runpy
from typing import Any

import numpy as np
import pytest

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.maps.mgeo import FILES, INFO_FILE, NO_PROJECTION, read_mgeo, read_projection
from rosbridge_sim.maps.road_map import RoadMap
from tests.support import ROOT

TRACK = {name: (ROOT / "rosbridge_sim" / "data" / "maps" / "track" / name).read_bytes() for name in (INFO_FILE, *FILES)}

INFO: dict[str, Any] = {
    "maj_ver": 2,
    "min_ver": 9,
    "global_coordinate_system": "+proj=utm +zone=52 +ellps=WGS84",
    "local_origin_in_global": [300000, 4000000, 12.5],
}
NODES: list[dict[str, Any]] = [{"idx": name, "point": [0, 0, 0], "on_stop_line": False} for name in "ABC"]


def link(
    idx: str, start: str | None, end: str | None, *points: tuple[float, float, float], **more: object
) -> dict[str, Any]:
    return {"idx": idx, "from_node_idx": start, "to_node_idx": end, "points": points, "lazy_init": False, **more}


LINKS: list[dict[str, Any]] = [
    link("AB", "A", "B", (0, 0, 0), (50, 0, 1), (100, 0, 2), max_speed=36, width_start=3.0, force_width_start=True),
    link("AB-AC", None, None, (0, 0, 0), (0, 9, 0), lazy_init=True, max_speed=0),
    link("BC", "B", "C", (100, 0, 2), (120, 0, 2), max_speed=0, width_start=9.0, link_type=None, related_signal="left"),
    link("BC2", "B", "C", (100, 0, 2), (120, 5, 2)),
]


def read(info: object = None, nodes: object = None, links: object = None) -> RoadMap:
    given = (INFO if info is None else info, NODES if nodes is None else nodes, LINKS if links is None else links)
    names = (INFO_FILE, *FILES)
    return read_mgeo({name: json.dumps(value).encode() for name, value in zip(names, given, strict=True)}, "maps/tiny/")


def refusal(**files: object) -> str:
    with pytest.raises(DocumentError) as caught:
        read(**files)
    text = str(caught.value)
    assert len(text.splitlines()) == 1
    assert len(text) < 400
    return text


def test_minimal_map_is_read() -> None:
    tiny = read()
    assert tiny.name == "tiny"
    assert tiny.origin == (300000.0, 4000000.0, 12.5)
    assert (tiny.projection.is_tm, tiny.projection.zone, tiny.projection.ellipse) == (False, 52, "WGS84")
    roads = tiny.roads
    assert roads.ids == ("AB", "BC", "BC2")
    assert roads.length.tolist() == pytest.approx([100.0, 20.0, math.hypot(20, 5)])
    assert roads.speed_limit.tolist() == [10.0, 0.0, 0.0]
    assert roads.width.tolist() == [3.0, 3.5, 3.5]
    assert [roads.successors(lane).tolist() for lane in range(3)] == [[1, 2], [], []]
    assert roads.at(0, 25.0)[0].tolist() == [[25.0, 0.0, 0.5]]


def test_a_map_without_links_is_refused() -> None:
    with pytest.raises(DocumentError, match=r"link_set\.json: expected at least one link to drive on, got none"):
        read(links=[])


def test_other_files_are_ignored() -> None:
    files = {"road_polygon_set.json": b"\xff", **TRACK}
    assert read_mgeo(files, "x").name == "x"


@pytest.mark.parametrize(
    ("text", "zone", "is_south", "ellipse"),
    [
        ("UTM52N", 52, False, "WGS84"),
        (" utm 7s ", 7, True, "WGS84"),
        ("UTM60", 60, False, "WGS84"),
        ("+proj=utm +zone=52 +ellps=WGS84", 52, False, "WGS84"),
        ("+proj=utm +zone=33 +south +datum=WGS84 +units=m +no_defs", 33, True, "WGS84"),
        ("+proj=utm +zone=52 +ellps=GRS80 +towgs84=0,0,0,0,0,0,0 +units=m", 52, False, "GRS80"),
        ("+proj=UTM +zone=5", 5, False, "WGS84"),
    ],
)
def test_utm_projections_are_recognised(text: str, zone: int, is_south: bool, ellipse: str) -> None:  # noqa: FBT001  # a column
    projection = read_projection(text, "x")
    assert (projection.is_tm, projection.zone, projection.is_south, projection.ellipse) == (
        False,
        zone,
        is_south,
        ellipse,
    )
    assert projection.text == text
    meridians = {52: 129.0, 7: -141.0, 60: 177.0, 33: 15.0, 5: -153.0}
    assert (projection.central_latitude, projection.central_meridian) == (0.0, meridians[zone])
    assert (projection.scale_factor, projection.false_easting) == (0.9996, 500_000.0)
    assert projection.false_northing == (10_000_000.0 if is_south else 0.0)


def test_transverse_mercator_is_recognised() -> None:
    text = "+proj=tmerc +lat_0=38 +lon_0=127.5 +k=0.9996 +x_0=1e6 +y_0=-2000000 +ellps=GRS80 +geoidgrids=egm96.gtx"
    projection = read_projection(text, "x")
    assert (projection.is_tm, projection.zone, projection.ellipse) == (True, 0, "GRS80")
    assert (projection.central_latitude, projection.central_meridian, projection.scale_factor) == (38.0, 127.5, 0.9996)
    assert (projection.false_easting, projection.false_northing) == (1e6, -2e6)
    plain = read_projection("+proj=tmerc +lat_0=0 +lon_0=0 +k_0=1 +x_0=0 +y_0=0 +datum=WGS84 +vunits=m", "x")
    assert (plain.scale_factor, plain.ellipse) == (1.0, "WGS84")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "expected proj4 text with +proj=utm or +proj=tmerc, or UTM52N, got ''"),
        (
            "+proj=lcc +lat_1=1",
            "expected proj4 text with +proj=utm or +proj=tmerc, or UTM52N, got '+proj=lcc +lat_1=1'",
        ),
        ("UTM61N", "expected a UTM zone 1..60, got '61'"),
        ("+proj=utm +zone=", "expected a UTM zone 1..60, got ''"),
        ("+proj=utm", "expected a UTM zone 1..60, got ''"),
        ("+proj=tmerc +lon_0=12e", "expected a number for +lon_0, got '12e'"),
        ("+proj=tmerc +lon_0=nan", "expected a number for +lon_0, got 'nan'"),
        ("+proj=tmerc +k=" + "9" * 400, "expected a number for +k, got '" + "9" * 40 + "'"),
    ],
)
def test_unknown_projections_are_noted(text: str, message: str) -> None:
    with pytest.raises(DocumentError) as caught:
        read_projection(text, "tiny/global_info.json")
    assert str(caught.value) == f"tiny/global_info.json: global_coordinate_system: {message}"


@pytest.mark.parametrize("name", FILES)
def test_a_missing_file_is_named(name: str) -> None:
    files = {key: text for key, text in TRACK.items() if key != name}
    with pytest.raises(DocumentError, match=f"^maps/x: {name} is missing$"):
        read_mgeo(files, "maps/x")


def test_map_without_georeference_has_the_same_roads() -> None:
    bare = read_mgeo({key: text for key, text in TRACK.items() if key != INFO_FILE}, "maps/x")
    assert bare.roads.digest == read_mgeo(TRACK, "maps/x").roads.digest
    assert (bare.projection, bare.origin) == (NO_PROJECTION, (0.0, 0.0, 0.0))
    assert bare.notes == ("global_info.json is missing: no georeference, so /gps has no fix",)
    assert not bare.projection.is_known
    assert read_projection("UTM52N", "x").is_known
    assert read_projection("+proj=tmerc", "x").is_known


def with_points(*points: object) -> list[object]:
    return [{**LINKS[0], "points": points}]


@pytest.mark.parametrize(
    ("files", "message"),
    [
        ({"info": []}, "tiny/global_info.json: expected an object, got a list of 0"),
        ({"info": {}}, "tiny/global_info.json: global_coordinate_system: missing"),
        (
            {"info": {**INFO, "local_origin_in_global": [1, "x", 3]}},
            "tiny/global_info.json: local_origin_in_global[1]: expected a number, got 'x'",
        ),
        ({"nodes": {}}, "tiny/node_set.json: expected a list, got an object"),
        ({"nodes": [{}]}, "tiny/node_set.json: [0].idx: missing"),
        ({"nodes": NODES[:2]}, "tiny/link_set.json: [2].to_node_idx: node_set.json has no node 'C'"),
        ({"links": [LINKS[0], LINKS[0]]}, "tiny/link_set.json: [1].idx: expected each id once, got 'AB' twice"),
        (
            {"links": with_points([0, 0, 0], [0, "y", 0])},
            "tiny/link_set.json: [0].points[1][1]: expected a number, got 'y'",
        ),
        ({"links": with_points([0, 0, 0], [1, 0])}, "tiny/link_set.json: [0].points[1]: expected a list of 3"),
        (
            {"links": with_points([0, 0, 0], [1e8, 0, 0])},
            "tiny/link_set.json: [0].points[1]: expected coordinates within",
        ),
        (
            {"links": with_points([0, 0, 0], [math.nan, 0, 0])},
            "tiny/link_set.json: [0].points[1][0]: expected a finite number, got nan",
        ),
        (
            {"links": with_points([1, 2, 0], [1, 2, 9])},
            "tiny/link_set.json: [0].points: expected two different points at",
        ),
        ({"links": with_points()}, "tiny/link_set.json: [0].points: expected two different points at least, got 0"),
        (
            {"links": [{**LINKS[0], "max_speed": "fast"}]},
            "tiny/link_set.json: [0].max_speed: expected a number, got 'fast'",
        ),
    ],
)
def test_errors_name_file_and_path(files: dict[str, object], message: str) -> None:
    assert refusal(**files).startswith(message)


def test_ids_may_be_numbers() -> None:
    tiny = read(nodes=[{"idx": 1}, {"idx": 2}], links=[{**LINKS[0], "idx": 5, "from_node_idx": 1, "to_node_idx": 2}])
    assert tiny.roads.ids == ("5",)


# -- what ships


def test_track_files_equal_the_output_of_their_script() -> None:
    folder = ROOT / "rosbridge_sim" / "data" / "maps" / "track"
    drawn = runpy.run_path(str(ROOT / "scripts" / "draw_maps.py"))["track_files"]()
    assert drawn == {path.name: path.read_bytes() for path in folder.iterdir()}


def test_both_lanes_of_the_track_are_closed_and_smooth() -> None:
    track = read_mgeo(TRACK, "track")
    roads = track.roads
    assert track.name == "track"
    assert track.origin == (330000.0, 4120000.0, 0.0)
    laps = []
    for name in ("L1_00", "L2_00"):
        lane, lap, turned = roads.row(name), 0.0, 0.0
        for _ in range(len(roads) // 2):
            lap += roads.length[lane]
            (after,) = roads.successors(lane).tolist()
            ends, yaws = roads.at([lane, after], [roads.length[lane], 0.0])
            assert np.hypot(*(ends[0] - ends[1])[:2]) < 0.002
            turned += float(np.abs(math.remainder(yaws[1] - yaws[0], math.tau)))
            lane = after
        assert lane == roads.row(name)
        assert turned < math.radians(20)  # over all joints: chords of the bends, no kinks
        laps.append(lap)
    inner, outer = laps
    assert outer - inner == pytest.approx(math.tau * 3.5, abs=0.1)
    assert 1000.0 < inner < outer < 2000.0
    gaps = np.hypot(*np.diff(roads.points[:, :2], axis=0).T)
    assert np.sort(gaps)[: -len(roads)].max() <= 1.003  # but for the leaps from one lane's end to the next lane's start
