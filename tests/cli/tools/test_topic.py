"""`topic ...` with our own server, as a user calls it."""

from __future__ import annotations

import asyncio
import json
import os
import re
import signal
from contextlib import suppress
from typing import Any

import pytest

from rosbridge_sim.cli.tools.hz import Rates, _Line
from rosbridge_sim.cli.tools.topic import FieldPath
from tests.cli.tool_fixture import in_the_background, run, start
from tests.conftest import Connect
from tests.support import PATIENCE, Client, ServerProcess, read_line


@pytest.fixture(scope="module")
def server(moving_server: ServerProcess) -> ServerProcess:
    """The world of these tests moves."""
    return moving_server


# list, info


def test_list_prints_one_name_per_line(server: ServerProcess) -> None:
    done = run("topic", "list", url=server.url)
    assert (done.code, done.err) == (0, "")
    assert {"/Ego_topic", "/ctrl_cmd", "/clock", "/rosout"} <= set(done.lines)
    assert done.lines == sorted(done.lines)


def test_list_with_types_has_them_in_brackets(server: ServerProcess) -> None:
    lines = run("topic", "list", "--types", url=server.url).lines
    rows = dict(line.split() for line in lines)
    assert rows["/Ego_topic"] == "[morai_msgs/EgoVehicleStatus]"


def test_list_shows_publishers_and_subscribers(server: ServerProcess) -> None:
    done = run("topic", "list", "-v", url=server.url)
    rows = [line.split() for line in done.lines]
    assert rows[0] == ["TOPIC", "TYPE", "PUBLISHERS", "SUBSCRIBERS"]
    assert ["/Ego_topic", "morai_msgs/EgoVehicleStatus", "/morai_sim", "-"] in rows
    assert ["/ctrl_cmd", "morai_msgs/CtrlCmd", "-", "/morai_sim"] in rows


def test_list_has_json_output(server: ServerProcess) -> None:
    plain = {one["topic"]: one for one in run("topic", "list", "--json", url=server.url).json}
    assert plain["/clock"] == {"topic": "/clock", "type": "rosgraph_msgs/Clock"}
    full = {one["topic"]: one for one in run("topic", "list", "-v", "--json", url=server.url).json}
    assert full.keys() == plain.keys()
    assert full["/clock"] == {**plain["/clock"], "publishers": ["/morai_sim"], "subscribers": []}


@pytest.mark.parametrize("name", ["/ctrl_cmd", "ctrl_cmd"])
def test_info_shows_type_publishers_and_subscribers(server: ServerProcess, name: str) -> None:
    done = run("topic", "info", name, url=server.url)
    assert done.out == "Type: morai_msgs/CtrlCmd\n\nPublishers: None\n\nSubscribers:\n * /morai_sim\n"
    assert run("topic", "info", name, "--json", url=server.url).json == {
        "topic": "/ctrl_cmd",
        "type": "morai_msgs/CtrlCmd",
        "publishers": [],
        "subscribers": ["/morai_sim"],
    }


def test_info_of_a_misspelt_topic_suggests_the_right_name(server: ServerProcess) -> None:
    done = run("topic", "info", "ego_topic", url=server.url)
    assert (done.code, done.out) == (1, "")
    assert done.complaint == "no topic /ego_topic here (did you mean /Ego_topic?)"


# echo


def test_echo_shows_whole_messages(server: ServerProcess) -> None:
    done = run("topic", "echo", "Ego_topic", "-n", "2", url=server.url)
    assert (done.code, done.err) == (0, "")
    first, second, rest = done.out.split("---\n")
    assert rest == ""
    for message in (first, second):
        assert message.startswith("header:\n  seq: ")
        assert "\nposition:\n  x: " in message


def test_echo_of_one_field(server: ServerProcess) -> None:
    done = run("topic", "echo", "/clock", "--field", "clock.secs", "--once", url=server.url)
    assert re.fullmatch(r"\d+\n---\n", done.out)


def test_echo_json_output_is_one_message_per_line(server: ServerProcess) -> None:
    done = run("topic", "echo", "/clock", "-n", "3", "--json", url=server.url)
    times = [json.loads(line)["clock"] for line in done.lines]
    assert len({(time["secs"], time["nsecs"]) for time in times}) == 3


def test_echo_of_a_latched_topic_comes_at_once(server: ServerProcess) -> None:
    assert "status: false\n" in run("topic", "echo", "/SyncModeInfo", "--once", url=server.url).out


def test_echo_of_an_unknown_topic_fails_and_names_the_option_to_wait(server: ServerProcess) -> None:
    done = run("topic", "echo", "/Ego_topi", url=server.url)
    assert (done.code, done.out) == (1, "")
    assert done.complaint == "no topic /Ego_topi here (did you mean /Ego_topic?); --type PKG/TYPE waits for one"


def test_echo_with_the_wrong_type_shows_the_reason(server: ServerProcess) -> None:
    done = run("topic", "echo", "/clock", "--type", "std_msgs/String", url=server.url)
    assert done.code == 1
    assert "already established with type rosgraph_msgs/Clock" in done.complaint


async def test_echo_with_a_type_waits_for_the_topic(server: ServerProcess, connect: Connect) -> None:
    client = await connect(server.url)
    topic, kind = "/tools/later", "std_msgs/String"
    tool = asyncio.create_task(in_the_background("topic", "echo", topic, "--type", kind, "--once", url=server.url))
    await wait_for_listener(client, topic)
    await client.send("publish", topic=topic, type=kind, msg={"data": "at last"})
    done = await tool
    assert (done.code, done.out, done.err) == (0, "data: at last\n---\n", "")


async def wait_for_listener(client: Client, topic: str) -> None:
    """Come back once somebody subscribes to the topic."""
    async with asyncio.timeout(PATIENCE):
        while not (await client.values("/rosapi/subscribers", {"topic": topic}))["subscribers"]:
            pass


@pytest.mark.parametrize(
    ("path", "line"),
    [
        ("clok", "no clok (did you mean clock?); it has clock"),
        ("clock.sec", "no sec in clock (did you mean secs?); it has secs, nsecs"),
        ("clock.secs.x", "no x in clock.secs"),
        ("clock[0]", "no list in clock, so there is no [0]"),
    ],
)
def test_unknown_field_is_reported(server: ServerProcess, path: str, line: str) -> None:
    done = run("topic", "echo", "/clock", "--field", path, url=server.url)
    assert (done.code, done.complaint) == (1, f"--field: {line}")


def test_field_path_can_index_lists() -> None:
    assert FieldPath("a[1].b").find({"a": [{}, {"b": [3]}]}) == [3]
    assert FieldPath("a[1].b[0]").find({"a": [{}, {"b": [3]}]}) == 3


# hz


def test_rate_has_mean_shortest_longest_and_deviation() -> None:
    rates = Rates()
    assert rates.read() is None
    for time in (0.0, 0.1, 0.3, 0.6):
        rates.add(time)
    rate = rates.read()
    assert rate is not None
    wanted = {"rate": 5.0, "min": 0.1, "max": 0.3, "std_dev": 0.0816496580927726, "window": 4}
    assert rate == pytest.approx(wanted)


def test_rates_look_back_no_further_than_the_window() -> None:
    rates = Rates(3)
    for time in (0.0, 10.0, 10.5, 11.0):
        rates.add(time)
    rate = rates.read()
    assert rate is not None
    assert (rate["rate"], rate["std_dev"], rate["window"]) == pytest.approx((2.0, 0.0, 3))


def test_messages_at_one_instant_have_no_rate() -> None:
    rates = Rates()
    rates.add(1.0)
    rates.add(1.0)
    report = rates.read()
    assert report is not None
    assert rates.text(report).startswith("average rate: inf Hz")


def test_hz_ends_after_the_given_number_of_messages(server: ServerProcess) -> None:
    done = run("topic", "hz", "/clock", "-n", "5", url=server.url)
    assert (done.code, done.err) == (0, "")
    pattern = r"average rate: [\d.]+ Hz  min: [\d.]+ s  max: [\d.]+ s  std dev: [\d.]+ s  window: 5"
    assert re.fullmatch(pattern, done.lines[-1])


def test_hz_has_json_output(server: ServerProcess) -> None:
    done = run("topic", "hz", "/clock", "-n", "4", "--window", "3", "--json", url=server.url)
    last = json.loads(done.lines[-1])
    assert last.keys() == {"rate", "min", "max", "std_dev", "window", "is_new"}
    assert last["window"] == 3
    assert last["min"] <= 1 / last["rate"] <= last["max"]


@pytest.mark.slow
async def test_hz_reports_when_no_messages_arrive(server: ServerProcess, connect: Connect) -> None:
    client = await connect(server.url)
    topic, kind = "/tools/rare", "std_msgs/String"
    with start("topic", "hz", topic, "--type", kind, "-n", "2", url=server.url) as process:
        assert await asyncio.to_thread(read_line, process) == "no new messages\n"
        await wait_for_listener(client, topic)
        for _ in range(2):
            await client.send("publish", topic=topic, type=kind, msg={})
        out, err = await asyncio.to_thread(process.communicate, timeout=PATIENCE)
        assert (process.returncode, err) == (0, "")
        assert out.splitlines()[-1].startswith("average rate: ")


@pytest.mark.slow
async def test_hz_reports_a_stream_that_has_stopped(server: ServerProcess, connect: Connect) -> None:
    """The rate is that of the last messages: without `is_new`, a sensor that has died still has 10 Hz."""
    client = await connect(server.url)
    topic, kind = "/tools/stops", "std_msgs/String"
    with start("topic", "hz", topic, "--type", kind, "-n", "3", "--json", url=server.url) as process:

        async def report() -> dict[str, Any]:
            value: dict[str, Any] = json.loads(await asyncio.to_thread(read_line, process))
            return value

        assert not (await report())["is_new"]
        await wait_for_listener(client, topic)
        for _ in range(2):
            await client.send("publish", topic=topic, type=kind, msg={})
        while not (one := await report())["is_new"]:
            pass
        while (one := await report())["is_new"]:  # the two may have come in different seconds
            pass
        assert one["window"] == 2
        await client.send("publish", topic=topic, type=kind, msg={})
        out, _ = await asyncio.to_thread(process.communicate, timeout=PATIENCE)
        assert json.loads(out.splitlines()[-1])["is_new"]


def test_hz_reports_missing_messages_despite_a_known_rate(capsys: pytest.CaptureFixture[str]) -> None:
    rates = Rates()
    with _Line(rates, is_json=False) as line:
        line.write(is_new=True)
        for time in (0.0, 0.5, 1.0):
            rates.add(time)
        line.write(is_new=True)
        line.write(is_new=False)
    text = "average rate: 2.000 Hz  min: 0.5000 s  max: 0.5000 s  std dev: 0.00000 s  window: 3"
    assert capsys.readouterr().out.splitlines() == ["no new messages", text, "no new messages"]


# pub


async def test_pub_once_reaches_subscribers(server: ServerProcess, connect: Connect) -> None:
    client = await connect(server.url)
    await client.subscribe("/tools/chatter", type="std_msgs/Header")
    text = "{frame_id: 'map', stamp: {secs: 3}}"
    done = await in_the_background("topic", "pub", "tools/chatter", "std_msgs/Header", text, "--once", url=server.url)
    assert (done.code, done.out) == (0, "")
    assert done.complaint == "published 1 message to /tools/chatter (subscribers: /rosbridge_websocket)"
    assert await client.message("/tools/chatter") == {"seq": 0, "stamp": {"secs": 3, "nsecs": 0}, "frame_id": "map"}


async def test_pub_repeats_at_the_given_rate(server: ServerProcess, connect: Connect) -> None:
    client = await connect(server.url)
    topic, kind = "/tools/often", "std_msgs/Int32"
    await client.subscribe(topic, type=kind)
    words = ("topic", "pub", topic, kind, '{"data": 7}', "-n", "3", "--rate", "1000", "--json")
    done = await in_the_background(*words, url=server.url)
    assert json.loads(done.out) == {"topic": topic, "type": kind, "count": 3}
    assert [await client.message(topic) for _ in range(3)] == [{"data": 7}] * 3


@pytest.mark.slow
async def test_latched_message_reaches_later_subscribers(server: ServerProcess, connect: Connect) -> None:
    client = await connect(server.url)
    with start("topic", "pub", "/tools/kept", "std_msgs/String", "data: hi", "--latch", url=server.url) as process:
        assert process.stderr is not None
        line = await asyncio.to_thread(process.stderr.readline)
        assert line.endswith("published to /tools/kept (no subscribers); kept until Ctrl-C for later subscribers\n")
        await client.send("subscribe", topic="/tools/kept")
        assert await client.message("/tools/kept") == {"data": "hi"}
        process.send_signal(signal.SIGINT)
        out, err = await asyncio.to_thread(process.communicate, timeout=PATIENCE)
    assert (process.returncode, out) == (0, "")
    assert err == "rosbridge-sim: published 1 message to /tools/kept\n"


@pytest.mark.parametrize(
    ("topic", "kind", "text", "line"),
    [
        ("/ctrl_cmd", "morai_msgs/CtrlCmd", "{speed: 3}", "morai_msgs/CtrlCmd does not have a field speed"),
        ("/ctrl_cmd", "morai_msgs/CtrlCmd", "{velocity: fast}", "requires a float64 for field velocity, but got"),
        ("/ctrl_cmd", "std_msgs/String", "{}", "already established with type morai_msgs/CtrlCmd"),
        ("/Ego_topic", "morai_msgs/EgoVehicleStatus", "{}", "is published by /morai_sim alone"),
        ("/x", "String", "{}", "String is not a valid type string; name its package, too, as in std_msgs/String"),
        ("/x", "std_msgs/Strin", "{}", "std_msgs/Strin"),
    ],
)
def test_pub_of_a_message_that_does_not_fit_its_type_shows_the_reason(
    server: ServerProcess, topic: str, kind: str, text: str, line: str
) -> None:
    for word in ("--once", "--rate=1", "--latch") if kind == "morai_msgs/CtrlCmd" else ("--once",):
        done = run("topic", "pub", topic, kind, text, word, url=server.url)
        assert (done.code, done.out) == (1, "")
        assert line in done.complaint


def test_malformed_message_is_refused_without_a_connection() -> None:
    done = run("topic", "pub", "/x", "std_msgs/String", "{data: ", url="ws://127.0.0.1:1")
    assert done.code == 2
    assert done.complaint.startswith("MESSAGE:1:8: expected JSON, or YAML such as '{x: 1}': ")


@pytest.mark.slow
async def test_pub_reports_that_the_simulator_ignores_a_control_command(
    server: ServerProcess, connect: Connect
) -> None:
    client = await connect(server.url)
    await client.ask("/SyncModeCmd", user_id="me", start_sync_mode=True, time_step=20)
    try:
        done = await in_the_background("topic", "pub", "/ctrl_cmd", "morai_msgs/CtrlCmd", "--once", url=server.url)
    finally:
        await client.ask("/SyncModeCmd", user_id="me", start_sync_mode=False, time_step=20)
    assert done.code == 0
    assert "the server says: /ctrl_cmd is ignored in synchronous mode" in done.err


# How they end


@pytest.mark.slow
@pytest.mark.parametrize(
    "words", [("topic", "echo", "/clock"), ("topic", "hz", "/clock"), ("topic", "hz", "/clock", "--json")]
)
def test_ctrl_c_ends_an_endless_command_with_exit_code_0(server: ServerProcess, words: tuple[str, ...]) -> None:
    with start(*words, url=server.url) as process:
        assert read_line(process)
        process.send_signal(signal.SIGINT)
        _, err = process.communicate(timeout=PATIENCE)
    assert (process.returncode, err) == (0, "")


@pytest.mark.slow
def test_closed_output_pipe_is_not_an_error(server: ServerProcess) -> None:
    with start("topic", "echo", "/clock", url=server.url) as process:
        assert read_line(process) == "clock:\n"
        assert process.stdout is not None
        process.stdout.close()
        assert process.wait(PATIENCE) == 0
        assert process.stderr is not None
        assert process.stderr.read() == ""


@pytest.mark.slow
async def test_hz_updates_one_line_on_a_terminal(server: ServerProcess, connect: Connect) -> None:
    client = await connect(server.url)
    topic, kind = "/tools/shown", "std_msgs/String"
    controller, terminal = os.openpty()
    with start("topic", "hz", topic, "--type", kind, "-n", "3", url=server.url, stdout=terminal) as process:
        os.close(terminal)
        await wait_for_listener(client, topic)
        for _ in range(2):
            await client.send("publish", topic=topic, type=kind, msg={})
        said = b""
        async with asyncio.timeout(PATIENCE):  # it writes once a second, whatever comes
            while b"\raverage rate" not in said:
                said += await asyncio.to_thread(os.read, controller, 4096)
        await client.send("publish", topic=topic, type=kind, msg={})
        assert await asyncio.to_thread(process.wait, PATIENCE) == 0
    with suppress(OSError):  # the end of a terminal whose other side is closed
        while part := os.read(controller, 4096):
            said += part
    os.close(controller)
    assert said.count(b"\raverage rate") >= 2
    assert said.count(b"\n") == 1
