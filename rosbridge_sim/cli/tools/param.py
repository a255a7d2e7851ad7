"""`param ...`: the parameters that rosapi knows, named as in ROS 1 (`/ns/x`) or as in ROS 2 (`/node:x`).

Words are taken as `rosparam` takes them (`get /ns/x`) and as `ros2 param` does (`get /node x`), and the answer has the
form of that tool.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import orjson

from rosbridge_sim.cli.tools.text import put, put_json, render, show
from rosbridge_sim.cli.tools.tool_client import Bridge, Frame, absolute, frames_in, words
from rosbridge_sim.cli.tools.topic import is_ros2
from rosbridge_sim.link.bridge_errors import RefusedError
from rosbridge_sim.link.json_with_words import to_json
from rosbridge_sim.link.terminal_text import safe
from rosbridge_sim.suggestions import hint

_WORDS = {bool: "Boolean", int: "Integer", float: "Double", str: "String"}
"""Word of `ros2 param get` for the type of a value."""

_TYPES = ("not set", "boolean", "integer", "double", "string", *(f"{one} array" for one in ("byte", "boolean")))
_TYPES += ("integer array", "double array", "string array")
"""Word for each number of rcl_interfaces/ParameterType."""


async def _name_of(bridge: Bridge, given: Sequence[str]) -> str:
    """Return a parameter's name, from one word, or from a node and a word."""
    if len(given) == 1:
        return absolute(given[0])
    return f"{absolute(given[0])}{':' if await is_ros2(bridge) else '/'}{given[1]}"


async def _names(bridge: Bridge, inner: str = "") -> list[str]:
    """Return the names of all parameters, or of those in a node or a namespace."""
    names = sorted(words(await bridge.ask("get_param_names"), "names"))
    root = absolute(inner).rstrip("/")
    return [one for one in names if not root or one == root or one.startswith((f"{root}/", f"{root}:"))]


async def _ask(bridge: Bridge, service: str, **args: object) -> Frame:
    """Return the values of a service, which may refuse in its response."""
    values = await bridge.ask(service, **args)
    if values.get("successful") is False:
        raise RefusedError(safe(str(values.get("reason") or f"/rosapi/{service} refuses without a reason")))
    return values


async def _value(bridge: Bridge, name: str) -> object:
    if (await bridge.ask("has_param", name=name)).get("exists") is not True:
        raise RefusedError(f"no parameter {safe(name)} here{hint(name, await _names(bridge))}")
    return _read(await _ask(bridge, "get_param", name=name))


def _read(values: Frame) -> object:
    """Return the value in an answer of `get_param`, which is JSON text."""
    text = str(values.get("value", "null"))
    try:
        value: object = orjson.loads(text)
    except orjson.JSONDecodeError:
        return text
    return value


async def list_parameters(bridge: Bridge, inner: str, *, is_json: bool) -> None:
    """Print the names of parameters; those of ROS 2 below their nodes.

    Args:
        inner: only those of this node or in this namespace; empty means all.

    Raises:
        RefusedError: rosapi refuses, or does not exist.
        BridgeError: there is no answer. The same holds for the other functions here.
    """
    names = await _names(bridge, inner)
    if is_json:
        put_json(names)
        return
    last = inner and absolute(inner)
    for name in names:
        node, sign, short = name.partition(":")
        if sign and node != last:
            put(f"{safe(node)}:")
            last = node
        put(safe(f"  {short}" if sign else name))


async def get_value(bridge: Bridge, given: Sequence[str], *, is_bare: bool, is_json: bool) -> None:
    """Print a value: as YAML, or with its type if the words are those of ROS 2.

    Args:
        given: a name, or a node and a name.
        is_bare: print no type.

    Raises:
        RefusedError: it is not set.
    """
    value = await _value(bridge, await _name_of(bridge, given))
    if is_json:
        put_json(value)
    elif is_bare or len(given) == 1 or isinstance(value, dict):
        put(render(value))
    elif isinstance(value, list):
        put(f"{_WORDS.get(type(next(iter(value), '')), 'String')} values are: {safe(str(value))}")
    else:
        put(f"{_WORDS.get(type(value), 'String')} value is: {safe(str(value))}")


async def set_value(bridge: Bridge, given: Sequence[str], value: object, *, is_json: bool) -> None:
    """Set a parameter.

    Raises:
        RefusedError: the server refuses.
    """
    name = await _name_of(bridge, given)
    await _ask(bridge, "set_param", name=name, value=to_json(value).decode())
    show({"name": name, "value": value}, "Set parameter successful", is_json=is_json)


async def delete_value(bridge: Bridge, given: Sequence[str], *, is_json: bool) -> None:
    """Delete a parameter, or a namespace of ROS 1.

    Raises:
        RefusedError: it is not set, or the server refuses.
    """
    name = await _name_of(bridge, given)
    await _ask(bridge, "delete_param", name=name)
    show({"name": name}, "Deleted parameter successfully", is_json=is_json)


async def describe(bridge: Bridge, node: str, names: Sequence[str], *, is_json: bool) -> None:
    """Print type and constraints of parameters of a node of ROS 2.

    Raises:
        RefusedError: it is ROS 1, which describes no parameters; or the node has no such services.
    """
    if not await is_ros2(bridge):
        raise RefusedError("ROS 1 has no descriptions of parameters; rosbridge-sim param get shows the value")
    service = f"{absolute(node)}/describe_parameters"
    found = frames_in(await bridge.request(service, {"names": list(names)}), "descriptors")
    if is_json:
        put_json(found)
        return
    for one in found:
        kind = one.get("type")
        put(f"Parameter name: {safe(str(one.get('name')))}")
        put(f"  Type: {_TYPES[kind] if isinstance(kind, int) and 0 <= kind < len(_TYPES) else '?'}")
        if one.get("description"):
            put(f"  Description: {safe(str(one['description']))}")
        put("  Constraints:")
        if one.get("read_only"):
            put("    Read only: true")
        for limits in (*frames_in(one, "integer_range"), *frames_in(one, "floating_point_range")):
            put("".join(f"    {title}: {limits.get(key)}\n" for title, key in _LIMITS)[:-1])


_LIMITS = (("Min value", "from_value"), ("Max value", "to_value"), ("Step", "step"))


async def dump(bridge: Bridge, inner: str, *, is_json: bool) -> None:
    """Print all values, or those of a node or a namespace, as a file of `ros2 param dump` or `rosparam dump`.

    Args:
        inner: node or namespace; empty means all.
    """
    names = await _names(bridge, inner)
    answers = await bridge.ask_all([("get_param", {"name": name}) for name in names])
    tree: dict[str, Any] = {}
    for name, answer in zip(names, answers, strict=True):
        node, sign, short = name.partition(":")
        path = [node, "ros__parameters", *short.split(".")] if sign else name.strip("/").split("/")
        place = tree
        for step in path[:-1]:
            place = place.setdefault(step, {})
        place[path[-1]] = _read(answer.fields)
    put_json(tree) if is_json else put(render(tree))
