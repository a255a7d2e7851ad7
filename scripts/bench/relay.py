"""Lower bound of a Python rosbridge relay, with the same WebSocket and JSON libraries as ours.

Each frame is parsed once by orjson, for its op and its topic. Its bytes are forwarded unchanged by the `websockets`
library's own `broadcast`. There are no types, no checks, no defaults and no limits. Calls get a new id, because two
callers may use the same one. `echo` answers with a frame of the requested size; `wire.py` compares it with a tick.

    ./.venv/bin/python scripts/bench/relay.py [--port N]
"""

from __future__ import annotations

import argparse
from typing import Any

import orjson
import uvloop
from websockets.asyncio.server import ServerConnection, broadcast, serve
from websockets.exceptions import ConnectionClosed


class Relay:
    """Subscribers of topics, providers of services, and callers that wait for answers."""

    def __init__(self) -> None:
        self.listeners: dict[str, dict[ServerConnection, None]] = {}
        self.providers: dict[str, ServerConnection] = {}
        self.calls: dict[str, tuple[ServerConnection, Any]] = {}
        self.num_calls = 0

    async def serve(self, socket: ServerConnection) -> None:
        """Read the frames of one client until it leaves.

        Args:
            socket: of the client.
        """
        try:
            while True:
                self.carry(socket, await socket.recv(decode=False))
        except ConnectionClosed:
            pass
        finally:
            for sockets in self.listeners.values():
                sockets.pop(socket, None)
            self.providers = {name: s for name, s in self.providers.items() if s is not socket}

    def carry(self, socket: ServerConnection, frame: bytes) -> None:
        """Carry out one frame.

        Args:
            socket: of its client.
            frame: JSON text.
        """
        op: dict[str, Any] = orjson.loads(frame)
        kind = op["op"]
        if kind == "publish":
            sockets = self.listeners.get(op["topic"])
            if sockets:
                broadcast(sockets, frame, text=True)
        elif kind == "call_service":
            self.num_calls += 1
            call_id = str(self.num_calls)
            self.calls[call_id] = (socket, op.get("id"))
            op["id"] = call_id
            broadcast((self.providers[op["service"]],), orjson.dumps(op), text=True)
        elif kind == "service_response":
            caller, op["id"] = self.calls.pop(op["id"])
            broadcast((caller,), orjson.dumps(op), text=True)
        elif kind == "echo":
            broadcast((socket,), b" " * op["size"], text=True)
        elif kind == "subscribe":
            self.listeners.setdefault(op["topic"], {})[socket] = None
        elif kind == "advertise_service":
            self.providers[op["service"]] = socket


async def _run(port: int) -> None:
    async with serve(Relay().serve, "127.0.0.1", port, compression=None, max_size=16 * 2**20) as server:
        real_port = next(iter(server.sockets)).getsockname()[1]
        print(f"relay listening on ws://127.0.0.1:{real_port}", flush=True)
        await server.serve_forever()


def main() -> None:
    """Run until killed."""
    parser = argparse.ArgumentParser(description="The relay floor of wire.py")
    parser.add_argument("--port", type=int, default=0)
    uvloop.run(_run(parser.parse_args().port))


if __name__ == "__main__":
    main()
