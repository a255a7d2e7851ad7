"""A short visit to a domain of ROS 2, to see which nodes and endpoints are there, for `rosbridge-sim ros2 check`."""

from __future__ import annotations

import re
import socket
import time
from pathlib import Path
from typing import Final

from rosbridge_sim.graph.ros2.discovery_info import DISCOVERY_TOPIC, Distro, discovery_type, node_names
from rosbridge_sim.graph.ros2.network_check import Discovery, SeenEndpoint, SeenGraph
from rosbridge_sim.graph.ros2.ros2_names import topic_of
from rosbridge_sim.shell.ros2.dds_library import DdsDomain, DdsEndpoint, DdsTypes, check_library
from rosbridge_sim.shell.ros2.ros2_node import NAME_PATIENCE, NAMES, NODE_NAME, config_of

__all__ = ["look_at_domain"]

SETTLING: Final = 1.0
"""Least time for all endpoints to be known after the server was found [s]."""

PAUSE: Final = 0.05
"""Time between two looks [s]."""

MAX_ENDPOINTS: Final = 20_000
"""Most endpoints that are remembered."""

MAX_MESSAGE: Final = 2**20
"""Longest message about nodes that is taken [bytes]."""

_BASE_PORT, _PORTS_OF_DOMAIN, _PORTS_OF_UNICAST = 7400, 250, range(10, 130)
"""Ports of DDS: 7400 + 250 * domain + 10 and more for unicast. Source: DDSI-RTPS 2.3, 9.6.1.1."""

_HASH: Final = re.compile(rb"typehash=([^;]*);")


def look_at_domain(domain: int, distro: Distro, patience: float) -> SeenGraph:
    """Return what is seen in a domain: first on loopback, then, if no server is there, in the network.

    Args:
        distro: distribution of the nodes.
        patience: longest wait for a server, in each of the two places [s].

    Raises:
        DocumentError: the DDS library is missing or refuses the domain.
    """
    check_library()
    why_not = _why_no_loopback()
    others = [one for one in _domains_here() if one != domain]
    places: list[Discovery] = ["multicast"] if why_not else ["localhost", "multicast"]
    for place in places:
        server, endpoints = _look(domain, place, distro, patience)
        if server:
            return SeenGraph(domain, place, server, endpoints, others, why_not)
    return SeenGraph(domain, None, "", [], others, why_not)


def _look(domain: int, place: Discovery, distro: Distro, patience: float) -> tuple[str, list[SeenEndpoint]]:
    """Return the full name of the server's node, and all endpoints; an empty name if it was not found."""
    opened = DdsDomain(domain, config_of(place, MAX_MESSAGE), b"enclave=/;", is_local=place == "localhost")
    try:
        data_type = DdsTypes().make(*discovery_type(distro))
        info = opened.open_reader(DISCOVERY_TOPIC, data_type, NAMES, b"", _do_nothing)
        takers = opened.watch(_do_nothing)
        names: dict[bytes, str] = {}
        found: dict[bytes, tuple[DdsEndpoint, bool]] = {}
        server, settled, until = "", 0.0, time.monotonic() + patience
        while time.monotonic() < until:
            while (raw := info.take()) is not None:
                names.update(node_names(distro, raw))
            for take, is_writer in zip(takers, (True, False), strict=True):
                while (one := take()) is not None and len(found) < MAX_ENDPOINTS:
                    if one.is_alive and one.participant != opened.key:
                        found[one.key] = one, is_writer
            if not server:
                server = next((name for name in names.values() if name.rpartition("/")[2] == NODE_NAME), "")
                if server:
                    until = time.monotonic() + NAME_PATIENCE
                    settled = time.monotonic() + SETTLING
            elif time.monotonic() > settled and all(key in names for key in found):
                break
            time.sleep(PAUSE)
    finally:
        opened.close()
    return server, [
        _endpoint(one, names, is_writer=is_writer) for one, is_writer in found.values() if topic_of(one.topic)
    ]


def _endpoint(one: DdsEndpoint, names: dict[bytes, str], *, is_writer: bool) -> SeenEndpoint:
    matched = _HASH.search(one.user_data)
    type_hash = matched[1].decode("ascii", "replace") if matched else ""
    node = names.get(one.key, f"program {one.participant.hex()[:12]}")
    return SeenEndpoint(topic_of(one.topic) or "", one.type[:300], is_writer, one.quality, type_hash, node)


def _why_no_loopback() -> str:
    """Return why programs of this machine cannot reach each other by loopback; empty if they can."""
    try:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one:
            one.settimeout(1.0)
            one.bind(("127.0.0.1", 0))
            one.sendto(b"x", one.getsockname())
            one.recv(1)
    except OSError as error:
        return str(error)
    return ""


def _domains_here() -> list[int]:
    """Return the domains with programs on this machine, from the ports that are in use; Linux alone tells them."""
    try:
        lines = Path("/proc/net/udp").read_text("ascii").splitlines()[1:]
    except OSError:
        return []
    ports = {int(line.split()[1].partition(":")[2], 16) for line in lines}
    found = {divmod(port - _BASE_PORT, _PORTS_OF_DOMAIN) for port in ports if port >= _BASE_PORT}
    return sorted({domain for domain, rest in found if rest in _PORTS_OF_UNICAST and domain <= 232})  # noqa: PLR2004 - the last one


def _do_nothing() -> None:
    """Do nothing: the loop above looks by itself."""
