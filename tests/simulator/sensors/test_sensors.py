from __future__ import annotations

import math
from typing import Any

import pytest
from pyproj import Proj

from rosbridge_sim.errors import FieldError
from rosbridge_sim.maps.mgeo import NO_PROJECTION
from rosbridge_sim.records import replace
from rosbridge_sim.world.state import placement
from rosbridge_sim.world.state.entity_types import GRAVITY
from rosbridge_sim.world.vehicle.sensor_readings import Mounting, feel
from tests.simulator.sim_harness import ALL, Client, SimHarness, rates

FIELDS = ("pose_x", "pose_y", "pose_z", "roll", "pitch", "yaw")
UTM = Proj(proj="utm", zone=52, ellps="WGS84")


def in_sync(**settings: Any) -> tuple[SimHarness, Client]:  # noqa: ANN401 - NodeSettings' own fields
    harness = SimHarness(start="sync", **settings)
    client = harness.client()
    client.start()
    return harness, client


def move(client: Client, *sensors: tuple[float, ...], topic: str = "/SensorPosControl") -> None:
    """Publish a SensorPosControl of (index, x, y, z, roll, pitch, yaw), what is left out being 0."""
    rows = [(*sensor, *[0.0] * (7 - len(sensor))) for sensor in sensors]
    columns = {name: [row[i] for row in rows] for i, name in enumerate(("sensor_index", *FIELDS))}
    client.send(topic, "morai_msgs/SensorPosControl", **columns)


def last(client: Client, topic: str) -> dict[str, Any]:
    return client.messages(topic)[-1]


def on_map(gps: dict[str, Any]) -> tuple[float, float]:
    """What clients make of a GPSMessage: the place on the map."""
    east, north = UTM(gps["longitude"], gps["latitude"])
    return east - gps["eastOffset"], north - gps["northOffset"]


# What they tell


def test_projected_gps_minus_offsets_equals_the_ego_position() -> None:
    _, client = in_sync()
    client.listen("/gps", "/Ego_topic")
    client.control(1, longlCmdType=2, velocity=60.0, steering=0.2)
    for _ in range(100):
        client.tick()
    fixes, egos = client.messages("/gps"), client.messages("/Ego_topic")
    assert len(fixes) == len(egos) == 100
    for i, (gps, ego) in enumerate(zip(fixes, egos, strict=True), start=1):
        place = ego["position"]
        assert on_map(gps) == pytest.approx((place["x"], place["y"]), abs=1e-4)
        assert (gps["altitude"], gps["status"]) == (place["z"] + 5.0, 1)
        assert (gps["eastOffset"], gps["northOffset"]) == (300.0, 400.0)
        assert (gps["header"]["seq"], gps["header"]["frame_id"]) == (i, "gps_link")
        assert gps["header"]["stamp"] == ego["header"]["stamp"]
    assert math.dist(on_map(fixes[0]), on_map(fixes[-1])) > 5.0


def test_map_without_georeference_gives_no_fix(caplog: pytest.LogCaptureFixture) -> None:
    harness, client = in_sync()
    harness.node.scene.road_map = replace(harness.node.scene.road_map, projection=NO_PROJECTION)
    client.listen("/gps")
    client.tick()
    gps = last(client, "/gps")
    assert (gps["latitude"], gps["longitude"], gps["status"]) == (0.0, 0.0, 0)
    assert not any("no GPS" in record.message for record in caplog.records), "the map's notes tell it"


def test_map_without_a_usable_projection_gives_no_fix(caplog: pytest.LogCaptureFixture) -> None:
    harness, client = in_sync()
    road_map = harness.node.scene.road_map
    harness.node.scene.road_map = replace(road_map, projection=replace(road_map.projection, ellipse="bogus"))
    client.listen("/gps")
    for _ in range(3):
        client.tick()
    gps = last(client, "/gps")
    assert (gps["latitude"], gps["longitude"], gps["status"]) == (0.0, 0.0, 0)
    assert sum("no GPS" in record.message for record in caplog.records) == 1


def test_imu_gives_heading_yaw_rate_and_gravity() -> None:
    harness, client = in_sync()
    client.listen("/imu", "/Ego_topic")
    client.control(1, longlCmdType=1, accel=0.8, steering=0.3)
    for _ in range(60):
        client.tick()
    imu, ego = last(client, "/imu"), last(client, "/Ego_topic")
    half = math.radians(ego["heading"]) / 2
    assert imu["orientation"] == pytest.approx({"x": 0.0, "y": 0.0, "z": math.sin(half), "w": math.cos(half)})
    assert imu["angular_velocity"] == {"x": 0.0, "y": 0.0, "z": harness.world.yaw_rate.item(harness.world.row(0))}
    assert imu["angular_velocity"]["z"] > 0.2
    assert imu["linear_acceleration"] == pytest.approx(
        {"x": ego["acceleration"]["x"], "y": ego["acceleration"]["y"], "z": GRAVITY}, abs=1e-12
    )
    assert imu["header"]["frame_id"] == "imu_link"
    assert imu["orientation_covariance"] == [0.0] * 9


def test_sensors_publish_at_50_hz_or_the_chosen_rate_in_real_time() -> None:
    harness = SimHarness(network=rates({"/gps": 5.0, "/imu": 100.0}))
    client = harness.client()
    client.listen("/gps", "/imu")
    harness.run(1.01)
    assert (len(client.messages("/gps")), len(client.messages("/imu"))) == (5, 100)


def test_sensors_keep_their_rate_in_simulated_time_in_synchronous_mode() -> None:
    _, client = in_sync(network=rates({"/gps": 5.0}))
    client.listen("/gps", "/imu", "/Ego_topic")
    for _ in range(40):
        client.tick()
    assert [message["header"]["seq"] for message in client.messages("/gps")] == list(range(10, 41, 10))
    assert len(client.messages("/imu")) == len(client.messages("/Ego_topic")) == 40


# /SensorPosControl


def test_moved_antenna_changes_fixes_and_tf_static() -> None:
    _, client = in_sync()
    client.listen("/gps", "/tf_static")
    move(client, (0, 1.5, -0.5, 1.75))
    (message,) = client.messages("/tf_static")
    poses = {t["child_frame_id"]: (t["header"]["frame_id"], t["transform"]) for t in message["transforms"]}
    parent, pose = poses["gps_link"]
    assert (parent, pose["translation"]) == ("base_link", {"x": 1.5, "y": -0.5, "z": 1.75})
    assert poses["imu_link"][1]["translation"] == {"x": 0.0, "y": 0.0, "z": 0.0}
    client.tick()
    assert on_map(last(client, "/gps")) == pytest.approx((10.5, 21.5), abs=1e-4)  # it looks north
    assert last(client, "/gps")["altitude"] == 6.75


def test_moved_imu_measures_at_its_new_position() -> None:
    harness, client = in_sync()
    client.listen("/imu", "/tf_static")
    move(client, (1, 2.0, 0.5, 1.0, 0.1, -0.2, 0.75))
    client.control(1, longlCmdType=2, velocity=40.0, steering=0.3)
    for _ in range(50):
        client.tick()
    reading = feel(harness.world, harness.world.row(0), Mounting(2.0, 0.5, 1.0, 0.1, -0.2, 0.75))
    imu = last(client, "/imu")
    assert tuple(imu["orientation"].values()) == reading.orientation
    assert tuple(imu["angular_velocity"].values()) == reading.angular_velocity
    assert tuple(imu["linear_acceleration"].values()) == reading.acceleration
    assert len(client.messages("/tf_static")) == 1


def test_several_sensors_or_one_without_a_list_can_be_moved() -> None:
    harness, client = in_sync()
    move(client, (1, 0.5), (0, 1.0))
    assert harness.node.egos[0].mountings == {"gps_link": Mounting(1.0), "imu_link": Mounting(0.5)}
    scalars = dict.fromkeys(FIELDS, 0.25)
    client.send("/SensorPosControl", "morai_msgs/SensorPosControl", sensor_index=1, **scalars)
    assert harness.node.egos[0].mountings["imu_link"] == Mounting(*[0.25] * 6)
    client.send("/SensorPosControl", "morai_msgs/SensorPosControl")  # none at all
    assert client.told == []


@pytest.mark.parametrize(
    ("sensors", "why"),
    [
        ([(0, 1.0), (2, 1.0)], r"sensor_index: expected 0 \(gps_link\), 1 \(imu_link\), got 2"),
        ([(0, 1.0), (-1, 1.0)], "got -1"),
        ([(0, 1.0), (0, 2.0)], "sensor_index: 0 is named twice"),
        ([(0, 1.0), (1, 100.5)], r"SensorPosControl\[1\]: expected a place within \+-100 m"),
        ([(0, 1.0, float("nan"))], "expected a place"),
        ([(0, 1.0, 0.0, 0.0, float("inf"))], "expected finite angles"),
    ],
)
def test_one_invalid_sensor_moves_none(sensors: list[tuple[float, ...]], why: str) -> None:
    harness, client = in_sync()
    with pytest.raises(FieldError, match=why):
        move(client, *sensors)
    assert set(harness.node.egos[0].mountings.values()) == {Mounting()}


def test_lists_of_different_lengths_move_nothing() -> None:
    harness, client = in_sync()
    lists = {name: [0.5] for name in FIELDS}
    with pytest.raises(FieldError, match=r"SensorPosControl.yaw: expected 1 entries as sensor_index has, got 2"):
        client.send(
            "/SensorPosControl", "morai_msgs/SensorPosControl", sensor_index=[0], **(lists | {"yaw": [0.5, 0.5]})
        )
    with pytest.raises(FieldError, match="pose_x: expected 2 entries"):
        client.send("/SensorPosControl", "morai_msgs/SensorPosControl", sensor_index=[0, 1], **lists)
    assert set(harness.node.egos[0].mountings.values()) == {Mounting()}


def test_sensors_stay_where_they_are_when_a_scenario_is_loaded_and_go_back_at_a_reset() -> None:
    harness, client = in_sync()
    move(client, (0, 1.0))
    client.ask("/Service_MoraiSL", file_name="parked", **ALL)
    assert harness.node.egos[0].mountings["gps_link"] == Mounting(1.0)
    client.listen("/tf_static")
    assert client.call("/sim/reset", {"seed": -1}).is_ok
    assert harness.node.egos[0].mountings["gps_link"] == Mounting()
    assert last(client, "/tf_static")["transforms"][1]["transform"]["translation"]["x"] == 0.0


# Further egos


def bring_ego_2(client: Client) -> None:
    arrays = {name: [0.0] for name in ("global_position_z", "global_roll", "global_pitch", "global_yaw", "velocity")}
    client.send(
        "/ego_setting",
        "morai_msgs/MultiEgoSetting",
        number_of_ego_vehicle=1,
        camera_index=0,
        ego_index=[2],
        global_position_x=[50.0],
        global_position_y=[60.0],
        gear=[4],
        ctrl_mode=[16],
        **arrays,
    )


def test_further_ego_has_its_own_sensors() -> None:
    harness, client = in_sync()
    bring_ego_2(client)
    client.listen("/Ego-2/gps", "/Ego-2/imu", "/gps")
    move(client, (0, 2.0), topic="/Ego-2/SensorPosControl")
    client.tick()
    assert on_map(last(client, "/Ego-2/gps")) == pytest.approx((52.0, 60.0), abs=1e-4)
    assert on_map(last(client, "/gps")) == pytest.approx((10.0, 20.0), abs=1e-4)
    assert last(client, "/Ego-2/gps")["header"]["frame_id"] == "Ego-2/gps_link"
    assert last(client, "/Ego-2/imu")["header"]["frame_id"] == "Ego-2/imu_link"
    client.send("/Ego-2/SaveSensorData", "morai_msgs/SaveSensorData")
    assert client.ask("/Ego-2/SyncModeCtrlCmd", frame=0, command={}, sensor_capture=True)["result"] is True
    client.tick()
    for _, _, files in harness.drawer.saved:
        assert list(files) == ["Ego-2/GPS_{}.csv", "Ego-2/IMU_{}.csv", "Ego-2/BOXES_{}.txt"]
    assert [name for _, name, _ in harness.drawer.saved] == ["frame_000001", "frame_000002"]


# /SaveSensorData and sensor_capture


def read_csv(text: str) -> dict[str, float]:
    names, values, nothing = text.split("\n")
    assert nothing == ""
    return dict(zip(names.split(","), map(float, values.split(",")), strict=True))


@pytest.mark.parametrize("release", ["22.R2", "26.R1"])
def test_saved_data_equals_the_topics_of_its_frame(release: str) -> None:
    harness, client = in_sync(release=release)
    client.listen("/gps", "/imu")
    assert client.control(1, longlCmdType=1, accel=0.8, steering=0.3)
    for _ in range(7):
        client.tick()
    client.send(
        "/SaveSensorData",
        "morai_msgs/SaveSensorData",
        is_custom_file_name=True,
        custom_file_name="shot",
        file_dir="runs",
    )
    ((folder, name, files),) = harness.drawer.saved
    assert (folder, name) == ("runs", "shot")
    gps, imu = last(client, "/gps"), last(client, "/imu")
    header = {"frame": 7.0, "time": 0.14}
    fields = ("latitude", "longitude", "altitude", "eastOffset", "northOffset", "status")
    assert read_csv(files["GPS_{}.csv"]) == header | {field: gps[field] for field in fields}
    parts = ("orientation", "angular_velocity", "linear_acceleration")
    figures = {f"{part}_{axis}": imu[part][axis] for part in parts for axis in imu[part]}
    assert read_csv(files["IMU_{}.csv"]) == header | figures


def test_box_file_has_one_line_per_object_with_all_values() -> None:
    harness, client = in_sync()  # the ego stands at (10, 20) and looks north
    placement.teleport(harness.world, harness.world.row(7), x=0.0, y=60.0, z=1.0, yaw=math.radians(135), speed=10.0)
    bring_ego_2(client)
    client.send("/SaveSensorData", "morai_msgs/SaveSensorData")
    ((_, _, files),) = harness.drawer.saved
    lines = [line.split(" ") for line in files["BOXES_{}.txt"].splitlines()]
    by_id = {int(line[-1]): [float(figure) for figure in line[:-1]] for line in lines}
    middle = (4.47 / 2 - 0.89) / math.sqrt(2)
    x, y = 40.0 + middle, 10.0 + middle
    height = 1.0 + 1.45 / 2
    assert by_id[7] == pytest.approx(
        [0, x, y, height, 4.47, 1.82, 1.45, 45.0, math.hypot(x, y, height), 10.0], abs=1e-4
    )
    assert {uid: figures[0] for uid, figures in by_id.items() if uid in {2, 9, 3, 4}} == {2: 0, 9: 1, 3: 2, 4: 2}
    distances = [float(line[8]) for line in lines]
    assert distances == sorted(distances)
    assert len(lines) == len(harness.world) - 1


def test_box_file_without_objects_is_empty() -> None:
    harness = SimHarness("parked")
    harness.client().send("/SaveSensorData", "morai_msgs/SaveSensorData")
    ((folder, name, files),) = harness.drawer.saved
    assert (folder, name, files["BOXES_{}.txt"]) == ("", "frame_000000", "")


def test_saved_data_is_of_the_frame_of_its_command() -> None:
    harness, client = in_sync()
    client.listen("/Ego_topic")
    command = {"longlCmdType": 2, "velocity": 30.0}
    assert client.ask("/SyncModeCtrlCmd", frame=3, command=command, sensor_capture=True)["result"] is True
    for frame in range(1, 6):
        assert [name for _, name, _ in harness.drawer.saved] == (["frame_000003"] if frame > 3 else [])
        client.tick()
    x = [message["position"]["y"] for message in client.messages("/Ego_topic")]
    gps = read_csv(harness.drawer.saved[0][2]["GPS_{}.csv"])
    assert on_map(gps)[1] == pytest.approx(x[2], abs=1e-4)
    assert x[1] == 20.0 < x[2], "the first frame in which the command shows"


def test_several_saves_in_one_tick_are_of_their_own_frames() -> None:
    harness, client = in_sync()
    client.start(time_step=100)
    for frame in (2, 4):
        client.ask("/SyncModeCtrlCmd", frame=frame, command={}, sensor_capture=True)
    client.tick()
    assert [name for _, name, _ in harness.drawer.saved] == ["frame_000002", "frame_000004"]


def test_refused_or_dropped_save_command_writes_nothing() -> None:
    harness, client = in_sync()
    assert client.ask("/SyncModeCtrlCmd", frame=1, command={"longlCmdType": 9}, sensor_capture=True)["result"] is False
    assert client.ask("/SyncModeCtrlCmd", frame=5, command={}, sensor_capture=True)["result"] is True
    client.stop()
    assert client.ask("/SyncModeCtrlCmd", frame=1, command={}, sensor_capture=True)["result"] is False
    harness.run(0.2)
    assert harness.drawer.saved == []


def test_save_for_a_removed_ego_writes_nothing() -> None:
    harness, client = in_sync()
    bring_ego_2(client)
    assert client.ask("/Ego-2/SyncModeCtrlCmd", frame=3, command={}, sensor_capture=True)["result"] is True
    client.ask("/Service_MoraiSL", file_name="crowd", **ALL)
    for _ in range(4):
        client.tick()
    assert (harness.drawer.saved, client.told) == ([], [])


def test_failed_save_is_reported_to_its_caller() -> None:
    harness, client = in_sync()
    harness.drawer.refusal = "the disk is full"
    with pytest.raises(FieldError, match=r"^morai_msgs/SaveSensorData: the disk is full$"):
        client.send("/SaveSensorData", "morai_msgs/SaveSensorData")
    client.ask("/SyncModeCtrlCmd", frame=0, command={}, sensor_capture=True)
    assert client.tick()["tick_status"] is True
    assert client.told == [("error", "sensor_capture: the disk is full")]


def test_custom_file_name_must_be_valid() -> None:
    harness, client = in_sync()
    with pytest.raises(FieldError, match="custom_file_name: expected a name"):
        client.send("/SaveSensorData", "morai_msgs/SaveSensorData", is_custom_file_name=True)
    client.send("/SaveSensorData", "morai_msgs/SaveSensorData", custom_file_name="unwanted")
    assert [name for _, name, _ in harness.drawer.saved] == ["frame_000000"]


# What it costs


def test_sensors_compute_nothing_without_subscribers(monkeypatch: pytest.MonkeyPatch) -> None:
    harness, client = in_sync()

    def fail(*_args: object) -> None:
        raise AssertionError("made for nobody")

    for name in ("sensors.gps.locate", "sensors.imu.feel", "sensor_services.sensor_commands.find_boxes"):
        monkeypatch.setattr(f"rosbridge_sim.simulator.{name}", fail)
    client.listen("/Ego_topic")
    client.tick()
    assert len(client.messages("/Ego_topic")) == 1
    assert harness.node.context.hooks.once_after_frame == []
