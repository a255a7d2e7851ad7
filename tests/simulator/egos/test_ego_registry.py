"""MultiEgoSetting, and egos beside the first one."""

from __future__ import annotations

import math
from typing import Any

import pytest

from rosbridge_sim.errors import DocumentError, FieldError, GraphError
from rosbridge_sim.graph.participant import Participant
from rosbridge_sim.morai.releases import Profile
from rosbridge_sim.simulator.scene.scene_limits import FIRST_EGO, MAX_EGOS
from rosbridge_sim.world.state.world import Kind
from tests.simulator.sim_harness import ALL, Client, SimHarness, rates

SETTING = "morai_msgs/MultiEgoSetting"
LISTS = {
    "global_position_x": 0.0,
    "global_position_y": 0.0,
    "global_position_z": 0.0,
    "global_roll": 0.0,
    "global_pitch": 0.0,
    "global_yaw": 0.0,
    "velocity": 0.0,
    "gear": 4,
    "ctrl_mode": 16,
}


def setting(*egos: int, **lists: list[Any]) -> dict[str, Any]:
    """A MultiEgoSetting for these egos; what is not said is 0, D and automatic."""
    body: dict[str, Any] = {"number_of_ego_vehicle": len(egos), "camera_index": 0, "ego_index": list(egos)}
    return body | {name: [value] * len(egos) for name, value in LISTS.items()} | lists


def put(client: Client, *egos: int, **lists: Any) -> None:  # noqa: ANN401 - the message's own lists
    client.send("/ego_setting", SETTING, **setting(*egos, **lists))


def two_egos(**settings: Any) -> tuple[SimHarness, Client]:  # noqa: ANN401 - NodeSettings' own fields
    harness = SimHarness("parked", **settings)
    client = harness.client()
    put(client, 2, global_position_y=[10.0])
    return harness, client


# Who sees whom


def test_each_ego_is_listed_for_others_as_a_vehicle_of_type_ego() -> None:
    harness, client = two_egos(start="sync")
    put(client, 3, global_position_x=[-20.0])
    client.listen("/Object_topic", "/Ego-2/Object_topic")
    client.start()
    client.tick()
    for topic, expected in (
        ("/Object_topic", [(2, 0.0, 10.0), (3, -20.0, 0.0)]),
        ("/Ego-2/Object_topic", [(0, -5.0, 0.0), (3, -20.0, 0.0)]),
    ):
        (listed,) = client.messages(topic)
        egos = [one for one in listed["npc_list"] if one["type"] == -1]
        assert [(one["unique_id"], one["position"]["x"], one["position"]["y"]) for one in egos] == expected
        assert listed["num_of_npcs"] == len(listed["npc_list"])
    client.ask("/Service_MoraiSL", file_name="parked", **ALL)
    client.tick()
    assert client.messages("/Object_topic")[-1]["npc_list"] == []
    assert len(harness.node.egos) == 1


def test_nearest_object_may_be_an_ego() -> None:
    _, client = two_egos(start="sync", profile=Profile(object_limit=1))
    assert client.ask("/SyncModeCmd", user_id="me", start_sync_mode=True, time_step=20)["result"]
    client.send("/SyncModeAddObj", "morai_msgs/SyncModeAddObj", name="Box", position={"x": 500.0})
    client.listen("/Object_topic")
    client.tick()
    (listed,) = client.messages("/Object_topic")
    assert [one["type"] for name in ("npc_list", "obstacle_list") for one in listed[name]] == [-1]


# The first ego


def test_ego_is_placed_at_the_pose_of_the_message() -> None:
    harness = SimHarness()
    client = harness.client()
    client.listen("/Ego_topic")
    place = {"global_position_x": [100.0], "global_position_y": [-50.0], "global_position_z": [2.0]}
    put(client, 0, **place, global_yaw=[450.0], global_roll=[1.0], global_pitch=[2.0], velocity=[36.0])
    row = harness.world.row(FIRST_EGO)
    assert harness.world.roll[row] == pytest.approx(math.radians(1.0))
    assert harness.world.pitch[row] == pytest.approx(math.radians(2.0))
    harness.run(0.021)
    status = client.messages("/Ego_topic")[0]
    assert status["position"]["x"] == pytest.approx(100.0)
    assert status["position"]["y"] == pytest.approx(-50.0 + 0.2, abs=0.01)
    assert status["position"]["z"] == 2.0
    assert status["heading"] == pytest.approx(90.0)
    assert status["velocity"]["x"] == pytest.approx(10.0, abs=0.02)


def test_ego_setting_acts_between_ticks_in_synchronous_mode() -> None:
    harness = SimHarness(start="sync")
    client = harness.client()
    client.start()
    client.control(0, longlCmdType=1, accel=1.0)
    for _ in range(100):
        client.tick()
    put(client, 0, global_position_x=[7.0], global_position_y=[8.0])
    client.control(0, longlCmdType=1, brake=1.0)
    status = client.tick()["vehicle_status"]
    assert (status["position"]["x"], status["position"]["y"]) == (7.0, 8.0)
    assert status["velocity"]["x"] == 0.0


@pytest.mark.parametrize(
    "command",
    [
        {"longlCmdType": 1, "accel": 1.0, "steering": 0.5},
        {"longlCmdType": 1, "brake": 1.0, "steering": -0.5},
        {"longlCmdType": 2, "velocity": 60.0, "steering": 0.5},
        {"longlCmdType": 3, "acceleration": 3.0, "steering": 0.5},
    ],
)
def test_placed_ego_forgets_its_command(command: dict[str, float]) -> None:
    harness = SimHarness("parked")
    client = harness.client()
    client.send("/ctrl_cmd", "morai_msgs/CtrlCmd", **command)
    harness.run(0.5)
    put(client, 0, global_position_x=[7.0], global_position_y=[8.0])
    client.listen("/Ego_topic")
    harness.run(0.5)
    for status in client.messages("/Ego_topic"):
        assert (status["position"]["x"], status["position"]["y"], status["heading"]) == (7.0, 8.0, 0.0)
        assert status["velocity"] == status["acceleration"] == {"x": 0.0, "y": 0.0, "z": 0.0}
        assert (status["accel"], status["brake"], status["wheel_angle"]) == (0.0, 0.0, 0.0)
    client.send("/ctrl_cmd", "morai_msgs/CtrlCmd", longlCmdType=2, velocity=18.0)
    harness.run(2.0)
    assert client.messages("/Ego_topic")[-1]["velocity"]["x"] == pytest.approx(5.0, abs=0.01)


def test_ego_placed_with_speed_rolls_straight_without_pedals() -> None:
    harness = SimHarness("parked")
    client = harness.client()
    client.send("/ctrl_cmd", "morai_msgs/CtrlCmd", longlCmdType=2, velocity=60.0, steering=0.5)
    harness.run(1.0)
    put(client, 0, velocity=[36.0])
    client.listen("/Ego_topic")
    harness.run(1.0)
    last = client.messages("/Ego_topic")[-1]
    assert (last["position"]["y"], last["heading"], last["wheel_angle"]) == (0.0, 0.0, 0.0)
    assert 9.5 < last["velocity"]["x"] < 10.0  # rolling and drag alone


def test_placing_an_ego_drops_its_waiting_commands() -> None:
    harness, client = two_egos(start="sync")
    client.start()
    throttle = {"longlCmdType": 1, "accel": 1.0}
    for frame in (1, 3, 5):
        assert client.ask("/SyncModeCtrlCmd", frame=frame, command=throttle)["result"]
        assert client.ask("/Ego-2/SyncModeCtrlCmd", frame=frame, command=throttle)["result"]
    assert client.ask("/SyncModeSetGear", frame=4, gear=2)["result"]
    put(client, 0)
    assert len(harness.node.sync.waiting()) == 3
    for _ in range(6):
        status = client.tick()["vehicle_status"]
        assert (status["velocity"]["x"], status["accel"]) == (0.0, 0.0)
    assert harness.node.egos[0].gear.name == "DRIVE"
    assert harness.world.speed[harness.node.egos[1].row] > 0.0
    put(client, 0)  # twice in one frame is once
    put(client, 0)
    client.control(0, **throttle)
    assert client.tick()["vehicle_status"]["velocity"]["x"] > 0.0


def test_refused_ego_setting_keeps_the_command() -> None:
    harness = SimHarness("parked")
    client = harness.client()
    client.send("/ctrl_cmd", "morai_msgs/CtrlCmd", longlCmdType=1, accel=1.0)
    with pytest.raises(FieldError):
        put(client, 0, gear=[7])
    harness.run(1.0)
    assert harness.world.speed[harness.world.row(FIRST_EGO)] > 1.0


def test_ego_setting_changes_gear_at_any_speed_and_0_keeps_it() -> None:
    harness = SimHarness()
    client = harness.client()
    put(client, 0, velocity=[-18.0], gear=[2])
    assert client.told == []
    ego = harness.node.egos[0]
    assert ego.gear.name == "REVERSE"
    assert harness.world.speed[ego.row] == pytest.approx(-5.0)
    for _ in range(2):
        put(client, 0, gear=[0], ctrl_mode=[0])
    assert ego.gear.name == "REVERSE"
    assert [(level, text.split(";")[0]) for level, text in client.told] == [
        ("warning", "/ego_setting: gear 0 leaves the gear as it is"),
        ("warning", "/ego_setting: ctrl_mode 0 leaves the mode as it is"),
    ]


@pytest.mark.parametrize("index", [0, 2])
def test_ego_is_placed_with_a_speed_in_the_direction_of_its_gear(index: int) -> None:
    harness = SimHarness("parked", start="sync")
    client = harness.client()
    client.start()
    for _ in range(2):
        put(client, index, velocity=[18.0], gear=[2])
    assert client.told == [("warning", "/ego_setting: in gear 2 (R) a velocity is driven backwards, whatever its sign")]
    ego = harness.node.egos.find(index)
    assert ego is not None
    assert harness.world.speed[ego.row] == pytest.approx(-5.0)
    for _ in range(50):
        client.tick()
    assert harness.world.x[ego.row] < -4.0
    put(client, index, velocity=[18.0], gear=[-1])
    assert harness.world.speed[ego.row] == pytest.approx(-5.0), "it is in R still"
    before = harness.world.digest()
    with pytest.raises(
        FieldError, match=rf"velocity of ego {index}: speed: expected 0 or more in gear 4 \(D\), got -5"
    ):
        put(client, 5, index, velocity=[0.0, -18.0], gear=[4, 4])
    assert harness.world.digest() == before


def test_keyboard_mode_blocks_client_control_until_automatic_mode() -> None:
    harness = SimHarness()
    client = harness.client()
    client.send("/ctrl_cmd", "morai_msgs/CtrlCmd", longlCmdType=1, accel=1.0)
    put(client, 0, ctrl_mode=[1])
    client.send("/ctrl_cmd", "morai_msgs/CtrlCmd", longlCmdType=1, accel=1.0)
    harness.run(1.0)
    assert harness.world.speed[harness.world.row(FIRST_EGO)] == 0.0
    assert client.ask("/Service_MoraiEventCmd", option=0)["ctrl_mode"] == 1
    put(client, 0, ctrl_mode=[16])
    assert client.ask("/Service_MoraiEventCmd", option=0)["ctrl_mode"] == 3
    client.send("/ctrl_cmd", "morai_msgs/CtrlCmd", longlCmdType=1, accel=1.0)
    harness.run(1.0)
    assert harness.world.speed[harness.world.row(FIRST_EGO)] > 1.0


@pytest.fixture(scope="module")
def unchanged() -> tuple[SimHarness, Client]:
    """A simulator that none of the messages that it gets may change."""
    return two_egos()


@pytest.mark.parametrize("name", ["ego_index", *LISTS])
@pytest.mark.parametrize("length", [0, 1, 3])
def test_lists_of_different_lengths_change_nothing(
    name: str, length: int, unchanged: tuple[SimHarness, Client]
) -> None:
    harness, client = unchanged
    before = harness.world.digest()
    body = setting(0, 2, global_position_x=[50.0, 60.0])
    body[name] = (body[name] * 2)[:length]
    with pytest.raises(FieldError, match=rf"MultiEgoSetting\.{name}: expected 2 entries"):
        client.send("/ego_setting", SETTING, **body)
    assert harness.world.digest() == before


@pytest.mark.parametrize(
    ("lists", "text"),
    [
        ({"global_position_x": [0.0, None]}, "finite"),
        ({"global_position_y": [0.0, 1e300]}, "finite"),
        ({"global_yaw": [0.0, None]}, "finite"),
        ({"velocity": [0.0, 1e9]}, "speed"),
        ({"gear": [4, 7]}, "gear: expected"),
        ({"ctrl_mode": [16, 5]}, "ctrl_mode: expected"),
        ({"ego_index": [0, 0]}, "named twice"),
        ({"ego_index": [0, -1]}, "named twice"),  # the first ego has two numbers
        ({"ego_index": [0, 1]}, "expected 0, 2 or more, got 1"),
        ({"ego_index": [0, -3]}, "expected 0, 2 or more, got -3"),
    ],
)
def test_invalid_entry_changes_nothing(lists: dict[str, Any], text: str, unchanged: tuple[SimHarness, Client]) -> None:
    harness, client = unchanged
    before = harness.world.digest()
    with pytest.raises(FieldError, match=text):
        client.send("/ego_setting", SETTING, **setting(0, 2, global_position_z=[5.0, 5.0]) | lists)
    assert harness.world.digest() == before
    assert len(harness.node.egos) == 2


def test_message_without_egos_is_accepted() -> None:
    harness = SimHarness()
    before = harness.world.digest()
    put(harness.client())
    assert harness.world.digest() == before


@pytest.mark.parametrize("camera_index", [2, 77, -1])
def test_any_camera_index_is_taken_and_moves_nothing(camera_index: int) -> None:
    harness, client = two_egos()
    plain, other = two_egos()
    client.send("/ego_setting", SETTING, **setting(0) | {"camera_index": camera_index})
    other.send("/ego_setting", SETTING, **setting(0))
    assert harness.world.digest() == plain.world.digest()
    assert client.told == other.told


# Further egos


def test_new_number_adds_an_ego_with_its_own_topics_and_services() -> None:
    harness, client = two_egos()
    client.listen("/Ego_topic", "/Ego-2/Ego_topic", "/Ego-2/Object_topic", "/Ego-2/CollisionData")
    client.send("/Ego-2/ctrl_cmd", "morai_msgs/CtrlCmd", longlCmdType=1, accel=1.0)
    state = client.ask("/Ego-2/Service_MoraiEventCmd", option=6, gear=4, lamps={"turnSignal": 1, "emergencySignal": 1})
    assert (state["gear"], state["lamps"]["turnSignal"], state["lamps"]["emergencySignal"]) == (4, 1, 1)
    assert client.ask("/Service_MoraiEventCmd", option=0)["lamps"]["turnSignal"] == 0
    harness.run(2.0)
    first, second = client.messages("/Ego_topic")[-1], client.messages("/Ego-2/Ego_topic")[-1]
    assert (first["unique_id"], first["velocity"]["x"], first["accel"]) == (0, 0.0, 0.0)
    assert (second["unique_id"], second["accel"]) == (2, 1.0)
    assert second["velocity"]["x"] > 5.0
    assert second["position"]["y"] == 10.0
    assert len(client.messages("/Ego-2/Object_topic")) == len(client.messages("/Ego-2/CollisionData")) == 100
    spec = client.ask("/Service_MoraiVehicleSpec", unique_id=2)
    assert spec == client.ask("/Service_MoraiVehicleSpec", unique_id=0)
    assert spec["wheel_base"] > 0.0


def test_ego_number_may_equal_an_object_id() -> None:
    harness = SimHarness()  # objects have the ids 3, 4, 7 and 9
    client = harness.client()
    put(client, 7, global_position_x=[500.0])
    client.listen("/Ego-7/Ego_topic", "/Object_topic")
    harness.run(0.021)
    assert client.messages("/Ego-7/Ego_topic")[0]["unique_id"] == 7
    assert 7 in [npc["unique_id"] for npc in client.messages("/Object_topic")[0]["npc_list"]]


def test_synchronous_mode_is_shared_by_all_egos() -> None:
    harness, client = two_egos(start="sync")
    other = harness.client()
    started = other.ask("/Ego-2/SyncModeCmd", user_id="me", start_sync_mode=True, time_step=20)
    assert started["result"]
    assert not client.start("somebody else")["result"]
    assert other.ask("/Ego-2/SyncModeSetGear", gear=4, frame=0)["result"]
    for _ in range(10):
        command = {"longlCmdType": 1, "accel": 1.0}
        assert other.ask("/Ego-2/SyncModeCtrlCmd", frame=0, command=command)["result"]
        answer = other.ask("/Ego-2/SyncModeWaitForTick", user_id="me", frame=0)
        assert answer["tick_status"]
    assert answer["vehicle_status"]["unique_id"] == 2
    assert answer["vehicle_status"]["velocity"]["x"] > 0.0
    answer = client.tick()
    assert (answer["frame"], answer["vehicle_status"]["unique_id"]) == (11, 0)
    assert answer["vehicle_status"]["velocity"]["x"] == 0.0
    client.send("/Ego-2/ctrl_cmd", "morai_msgs/CtrlCmd", longlCmdType=1, accel=1.0)
    assert "/Ego-2/ctrl_cmd is ignored in synchronous mode: use /Ego-2/SyncModeCtrlCmd" in client.told[-1][1]


def test_touching_egos_report_each_other() -> None:
    harness, client = two_egos()
    put(client, 2, global_position_x=[-5.0])
    client.listen("/CollisionData", "/Ego-2/CollisionData", "/VehicleCollisionData")
    harness.run(0.021)
    (mine,) = client.messages("/CollisionData")[0]["collision_object"]
    (its,) = client.messages("/Ego-2/CollisionData")[0]["collision_object"]
    assert (mine["type"], mine["unique_id"]) == (-1, 2)
    assert (its["type"], its["unique_id"]) == (-1, 0)
    assert client.messages("/VehicleCollisionData")[0]["collisions"] == []


def test_scenario_that_replaces_the_ego_removes_further_egos_and_their_names() -> None:
    harness, client = two_egos(start="sync")
    client.listen("/Ego-2/Ego_topic")
    client.start()
    client.ask("/Ego-2/SyncModeCtrlCmd", frame=5, command={"longlCmdType": 1, "accel": 1.0})
    client.ask("/Ego-2/SyncModeSetGear", frame=5, gear=4)
    client.ask("/Service_MoraiSL", file_name="crowd", **ALL)
    assert [ego.index for ego in harness.node.egos] == [0]
    assert client.call("/Ego-2/SyncModeCmd", {}).is_ok is False
    for _ in range(6):
        client.tick()
    assert client.messages("/Ego-2/Ego_topic") == []
    assert any("ego 2 has been removed" in text for _, text in client.told)
    put(client, 2)
    client.tick()
    assert len(client.messages("/Ego-2/Ego_topic")) == 1


@pytest.mark.parametrize("options", [{"delete_all": False}, {"load_ego_vehicle_data": False}])
def test_other_loads_keep_the_further_egos(options: dict[str, bool]) -> None:
    harness, client = two_egos()
    assert client.ask("/Service_MoraiSL", file_name="crowd", **ALL | options)["result"]
    assert [ego.index for ego in harness.node.egos] == [0, 2]
    assert all(ego.is_there for ego in harness.node.egos)


def test_the_number_of_egos_is_bounded() -> None:
    harness = SimHarness()
    client = harness.client()
    put(client, *range(2, MAX_EGOS + 1))
    with pytest.raises(FieldError, match=f"{MAX_EGOS} egos at most"):
        put(client, MAX_EGOS + 1)
    assert len(harness.node.egos) == MAX_EGOS


def test_client_with_the_names_of_a_further_ego_does_not_block_it() -> None:
    harness = SimHarness()
    client, user = harness.client(), harness.client()
    client.send("/Ego-2/ctrl_cmd", "std_msgs/String", data="mine")
    client.send("/Ego-2/Ego_topic", "std_msgs/String", data="mine")
    client.send("/Ego-2/gps", "morai_msgs/GPSMessage")
    harness.bus.subscribe(client, "/Ego-2/imu", lambda *_: None, type_name="std_msgs/Int32")
    harness.bus.provide(client, "/Ego-2/SyncModeCmd", "std_srvs/Trigger", lambda *_: None)
    put(user, 2)
    assert [ego.index for ego in harness.node.egos] == [0, 2]
    assert sorted(client.lost) == [
        ("service", "/Ego-2/SyncModeCmd"),
        *(("topic", f"/Ego-2/{name}") for name in ("Ego_topic", "ctrl_cmd", "gps")),
    ]
    assert len(client.told) == 5
    user.listen("/Ego-2/Ego_topic")
    user.send("/Ego-2/ctrl_cmd", "morai_msgs/CtrlCmd", longlCmdType=1, accel=1.0)
    harness.run(1.0)
    assert user.messages("/Ego-2/Ego_topic")[-1]["velocity"]["x"] > 0.0


def test_topic_with_another_type_of_a_component_blocks_a_further_ego() -> None:
    class Part(Participant):
        name = "/part"

        def notify(self, level: str, text: str) -> None:
            pass

    harness = SimHarness()
    client = harness.client()
    harness.bus.advertise(Part(), "/Ego-3/ctrl_cmd", "std_msgs/String")
    before = len(harness.bus.services)
    with pytest.raises(GraphError, match="already established"):
        put(client, 2, 3)
    assert [ego.index for ego in harness.node.egos] == [0]
    assert len(harness.bus.services) == before
    assert len(harness.world.rows(Kind.EGO)) == 1
    put(client, 2)
    assert [ego.index for ego in harness.node.egos] == [0, 2]


def test_further_ego_has_the_first_egos_rate_or_its_own() -> None:
    harness, client = two_egos(network=rates({"/Ego_topic": 10.0, "/Ego-3/Ego_topic": 25.0}))
    put(client, 3)
    client.listen("/Ego-2/Ego_topic", "/Ego-3/Ego_topic", "/Ego-3/Object_topic")
    harness.run(1.0)
    names = ("/Ego-2/Ego_topic", "/Ego-3/Ego_topic", "/Ego-3/Object_topic")
    assert [len(client.messages(name)) for name in names] == [10, 25, 50]
    for name in ("/Ego-2/VehicleCollision", "/Ego-x/Ego_topic"):
        with pytest.raises(DocumentError, match=r"^publishers\..*: the simulator has no such publisher"):
            SimHarness(network=rates({name: 10.0}))
    with pytest.raises(DocumentError, match="at most 120 Hz"):
        SimHarness(network=rates({"/Ego-2/Ego_topic": 500.0}))


def test_adding_and_removing_egos_many_times_leaves_no_memory() -> None:
    harness, client = two_egos()
    client.ask("/Service_MoraiSL", file_name="parked", **ALL)
    before = (len(harness.bus.topics), len(harness.bus.services))
    for _ in range(8):
        put(client, 2, 3, 4)
        harness.run(0.06)
        client.ask("/Service_MoraiSL", file_name="parked", **ALL)
    harness.bus.expire(harness.now + 1_000.0)
    assert len(harness.bus.services) == before[1]
    assert len(harness.bus.topics) <= before[0]


def test_list_longer_than_the_ego_limit_is_refused_before_it_is_read() -> None:
    harness = SimHarness()
    with pytest.raises(FieldError, match=f"there are {MAX_EGOS} egos at most, got {MAX_EGOS + 1} entries"):
        put(harness.client(), *[7] * (MAX_EGOS + 1))
    assert len(harness.node.egos) == 1


# Who has left


def test_services_of_a_removed_ego_are_remembered_until_it_returns() -> None:
    harness, client = two_egos()
    name = "/Ego-2/Service_MoraiEventCmd"
    assert name in harness.bus.services
    assert not harness.node.context.ego_interfaces.why_gone(name)
    harness.node.reset(None, 0.0)
    assert name not in harness.bus.services
    assert harness.node.context.ego_interfaces.why_gone(name) == "ego 2 has left"
    assert not harness.node.context.ego_interfaces.why_gone("/Service_MoraiEventCmd")
    assert not harness.node.context.ego_interfaces.why_gone("/Ego-3/Service_MoraiEventCmd")
    put(client, 2)
    assert not harness.node.context.ego_interfaces.why_gone(name)


def test_services_of_an_ego_that_leaves_and_returns_are_never_reported_as_unknown() -> None:
    harness, client = two_egos()
    names = [name for name in harness.bus.services if name.startswith("/Ego-2/")]
    lost: list[str] = []

    def look(_owner: Participant) -> None:
        lost.extend(
            name
            for name in names
            if name not in harness.bus.services and not harness.node.context.ego_interfaces.why_gone(name)
        )

    harness.bus.on_holdings.append(look)
    harness.node.reset(None, 0.0)
    put(client, 2)
    assert names
    assert not lost


def test_remembered_ego_numbers_are_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("rosbridge_sim.simulator.kernel.ego_interfaces.MAX_GONE", 3)
    harness, client = two_egos()
    for index in range(10, 20):
        harness.node.reset(None, 0.0)
        put(client, index)
    harness.node.reset(None, 0.0)
    gone = [
        harness.node.context.ego_interfaces.why_gone(f"/Ego-{index}/Service_MoraiEventCmd") for index in range(10, 20)
    ]
    assert [bool(text) for text in gone] == [False] * 9 + [True], "the last one has three services, and three are kept"
    assert harness.node.context.ego_interfaces.why_gone("/Ego-19/Service_MoraiEventCmd")
    assert not harness.node.context.ego_interfaces.why_gone("/Ego-10/Service_MoraiEventCmd")
