"""The checks of services across the graph: what they say of two clients holds if one of them is a node of ROS 1.

A node speaks no rosbridge: here it turns the frames of a check into what a node does on the wire, and back.
"""

from __future__ import annotations

import asyncio
import json
from collections import deque
from collections.abc import AsyncIterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import orjson
import pytest

from rosbridge_sim import Simulator
from rosbridge_sim.doctor.check_frames import agrees, write_frame
from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.gateway.far_graph import FarServiceType
from rosbridge_sim.graph.ros1.ros1_types import Ros1Types
from rosbridge_sim.schema.message import Message
from rosbridge_sim.shell.config.options import SimulatorOptions
from rosbridge_sim.shell.ros1 import ros1_node
from tests.graph.bus_fixture import make_store
from tests.shell.ros1.small_ros1 import MOST_SERVICES, Reply, SmallMaster, SmallNode, Stream, ask, until
from tests.support import Client
from tests.vector_player import load_vectors

pytestmark = pytest.mark.slow

Frame = dict[str, Any]

VECTORS = {vector["id"].partition("/")[2]: vector for vector in load_vectors() if vector["id"].startswith("services/")}

PROVIDED = (
    *("whole", "no-id", "args-by-position", "args-too-many", "args-absent", "args-unknown-field", "args-wrong-type"),
    *("two-in-flight", "provider-refuses", "provider-refuses-bare", "unadvertise", "provider-lost", "caller-lost"),
    *("timeout-accepted", "type-spelling", "result-true-empty", "result-empty-type-true", "standard-package"),
)
"""Checks in which `a`, the provider, is a node."""

CALLED = (
    *("whole", "no-id", "args-absent", "two-in-flight", "provider-refuses", "bad-response", "caller-lost"),
    *("type-spelling", "response-reason", "result-false-with-values", "result-false-other-object"),
    *("result-true-empty", "result-absent-empty", "standard-package", "duplicate-same-client"),
    *("unadvertise", "provider-lost"),
)
"""Checks in which `b`, the caller, is a node, and `c`, too."""

ANSWERED = (
    *("provider-refuses-bare", "response-reason-ok", "result-null-with-values", "result-absent-with-values"),
    *("result-false-one-field", "result-false-empty", "result-null-text", "result-absent-wrong-values"),
    *("result-empty-type-true", "result-empty-type-false", "result-empty-type-absent"),
)
"""The same, for further forms of the provider's answer."""

LOST = "~Service /add of ROS 1 was lost: .*"

TEXTS: dict[tuple[str, str], dict[Any, str]] = {
    ("a", "provider-refuses-bare"): {
        "Service /add failed; its provider gave no reason": "Service /add failed; its node gave no reason"
    },
    ("a", "provider-lost"): {
        "~Service /add was unadvertised.*disconnected": LOST,
        "Service /add does not exist": LOST,  # the master still names it
    },
    ("b", "result-false-other-object"): {'{"error":"no"}': '{"error":"no"}'},  # as text
    ("b", "unadvertise"): {"Service /add does not exist": "service /add does not exist here"},
    ("b", "provider-lost"): {"Service /add does not exist": "service /add does not exist here"},
}
"""Reasons that are others there."""


class Joined:
    """A server on a graph, and what its vectors need."""

    def __init__(self, sim: Simulator, master: SmallMaster) -> None:
        assert sim.bus is not None
        self.url = sim.url
        self.bus: Bus = sim.bus
        self.master = master
        self.types = Ros1Types(make_store(1), make_store(1))


class BridgeClient:
    """A client of the server."""

    def __init__(self, client: Client) -> None:
        self._client = client
        self.frames: deque[Frame] = deque()
        self._task = asyncio.create_task(self._read())

    async def send(self, frame: Any) -> None:  # noqa: ANN401 - of a check
        await self._client.send_raw(write_frame(frame))

    async def _read(self) -> None:
        while True:
            self.frames.append(await self._client.read())

    async def close(self) -> None:
        self._task.cancel()
        await self._client.close()


class ProvidingNode:
    """A node that provides services."""

    def __init__(self, joined: Joined, node: SmallNode) -> None:
        self._joined = joined
        self._node = node
        self._service: FarServiceType | None = None
        self._name = ""
        self._waiting: dict[str, asyncio.Future[Reply]] = {}
        self._num = 0
        self.frames: deque[Frame] = deque()

    async def send(self, frame: Frame) -> None:
        match frame["op"]:
            case "advertise_service":
                await self._offer(frame["service"], frame["type"])
            case "unadvertise_service":
                await self._withdraw(frame["service"])
            case "service_response":
                self._waiting.pop(frame["id"]).set_result(self._reply(frame))

    async def _offer(self, name: str, kind: str) -> None:
        service = self._service = self._joined.types.find_service(kind)
        self._name = name
        self._node.answer_header = {"type": service.name, "md5sum": service.hash}
        self._node.handle = self._handle
        await self._node.register("Service", name, "")
        await until(lambda: name in self._joined.bus.services)

    async def _withdraw(self, name: str) -> None:
        del self._joined.master.services[name]
        await until(lambda: name not in self._joined.bus.services)

    async def _handle(self, request: bytes) -> Reply:
        assert self._service is not None
        self._num += 1
        key = f"service_request:{self._name}:{self._num}"
        self._waiting[key] = asyncio.get_running_loop().create_future()
        args = _read(self._service.request, request)
        self.frames.append({"op": "call_service", "service": self._name, "id": key, "args": args})
        return await self._waiting[key]

    def _reply(self, frame: Frame) -> Reply:
        assert self._service is not None
        if not frame["result"]:
            return False, frame.get("values", "").encode()
        kind = self._service.response
        return True, kind.encode(Message(kind.type, kind.type.check(frame["values"], 0)))

    async def close(self) -> None:
        self._node.die()


class CallingNode:
    """A node that calls services, on a connection of its own each time."""

    def __init__(self, joined: Joined, node: SmallNode) -> None:
        self._joined = joined
        self._node = node
        self._stream: Stream | None = None
        self._tasks: list[asyncio.Task[None]] = []
        self._uris: dict[str, str] = {}
        self.frames: deque[Frame] = deque()

    async def send(self, frame: Frame) -> None:
        if frame["op"] == "call_service":
            known = self._joined.master.services
            await until(lambda: frame["service"] in known or frame["service"] in self._uris)
            self._tasks.append(asyncio.create_task(self._call(**frame)))

    async def _call(self, op: str, service: str, args: Any = None, **rest: Any) -> None:  # noqa: ANN401 - of a check
        assert op == "call_service"
        known = self._joined.master.services.get(service)
        uri = self._uris[service] = known[1] if known else self._uris[service]
        header, stream = await self._node.connect(
            "127.0.0.1", int(uri.rpartition(":")[2]), {"service": service, "md5sum": "*"}
        )
        if "error" in header:
            is_ok, values = False, header["error"]
        else:
            kind = self._joined.types.find_service(header["type"])
            request = kind.request.encode(Message(kind.request.type, kind.request.type.check(args or {}, 0)))
            self._stream = stream
            is_ok, body = await ask(stream, request)
            values = _read(kind.response, body) if is_ok else body.decode()
        sent = {key: value for key, value in rest.items() if key == "id"}
        self.frames.append({"op": "service_response", "service": service, "values": values, "result": is_ok, **sent})

    async def close(self) -> None:
        for task in self._tasks:
            task.cancel()
        self._node.die()


def _read(kind: Any, raw: bytes) -> Any:  # noqa: ANN401 - a Ros1Type, any value of JSON
    return orjson.loads(kind.type.encode_json(kind.decode(raw, 0)))


def _wanted(frame: Frame, texts: dict[Any, str]) -> Frame:
    """The frame that must come, whose reason may be another one here: an object is its JSON text for a node."""
    values = frame.get("values")
    if frame.get("result") is not False or values is None:
        return frame
    known = values if isinstance(values, str) else json.dumps(values, separators=(",", ":"))
    return frame | {"values": texts.get(known, values)}


async def play(name: str, joined: Joined, nodes: dict[str, type[ProvidingNode | CallingNode]]) -> None:
    """Play a check: each frame is waited for, and none may be left."""
    texts = TEXTS.get((next(iter(nodes)), name), {})
    clients: dict[str, Any] = {}

    def num_frames() -> int:
        return sum(len(one.frames) for one in clients.values())

    for number, step in enumerate(VECTORS[name]["steps"], 1):
        ((key, value),) = step.items()
        who, action = key[:-1], key[-1]
        if who not in clients:
            clients[who] = await make(who, joined, nodes.get(who))
        client, before = clients[who], num_frames()
        if action == ">":
            await client.send(value)
            if value["op"] == "call_service":  # it comes to the provider, or back, before the next one
                await until(partial(lambda before: num_frames() > before, before))
        elif action == "-":
            await client.close()
        else:
            await until(partial(len, client.frames))
            frame, wanted = client.frames.popleft(), _wanted(value, texts)
            assert agrees(wanted, frame), f"{name}, step {number}: {who} got {frame}, expected {wanted}"
    assert num_frames() == 0, name
    for client in clients.values():
        await client.close()
    joined.master.services.clear()
    await until(lambda: not any(name in joined.bus.services for name in ("/add", "/static_map")))


async def make(who: str, joined: Joined, kind: type[ProvidingNode | CallingNode] | None) -> Any:  # noqa: ANN401 - one of three
    """A node of a kind, or a client."""
    if kind is None:
        return BridgeClient(await Client.open(joined.url))
    return kind(joined, await SmallNode(joined.master, f"/{who}").start())


@pytest.fixture
async def joined(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> AsyncIterator[Joined]:
    monkeypatch.setattr(ros1_node, "PERIOD", 0.02)
    monkeypatch.setattr(ros1_node, "MOST_LOOKING", 1.0)
    master = await SmallMaster().start()
    options: SimulatorOptions = {"port": 0, "world": False, "data_dir": tmp_path, "ros1_master": master.uri}
    options["deny_service"] = MOST_SERVICES
    async with Simulator(**options) as sim:
        yield Joined(sim, master)
    master.server.stop()


async def test_a_node_that_provides_does_what_the_checks_say_of_a_client(joined: Joined) -> None:
    for name in PROVIDED:
        await play(name, joined, {"a": ProvidingNode})


@pytest.mark.parametrize("names", [CALLED, ANSWERED], ids=["calls", "answers"])
async def test_a_node_that_calls_gets_what_the_checks_say_of_a_client(joined: Joined, names: Sequence[str]) -> None:
    for name in names:
        await play(name, joined, {"b": CallingNode, "c": CallingNode})
