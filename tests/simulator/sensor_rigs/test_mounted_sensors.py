from __future__ import annotations

import base64
import json
import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pytest

from rosbridge_sim.errors import DocumentError, FieldError
from rosbridge_sim.graph.topics_services import Answer
from rosbridge_sim.scenery.pictures import EXTINCTION, Weather
from rosbridge_sim.schema.definitions.names import Generation
from rosbridge_sim.simulator.sensor_data.lidar_sweep import POINT_TYPE, Echoes, fade
from rosbridge_sim.simulator.sensor_rigs.mounted_sensors import MountedSensors
from rosbridge_sim.simulator.sensors.camera_sensor import CameraSpec
from rosbridge_sim.simulator.sensors.gps import GpsSpec
from rosbridge_sim.simulator.sensors.imu import ImuSpec
from rosbridge_sim.simulator.sensors.lidar_2d import Lidar2dSpec
from rosbridge_sim.simulator.sensors.lidar_3d import Lidar3dSpec
from rosbridge_sim.simulator.sensors.radar import RadarSpec
from rosbridge_sim.world.geometry.planar import rotate
from tests.simulator.sensors.analytic_makers import AtOnceWorker, ManualWorker
from tests.simulator.sim_harness import ALL, Client, SimHarness, put_egos, rates

CAMERA = CameraSpec(width=32, height=24, x=1.8, z=2.0, pitch=7.0)
LIDAR = Lidar3dSpec(columns=36, x=2.0, z=1.25)
SCAN = Lidar2dSpec(x=3.8, z=0.5, num_values=36, ahead=18)
RADAR = RadarSpec(x=3.8, z=0.5)
IMAGE, POINTS = "/image_jpeg/compressed", "/lidar3D"


def in_sync(*rig: Any, worker: Any = None, **settings: Any) -> tuple[SimHarness, Client]:  # noqa: ANN401 - as SimHarness
    harness = SimHarness(start="sync", sensors=rig, worker=worker or AtOnceWorker(), **settings)
    client = harness.client()
    client.start(time_step=settings.get("time_step", 20))
    return harness, client


def begin_tick(harness: SimHarness, client: Client, **request: Any) -> list[Answer]:  # noqa: ANN401 - fields
    """Ask for a tick whose answer may come later."""
    answers: list[Answer] = []
    args = {"request": {"user_id": "me", "frame": 0, **request}}
    harness.bus.call(client, "/SyncModeWaitForTick", args, answers.append, now=0.0)
    return answers


def sensors(client: Client, **request: Any) -> dict[str, Any]:  # noqa: ANN401 - fields
    answer = client.call("/sim/sensors", request)
    assert answer.is_ok, answer.values
    response: dict[str, Any] = json.loads(answer.values.json)  # type: ignore[attr-defined]
    return {**response, "mounted": response["sensors"][2:]}  # behind GPS and IMU


def points(message: dict[str, Any]) -> Any:  # noqa: ANN401 - a structured array
    return np.frombuffer(base64.b64decode(message["data"]), dtype=POINT_TYPE)


# Messages


def test_camera_publishes_at_30_hz_with_the_stamp_of_the_frame() -> None:
    _, client = in_sync(CAMERA)
    client.listen(IMAGE)
    for _ in range(10):
        client.tick()
    headers = [message["header"] for message in client.messages(IMAGE)]
    assert [header["seq"] for header in headers] == [2, 4, 5, 7, 9, 10]
    assert [header["stamp"]["nsecs"] for header in headers] == [20_000_000 * i for i in (2, 4, 5, 7, 9, 10)]
    assert {header["frame_id"] for header in headers} == {"Camera"}
    assert {message["format"] for message in client.messages(IMAGE)} == {"jpeg"}


def test_rate_of_the_settings_is_that_of_the_camera() -> None:
    _, client = in_sync(CAMERA, network=rates({IMAGE: 10}))
    client.listen(IMAGE)
    for _ in range(10):
        client.tick()
    assert [message["header"]["seq"] for message in client.messages(IMAGE)] == [5, 10]


def test_nothing_is_drawn_without_a_listener() -> None:
    worker = ManualWorker()
    _, client = in_sync(CAMERA, LIDAR, SCAN, worker=worker)
    for _ in range(10):
        client.tick()
    assert not worker.jobs
    client.listen("/image_jpeg/camera_info")  # it needs no picture
    client.tick()
    client.tick()
    assert not worker.jobs
    assert client.messages("/image_jpeg/camera_info")


def test_camera_info_has_the_focal_length_of_the_horizontal_field_of_view() -> None:
    _, client = in_sync(CameraSpec(fov=70.0))
    client.listen("/image_jpeg/camera_info")
    client.tick()
    client.tick()
    info = client.messages("/image_jpeg/camera_info")[0]
    assert (info["width"], info["height"], info["distortion_model"]) == (640, 480, "plumb_bob")
    assert info["K"] == pytest.approx([457.007, 0, 320, 0, 457.007, 240, 0, 0, 1], abs=1e-2)
    assert info["P"] == pytest.approx([457.007, 0, 320, 0, 0, 457.007, 240, 0, 0, 0, 1, 0], abs=1e-2)
    assert info["D"] == [0.0] * 5


@pytest.mark.parametrize(
    ("picture", "encoding", "kind"),
    [("rgb", "rgb8", np.uint8), ("depth", "32FC1", "<f4"), ("semantic", "mono8", "u1"), ("instance", "mono16", "<u2")],
)
def test_raw_pictures_have_their_encoding(picture: Any, encoding: str, kind: str) -> None:  # noqa: ANN401
    spec = CameraSpec(picture=picture, encoding="raw", width=32, height=24, rate=50.0, x=1.8, z=2.0)
    _, client = in_sync(spec)
    client.listen(spec.topic)
    client.tick()
    (message,) = client.messages(spec.topic)
    assert (message["encoding"], message["width"], message["height"]) == (encoding, 32, 24)
    data = np.frombuffer(base64.b64decode(message["data"]), dtype=kind)
    assert message["step"] * 24 == data.nbytes
    if picture == "depth":  # the pixel below the middle looks down by half a pixel: ground at 2 m / tan
        assert data.reshape(24, 32)[23, 16] == pytest.approx(2.0 / (11.5 / 16.0), abs=1e-4)
        assert np.isinf(data.reshape(24, 32)[0, 0])


def test_lidar_has_both_names_and_the_fields_of_the_driver() -> None:
    _, client = in_sync(LIDAR)
    client.listen(POINTS, "/velodyne_points")
    for _ in range(5):
        client.tick()
    (cloud,), (other,) = client.messages(POINTS), client.messages("/velodyne_points")
    assert cloud == other
    assert [(one["name"], one["offset"], one["datatype"]) for one in cloud["fields"]] == [
        ("x", 0, 7),
        ("y", 4, 7),
        ("z", 8, 7),
        ("intensity", 12, 7),
        ("ring", 16, 4),
        ("time", 18, 7),
    ]
    found = points(cloud)
    assert (cloud["point_step"], cloud["height"], cloud["is_dense"]) == (22, 1, True)
    assert cloud["width"] == len(found) == cloud["row_step"] // 22
    assert cloud["header"]["frame_id"] == "velodyne"
    ground = found[found["intensity"] <= 14.0]  # asphalt; a vehicle has 30 and more
    assert len(ground)
    assert ground["z"] == pytest.approx(-1.25, abs=1e-4)
    assert found["time"].min() > -0.1
    assert found["time"].max() == 0.0
    assert set(found["ring"]) <= set(range(16))


def test_scan_looks_ahead_in_its_middle() -> None:
    harness, client = in_sync(SCAN)
    client.listen("/lidar2D")
    for _ in range(5):
        client.tick()
    (scan,) = client.messages("/lidar2D")
    assert len(scan["ranges"]) == len(scan["intensities"]) == 36
    assert scan["angle_min"] + 18 * scan["angle_increment"] == pytest.approx(0.0, abs=1e-6)
    world = harness.world
    ego = harness.node.egos.first.row
    others = [row for row in range(len(world)) if row != ego and world.alive[row]]
    away = [(world.x[row] - world.x[ego], world.y[row] - world.y[ego]) for row in others]
    ahead = [north for east, north in away if abs(east) < 1.0 and north > 0.0]  # the ego looks north
    assert bool(ahead) == (scan["ranges"][18] is not None)


def test_radar_needs_no_worker() -> None:
    harness = SimHarness(start="sync", sensors=(RadarSpec(x=3.8, z=0.5, yaw=-90.0, near_fov=170.0),))
    client = harness.client()
    client.start()
    client.listen("/radar")
    for _ in range(5):
        client.tick()
    messages = client.messages("/radar")
    assert [message["header"]["seq"] for message in messages] == [3, 5]
    assert messages[0]["header"]["frame_id"] == "radar"
    assert messages[0]["detections"]
    first = messages[0]["detections"][0]
    distance = math.hypot(first["position"]["x"], first["position"]["y"])
    assert math.atan2(first["position"]["y"], first["position"]["x"]) == pytest.approx(first["azimuth"], abs=1e-6)
    assert 0.0 < distance < 60.0


def test_boxes_name_the_objects_of_the_picture() -> None:
    spec = CameraSpec(width=160, height=120, x=0.0, z=3.0, yaw=-90.0, rate=50.0)  # the ego looks north
    _, client = in_sync(spec)
    client.listen("/image_jpeg/boxes", "/Object_topic")
    client.tick()
    (message,) = client.messages("/image_jpeg/boxes")
    seen = {box["unique_id"]: box for box in message["boxes"]}
    assert seen
    listed = client.messages("/Object_topic")[0]
    ids = {one["unique_id"] for key in ("npc_list", "pedestrian_list", "obstacle_list") for one in listed[key]}
    assert set(seen) <= ids
    for box in seen.values():
        assert 0.0 <= box["left"] < box["right"] <= 160.0
        assert 0.0 < box["visibility"] <= 1.0
        assert box["center"]["z"] > 0.0
        assert math.hypot(*box["up"].values()) == pytest.approx(1.0, abs=1e-6)
    assert not client.messages(IMAGE)


@pytest.mark.parametrize("ros", [1, 2])
def test_detections_are_the_boxes_in_the_optical_frame(ros: Generation) -> None:
    spec = CameraSpec(width=160, height=120, x=0.0, z=3.0, yaw=-90.0, pitch=10.0, rate=50.0, detections=True)
    _, client = in_sync(spec, ros=ros)
    flat, solid = "/image_jpeg/detections_2d", "/image_jpeg/detections_3d"
    client.listen("/image_jpeg/boxes", flat, solid)
    client.tick()
    boxes, shown, around = (client.messages(topic)[0] for topic in ("/image_jpeg/boxes", flat, solid))
    assert shown["header"]["frame_id"] == around["header"]["frame_id"] == "Camera_optical"
    assert shown["header"]["stamp"] == boxes["header"]["stamp"]
    assert len(shown["detections"]) == len(around["detections"]) == len(boxes["boxes"]) > 0
    for box, one, other in zip(boxes["boxes"], shown["detections"], around["detections"], strict=True):
        middle = one["bbox"]["center"]["position"] if ros == 2 else one["bbox"]["center"]
        assert middle["x"] == pytest.approx(0.5 * (box["left"] + box["right"]), abs=1e-3)
        assert one["bbox"]["size_y"] == pytest.approx(box["bottom"] - box["top"], abs=1e-3)
        assert other["bbox"]["center"]["position"] == box["center"]
        assert other["bbox"]["size"] == box["size"]
        turn = tuple(other["bbox"]["center"]["orientation"][name] for name in "xyzw")
        assert rotate(turn, (1.0, 0.0, 0.0)) == pytest.approx(tuple(box["forward"].values()), abs=1e-6)
        assert rotate(turn, (0.0, 0.0, 1.0)) == pytest.approx(tuple(box["up"].values()), abs=1e-6)
        for detection in (one, other):
            (result,) = detection["results"]
            assert (result["hypothesis"]["class_id"] if ros == 2 else result["id"]) == (
                str(box["label"]) if ros == 2 else box["label"]
            )
            assert ros == 1 or detection["id"] == str(box["unique_id"])


def test_cameras_share_a_topic_and_differ_in_the_frame() -> None:
    rig = [CAMERA.changed(frame_id=f"Camera-{i}", yaw=60.0 * i) for i in range(3)]
    _, client = in_sync(*rig)
    client.listen(IMAGE)
    client.tick()
    client.tick()
    assert [message["header"]["frame_id"] for message in client.messages(IMAGE)] == ["Camera-0", "Camera-1", "Camera-2"]


def test_further_ego_has_the_sensors_under_its_prefix() -> None:
    _, client = in_sync(CAMERA, LIDAR)
    client.send("/ego_setting", "morai_msgs/MultiEgoSetting", **put_egos(0, 2))
    client.listen("/Ego-2/image_jpeg/compressed", "/Ego-2/velodyne_points")
    for _ in range(5):
        client.tick()
    frames = [message["header"]["frame_id"] for message in client.messages("/Ego-2/image_jpeg/compressed")]
    assert set(frames) == {"Ego-2/Camera"}
    assert client.messages("/Ego-2/velodyne_points")[0]["header"]["frame_id"] == "Ego-2/velodyne"


def test_static_frames_have_each_sensor_and_the_picture_of_a_camera() -> None:
    _, client = in_sync(CAMERA, LIDAR)
    client.listen("/tf_static")
    client.send("/SensorPosControl", "morai_msgs/SensorPosControl", sensor_index=[3], **_places(1.0, 0.0, 2.0))
    frames = {one["child_frame_id"]: one for one in client.messages("/tf_static")[-1]["transforms"]}
    assert {"gps_link", "imu_link", "Camera", "Camera_optical", "velodyne"} <= set(frames)
    assert frames["Camera_optical"]["header"]["frame_id"] == "Camera"
    turn = frames["Camera_optical"]["transform"]["rotation"]
    assert [turn[axis] for axis in "xyzw"] == pytest.approx([-0.5, 0.5, -0.5, 0.5], abs=1e-9)
    assert frames["velodyne"]["transform"]["translation"] == {"x": 1.0, "y": 0.0, "z": 2.0}


def _places(*figures: float) -> dict[str, list[float]]:
    names = ("pose_x", "pose_y", "pose_z", "roll", "pitch", "yaw")
    return {name: [figure] for name, figure in zip(names, (*figures, *[0.0] * (6 - len(figures))), strict=True)}


# Synchronous mode


def test_messages_are_out_before_the_answer_of_their_tick() -> None:
    worker = ManualWorker()
    harness, client = in_sync(CAMERA, worker=worker)
    client.listen(IMAGE)
    client.tick()
    answers = begin_tick(harness, client)
    assert harness.world.frame == 2
    assert len(worker.jobs) == 1
    assert not answers
    worker.finish()
    assert len(client.messages(IMAGE)) == 1
    assert [answer.is_ok for answer in answers] == [True]


def test_next_tick_waits_for_the_pictures_of_the_last_one() -> None:
    worker = ManualWorker()
    harness, client = in_sync(CAMERA, worker=worker)
    client.listen(IMAGE)
    client.tick()
    first, second = begin_tick(harness, client), begin_tick(harness, client)
    assert harness.world.frame == 2
    worker.finish()
    assert (len(first), len(second)) == (1, 1)  # frame 3 has no picture
    assert harness.world.frame == 3


def test_tick_of_several_frames_draws_each_due_frame_in_order() -> None:
    worker = ManualWorker()
    harness = SimHarness(start="sync", sensors=(CAMERA,), worker=worker)
    client = harness.client()
    client.start(time_step=100)
    client.listen(IMAGE, "/clock")
    answers = begin_tick(harness, client)
    seen = []
    while worker.jobs:
        seen.append((harness.world.frame, len(answers)))
        worker.finish()
    assert seen == [(2, 0), (4, 0), (5, 0)]
    assert len(answers) == 1
    order = [(name, message.get("header", {}).get("seq")) for name, message in client.heard]
    assert [one for one in order if one[0] == IMAGE] == [(IMAGE, 2), (IMAGE, 4), (IMAGE, 5)]
    assert [name for name, _ in order] == ["/clock"] * 2 + [IMAGE] + ["/clock"] * 2 + [IMAGE, "/clock", IMAGE]


def test_step_draws_each_due_frame_and_returns_the_last_picture() -> None:
    worker = ManualWorker()
    harness, client = in_sync(CAMERA, LIDAR, worker=worker)
    client.listen(POINTS)
    answers: list[Answer] = []
    args = {"user_id": "me", "n": 6, "topics": [IMAGE, POINTS]}
    harness.bus.call(client, "/sim/step", args, answers.append, now=0.0)
    frames = []
    while worker.jobs:
        frames.append(harness.world.frame)
        worker.finish()
    assert frames == [2, 4, 5]
    response = json.loads(answers[0].values.json)  # type: ignore[attr-defined]
    assert (response["result"], response["frame"], response["steps"]) == (True, 6, 6)
    picture, cloud = (json.loads(sample["message"]) for sample in response["topics"])
    assert (picture["header"]["seq"], cloud["header"]["seq"]) == (5, 5)
    assert not client.messages(IMAGE)  # the caller has not subscribed
    assert len(client.messages(POINTS)) == 1
    client.tick()
    assert not worker.jobs


def test_two_runs_give_the_same_bytes() -> None:
    def run() -> list[bytes]:
        _, client = in_sync(CAMERA, LIDAR, SCAN, RADAR)
        client.listen(IMAGE, POINTS, "/lidar2D", "/radar")
        client.control(1, longlCmdType=2, velocity=40.0, steering=0.1)
        for _ in range(20):
            client.tick()
        return client.raw

    first = run()
    assert len(first) > 20
    assert run() == first


def test_snapshot_goes_on_with_the_same_bytes() -> None:
    _, client = in_sync(CAMERA, LIDAR)
    client.listen(IMAGE, POINTS)
    client.control(1, longlCmdType=2, velocity=40.0, steering=0.1)
    sensors(client, add=json.dumps({"camera": [{"frame_id": "left", "yaw": 70, "width": 16, "height": 12}]}))
    client.call("/sim/snapshot", {"id": "here"})
    for _ in range(10):
        client.tick()
    first = list(client.raw)
    sensors(client, remove=["left", "velodyne"])
    client.raw.clear()
    answer = client.call("/sim/restore", {"id": "here", "user_id": "me"})
    assert answer.is_ok
    assert json.loads(answer.values.json)["result"]  # type: ignore[attr-defined]
    assert [one["frame_id"] for one in sensors(client)["mounted"]] == ["Camera", "velodyne", "left"]
    client.raw.clear()
    for _ in range(10):
        client.tick()
    assert client.raw == first


def test_reset_puts_the_rig_of_the_start_back_and_drops_what_is_drawn() -> None:
    worker = ManualWorker()
    harness, client = in_sync(CAMERA, worker=worker)
    client.listen(IMAGE)
    sensors(client, add='{"radar": [{}]}', move=['{"frame_id": "Camera", "z": 3}'])
    client.tick()
    answers = begin_tick(harness, client)
    harness.node.reset(None, 0.0)
    assert len(answers) == 1  # refused: its pictures will never come
    worker.finish()
    assert not client.messages(IMAGE)
    (camera,) = sensors(client)["mounted"]
    assert camera["z"] == 2.0
    client.tick()
    assert len(begin_tick(harness, client)) == 0
    worker.finish()
    assert len(client.messages(IMAGE)) == 1


def test_scenario_load_keeps_the_sensors() -> None:
    _, client = in_sync(CAMERA)
    client.listen(IMAGE)
    client.send("/ScenarioLoad", "morai_msgs/ScenarioLoad", file_name="parked", **ALL)
    client.tick()
    client.tick()
    assert len(client.messages(IMAGE)) == 1


def test_failure_of_the_drawing_releases_the_tick(caplog: pytest.LogCaptureFixture) -> None:
    worker = ManualWorker()
    harness, client = in_sync(CAMERA, worker=worker)
    client.listen(IMAGE)
    client.tick()
    answers = begin_tick(harness, client)
    worker.fail()
    assert len(answers) == 1
    assert not client.messages(IMAGE)
    assert "cannot be served: no GL" in caplog.text


def test_master_that_leaves_while_pictures_are_drawn_holds_nothing() -> None:
    worker = ManualWorker()
    harness, client = in_sync(CAMERA, worker=worker)
    viewer = harness.client()
    viewer.listen(IMAGE)
    client.tick()
    begin_tick(harness, client)
    client.leave()
    worker.finish()
    assert len(viewer.messages(IMAGE)) == 1
    harness.client().start("other")
    assert harness.node.sync.master_id == "other"


# Real time


def test_real_time_skips_while_the_worker_is_busy_and_then_uses_the_last_frame_at_once() -> None:
    worker = ManualWorker()
    harness = SimHarness(sensors=(CAMERA,), worker=worker)
    client = harness.client()
    client.listen(IMAGE, "/clock")
    harness.run(0.1)
    assert len(worker.jobs) == 1
    assert worker.jobs[0][0].frame.frame == 2
    harness.run(0.2)
    assert len(worker.jobs) == 1
    assert harness.world.frame >= 14  # the world has gone on
    worker.finish(harness.now)
    assert [message["header"]["seq"] for message in client.messages(IMAGE)] == [2]
    assert worker.jobs[0][0].frame.frame == harness.world.frame
    (camera,) = sensors(client)["mounted"]
    assert camera["skipped"] >= 5
    assert camera["measured"] < 5.0
    assert camera["rate"] == 30.0


def test_measured_rate_is_that_of_the_messages() -> None:
    harness = SimHarness(sensors=(CAMERA,), worker=AtOnceWorker())
    client = harness.client()
    client.listen(IMAGE)
    harness.run(2.0)
    (camera,) = sensors(client)["mounted"]
    assert camera["measured"] == pytest.approx(30.0, abs=0.5)
    assert camera["skipped"] == 0


# /sim/sensors


def test_sensors_are_added_moved_and_removed() -> None:
    _, client = in_sync()
    assert sensors(client)["mounted"] == []
    added = sensors(
        client, add='{"camera": [{"frame_id": "left", "rate": 50, "width": 16, "height": 12}], "radar": [{}]}'
    )
    assert (added["result"], added["message"]) == (True, "")
    assert [(one["number"], one["kind"], one["frame_id"]) for one in added["mounted"]] == [
        (2, "camera", "left"),
        (3, "radar", "radar"),
    ]
    assert added["mounted"][0]["topics"] == [IMAGE, "/image_jpeg/camera_info", "/image_jpeg/boxes"]
    client.listen(IMAGE)
    client.tick()
    assert client.messages(IMAGE)[0]["header"]["frame_id"] == "left"
    moved = sensors(client, move=['{"frame_id": "left", "z": 1.5, "pitch": "-5"}'])["mounted"][0]
    assert (moved["z"], moved["pitch"]) == (1.5, -5.0)
    assert json.loads(moved["settings"])["pitch"] == -5.0
    assert [one["frame_id"] for one in sensors(client, remove=["left"])["mounted"]] == ["radar"]
    client.tick()
    assert len(client.messages(IMAGE)) == 1


@pytest.mark.parametrize(
    ("request_", "text"),
    [
        ({"ego": 7}, "ego: expected the number of an ego, one of 0; got 7"),
        ({"add": "camera"}, "add:1:1: not JSON: expected a value, got 'camera'"),
        ({"add": '{"camera": [{"fov": 180}]}'}, "add: camera[0].fov: expected at most 170, got 180"),
        ({"add": '{"camera": [{"width": NaN}]}'}, "add: "),
        ({"add": '{"camera": [{"rate": 1000}]}'}, "rate: expected at most 50, got 1000"),
        ({"add": '{"camera": [{}]}'}, "expected different names, got Camera 2 times"),
        ({"add": '{"camera": [{"frame_id": "b", "width": 8192, "height": 8192}]}'}, "at most 8,294,400 pixels"),
        ({"add": json.dumps({"radar": [{"frame_id": f"r{i}"} for i in range(32)]})}, "at most 32 for an ego, got 33"),
        ({"add": '{"radar": [{"topic": "/clock"}]}'}, "/clock"),
        ({"remove": ["camra"]}, "remove: expected one of Camera, got 'camra'"),
        ({"move": ['{"frame_id": "x"}']}, "move[0].frame_id: expected one of gps_link, imu_link, Camera, got 'x'"),
        ({"remove": ["gps_link"]}, "remove: gps_link: each ego has one; expected one of Camera"),
        ({"add": '{"imu": {"z": 1}}'}, "add: imu: each ego has one; move imu_link instead"),
        ({"move": ['{"frame_id": "Camera", "zz": 1}']}, "move[0].zz: expected one of x, y, z, roll, pitch, yaw"),
        ({"move": ['{"frame_id": "Camera", "z": 1000}']}, "z: expected at most 100, got 1000"),
        ({"move": ['{"frame_id": "Camera", "z": NaN}']}, "z: "),
    ],
)
def test_wrong_change_is_refused_as_a_whole(request_: dict[str, Any], text: str) -> None:
    _, client = in_sync(CAMERA)
    before = sensors(client)["mounted"]
    answer = sensors(client, **request_)
    assert not answer["result"]
    assert text in answer["message"]
    assert sensors(client)["mounted"] == before


def test_nothing_can_be_drawn_without_a_worker() -> None:
    with pytest.raises(DocumentError, match="draws nothing"):
        SimHarness(sensors=(CAMERA,))
    harness = SimHarness()
    assert "draws nothing" in sensors(harness.client(), add='{"camera": [{}]}')["message"]


def test_sensor_pos_control_moves_sensors_behind_gps_and_imu() -> None:
    harness, client = in_sync(CAMERA, LIDAR)
    client.send("/SensorPosControl", "morai_msgs/SensorPosControl", sensor_index=[3], **_places(1.0, 0.5, 2.0))
    lidar = sensors(client)["mounted"][1]
    assert (lidar["x"], lidar["y"], lidar["z"]) == (1.0, 0.5, 2.0)
    assert harness.node.egos.first.mountings["velodyne"].place == (1.0, 0.5, 2.0)


def test_gps_and_imu_are_listed_first_and_moved_like_the_others() -> None:
    rig = (GpsSpec(z=1.2), CAMERA)
    harness, client = in_sync(*rig)
    client.listen("/gps")
    for _ in range(4):
        client.tick()
    gps, imu, camera = sensors(client)["sensors"]
    assert [(one["number"], one["kind"], one["frame_id"], one["topics"]) for one in (gps, imu)] == [
        (0, "gps", "gps_link", ["/gps"]),
        (1, "imu", "imu_link", ["/imu"]),
    ]
    assert (gps["z"], gps["rate"], gps["measured"], imu["measured"], camera["number"]) == (1.2, 50.0, 50.0, 0.0, 2)
    height = client.messages("/gps")[-1]["altitude"]
    assert sensors(client, move=['{"frame_id": "gps_link", "z": 2.2}'])["sensors"][0]["z"] == 2.2
    client.tick()
    assert client.messages("/gps")[-1]["altitude"] == pytest.approx(height + 1.0)
    client.call("/sim/reset", {})
    assert harness.node.egos.first.mountings["gps_link"].place == (0.0, 0.0, 1.2)


def test_snapshot_keeps_the_places_of_gps_and_imu() -> None:
    harness, client = in_sync(ImuSpec(x=1.5))
    sensors(client, move=['{"frame_id": "imu_link", "z": 0.5}'])
    client.call("/sim/snapshot", {"id": "here"})
    client.send("/SensorPosControl", "morai_msgs/SensorPosControl", sensor_index=[1], **_places(0.0, 0.0, 9.0))
    client.call("/sim/restore", {"id": "here", "user_id": "me"})
    assert harness.node.egos.first.mountings["imu_link"].place == (1.5, 0.0, 0.5)


def test_raw_pictures_of_many_egos_are_drawn_and_published_in_several_jobs() -> None:
    worker = ManualWorker()
    spec = CameraSpec(picture="depth", width=1600, height=1200, rate=50.0)  # 7.7 MB each
    harness, client = in_sync(spec, worker=worker)
    client.send("/ego_setting", "morai_msgs/MultiEgoSetting", **put_egos(0, 2, 3))
    client.listen("/image", "/Ego-2/image", "/Ego-3/image")
    answers = begin_tick(harness, client)
    assert [len(job.sights) for job, _ in worker.jobs] == [1, 1, 1]
    assert len({id(job.frame) for job, _ in worker.jobs}) == 1
    for _ in range(3):
        assert not answers
        worker.fail()
    assert len(answers) == 1


def test_cameras_of_twenty_egos_are_out_before_the_answer_in_a_turn_each() -> None:
    worker = ManualWorker()
    harness, client = in_sync(CAMERA, worker=worker)
    numbers = [0, *range(2, 21)]
    client.send("/ego_setting", "morai_msgs/MultiEgoSetting", **put_egos(*numbers))
    topics = [IMAGE if number == 0 else f"/Ego-{number}{IMAGE}" for number in numbers]
    client.listen(*topics)
    client.tick()  # no picture is due in the first frame
    answers = begin_tick(harness, client)
    assert len(worker.jobs) == len(numbers)
    for _ in numbers:
        assert not answers
        worker.finish()
    assert len(answers) == 1
    assert [len(client.messages(topic)) for topic in topics] == [1] * len(numbers)


def test_sensors_that_move_and_change_in_each_frame_leave_nothing_behind() -> None:
    harness, client = in_sync(CAMERA, LIDAR)
    client.listen(IMAGE, POINTS)
    own = {"/SensorPosControl"}  # the client's
    before = {topic.name for topic in harness.bus.topics.values() if topic.publishers}
    for i in range(20):
        place = _places(0.1 * i, 0.0, 2.0)
        client.send("/SensorPosControl", "morai_msgs/SensorPosControl", sensor_index=[2], **place)
        added = {"frame_id": f"c{i}", "topic": f"/extra{i}", "width": 8, "height": 8}
        changes = {"remove": [f"c{i - 1}"] if i else [], "add": json.dumps({"camera": [added]})}
        assert sensors(client, move=[json.dumps({"frame_id": "velodyne", "z": 1.0 + 0.01 * i})], **changes)["result"]
        client.tick()
    assert sensors(client, remove=["c19"])["result"]
    camera, lidar = sensors(client)["mounted"]
    assert (camera["x"], lidar["z"]) == pytest.approx((1.9, 1.19))
    assert len(client.messages(IMAGE)) == 12
    assert {topic.name for topic in harness.bus.topics.values() if topic.publishers} - own == before


# Weather and dressing


def test_rain_takes_friction_only_if_it_is_set() -> None:
    for share, expected in ((0.0, 1.0), (0.7, 0.7)):
        harness, client = in_sync(weather=Weather.RAIN, rain_friction=share)
        assert harness.world.friction_share == expected
        client.call("/sim/weather", {"weather": "fog"})
        assert harness.world.friction_share == 1.0
        client.call("/sim/weather", {"weather": ""})
        client.call("/sim/reset", {"seed": -1})
        assert harness.world.friction_share == expected


def test_weather_is_that_of_the_settings_until_the_service_changes_it() -> None:
    worker = ManualWorker()
    harness, client = in_sync(CAMERA, worker=worker, weather=Weather.RAIN, is_dressed=False)

    def ask(name: str = "") -> dict[str, Any]:
        response: dict[str, Any] = json.loads(client.call("/sim/weather", {"weather": name}).values.json)  # type: ignore[attr-defined]
        return response

    assert ask() == {"result": True, "message": "", "weather": "rain"}
    assert ask("fog")["weather"] == "fog"
    client.listen(IMAGE)
    client.tick()
    begin_tick(harness, client)
    job, _ = worker.jobs[0]
    assert (job.weather, job.is_dressed) == (Weather.FOG, False)
    worker.finish()
    refused = ask("snow")
    assert (refused["result"], refused["weather"]) == (False, "fog")
    assert "expected one of noon, dusk, night, rain, fog, or nothing to ask; got 'snow'" in refused["message"]
    client.call("/sim/snapshot", {"id": "fog"})
    client.call("/sim/reset", {})
    assert ask()["weather"] == "rain"
    client.call("/sim/restore", {"id": "fog", "user_id": "me"})
    assert ask()["weather"] == "fog"


def test_lidar_loses_far_echoes_in_fog() -> None:
    rig = (LIDAR.changed(rate=50.0),)
    seen = []
    for weather in (Weather.NOON, Weather.NIGHT, Weather.RAIN, Weather.FOG):
        _, client = in_sync(*rig, weather=weather)
        client.listen(POINTS)
        client.tick()
        seen.append(points(client.messages(POINTS)[0]))
    noon, night, rain, fog = seen
    assert len(noon) == len(night) > len(rain) >= len(fog)  # the ring at -1 deg meets the ground at 72 m
    assert fog["intensity"].mean() < noon["intensity"].mean()


def test_echo_in_fog_is_lost_where_it_is_weaker_than_the_darkest_at_the_end_of_the_range() -> None:
    ranges = np.array([35.0, 37.0, 57.0, 59.0, np.inf], dtype=np.float32)
    echoes = Echoes(ranges, np.array([7.0, 7.0, 60.0, 60.0, 0.0], dtype=np.float32), np.ones(5, dtype=np.float32))
    found = fade(echoes, EXTINCTION[Weather.FOG], 100.0)
    assert found.ranges.tolist() == [35.0, math.inf, 57.0, math.inf, math.inf]
    assert found.intensities[2] == round(60.0 * math.exp(-0.056 * 57.0))


# Files


def test_saved_data_has_pictures_and_points() -> None:
    worker = ManualWorker()
    harness, client = in_sync(CAMERA, LIDAR, RADAR, worker=worker)
    client.tick()
    client.send("/SaveSensorData", "morai_msgs/SaveSensorData", is_custom_file_name=True, custom_file_name="here")
    assert not harness.drawer.saved
    answers = begin_tick(harness, client)  # it waits: the files are of frame 1
    assert harness.world.frame == 1
    worker.finish()
    assert harness.world.frame == 2
    assert len(answers) == 1
    ((_, name, files),) = harness.drawer.saved
    assert name == "here"
    assert set(files) == {
        *("GPS_{}.csv", "IMU_{}.csv", "BOXES_{}.txt"),
        *("CAMERA_Camera_{}.jpeg", "LIDAR_velodyne_{}.bin"),
    }
    assert len(files["CAMERA_Camera_{}.jpeg"]) == 1 + 32 * 24
    points = np.frombuffer(files["LIDAR_velodyne_{}.bin"], dtype="<f4").reshape(-1, 4)
    assert len(points)
    assert points[:, 3].max() <= 255.0


def test_lidar_that_sees_nothing_is_saved_as_an_empty_file() -> None:
    blind = LIDAR.changed(model="own", elevations=(80.0, 85.0))
    harness, client = in_sync(blind)
    client.send("/SaveSensorData", "morai_msgs/SaveSensorData")
    ((_, _, files),) = harness.drawer.saved
    assert files["LIDAR_velodyne_{}.bin"] == b""


def test_data_that_cannot_be_saved_after_drawing_is_told() -> None:
    worker = ManualWorker()
    harness, client = in_sync(CAMERA, worker=worker)
    harness.drawer.refusal = "the disk is full"
    client.send("/SaveSensorData", "morai_msgs/SaveSensorData")
    worker.finish()
    assert client.told[-1][0] == "error"
    assert "the disk is full" in client.told[-1][1]


def test_captures_that_wait_are_bounded() -> None:
    worker = ManualWorker()
    _, client = in_sync(CAMERA, worker=worker)
    for _ in range(4):
        client.send("/SaveSensorData", "morai_msgs/SaveSensorData")
    with pytest.raises(FieldError, match="4 captures are being drawn already"):
        client.send("/SaveSensorData", "morai_msgs/SaveSensorData")
    worker.finish()
    client.send("/SaveSensorData", "morai_msgs/SaveSensorData")
    assert len(worker.jobs) == 4
    with pytest.raises(FieldError, match="4 captures are being drawn already"):
        client.send("/SaveSensorData", "morai_msgs/SaveSensorData")


def test_sensor_behind_one_that_is_not_due_is_read() -> None:
    _, client = in_sync(CAMERA.changed(rate=10.0), RADAR.changed(rate=50.0))
    client.listen(IMAGE, "/radar")
    for _ in range(5):
        client.tick()
    assert [message["header"]["seq"] for message in client.messages("/radar")] == [1, 2, 3, 4, 5]
    assert [message["header"]["seq"] for message in client.messages(IMAGE)] == [5]


def test_ego_publishes_messages_of_the_types_of_its_sensors_alone() -> None:
    harness, _ = in_sync(SCAN)
    has = harness.node.component(MountedSensors).has_topic_like
    types = ("sensor_msgs/LaserScan", "sensor_msgs/Imu", "sensor_msgs/Image", "sensor_msgs/PointCloud2")
    assert [has(name) for name in types] == [True, True, False, False]


# Radars of many egos


def _many_radars(num: int) -> list[RadarSpec]:
    return [RadarSpec(frame_id=f"r{i}", topic=f"/r{i}", rate=50.0) for i in range(num)]


def _radars_by_frame(client: Client, egos: Sequence[int], num: int, num_frames: int) -> list[list[str]]:
    """The topics of radars that have a message in each of the next frames."""
    prefixes = ["" if ego == 0 else f"/Ego-{ego}" for ego in egos]
    topics = [f"{prefix}/r{i}" for prefix in prefixes for i in range(num)]
    client.listen(*topics)
    frames = []
    for _ in range(num_frames):
        client.heard.clear()
        client.tick()
        frames.append([name for name, _ in client.heard if name in topics])
    return frames


def _with_egos(client: Client) -> None:
    client.send("/ego_setting", "morai_msgs/MultiEgoSetting", **put_egos(0, 2, 3))


def _by_the_rig(harness: SimHarness, client: Client) -> None:
    del harness
    _with_egos(client)


def _by_the_service(harness: SimHarness, client: Client) -> None:
    del harness
    _with_egos(client)
    for ego in (0, 2, 3):
        add = {"radar": [{"frame_id": f"r{i}", "topic": f"/r{i}", "rate": 50} for i in range(20)]}
        sensors(client, ego=ego, add=json.dumps(add))


def _by_a_restore(harness: SimHarness, client: Client) -> None:
    _by_the_service(harness, client)
    client.call("/sim/snapshot", {"id": "here"})
    for ego in (0, 2, 3):
        sensors(client, ego=ego, remove=[f"r{i}" for i in range(20)])
    client.call("/sim/restore", {"id": "here", "user_id": "me"})


@pytest.mark.parametrize(
    ("rig", "mount"), [(_many_radars(20), _by_the_rig), ([], _by_the_service), ([], _by_a_restore)]
)
def test_frame_reads_a_bounded_number_of_radars_and_each_has_its_turn(
    rig: list[RadarSpec], mount: Callable[[SimHarness, Client], None], caplog: pytest.LogCaptureFixture
) -> None:
    harness, client = in_sync(*rig)
    mount(harness, client)
    client.tick()
    frames = _radars_by_frame(client, (0, 2, 3), 20, 4)
    assert [len(names) for names in frames] == [30, 30, 30, 30]
    assert len(set(frames[0] + frames[1])) == 60
    assert frames[:2] == frames[2:]
    assert {one["skipped"] for one in sensors(client)["mounted"]} == {2}  # 50 Hz are asked for, in four frames
    text = "60 radars are mounted, and a frame reads at most 32: each has a turn every 2 frames, 25 Hz at most"
    assert caplog.messages.count(text) == 1


def test_radars_that_are_not_due_each_frame_keep_their_rate_beside_many_others() -> None:
    rig = [RadarSpec(frame_id=f"r{i}", topic=f"/r{i}") for i in range(20)]  # 20 Hz, and a turn at 25 Hz
    _, client = in_sync(*rig)
    _with_egos(client)
    client.tick()
    frames = _radars_by_frame(client, (0, 2, 3), 20, 10)
    names = [name for one in frames for name in one]
    assert {names.count(name) for name in set(names)} == {4}
    assert max(len(one) for one in frames) <= 32
    assert {one["skipped"] for one in sensors(client)["mounted"]} == {0}


def test_radars_have_the_same_turns_after_a_restore() -> None:
    _, client = in_sync(*_many_radars(20))
    _with_egos(client)
    client.tick()
    client.call("/sim/snapshot", {"id": "here"})
    first = _radars_by_frame(client, (0, 2, 3), 20, 3)
    assert client.call("/sim/restore", {"id": "here", "user_id": "me"}).is_ok
    again = [sorted(set(names)) for names in _radars_by_frame(client, (0, 2, 3), 20, 3)]
    assert again == [sorted(names) for names in first]


def test_client_that_adds_radars_beyond_those_of_a_frame_is_told_their_rate() -> None:
    _, client = in_sync(*_many_radars(16))
    client.send("/ego_setting", "morai_msgs/MultiEgoSetting", **put_egos(0, 2))
    client.tick()
    assert not client.told
    sensors(client, add='{"radar": [{}]}')
    assert client.told == [
        (
            "warning",
            "33 radars are mounted, and a frame reads at most 32: each has a turn every 2 frames, 25 Hz at most",
        )
    ]
