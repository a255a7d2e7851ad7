"""Programs of released client libraries connect by many names and ports of the server.

Python's `websocket-client` sends an Origin as a page does, equal to the Host; the others send none. The port that a
client calls differs from the server's where a Docker container publishes it or an SSH tunnel forwards it.
"""

from __future__ import annotations

import asyncio
import json
import socket
from typing import Any

import pytest
import websocket

from tests.broken_proxy import BrokenProxy
from tests.conftest import Serve
from tests.end_to_end.programs import LIBRARIES, finish, start
from tests.support import PATIENCE, ServerProcess

pytestmark = [pytest.mark.client, pytest.mark.slow]


def ask_time(url: str, port: int, **options: Any) -> bool:  # noqa: ANN401 - the library's own
    """Connect with websocket-client and call a service; the host of the URL is not looked up."""
    line = socket.create_connection(("127.0.0.1", port), PATIENCE)
    client = websocket.create_connection(url, PATIENCE, socket=line, **options)
    client.send(json.dumps({"op": "call_service", "service": "/rosapi/get_time", "id": "t"}))
    answer = json.loads(client.recv())
    client.close()
    return answer["result"] is True


def refusal(url: str, port: int) -> str:
    """What websocket-client is told."""
    with pytest.raises(websocket.WebSocketBadStatusException) as caught:
        ask_time(url, port)
    assert caught.value.status_code == 403
    assert caught.value.resp_body is not None
    return caught.value.resp_body.decode()


@pytest.mark.parametrize("listening", ["127.0.0.1", "0.0.0.0"])  # noqa: S104 - as in a container
def test_websocket_client_connects_by_address_and_localhost(serve: Serve, listening: str) -> None:
    port = serve("--no-world", "--host", listening).port
    for host in ("127.0.0.1", "localhost", "192.168.1.5", "[::1]", "sim.localhost"):
        assert ask_time(f"ws://{host}:{port}", port)
        assert ask_time(f"ws://{host}:19090", port), "a published port, or a tunnel"
        assert ask_time(f"ws://{host}", port)


@pytest.mark.parametrize("listening", ["127.0.0.1", "0.0.0.0"])  # noqa: S104 - as in a container
def test_websocket_client_calls_a_service_of_docker_compose_with_the_flag(serve: Serve, listening: str) -> None:
    port = serve("--no-world", "--host", listening).port
    assert "--allow-host sim would let them" in refusal("ws://sim:9090", port)
    assert ask_time("ws://sim:9090", port, suppress_origin=True)
    assert ask_time("ws://sim:9090", port, origin="http://localhost:9090", host="localhost:9090")
    port = serve("--no-world", "--host", listening, "--allow-host", "sim").port
    assert ask_time("ws://sim:9090", port)
    port = serve("--no-world", "--host", listening, env={"ROSBRIDGE_SIM_TOKEN": "sesame"}).port
    assert ask_time("ws://sim:9090/?token=sesame", port)


def test_origin_star_lets_every_page_connect(serve: Serve) -> None:
    port = serve("--no-world", "--allow-origin", "*").port
    for origin in ("https://website.example", "null", "http://sim:9090"):
        assert ask_time("ws://sim:9090", port, origin=origin)


@pytest.mark.parametrize("library", LIBRARIES)
async def test_client_connects_through_another_port(server: ServerProcess, library: str) -> None:
    async with BrokenProxy(server.port) as proxy:
        seen = await asyncio.to_thread(lambda: finish(start(library, "basics", proxy.port, "remember", "/tunnel")))
    assert seen["is_listed"]
