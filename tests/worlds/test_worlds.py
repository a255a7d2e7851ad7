"""`Worlds`: the worlds of a server, without a server."""

from __future__ import annotations

import copy
import pickle
import shutil
from functools import partial
from pathlib import Path

import numpy as np
import pytest

import rosbridge_sim
from rosbridge_sim.errors import DocumentError
from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.records import replace
from rosbridge_sim.shell.files.library import DiskLibrary
from rosbridge_sim.simulator.node_factory import make_node
from rosbridge_sim.simulator.simulator_node import NodeSettings
from rosbridge_sim.world.state.commands import command
from rosbridge_sim.world.state.world import Dynamics, Gear, Kind, Mode, World
from tests.simulator.sim_harness import Client, make_store
from tests.support import ROOT

pytestmark = pytest.mark.usefixtures("loops")

LIBRARY = DiskLibrary()

Worlds = partial(rosbridge_sim.Worlds, library=LIBRARY)
"""Each map is read once for all tests."""

PEDALS = {"steering": 0.02, "throttle": 0.4, "brake": 0.0}


def digests_of_server(seed: int, num_frames: int, traffic: int, remove_at: int = -1) -> str:
    """Drive a server's world in synchronous mode with the pedals of `PEDALS`; perhaps remove the latest vehicle."""
    library, bus, world = LIBRARY, Bus(make_store()), World(seed, Dynamics.SINGLE_TRACK)
    settings = NodeSettings(start_mode="external", traffic=traffic, start="sync")
    make_node(bus, world, library, library.opening_scenario("loop"), settings)
    client = Client(bus, "/master")
    client.start()
    world.start_scoring()
    row = int(world.rows(Kind.EGO)[0])
    command(world, row, mode=Mode.PEDALS, steer=0.02, throttle=0.4)
    for frame in range(num_frames):
        if frame == remove_at:
            world.remove(int(world.uid.max()))
        client.tick(frame=frame)
    assert world.frame == num_frames
    return world.digest()


def test_world_equals_that_of_a_server() -> None:
    worlds = Worlds("loop", 3, seed=4, traffic=6)
    worlds.step(PEDALS, 37)
    assert worlds.digests()[1] == digests_of_server(5, 37, 6)


@pytest.mark.slow
def test_removed_vehicle_is_replaced_as_on_a_server() -> None:
    worlds = Worlds("loop", 2, seed=4, traffic=6)
    worlds.step(PEDALS, 43)
    uid = int(worlds.world(1).uid.max())
    worlds.remove(1, uid)
    num = len(worlds.world(1))
    worlds.step(None, 220)
    assert len(worlds.world(1)) > num
    assert worlds.digests()[1] == digests_of_server(5, 263, 6, remove_at=43)


def test_reset_begins_the_masked_worlds_again() -> None:
    worlds, fresh = Worlds("loop", 3, traffic=4), Worlds("loop", 3, traffic=4)
    start = fresh.digests()
    worlds.step(PEDALS, 12)
    before = worlds.digests()
    worlds.reset(np.array([False, True, False]))
    assert worlds.digests() == [before[0], start[1], before[2]]
    assert worlds.frames.tolist() == [12, 0, 12]


def test_reset_takes_new_seeds() -> None:
    worlds = Worlds("loop", 2, traffic=4)
    worlds.reset(seeds=[7, None])
    assert worlds.seeds == [7, 1]
    assert worlds.digests() == [
        Worlds("loop", seed=7, traffic=4).digests()[0],
        Worlds("loop", seed=1, traffic=4).digests()[0],
    ]


def test_begins_are_kept_by_scenario_and_seed_and_few_of_them() -> None:
    worlds = Worlds(["loop", "roundabout"], seed=[3, 3], traffic=2)
    fresh = worlds.digests()
    worlds.step(PEDALS, 3)
    for seeds in ([3, 3], [4, 4], [3, 3]):  # the second time from what is kept
        worlds.reset(seeds=seeds)
        assert (worlds.digests() == fresh) == (seeds == [3, 3])
    worlds.step(PEDALS, 13)
    worlds.reset(seeds=[None, 4])
    assert worlds.digests()[0] == fresh[0]
    assert worlds.seeds == [3, 4]
    with pytest.raises(ValueError, match="seeds: expected 2 numbers"):
        worlds.reset(seeds=[0, -1])


def test_saved_traffic_goes_on_in_its_own_time() -> None:
    worlds, same = Worlds("loop", traffic=6), Worlds("loop", traffic=6)
    worlds.step(PEDALS, 13)
    saved = worlds.save()
    worlds.step(PEDALS, 4)
    worlds.load(saved)
    worlds.remove(0, int(worlds.world(0).uid.max()))
    same.step(PEDALS, 13)
    same.remove(0, int(same.world(0).uid.max()))
    for each in (worlds, same):
        each.step(PEDALS, 45)
        each.step(PEDALS, 2)
    assert worlds.digests() == same.digests()


def test_ego_has_the_model_that_was_asked_for() -> None:
    longest, usual = Worlds("loop", vehicle="Bus"), Worlds("loop")
    assert longest.egos(("centre",))["centre"] > usual.egos(("centre",))["centre"] + 1.0


def test_several_egos_begin_at_the_first_one_and_are_placed_apart() -> None:
    worlds = Worlds(["loop", "hills"], egos=3)
    poses = worlds.egos(("x", "y", "z", "yaw"))
    for values in poses.values():
        assert values.shape == (2, 3)
        assert (values == values[:, :1]).all()
    worlds.place(1, x=5.0, y=6.0, z=1.0, yaw=0.5, speed=4.0, ego=2)
    egos = worlds.egos(("x", "y", "yaw", "speed"))
    assert [float(values[1, 2]) for values in egos.values()] == [5.0, 6.0, 0.5, 4.0]
    assert egos["x"][1, 1] == poses["x"][1, 1]
    start = worlds.digests()
    worlds.step()
    worlds.reset()
    assert worlds.egos(("x",))["x"].tolist() == poses["x"].tolist()
    assert worlds.digests() != start
    for ego in (-1, 3):
        with pytest.raises(ValueError, match=rf"ego: expected 0\.\.2, got {ego}"):
            worlds.place(0, x=0.0, y=0.0, yaw=0.0, ego=ego)
    for num in (0, 1_000_000):
        with pytest.raises(ValueError, match="egos: expected 1"):
            Worlds("loop", egos=num)


def test_vehicle_is_spawned_on_a_lane_and_follows_it() -> None:
    worlds = Worlds("loop")
    world = worlds.world(0)
    last = len(world.roads) - 1
    for lane in (0, last):
        row = world.row(worlds.spawn(0, "2015_Kia_K5", lane=lane, s=12.0, speed=3.0))
        place = world.roads.at(np.array([lane]), np.array([12.0]))[0][0]
        assert (world.x[row], world.y[row], world.speed[row]) == pytest.approx((place[0], place[1], 3.0))
    row = world.row(worlds.spawn(0, "2015_Kia_K5", x=3.0, y=400.0, yaw=0.5, speed=2.0))
    worlds.step(n=50)
    assert (world.x[row], world.y[row]) == pytest.approx((3.0 + 2.0 * np.cos(0.5), 400.0 + 2.0 * np.sin(0.5)))
    for lane in (-1, last + 1):
        with pytest.raises(ValueError, match=rf"lane: expected 0\.\.{last}, got {lane}"):
            worlds.spawn(0, "2015_Kia_K5", lane=lane)
    for uid in (0, 999_999):
        with pytest.raises(ValueError, match=f"uid: expected an object that is no ego, got {uid}"):
            worlds.remove(0, uid)


def test_pickled_worlds_find_the_map_of_their_user_again(tmp_path: Path) -> None:
    shutil.copytree(ROOT / "rosbridge_sim" / "data" / "maps" / "track", tmp_path / "own")
    library = DiskLibrary(own_map=str(tmp_path / "own"))
    worlds = rosbridge_sim.Worlds("loop", library=library)
    for each in (copy.deepcopy(worlds), pickle.loads(pickle.dumps(worlds))):  # noqa: S301 - our own bytes
        assert each.world(0).roads.ids == worlds.world(0).roads.ids
        assert each.digests() == worlds.digests()


def test_copied_and_pickled_worlds_go_on_as_they_did() -> None:
    worlds = Worlds(["loop", "roundabout"], seed=[3, 5], traffic=4)
    worlds.step(PEDALS, 25)
    copies = [copy.deepcopy(worlds), pickle.loads(pickle.dumps(worlds))]  # noqa: S301 - our own bytes
    for each in (worlds, *copies):
        each.step(None, 40)
    assert worlds.digests() == copies[0].digests() == copies[1].digests()
    for each in (worlds, *copies):
        each.reset([False, True], [None, 8])
        each.step(PEDALS, 5)
    assert worlds.digests() == copies[0].digests() == copies[1].digests()
    assert copies[1].seeds == [3, 8]
    assert worlds.scores()["score_distance"].tolist() == copies[1].scores()["score_distance"].tolist()


def test_saved_worlds_go_on_as_they_did() -> None:
    worlds = Worlds("loop", 2, traffic=4)
    worlds.step(PEDALS, 20)
    saved = worlds.save()
    worlds.step(PEDALS, 30)
    after = worlds.digests()
    worlds.load(saved)
    worlds.step(PEDALS, 30)
    assert worlds.digests() == after
    worlds.load(saved[:1], np.array([False, True]))
    worlds.step(PEDALS, 30)
    assert worlds.digests()[1] == after[0]


def test_egos_move_as_they_are_commanded() -> None:
    worlds = Worlds("loop", 2)
    start = worlds.egos()
    worlds.step({"steering": [[0.0], [0.1]], "speed": 5.0}, 100)
    egos = worlds.egos()
    assert egos["speed"] == pytest.approx(np.full((2, 1), 5.0), abs=0.2)
    assert abs(egos["yaw"] - start["yaw"])[0, 0] < 1e-6
    assert (egos["yaw"] - start["yaw"])[1, 0] > 0.1
    assert worlds.scores()["score_distance"][0, 0] > 3.0


def test_others_are_seen_from_the_ego() -> None:
    worlds = Worlds("loop", 2)
    ego = {name: float(values[1, 0]) for name, values in worlds.egos().items()}
    ahead = ego["x"] + 20.0 * np.cos(ego["yaw"]), ego["y"] + 20.0 * np.sin(ego["yaw"])
    uid = worlds.spawn(1, "2015_Kia_K5", x=ahead[0], y=ahead[1], yaw=ego["yaw"])
    out = np.empty((2, 1, 1, 9))
    seen = worlds.others(1, out)
    assert seen is out
    is_there, x, y, vx, _, cos, _, length, _ = seen[1, 0, 0]
    assert (is_there, cos) == (1.0, pytest.approx(1.0))
    assert x == pytest.approx(20.0, abs=2.0)  # the middle of the car, not its rear axle
    assert (y, vx) == (pytest.approx(0.0, abs=1e-6), 0.0)
    assert length > 4.0
    worlds.remove(1, uid)
    assert not np.allclose(worlds.others(1)[1], seen[1]) or not worlds.others(1)[1].any()


def test_lanes_are_told_in_the_frame_of_the_ego() -> None:
    worlds = Worlds("loop")
    lanes = worlds.lanes([0.0, 10.0])
    assert lanes["is_on_road"].tolist() == [[1.0]]
    assert abs(lanes["offset"][0, 0]) < 0.5
    assert lanes["points"][0, 0, 1] == pytest.approx([10.0, 0.0], abs=0.5)
    x, y, yaw = (worlds.egos()[name][0, 0] for name in ("x", "y", "yaw"))
    worlds.place(0, x=x - np.sin(yaw), y=y + np.cos(yaw), yaw=yaw)
    assert worlds.lanes()["offset"][0, 0] == pytest.approx(lanes["offset"][0, 0] + 1.0, abs=1e-6)


def test_contacts_are_those_of_each_world() -> None:
    worlds = Worlds("loop", 2)
    ego = {name: float(values[0, 0]) for name, values in worlds.egos().items()}
    uid = worlds.spawn(0, "2015_Kia_K5", x=ego["x"], y=ego["y"], yaw=ego["yaw"])
    worlds.step()
    assert [pairs.tolist() for pairs in worlds.contacts()] == [[[0, uid]], []]
    assert worlds.scores()["num_collisions"].tolist() == [[1.0], [0.0]]


def test_worlds_may_have_different_scenarios() -> None:
    worlds = Worlds(["loop", "hills", "loop"], seed=[1, 2, 3])
    worlds.step(PEDALS, 20)
    assert worlds.digests()[1] == _stepped("hills", 2, 20)


def test_standing_ego_shifts_and_drives_backwards() -> None:
    worlds = Worlds("loop", 2)
    worlds.step({"steering": 0.0, "accel": [[2.0], [0.0]], "gear": [[Gear.REVERSE], [Gear.DRIVE]]}, 50)
    assert worlds.egos()["gear"].tolist() == [[Gear.REVERSE], [Gear.DRIVE]]
    assert worlds.egos()["speed"][0, 0] < -1.0
    worlds.step({"steering": 0.0, "accel": 0.0, "gear": Gear.DRIVE})
    assert worlds.egos()["gear"][0, 0] == Gear.REVERSE  # it is too fast


def test_egos_drive_themselves_in_many_worlds_as_in_one() -> None:
    many = Worlds("motorway", 3, seed=1, traffic=6)
    one = Worlds("motorway", seed=2, traffic=6)
    assert many.drive_itself([[np.nan], [20.0], [25.0]]).tolist() == [[False], [True], [True]]
    one.drive_itself(20.0)
    for worlds, sides in ((many, [[0.0], [1.0], [0.0]]), (one, 1.0)):
        worlds.step(n=70)
        assert worlds.change_lanes(sides).any()
        worlds.step(n=30)
        worlds.drive_itself([[np.nan], [30.0], [np.nan]] if worlds is many else 30.0)
        worlds.step(n=40)
    assert many.digests()[1] == one.digests()[0]
    assert many.egos()["speed"][0, 0] < 1.0
    assert many.egos()["speed"][1, 0] > 5.0


def test_wanted_figures_of_egos_alone_are_returned() -> None:
    worlds = Worlds("loop", 2)
    assert list(worlds.egos(("speed", "yaw"))) == ["speed", "yaw"]
    with pytest.raises(ValueError, match=r"names: expected those of x, y, .* got velocity"):
        worlds.egos(("velocity",))


def test_wrong_wishes_are_refused() -> None:
    worlds = Worlds("loop", 2)
    with pytest.raises(ValueError, match="desired_speed: expected numbers from 0 on, or nan"):
        worlds.drive_itself(-1.0)
    with pytest.raises(ValueError, match=r"side: expected an array of shape \(2, 1\), got \(3,\)"):
        worlds.change_lanes([1.0, 0.0, 0.0])
    assert not worlds.change_lanes(1.0).any()  # none drives itself


@pytest.mark.slow
def test_lights_are_those_ahead_of_each_ego() -> None:
    town = replace(LIBRARY.scenario("town"), vehicles=())
    worlds, alone = Worlds(town, 3, seed=1), Worlds(town, seed=2)
    lights = worlds.lights()
    assert 60.0 < lights["distance"][1, 0] < 80.0  # from x = -86 m to the junction at x = -14 m
    states: set[float] = set()
    for _ in range(60):
        if len(states) > 1:
            break
        worlds.step({"steering": 0.0, "speed": 0.0}, 50)
        alone.step({"steering": 0.0, "speed": 0.0}, 50)
        assert alone.lights()["must_stop"][0] == worlds.lights()["must_stop"][1]
        states.add(float(worlds.lights()["must_stop"][1, 0]))
    assert states == {0.0, 1.0}


def _stepped(scenario: str, seed: int, num_frames: int) -> str:
    one = Worlds(scenario, seed=seed)
    one.step(PEDALS, num_frames)
    return one.digests()[0]


@pytest.mark.parametrize(
    ("commands", "text"),
    [
        ({"steering": 0.0}, "commands: expected steering with throttle and brake, with speed or with accel"),
        ({"speed": 0.0}, "commands: expected steering"),
        ({"steering": [0.0, 1.0, 2.0], "speed": 0.0}, r"steering: expected an array of shape \(2, 1\), got \(3,\)"),
        ({"steering": 0.0, "speed": float("nan")}, "speed: expected finite numbers"),
        ({"steering": 0.0, "speed": 1.0, "gear": 9}, r"gear: expected numbers within 1\.\.4"),
    ],
)
def test_wrong_commands_are_refused(commands: dict[str, object], text: str) -> None:
    worlds = Worlds("loop", 2)
    before = worlds.digests()
    with pytest.raises(ValueError, match=text):
        worlds.step(commands)  # type: ignore[arg-type]
    assert worlds.digests() == before


def test_wrong_arguments_are_refused() -> None:
    worlds = Worlds("loop", 2)
    with pytest.raises(ValueError, match=r"mask: expected bool of shape \(2,\)"):
        worlds.reset([True])
    with pytest.raises(ValueError, match="seeds: expected 2 numbers"):
        worlds.reset(seeds=[1])
    with pytest.raises(ValueError, match="n: expected a whole number from 1 on, got 0"):
        worlds.step(n=0)
    with pytest.raises(ValueError, match="num_worlds: expected a whole number from 1 on, got '2'"):
        Worlds("loop", "2")  # type: ignore[arg-type]
    for traffic in (-1, 2.5, float("nan"), True):
        with pytest.raises(ValueError, match=f"traffic: expected a whole number from 0 on, got {traffic}"):
            Worlds("loop", traffic=traffic)  # type: ignore[arg-type]
    for seed in (-1, [0, -1], [0]):
        with pytest.raises(ValueError, match="seed: expected 2 numbers that are not negative"):
            Worlds("loop", 2, seed=seed)
    with pytest.raises(ValueError, match="scenario: expected at least one"):
        Worlds([])
    with pytest.raises(ValueError, match="saved: expected copies from `save`"):
        worlds.load(b"ab")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match=r"world: expected 0\.\.1, got 2"):
        worlds.spawn(2, "2015_Kia_K5")
    with pytest.raises(ValueError, match="the catalogue has no 'no such car'"):
        worlds.spawn(0, "no such car")
    with pytest.raises(ValueError, match="saved: expected 2 copies, got 1"):
        worlds.load(worlds.save(np.array([True, False])))
    with pytest.raises(DocumentError):
        Worlds("no such scenario")
