"""The whole, in process: it starts, time passes in it, it stops, and what fails is told."""

from __future__ import annotations

import asyncio
import logging
import socket
import time
from pathlib import Path

import pytest
from websockets.exceptions import ConnectionClosed

import rosbridge_sim
from rosbridge_sim import DocumentError, Simulator
from rosbridge_sim.shell.app import AddressError, WorldFailedError
from rosbridge_sim.shell.settings import Settings
from tests.conftest import Connect
from tests.support import PATIENCE


async def start_of(**options: object) -> str:
    """The one line with which a start is refused."""
    with pytest.raises(DocumentError) as caught:
        await Simulator(port=0, **options).start()
    text = str(caught.value)
    assert "\n" not in text
    return text


# It runs


async def test_client_finds_the_simulator_behind_its_url(connect: Connect) -> None:
    async with Simulator(port=0) as sim:
        client = await connect(sim.url)
        services = (await client.values("/rosapi/services"))["services"]
        assert "/SyncModeWaitForTick" in services
        assert sim.port != 0
        assert sim.url == f"ws://127.0.0.1:{sim.port}"


def test_url_puts_an_address_of_many_colons_in_brackets() -> None:
    assert Simulator(host="::1").url == "ws://[::1]:0"


async def test_time_passes_by_itself(connect: Connect) -> None:
    async with Simulator(port=0) as sim:
        client = await connect(sim.url)
        await client.send("subscribe", topic="/clock")
        stamps = [(await client.message("/clock"))["clock"] for _ in range(5)]
        frames = [round((stamp["secs"] + stamp["nsecs"] * 1e-9) / 0.02) for stamp in stamps]
        assert frames == list(range(frames[0], frames[0] + 5))


async def test_time_stands_still_until_a_first_master_ticks(connect: Connect) -> None:
    async with Simulator(port=0, start="sync") as sim:
        assert sim.node is not None
        client = await connect(sim.url)
        await client.ask("/SyncModeCmd", user_id="me", start_sync_mode=True, time_step=20)
        assert sim.node.world.frame == 0
        answer = await client.ask("/SyncModeWaitForTick", user_id="me", frame=1)
        assert answer["frame"] == sim.node.world.frame == 1
        await client.ask("/SyncModeCmd", user_id="me", start_sync_mode=False)
        await client.send("subscribe", topic="/clock")
        await client.message("/clock")
        assert sim.node.world.frame > 1


async def test_call_that_nobody_answers_ends_in_time(connect: Connect) -> None:
    async with Simulator(port=0, world=False, service_timeout=0.05) as sim:
        provider, caller = await connect(sim.url), await connect(sim.url)
        await provider.send("advertise_service", service="/silent", type="std_srvs/Trigger")
        await provider.settle()
        answer = await caller.call("/silent")
        assert answer["result"] is False
        assert "Timeout" in answer["values"]


async def test_silent_master_is_lost_in_time(connect: Connect) -> None:
    async with Simulator(port=0, start="sync", sync_lease=0.05) as sim:
        client = await connect(sim.url)
        await client.ask("/SyncModeCmd", user_id="me", start_sync_mode=True, time_step=20)
        await client.send("subscribe", topic="/clock")
        await client.message("/clock")  # real time goes on


async def test_settings_reach_the_parts(connect: Connect) -> None:
    async with Simulator(port=0, profile="field", object_limit=2, start="sync", seed=5) as sim:
        assert sim.node is not None
        assert sim.node.world.seed == 5
        client = await connect(sim.url)
        await client.send("subscribe", topic="/Object_topic")
        await client.ask("/SyncModeCmd", user_id="me", start_sync_mode=True, time_step=20)
        await client.ask("/SyncModeWaitForTick", user_id="me", frame=1)
        objects = await client.message("/Object_topic")
        assert objects["num_of_npcs"] + objects["num_of_pedestrian"] + objects["num_of_obstacle"] == 2


async def test_settings_may_be_given_whole() -> None:
    async with Simulator(Settings(port=0, world=False)) as sim:
        assert sim.node is None


async def test_two_in_one_process_share_nothing(connect: Connect) -> None:
    async with Simulator(port=0, start="sync") as one, Simulator(port=0, start="sync") as two:
        here, there = await connect(one.url), await connect(two.url)
        for client in (here, there):
            await client.send("subscribe", topic="/chat", type="std_msgs/String")
            await client.settle()
        await here.ask("/SyncModeCmd", user_id="me", start_sync_mode=True, time_step=20)
        await here.ask("/SyncModeWaitForTick", user_id="me", frame=1)
        await here.send("publish", topic="/chat", type="std_msgs/String", msg={"data": "x"})
        assert (await here.message("/chat")) == {"data": "x"}
        assert not [frame for frame in await there.settle() if frame["op"] == "publish"]
        assert one.node is not None
        assert two.node is not None
        assert (one.node.world.frame, two.node.world.frame) == (1, 0)
        assert not two.node.sync.master_id


async def test_without_a_world_anybody_may_be_the_simulator(connect: Connect) -> None:
    async with Simulator(port=0, world=False) as sim:
        stand_in, user = await connect(sim.url), await connect(sim.url)
        await stand_in.send("advertise", topic="/Ego_topic", type="morai_msgs/EgoVehicleStatus")
        await stand_in.send("advertise_service", service="/SyncModeCmd", type="morai_msgs/MoraiSyncModeCmdSrv")
        await stand_in.settle()
        await user.subscribe("/Ego_topic")
        await stand_in.send("publish", topic="/Ego_topic", msg={"unique_id": 7})
        message = await user.message("/Ego_topic")
        assert message["unique_id"] == 7
        assert message["header"]["stamp"]["secs"] == pytest.approx(time.time(), abs=PATIENCE)
        stamp = (await user.values("/rosapi/get_time"))["time"]
        assert stamp["secs"] == pytest.approx(time.time(), abs=PATIENCE)


# It stops


async def test_stop_tells_clients_and_frees_the_port(connect: Connect) -> None:
    async with Simulator(port=0) as sim:
        client = await connect(sim.url)
        await client.settle()
        port = sim.port
    with pytest.raises(ConnectionClosed):
        await client.read()
    assert client.socket.close_code == 1001
    async with Simulator(port=port):
        pass


async def test_stop_twice_or_before_the_start_is_no_error() -> None:
    sim = Simulator(port=0)
    await sim.stop()
    await sim.start()
    await sim.stop()
    await sim.stop()


async def test_world_stands_still_after_the_stop() -> None:
    async with Simulator(port=0) as sim:
        pass
    assert sim.node is not None
    frame = sim.node.world.frame
    for _ in range(3):
        await asyncio.sleep(0)
    assert sim.node.world.frame == frame


async def test_world_that_fails_is_told_and_everybody_is_sent_away(
    connect: Connect, caplog: pytest.LogCaptureFixture
) -> None:
    sim = await Simulator(port=0).__aenter__()
    client = await connect(sim.url)
    await client.settle()
    assert sim.num_bugs == 0
    assert sim.node is not None
    sim.node.world = None  # type: ignore[assignment] # as good a bug as any
    async with asyncio.timeout(PATIENCE):
        with pytest.raises(WorldFailedError, match="the world has failed: AttributeError"):
            await sim.wait()
        await client.socket.wait_closed()
    assert client.socket.close_code == 1001
    assert sim.num_bugs == 1
    with pytest.raises(WorldFailedError):  # whoever did not wait hears of it at the end
        await sim.__aexit__(None, None, None)
    records = [record for record in caplog.records if record.levelno == logging.CRITICAL]
    assert len(records) == 1
    assert records[0].exc_info is not None


# It does not start


async def test_taken_port_is_told() -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(AddressError) as caught:
            await Simulator(port=port, world=False).start()
        assert str(caught.value) == (
            f"cannot listen on 127.0.0.1 port {port}: the port is taken, perhaps by a server that still runs;"
            " --port 0 takes a free one"
        )


@pytest.mark.parametrize("host", ["192.0.2.1", "a..b", "x" * 300, "no such host"])
async def test_host_that_is_not_ours_is_told(host: str) -> None:
    text = await start_of(host=host, world=False)
    assert text.startswith(f"cannot listen on {host} port 0: ")


async def test_document_that_cannot_be_used_is_told_before_anybody_connects(tmp_path: Path) -> None:
    (tmp_path / "bad.json").write_text('{"egoVehicle": }')
    assert "bad.json:1:" in await start_of(scenario=str(tmp_path / "bad.json"))
    assert "no scenario 'nothing'; known are " in await start_of(scenario="nothing")
    assert "no map 'nothing'; known are " in await start_of(map="nothing")
    assert "expected a folder with ROS packages" in await start_of(schema_path=str(tmp_path / "nowhere"))
    assert "expected a folder with scenarios" in await start_of(scenario_path=[tmp_path / "nowhere"])


async def test_rate_of_a_topic_that_is_none_is_told() -> None:
    assert "/Ego_topci" in await start_of(rate={"Ego_topci": 10})


def test_option_that_is_none_is_told() -> None:
    with pytest.raises(DocumentError, match=r"no such option: prot \(did you mean port\?\)"):
        Simulator(prot=0)


# The package's face


def test_public_names_are_there_and_no_others() -> None:
    for name in rosbridge_sim.__all__:
        assert getattr(rosbridge_sim, name) is not None
    with pytest.raises(AttributeError, match="has no attribute 'Simulation'"):
        _ = rosbridge_sim.Simulation
