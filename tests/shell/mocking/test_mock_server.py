"""A mock within a server: real clients, faults of the wire, the second port, and a file that changes."""

from __future__ import annotations

import asyncio
import sys
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import orjson
import pytest
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed

from rosbridge_sim.client import AsyncClient
from rosbridge_sim.errors import ConnectError, DocumentError, ServiceRefusedError
from rosbridge_sim.shell.app import Simulator
from rosbridge_sim.shell.config.loading import check_options
from rosbridge_sim.shell.mocking import mock_server
from rosbridge_sim.shell.mocking.fault_bus import MESSAGE_BYTES, FaultBus

ROBOT = """
topics:
  /x: {type: std_msgs/Float64, rate: 100, value: {data: {$counter: {}}}}
services:
  /plain: {type: std_srvs/Trigger, answers: [{value: {success: true}}]}
"""


SWITCH_ON = '{"op":"call_service","service":"/mock/set_fault","args":{"name":"f","active":true}}'
"""Its times count from then, and not from the start of a server that a client may find late."""


@asynccontextmanager
async def mock_of(folder: Path, text: str = ROBOT, /, **options: object) -> AsyncIterator[Simulator]:
    path = folder / "robot.yaml"
    path.write_text(text)
    async with Simulator(check_options({"mock": str(path), "port": 0, "page": False, **options})) as sim:
        yield sim


async def receive(socket: ClientConnection, num: int) -> list[float | str | None]:
    """The data of the next messages."""
    return [orjson.loads(await socket.recv())["msg"]["data"] for _ in range(num)]


Frame = dict[str, Any]
Subscribe = Callable[..., Awaitable[ClientConnection]]


@pytest.fixture
async def subscribe() -> AsyncIterator[Subscribe]:
    """Connects, and subscribes to /x."""
    sockets: list[ClientConnection] = []

    async def make(url: str, **options: object) -> ClientConnection:
        socket = await connect(url, compression=None)
        sockets.append(socket)
        await socket.send(orjson.dumps({"op": "subscribe", "topic": "/x", **options}).decode())
        return socket

    yield make
    for socket in sockets:
        socket.transport.abort()
        await socket.wait_closed()


async def test_clients_get_topics_services_and_no_world(tmp_path: Path, subscribe: Subscribe) -> None:
    async with mock_of(tmp_path) as sim, AsyncClient(sim.url) as client:
        first, second = await receive(await subscribe(sim.url), 2)
        assert second > first  # type: ignore[operator]
        assert (await client.call("/plain"))["success"] is True
        assert "/Ego_topic" not in (await client.call("/rosapi/topics"))["topics"]
        assert (await client.call("/rosapi/publishers", {"topic": "/x"}))["publishers"] == ["/mock"]


async def test_faults_of_topics_reach_a_client(tmp_path: Path, subscribe: Subscribe) -> None:
    async def first(rule: str, num: int) -> list[float | str | None]:
        async with mock_of(tmp_path, f"{ROBOT}\nfaults: {{f: {rule}}}") as sim:
            async with asyncio.timeout(10):
                return await receive(await subscribe(sim.url), num)

    doubled = await first("{kind: duplicate}", 6)
    assert doubled[::2] == doubled[1::2]
    assert len(set(doubled)) == 3
    assert await first("{kind: nan}", 2) == [None, None]
    assert all(isinstance(each, str) for each in await first("{kind: wrong_type}", 2))
    frozen = await first("{kind: freeze, start: 0.1}", 40)
    assert frozen[-1] == frozen[-10]
    half = await first("{kind: drop, probability: 0.5}", 30)
    assert half[-1] - half[0] > 40  # type: ignore[operator]


async def test_delayed_messages_keep_their_order(tmp_path: Path, subscribe: Subscribe) -> None:
    text = ROBOT + "\nfaults: {f: {kind: delay, seconds: 0.05, jitter: 0.05}}"
    async with mock_of(tmp_path, text) as sim:
        got = await receive(await subscribe(sim.url), 30)
        assert got == sorted(set(got))  # type: ignore[type-var]


async def test_changed_message_is_lost_for_an_encoding_that_cannot_hold_it(
    tmp_path: Path, subscribe: Subscribe
) -> None:
    async with mock_of(tmp_path, ROBOT + "\nfaults: {f: {kind: wrong_type, end: 0.1}}") as sim:
        socket = await subscribe(sim.url, compression="cbor-raw")
        while not isinstance(frame := await socket.recv(), bytes):
            assert "cannot be sent as cbor-raw" in frame


async def test_connections_are_closed_with_the_code(tmp_path: Path, subscribe: Subscribe) -> None:
    fault = "{kind: close, code: 4001, text: bye, start: 0.1, on: false}"
    async with mock_of(tmp_path, f"{ROBOT}\nfaults: {{f: {fault}}}") as sim:
        socket, switch = await subscribe(sim.url), await subscribe(sim.url)
        await receive(socket, 1)
        await switch.send(SWITCH_ON)
        with pytest.raises(ConnectionClosed) as closed:
            await receive(socket, 1000)
        assert closed.value.rcvd is not None
        assert (closed.value.rcvd.code, closed.value.rcvd.reason) == (4001, "bye")
        await receive(await subscribe(sim.url), 1)


async def test_connection_is_cut_without_a_close_frame(tmp_path: Path, subscribe: Subscribe) -> None:
    async with mock_of(tmp_path, ROBOT + "\nfaults: {f: {kind: close, code: 1006, every: 0.1}}") as sim:
        with pytest.raises(ConnectionClosed) as closed:  # it may be cut before it subscribes
            await receive(await subscribe(sim.url), 1000)
        assert closed.value.rcvd is None


async def test_services_fail_and_answer_late(tmp_path: Path) -> None:
    fail = "{kind: fail, services: [/plain], text: broken, end: 0.3, on: false}"
    text = f"{ROBOT}\nfaults: {{f: {fail}, s: {{kind: slow, seconds: 0.2}}}}"
    async with mock_of(tmp_path, text) as sim, AsyncClient(sim.url) as client:
        switched = await client.begin_call("/mock/set_fault", {"name": "f", "active": True})
        with pytest.raises(ServiceRefusedError, match="broken"):
            await client.call("/plain")  # in one write with the switch, so its time is not over
        assert switched.done()
        began = asyncio.get_running_loop().time()
        await asyncio.sleep(max(0.0, began + 0.31 - asyncio.get_running_loop().time()))
        began = asyncio.get_running_loop().time()
        assert (await client.call("/plain"))["success"] is True
        assert asyncio.get_running_loop().time() - began > 0.19


async def test_control_port_is_touched_by_no_fault(tmp_path: Path, subscribe: Subscribe) -> None:
    text = ROBOT + "\nfaults: {d: {kind: drop}, f: {kind: fail}, c: {kind: close, every: 0.1}}"
    async with mock_of(tmp_path, text, control_port=0, token="secret", deny_publish=["/y"]) as sim:  # noqa: S106
        assert sim.mock is not None
        assert sim.mock.control is not None
        url = f"ws://127.0.0.1:{sim.mock.control.port}"
        with pytest.raises(ConnectError):
            async with AsyncClient(url, token="wrong"):  # noqa: S106
                pass
        async with AsyncClient(url, token="secret") as client:  # noqa: S106
            assert len(await receive(await subscribe(f"{url}/?token=secret"), 20)) == 20
            assert (await client.call("/plain"))["success"] is True
            for name in ("d", "f", "c"):
                assert (await client.call("/mock/set_fault", {"name": name, "active": False}))["success"] is True
        async with AsyncClient(sim.url, token="secret") as client:  # noqa: S106
            assert len(await receive(await subscribe(f"{sim.url}/?token=secret"), 20)) == 20
            assert (await client.call("/plain"))["success"] is True


FROM_CLIENTS = """
services:
  /plain: {type: std_srvs/Trigger, answers: [{value: {success: true}}]}
subscribers: {/y: std_msgs/Float64}
faults:
  f: {direction: from_clients, RULE}
"""


@asynccontextmanager
async def echo_of(folder: Path, rule: str) -> AsyncIterator[tuple[ClientConnection, Callable[[str], Awaitable[Frame]]]]:
    """A client that publishes, and what another one hears of it or what itself is told."""
    async with (
        mock_of(folder, FROM_CLIENTS.replace("RULE", rule)) as sim,
        connect(sim.url, compression=None) as sender,
        connect(sim.url, compression=None) as hearer,
    ):
        await hearer.send('{"op":"subscribe","topic":"/y","type":"std_msgs/Float64"}')
        await hearer.send('{"op":"call_service","service":"/rosapi/topics","id":"ready"}')
        await hearer.recv()
        await sender.send('{"op":"advertise","topic":"/y","type":"std_msgs/Float64"}')

        async def hear(which: str) -> Frame:
            async with asyncio.timeout(10):
                frame: Frame = orjson.loads(await {"sender": sender, "hearer": hearer}[which].recv())
            return frame

        yield sender, hear


async def publish(socket: ClientConnection, *values: float) -> None:
    for value in values:
        await socket.send(orjson.dumps({"op": "publish", "topic": "/y", "id": "p", "msg": {"data": value}}).decode())


@pytest.mark.parametrize(
    ("rule", "heard"),
    [
        ("kind: drop, topics: [/y]", [9.0]),
        ("kind: delay, seconds: 0.05, jitter: 0.04", [1.0, 2.0, 3.0, 9.0]),
        ("kind: duplicate, topics: [/y]", [1.0, 1.0, 2.0, 2.0, 3.0, 3.0, 9.0]),
        ("kind: freeze, topics: [/y]", [1.0, 1.0, 1.0, 9.0]),
    ],
)
async def test_faults_touch_what_a_client_publishes(tmp_path: Path, rule: str, heard: list[float]) -> None:
    async with echo_of(tmp_path, rule) as (sender, hear):
        await publish(sender, 1, 2, 3)
        await sender.send('{"op":"call_service","service":"/mock/set_fault","args":{"name":"f","active":false}}')
        await publish(sender, 9)
        assert [(await hear("hearer"))["msg"]["data"] for _ in heard] == heard


async def test_publish_of_a_client_is_refused_with_its_id(tmp_path: Path) -> None:
    async with echo_of(tmp_path, "kind: fail, topics: [/y], text: not now") as (sender, hear):
        await publish(sender, 1)
        status = await hear("sender")
        assert (status["op"], status["level"], status["id"], status["msg"]) == ("status", "error", "p", "not now")


async def test_calls_of_a_client_get_lost_or_arrive_late(tmp_path: Path) -> None:
    call = '{"op":"call_service","service":"/plain","id":"c"}'
    async with echo_of(tmp_path, "kind: drop, services: [/plain], probability: 0.5") as (sender, hear):
        for _ in range(60):
            await sender.send(call)
        await sender.send('{"op":"call_service","service":"/rosapi/topics","id":"end"}')
        answers = [frame["id"] async for frame in _until_end(hear)]
        assert 10 < len(answers) < 50
    async with echo_of(tmp_path, "kind: delay, services: [/plain], seconds: 0.2") as (sender, hear):
        began = asyncio.get_running_loop().time()
        await sender.send(call)
        assert (await hear("sender"))["values"]["success"] is True
        assert asyncio.get_running_loop().time() - began > 0.19


async def _until_end(hear: Callable[[str], Awaitable[Frame]]) -> AsyncIterator[Frame]:
    while (frame := await hear("sender"))["id"] != "end":
        yield frame


async def test_late_calls_are_bounded_and_given_up_with_their_client(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("rosbridge_sim.shell.mocking.fault_bus.MAX_LATE_BYTES", 5_000)
    text = FROM_CLIENTS.replace("RULE", "kind: delay, seconds: 0.3, services: ['*']")
    async with mock_of(tmp_path, text) as sim:
        async with connect(sim.url, compression=None) as socket:
            for i in range(8):
                await socket.send(orjson.dumps({"op": "call_service", "service": "/plain", "id": str(i)}).decode())
            refused = [orjson.loads(await socket.recv()) for _ in range(3)]
            assert {frame["values"] for frame in refused} == {"The faults of the mock delay too much already"}
            assert [frame["id"] for frame in refused] == ["5", "6", "7"]
        bus = sim.bus
        assert isinstance(bus, FaultBus)
        await until(lambda: bus.num_late_bytes == 0)


async def test_topics_whose_messages_are_delayed_are_bounded(tmp_path: Path) -> None:
    text = FROM_CLIENTS.replace("RULE", "kind: delay, topics: ['/t*'], seconds: 60")
    async with mock_of(tmp_path, text, max_held=3) as sim, connect(sim.url, compression=None) as socket:
        for i in range(4):
            name = f"/t{i}"
            await socket.send(orjson.dumps({"op": "advertise", "topic": name, "type": "std_msgs/Float64"}).decode())
            await socket.send(orjson.dumps({"op": "publish", "topic": name, "msg": {"data": 1}}).decode())
            await socket.send(orjson.dumps({"op": "unadvertise", "topic": name}).decode())
        async with asyncio.timeout(10):
            status = orjson.loads(await socket.recv())
        assert status["msg"] == "/t3: faults of the mock delay messages of 3 other topics of this client already"


async def test_late_messages_without_fields_are_bounded_too(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("rosbridge_sim.shell.mocking.fault_bus.MAX_LATE_BYTES", 5 * MESSAGE_BYTES)
    text = FROM_CLIENTS.replace("RULE", "kind: delay, topics: [/e], seconds: 60")
    async with mock_of(tmp_path, text) as sim, connect(sim.url, compression=None) as socket:
        await socket.send('{"op":"advertise","topic":"/e","type":"std_msgs/Empty"}')
        for _ in range(8):
            await socket.send('{"op":"publish","topic":"/e","msg":{}}')
        await socket.send('{"op":"call_service","service":"/rosapi/topics","id":"end"}')
        async with asyncio.timeout(10):
            await socket.recv()
        assert isinstance(sim.bus, FaultBus)
        assert sim.bus.num_late_bytes == 5 * MESSAGE_BYTES


async def test_faults_of_one_client_spare_the_others(tmp_path: Path, subscribe: Subscribe) -> None:
    text = ROBOT + "\nfaults: {n: {kind: nan, clients: [1]}, s: {kind: wrong_type, clients: ['127.0.0.2*']}}"
    async with mock_of(tmp_path, text) as sim:
        first, second = await subscribe(sim.url), await subscribe(sim.url)
        assert await receive(first, 2) == [None, None]
        assert all(isinstance(each, float) for each in await receive(second, 2))
        async with AsyncClient(sim.url) as client:
            rule = {"name": "c", "active": True, "rule": "{kind: close, code: 4002, clients: [2]}"}
            assert (await client.call("/mock/set_fault", rule))["success"] is True
            with pytest.raises(ConnectionClosed) as closed:
                await receive(second, 1000)
            assert closed.value.rcvd is not None
            assert closed.value.rcvd.code == 4002
            await receive(first, 2)
            assert (await client.call("/plain"))["success"] is True


@pytest.fixture
def quick_look(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mock_server, "LOOK_PERIOD", 0.02)


async def until(is_true: Callable[[], bool]) -> None:
    async with asyncio.timeout(10):
        while not is_true():  # noqa: ASYNC110 - nothing announces it
            await asyncio.sleep(0.01)


@pytest.mark.usefixtures("quick_look")
async def test_changed_file_is_read_anew_and_one_with_a_mistake_is_told(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    async with mock_of(tmp_path) as sim:
        assert sim.bus is not None
        bus, path = sim.bus, tmp_path / "robot.yaml"
        path.write_text(ROBOT.replace("/x", "/longer"))
        await until(lambda: "/longer" in bus.topics)
        path.write_text(ROBOT.replace("Float64", "Float65"))
        await until(lambda: "the mock goes on as it was" in caplog.text)
        assert "robot.yaml:3: topics./x.type: " in caplog.text
        assert bus.topics["/longer"].publishers
        path.unlink()
        (tmp_path / "new.yaml").write_text(ROBOT.replace("/x", "/third") + "\nfaults: {f: {kind: drop}}")
        (tmp_path / "new.yaml").replace(path)
        await until(lambda: "/third" in bus.topics)
        assert [fault.name for fault in bus.topics["/mock/faults"].latched[0].value.faults] == ["f"]


async def test_late_messages_are_bounded_in_bytes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, subscribe: Subscribe
) -> None:
    monkeypatch.setattr("rosbridge_sim.shell.mocking.fault_bus.MAX_LATE_BYTES", 2_000)
    text = ROBOT + "\nfaults: {f: {kind: delay, seconds: 0.5}}"
    async with mock_of(tmp_path, text) as sim:
        socket = await subscribe(sim.url)
        got = await receive(socket, 40)
        assert got[-1] - got[0] > 45  # type: ignore[operator] # some were dropped
        assert sim.bus is not None
        await socket.close()
        await until(lambda: sim.bus.num_late_bytes == 0)  # type: ignore[union-attr]


async def test_hook_is_a_function_of_a_module(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, subscribe: Subscribe
) -> None:
    (tmp_path / "my_hook.py").write_text("def change(name, values, request):\n    return {'data': -1.0}\nother = 3\n")
    monkeypatch.chdir(tmp_path)
    async with mock_of(tmp_path, hook="my_hook:change") as sim:
        assert await receive(await subscribe(sim.url), 1) == [-1.0]
    sys.modules.pop("my_hook")
    for place, text in (
        (
            "my_hook:none",
            "hook: expected MODULE:FUNCTION, got 'my_hook:none': module 'my_hook' has no attribute 'none'",
        ),
        ("my_hook:other", "hook: expected a function, but my_hook:other is int"),
        ("no_such_module:x", "hook: expected MODULE:FUNCTION, got 'no_such_module:x': No module named"),
    ):
        with pytest.raises(DocumentError) as caught:
            async with mock_of(tmp_path, hook=place):
                pass
        assert str(caught.value).startswith(text)
    sys.modules.pop("my_hook")


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"mock": "none.yaml"}, "none.yaml: cannot be read: No such file or directory"),
        ({"world": True}, "mock: expected no world beside it; --no-world switches it off"),
        (
            {"mock": None, "world": False, "hook": "a:b"},
            "control-port, hook: expected with a mock: rosbridge-sim mock run",
        ),
    ],
)
async def test_start_that_makes_no_sense_is_refused(tmp_path: Path, options: dict[str, object], text: str) -> None:
    with pytest.raises(DocumentError) as caught:
        async with mock_of(tmp_path, **options):
            pass
    assert str(caught.value).startswith(text)


async def test_all_mistakes_of_the_file_are_told_at_the_start(tmp_path: Path) -> None:
    with pytest.raises(DocumentError) as caught:
        async with mock_of(tmp_path, "topics: {" + ", ".join(f"/x{i}: {{type: a/B}}" for i in range(30)) + "}"):
            pass
    lines = str(caught.value).splitlines()
    assert len(lines) == 21
    assert lines[0].startswith("robot.yaml:1: topics./x0.type: ")
    assert lines[20] == "robot.yaml: 10 more mistakes"


async def test_flags_of_serve_hold(tmp_path: Path, subscribe: Subscribe) -> None:
    async with mock_of(tmp_path, ros=2, deny_service=["/plain"], deny_subscribe=["/x"]) as sim:
        async with AsyncClient(sim.url) as client:
            assert (await client.call("/rosapi/get_ros_version"))["version"] == 2
            with pytest.raises(ServiceRefusedError, match="plain"):
                await client.call("/plain")
        status = orjson.loads(await (await subscribe(sim.url)).recv())
        assert (status["op"], status["level"]) == ("status", "error")
