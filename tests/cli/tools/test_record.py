"""`rosbridge-sim record`: a bag of the topics of any rosbridge."""

from __future__ import annotations

import asyncio
import json
import signal
from pathlib import Path

import pytest

from rosbridge_sim import Simulator
from rosbridge_sim.cli.tools import record
from rosbridge_sim.shell.bags.repair import repair
from tests.cli.tool_fixture import Frame, answering, in_the_background, other_server, run, start
from tests.conftest import Connect
from tests.shell.bags.bag_reading import read_bag
from tests.support import PATIENCE, ServerProcess


@pytest.fixture(scope="module")
def server(moving_server: ServerProcess) -> ServerProcess:
    """The world of these tests moves."""
    return moving_server


@pytest.mark.parametrize("name", ["drive.bag", "drive.mcap", "drive"])
async def test_recorded_stamps_are_the_time_of_the_server(tmp_path: Path, name: str) -> None:
    async with Simulator(port=0) as sim:
        words = ("record", str(tmp_path / name), "-n", "40", "--topics", "/Ego_topic", "--topics", "/clock")
        done = await in_the_background(*words, url=sim.url)
    assert (done.code, done.out) == (0, "")
    assert done.err.endswith(f"rosbridge-sim: {tmp_path / name}: 40 messages on 2 topics\n")
    seen = read_bag(tmp_path / name)
    assert {topic for topic, _, _ in seen} == {"/Ego_topic", "/clock"}
    stamps = [
        (stamp_ns, message.header.stamp.sec * 10**9 + message.header.stamp.nanosec)
        for topic, stamp_ns, message in seen
        if topic == "/Ego_topic"
    ]
    # the clock goes out first in each frame; what came before the first one has that one's time
    assert all(stamp_ns == said for stamp_ns, said in stamps[1:])


async def test_clock_topic_under_another_name_gives_the_stamps(tmp_path: Path) -> None:
    names = {"/clock": {"name": "/sim/time"}, "/tf": {"on": False}}
    async with Simulator(port=0, publishers=names) as sim:
        words = ("record", str(tmp_path / "a.mcap"), "-n", "9", "--topics", "/Ego_topic")
        assert (await in_the_background(*words, url=sim.url)).code == 0
    stamps = [stamp_ns - message.header.stamp.sec * 10**9 for _, stamp_ns, message in read_bag(tmp_path / "a.mcap")]
    assert len(stamps) == 9
    assert max(stamps) < 10**9


async def test_topic_advertised_later_is_recorded(tmp_path: Path, connect: Connect) -> None:
    async with Simulator(port=0, world=False) as sim:
        client = await connect(sim.url)
        words = ("record", str(tmp_path / "a.bag"), "-n", "1", "--topics", "/chatter", "--json")
        task = asyncio.create_task(in_the_background(*words, url=sim.url))
        await client.send("advertise", topic="/chatter", type="std_msgs/String", latch=True)
        await client.send("publish", topic="/chatter", msg={"data": "hello"})
        done = await task
    assert json.loads(done.out) == {"file": str(tmp_path / "a.bag"), "messages": 1, "topics": 1}
    assert [message.data for _, _, message in read_bag(tmp_path / "a.bag")] == ["hello"]


async def test_server_without_a_clock_topic_is_recorded_with_wall_clock_time(tmp_path: Path) -> None:
    rosapi = answering(topics={"topics": ["/a", "/b"], "types": ["std_msgs/Int32", "nobody_msgs/Knows"]})

    def reply(frame: Frame) -> list[str | bytes]:
        if frame["op"] == "subscribe":
            assert frame["topic"] == "/a"
            return [json.dumps({"op": "publish", "topic": "/a", "msg": {"data": 7}})]
        return list(rosapi(frame))

    async with other_server(reply) as url:
        done = await in_the_background("record", str(tmp_path / "a.mcap"), "-n", "1", url=url)
    assert done.code == 0
    assert "/b is not recorded: " in done.err
    ((topic, stamp_ns, message),) = read_bag(tmp_path / "a.mcap")
    assert (topic, message.data) == ("/a", 7)
    assert stamp_ns > 10**18


async def test_lost_server_leaves_a_complete_bag(tmp_path: Path) -> None:
    def reply(frame: Frame) -> list[str | bytes]:
        if frame["op"] == "subscribe":
            msg = {"op": "publish", "topic": "/a", "msg": {"data": 7}}
            return [json.dumps(msg), json.dumps({"op": "x"}), json.dumps(msg)]
        if len(frames) > 2:
            raise ConnectionError
        frames.append(frame)
        return list(answering(topics={"topics": ["/a"], "types": ["std_msgs/Int32"]})(frame))

    frames: list[Frame] = [{}, {}]
    async with other_server(reply) as url:
        done = await in_the_background("record", str(tmp_path / "a.bag"), url=url)
    assert done.code == 1
    assert "the server has closed the connection" in done.err
    assert [message.data for _, _, message in read_bag(tmp_path / "a.bag")] == [7, 7]


@pytest.mark.parametrize("name", ["a.bag", "a.mcap", "a"])
async def test_messages_are_on_the_disk_before_each_question_even_without_a_clock_message(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    monkeypatch.setattr(record, "FLUSH_PERIOD", 0.0)
    types = {"/a": "std_msgs/Int32", "/clock": "rosgraph_msgs/Clock"}  # the world stands: nothing is on the clock
    rosapi = answering(topics={"topics": list(types), "types": list(types.values())})
    recovered: list[int] = []

    def reply(frame: Frame) -> list[str | bytes]:
        answers = list(rosapi(frame))
        if frame["op"] != "call_service":
            return answers
        if asked:  # this is the state of the disk if the recorder is killed now
            copy = tmp_path / f"copy{len(asked)}{Path(name).suffix}"
            recovered.append(repair(tmp_path / name, copy).num_messages if len(asked) > 1 else 0)
        asked.append(frame)
        if len(asked) > 4:
            raise ConnectionError
        return [json.dumps({"op": "publish", "topic": "/a", "msg": {"data": 7}}), *answers] if asked[1:] else answers

    asked: list[Frame] = []
    async with other_server(reply) as url:
        await in_the_background("record", str(tmp_path / name), url=url)
    assert recovered == [0, 1, 2, 3]
    assert [stamp_ns for _, stamp_ns, _ in read_bag(tmp_path / name)] == [0, 0, 0]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("number", "name"), [(signal.SIGINT, "a.bag"), (signal.SIGTERM, "a.mcap"), (signal.SIGHUP, "a")]
)
def test_signal_finishes_the_bag(tmp_path: Path, server: ServerProcess, number: signal.Signals, name: str) -> None:
    path = tmp_path / name
    process = start("record", str(path), url=server.url)
    assert process.stderr is not None
    assert process.stderr.readline() == f"rosbridge-sim: recording into {path}; Ctrl-C ends it\n"
    process.send_signal(number)
    _, err = process.communicate(timeout=PATIENCE)
    assert process.returncode == 0, err
    read_bag(path)


@pytest.mark.slow
@pytest.mark.parametrize("clock", [{}, {"/clock": "rosgraph_msgs/Clock"}])
async def test_deleted_output_file_is_reported(tmp_path: Path, clock: dict[str, str]) -> None:
    path = tmp_path / "a.bag"
    types = {"/a": "std_msgs/Int32", **clock}
    rosapi = answering(topics={"topics": list(types), "types": list(types.values())})

    def reply(frame: Frame) -> list[str | bytes]:
        if frame.get("topic") == "/a":
            path.unlink()
            return [json.dumps({"op": "publish", "topic": "/a", "msg": {"data": 7}})]
        return list(rosapi(frame))

    async with other_server(reply) as url:
        done = await in_the_background("record", str(path), url=url)
    assert done.code == 2
    assert done.err.endswith(f"rosbridge-sim: {path}: was deleted during the recording: everything recorded is lost\n")


def test_unknown_suffix_and_existing_file_are_refused(tmp_path: Path, server: ServerProcess) -> None:
    done = run("record", str(tmp_path / "a.db3"), url=server.url)
    assert (done.code, done.complaint.split(": ")[1]) == (
        2,
        "expected NAME.bag (ROS 1), NAME.mcap (ROS 2) or a folder's name; .db3 is not written",
    )
    (tmp_path / "a.bag").write_text("precious")
    done = run("record", str(tmp_path / "a.bag"), url=server.url)
    assert (done.code, done.complaint.split(": ")[1]) == (2, "exists already; recordings are not overwritten")
