"""A simulator behind a bridge that dies, stalls or lacks something: it recovers, and one log line names the fault.

The bridge is our own server without a world, or the far side with the manners of rosbridge_suite. Clients know the
bridge alone. What takes time is waited for by what comes meanwhile.
"""

from __future__ import annotations

import asyncio
import os
import signal
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import ExitStack, asynccontextmanager
from pathlib import Path

import pytest

from tests.broken_proxy import BrokenProxy, draw_fates
from tests.conftest import Connect
from tests.deployment import Kind
from tests.far_side.messages import UNFIT
from tests.far_side.server import FarSide
from tests.support import PATIENCE, AttachProcess, Client, FarSideProcess, Frame, ServerProcess, held_port

pytestmark = pytest.mark.slow

BRIDGES: tuple[Kind, ...] = ("attach", "quirks")

MIB = 2**20

Start = Callable[..., AttachProcess]
"""`start(url, "--start", "sync")`: a simulator that dials a bridge, or several: a list of URLs."""

Bridge = ServerProcess | FarSideProcess

Build = Callable[..., Bridge]
"""`build("quirks", "--work", "0.1", port=9090)`: a bridge of some kind."""


@pytest.fixture
def build(tmp_path: Path) -> Iterator[Build]:
    """Starts bridges. The port of each is held to the end, so that another one can take its place."""
    bridges: list[Bridge] = []
    ports = ExitStack()

    def build_one(kind: Kind, *flags: str, port: int = 0) -> Bridge:
        port = port or ports.enter_context(held_port())
        log = tmp_path / f"bridge-{len(bridges)}.txt"
        bridges.append(
            FarSideProcess(log, flags, port)
            if kind == "quirks"
            else ServerProcess(log, ["--no-world", *flags], port=port)
        )
        return bridges[-1]

    with ports:
        yield build_one
    for bridge in bridges:
        bridge.kill()
        if isinstance(bridge, FarSideProcess):
            assert not UNFIT.search(bridge.log), "a message or an answer that ROS 1 refuses"


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Start]:
    """Starts simulators that dial; each must end cleanly, whatever became of its bridge."""
    simulators: list[AttachProcess] = []

    def start_one(urls: str | list[str], *flags: str) -> AttachProcess:
        log = tmp_path / f"simulator-{len(simulators)}.txt"
        simulators.append(AttachProcess(log, [urls] if isinstance(urls, str) else urls, flags))
        return simulators[-1]

    yield start_one
    for simulator in simulators:
        simulator.stop_cleanly()


class Driver:
    """A master at the wheel."""

    def __init__(self, client: Client) -> None:
        self.client = client

    async def lead(self) -> int:
        """Be the master; the frame."""
        answer = await self._ask("/SyncModeCmd", user_id="me", start_sync_mode=True, time_step=20)
        assert answer["result"] is True
        frame: int = answer["frame"]
        return frame

    async def drive(self, frame: int, num_ticks: int) -> tuple[int, float]:
        """Full throttle for some ticks from a frame on; the frame after them, and how far east that is [m]."""
        for named in range(frame + 1, frame + 1 + num_ticks):
            answer = await self._ask("/SyncModeCtrlCmd", frame=named, command={"longlCmdType": 1, "accel": 1.0})
            assert answer["result"] is True
            answer = await self._ask("/SyncModeWaitForTick", user_id="me", frame=named)
            assert (answer["tick_status"], answer["frame"]) == (True, named)
        return answer["frame"], answer["vehicle_status"]["position"]["x"]

    async def _ask(self, service: str, **request: object) -> Frame:
        """A call, made again if it went to a socket that is gone: rosbridge_suite lists those, and tells it late."""
        answer = await self.client.call(service, {"request": request})
        while answer["values"] == f"Service {service} was unadvertised":
            answer = await self.client.call(service, {"request": request})
        response: Frame = answer["values"]["response"]
        return response


SERVICES = {"/SyncModeCmd", "/SyncModeCtrlCmd", "/SyncModeWaitForTick", "/Service_MoraiEventCmd"}
"""Those that these tests call. Each may have a socket of its own, which comes back when it likes."""


async def until_announced(client: Client) -> None:
    """Come back once the simulator is there again: its latched topic first, its services soon after."""
    await client.send("subscribe", topic="/SyncModeInfo", type="morai_msgs/SyncModeInfo", id="until")
    await client.message("/SyncModeInfo")
    await client.send("unsubscribe", topic="/SyncModeInfo", id="until")
    async with asyncio.timeout(PATIENCE):
        while SERVICES - set((await client.values("/rosapi/services"))["services"]):
            pass


async def lines_of(simulator: AttachProcess, client: Client, text: str) -> list[str]:
    """The lines of its log with this text, once there is one; the world's clock goes on meanwhile."""
    async with asyncio.timeout(PATIENCE):
        while not (lines := [line for line in simulator.log.splitlines() if text in line]):
            await client.message("/clock")
    return lines


# Gone and back


@pytest.mark.parametrize("kind", BRIDGES)
async def test_drive_goes_on_after_the_bridge_was_killed(
    build: Build, start: Start, connect: Connect, kind: Kind
) -> None:
    bridge = build(kind)
    simulator = start(bridge.url, "--start", "sync", "--sync-lease", "60")
    driver = Driver(await connect(bridge.url))
    frame, x = await driver.drive(await driver.lead(), 50)
    for _ in range(2):
        tick = {"request": {"user_id": "me", "frame": frame + 1}}
        await driver.client.send("call_service", service="/SyncModeWaitForTick", args=tick)  # whose answer is lost
        bridge.kill()
        bridge = build(kind, port=bridge.port)
        driver = Driver(await connect(bridge.url))
        await until_announced(driver.client)
        led = await driver.lead()
        assert led in {frame, frame + 1}, "nothing else has moved the world"
        frame, further = await driver.drive(led, 50)
        assert further > x, "it drives on from where it was"
        x = further
    assert simulator.log.count("attached:") == 3


@pytest.mark.parametrize("kind", BRIDGES)
async def test_real_time_drive_goes_on_after_the_bridge_was_killed(
    build: Build, start: Start, connect: Connect, kind: Kind
) -> None:
    bridge = build(kind)
    start(bridge.url)
    client = await connect(bridge.url)
    await client.send("advertise", topic="/ctrl_cmd", type="morai_msgs/CtrlCmd")
    await client.send("publish", topic="/ctrl_cmd", msg={"longlCmdType": 2, "velocity": 20.0})
    await client.send("subscribe", topic="/Ego_topic", type="morai_msgs/EgoVehicleStatus")
    before = await client.message_where("/Ego_topic", lambda status: status["velocity"]["x"] > 2.0)
    bridge.kill()
    client = await connect(build(kind, port=bridge.port).url)
    await client.send("subscribe", topic="/Ego_topic", type="morai_msgs/EgoVehicleStatus")
    after = await client.message("/Ego_topic")
    assert after["position"] != before["position"], "it has not stood still meanwhile"
    await client.send("advertise", topic="/ctrl_cmd", type="morai_msgs/CtrlCmd")
    await until_announced(client)
    await client.send("publish", topic="/ctrl_cmd", msg={"longlCmdType": 1, "brake": 1.0})
    await client.message_where("/Ego_topic", lambda status: status["velocity"]["x"] == 0.0)


async def test_second_simulator_takes_over_after_the_first_was_killed(
    build: Build, start: Start, connect: Connect
) -> None:
    """rosbridge_suite keeps the services of the one that is gone, and calls of them wait for ever."""
    bridge = build("quirks")
    first = AttachProcess(Path("/dev/null"), [bridge.url])
    first.kill()
    client = await connect(bridge.url)
    await client.send("call_service", service="/Service_MoraiEventCmd", id="lost", args={})
    second = start(bridge.url)
    frame = await client.take("service_response", id="lost")
    assert (frame["result"], frame["values"]) == (False, "Service /Service_MoraiEventCmd was unadvertised")
    assert (await client.ask("/Service_MoraiEventCmd", option=0))["gear"] == 4
    (line,) = [line for line in second.log.splitlines() if " already" in line]
    assert "WARNING" in line


@pytest.mark.parametrize("kind", BRIDGES)
async def test_drive_over_one_socket_per_topic_and_service_is_the_same(
    build: Build, start: Start, connect: Connect, kind: Kind
) -> None:
    bridge = build(kind)
    start(bridge.url, "--start", "sync", "--attach-sockets", "per-topic", "--sync-lease", "60")
    driver = Driver(await connect(bridge.url))
    frame, x = await driver.drive(await driver.lead(), 50)
    bridge.kill()
    client = await connect(build(kind, port=bridge.port).url)
    await until_announced(client)
    assert (await Driver(client).drive(frame, 50))[1] > x


# What the far side lacks, or has already


async def test_package_missing_at_the_bridge_is_one_log_line(build: Build, start: Start, connect: Connect) -> None:
    bridge = build("quirks", "--without", "morai_msgs")
    simulator = start(bridge.url)
    client = await connect(bridge.url)
    await client.send("subscribe", topic="/clock", type="rosgraph_msgs/Clock")
    (line,) = await lines_of(simulator, client, "package morai_msgs")
    assert "WARNING" in line
    await client.message("/clock")
    services = (await client.values("/rosapi/services"))["services"]
    assert "/SyncModeCmd" not in services


async def test_bridge_without_rosapi_can_drive_the_car(build: Build, start: Start) -> None:
    bridge = build("quirks", "--no-rosapi")
    simulator = start(bridge.url, "--start", "sync")
    async with await Client.open(bridge.url) as client:
        driver = Driver(client)
        await driver.drive(await driver.lead(), 20)
    assert len(simulator.log.splitlines()) < 10


async def test_service_that_exists_at_the_bridge_is_one_log_line(build: Build, start: Start, connect: Connect) -> None:
    bridge = build("quirks", "--provide", "/Service_MoraiEventCmd=morai_msgs/MoraiEventCmdSrv")
    simulator = start(bridge.url)
    client = await connect(bridge.url)
    await client.send("subscribe", topic="/clock", type="rosgraph_msgs/Clock")
    (line,) = await lines_of(simulator, client, "it already has /Service_MoraiEventCmd")
    assert "WARNING" in line


async def test_refused_call_is_answered_at_a_bridge_that_ignores_result(
    build: Build, start: Start, connect: Connect
) -> None:
    bridge = build("quirks")
    start(bridge.url, "--start", "sync")
    client = await connect(bridge.url)
    answer = await client.ask("/SyncModeWaitForTick", user_id="nobody", frame=1)
    assert answer["tick_status"] is False
    answer = await client.ask("/Service_MoraiSL", file_name="no such scenario")
    assert answer["result"] is False


async def test_unrequested_fragments_of_a_call_are_joined(build: Build, start: Start, connect: Connect) -> None:
    bridge = build("quirks", "--max-message-size", "100")
    simulator = start(bridge.url, "--start", "sync")
    client = await connect(bridge.url)
    await client.send("call_service", service="/rosapi/get_time", id="mine", fragment_size=10**6)  # for us alone
    await client.take("service_response", id="mine")
    driver = Driver(client)
    frame, _ = await driver.drive(await driver.lead(), 20)
    assert frame == 20
    warnings = [line for line in simulator.log.splitlines() if "WARNING" in line]
    assert all("it is too slow: " in line for line in warnings), simulator.log  # as any bridge of a busy machine


# Slow and broken


MOST_TURNS = 4
"""Log lines on a bridge that is too slow and fast enough again: each takes twice as long to come as the one before."""


@asynccontextmanager
async def watched(simulator: AttachProcess, num_lines: int, growth: int = 24 * MIB) -> AsyncIterator[None]:
    """Whatever happens meanwhile costs the simulator little memory [bytes] and few lines."""
    memory, lines = simulator.memory, len(simulator.log.splitlines())
    yield
    assert simulator.is_alive, simulator.log
    assert simulator.memory - memory < growth
    new = simulator.log.splitlines()[lines:]
    turns = [line for line in new if "it is too slow: " in line or "it is fast enough again: " in line]
    assert len(turns) <= MOST_TURNS, simulator.log
    assert len(new) - len(turns) <= num_lines, simulator.log


async def test_slow_bridge_is_not_flooded(build: Build, start: Start, connect: Connect) -> None:
    """It handles fewer frames than a world makes, reads them all and says nothing: answers still come."""
    bridge = build("quirks", "--work", "0.004")
    assert isinstance(bridge, FarSideProcess)
    simulator = start(bridge.url)
    client = await connect(bridge.url)
    async with watched(simulator, num_lines=5):
        while bridge.report["handled"] < 700:
            state = await client.ask("/Service_MoraiEventCmd", option=0)
            assert state["gear"] == 4
    assert bridge.report["most_waiting"] < 500


async def test_small_topics_pass_clouds_at_a_bridge_that_checks_texts_slowly(
    build: Build, start: Start, connect: Connect
) -> None:
    """A cloud takes it 0.14 s, as rosbridge_suite with an old wsaccel on half a core; nobody reads its second name."""
    bridge = build("quirks", "--utf8-check", "0.24")
    assert isinstance(bridge, FarSideProcess)
    start(bridge.url, "--sensors", "teaching")
    client = await connect(bridge.url)
    assert "/lidar3D" not in bridge.report["published"]
    for name in ("/lidar3D", "/image_jpeg/compressed"):
        await client.subscribe(name)
    await client.message("/image_jpeg/compressed")
    for _ in range(6):
        await client.message("/lidar3D")
    published = bridge.report["published"]
    assert published["/Ego_topic"] >= 5 * published["/lidar3D"]
    assert "/velodyne_points" not in published


async def test_topics_on_other_sockets_do_not_delay_an_answer(build: Build, start: Start, connect: Connect) -> None:
    """A slow far side handles few frames between a call and its answer; with one socket for all, it is hundreds."""
    bridge = build("quirks", "--work", "0.004")
    assert isinstance(bridge, FarSideProcess)
    start(bridge.url, "--attach-sockets", "per-topic")
    client = await connect(bridge.url)
    while bridge.report["handled"] < 500:
        await client.settle()
    counts = []
    for _ in range(5):
        before = bridge.report["handled"]
        await client.ask("/Service_MoraiEventCmd", option=0)
        counts.append(bridge.report["handled"] - before)
    assert min(counts) < 150, counts


async def test_stalled_bridge_does_not_delay_clients_of_another(build: Build, start: Start, connect: Connect) -> None:
    """Two bridges: the one's threads hang while it reads on, the other's clients notice nothing."""
    bridge = build("attach")
    async with FarSide() as far_side:
        simulator = await asyncio.to_thread(start, [bridge.url, far_side.url])
        client, there = await connect(bridge.url), await connect(far_side.url)
        await until_announced(there)
        await client.send("subscribe", topic="/clock", type="rosgraph_msgs/Clock")
        far_side.may_work.clear()
        async with watched(simulator, num_lines=5):
            for _ in range(100):
                await client.message("/clock")
            assert (await client.ask("/Service_MoraiEventCmd", option=0))["gear"] == 4
        assert far_side.most_waiting < 800
        far_side.may_work.set()
        assert (await there.ask("/Service_MoraiEventCmd", option=0))["gear"] == 4


async def test_bridge_on_a_frozen_machine_is_kept_and_delays_no_other(
    build: Build, start: Start, connect: Connect
) -> None:
    """It reads nothing at all: what waits for it has a bound, and another bridge notices nothing."""
    bridge, frozen = build("attach"), build("quirks")
    simulator = start([bridge.url, frozen.url])
    client, there = await connect(bridge.url), await connect(frozen.url)
    await until_announced(there)
    await client.send("subscribe", topic="/clock", type="rosgraph_msgs/Clock")
    os.kill(frozen.pid, signal.SIGSTOP)
    async with watched(simulator, num_lines=5):
        for _ in range(100):
            await client.message("/clock")
        assert (await client.ask("/Service_MoraiEventCmd", option=0))["gear"] == 4
    os.kill(frozen.pid, signal.SIGCONT)
    assert (await there.ask("/Service_MoraiEventCmd", option=0))["gear"] == 4


@pytest.mark.parametrize(("kind", "seed"), [("attach", 1), ("quirks", 2)])
async def test_unreliable_connection_is_dialled_again_until_it_holds(
    build: Build, start: Start, connect: Connect, kind: Kind, seed: int
) -> None:
    num_fates = 5
    bridge = build(kind)
    async with BrokenProxy(bridge.port, draw_fates(seed, num_fates, 20_000)) as proxy:
        # A mute connection is noticed soon, and the last one is not lost to a machine that is busy for some seconds.
        flags = ("--ping-interval", "0.3", "--ping-timeout", "5", "--attach-retry", "0.5")
        simulator = await asyncio.to_thread(start, proxy.url, *flags)
        async with watched(simulator, num_lines=4 * num_fates):
            await proxy.until(lambda: proxy.is_used_up)
            client = await connect(bridge.url)
            await until_announced(client)
            driver = Driver(client)
            await driver.drive(await driver.lead(), 20)
        await asyncio.to_thread(simulator.stop_cleanly)
