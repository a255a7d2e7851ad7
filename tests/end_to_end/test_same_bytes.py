"""All features in one run, in two servers: every topic and saved file has the same bytes."""

from __future__ import annotations

import json
import re
import shutil
from collections import Counter
from pathlib import Path
from typing import Any

import pytest

from rosbridge_sim import Simulator
from tests.conftest import Connect, Serve
from tests.support import Client

pytestmark = pytest.mark.slow

MORAI = {
    "Ego_topic": "EgoVehicleStatus",
    "Object_topic": "ObjectStatusList",
    "CollisionData": "CollisionData",
    "GetTrafficLightStatus": "GetTrafficLightStatus",
    "InsnStatus": "IntersectionStatus",
    "gps": "GPSMessage",
}
"""What each ego has of its own, and is of `morai_msgs`."""

TOPICS = {
    **{prefix + name: f"morai_msgs/{kind}" for prefix in ("/", "/Ego-2/") for name, kind in MORAI.items()},
    **dict.fromkeys(("/imu", "/Ego-2/imu"), "sensor_msgs/Imu"),
    **dict.fromkeys(("/car/state", "/Ego-2/car/state"), "morai_msgs/EgoVehicleStatus"),
    **dict.fromkeys(("/ReplayInfo_topic", "/car/replay"), "morai_msgs/ReplayInfo"),
    "/VehicleCollisionData": "morai_msgs/VehicleCollisionData",
    "/IntscnTL_topic": "morai_msgs/IntscnTL",
    "/SyncModeInfo": "morai_msgs/SyncModeInfo",
    "/sim/process/state/msg/MoraiSimProcStatus": "morai_msgs/MoraiSimProcStatus",
    "/clock": "rosgraph_msgs/Clock",
    "/tf": "tf2_msgs/TFMessage",
    "/tf_static": "tf2_msgs/TFMessage",
}

NETWORK = """
[publishers]
"/Ego_topic" = { name = "/car/state" }
"/ReplayInfo_topic" = { name = "/car/replay" }
"/gps" = { rate = 7 }
[services]
"/Morai_SimProc" = { name = "/car/process" }
"""

WHOLE = {
    "delete_all": True,
    "load_ego_vehicle_data": True,
    "load_surrounding_vehicle_data": True,
    "load_pedestrian_data": True,
    "load_obstacle_data": True,
}


NUM_CAPTURES = 10
"""Ticks in which the sensors of both egos are saved."""


async def tick(master: Client, num: int, *, captures: bool = False) -> None:
    for _ in range(num):
        command = {"longlCmdType": 1, "accel": 0.5, "steering": 0.1}
        await master.ask("/SyncModeCtrlCmd", command=command, sensor_capture=captures)
        await master.ask("/SyncModeWaitForTick", user_id="master")


async def replay(
    master: Client, status: int, option: int = 0, service: str = "/Morai_SimProc", **fields: object
) -> None:
    answer = await master.ask(service, sim_process_status=status, replay_option=option, **fields)
    assert answer["result"] is True


async def drive(master: Client) -> None:
    """Sensors that are moved and saved, two egos of which one drives itself, a replay, other names, scenarios."""
    await master.ask("/SyncModeCmd", user_id="master", start_sync_mode=True)
    await tick(master, 10)
    places = {name: [0.1, 0.2] for name in ("pose_x", "pose_y", "pose_z", "roll", "pitch", "yaw")}
    await master.send("publish", topic="/SensorPosControl", msg={"sensor_index": [0, 1], **places})
    at = {"global_position_x": [-80.0], "global_position_y": [-5.25], "global_position_z": [0.0], "velocity": [0.0]}
    at |= {name: [0.0] for name in ("global_roll", "global_pitch", "global_yaw")}
    ego = {"number_of_ego_vehicle": 1, "camera_index": 2, "ego_index": [2], "gear": [4], "ctrl_mode": [6], **at}
    await master.send("publish", topic="/ego_setting", msg=ego)
    await tick(master, NUM_CAPTURES, captures=True)
    await master.ask("/Service_MoraiEventCmd", option=1, ctrl_mode=6)
    for _ in range(20):
        await master.ask("/SyncModeWaitForTick", user_id="master")
    await replay(master, 1, 1, rosbag_file_name="drive")
    await tick(master, 10)
    await replay(master, 1, 4 | 8, start_time=500, replay_speed=3)
    await tick(master, 10)
    await replay(master, 1, 2, replay_target_option=2)
    await tick(master, 5)
    await replay(master, 32)
    await tick(master, 5)
    for name, has_network in (("demo", True), ("town", False)):
        load = {"file_name": name, **WHOLE, "load_network_connection_data": has_network}
        assert (await master.ask("/Service_MoraiSL", **load))["result"] is True
        await tick(master, 10)
    await replay(master, 1, 1, "/car/process", rosbag_file_name="drive.mcap")
    await tick(master, 60)  # it ends, and the last ones are refused
    await replay(master, 32, service="/car/process")
    await master.send("publish", topic="/ego_setting", msg=ego)
    await tick(master, 10)
    await master.call("/sim/reset", {"seed": -1})
    await tick(master, 10)


async def run(
    serve: Serve, connect: Connect, data: Path, bag: Path, hash_seed: str, *more_flags: str
) -> tuple[list[str], dict[str, bytes]]:
    """Every frame that the topics gave, and the files that were saved."""
    (data / "Network").mkdir(parents=True)
    (data / "Network" / "demo.toml").write_text(NETWORK)
    shutil.copy(bag, data)
    flags = ("--scenario", "town", "--start", "sync", "--seed", "7", "--data-dir", str(data), *more_flags)
    url = serve(*flags, env={"PYTHONHASHSEED": hash_seed}).url
    master, watcher = await connect(url), await connect(url, is_recording=True)
    for topic, type_name in TOPICS.items():
        await watcher.send("subscribe", topic=topic, type=type_name)
    await watcher.send("call_service", service="/rosapi/topic_type", id="ready", args={"topic": "/clock"})
    await watcher.take("service_response", id="ready")
    await drive(master)
    # an answer without a time in it, so that all that is recorded can be compared
    await watcher.send("call_service", service="/rosapi/topic_type", id="done", args={"topic": "/clock"})
    await watcher.take("service_response", id="done")
    saved = data / "SensorData"
    return watcher.raw, {str(file.relative_to(saved)): file.read_bytes() for file in saved.rglob("*.*")}


_STAMP = re.compile(r'("(?:stamp|clock|latest_command_time)":) ?\{"secs": ?(\d+), ?"nsecs": ?\d+\}')


async def test_runs_of_all_features_give_the_same_bytes(serve: Serve, connect: Connect, tmp_path: Path) -> None:
    """With the time of day, all but the stamps."""
    bag = tmp_path / "drive.mcap"
    async with Simulator(port=0, start="sync", scenario="town", record=bag) as sim:
        master = await connect(sim.url)
        await master.ask("/SyncModeCmd", user_id="master", start_sync_mode=True)
        await tick(master, 50)
    first, files = await run(serve, connect, tmp_path / "first", bag, "1", "--stamps", "sim")
    second, same_files = await run(serve, connect, tmp_path / "second", bag, "2", "--stamps", "sim")
    timed, timed_files = await run(serve, connect, tmp_path / "timed", bag, "3", "--stamps", "wall")
    frames: list[dict[str, Any]] = [json.loads(text) for text in first]
    heard = Counter(frame["topic"] for frame in frames if frame["op"] == "publish")
    assert set(TOPICS) - set(heard) <= {"/InsnStatus", "/Ego-2/InsnStatus"}, "of all but where nobody was"
    assert len(files) == 3 * NUM_CAPTURES
    assert first == second
    assert files == same_files == timed_files
    times = [int(secs) for text in timed for _, secs in _STAMP.findall(text)]
    assert times
    assert all(secs == 0 or secs > 1_000_000_000 for secs in times), "0 is that of no command"
    assert [_STAMP.sub(r"\1 {}", text) for text in timed] == [_STAMP.sub(r"\1 {}", text) for text in first]
