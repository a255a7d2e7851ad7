"""How recordings are found by name and read in a thread, and what a server makes of them."""

from __future__ import annotations

import asyncio
import shutil
from pathlib import Path
from typing import Any

import pytest

from rosbridge_sim import DocumentError, Simulator
from rosbridge_sim.morai.messages.convert import Converter
from rosbridge_sim.shell.bags.recordings import DiskRecordings, find_recording
from rosbridge_sim.shell.files.definitions import read_definitions
from rosbridge_sim.simulator.replays.recorded_drive import Recording
from rosbridge_sim.simulator.replays.recording_builder import RecordingBuilder
from tests.conftest import Connect
from tests.shell.bags.test_bag_reader import types_of, ways, write
from tests.support import PATIENCE, Client

FRAME_NS = 20_000_000
STATUS = "/sim/process/state/msg/MoraiSimProcStatus"
EGO, OBJECTS, INFO = "morai_msgs/EgoVehicleStatus", "morai_msgs/ObjectStatusList", "morai_msgs/ReplayInfo"

# Names


def test_recordings_are_found_in_the_data_folder(tmp_path: Path) -> None:
    data = tmp_path / "data"
    for place in ("Replay/a.bag", "b.mcap", "day/c.bag", "folder/metadata.yaml"):
        (data / place).parent.mkdir(parents=True, exist_ok=True)
        (data / place).touch()
    for name, found in {
        "a": "Replay/a.bag",
        "a.bag": "Replay/a.bag",
        "b": "b.mcap",
        "day/c": "day/c.bag",
        "day\\c.bag": "day/c.bag",
        "folder": "folder",
        str(data / "b.mcap"): "b.mcap",
        "SaveFile/b.mcap": "b.mcap",
        "SaveFile/Replay/a": "Replay/a.bag",
    }.items():
        assert find_recording(data, name) == data / found
    with pytest.raises(
        DocumentError, match=r"no recording 'x' in --data-dir \(.*\); known are a\.bag, b\.mcap, folder$"
    ):
        find_recording(data, "x")
    with pytest.raises(DocumentError, match="known are none"):
        find_recording(tmp_path / "nowhere", "x")


def test_recording_name_outside_the_data_folder_is_refused(tmp_path: Path) -> None:
    data = tmp_path / "data"
    data.mkdir()
    secret = tmp_path / "secret.bag"
    secret.touch()
    (data / "link.bag").symlink_to(secret)
    (data / "out").symlink_to(tmp_path)
    for name in (
        "../secret",
        "../secret.bag",
        str(secret),
        "link",
        "out/secret.bag",
        "day/../../secret",
        "..",
        "/",
        f"SaveFile/{secret}",
    ):
        with pytest.raises(DocumentError, match="leads out of --data-dir"):
            find_recording(data, name)
    for name in ("", "  ", "a\0b", "a\nb", "x" * 500):
        with pytest.raises(DocumentError, match="is not a recording's name"):
            find_recording(data, name)
    for name in (".", "Replay", "x" * 300):
        with pytest.raises(DocumentError, match="no recording"):
            find_recording(data, name)


# The whole


async def command(client: Client, status: int, option: int = 0, name: str = "", **fields: int) -> bool:
    answer = await client.ask(
        "/Morai_SimProc", sim_process_status=status, replay_option=option, rosbag_file_name=name, **fields
    )
    return bool(answer["result"])


async def tick(client: Client) -> dict[str, Any]:
    status: dict[str, Any] = (await client.ask("/SyncModeWaitForTick", user_id="me"))["vehicle_status"]
    return {key: value for key, value in status.items() if key != "header"}


@pytest.mark.slow
@pytest.mark.parametrize("name", ["drive.bag", "drive.mcap", "drive"])
async def test_bag_of_one_server_is_replayed_by_another(tmp_path: Path, connect: Connect, name: str) -> None:
    async with Simulator(port=0, start="sync", data_dir=tmp_path / "data", record=tmp_path / "data" / name) as sim:
        client = await connect(sim.url)
        await client.ask("/SyncModeCmd", user_id="me", start_sync_mode=True)
        driven = []
        for i in range(30):
            await client.ask("/SyncModeCtrlCmd", command={"longlCmdType": 1, "accel": 0.7, "steering": 0.01 * i})
            driven.append(await tick(client))
    async with Simulator(port=0, start="sync", data_dir=tmp_path / "data", scenario="town") as sim:
        client = await connect(sim.url)
        await client.send("subscribe", topic=STATUS)
        await client.ask("/SyncModeCmd", user_id="me", start_sync_mode=True)
        assert await command(client, 1, 1, "drive")
        assert [await tick(client) for _ in range(30)] == driven
        ended = await client.message_where(STATUS, lambda status: status["current_status"] == 32)
        assert (ended["command_result"], ended["current_mode"]) == (1, 16)
        assert await command(client, 32)
    assert driven[-1]["velocity"]["x"] > 0.9


@pytest.mark.slow
@pytest.mark.parametrize("name", ["drive.bag", "drive.mcap"])
async def test_plans_of_programs_are_replayed_beside_the_drive(tmp_path: Path, connect: Connect, name: str) -> None:
    topics = ("/Ego_topic", "/plan/*", "/clock")
    folder = tmp_path / "data"
    async with Simulator(port=0, start="sync", data_dir=folder, record=folder / name, record_topics=topics) as sim:
        client = await connect(sim.url)
        await client.send("advertise", topic="/plan/path", type="nav_msgs/Path")
        await client.send("advertise", topic="/plan/marks", type="visualization_msgs/MarkerArray")
        await client.ask("/SyncModeCmd", user_id="me", start_sync_mode=True)
        for i in range(20):
            if i % 5 == 0:  # at frames 1, 6, 11 and 16
                path = {"header": {"frame_id": "map"}, "poses": [{"pose": {"position": {"x": float(i)}}}]}
                await client.send("publish", topic="/plan/path", msg=path)
                marks = {"markers": [{"ns": "candidates", "id": i, "colors": [{"r": 1.0}]}]}
                await client.send("publish", topic="/plan/marks", msg=marks)
            await tick(client)
    async with Simulator(port=0, start="sync", data_dir=folder) as sim:
        client = await connect(sim.url)
        await client.send("subscribe", topic="/plan/path", type="nav_msgs/Path")
        await client.send("subscribe", topic="/plan/marks", type="visualization_msgs/MarkerArray")
        await client.ask("/SyncModeCmd", user_id="me", start_sync_mode=True)
        assert await command(client, 1, 1, "drive")
        for _ in range(12):
            await tick(client)
        xs = [(await client.message("/plan/path"))["poses"][0]["pose"]["position"]["x"] for _ in range(3)]
        assert xs == [0.0, 5.0, 10.0]
        assert [(await client.message("/plan/marks"))["markers"][0]["id"] for _ in range(3)] == [0, 5, 10]
        publishers = (await client.values("/rosapi/publishers", {"topic": "/plan/path"}))["publishers"]
        assert publishers == ["/replay"]  # as a program that publishes them, and not as the simulator
        assert await command(client, 32)
        assert not (await client.values("/rosapi/publishers", {"topic": "/plan/path"}))["publishers"]


async def test_unusable_recording_has_its_result_code(
    tmp_path: Path, connect: Connect, caplog: pytest.LogCaptureFixture
) -> None:
    (tmp_path / "broken.bag").write_bytes(b"no bag at all")
    write(tmp_path / "chat.bag", {"/chatter": ("std_msgs/String", [{"data": "x"}])})
    async with Simulator(port=0, start="sync", data_dir=tmp_path) as sim:
        client = await connect(sim.url)
        await client.send("subscribe", topic=STATUS)
        for name, code, why in (
            ("broken.bag", 32, "broken.bag: is not a bag, or has no index"),
            ("../x.bag", 32, "'../x.bag' leads out of --data-dir"),
            ("chat", 48, "it holds no ego and no objects that can be replayed"),
        ):
            assert not await command(client, 1, 1, name)
            status = await client.take("status", level="error")
            assert why in status["msg"]
            assert any(why in line for line in caplog.messages)
            await client.message_where(STATUS, lambda message, code=code: message["command_result"] == code)  # type: ignore[misc] # mypy cannot infer a default


async def test_stopping_server_does_not_wait_for_a_read(tmp_path: Path) -> None:
    path = write(tmp_path / "a.bag", {"/Ego_topic": (EGO, ways(*range(500)))})
    shutil.copy(path, tmp_path / "b.bag")
    texts = read_definitions("22.R2")
    recordings = DiskRecordings(tmp_path, texts, asyncio.get_running_loop())
    taken: list[object] = []
    done = asyncio.Event()
    recordings.reader.on_done = done.set
    convert = Converter(types_of("22.R2"))
    recordings.read("a", RecordingBuilder("a", convert), lambda outcome, _now: taken.append(outcome))
    await done.wait()
    assert isinstance(taken.pop(), Recording)
    recordings.read("b", RecordingBuilder("b", convert), lambda outcome, _now: taken.append(outcome))
    recordings.reader.stop()
    await asyncio.sleep(0)
    assert not taken


async def test_failed_use_of_a_recording_does_not_block_the_next_one(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    write(tmp_path / "a.bag", {"/Ego_topic": (EGO, ways(1.0))})
    texts = read_definitions("22.R2")
    recordings = DiskRecordings(tmp_path, texts, asyncio.get_running_loop())
    done = asyncio.Event()
    recordings.reader.on_done = done.set
    convert = Converter(types_of("22.R2"))

    def fail(_outcome: object, _now: float) -> None:
        raise ZeroDivisionError

    taken: list[object] = []
    for then in (fail, lambda outcome, _now: taken.append(outcome)):
        recordings.read("a", RecordingBuilder("a", convert), then)
        async with asyncio.timeout(PATIENCE):
            await done.wait()
        done.clear()
    assert isinstance(taken.pop(), Recording)
    assert recordings.reader.num_bugs == 1
    assert [record.exc_info is not None for record in caplog.records] == [True]
