"""The part of Cyclone DDS that we use, private calls included; nothing else imports it.

`cyclonedds` offers no public way to send and take serialised bytes, so its version is pinned and its parts are checked
when it is loaded. `tests/shell/ros2/test_dds_library.py` is the contract.
"""

from __future__ import annotations

import ctypes
import importlib.util
import platform
import sys
from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import partial
from importlib.metadata import version
from typing import Any, Final

from rosbridge_sim.errors import DocumentError, GraphError
from rosbridge_sim.graph.gateway.quality import Quality
from rosbridge_sim.graph.ros2.ros2_names import dds_type
from rosbridge_sim.records import Record
from rosbridge_sim.shell.ros2.loopback import close_to_network

FITTING: Final = "11.0.1"
"""The version that this module supports, as in `pyproject.toml`."""


def check_library() -> None:
    """Load the library and check its version.

    Raises:
        DocumentError: it is not installed, does not exist for this system, or has another version.
    """
    why_not = why_no_library()
    if why_not is not None:
        raise DocumentError(f"ros2-domain: {why_not}")


def why_no_library() -> str | None:
    """Load the library; return why it cannot be used, None if it can."""
    if importlib.util.find_spec("cyclonedds") is None:
        where = ""
        if sys.version_info >= (3, 14) or (sys.platform == "linux" and platform.machine() != "x86_64"):
            system = f"Python {platform.python_version()} on {platform.system()} {platform.machine()}"
            where = f"; there is none for {system}"
        return f"needs the extra rosbridge-sim[ros2], that is cyclonedds=={FITTING}{where}, or rclpy of ROS 2"
    found = version("cyclonedds")
    if found != FITTING:
        return f"needs cyclonedds=={FITTING}, but {found} is installed"
    try:
        from cyclonedds import _clayer  # noqa: PLC0415 - 0.2 s, and only with --ros2-domain
    except Exception as error:  # noqa: BLE001 - a library with a part in C: any error means that it cannot be used here
        return f"cyclonedds cannot be loaded: {error!r:.200}"
    missing = [name for name in ("ddspy_write", "ddspy_take") if not hasattr(_clayer, name)]
    return f"this cyclonedds lacks {', '.join(missing)}; install it anew" if missing else None


# Its log


def quiet_library() -> None:
    """Have the library write errors alone to the error output: it writes a warning for each malformed message."""
    from cyclonedds.__library__ import library_path  # noqa: PLC0415 - as above

    with suppress(OSError, AttributeError):  # a build of the library elsewhere: more lines, and nothing else
        ctypes.CDLL(str(library_path)).dds_set_log_mask(ctypes.c_uint32(_FATAL | _ERROR))


_FATAL, _ERROR = 1, 2
"""`DDS_LC_FATAL`, `DDS_LC_ERROR` (dds/ddsrt/log.h)."""


# Types


class DdsTypes:
    """Types for the library, made from definitions in the form of rosbags; each once."""

    def __init__(self) -> None:
        self._made: dict[str, Any] = {}

    def make(self, name: str, definitions: Mapping[str, Any]) -> Any:  # noqa: ANN401 - a class of the library
        """Return the class of a type.

        Args:
            name: `pkg/msg/Type`.
            definitions: all types in it, itself included: name -> fields.
        """
        from cyclonedds.idl import make_idl_struct  # noqa: PLC0415 - as above
        from cyclonedds.idl.types import uint8  # noqa: PLC0415

        made = self._made.get(name)
        if made is None:
            fields = {field: self._field(one, definitions) for field, one in definitions[name]}
            if not fields:
                fields = {"structure_needs_at_least_one_member": uint8}
            made = make_idl_struct(name.replace("/", "_"), dds_type(name), fields, dataclassify=False)
            self._made[name] = made
        return made

    def _field(self, one: Any, definitions: Mapping[str, Any]) -> Any:  # noqa: ANN401 - of two libraries
        from cyclonedds.idl import types  # noqa: PLC0415 - as above

        kind, rest = one
        if kind == _NAME:
            return self.make(rest, definitions)
        if kind == _BASE:
            base, length = rest
            if base == "string":
                return types.bounded_str[length] if length else str
            return bool if base == "bool" else getattr(types, "uint8" if base in {"byte", "char"} else base)
        inner, length = rest
        part = self._field(inner, definitions)
        if kind == _ARRAY:
            return types.array[part, length]
        return types.sequence[part, length] if length else types.sequence[part]


_BASE, _NAME, _ARRAY = 1, 2, 3
"""Kinds of fields, as rosbags numbers them; 4 is a sequence."""


# Entities


class DdsEndpoint(Record):
    """An endpoint on the network.

    Attributes:
        key: its 16 bytes of identity.
        participant: those of its program.
        topic, type: names for DDS; empty if it is gone.
        is_alive: False if it is gone.
        quality: what it offers or asks for.
        user_data: what its program tells of it, such as the hash of its type.
    """

    key: bytes
    participant: bytes
    topic: str
    type: str
    is_alive: bool
    quality: Quality
    user_data: bytes


class DdsDomain:
    """One domain, with one program in it: ours.

    Attributes:
        key: the 16 bytes of identity of our program.
    """

    def __init__(self, domain: int, config: str, user_data: bytes, *, is_local: bool) -> None:
        """Open the domain.

        Args:
            config: configuration of the library, XML.
            user_data: what other programs are told about ours.
            is_local: take nothing from other machines.

        Raises:
            DocumentError: the library refuses it.
        """
        from cyclonedds.core import DDSException, Policy, Qos  # noqa: PLC0415 - as above
        from cyclonedds.domain import Domain, DomainParticipant  # noqa: PLC0415

        quiet_library()
        try:
            self._domain = Domain(domain, config)
            self._participant = DomainParticipant(domain, Qos(Policy.Userdata(user_data)))
        except DDSException as error:
            text = "another simulator of this process is in it" if error.code == _PRECONDITION else _why(error)
            raise DocumentError(f"ros2-domain: cannot use domain {domain}: {text}") from None
        if is_local:
            close_to_network(domain)
        self.key: bytes = self._participant.get_guid().bytes
        self._topics: dict[str, Any] = {}
        self._entities: dict[int, Any] = {}
        self._names: dict[int, str] = {}  # of each writer and reader: its topic

    @property
    def num_topics(self) -> int:
        """Number of topics with a writer or a reader of ours."""
        return len(self._topics)

    def close(self) -> None:
        """End everything in the domain; no thread of the library stays."""
        for entity in reversed(self._entities.values()):
            _delete(entity)
        self._entities.clear()
        for entity in (*self._topics.values(), self._participant, self._domain):
            _delete(entity)
        self._topics.clear()

    def open_writer(self, topic: str, data_type: type, quality: Quality, user_data: bytes) -> DdsWriter:
        """Publish on a topic.

        Args:
            topic: its name for DDS.
            data_type: from `DdsTypes`.
            user_data: what other programs are told about the writer.
        """
        from cyclonedds.core import Policy  # noqa: PLC0415 - as above
        from cyclonedds.pub import DataWriter  # noqa: PLC0415

        def make() -> Any:  # noqa: ANN401 - of the library
            qos = _qos(quality, Policy.Userdata(user_data), Policy.IgnoreLocal.Participant)
            return DataWriter(self._participant, self._topic(topic, data_type), qos)

        return DdsWriter(self, self._keep(make, topic))

    def open_reader(
        self, topic: str, data_type: type, quality: Quality, user_data: bytes, on_data: Callable[[], None]
    ) -> DdsReader:
        """Subscribe to a topic.

        Args:
            topic: its name for DDS.
            data_type: from `DdsTypes`.
            quality: what is asked for.
            user_data: what other programs are told about the reader.
            on_data: called in a thread of the library when messages wait.
        """
        from cyclonedds.core import Policy  # noqa: PLC0415 - as above
        from cyclonedds.sub import DataReader  # noqa: PLC0415

        def make() -> Any:  # noqa: ANN401 - of the library
            # Names of fields do not count, since packages for ROS 2 made from MORAI's spell some in another way.
            consistency = Policy.TypeConsistency.AllowTypeCoercion()
            qos = _qos(quality, Policy.Userdata(user_data), Policy.IgnoreLocal.Participant, consistency)
            return DataReader(self._participant, self._topic(topic, data_type), qos, _listener(on_data))

        return DdsReader(self, self._keep(make, topic))

    def watch(self, on_data: Callable[[], None]) -> tuple[Callable[[], DdsEndpoint | None], ...]:
        """Return a function for the writers and one for the readers in the domain, which gives the next change.

        Args:
            on_data: called in a thread of the library when there are changes.
        """
        from cyclonedds.builtin import (  # noqa: PLC0415 - as above
            BuiltinDataReader,
            BuiltinTopicDcpsPublication,
            BuiltinTopicDcpsSubscription,
        )

        def taker(reader: Any) -> Callable[[], DdsEndpoint | None]:  # noqa: ANN401 - of the library
            def take() -> DdsEndpoint | None:
                found = reader.take(1)
                return _endpoint(found[0]) if found else None

            return take

        topics = BuiltinTopicDcpsPublication, BuiltinTopicDcpsSubscription
        return tuple(
            taker(self._keep(partial(BuiltinDataReader, self._participant, one, listener=_listener(on_data))))
            for one in topics
        )

    def forget(self, entity: Any) -> None:  # noqa: ANN401 - of the library
        """Delete a writer or reader, and its topic if it was the last one there (for `DdsWriter` and `DdsReader`)."""
        if self._entities.pop(id(entity), None) is None:
            return
        _delete(entity)
        name = self._names.pop(id(entity))
        if name not in self._names.values():
            _delete(self._topics.pop(name))

    def _topic(self, name: str, data_type: type) -> Any:  # noqa: ANN401 - of the library
        """Return a topic; one that had another type before is made anew."""
        from cyclonedds.core import Qos  # noqa: PLC0415 - as above
        from cyclonedds.topic import Topic  # noqa: PLC0415

        known = self._topics.get(name)
        if known is None or known.data_type is not data_type:
            known = self._topics[name] = Topic(self._participant, name, data_type, Qos(_plain_cdr()))
        return known

    def _keep(self, make: Callable[[], Any], topic: str = "") -> Any:  # noqa: ANN401 - of the library
        from cyclonedds.core import DDSException  # noqa: PLC0415 - as above

        try:
            entity = make()
        except DDSException as error:
            raise GraphError(f"the DDS library refuses it: {_why(error)}") from None
        self._entities[id(entity)] = entity
        self._names[id(entity)] = topic
        return entity


class _Entity:
    """A writer or a reader.

    Attributes:
        key: its 16 bytes of identity.
    """

    def __init__(self, domain: DdsDomain, entity: Any) -> None:  # noqa: ANN401 - of the library
        self.key: bytes = entity.get_guid().bytes
        self._domain = domain
        self._entity = entity
        self._ref = entity._ref  # noqa: SLF001 - see the module's first lines

    def close(self) -> None:
        """End it."""
        self._domain.forget(self._entity)


class DdsWriter(_Entity):
    """A publisher of one topic."""

    def __init__(self, domain: DdsDomain, entity: Any) -> None:  # noqa: ANN401 - of the library
        from cyclonedds._clayer import ddspy_write  # noqa: PLC0415 - as above

        super().__init__(domain, entity)
        self._write = ddspy_write

    def write(self, raw: bytes) -> bool:
        """Send a message.

        Args:
            raw: CDR, with its four bytes of encapsulation.

        Returns:
            False if too much waits for a subscriber already, or the bytes are not a message of the type.
        """
        return bool(self._write(self._ref, raw + bytes(-len(raw) % 4)) >= 0)


class DdsReader(_Entity):
    """A subscription to one topic."""

    def __init__(self, domain: DdsDomain, entity: Any) -> None:  # noqa: ANN401 - of the library
        from cyclonedds._clayer import ddspy_take  # noqa: PLC0415 - as above
        from cyclonedds.core import InstanceState, SampleState, ViewState  # noqa: PLC0415

        super().__init__(domain, entity)
        self._take = ddspy_take
        self._any = SampleState.Any | ViewState.Any | InstanceState.Any

    def take(self) -> bytes | None:
        """Return the next message as CDR; empty bytes for the news that a publisher left; None if nothing waits."""
        taken = self._take_one()
        return None if taken is None else taken[0]

    def take_from(self) -> tuple[bytes, bytes] | None:
        """Return the result of `take`, and the identity of the publisher: 16 bytes; empty if it has left."""
        taken = self._take_one()
        if taken is None:
            return None
        publisher = self._entity.get_matched_publication_data(taken[1])
        return taken[0], publisher.key.bytes if publisher else b""

    def _take_one(self) -> tuple[bytes, int] | None:
        found = self._take(self._ref, self._any, 1)  # one, because it may be as long as a frame
        if isinstance(found, int) or not found:  # a number is an error: the entity has ended
            return None
        raw, info = found[0]
        return bytes(raw) if info.valid_data else b"", info.publication_handle


_PRECONDITION: Final = -4
"""DDS_RETCODE_PRECONDITION_NOT_MET: the domain exists already."""


def _why(error: Any) -> str:  # noqa: ANN401 - of the library
    return str(getattr(error, "msg", None) or error)[:200]


def _delete(entity: Any) -> None:  # noqa: ANN401 - of the library
    """Delete an entity now; the library itself does it when Python forgets the object."""
    entity.__del__()


def _plain_cdr() -> Any:  # noqa: ANN401 - of the library
    """Return the encoding of ROS 2: CDR in its first version."""
    from cyclonedds.core import Policy  # noqa: PLC0415 - as above

    return Policy.DataRepresentation(use_cdrv0_representation=True)


def _qos(quality: Quality, *others: Any) -> Any:  # noqa: ANN401 - of the library
    from cyclonedds.core import Policy, Qos  # noqa: PLC0415 - as above

    reliability = Policy.Reliability.Reliable(0) if quality.is_reliable else Policy.Reliability.BestEffort
    durability = Policy.Durability.TransientLocal if quality.is_latched else Policy.Durability.Volatile
    return Qos(_plain_cdr(), reliability, durability, Policy.History.KeepLast(quality.depth), *others)


def _listener(on_data: Callable[[], None]) -> Any:  # noqa: ANN401 - of the library
    from cyclonedds.core import Listener  # noqa: PLC0415 - as above

    return Listener(on_data_available=lambda _reader: on_data())


def _endpoint(sample: Any) -> DdsEndpoint:  # noqa: ANN401 - of the library
    """Return an endpoint from a sample of the library."""
    from cyclonedds.core import InstanceState, Policy  # noqa: PLC0415 - as above

    is_alive = bool(sample.sample_info.valid_data) and sample.sample_info.instance_state == InstanceState.Alive
    qos = list(sample.qos or ()) if is_alive else []
    quality = Quality(
        is_reliable=any(isinstance(one, Policy.Reliability.Reliable) for one in qos),
        is_latched=any(one in {Policy.Durability.TransientLocal, Policy.Durability.Persistent} for one in qos),
    )
    return DdsEndpoint(
        sample.key.bytes,
        sample.participant_key.bytes,
        sample.topic_name or "",
        sample.type_name or "",
        is_alive,
        quality,
        next((bytes(one.data) for one in qos if isinstance(one, Policy.Userdata)), b""),
    )
