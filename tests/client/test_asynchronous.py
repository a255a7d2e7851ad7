"""The client for asyncio: at our own server, at others, and where the connection ends."""

from __future__ import annotations

import asyncio
import json
import logging
import math
import ssl
from collections.abc import AsyncIterator, Awaitable, Callable, Iterable

import pytest
import pytest_asyncio
from websockets.asyncio.server import ServerConnection

from rosbridge_sim import Simulator
from rosbridge_sim.client import (
    AnswerTimeoutError,
    AsyncClient,
    ClientError,
    ConnectError,
    ConnectionLostError,
    OpRefusedError,
    ServiceRefusedError,
    asynchronous,
)
from tests.cli.tool_fixture import Frame, answering, other_server, talking_server
from tests.support import PATIENCE

NO_TIME = 0.01
"""A time-out for what never comes [s]."""


@pytest_asyncio.fixture
async def sim() -> AsyncIterator[Simulator]:
    async with Simulator(port=0, start="sync") as simulator:
        yield simulator


@pytest_asyncio.fixture
async def client(sim: Simulator) -> AsyncIterator[AsyncClient]:
    async with AsyncClient(sim.url, timeout=PATIENCE) as client:
        yield client


# Services


async def test_ask_wraps_the_request_and_call_does_not(client: AsyncClient) -> None:
    spec = await client.ask("/Service_MoraiVehicleSpec", unique_id=0)
    values = await client.call("/Service_MoraiVehicleSpec", {"request": {"unique_id": 0}})
    assert values == {"response": spec}
    assert "/SyncModeCmd" in (await client.call("rosapi/services"))["services"]


async def test_refused_call_tells_service_and_reason(client: AsyncClient) -> None:
    with pytest.raises(ServiceRefusedError) as caught:
        await client.call("/SyncModeCmdd")
    error = caught.value
    assert error.service == "/SyncModeCmdd"
    assert error.reason == "Service /SyncModeCmdd does not exist (did you mean /SyncModeCmd?)"
    assert str(error) == f"/SyncModeCmdd: {error.reason}"
    assert isinstance(error, ClientError)


async def test_answer_without_a_response_is_no_answer_to_ask() -> None:
    async with other_server(answering(topics={"topics": []})) as url, AsyncClient(url) as client:
        with pytest.raises(ServiceRefusedError, match=r"use call\(\)"):
            await client.ask("/rosapi/topics")


async def test_answers_that_do_not_come_are_a_time_out() -> None:
    async with other_server(lambda _: ()) as url, AsyncClient(url) as client:
        for timeout in (NO_TIME, 0.0):
            with pytest.raises(AnswerTimeoutError, match=r"/slow: no answer within 0"):
                await client.call("/slow", timeout=timeout)
        with pytest.raises(TimeoutError):
            await client.ask("/slow", timeout=NO_TIME)


async def test_time_out_includes_the_sending_to_a_server_that_does_not_read(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(asynchronous, "CLOSE_TIMEOUT", NO_TIME)
    deaf, over = asyncio.Event(), asyncio.Event()

    async def stop_reading(connection: ServerConnection) -> None:
        connection.transport.pause_reading()
        deaf.set()
        await over.wait()
        connection.transport.abort()

    async with talking_server(stop_reading) as url, asyncio.timeout(PATIENCE):
        client = await AsyncClient(url, timeout=math.inf, status_level=None).open()
        await deaf.wait()
        with pytest.raises(AnswerTimeoutError, match=r"no answer within 0\.01 s"):
            await client.call("/large", {"data": "x" * 20_000_000}, timeout=NO_TIME)
        for wait in (client.call, client.wait_for):
            with pytest.raises(AnswerTimeoutError, match=r"no answer within 0\.01 s"):
                await wait("/large", timeout=NO_TIME)
        await client.close()
        assert not client.is_connected
        over.set()


async def test_late_answer_disturbs_nobody() -> None:
    held: list[Frame] = []

    def reply(frame: Frame) -> Iterable[str]:
        if frame.get("service") == "/slow":
            held.append(frame)
        elif frame.get("service") == "/quick":
            for one in (*held, frame):
                yield json.dumps({"op": "service_response", "id": one["id"], "values": {"of": one["service"]}})

    async with other_server(reply) as url, AsyncClient(url) as client:
        with pytest.raises(AnswerTimeoutError):
            await client.call("/slow", timeout=NO_TIME)
        assert await client.call("/quick", timeout=math.inf) == {"of": "/quick"}


async def test_calls_of_several_tasks_get_their_own_answers(client: AsyncClient) -> None:
    names = ["/Ego_topic", "/clock", "/tf"] * 10
    answers = await asyncio.gather(*(client.call("/rosapi/topic_type", {"topic": name}) for name in names))
    types = {"/Ego_topic": "morai_msgs/EgoVehicleStatus", "/clock": "rosgraph_msgs/Clock", "/tf": "tf2_msgs/TFMessage"}
    assert [answer["type"] for answer in answers] == [types[name] for name in names]


async def test_cancelled_call_leaves_the_client_usable(client: AsyncClient) -> None:
    task = asyncio.create_task(client.call("/rosapi/topics"))
    await asyncio.sleep(0)
    task.cancel()
    with pytest.raises(asyncio.CancelledError):
        await task
    assert await client.call("/rosapi/get_time")


# Topics


async def test_message_reaches_another_client(sim: Simulator, client: AsyncClient) -> None:
    async with AsyncClient(sim.url) as other, await other.subscribe("chatter", "std_msgs/String") as chatter:
        for text in ("one", "two"):
            await client.publish("/chatter", {"data": text}, "std_msgs/String")
        assert await chatter.next(timeout=PATIENCE) == {"data": "one"}
        assert await chatter.wait_for(lambda msg: msg["data"] == "two", timeout=PATIENCE) == {"data": "two"}


async def test_infinity_is_not_sent_as_null(client: AsyncClient) -> None:
    await client.publish("/number", {"data": math.inf}, "std_msgs/Int32")  # null is 0 there
    with pytest.raises(OpRefusedError, match="requires a int32 for field data, but got"):
        await client.confirm()


async def test_mistake_in_a_message_is_told_once(client: AsyncClient, caplog: pytest.LogCaptureFixture) -> None:
    await client.publish("/ctrl_cmd", {"acel": 1.0})
    with pytest.raises(OpRefusedError, match=r"does not have a field acel \(did you mean accel\?\)"):
        await client.confirm()
    await client.confirm()
    assert [status.level for status in client.statuses] == ["error"]
    (line,) = [one for one in caplog.records if one.name == "rosbridge_sim.client"]
    assert line.levelno == logging.WARNING
    assert "did you mean accel?" in line.getMessage()


async def test_subscription_to_what_is_not_there_is_refused_and_forgotten(client: AsyncClient) -> None:
    with pytest.raises(OpRefusedError, match=r"did you mean /Ego_topic\?"):
        await client.subscribe("/Ego_topicc")
    with pytest.raises(OpRefusedError, match="already established with type morai_msgs/EgoVehicleStatus"):
        await client.wait_for("/Ego_topic", type_name="std_msgs/String")
    with pytest.raises(OpRefusedError, match="not a valid graph name"):
        await client.subscribe("", "std_msgs/String")
    with pytest.raises(ValueError, match="keep: expected a number from 1 on; got 0"):
        await client.subscribe("/Ego_topic", keep=0)
    await client.confirm()  # whoever was told need not be told again
    assert client._subscriptions == {}


async def test_wait_that_is_in_vain_says_how_many_came(client: AsyncClient) -> None:
    with pytest.raises(AnswerTimeoutError, match=r"^/Ego_topic: no message within 0\.01 s$"):
        await client.wait_for("/Ego_topic", timeout=NO_TIME)
    await client.start_sync()
    async with await client.subscribe("/Ego_topic") as egos:
        with pytest.raises(AnswerTimeoutError, match=r"0\.01 s; in synchronous mode the world moves only by tick\(\)$"):
            await egos.next(timeout=NO_TIME)
        await client.tick(3)
        with pytest.raises(AnswerTimeoutError, match=r"no message within 0\.01 s; 3 came, but none of them fits$"):
            await egos.wait_for(lambda _: False, timeout=NO_TIME)
    assert client._subscriptions == {}


async def test_latched_message_counts_for_wait_for(client: AsyncClient) -> None:
    assert (await client.wait_for("SyncModeInfo"))["frame"] == 0


async def test_messages_are_kept_up_to_a_bound_and_the_newest_win(client: AsyncClient) -> None:
    await client.start_sync()
    async with await client.subscribe("/Ego_topic", keep=2) as few, await client.subscribe("Ego_topic") as all_of_them:
        await client.tick(5)
        assert [msg["header"]["seq"] for msg in await few.take()] == [4, 5]
        assert few.num_dropped == 3
        assert [msg["header"]["seq"] for msg in await all_of_them.take()] == [1, 2, 3, 4, 5]


async def test_one_subscription_that_ends_leaves_the_other_one(client: AsyncClient) -> None:
    await client.start_sync()
    first, second = await client.subscribe("/Ego_topic"), await client.subscribe("/Ego_topic")
    await first.close()
    await first.close()
    await client.tick()
    assert len(await second.take()) == 1
    with pytest.raises(ClientError, match="this one was closed"):
        await first.next()


async def test_loop_over_messages_ends_with_the_subscription(client: AsyncClient) -> None:
    await client.start_sync()
    egos = await client.subscribe("/Ego_topic")
    await client.tick(3)
    seen = []
    async for ego in egos:
        seen.append(ego["header"]["seq"])
        if len(seen) == 3:
            await egos.close()
    assert seen == [1, 2, 3]


async def test_predicate_that_fails_is_the_callers_error(client: AsyncClient) -> None:
    with pytest.raises(KeyError):
        await client.wait_for("/SyncModeInfo", lambda msg: msg["no_such_field"])
    assert client._subscriptions == {}


async def test_what_json_cannot_say_is_a_type_error(client: AsyncClient) -> None:
    with pytest.raises(TypeError):
        await client.publish("/ctrl_cmd", {"accel": object()})
    with pytest.raises(TypeError):
        await client.call("/rosapi/get_time", {"x": object()})
    assert client._calls == {}
    await client.confirm()


# Synchronous mode


async def test_ticks_move_the_world_from_frame_to_frame(client: AsyncClient) -> None:
    assert client.next_frame == 0
    assert await client.start_sync() == 0
    assert client.next_frame == 1
    tick = await client.tick(5)
    assert (tick.frame, tick.time) == (5, 0.1)
    assert tick.ego["header"]["seq"] == 5
    await client.stop_sync()
    await client.stop_sync()


async def test_longer_ticks_move_the_world_by_more_frames(client: AsyncClient) -> None:
    await client.start_sync(user_id="me", step_ms=100)
    assert (await client.tick(2)).frame == 10
    assert (await client.wait_for("/SyncModeInfo"))["master_id"] == "me"


async def test_drive_in_synchronous_mode(client: AsyncClient) -> None:
    await client.start_sync(step_ms=100)
    command = {"longlCmdType": 2, "velocity": 30.0}
    await client.ask("/SyncModeCtrlCmd", frame=client.next_frame, command=command, sensor_capture=False)
    assert (await client.tick(50)).ego["velocity"]["x"] * 3.6 == pytest.approx(30.0, abs=1.0)


async def test_scores_of_the_egos_count_from_the_first_call(client: AsyncClient) -> None:
    await client.start_sync()
    assert [(score["unique_id"], score["since_frame"]) for score in await client.score()] == [(0, 0)]
    await client.publish("/ctrl_cmd", {"longlCmdType": 2, "velocity": 30.0}, "morai_msgs/CtrlCmd")
    async with await client.subscribe("/sim/score") as scores:
        await client.tick(25)
        told = (await scores.wait_for(lambda msg: msg["header"]["seq"] == 25))["scores"]
    assert await client.score(reset=True) == told
    assert (await client.score())[0]["since_frame"] == 25


async def test_refused_ticks_have_the_reason_of_the_server(sim: Simulator, client: AsyncClient) -> None:
    with pytest.raises(ClientError, match=r"call start_sync\(\) first"):
        await client.tick()
    await client.start_sync()
    async with AsyncClient(sim.url) as other:
        with pytest.raises(ServiceRefusedError, match=r"another user id is the master: 'rosbridge_sim\.client'"):
            await other.start_sync(user_id="other")
        with pytest.raises(ClientError):
            await other.tick()
    with pytest.raises(ValueError, match="expected a number from 1 on; got 0"):
        await client.tick(0)


async def test_pause_refuses_a_tick_and_tells_why(client: AsyncClient) -> None:
    await client.start_sync()
    await client.call("/Service_MoraiEventCmd", {"request": {"option": 8, "set_pause": True}})
    with pytest.raises(ServiceRefusedError) as caught:
        await client.tick()
    assert "pause" in caught.value.reason
    await client.call("/Service_MoraiEventCmd", {"request": {"option": 8, "set_pause": False}})
    assert (await client.tick()).frame == 1


async def test_ticks_of_two_tasks_do_not_overlap(client: AsyncClient) -> None:
    await client.start_sync()
    ticks = await asyncio.gather(*(client.tick(3) for _ in range(4)))
    assert sorted(tick.frame for tick in ticks) == [3, 6, 9, 12]


# The connection


@pytest.mark.parametrize(
    ("url", "token", "said", "is_final"),
    [
        ("ftp://x", None, "url: expected a URL such as ws://127.0.0.1:9090; got 'ftp://x'", True),
        ("", None, "url: expected a URL", True),
        ("ws://127.0.0.1:9", "two words", "token: expected printable ASCII without blanks", True),
        ("ws://no-such-host.invalid", None, "there is no such host", False),
    ],
)
async def test_connection_that_cannot_be(url: str, token: str | None, said: str, *, is_final: bool) -> None:
    with pytest.raises(ConnectError) as caught:
        await AsyncClient(url, token=token).open()
    assert said in str(caught.value)
    assert caught.value.is_final is is_final


async def test_certificates_for_a_url_without_tls_are_a_mistake() -> None:
    with pytest.raises(ConnectError, match=r"tls: expected a URL with wss://; got 'ws://127\.0\.0\.1:9'"):
        await AsyncClient("ws://127.0.0.1:9/?token=x", tls=ssl.create_default_context()).open()


@pytest.mark.slow  # the server makes whoever guesses wait
async def test_token_lets_in_and_stands_in_no_text() -> None:
    async with Simulator(port=0, world=False, token="sesame") as sim:  # noqa: S106 - opens nothing
        async with AsyncClient(sim.url, token="sesame") as client:  # noqa: S106 - the same
            await client.confirm()
            assert repr(client) == f"<AsyncClient {sim.url} connected>"
        with pytest.raises(ConnectError) as caught:
            await AsyncClient(f"{sim.url}/?token=simsim").open()
        assert (caught.value.status, caught.value.is_final) == (401, True)
        assert "simsim" not in str(caught.value)


@pytest.mark.parametrize(
    ("end", "said"),
    [
        (lambda socket: socket.close(1008, "too much"), r"the server has closed the connection \(1008\): too much"),
        (lambda socket: asyncio.sleep(0, socket.transport.abort()), "the connection was lost"),
        (
            lambda socket: socket.send(b'{"op": "\xff"}', text=True),
            "the connection was given up: invalid start byte at",
        ),
    ],
    ids=["closed", "broken", "not UTF-8"],
)
async def test_connection_that_ends_is_told_to_all_who_wait(
    end: Callable[[ServerConnection], Awaitable[object]], said: str
) -> None:
    async def handle(socket: ServerConnection) -> None:
        async for data in socket:
            frame = json.loads(data)
            if frame.get("service") == "/rosapi/get_time":
                await socket.send(json.dumps({"op": "service_response", "id": frame["id"], "values": {}}))
            elif frame.get("service") == "/end":
                await end(socket)

    async with talking_server(handle) as url, AsyncClient(url) as client:
        chatter = await client.subscribe("/chatter", "std_msgs/String")
        waiting = asyncio.create_task(chatter.next(timeout=math.inf))
        with pytest.raises(ConnectionLostError, match=said):
            await client.call("/end")
        with pytest.raises(ConnectionLostError, match=said):
            await waiting
        with pytest.raises(ConnectionLostError, match=said):
            await anext(chatter)
        for after in (client.call("/x"), client.publish("/x", {}), client.subscribe("/x"), client.confirm()):
            with pytest.raises(ConnectionLostError, match=said):
                await after
        assert not client.is_connected
        await chatter.close()
    assert "not connected" in repr(client)


async def test_close_after_the_server_has_cut_the_connection_is_no_error() -> None:
    async with Simulator(port=0, world=False, max_frame_size=1024) as sim, AsyncClient(sim.url) as client:
        await client.publish("/chatter", {"data": 100_000 * "x"}, "std_msgs/String")
        with pytest.raises(ConnectionLostError):  # a reset may overtake the reason
            await client.confirm()


async def test_client_that_is_closed_ends_all_that_wait(client: AsyncClient) -> None:
    ticking = asyncio.create_task(client.wait_for("/Ego_topic", timeout=math.inf))
    await client.confirm()
    await client.close()
    await client.close()
    with pytest.raises(ConnectionLostError, match="this client was closed"):
        await ticking
    with pytest.raises(ClientError, match="make another one"):
        await client.open()


async def test_client_that_was_never_opened_says_so() -> None:
    client = AsyncClient()
    await client.close()
    with pytest.raises(ConnectionLostError, match=r"ws://127\.0\.0\.1:9090: not connected yet; use `with`"):
        await client.call("/x")


async def test_servers_that_send_rubbish_do_no_harm(caplog: pytest.LogCaptureFixture) -> None:
    def reply(frame: Frame) -> Iterable[str | bytes]:
        yield from ("", "[]", b"\xff", '{"op": 3}', '{"op": "publish"}', '{"op": "publish", "topic": "/t", "msg": 3}')
        yield from ('{"op": "status"}', '{"op": "status", "level": "error", "msg": "\\u001b[2J", "id": [1]}')
        yield from ('{"op": "service_response"}', '{"op": "fragment"}', '{"op": "service_response", "id": {}}')
        yield json.dumps({"op": "service_response", "id": frame["id"], "values": 3})

    async with other_server(reply) as url, AsyncClient(url) as client:
        assert await client.call("/x") == {}
        assert client.statuses[-1].text == "\x1b[2J"
    assert "\x1b" not in caplog.text
    assert "a fragment that cannot be used" in caplog.text


# The barrier


async def test_members_of_a_barrier_tick_together(sim: Simulator, client: AsyncClient) -> None:
    async with AsyncClient(sim.url, timeout=PATIENCE) as other:
        assert await client.join_barrier(user_id="one", step_ms=40) == 0
        assert await other.join_barrier() == 0
        ticks = await asyncio.gather(client.tick(3), other.tick(3))
        assert [tick.frame for tick in ticks] == [6, 6]
        await other.leave_barrier()
        assert (await client.tick()).frame == 8
        await client.leave_barrier()
        await client.leave_barrier()
        assert (await client.wait_for("/sim/barrier"))["members"] == []
        with pytest.raises(ClientError, match="join_barrier"):
            await client.tick()


async def test_other_terms_than_those_in_force_are_refused_with_the_reason(sim: Simulator, client: AsyncClient) -> None:
    async with AsyncClient(sim.url, timeout=PATIENCE) as other:
        await client.join_barrier(step_ms=40, deadline=0.5)
        with pytest.raises(ServiceRefusedError, match=r"time_step 40 ms, deadline_s 0\.5"):
            await other.join_barrier(step_ms=20)


async def test_stop_of_a_member_leaves_the_barrier(client: AsyncClient) -> None:
    await client.join_barrier()
    await client.stop_sync()
    assert (await client.wait_for("/SyncModeInfo"))["status"] is False


# Time


async def test_step_drives_several_ticks_and_returns_egos_and_topics(client: AsyncClient) -> None:
    with pytest.raises(ClientError, match=r"call start_sync\(\) first"):
        await client.step()
    start = await client.start_sync()
    done = await client.step(100, commands={0: {"longlCmdType": 2, "velocity": 36.0}}, topics=["/clock", "/gps"])
    assert (done.frame, done.steps, done.stopped_by) == (start + 100, 100, "")
    assert done.ego["velocity"]["x"] > 3.0
    assert done.topics["/clock"] is not None
    each = [{"longlCmdType": 1, "brake": 1.0}, {"longlCmdType": 1, "accel": 1.0}]
    assert (await client.step(2, commands={0: each})).ego["accel"] == 1.0
    assert (await client.tick()).frame == start + 103
    stopped = await client.step(100, stop_after_m=0.1, stop_on=["red_light", "off_road"])
    assert stopped.stopped_by == "distance"
    x, y = (done.ego["position"][axis] for axis in "xy")
    assert (await client.step(2, stop_at=(x, y, 100.0))).stopped_by == "place"
    with pytest.raises(ServiceRefusedError, match="n: expected 1 to 1,000 steps, got 0") as caught:
        await client.step(0)
    assert caught.value.reason == "n: expected 1 to 1,000 steps, got 0"


async def test_others_are_served_while_many_steps_are_done() -> None:
    async with Simulator(port=0, start="sync") as sim, AsyncClient(sim.url) as client, AsyncClient(sim.url) as other:
        await client.start_sync(step_ms=200)
        stepping = asyncio.create_task(client.step(1_000, timeout=math.inf))
        clock = await other.wait_for("/clock", timeout=math.inf)
        assert clock["clock"]["secs"] >= 0
        refused = await other.call("/sim/step", {"user_id": "other", "n": 1})
        assert refused["result"] is False
        await other.ask("/Service_MoraiEventCmd", option=8, set_pause=True)
        with pytest.raises(ServiceRefusedError, match="paused") as caught:
            await stepping
        assert isinstance(caught.value.answer, dict)
        assert 0 < caught.value.answer["steps"] < 1_000


async def test_real_time_factor_is_set_and_asked() -> None:
    async with Simulator(port=0) as sim, AsyncClient(sim.url) as client:
        assert (await client.real_time_factor()).factor == 1.0
        assert (await client.real_time_factor(2.5)).factor == 2.5
        with pytest.raises(ServiceRefusedError, match=r"expected 0\.1 to 20"):
            await client.real_time_factor(30.0)
        assert (await client.real_time_factor()).factor == 2.5


async def test_world_as_fast_as_possible_serves_clients_and_stops() -> None:
    async with Simulator(port=0, real_time_factor=0.0) as sim, AsyncClient(sim.url) as client:
        first = await client.wait_for("/clock", lambda clock: clock["clock"]["secs"] >= 1, timeout=PATIENCE)
        for _ in range(20):
            assert (await client.real_time_factor()).factor == 0.0
        later = await client.wait_for("/clock", timeout=PATIENCE)
        assert later["clock"]["secs"] >= first["clock"]["secs"]


async def test_map_of_another_server_is_a_clear_error() -> None:
    async def handle(socket: ServerConnection) -> None:
        async for data in socket:
            answer = {"op": "service_response", "id": json.loads(data).get("id"), "values": {"result": True}}
            await socket.send(json.dumps({**answer, "result": True}))

    async with talking_server(handle) as url, AsyncClient(url, timeout=PATIENCE) as client:
        with pytest.raises(ServiceRefusedError, match="expected a page of a map with page, num_pages, digest; is this"):
            await client.map()
