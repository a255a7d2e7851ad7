"""The orders in which programs in the field call the simulator, each driven over a real socket.

They differ in which frame they name, when they set a gear or load a scenario, and how they go by what comes
back. All of them are expected to drive: each tick is accepted and moves one time step, and the car goes where
it is told.
"""

from __future__ import annotations

import math
from typing import Any

import pytest

from tests.conftest import Connect, Simulate
from tests.support import Client

pytestmark = pytest.mark.slow

everywhere = pytest.mark.parametrize("simulate", ["serve", "attach", "quirks"], indirect=True)
"""Also behind rosbridge_suite, which takes no float for an integer and promises no order between topics and answers."""

FULL_THROTTLE = {"accel": 1.0, "brake": 0.0, "steering": 0.0}
"""Commands of the official programs never set longlCmdType."""

SCENARIO = {
    "file_name": "demo",
    "delete_all": True,
    "load_network_connection_data": False,
    "load_ego_vehicle_data": True,
    "load_surrounding_vehicle_data": True,
    "load_pedestrian_data": True,
    "load_obstacle_data": True,
    "set_pause": False,
}


def place(status: dict[str, Any]) -> tuple[float, float]:
    return status["position"]["x"], status["position"]["y"]


async def start(client: Client, user_id: str = "", step_ms: int = 20) -> dict[str, Any]:
    answer = await client.ask("/SyncModeCmd", user_id=user_id, start_sync_mode=True, time_step=step_ms)
    assert answer["result"] is True
    assert answer["time_step"] == step_ms
    assert answer["user_id"], "an id was given or made"
    return answer


async def stop(client: Client, user_id: str, step_ms: int = 20) -> None:
    answer = await client.ask("/SyncModeCmd", user_id=user_id, start_sync_mode=False, time_step=step_ms)
    assert answer["result"] is True


async def control(client: Client, frame: float, command: dict[str, float]) -> None:
    answer = await client.ask("/SyncModeCtrlCmd", frame=frame, command=command, sensor_capture=False)
    assert answer["result"] is True


async def tick(client: Client, user_id: str, frame: float) -> dict[str, Any]:
    answer = await client.ask("/SyncModeWaitForTick", user_id=user_id, frame=frame)
    assert answer["tick_status"] is True
    assert answer["pause_status"] is False
    return answer


@everywhere
@pytest.mark.parametrize("step_ms", [20, 40])
async def test_planner_that_counts_frames_itself_drives(simulate: Simulate, connect: Connect, step_ms: int) -> None:
    """Start, tick, then control and tick for a frame that it counts by itself; no gear, no control type."""
    client = await connect(simulate("--start", "sync").url)
    started = await start(client, step_ms=step_ms)
    user_id = started["user_id"]
    next_frame = started["frame"] + 1  # ends one frame early with a step of 40: nobody may mind
    first = await tick(client, user_id, next_frame)
    assert first["frame"] == started["frame"] + step_ms // 20
    last = first
    for _ in range(100):
        next_frame += step_ms // 20
        await control(client, next_frame, FULL_THROTTLE)
        answer = await tick(client, user_id, next_frame)
        assert answer["frame"] == last["frame"] + step_ms // 20
        last = answer
    assert math.dist(place(first["vehicle_status"]), place(last["vehicle_status"])) > 3.0
    assert last["vehicle_status"]["velocity"]["x"] > 2.0
    await stop(client, user_id, step_ms)


async def test_planner_that_loads_a_scenario_and_sets_the_gear_drives(simulate: Simulate, connect: Connect) -> None:
    """Scenario and gear for the frame to come, then its tick; frames may come as floats."""
    client = await connect(simulate().url)
    started = await start(client)
    user_id, next_frame = started["user_id"], float(started["frame"]) + 2.0 / 2
    assert (await client.ask("/SyncModeScenarioLoad", frame=next_frame, **SCENARIO))["result"] is True
    assert (await client.ask("/SyncModeSetGear", frame=next_frame, gear=4))["result"] is True
    first = answer = await tick(client, user_id, next_frame)
    for _ in range(100):
        next_frame = answer["frame"] + 1
        await control(client, next_frame, FULL_THROTTLE)
        answer = await tick(client, user_id, next_frame)
        assert answer["frame"] == next_frame
    assert math.dist(place(first["vehicle_status"]), place(answer["vehicle_status"])) > 3.0
    await stop(client, user_id)


@everywhere
async def test_program_with_stale_frame_numbers_drives(simulate: Simulate, connect: Connect) -> None:
    """Gear and every tick for the frame of the start, control for the current one, a scenario load in between.

    A reset is: off, scenario, on, gear, tick. Each command is followed by two ticks.
    """
    client = await connect(simulate().url)
    starts = []
    for _ in range(2):
        assert (await client.ask("/Service_MoraiSL", **SCENARIO))["result"] is True
        started = await start(client, "course")
        stale = started["frame"]
        assert (await client.ask("/SyncModeSetGear", frame=stale, gear=4))["result"] is True
        answer = await tick(client, "course", stale)
        assert answer["frame"] == stale + 1
        assert (await client.ask("/Service_MoraiSL", **SCENARIO))["result"] is True
        answer = await tick(client, "course", stale)
        starts.append(place(answer["vehicle_status"]))
        for _ in range(50):
            before = (await tick(client, "course", stale))["frame"]
            await control(client, before, {"longlCmdType": 1, "accel": 0.8, "brake": 0.0, "steering": 0.1})
            answer = await tick(client, "course", stale)
            assert answer["frame"] == before + 1
        assert math.dist(starts[-1], place(answer["vehicle_status"])) > 2.0
        await stop(client, "course")
    assert math.dist(*starts) < 0.5, "a load puts the car back to its start"


@everywhere
@pytest.mark.parametrize("frame", [0, 1])
async def test_program_with_a_constant_frame_number_drives(simulate: Simulate, connect: Connect, frame: int) -> None:
    """A learner's program: control and tick always name the same frame."""
    client = await connect(simulate("--start", "sync").url)
    started = await start(client, "learner")
    first = answer = await tick(client, "learner", frame)
    for _ in range(100):
        await control(client, frame, FULL_THROTTLE)
        answer = await tick(client, "learner", frame)
    assert answer["frame"] == started["frame"] + 101
    assert math.dist(place(first["vehicle_status"]), place(answer["vehicle_status"])) > 3.0
    await stop(client, "learner")


@everywhere
async def test_learning_loop_with_resets_drives(simulate: Simulate, connect: Connect) -> None:
    """Reinforcement learning: attaches to its own master, goes by the answer's frame, reads SyncModeInfo, cleans up."""
    step_ms = 60
    client = await connect(simulate().url)
    await client.subscribe("/SyncModeInfo", type="morai_msgs/SyncModeInfo")
    await start(client, "learner", step_ms)
    again = await client.ask("/SyncModeCmd", user_id="learner", start_sync_mode=True, time_step=step_ms)
    info = await client.message_where("/SyncModeInfo", lambda info: info["status"])
    assert again["result"] is True or info["master_id"] == "learner"
    assert info["can_send_tick"] is True
    next_frame = again["frame"] + 1
    answer = await tick(client, "learner", next_frame)
    first = answer["vehicle_status"]
    target = {"longlCmdType": 2, "velocity": 20.0, "steering": -0.2, "accel": 0.0, "brake": 0.0, "acceleration": 0.0}
    for _ in range(100):
        next_frame = answer["frame"] + step_ms // 20
        await control(client, next_frame, target)
        answer = await tick(client, "learner", next_frame)
        assert answer["frame"] == next_frame
    last = answer["vehicle_status"]
    assert last["velocity"]["x"] == pytest.approx(20.0 / 3.6, rel=0.02)
    turned = (last["heading"] - first["heading"] + 180.0) % 360.0 - 180.0
    assert turned < -5.0, "it steered to the right"
    refused = await client.ask("/SyncModeWaitForTick", user_id="somebody", frame=next_frame)
    assert refused["tick_status"] is False
    assert refused["frame"] == answer["frame"]
    await stop(client, "learner", step_ms)
    await client.message_where("/SyncModeInfo", lambda info: not info["status"])


@everywhere
async def test_gear_change_at_the_frame_of_sync_mode_info_takes_effect(simulate: Simulate, connect: Connect) -> None:
    """Synchronous mode for a change of gear alone, with a time step of 0 on start and stop."""
    client = await connect(simulate().url)
    await client.subscribe("/SyncModeInfo", type="morai_msgs/SyncModeInfo")
    frame = (await client.message("/SyncModeInfo"))["frame"]
    answer = await client.ask("/SyncModeCmd", user_id="gear", start_sync_mode=True, time_step=0)
    assert answer["result"] is True
    assert answer["time_step"] == 20
    for gear in (1, 2, 4):
        assert (await client.ask("/SyncModeSetGear", frame=frame, gear=gear))["result"] is True
        await tick(client, "gear", frame)
        state = await client.ask("/Service_MoraiEventCmd", option=0, gear=-1)
        assert state["gear"] == gear
    await stop(client, "gear", 0)


async def test_topics_of_a_tick_arrive_before_its_answer(simulate: Simulate, connect: Connect) -> None:
    client = await connect(simulate("--start", "sync").url)
    await client.subscribe("/Ego_topic", type="morai_msgs/EgoVehicleStatus")
    await start(client, "master", 60)
    for i in range(20):
        await tick(client, "master", 0)
        frames = list(client.inbox)  # what came on the way to the answer
        client.inbox.clear()
        assert [frame["topic"] for frame in frames] == ["/Ego_topic"] * 3
        assert [frame["msg"]["header"]["seq"] for frame in frames] == [3 * i + 1, 3 * i + 2, 3 * i + 3]
