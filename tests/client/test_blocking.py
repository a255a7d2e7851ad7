"""The blocking client: the same methods as the one for asyncio, from any thread."""

from __future__ import annotations

import inspect
import threading
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor

import pytest

from rosbridge_sim import Simulator
from rosbridge_sim.client import (
    AnswerTimeoutError,
    AsyncClient,
    AsyncSubscription,
    Client,
    ClientError,
    ConnectError,
    ConnectionLostError,
    OpRefusedError,
    Subscription,
)
from tests.support import PATIENCE


@pytest.fixture
def sim() -> Iterator[Simulator]:
    with Simulator(port=0, start="sync") as simulator:
        yield simulator


@pytest.fixture
def client(sim: Simulator) -> Iterator[Client]:
    with Client(sim.url, timeout=PATIENCE) as client:
        yield client


def shown(kind: type) -> dict[str, str]:
    """Public methods and properties of a class, with their parameters."""
    return {
        name: str(inspect.signature(member).replace(return_annotation=inspect.Signature.empty))
        if inspect.isfunction(member)
        else ""
        for base in reversed(kind.__mro__)
        if base.__module__.startswith("rosbridge_sim.")
        for name, member in vars(base).items()
        if not name.startswith("_") and (inspect.isfunction(member) or isinstance(member, property))
    }


ASYNC_ALONE = {"begin_call", "collect_others", "note", "next_of", "unsubscribe"}
"""Methods that `AsyncClient` and its own subscriptions and tools share; `Subscription.close` unsubscribes."""

ATTRIBUTES = {"url", "timeout", "statuses"}
"""Attributes of the one form, and properties of the other."""


def test_both_forms_have_the_same_methods() -> None:
    there = {name: text for name, text in shown(AsyncClient).items() if name not in ASYNC_ALONE}
    here = {name: text for name, text in shown(Client).items() if name not in ATTRIBUTES | {"run"}}
    assert here == there
    assert shown(Subscription) == {**shown(AsyncSubscription), "topic": ""}
    assert inspect.signature(Client) == inspect.signature(AsyncClient)


def test_first_drive(client: Client) -> None:
    assert client.start_sync() == 0
    with client.subscribe("/Ego_topic") as egos:
        assert egos.topic == "/Ego_topic"
        tick = client.tick(3)
        assert (tick.frame, client.next_frame) == (3, 4)
        assert next(egos)["header"]["seq"] == 1
        assert egos.next()["header"]["seq"] == 2
        assert egos.wait_for(lambda ego: ego["header"]["seq"] == 3) == tick.ego
        assert (egos.take(), egos.num_dropped) == ([], 0)
    client.stop_sync()
    assert client.wait_for("/SyncModeInfo")["status"] is False


def test_barrier_of_two_threads(sim: Simulator, client: Client) -> None:
    with Client(sim.url, timeout=PATIENCE) as other, ThreadPoolExecutor() as pool:
        client.join_barrier()
        other.join_barrier()
        ticks = [pool.submit(one.tick) for one in (client, other)]
        assert {tick.result().frame for tick in ticks} == {1}
        other.leave_barrier()


def test_methods_of_all_kinds_reach_the_server(client: Client) -> None:
    assert client.ask("/Service_MoraiVehicleSpec", unique_id=0)
    assert client.send("set_level", level="error").startswith("set_level:")
    client.publish("/chatter", {"data": "x"}, "std_msgs/String")
    client.confirm()
    client.publish("/chatter", {"dat": "x"})
    with pytest.raises(OpRefusedError, match="did you mean data"):
        client.confirm()
    assert client.call("/rosapi/topic_type", {"topic": "/chatter"}) == {"type": "std_msgs/String"}
    assert [status.level for status in client.statuses] == ["error"]
    with pytest.raises(AnswerTimeoutError):
        client.wait_for("/chatter", timeout=0.01)
    assert client.is_connected


def test_loop_over_messages_ends_with_the_subscription(client: Client) -> None:
    client.start_sync()
    egos = client.subscribe("/Ego_topic")
    client.tick(2)
    seen = []
    for ego in egos:
        seen.append(ego["header"]["seq"])
        if len(seen) == 2:
            egos.close()
    assert seen == [1, 2]


def test_several_threads_share_a_client(client: Client) -> None:
    client.start_sync()
    with ThreadPoolExecutor(4) as pool:
        frames = list(pool.map(lambda _: client.tick(5).frame, range(8)))
    assert sorted(frames) == [5 * i for i in range(1, 9)]


def test_close_in_another_thread_ends_a_wait(client: Client) -> None:
    client.start_sync()
    egos = client.subscribe("/Ego_topic")
    with ThreadPoolExecutor(1) as pool:
        waiting = pool.submit(next, egos)
        client.confirm()
        client.close()
        with pytest.raises(ConnectionLostError, match="closed"):
            waiting.result(PATIENCE)
    with pytest.raises(ConnectionLostError, match="closed"):
        client.tick()
    egos.close()
    client.close()
    with pytest.raises(ClientError, match="make another one"):
        client.open()


def test_server_that_goes_is_told(sim: Simulator, client: Client) -> None:
    sim.close()
    with pytest.raises(ConnectionLostError, match=r"closed the connection \(1001\)"):
        client.wait_for("/Ego_topic")
    assert not client.is_connected


def test_predicate_that_calls_the_client_is_refused_and_does_not_hang(client: Client) -> None:
    with pytest.raises(RuntimeError, match="would wait for itself"):
        client.wait_for("/SyncModeInfo", lambda _: client.tick())
    client.confirm()


def test_connection_that_cannot_be_leaves_no_thread() -> None:
    before = {*threading.enumerate()}
    client = Client("ftp://x")
    with pytest.raises(ConnectError):
        client.open()
    assert not {*threading.enumerate()} - before
    with pytest.raises(ConnectionLostError, match="closed"):
        client.confirm()
    with pytest.raises(ConnectionLostError, match="not connected yet"):
        Client("ws://127.0.0.1:9").confirm()
    assert repr(client) == "<Client ftp://x not connected>"


def test_closed_client_leaves_no_thread(sim: Simulator) -> None:
    before = {*threading.enumerate()}
    with Client(sim.url):
        assert len({*threading.enumerate()} - before) == 1
    assert not {*threading.enumerate()} - before
