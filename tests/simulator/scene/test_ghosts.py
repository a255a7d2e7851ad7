"""Ghosts: egos and vehicles that a client places."""

from __future__ import annotations

import math
from typing import Any, cast

import pytest

from rosbridge_sim.errors import FieldError
from rosbridge_sim.records import replace
from rosbridge_sim.scenarios.catalogue import Catalogue, Model
from rosbridge_sim.simulator.plain.plain_bytes import PlainData
from rosbridge_sim.simulator.scene.ghost_trails import SPEED_WINDOW
from rosbridge_sim.simulator.scene.ghosts import Ghosts
from rosbridge_sim.simulator.scene.scene import Scene
from rosbridge_sim.simulator.scene.scene_limits import FIRST_EGO, MAX_ENTITIES, MAX_FILE_UID
from rosbridge_sim.world.state.world import DT, Body, Kind, World
from tests.simulator.sim_harness import ALL, Client, SimHarness

GHOST = "morai_msgs/GhostMessage"
GHOSTS = "morai_msgs/NpcGhostCmd"
NIRO = "2016_Kia_Niro(HEV)"


def vector(x: float = 0.0, y: float = 0.0, z: float = 0.0) -> dict[str, float]:
    return {"x": x, "y": y, "z": z}


def npc(uid: int, x: float, y: float = 0.0, *, yaw: float = 0.0, name: str = NIRO, **more: object) -> dict[str, Any]:
    return {"unique_id": uid, "name": name, "position": vector(x, y), "rpy": vector(z=yaw), **more}


def place(client: Client, *npcs: dict[str, Any]) -> None:
    client.send("/NpcGhost_Topic", GHOSTS, npc_list=list(npcs))


def npcs_of(client: Client) -> dict[int, dict[str, Any]]:
    return {each["unique_id"]: each for each in client.messages("/Object_topic")[-1]["npc_list"]}


# The ego


def test_ghost_keeps_the_pose_and_speed_of_its_message() -> None:
    harness = SimHarness()
    client = harness.client()
    client.listen("/Ego_topic")
    client.send("/ctrl_cmd", "morai_msgs/CtrlCmd", longlCmdType=1, accel=1.0)
    client.send(
        "/ghost_ctrl_cmd",
        GHOST,
        position=vector(70.0, -3.0, 1.0),
        rotation=vector(1.0, 2.0, 45.0),
        velocity=72.0,
        steering_angle=10.0,
    )
    harness.run(0.5)
    first, last = (client.messages("/Ego_topic")[i] for i in (0, -1))
    for status in (first, last):
        assert status["position"] == vector(70.0, -3.0, 1.0)
        assert status["heading"] == pytest.approx(45.0)
        assert status["velocity"]["x"] == pytest.approx(20.0)
        assert status["wheel_angle"] == pytest.approx(math.radians(10.0), rel=1e-6)
        assert status["acceleration"] == vector()
    row = harness.world.row(FIRST_EGO)
    assert (harness.world.roll[row], harness.world.pitch[row]) == pytest.approx((math.radians(1.0), math.radians(2.0)))


@pytest.mark.parametrize("way", ["command", "setting", "mode"])
def test_ghost_drives_again_after_a_command_teleport_or_mode_change(way: str) -> None:
    harness = SimHarness()
    client = harness.client()
    client.send("/ghost_ctrl_cmd", GHOST, position=vector(70.0), velocity=36.0)
    harness.run(0.2)
    row = harness.world.row(FIRST_EGO)
    assert harness.world.x[row] == 70.0
    if way == "command":
        client.send("/ctrl_cmd", "morai_msgs/CtrlCmd", longlCmdType=2, velocity=36.0)
    elif way == "mode":
        client.ask("/Service_MoraiEventCmd", option=1, ctrl_mode=1)
    else:
        lists = ("global_position_y", "global_position_z", "global_roll", "global_pitch", "global_yaw")
        client.send(
            "/ego_setting",
            "morai_msgs/MultiEgoSetting",
            number_of_ego_vehicle=1,
            ego_index=[0],
            global_position_x=[70.0],
            velocity=[36.0],
            gear=[4],
            ctrl_mode=[16],
            **{name: [0.0] for name in lists},
        )
    harness.run(0.2)
    assert harness.world.x[row] == pytest.approx(72.0, abs=0.1)


def test_ghost_control_needs_external_mode_and_real_time() -> None:
    harness = SimHarness(start_mode="keyboard")
    client = harness.client()
    before = harness.world.digest()
    for _ in range(2):
        client.send("/ghost_ctrl_cmd", GHOST, position=vector(70.0))
    assert [text for _, text in client.told] == [
        "/ghost_ctrl_cmd is ignored: ctrl_mode is KEYBOARD; set 3 by /Service_MoraiEventCmd"
    ]
    client.ask("/Service_MoraiEventCmd", option=1, ctrl_mode=3)
    client.start()
    client.send("/ghost_ctrl_cmd", GHOST, position=vector(70.0))
    assert client.told[-1] == ("warning", "/ghost_ctrl_cmd is ignored in synchronous mode: use /ego_setting")
    assert harness.world.digest() == before


@pytest.mark.parametrize(
    "wrong",
    [
        {"position": {"x": None}},
        {"position": {"x": 1e300}},
        {"rotation": {"z": None}},
        {"velocity": 1e9},
        {"velocity": None},
        {"steering_angle": None},
    ],
)
def test_a_ghost_message_with_a_bad_number_does_nothing(wrong: dict[str, Any]) -> None:
    harness = SimHarness()
    before = harness.world.digest()
    with pytest.raises(FieldError, match="GhostMessage"):
        harness.client().send("/ghost_ctrl_cmd", GHOST, **wrong)
    assert harness.world.digest() == before


# Vehicles


def test_new_number_adds_a_vehicle_of_the_model() -> None:
    harness = SimHarness("empty")
    client = harness.client()
    client.listen("/Object_topic")
    place(client, npc(2, 30.0, yaw=90.0), npc(3, 40.0, 5.0, name="Bus"))
    harness.run(0.1)
    npcs = npcs_of(client)
    assert {uid: each["name"] for uid, each in npcs.items()} == {2: NIRO, 3: "Bus"}
    assert npcs[2]["heading"] == pytest.approx(90.0)
    assert npcs[3]["position"] == vector(40.0, 5.0)
    assert client.ask("/Service_MoraiVehicleSpec", unique_id=3)["size"]["x"] == pytest.approx(10.955)


def test_ghost_may_use_a_model_of_the_users_catalogue() -> None:
    lorry = Model("Lorry", Kind.VEHICLE, replace(Body(), length=9.0, front_overhang=5.41))
    harness = SimHarness("empty", catalogue=Catalogue([lorry]))
    client = harness.client()
    place(client, npc(2, 30.0, name="lorry"))
    assert client.ask("/Service_MoraiVehicleSpec", unique_id=2)["size"]["x"] == 9.0
    with pytest.raises(FieldError, match="the catalogue has no vehicle 'lorry'"):
        place(SimHarness("empty").client(), npc(2, 30.0, name="lorry"))


def test_driving_vehicle_can_become_a_ghost() -> None:
    harness = SimHarness()  # 7 is a vehicle that goes at 10 m/s, along no path
    client = harness.client()
    client.listen("/Object_topic")
    place(client, npc(7, 300.0, name=""))
    harness.run(0.5)
    assert npcs_of(client)[7]["position"] == vector(300.0)
    assert npcs_of(client)[7]["velocity"] == vector()


def test_ghost_vehicles_are_placed_between_ticks_in_synchronous_mode() -> None:
    harness = SimHarness(start="sync")
    client = harness.client()
    client.listen("/Object_topic", "/CollisionData")
    client.start()
    for i in range(3):
        place(client, npc(50, 10.0, 40.0 - 10.0 * i))
        client.tick()
    places = [
        [each["position"]["y"] for each in message["npc_list"] if each["unique_id"] == 50]
        for message in client.messages("/Object_topic")
    ]
    assert places == [[40.0], [30.0], [20.0]]
    hits = [[each["unique_id"] for each in m["collision_object"]] for m in client.messages("/CollisionData")]
    assert hits == [[], [], [50]]
    assert harness.world.frame == 3


def test_ghost_speed_is_computed_from_its_motion() -> None:
    harness = SimHarness("empty", start="sync")
    client = harness.client()
    client.listen("/Object_topic")
    client.start()
    speeds = []
    for i in range(4 * SPEED_WINDOW):
        place(client, npc(2, 10.0 + 0.3 * i), npc(3, 10.0 - 0.1 * i))
        if i % 7 == 0:  # two messages within one frame
            place(client, npc(2, 10.0 + 0.3 * i), npc(3, 10.0 - 0.1 * i))
        client.tick()
        speeds.append([npcs_of(client)[uid]["velocity"]["x"] / 3.6 for uid in (2, 3)])
    assert speeds[0] == [0.0, 0.0]
    assert speeds[2] == pytest.approx([15.0, -5.0])
    assert speeds[-1] == pytest.approx([15.0, -5.0])
    place(client, npc(2, 900.0), npc(3, 0.0))  # put elsewhere
    client.tick()
    assert npcs_of(client)[2]["velocity"]["x"] == 0.0
    for _ in range(60):
        client.tick()
    place(client, npc(2, 903.0))  # after a long silence
    client.tick()
    assert npcs_of(client)[2]["velocity"]["x"] == 0.0


def test_ghost_speed_is_the_mean_over_a_window() -> None:
    """A window that is a frame longer lags behind whoever brakes."""
    harness = SimHarness("empty", start="sync")
    client = harness.client()
    client.listen("/Object_topic")
    client.start()
    for i in range(3 * SPEED_WINDOW):
        place(client, npc(2, 10.0 + 0.002 * i * i))
        client.tick()
    last = 3 * SPEED_WINDOW - 1
    way = 0.002 * (last**2 - (last - SPEED_WINDOW) ** 2)
    assert npcs_of(client)[2]["velocity"]["x"] / 3.6 == pytest.approx(way / (SPEED_WINDOW * DT))


def test_newer_release_gives_the_ghost_speed_in_the_message() -> None:
    harness = SimHarness("empty", release="26.R1", start="sync")
    client = harness.client()
    client.listen("/Object_topic")
    client.start()
    for i in range(3):
        place(client, npc(2, float(i), vehicle_speed=36.0, turn_signal=1))
        client.tick()
        assert npcs_of(client)[2]["velocity"]["x"] == pytest.approx(36.0)
        assert npcs_of(client)[2]["position"]["x"] == float(i)


@pytest.mark.parametrize(
    ("wrong", "text"),
    [
        (npc(9, 0.0), "a pedestrian's"),
        (npc(3, 0.0), "obstacle"),
        (npc(0, 0.0), "an ego's"),
        (npc(-1, 0.0), "expected 1.."),
        (npc(MAX_FILE_UID + 1, 0.0), "expected 1.."),
        (npc(50, 0.0, name="Zeppelin"), "no vehicle 'Zeppelin'"),
        (npc(50, 0.0, name="Man"), "no vehicle 'Man'"),
        (npc(50, math.nan), "finite"),
        (npc(7, 5.0), "named twice"),
    ],
)
def test_one_invalid_entry_moves_nothing(wrong: dict[str, Any], text: str) -> None:
    harness = SimHarness()
    before = harness.world.digest()
    with pytest.raises(FieldError, match=text):
        place(harness.client(), npc(7, 99.0), npc(60, 9.0), wrong)
    assert harness.world.digest() == before


def test_ego_number_is_refused_for_a_ghost_vehicle() -> None:
    harness = SimHarness("empty")
    client = harness.client()
    lists = ("global_position_x", "global_position_y", "global_position_z", "global_roll", "global_pitch", "global_yaw")
    client.send(
        "/ego_setting",
        "morai_msgs/MultiEgoSetting",
        number_of_ego_vehicle=1,
        ego_index=[2],
        velocity=[0.0],
        gear=[4],
        ctrl_mode=[16],
        **{name: [9.0] for name in lists},
    )
    with pytest.raises(FieldError, match="an ego's"):
        place(client, npc(2, 0.0))


def test_ghost_numbers_can_be_used_again_after_a_load() -> None:
    harness = SimHarness("empty")
    client = harness.client()
    client.listen("/Object_topic")
    place(client, npc(40, 0.0))
    client.ask("/Service_MoraiSL", file_name="parked", **ALL)
    harness.run(0.021)
    assert npcs_of(client) == {}
    place(client, npc(40, 50.0))
    client.start()
    client.send("/SyncModeAddObj", "morai_msgs/SyncModeAddObj", name="Van", position=vector(99.0), frame=0)
    client.tick()
    assert list(npcs_of(client)) == [40, 41]


@pytest.mark.parametrize("release", ["22.R2", "26.R1"])
def test_message_without_ghosts_changes_nothing(release: str) -> None:
    harness = SimHarness(release=release)
    before = harness.world.digest()
    place(harness.client())
    assert harness.world.digest() == before


def test_number_of_ghosts_is_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("rosbridge_sim.simulator.scene.ghosts.MAX_ENTITIES", 3)
    harness = SimHarness("empty")
    client = harness.client()
    place(client, npc(2, 0.0), npc(3, 9.0))
    with pytest.raises(FieldError, match="holds 3 at most"):
        place(client, npc(2, 50.0), npc(4, 0.0))
    place(client, npc(2, 50.0))


# Lamps


def test_lamps_topic_sets_the_lamps_of_the_event_answer() -> None:
    harness = SimHarness()
    client = harness.client()
    for turn, emergency in ((1, 0), (2, 1), (0, 0)):
        client.send("/lamps", "morai_msgs/Lamps", turnSignal=turn, emergencySignal=emergency)
        lamps = client.ask("/Service_MoraiEventCmd", option=0)["lamps"]
        assert (lamps["turnSignal"], lamps["emergencySignal"]) == (turn, emergency)
    client.send("/lamps", "morai_msgs/Lamps", turnSignal=1)
    for wrong in ({"turnSignal": 3}, {"emergencySignal": 2}, {"turnSignal": 2, "emergencySignal": -1}):
        with pytest.raises(FieldError, match=r"lamps\."):
            client.send("/lamps", "morai_msgs/Lamps", **wrong)
    assert client.ask("/Service_MoraiEventCmd", option=0)["lamps"]["turnSignal"] == 1


def test_too_many_vehicles_are_refused_before_they_are_read() -> None:
    harness = SimHarness()
    before = harness.world.digest()
    with pytest.raises(FieldError, match=f"the world holds 20,000 at most, got {MAX_ENTITIES + 1:,} vehicles"):
        harness.client().send("/NpcGhost_Topic", "morai_msgs/NpcGhostCmd", npc_list=[{}] * (MAX_ENTITIES + 1))
    assert harness.world.digest() == before


@pytest.mark.parametrize("state", [None, 7, [], [1, 2, 3, 4], {"uids": []}])
def test_saved_ghosts_of_another_form_are_refused_in_plain_words(state: object) -> None:
    ghosts = Ghosts(World(0), cast("Scene", None), set)
    with pytest.raises(ValueError, match="ghosts: expected ids, counts, frames and places"):
        ghosts.trails.load_state(cast("PlainData", state))
