"""With `--start sync`, a run depends only on its calls: two servers send the same bytes."""

from __future__ import annotations

import math

import pytest

from tests.conftest import Connect, Simulate

pytestmark = pytest.mark.slow

NUM_TICKS = 140


async def record_drive(url: str, connect: Connect) -> list[str]:
    """Every frame that a drive's two status topics gave, as it came."""
    master, watcher = await connect(url), await connect(url, is_recording=True)
    await watcher.send("subscribe", topic="/Ego_topic", type="morai_msgs/EgoVehicleStatus")
    await watcher.send("subscribe", topic="/Object_topic", type="morai_msgs/ObjectStatusList")
    # an answer without a time in it, so that all that is recorded can be compared
    await watcher.send("call_service", service="/rosapi/topic_type", id="ready", args={"topic": "/Ego_topic"})
    await watcher.take("service_response", id="ready")
    started = await master.ask("/SyncModeCmd", user_id="master", start_sync_mode=True, time_step=20)
    assert started["frame"] == 0
    await master.send("advertise", topic="/SyncModeAddObj", type="morai_msgs/SyncModeAddObj")
    for i in range(NUM_TICKS):
        command = {"longlCmdType": 1 + i // 40 % 3, "steering": 0.3 * math.sin(i / 16), "accel": 0.7}
        command |= {"velocity": 30.0, "acceleration": math.cos(i / 12)}
        await master.ask("/SyncModeCtrlCmd", frame=i + 1, command=command, sensor_capture=False)
        if i == 40:
            place = {"x": 5.0, "y": -3.0, "z": 0.0}
            added = {"name": "2016_Hyundai_Ioniq", "position": place, "heading": 30.0, "frame": 60}
            await master.send("publish", topic="/SyncModeAddObj", msg=added)
        if i == 120:
            answer = await master.ask("/SyncModeScenarioLoad", frame=i + 1, file_name="demo", delete_all=True)
            assert answer["result"] is True
        answer = await master.ask("/SyncModeWaitForTick", user_id="master", frame=i + 1)
        assert answer["frame"] == i + 1
    for topic in ("/Ego_topic", "/Object_topic"):
        for _ in range(NUM_TICKS):
            await watcher.message(topic)
    return watcher.raw


async def test_two_runs_give_the_same_bytes(simulate: Simulate, connect: Connect) -> None:
    first = await record_drive(simulate("--start", "sync").url, connect)
    second = await record_drive(simulate("--start", "sync").url, connect)
    assert len(first) >= 2 * NUM_TICKS
    assert len(set(first)) >= 2 * NUM_TICKS, "the world moved"
    assert first == second
