from __future__ import annotations

import math

import numpy as np
import pytest

from rosbridge_sim.errors import DocumentError, FieldError
from rosbridge_sim.morai import stage as stage_module
from rosbridge_sim.morai.catalogue import Model, find_model
from rosbridge_sim.morai.scenarios.scenario import Scenario, Spawn
from rosbridge_sim.morai.stage import WHOLE, LoadOptions, Stage
from rosbridge_sim.world.state import Gear, Kind, World
from tests.morai.stand import Shelf

NOTHING = LoadOptions(delete_all=False, ego=False, vehicles=False, pedestrians=False, obstacles=False)


def a_stage(name: str = "crowd") -> Stage:
    shelf = Shelf()
    return Stage(World(), shelf, shelf.scenario(name), ego_gear=Gear.DRIVE)


def load(stage: Stage, name: str, options: LoadOptions = WHOLE) -> None:
    stage.carry_out(stage.prepare(Shelf().scenario(name), options))


def uids(stage: Stage, kind: Kind) -> list[int]:
    return [int(stage.world.uid[row]) for row in stage.world.rows(kind)]


def population(stage: Stage) -> dict[Kind, list[int]]:
    return {kind: uids(stage, kind) for kind in Kind}


def model(name: str) -> Model:
    found = find_model(name)
    assert found is not None
    return found


def test_the_opening_scene_keeps_the_documents_ids() -> None:
    stage = a_stage()
    assert population(stage) == {Kind.EGO: [0], Kind.VEHICLE: [7, 10], Kind.PEDESTRIAN: [9], Kind.OBSTACLE: [3, 4]}
    world = stage.world
    assert (world.x[world.row(0)], world.y[world.row(0)]) == (10.0, 20.0)
    assert world.yaw[world.row(0)] == pytest.approx(math.pi / 2)
    assert world.speed[world.row(7)] == pytest.approx(10.0)


def test_the_opening_gear_beats_the_documents() -> None:
    stage = a_stage("parked")
    assert stage.world.gear[stage.world.row(0)] == Gear.DRIVE
    load(stage, "parked")
    assert stage.world.gear[stage.world.row(0)] == Gear.PARK


def test_a_scene_without_an_ego_gets_one_at_the_origin() -> None:
    stage = a_stage("empty")
    assert population(stage)[Kind.EGO] == [0]
    assert stage.world.x[stage.world.row(0)] == 0.0


def test_a_second_load_replaces_all_and_repeats_no_id() -> None:
    stage = a_stage()
    seen = {uid for kind in (Kind.VEHICLE, Kind.PEDESTRIAN, Kind.OBSTACLE) for uid in uids(stage, kind)}
    for _ in range(3):
        load(stage, "crowd")
        there = [uid for kind in (Kind.VEHICLE, Kind.PEDESTRIAN, Kind.OBSTACLE) for uid in uids(stage, kind)]
        assert len(there) == 5
        assert not seen & set(there)
        assert uids(stage, Kind.EGO) == [0]
        seen |= set(there)


def test_loads_leave_the_frame_count_and_the_same_memory() -> None:
    stage = a_stage()
    stage.world.frame = 123
    for _ in range(50):
        load(stage, "crowd")
    assert stage.world.frame == 123
    assert stage.world.n == 6


def test_without_delete_all_a_load_adds() -> None:
    stage = a_stage()
    load(stage, "crowd", LoadOptions(delete_all=False, ego=False, vehicles=True, pedestrians=False, obstacles=False))
    assert len(uids(stage, Kind.VEHICLE)) == 4
    assert len(uids(stage, Kind.OBSTACLE)) == 2


def test_delete_all_spares_the_ego_unless_a_new_one_comes() -> None:
    stage = a_stage()
    world = stage.world
    world.x[world.row(0)] = 77.0
    load(stage, "crowd", LoadOptions(delete_all=True, ego=False, vehicles=False, pedestrians=True, obstacles=False))
    assert {kind: len(ids) for kind, ids in population(stage).items()} == {
        Kind.EGO: 1,
        Kind.VEHICLE: 0,
        Kind.PEDESTRIAN: 1,
        Kind.OBSTACLE: 0,
    }
    assert world.x[world.row(0)] == 77.0


def test_a_new_ego_alone_replaces_the_old_one() -> None:
    stage = a_stage()
    load(stage, "parked", LoadOptions(delete_all=False, ego=True, vehicles=True, pedestrians=True, obstacles=True))
    assert uids(stage, Kind.EGO) == [0]
    assert stage.world.x[stage.world.row(0)] == -5.0
    assert len(uids(stage, Kind.VEHICLE)) == 2


def test_a_load_of_nothing_changes_nothing() -> None:
    stage = a_stage()
    before = stage.world.digest()
    load(stage, "parked", NOTHING)
    assert stage.world.digest() == before


def test_a_load_without_an_ego_in_it_keeps_the_one_there_is() -> None:
    stage = a_stage()
    load(stage, "empty")
    assert population(stage) == {Kind.EGO: [0], Kind.VEHICLE: [], Kind.PEDESTRIAN: [], Kind.OBSTACLE: []}


def test_a_scenario_brings_its_map_and_is_placed_on_it() -> None:
    stage = a_stage()
    load(stage, "elsewhere")
    assert stage.road_map.name == "hills"
    world = stage.world
    assert (world.x[world.row(0)], world.y[world.row(0)]) == (0.0, pytest.approx(50.0))
    assert world.yaw[world.row(0)] == pytest.approx(math.pi / 2)
    load(stage, "parked")  # names no map
    assert stage.road_map.name == "hills"


def test_a_map_is_read_once_for_all_loads_that_name_it() -> None:
    shelf = Shelf()
    stage = Stage(World(), shelf, shelf.scenario("crowd"), ego_gear=Gear.DRIVE)
    for _ in range(3):
        load(stage, "crowd")
    assert shelf.num_maps_read == 1


def test_no_other_map_serves_for_one_that_is_not_there() -> None:
    stage = a_stage("elsewhere")
    before = stage.world.digest()
    with pytest.raises(DocumentError, match="no map 'R_KR_PG_K-City'"):
        load(stage, "nowhere")
    assert (stage.road_map.name, stage.world.digest()) == ("hills", before)
    with pytest.raises(DocumentError, match="no map 'R_KR_PG_K-City'"):
        a_stage("nowhere")


def test_what_cannot_be_placed_is_found_before_anything_changes() -> None:
    stage = a_stage()
    before = stage.world.digest()
    with pytest.raises(DocumentError, match="no such link"):
        load(stage, "lost")
    assert stage.world.digest() == before


def spawn(name: str, uid: int | None, x: float) -> Spawn:
    found = model(name)
    return Spawn(found.kind, found, found.name, uid, x, 0.0, 0.0, 0.0)


def test_a_load_that_the_world_refuses_half_way_leaves_it_as_it_was() -> None:
    stage = a_stage()
    before, road_map = stage.world.digest(), stage.road_map
    bad = Scenario("bad", obstacles=(spawn("Box", None, 1.0), spawn("Box", None, 1e12)))
    with pytest.raises(DocumentError, match="bad: x: expected"):
        stage.carry_out(stage.prepare(bad, WHOLE))
    assert stage.world.digest() == before
    assert stage.road_map is road_map


def test_the_world_has_room_for_so_many(monkeypatch: pytest.MonkeyPatch) -> None:
    stage = a_stage()
    monkeypatch.setattr(stage_module, "MAX_ENTITIES", 8)
    vehicles = LoadOptions(delete_all=False, ego=False, vehicles=True, pedestrians=False, obstacles=False)
    with pytest.raises(DocumentError, match="crowd: the world holds 8 at most"):
        load(stage, "crowd", vehicles)
    stage.add(model("Box"), x=0.0, y=0.0, z=0.0, yaw=0.0)
    stage.add(model("Box"), x=0.0, y=0.0, z=0.0, yaw=0.0)
    with pytest.raises(FieldError, match="the world holds 8 at most"):
        stage.add(model("Box"), x=0.0, y=0.0, z=0.0, yaw=0.0)


def test_one_huge_id_in_a_document_does_not_use_up_all() -> None:
    stage = a_stage()
    many = Scenario("many", obstacles=(spawn("Box", 2**31 - 1, 0.0), spawn("Box", 500, 0.0), spawn("Box", None, 0.0)))
    stage.carry_out(stage.prepare(many, WHOLE))
    assert uids(stage, Kind.OBSTACLE) == [501, 500, 502]


def test_single_objects_come_and_go() -> None:
    stage = a_stage()
    uid = stage.add(model("Truck"), x=1.0, y=2.0, z=3.0, yaw=0.5)
    row = stage.world.row(uid)
    assert (stage.world.kind[row], stage.world.z[row], stage.world.speed[row]) == (Kind.VEHICLE, 3.0, 0.0)
    stage.remove(uid)
    assert stage.add(model("Truck"), x=1.0, y=2.0, z=3.0, yaw=0.5) > uid
    with pytest.raises(FieldError, match="there is no such object"):
        stage.remove(uid)
    with pytest.raises(FieldError, match="the ego cannot be removed"):
        stage.remove(0)
    with pytest.raises(FieldError, match="x: expected"):
        stage.add(model("Truck"), x=np.nan, y=2.0, z=3.0, yaw=0.5)


def test_vehicles_have_figures_by_their_ids() -> None:
    stage = a_stage()
    ego = stage.world.bodies[stage.world.row(0)]
    assert stage.vehicle(0) is stage.vehicle(-1) is ego
    assert stage.vehicle(7) is not None
    assert stage.vehicle(9) is None  # walks
    assert stage.vehicle(12345) is None
