"""A server through rclpy on a machine with two interfaces: the packets that leave by the second one, as JSON.

Run in a new network namespace, with the Python that has rclpy.
"""

from __future__ import annotations

import asyncio
import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Final, Literal

DOMAIN = 7
OTHER = "10.99.0.1"

CHOICES: Final[tuple[tuple[Literal["localhost", "multicast"], str], ...]] = (
    ("localhost", "LOCALHOST"),
    ("multicast", "SUBNET"),
)
"""Of the server, and ROS_AUTOMATIC_DISCOVERY_RANGE of the nodes."""

SEEK = """
import sys, time, rclpy
rclpy.init(domain_id=7)
node = rclpy.create_node("seeker")
end = time.monotonic() + 120.0
while "rosbridge_sim" not in node.get_node_names():
    assert time.monotonic() < end
    time.sleep(0.05)
"""
"""A node that ends when it sees that of the server."""


def ip(*words: str) -> None:
    subprocess.run(["ip", *words], check=True)


def num_sent() -> int:
    (line,) = (one for one in Path("/proc/net/dev").read_text().splitlines() if one.strip().startswith("near:"))
    return int(line.split(":")[1].split()[9])


def make_interfaces() -> None:
    ip("link", "set", "lo", "up")
    ip("link", "add", "near", "type", "veth", "peer", "name", "far")
    for name in ("near", "far"):
        Path(f"/proc/sys/net/ipv6/conf/{name}/disable_ipv6").write_text("1")  # the system's own packets
        ip("link", "set", name, "up")
    ip("addr", "add", f"{OTHER}/24", "dev", "near")
    ip("route", "add", "default", "dev", "near")


async def main() -> None:
    """Serve with each choice until a node has seen the server."""
    from rosbridge_sim import Simulator  # noqa: PLC0415 - after the interfaces are there

    make_interfaces()
    os.environ["ROS_STATIC_PEERS"] = "10.99.0.2"  # of the nodes of this machine; not for the server
    sent = {}
    for discovery, range_ in CHOICES:
        before = num_sent()
        async with Simulator(port=0, world=False, ros2_domain=DOMAIN, ros2_through="rclpy", ros2_discovery=discovery):
            own = num_sent() - before
            env = os.environ | {"ROS_AUTOMATIC_DISCOVERY_RANGE": range_, "ROS_STATIC_PEERS": ""}
            seeker = await asyncio.create_subprocess_exec(sys.executable, "-c", SEEK, env=env)
            assert await seeker.wait() == 0
        sent[discovery] = [own, num_sent() - before]
    sys.stdout.write(json.dumps(sent))
    sys.stdout.flush()
    os._exit(0)  # without the threads of the libraries


if __name__ == "__main__":
    asyncio.run(main())
