"""`topic list`, `info`, `type`, `find`, `echo` and `pub`: list topics, show them, print messages, and publish."""

from __future__ import annotations

import asyncio
import re
import time
from collections import defaultdict
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

from rosbridge_sim.cli.tools.service import read_fields
from rosbridge_sim.cli.tools.text import leaves, note, put, put_json, put_names, put_record, put_table, show
from rosbridge_sim.cli.tools.tool_client import Bridge, Frame, absolute, frames_in, words
from rosbridge_sim.cli.tools.tool_subscription import Listener, NoTopicError, no_topic
from rosbridge_sim.link.bridge_errors import RefusedError
from rosbridge_sim.link.json_with_words import to_json
from rosbridge_sim.link.terminal_text import safe
from rosbridge_sim.suggestions import hint

LOOK_INTERVAL = 0.2
"""Time between two questions for the subscribers of a topic [s]."""


# list, info, type, find


async def list_topics(
    bridge: Bridge, namespace: str, *, is_verbose: bool, has_types: bool, is_count: bool, is_json: bool
) -> None:
    """Print topics, sorted by name.

    Args:
        namespace: only topics in it; empty means all.
        is_verbose: with types, and with the nodes that publish and subscribe.
        is_count: print only how many there are.

    Raises:
        RefusedError: rosapi refuses, or does not exist.
        BridgeError: there is no answer.
    """
    topics = sorted((await types_of_topics(bridge)).items())
    if namespace:
        inner = absolute(namespace).rstrip("/")
        topics = [(name, kind) for name, kind in topics if name == inner or name.startswith(f"{inner}/")]
    if is_count or not (is_verbose or is_json):
        put_names([name for name, _ in topics], [kind for _, kind in topics if has_types], is_count=is_count)
        return
    users = await _who_is_who(bridge) if is_verbose else {}
    if is_json:
        put_json(
            [
                {"topic": name, "type": kind, **{title: nodes[name] for title, nodes in users.items()}}
                for name, kind in topics
            ]
        )
        return
    rows = [(name, kind, *(", ".join(nodes[name]) or "-" for nodes in users.values())) for name, kind in topics]
    put_table(("TOPIC", "TYPE", *(title.upper() for title in users)), rows)


async def types_of_topics(bridge: Bridge) -> dict[str, str]:
    """Return topic -> type of all topics.

    Raises:
        RefusedError: rosapi refuses, or does not exist.
        BridgeError: there is no answer.
    """
    values = await bridge.ask("topics")
    names, types = words(values, "topics"), words(values, "types")
    types += ["?"] * (len(names) - len(types))  # an older rosapi gives only names
    return dict(zip(names, types, strict=False))


async def _who_is_who(bridge: Bridge) -> dict[str, defaultdict[str, list[str]]]:
    """Return the nodes that publish each topic, and those that subscribe to it."""
    nodes = words(await bridge.ask("nodes"), "nodes")
    users = {title: defaultdict[str, list[str]](list) for title in ("publishers", "subscribers")}
    answers = await bridge.ask_all([("node_details", {"node": node}) for node in nodes])
    for node, answer in zip(nodes, answers, strict=True):
        for title, key in (("publishers", "publishing"), ("subscribers", "subscribing")):
            for topic in words(answer.fields, key):  # none of a node that has just left
                users[title][topic].append(node)
    return users


async def is_ros2(bridge: Bridge) -> bool:
    """Return True if types have the spelling of ROS 2; not every rosapi has a service that tells the generation."""
    return any("/msg/" in kind for kind in (await types_of_topics(bridge)).values())


async def _type_of(bridge: Bridge, topic: str) -> str:
    """Return a topic's type.

    Raises:
        RefusedError: there is no such topic.
        BridgeError: there is no answer.
    """
    kind = str((await bridge.ask("topic_type", topic=topic)).get("type", ""))
    if not kind:
        raise await no_topic(bridge, topic)
    return kind


async def show_topic_type(bridge: Bridge, name: str, *, is_json: bool) -> None:
    """Print a topic's type; see `_type_of` for errors."""
    kind = await _type_of(bridge, absolute(name))
    show(kind, safe(kind), is_json=is_json)


async def find_topics(bridge: Bridge, type_name: str, *, is_count: bool, is_json: bool) -> None:
    """Print the topics of a type, which may be spelled as in either generation.

    Raises:
        RefusedError: there is none, or no rosapi.
        BridgeError: there is no answer.
    """
    types = await types_of_topics(bridge)
    wanted = type_name.replace("/msg/", "/")
    found = sorted(name for name, kind in types.items() if kind.replace("/msg/", "/") == wanted)
    if not found:
        raise RefusedError(f"no topic of type {safe(type_name)} here{hint(type_name, sorted(set(types.values())))}")
    put_names(found, is_count=is_count, is_json=is_json)


async def show_topic(bridge: Bridge, name: str, *, is_verbose: bool, is_json: bool) -> None:
    """Print a topic's type, and its publishers and subscribers.

    Args:
        is_verbose: print each node as `ros2 topic info -v` does.

    Raises:
        RefusedError: there is no such topic.
        BridgeError: there is no answer.
    """
    topic = absolute(name)
    kind = await _type_of(bridge, topic)
    publishers = words(await bridge.ask("publishers", topic=topic), "publishers")
    subscribers = words(await bridge.ask("subscribers", topic=topic), "subscribers")
    if is_json:
        put_json({"topic": topic, "type": kind, "publishers": publishers, "subscribers": subscribers})
        return
    put(f"Type: {safe(kind)}")
    if is_verbose:
        _put_endpoints(kind, publishers, subscribers)
        return
    for title, nodes in (("Publishers", publishers), ("Subscribers", subscribers)):
        put(f"\n{title}:{'' if nodes else ' None'}")
        for node in nodes:
            put(f" * {safe(node)}")


def _put_endpoints(kind: str, publishers: Sequence[str], subscribers: Sequence[str]) -> None:
    for title, word, nodes in (("Publisher", "PUBLISHER", publishers), ("Subscription", "SUBSCRIPTION", subscribers)):
        put(f"\n{title} count: {len(nodes)}")
        for node in nodes:
            namespace, _, short = absolute(node).rpartition("/")
            put(f"\nNode name: {safe(short)}\nNode namespace: {safe(namespace) or '/'}")
            put(f"Topic type: {safe(kind)}\nEndpoint type: {word}")


# echo


@dataclass(frozen=True, slots=True)
class Echo:
    """The form in which messages are printed.

    Attributes:
        is_json: one line of JSON per message.
        is_csv: one line of all values per message, with commas between them.
        has_header: the same with a line of names first, and with the time of arrival, as `rostopic echo -p` has them.
        has_arrays, has_texts: print what is in lists, and texts.
        field: print a part of each message; None means all of it.
    """

    is_json: bool = False
    is_csv: bool = False
    has_header: bool = False
    has_arrays: bool = True
    has_texts: bool = True
    field: FieldPath | None = None

    def put(self, msg: Frame, *, is_first: bool) -> None:
        """Print a message, or its part.

        Args:
            is_first: nothing was printed before.
        """
        value = self._shortened(msg if self.field is None else self.field.find(msg))
        if self.is_csv or self.has_header:
            found = list(leaves(value))
            if self.has_header and is_first:
                put(safe(",".join(["%time", *(f"field.{path}" if path else "field" for path, _ in found)])))
            cells = [str(one) if isinstance(one, str) else to_json(one).decode() for _, one in found]
            put(safe(",".join([str(time.time_ns()), *cells] if self.has_header else cells)))
        else:
            (put_json if self.is_json else put_record)(value)

    def _shortened(self, value: object) -> object:
        if isinstance(value, Mapping):
            return {key: self._shortened(one) for key, one in value.items()}
        if isinstance(value, list):
            return [self._shortened(one) for one in value] if self.has_arrays else f"<array length: {len(value)}>"
        return value if self.has_texts or not isinstance(value, str) else f"<string length: {len(value)}>"


async def echo(
    bridge: Bridge, name: str, type_name: str | None, count: int | None, *, patience: float | None, form: Echo
) -> None:
    """Print each message as it comes, up to a number.

    Args:
        name: name of the topic, or with the path of a field behind it, as in `rostopic echo /topic/field`.
        type_name: its type; None means that of an existing topic.
        count: number of messages; None means no end.
        patience: longest wait for a message [s]; None means no limit.

    Raises:
        RefusedError: the topic does not exist, or no message came in time.
    """
    listener = await Listener.open(bridge, absolute(name), type_name)
    num_printed = 0
    while num_printed != count:
        try:
            msg = await listener.expect(patience)
        except NoTopicError:
            topic, form = await _split_field(bridge, absolute(name), form)
            if not topic:
                raise
            listener = await Listener.open(bridge, topic, None)
            continue
        form.put(msg, is_first=not num_printed)
        num_printed += 1


async def _split_field(bridge: Bridge, name: str, form: Echo) -> tuple[str, Echo]:
    """Return the topic of a name with a field behind it, and the form with that; an empty topic if it is none."""
    topics = [one for one in await types_of_topics(bridge) if name.startswith(f"{one}/")]
    topic = max(topics, key=len, default="")
    with suppress(ValueError):
        if topic and form.field is None:
            return topic, replace(form, field=FieldPath(name[len(topic) + 1 :].replace("/", ".")))
    return "", form


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


async def _positional_message(bridge: Bridge, type_name: str, values: Sequence[object]) -> Frame:
    """Return a message from the values of its fields in order, as `rostopic pub` takes them; a list may be a message.

    Raises:
        RefusedError: the server does not tell the fields, or there are more or fewer of them.
        BridgeError: there is no answer.
    """
    answer = await bridge.ask("message_details", type=type_name)
    fields = {str(one.get("type")): read_fields(one) for one in frames_in(answer, "typedefs")}

    def fill(kind: str, value: object) -> object:
        if not isinstance(value, list):
            return value
        if kind.endswith("]"):
            return [fill(kind.partition("[")[0], one) for one in value]
        parts = fields.get(kind)
        if parts is None:
            return value
        if len(parts) != len(value):
            names = ", ".join(safe(name) for _, name in parts)
            raise RefusedError(f"MESSAGE: {safe(kind)}: expected {len(parts)} values ({names}); got {len(value)}")
        return {name: fill(part, one) for (part, name), one in zip(parts, value, strict=True)}

    root = next(iter(fields), "")
    is_whole = len(values) == 1 and isinstance(values[0], list) and len(fields.get(root, ())) != 1
    filled = fill(root, values[0] if is_whole else list(values))
    if not isinstance(filled, dict):
        raise RefusedError(
            f"MESSAGE: expected an object such as '{{data: 1}}': the fields of {safe(type_name)} are unknown"
        )
    return filled


async def _await_subscribers(bridge: Bridge, topic: str, number: int, patience: float) -> None:
    """Wait for so many nodes that subscribe.

    Raises:
        RefusedError: there are fewer in time, or the server does not tell.
    """
    until = bridge.now() + patience
    while len(words(await bridge.ask("subscribers", topic=topic), "subscribers")) < number:
        if bridge.now() >= until:
            raise RefusedError(f"{safe(topic)}: fewer than {number} nodes subscribe within {patience:g} s")
        await _wait(bridge, bridge.now() + LOOK_INTERVAL, "")


async def publish(
    bridge: Bridge,
    name: str,
    type_name: str,
    values: Sequence[object],
    *,
    count: int | None,
    rate: float | None,
    is_latched: bool,
    num_subscribers: int,
    wait: float,
    is_json: bool,
) -> None:
    """Publish a message `count` times, or until Ctrl-C.

    Args:
        values: the message, or the values of its fields in order.
        count: number of messages; None means no end.
        rate: messages per second [Hz]; None publishes once, and then stays for later subscribers.
        is_latched: later subscribers get the last message.
        num_subscribers: nodes that must subscribe before the first message.
        wait: longest wait for them [s].
        is_json: print the result as JSON for programs.

    Raises:
        RefusedError: the server refuses it.
    """
    topic = absolute(name)
    first = values[0] if values else {}
    is_whole = len(values) < 2 and isinstance(first, dict)  # noqa: PLR2004 - one that has all fields
    msg = first if is_whole else await _positional_message(bridge, type_name, values)
    # Some refusals are warnings, such as a control that the simulator ignores; servers without levels send all.
    ignored = await bridge.send("set_level", level="warning")
    await bridge.send("advertise", topic=topic, type=type_name, latch=is_latched)
    if num_subscribers:
        note(f"waiting for at least {num_subscribers} matching subscription(s)...")
        await _await_subscribers(bridge, topic, num_subscribers, wait)
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
