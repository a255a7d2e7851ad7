"""`mock capture` of this server, of bags and of strange servers: `mock check` finds no mistake in what it writes."""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncIterator, Iterable
from pathlib import Path
from typing import Any, Literal

import pytest
import pytest_asyncio
from hypothesis import given
from hypothesis import strategies as st

from rosbridge_sim import Simulator
from rosbridge_sim.cli.mock.capture_run import mock_text
from rosbridge_sim.documents.yaml_reading import YamlDocument, read_yaml
from rosbridge_sim.mock.mock_capture import captured_topic, leave_out_mistakes
from rosbridge_sim.mock.mock_plan import MockFiles, plan_mock
from rosbridge_sim.schema.store import Store
from rosbridge_sim.shell.bags.bag import open_bag
from rosbridge_sim.shell.bags.message_writer import BagMessageWriter
from rosbridge_sim.shell.files.definitions import read_definitions
from tests.cli.tool_fixture import Frame, Result, answering, other_server, run
from tests.contracts.test_contract_recording import MESSAGES
from tests.contracts.test_seen_system import topic_of
from tests.support import PATIENCE

TEXTS = read_definitions("22.R2")
STORE = Store(TEXTS, ros=1)

STEADY = "1.5"
"""A time in which a server has its rate, although a busy machine holds it up for a moment [s]."""


async def mock(*words: str) -> Result:
    async with asyncio.timeout(PATIENCE):
        return await asyncio.to_thread(run, "mock", *words)


@pytest.fixture
def file(tmp_path: Path) -> str:
    return str(tmp_path / "robot.yaml")


def text_of(file: str) -> str:
    return Path(file).read_text()


def document_of(file: str) -> Any:  # noqa: ANN401 - what was written
    return read_yaml(text_of(file), file).value


@pytest_asyncio.fixture
async def url() -> AsyncIterator[str]:
    async with Simulator(port=0) as simulator:
        yield simulator.url


@pytest.mark.slow
@pytest.mark.parametrize("ros", [1, 2])
async def test_simulator_is_captured_without_mistakes(ros: Literal[1, 2], file: str) -> None:
    async with Simulator(port=0, ros=ros, start="sync") as simulator:
        words = ("--duration", "0.5", "--call", "/sim/describe", "--json")
        done = await mock("capture", simulator.url, "-o", file, *words)
    assert (done.code, "left out" in done.err) == (0, False), done
    checked = run("mock", "check", file, "--ros", str(ros))
    assert (checked.code, "good" in checked.out) == (0, True), checked
    document = json.loads(done.out)
    assert document["subscribers"]["/ctrl_cmd"].replace("/msg/", "/") == "morai_msgs/CtrlCmd"
    assert document["services"]["/SyncModeCmd"]["answers"][0]["value"]["response"]["result"] is False
    assert document["services"]["/sim/describe"]["answers"][0]["value"]["model"] == "2016_Hyundai_Ioniq"
    assert {"parent": "base_link", "child": "imu_link"} in document["transforms"]
    assert not document.keys() & {"actions", "parameters"}
    assert ("--ros 2" in text_of(file)) == (ros == 2)


async def test_moving_topics_have_rates_and_patterns(url: str, file: str) -> None:
    done = await mock("capture", url, "-o", file, "-d", STEADY, "-t", "/SyncModeInfo", "-s", "/none", "--json")
    document = json.loads(done.out)
    assert done.code == 0
    assert document.keys() == {"topics"}
    topic = document["topics"]["/SyncModeInfo"]
    assert topic["rate"] == pytest.approx(50.0, rel=0.9)
    assert topic["value"]["frame"].keys() <= {"$counter", "$random_walk"}
    again = await mock("capture", url, "-o", file)
    assert (again.code, again.complaint) == (2, f"{file}: is there already; choose another name, or delete it")


@pytest.mark.parametrize(
    ("words", "kinds"),
    [
        (("-t", "/SyncModeInfo"), {"topics"}),
        (("-s", "/SyncModeC*"), {"services"}),
        (("-t", "/SyncModeInfo", "--call", "/sim/describe"), {"topics", "services"}),
    ],
)
async def test_patterns_of_one_kind_select_nothing_of_the_others(
    words: tuple[str, ...], kinds: set[str], url: str, file: str
) -> None:
    done = await mock("capture", url, "-o", file, "-d", "0.3", *words, "--json")
    assert done.code == 0, done
    document = json.loads(done.out)
    assert document.keys() == kinds
    assert ("-s '*' takes them" in done.err) == ("-t" in words)
    wanted = {"--call": {"/sim/describe"}, "-s": {"/SyncModeCmd", "/SyncModeCtrlCmd"}}
    assert set(document.get("services", ())) == wanted.get(words[-2], set())


async def test_contract_of_a_simulator_is_kept_by_a_mock_of_it(file: str, tmp_path: Path) -> None:
    contract, chosen = str(tmp_path / "contract.yaml"), ("-d", STEADY, "-t", "/Ego_topic", "-s", "/SyncModeCmd")
    async with Simulator(port=0) as simulator:
        assert (await mock("capture", simulator.url, "-o", file, *chosen)).code == 0
        words = ("record", simulator.url, contract, *chosen, "--tolerance", "0.9")
        assert (await asyncio.to_thread(run, "contract", *words)).code == 0
    async with Simulator(port=0, mock=file) as robot:
        done = await asyncio.to_thread(run, "contract", "check", robot.url, contract, "-d", STEADY)
    assert (done.code, done.lines[-1].endswith("all are kept")) == (0, True), done
    async with Simulator(port=0, mock=file, ros=2) as other:
        done = await asyncio.to_thread(run, "contract", "check", other.url, contract, "-d", STEADY)
    assert done.code == 0, done


async def test_service_that_is_not_there_is_told_with_the_nearest_one(url: str, file: str) -> None:
    done = await mock("capture", url, "-o", file, "--call", "/sim/descibe")
    assert (done.code, done.complaint) == (1, "--call: no service /sim/descibe here (did you mean /sim/describe?)")
    assert not Path(file).exists()  # noqa: ASYNC240 - a test


@pytest.mark.parametrize("name", ["drive.bag", "drive.mcap"])
def test_bag_is_captured_without_mistakes(name: str, tmp_path: Path, file: str) -> None:
    bag = open_bag(tmp_path / name)
    writer = BagMessageWriter(bag, Store(TEXTS, ros=bag.ros))
    for topic, kind in (("/odom", "nav_msgs/Odometry"), ("/picture", "sensor_msgs/CompressedImage")):
        writer.add(topic, kind)
    for i in range(20):
        odom = {"header": {"frame_id": "odom"}, "pose": {"pose": {"position": {"x": 0.5 * (i % 7)}}}}
        writer.write_json("/odom", json.dumps(odom).encode(), i * 10**8)
        writer.write_json("/picture", json.dumps({"format": "jpeg", "data": "/9j/" * 1000}).encode(), i * 10**8)
    writer.close()
    done = run("mock", "capture", str(tmp_path / name), "-o", file)
    assert (done.code, done.out) == (0, ""), done
    odom, picture = (document_of(file)["topics"][topic] for topic in ("/odom", "/picture"))
    assert (odom["rate"], picture["rate"]) == (10.0, 10.0)
    assert odom["value"]["pose"]["pose"]["position"]["x"]["$random_walk"]["high"] == 3.0
    assert odom["value"]["header"] == {"frame_id": "odom"}
    assert picture["value"] == {"header": {"frame_id": ""}, "format": "jpeg"}
    assert run("mock", "check", file, "--ros", str(bag.ros)).code == 0


def test_source_that_is_nothing_is_told(file: str) -> None:
    done = run("mock", "capture", "ws://127.0.0.1:1", "-o", file)
    assert (done.code, "nothing listens there" in done.complaint) == (2, True)
    Path(file).with_suffix(".bag").write_text("hello")
    done = run("mock", "capture", str(Path(file).with_suffix(".bag")), "-o", file)
    assert (done.code, "is not a bag" in done.complaint) == (2, True)


TYPES = {
    "topics": ["/good", "/odd", "/unknown", "/mock/x", "/tf"],
    "types": ["std_msgs/Float64", "std_msgs/Int8", "nobody/Knows", "std_msgs/String", "tf2_msgs/TFMessage"],
}
SERVICES: dict[str, Frame | str] = {
    "topics": TYPES,
    "services": {"services": ["/reset", "/strange"]},
    "service_type": {"type": "std_srvs/Trigger"},
    "action_servers": {"action_servers": ["/strange"]},
    "action_type": {"type": "nobody/Acts"},
}


def strange(frame: Frame) -> Iterable[str | bytes]:
    yield from answering(**SERVICES)(frame)
    if frame["op"] == "subscribe":
        yield from (
            json.dumps({"op": "publish", "topic": frame["topic"], "msg": msg})
            for msg in ({"data": 1000, "x": {"$file": "/etc/passwd"}}, {"data": [{"$file": "a"}], "transforms": 7})
        )
    if frame.get("service") == "/reset":
        yield json.dumps({"op": "service_response", "id": frame["id"], "values": {"$expression": "1"}, "result": True})


async def test_what_a_mock_cannot_do_is_left_out_and_told(file: str) -> None:
    async with other_server(strange) as url:
        done = await mock("capture", url, "-o", file, "-d", "0.2", "--call", "reset")
    assert done.code == 0, done
    assert run("mock", "check", file).code == 0
    for text in (
        "topics./unknown.type: Unable to import nobody.msg",
        "topics./odd.value.data: ",
        "actions./strange.type: ",
    ):
        assert f"left out: {text}" in done.err
    document = document_of(file)
    assert document["topics"] == {"/good": {"type": "std_msgs/Float64"}, "/odd": {"type": "std_msgs/Int8"}}
    assert document["services"]["/reset"] == {"type": "std_srvs/Trigger", "answers": [{"value": {}}]}
    assert "$file" not in text_of(file)


@pytest.mark.usefixtures("patient_handshakes")
async def test_system_without_rosapi_is_refused(file: str) -> None:
    async with other_server(lambda _frame: []) as url:
        done = await mock("capture", url, "-o", file, "--timeout", "0.1")
    assert (done.code, "cannot be captured without rosapi" in done.err) == (1, True)


KINDS = st.sampled_from(
    ["std_msgs/Float64", "std_msgs/Header", "nav_msgs/Odometry", "no/Type", "", "std_msgs/ByteMultiArray"]
)
NAMES = st.sampled_from(["/a", "b", "/c/d", "/e f", "/mock/x", ""])


@given(st.dictionaries(NAMES, st.tuples(KINDS, MESSAGES.filter(bool)), max_size=3))
def test_written_file_is_read_back_and_has_no_mistake(system: dict[str, tuple[str, list[dict[str, Any]]]]) -> None:
    document = {
        "topics": {name: captured_topic(topic_of(*messages), kind) for name, (kind, messages) in system.items()}
    }

    def find(value: dict[str, Any]) -> Any:  # noqa: ANN401 - mistakes
        return plan_mock(YamlDocument("f", value, {}), STORE, MockFiles(), pytest.fail)[1]

    leave_out_mistakes(document, find)
    read = read_yaml(mock_text(document), "f")
    assert repr(read.value or {}) == repr(document)
    assert plan_mock(read, STORE, MockFiles(), pytest.fail)[1] == []
