"""The wire vectors with a live server, over sockets."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from typing import Any

import pytest
import pytest_asyncio

from rosbridge_sim.graph.rosapi_services.rosapi import Rosapi
from rosbridge_sim.shell.websocket.limits import ServerLimits
from rosbridge_sim.shell.websocket.server import Server
from tests.graph.bus_fixture import make_bus
from tests.support import PATIENCE, Client
from tests.vector_player import load_vectors, play


class SocketClients:
    """Named clients of a live server."""

    def __init__(self, server: Server) -> None:
        self._server = server
        self._clients: dict[str, Client] = {}
        self._heard: dict[str, list[dict[str, Any]]] = {}
        self._sender = ""  # of frames that the server may not have handled yet
        self._settled: set[str] = set()  # those that have heard all that follows from the frames before

    async def _client(self, name: str) -> Client:
        if name not in self._clients:
            self._clients[name] = await Client.open(f"ws://127.0.0.1:{self._server.port}")
            self._heard[name] = []
        return self._clients[name]

    async def send(self, name: str, frame: str | bytes) -> None:
        if self._sender != name:
            await self._finish()
        client = await self._client(name)
        await client.send_raw(frame)
        self._sender = name

    async def _finish(self) -> None:
        """Have the server carry what was sent to its end: then all that follows from it is on its way."""
        sender, self._sender = self._sender, ""
        if sender:
            self._settled.clear()
            await self._settle(sender)

    async def _settle(self, name: str) -> None:
        client = self._clients.get(name)
        if client is not None and name not in self._settled:
            self._settled.add(name)
            self._heard[name] += await client.settle()

    async def received(self, name: str) -> list[Any]:
        await self._finish()
        await self._settle(name)
        heard = self._heard.get(name, [])
        self._heard[name] = []
        return heard

    async def close(self, name: str) -> None:
        client = self._clients.pop(name, None)
        if client is None:
            return
        self._settled.clear()
        num_clients = len(self._server.clients)
        await client.close()
        async with asyncio.timeout(PATIENCE):
            while len(self._server.clients) >= num_clients:  # noqa: ASYNC110 - no event tells of it
                await asyncio.sleep(0)

    async def close_all(self) -> None:
        for name in list(self._clients):
            await self.close(name)


pytestmark = pytest.mark.asyncio(loop_scope="module")


@pytest_asyncio.fixture(loop_scope="module")
async def clients() -> AsyncIterator[SocketClients]:
    bus = make_bus()
    Rosapi(bus)
    server = Server(bus, ServerLimits(), lambda: None)
    await server.start("127.0.0.1", 0)
    clients = SocketClients(server)
    yield clients
    await clients.close_all()
    assert [owner.name for owner in bus.owners()] == ["/rosapi"]
    assert server.num_bugs == 0
    await server.stop()


@pytest.mark.parametrize("vector", load_vectors(), ids=lambda vector: vector["id"])
async def test_live_server_answers_as_the_vector_says(vector: dict[str, Any], clients: SocketClients) -> None:
    await play(vector, clients)
