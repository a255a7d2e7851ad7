"""Host lookup: addresses or an error, without waiting for a silent name server."""

from __future__ import annotations

import asyncio
import socket
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from rosbridge_sim.link.client_connection import why_not
from rosbridge_sim.shell.websocket.dns import MAX_THREADS, HostLookup
from tests.support import PATIENCE, Process

PLACE = (socket.AF_INET, socket.SOCK_STREAM, 6, "", ("192.0.2.7", 0))


class NameServer:
    """What the system asks: it answers when it may."""

    def __init__(self) -> None:
        self.may_answer = threading.Event()
        self.num_asked = 0

    def __call__(self, *_: object, **__: object) -> list[object]:
        self.num_asked += 1
        assert self.may_answer.wait(PATIENCE)
        return [PLACE, PLACE]


@pytest.fixture
def name_server(monkeypatch: pytest.MonkeyPatch) -> Iterator[NameServer]:
    server = NameServer()
    monkeypatch.setattr(socket, "getaddrinfo", server)
    yield server
    server.may_answer.set()


@pytest.mark.parametrize("address", ["127.0.0.1", "::1", "fe80::1%2"])
async def test_ip_address_is_not_looked_up(address: str, name_server: NameServer) -> None:
    assert await HostLookup(address).addresses(PATIENCE) == [address]
    assert name_server.num_asked == 0


@pytest.mark.parametrize("name", ["localhost", "127.1"])
async def test_host_name_is_looked_up(name: str) -> None:
    assert "127.0.0.1" in await HostLookup(name).addresses(PATIENCE)


async def test_names_beyond_a_number_are_not_looked_up_at_once(name_server: NameServer) -> None:
    asked = [asyncio.ensure_future(HostLookup(f"robot{i}").addresses(PATIENCE)) for i in range(MAX_THREADS)]
    await asyncio.sleep(0)
    with pytest.raises(socket.gaierror, match="too many host names are looked up at once"):
        await HostLookup("robot").addresses(PATIENCE)
    name_server.may_answer.set()
    await asyncio.gather(*asked)
    for thread in threading.enumerate():
        if thread.name.startswith("lookup of"):
            thread.join(PATIENCE)
    assert await HostLookup("robot").addresses(PATIENCE) == ["192.0.2.7"]


async def test_concurrent_lookups_share_one_answer(name_server: NameServer) -> None:
    lookup = HostLookup("robot")
    asked = [asyncio.ensure_future(lookup.addresses(PATIENCE)) for _ in range(3)]
    await asyncio.sleep(0)
    name_server.may_answer.set()
    assert await asyncio.gather(*asked) == [["192.0.2.7"]] * 3
    assert name_server.num_asked == 1
    await lookup.addresses(PATIENCE)
    assert name_server.num_asked == 2


@pytest.mark.parametrize("name", ["no-such-host.invalid", "a..b", "x" * 300])
async def test_unknown_host_is_an_error(name: str) -> None:
    with pytest.raises((socket.gaierror, UnicodeError)):
        await HostLookup(name).addresses(PATIENCE)


async def test_silent_name_server_times_out(name_server: NameServer) -> None:
    with pytest.raises(socket.gaierror) as caught:
        await HostLookup("robot").addresses(0.01)
    assert "no DNS server answers" in why_not("ws://robot", caught.value, 5.0, flag="attach", token="")
    assert name_server.num_asked == 1


FOR_EVER = """
import socket, sys, threading
ask = socket.getaddrinfo
socket.getaddrinfo = lambda host, *rest, **more: (
    threading.Event().wait() if host == "robot" else ask(host, *rest, **more)
)
from rosbridge_sim.__main__ import main
sys.exit(main())
"""


@pytest.mark.slow
def test_process_stops_during_a_lookup(tmp_path: Path) -> None:
    words = ("serve", "--port", "0", "--attach", "ws://robot:9090")
    process = Process(tmp_path / "log.txt", ["-c", FOR_EVER, *words], "rosbridge-sim listening on ")
    process.stop_cleanly()
