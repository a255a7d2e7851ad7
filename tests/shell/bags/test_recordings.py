"""Recordings from the disk: ours and strangers', whole, broken and none; and names that lead nowhere or elsewhere."""

from __future__ import annotations

import asyncio
import shutil
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any, Literal

import pytest
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from rosbridge_sim import DocumentError, Simulator
from rosbridge_sim.morai.convert import Converter
from rosbridge_sim.morai.releases import LENIENCY
from rosbridge_sim.morai.replays.recording import EGO_COLUMNS, Recording
from rosbridge_sim.morai.replays.recording_builder import RecordingBuilder
from rosbridge_sim.schema.store import Store
from rosbridge_sim.shell.bags.bag import open_bag
from rosbridge_sim.shell.bags.recording import BagMessageWriter
from rosbridge_sim.shell.bags.recordings import DiskRecordings, find_recording, read_recording
from rosbridge_sim.shell.files.library import read_definitions
from tests.conftest import Connect
from tests.support import PATIENCE, Client

FRAME_NS = 20_000_000
STATUS = "/sim/process/state/msg/MoraiSimProcStatus"
EGO, OBJECTS, INFO = "morai_msgs/EgoVehicleStatus", "morai_msgs/ObjectStatusList", "morai_msgs/ReplayInfo"


def read(path: Path, release: str = "22.R2") -> Recording:
    texts = read_definitions(release)
    reading = RecordingBuilder(path.name, Converter(Store(texts, leniency=LENIENCY)))
    return read_recording(path, reading, texts, lambda: None)


def write(path: Path, topics: dict[str, tuple[str, list[dict[str, Any]]]], release: str = "22.R2") -> Path:
    """A bag with messages 20 ms apart on each topic."""
    ros: Literal[1, 2] = 1 if path.suffix == ".bag" else 2
    store = Store(read_definitions(release), leniency=LENIENCY, ros=ros)
    writer = BagMessageWriter(open_bag(path), store)
    for topic, (type_name, messages) in topics.items():
        writer.add(topic, type_name)
        message_type = store.message(type_name)
        for i, fields in enumerate(messages):
            raw = message_type.encode_raw(message_type.check(fields, (i + 1) * FRAME_NS))
            writer._write(topic, raw, (i + 1) * FRAME_NS)
    writer.close()
    return path


def ways(*xs: float) -> list[dict[str, Any]]:
    return [{"position": {"x": x}, "heading": 90.0, "accel": 0.5} for x in xs]


def shown(recording: Recording, index: int = 0) -> list[float]:
    return list(recording.egos[index].values[0])


# What is in a bag


@pytest.mark.parametrize("name", ["a.bag", "a.mcap", "a"])
def test_egos_and_objects_are_read(tmp_path: Path, name: str) -> None:
    objects = [{"npc_list": [{"unique_id": 4, "name": "Bus", "position": {"x": x}}]} for x in (1.0, 2.0)]
    path = write(
        tmp_path / name,
        {
            "/Ego_topic": (EGO, ways(1.0, 2.0)),
            "/Ego-3/Ego_topic": (EGO, ways(7.0)),
            "/Object_topic": (OBJECTS, objects),
            "/Ego-3/Object_topic": (OBJECTS, []),
            "/ReplayInfo_topic": (INFO, [{}]),
            "/chatter": ("std_msgs/String", [{"data": "x"}]),
        },
    )
    recording = read(path)
    assert shown(recording) == [1.0, 2.0]
    assert shown(recording, 3) == [7.0]
    assert recording.objects is not None
    assert recording.objects.values[0].tolist() == [1.0, 2.0]
    assert recording.duration_ns == FRAME_NS
    assert recording.notes == ()


@pytest.mark.parametrize("name", ["a.bag", "a.mcap"])
def test_replay_info_fills_in_what_the_others_do_not_tell(tmp_path: Path, name: str) -> None:
    info = {"ego_acc": 0.25, "npc_list": [{"unique_id": 4, "name": "Bus", "position": {"x": 9.0}}]}
    alone = read(write(tmp_path / name, {"/ReplayInfo_topic": (INFO, [info])}))
    assert not alone.egos[0].has_place
    assert alone.egos[0].values[EGO_COLUMNS.index("throttle")].tolist() == [0.25]
    assert alone.objects is not None
    both = read(write(tmp_path / f"b-{name}", {"/r": (INFO, [info]), "/e": (EGO, ways(1.0))}))
    assert both.egos[0].has_place
    assert both.objects is not None
    assert both.objects.values[0].tolist() == [9.0]


def test_of_two_topics_of_a_type_the_usual_one_is_read(tmp_path: Path) -> None:
    recording = read(write(tmp_path / "a.bag", {"/AAA": (EGO, ways(7.0)), "/Ego_topic": (EGO, ways(1.0))}))
    assert shown(recording) == [1.0]
    assert recording.notes == ("/AAA is left out: /Ego_topic is replayed",)


def test_under_names_of_ones_own_the_messages_say_whose_they_are(tmp_path: Path) -> None:
    second = [{**way, "unique_id": 2} for way in ways(7.0)]
    first = [{**way, "unique_id": -1} for way in ways(1.0)]
    recording = read(write(tmp_path / "a.bag", {"/a/second": (EGO, second), "/car/state": (EGO, first)}))
    assert (shown(recording), shown(recording, 2)) == ([1.0], [7.0])
    assert recording.notes == ()


def test_bag_without_anything_of_ours_is_empty(tmp_path: Path) -> None:
    assert read(write(tmp_path / "a.bag", {"/chatter": ("std_msgs/String", [{"data": "x"}])})).is_empty
    assert read(write(tmp_path / "b.bag", {"/Ego_topic": (EGO, [])})).is_empty


@pytest.mark.parametrize(("written", "used"), [("22.R2", "26.R1"), ("26.R1", "22.R2")])
def test_bag_of_the_other_release_is_read_by_its_own_definitions(tmp_path: Path, written: str, used: str) -> None:
    steering = "wheel_angle" if written == "22.R2" else "front_steer_angle"
    path = write(tmp_path / "a.mcap", {"/Ego_topic": (EGO, [{"position": {"x": 3.0}, steering: 0.5}])}, written)
    recording = read(path, used)
    assert shown(recording) == [3.0]
    steer = recording.egos[0].values[EGO_COLUMNS.index("steer"), 0]
    assert steer == pytest.approx(0.5 if written == "22.R2" else 0.5 * 3.14159265 / 180)


# Strangers' bags

HEADER = "=" * 80 + "\nMSG: std_msgs/Header\nuint32 seq\ntime stamp\nstring frame_id\n"
VECTOR = "=" * 80 + "\nMSG: geometry_msgs/Vector3\nfloat64 x\nfloat64 y\nfloat64 z\n"
OTHER_STATUS = (
    "Header header\nObjectStatus[] npc_list\n"
    + ("=" * 80)
    + "\nMSG: morai_msgs/ObjectStatus\nint32 unique_id\nstring name\nfloat64 heading\nfloat64 extra\n"
    "geometry_msgs/Vector3 velocity\ngeometry_msgs/Vector3 acceleration\ngeometry_msgs/Vector3 size\n"
    "geometry_msgs/Vector3 position\n"
)


def write_strange(
    path: Path,
    text: str,
    raw_of: Callable[[Typestore], bytes],
    topic: str = "/Object_topic",
    name: str = "ObjectStatusList",
) -> Path:
    """A ROS 1 bag with one message of a definition of somebody's own."""
    full_name = f"morai_msgs/msg/{name}"
    types = get_typestore(Stores.EMPTY)
    types.register(get_types_from_msg(text, full_name))
    with Writer1(path) as writer:
        connection = writer.add_connection(topic, full_name, msgdef=text, md5sum="0" * 32)
        broken = writer.add_connection("/odd", "odd_msgs/msg/Odd", msgdef="§ this is no definition", md5sum="0" * 32)
        writer.write(connection, FRAME_NS, raw_of(types))
        writer.write(broken, FRAME_NS, b"\1\2\3")
    return path


def test_other_layout_is_read_by_the_bags_own_definition(tmp_path: Path) -> None:
    def raw_of(types: Typestore) -> bytes:
        kinds: dict[str, Any] = types.types  # classes that are made at run time
        vector = kinds["geometry_msgs/msg/Vector3"]
        stamp = kinds["std_msgs/msg/Header"](0, kinds["builtin_interfaces/msg/Time"](1, 0), "")
        status = kinds["morai_msgs/msg/ObjectStatus"](
            5, "Bus", 90.0, 1.0, *(vector(float(i), float(i + 1), float(i + 2)) for i in (1, 4, 7, 10))
        )
        message = kinds["morai_msgs/msg/ObjectStatusList"](stamp, [status])
        return bytes(types.serialize_ros1(message, "morai_msgs/msg/ObjectStatusList"))

    recording = read(write_strange(tmp_path / "a.bag", OTHER_STATUS + HEADER + VECTOR, raw_of))
    assert recording.objects is not None
    assert recording.objects.values[:3, 0].tolist() == [10.0, 11.0, 12.0]
    assert recording.objects.actors[0].uid == 5


def test_message_without_the_fields_that_matter_is_told(tmp_path: Path) -> None:
    path = write_strange(tmp_path / "a.bag", "float64 x\n", lambda _types: bytes(8), "/Ego_topic", "EgoVehicleStatus")
    with pytest.raises(DocumentError, match=r"a\.bag: a message does not fit its type: /Ego_topic: .*'header'"):
        read(path)


def test_bag_without_definitions_is_read_by_those_in_use(tmp_path: Path) -> None:
    store = Store(read_definitions("26.R1"), leniency=LENIENCY, ros=2)
    message_type = store.message(EGO)
    path = tmp_path / "old"
    with Writer2(path, version=8, storage_plugin=StoragePlugin.SQLITE3) as writer:
        full_name = EGO.replace("/", "/msg/")
        connection = writer.add_connection("/Ego_topic", full_name, msgdef=store.full_text(EGO), rihs01="RIHS01_0")
        raw = message_type.encode_raw(message_type.check(ways(5.0)[0], FRAME_NS))
        writer.write(connection, FRAME_NS, raw)
    import sqlite3  # noqa: PLC0415 - takes the definitions out, as they were not in there before

    with sqlite3.connect(path / "old.db3") as database:
        database.execute("DELETE FROM message_definitions")
    database.close()
    assert shown(read(path, "26.R1")) == [5.0]


# Broken ones


@pytest.mark.parametrize("name", ["a.bag", "a.mcap"])
def test_broken_bags_are_one_readable_line(tmp_path: Path, name: str) -> None:
    whole = write(tmp_path / name, {"/Ego_topic": (EGO, ways(*range(200)))}).read_bytes()
    path = tmp_path / f"b-{name}"
    texts = []
    for content in (b"", b"no bag at all", whole[: len(whole) // 2], whole[:-20], whole[100:]):
        path.write_bytes(content)
        with pytest.raises(DocumentError) as caught:
            read(path)
        texts.append(str(caught.value))
    assert all(text.startswith(f"b-{name}: ") and "\n" not in text for text in texts)
    assert all("is no bag, or has no end" in text for text in texts[:3])


@pytest.mark.slow
def test_any_bytes_in_the_middle_give_a_recording_or_a_reason(tmp_path: Path) -> None:
    for name in ("a.bag", "a.mcap"):
        whole = write(tmp_path / name, {"/Ego_topic": (EGO, ways(*range(20)))}).read_bytes()
        for at in range(0, len(whole), len(whole) // 30):
            path = tmp_path / f"b-{name}"
            path.write_bytes(whole[:at] + b"\xff\xfe\xfd\xfc" + whole[at + 4 :])
            with suppress(DocumentError):
                assert isinstance(read(path), Recording)


# Names


def test_names_are_looked_for_in_the_data_folder(tmp_path: Path) -> None:
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


def test_names_that_lead_elsewhere_are_refused(tmp_path: Path) -> None:
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
        with pytest.raises(DocumentError, match="is no name of a recording"):
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
async def test_what_a_server_records_another_one_replays(tmp_path: Path, connect: Connect, name: str) -> None:
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
    assert driven[-1]["velocity"]["x"] > 1.0


async def test_what_cannot_be_replayed_has_its_codes(
    tmp_path: Path, connect: Connect, caplog: pytest.LogCaptureFixture
) -> None:
    (tmp_path / "broken.bag").write_bytes(b"no bag at all")
    write(tmp_path / "chat.bag", {"/chatter": ("std_msgs/String", [{"data": "x"}])})
    async with Simulator(port=0, start="sync", data_dir=tmp_path) as sim:
        client = await connect(sim.url)
        await client.send("subscribe", topic=STATUS)
        for name, code, why in (
            ("broken.bag", 32, "broken.bag: is no bag, or has no end"),
            ("../x.bag", 32, "'../x.bag' leads out of --data-dir"),
            ("chat", 48, "there is nothing in it that can be replayed"),
        ):
            assert not await command(client, 1, 1, name)
            status = await client.take("status", level="error")
            assert why in status["msg"]
            assert any(why in line for line in caplog.messages)
            await client.message_where(STATUS, lambda message, code=code: message["command_result"] == code)  # type: ignore[misc] # mypy cannot infer a default


async def test_server_that_stops_meanwhile_waits_for_nothing(tmp_path: Path) -> None:
    path = write(tmp_path / "a.bag", {"/Ego_topic": (EGO, ways(*range(500)))})
    shutil.copy(path, tmp_path / "b.bag")
    texts = read_definitions("22.R2")
    recordings = DiskRecordings(tmp_path, texts, asyncio.get_running_loop())
    taken: list[object] = []
    done = asyncio.Event()
    recordings.on_done = done.set
    convert = Converter(Store(texts, leniency=LENIENCY))
    recordings.read("a", RecordingBuilder("a", convert), lambda outcome, _now: taken.append(outcome))
    await done.wait()
    assert isinstance(taken.pop(), Recording)
    recordings.read("b", RecordingBuilder("b", convert), lambda outcome, _now: taken.append(outcome))
    recordings.stop()
    await asyncio.sleep(0)
    assert not taken


async def test_what_follows_from_a_recording_may_fail_and_the_next_one_is_read(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    write(tmp_path / "a.bag", {"/Ego_topic": (EGO, ways(1.0))})
    texts = read_definitions("22.R2")
    recordings = DiskRecordings(tmp_path, texts, asyncio.get_running_loop())
    done = asyncio.Event()
    recordings.on_done = done.set
    convert = Converter(Store(texts, leniency=LENIENCY))

    def fail(_outcome: object, _now: float) -> None:
        raise ZeroDivisionError

    taken: list[object] = []
    for then in (fail, lambda outcome, _now: taken.append(outcome)):
        recordings.read("a", RecordingBuilder("a", convert), then)
        async with asyncio.timeout(PATIENCE):
            await done.wait()
        done.clear()
    assert isinstance(taken.pop(), Recording)
    assert recordings.num_bugs == 1
    assert [record.exc_info is not None for record in caplog.records] == [True]
