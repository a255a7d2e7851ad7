"""`node list` and `info`: the nodes that rosapi lists, with their topics and services."""

from __future__ import annotations

from rosbridge_sim.cli.tools.text import put, put_json, put_names
from rosbridge_sim.cli.tools.tool_client import Bridge, absolute, words
from rosbridge_sim.cli.tools.topic import types_of_topics
from rosbridge_sim.link.bridge_errors import RefusedError
from rosbridge_sim.link.terminal_text import safe
from rosbridge_sim.suggestions import hint


async def list_nodes(bridge: Bridge, *, is_count: bool, is_json: bool) -> None:
    """Print all nodes.

    Raises:
        RefusedError: rosapi refuses, or does not exist.
        BridgeError: there is no answer.
    """
    names = sorted(words(await bridge.ask("nodes"), "nodes"))
    put_names(names, is_count=is_count, is_json=is_json)


async def show_node(bridge: Bridge, name: str, *, is_json: bool) -> None:
    """Print the topics and services of a node with their types, in the form of `ros2 node info`.

    Raises:
        RefusedError: there is no such node, or no rosapi.
        BridgeError: there is no answer.
    """
    node = absolute(name)
    nodes = words(await bridge.ask("nodes"), "nodes")
    if node not in nodes:
        raise RefusedError(f"no node {safe(node)} here{hint(node, nodes)}")
    details = await bridge.ask("node_details", node=node)
    topics = await types_of_topics(bridge)
    services = sorted(words(details, "services"))
    answers = await bridge.ask_all([("service_type", {"service": one}) for one in services])
    kinds = [one.word("type") or "?" for one in answers]
    parts = {
        "Subscribers": {one: topics.get(one, "?") for one in sorted(words(details, "subscribing"))},
        "Publishers": {one: topics.get(one, "?") for one in sorted(words(details, "publishing"))},
        "Service Servers": dict(zip(services, kinds, strict=True)),
    }
    if is_json:
        put_json({"node": node, **{title.lower().replace(" ", "_"): part for title, part in parts.items()}})
        return
    put(safe(node))
    for title, part in parts.items():
        put(f"  {title}:")
        for one, kind in part.items():
            put(f"    {safe(one)}: {safe(kind)}")
