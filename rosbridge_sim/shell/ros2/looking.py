"""A short visit to a domain of ROS 2, to see which nodes and endpoints are there, for `rosbridge-sim ros2 check`."""

from __future__ import annotations

import re
import socket
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

from rosbridge_sim.graph.gateway.quality import Quality
from rosbridge_sim.graph.ros2.discovery_info import DISCOVERY_TOPIC, Distro, discovery_type, node_names
from rosbridge_sim.graph.ros2.network_check import Discovery, SeenEndpoint, SeenGraph
from rosbridge_sim.graph.ros2.ros2_names import dds_topic, guid_text, topic_of
from rosbridge_sim.records import replace
from rosbridge_sim.shell.ros2.dds_library import DdsDomain, DdsEndpoint, DdsReader, DdsTypes, check_library
from rosbridge_sim.shell.ros2.ros2_node import NAME_PATIENCE, NAMES, NODE_NAME, SOLE, config_of

SETTLING: Final = 1.0
"""Least time for all endpoints to be known after the server was found [s]."""

PAUSE: Final = 0.05
"""Time between two looks [s]."""

MAX_ENDPOINTS: Final = 20_000
"""Most endpoints that are remembered, and most frames."""

MAX_NAME: Final = 300
"""Longest name of a frame that is told in full [characters]."""

TF: Final = "tf2_msgs/msg/TFMessage"

MAX_MESSAGE: Final = 2**20
"""Longest message about nodes that is taken [bytes]."""

_BASE_PORT, _PORTS_OF_DOMAIN, _PORTS_OF_UNICAST = 7400, 250, range(10, 130)
"""Ports of DDS: 7400 + 250 * domain + 10 and more for unicast. Source: DDSI-RTPS 2.3, 9.6.1.1."""

_HASH: Final = re.compile(rb"typehash=([^;]*);")


def look_at_domain(domain: int, distro: Distro, patience: float) -> SeenGraph:
    """Return what is seen in a domain: first on loopback, then, if no server is there, in the network.

    Args:
        patience: longest wait for a server, in each of the two places [s].

    Raises:
        DocumentError: the DDS library is missing or refuses the domain.
    """
    check_library()
    why_not = _why_no_loopback()
    others = [one for one in _domains_here() if one != domain]
    places: list[Discovery] = ["multicast"] if why_not else ["localhost", "multicast"]
    for place in places:
        seen = _Visit(domain, place, distro).look(patience)
        if seen.server:
            return replace(seen, other_domains=others, why_no_loopback=why_not)
    return SeenGraph(domain, None, "", [], others, why_not)


class _Visit:
    """A participant of `ros2 check` in a domain, for some seconds."""

    def __init__(self, domain: int, place: Discovery, distro: Distro) -> None:
        self._where = domain, place
        self._distro = distro
        self._opened = DdsDomain(domain, config_of(place, MAX_MESSAGE), b"enclave=/;", is_local=place == "localhost")
        self._types = DdsTypes()
        self._names: dict[bytes, str] = {}
        self._found: dict[bytes, tuple[DdsEndpoint, bool]] = {}
        self._frames: dict[tuple[str, bytes], None] = {}
        self._tf_readers: list[DdsReader] = []
        self._read_frames: Callable[[bytes], Any]  # a struct that rosbags has made

    def look(self, patience: float) -> SeenGraph:
        """Leave the domain, and return all findings; empty if no server was found."""
        opened = self._opened
        try:
            data_type = self._types.make(*discovery_type(self._distro))
            info = opened.open_reader(DISCOVERY_TOPIC, data_type, NAMES, b"", _do_nothing)
            takers = opened.watch(_do_nothing)
            server, settled, until = "", 0.0, time.monotonic() + patience
            while time.monotonic() < until:
                while (raw := info.take()) is not None:
                    self._names.update(node_names(self._distro, raw))
                for take, is_writer in zip(takers, (True, False), strict=True):
                    while (one := take()) is not None and len(self._found) < MAX_ENDPOINTS:
                        if one.is_alive and one.participant != opened.key:
                            self._found[one.key] = one, is_writer
                self._take_frames()
                if not server:
                    server = next((name for name in self._names.values() if name.endswith(f"/{NODE_NAME}")), "")
                    if server:
                        self._follow_frames(server.rpartition("/")[0])
                        until = time.monotonic() + NAME_PATIENCE
                        settled = time.monotonic() + SETTLING
                elif time.monotonic() > settled and all(key in self._names for key in self._found):
                    break
                time.sleep(PAUSE)
        finally:
            opened.close()
        return self._seen(server)

    def _follow_frames(self, namespace: str) -> None:
        """Subscribe to the frames of a server. Transforms that `/tf` had before are not seen."""
        from rosbags.typesys import Stores, get_typestore  # noqa: PLC0415 - a tenth of a second, if a server is there

        store = get_typestore(Stores.ROS2_JAZZY)
        data_type = self._types.make(TF, {name: fields for name, (_, fields) in store.fielddefs.items()})
        self._read_frames = lambda raw: store.deserialize_cdr(raw, TF)
        for topic, is_latched in (("/tf", False), ("/tf_static", True)):
            quality = Quality(is_reliable=is_latched, is_latched=is_latched, depth=1_000)
            name = dds_topic(topic, namespace)
            self._tf_readers.append(self._opened.open_reader(name, data_type, quality, b"", _do_nothing))

    def _take_frames(self) -> None:
        for reader in self._tf_readers:
            while (taken := reader.take_from()) is not None and len(self._frames) < MAX_ENDPOINTS:
                try:
                    transforms = self._read_frames(taken[0]).transforms if taken[0] else ()
                except Exception:  # noqa: BLE001, S112 - a library reads foreign bytes: any error means that they are broken
                    continue
                self._frames.update({(one.child_frame_id[:MAX_NAME], taken[1]): None for one in transforms})

    def _seen(self, server: str) -> SeenGraph:
        seen = {
            key: self._endpoint(one, is_writer=is_writer)
            for key, (one, is_writer) in self._found.items()
            if topic_of(one.topic)
        }
        frames = [(name, seen[key]) for name, key in self._frames if key in seen]
        domain, place = self._where
        return SeenGraph(domain, place, server, list(seen.values()), (), "", frames)

    def _endpoint(self, one: DdsEndpoint, *, is_writer: bool) -> SeenEndpoint:
        matched = _HASH.search(one.user_data)
        type_hash = matched[1].decode("ascii", "replace") if matched else ""
        return SeenEndpoint(
            topic_of(one.topic) or "",
            one.type[:300],
            is_writer,
            one.quality,
            type_hash,
            self._names.get(one.key, ""),
            guid_text(one.participant),
            SOLE in one.user_data,
        )


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
