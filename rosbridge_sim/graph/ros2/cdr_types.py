"""Messages as nodes of ROS 2 exchange them: CDR bytes, made and read for the types of a store of either generation.

The writer is the one of `ros_serialization.py`. A store of ROS 1 has the same layout for nearly all types, apart from
the `seq` of a header, which ROS 2 does not have; the few others go through JSON and the type of ROS 2. The reader is
that of rosbags, which computes ROS 2's hash of a type, too. What it read is checked like a body of any client. rosbags
can read definition texts, but its parser takes tens of milliseconds for each type, and the types are parsed already.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Mapping
from typing import Any, Final

from rosbags.interfaces import Nodetype
from rosbags.interfaces.typing import Fielddefs, Typesdict
from rosbags.typesys import Stores, get_typestore
from rosbags.typesys.store import Typestore

from rosbridge_sim.errors import FieldError, PeerError, Reason, TypeNameError
from rosbridge_sim.graph.gateway.far_graph import FarServiceType
from rosbridge_sim.graph.ros2.cdr_objects import count_objects
from rosbridge_sim.loose_types import Struct
from rosbridge_sim.records import Record
from rosbridge_sim.schema.definitions.message_spec import FieldSpec, MessageSpec, layout_of
from rosbridge_sim.schema.definitions.names import ros2_names, spelled
from rosbridge_sim.schema.message import Message
from rosbridge_sim.schema.message_type import MessageType
from rosbridge_sim.schema.plain_values import plain_message, without_unknown
from rosbridge_sim.schema.ros_serialization import RosWriters
from rosbridge_sim.schema.store import Store

MAX_OBJECTS: Final = 4_000
"""Most messages and texts within a message that is read: reading them takes 50 ms."""


class CdrType:
    """A message type as nodes of ROS 2 know it; `CdrTypes` makes it.

    Attributes:
        name: `pkg/msg/Type`.
        type: the type in the store of the bus.
        has_same_bytes: the bus has the bytes of ROS 2, too.
        hash: ROS 2's hash of the definition, `RIHS01_` and 64 hexadecimal digits.
        definitions: all types in it, itself included: `pkg/msg/Type` -> fields, in the form of rosbags.
    """

    def __init__(
        self, message_type: MessageType, cdr_type: MessageType, types: Typesdict, known: Typestore, *, is_same: bool
    ) -> None:
        self.name = spelled(cdr_type.name, "msg", 2)
        self.type = message_type
        self.has_same_bytes = is_same and message_type.spec.dialect.ros != 1
        self.hash = known.hash_rihs01(self.name)
        self.definitions: Mapping[str, Fielddefs] = {name: found for name, (_, found) in types.items()}
        self._cdr_type = cdr_type
        self._types = known
        self._is_same = is_same

    def encode(self, message: Message) -> bytes:
        """Return a message as CDR, with its four bytes of encapsulation; made once for all who want it.

        Raises:
            EncodingError: it cannot be written, because of an internal error.
        """
        if self.has_same_bytes:
            return message.raw
        return message.shared("CDR", lambda: self._encode(message))

    def _encode(self, message: Message) -> bytes:
        if self._is_same:
            return _WRITERS.serialize(self.type.spec, message.value)
        return self._cdr_type.encode_raw(self._cdr_type.decode_json(message.json, 0))

    def decode(self, raw: bytes, stamp_ns: int) -> Struct:
        """Return the checked value of a message.

        Args:
            raw: CDR, with its four bytes of encapsulation.
            stamp_ns: the present time, for a header without a stamp [ns].

        Raises:
            FieldError: the bytes are not a message of the type, or are too many.
        """
        try:
            count, length = count_objects(raw, self.name, self.definitions, MAX_OBJECTS)
        except (struct.error, IndexError):
            count = length = 0  # the reader finds the mistake, and words it
        if count > MAX_OBJECTS:
            why = f"{self.name}: expected at most {MAX_OBJECTS:,} messages and texts within a message; got more"
            raise FieldError(why, reason=Reason.TOO_MUCH)
        if 0 < length < len(raw):  # rclpy hands out its buffer, which may be longer than the message
            raw = raw[:length]
        try:
            value = plain_message(self._types.deserialize_cdr(raw, self.name), self.definitions)
        except Exception as error:  # noqa: BLE001 - a library reads foreign bytes: any error means that they are broken
            raise FieldError(f"{self.name}: the bytes are not a message of this type: {error!r:.100}") from None
        return self.type.check(value if self._is_same else without_unknown(value, self.type.spec), stamp_ns)


_WRITERS: Final = RosWriters(2)
"""Writers for types of ROS 1 that have the layout of ROS 2; a cache of pure functions."""


class CdrActionType(Record):
    """An action type as nodes of ROS 2 know it.

    Attributes:
        name: `pkg/action/Type`.
    """

    name: str
    goal: CdrType
    result: CdrType
    feedback: CdrType


class CdrTypes:
    """The types of one store as nodes of ROS 2 know them, each made at its first use.

    Args:
        ros2: the same types in the form of ROS 2; `store` itself if it has that.
    """

    def __init__(self, store: Store, ros2: Store) -> None:
        assert ros2.ros == 2  # noqa: PLR2004 - a generation
        self._store = store
        self._ros2 = ros2
        self._types: dict[str, CdrType | PeerError] = {}
        self._parts: dict[str, CdrType] = {}
        self._known = get_typestore(Stores.EMPTY)

    def find(self, name: str) -> CdrType:
        """Return a type.

        Args:
            name: `pkg/Type`, in any spelling.

        Raises:
            TypeNameError: ROS 2 has no such type, or none is known here.
            FieldError: nodes of ROS 2 cannot exchange it.
        """
        canonical = self._store.canonical(name)
        known = self._types.get(canonical)
        if known is None:
            try:
                known = self._make(self._store.message(canonical), self._ros2.message(canonical))
            except PeerError as error:
                known = error
            if len(self._types) >= _MAX_TYPES:
                self._types.clear()
            self._types[canonical] = known
        if isinstance(known, PeerError):
            raise known
        return known

    def find_service(self, name: str) -> FarServiceType:
        """Return a type; see `find`."""
        here, there = self._store.service(name), self._ros2.service(name)
        request, response = self._part(here.request, there.request), self._part(here.response, there.response)
        return FarServiceType(self._ros2.spelled(name, "srv"), request, response)

    def find_action(self, name: str) -> CdrActionType:
        """Return a type; see `find`."""
        here, there = self._store.action(name), self._ros2.action(name)
        parts = (self._part(getattr(here, one), getattr(there, one)) for one in ("goal", "result", "feedback"))
        return CdrActionType(self._ros2.spelled(name, "action"), *parts)

    def _part(self, here: MessageType, there: MessageType) -> CdrType:
        """Return a message type that is a part of a service or an action; see `find`."""
        known = self._parts.get(there.name)
        if known is None or known.type is not here:
            if len(self._parts) >= _MAX_TYPES:
                self._parts.clear()
            known = self._parts[there.name] = self._make(here, there)
        return known

    def _make(self, message_type: MessageType, cdr_type: MessageType) -> CdrType:
        name = message_type.name
        cdr_type.encode_raw(cdr_type.default())  # raises now if ROS 2 cannot write the type
        types: Typesdict = {name: ([], fields) for name, fields in _types_in(cdr_type.spec)}
        is_same = layout_of(message_type.spec) == layout_of(cdr_type.spec)
        if not is_same:
            try:
                cdr_type.decode_json(Message(message_type, message_type.default()).json, 0)
            except FieldError as error:
                raise FieldError(f"{name} has other fields in ROS 2; it passes with --ros 2: {error}") from None
        try:
            self._known.register(types)
            return CdrType(message_type, cdr_type, types, self._known, is_same=is_same)
        except Exception as error:  # noqa: BLE001 - a library that reads definitions of users
            raise TypeNameError(f"{name} cannot be used with ROS 2: {error!r:.100}") from None


_MAX_TYPES: Final = 10_000
"""Types that are remembered; a server knows fewer, unless clients name ever new ones."""


_TIMES: Final = {"time": "builtin_interfaces/msg/Time", "duration": "builtin_interfaces/msg/Duration"}

_TIME_FIELDS: Final[Fielddefs] = [("sec", (Nodetype.BASE, ("int32", 0))), ("nanosec", (Nodetype.BASE, ("uint32", 0)))]


def _types_in(spec: MessageSpec) -> Iterator[tuple[str, Fielddefs]]:
    """Yield a type of a store of ROS 2 and all types in it: `pkg/msg/Type`, and the fields."""
    names = {name: other for other, name in ros2_names(spec.fields).items()}
    yield (
        spelled(spec.name, "msg", 2),
        [(names.get(name, name), _described(field)) for name, field in spec.fields.items()],
    )
    for field in spec.fields.values():
        if field.nested is not None:
            yield from _types_in(field.nested)
        elif field.definition.type in _TIMES:
            yield _TIMES[field.definition.type], _TIME_FIELDS


def _described(field: FieldSpec) -> Any:  # noqa: ANN401 - rosbags' types have no name for it
    """Return the type of a field."""
    one = field.definition
    base: tuple[Nodetype, object]
    if field.nested is not None:
        base = (Nodetype.NAME, spelled(field.nested.name, "msg", 2))
    elif one.type in _TIMES:
        base = (Nodetype.NAME, _TIMES[one.type])
    else:
        base = (Nodetype.BASE, (one.type, one.max_chars or 0))
    if one.array is None:
        return base
    return (Nodetype.ARRAY if one.array and not one.is_bounded else Nodetype.SEQUENCE, (base, one.array))
