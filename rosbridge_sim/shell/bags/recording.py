"""A recorder: one more listener on the bus, who writes down what he hears.

Unless patterns choose, he listens to what the simulator publishes and to what it listens to itself: its state and its
commands. That decides itself when somebody advertises or subscribes, so the bus tells of both. Each message gets the
simulation's time as its stamp. Bytes are those of the bag's ROS generation: the message's own where the server speaks
the same one, else these in the other's spelling, which rosbags knows. The few types that differ in more than that are
read once more from their JSON text, as the other generation's.

A disk that is full ends the recording and nothing else, and so does a file that was deleted or moved, which is noticed
at the next flush: the world goes on, and the log says so.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from rosbridge_sim.errors import DocumentError, EncodingError, GraphError, PeerError
from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.participant import Participant
from rosbridge_sim.graph.policy import Rule
from rosbridge_sim.graph.topics_services import Topic
from rosbridge_sim.schema.message import Message
from rosbridge_sim.schema.message_spec import MessageSpec
from rosbridge_sim.schema.message_type import MessageType
from rosbridge_sim.schema.store import Store
from rosbridge_sim.shell.bags.bag import Bag, BagGoneError, Channel

__all__ = ["FLUSH_PERIOD", "BagMessageWriter", "Recorder"]

MAX_TOPICS = 10_000
"""Topics of one recording. A topic that is recorded is never forgotten: without a bound a client that advertises ever
new names under `--record-topics '*'` would fill the memory."""

FLUSH_PERIOD = 1.0
"""Between two flushes [s]: what a crash may cost."""

_log = logging.getLogger("rosbridge_sim.recording")


@dataclass(frozen=True, slots=True)
class _Track:
    """A topic in a bag.

    Attributes:
        type: of the bag's generation.
        channel: the bag's own name for it.
        recode: a message's bytes at the source -> those in the bag; None where they must be made from its value.
    """

    type: MessageType
    channel: Channel
    recode: Callable[[bytes], bytes] | None


def _layout(spec: MessageSpec) -> list[object]:
    """What decides in which order a type's bytes stand; equal in both generations for nearly all types."""
    layout: list[object] = []
    for field_spec in spec.fields.values():
        one = field_spec.definition
        if spec.name == "std_msgs/Header" and one.name == "seq":
            continue  # ROS 2 has none, and whoever recodes knows it
        layout += [one.array, one.is_bounded, one.type if field_spec.nested is None else _layout(field_spec.nested)]
    return layout


class BagMessageWriter:
    """Writes messages of any topics into a bag.

    Attributes:
        num_messages: written so far.
        num_bytes: of these messages.
    """

    def __init__(self, bag: Bag, store: Store, source: Store | None = None) -> None:
        """A scribe for a bag whose topics are not known yet.

        Args:
            bag: open; the scribe closes it.
            store: of the bag's generation.
            source: whose messages `write` gets; None where that is the same one.
        """
        assert bag.ros == store.ros
        self.num_messages = 0
        self.num_bytes = 0
        self._bag = bag
        self._store = store
        self._source = source or store
        self._channels: dict[str, _Track] = {}

    def add(self, topic: str, type_name: str, *, is_latching: bool = False) -> None:
        """Get ready for a topic.

        Raises:
            PeerError: its type is not known, or nobody knows how it is written.
            DocumentError: the disk does not take it.
        """
        if topic in self._channels:
            return
        message_type = self._store.message(type_name)
        message_type.encode_raw(message_type.default())  # a type that cannot be written complains now
        text = self._store.full_text(message_type.name)
        channel = self._bag.add(topic, message_type.name, text, latching=is_latching)
        self._channels[topic] = _Track(message_type, channel, self._recoder(message_type))

    def _recoder(self, message_type: MessageType) -> Callable[[bytes], bytes] | None:
        """What makes the bag's bytes from those of the source; None where that takes more than their order."""
        if self._source.ros == self._store.ros:
            return bytes
        try:
            other = self._source.message(message_type.name)
        except PeerError:
            return None
        if _layout(other.spec) != _layout(message_type.spec):
            return None
        full_name = message_type.name.replace("/", "/msg/")
        ros2 = self._store if self._store.ros != 1 else self._source  # rosbags goes by the definition of ROS 2
        types = get_typestore(Stores.EMPTY)
        types.register(get_types_from_msg(ros2.full_text(message_type.name), full_name))
        recode = types.cdr_to_ros1 if self._store.ros == 1 else types.ros1_to_cdr
        return lambda raw: bytes(recode(raw, full_name))

    def write(self, topic: str, message: Message, stamp_ns: int) -> None:
        """Add a message of the source.

        Raises:
            PeerError: it cannot be written, or the topic has another type by now: a bag has one for each topic.
            EncodingError: the same, by a bug of ours or of a library.
            DocumentError: the disk does not take it.
        """
        track = self._channels[topic]
        if message.type.name != track.type.name:
            raise GraphError(f"expected {track.type.name}, as the topic began; got {message.type.name}")
        if track.recode is None:
            self.write_json(topic, message.json, stamp_ns)
            return
        raw = message.raw
        try:
            recoded = track.recode(raw)
        except Exception as error:
            raise _failure(track.type, error) from error
        self._write(topic, recoded, stamp_ns)

    def write_json(self, topic: str, body: bytes, stamp_ns: int) -> None:
        """Add a message that is given as JSON text.

        Raises:
            PeerError: it does not fit its type.
            EncodingError: it cannot be written, by a bug of ours or of a library.
            DocumentError: the disk does not take it.
        """
        message_type = self._channels[topic].type
        try:
            raw = message_type.encode_raw(message_type.decode_json(body, stamp_ns))
        except PeerError:
            raise
        except Exception as error:
            raise _failure(message_type, error) from error
        self._write(topic, raw, stamp_ns)

    def _write(self, topic: str, raw: bytes, stamp_ns: int) -> None:
        self._bag.write(self._channels[topic].channel, stamp_ns, raw)
        self.num_messages += 1
        self.num_bytes += len(raw)

    def flush(self) -> None:
        """What was written is to survive a crash."""
        self._bag.flush()

    def close(self) -> None:
        """Finish the bag.

        Raises:
            DocumentError: the disk does not take its end; the file is left as it is.
        """
        try:
            self._bag.close()
        except DocumentError:
            self._bag.abort()
            raise

    def abort(self) -> None:
        """Leave the file as it is."""
        self._bag.abort()


def _failure(message_type: MessageType, error: Exception) -> EncodingError:
    return EncodingError(f"{message_type.name} cannot be written into the bag: {error!r:.200}")


class Recorder:
    """A listener who writes a bag. An `Participant` on the bus.

    Attributes:
        name: as rosapi shows it.
        writer: what he writes with.
    """

    name = "/recorder"

    def __init__(
        self,
        bus: Bus,
        writer: BagMessageWriter,
        path: Path,
        *,
        simulator: Participant | None = None,
        patterns: tuple[str, ...] = (),
        loop: asyncio.AbstractEventLoop,
    ) -> None:
        """Record from now on, until `stop`.

        Args:
            bus: whose topics.
            writer: for an empty bag.
            path: of the bag, for the log.
            simulator: whose topics and commands are meant where there are no patterns; None means all there are.
            patterns: of the topics to record.
            loop: whose time says when to flush.
        """
        self.writer = writer
        self._bus = bus
        self._path = path
        self._simulator = simulator
        self._rule = Rule(patterns) if patterns else None
        self._loop = loop
        self._seen: set[Topic] = set()
        self._is_full = False  # and the log says so
        self._given_up: set[Topic] = set()
        self._is_on = True
        self._timer = loop.call_later(FLUSH_PERIOD, self._tick)
        for topic in list(bus.topics.values()):
            self._look(topic)
        bus.on_topic.append(self._look)
        _log.info("recording into %s", path)

    def notify(self, level: str, text: str) -> None:
        """What the bus has to say to the recorder goes into the log."""
        _log.log(logging.getLevelNamesMapping().get(level.upper(), logging.WARNING), "%s", text)

    def stop(self) -> None:
        """Finish the bag; twice is no error."""
        if self._is_on:
            self._leave()
            try:
                self.writer.close()
            except BagGoneError as error:
                _log.error("the recording has ended: %s", error)
            except DocumentError as error:
                _log.error("the recording has no index: %s", error)
            except Exception as error:  # noqa: BLE001 - our own bug, or the writer's
                self._bus.guard.note("the end of the recording", error)
                self.writer.abort()
            else:
                _log.info("recorded %d messages into %s", self.writer.num_messages, self._path)

    def fail(self, error: Exception) -> None:
        """See `Guarded`: the recording ends, and what was written stays as it is."""
        if not self._is_on:
            return
        _log.error(
            "the recording has ended by a bug of ours; `rosbridge-sim bag repair` makes it readable", exc_info=error
        )
        try:
            self._leave()
        finally:
            self.writer.abort()

    # What he listens to

    def _look(self, topic: Topic) -> None:
        """Somebody publishes or listens there, perhaps for the first time."""
        if topic in self._seen or not self._is_on or not topic.is_settled or not self._is_wanted(topic):
            return
        if len(self._seen) >= MAX_TOPICS:
            if not self._is_full:
                self._is_full = True
                _log.warning("%s: no further topics are recorded: %s are recorded already", self._path, MAX_TOPICS)
            return
        self._seen.add(topic)  # before he subscribes, for that is told too
        if self._guard(lambda: self.writer.add(topic.name, topic.type.name, is_latching=topic.is_latching), topic):
            self._bus.subscribe(self, topic.name, self._write, is_general=self._rule is None, is_recording=True)
            for message in topic.latched:
                try:
                    self._write(topic, message, self, 0.0)
                except EncodingError as error:
                    self._bus.guard.note_encoding(topic.name, error)

    def _is_wanted(self, topic: Topic) -> bool:
        if self._rule is not None:
            return self._rule.admits(topic.name)
        simulator = self._simulator
        return (
            simulator is None
            or simulator in topic.publishers
            or any(subscription.owner is simulator for subscription in topic.subscriptions)
        )

    # What he writes

    def _write(self, topic: Topic, message: Message, _sender: Participant, _now: float) -> None:
        if self._is_on:  # a message of the same delivery, or one of several that are latched, may have ended it
            time_ns = self._bus.time_ns
            self._guard(lambda: self.writer.write(topic.name, message, time_ns), topic)

    def _guard(self, work: Callable[[], None], topic: Topic | None = None) -> bool:
        """Do it, and return whether it went well. The log says what goes wrong, and nobody else is told.

        Raises:
            EncodingError: a message cannot be written, by a bug of ours: that concerns its publisher too.
        """
        try:
            work()
        except EncodingError:
            raise
        except PeerError as error:
            if topic is not None and topic not in self._given_up:
                self._given_up.add(topic)
                _log.warning("%s is not recorded, or not all of it: %s", topic.name, error)
            return False
        except DocumentError as error:
            self._leave()
            self.writer.abort()
            advice = "" if isinstance(error, BagGoneError) else "; `rosbridge-sim bag repair` makes it readable"
            _log.error("the recording has ended: %s%s", error, advice)
            return False
        return True

    def _tick(self) -> None:
        self._timer = self._loop.call_later(FLUSH_PERIOD, self._tick)
        try:
            self._guard(self.writer.flush)
        except Exception as error:  # noqa: BLE001 - our own bug, or the writer's
            self._bus.guard.blame(self, error)

    def _leave(self) -> None:
        self._is_on = False
        self._timer.cancel()
        self._bus.on_topic.remove(self._look)
        self._bus.leave(self, self._loop.time())
