"""The programs that compare traffic with SUMO's and that watch it for hours, without SUMO and in short."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pytest

from rosbridge_sim.shell.files.library import DiskLibrary
from rosbridge_sim.world.roads.signals import Signals
from rosbridge_sim.world.state.placement import set_speed
from rosbridge_sim.world.state.world import DT, Body, Kind, World
from rosbridge_sim.world.step import step
from scripts import draw_trajectories, trajectory_cases
from scripts.bench import traffic as compare
from scripts.bench import traffic_cases
from scripts.bench.sumo_network import Network, convert
from scripts.soak import traffic, traffic_cells
from tests.world.road_factory import keep_lane


@pytest.fixture(scope="module")
def town() -> Network:
    road_map = DiskLibrary().map("town")
    return convert(road_map.roads, road_map.plan)


def test_each_lane_outside_crossings_is_a_lane_of_one_edge(town: Network) -> None:
    lanes = [lane for edge in town.edges for lane in edge.lanes]
    assert len(lanes) == len(set(lanes)) == 96
    assert sum(len(edge.lanes) == 2 for edge in town.edges) == 16, "the avenues"
    assert all(town.roads.right[edge.lanes[-1]] == edge.lanes[0] for edge in town.edges if len(edge.lanes) == 2)
    inside = {lane for way in town.connections for lane in way.inside}
    assert inside == set(range(len(town.roads))) - set(lanes)


def test_converted_files_name_only_what_they_have(town: Network) -> None:
    files = {name: ET.fromstring(text) for name, text in town.files().items()}  # noqa: S314 - our own text
    nodes = {node.get("id") for node in files["nod.xml"]}
    edges = {edge.get("id"): int(edge.get("numLanes", "0")) for edge in files["edg.xml"]}
    assert all({edge.get("from"), edge.get("to")} <= nodes for edge in files["edg.xml"])
    for way in files["con.xml"]:
        assert int(way.get("fromLane", "-1")) < edges[way.get("from")]
        assert int(way.get("toLane", "-1")) < edges[way.get("to")]
    lights = {node.get("tl") for node in files["nod.xml"]} - {None}
    assert lights == {logic.get("id") for logic in files["tll.xml"].iter("tlLogic")}


def test_converted_lights_show_what_ours_show(town: Network) -> None:
    signals, lit = Signals(town.plan), {}
    for controller in {number for number in town.node_controllers if number >= 0}:
        phases = town.phases(controller)
        lit[controller] = [letters for seconds, letters in phases for _ in range(round(seconds / DT))]
        assert len(lit[controller]) == town.plan.cycle[controller]
    for frame in range(0, int(town.plan.cycle.max()), 40):
        signals.show(frame)
        for controller, letters in lit.items():
            ways = town._ways_of(controller)
            now = letters[frame % len(letters)]
            assert [letter in "gG" for letter in now] == [
                bool(signals.may_enter[list(way.inside)].all()) for way in ways
            ]


def test_place_on_an_edge_counts_lanes_from_the_right(town: Network) -> None:
    roads = town.roads
    left = roads.row("R2021L1")
    name, index, s = town.place(left, 20.0)
    assert (index, town.place(int(roads.right[left]), 20.0)[:2]) == (1, (name, 0))
    assert s == pytest.approx(20.0)


def test_planned_routes_are_those_that_are_driven(town: Network) -> None:
    demand = traffic_cases.spread(town, 8, seed=3)
    world = traffic_cases.ours(town.roads, town.plan, demand)
    planned = traffic_cases.plan_routes(world, demand, 300.0)
    rows = world.rows(Kind.VEHICLE)
    ahead = world.int_block("lane", "ahead_5")[:, rows].T.tolist()
    assert [list(start.route[: len(lanes)]) for start, lanes in zip(planned, ahead, strict=True)] == ahead
    lengths = [town.roads.length[list(start.route)].sum() for start in planned]
    assert min(lengths) > 300.0


@pytest.mark.slow
def test_queue_passes_the_line_one_after_the_other_once_the_light_is_green() -> None:
    times = traffic_cases.discharge(3)
    assert times[0] > 0.0
    assert (np.diff(times) > 1.0).all()


def test_flow_counts_distance_and_edges(town: Network) -> None:
    world = traffic_cases.ours(town.roads, town.plan, traffic_cases.spread(town, 4))
    flow = traffic_cases.measure_flow(world, town, settle=0.0, seconds=0.4)
    assert flow.speed == pytest.approx(traffic_cases.START_SPEED, abs=0.5)
    assert flow.edges_per_hour == 0.0


def _watched(*places: tuple[int, float, float]) -> tuple[World, traffic.Watch, traffic.Outcome]:
    """Return a world with cars on the lanes of a queue (lane, arc, speed), and its observer."""
    world = World()
    world.lay_roads(*traffic_cases.queue_roads())
    for lane, s, speed in places:
        uid = world.spawn(Kind.VEHICLE, Body(), name="npc", x=0.0, y=0.0, speed=speed)
        keep_lane(world, world.row(uid), lane, s)
    outcome = traffic.Outcome(traffic_cells.Cell("queue", len(places), 0))
    return world, traffic.Watch(world, outcome), outcome


def test_watch_counts_a_red_light_and_an_overlap_once() -> None:
    world, watch, outcome = _watched((0, 296.3, 10.0), (2, 50.0, 0.0), (2, 52.0, 0.0))
    for _ in range(20):
        step(world)
        set_speed(world, 0, 10.0)  # this driver heeds no light
        watch.look()
    assert (outcome.red_lights, outcome.overlaps) == (1, 1)
    assert any("passes a red light; lane before" in line for line in outcome.lines)
    assert any("touch; lane behind" in line for line in outcome.lines)


def test_watch_counts_braking_with_its_cause() -> None:
    world, watch, outcome = _watched((2, 20.0, 20.0))
    world.spawn(Kind.OBSTACLE, Body(), name="wall", x=traffic_cases.QUEUE_LINE + 78.0, y=0.0)
    for _ in range(50):
        step(world)
        watch.look()
    assert (outcome.hard, outcome.explained, outcome.num_faults) == (1, 1, 0)
    assert "lead uid 2 (obstacle" in outcome.lines[0]


def test_watch_counts_a_vehicle_that_stands_for_three_minutes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(traffic, "STRANDED", 0.1)
    world, watch, outcome = _watched((0, 295.8, 0.0))
    for _ in range(20):
        step(world)
        watch.look()
    assert (outcome.stranded, outcome.num_faults) == (1, 1)
    assert "stops for light" in outcome.lines[0]


def test_watch_counts_people_who_are_hit_who_bump_and_who_wait_too_long(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(traffic, "STRANDED", 0.3)
    world = World()
    world.lay_roads(*traffic_cases.queue_roads())
    man = Body.box(0.45, 0.55, 1.7)
    uid = world.spawn(Kind.VEHICLE, Body(), name="npc", x=0.0, y=0.0, speed=8.0)
    keep_lane(world, world.row(uid), 2, 20.0)
    x, y = float(world.x[0]), float(world.y[0])
    world.spawn(Kind.PEDESTRIAN, man, name="man", x=x + 4.0, y=y)
    for i in range(2):
        to_west = np.array([[x, y + 50.0 + 0.1 * i], [x + 9.0 * (-1) ** i, y + 50.0]])
        world.spawn(Kind.PEDESTRIAN, man, name="man", x=x - 1.5 * (-1) ** i, y=y + 50.0, path=to_west, speed=2.0)
    outcome = traffic.Outcome(traffic_cells.Cell("queue", 1, 0, 3))
    watch = traffic.Watch(world, outcome)
    for _ in range(40):
        step(world)
        watch.look()
    assert (outcome.hits, outcome.bumps, outcome.waiting, outcome.overlaps) == (1, 1, 1, 0)
    assert any("pedestrian 2 at" in line for line in outcome.lines)
    assert outcome.num_faults >= 3


def test_cells_with_people_and_parked_cars_begin_with_them() -> None:
    world = traffic_cells.world_of(traffic_cells.Cell("parking", 4, 0))
    drives = world.alive & world.has_lane
    assert int(drives.sum()) == 4
    assert int((world.alive & (world.kind == Kind.VEHICLE) & ~drives).sum()) > 20
    step(world)
    assert not len(world.contacts)
    world = traffic_cells.world_of(traffic_cells.Cell("town", 4, 0, people=7))
    assert [int((world.alive & (world.kind == kind)).sum()) for kind in (Kind.EGO, Kind.VEHICLE, Kind.PEDESTRIAN)] == [
        *(0, 4, 7)
    ]


def test_soak_goes_on_where_it_was_interrupted(tmp_path: Path) -> None:
    cells = traffic_cells.cells_of(1.0, ["town", "hills"], 5)
    assert cells[0] == traffic_cells.Cell("town", 3, 5)
    assert [cell.seed for cell in cells] == [5] * len(cells)
    progress = tmp_path / "progress"
    outcome = traffic.Outcome(cells[1], num=24, minutes=10.0, lines=["a line"])
    progress.write_text(json.dumps(asdict(outcome)) + '\n{"cell": {"map')
    assert traffic._read(progress) == [outcome]
    assert "| town | 24 | 0 | 10 min |" in traffic.as_table([outcome])


def test_table_replaces_the_one_that_is_there(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text("Text.\n\n<!-- town -->\n\n<!-- loop -->\n\nEnd.\n")
    for value in ("1", "2"):
        for part in ("town", "loop"):
            table = compare.as_markdown([["a", "b"], [part, value]])
            compare.put_into(page, part, table)
    tables = [f"<!-- {part} -->\n\n| a | b |\n|---|---|\n| {part} | 2 |" for part in ("town", "loop")]
    assert page.read_text() == f"Text.\n\n{tables[0]}\n\n{tables[1]}\n\nEnd.\n"


@pytest.mark.slow
@pytest.mark.parametrize("name", ["town", "motorway"])
def test_short_soak_of_traffic_has_no_fault(name: str) -> None:
    outcome = traffic.run_cell(traffic_cells.Cell(name, 40, 1), minutes=0.3)
    assert outcome.num == 40
    assert outcome.speed > 5.0
    assert (outcome.overlaps, outcome.red_lights, outcome.stranded) == (0, 0, 0)


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(trajectory_cases.CASES))
def test_picture_of_trajectories_has_what_its_name_says(name: str) -> None:
    case = trajectory_cases.CASES[name]
    world = case.make()
    traces = draw_trajectories.record(world, case.begin, case.seconds, 1.0)
    image = draw_trajectories.draw(world, traces, case.box)
    assert image.width == draw_trajectories.WIDTH
    west, south, east, north = case.box
    inside = [
        trace
        for trace in traces
        if ((trace.rows[:, 1:3] > (west, south)) & (trace.rows[:, 1:3] < (east, north))).all(axis=1).any()
    ]
    kinds = {trace.kind for trace in inside}
    assert (Kind.PEDESTRIAN in kinds) == (name == "crossing_people")
    assert (Kind.EGO in kinds) == (name == "standing_ego")
    assert sum(not trace.is_still for trace in inside) >= (1 if name == "turning_bus" else 2)
    assert min(float(trace.rows[:, 5].min()) for trace in inside) > -6.0
