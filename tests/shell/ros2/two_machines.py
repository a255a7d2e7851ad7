"""A server in a network namespace and a program in another one, with a cable between them.

It goes into a new namespace, starts a server that joins ROS 2, and prints as JSON what became of the packets of `far`.
"""

from __future__ import annotations

import asyncio
import ctypes
import json
import socket
import subprocess
import sys

DOMAIN = 7
PORTS = (9_160, 9_161)
"""Those of the first program of the domain on a machine: 7400 + 250 * 7 + 10, and the next."""

NEAR, FAR = "10.99.0.1", "10.99.0.2"
PATIENCE = 20.0

CLONE_NEWNET = 0x4000_0000
"""Source: unshare(2)."""


def ip(*words: str) -> None:
    subprocess.run(["ip", *words], check=True)


def put(line: str) -> None:
    sys.stdout.write(f"{line}\n")
    sys.stdout.flush()


def far() -> None:
    """Send a packet to each port that is named; print whether the other machine says that nobody listens."""
    put("ready")
    ports = json.loads(sys.stdin.readline())
    ip("addr", "add", f"{FAR}/24", "dev", "far")
    ip("link", "set", "far", "up")
    found = {}
    for port in ports:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one:
            one.connect((NEAR, port))
            one.settimeout(PATIENCE if port in PORTS else 0.0)
            one.send(b"RTPS")
            try:
                one.recv(100)
            except ConnectionRefusedError:
                found[port] = "refused"
            except (TimeoutError, BlockingIOError):
                found[port] = "taken"
    put(json.dumps(found))


async def near() -> None:
    """Serve between the start of the far program and its end."""
    from rosbridge_sim import Simulator  # noqa: PLC0415 - the other program needs none of it

    assert ctypes.CDLL(None).unshare(CLONE_NEWNET) == 0
    ip("link", "set", "lo", "up")
    words = ["unshare", "-n", sys.executable, __file__, "far"]
    other = subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)  # noqa: ASYNC220 - at once
    assert other.stdout is not None
    await asyncio.to_thread(other.stdout.readline)
    ip("link", "add", "near", "type", "veth", "peer", "name", "far", "netns", str(other.pid))
    ip("addr", "add", f"{NEAR}/24", "dev", "near")
    ip("link", "set", "near", "up")
    async with Simulator(port=0, ros2_domain=DOMAIN, ros2_topics=("/clock",)):
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as open_to_all:
            open_to_all.bind(("0.0.0.0", 0))  # noqa: S104 - in a network of its own
            open_to_all.settimeout(PATIENCE)
            port = open_to_all.getsockname()[1]
            out, _ = await asyncio.to_thread(other.communicate, json.dumps([*PORTS, port]) + "\n")
            found = json.loads(out) | {str(port): open_to_all.recv(100).decode()}
            put(json.dumps([found[str(one)] for one in (*PORTS, port)]))


if __name__ == "__main__":
    far() if sys.argv[1:] == ["far"] else asyncio.run(near())
