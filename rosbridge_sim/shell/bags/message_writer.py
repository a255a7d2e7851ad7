"""Messages of the bus, written into a bag in the bag's ROS generation.

If the server uses the same generation, the message's own bytes are written. Otherwise rosbags converts them. A few
types differ in more than the byte layout: for these, the message's JSON text is read as the other generation's type.
"""

from __future__ import annotations

from collections.abc import Callable

from rosbridge_sim.errors import DocumentError, EncodingError, GraphError, PeerError
from rosbridge_sim.records import Record
from rosbridge_sim.schema.definitions.message_spec import layout_of
from rosbridge_sim.schema.message import Message
from rosbridge_sim.schema.message_type import MessageType
from rosbridge_sim.schema.store import Store
from rosbridge_sim.shell.bags.bag import Bag, Channel, types_of


class _Track(Record):
    """A topic in a bag.

    Attributes:
        type: its type in the bag's generation.
        channel: the bag's own object for the topic.
        recode: converts a message's bytes from the source to the bag; None if they must be made from its value.
    """

    type: MessageType
    channel: Channel
    recode: Callable[[bytes], bytes] | None


class BagMessageWriter:
    """Writes messages of any topics into a bag.

    Attributes:
        num_messages: number of messages written.
        num_bytes: size of these messages [bytes].
    """

    def __init__(self, bag: Bag, store: Store, source: Store | None = None) -> None:
        """Start with an empty bag.

        Args:
            bag: an open bag; the writer closes it.
            store: types of the bag's generation.
            source: types of the messages for `write`; None if they are those of `store`.
        """
        assert bag.ros == store.ros
        self.num_messages = 0
        self.num_bytes = 0
        self._bag = bag
        self._store = store
        self._source = source or store
        self._channels: dict[str, _Track] = {}

    def add(self, topic: str, type_name: str, *, is_latching: bool = False) -> None:
        """Add a topic.

        Args:
            topic: its absolute name.
            type_name: `pkg/Type`.
            is_latching: late subscribers get the last message, too.

        Raises:
            PeerError: its type is unknown, or cannot be written.
            DocumentError: the disk fails.
        """
        if topic in self._channels:
            return
        message_type = self._store.message(type_name)
        message_type.encode_raw(message_type.default())  # raises now if the type cannot be written
        text = self._store.full_text(message_type.name)
        channel = self._bag.add(topic, message_type.name, text, latching=is_latching)
        self._channels[topic] = _Track(message_type, channel, self._recoder(message_type))

    def _recoder(self, message_type: MessageType) -> Callable[[bytes], bytes] | None:
        """Return a function from the source's bytes to the bag's; None if they differ in more than their layout."""
        if self._source.ros == self._store.ros:
            return bytes
        try:
            other = self._source.message(message_type.name)
        except PeerError:
            return None
        if layout_of(other.spec) != layout_of(message_type.spec):
            return None
        full_name = message_type.name.replace("/", "/msg/")
        ros2 = self._store if self._store.ros != 1 else self._source  # rosbags needs the definition of ROS 2
        types = types_of(message_type.name, ros2.full_text(message_type.name))
        recode = types.cdr_to_ros1 if self._store.ros == 1 else types.ros1_to_cdr
        return lambda raw: bytes(recode(raw, full_name))

    def write(self, topic: str, message: Message, stamp_ns: int) -> None:
        """Add a message of the source.

        Args:
            stamp_ns: its time [ns].

        Raises:
            PeerError: it cannot be written, or the topic now has another type: a bag has one type per topic.
            EncodingError: it cannot be written because of an internal error, or one of a library.
            DocumentError: the disk fails.
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

        Args:
            body: the message as JSON text.
            stamp_ns: its time [ns].

        Raises:
            PeerError: it does not fit its type.
            EncodingError: it cannot be written because of an internal error, or one of a library.
            DocumentError: the disk fails.
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
        """Write everything to the disk, so that it survives a crash."""
        self._bag.flush()

    def close(self) -> None:
        """Finish the bag.

        Raises:
            DocumentError: the disk fails; the file is left as it is.
        """
        try:
            self._bag.close()
        except DocumentError:
            self._bag.abort()
            raise

    def abort(self) -> None:
        """Leave the file as it is, without an index."""
        self._bag.abort()


def _failure(message_type: MessageType, error: Exception) -> EncodingError:
    return EncodingError(f"{message_type.name} cannot be written into the bag: {error!r:.200}")
