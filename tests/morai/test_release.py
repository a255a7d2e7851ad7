"""Differences of the newer release; everything else is tested with the older one."""

from __future__ import annotations

import math
from typing import Any

import pytest

from rosbridge_sim.morai.messages.convert import Converter
from rosbridge_sim.morai.releases import FIELD, MANUAL, RELEASES, SPEED_LIMITS, advise_release, choose_profile
from rosbridge_sim.world.roads.roads import Roads
from rosbridge_sim.world.state.world import Body, Dynamics, Kind, World
from tests.graph.bus_fixture import Wire
from tests.simulator.sim_harness import ALL, Client, SimHarness, make_store

NEWER = "26.R1"
WHEELS = ("fl", "fr", "rl", "rr")


def in_sync(scenario: str = "crowd") -> tuple[SimHarness, Client]:
    harness = SimHarness(scenario, release=NEWER, start="sync")
    client = harness.client()
    client.start()
    return harness, client


def test_steering_has_its_new_name_and_accepts_the_old_one() -> None:
    for name in ("front_steer", "steering"):
        _, client = in_sync("parked")
        client.control(0, longlCmdType=1, rear_steer=0.3, **{name: 0.2})
        for _ in range(50):
            status = client.tick()["vehicle_status"]
        assert status["front_steer_angle"] == pytest.approx(math.degrees(0.2), rel=1e-6)
        assert status["rear_steer_angle"] == 0.0
        assert "wheel_angle" not in status


def test_ego_status_has_the_position_on_its_lane() -> None:
    harness, client = in_sync("elsewhere")  # a lane north from (0, 0), 3.5 m wide
    client.listen("/Ego_topic")
    setting: dict[str, Any] = {
        "number_of_ego_vehicle": 1,
        "ego_index": [0],
        "global_position_x": [-0.5],
        "global_position_y": [40.0],
        "global_position_z": [0.0],
        "global_yaw": [90.0],
        **{name: [0.0] for name in ("global_roll", "global_pitch", "velocity")},
        "gear": [4],
        "ctrl_mode": [16],
    }
    client.send("/ego_setting", "morai_msgs/MultiEgoSetting", **setting)
    status = client.tick()["vehicle_status"]
    assert status["lateral_offset"] == 0.5
    assert status["cross_track_error"] == -0.5
    assert status["distance_left_lane_boundary"] == 1.25
    assert status["distance_right_lane_boundary"] == 2.25
    for wheel in WHEELS:
        for name in ("tire_lateral_force", "side_slip_angle", "tire_cornering_stiffness"):
            assert status[f"{name}_{wheel}"] == 0.0
    assert client.messages("/Ego_topic") == [status]
    assert harness.node.egos[0].status() is harness.node.egos[0].status()


def test_tyres_and_rear_wheels_are_reported_in_their_units() -> None:
    harness = SimHarness("parked", release=NEWER, start="sync", dynamics=Dynamics.SINGLE_TRACK)
    client = harness.client()
    client.start()
    client.control(0, longlCmdType=2, velocity=30.0, front_steer=0.05, rear_steer=-0.02)
    for _ in range(500):
        status = client.tick()["vehicle_status"]
    body = harness.world.bodies[0]
    assert status["rear_steer_angle"] == pytest.approx(math.degrees(-0.02), rel=1e-6)
    assert status["velocity"]["y"] == pytest.approx(harness.world.lateral_speed.item(0))
    for side in "lr":
        assert -5.0 < status[f"side_slip_angle_f{side}"] < -0.1
        force, slip = status[f"tire_lateral_force_f{side}"], status[f"side_slip_angle_f{side}"]
        stiffness = status[f"tire_cornering_stiffness_f{side}"]
        assert stiffness == pytest.approx(math.radians(0.5 * body.mass * 9.80665 * body.front_load * 14.0), rel=1e-3)
        assert force == pytest.approx(-stiffness * slip, rel=0.1)
        assert status[f"tire_lateral_force_r{side}"] > 100.0
    client.control(0, longlCmdType=1, rear_steer=math.inf)
    assert client.tick()["vehicle_status"]["rear_steer_angle"] == pytest.approx(math.degrees(-0.02), rel=1e-6)


def test_lane_fields_are_0_off_the_road() -> None:
    world = World()
    row = world.row(world.spawn(Kind.EGO, Body(), name="ego", x=0.0, y=0.0))
    for roads in (None, Roads()):
        status = Converter(make_store(NEWER)).ego_vehicle_status(world, row, 0, roads)
        assert status.lateral_offset == status.distance_left_lane_boundary == status.cross_track_error == 0.0


def test_ego_setting_has_optional_lamps_and_steering() -> None:
    harness, client = in_sync("parked")
    common: dict[str, Any] = {
        "number_of_ego_vehicle": 1,
        "ego_index": [0],
        "gear": [4],
        "ctrl_mode": [16],
        **{f"global_position_{axis}": [0.0] for axis in "xyz"},
        **{f"global_{angle}": [0.0] for angle in ("roll", "pitch", "yaw")},
        "velocity": [0.0],
    }
    client.send("/ego_setting", "morai_msgs/MultiEgoSetting", **common, steering_angle=[10.0], turn_signal=[3])
    assert client.ask("/Service_MoraiEventCmd", option=0)["lamps"]["emergencySignal"] == 1
    assert harness.world.steer[harness.node.egos[0].row] == pytest.approx(math.radians(10.0))
    client.send("/ego_setting", "morai_msgs/MultiEgoSetting", **common)
    assert client.ask("/Service_MoraiEventCmd", option=0)["lamps"]["emergencySignal"] == 1


def test_newer_release_adds_and_removes_objects_by_services_only() -> None:
    harness, client = in_sync("empty")
    place = {"name": "Bus", "position": {"x": 40.0, "y": 5.0, "z": 0.0}, "heading": 90.0}
    assert client.ask("/SyncModeAddObject", frame=2, **place) == {"result": True}
    client.listen("/Object_topic")
    client.tick()
    client.tick()
    npcs = [message["npc_list"] for message in client.messages("/Object_topic")]
    assert [len(each) for each in npcs] == [0, 1]
    assert (npcs[1][0]["name"], npcs[1][0]["heading"]) == ("Bus", 90.0)
    uid = npcs[1][0]["unique_id"]
    assert client.ask("/SyncModeRemoveObject", unique_id=uid, frame=0) == {"result": True}
    assert client.ask("/SyncModeRemoveObject", unique_id=12345, frame=0) == {"result": True}
    client.tick()
    assert client.messages("/Object_topic")[-1]["num_of_npcs"] == 0
    assert client.told[-1] == ("error", "/SyncModeRemoveObject: unique_id 12345: there is no such object")
    assert client.ask("/SyncModeAddObject", name="Zeppelin", frame=0) == {"result": False}
    assert client.told[-1][1].startswith("/SyncModeAddObject: the catalogue has no model 'Zeppelin'")
    assert harness.bus.find_topic("/SyncModeAddObj") is None
    client.stop()
    assert client.ask("/SyncModeAddObject", frame=0, **place) == {"result": False}


def test_older_release_adds_and_removes_objects_by_topics_only() -> None:
    harness = SimHarness()
    assert harness.bus.find_topic("/SyncModeAddObj") is not None
    assert not [name for name in harness.bus.services if name.endswith("Object")]


def test_collided_objects_are_given_under_both_names() -> None:
    _, client = in_sync("empty")
    client.listen("/CollisionData")
    client.ask("/SyncModeAddObject", name="Box", position={"x": 1.0, "y": 0.0, "z": 0.0}, frame=0)
    client.tick()
    (hit,) = client.messages("/CollisionData")
    assert len(hit["collision_object"]) == 1
    assert hit["collision_objecta"] == hit["collision_object"]


def test_newer_release_lists_the_20_nearest_objects() -> None:
    assert RELEASES["22.R2"] == MANUAL == choose_profile("manual")
    assert choose_profile("manual", NEWER).object_limit == 20
    assert choose_profile("manual", NEWER, object_limit=0) == MANUAL
    assert choose_profile("field", NEWER) == FIELD


def test_speed_mode_limits_hold_for_all_egos_and_after_a_load() -> None:
    harness = SimHarness(release=NEWER, start="sync", speed_limits=SPEED_LIMITS[NEWER])
    client = harness.client()
    client.start()

    def changes(wish: float) -> list[float]:
        """How the two egos' speeds change in half a second [m/s^2]."""
        before = [float(harness.world.speed[ego.row]) for ego in harness.node.egos]
        for prefix in ("", "/Ego-2"):
            client.ask(f"{prefix}/SyncModeCtrlCmd", frame=0, command={"longlCmdType": 2, "velocity": wish})
        for _ in range(25):
            client.tick()
        return [
            2.0 * (float(harness.world.speed[e.row]) - was) for e, was in zip(harness.node.egos, before, strict=True)
        ]

    zeros = ("global_position_y", "global_position_z", "global_yaw", "global_roll", "global_pitch", "velocity")
    lists: dict[str, Any] = {name: [0.0] for name in zeros} | {"global_position_x": [200.0], "gear": [4]}
    setting = {"number_of_ego_vehicle": 1, "ego_index": [2], "ctrl_mode": [16], **lists}
    client.send("/ego_setting", "morai_msgs/MultiEgoSetting", **setting)
    assert changes(90.0) == pytest.approx([1.0, 1.0])
    changes(90.0)
    changes(90.0)
    changes(90.0)
    assert changes(0.0) == pytest.approx([-2.0, -2.0])
    keep = ALL | {"delete_all": False}
    assert client.ask("/Service_MoraiSL", file_name="crowd", **keep)["result"]
    assert changes(90.0)[0] == pytest.approx(1.0)


def test_names_of_another_release_are_refused_with_that_release() -> None:
    older, newer = Wire(SimHarness().bus), Wire(SimHarness(release=NEWER).bus)
    (answer,) = older.says(op="call_service", service="/SyncModeAddObject", args={})
    assert answer["values"] == (
        "Service /SyncModeAddObject does not exist; only release 26.R1 has it (serve --release 26.R1),"
        " here it is the topic /SyncModeAddObj"
    )
    (status,) = newer.says(op="publish", topic="/SyncModeAddObj", msg={})
    assert status["msg"].endswith(
        "; only release 22.R2 has it (serve --release 22.R2), here it is the service /SyncModeAddObject"
    )
    for name in ("morai_msgs/SyncModeAddObject", "morai_msgs/msg/SyncModeAddObject"):
        (status,) = older.says(op="advertise", topic="/x", type=name)
        assert status["msg"].endswith("; only release 26.R1 has it (serve --release 26.R1)")
    (answer,) = older.says(op="call_service", service="/SyncModeAddObjekt", args={})
    assert "release" not in answer["values"]


def test_item_of_this_release_under_another_name_is_not_sent_to_another_release() -> None:
    bus = SimHarness(release=NEWER, network={"services": {"/SyncModeAddObject": {"name": "/add"}}}).bus
    (answer,) = Wire(bus).says(op="call_service", service="/SyncModeAddObject", args={})
    assert "release" not in answer["values"]


def test_types_of_one_release_alone_are_listed() -> None:
    older, newer = (set(make_store(release).names("msg") + make_store(release).names("srv")) for release in RELEASES)
    for name in older | newer:
        only = "22.R2" if name not in newer else "26.R1" if name not in older else ""
        assert advise_release(name) == (f"; only release {only} has it (serve --release {only})" if only else "")


@pytest.mark.parametrize(
    ("release", "kind", "field", "end"),
    [
        ("22.R2", "MultiEgoSetting", "steering_angle", "field steering_angle; only release 26.R1 has it"),
        ("22.R2", "MultiEgoSetting", "steering_angel", "(did you mean steering_angle?); only release 26.R1 has it"),
        ("22.R2", "MultiEgoSetting", "velocty", "(did you mean velocity?); it has"),
        ("22.R2", "CtrlCmd", "rear_steer", "field rear_steer; only release 26.R1 has it"),
        ("26.R1", "EgoVehicleStatus", "wheel_angle", "field wheel_angle; only release 22.R2 has it"),
    ],
)
def test_field_of_another_release_is_refused_with_that_release(release: str, kind: str, field: str, end: str) -> None:
    wire = Wire(SimHarness(release=release).bus)
    (status,) = wire.says(op="publish", topic="/x", type=f"morai_msgs/{kind}", msg={field: 1})
    assert end in status["msg"]


def test_field_of_another_release_is_named_inside_other_messages() -> None:
    wire = Wire(SimHarness(release="22.R2").bus)
    msg = {"vehicle_status": {"lateral_offset": 1}}
    (status,) = wire.says(op="publish", topic="/x", type="morai_msgs/WaitForTickResponse", msg=msg)
    assert "lateral_offset; only release 26.R1 has it (serve --release 26.R1); " in status["msg"]


def test_fields_of_one_release_alone_are_listed() -> None:
    older, newer = (make_store(release) for release in RELEASES)
    num_listed = 0
    for name in {*older.names("msg")} & {*newer.names("msg")}:
        if not name.startswith("morai_msgs/"):
            continue
        for store, other, release in ((older, newer, "26.R1"), (newer, older, "22.R2")):
            spec = store.message(name).spec
            only = other.message(name).spec.fields.keys() - spec.fields.keys() - spec.aliases.keys()
            listed = {field for field, text in spec.elsewhere.items() if release in text}
            assert listed == only
            num_listed += len(listed)
    assert num_listed > 20
