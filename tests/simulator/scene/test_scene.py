from __future__ import annotations

import math

import numpy as np
import pytest

from rosbridge_sim.errors import DocumentError, FieldError
from rosbridge_sim.scenarios.catalogue import Model, find_model
from rosbridge_sim.scenarios.scenario import Scenario, Spawn
from rosbridge_sim.simulator.scene import scene as stage_module
from rosbridge_sim.simulator.scene.load import WHOLE, LoadOptions
from rosbridge_sim.simulator.scene.scene import Scene
from rosbridge_sim.world.state.world import Gear, Kind, World
from tests.simulator.sim_harness import MemoryLibrary

NOTHING = LoadOptions(delete_all=False, ego=False, vehicles=False, pedestrians=False, obstacles=False)


def make_scene(name: str = "crowd") -> Scene:
    shelf = MemoryLibrary()
    return Scene(World(), shelf, shelf.scenario(name), ego_gear=Gear.DRIVE)


def load(scene: Scene, name: str, options: LoadOptions = WHOLE) -> None:
    scene.carry_out(scene.prepare(MemoryLibrary().scenario(name), options))


def uids(scene: Scene, kind: Kind) -> list[int]:
    return [int(scene.world.uid[row]) for row in scene.world.rows(kind)]


def population(scene: Scene) -> dict[Kind, list[int]]:
    return {kind: uids(scene, kind) for kind in Kind}


def model(name: str) -> Model:
    found = find_model(name)
    assert found is not None
    return found


def test_opening_scene_keeps_the_ids_of_its_document() -> None:
    scene = make_scene()
    assert population(scene) == {Kind.EGO: [0], Kind.VEHICLE: [7, 10], Kind.PEDESTRIAN: [9], Kind.OBSTACLE: [3, 4]}
    world = scene.world
    assert (world.x[world.row(0)], world.y[world.row(0)]) == (10.0, 20.0)
    assert world.yaw[world.row(0)] == pytest.approx(math.pi / 2)
    assert world.speed[world.row(7)] == pytest.approx(10.0)


def test_opening_gear_takes_precedence_over_the_documents() -> None:
    scene = make_scene("parked")
    assert scene.world.gear[scene.world.row(0)] == Gear.DRIVE
    load(scene, "parked")
    assert scene.world.gear[scene.world.row(0)] == Gear.PARK


def test_a_scene_without_an_ego_gets_one_at_the_origin() -> None:
    scene = make_scene("empty")
    assert population(scene)[Kind.EGO] == [0]
    assert scene.world.x[scene.world.row(0)] == 0.0


def test_second_load_replaces_everything_and_repeats_no_id() -> None:
    scene = make_scene()
    seen = {uid for kind in (Kind.VEHICLE, Kind.PEDESTRIAN, Kind.OBSTACLE) for uid in uids(scene, kind)}
    for _ in range(3):
        load(scene, "crowd")
        there = [uid for kind in (Kind.VEHICLE, Kind.PEDESTRIAN, Kind.OBSTACLE) for uid in uids(scene, kind)]
        assert len(there) == 5
        assert not seen & set(there)
        assert uids(scene, Kind.EGO) == [0]
        seen |= set(there)


def test_loads_keep_the_frame_count_and_free_their_memory() -> None:
    scene = make_scene()
    scene.world.frame = 123
    for _ in range(50):
        load(scene, "crowd")
    assert scene.world.frame == 123
    assert scene.world.n == 6


def test_load_without_delete_all_adds_entities() -> None:
    scene = make_scene()
    load(scene, "crowd", LoadOptions(delete_all=False, ego=False, vehicles=True, pedestrians=False, obstacles=False))
    assert len(uids(scene, Kind.VEHICLE)) == 4
    assert len(uids(scene, Kind.OBSTACLE)) == 2


def test_delete_all_keeps_the_ego_unless_a_new_one_comes() -> None:
    scene = make_scene()
    world = scene.world
    world.x[world.row(0)] = 77.0
    load(scene, "crowd", LoadOptions(delete_all=True, ego=False, vehicles=False, pedestrians=True, obstacles=False))
    assert {kind: len(ids) for kind, ids in population(scene).items()} == {
        Kind.EGO: 1,
        Kind.VEHICLE: 0,
        Kind.PEDESTRIAN: 1,
        Kind.OBSTACLE: 0,
    }
    assert world.x[world.row(0)] == 77.0


def test_a_new_ego_alone_replaces_the_old_one() -> None:
    scene = make_scene()
    load(scene, "parked", LoadOptions(delete_all=False, ego=True, vehicles=True, pedestrians=True, obstacles=True))
    assert uids(scene, Kind.EGO) == [0]
    assert scene.world.x[scene.world.row(0)] == -5.0
    assert len(uids(scene, Kind.VEHICLE)) == 2


def test_a_load_of_nothing_changes_nothing() -> None:
    scene = make_scene()
    before = scene.world.digest()
    load(scene, "parked", NOTHING)
    assert scene.world.digest() == before


def test_load_without_an_ego_keeps_the_present_one() -> None:
    scene = make_scene()
    load(scene, "empty")
    assert population(scene) == {Kind.EGO: [0], Kind.VEHICLE: [], Kind.PEDESTRIAN: [], Kind.OBSTACLE: []}


def test_a_scenario_brings_its_map_and_is_placed_on_it() -> None:
    scene = make_scene()
    load(scene, "elsewhere")
    assert scene.road_map.name == "hills"
    world = scene.world
    assert (world.x[world.row(0)], world.y[world.row(0)]) == (0.0, pytest.approx(50.0))
    assert world.yaw[world.row(0)] == pytest.approx(math.pi / 2)
    load(scene, "parked")  # names no map
    assert scene.road_map.name == "hills"


def test_a_map_is_read_once_for_all_loads_that_name_it() -> None:
    shelf = MemoryLibrary()
    scene = Scene(World(), shelf, shelf.scenario("crowd"), ego_gear=Gear.DRIVE)
    for _ in range(3):
        load(scene, "crowd")
    assert shelf.num_maps_read == 1


def test_missing_map_is_not_replaced_by_another() -> None:
    scene = make_scene("elsewhere")
    before = scene.world.digest()
    with pytest.raises(DocumentError, match="no map 'R_KR_PG_K-City'"):
        load(scene, "nowhere")
    assert (scene.road_map.name, scene.world.digest()) == ("hills", before)
    with pytest.raises(DocumentError, match="no map 'R_KR_PG_K-City'"):
        make_scene("nowhere")


def test_unplaceable_entity_is_found_before_anything_changes() -> None:
    scene = make_scene()
    before = scene.world.digest()
    with pytest.raises(DocumentError, match="no such link"):
        load(scene, "lost")
    assert scene.world.digest() == before


def spawn(name: str, uid: int | None, x: float) -> Spawn:
    found = model(name)
    return Spawn(found.kind, found, found.name, uid, x, 0.0, 0.0, 0.0)


def test_load_refused_half_way_changes_nothing() -> None:
    scene = make_scene()
    before, road_map = scene.world.digest(), scene.road_map
    bad = Scenario("bad", obstacles=(spawn("Box", None, 1.0), spawn("Box", None, 1e12)))
    with pytest.raises(DocumentError, match="bad: x: expected"):
        scene.carry_out(scene.prepare(bad, WHOLE))
    assert scene.world.digest() == before
    assert scene.road_map is road_map


def test_number_of_entities_is_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = make_scene()
    monkeypatch.setattr(stage_module, "MAX_ENTITIES", 8)
    vehicles = LoadOptions(delete_all=False, ego=False, vehicles=True, pedestrians=False, obstacles=False)
    with pytest.raises(DocumentError, match="crowd: the world holds 8 at most"):
        load(scene, "crowd", vehicles)
    scene.add(model("Box"), x=0.0, y=0.0, z=0.0, yaw=0.0)
    scene.add(model("Box"), x=0.0, y=0.0, z=0.0, yaw=0.0)
    with pytest.raises(FieldError, match="the world holds 8 at most"):
        scene.add(model("Box"), x=0.0, y=0.0, z=0.0, yaw=0.0)


def test_one_huge_id_does_not_exhaust_the_ids() -> None:
    scene = make_scene()
    many = Scenario("many", obstacles=(spawn("Box", 2**31 - 1, 0.0), spawn("Box", 500, 0.0), spawn("Box", None, 0.0)))
    scene.carry_out(scene.prepare(many, WHOLE))
    assert uids(scene, Kind.OBSTACLE) == [501, 500, 502]


def test_single_objects_can_be_added_and_removed() -> None:
    scene = make_scene()
    uid = scene.add(model("Truck"), x=1.0, y=2.0, z=3.0, yaw=0.5)
    row = scene.world.row(uid)
    assert (scene.world.kind[row], scene.world.z[row], scene.world.speed[row]) == (Kind.VEHICLE, 3.0, 0.0)
    scene.remove(uid)
    assert scene.add(model("Truck"), x=1.0, y=2.0, z=3.0, yaw=0.5) > uid
    with pytest.raises(FieldError, match="there is no such object"):
        scene.remove(uid)
    with pytest.raises(FieldError, match="the ego cannot be removed"):
        scene.remove(0)
    with pytest.raises(FieldError, match="x: expected"):
        scene.add(model("Truck"), x=np.nan, y=2.0, z=3.0, yaw=0.5)


def test_vehicle_specifications_are_found_by_id() -> None:
    scene = make_scene()
    ego = scene.world.bodies[scene.world.row(0)]
    assert scene.vehicle(0) is scene.vehicle(-1) is ego
    assert scene.vehicle(7) is not None
    assert scene.vehicle(9) is None  # walks
    assert scene.vehicle(12345) is None


@pytest.mark.parametrize(("gear", "expected"), [(Gear.REVERSE, -5.0), (Gear.DRIVE, 5.0)])
@pytest.mark.parametrize("speed", [5.0, -5.0])
def test_ego_of_a_scenario_starts_in_the_direction_of_its_gear(gear: Gear, speed: float, expected: float) -> None:
    ego = Spawn(Kind.EGO, model("2016_Hyundai_Ioniq"), "ego", 0, 0.0, 0.0, 0.0, 0.0, speed)
    scene = Scene(World(0), MemoryLibrary(), Scenario("moving", None, (ego,)), ego_gear=gear)
    assert scene.world.speed[scene.world.row(0)] == expected
