"""Memory held for clients: bounded for each, and for all together."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable, Iterator
from contextlib import AsyncExitStack, suppress

import pytest
import pytest_asyncio
from websockets.exceptions import ConnectionClosed

from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.rosapi_services.rosapi import Rosapi
from rosbridge_sim.schema.store import Store
from rosbridge_sim.shell.page.map_page import MapText
from rosbridge_sim.shell.websocket.limits import ServerLimits
from rosbridge_sim.shell.websocket.memory_budget import MemoryBudget, default_budget
from rosbridge_sim.shell.websocket.server import Server
from tests.graph.bus_fixture import make_store
from tests.support import PATIENCE, Client

MB = 2**20
PART = MB // 4
"""Size of a message; limits are some of those."""

TEXT = "x" * PART

Listen = Callable[[ServerLimits], Awaitable[tuple[Server, Bus]]]


@pytest_asyncio.fixture
async def listen() -> AsyncIterator[Listen]:
    async with AsyncExitStack() as stack:

        async def start(limits: ServerLimits) -> tuple[Server, Bus]:
            bus = Bus(make_store())
            Rosapi(bus)
            server = Server(bus, limits, lambda: None)
            await server.start("127.0.0.1", 0)
            stack.push_async_callback(server.stop)
            return server, bus

        yield start


def url_of(server: Server) -> str:
    return f"ws://127.0.0.1:{server.port}"


async def test_latched_messages_of_one_client_are_bounded_in_bytes(listen: Listen) -> None:
    server, bus = await listen(ServerLimits(client_memory=8 * PART))
    async with await Client.open(url_of(server)) as client:
        for name in ("/a", "/b", "/c"):
            qos = {"durability": "transient_local", "depth": 1_000}
            await client.send("advertise", topic=name, type="std_msgs/String", qos=qos)
            for _ in range(10):
                await client.send("publish", topic=name, msg={"data": TEXT})
        statuses = [frame for frame in await client.settle() if frame["op"] == "status"]
        assert bus.total.num_bytes <= 8 * PART
        assert sum(len(topic.latched) for topic in bus.topics.values()) >= 3
        assert statuses
        assert "not latched" in statuses[0]["msg"]
    async with await Client.open(url_of(server)) as late:
        await late.settle()


async def test_throttle_queues_of_one_client_are_bounded_in_bytes(listen: Listen) -> None:
    server, bus = await listen(ServerLimits(client_memory=8 * PART))
    async with await Client.open(url_of(server)) as listener, await Client.open(url_of(server)) as client:
        await listener.subscribe("/t", type="std_msgs/String", throttle_rate=3_600_000, queue_length=10_000)
        await client.send("advertise", topic="/t", type="std_msgs/String")
        for _ in range(30):
            await client.send("publish", topic="/t", msg={"data": TEXT})
        await client.settle()
        assert 2 * PART < bus.total.num_bytes <= 8 * PART
        await listener.send("unsubscribe", topic="/t")
        await listener.settle()
        assert bus.total.num_bytes == 0


async def test_calls_in_flight_of_one_client_are_bounded_in_bytes(listen: Listen) -> None:
    server, bus = await listen(ServerLimits(client_memory=8 * PART))
    async with await Client.open(url_of(server)) as provider, await Client.open(url_of(server)) as caller:
        await provider.send("advertise_service", service="/s", type="rosapi/SetParam")
        await provider.settle()
        for i in range(20):
            await caller.send("call_service", service="/s", id=str(i), args={"name": "/x", "value": TEXT})
        refused = [frame for frame in await caller.settle() if frame["op"] == "service_response"]
        assert 10 < len(refused) < 20
        assert "holds too much" in refused[0]["values"] or "hold too much" in refused[0]["values"]
        waiting = bus.total.num_bytes
        assert 0 < waiting <= 8 * PART
        request = await provider.take("call_service")
        await provider.send("service_response", service="/s", id=request["id"], values={}, result=True)
        await provider.settle()
        assert bus.total.num_bytes < waiting
    while server.clients:  # noqa: ASYNC110 - nothing tells of it
        await asyncio.sleep(0)
    assert bus.total.num_bytes == 0


async def test_goals_and_fragments_of_one_client_are_bounded_in_bytes(listen: Listen) -> None:
    server, bus = await listen(ServerLimits(client_memory=4 * PART))
    async with await Client.open(url_of(server)) as provider, await Client.open(url_of(server)) as caller:
        await provider.send("advertise_action", action="/a", type="tf2_web_republisher/TFSubscription")
        await provider.settle()
        for i in range(10):
            args = {"source_frames": [TEXT]}
            await caller.send("send_action_goal", action="/a", id=str(i), args=args)
        ends = [frame for frame in await caller.settle() if frame["op"] == "action_result"]
        assert 5 < len(ends) < 10
        assert "hold too much" in ends[0]["values"]
        for i in range(8):
            await caller.send("fragment", id=f"f{i}", num=0, total=2, data=TEXT)
        told = [frame for frame in await caller.settle() if frame["op"] == "status"]
        assert told
        assert "hold too much" in told[-1]["msg"]
        assert bus.total.num_bytes <= 4 * PART
    while server.clients:  # noqa: ASYNC110 - nothing tells of it
        await asyncio.sleep(0)
    assert bus.total.num_bytes == 0


async def test_largest_client_is_disconnected_beyond_the_budget(listen: Listen) -> None:
    server, bus = await listen(ServerLimits(client_memory=100 * PART, memory_budget=20 * PART))
    async with AsyncExitStack() as stack:
        large, small = [await stack.enter_async_context(await Client.open(url_of(server))) for _ in range(2)]
        for client, name, num in ((large, "/large", 14), (small, "/small", 2)):
            qos = {"durability": "transient_local", "depth": 100}
            await client.send("advertise", topic=name, type="std_msgs/String", qos=qos)
            with suppress(ConnectionClosed):  # the look at the memory may come before the last message
                for _ in range(num):
                    await client.send("publish", topic=name, msg={"data": TEXT})
                    await client.settle()  # one after another: what waits to be read counts, too
        status = await large.take("status")
        assert "--memory-budget" in status["msg"]
        with pytest.raises(ConnectionClosed):
            await large.read()
        assert large.socket.close_code == 1008
        assert "held most" in (large.socket.close_reason or "")
        await small.settle()
        assert bus.total.num_bytes <= 8 * PART


class HoldingClient:
    """A client that holds what a test says."""

    def __init__(self, name: str, own: int, shared: dict[int, int] | None = None) -> None:
        self.name = name
        self.evicted: list[str] = []
        self._own = own
        self._shared = shared or {}

    @property
    def num_bytes_held(self) -> int:
        return self._own + sum(self._shared.values())

    def shared(self) -> Iterator[tuple[int, int]]:
        yield from self._shared.items()

    def evict(self, reason: str) -> None:
        self.evicted.append(reason)


async def closed(budget: int, *holders: HoldingClient) -> list[str]:
    bus = Bus(Store({}))
    watch = MemoryBudget(asyncio.get_running_loop(), bus, lambda: holders, budget)
    watch.look()
    watch.stop()
    return [holder.name for holder in holders if holder.evicted]


async def test_largest_clients_are_disconnected_until_the_rest_fits() -> None:
    holders = [HoldingClient(str(i), i * MB) for i in (3, 9, 1, 7, 2)]
    assert await closed(22 * MB, *holders) == []
    assert await closed(21 * MB, *holders) == ["9"]
    holders = [HoldingClient(str(i), i * MB) for i in (3, 9, 1, 7, 2)]
    assert await closed(6 * MB, *holders) == ["9", "7"]


async def test_shared_bytes_count_once() -> None:
    image = {1: 16 * MB}
    assert await closed(40 * MB, *[HoldingClient(str(i), MB, image) for i in range(20)]) == []
    own = [HoldingClient(str(i), MB, {i: 16 * MB}) for i in range(20)]
    assert len(await closed(40 * MB, *own)) == 18


async def test_latched_messages_of_a_client_that_is_gone_are_dropped_before_another_client_is_closed(
    listen: Listen,
) -> None:
    server, bus = await listen(ServerLimits())
    async with await Client.open(url_of(server)) as gone:
        qos = {"durability": "transient_local", "depth": 1}
        await gone.send("advertise", topic="/t", type="std_msgs/String", qos=qos)
        await gone.send("publish", topic="/t", msg={"data": TEXT})
        await gone.settle()
    while server.clients:  # noqa: ASYNC110 - nothing tells of it
        await asyncio.sleep(0)
    assert bus.total.num_bytes >= PART
    stays = HoldingClient("stays", PART)
    watch = MemoryBudget(asyncio.get_running_loop(), bus, lambda: [stays], PART)
    watch.look()
    watch.stop()
    assert (bus.total.num_bytes, stays.evicted) == (0, [])


def test_default_budget_is_a_part_of_the_machines_memory() -> None:
    assert 64 * MB <= default_budget() < 2**50


async def test_unread_http_answers_count_and_their_readers_are_cut_off(
    listen: Listen, caplog: pytest.LogCaptureFixture
) -> None:
    server, _ = await listen(ServerLimits(memory_budget=16 * MB))
    text: asyncio.Future[MapText] = asyncio.get_running_loop().create_future()
    text.set_result(MapText("etag", b"x" * 12 * MB))
    server.pages.ask_map = lambda _known: text
    async with await Client.open(url_of(server)) as client:
        readers = [await asyncio.open_connection("127.0.0.1", server.port, limit=1) for _ in range(4)]
        for _, writer in readers:
            writer.write(b"GET /map.json HTTP/1.1\r\nHost: localhost\r\n\r\n")
        assert server._budget is not None
        async with asyncio.timeout(PATIENCE):
            while "is closed: it holds" not in caplog.text:
                await asyncio.sleep(0)
                server._budget.look()
        assert await client.settle() == [], "the client stays"
        for _, writer in readers:
            writer.transport.abort()
