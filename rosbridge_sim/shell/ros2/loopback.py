"""The sockets of the DDS library, kept to loopback.

The library binds the two sockets of a participant to all addresses, whatever interface it is told. The system is asked
here to give them packets of loopback alone, and answers others as if no program listened.
"""

from __future__ import annotations

import logging
import socket
from collections.abc import Iterator
from pathlib import Path
from typing import Final

_log = logging.getLogger("rosbridge_sim.ros2")

LOOPBACK: Final = "lo"
"""Name of the interface on Linux, as in the configuration of the library."""

_BASE_PORT, _PORTS_OF_DOMAIN = 7400, 250  # DDSI-RTPS 2.3, 9.6.1.1


def close_to_network(domain: int) -> None:
    """Let this process receive only packets of loopback in a domain; log a warning if the system refuses.

    Args:
        domain: one that the library has opened in this process.
    """
    option = getattr(socket, "SO_BINDTODEVICE", None)
    if option is None:  # another system than Linux
        return
    for one in _sockets_of(domain):
        try:
            one.setsockopt(socket.SOL_SOCKET, option, LOOPBACK.encode() + b"\0")
        except OSError as error:
            _log.warning(
                "port %d of ROS 2 can be reached from other machines (%s): Linux 5.7, or the right CAP_NET_RAW, is"
                " needed to close it; close the port in a firewall",
                one.getsockname()[1],
                error.strerror,
            )


def _sockets_of(domain: int) -> Iterator[socket.socket]:
    """Yield each UDP socket of this process that is bound to all addresses and to a port of a domain."""
    ports = range(_BASE_PORT + _PORTS_OF_DOMAIN * domain, _BASE_PORT + _PORTS_OF_DOMAIN * (domain + 1))
    for descriptor in list(Path("/proc/self/fd").iterdir()):
        try:
            one = socket.socket(fileno=int(descriptor.name))
        except OSError:  # it is no socket, or is closed by now
            continue
        try:
            if (one.family, one.type) == (socket.AF_INET, socket.SOCK_DGRAM):
                address, port = one.getsockname()
                if address == "0.0.0.0" and port in ports:  # noqa: S104 - it is looked for
                    yield one
        finally:
            one.detach()  # it is the library's
