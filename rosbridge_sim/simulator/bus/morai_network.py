"""MORAI's own network files (`SaveFile/Network/*.json`, `*_MN.json`) as network settings.

Such a file has a list of items for each ego. An item has a number for what it is, and a block with the way it is sent
(UDP or ROS), the topic, and the rate. The numbers are known from files that users published; only those are read here.
What has no counterpart, such as an item that is sent by UDP, is returned as text for the user.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Final

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.loose_types import JsonValue
from rosbridge_sim.simulator.bus.network_settings import MAX_RATE, InterfaceKind, NetworkSettings, read_choices

_TOP: Final = "egoNetworkData"
_ITEMS: Final = "listEgoNetworkInfo"

_KINDS: Final = {1: InterfaceKind.PUBLISHER, 3: InterfaceKind.SUBSCRIBER, 4: InterfaceKind.SERVICE}
"""`Division_TYPE` -> kind; 3 is the control command of an ego."""

_DEFAULTS: Final = {
    (InterfaceKind.SUBSCRIBER, 771): "/ctrl_cmd",
    (InterfaceKind.PUBLISHER, 261): "/CollisionData",
    (InterfaceKind.PUBLISHER, 278): "/Object_topic",
    (InterfaceKind.SERVICE, 780): "/Service_MoraiEventCmd",
}
"""Kind and `PUBSUB_TYPE` -> default name."""

_BY_NAME: Final = {**{(kind, name): name for (kind, _), name in _DEFAULTS.items()}} | {
    (InterfaceKind.PUBLISHER, "/Ego_topic"): "/Ego_topic"
}
"""Kind and topic -> default name, for an item with an unknown number and a default name."""

_ROS: Final = 3
_WAYS: Final = {0: "no connection", 1: "UDP"}
"""`commType`: ROS, and the others with the words for them."""

_FIRST_EGO: Final = (0, -100)
"""`UNIQUEID` of the first ego, and of what all egos share."""

MAX_ITEMS: Final = 1_000
"""Most items in a file: MORAI has fewer than a hundred for an ego."""


def is_morai_network(document: object) -> bool:
    """Return True if a JSON document is a network file of MORAI."""
    return isinstance(document, Mapping) and isinstance(document.get(_TOP), list)


def read_morai_network(document: Mapping[str, JsonValue], source: str) -> tuple[NetworkSettings, list[str]]:
    """Return the network settings of a file, and what in it is not used, one text each.

    Args:
        document: the file's content, for which `is_morai_network` is true.
        source: name of the file, for errors.

    Raises:
        DocumentError: an item cannot be read, or a topic is not a valid name.
    """
    choices: dict[InterfaceKind, dict[str, JsonValue]] = {kind: {} for kind in InterfaceKind}
    unused: list[str] = []
    for where, owner, item in _items(document, source):
        _read_item(where, owner, item, choices, unused)
    if document.get("frameRate"):
        unused.append("frameRate")
    return NetworkSettings(**{kind.value: found for kind, found in choices.items()}), list(dict.fromkeys(unused))


def _items(document: Mapping[str, JsonValue], source: str) -> Iterator[tuple[str, object, Mapping[str, JsonValue]]]:
    """Yield the place, the ego's number and the content of each item."""
    num_items = 0
    for i, ego in enumerate(document[_TOP]):
        where = f"{source}: {_TOP}[{i}]"
        items = ego.get(_ITEMS, []) if isinstance(ego, Mapping) else None
        if not isinstance(items, list):
            raise DocumentError(f"{where}: expected an object with a list {_ITEMS}")
        num_items += len(items)
        if num_items > MAX_ITEMS:
            raise DocumentError(f"{where}: expected at most {MAX_ITEMS:,} items in the file")
        for j, item in enumerate(items):
            if not isinstance(item, Mapping):
                raise DocumentError(f"{where}.{_ITEMS}[{j}]: expected an object")
            yield f"{where}.{_ITEMS}[{j}]", _number(ego.get("UNIQUEID")), item


def _read_item(
    where: str,
    owner: object,
    item: Mapping[str, JsonValue],
    choices: Mapping[InterfaceKind, dict[str, JsonValue]],
    unused: list[str],
) -> None:
    """Add the choice of one item, or say why there is none."""
    number, kind = _number(item.get("PUBSUB_TYPE")), _KINDS.get(_number(item.get("Division_TYPE")))
    block = item.get("EgoCtrlConfig" if kind is InterfaceKind.SUBSCRIBER else "config")
    block = block if isinstance(block, Mapping) else {}
    ros = block.get("rosConfig")
    topic = ros.get("Topic") if isinstance(ros, Mapping) else None
    topic = topic.strip() if isinstance(topic, str) else ""
    name = f"type {number}" + (f" ({topic})" if topic else "")
    way = _number(block.get("commType"))
    if owner not in _FIRST_EGO:
        unused.append(f"{name} of ego {owner}, which is not the first one")
    elif way != _ROS:
        unused.append(f"{name} by {_WAYS.get(way, f'commType {way}')}")
    elif kind is None or (default := _default(kind, number, topic)) is None:
        unused.append(f"{name}, which is not known")
    else:
        entry: dict[str, JsonValue] = {"name": topic} if topic else {}
        if kind is InterfaceKind.PUBLISHER and "pubFrequency" in block:
            rate = _float(block["pubFrequency"])
            if 0.0 < rate <= MAX_RATE:
                entry["rate"] = rate
            else:
                unused.append(f"pubFrequency {rate:g} of {name}")
        choices[kind].update(read_choices(kind, {default: entry}, lambda _path: where))


def _default(kind: InterfaceKind, number: int, topic: str) -> str | None:
    return _DEFAULTS.get((kind, number)) or _BY_NAME.get((kind, "/" + topic.removeprefix("/")))


def _number(value: object) -> int:
    """Return a whole number, also from a text; -1 for anything else."""
    number = _float(value)
    return int(number) if number == number // 1 and abs(number) < 2**31 else -1


def _float(value: object) -> float:
    """Return a finite number, also from a text; -1 for anything else."""
    try:
        number = float(value) if isinstance(value, (int, float, str)) else -1.0
    except (ValueError, OverflowError):
        return -1.0
    return number if -1e300 < number < 1e300 else -1.0  # noqa: PLR2004 - neither infinite nor NaN
