"""A check: steps that are sent or must come, with the source of the claim; made ready for one server.

Checks are lines of JSON. A step has one key, the name of a client and an action:

    {"a>": frame}     client `a` sends this frame
    {"a<": frame}     the next frame that comes to `a` is this one
    {"a?": null}      what comes to `a` from now on does not matter
    {"a-": "close"}   client `a` closes its connection

The forms of frames are in `check_frames.py`. When the steps are over, no client may have got another frame.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from typing import Final

from rosbridge_sim.loose_types import JsonValue
from rosbridge_sim.records import Record, replace

_NAMED: Final = ("topic", "service", "action")
"""Keys of an op whose value is a name of the graph."""

_ASKED_FOR: Final = ("name", "topic", "service", "node")
"""Arguments of rosapi whose value is a name of the graph."""

_OF_ROSAPI: Final = re.compile(r"/?rosapi/.*")

ON_ROS_2: Final = {"rospy_tutorials/AddTwoInts": "example_interfaces/AddTwoInts"}
"""Type that ROS 2 lacks -> the type with the same fields there."""

STANDARD_PACKAGES: Final = frozenset(
    {
        *("std_msgs", "std_srvs", "geometry_msgs", "sensor_msgs", "nav_msgs", "tf2_msgs"),
        *("rospy_tutorials", "example_interfaces"),
    }
)


_INVENTED: Final = frozenset({"Nonsense", "Other", "Thing"})
"""Types that no package has; some checks are about such a mistake."""


class Check(Record):
    """A check.

    Attributes:
        id: section and name, such as `topics/latch`.
        source: where the claim comes from.
        says: what is checked.
        steps: see above.
        ros: 1 or 2 if it is about one of them alone; 0 for both.
        is_hostile: it sends what no honest client sends.
    """

    id: str
    source: str
    says: str
    steps: list[dict[str, JsonValue]]
    ros: int = 0
    is_hostile: bool = False

    @property
    def section(self) -> str:
        """The part of its id before the slash."""
        return self.id.partition("/")[0]

    @property
    def types(self) -> set[tuple[str, str]]:
        """Types of standard packages that the server must know for it: kind (topic, service, action) and `pkg/Type`.

        Not `_INVENTED` ones.
        """
        found: set[tuple[str, str]] = set()
        for _, action, frame in moves(self):
            if action != ">" or not isinstance(frame, dict):
                continue
            kind = next((kind for kind in ("service", "action") if f"_{kind}" in str(frame.get("op"))), "topic")
            for key in ("type", "action_type"):
                name = str(frame.get(key))
                package, _, rest = plain_types(name).partition("/")
                if package in STANDARD_PACKAGES and rest.isidentifier() and rest not in _INVENTED:
                    found.add((kind, f"{package}/{rest}"))
        return found


def read_checks(text: str) -> list[Check]:
    """Return the checks of a file.

    Args:
        text: its content: one check in each line.
    """
    return [Check(**json.loads(line)) for line in text.splitlines()]


def moves(check: Check) -> Iterator[tuple[str, str, JsonValue]]:
    """Yield the steps: client, action (`>`, `<`, `?` or `-`), and frame."""
    for step in check.steps:
        ((key, frame),) = step.items()
        yield key[:-1], key[-1], frame


def prepared(check: Check, prefix: str, ros: int) -> Check:
    """Return a check with names of its own and the types of the server's ROS.

    Args:
        check: the check.
        prefix: namespace for all names of topics, services, actions and parameters, such as `/doctor_7/12`.
        ros: 1 or 2; 0 if it is not known.
    """
    text = json.dumps(check.steps)
    for name in sorted(_names(check), key=len, reverse=True):
        inner = name.lstrip("/")
        root = prefix if name.startswith("/") else prefix.lstrip("/")
        text = re.sub(rf'(?<![\w/.]){re.escape(name)}(?![\w])(?!"\s*:)', f"{root}/{inner}", text)
    for old, new in ON_ROS_2.items() if ros == 2 else ():  # noqa: PLR2004 - as in the name
        text = text.replace(old, new).replace(old.replace("/", "/srv/"), new.replace("/", "/srv/"))
    return replace(check, steps=_chosen(json.loads(text), ros))


def _chosen(value: JsonValue, ros: int) -> JsonValue:
    """Return a value with what comes from one ROS in place of what comes from each."""
    if isinstance(value, dict):
        if value.keys() == {"$ros"}:
            return value["$ros"][ros == 2]  # noqa: PLR2004 - as in its name
        return {key: _chosen(inner, ros) for key, inner in value.items()}
    return [_chosen(inner, ros) for inner in value] if isinstance(value, list) else value


def _names(check: Check) -> set[str]:
    names: set[str] = set()
    for _, action, sent in moves(check):
        if action != ">":
            continue
        frame = next(iter(sent.values())) if isinstance(sent, dict) and len(sent) == 1 else sent
        if isinstance(frame, str):
            names |= {found for key in _NAMED for found in re.findall(rf'"{key}"\s*:\s*"([^"\s]+)"', frame)}
        elif isinstance(frame, dict):
            named = [frame.get(key) for key in _NAMED]
            names |= {name for name in named if isinstance(name, str)}
            names |= {part for name in named if isinstance(name, dict) for part in name["$repeat"][2:]}
            args = frame.get("args")
            if _OF_ROSAPI.fullmatch(str(frame.get("service"))) and isinstance(args, dict):
                names |= {args[key] for key in _ASKED_FOR if str(args.get(key)).startswith("/")}
    names = {name.partition("#")[0].removesuffix("/_action/cancel_goal") for name in names}
    return {name for name in names if name.strip("/") and not _OF_ROSAPI.fullmatch(name)}


def plain_types(text: str) -> str:
    """Return a text with names of types as ROS 1 writes them: `pkg/Type`, and `rosapi` for `rosapi_msgs`."""
    return re.sub(r"\b(\w+?)/(?:msg|srv|action)/(\w+)", r"\1/\2", text).replace("rosapi_msgs/", "rosapi/")
