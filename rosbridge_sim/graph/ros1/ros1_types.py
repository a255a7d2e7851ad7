"""Types as nodes of ROS 1 know them: md5 sum and full definition, and their bytes.

A bus of ROS 2 has other fields in a few types. Their messages pass through JSON, in which both spellings of times are
accepted. Types of packages that are unknown here are learnt from the definitions that other nodes send.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Final

from rosbridge_sim.errors import DocumentError, FieldError, GraphError, PeerError
from rosbridge_sim.graph.gateway.far_graph import FarServiceType
from rosbridge_sim.loose_types import Struct
from rosbridge_sim.schema.definitions.md5 import message_md5, service_md5
from rosbridge_sim.schema.message import Message
from rosbridge_sim.schema.message_type import MessageType
from rosbridge_sim.schema.ros_reading import RosReaders
from rosbridge_sim.schema.store import Store

MAX_LEARNT: Final = 4 * 2**20
"""Most text of definitions that is learnt from other nodes [characters]; a thousand types have a million."""

MAX_DEPTH: Final = 50
"""Deepest nesting of messages in such a definition; real ones have ten levels."""

MAX_VALUES: Final = 20_000
"""Most values in the default of such a type: making one takes 20 ms."""


class Ros1Type:
    """A message type as nodes of ROS 1 know it; `Ros1Types` makes it.

    Attributes:
        name: `pkg/Type`.
        type: the type in the store of the bus.
        has_same_bytes: the bus has the bytes of ROS 1, too.
        md5: sum of the definition.
    """

    def __init__(self, message_type: MessageType, ros1: MessageType, readers: RosReaders) -> None:
        """Find whether messages can pass.

        Raises:
            FieldError: the type has other fields in the other generation.
        """
        self.name = ros1.name
        self.type = message_type
        self.has_same_bytes = message_type is ros1
        self._ros1 = ros1
        self._readers = readers
        self.md5 = message_md5(ros1.spec)
        try:
            self.decode(self.encode(Message(self.type, self.type.default())), 0)
        except PeerError as error:
            raise FieldError(f"{self.name} has other fields in ROS 1; it passes with --ros 1: {error}") from None

    def encode(self, message: Message) -> bytes:
        """Return the bytes of a message, made once for all who want them.

        Raises:
            PeerError: it cannot be written.
        """
        if self.has_same_bytes:
            return message.raw
        return message.shared("ROS 1", lambda: self._ros1.encode_raw(self._ros1.decode_json(message.json, 0)))

    def decode(self, raw: bytes, stamp_ns: int) -> Struct:
        """Return the checked value of a message.

        Raises:
            FieldError: the bytes are not a message of the type, or it has too many parts.
        """
        value = self._readers.read(self._ros1.spec, raw)
        return value if self.has_same_bytes else self.type.decode_json(self._ros1.encode_json(value), stamp_ns)


class Ros1Types:
    """The types of one store as nodes of ROS 1 know them, each made at its first use.

    Args:
        ros1: the same types in the form of ROS 1; `store` itself if it has that.
        find_service_text: returns the definition of a service from an installation of ROS; None if there is none.
    """

    def __init__(
        self, store: Store, ros1: Store, find_service_text: Callable[[str], str | None] = lambda _name: None
    ) -> None:
        assert ros1.ros == 1
        self._store = store
        self._ros1 = ros1
        self._find_service_text = find_service_text
        self._readers = RosReaders()
        self._types: dict[str, Ros1Type] = {}
        self._services: dict[str, FarServiceType] = {}
        self._num_learnt = 0

    def find(self, name: str) -> Ros1Type:
        """Return a type.

        Args:
            name: `pkg/Type`, in any spelling.

        Raises:
            PeerError: no such type is known here, or it has other fields in the other generation.
        """
        canonical = self._ros1.canonical(name)
        known = self._types.get(canonical)
        if known is None:
            here, there = self._store.message(canonical), self._ros1.message(canonical)
            known = self._types[canonical] = Ros1Type(here, there, self._readers)
        return known

    def find_service(self, name: str) -> FarServiceType:
        """Return the type of a service; the arguments and errors are those of `find`."""
        canonical = self._ros1.canonical(name)
        known = self._services.get(canonical)
        if known is None:
            if not self._ros1.has(canonical, "srv") and (text := self._find_service_text(canonical)) is not None:
                self._learn({_key(canonical, "srv"): text})
            own, there = self._store.service(canonical), self._ros1.service(canonical)
            request = Ros1Type(own.request, there.request, self._readers)
            response = Ros1Type(own.response, there.response, self._readers)
            md5 = service_md5(there.request.spec, there.response.spec)
            known = self._services[canonical] = FarServiceType(canonical, request, response, md5)
        return known

    def text(self, name: str) -> str:
        """Return the full definition of a message, with those of all types in it."""
        return self._ros1.full_text(name)

    def is_known(self, name: str) -> bool:
        """Return True if a type of this name is known."""
        try:
            self._ros1.message(name)
        except PeerError:
            return False
        return True

    def learn(self, name: str, full_text: str, md5: str) -> None:
        """Take the definition of a type from another node; nothing changes if it is known already.

        Args:
            name: `pkg/Type`.
            md5: its sum, which the text must have.

        Raises:
            PeerError: the definition cannot be used, and the type stays unknown.
        """
        if self.is_known(name):
            return
        first, *others = full_text.split(f"\n{'=' * 80}\nMSG: ")
        parts = [(name, first), *((title.strip(), text) for title, _, text in (one.partition("\n") for one in others))]
        try:
            texts = {_key(self._ros1.canonical(one), "msg"): text for one, text in parts if not self.is_known(one)}
            store = self._ros1.with_texts(texts)
            _weigh(store, name, 0, {})
            found = message_md5(store.message(name).spec)
        except (PeerError, DocumentError) as error:
            raise GraphError(f"the definition of {name} that a node sent cannot be used: {error}") from None
        if found != md5:
            raise GraphError(f"the definition of {name} that a node sent has the md5 sum {found}, and it names {md5}")
        self._learn(texts)

    def _learn(self, texts: Mapping[tuple[str, str, str], str]) -> None:
        """Add definitions of types that are unknown."""
        self._num_learnt += sum(map(len, texts.values()))
        if self._num_learnt > MAX_LEARNT:
            raise GraphError(f"definitions of other nodes have more than {MAX_LEARNT:,} characters in all")
        self._store.add(texts)
        if self._ros1 is not self._store:
            self._ros1.add(texts)


def _key(name: str, kind: str) -> tuple[str, str, str]:
    package, _, short = name.partition("/")
    return package, kind, short


def _weigh(store: Store, name: str, depth: int, known: dict[str, int]) -> int:
    """Return the number of values in the default of a message, which a few lines can make endless.

    Args:
        known: messages that were weighed before.

    Raises:
        GraphError: there are too many, or too deep.
    """
    if name not in known:
        if depth > MAX_DEPTH:
            raise GraphError(f"messages in messages are nested more than {MAX_DEPTH} deep")
        total = 0
        for field in store.definition(name).fields:
            weight = _weigh(store, field.type, depth + 1, known) if "/" in field.type else 1
            total += weight if field.is_bounded or field.array is None else weight * field.array
        if total > MAX_VALUES:
            raise GraphError(f"{name} has more than {MAX_VALUES:,} values by default")
        known[name] = total
    return known[name]
