"""`bag play`: publish the messages of a bag through a rosbridge, at their times."""

from __future__ import annotations

import base64
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rosbridge_sim.cli.tools.schema import DefinitionSources, read_texts
from rosbridge_sim.cli.tools.text import note, put_json
from rosbridge_sim.cli.tools.tool_client import Bridge, Frame, absolute
from rosbridge_sim.cli.tools.topic import is_ros2
from rosbridge_sim.errors import DocumentError
from rosbridge_sim.link.bridge_errors import RefusedError
from rosbridge_sim.schema.plain_values import plain_message
from rosbridge_sim.shell.bags.bag_reader import BagTypes, open_reader, read_messages

if TYPE_CHECKING:
    from rosbags.interfaces import Connection


@dataclass(frozen=True, slots=True)
class Selection:
    """Selection of messages to play.

    Attributes:
        topics: names in the bag; empty means all.
        names: name in the bag -> another name.
        start, end: part of the bag, from its beginning [s].
        rate: factor of the speed.
        is_looping: begin again at the end.
    """

    topics: tuple[str, ...]
    names: Mapping[str, str]
    start: float
    end: float
    rate: float
    is_looping: bool


async def play(bridge: Bridge, file: str, selection: Selection, sources: DefinitionSources, *, is_json: bool) -> None:
    """Publish the messages of a bag.

    Args:
        sources: definitions for a bag without its own.
        is_json: print the result as JSON on stdout, not as a line for people.

    Raises:
        DocumentError: the bag cannot be read.
        RefusedError: the server takes none of the topics.
    """
    path = Path(file)
    target = 2 if await is_ros2(bridge) else 1
    types = BagTypes(read_texts(sources), is_ros1=path.suffix == ".bag")
    with open_reader(path) as bag:
        player = _Player(bridge, types, selection, target)
        chosen = [one for one in bag.connections if not selection.topics or one.topic in selection.topics]
        await player.advertise(chosen)
        note(f"playing {file}, {len(player.decoders)} of {len({one.topic for one in chosen})} topics; Ctrl-C ends it")
        while True:
            begin, num_before = bridge.now() - selection.start / selection.rate, player.num_sent
            for connection, stamp_ns, raw in read_messages(bag, chosen, path):
                at = (stamp_ns - bag.start_time) / 1e9
                if selection.start <= at <= selection.end:
                    await player.publish(connection, raw, begin + at / selection.rate)
            if not selection.is_looping or player.num_sent == num_before:
                break
    await player.settle()
    if is_json:
        put_json({"file": file, "messages": player.num_sent})
    else:
        note(f"published {player.num_sent:,} messages of {file}")


class _Player:
    """The publisher of one bag.

    Attributes:
        decoders: topic in the bag -> reader of its bytes, of the topics that the server takes.
        num_sent: number of published messages.
    """

    def __init__(self, bridge: Bridge, types: BagTypes, selection: Selection, target: int) -> None:
        self.decoders: dict[str, Callable[[bytes], object]] = {}
        self.num_sent = 0
        self._bridge = bridge
        self._types = types
        self._names = selection.names
        self._target = target
        self._ids: dict[str, str] = {}  # of the op that announced a topic
        self._said: set[str] = set()

    def _name(self, topic: str) -> str:
        return absolute(self._names.get(topic, topic))

    async def advertise(self, connections: list[Connection]) -> None:
        """Announce the topics.

        Raises:
            RefusedError: the server takes none.
        """
        for one in connections:
            if one.topic not in self.decoders:
                try:
                    self.decoders[one.topic] = json_reader(self._types, one, self._target)
                except DocumentError as error:
                    note(f"{error}: it is left out")
                    continue
                kind = one.msgtype if self._target != 1 else one.msgtype.replace("/msg/", "/")
                advertise_id = await self._bridge.send("advertise", topic=self._name(one.topic), type=kind)
                self._ids[advertise_id] = one.topic
        await self.settle()
        if not self.decoders:
            raise RefusedError(
                "no topic of the bag can be played; --remap OLD:=NEW plays one under another name, and"
                " rosbridge-sim docs reference/replay tells how this simulator replays a drive itself"
            )

    async def settle(self) -> None:
        """Wait until the server has handled all ops: the answer of a call comes behind its reports about them."""
        await self._bridge.call("/rosapi/get_time", {}, self._bridge.patience)
        for frame in self._bridge.take_inbox():
            self._hear(frame)

    def _hear(self, frame: Frame) -> None:
        """Print what the server says, each text once; leave out a topic that it refuses."""
        if frame.get("op") != "status" or frame.get("level") not in {"error", "warning"}:
            return
        topic, text = self._ids.get(str(frame.get("id"))), str(frame.get("msg"))
        if topic is not None and frame["level"] == "error":
            self.decoders.pop(topic, None)
            text = f"{text}; it is left out"
        if text not in self._said and len(self._said) < MAX_SAID:
            self._said.add(text)
            note(f"the server says: {text}")

    async def publish(self, connection: Connection, raw: bytes, at: float) -> None:
        """Publish a message at its time of the event loop [s], if its topic is played."""
        decode = self.decoders.get(connection.topic)
        if decode is None:
            return
        while (frame := await self._bridge.receive(at)) is not None:
            self._hear(frame)
        msg = decode(raw)
        await self._bridge.send("publish", topic=self._name(connection.topic), msg=msg)
        self.num_sent += 1


MAX_SAID = 100
"""Different texts of a server that are printed."""


def json_reader(types: BagTypes, connection: Connection, target: int) -> Callable[[bytes], Any]:
    """Return a function from the bytes of a topic's messages to JSON; it raises DocumentError if they do not fit.

    Args:
        types: those of the bag.
        connection: that of the topic.
        target: generation of ROS of the JSON.

    Raises:
        DocumentError: the type is unknown.
    """
    read, fields = types.decoder(connection), types.fields_of(connection)

    def decode(raw: bytes) -> object:
        try:
            return _to_wire(plain_message(read(raw), fields), target)
        except Exception as error:  # noqa: BLE001 - bytes from outside, by a definition from outside
            raise DocumentError(f"{connection.topic}: a message does not fit its type: {error}") from None

    return decode


def _to_wire(value: object, target: int) -> object:
    """Return a message of a bag as JSON of a generation: base64 for bytes, and the names of that generation's times."""
    if isinstance(value, bytes):
        return base64.b64encode(value).decode()
    if isinstance(value, list):
        return [_to_wire(one, target) for one in value]
    if not isinstance(value, dict):
        return value
    if target == 1 and value.keys() == {"sec", "nanosec"}:
        return {"secs": value["sec"], "nsecs": value["nanosec"]}
    is_header = value.keys() == {"seq", "stamp", "frame_id"}
    return {
        name: _to_wire(one, target) for name, one in value.items() if not (is_header and target != 1 and name == "seq")
    }
