"""Sudden loss of the master: the world goes on as `--sync-on-loss` says."""

from __future__ import annotations

import pytest

from tests.conftest import Connect, Serve, Simulate
from tests.support import Client

pytestmark = pytest.mark.slow


async def lose_master(serve: Serve, connect: Connect, on_loss: str) -> tuple[Client, str, int]:
    """A watcher of SyncModeInfo, the server's address, and the frame at which the master's socket was cut."""
    url = serve("--start", "sync", "--sync-on-loss", on_loss).url
    watcher, master = await connect(url), await connect(url)
    await watcher.subscribe("/SyncModeInfo", type="morai_msgs/SyncModeInfo")
    await master.ask("/SyncModeCmd", user_id="first", start_sync_mode=True, time_step=20)
    await master.ask("/SyncModeCtrlCmd", frame=1, command={"longlCmdType": 2, "velocity": 20.0}, sensor_capture=False)
    for i in range(20):
        answer = await master.ask("/SyncModeWaitForTick", user_id="first", frame=i + 1)
    await watcher.message_where("/SyncModeInfo", lambda info: info["master_id"] == "first" and info["frame"] == 20)
    master.cut()
    return watcher, url, answer["frame"]


async def become_master(client: Client) -> int:
    """The frame at which the next master takes over."""
    answer = await client.ask("/SyncModeCmd", user_id="second", start_sync_mode=True, time_step=20)
    assert answer["result"] is True
    assert answer["user_id"] == "second"
    frame: int = answer["frame"]
    return frame


async def test_lost_master_with_run_lets_the_world_run_in_real_time(serve: Serve, connect: Connect) -> None:
    watcher, url, frame = await lose_master(serve, connect, "run")
    info = await watcher.message_where("/SyncModeInfo", lambda info: not info["master_id"])
    assert info["status"] is False
    await watcher.subscribe("/Ego_topic", type="morai_msgs/EgoVehicleStatus")
    first = await watcher.message("/Ego_topic")
    later = await watcher.message_where("/Ego_topic", lambda m: m["header"]["seq"] >= first["header"]["seq"] + 10)
    assert later["position"] != first["position"], "the last command holds, so the car drives on"
    client = await connect(url)
    taken_at = await become_master(client)
    assert taken_at > frame
    answer = await client.ask("/SyncModeWaitForTick", user_id="second", frame=taken_at + 1)
    assert (answer["tick_status"], answer["frame"]) == (True, taken_at + 1)


async def test_lost_master_with_pause_leaves_the_world_paused(serve: Serve, connect: Connect) -> None:
    watcher, url, frame = await lose_master(serve, connect, "pause")
    info = await watcher.message_where("/SyncModeInfo", lambda info: not info["master_id"])
    assert (info["status"], info["frame"], info["can_send_tick"]) == (False, frame, False)
    client = await connect(url)
    assert await become_master(client) == frame, "nothing has moved"
    answer = await client.ask("/SyncModeWaitForTick", user_id="second", frame=frame + 1)
    assert (answer["tick_status"], answer["pause_status"], answer["frame"]) == (False, True, frame)
    state = await client.ask("/Service_MoraiEventCmd", option=8, set_pause=False)
    assert state["set_pause"] is False
    answer = await client.ask("/SyncModeWaitForTick", user_id="second", frame=frame + 1)
    assert (answer["tick_status"], answer["pause_status"], answer["frame"]) == (True, False, frame + 1)


async def test_lost_master_with_wait_stops_the_world_until_the_next_master(serve: Serve, connect: Connect) -> None:
    watcher, url, frame = await lose_master(serve, connect, "wait")
    info = await watcher.message_where("/SyncModeInfo", lambda info: not info["master_id"])
    assert (info["status"], info["frame"], info["can_send_tick"]) == (True, frame, False)
    client = await connect(url)
    assert await become_master(client) == frame, "nothing has moved"
    answer = await client.ask("/SyncModeWaitForTick", user_id="second", frame=frame + 1)
    assert (answer["tick_status"], answer["frame"]) == (True, frame + 1)


async def test_silent_master_is_lost_when_its_lease_ends(simulate: Simulate, connect: Connect) -> None:
    url = simulate("--sync-lease", "0.2", "--sync-on-loss", "wait").url
    client = await connect(url)
    await client.subscribe("/SyncModeInfo", type="morai_msgs/SyncModeInfo")
    await client.ask("/SyncModeCmd", user_id="silent", start_sync_mode=True, time_step=20)
    await client.message_where("/SyncModeInfo", lambda info: info["master_id"] == "silent")
    info = await client.message_where("/SyncModeInfo", lambda info: not info["master_id"])
    assert info["status"] is True
