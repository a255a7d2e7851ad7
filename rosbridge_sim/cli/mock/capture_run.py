"""`mock capture`: watch a running system or a bag for a while, and write the file of a mock of it."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import orjson

from rosbridge_sim.cli.contracts.watching import chosen, services_if_told, types_if_told, watch_topics
from rosbridge_sim.cli.tools.action import types_of_actions
from rosbridge_sim.cli.tools.bag_play import json_reader
from rosbridge_sim.cli.tools.schema import DefinitionSources, open_store, read_texts
from rosbridge_sim.cli.tools.text import Flow, demand_new, note, put_json, render, write_file
from rosbridge_sim.cli.tools.tool_client import Bridge, Connect, Frame, absolute
from rosbridge_sim.contracts.seen_system import SeenTopic
from rosbridge_sim.documents.yaml_reading import MAX_YAML_BYTES, YamlDocument
from rosbridge_sim.errors import DocumentError, PeerError
from rosbridge_sim.link.bridge_errors import RefusedError
from rosbridge_sim.link.json_with_words import to_json
from rosbridge_sim.link.urls import shown_url
from rosbridge_sim.loose_types import JsonValue
from rosbridge_sim.mock.mock_capture import (
    SeenTransforms,
    captured_topic,
    leave_out_mistakes,
    shorten,
    without_patterns,
)
from rosbridge_sim.mock.mock_plan import MockFiles, plan_mock
from rosbridge_sim.schema.store import Store
from rosbridge_sim.shell.bags.bag_reader import BagTypes, open_reader, read_messages
from rosbridge_sim.shell.files.definitions import Texts
from rosbridge_sim.suggestions import hint

MAX_NOTED = 20
"""Lines about what is left out that are printed."""

OF_THE_MOCK = ("/clock", "/mock/*", "/tf2_web_republisher*", "/republish_tfs")
"""Topics and services that a mock's server has of its own."""

TRANSFORMS = {"tf2_msgs/TFMessage", "tf2_msgs/msg/TFMessage"}

HEAD = """\
# A mock of {source}, as seen for {duration:g} s.
# `rosbridge-sim mock run FILE{ros}` serves it, and `rosbridge-sim mock check FILE{ros}` finds mistakes in it.
"""
SERVICES = """\
# Watching does not show what services answer. These are defaults, or the answers to --call: fill in what the app needs.
"""
SUBSCRIBERS = """\
# Topics on which no message came: the mock subscribes to them.
"""


@dataclass
class _Capture:
    """The parts of a system to capture.

    Attributes:
        topics, services, calls, duration: see `capture_mock`.
        types: topic -> type of all topics that are wanted.
        seen: topic -> messages.
        offered, actions: services and actions, name -> type.
        answers: service -> its answer, as a mock's file has it.
    """

    topics: Sequence[str]
    services: Sequence[str]
    calls: Sequence[str]
    duration: float
    types: dict[str, str] = field(default_factory=dict)
    seen: Mapping[str, SeenTopic] = field(default_factory=dict)
    offered: Mapping[str, str] = field(default_factory=dict)
    actions: Mapping[str, str] = field(default_factory=dict)
    answers: dict[str, JsonValue] = field(default_factory=dict)
    transforms: SeenTransforms = field(default_factory=SeenTransforms)

    def want(self, types: Mapping[str, str]) -> None:
        """Choose the topics."""
        self.types = {name: types[name] for name in chosen(types, self.topics, OF_THE_MOCK)}

    def take_transforms(self, topic: str, now: float, message: Frame) -> None:
        """Take the transforms of a message, if it has some."""
        if self.types[topic] in TRANSFORMS:
            self.transforms.add(now, message, is_static=topic.endswith("_static"))

    def document(self, store: Store) -> dict[str, JsonValue]:
        """Return the document of the mock's file."""
        came = {name: topic for name, topic in self.seen.items() if topic.num and self.types[name] not in TRANSFORMS}
        silent = {name: kind for name, kind in self.types.items() if name not in self.seen or not self.seen[name].num}
        return {
            "topics": {name: captured_topic(topic, self.types[name]) for name, topic in came.items()},
            "subscribers": {name: kind for name, kind in silent.items() if kind not in TRANSFORMS},
            "transforms": self.transforms.captured(),
            "services": {
                name: {"type": kind, "answers": [self.answers.get(name) or {"value": _default(store, kind)}]}
                for name, kind in self.offered.items()
            },
            "actions": {name: {"type": kind} for name, kind in self.actions.items()},
        }


def _default(store: Store, service_type: str) -> JsonValue:
    """Return the response of defaults; an empty one for an unknown type, which is left out later."""
    try:
        response = store.service(service_type).response
        return orjson.loads(b"".join(response.encode_json_parts(response.default())))
    except PeerError:
        return {}


async def capture_mock(
    source: str,
    file: str,
    *,
    connect: Connect,
    topics: Sequence[str],
    services: Sequence[str],
    calls: Sequence[str],
    duration: float,
    sources: DefinitionSources,
    is_json: bool,
) -> None:
    """Watch a system or a bag, and write the file of a mock of it. `mock check` finds no mistake in that.

    Args:
        source: URL of a rosbridge, or path of a bag.
        file: path of the new file.
        connect: opens the connection.
        topics, services: patterns of topics, and of services and actions; none of both means all but those of ROS
            itself.
        calls: services that are called without arguments.
        duration: how long it is watched, or how much of the bag is read [s].
        sources: selects the known definitions.
        is_json: print the document as JSON.

    Raises:
        DocumentError: the file is there already or cannot be written; there is no connection, or no such bag.
        RefusedError: there is no rosapi, or no such service.
    """
    demand_new(Path(file))
    found = _Capture(topics, services, calls, duration)
    is_bag = _is_file(source)
    if is_bag:
        _read_bag(found, Path(source), read_texts(sources))
    else:
        async with connect(source) as bridge:
            await _watch(found, bridge)
    is_ros2 = any("/msg/" in kind for kind in found.types.values())
    ros = sources.ros or ("2" if is_ros2 else "1")
    store = open_store(DefinitionSources(sources.release, ros, sources.folders))
    document = {key: part for key, part in found.document(store).items() if part}
    left_out = leave_out_mistakes(
        document, lambda value: plan_mock(YamlDocument("", value, {}), store, MockFiles(), lambda _text: None)[1]
    )
    left_out = [text.removeprefix(":1: ") for text in left_out]  # there is no file with lines yet
    left_out += [f"{name}: its values are too long" for name in shorten(document, MAX_YAML_BYTES // 2, _size)]
    for text in left_out[:MAX_NOTED]:
        note(f"left out: {text}")
    if len(left_out) > MAX_NOTED:
        note(f"left out: {len(left_out) - MAX_NOTED:,} more")
    shown = source if is_bag else shown_url(source)
    head = HEAD.format(source=render(shown), duration=duration, ros=" --ros 2" if ros == "2" else "")
    write_file(Path(file), head + mock_text(document))
    if is_json:
        put_json(document)
    else:
        note(f"{file}: " + ", ".join(f"{len(part):,} {key}" for key, part in document.items()))
    if not is_bag and topics and not services:
        note("no services and actions, because -t selects topics alone; -s '*' takes them, too")


def _is_file(source: str) -> bool:
    return Path(source).exists()


def _size(value: JsonValue) -> int:
    return len(render(value).encode())


def mock_text(document: Mapping[str, JsonValue]) -> str:
    """Return the document of a mock's file as YAML, with comments."""
    comments = {"services": SERVICES, "subscribers": SUBSCRIBERS}
    return (
        "".join(f"{comments.get(key, '')}{render({key: _with_flow(part)})}\n" for key, part in document.items())
        or "{}\n"
    )


def _with_flow(value: JsonValue) -> JsonValue:
    """Return a value whose patterns and small objects are written on one line each."""
    if isinstance(value, list):
        return [_with_flow(one) for one in value]
    if not isinstance(value, dict):
        return value
    parts = {key: _with_flow(one) for key, one in value.items()}
    is_flat = all(isinstance(one, Flow) or not isinstance(one, (dict, list)) for one in parts.values())
    is_short = is_flat and parts and _size(Flow(parts)) <= MAX_FLOW
    return Flow(parts) if is_short else parts


MAX_FLOW = 100
"""Longest object on one line [characters]."""


async def _watch(found: _Capture, bridge: Bridge) -> None:
    """Watch a running system; see `capture_mock`."""
    types = await types_if_told(bridge)
    patterns, is_all = [*found.services, *found.calls], not found.topics and not found.services  # of one kind: no other
    there = await services_if_told(bridge, [] if is_all else patterns, OF_THE_MOCK) if is_all or patterns else {}
    if types is None or there is None:
        raise RefusedError("a mock cannot be captured without rosapi; a bag can be: rosbridge-sim record writes one")
    for name in map(absolute, found.calls):
        if name not in there:
            raise RefusedError(f"--call: no service {name} here{hint(name, there)}")
        answer = await bridge.call(name, {}, bridge.patience)
        if answer is None:
            raise RefusedError(f"--call: {name}: no answer within {bridge.patience:g} s; --timeout waits longer")
        found.answers[name] = (
            {"value": without_patterns(answer.values)} if answer.is_ok else {"fail": str(answer.values)[:MAX_FAIL]}
        )
    actions = {absolute(name): kind for name, kind in (await types_of_actions(bridge)).items()}
    names = chosen(actions, found.services, OF_THE_MOCK) if is_all or found.services else []
    found.actions = {name: actions[name] for name in names if actions[name] != "?"}
    of_actions = tuple(f"{name}/*" for name in found.actions)
    found.offered = {name: there[name] for name in chosen(there, ["*"], of_actions) if there[name]}
    types = types if is_all or found.topics else {}
    found.want({name: kind for name, kind in types.items() if chosen([name], [], of_actions)})
    found.seen = await watch_topics(bridge, found.types, found.duration, found.take_transforms)


MAX_FAIL = 500
"""Longest text of a failure in a mock's file [characters]."""


def _read_bag(found: _Capture, path: Path, texts: Texts) -> None:
    """Read the beginning of a bag; see `capture_mock`."""
    ros = 1 if path.suffix == ".bag" else 2
    types = BagTypes(texts, is_ros1=ros == 1)
    with open_reader(path) as bag:
        there = {one.topic: one for one in bag.connections if one.msgcount}
        kinds = {name: one.msgtype if ros != 1 else one.msgtype.replace("/msg/", "/") for name, one in there.items()}
        found.want(kinds)
        readers = {}
        for name in found.types:
            try:
                readers[name] = json_reader(types, there[name], ros)
            except DocumentError as error:
                note(f"left out: {error}")
        seen = {name: SeenTopic() for name in found.types}
        connections = [one for one in bag.connections if one.topic in readers]
        for connection, stamp_ns, raw in read_messages(bag, connections, path) if connections else ():
            at, name = (stamp_ns - bag.start_time) / 1e9, connection.topic
            if at > found.duration:
                break
            message = json.loads(to_json(readers[name](raw)))  # without the library's arrays
            seen[name].add(at, message)
            found.take_transforms(name, at, message)
    found.seen = seen
