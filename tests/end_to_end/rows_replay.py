"""Rows: recorded drives."""

from __future__ import annotations

import json
import math

import pytest

from tests.end_to_end.table_rows import ME, Message, SceneClient, Table
from tests.support import Client, ServerProcess

__all__ = ["TABLE"]

TABLE = Table()

PLAY, PAUSE, STOP = 1, 2, 32
FILE, TARGETS, START, SPEED = 1, 2, 4, 8
STATUS = "/sim/process/state/msg/MoraiSimProcStatus"


async def _record(play: SceneClient) -> list[Message]:
    """The ego's statuses of a drive of three seconds, which lies as `drive` where replays are looked for."""
    bag, notes = play.data / "drive.mcap", play.data / "drive.json"
    if not notes.exists():
        play.data.mkdir(exist_ok=True)
        flags = ("--release", play.release, "--start", "sync", "--scenario", str(play.data.parent / "page.json"))
        server = ServerProcess(play.data / "record.txt", (*flags, "--record", str(bag)))
        async with await Client.open(server.url) as client:
            recorder = SceneClient(client, play.release, play.data)
            await recorder.begin()
            await recorder.lead(500)
            await recorder.listen("/Ego_topic")
            await recorder.control(longlCmdType=1, accel=0.8, steering=0.05)
            await recorder.tick(3.0)
            notes.write_text(json.dumps(recorder.heard("/Ego_topic")))
        server.stop_cleanly()
    drive: list[Message] = json.loads(notes.read_text())
    return drive


async def _command(play: SceneClient, status: int, *, is_fine: bool = True, **options: object) -> None:
    answer = await play.ask("/Morai_SimProc", sim_process_status=status, **options)
    assert answer["result"] is is_fine


def _motion(statuses: list[Message]) -> list[Message]:
    """The recorded fields: without the stamp, and without the tyres, whose readings a played ego does not have."""
    names = [name for name in statuses[0] if not name.startswith(("header", "tire_", "side_slip_"))]
    return [{name: status[name] for name in names} for status in statuses]


@TABLE.row(
    "/Morai_SimProc",
    done="a recorded drive is loaded and played, paused, played on, then from its first second twice as fast, stopped",
    seen="/Ego_topic says what was recorded, frame by frame; nothing moves while paused; stop: the scene as it was",
)
async def _(play: SceneClient) -> None:
    drive = _motion(await _record(play))
    await play.lead(500)
    await play.put(200.0, 300.0)
    before = await play.tick()
    await play.listen("/Ego_topic", "/Object_topic")
    await _command(play, PLAY, replay_option=FILE, rosbag_file_name="drive")
    await play.tick(1.0)
    assert _motion(play.heard("/Ego_topic")) == drive[:50]
    places = [one["position"]["x"] for one in play.last("/Object_topic")["npc_list"] if one["unique_id"] == 7]
    assert places == [pytest.approx(10.0)], "a second of the car at 36 km/h"
    await _command(play, PAUSE)
    refused = await play.ask("/SyncModeWaitForTick", user_id=ME, frame=0)
    assert (refused["tick_status"], refused["pause_status"]) == (False, True)
    await _command(play, PLAY)
    await play.tick(0.5)
    assert _motion(play.heard("/Ego_topic")) == drive[50:75]
    await _command(play, PLAY, replay_option=START + SPEED, start_time=1000, replay_speed=2)
    await play.tick(0.5)
    assert _motion(play.heard("/Ego_topic")) == drive[50:100:2]
    await _command(play, STOP)
    assert (await play.tick())["position"] == before["position"]
    await _command(play, PLAY, replay_option=FILE, rosbag_file_name="nowhere", is_fine=False)
    await _command(play, 77, is_fine=False)


@TABLE.row(
    "/ReplayInfo_topic",
    done="a recorded drive is played; then a client publishes the topic itself, with a car that nobody had",
    seen="pedals, wheels (deg), turn and objects of the drive; and from the client's on, /Object_topic has its car",
)
async def _(play: SceneClient) -> None:
    drive = await _record(play)
    await play.lead(500)
    await play.listen("/ReplayInfo_topic", "/Object_topic")
    await _command(play, PLAY, replay_option=FILE, rosbag_file_name="drive")
    play.client.inbox.clear()
    await play.tick(2.0)
    said = play.heard("/ReplayInfo_topic")
    assert len(said) == 100
    last, then = said[-1], drive[99]
    assert (last["ego_acc"], last["ego_brake"]) == pytest.approx((0.8, 0.0))
    assert last["ego_steer"] == pytest.approx(math.degrees(0.05), abs=0.01)
    assert last["linear_acceleration"]["x"] == pytest.approx(then["acceleration"]["x"], abs=1e-6)
    heading = 2.0 * math.degrees(math.atan2(last["orientation"]["z"], last["orientation"]["w"]))
    assert heading == pytest.approx(then["heading"], abs=1e-6)
    assert last["npc_list"] == play.last("/Object_topic")["npc_list"]
    assert [last[f"num_of_{name}"] for name in ("npcs", "pedestrian", "obstacle")] == [3, 1, 1]
    await _command(play, STOP)
    await play.tick()  # else ours has the stamp of the simulator's last one, and is taken for its echo

    car = {"unique_id": 60, "type": 1, "name": "Van", "heading": 90.0, "position": {"x": 7.0, "y": 350.0, "z": 0.0}}
    await play.send("/ReplayInfo_topic", num_of_npcs=1, npc_list=[car])
    await play.tick()
    seen = [(one["name"], one["position"]["x"], one["heading"]) for one in play.last("/Object_topic")["npc_list"]]
    assert ("Van", 7.0, pytest.approx(90.0)) in seen
    await _command(play, STOP)


@TABLE.row(
    STATUS,
    done="commands that can be, that cannot, for a bag that is there and for some that are none; a replay to its end",
    seen="mode, state and result by the manual's codes, and when the last command came",
)
async def _(play: SceneClient) -> None:
    await _record(play)
    (play.data / "torn.mcap").write_bytes(b"no bag")
    await play.listen(STATUS)

    async def look() -> tuple[int, int, int]:
        play.client.inbox.clear()
        await play.client.send("unsubscribe", topic=STATUS)
        await play.client.send("subscribe", topic=STATUS)
        said = await play.client.message(STATUS)
        return said["command_result"], said["current_mode"], said["current_status"]

    await play.tick()
    assert play.last(STATUS)["header"]["frame_id"] == "SimProcStatus"
    assert (await look())[1:] == (0x01, 0x01)
    await _command(play, PLAY, replay_option=FILE, rosbag_file_name="torn", is_fine=False)
    assert await look() == (0x20, 0x01, 0x01)
    await _command(play, PLAY, replay_option=SPEED, replay_speed=99, is_fine=False)
    assert await look() == (0x10, 0x01, 0x01)
    await play.tick(0.5)
    await _command(play, PLAY, replay_option=FILE, rosbag_file_name="drive")
    assert await look() == (0x01, 0x10, 0x01)
    await play.tick(0.5)
    said = play.last(STATUS)
    time = said["latest_command_time"]
    assert time["secs"] + time["nsecs"] * 1e-9 == pytest.approx(0.52)
    await _command(play, PAUSE)
    assert await look() == (0x01, 0x10, 0x10)
    await _command(play, PLAY, replay_option=START, start_time=2900)
    ticks = [await play.ask("/SyncModeWaitForTick", user_id=ME, frame=0) for _ in range(20)]
    assert not ticks[-1]["tick_status"], "it has paused itself"
    assert await look() == (0x01, 0x10, 0x20)
    await _command(play, STOP)
    assert (await look())[:2] == (0x01, 0x01)
