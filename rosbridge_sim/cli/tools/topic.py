"""`topic list`, `info`, `echo` and `pub`: list topics, show their state, print messages, and publish."""

from __future__ import annotations

import asyncio
import re
from collections.abc import Mapping, Sequence

from rosbridge_sim.cli.tools.text import note, put, put_json, put_record, put_table
from rosbridge_sim.cli.tools.tool_client import Bridge, Frame, absolute, words
from rosbridge_sim.cli.tools.tool_subscription import Listener, no_topic
from rosbridge_sim.link.bridge_errors import RefusedError
from rosbridge_sim.link.terminal_text import safe
from rosbridge_sim.suggestions import hint

__all__ = ["FieldPath", "echo", "list_topics", "publish", "show_topic"]


# list, info


async def list_topics(bridge: Bridge, *, is_verbose: bool, has_types: bool, is_json: bool) -> int:
    """Print all topics, sorted by name.

    Args:
        is_verbose: with types, and with the nodes that publish and subscribe.

    Raises:
        RefusedError: rosapi refuses, or does not exist.
        BridgeError: there is no answer.
    """
    values = await bridge.ask("topics")
    names, types = words(values, "topics"), words(values, "types")
    types += ["?"] * (len(names) - len(types))  # an older rosapi gives only names
    topics = sorted(zip(names, types, strict=False))
    if not is_verbose:
        _put_topics(topics, has_types=has_types, is_json=is_json)
        return 0
    publishing, subscribing = await _who_is_who(bridge)
    if is_json:
        put_json(
            [
                {"topic": name, "type": kind, "publishers": publishing[name], "subscribers": subscribing[name]}
                for name, kind in topics
            ]
        )
        return 0
    rows = [(name, kind, _list(publishing[name]), _list(subscribing[name])) for name, kind in topics]
    put_table(("TOPIC", "TYPE", "PUBLISHERS", "SUBSCRIBERS"), rows)
    return 0


def _put_topics(topics: Sequence[tuple[str, str]], *, has_types: bool, is_json: bool) -> None:
    if is_json:
        put_json([{"topic": name, "type": kind} for name, kind in topics])
    elif has_types:
        width = max((len(name) for name, _ in topics), default=0)
        for name, kind in topics:
            put(f"{safe(name):{width}}  {safe(kind)}")
    else:
        for name, _ in topics:
            put(safe(name))


class _Names(dict[str, list[str]]):
    """Topic -> its nodes; an unknown topic has none."""

    def __missing__(self, key: str) -> list[str]:
        return []


async def _who_is_who(bridge: Bridge) -> tuple[_Names, _Names]:
    """Return the nodes that publish each topic, and those that subscribe to it."""
    nodes = words(await bridge.ask("nodes"), "nodes")
    publishing, subscribing = _Names(), _Names()
    answers = await bridge.ask_all([("node_details", {"node": node}) for node in nodes])
    for node, answer in zip(nodes, answers, strict=True):
        if not answer.is_ok or not isinstance(answer.values, dict):
            continue  # a node that has just left
        for table, key in ((publishing, "publishing"), (subscribing, "subscribing")):
            for topic in words(answer.values, key):
                table.setdefault(topic, []).append(node)
    return publishing, subscribing


def _list(names: Sequence[str]) -> str:
    return ", ".join(names) or "-"


async def show_topic(bridge: Bridge, name: str, *, is_json: bool) -> int:
    """Print a topic's type, and its publishers and subscribers.

    Raises:
        RefusedError: there is no such topic.
        BridgeError: there is no answer.
    """
    topic = absolute(name)
    kind = str((await bridge.ask("topic_type", topic=topic)).get("type", ""))
    if not kind:
        raise await no_topic(bridge, topic)
    publishers = words(await bridge.ask("publishers", topic=topic), "publishers")
    subscribers = words(await bridge.ask("subscribers", topic=topic), "subscribers")
    if is_json:
        put_json({"topic": topic, "type": kind, "publishers": publishers, "subscribers": subscribers})
        return 0
    put(f"Type: {safe(kind)}")
    for title, nodes in (("Publishers", publishers), ("Subscribers", subscribers)):
        put(f"\n{title}:{'' if nodes else ' None'}")
        for node in nodes:
            put(f" * {safe(node)}")
    return 0


# echo


async def echo(
    bridge: Bridge,
    name: str,
    type_name: str | None,
    field: FieldPath | None,
    count: int | None,
    *,
    patience: float | None,
    is_json: bool,
) -> int:
    """Print each message as it comes, up to a number.

    Args:
        name: name of the topic.
        type_name: its type; None means that of an existing topic.
        field: a part of each message; None means all of it.
        count: number of messages; None means no end.
        patience: longest wait for a message [s]; None means no limit.
        is_json: print one line of JSON per message.

    Raises:
        RefusedError: the topic does not exist, or no message came in time.
    """
    listener = await Listener.open(bridge, absolute(name), type_name)
    num_left = count
    while num_left != 0:
        msg = await listener.expect(patience)
        value = msg if field is None else field.find(msg)
        (put_json if is_json else put_record)(value)
        if num_left is not None:
            num_left -= 1
    return 0


class FieldPath:
    """The path to a part of a message: `pose.position`, `npc_list[0].name`."""

    _FORM = re.compile(r"\w+(?:\[\d+\])*(?:\.\w+(?:\[\d+\])*)*")

    def __init__(self, text: str) -> None:
        """Read a path.

        Raises:
            ValueError: the text is not a path.
        """
        if not self._FORM.fullmatch(text):
            raise ValueError(text)
        self._steps = re.findall(r"\w+|\[\d+\]", text)

    def find(self, msg: Frame) -> object:
        """Return the part of a message at this path.

        Args:
            msg: the message.

        Raises:
            RefusedError: the message has no such part.
        """
        value: object = msg
        for i, step in enumerate(self._steps):
            where = "".join(f".{part}" if part[0] != "[" else part for part in self._steps[:i]).lstrip(".")
            where = f" in {where}" if where else ""
            if step.startswith("["):
                if not isinstance(value, list):
                    raise RefusedError(f"--field: no list{where}, so there is no {step}")
                if int(step[1:-1]) >= len(value):
                    raise RefusedError(f"--field: no {step}{where}: it has {len(value)} elements")
                value = value[int(step[1:-1])]
            elif isinstance(value, Mapping) and step in value:
                value = value[step]
            else:
                names = list(value) if isinstance(value, Mapping) else []
                there = f"; it has {', '.join(map(safe, names))}" if names else ""
                raise RefusedError(f"--field: no {step}{where}{hint(step, names)}{there}")
        return value


# pub


async def publish(
    bridge: Bridge,
    name: str,
    type_name: str,
    msg: Frame,
    *,
    count: int | None,
    rate: float | None,
    is_latched: bool,
    is_json: bool,
) -> int:
    """Publish a message `count` times, or until Ctrl-C.

    Args:
        name: name of the topic.
        msg: the message.
        count: number of messages; None means no end.
        rate: messages per second [Hz]; None publishes once, and then stays for later subscribers.
        is_latched: later subscribers get the last message.
        is_json: print the result as JSON for programs.

    Raises:
        RefusedError: the server refuses it.
    """
    topic = absolute(name)
    # Some refusals are warnings, such as a control that the simulator ignores; servers without levels send all.
    ignored = await bridge.send("set_level", level="warning")
    await bridge.send("advertise", topic=topic, type=type_name, latch=is_latched)
    await bridge.send("publish", topic=topic, msg=msg)
    listeners = await _check(bridge, topic, ignored)
    num_sent = 1
    try:
        if rate is not None:
            note(f"publishing to {topic}{listeners}, {rate:g} a second")
            start = bridge.now()
            while num_sent != count:
                await _wait(bridge, start + num_sent / rate, ignored)
                await bridge.send("publish", topic=topic, msg=msg)
                num_sent += 1
            listeners = await _check(bridge, topic, ignored)
        elif count is None:
            note(f"published to {topic}{listeners}; kept until Ctrl-C for later subscribers")
            await _wait(bridge, None, ignored)
    except asyncio.CancelledError:  # Ctrl-C is the usual end
        _account(topic, type_name, num_sent, "", is_json=is_json)
        raise
    _account(topic, type_name, num_sent, listeners, is_json=is_json)
    return 0


def _account(topic: str, type_name: str, num_sent: int, listeners: str, *, is_json: bool) -> None:
    if is_json:
        put_json({"topic": topic, "type": type_name, "count": num_sent})
    else:
        note(f"published {num_sent} message{'s' if num_sent > 1 else ''} to {topic}{listeners}")


async def _check(bridge: Bridge, topic: str, ignored: str) -> str:
    """Wait until the server has handled everything that was sent; return the subscribers as text, if they are known.

    The server handles frames in order, so the answer to a call comes after its reports about all earlier frames.

    Raises:
        RefusedError: the server reports an error.
    """
    answer = await bridge.call("/rosapi/subscribers", {"topic": topic}, bridge.patience)
    for frame in bridge.take_inbox():
        _hear(frame, ignored)
    if answer is None:
        note(f"{bridge.silence} So it is not known if the message was accepted")
        return ""
    if not answer.is_ok or not isinstance(answer.values, dict):
        return ""
    nodes = words(answer.values, "subscribers")
    return f" (subscribers: {', '.join(nodes)})" if nodes else " (no subscribers)"


async def _wait(bridge: Bridge, until: float | None, ignored: str) -> None:
    """Wait, and handle the server's status messages meanwhile.

    Raises:
        RefusedError: the server reports an error.
    """
    while (frame := await bridge.receive(until)) is not None:
        _hear(frame, ignored)


def _hear(frame: Frame, ignored: str) -> None:
    if frame.get("op") != "status" or frame.get("id") == ignored:
        return
    text = str(frame.get("msg"))
    if frame.get("level") == "error":
        raise RefusedError(safe(text))
    note(f"the server says: {text}")
