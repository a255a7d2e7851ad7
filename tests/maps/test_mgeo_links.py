from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.world.roads.roads import Roads
from tests.simulator.small_maps import KOREAN, ROADRUNNER, Files, read
from tests.world.road_factory import built_in


def edges(roads: Roads, name: str, *s: float) -> list[float]:
    """Left, right, left, right, ... from the line of a lane at some places along it [m]."""
    points, _ = roads.at([roads.row(name)] * len(s), s)
    pairs = np.stack(roads.beside(roads.nearest(points[:, 0], points[:, 1])), axis=-1)
    return [float(value) for value in pairs.round(6).ravel()]


def changed(files: Files, **changes: Any) -> Files:  # noqa: ANN401 - contents of files
    """The files with others in their place; `link` changes keys of the links with an id."""
    links = changes.pop("links", {})
    out = {**files, **changes}
    out["link_set.json"] = [{**entry, **links.get(entry["idx"], {})} for entry in files["link_set.json"]]
    return out


@pytest.mark.parametrize("files", [ROADRUNNER, KOREAN])
def test_links_are_lanes_and_lane_changes_are_not(files: Files) -> None:
    roads = read(files).roads
    assert roads.ids == ("A1B1", "A2B2", "B1C1", "B2C2", "B2D")
    assert [roads.successors(i).tolist() for i in range(5)] == [[2], [3, 4], [], [], []]
    assert roads.is_stop.tolist() == [True, True, False, False, False]
    assert roads.left.tolist() == [1, -1, -1, -1, -1]
    assert roads.right.tolist() == [-1, 0, -1, -1, -1]
    assert roads.speed_limit.tolist() == pytest.approx([50 / 3.6] * 2 + [30 / 3.6] * 3)


@pytest.mark.parametrize("files", [ROADRUNNER, KOREAN])
def test_lane_borders_are_read_under_either_name(files: Files) -> None:
    roads = read(files).roads
    assert edges(roads, "A1B1", 0.0, 50.0) == pytest.approx([1.6, 1.5, 1.6, 2.333], abs=0.01)
    # The edge's line ends 40 m before the lane does: there, and where nothing is drawn, it is half a width away.
    assert edges(roads, "A1B1", 100.0) == [1.6, 1.75]
    assert edges(roads, "A2B2", 50.0) == [1.75, 1.9]
    assert edges(roads, "B2D", 5.0) == [1.75, 1.75]


def test_old_border_name_takes_precedence() -> None:
    files = {**KOREAN, "lane_boundary_set.json": []}
    assert edges(read(files).roads, "A1B1", 0.0)[0] == 1.6
    files = {**ROADRUNNER, "lane_marking_set.json": []}
    assert edges(read(files).roads, "A1B1", 0.0) == [1.75, 1.75]


def test_borders_far_away_or_on_the_wrong_side_are_ignored() -> None:
    far = [{"idx": "middle", "points": [[0, 30, 0], [100, 30, 0]]}, {"idx": "edge", "points": [[0, 1, 0], [100, 1, 0]]}]
    assert edges(read({**ROADRUNNER, "lane_boundary_set.json": far}).roads, "A1B1", 50.0) == [1.75, 1.75]


def test_lane_change_links_define_neighbours_if_lanes_do_not() -> None:
    silent = {"left_lane_change_dst_link_idx": None, "right_lane_change_dst_link_idx": None}
    free = {**silent, "can_move_left_lane": True, "can_move_right_lane": True}
    files = changed(ROADRUNNER, links={"A1B1": free, "A2B2": free})
    assert read(files).roads.left.tolist() == [1, -1, -1, -1, -1]
    assert read(files).roads.right.tolist() == [-1, -1, -1, -1, -1], "only one way has a link"
    files = changed(ROADRUNNER, links={"A1B1": silent | {"can_move_left_lane": False}})
    assert read(files).roads.left.tolist() == [-1, -1, -1, -1, -1], "it may not be used"
    files["link_set.json"][-1]["lane_ch_link_path"] = ["A2B2", "A1B1", "elsewhere"]
    files = changed(files, links={"A2B2": free})
    assert read(files).roads.right.tolist() == [-1, 0, -1, -1, -1]


def test_missing_neighbours_are_ignored() -> None:
    files = changed(ROADRUNNER, links={"A2B2": {"right_lane_change_dst_link_idx": "gone"}})
    assert read(files).roads.right.tolist() == [-1] * 5


def test_missing_keys_of_older_maps_have_defaults() -> None:
    keep = ("idx", "from_node_idx", "to_node_idx", "points", "lazy_init")
    bare = [{key: entry[key] for key in keep} for entry in ROADRUNNER["link_set.json"]]
    nodes = [{"idx": entry["idx"]} for entry in ROADRUNNER["node_set.json"]]
    roads = read(
        {"global_info.json": ROADRUNNER["global_info.json"], "node_set.json": nodes, "link_set.json": bare}
    ).roads
    assert (roads.width.tolist(), roads.speed_limit.tolist()) == ([3.5] * 5, [0.0] * 5)
    assert not roads.is_stop.any()


@pytest.mark.parametrize(
    ("borders", "message"),
    [
        ([{"points": []}], "tiny/lane_boundary_set.json: [0].idx: missing"),
        (
            [{"idx": "x", "points": [[0, 0]]}],
            "tiny/lane_boundary_set.json: [0].points[0]: expected a list of 3, got a list of 2",
        ),
        (
            [{"idx": "x", "points": [[0, 0, 0], [1e9, 0, 0]]}],
            "tiny/lane_boundary_set.json: [0].points[1]: expected coordinates within 10,000,000 m",
        ),
    ],
)
def test_unreadable_borders_are_named(borders: object, message: str) -> None:
    with pytest.raises(DocumentError) as caught:
        read({**ROADRUNNER, "lane_boundary_set.json": borders})
    assert str(caught.value) == message


def test_lane_with_repeated_points_keeps_its_borders() -> None:
    points = [[0, 0, 0], [0, 0, 0], [50, 0, 0], [100, 0, 0]]
    roads = read(changed(ROADRUNNER, links={"A1B1": {"points": points}})).roads
    assert np.allclose(roads.border[:3, 0], 1.6)


@pytest.mark.parametrize(("rise", "bank"), [(0.0, 0.0), (0.08, 0.08 / 1.6), (-0.16, -0.1), (2.0, 0.0)])
def test_height_of_the_borders_is_the_bank_of_the_lanes(rise: float, bank: float) -> None:
    borders = [
        {**entry, "points": [[x, y, z + rise] for x, y, z in entry["points"]]} if i == 0 else entry
        for i, entry in enumerate(ROADRUNNER["lane_boundary_set.json"])
    ]
    roads = read(changed(ROADRUNNER, **{"lane_boundary_set.json": borders})).roads
    lane = roads.row("A1B1")
    assert roads.bank[roads.first[lane]].tolist() == pytest.approx([bank, 0.0], abs=1e-9)
    assert roads.is_flat == (bank == 0.0)


def test_bends_of_the_hills_are_banked_to_the_outside() -> None:
    roads = built_in("hills").roads
    for name, bank in (("F1", -0.04), ("F5", 0.04), ("B1", 0.04), ("B5", -0.04)):
        lane = roads.row(name)
        middle = (roads.first[lane] + roads.first[lane + 1]) // 2
        assert roads.bank[middle].tolist() == pytest.approx([bank, bank], abs=0.003), name


def with_type(kind: object) -> Files:
    return changed(ROADRUNNER, links={"B2C2": {"link_type": kind}})


@pytest.mark.parametrize("kind", ["sidewalk", "Sidewalk", " SIDEWALK ", "shoulder", "Biking", "curb"])
def test_links_that_are_no_roads_are_not_lanes(kind: str) -> None:
    road_map = read(with_type(kind))
    roads = road_map.roads
    assert roads.ids == ("A1B1", "A2B2", "B1C1", "B2D")
    assert [roads.successors(i).tolist() for i in range(4)] == [[2], [3], [], []], "no lane leads onto it"
    word = kind.strip().lower()
    assert road_map.notes == (f"links of type {word} are no road for vehicles and left out: 1 (B2C2)",)
    assert road_map.plan.lights[0].lanes == (2,), "its lights serve the other lane"


@pytest.mark.parametrize(
    "kind", [None, "", "1", "6", 6, 6.0, True, [], {}, "Driving", "DRIVABLE_LANE", "Parking", "none", "elevated"]
)
def test_links_of_other_types_are_lanes(kind: object) -> None:
    road_map = read(with_type(kind))
    assert road_map.roads.ids == ("A1B1", "A2B2", "B1C1", "B2C2", "B2D")
    assert road_map.notes == ()


def test_links_for_lane_changes_are_not_told_as_left_out() -> None:
    assert read(changed(ROADRUNNER, links={"A1B1-A2B2": {"link_type": "sidewalk"}})).notes == ()


def test_neighbour_that_is_no_road_is_none() -> None:
    roads = read(changed(ROADRUNNER, links={"A2B2": {"link_type": "shoulder"}})).roads
    assert (roads.ids[0], roads.left[0]) == ("A1B1", -1)


def test_map_of_pavements_alone_is_refused() -> None:
    every = {entry["idx"]: {"link_type": "sidewalk"} for entry in ROADRUNNER["link_set.json"]}
    with pytest.raises(DocumentError, match="expected at least one link to drive on, got 5 of type sidewalk"):
        read(changed(ROADRUNNER, links=every))


def test_note_about_many_links_is_short() -> None:
    more = [{**ROADRUNNER["link_set.json"][0], "idx": f"W{i}" * 100, "link_type": "sidewalk"} for i in range(900)]
    (note,) = read({**ROADRUNNER, "link_set.json": [*ROADRUNNER["link_set.json"], *more]}).notes
    assert note.startswith("links of type sidewalk are no road for vehicles and left out: 900 (W0W0")
    assert note.endswith(", ...)")
    assert len(note) < 600
