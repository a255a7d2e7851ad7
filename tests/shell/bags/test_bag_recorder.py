"""A server that records: content of the bag, and failures that do not end the server."""

from __future__ import annotations

import asyncio
import json
import logging
import resource
import shutil
from pathlib import Path
from typing import Literal, NoReturn

import pytest

from rosbridge_sim import DocumentError, Simulator
from rosbridge_sim.records import replace
from rosbridge_sim.schema.message import Message
from rosbridge_sim.shell.bags import bag_recorder as recording
from rosbridge_sim.shell.bags.bag import open_bag
from rosbridge_sim.shell.bags.bag_recorder import BagRecorder
from rosbridge_sim.shell.bags.message_writer import BagMessageWriter
from tests.conftest import Connect
from tests.graph.bus_fixture import Wire, make_bus
from tests.shell.bags.bag_reading import Seen, read_bag
from tests.support import Client

FRAME_NS = 20_000_000


async def drive(client: Client, num_ticks: int) -> None:
    """Some ticks of 20 ms with a little throttle."""
    await client.ask("/SyncModeCmd", user_id="me", start_sync_mode=True, time_step=20)
    command = {"longlCmdType": 1, "accel": 0.5, "steering": 0.01}
    await client.ask("/SyncModeCtrlCmd", frame=1, command=command)
    for frame in range(1, num_ticks + 1):
        await client.ask("/SyncModeWaitForTick", user_id="me", frame=frame)


def stamps_of(seen: Seen, wanted: str) -> list[int]:
    return [stamp_ns for topic, stamp_ns, _ in seen if topic == wanted]


@pytest.mark.parametrize("ros", [1, 2])
@pytest.mark.parametrize("name", ["drive.bag", "drive.mcap", "drive"])
async def test_bag_holds_the_drive_as_a_subscriber_received_it(
    tmp_path: Path, connect: Connect, name: str, ros: Literal[1, 2]
) -> None:
    heard = []
    async with Simulator(port=0, start="sync", record=tmp_path / name, ros=ros) as sim:
        client = await connect(sim.url)
        await client.send("subscribe", topic="/Ego_topic")
        await drive(client, 5)
        heard = [await client.message("/Ego_topic") for _ in range(5)]
    seen = read_bag(tmp_path / name)
    for topic in ("/clock", "/Ego_topic", "/Object_topic", "/CollisionData"):
        assert stamps_of(seen, topic) == [frame * FRAME_NS for frame in range(1, 6)]
    assert stamps_of(seen, "/SyncModeInfo")[0] == 0  # it is latched: what was said before the recorder came
    recorded = [message for topic, _, message in seen if topic == "/Ego_topic"]
    assert [one.position.x for one in recorded] == [one["position"]["x"] for one in heard]
    assert [one.velocity.x for one in recorded] == [one["velocity"]["x"] for one in heard]
    assert recorded[-1].velocity.x > 0


async def test_bag_uses_simulated_time_regardless_of_stamps(tmp_path: Path, connect: Connect) -> None:
    path, topics = tmp_path / "a.mcap", ["/clock", "/Ego_topic", "/Object_topic"]
    async with Simulator(port=0, start="sync", stamps="wall", record=path, record_topics=topics) as sim:
        await drive(await connect(sim.url), 5)
    seen = read_bag(path)
    for topic in topics:
        assert stamps_of(seen, topic) == [frame * FRAME_NS for frame in range(1, 6)]
    days = [message.header.stamp.sec for topic, _, message in seen if topic == "/Ego_topic"]
    assert min(days) > 1_000_000_000


async def test_repeated_states_of_a_pause_are_not_recorded(tmp_path: Path, connect: Connect) -> None:
    async with Simulator(port=0, record=tmp_path / "a.mcap", record_topics=["/Ego_topic"]) as sim:
        client = await connect(sim.url)
        await client.ask("/Service_MoraiEventCmd", option=8, set_pause=True)
        await client.send("subscribe", topic="/Ego_topic")
        assert await client.message("/Ego_topic"), "the world as it stands"
    stamps = stamps_of(read_bag(tmp_path / "a.mcap"), "/Ego_topic")
    assert len(set(stamps)) == len(stamps)


async def test_drive_can_be_recorded_as_replay_info_only(tmp_path: Path, connect: Connect) -> None:
    topics = ["/ReplayInfo_topic"]
    async with Simulator(port=0, start="sync", record=tmp_path / "a.bag", record_topics=topics) as sim:
        await drive(await connect(sim.url), 5)
    assert stamps_of(read_bag(tmp_path / "a.bag"), "/ReplayInfo_topic") == [i * FRAME_NS for i in range(1, 6)]


@pytest.mark.parametrize("is_wanted", [False, True])
async def test_recording_of_all_topics_has_replay_info_if_set(
    tmp_path: Path, connect: Connect, *, is_wanted: bool
) -> None:
    async with Simulator(port=0, start="sync", record=tmp_path / "a.bag", replay_info=is_wanted) as sim:
        await drive(await connect(sim.url), 5)
    assert len(stamps_of(read_bag(tmp_path / "a.bag"), "/ReplayInfo_topic")) == 5 * is_wanted


async def test_commands_are_recorded_with_their_arrival_time(tmp_path: Path, connect: Connect) -> None:
    async with Simulator(port=0, start="sync", record=tmp_path / "a.bag") as sim:
        client = await connect(sim.url)
        await drive(client, 2)
        await client.send("advertise", topic="/ctrl_cmd", type="morai_msgs/CtrlCmd")
        await client.send("publish", topic="/ctrl_cmd", msg={"longlCmdType": 1, "accel": 0.25})
        await client.send("advertise", topic="/chatter", type="std_msgs/String")
        await client.send("publish", topic="/chatter", msg={"data": "no business of the simulator's"})
        await client.settle()
    seen = read_bag(tmp_path / "a.bag")
    assert [(at, one.accel) for topic, at, one in seen if topic == "/ctrl_cmd"] == [(2 * FRAME_NS, 0.25)]
    assert stamps_of(seen, "/chatter") == []


async def test_number_of_recorded_topics_is_bounded_and_logged_once(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(recording, "MAX_TOPICS", 3)
    path = tmp_path / "a.bag"
    async with Simulator(port=0, world=False, record=path, record_topics=["/chat*"]) as sim:
        assert sim.bus is not None
        client = Wire(sim.bus)
        for i in range(6):
            client.says(op="publish", topic=f"/chat{i}", type="std_msgs/String", msg={"data": "x"})
            client.says(op="unadvertise", topic=f"/chat{i}")
    assert [topic for topic, _, _ in read_bag(path)] == ["/chat0", "/chat1", "/chat2"]
    assert (
        caplog.messages.count(
            f"{path}: new topics are not recorded, because 3 topics are; choose some with --record-topics"
        )
        == 1
    )


async def test_patterns_select_topics_of_every_publisher(tmp_path: Path, connect: Connect) -> None:
    async with Simulator(port=0, start="sync", record=tmp_path / "a.mcap", record_topics=["/chat*", "/clock"]) as sim:
        client = await connect(sim.url)
        await drive(client, 2)
        await client.send("advertise", topic="/chatter", type="std_msgs/String")
        await client.send("publish", topic="/chatter", msg={"data": "hello"})
        await client.settle()
    seen = read_bag(tmp_path / "a.mcap")
    assert [topic for topic, _, _ in seen] == ["/clock", "/clock", "/chatter"]


async def test_gateway_without_a_world_records_all_messages(tmp_path: Path, connect: Connect) -> None:
    async with Simulator(port=0, world=False, record=tmp_path / "a.bag") as sim:
        client = await connect(sim.url)
        await client.send("advertise", topic="/chatter", type="std_msgs/String")
        await client.send("publish", topic="/chatter", msg={"data": "hello"})
        await client.settle()
    assert [one.data for topic, _, one in read_bag(tmp_path / "a.bag") if topic == "/chatter"] == ["hello"]


@pytest.mark.parametrize(("ros", "name"), [(1, "a.mcap"), (2, "a.bag")])
async def test_types_that_differ_between_ros_versions_are_recorded(
    tmp_path: Path, connect: Connect, ros: Literal[1, 2], name: str
) -> None:
    async with Simulator(port=0, world=False, ros=ros, record=tmp_path / name) as sim:
        client = await connect(sim.url)
        await client.send("advertise", topic="/camera", type="sensor_msgs/CameraInfo")  # K is k in ROS 2
        await client.send("publish", topic="/camera", msg={"height": 7, "header": {"frame_id": "c"}})
        await client.send("advertise", topic="/shape", type="shape_msgs/SolidPrimitive")  # has a polygon in ROS 2
        await client.send("publish", topic="/shape", msg={"type": 1, "dimensions": [1.0, 2.0, 3.0]})
        await client.settle()
    seen = {topic: message for topic, _, message in read_bag(tmp_path / name)}
    assert (seen["/camera"].height, seen["/camera"].header.frame_id) == (7, "c")
    if ros == 1:  # the other way the polygon has no place to go, which is told
        assert (seen["/shape"].type, list(seen["/shape"].dimensions)) == (1, [1.0, 2.0, 3.0])
    assert ("/shape" in seen) == (ros == 1)


async def test_unknown_type_is_logged_once_and_left_out(
    tmp_path: Path, connect: Connect, caplog: pytest.LogCaptureFixture
) -> None:
    async with Simulator(port=0, world=False, record=tmp_path / "a.bag", record_topics=["*"]) as sim:
        client = await connect(sim.url)
        await client.send("advertise", topic="/odd", type="nobody_msgs/Knows")
        for _ in range(3):
            await client.send("publish", topic="/odd", msg={"a": 1})
        await client.settle()
    assert [
        line for line in caplog.messages if line.startswith("topic /odd is recorded only in part, or not at all")
    ] != []
    assert (
        len([line for line in caplog.messages if line.startswith("topic /odd is recorded only in part, or not at all")])
        == 1
    )
    assert stamps_of(read_bag(tmp_path / "a.bag"), "/odd") == []


async def test_topic_has_the_type_of_its_first_publisher_in_the_bag(
    tmp_path: Path, connect: Connect, caplog: pytest.LogCaptureFixture
) -> None:
    async with Simulator(port=0, world=False, record=tmp_path / "a.bag") as sim:
        listener, talker = await connect(sim.url), await connect(sim.url)
        await listener.send("subscribe", topic="/t", type="std_msgs/Int32")
        await listener.settle()
        await talker.send("publish", topic="/t", type="std_msgs/String", msg={"data": "first"})
        await talker.send("unadvertise", topic="/t")
        await talker.settle()
        assert sim.bus is not None
        sim.bus.topic_table.forget_topic("/t")
        for _ in range(2):
            await talker.send("publish", topic="/t", type="std_msgs/Int32", msg={"data": 7})
        await talker.settle()
    assert [one.data for topic, _, one in read_bag(tmp_path / "a.bag") if topic == "/t"] == ["first"]
    told = [line for line in caplog.messages if line.startswith("topic /t is recorded only in part, or not at all")]
    why = "expected std_msgs/String, as the topic began; got std_msgs/Int32"
    assert told == [f"topic /t is recorded only in part, or not at all: {why}"]


async def test_full_disk_ends_only_the_recording(
    tmp_path: Path, connect: Connect, caplog: pytest.LogCaptureFixture
) -> None:
    old = resource.getrlimit(resource.RLIMIT_FSIZE)
    async with Simulator(port=0, start="sync", record=tmp_path / "a.bag") as sim:
        client = await connect(sim.url)
        assert sim._recorder is not None
        sim._recorder._timer.cancel()  # else it may have written all before the disk is full
        await drive(client, 2)
        resource.setrlimit(resource.RLIMIT_FSIZE, (6_000, old[1]))
        try:
            sim._recorder._tick()
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, old)
        answer = await client.ask("/SyncModeWaitForTick", user_id="me", frame=3)
        assert answer["frame"] == 3
        nodes = await client.values("/rosapi/nodes")
        assert "/recorder" not in nodes["nodes"]
    errors = [record.getMessage() for record in caplog.records if record.levelno >= logging.ERROR]
    assert len(errors) == 1
    assert "the recording has ended: " in errors[0]
    assert "a.bag: cannot be written: file too large" in errors[0]


@pytest.mark.parametrize("name", ["a.bag", "a.mcap", "a"])
async def test_deleted_file_ends_only_the_recording(
    tmp_path: Path, connect: Connect, caplog: pytest.LogCaptureFixture, name: str
) -> None:
    path = tmp_path / name
    async with Simulator(port=0, start="sync", record=path, record_topics=["/Ego_topic"]) as sim:
        client = await connect(sim.url)
        await drive(client, 2)
        assert sim._recorder is not None
        if path.is_dir():
            shutil.rmtree(path)
        else:
            path.unlink()
        sim._recorder._tick()
        answer = await client.ask("/SyncModeWaitForTick", user_id="me", frame=3)
        assert answer["frame"] == 3
        assert "/recorder" not in (await client.values("/rosapi/nodes"))["nodes"]
    errors = [record.getMessage() for record in caplog.records if record.levelno >= logging.ERROR]
    why = f"{path}: was deleted during the recording: everything recorded is lost"
    assert errors == [f"the recording has ended: {why}"]
    assert not path.exists()


async def test_file_deleted_just_before_the_end_is_reported(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    path = tmp_path / "a.bag"
    async with Simulator(port=0, start="sync", record=path, record_topics=["/Ego_topic"]):
        path.unlink()
    assert [line for line in caplog.messages if "has ended" in line] == [
        f"the recording has ended: {path}: was deleted during the recording: everything recorded is lost"
    ]


async def test_bag_file_that_cannot_be_created_prevents_the_start(tmp_path: Path) -> None:
    with pytest.raises(DocumentError, match=r"a\.bag: cannot be written: no such file or directory"):
        await Simulator(port=0, record=tmp_path / "nowhere" / "a.bag").start()


async def test_recorder_is_a_node_that_rosapi_shows(tmp_path: Path, connect: Connect) -> None:
    async with Simulator(port=0, start="sync", record=tmp_path / "a.bag") as sim:
        client = await connect(sim.url)
        details = await client.values("/rosapi/node_details", {"node": "/recorder"})
        assert "/Ego_topic" in details["subscribing"], json.dumps(details)


# A failure of ours that belongs to the recording


def break_down(*_: object, **__: object) -> NoReturn:
    raise ZeroDivisionError


def failures(caplog: pytest.LogCaptureFixture) -> list[str]:
    """What the log says of failures, each with its traceback."""
    return [record.getMessage() for record in caplog.records if record.exc_info]


@pytest.mark.parametrize(("ros", "name"), [(1, "a.bag"), (1, "a.mcap"), (2, "a.mcap")])
async def test_unencodable_message_is_left_out_alone(
    tmp_path: Path, connect: Connect, caplog: pytest.LogCaptureFixture, ros: Literal[1, 2], name: str
) -> None:
    async with Simulator(port=0, world=False, record=tmp_path / name, ros=ros) as sim:
        client = await connect(sim.url)
        for topic in ("/bad", "/good"):
            await client.send("advertise", topic=topic, type="std_msgs/String")
        await client.settle()
        assert sim._recorder is not None
        channels = sim._recorder.writer._channels
        channels["/bad"] = replace(channels["/bad"], recode=break_down)
        for data in ("a", "b"):
            for topic in ("/bad", "/good"):
                await client.send("publish", topic=topic, msg={"data": data})
            told = await client.take("status")
            assert told["msg"] == "std_msgs/String cannot be written into the bag: ZeroDivisionError()"
        assert await client.settle() == []
        assert sim.bus is not None
        assert sim.bus.guard.num_faults == sim.num_bugs == 2
    assert [one.data for topic, _, one in read_bag(tmp_path / name) if topic == "/good"] == ["a", "b"]
    assert [line.partition(":")[0] for line in failures(caplog)] == ["/bad"]


async def test_unencodable_latched_message_does_not_exclude_its_topic(tmp_path: Path) -> None:
    bus, path = make_bus(), tmp_path / "a.bag"
    speaker = BagRecorder.__new__(BagRecorder)  # any owner
    topic = bus.advertise(speaker, "/t", "std_msgs/String", depth=3)
    make = bus.store.message("std_msgs/String").struct_type
    for data in ("a", object(), "b"):
        bus.publish(speaker, topic, Message(topic.type, make(data=data)), 0.0)
    recorder = BagRecorder(bus, BagMessageWriter(open_bag(path), bus.store), path, loop=asyncio.get_running_loop())
    recorder.stop()
    assert [one.data for _, _, one in read_bag(path)] == ["a", "b"]
    assert bus.guard.num_faults == 1


@pytest.mark.parametrize("end", ["stop", "fail"])
async def test_ended_recording_is_not_flushed_again(tmp_path: Path, end: str) -> None:
    """A timer that goes on would keep the bag in memory and write to its closed file once a second, for ever."""
    bus, path = make_bus(), tmp_path / "a.bag"
    recorder = BagRecorder(bus, BagMessageWriter(open_bag(path), bus.store), path, loop=asyncio.get_running_loop())
    recorder._tick()
    if end == "stop":
        recorder.stop()
    else:
        recorder.fail(OSError("gone"))
    assert recorder._timer.cancelled()


@pytest.mark.parametrize("seam", ["write", "flush", "abort"])
async def test_failed_recording_ends_and_the_world_goes_on(
    tmp_path: Path, connect: Connect, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch, seam: str
) -> None:
    async with Simulator(port=0, start="sync", record=tmp_path / "a.bag", record_topics=["/Ego_topic"]) as sim:
        client = await connect(sim.url)
        await client.send("subscribe", topic="/Ego_topic")
        await drive(client, 2)
        recorder = sim._recorder
        assert recorder is not None
        monkeypatch.setattr(recorder.writer._bag, "flush" if seam == "flush" else "write", break_down)
        if seam == "abort":  # its end fails too
            monkeypatch.setattr(recorder.writer._bag, "abort", break_down)
        if seam == "flush":
            recorder._timer.cancel()  # the next call makes another one, and this one would fail again a second later
            recorder._tick()
        answer = await client.ask("/SyncModeWaitForTick", user_id="me", frame=3)
        assert answer["frame"] == 3
        assert len([await client.message("/Ego_topic") for _ in range(3)]) == 3
        assert "/recorder" not in (await client.values("/rosapi/nodes"))["nodes"]
        assert sim.num_bugs == (2 if seam == "abort" else 1)
        monkeypatch.undo()
        recorder.writer.abort()
    assert "the recording ended by an internal error; `rosbridge-sim bag repair` makes it readable" in failures(caplog)
    assert len(failures(caplog)) == (2 if seam == "abort" else 1)


@pytest.mark.parametrize("seam", ["recording", "server"])
async def test_failed_end_of_a_recording_does_not_stop_other_cleanup(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch, seam: str
) -> None:
    sim = Simulator(port=0, world=False, record=tmp_path / "a.bag")
    await sim.start()
    assert sim._recorder is not None
    assert sim._server is not None
    if seam == "recording":
        monkeypatch.setattr(sim._recorder.writer._bag, "close", break_down)
        await sim.stop()
        assert failures(caplog) == ["the end of the recording has failed; this is a bug of ours, and the rest goes on"]
    else:
        stop = sim._server.stop
        monkeypatch.setattr(sim._server, "stop", break_down)
        with pytest.raises(ZeroDivisionError):
            await sim.stop()
        assert read_bag(tmp_path / "a.bag") is not None  # it is whole
        await stop()
