"""Rows: synchronous mode."""

from __future__ import annotations

import math
from itertools import pairwise

import pytest

from tests.end_to_end.rows_scene import WHOLE, write_networks
from tests.end_to_end.table_rows import ME, SceneClient, Table

__all__ = ["TABLE"]

TABLE = Table()

OLDER, NEWER = ("22.R2",), ("26.R1",)


@TABLE.row(
    "/SyncModeCmd",
    done="the mode is turned off and on again, by its master, by another, with an empty id and with a step of 30 ms",
    seen="off: time passes by itself; on: it stands; another's wish and the odd step are false and change nothing",
)
async def _(play: SceneClient) -> None:
    await play.listen("/Ego_topic")
    assert await _is_time_standing(play)
    await play.let_go()
    first = await play.client.message("/Ego_topic")
    await play.client.message_where("/Ego_topic", lambda status: status["header"]["seq"] >= first["header"]["seq"] + 5)
    answer = await play.ask("/SyncModeCmd", user_id="", start_sync_mode=True, time_step=40)
    mine = answer["user_id"]
    assert (answer["result"], answer["time_step"], mine != "") == (True, 40, True)
    assert await _is_time_standing(play)
    for request in ({"user_id": "other", "time_step": 20}, {"user_id": mine, "time_step": 30}):
        refused = await play.ask("/SyncModeCmd", start_sync_mode=True, **request)
        assert (refused["result"], refused["time_step"], refused["frame"]) == (False, 40, answer["frame"])
    assert (await play.ask("/SyncModeCmd", user_id="other", start_sync_mode=False))["result"] is False
    assert (await play.ask("/SyncModeCmd", user_id=mine, start_sync_mode=False))["result"] is True


async def _is_time_standing(play: SceneClient) -> bool:
    """Whether no frame goes by while the simulator answers a few calls: a stranger's ticks, which it refuses."""
    answers = [await play.ask("/SyncModeWaitForTick", user_id="stranger") for _ in range(10)]
    return bool(answers[0]["frame"] == answers[-1]["frame"])


@TABLE.row(
    "/SyncModeWaitForTick",
    done="ticks with steps of 20 and 100 ms, for right and wrong frames, by the master and by another",
    seen="each moves the world by just its step, with the ego after it; another's moves nothing",
)
async def _(play: SceneClient) -> None:
    await play.control(longlCmdType=1, accel=1.0)
    for step_ms, named in ((20, 1), (100, 6), (100, 3), (100, 2.0), (100, 99)):
        await play.lead(step_ms)
        answer = await play.ask("/SyncModeWaitForTick", user_id=ME, frame=named)
        assert (answer["tick_status"], answer["pause_status"]) == (True, False)
        assert answer["frame"] == play.frame + step_ms // 20
        assert answer["time"] == f"{answer['frame'] * 0.02:.2f}"
        assert answer["vehicle_status"]["header"]["seq"] == answer["frame"]
        play.frame = answer["frame"]
    assert answer["vehicle_status"]["position"]["x"] > -86.0
    refused = await play.ask("/SyncModeWaitForTick", user_id="other", frame=play.frame + 1)
    assert (refused["tick_status"], refused["frame"]) == (False, play.frame)
    assert refused["vehicle_status"] == answer["vehicle_status"]


@TABLE.row(
    "/SyncModeCtrlCmd",
    done="full throttle for the frame ten frames on, and full brake for fifty frames after it",
    seen="the ego stands until then, speeds up from that very frame on, and brakes from that very frame on",
)
async def _(play: SceneClient) -> None:
    await play.listen("/Ego_topic")
    for frame, command in ((11, {"longlCmdType": 1, "accel": 1.0}), (61, {"longlCmdType": 1, "brake": 1.0})):
        answer = await play.ask("/SyncModeCtrlCmd", frame=frame, command=command, sensor_capture=False)
        assert answer["result"] is True
    await play.tick(1.4)
    speeds, gains = (
        [status[figure]["x"] for status in play.heard("/Ego_topic")] for figure in ("velocity", "acceleration")
    )
    assert speeds[:10] == [0.0] * 10
    assert all(after > before for before, after in pairwise(speeds[9:60]))
    assert all(after < before for before, after in pairwise(gains[59:])), "the pressure of the brake rises"
    assert (gains[59] > 3.0, gains[-1] < -5.0, speeds[-1] < speeds[59]) == (True, True, True)
    await play.let_go()
    off = await play.ask("/SyncModeCtrlCmd", frame=0, command={"accel": 1.0}, sensor_capture=False)
    assert off["result"] is False
    await play.lead()


@TABLE.row(
    "/SyncModeSetGear",
    done="R while it stands, throttle; D while it rolls; D when it stands again",
    seen="it goes backwards; at speed the answer is false and the gear stays R; then it goes forwards",
)
async def _(play: SceneClient) -> None:
    async def shift(gear: int, *, is_accepted: bool = True) -> int:
        answer = await play.ask("/SyncModeSetGear", gear=gear, frame=play.frame + 1)
        assert answer["result"] is is_accepted
        await play.tick()
        reached: int = (await play.ask("/Service_MoraiEventCmd", option=0))["gear"]
        return reached

    await play.lead(100)
    assert await shift(2) == 2
    await play.control(longlCmdType=1, accel=0.5)
    assert (await play.tick(1.0))["velocity"]["x"] < -0.5
    assert await shift(4, is_accepted=False) == 2
    await play.control(longlCmdType=1, brake=1.0)
    await play.tick(2.0)
    assert await shift(4) == 4
    await play.control(longlCmdType=1, accel=0.5)
    assert (await play.tick(1.0))["velocity"]["x"] > 0.5


@TABLE.row(
    "/SyncModeScenarioLoad",
    done="a scenario for the frame six frames on, by the manual's names; one that there is not; one's network settings",
    seen="till then all is as it was, at that very frame it has the stage, or a topic its name; the other: false",
)
async def _(play: SceneClient) -> None:
    await play.listen("/Ego_topic", "/Object_topic")
    options = dict(WHOLE)
    options["load_network_connection"] = options.pop("load_network_connection_data")
    answer = await play.ask("/SyncModeScenarioLoad", frame=6, file_name="elsewhere", **options)
    assert answer["result"] is True
    await play.tick(0.2)
    places = [status["position"]["x"] for status in play.heard("/Ego_topic")]
    assert places == [-86.0] * 5 + [-5.25] * 5
    assert [said["num_of_pedestrian"] for said in play.heard("/Object_topic")] == [1] * 5 + [2] * 5
    assert play.frame == 10, "frames go on counting"
    answer = await play.ask("/SyncModeScenarioLoad", frame=11, file_name="nowhere", **options)
    assert answer["result"] is False

    write_networks(play.data)
    await play.client.send("subscribe", topic="/inertia", type="sensor_msgs/Imu")
    for name, frame in (("elsewhere", 16), ("page", 21)):
        only = dict.fromkeys(options, False) | {"load_network_connection": True}
        assert (await play.ask("/SyncModeScenarioLoad", frame=frame, file_name=name, **only))["result"] is True
    await play.tick(0.3)
    assert [said["header"]["seq"] for said in play.heard("/inertia")] == list(range(16, 21))


@TABLE.row(
    "/SyncModeInfo",
    done="the mode is on, ticked, paused, and off",
    seen="master, mode, frame and whether a tick may be sent, at once for who comes late, and at each change",
)
async def _(play: SceneClient) -> None:
    await play.tick(0.1)
    await play.client.send("subscribe", topic="/SyncModeInfo")
    expected = {"master_id": ME, "status": True, "frame": 5, "can_send_tick": True}
    assert await play.client.message("/SyncModeInfo") == expected
    await play.tick()
    assert play.last("/SyncModeInfo") == expected | {"frame": 6}
    play.client.inbox.clear()
    await play.ask("/Service_MoraiEventCmd", option=8, set_pause=True)
    assert play.last("/SyncModeInfo") == expected | {"frame": 6, "can_send_tick": False}
    await play.ask("/Service_MoraiEventCmd", option=8, set_pause=False)
    play.client.inbox.clear()
    await play.let_go()
    said = play.heard("/SyncModeInfo")[0]
    assert (said["master_id"], said["status"], said["can_send_tick"]) == ("", False, False)
    await play.lead()


async def _bring_and_take(play: SceneClient, *, by_service: bool) -> None:
    """A van comes at frame 6 and goes at frame 16, by either release's way."""
    add, remove = (
        ("/SyncModeAddObject", "/SyncModeRemoveObject") if by_service else ("/SyncModeAddObj", "/SyncModeRemoveObj")
    )

    async def tell(topic_or_service: str, **request: object) -> None:
        if by_service:
            assert (await play.ask(topic_or_service, **request))["result"] is True
        else:
            await play.send(topic_or_service, **request)

    await play.listen("/Object_topic")
    await tell(add, name="Van", position={"x": 100.0, "y": 350.0, "z": 1.0}, heading=45.0, frame=6)
    await play.tick(0.2)
    assert [said["num_of_npcs"] for said in play.heard("/Object_topic")] == [3] * 5 + [4] * 5
    van = play.last("/Object_topic")["npc_list"][-1]
    assert (van["name"], van["heading"]) == ("Van", pytest.approx(45.0))
    assert van["position"] == {"x": 100.0, "y": 350.0, "z": 1.0}
    await tell(remove, unique_id=van["unique_id"], frame=16)
    await play.tick(0.2)
    assert [said["num_of_npcs"] for said in play.heard("/Object_topic")] == [4] * 5 + [3] * 5


async def _run_into(play: SceneClient, add: str, *, by_service: bool) -> None:
    """What was added stands there: the ego touches it."""
    request = {"name": "Cargo_Box", "position": {"x": -70.0, "y": -5.25, "z": 0.0}, "heading": 0.0, "frame": 0}
    if by_service:
        assert (await play.ask(add, **request))["result"] is True
    else:
        await play.send(add, **request)
    await play.lead(500)
    await play.listen("/CollisionData")
    await play.control(longlCmdType=1, accel=1.0)
    await play.tick(4.0)
    names = {one["name"] for said in play.heard("/CollisionData") for one in said["collision_object"]}
    assert names == {"Cargo_Box"}
    assert math.isclose(play.heard("/CollisionData")[0]["global_offset_x"], 0.0)


for _add, _remove, _by_service, _releases in (
    ("/SyncModeAddObj", "/SyncModeRemoveObj", False, OLDER),
    ("/SyncModeAddObject", "/SyncModeRemoveObject", True, NEWER),
):

    @TABLE.row(
        _add,
        done="a box is laid onto the ego's lane and the ego driven into it",
        seen="/CollisionData names the box",
        releases=_releases,
    )
    async def _(play: SceneClient, add: str = _add, by_service: bool = _by_service) -> None:  # noqa: FBT001 - of the row
        await _run_into(play, add, by_service=by_service)

    @TABLE.row(
        _remove,
        done="a van is brought for frame 6 and taken away for frame 16",
        seen="/Object_topic has it from the one frame to the other",
        releases=_releases,
    )
    async def _(play: SceneClient, by_service: bool = _by_service) -> None:  # noqa: FBT001 - of the row
        await _bring_and_take(play, by_service=by_service)
