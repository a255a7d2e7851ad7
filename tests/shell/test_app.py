"""The whole server in process: start, time, stop, and reported failures."""

from __future__ import annotations

import asyncio
import json
import logging
import re
import socket
import threading
import time
from pathlib import Path
from typing import Literal, NoReturn, Unpack

import pytest
from websockets.exceptions import ConnectionClosed

import rosbridge_sim
from rosbridge_sim import DocumentError, Simulator
from rosbridge_sim.client import Client, ServiceRefusedError
from rosbridge_sim.errors import SettingError
from rosbridge_sim.graph.participant import Participant
from rosbridge_sim.shell.app import AddressError
from rosbridge_sim.shell.assembly import list_items
from rosbridge_sim.shell.clocks.scheduler import WorldFailedError
from rosbridge_sim.shell.config.loading import check_options
from rosbridge_sim.shell.config.options import SimulatorOptions
from rosbridge_sim.shell.config.settings import Settings
from rosbridge_sim.shell.config.toml_output import format_config
from tests.conftest import Connect
from tests.graph.bus_fixture import Wire
from tests.support import PATIENCE


async def start_of(**options: Unpack[SimulatorOptions]) -> str:
    """The one line with which a start is refused."""
    options.setdefault("port", 0)
    with pytest.raises(DocumentError) as caught:
        await Simulator(**options).start()
    text = str(caught.value)
    assert "\n" not in text
    return text


# It runs


async def test_client_reaches_the_simulator_by_its_url(connect: Connect) -> None:
    async with Simulator(port=0) as sim:
        client = await connect(sim.url)
        services = (await client.values("/rosapi/services"))["services"]
        assert "/SyncModeWaitForTick" in services
        assert sim.port != 0
        assert sim.url == f"ws://127.0.0.1:{sim.port}"


async def test_reason_of_a_refused_start_is_told_from_level_warning_on(connect: Connect) -> None:
    async with Simulator(port=0) as sim:
        client = await connect(sim.url)
        wanted = {"user_id": "me", "start_sync_mode": True, "time_step": 30}
        assert not (await client.ask("/SyncModeCmd", **wanted))["result"]
        assert (
            await client.settle() == []
        )  # the level of a new client is `error`, and the answer says that it is refused
        await client.send("set_level", level="warning")
        assert not (await client.ask("/SyncModeCmd", **wanted))["result"]
        (status,) = await client.settle()
        assert (status["op"], status["level"]) == ("status", "warning")
        assert status["msg"].startswith("/SyncModeCmd: time_step must be a multiple of 20 ms and at most 1000")


def test_url_puts_an_ipv6_address_in_brackets() -> None:
    assert Simulator(host="::1").url == "ws://[::1]:0"


async def test_real_time_advances_by_itself(connect: Connect) -> None:
    async with Simulator(port=0) as sim:
        client = await connect(sim.url)
        await client.send("subscribe", topic="/clock")
        stamps = [(await client.message("/clock"))["clock"] for _ in range(5)]
        frames = [round((stamp["secs"] + stamp["nsecs"] * 1e-9) / 0.02) for stamp in stamps]
        assert frames == list(range(frames[0], frames[0] + 5))


async def test_start_sync_stays_at_frame_0_until_a_tick(connect: Connect) -> None:
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


async def test_unanswered_call_times_out(connect: Connect) -> None:
    async with Simulator(port=0, world=False, service_timeout=0.05) as sim:
        provider, caller = await connect(sim.url), await connect(sim.url)
        await provider.send("advertise_service", service="/silent", type="std_srvs/Trigger")
        await provider.settle()
        answer = await caller.call("/silent")
        assert answer["result"] is False
        assert "Timeout" in answer["values"]


async def test_silent_master_is_lost_after_its_lease(connect: Connect) -> None:
    async with Simulator(port=0, start="sync", sync_lease=0.05) as sim:
        client = await connect(sim.url)
        await client.ask("/SyncModeCmd", user_id="me", start_sync_mode=True, time_step=20)
        await client.send("subscribe", topic="/clock")
        await client.message("/clock")  # real time goes on


async def test_settings_reach_the_components(connect: Connect) -> None:
    async with Simulator(port=0, profile="field", object_limit=2, start="sync", seed=5) as sim:
        assert sim.node is not None
        assert sim.node.world.seed == 5
        client = await connect(sim.url)
        await client.send("subscribe", topic="/Object_topic")
        await client.ask("/SyncModeCmd", user_id="me", start_sync_mode=True, time_step=20)
        await client.ask("/SyncModeWaitForTick", user_id="me", frame=1)
        objects = await client.message("/Object_topic")
        assert objects["num_of_npcs"] + objects["num_of_pedestrian"] + objects["num_of_obstacle"] == 2


async def test_user_catalogue_holds_for_scenarios_and_clients(connect: Connect, tmp_path: Path) -> None:
    models = tmp_path / "models.csv"
    models.write_text(
        "DataID,name,class,length,width,height\n,Fridge,obstacle,0.7,0.6,1.8\n20200003,Tank,vehicle,8,3,3\n"
    )
    place = {"initPositionMode": "Absolute", "pos": {"x": 40, "y": 0}}
    scene = tmp_path / "scene.json"
    scene.write_text(json.dumps({"egoVehicle": {"DataID": 20200003, "initPosition": place}}))
    async with Simulator(port=0, start="sync", scenario=str(scene), catalogue=str(models)) as sim:
        client = await connect(sim.url)
        spec = await client.ask("/Service_MoraiVehicleSpec", unique_id=0)
        assert spec["size"] == {"x": 8.0, "y": 3.0, "z": 3.0}
        await client.send("subscribe", topic="/Object_topic")
        frame = (await client.ask("/SyncModeCmd", user_id="me", start_sync_mode=True, time_step=20))["frame"]
        await client.send("advertise", topic="/SyncModeAddObj", type="morai_msgs/SyncModeAddObj")
        added = {"frame": frame + 1, "name": "fridge", "position": {"x": 60.0, "y": 0.0, "z": 0.0}}
        await client.send("publish", topic="/SyncModeAddObj", msg=added)
        await client.ask("/SyncModeWaitForTick", user_id="me", frame=frame + 1)
        (fridge,) = (await client.message("/Object_topic"))["obstacle_list"]
        assert (fridge["name"], fridge["size"]["z"]) == ("Fridge", 1.8)


async def test_settings_may_be_given_as_one_object() -> None:
    async with Simulator(Settings(port=0, world=False)) as sim:
        assert sim.node is None


async def test_two_simulators_in_one_process_share_nothing(connect: Connect) -> None:
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


async def test_gateway_relays_transforms(connect: Connect) -> None:
    async with Simulator(port=0, world=False) as sim:
        robot, page = await connect(sim.url), await connect(sim.url)
        await page.subscribe("/tf2_web_republisher/status")
        assert (await page.message("/tf2_web_republisher/status"))["status_list"] == []  # by the clock alone
        request = {"source_frames": ["base_link"], "target_frame": "map", "rate": 20.0}
        name = (await page.values("/republish_tfs", request))["topic_name"]
        await page.subscribe(name)
        await robot.send("advertise", topic="/tf", type="tf2_msgs/TFMessage")
        for x in range(5):
            shift = {"translation": {"x": x}, "rotation": {"w": 1}}
            transform = {"header": {"frame_id": "/map"}, "child_frame_id": "/base_link", "transform": shift}
            await robot.send("publish", topic="/tf", msg={"transforms": [transform]})
        is_last = lambda msg: msg["transforms"][0]["transform"]["translation"]["x"] == 4  # noqa: E731 - one line
        await page.message_where(name, is_last)
        await robot.send("publish", topic="/tf", id="bad", msg={"transforms": [{**transform, "transform": {}}]})
        assert "is not an orientation" in (await robot.take("status", id="bad"))["msg"]


async def test_client_may_be_the_simulator_without_a_world(connect: Connect) -> None:
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


async def test_stop_twice_or_before_the_start_is_harmless() -> None:
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


async def test_failed_world_is_logged_and_disconnects_all_clients(
    connect: Connect, caplog: pytest.LogCaptureFixture
) -> None:
    sim = await Simulator(port=0).__aenter__()
    client = await connect(sim.url)
    await client.settle()
    assert sim.num_bugs == 0
    assert sim.node is not None
    sim.node.context.hooks.place.append(lambda: 1 // 0)  # as good a bug as any
    async with asyncio.timeout(PATIENCE):
        with pytest.raises(WorldFailedError, match="the world has failed: ZeroDivisionError"):
            await sim.wait()
        await client.socket.wait_closed()
    assert client.socket.close_code == 1001
    assert sim.num_bugs == 1
    with pytest.raises(WorldFailedError):  # whoever did not wait hears of it at the end
        await sim.__aexit__(None, None, None)
    records = [record for record in caplog.records if record.levelno == logging.CRITICAL]
    assert len(records) == 1
    assert records[0].exc_info is not None


async def test_failed_tick_ends_the_server(connect: Connect) -> None:
    sim = await Simulator(port=0, start="sync").__aenter__()
    client = await connect(sim.url)
    await client.ask("/SyncModeCmd", user_id="me", start_sync_mode=True, time_step=20)
    assert sim.node is not None
    sim.node.context.hooks.place.append(lambda: 1 // 0)  # as good a bug as any
    answer = await client.call("/SyncModeWaitForTick", {"request": {"user_id": "me", "frame": 1}})
    assert (answer["result"], answer["values"][:40]) == (False, "the world has failed: ZeroDivisionError("[:40])
    with pytest.raises(WorldFailedError):
        await sim.__aexit__(None, None, None)


async def test_gateway_goes_on_after_a_failed_world_with_serve(
    connect: Connect, caplog: pytest.LogCaptureFixture
) -> None:
    async with Simulator(port=0, on_world_failure="serve") as sim:
        client, other = await connect(sim.url), await connect(sim.url)
        assert (await get(sim.port, "/healthz"))[0] == 200
        assert sim.node is not None
        await client.send("subscribe", topic="/rosout", type="rosgraph_msgs/Log")
        await client.settle()
        sim.node.context.hooks.place.append(lambda: 1 // 0)  # as good a bug as any
        await client.message_where("/rosout", lambda line: line["level"] == 16)
        status, body = await get(sim.port, "/healthz")
        assert (status, json.loads(body)["reason"][:21]) == (503, "the world has failed:")
        assert "\nrosbridge_sim_world_failed 1.0\n" in (await get(sim.port, "/metrics"))[1]
        answer = await client.call("/Service_MoraiVehicleSpec")
        assert (answer["result"], answer["values"][:21]) == (False, "the world has failed:")
        await client.send("publish", topic="/ctrl_cmd", type="morai_msgs/CtrlCmd", msg={}, id="pedal")
        assert (await client.take("status", id="pedal"))["msg"].startswith("the world has failed: ")
        await other.send("subscribe", topic="/chat", type="std_msgs/String")
        await other.settle()
        await client.send("publish", topic="/chat", type="std_msgs/String", msg={"data": "hello"})
        assert (await other.message("/chat"))["data"] == "hello"
        assert "/chat" in (await other.values("/rosapi/topics"))["topics"]
        await other.send("advertise_service", service="/silent", type="std_srvs/Trigger")
        await other.settle()
        slow = await client.call("/silent", timeout=0.05)  # the bus's own clock goes on
        assert "Timeout" in slow["values"]
        assert sim.num_bugs == 1
    assert [record.exc_info is not None for record in caplog.records if record.levelno == logging.CRITICAL] == [True]


def break_down(*_: object) -> NoReturn:
    raise ZeroDivisionError


class InProcessListener(Participant):
    """A listener in the same process, of the program that runs the simulator, which cannot end alone."""

    name = "/stranger"

    def notify(self, level: str, text: str) -> None:
        """It does not listen."""


async def test_failing_subscribers_do_not_end_the_world(connect: Connect, caplog: pytest.LogCaptureFixture) -> None:
    async with Simulator(port=0) as sim:
        bad, good = await connect(sim.url), await connect(sim.url)
        for client in (bad, good):
            await client.subscribe("/Ego_topic")
        assert sim.bus is not None
        assert sim._server is not None
        assert sim._scheduler is not None
        served = next(iter(sim._server.clients))
        served.peer.topics._subscriptions["/Ego_topic"].feed._head = 5  # type: ignore[assignment] # as good a bug as any
        async with asyncio.timeout(PATIENCE):
            await bad.socket.wait_closed()
        assert bad.socket.close_code == 1011
        assert sim.num_bugs == 1
        sim.bus.subscribe(InProcessListener(), "/Ego_topic", break_down)
        async with asyncio.timeout(PATIENCE):
            while sim.num_bugs == 1:  # on a busy machine, older messages come first
                await good.message("/Ego_topic")
        for _ in range(10):
            await good.message("/Ego_topic")
        assert not sim._scheduler.is_failed
    lines = [record.getMessage() for record in caplog.records if record.exc_info]
    assert [line for line in lines if line.endswith(": closed because of an internal error")] == lines[:1]
    assert {line[:35] for line in lines[1:]} == {"a listener of /Ego_topic has failed"}


async def test_master_that_fails_during_its_tick_is_replaced_by_another(connect: Connect) -> None:
    async with Simulator(port=0, start="sync") as sim:
        bad, good = await connect(sim.url), await connect(sim.url)
        for client in (bad, good):
            await client.subscribe("/Ego_topic")
        await bad.ask("/SyncModeCmd", user_id="bad", start_sync_mode=True, time_step=60)
        assert sim._server is not None
        served = next(iter(sim._server.clients))
        served.peer.topics._subscriptions["/Ego_topic"].feed._head = 5  # type: ignore[assignment] # as above
        await bad.send("call_service", service="/SyncModeWaitForTick", args={"request": {"user_id": "bad", "frame": 3}})
        async with asyncio.timeout(PATIENCE):
            await bad.socket.wait_closed()
        assert bad.socket.close_code == 1011
        stamps = [(await good.message("/Ego_topic"))["header"]["stamp"]["nsecs"] for _ in range(3)]
        assert stamps == [20_000_000, 40_000_000, 60_000_000]
        answer = await good.ask("/SyncModeCmd", user_id="good", start_sync_mode=True, time_step=20)
        assert answer["result"] is True
        assert (await good.ask("/SyncModeWaitForTick", user_id="good", frame=0))["tick_status"] is True
        assert sim.num_bugs == 1


async def test_data_folder_that_is_of_no_use_is_told_at_the_start(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    (tmp_path / "file").touch()
    async with Simulator(port=0, data_dir=tmp_path / "file"):
        pass
    async with Simulator(port=0, data_dir=tmp_path / "new"), Simulator(port=0, world=False, data_dir=tmp_path / "file"):
        pass
    why = f"clients can save nothing there: {tmp_path / 'file'} is not a folder"
    lines = [record.getMessage() for record in caplog.records if "--data-dir" in record.getMessage()]
    assert lines == [f"--data-dir {tmp_path / 'file'}: {why}"]


async def test_health_tells_frame_and_mode(connect: Connect) -> None:
    async with Simulator(port=0, start="sync") as sim, Simulator(port=0, world=False) as gateway:
        client = await connect(sim.url)
        await client.ask("/SyncModeCmd", user_id="me", start_sync_mode=True, time_step=60)
        await client.ask("/SyncModeWaitForTick", user_id="me", frame=1)
        health = json.loads((await get(sim.port, "/healthz"))[1])
        assert health == {
            "status": "ok",
            "version": rosbridge_sim.__version__,
            "frame": 3,
            "mode": "synchronous",
            "paused": False,
            "clients": 1,
        }
        await client.ask("/SyncModeCmd", user_id="me", start_sync_mode=False)
        await client.ask("/Service_MoraiEventCmd", option=8, set_pause=True)
        health = json.loads((await get(sim.port, "/healthz"))[1])
        assert (health["mode"], health["paused"]) == ("real_time", True)
        health = json.loads((await get(gateway.port, "/healthz"))[1])
        assert (health["frame"], health["mode"]) == (None, "gateway")


async def get(port: int, path: str) -> tuple[int, str]:
    """The status and the body of a page."""
    async with asyncio.timeout(PATIENCE):
        reader, writer = await asyncio.open_connection("127.0.0.1", port)
        writer.write(f"GET {path} HTTP/1.1\r\nHost: localhost\r\n\r\n".encode())
        answer = (await reader.read()).decode()
        writer.close()
        await writer.wait_closed()
    return int(answer.split()[1]), answer.partition("\r\n\r\n")[2]


# It does not start


async def test_port_in_use_is_an_error() -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(AddressError) as caught:
            await Simulator(port=port, world=False).start()
        assert str(caught.value) == (
            f"cannot listen on 127.0.0.1 port {port}: the port is in use, perhaps by a server that still runs;"
            " --port 0 takes a free one"
        )


@pytest.mark.parametrize("host", ["192.0.2.1", "a..b", "x" * 300, "no such host"])
async def test_foreign_host_address_is_an_error(host: str) -> None:
    text = await start_of(host=host, world=False)
    assert text.startswith(f"cannot listen on {host} port 0: ")


async def test_unusable_document_is_an_error_at_the_start(tmp_path: Path) -> None:
    (tmp_path / "bad.json").write_text('{"egoVehicle": }')
    assert "bad.json:1:" in await start_of(scenario=str(tmp_path / "bad.json"))
    assert "no scenario 'nothing'; known are " in await start_of(scenario="nothing")
    assert "no map 'nothing'; known are " in await start_of(map="nothing")
    assert "expected a folder with ROS packages" in await start_of(schema_path=str(tmp_path / "nowhere"))
    assert "expected a folder with scenarios" in await start_of(scenario_path=[tmp_path / "nowhere"])


async def test_rate_of_an_unknown_topic_is_an_error() -> None:
    assert await start_of(rate={"Ego_topci": 10}) == (
        "rate /Ego_topci=10: the simulator has no such publisher (did you mean /Ego_topic?)"
    )


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (
            '[publishers]\n"/Ego_topci" = {}',
            ':2: publishers."/Ego_topci": the simulator has no such publisher (did you',
        ),
        (
            '[services]\n"/ctrl_cmd" = {}',
            ':2: services."/ctrl_cmd": the simulator has no such service; /ctrl_cmd is a s',
        ),
        (
            '[services."/SyncModeCmd"]\nname = "/rosapi/topics"',
            ':1: services."/SyncModeCmd": service /rosapi/topics is',
        ),
        ('[publishers]\n"/clock".name = "/rosout"', ':2: publishers."/clock": expected another name than /rosout'),
        ('[publishers]\n"/clock".name = "/tf"', ':2: publishers."/clock": expected different names for /clock'),
    ],
)
async def test_invalid_network_settings_are_reported_with_their_line(tmp_path: Path, text: str, said: str) -> None:
    file = tmp_path / "s.toml"
    file.write_text(text + "\n")
    assert (await start_of(config=str(file))).startswith(f"{file}{said}")


@pytest.mark.parametrize("release", ["22.R2", "26.R1"])
async def test_printed_config_lists_all_interfaces_and_reads_back(
    release: Literal["22.R2", "26.R1"], tmp_path: Path
) -> None:
    settings = check_options({"release": release, "port": 0, "seed": 5})
    text = format_config(settings, list_items(settings))
    file = tmp_path / "s.toml"
    file.write_text(text)
    async with Simulator(port=0, release=release) as plain, Simulator(config=str(file)) as printed:
        assert plain.node is not None
        assert printed.node is not None
        assert list(printed.node.interfaces.listing()) == list(plain.node.interfaces.listing())
        listed = set(re.findall(r'^"([^"]+)" = \{ name = "\1", (?:rate = [\d.]+, )?on = true \}$', text, re.MULTILINE))
        for sim in (plain, printed):
            assert sim.bus is not None
            assert sim.node is not None
            owner = sim.node.participant
            own = {name for name, service in sim.bus.services.items() if service.owner is owner}
            for topic in sim.bus.topics.values():
                if owner in topic.publishers or any(s.owner is owner for s in topic.subscriptions):
                    own.add(topic.name)
            assert listed == own


# In a thread of its own


def test_blocking_form_serves_and_leaves_no_thread() -> None:
    before = {*threading.enumerate()}
    with Simulator(port=0, start="sync") as sim, Client(sim.url) as client:
        client.start_sync()
        assert client.tick(3).frame == sim.run_inside(lambda: sim.node.world.frame if sim.node else -1) == 3
    assert not {*threading.enumerate()} - before
    assert (sim.num_bugs, sim.port) == (0, int(sim.url.rpartition(":")[2]))


async def test_blocking_form_runs_within_somebody_elses_event_loop(connect: Connect) -> None:
    with Simulator(port=0) as sim:
        client = await connect(sim.url)
        assert (await client.values("/rosapi/services"))["services"]


def test_blocking_close_is_for_any_time() -> None:
    sim = Simulator(port=0, world=False)
    sim.close()
    sim.open()
    with pytest.raises(RuntimeError, match="expected a simulator that was never started"):
        sim.open()
    sim.close()
    sim.close()
    with pytest.raises(RuntimeError, match="has been stopped"):
        sim.run_inside(lambda: None)


def test_blocking_start_that_fails_leaves_no_thread_and_can_be_tried_again() -> None:
    before = {*threading.enumerate()}
    with socket.create_server(("127.0.0.1", 0)) as taken:
        sim = Simulator(port=taken.getsockname()[1], world=False)
        with pytest.raises(AddressError, match="the port is in use"):
            sim.open()
        assert not {*threading.enumerate()} - before
    with sim:
        assert sim.port


async def test_what_belongs_to_a_thread_is_refused_without_one() -> None:
    async with Simulator(port=0, world=False) as sim:
        with pytest.raises(RuntimeError, match=r"runs in a thread of its own; use `with` or open\(\)"):
            sim.run_inside(lambda: None)
        with pytest.raises(RuntimeError, match="never started"):
            sim.open()


def _fail() -> None:
    raise ZeroDivisionError


def test_blocking_form_tells_that_the_world_has_failed() -> None:
    sim = Simulator(port=0, start="sync").open()
    assert sim.node is not None
    placing = sim.node.context.hooks.place
    with Client(sim.url) as client:
        client.start_sync()
        sim.run_inside(lambda: placing.append(_fail))
        with pytest.raises(ServiceRefusedError, match="the world has failed"):
            client.tick()
    with pytest.raises(WorldFailedError):
        sim.__exit__(None, None, None)
    sim.__exit__(KeyError, KeyError(), None)  # an error that is on its way is not replaced


def test_repr_tells_place_world_and_state_and_no_secret() -> None:
    sim = Simulator(port=0, seed=7, token="sesame")  # noqa: S106 - opens nothing
    assert repr(sim) == "<Simulator 127.0.0.1 port 0 scenario='demo' seed=7 not started>"
    with sim:
        assert repr(sim) == f"<Simulator {sim.url} scenario='demo' seed=7 running>"
    assert repr(sim) == f"<Simulator {sim.url} scenario='demo' seed=7 stopped>"
    assert "without a world" in repr(Simulator(world=False))


def test_settings_and_options_together_are_a_mistake() -> None:
    with pytest.raises(SettingError, match="expected settings or options; got both, with port, seed"):
        Simulator(Settings(), port=0, seed=1)


def test_unknown_option_is_an_error() -> None:
    with pytest.raises(DocumentError, match=r"no such option: prot \(did you mean port\?\)"):
        Simulator(prot=0)  # type: ignore[call-arg]


# The package's face


def test_public_names_are_exactly_the_documented_ones() -> None:
    for name in rosbridge_sim.__all__:
        assert getattr(rosbridge_sim, name) is not None
    with pytest.raises(AttributeError, match="has no attribute 'Simulation'"):
        _ = rosbridge_sim.Simulation


# Names


@pytest.mark.parametrize("is_reset", [False, True])
async def test_client_cannot_take_names_of_the_server(*, is_reset: bool) -> None:
    shared = {"/tf", "/tf_static", "/ReplayInfo_topic", "/rosout"}
    async with Simulator(port=0, start="sync") as sim:
        assert sim.bus is not None
        client = Wire(sim.bus)
        if is_reset:
            assert client.calls("/sim/reset", seed=-1)["result"] is True
        outputs = {name: topic.type.name for name, topic in sim.bus.topics.items() if topic.publishers}
        services = list(sim.bus.services)
        assert {"/rosapi/set_param", "/rosapi/topics", "/republish_tfs", "/SyncModeCmd"} < set(services)
        ops = [
            *({"op": "advertise", "topic": name, "type": outputs[name]} for name in outputs),
            *({"op": "advertise_service", "service": name, "type": "std_srvs/Trigger"} for name in services),
            *({"op": "advertise_action", "action": name, "type": "my_msgs/Dig"} for name in sim.bus.actions.by_name),
        ]
        assert {op["topic"] for op in ops if client.says(**op) == []} == shared


# Patterns


async def test_patterns_hold_for_all_aliases_and_the_start_log_names_open_routes(
    connect: Connect, caplog: pytest.LogCaptureFixture
) -> None:
    settings: SimulatorOptions = {
        "deny_publish": ["/ctrl_cmd"],
        "deny_subscribe": ["/tf", "/client_count"],
        "start": "sync",
        "port": 0,
    }
    async with Simulator(**settings) as sim:
        client = await connect(sim.url)
        for topic in ("/ctrl_cmd", "/ctrl_cmd_0", "/Ego-2/ctrl_cmd"):
            await client.send("advertise", topic=topic, type="morai_msgs/CtrlCmd")
        frames = await client.settle()
        assert [frame["msg"].partition(",")[0] for frame in frames] == [
            f"Not allowed to publish to {topic}" for topic in ("/ctrl_cmd", "/ctrl_cmd_0", "/Ego-2/ctrl_cmd")
        ]
        answer = await client.call("/republish_tfs", {"source_frames": ["base_link"], "target_frame": "map"})
        assert answer["values"] == "Not allowed to call /republish_tfs, since it shows what /tf does"
    lines = [record.getMessage() for record in caplog.records if "leaves these ways open" in record.getMessage()]
    assert [line.partition(" leaves")[0] for line in lines] == [
        "--deny-publish /ctrl_cmd",
        "--deny-subscribe /tf",
        "--deny-subscribe /client_count",
    ]
    others = "/connected_clients, /sim/clients, /rosout, /sim/refusals, /sim/topics, /sim/drivers"
    assert lines[2].endswith(f"who is connected: listening to {others}")


async def test_log_says_that_patterns_do_not_hold_behind_a_bridge(caplog: pytest.LogCaptureFixture) -> None:
    with socket.create_server(("127.0.0.1", 0)) as nobody:
        bridge = f"ws://127.0.0.1:{nobody.getsockname()[1]}"
        async with Simulator(port=0, attach=[bridge], deny_publish=["/nothing"]):
            pass
    assert (
        len(
            [
                line
                for line in caplog.messages
                if line.startswith("--allow and --deny patterns apply only to clients of this server")
            ]
        )
        == 1
    )


async def test_names_of_a_scenario_are_checked_at_once(tmp_path: Path, connect: Connect) -> None:
    (tmp_path / "Network").mkdir()
    (tmp_path / "Network" / "demo.toml").write_text('[subscribers]\n"/ctrl_cmd" = { name = "/drive" }\n')
    async with Simulator(port=0, start="sync", data_dir=tmp_path, deny_publish=["/ctrl_cmd"]) as sim:
        thief, user = await connect(sim.url), await connect(sim.url)
        await thief.send("advertise", topic="/drive", type="morai_msgs/CtrlCmd")
        assert await thief.settle() == []
        await user.ask("/Service_MoraiSL", file_name="demo", load_network_connection_data=True)
        (status,) = await thief.settle()
        assert status["msg"].startswith("Not allowed to publish to /drive, another way of publishing /ctrl_cmd")
