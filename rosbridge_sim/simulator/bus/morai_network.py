"""MORAI's own network files (`SaveFile/Network/*.json`, `*_MN.json`) as network settings.

Such a file has a list of items for each ego. An item has a number for what it is, and a block with the way it is sent
(UDP or ROS), the topic, and the rate. The numbers are known from files that users published; only those are read here.
What has no counterpart, such as an item that is sent by UDP, is returned as text for the user.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Final

from msgspec import Meta, field

from rosbridge_sim.documents.document_model import Document, DocumentType, KeptAsWritten
from rosbridge_sim.documents.document_reading import read_values
from rosbridge_sim.errors import DocumentError
from rosbridge_sim.loose_types import JsonValue
from rosbridge_sim.simulator.bus.network_settings import (
    MAX_RATE,
    InterfaceChoice,
    InterfaceKind,
    NetworkSettings,
    read_choices,
)

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
    return isinstance(document, Mapping) and isinstance(document.get("egoNetworkData"), list)


def read_morai_network(document: Mapping[str, JsonValue], source: str) -> tuple[NetworkSettings, list[str]]:
    """Return the network settings of a file, and what in it is not used, one text each.

    Args:
        document: the file's content, for which `is_morai_network` is true.
        source: name of the file, for errors.

    Raises:
        DocumentError: an item cannot be read, or a topic is not a valid name.
    """
    file = read_values(_FILE, document, source)
    if sum(len(ego.items) for ego in file.egos) > MAX_ITEMS:
        raise DocumentError(f"{source}: expected at most {MAX_ITEMS:,} items in the file")
    choices: dict[InterfaceKind, dict[str, InterfaceChoice]] = {kind: {} for kind in InterfaceKind}
    unused: list[str] = []
    for i, ego in enumerate(file.egos):
        for j, item in enumerate(ego.items):
            where = f"{source}: egoNetworkData[{i}].listEgoNetworkInfo[{j}]"
            _read_item(where, ego.number, item, choices, unused)
    if file.frame_rate:
        unused.append("frameRate")
    return NetworkSettings(**{kind.value: found for kind, found in choices.items()}), list(dict.fromkeys(unused))


def _read_item(
    where: str, owner: int, item: _Item, choices: Mapping[InterfaceKind, dict[str, InterfaceChoice]], unused: list[str]
) -> None:
    """Add the choice of one item, or say why there is none."""
    number, kind = item.number, _KINDS.get(item.division)
    block = item.command if kind is InterfaceKind.SUBSCRIBER else item.config
    topic = block.ros.topic
    name = f"type {number}" + (f" ({topic})" if topic else "")
    if owner not in _FIRST_EGO:
        unused.append(f"{name} of ego {owner}, which is not the first one")
    elif block.way != _ROS:
        unused.append(f"{name} by {_WAYS.get(block.way, f'commType {block.way}')}")
    elif kind is None or (default := _default(kind, number, topic)) is None:
        unused.append(f"{name}, which is not known")
    else:
        entry: dict[str, JsonValue] = {"name": topic} if topic else {}
        if kind is InterfaceKind.PUBLISHER and block.rate is not None:
            if 0.0 < block.rate <= MAX_RATE:
                entry["rate"] = block.rate
            else:
                unused.append(f"pubFrequency {block.rate:g} of {name}")
        choices[kind].update(read_choices(kind, {default: entry}, lambda _path: where))


def _default(kind: InterfaceKind, number: int, topic: str) -> str | None:
    return _DEFAULTS.get((kind, number)) or _BY_NAME.get((kind, "/" + topic.removeprefix("/")))


# The form of a file. Values of another type are none, as in MORAI: only lists and their entries must be such.


def _read_whole(value: object) -> int:
    """Return a whole number, also from a text; -1 for anything else."""
    number = _read_float(value)
    return int(number) if number == number // 1 and abs(number) < 2**31 else -1


def _read_float(value: object) -> float:
    """Return a finite number, also from a text; -1 for anything else."""
    try:
        number = float(value) if isinstance(value, (int, float, str)) else -1.0
    except (ValueError, OverflowError):
        return -1.0
    return number if -1e300 < number < 1e300 else -1.0  # noqa: PLR2004 - neither infinite nor NaN


def _read_topic(value: object) -> str:
    return value.strip() if isinstance(value, str) else ""


_Whole = Annotated[int, Meta(extra={"read": _read_whole})]


class _Block(Document, frozen=True, kw_only=True):
    """An object whose place may have anything else, which is read as an empty one."""

    @classmethod
    def prepare(cls, value: JsonValue) -> JsonValue:
        return value if isinstance(value, dict) else {}


class _Ros(_Block, frozen=True, kw_only=True):
    topic: Annotated[str, Meta(extra={"read": _read_topic})] = field(name="Topic", default="")


class _Config(_Block, frozen=True, kw_only=True):
    way: _Whole = field(name="commType", default=-1)
    rate: Annotated[float, Meta(extra={"read": _read_float})] | None = field(name="pubFrequency", default=None)
    ros: _Ros = field(name="rosConfig", default=_Ros())


class _Item(Document, frozen=True, kw_only=True):
    number: _Whole = field(name="PUBSUB_TYPE", default=-1)
    division: _Whole = field(name="Division_TYPE", default=-1)
    config: _Config = field(default=_Config())
    command: _Config = field(name="EgoCtrlConfig", default=_Config())


class _Ego(Document, frozen=True, kw_only=True):
    number: _Whole = field(name="UNIQUEID", default=-1)
    items: tuple[_Item, ...] = field(name="listEgoNetworkInfo", default=())


class _File(Document, frozen=True, kw_only=True):
    egos: tuple[_Ego, ...] = field(name="egoNetworkData")
    frame_rate: KeptAsWritten = field(name="frameRate", default=None)


_FILE: Final[DocumentType[_File]] = DocumentType(_File)
