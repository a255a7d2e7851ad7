"""Words that ROS users type, against a server of each ROS generation and against other rosbridges."""

from __future__ import annotations

import asyncio
import json
import re
import signal
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path

import pytest

from rosbridge_sim import __main__
from rosbridge_sim.cli.tools.schema import DefinitionSources, open_store
from rosbridge_sim.shell.bags.bag import open_bag
from rosbridge_sim.shell.bags.message_writer import BagMessageWriter
from tests.cli.tool_fixture import Frame, Result, answering, in_the_background, other_server, run, start
from tests.conftest import Connect
from tests.support import PATIENCE, ServerProcess, read_line


@pytest.fixture(scope="module", params=[1, 2])
def ros(request: pytest.FixtureRequest) -> int:
    generation: int = request.param
    return generation


@pytest.fixture(scope="module")
def server(ros: int, tmp_path_factory: pytest.TempPathFactory) -> Iterator[ServerProcess]:
    """A server without a world in each generation."""
    process = ServerProcess(tmp_path_factory.mktemp("server") / "log.txt", ("--no-world", "--ros", str(ros)))
    yield process
    process.stop_cleanly()


# Words for a server, its output and what it notes; {m} and {s} are `msg/` and `srv/` of ROS 2. The order counts.
ROWS = [
    ("topic list -c", r"\d+\n", ""),
    ("topic list -t /client_count", r"/client_count \[std_msgs/{m}Int32\]\n", ""),
    ("topic type client_count", r"std_msgs/{m}Int32\n", ""),
    ("topic find std_msgs/Int32", r"/client_count\n", ""),
    ("topic find std_msgs/msg/Int32 --count-topics", r"1\n", ""),
    ("topic find std_msgs/Int32 -c --json", r"1\n", ""),
    (
        "topic info /client_count -v",
        r"(?s)Type: std_msgs/{m}Int32\n\nPublisher count: 1\n\nNode name: \w+\n.*PUBLISHER\n\nSubscription count: 0\n",
        "",
    ),
    ("topic echo /client_count std_msgs/{m}Int32 --once", r"data: \d+\n---\n", ""),
    ("topic echo /client_count/data -n 1", r"\d+\n---\n", ""),
    ("topic echo /client_count --csv --once", r"\d+\n", ""),
    ("topic echo -p /client_count -n 1", r"%time,field.data\n\d+,\d+\n", ""),
    ("topic echo /connected_clients --no-arr --once", r"clients: \"<array length: \d+>\"\n---\n", ""),
    (
        "topic echo --qos-reliability best_effort --once /client_count",
        r"data: \d+\n---\n",
        "--qos-reliability has no effect: ",
    ),
    (
        "topic pub -w 1 --max-wait-time-secs 0.01 -1 /hands std_msgs/String hi",
        "",
        "fewer than 1 nodes subscribe within 0.01 s",
    ),
    ("topic pub -1 /hands geometry_msgs/Point 1 2", "", r"expected 3 values \(x, y, z\); got 2"),
    ("service list --count-services", r"\d+\n", ""),
    ("service list -t", r"(?s).*/rosapi/topics \[rosapi{_msgs}/{s}Topics\]\n.*", ""),
    ("service type /rosapi/topics", r"rosapi{_msgs}/{s}Topics\n", ""),
    ("service node /rosapi/topics", r"/rosapi\n", ""),
    ("service find rosapi/Topics", r"/rosapi/topics\n", ""),
    ("service find rosapi_msgs/srv/Topics -c", r"1\n", ""),
    ("service find std_srvs/Empty", "", "no service of type std_srvs/Empty here"),
    (
        "service call /rosapi/topic_type rosapi/TopicType {{topic:\u00a0/client_count}}",
        r"type: std_msgs/{m}Int32\n",
        "",
    ),
    ("service call /rosapi/topic_type rosapi_msgs/srv/TopicType /client_count", r"type: std_msgs/{m}Int32\n", ""),
    ("service call /rosapi/nodes rosapi_msgs/srv/Nodes", r"nodes: .*\n", ""),
    ("service call /rosapi/nodes std_srvs/srv/Empty", "", r"is of type rosapi{_msgs}/{s}Nodes, not std_srvs/srv/Empty"),
    ("service args /rosapi/nodes", "", "service args: rosbridge-sim service info shows"),
    ("node list", r"(?s).*/rosapi\n.*", ""),
    ("node list -c", r"\d+\n", ""),
    (
        "node info /rosbridge_websocket",
        r"(?s).*  Publishers:\n.*    /client_count: std_msgs/{m}Int32\n.*  Service Servers:\n.*",
        "",
    ),
    ("node info /rosap", "", r"no node /rosap here \(did you mean /rosapi\?\)"),
    ("node ping /rosapi", "", "node ping: a rosbridge cannot reach a single node; rosbridge-sim wait "),
    ("param set /hands/x 2.5", r"Set parameter successful\n", ""),
    ("param set hands_node y [1,2]", r"Set parameter successful\n", ""),
    ("param get /hands/x", r"2.5\n", ""),
    ("param get /hands_node y", r"Integer values are: \[1, 2\]\n", ""),
    ("param get /hands_node y --hide-type", r"\[1, 2\]\n", ""),
    ("param list /hands_node", r"({indent}y|/hands_node/y)\n", ""),
    ("param dump /hands", r"hands:\n  x: 2.5\n", ""),
    ("param delete hands_node y", r"Deleted parameter successfully\n", ""),
    ("param delete hands_node y", "", r"/hands_node[:/]y is not set"),
    ("param get /hand/x", "", r"no parameter /hand/x here \(did you mean /hands/x\?\)"),
    ("param load x.yaml", "", "param load: a rosbridge reads no files"),
    ("action list", "(/tf2_web_republisher\n)?", ""),
    ("action info /hands", "", "no action /hands here"),
]


def test_words_of_ros_are_understood(server: ServerProcess, ros: int) -> None:
    spellings = {"m": "", "s": "", "_msgs": "", "indent": ""}
    if ros == 2:
        spellings = {"m": "msg/", "s": "srv/", "_msgs": "_msgs", "indent": "  "}

    def fill(pattern: str) -> str:
        return re.sub(r"\{(\w*)\}", lambda match: spellings.get(match[1], match[0]), pattern)

    wrong = []
    for words, out, err in ROWS:
        done = run(*(word.replace("\u00a0", " ") for word in words.format(**spellings).split(" ")), url=server.url)
        is_good = re.fullmatch(fill(out), done.out) and re.search(fill(err), done.err) and bool(done.err) == bool(err)
        if not is_good or done.err.count("\n") > 2 or (done.code == 0) != bool(out):
            wrong.append((words, done))
    assert not wrong


def test_values_of_a_node_have_the_shape_of_their_generation(server: ServerProcess, ros: int) -> None:
    node = "/rosapi"
    assert run("param", "set", node, "speed.max", "3", url=server.url).code == 0
    tree = run("param", "dump", node, "--json", url=server.url).json
    described = run("param", "describe", node, "speed.max", url=server.url)
    if ros == 1:
        assert tree == {"rosapi": {"speed.max": 3}}
        assert described.complaint == "ROS 1 has no descriptions of parameters; rosbridge-sim param get shows the value"
    else:
        assert tree[node]["ros__parameters"] == {"use_sim_time": False, "speed": {"max": 3}}
        assert described.out == "Parameter name: speed.max\n  Type: integer\n  Constraints:\n"
        assert run("param", "get", node, "use_sim_time", url=server.url).out == "Boolean value is: False\n"


async def test_values_in_order_become_a_message(server: ServerProcess, connect: Connect) -> None:
    client = await connect(server.url)
    await client.subscribe("/hands_twist", type="geometry_msgs/Twist")
    words = ("topic", "pub", "-t", "1", "-w", "1", "/hands_twist", "geometry_msgs/Twist", "[1, 2, 3]", "[0, 0, 0.5]")
    assert (await in_the_background(*words, url=server.url)).code == 0
    assert await client.message("/hands_twist") == {
        "linear": {"x": 1.0, "y": 2.0, "z": 3.0},
        "angular": {"x": 0.0, "y": 0.0, "z": 0.5},
    }


# actions


async def test_goal_is_sent_with_feedback_and_its_end_is_the_exit_code(server: ServerProcess, connect: Connect) -> None:
    client = await connect(server.url)
    await client.send("advertise_action", action="/count", type="action_tutorials_interfaces/Fibonacci")
    await client.settle()
    for status, word in ((4, "SUCCEEDED"), (6, "ABORTED")):
        words = ("action", "send_goal", "-f", "/count", "action_tutorials_interfaces/action/Fibonacci", "{order: 2}")
        task = asyncio.create_task(in_the_background(*words, url=server.url))
        goal = await client.take("send_action_goal")
        named = {"action": "/count", "id": goal["id"]}
        await client.send("action_feedback", **named, values={"partial_sequence": [0]})
        await client.send("action_result", **named, values={"sequence": [0, 1]}, status=status, result=True)
        done = await task
        assert done.out == (
            "Sending goal:\n    order: 2\n\nFeedback:\n    partial_sequence: [0]\n\nResult:\n    sequence: [0, 1]\n"
            f"\nGoal finished with status: {word}\n"
        )
        assert done.code == (0 if status == 4 else 1)
    assert done.complaint == "/count: the goal has not succeeded: ABORTED"


@pytest.mark.slow
async def test_ctrl_c_cancels_the_goal(server: ServerProcess, connect: Connect) -> None:
    client = await connect(server.url)
    await client.send("advertise_action", action="/count", type="action_tutorials_interfaces/Fibonacci")
    await client.settle()
    with start("action", "send_goal", "/count", "{order: 9}", url=server.url) as process:
        goal = await client.take("send_action_goal")
        assert await asyncio.to_thread(read_line, process) == "Sending goal:\n"
        process.send_signal(signal.SIGINT)
        await client.take("cancel_action_goal", id=goal["id"])
        assert await asyncio.to_thread(process.wait, PATIENCE) == 130
        assert process.stderr is not None
        assert process.stderr.read() == ""


# bags


@pytest.mark.slow
async def test_bag_is_recorded_shown_and_played(
    server: ServerProcess, ros: int, connect: Connect, tmp_path: Path
) -> None:
    """A bag of either generation is played to a server of either, with the spelling of the server."""
    client = await connect(server.url)
    sent = {"header": {"stamp": {"sec": 7, "nanosec": 8}, "frame_id": "a"}, "format": "png", "data": "AAEC"}
    kind = "sensor_msgs/CompressedImage"
    await client.send("advertise", topic="/hands_image", type=kind, latch=True)
    await client.send("publish", topic="/hands_image", msg=sent)
    await client.subscribe("/again", type=kind)
    names = {"a.bag": kind, "a.mcap": "sensor_msgs/msg/CompressedImage", "folder": "sensor_msgs/msg/CompressedImage"}
    for name, type_name in names.items():
        file = str(tmp_path / name)
        words = ("bag", "record", "-o", file, "/hands_image", "-n", "1")
        assert (await in_the_background(*words, url=server.url)).code == 0
        shown = run("bag", "info", file)
        assert re.search(rf"/hands_image .* {type_name}( |\n)", shown.out), shown
        assert run("bag", "info", file, "--json").json["topics"] == [
            {"topic": "/hands_image", "type": type_name, "count": 1}
        ]
        words = ("bag", "play", file, "-r", "100", "--remap", "/hands_image:=/again")
        done = await in_the_background(*words, url=server.url)
        assert done.code == 0, done
        msg = await client.message("/again")
        assert msg["header"].pop("stamp") == ({"secs": 7, "nsecs": 8} if ros == 1 else {"sec": 7, "nanosec": 8})
        assert (msg["header"]["frame_id"], msg["format"], msg["data"]) == ("a", "png", "AAEC")


async def test_topics_that_the_server_owns_are_left_out_of_a_played_bag(server: ServerProcess, tmp_path: Path) -> None:
    file = str(tmp_path / "a.mcap")
    words = ("record", "-o", file, "/client_count", "-n", "1")
    assert (await in_the_background(*words, url=server.url)).code == 0
    done = await in_the_background("bag", "play", file, url=server.url)
    assert (done.code, done.out) == (1, "")
    assert "/client_count is published by /rosbridge_websocket alone" in done.err
    assert "--remap OLD:=NEW plays one under another name" in done.err


async def test_a_loop_ends_when_the_server_refuses_all_topics(tmp_path: Path) -> None:
    """Nothing is left to wait for then: without an end the command would read the bag without pause."""
    file = tmp_path / "a.bag"
    writer = BagMessageWriter(open_bag(file), open_store(DefinitionSources(ros="1")))
    writer.add("/x", "std_msgs/Int32")
    writer.write_json("/x", b'{"data": 1}', 10**9)
    writer.close()
    ask, ids = answering(topics={"topics": [], "types": []}, get_time={}), []

    def reply(frame: Frame) -> Iterable[str | bytes]:
        yield from ask(frame)
        if frame["op"] == "advertise":
            ids.append(frame["id"])
        elif frame["op"] == "publish":
            yield json.dumps({"op": "status", "level": "error", "id": ids[0], "msg": "it is full"})

    async with other_server(reply) as url:
        with start("bag", "play", str(file), "--loop", url=url) as process:
            _, err = await asyncio.to_thread(process.communicate, timeout=PATIENCE)
    assert (process.returncode, err.count("it is full; it is left out")) == (0, 1)


def test_what_is_no_bag_is_one_sentence(tmp_path: Path) -> None:
    for name in ("a.bag", "a.mcap"):
        (tmp_path / name).write_bytes(b"no bag at all")
        for words in (("info", str(tmp_path / name)), ("info", str(tmp_path / "nowhere"))):
            done = run("bag", *words)
            assert (done.code, done.out, done.err.count("\n")) == (2, "", 1)


# Other rosbridges


def reply_with_stamps(clock: str | None) -> object:
    known = {"topics": ["/x", clock] if clock else ["/x"], "types": ["a/A", "rosgraph_msgs/Clock"]}
    ask = answering(topics=known, topic_type={"type": "a/A"}, publishers={"publishers": ["/n"]})

    def reply(frame: Frame) -> Iterable[str | bytes]:
        yield from ask(frame)
        if frame["op"] == "subscribe" and frame["topic"] == (clock or "/x"):
            for secs in (10, 11):
                if clock:
                    yield json.dumps({"op": "publish", "topic": clock, "msg": {"clock": {"secs": secs, "nsecs": 0}}})
                header = {"stamp": {"secs": secs - 1, "nsecs": 500_000_000 if secs == 10 else 0}}
                yield json.dumps({"op": "publish", "topic": "/x", "msg": {"header": header, "text": "12345"}})

    return reply


@pytest.mark.parametrize("clock", ["/clock", None])
async def test_delay_is_measured_in_the_time_of_the_stamps(clock: str | None) -> None:
    async with other_server(reply_with_stamps(clock)) as url:  # type: ignore[arg-type]
        done = await in_the_background("topic", "delay", "/x", "-n", "2", "--json", url=url)
    assert done.code == 0, done
    report = json.loads(done.lines[-1])
    if clock:
        assert (report["mean"], report["min"], report["max"], report["window"]) == (0.75, 0.5, 1.0, 2)
        assert "delay = /clock - header.stamp: the age of the content" in done.err
    else:
        assert report["min"] > 1e9
        assert "there is no /clock, so the clocks of both machines count" in done.err


async def test_bandwidth_counts_the_bytes_of_the_messages() -> None:
    async with other_server(reply_with_stamps(None)) as url:  # type: ignore[arg-type]
        done = await in_the_background("topic", "bw", "/x", "-n", "2", "--json", url=url)
    size = len('{"header":{"stamp":{"secs":9,"nsecs":500000000}},"text":"12345"}')
    assert {**json.loads(done.lines[-1]), "rate": 0, "is_new": 0} == {
        **dict.fromkeys(("rate", "is_new"), 0),
        "mean": size - 3.5,
        "min": size - 7,
        "max": size,
        "window": 2,
    }


async def test_rosbridge_of_ros_1_without_goals_says_which_topic_takes_them() -> None:
    known = {"topics": ["/fly/goal"], "types": ["my/FlyActionGoal"]}
    refused = "Service /rosapi/get_ros_version does not exist"
    reply = answering(
        action_servers={"action_servers": ["/fly"]}, topics=known, action_type="no", get_ros_version=refused
    )
    async with other_server(reply) as url:
        assert (await in_the_background("action", "list", "-t", url=url)).out == "/fly [my/Fly]\n"
        done = await in_the_background("action", "send_goal", "/fly", url=url)
    assert done.code == 1
    assert "topic pub --once /fly/goal my/FlyActionGoal" in done.complaint


@pytest.mark.parametrize("words", ["node list", "param list", "action list", "service find a/B", "topic find a/B"])
async def test_rosbridge_without_a_service_of_rosapi_is_one_sentence(words: str) -> None:
    def reply(frame: Frame) -> Iterable[str | bytes]:
        name = frame.get("service")
        if name:
            text = f"Service {name} does not exist"
            yield json.dumps({"op": "service_response", "id": frame["id"], "values": text, "result": False})

    async with other_server(reply) as url:
        done = await in_the_background(*words.split(), url=url)
    assert done.code == 1
    assert re.match(r"/rosapi/\w+ says: Service /rosapi/\w+ does not exist", done.complaint)


# Without a server


def run_main(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], words: str) -> Result:
    monkeypatch.setattr(sys, "argv", ["rosbridge-sim", *words.split()])
    code = __main__.main()
    return Result(code, *capsys.readouterr())


@pytest.mark.parametrize(
    ("words", "out"),
    [
        ("interface list -m", r"(?s)Messages:\n.*    std_msgs/String\n.*"),
        ("interface list -s --ros 2", r"(?s)Services:\n.*    std_srvs/srv/Trigger\n.*"),
        ("interface package std_srvs", r"(?s).*std_srvs/Trigger\n.*"),
        ("interface packages", r"(?s).*morai_msgs\n.*"),
        ("interface show geometry_msgs/msg/Twist", r"(?s).*Vector3 angular  # \[rad/s\]\n\tfloat64 x\n.*"),
        ("interface show std_srvs/srv/Trigger", r"(?s).*---\n.*bool success .*"),
        ("interface proto geometry_msgs/msg/Point", r'"x: 0.0\ny: 0.0\nz: 0.0\n"\n'),
        ("interface proto std_srvs/srv/SetBool", r'"data: false\n"\n'),
        ("rosmsg package std_srvs", r"(?s).*std_srvs/Trigger\n.*"),
        ("ros2 interface packages -a", r"(?s).*action_tutorials_interfaces\n.*"),
    ],
)  # fmt: skip
def test_interfaces_are_shown_as_ros_shows_them(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], words: str, out: str
) -> None:
    done = run_main(monkeypatch, capsys, words)
    assert (done.code, done.err) == (0, "")
    assert re.fullmatch(out, done.out), done.out


@pytest.mark.parametrize(
    ("words", "text"),
    [
        ("roscore", "roscore: none is needed; rosbridge-sim serve is the server"),
        ("ros2 launch a b.py", "launch: there are no packages of ROS to start"),
        ("rostopic echo", "the following arguments are required: NAME; see rosbridge-sim topic echo --help"),
        ("ros2 bag convert x", "bag convert: bags are not changed here"),
        ("rosmsg md5 std_msgs/String", "interface md5: programs behind a rosbridge compare no checksums"),
        ("ros2 chekc", "no such command: chekc (did you mean check?)"),
        ("interface show std_msgs/Strin", "no type std_msgs/Strin is known (did you mean std_msgs/String?)"),
        ("bag play x --remap a=b", "--remap: expected OLD:=NEW; got 'a=b'"),
        ("record", "the following arguments are required: FILE"),
        ("param set /x", "param set: expected [NODE] NAME VALUE; got 1 words"),
    ],
)
def test_words_without_a_meaning_are_one_sentence(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], words: str, text: str
) -> None:
    done = run_main(monkeypatch, capsys, words)
    assert done.code in {1, 2}
    assert done.complaint.startswith(text)
