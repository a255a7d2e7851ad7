"""A reader of bags for replays: bags of both ROS generations, from this package and from real MORAI users.

It selects topics by type; if several topics have one type, by name. It reads the states of all egos and the object list
of the first one; from `ReplayInfo` it takes only what these lack. Definitions come from the bag. If the bag has none
that can be read (for years, rosbag2 stored none), those of the current release are used.
"""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import partial
from operator import itemgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from rosbridge_sim.errors import DocumentError, PeerError
from rosbridge_sim.graph.participant import resolve
from rosbridge_sim.loose_types import Struct
from rosbridge_sim.records import replace
from rosbridge_sim.schema.plain_values import plain_message
from rosbridge_sim.schema.store import Store
from rosbridge_sim.shell.files.definitions import Texts
from rosbridge_sim.simulator.replays.object_list_decoder import LAYOUT, decode_object_lists
from rosbridge_sim.simulator.replays.recorded_drive import Recording
from rosbridge_sim.simulator.replays.recorded_plans import (
    MAX_CLOUD_BYTES,
    MAX_PLAN_BYTES,
    MAX_PLAN_MESSAGE,
    MAX_PLAN_TOPICS,
    PLAN_TYPES,
    RecordedPlan,
)
from rosbridge_sim.simulator.replays.recording_builder import RecordingBuilder

if TYPE_CHECKING:  # an import of a tenth of a second that only a replay needs
    from rosbags.interfaces import Connection
    from rosbags.rosbag1 import Reader as Reader1
    from rosbags.rosbag2 import Reader as Reader2
    from rosbags.typesys.store import Typestore

_EGO, _OBJECTS, _INFO = (f"morai_msgs/msg/{name}" for name in ("EgoVehicleStatus", "ObjectStatusList", "ReplayInfo"))
_FURTHER_EGO: Final = re.compile(r"/Ego-(\d{1,9})/", re.ASCII)  # more digits are a name, not an ego's number
_USUAL: Final = {_EGO: "/Ego_topic", _OBJECTS: "/Object_topic", _INFO: "/ReplayInfo_topic"}

_CLOUD: Final = "sensor_msgs/PointCloud2"

MAX_UNCLEAR: Final = 100
"""Topics with states of egos that are looked at for the numbers of the egos."""

MAX_EGO_TOPICS: Final = 100
"""Topics with states of egos that are replayed: as many as a world may have egos, and more."""

_BREATH: Final = 100
"""Messages after which a thread that reads lets other threads run."""


def read_recording(path: Path, reading: RecordingBuilder, texts: Texts) -> Recording:
    """Return the recording in a bag; an empty one if there is nothing to replay.

    Args:
        path: `.bag`, `.mcap`, `.db3`, or a folder of rosbag2.
        reading: a new builder; takes the messages.
        texts: definitions for a bag without its own.

    Raises:
        DocumentError: the bag is broken, is not a bag, or is too large.
    """
    with open_reader(path) as bag:
        types = BagTypes(texts, is_ros1=path.suffix == ".bag")
        egos = _find_egos(bag, path, types)
        chosen = _choose(bag.connections, egos, reading)
        held = {one.msgtype for one in chosen}
        start_ns: int | None = None
        for connection in chosen:
            take = _taker(connection, held, egos[connection.topic], reading, types)
            for _, stamp_ns, raw in read_messages(bag, [connection], path):
                start_ns = stamp_ns if start_ns is None else min(start_ns, stamp_ns)
                try:
                    take(raw, stamp_ns)
                except DocumentError:
                    raise
                except Exception as error:  # noqa: BLE001 - bytes from outside, by a definition from outside
                    what = f"{connection.topic}: {_first_line(error)}"
                    raise DocumentError(f"{path.name}: a message does not fit its type: {what}") from None
        plans = _read_plans(bag, path, start_ns or 0, types, reading=reading) if chosen else ()
    recording = replace(reading.finish(), plans=plans)
    _ = recording.digest  # kept with it: later it would keep the event loop waiting
    return recording


def _taker(
    connection: Connection, held: set[str], index: int, reading: RecordingBuilder, types: BagTypes
) -> Callable[[bytes, int], None]:
    """Return a function that takes the bytes of a topic's messages and their stamps in the bag [ns].

    Args:
        connection: connection of the topic.
        held: types of all topics that are read.
        index: number of the topic's ego.
        reading: takes the contents of the messages.
        types: of the bag.

    Raises:
        DocumentError: the type is unknown.
    """
    decode = types.decoder(connection)
    if connection.msgtype == _EGO:

        def take_ego(raw: bytes, stamp_ns: int) -> None:
            message: Any = decode(raw)
            reading.take_ego(index, message, (_stamp_of(message), stamp_ns))

        return take_ego

    has_pedals = connection.msgtype == _INFO
    is_ego_here, are_objects_here = _EGO in held and has_pedals, _OBJECTS in held and has_pedals
    is_known = types.is_known(connection)

    def take_lists(raw: bytes, stamp_ns: int) -> None:
        pedals: Any  # both kinds of readers name the fields as in the message
        if is_known:
            skimmed = decode_object_lists(raw, is_cdr=not types.is_ros1, has_pedals=has_pedals)
            stamps, pedals = (skimmed.stamp_ns, stamp_ns), skimmed.pedals
            if not are_objects_here:
                reading.take_sample(skimmed.who, skimmed.figures, stamps)
        else:
            pedals = decode(raw)
            stamps = _stamp_of(pedals), stamp_ns
            if not are_objects_here:
                reading.take_objects(pedals, stamps)
        if has_pedals and not is_ego_here:
            reading.take_pedals(pedals, stamps)

    return take_lists


def _read_plans(
    bag: Reader1 | Reader2, path: Path, start_ns: int, types: BagTypes, *, reading: RecordingBuilder
) -> tuple[RecordedPlan, ...]:
    """Return what programs published that viewers draw; topics that cannot be read, and what is too much, are noted.

    Names are checked and readers of bytes are compiled here, because this is a thread that nobody waits for.

    Args:
        bag: the open bag.
        path: of the bag.
        start_ns: time in the bag at which the recording begins [ns].
        types: of the bag.
        reading: takes the notes.

    Raises:
        DocumentError: the bag is broken.
    """
    found: dict[tuple[str, str], list[tuple[int, bytes]]] = {}
    decoders: dict[tuple[str, str], Callable[[bytes], object]] = {}
    num_bytes = num_beyond = num_long = 0
    for connection in bag.connections:
        key = connection.topic, connection.msgtype.replace("/msg/", "/")
        most_bytes = MAX_CLOUD_BYTES if key[1] == _CLOUD else MAX_PLAN_MESSAGE
        if key[1] not in PLAN_TYPES or not connection.msgcount:
            continue
        if key not in decoders and len(decoders) >= MAX_PLAN_TOPICS:
            num_beyond += 1
            continue
        time.sleep(0)
        try:
            resolve(connection.topic)
            decoders[key] = _plain_decoder(connection, types)
        except (DocumentError, PeerError) as error:
            reading.note(f"{error}: it is left out")
            continue
        messages = found.setdefault(key, [])
        for _, stamp_ns, raw in read_messages(bag, [connection], path):
            if len(raw) > most_bytes:
                num_long += 1
                continue
            num_bytes += len(raw)
            if num_bytes > MAX_PLAN_BYTES:
                reading.note(f"{connection.topic}: only the first {MAX_PLAN_BYTES // 1_000_000} MB of plans are kept")
                break
            messages.append((stamp_ns - start_ns, raw))
    if num_beyond:
        reading.note(f"{num_beyond} topics with plans are left out: at most {MAX_PLAN_TOPICS} are replayed")
    if num_long:
        mb, cloud_mb = MAX_PLAN_MESSAGE / 1e6, MAX_CLOUD_BYTES / 1e6
        reading.note(f"{num_long} messages with plans are left out: above {mb:g} MB, or {cloud_mb:g} MB of a cloud")
    return tuple(
        [
            RecordedPlan(*key, [stamp_ns for stamp_ns, _ in ordered], [raw for _, raw in ordered], decoders[key])
            for key, messages in found.items()
            if (ordered := sorted(messages, key=itemgetter(0)))
        ]
    )


def _plain_decoder(connection: Connection, types: BagTypes) -> Callable[[bytes], object]:
    """Return a function from the bytes of a topic's messages to plain objects.

    Raises:
        DocumentError: the type is unknown.
    """
    read, fields = types.decoder(connection), types.fields_of(connection)

    def decode(raw: bytes) -> object:
        try:
            message = read(raw)
            num_bytes = len(raw) - getattr(getattr(message, "data", None), "nbytes", 0)
            if num_bytes <= MAX_PLAN_MESSAGE:
                return plain_message(message, fields)
        except Exception as error:  # noqa: BLE001 - bytes from outside, by a definition from outside
            raise DocumentError(f"it does not fit its type: {_first_line(error)}") from None
        raise DocumentError(
            f"expected at most {MAX_PLAN_MESSAGE:,} bytes beside those of its points, got {num_bytes:,}"
        )

    return decode


def _stamp_of(message: Struct) -> int:
    stamp = message.header.stamp
    return int(stamp.sec * 1_000_000_000 + stamp.nanosec)


def _choose(connections: list[Connection], egos: Mapping[str, int], reading: RecordingBuilder) -> list[Connection]:
    """Return the topics to replay: the states of all egos, and one topic of each other type."""
    held = [one for one in connections if one.msgcount]
    chosen: dict[tuple[str, int], Connection] = {}
    for connection in sorted(held, key=lambda one: (one.topic != _USUAL.get(one.msgtype), one.topic)):
        index = egos[connection.topic]
        if connection.msgtype not in _USUAL or (index and connection.msgtype != _EGO):
            continue
        if index and (connection.msgtype, index) not in chosen and len(chosen) >= MAX_EGO_TOPICS:
            reading.note(f"{connection.topic} is left out: there are more than {MAX_EGO_TOPICS} egos")
            continue
        first = chosen.setdefault((connection.msgtype, index), connection)
        if first.topic != connection.topic:
            reading.note(f"{connection.topic} is left out: {first.topic} is replayed")
    types = {msgtype for msgtype, _ in chosen}
    if {_EGO, _OBJECTS} <= types:
        chosen = {key: one for key, one in chosen.items() if key[0] != _INFO}
    topics = {one.topic for one in chosen.values()}
    # A topic has several connections if several programs have published on it.
    return [one for one in held if one.topic in topics and one.msgtype in types]


def _find_egos(bag: Reader1 | Reader2, path: Path, types: BagTypes) -> dict[str, int]:
    """Return topic -> number of its ego.

    The number comes from the topic's prefix, or from its messages if several topics have other names.
    """
    egos: dict[str, int] = {}
    unclear: list[Connection] = []
    for connection in bag.connections:
        match = _FURTHER_EGO.match(connection.topic)
        egos[connection.topic] = int(match[1]) if match else 0
        if not match and connection.msgtype == _EGO and connection.msgcount:
            unclear.append(connection)
    if len({one.topic for one in unclear}) < 2 or any(one.topic == _USUAL[_EGO] for one in unclear):  # noqa: PLR2004
        return egos
    for connection in unclear[:MAX_UNCLEAR]:
        time.sleep(0)
        with suppress(Exception):  # errors in the bytes are reported when all messages are read
            _, _, raw = next(read_messages(bag, [connection], path))
            message: Any = types.decoder(connection)(raw)
            egos[connection.topic] = max(message.unique_id, 0)
    return egos


@contextmanager
def open_reader(path: Path) -> Iterator[Reader1 | Reader2]:
    """Return a bag's reader.

    Raises:
        DocumentError: it is not a bag, or its index is missing or broken.
    """
    from rosbags.rosbag1 import Reader as Reader1  # noqa: PLC0415 - see above
    from rosbags.rosbag2 import Reader as Reader2  # noqa: PLC0415

    try:
        reader = Reader1(path) if path.suffix == ".bag" else Reader2(path)
        reader.open()
    except OSError as error:
        raise DocumentError(f"{path.name}: cannot be read: {error.strerror or error}") from None
    except Exception as error:  # noqa: BLE001 - a library reads foreign bytes: any error means that they are broken
        raise DocumentError(
            f"{path.name}: is not a bag, or has no index: {_first_line(error)}"
            " (a bag gets its index at the end of the recording; if the recorder was killed, use"
            " `rosbridge-sim bag repair`)"
        ) from None
    try:
        if not all(isinstance(text, str) for one in reader.connections for text in (one.topic, one.msgtype)):
            # A column of SQLite holds values of any type.
            raise DocumentError(f"{path.name}: is broken: the name or type of a topic is not a text")
        yield reader
    finally:
        reader.close()


def read_messages(
    bag: Reader1 | Reader2, connections: list[Connection], path: Path
) -> Iterator[tuple[Connection, int, bytes]]:
    """Yield connection, stamp [ns] and bytes of each message of these topics, in order of the stamps.

    Args:
        bag: the open bag.
        connections: of the topics; at least one.
        path: of the bag, for errors.

    Raises:
        DocumentError: they are not where the index says, or are incomplete.
    """
    found = bag.messages(connections=connections)
    for i in range(sum(one.msgcount for one in connections)):
        if i % _BREATH == 0:
            time.sleep(0)
        try:
            message = next(found, None)
        except Exception as error:  # noqa: BLE001 - as above
            raise DocumentError(f"{path.name}: is broken: {_first_line(error)}") from None
        if message is None:
            return
        yield message


class BagTypes:
    """The types of a bag. Each is read and compiled once, which takes 10 to 50 ms: many topics may have one type.

    Attributes:
        is_ros1: the bytes of its messages are ROS 1 bytes; otherwise CDR.
    """

    def __init__(self, texts: Texts, *, is_ros1: bool) -> None:
        """Know no type yet.

        Args:
            texts: definitions for a bag without its own.
            is_ros1: see the class.
        """
        self.is_ros1 = is_ros1
        self._texts = texts
        self._stores: dict[tuple[str, str], Typestore] = {}
        self._own_fields: dict[str, object] | None = None

    def decoder(self, connection: Connection) -> Callable[[bytes], object]:
        """Return a function that reads the bytes of a topic's messages; it compiles nothing.

        Raises:
            DocumentError: the type is unknown.
        """
        store = self._store_of(connection)
        return partial(store.deserialize_ros1 if self.is_ros1 else store.deserialize_cdr, typename=connection.msgtype)

    def fields_of(self, connection: Connection) -> dict[str, Any]:
        """Return the fields of a topic's type and of those in it, by their names.

        Raises:
            DocumentError: the type is unknown.
        """
        return {name: found for name, (_, found) in self._store_of(connection).fielddefs.items()}

    def is_known(self, connection: Connection) -> bool:
        """Return True if object lists have the byte layout that `decode_object_lists` expects.

        Raises:
            DocumentError: the type is unknown.
        """
        if self._own_fields is None:
            self._own_fields = {
                name: fields
                for msgtype in (_OBJECTS, _INFO)
                for name, (_, fields) in _register(self._own_text(msgtype), msgtype).fielddefs.items()
            }
        own, fields = self._own_fields, self.fields_of(connection)
        return all(fields[name] == own[name] for name in LAYOUT if name in fields)

    def _store_of(self, connection: Connection) -> Typestore:
        """Return a topic's type with the types in it, from the bag's own definition if it can be read.

        Raises:
            DocumentError: the type is unknown.
        """
        from rosbags.interfaces import MessageDefinitionFormat  # noqa: PLC0415 - see above

        definition, name = connection.msgdef, connection.msgtype
        text = definition.data if definition.format == MessageDefinitionFormat.MSG else ""
        store = self._stores.get((name, text))
        if store is not None:
            return store
        try:
            store = _register(text or self._own_text(name), name)
            store.get_msgdef(name)
        except PeerError as error:
            raise DocumentError(f"{connection.topic}: {error}") from None
        except Exception as error:  # noqa: BLE001 - as above
            raise DocumentError(f"{connection.topic}: its definition cannot be read: {_first_line(error)}") from None
        self._stores[name, text] = store
        return store

    def _own_text(self, msgtype: str) -> str:
        """Return our definition of a type of a bag."""
        return Store(self._texts, ros=1 if self.is_ros1 else 2).full_text(msgtype.replace("/msg/", "/"))


def _register(text: str, msgtype: str) -> Typestore:
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore  # noqa: PLC0415 - see above

    types = get_typestore(Stores.EMPTY)
    types.register(get_types_from_msg(text, msgtype))
    return types


def _first_line(error: Exception) -> str:
    return (str(error).strip() or type(error).__name__).splitlines()[0][:200]
