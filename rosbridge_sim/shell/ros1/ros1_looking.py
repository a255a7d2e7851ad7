"""A short visit to a master of ROS 1, for `rosbridge-sim ros1 check`."""

from __future__ import annotations

import asyncio
import socket
from collections.abc import Mapping
from functools import partial
from typing import Final

from rosbridge_sim.errors import DocumentError, GraphError
from rosbridge_sim.graph.ros1.master_check import SeenMaster
from rosbridge_sim.graph.ros1.master_view import read_view
from rosbridge_sim.records import replace
from rosbridge_sim.shell.ros1.ros1_joining import master_of, named_host
from rosbridge_sim.shell.ros1.xmlrpc_http import addresses, call

CALLER: Final = "/rosbridge_sim_check"


def look_at_master(master: str, server: str, environment: Mapping[str, str]) -> SeenMaster:
    """Return what is seen of a graph.

    Args:
        master: URI of the master, or `env` for that of the variables.
        server: name of the server's node.
        environment: variables of the terminal.
    """
    return asyncio.run(_look(master, server, environment))


async def _look(master: str, server: str, environment: Mapping[str, str]) -> SeenMaster:
    try:
        uri = master_of(master, environment)
        ask = partial(call, uri, is_master=True)
        state, types = await ask("getSystemState", CALLER), await ask("getTopicTypes", CALLER)
        seen = SeenMaster(uri, view=read_view(state, types), server=server)
    except (DocumentError, GraphError) as error:
        return SeenMaster("", why_no_master=str(error))
    seen = replace(seen, why_no_name=await _why_no_name(environment), uses_sim_time=await _uses_sim_time(uri))
    try:
        seen = replace(seen, server_uri=str(await call(uri, "lookupNode", CALLER, server)))
        topics = [
            *await call(seen.server_uri, "getPublications", CALLER),
            *await call(seen.server_uri, "getSubscriptions", CALLER),
        ]
        return replace(seen, topics={str(name): str(type_name) for name, type_name in topics})
    except GraphError as error:
        return replace(seen, why_no_server=str(error))


async def _uses_sim_time(uri: str) -> bool:
    try:
        return (await call(uri, "getParam", CALLER, "/use_sim_time")) is True
    except GraphError:
        return False  # it is not set


async def _why_no_name(environment: Mapping[str, str]) -> str:
    """Return why nodes of the terminal cannot be reached by the name that they give to others; empty if they can."""
    variable, name = named_host(environment) or ("the name of this machine", socket.gethostname())
    try:
        await addresses(name)
    except (OSError, UnicodeError) as error:
        return f"{variable} is {name}, which cannot be found, so no one can connect to your nodes: {error}"
    return ""
