"""`rosbridge-sim contract` with this server, and with servers that say little or too much."""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncIterator, Iterable
from pathlib import Path
from typing import Literal
from xml.etree import ElementTree as ET

import pytest
import pytest_asyncio

from rosbridge_sim import Simulator
from rosbridge_sim.cli.contracts.watching import chosen
from tests.cli.tool_fixture import Frame, Result, answering, other_server, run
from tests.support import PATIENCE

SHORT = ("--duration", "0.3")

STEADY = ("--duration", "1.5")
"""A time in which a server has its rate, although a busy machine holds it up for a moment."""


async def contract(*words: str) -> Result:
    async with asyncio.timeout(PATIENCE):
        return await asyncio.to_thread(run, "contract", *words)


def write(file: str, text: str) -> None:
    Path(file).write_bytes(text.encode("utf-8", "surrogateescape"))


@pytest_asyncio.fixture
async def url() -> AsyncIterator[str]:
    async with Simulator(port=0) as simulator:
        yield simulator.url


@pytest.fixture
def file(tmp_path: Path) -> str:
    return str(tmp_path / "robot.yaml")


@pytest.mark.parametrize("ros", [1, 2])
async def test_recorded_contract_is_kept_by_the_other_generation(ros: Literal[1, 2], file: str) -> None:
    async with Simulator(port=0, ros=ros) as simulator:
        done = await contract("record", simulator.url, file, *STEADY, "-t", "Ego*", "-t", "clock", "--tolerance", "0.9")
        assert (done.code, done.out, "2 topics, " in done.err) == (0, "", True), done
    async with Simulator(port=0, ros=3 - ros) as simulator:  # type: ignore[arg-type] # 1 or 2
        done = await contract("check", simulator.url, file, *STEADY)
    assert (done.code, done.lines[-1].endswith(": all are kept")) == (0, True), done.out


async def test_moved_ego_breaks_its_range_by_name(url: str, file: str) -> None:
    write(
        file,
        "topics:\n  /Ego_topic:\n    type: morai_msgs/EgoVehicleStatus\n    rate: 50\n    tolerance: 0.9\n"
        "    fields: {position.x: {max: -1000}, position.q: {}}\n  /odm: {type: nav_msgs/Odometry}\n"
        "services: {/SyncModeCmd: std_srvs/Empty}\n",
    )
    done = await contract("check", url, file, *STEADY)
    assert done.code == 1
    assert done.lines[-1] == "6 terms: 4 broken"
    ego, field, topic, service = done.lines[-5:-1]
    assert ego.startswith("/Ego_topic: position.x: expected at most -1000, got ")
    assert field.startswith("/Ego_topic: position.q: expected to be there, got no such field in ")
    assert topic.startswith("/odm: type: expected nav_msgs/Odometry, got no such topic")
    assert service == "/SyncModeCmd: type: expected std_srvs/Empty, got morai_msgs/MoraiSyncModeCmdSrv"
    assert done.lines[1].startswith("/Ego_topic ")
    assert done.lines[1].endswith(" Hz  4      2 of 4 broken")


async def test_programs_get_json_and_junit(url: str, file: str, tmp_path: Path) -> None:
    write(file, "topics: {/Ego_topic: {type: a/B}, /clock: {type: rosgraph_msgs/msg/Clock}}")
    junit = tmp_path / "contract.xml"
    done = await contract("check", url, file, *SHORT, "--json", "--junit", str(junit))
    report = json.loads(done.out)
    assert (done.code, report["broken"]) == (1, 1)
    assert report["claims"][0] == {
        "name": "/Ego_topic",
        "term": "type",
        "expected": "a/B",
        "seen": "morai_msgs/EgoVehicleStatus",
        "is_broken": True,
    }
    suite = ET.parse(junit).getroot()  # noqa: S314 - our own file
    assert (suite.get("tests"), suite.get("failures")) == ("2", "1")


async def test_patterns_select_topics_and_services(url: str, file: str) -> None:
    done = await contract("record", url, file, *SHORT, "-t", "Ego*", "-s", "/SyncModeC*", "--json")
    written = json.loads(done.out)
    assert list(written["topics"]) == ["/Ego_topic"]
    assert set(written["services"]) == {"/SyncModeCmd", "/SyncModeCtrlCmd"}
    again = await contract("record", url, file)
    assert (again.code, again.complaint) == (2, f"{file}: is there already; choose another name, or delete it")
    done = await contract("record", url, f"{file}.other", "-t", "/none", "-s", "/none")
    assert (done.code, done.complaint[:17]) == (1, "nothing to record")


@pytest.mark.parametrize(("words", "kind"), [(("-t", "Ego*"), "topics"), (("-s", "/SyncModeCmd"), "services")])
async def test_patterns_of_one_kind_select_nothing_of_the_other(
    url: str, file: str, words: tuple[str, str], kind: str
) -> None:
    written = json.loads((await contract("record", url, file, *SHORT, *words, "--json")).out)
    assert [key for key in ("topics", "services") if written.get(key)] == [kind]


def test_topics_of_ros_itself_need_a_pattern() -> None:
    names = ["/odom", "/rosout", "/camera/set_parameters", "/rosapi/topics"]
    assert chosen(names, []) == ["/odom"]
    assert chosen(names, ["rosout", "/o*"]) == ["/odom", "/rosout"]


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        (
            "topics: {/a: {tipe: x}}",
            ":1: topics./a.tipe: expected one of type, rate, tolerance, fields (did you mean type?)",
        ),
        ("topics: [", ":1:10: expected YAML:"),
        ("!!python/object:os.system {}", ":1:1: expected no tags"),
        ("\xff\udcff", ": expected a text in UTF-8"),
    ],
)
async def test_mistake_in_the_file_ends_with_code_2(text: str, complaint: str, file: str) -> None:
    write(file, text)
    done = await contract("check", "ws://127.0.0.1:1", file)
    assert done.code == 2
    assert f"{file}{complaint}" in done.err


async def test_no_connection_and_no_file_end_with_code_2(file: str) -> None:
    done = await contract("check", "ws://127.0.0.1:1", file)
    assert (done.code, done.complaint) == (2, f"{file}: cannot be read: No such file or directory")
    write(file, "services: {/a: ''}")
    done = await contract("check", "ws://127.0.0.1:1", file)
    assert (done.code, "nothing listens there" in done.complaint) == (2, True)


def publishing(frame: Frame) -> Iterable[str]:
    if frame["op"] == "subscribe":
        message = {"op": "publish", "topic": frame["topic"], "msg": {"data": 7}}
        yield from [json.dumps(message), json.dumps({**message, "msg": 5}), '{"op": "publish"}', "{"]
        yield from [json.dumps({"op": "status", "level": "error", "msg": f"no \x1b{i}"}) for i in (1, 1, 2)]


@pytest.mark.usefixtures("patient_handshakes")
async def test_server_without_rosapi_is_judged_by_its_messages(file: str) -> None:
    write(file, "topics: {/a: {type: std_msgs/Int32, fields: {data: {min: 7, max: 7}}}}\nservices: {/s: ''}")
    async with other_server(publishing) as url:
        done = await contract("check", url, file, *SHORT, "--timeout", "0.1", "--verbose")
        recorded = await contract("record", url, f"{file}.other", *SHORT, "--timeout", "0.1")
    assert done.code == 0, done
    assert "/a: data: expected 7, got 7" in done.lines
    assert done.err.count("the server says") == 2
    assert "\x1b" not in done.out + done.err
    assert (recorded.code, "cannot be recorded without rosapi" in recorded.err) == (1, True)


async def test_server_with_thousands_of_services_is_judged_but_not_recorded(file: str) -> None:
    names = [f"/s{i}" for i in range(2000)]
    reply = answering(topics={"topics": []}, services={"services": names}, service_type={"type": "a/B"})
    write(file, "services: {/s7: a/B, /s_7: ''}")
    async with other_server(reply) as url:
        checked = await contract("check", url, file, *SHORT)
        recorded = await contract("record", url, f"{file}.other", *SHORT)
    assert (checked.code, checked.lines[-1]) == (1, "2 terms: 1 broken")
    assert "/s_7: type: expected a service, got no such service" in checked.lines
    assert (recorded.code, recorded.complaint[:14]) == (1, "2,000 services")


async def test_server_with_thousands_of_topics_is_refused(file: str) -> None:
    names = [f"/t{i}" for i in range(2000)]
    reply = answering(topics={"topics": names, "types": ["a/B"] * 2000}, services={"services": []})
    async with other_server(reply) as url:
        done = await contract("record", url, file, *SHORT)
    assert (done.code, done.complaint) == (1, "2,000 topics, expected at most 1,000; --topic selects some")
