"""The simulator behind a bridge, over real sockets: connected, lost, reconnected, slow, and never itself."""

from __future__ import annotations

import asyncio
import gc
import json
import logging
import time
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from itertools import pairwise
from pathlib import Path
from typing import Any, Literal, NoReturn, Unpack

import pytest
from websockets.asyncio.server import ServerConnection, serve

from rosbridge_sim import DocumentError, Simulator, serving
from rosbridge_sim.graph.attach import announcing, rosapi_watch, survey
from rosbridge_sim.records import replace
from rosbridge_sim.shell import attach
from rosbridge_sim.shell.app import AddressError
from rosbridge_sim.shell.attach import is_own_address
from rosbridge_sim.shell.config.options import SimulatorOptions
from rosbridge_sim.simulator.morai_services.loads import Loads
from tests.conftest import Connect
from tests.far_side import graph as far_graph
from tests.far_side.server import FarSide
from tests.simulator.sim_harness import ManualReader, put_egos
from tests.support import PATIENCE, Client, held_port

TOKEN = "sesame"  # noqa: S105 - opens nothing

EVERYWHERE = "0.0.0.0"  # noqa: S104 - nobody listens there, or at most for a moment


@asynccontextmanager
async def gateway(**options: Unpack[SimulatorOptions]) -> AsyncIterator[Simulator]:
    """A rosbridge of our own kind, without a world."""
    options.setdefault("port", 0)
    options["world"] = False
    async with Simulator(**options) as sim:
        yield sim


@asynccontextmanager
async def attached(*urls: str, **options: Unpack[SimulatorOptions]) -> AsyncIterator[Simulator]:
    """A simulator that is attached to these bridges, and listens nowhere."""
    options.setdefault("start", "sync")
    options.update({"attach": urls, "listen": False})
    async with Simulator(**options) as sim:
        async with asyncio.timeout(PATIENCE):
            await asyncio.gather(*(asyncio.shield(attachment.attached) for attachment in sim.attachments))
        yield sim


@pytest.fixture
def lines(caplog: pytest.LogCaptureFixture) -> Callable[[], list[str]]:
    """What the log says of bridges."""
    caplog.set_level(logging.INFO, "rosbridge_sim.attach")
    return lambda: [record.getMessage() for record in caplog.records if record.name == "rosbridge_sim.attach"]


async def until(holds: Callable[[], bool]) -> None:
    """Come back once something holds; the loop goes on meanwhile.

    A world in real time needs longer than an answer does: a flood took a minute beside eight busy programs.
    """
    async with asyncio.timeout(5 * PATIENCE):
        while not holds():  # noqa: ASYNC110 - what is waited for tells nobody
            await asyncio.sleep(0.01)


async def provided(client: Client, service: str) -> None:
    """Come back once a bridge has a service."""
    async with asyncio.timeout(PATIENCE):
        while service not in (await client.values("/rosapi/services"))["services"]:  # noqa: ASYNC110 - what is waited for tells nobody
            await asyncio.sleep(0.01)


async def lead(client: Client) -> int:
    frame: int = (await client.ask("/SyncModeCmd", user_id="me", start_sync_mode=True, time_step=20))["frame"]
    return frame


# A client of the bridge


@pytest.mark.slow
async def test_client_of_a_bridge_ticks_the_world_behind_it(connect: Connect) -> None:
    async with gateway() as bridge, attached(bridge.url) as sim:
        client = await connect(bridge.url)
        await client.subscribe("/Ego_topic")
        frame = await lead(client)
        for i in range(1, 4):
            answer = await client.ask("/SyncModeWaitForTick", user_id="me", frame=frame + i)
            assert answer["frame"] == frame + i
            # the state of a tick stands before its answer
            (ego,) = [f for f in client.inbox if f["op"] == "publish"]
            assert ego["msg"] == answer["vehicle_status"]
            client.inbox.clear()
        assert sim.port == 0
        assert sim.num_bugs == bridge.num_bugs == 0


@pytest.mark.slow
async def test_caller_behind_a_bridge_gets_the_failure_of_the_world(connect: Connect) -> None:
    async with gateway() as bridge, attached(bridge.url, start="run", on_world_failure="serve") as sim:
        client = await connect(bridge.url)
        assert sim.node is not None
        sim.node.context.hooks.place.append(lambda: 1 // 0)  # as good a bug as any
        await until(lambda: sim.node is not None and sim.node.context.failure.why is not None)
        for _ in range(2):
            answer = await client.call("/Service_MoraiVehicleSpec")
            assert (answer["result"], answer["values"][:21]) == (False, "the world has failed:")


def break_down(*_: object) -> NoReturn:
    raise ZeroDivisionError


@pytest.mark.slow
@pytest.mark.parametrize("seam", ["delivery", "writing"])
async def test_failed_bridge_is_dialled_again_without_loss_at_another_bridge(
    connect: Connect, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch, seam: str
) -> None:
    async with gateway() as first, gateway() as second, attached(first.url, second.url) as sim:
        clients = [await connect(bridge.url) for bridge in (first, second)]
        for client in clients:
            await client.subscribe("/Ego_topic")
        frame = await lead(clients[1])
        (line,) = sim.attachments[0].mirror.connections.values()
        with monkeypatch.context() as patch:
            if seam == "delivery":
                patch.setattr(line, "offer", break_down)
            else:
                patch.setattr(line, "take", break_down)
            for i in range(1, 4):
                await clients[1].ask("/SyncModeWaitForTick", user_id="me", frame=frame + i)
            assert len([await clients[1].message("/Ego_topic") for _ in range(3)]) == 3
            await until(lambda: not line.is_open)
        await until(lambda: line.is_ready)
        await clients[1].ask("/SyncModeWaitForTick", user_id="me", frame=frame + 4)
        await clients[0].message("/Ego_topic")
        assert sim.bus is not None
        assert sim.num_bugs == sim.bus.guard.num_faults >= 1
        assert sim._scheduler is not None
        assert not sim._scheduler.is_failed
    assert any("internal error; connecting again" in line for line in caplog.messages)


async def test_command_on_a_bridge_drives_the_car(connect: Connect) -> None:
    async with gateway() as bridge, attached(bridge.url, start="run"):
        client = await connect(bridge.url)
        await client.send("advertise", topic="/ctrl_cmd", type="morai_msgs/CtrlCmd")
        await client.send("publish", topic="/ctrl_cmd", msg={"longlCmdType": 1, "accel": 1.0})
        await client.subscribe("/Ego_topic")
        await client.message_where("/Ego_topic", lambda ego: ego["velocity"]["x"] > 0.1)


@pytest.mark.slow
async def test_messages_after_a_load_are_not_read_before_it_ends(connect: Connect) -> None:
    async with gateway() as bridge, attached(bridge.url) as sim:
        assert sim.node is not None
        loads = next(each for each in sim.node.components if isinstance(each, Loads))
        reader = ManualReader()
        loads._context = replace(loads._context, reader=reader)
        (line,) = sim.attachments[0].mirror.connections.values()
        client = await connect(bridge.url)
        await lead(client)
        await client.send("publish", topic="/ScenarioLoad", type="morai_msgs/ScenarioLoad", msg={"file_name": "town"})
        request = {"user_id": "me", "frame": 0}
        for _ in range(2):
            for i in range(64):  # 1 MiB
                args = {"request": {**request, "user_id": "x" * 2**14}}
                await client.send("call_service", service="/SyncModeWaitForTick", id=f"early {i}", args=args)
        await until(lambda: line.is_full)
        assert reader.waiting
        await client.send("call_service", service="/SyncModeWaitForTick", id="last", args={"request": request})
        assert sim.node.world.frame == 0
        reader.hand_over(now=asyncio.get_running_loop().time())
        answer = await client.take("service_response", id="last")
        assert (answer["values"]["response"]["tick_status"], sim.num_bugs) == (True, 0)
        assert not line.waiting


async def test_latched_topics_reach_late_subscribers_at_a_bridge(connect: Connect) -> None:
    async with gateway() as bridge, attached(bridge.url):
        client = await connect(bridge.url)
        await client.send("subscribe", topic="/SyncModeInfo")
        await client.send("subscribe", topic="/tf_static")
        assert (await client.message("/SyncModeInfo"))["status"] is True
        assert (await client.message("/tf_static"))["transforms"]


async def test_viewer_behind_a_bridge_gets_drivers_and_descriptions_of_a_world_that_waits(connect: Connect) -> None:
    async with gateway() as bridge, attached(bridge.url):
        client = await connect(bridge.url)
        await client.send("subscribe", topic="/sim/drivers")
        assert (await client.message("/sim/drivers"))["is_synchronous"]
        assert (await client.values("/sim/describe", {"id": 0}))["behaviour"] == "driven"


async def test_egos_added_at_run_time_appear_at_a_bridge(connect: Connect) -> None:
    async with gateway() as bridge, attached(bridge.url, start="run"):
        client = await connect(bridge.url)
        await client.send("advertise", topic="/ego_setting", type="morai_msgs/MultiEgoSetting")
        zero = [0.0]
        full = {
            "number_of_ego_vehicle": 1,
            "ego_index": [2],
            "global_position_x": [20.0],
            "global_position_y": zero,
            "global_position_z": zero,
            "global_roll": zero,
            "global_pitch": zero,
            "global_yaw": zero,
            "velocity": zero,
            "gear": [4],
            "ctrl_mode": [16],
        }
        await client.send("publish", topic="/ego_setting", msg=full)
        await provided(client, "/Ego-2/SyncModeWaitForTick")
        await client.subscribe("/Ego-2/Ego_topic")
        assert (await client.message("/Ego-2/Ego_topic"))["unique_id"] == 2


@pytest.mark.slow
async def test_silent_master_behind_a_bridge_loses_its_lease(connect: Connect) -> None:
    async with gateway() as bridge, attached(bridge.url, sync_lease=0.3, sync_on_loss="wait"):
        master, other = await connect(bridge.url), await connect(bridge.url)
        await other.subscribe("/SyncModeInfo")
        await lead(master)
        await master.close()  # which nobody behind the bridge can see
        await other.message_where("/SyncModeInfo", lambda info: info["master_id"] == "me")
        await other.message_where("/SyncModeInfo", lambda info: info["master_id"] == "")
        assert await lead(other) == 0


async def test_direct_clients_and_clients_of_a_bridge_work_together(connect: Connect) -> None:
    async with gateway() as bridge, Simulator(port=0, attach=[bridge.url], start="sync") as sim:
        await asyncio.wait_for(sim.attachments[0].attached, PATIENCE)
        far, near = await connect(bridge.url), await connect(sim.url)
        await near.subscribe("/Ego_topic")
        frame = await lead(far)
        await far.ask("/SyncModeWaitForTick", user_id="me", frame=frame + 1)
        await near.message("/Ego_topic")
        answer = await near.ask("/SyncModeWaitForTick", user_id="me", frame=frame + 2)
        assert answer["frame"] == frame + 2


async def test_refusals_behind_a_bridge_are_on_the_refusals_topic(connect: Connect) -> None:
    async with gateway() as bridge, Simulator(port=0, attach=[bridge.url], start="sync") as sim:
        await asyncio.wait_for(sim.attachments[0].attached, PATIENCE)
        far, near = await connect(bridge.url), await connect(sim.url)
        await near.ask("/SyncModeCmd", user_id="me", start_sync_mode=True, time_step=20)
        await far.ask("/SyncModeWaitForTick", user_id="you", frame=1)
        await far.send("publish", topic="/SyncModeAddObj", msg={"name": "Boxx"})
        await near.send("subscribe", topic="/sim/refusals")  # `subscribe` would lose what comes at once
        message = await near.message_where("/sim/refusals", lambda message: len(message["refusals"]) == 2)
    assert [(each["client"], each["reason"], each["subject"]) for each in message["refusals"]] == [
        (bridge.url, "not_master", "/SyncModeWaitForTick"),
        (bridge.url, "wrong_value", "/SyncModeAddObj"),
    ]


async def test_each_of_two_bridges_gets_all_topics(connect: Connect) -> None:
    async with gateway() as one, gateway() as other, attached(one.url, other.url):
        clients = [await connect(one.url), await connect(other.url)]
        for client in clients:
            await client.subscribe("/Ego_topic")
        frame = await lead(clients[0])
        await clients[0].ask("/SyncModeWaitForTick", user_id="me", frame=frame + 1)
        first, second = [await client.message("/Ego_topic") for client in clients]
        assert first == second


@pytest.mark.slow
async def test_one_socket_per_topic_carries_the_same(connect: Connect) -> None:
    async with gateway() as bridge, attached(bridge.url, attach_sockets="per-topic"):
        client = await connect(bridge.url)
        num_clients = (await asyncio.wait_for(_clients(client), PATIENCE))["data"]
        assert num_clients > 30
        await client.subscribe("/Ego_topic")
        frame = await lead(client)
        await client.ask("/SyncModeWaitForTick", user_id="me", frame=frame + 1)
        await client.message("/Ego_topic")


async def _clients(client: Client) -> dict[str, Any]:
    await client.send("subscribe", topic="/client_count")
    return await client.message("/client_count")


@pytest.mark.slow
async def test_loss_of_many_sockets_is_one_log_line(lines: Callable[[], list[str]]) -> None:
    async with FarSide() as far_side, attached(far_side.url, attach_sockets="per-topic", start="run") as sim:
        await far_side.kill()
        await far_side.listen()
        await until(lambda: sum("attached: " in line for line in lines()) == 2)
        assert sum("lost" in line for line in lines()) == 1
        assert sim.num_bugs == 0


@pytest.mark.slow
async def test_loss_of_one_of_many_sockets_is_one_log_line(lines: Callable[[], list[str]]) -> None:
    async with gateway() as bridge, attached(bridge.url, attach_sockets="per-topic") as sim:
        (attachment,) = sim.attachments
        (carrier,) = [one for line, one in attachment._carriers.items() if line.name == "topic /Ego_topic"]
        assert carrier._socket is not None
        carrier._socket.transport.abort()
        await until(lambda: any("the socket of topic /Ego_topic was lost and made again" in line for line in lines()))


@pytest.mark.slow
async def test_bridge_with_a_socket_limit_gives_few_log_lines(lines: Callable[[], list[str]]) -> None:
    async with (
        gateway(max_clients=5) as bridge,
        Simulator(attach=bridge.url, attach_sockets="per-topic", listen=False, attach_retry=0.5),
    ):
        await until(lambda: any("accepts no more clients now" in line for line in lines()))
        assert len(lines()) < 20


async def test_ros_version_of_attach_is_that_of_serve(connect: Connect) -> None:
    async with gateway(ros=2) as bridge, attached(bridge.url, ros=2):
        client = await connect(bridge.url)
        assert (await client.values("/rosapi/topic_type", {"topic": "/Ego_topic"}))["type"].count("/msg/") == 1
        await client.subscribe("/clock")
        frame = await lead(client)
        await client.ask("/SyncModeWaitForTick", user_id="me", frame=frame + 1)
        assert set((await client.message("/clock"))["clock"]) == {"sec", "nanosec"}


@pytest.mark.slow
@pytest.mark.parametrize("sockets", ["one", "per-topic"])
async def test_scene_is_announced_at_a_bridge_on_request_alone(
    connect: Connect, sockets: Literal["one", "per-topic"]
) -> None:
    names = {"/sim/scene/map", "/sim/scene/objects"}
    async with gateway() as bridge, attached(bridge.url, start="run"):
        client = await connect(bridge.url)
        assert not names & set((await client.values("/rosapi/topics"))["topics"])
    async with gateway() as bridge, attached(bridge.url, start="run", scene=True, attach_sockets=sockets) as sim:
        client = await connect(bridge.url)
        assert names <= set((await client.values("/rosapi/topics"))["topics"])
        for topic, ns in (("/sim/scene/map", "lanes"), ("/sim/scene/objects", "egos")):
            await client.send("subscribe", topic=topic)
            message = await client.message(topic)
            assert ns in {marker["ns"] for marker in message["markers"]}
        assert sim.num_bugs == bridge.num_bugs == 0


async def test_renamed_scene_stays_at_home_too(connect: Connect) -> None:
    publishers = {"/sim/scene/map": {"name": "/view/map"}}
    async with gateway() as bridge, attached(bridge.url, start="run", publishers=publishers):
        client = await connect(bridge.url)
        assert "/view/map" not in (await client.values("/rosapi/topics"))["topics"]


async def test_scene_without_a_bridge_is_a_mistake() -> None:
    with pytest.raises(DocumentError, match="scene: expected with --attach"):
        await Simulator(port=0, scene=True).start()


@pytest.mark.parametrize("proxy", ["http://127.0.0.1:1", "socks5://127.0.0.1:1"])
async def test_proxy_variables_of_the_environment_are_ignored(proxy: str, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("http_proxy", "https_proxy", "all_proxy"):
        monkeypatch.setenv(name, proxy)
    monkeypatch.delenv("no_proxy", raising=False)
    async with gateway() as bridge, attached(bridge.url):
        pass


# A bridge that goes and comes


@pytest.mark.slow
async def test_client_goes_on_after_a_bridge_restart(connect: Connect, lines: Callable[[], list[str]]) -> None:
    async with attached_later() as (sim, port):
        await until(lambda: any("nothing listens there" in line for line in lines()))
        async with gateway(port=port) as bridge:
            await asyncio.wait_for(sim.attachments[0].attached, PATIENCE)
            frame = await lead(client := await connect(bridge.url))
            await client.ask("/SyncModeWaitForTick", user_id="me", frame=frame + 1)
        await until(lambda: any("closed the connection" in line for line in lines()))
        async with gateway(port=port) as bridge:
            client = await connect(bridge.url)
            await provided(client, "/SyncModeWaitForTick")
            answer = await client.ask("/SyncModeWaitForTick", user_id="me", frame=frame + 2)
            # whoever led the world still does: no client has left, as far as can be known
            assert (answer["tick_status"], answer["frame"]) == (True, frame + 2)
        await until(lambda: sum("closed the connection" in line for line in lines()) == 2)
    said = [line.partition(": ")[2] for line in lines()]
    assert said[0] == "dialling"
    assert sum("nothing listens there" in line for line in said) >= 1
    assert sum(line.startswith("attached: ") for line in said) == 2
    assert sum("the server has closed the connection (1001)" in line for line in said) == 2


@asynccontextmanager
async def attached_later() -> AsyncIterator[tuple[Simulator, int]]:
    """A simulator that dials a port where nobody listens yet."""
    with held_port() as port:
        async with Simulator(attach=f"127.0.0.1:{port}", listen=False, start="sync", attach_retry=0.5) as sim:
            yield sim, port


async def test_leaving_unadvertises_at_the_bridge(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(attach, "LAST_WORD", PATIENCE)  # a busy bridge may need more than the user's patience
    async with FarSide() as far_side:
        async with attached(far_side.url):
            assert "/SyncModeCmd" in far_side.graph.services
        assert not [name for name in far_side.graph.services if "Sync" in name]
        assert not [line for line in far_side.log if "Unknown operation" in line or "exception" in line.lower()]


async def test_stop_waits_for_the_bridges_answer_and_not_for_a_time_out(monkeypatch: pytest.MonkeyPatch) -> None:
    """Else every stop takes half a second longer than the bridge does."""
    monkeypatch.setattr(attach, "LAST_WORD", 2.0 * PATIENCE)
    async with FarSide() as far_side, attached(far_side.url) as sim:
        async with asyncio.timeout(PATIENCE):
            await sim.attachments[0].stop()


@pytest.mark.slow
async def test_back_off_grows_to_the_chosen_maximum(lines: Callable[[], list[str]]) -> None:
    """A bridge that comes back after an hour is found within `--attach-retry`, not within another hour."""

    async def leave(connection: ServerConnection) -> None:
        await connection.close()

    async with serve(leave, "127.0.0.1", 0) as server:
        url = f"ws://127.0.0.1:{server.sockets[0].getsockname()[1]}"
        async with Simulator(attach=url, listen=False, attach_retry=0.75):
            await until(lambda: sum("next try" in line for line in lines()) > 3)
    waits = [line.rpartition(" in ")[2] for line in lines() if "next try" in line]
    assert waits[:4] == ["0.5 s", "0.75 s", "0.75 s", "0.75 s"]


@pytest.mark.slow
async def test_bridge_that_soon_disconnects_is_dialled_with_back_off(lines: Callable[[], list[str]]) -> None:
    async def answer_and_leave(connection: ServerConnection) -> None:
        async for text in connection:
            op = json.loads(text)
            if op["op"] == "call_service":
                answer = {"op": "service_response", "service": "", "id": op["id"], "values": {}, "result": True}
                await connection.send(json.dumps(answer))
                if op["service"] == "/rosapi/get_time":  # everything is announced
                    return

    async with serve(answer_and_leave, "127.0.0.1", 0) as server:
        url = f"ws://127.0.0.1:{server.sockets[0].getsockname()[1]}"
        async with attached(url):
            await until(lambda: any("next try in 2 s" in line for line in lines()))


# A far side that is not ours


@pytest.mark.slow
async def test_stalled_bridge_is_not_flooded() -> None:
    async with FarSide() as far_side, attached(far_side.url, start="run") as sim:
        assert sim.node is not None
        far_side.may_work.clear()
        line = sim.attachments[0].mirror.connections[""]
        await until(lambda: not line.flow_control.has_room)
        num_waiting = far_side.most_waiting
        frame = sim.node.world.frame
        await until(lambda: sim.node is not None and sim.node.world.frame > frame + 10)
        assert far_side.most_waiting <= num_waiting + 100  # what was on its way
        far_side.may_work.set()
        await until(lambda: line.flow_control.has_room)


@pytest.mark.slow
async def test_few_messages_wait_at_a_slow_bridge() -> None:
    async with FarSide(work=0.01) as far_side, attached(far_side.url, start="run") as sim:
        line = sim.attachments[0].mirror.connections[""]
        await until(lambda: line.fresh.is_behind)
        before = far_side.num_handled
        await until(lambda: far_side.num_handled > before + 60)
        far_side.most_waiting = 0
        await until(lambda: far_side.num_handled > before + 120)
        assert far_side.most_waiting <= 40  # 0.1 s of work are ten, and the window was 170 messages
        assert line.num_dropped


@pytest.mark.slow
async def test_answer_behind_many_topics_reaches_a_silent_bridge() -> None:
    """It answers at the beginning, and then nothing: what it is sent is little by little, but comes."""
    frames: asyncio.Queue[dict[str, Any]] = asyncio.Queue()
    connections: list[ServerConnection] = []

    async def fall_silent(connection: ServerConnection) -> None:
        connections.append(connection)
        async for text in connection:
            op = json.loads(text)
            if op["op"] == "call_service" and op["id"].startswith("ask:"):
                answer = {"op": "service_response", "service": "", "id": op["id"], "values": {}, "result": True}
                await connection.send(json.dumps(answer))
            frames.put_nowait(op)

    async with serve(fall_silent, "127.0.0.1", 0) as server:
        url = f"ws://127.0.0.1:{server.sockets[0].getsockname()[1]}"
        async with attached(url) as sim:
            for mark, service, request in (
                ("start", "/SyncModeCmd", {"user_id": "me", "start_sync_mode": True, "time_step": 500}),
                ("tick", "/SyncModeWaitForTick", {"user_id": "me", "frame": 1}),
            ):
                call = {"op": "call_service", "id": mark, "service": service, "args": {"request": request}}
                await connections[0].send(json.dumps(call))
                async with asyncio.timeout(PATIENCE):
                    while (answer := await frames.get()).get("id") != mark:
                        pass
            assert answer["values"]["response"]["frame"] == 25
            assert sim.attachments[0].mirror.connections[""].flow_control.is_late


@pytest.mark.slow
async def test_missing_package_is_one_log_line_and_the_rest_works(
    lines: Callable[[], list[str]], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(survey, "SURVEY_DELAYS", (0.0, 0.1, 0.1))
    async with FarSide(without=["tf2_msgs"]) as far_side, attached(far_side.url):
        assert "/Ego_topic" in far_side.graph.topics
        await until(lambda: any("package" in line for line in lines()))
        (line,) = [line for line in lines() if "does not know the package" in line]
        assert "tf2_msgs, so it lacks /tf, /tf_static" in line


@pytest.mark.slow
@pytest.mark.parametrize("sockets", ["one", "per-topic"])
async def test_nothing_is_published_of_a_package_that_the_bridge_lacks(sockets: Literal["one", "per-topic"]) -> None:
    async with (
        FarSide(without=["rosbridge_sim_msgs"]) as far_side,
        attached(far_side.url, start="run", attach_sockets=sockets) as sim,
    ):
        assert sim.node is not None
        frame = sim.node.world.frame
        await until(lambda: sim.node is not None and sim.node.world.frame > frame + 20)
        assert not [line for line in far_side.log if "not yet advertised" in line]


@pytest.mark.slow
@pytest.mark.parametrize(("ours", "theirs"), [("22.R2", "26.R1"), ("26.R1", "22.R2")])
async def test_other_release_at_the_bridge_is_one_log_line_that_names_the_right_one(
    ours: Literal["22.R2", "26.R1"], theirs: str, lines: Callable[[], list[str]]
) -> None:
    async with FarSide(release=theirs) as far_side, attached(far_side.url, release=ours):
        await until(lambda: any("has other fields" in line for line in lines()))
        (line,) = [line for line in lines() if "has other fields" in line]
        assert line.endswith(f"use --release {theirs}")


@pytest.mark.slow
async def test_same_release_at_the_bridge_is_no_log_line(lines: Callable[[], list[str]]) -> None:
    async with FarSide() as far_side, attached(far_side.url, strict_release=True) as sim:
        line = sim.attachments[0].mirror.connections[""]
        await until(lambda: sim.attachments[0].mirror.diagnostics._listed >= {"/Ego_topic"} and not line._questions)
        assert not [line for line in lines() if "other fields" in line]


@pytest.mark.slow
async def test_other_release_at_the_bridge_ends_a_strict_simulator_with_an_exit_code() -> None:
    async with FarSide(release="26.R1") as far_side:
        sim = Simulator(attach=far_side.url, listen=False, strict_release=True)
        try:
            async with asyncio.timeout(PATIENCE):
                assert await serving._run(sim) == 2
        finally:
            gc.unfreeze()
        far_side.log.clear()  # what was sent until then does not fit


@pytest.mark.slow
async def test_scan_with_infinity_reaches_programs_behind_ros_1(connect: Connect, tmp_path: Path) -> None:
    pytest.importorskip("embreex")
    sensors = tmp_path / "scan.toml"
    sensors.write_text("[[lidar2d]]\nx = 3.8\nz = 0.5\n")
    async with FarSide() as far_side, attached(far_side.url, sensors=sensors, scene=True, standard_topics=True):
        client = await connect(far_side.url)
        await client.subscribe("/lidar2D")
        frame = await lead(client)
        for i in range(1, 6):
            await client.ask("/SyncModeWaitForTick", user_id="me", frame=frame + i)
        ranges = (await client.message("/lidar2D"))["ranges"]
        assert 0 < ranges.count(None) < len(ranges), "rosbridge_suite itself sends null in place of infinity"


@pytest.mark.slow
async def test_rubbish_from_a_bridge_does_not_end_the_connection(caplog: pytest.LogCaptureFixture) -> None:
    rubbish: list[str | bytes] = [
        "{",
        "[]",
        '{"op":"bake"}',
        b"\x00\xff",
        '{"op":"publish","topic":"/ctrl_cmd","msg":{"accel":"much"}}',
    ]

    async def answer(connection: ServerConnection) -> None:
        for frame in rubbish:
            await connection.send(frame)
        async for text in connection:
            op = json.loads(text)
            if op["op"] == "call_service" and "id" in op:
                refusal = {"op": "service_response", "service": "", "id": op["id"], "values": "no", "result": False}
                await connection.send(json.dumps(refusal))

    async with serve(answer, "127.0.0.1", 0) as server:
        url = f"ws://127.0.0.1:{server.sockets[0].getsockname()[1]}"
        async with attached(url) as sim:
            await until(lambda: sum("refused: " in line for line in caplog.messages) == 3)
            assert sim.num_bugs == 0
        refused = [line.partition("refused")[2] for line in caplog.messages if "refused" in line]
        assert [line.rpartition("(")[2] for line in refused[:3]] == ["bad_frame)", "unknown_op)", "wrong_type)"]
        assert "2 more refused (bad_frame)" in "".join(caplog.messages), "lines of one reason share one"


# What cannot be


async def refusal_of(**options: Unpack[SimulatorOptions]) -> str:
    with pytest.raises(DocumentError) as caught:
        await Simulator(**options).start()
    text = str(caught.value)
    assert "\n" not in text
    return text


async def test_attach_without_a_world_is_an_error() -> None:
    assert "without one there is nothing" in await refusal_of(attach="ws://h:1", world=False)


async def test_neither_listening_nor_attached_is_an_error() -> None:
    assert "attach: expected URLs of rosbridges" in await refusal_of(listen=False)


@pytest.mark.parametrize("url", ["", "http", "ftp://x", "ws://", "ws://h:0", "ws://h:99999", "ws://h:x", "ws://a b"])
async def test_malformed_url_is_an_error(url: str) -> None:
    if url == "http":
        url = "ws://[::1"
    assert "attach: expected URLs of rosbridges" in await refusal_of(attach=url)


async def test_token_in_a_url_is_not_shown(lines: Callable[[], list[str]]) -> None:
    assert TOKEN not in await refusal_of(attach=f"ws://h:x/?token={TOKEN}")
    async with gateway(token=TOKEN) as bridge, attached(f"{bridge.url}/?token={TOKEN}") as sim:
        assert TOKEN not in repr(sim.settings)
        assert sim.attachments[0].url == bridge.url
    assert TOKEN not in "\n".join(lines())


@pytest.mark.slow
async def test_wrong_token_is_reported(lines: Callable[[], list[str]]) -> None:
    async with gateway(token=TOKEN) as bridge, Simulator(attach=f"{bridge.url}/?token=x", listen=False):
        await until(lambda: any("it needs a token (?token=... in its URL)" in line for line in lines()))


@pytest.mark.parametrize("host", ["127.0.0.1", "localhost", EVERYWHERE])
async def test_server_does_not_dial_itself(host: str) -> None:
    async with gateway() as bridge:
        port = bridge.port
    with pytest.raises(AddressError, match="is this server itself"):
        await Simulator(port=port, attach=f"ws://{host}:{port}").start()


@pytest.mark.parametrize(
    ("url", "addresses", "is_own"),
    [
        ("ws://127.0.0.1:9090", ["127.0.0.1"], True),
        ("ws://127.0.0.1:9091", ["127.0.0.1"], False),
        ("ws://127.0.0.2:9090", ["127.0.0.1"], False),
        ("ws://127.0.0.2:9090", [EVERYWHERE], True),
        ("ws://0.0.0.0:9090", [EVERYWHERE], True),
        ("ws://[::]:9090", ["::1"], True),
        ("ws://[::ffff:127.0.0.1]:9090", ["127.0.0.1"], True),
        ("ws://[::ffff:127.0.0.1]:9090", [EVERYWHERE], True),
        ("ws://[::ffff:127.0.0.2]:9090", ["127.0.0.1"], False),
        ("ws://[::]:9090", ["127.0.0.1"], True),
        ("ws://192.0.2.1:9090", [EVERYWHERE], False),
        ("ws://no.such.host.invalid:9090", [EVERYWHERE], False),
    ],
)
async def test_own_addresses_are_recognised(url: str, addresses: list[str], *, is_own: bool) -> None:
    assert await is_own_address(url, 9090, addresses) is is_own


# Stamps

DAY_NS = 10**18
"""Of September 2001: later than any simulation, and earlier than any day on which this runs."""


def stamp_of(header: dict[str, Any]) -> int:
    stamp: dict[str, int] = header["stamp"]
    return stamp["secs"] * 10**9 + stamp["nsecs"]


class ExtrapolationError(Exception):
    """A time that the transforms do not reach."""


class TfBuffer:
    """Where the car was at a time, as tf2's buffer tells it: between two transforms and never beyond them."""

    def __init__(self) -> None:
        self._places: list[tuple[int, float]] = []

    def put(self, message: dict[str, Any]) -> None:
        for one in message["transforms"]:
            if one["child_frame_id"] == "base_link":
                self._places.append((stamp_of(one["header"]), one["transform"]["translation"]["x"]))

    def look_up(self, time_ns: int) -> float:
        if not self._places or not self._places[0][0] <= time_ns <= self._places[-1][0]:
            raise ExtrapolationError
        for (before, x), (after, next_x) in pairwise(self._places):
            if before <= time_ns <= after:
                return x + (next_x - x) * (time_ns - before) / (after - before)
        raise ExtrapolationError


@pytest.mark.slow
async def test_program_behind_a_bridge_finds_the_transform_of_its_present_time(connect: Connect) -> None:
    async with FarSide() as far_side, attached(far_side.url, start="run"):
        client = await connect(far_side.url)
        await client.send("advertise", topic="/ctrl_cmd", type="morai_msgs/CtrlCmd")
        await client.send("publish", topic="/ctrl_cmd", msg={"longlCmdType": 2, "velocity": 30.0})
        await client.send("subscribe", topic="/tf")
        buffer = TfBuffer()
        buffer.put(await client.message("/tf"))
        wanted_ns = time.time_ns()
        with pytest.raises(ExtrapolationError):
            buffer.look_up(wanted_ns)  # not yet: a program waits for the next transform
        async with asyncio.timeout(PATIENCE):
            while True:
                buffer.put(await client.message("/tf"))
                try:
                    x = buffer.look_up(wanted_ns)
                except ExtrapolationError:
                    continue
                break
        assert 40.0 <= x < 60.0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("parameter", "options", "is_wall"),
    [
        (None, {}, True),
        (True, {}, False),
        (False, {}, True),
        (None, {"stamps": "sim"}, False),
        (True, {"stamps": "wall"}, True),
    ],
)
async def test_headers_clock_and_transforms_use_the_time_source_of_the_bridge(
    connect: Connect, parameter: object, options: SimulatorOptions, *, is_wall: bool
) -> None:
    async with FarSide() as far_side:
        if parameter is not None:
            far_side.graph.parameters["/use_sim_time"] = parameter
        async with attached(far_side.url, **options):
            client = await connect(far_side.url)
            topics = {
                "/clock": "rosgraph_msgs/Clock",
                "/tf": "tf2_msgs/TFMessage",
                "/Ego_topic": "morai_msgs/EgoVehicleStatus",
            }
            for topic in topics:
                await client.send("subscribe", topic=topic)
            await client.send("subscribe", topic="/tf_static")
            static = (await client.message("/tf_static"))["transforms"][0]["header"]
            frame = await lead(client)
            await client.ask("/SyncModeWaitForTick", user_id="me", frame=frame + 1)
            clock = await client.message("/clock")
            ego = await client.message("/Ego_topic")
            tf = await client.message("/tf")
            stamps = {stamp_of({"stamp": clock["clock"]}), stamp_of(ego["header"])}
            stamps |= {stamp_of(one["header"]) for one in tf["transforms"]}
            (stamp,) = stamps
            assert (stamp > DAY_NS) is is_wall
            assert (stamp_of(static) > DAY_NS) is is_wall, "nothing was announced before it was settled"


async def test_server_that_also_attaches_keeps_simulated_stamps_and_warns(lines: Callable[[], list[str]]) -> None:
    async with gateway() as bridge, Simulator(port=0, start="sync", attach=[bridge.url]) as sim:
        assert sim.bus is not None
        assert sim.bus.stamp_ns == 0
        await until(lambda: any("--stamps wall" in line for line in lines()))


async def test_ros_2_uses_wall_clock_stamps(lines: Callable[[], list[str]]) -> None:
    async with gateway(ros=2) as bridge, attached(bridge.url, ros=2) as sim:
        assert sim.bus is not None
        assert sim.bus.stamp_ns > DAY_NS
        assert not [line for line in lines() if "use_sim_time" in line]


async def test_stamps_auto_without_a_bridge_uses_simulated_time_and_logs_it(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.INFO, "rosbridge_sim.app")
    async with Simulator(port=0, start="sync", stamps="auto") as sim:
        assert sim.bus is not None
        assert sim.bus.stamp_ns == 0
    assert any("there is none: stamps are simulated time" in record.getMessage() for record in caplog.records)


# What goes, and comes back


@pytest.mark.slow
async def test_services_of_a_removed_ego_stay_announced_at_the_bridge(
    connect: Connect, lines: Callable[[], list[str]]
) -> None:
    async with FarSide() as far_side, attached(far_side.url) as sim:
        client = await connect(far_side.url)
        await client.send("advertise", topic="/ego_setting", type="morai_msgs/MultiEgoSetting")
        await client.send("publish", topic="/ego_setting", msg=put_egos(2))
        await provided(client, "/Ego-2/Service_MoraiEventCmd")
        assert sim.node is not None
        sim.node.reset(None, 0.0)
        service = "/Ego-2/Service_MoraiEventCmd"
        assert service in (await client.values("/rosapi/services"))["services"]
        answer = await client.call(service, {"request": {}})  # rosbridge_suite passes over `result`
        assert answer["values"]["response"]["gear"] == 0
        assert any(f"a call of {service} is refused: " in line and "ego 2 has left" in line for line in lines())
        await client.send("publish", topic="/ego_setting", msg=put_egos(2))
        await until(lambda: sim.node is not None and len(sim.node.egos) == 2)
        answer = await client.call(service, {"request": {}})
        assert answer["values"]["response"]["gear"] == 4
        assert not [line for line in far_side.log if "Overwriting" in line]


@pytest.mark.slow
async def test_all_topics_return_after_a_restart_of_the_ros_master(
    connect: Connect, monkeypatch: pytest.MonkeyPatch, lines: Callable[[], list[str]]
) -> None:
    for module, name, value in (
        (rosapi_watch, "LOOK_PERIOD", 0.1),
        (rosapi_watch, "LOST_PERIOD", 0.05),
        (survey, "SURVEY_DELAYS", (0.0, 0.05, 0.1)),
        (announcing, "UNREGISTER_TIME", 0.5),
        (far_graph, "UNREGISTER_TIMEOUT", 0.2),
    ):
        monkeypatch.setattr(module, name, value)
    async with FarSide() as far_side, attached(far_side.url) as sim:
        await until(lambda: sim.attachments[0].mirror.diagnostics._listed >= {"/Ego_topic", "/tf_static"})
        far_side.restart_master()
        await until(lambda: any("stopped answering" in line for line in lines()))
        assert len([line for line in lines() if "stopped answering" in line]) == 1
        far_side.start_rosapi()
        client = await connect(far_side.url)
        await provided(client, "/SyncModeWaitForTick")
        async with asyncio.timeout(PATIENCE):
            while "/Ego_topic" not in (await client.values("/rosapi/topics"))["topics"]:  # noqa: ASYNC110 - what is waited for tells nobody
                await asyncio.sleep(0.01)
        await client.send("subscribe", topic="/Ego_topic")
        frame = await lead(client)
        await client.ask("/SyncModeWaitForTick", user_id="me", frame=frame + 1)
        assert (await client.message("/Ego_topic"))["position"]["x"] == 40.0
        assert sim.num_bugs == 0


@pytest.mark.slow
@pytest.mark.parametrize("is_wanted", [False, True])
async def test_replay_info_reaches_a_bridge_if_set_and_is_not_followed(connect: Connect, *, is_wanted: bool) -> None:
    async with FarSide() as far_side, attached(far_side.url, replay_info=is_wanted) as sim:
        client = await connect(far_side.url)
        await client.send("subscribe", topic="/ReplayInfo_topic", type="morai_msgs/ReplayInfo")
        await client.send("subscribe", topic="/Object_topic", type="morai_msgs/ObjectStatusList")
        frame = await lead(client)
        for i in range(1, 6):
            await client.ask("/SyncModeWaitForTick", user_id="me", frame=frame + i)
        if is_wanted:
            told = [await client.message("/ReplayInfo_topic") for _ in range(5)]
            listed = [await client.message("/Object_topic") for _ in range(5)]
            assert [one["npc_list"] for one in told] == [one["npc_list"] for one in listed]
        else:
            assert not [f for f in client.inbox if f.get("topic") == "/ReplayInfo_topic"]
        assert sim.node is not None
        assert not sim.node.scene.is_replaying


async def test_client_of_a_bridge_steps_the_world_behind_it(connect: Connect) -> None:
    async with gateway() as bridge, attached(bridge.url) as sim:
        client = await connect(bridge.url)
        await lead(client)
        request: dict[str, Any] = {"user_id": "me", "n": 300, "topics": ["/Ego_topic"], "stop_after_m": 1.0}
        request["commands"] = [{"ego": 0, "commands": [{"longlCmdType": 2, "velocity": 36.0}]}]
        done = await client.values("/sim/step", request)
        assert (done["result"], done["stopped_by"]) == (True, "distance")
        assert json.loads(done["topics"][0]["message"]) == done["egos"][0]
        assert sim.node is not None
        assert sim.node.world.frame == done["frame"]
