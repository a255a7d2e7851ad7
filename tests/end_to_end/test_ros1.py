"""Real ROS 1 of Debian (roscore, rospy, roscpp, rostopic, rosservice, rosnode) beside a server, on loopback."""

from __future__ import annotations

import asyncio
import json
import os
import re
import shutil
import signal
import subprocess
from collections.abc import AsyncIterator, Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from rosbridge_sim import Simulator
from rosbridge_sim.client import Client as SyncClient
from rosbridge_sim.schema.definitions.md5 import service_md5
from rosbridge_sim.schema.definitions.typedefs import full_text
from rosbridge_sim.schema.message import Message
from tests.cpu_time import run as run_to_end
from tests.graph.bus_fixture import SCHEMAS, make_store
from tests.graph.participants import Somebody
from tests.shell.ros1.small_ros1 import until
from tests.support import PATIENCE, ROOT, Client, ServerProcess, held_port, miss

PYTHON = "/usr/bin/python3"
HERE = Path(__file__).parent
NODE = HERE / "node_of_ros1.py"
PLANNER = ROOT / "scripts" / "examples" / "plan_ros1.py"
MORAI_MSGS = SCHEMAS / "morai_msgs" / "22.R2"
MESSAGES = ("morai_msgs/EgoVehicleStatus",)
SERVICES = ("MoraiSyncModeCmdSrv", "MoraiWaitForTickSrv", "MoraiSyncModeCtrlCmdSrv")
LIBRARIES = ("roscpp", "rosconsole", "roscpp_serialization", "rostime", "xmlrpcpp", "cpp_common", "boost_system")

pytestmark = [pytest.mark.long, pytest.mark.client]


class Ros(NamedTuple):
    """The variables for programs of ROS, and the folder of this test."""

    env: Mapping[str, str]
    folder: Path

    @property
    def master(self) -> str:
        return self.env["ROS_MASTER_URI"]

    def run(self, *command: str | Path, fails: bool = False) -> str:
        """What a program says; it must succeed, or fail."""
        done = run_to_end(list(map(str, command)), env=self.env)
        assert (done.returncode != 0) is fails, done.stdout + done.stderr
        return done.stdout + (done.stderr if fails else "")

    def start_core(self) -> subprocess.Popen[bytes]:
        """A roscore that is ready."""
        port = self.master.rpartition(":")[2]
        core = subprocess.Popen(["roscore", "-p", port], env=self.env, stdout=subprocess.DEVNULL)
        while subprocess.run(["rosparam", "get", "/run_id"], env=self.env, capture_output=True, check=False).returncode:
            assert core.poll() is None
        return core

    def start_master(self) -> subprocess.Popen[bytes]:
        """A master alone, which can be killed as one process, and is ready."""
        master = subprocess.Popen(["rosmaster", "--core", "-p", self.master.rpartition(":")[2]], env=self.env)
        while subprocess.run(["rosparam", "list"], env=self.env, capture_output=True, check=False).returncode:
            assert master.poll() is None
        return master

    async def start_node(self, what: str, *arguments: str) -> asyncio.subprocess.Process:
        """A node of `node_of_ros1.py` that is ready."""
        node = await self.start(PYTHON, NODE, what, self.folder / "types.json", *arguments)
        assert await read(node) == "ready"
        return node

    async def start(self, *command: str | Path) -> asyncio.subprocess.Process:
        """A program whose output is read."""
        return await asyncio.create_subprocess_exec(
            *map(str, command), env=self.env, stdout=asyncio.subprocess.PIPE, limit=2**20
        )


async def read(program: asyncio.subprocess.Process) -> Any:  # noqa: ANN401 - any value of JSON
    """The next line of JSON that a program says."""
    assert program.stdout is not None
    async with asyncio.timeout(PATIENCE):
        while line := await program.stdout.readline():
            with suppress(json.JSONDecodeError):  # rospy writes warnings there, too
                return json.loads(line)
    raise AssertionError("the program has ended")


def stop(core: subprocess.Popen[bytes]) -> None:
    core.send_signal(signal.SIGINT)
    core.wait(PATIENCE)


@pytest.fixture
def ros(tmp_path: Path) -> Iterator[Ros]:
    if shutil.which("roscore") is None or not Path("/usr/include/ros/ros.h").exists():
        miss("needs ROS 1 of Debian (./scripts/test --long installs it)")
    store = make_store(1)
    services = {name: store.service(name) for name in (f"morai_msgs/{name}" for name in SERVICES)}
    types = {
        "messages": {name: store.full_text(name) for name in MESSAGES},
        "services": {
            name: [full_text(one.request.spec), full_text(one.response.spec), ""] for name, one in services.items()
        },
    }
    for name, one in services.items():
        types["services"][name][2] = service_md5(one.request.spec, one.response.spec)  # type: ignore[index] # of lists
    (tmp_path / "types.json").write_text(json.dumps(types))
    own = {"ROS_IP": "127.0.0.1", "ROS_HOME": str(tmp_path / "ros"), "ROS_LOG_DIR": str(tmp_path / "ros")}
    with held_port() as port:  # of the master, which comes and goes
        own["ROS_MASTER_URI"] = f"http://127.0.0.1:{port}"
        yield Ros({**os.environ, **own, "PYTHONUNBUFFERED": "1"}, tmp_path)


@pytest.fixture
def core(ros: Ros) -> Iterator[subprocess.Popen[bytes]]:
    core = ros.start_core()
    yield core
    stop(core)


@pytest.fixture
def server(ros: Ros, core: subprocess.Popen[bytes]) -> Iterator[ServerProcess]:
    assert core.poll() is None
    program = ServerProcess(ros.folder / "log", ["--ros1-master", "env", "--stamps", "sim"], dict(ros.env))
    yield program
    program.stop_cleanly()


@pytest.fixture
async def gateway(ros: Ros, core: subprocess.Popen[bytes]) -> AsyncIterator[tuple[Simulator, Client]]:
    """A server without a world, and a client of it."""
    assert core.poll() is None
    options = {"data_dir": ros.folder, "world": False}
    async with Simulator(port=0, ros1_master=ros.master, **options) as sim, await Client.open(sim.url) as client:  # type: ignore[arg-type] # of several types
        yield sim, client


def test_the_tools_of_ros_see_the_server(server: ServerProcess, ros: Ros) -> None:
    assert server.is_alive
    assert {"/Ego_topic", "/clock", "/ctrl_cmd", "/imu", "/tf"} <= set(ros.run("rostopic", "list").split())
    assert re.search(r"Type: sensor_msgs/Imu\n\nPublishers: \n \* /rosbridge_sim", ros.run("rostopic", "info", "/imu"))
    # A busy machine may take seconds to start the tool, and then hold the world for a while.
    near_50 = r"grep --max-count 1 --extended-regexp 'average rate: [45][0-9]\.'"
    rate = ros.run("sh", "-c", f"timeout -s INT {PATIENCE} rostopic hz -w 50 /imu | {near_50}").rpartition(" ")[2]
    assert 40 < float(rate) < 60
    assert 'frame_id: "imu_link"' in ros.run("rostopic", "echo", "-n", "1", "/imu")
    assert "xmlrpc reply from" in ros.run("rosnode", "ping", "-c", "1", "/rosbridge_sim")
    told = ros.run("rosnode", "info", "/rosbridge_sim")
    assert " * /imu [sensor_msgs/Imu]" in told
    assert " * /SyncModeWaitForTick" in told
    assert "Pid: " in told
    assert ros.run("rosservice", "type", "/SyncModeCmd") == "morai_msgs/MoraiSyncModeCmdSrv\n"
    assert "/rosbridge_sim" in ros.run("rosservice", "node", "/SyncModeCmd")


async def test_a_rospy_program_drives_in_synchronous_mode_until_it_is_killed(server: ServerProcess, ros: Ros) -> None:
    async with await Client.open(server.url) as client:
        await client.subscribe("/SyncModeInfo")
        driver = await ros.start(PYTHON, NODE, "drive", ros.folder / "types.json")
        seen = await read(driver)
        assert await driver.wait() == -signal.SIGKILL
        assert (seen["frames"], seen["steps"], seen["egos"] >= 200) == (200, [20_000_000], True)
        assert seen["speeds"][-1] > seen["speeds"][50] > seen["speeds"][0]
        await client.message_where("/SyncModeInfo", lambda info: bool(info["status"]))
        await client.message_where("/SyncModeInfo", lambda info: not info["status"])
    assert "node /planner has gone" in (ros.folder / "log").read_text()


def build_morai_msgs(ros: Ros) -> Mapping[str, str]:
    """The variables for programs that import `morai_msgs`, which genpy makes as a catkin workspace does."""
    folders = {name: SCHEMAS / name for name in ("std_msgs", "geometry_msgs")} | {"morai_msgs": MORAI_MSGS}
    includes = [f"-I{name}:{folder / 'msg'}" for name, folder in folders.items()]
    for kind in ("msg", "srv"):
        out = ros.folder / "python" / "morai_msgs" / kind
        out.mkdir(parents=True)
        make = (PYTHON, f"/usr/lib/genpy/gen{kind}_py.py", "-p", "morai_msgs", "-o", out)
        ros.run(*make, *includes, *sorted((MORAI_MSGS / kind).glob(f"*.{kind}")))
        ros.run(*make, "--initpy")
    (out.parent / "__init__.py").touch()
    return {**ros.env, "PYTHONPATH": str(out.parents[1])}


def test_the_planner_of_the_examples_overtakes_in_rospy(ros: Ros, core: subprocess.Popen[bytes]) -> None:
    assert core.poll() is None
    flags = ["--ros1-master", "env", "--stamps", "sim", "--scenario", "loop", "--start", "sync"]
    env = build_morai_msgs(ros)
    server = ServerProcess(ros.folder / "log", flags, dict(ros.env))
    try:
        with SyncClient(server.url, timeout=PATIENCE) as client:
            lanes = {lane["link"]: lane for lane in client.map()["lanes"]}
            link = client.nearest_lane(60.0, -3.5)["link"]  # of the car
            points: list[tuple[float, float]] = []
            while len(points) < 2_000:
                points += list(zip(lanes[link]["x"], lanes[link]["y"], strict=True))[:-1]
                link = lanes[link]["successors"][0]
            path = ros.folder / "path.txt"
            path.write_text("".join(f"{x} {y} 0\n" for x, y in points))
            plans = client.subscribe("/plan/path", "nav_msgs/Path", keep=1_000)
            client.score(reset=True)
            command = (PYTHON, PLANNER, "--path", path, "--seconds", "60", "--speed-kmh", "100")
            told = ros._replace(env=env).run(*command)
            client.confirm()
            found = plans.take()
            (score,) = client.score()
    finally:
        server.stop_cleanly()
    matched = re.search(r"drove 60 s, (\d+) lane changes, now at (\d+) km/h", told)
    assert matched is not None, told
    assert (int(matched[1]) >= 1, int(matched[2]) > 80) == (True, True)
    assert (score["collisions"], score["off_road_time"], score["distance"] > 1_300.0) == (0, 0.0, True)
    assert len(found) > 250  # of 300: a publisher of rospy loses those before it is connected
    assert all(len(one["poses"]) == 40 and one["header"]["frame_id"] == "map" for one in found)


@pytest.mark.parametrize("kind", ["raw", "jpeg"])
async def test_camera_and_lidar_arrive_at_their_full_rate(
    gateway: tuple[Simulator, Client], ros: Ros, kind: str
) -> None:
    bus = gateway[0].bus
    assert bus is not None
    me = Somebody("/camera")
    picture = "sensor_msgs/Image" if kind == "raw" else "sensor_msgs/CompressedImage"
    names = (("/picture", picture), ("/cloud", "sensor_msgs/PointCloud2"))
    topics = [bus.advertise(me, name, type_name) for name, type_name in names]
    sizes = [640 * 480 * 3 if kind == "raw" else 100_000, 572_000]
    counter = await ros.start_node("count", kind)
    await until(lambda: all(topic.has_listener for topic in topics))
    loop = asyncio.get_running_loop()
    start = loop.time()

    def make(i: int, frame: str) -> Message:
        message_type = topics[i].type
        return Message(message_type, message_type.check({"header": {"frame_id": frame}, "data": bytes(sizes[i])}, 0))

    for i in range(1, 151):  # five seconds
        due: asyncio.Future[None] = loop.create_future()
        loop.call_at(start + i / 30, due.set_result, None)
        await due
        frame = "last" if i == 150 else ""
        bus.announce(me, topics[0], make(0, frame), loop.time())
        if i % 3 == 0:
            bus.announce(me, topics[1], make(1, frame), loop.time())
    assert await read(counter) == {"/picture": 150, "/cloud": 50}
    await counter.wait()


async def test_topics_services_and_parameters_both_ways(gateway: tuple[Simulator, Client], ros: Ros) -> None:
    client = gateway[1]
    bus = gateway[0].bus
    assert bus is not None
    node = await ros.start_node("serve")
    await until(lambda: {"/switch", "/sleep"} <= bus.services.keys() and "/status" in bus.topics)
    await client.subscribe("/status")
    assert await client.message("/status") == {"data": "here"}, "it is latched"
    await client.subscribe("/echo")
    await client.send("advertise", topic="/say", type="std_msgs/String")
    await until(lambda: "/say" in bus.topics and bus.topics["/say"].has_listener)
    await client.send("publish", topic="/say", msg={"data": "hello"})
    assert await client.message("/echo") == {"data": "heard hello"}
    for i in range(20):  # at once
        await client.send("call_service", service="/switch", id=str(i), args={"data": True})
    for i in range(20):
        answer = await client.take("service_response", id=str(i))
        assert answer["values"] == {"success": True, "message": "on"}
    refusal = await client.call("/switch", {"data": False})
    assert (refusal["result"], "it cannot be switched off" in refusal["values"]) == (False, True)
    silent = await client.call("/sleep", {}, timeout=0.2)
    assert (silent["result"], silent["values"]) == (False, "Timeout exceeded while waiting for service response")
    assert (await client.values("/rosapi/get_param", {"name": "/server/speed"}))["value"] == "1.5"
    await client.values("/rosapi/set_param", {"name": "/from_client", "value": "[1, 2]"})
    await client.send("advertise_service", service="/trigger", type="std_srvs/Trigger")
    await client.send("publish", topic="/say", msg={"data": "end"})
    first = await client.take("call_service", service="/trigger")
    values = {"success": True, "message": "yes"}
    await client.send("service_response", service="/trigger", id=first["id"], result=True, values=values)
    second = await client.take("call_service", service="/trigger")
    await client.send("service_response", service="/trigger", id=second["id"], result=False, values="not again")
    answers = await read(node)
    assert (answers[0], "not again" in answers[1]) == ("yes", True)
    await node.wait()
    await until(lambda: "/switch" not in bus.services and not bus.topics["/echo"].publishers)
    told = await asyncio.to_thread(ros.run, "rosservice", "call", "/rosapi_nothing", fails=True)
    assert "Service [/rosapi_nothing] is not available" in told
    called = asyncio.create_task(asyncio.to_thread(ros.run, "rosservice", "call", "/trigger"))
    third = await client.take("call_service", service="/trigger")
    await client.send("service_response", service="/trigger", id=third["id"], result=True, values=values)
    assert (await called).split() == ["success:", "True", "message:", '"yes"']


async def test_a_provider_that_is_killed_fails_the_call_that_waits(gateway: tuple[Simulator, Client], ros: Ros) -> None:
    client, bus = gateway[1], gateway[0].bus
    assert bus is not None
    node = await ros.start_node("serve")
    await until(lambda: "/sleep" in bus.services)
    await client.send("call_service", service="/sleep", id="a")
    await client.send("call_service", service="/switch", id="b", args={"data": True})
    assert (await client.take("service_response", id="b"))["result"] is True
    node.kill()
    for key in ("a", "c"):  # the second one while the master still names the node
        answer = await client.take("service_response", id=key)
        assert (answer["result"], "Service /sleep of ROS 1 was lost" in answer["values"]) == (False, True)
        await client.send("call_service", service="/sleep", id="c")
    await node.wait()


async def test_roscpp_speaks_with_clients(gateway: tuple[Simulator, Client], ros: Ros) -> None:
    program = ros.folder / "node"
    flags = [f"-l{name}" for name in LIBRARIES]
    await asyncio.to_thread(ros.run, "g++", HERE / "node_of_ros1.cpp", "-o", program, *flags, "-lboost_thread")
    client, bus = gateway[1], gateway[0].bus
    assert bus is not None
    talker = await ros.start(program)
    await until(lambda: "/ask_roscpp" in bus.services)
    await client.subscribe("/from_roscpp", type="std_msgs/String")
    assert await client.message("/from_roscpp") == {"data": "hello"}
    assert await client.values("/ask_roscpp") == {"success": True, "message": "from roscpp"}
    await client.send("advertise", topic="/to_roscpp", type="std_msgs/String")
    await until(lambda: "/to_roscpp" in bus.topics and bus.topics["/to_roscpp"].has_listener)
    await client.send("publish", topic="/to_roscpp", msg={"data": "one"})
    await client.send("advertise_service", service="/ask_client", type="std_srvs/Trigger")
    call = await client.take("call_service", service="/ask_client")
    values = {"success": True, "message": "from a client"}
    await client.send("service_response", service="/ask_client", id=call["id"], result=True, values=values)
    await client.send("publish", topic="/to_roscpp", msg={"data": "two"})
    assert talker.stdout is not None
    async with asyncio.timeout(PATIENCE):
        assert await talker.stdout.read() == b"one\n1 from a client\ntwo\n"
    await talker.wait()


def test_a_master_that_is_killed_and_started_again_knows_the_server(ros: Ros) -> None:
    program = ServerProcess(ros.folder / "log", ["--ros1-master", "env"], dict(ros.env))
    core = ros.start_master()
    while "/imu" not in ros.run("rostopic", "list"):
        assert program.is_alive
    core.kill()
    core.wait()
    core = ros.start_master()
    while "/imu" not in ros.run("rostopic", "list"):
        assert program.is_alive
    assert "sensor_msgs/Imu" in ros.run("rostopic", "type", "/imu")
    program.stop_cleanly()
    assert "rosbridge_sim" not in ros.run("rosnode", "list")
    stop(core)
    assert (ros.folder / "log").read_text().count("everything is registered anew") <= 1
