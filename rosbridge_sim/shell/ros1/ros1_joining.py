"""The node of ROS 1, made from the settings, and the addresses that it has."""

from __future__ import annotations

import ipaddress
import logging
import os
import re
import socket
from collections.abc import Mapping
from pathlib import Path
from typing import Final

from rosbridge_sim.errors import DocumentError, GraphError, PeerError
from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.policy import Policy, Rule
from rosbridge_sim.graph.ros1.ros1_types import Ros1Types
from rosbridge_sim.graph.stamps import Stamps
from rosbridge_sim.morai.releases import LENIENCY
from rosbridge_sim.protocol.client_memory import Account
from rosbridge_sim.schema.store import Store
from rosbridge_sim.shell.clocks.scheduler import Scheduler
from rosbridge_sim.shell.config.settings import Settings
from rosbridge_sim.shell.files.bounded_read import read_bounded
from rosbridge_sim.shell.files.definitions import MAX_DEFINITION_SIZE, Texts
from rosbridge_sim.shell.ros1.ros1_choices import Ros1Choices
from rosbridge_sim.shell.ros1.ros1_node import Ros1Node
from rosbridge_sim.shell.ros1.xmlrpc_http import address_of, addresses, call
from rosbridge_sim.shell.websocket.dns import is_own

_log = logging.getLogger("rosbridge_sim.ros1")

MAX_INCOMPLETE: Final = 128 * 2**20
"""Memory for messages and requests of all nodes that have not come whole yet [bytes]; a large cloud has ten million."""

MASTER_VARIABLE: Final = "ROS_MASTER_URI"

_TYPE_NAME: Final = re.compile(r"\w+/\w+", re.ASCII)


async def join_ros1(
    settings: Settings, bus: Bus, policy: Policy, texts: Texts, scheduler: Scheduler, *, stamps: Stamps | None
) -> Ros1Node:
    """Return the node of the settings, which `start` registers.

    Args:
        settings: all settings; `ros1_master` is set.
        policy: rights of all clients.
        scheduler: calls the gateway.
        stamps: get the clock of the nodes; None without a world.

    Raises:
        DocumentError: master, host or name cannot be used.
    """
    choices = await choose(settings, os.environ)
    store = bus.store if bus.store.ros == 1 else Store(texts, leniency=LENIENCY, ros=1)
    types = Ros1Types(bus.store, store, lambda name: find_service_text(name, os.environ))
    node = Ros1Node(choices, bus, types, policy, topics=Rule(settings.ros1_topics), stamps=stamps)
    node.gateway.on_change = scheduler.look
    scheduler.add(node.gateway)
    _log.info("node %s of ROS 1 at the master %s", choices.name, choices.master)
    return node


async def choose(settings: Settings, environment: Mapping[str, str]) -> Ros1Choices:
    """Return the choices for the node.

    Args:
        settings: all settings; `ros1_master` is set.

    Raises:
        DocumentError: master, host or name cannot be used.
    """
    master = master_of(settings.ros1_master or "", environment)
    host = settings.ros1_host
    master_host, port = address_of(master)
    found = await _resolve("ros1-master", master_host)
    is_loopback = is_local(host)
    if is_loopback and not any(map(is_own, found)):
        raise DocumentError(
            f"ros1-master: {master} is on another machine, whose nodes cannot reach this one on {host}; give the"
            " address of this machine in its network: --ros1-host 192.168.0.5"
        )
    name = f"{settings.ros1_namespace}{settings.ros1_name}"
    shown = await _shown_host(host, (found[0], port), environment, is_loopback=is_loopback)
    try:
        await call(str(await call(master, "lookupNode", name, name)), "getPid", name)
    except GraphError:
        pass  # there is none of this name, or it has died
    else:
        raise DocumentError(f"ros1-name: the node {name} is on the graph of {master} already; use --ros1-name")
    room = Account(max(MAX_INCOMPLETE, settings.max_frame_size))
    return Ros1Choices(master, name, settings.ros1_namespace, host, shown, settings.max_frame_size, room)


def master_of(choice: str, environment: Mapping[str, str]) -> str:
    """Return the URI of the master.

    Args:
        choice: it, or `env` for that of the variable.

    Raises:
        DocumentError: there is none.
    """
    where, uri = ("ros1-master", choice) if choice != "env" else (MASTER_VARIABLE, environment.get(MASTER_VARIABLE, ""))
    try:
        address_of(uri)
    except GraphError as error:
        raise DocumentError(f"{where}: {error}, such as http://localhost:11311") from None
    return uri


def is_local(host: str) -> bool:
    """Return True if a host is a loopback address."""
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


async def _resolve(where: str, host: str) -> list[str]:
    try:
        return await addresses(host)
    except (OSError, UnicodeError) as error:
        raise DocumentError(f"{where}: the host {host} cannot be found: {error}") from None


def named_host(environment: Mapping[str, str]) -> tuple[str, str] | None:
    """Return the variable that names the host of nodes in a terminal, and its value; None if none does."""
    named = ((variable, environment.get(variable, "").strip()) for variable in ("ROS_HOSTNAME", "ROS_IP"))
    return next((one for one in named if one[1]), None)


async def _shown_host(host: str, master: tuple[str, int], environment: Mapping[str, str], *, is_loopback: bool) -> str:
    """Return the host in the addresses that other nodes get: that of the variables, or the one that the master sees."""
    named = named_host(environment)
    if named is not None:
        if not is_loopback or all(map(is_local, await _resolve(*named))):
            return named[1]
        _log.warning(
            "%s is %s, and this node listens on loopback alone, so nodes are told %s; give --ros1-host to be"
            " reached from other machines",
            *(*named, host),
        )
    if not ipaddress.ip_address((await _resolve("ros1-host", host))[0]).is_unspecified:
        return host
    with socket.socket(socket.AF_INET6 if ":" in master[0] else socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect(master)  # sends nothing: it finds the address from which the master would be reached
            return str(probe.getsockname()[0])
        except OSError:
            return socket.gethostname()


def find_service_text(name: str, environment: Mapping[str, str]) -> str | None:
    """Return the definition of a service that an installation of ROS has; None if none has it.

    Args:
        name: `pkg/Type`.
        environment: variables of the process: ROS_PACKAGE_PATH names the folders.
    """
    if not _TYPE_NAME.fullmatch(name):
        return None
    package, _, short = name.partition("/")
    for folder in environment.get("ROS_PACKAGE_PATH", "").split(os.pathsep):
        path = Path(folder, package, "srv", f"{short}.srv")
        if folder and path.is_file():
            try:
                return read_bounded(path, MAX_DEFINITION_SIZE).decode()
            except (OSError, UnicodeDecodeError, DocumentError, PeerError) as error:
                _log.warning("%s cannot be used: %s", path, error)
    return None
