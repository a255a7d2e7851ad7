"""Participants of the bus, names and message bodies, as topics, services and actions share them."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from functools import lru_cache
from typing import Literal, Protocol, TypeAlias, cast, runtime_checkable

import msgspec

from rosbridge_sim.errors import FieldError, GraphError, Reason
from rosbridge_sim.protocol.ops import ABSENT, OpBody, is_absent
from rosbridge_sim.schema.json_text import parse_by_position
from rosbridge_sim.schema.message_type import MessageType
from rosbridge_sim.schema.opaque_types import OpaqueType
from rosbridge_sim.schema.sizes import size_of
from rosbridge_sim.suggestions import listing

_NAME = re.compile(r"[^\s\x00-\x1f\x7f]{1,256}")


class Participant(Protocol):
    """An owner of topics and services; compared by identity.

    Attributes:
        name: ROS node name in rosapi's lists, e.g. `/morai_sim`.
    """

    @property
    def name(self) -> str:
        """ROS node name in rosapi's lists."""

    def notify(self, level: str, text: str) -> None:
        """Receive a notice that is not an answer to a request.

        Args:
            level: `info`, `warning` or `error`.
        """


@runtime_checkable
class Holdable(Protocol):
    """An owner whose input can wait: its next ops are handled later, in order."""

    def hold(self) -> Callable[[], None]:
        """Handle no more input of this owner until the returned function is called. Several holds are counted.

        Returns:
            Ends this hold; a second call does nothing.
        """


OfferKind: TypeAlias = Literal["topic", "service", "action"]
"""Kinds of things that an owner offers under a name."""


@runtime_checkable
class Guest(Protocol):
    """An owner that must give names to the server's own parts: a client.

    The server's parts come first, so that no client can take names and types that one of them needs, such as an ego
    that is added later. A type in a guest's subscription applies only to that subscription.
    """

    def lose(self, kind: OfferKind, name: str, why: str) -> None:
        """Receive the news that another owner takes an offer of this one.

        It is called just before the offer is removed from the bus.

        Args:
            name: absolute name.
            why: a line of text for the user of the client.
        """


def is_guest(owner: Participant) -> bool:
    """Return True if an owner is a guest."""
    return _has(type(owner), Guest)


Notify = Callable[[str, str], None]
"""`(level, text)`, as for `notify`."""


@runtime_checkable
class Correlating(Protocol):
    """An owner that can be told later which of its requests a notice is about."""

    def notifier(self) -> Notify:
        """Return a function like `notify` that adds the id of the current request, even later."""


@runtime_checkable
class Explaining(Protocol):
    """An owner that gets the kind of its mistake together with the text."""

    def explain(self, level: str, text: str, reason: Reason) -> None:
        """Receive a notice with a reason, which goes to the log and to `/sim/refusals`.

        Args:
            level: `warning` or `error`.
        """


@runtime_checkable
class Located(Protocol):
    """An owner with an address on the network.

    Attributes:
        address: `host:port`.
    """

    address: str


def address_of(owner: Participant) -> str:
    """Return the address of an owner, which tells clients apart; the name of its node if it has none."""
    return owner.address if isinstance(owner, Located) else owner.name


@runtime_checkable
class Remarkable(Protocol):
    """An owner that can be told what others have done; `notify` would count as a mistake of its own."""

    def remark(self, level: str, text: str) -> None:
        """Say something that concerns no request of this owner."""


def remark(owner: Participant, level: str, text: str) -> None:
    """Tell an owner what others have done."""
    if isinstance(owner, Remarkable):
        owner.remark(level, text)
    else:
        owner.notify(level, text)


def explain(owner: Participant, level: str, text: str, reason: Reason) -> None:
    """Tell an owner why its request was refused. An owner that does not record reasons gets only the text.

    Args:
        level: `warning` or `error`.
    """
    if isinstance(owner, Explaining):
        owner.explain(level, text, reason)
    else:
        owner.notify(level, text)


@runtime_checkable
class Standing(Protocol):
    """An owner that stands for many nodes, those of another graph."""

    def nodes(self, role: NodeRole, name: str) -> Iterable[str]:
        """Return the names of the nodes with a part in a thing; `name` is that of the topic or service."""


NodeRole: TypeAlias = Literal["publisher", "subscriber", "provider", "any"]
"""Parts that a node has in a topic or a service; `any` is for all nodes, whatever the thing."""


def node_names_of(owner: Participant, role: NodeRole, name: str = "") -> Iterable[str]:
    """Return the names of the nodes that an owner is or stands for, as far as they have a part in a thing."""
    return cast("Standing", owner).nodes(role, name) if _has(type(owner), Standing) else (owner.name,)


@runtime_checkable
class Restricted(Protocol):
    """An owner with limited rights: a client."""

    def check_subscribe(self, topic: str, type_name: str) -> None:
        """Raise GraphError if this owner must not subscribe to a topic."""

    def check_publish(self, topic: str, type_name: str) -> None:
        """Raise GraphError if this owner must not publish to a topic."""


def check_publishing(owner: Participant, topic: str, type_name: str) -> None:
    """Check that an owner may have messages published on a topic, as if it did so itself.

    Raises:
        GraphError: it must not publish there.
    """
    if isinstance(owner, Restricted):
        owner.check_publish(topic, type_name)


def check_reading(owner: Participant, topic: str, type_name: str) -> None:
    """Check that an owner may have the messages of a topic, in an answer as by a subscription.

    Raises:
        GraphError: it must not subscribe to it.
    """
    if isinstance(owner, Restricted):
        owner.check_subscribe(topic, type_name)


def may_read(owner: Participant, topic: str, type_name: str) -> bool:
    """Return True if an owner may have the messages of a topic; the arguments are those of `check_reading`."""
    try:
        check_reading(owner, topic, type_name)
    except GraphError:
        return False
    return True


def gives_way(old: Participant, new: Participant) -> bool:
    """Return True if an owner must leave even its exclusive name to another one.

    Args:
        old: the present owner of the name.
    """
    return is_guest(old) and not is_guest(new)


def take_over(old: Participant, kind: OfferKind, name: str, new: Participant) -> None:
    """Tell an owner that another one takes its offer; called before the offer is removed from the bus.

    Args:
        name: absolute name.
    """
    why = f"{kind.capitalize()} {name} is provided by {new.name} from now on: this client's offer has ended"
    if is_guest(old):
        cast("Guest", old).lose(kind, name, why)
    else:
        old.notify("error", why)


def hold(owner: Participant) -> Callable[[], None]:
    """Hold an owner's input, because its current request takes time.

    An owner inside this process that cannot be held only gets its answer later.

    Returns:
        Releases the owner. It must be called once; a second call does nothing.
    """
    return cast("Holdable", owner).hold() if _has(type(owner), Holdable) else _nothing


def notifier(owner: Participant) -> Notify:
    """Return a function that tells an owner something about its current request, now or later."""
    return cast("Correlating", owner).notifier() if _has(type(owner), Correlating) else owner.notify


@lru_cache(maxsize=64)  # a few classes; `isinstance` looks up all members of a protocol at each call, which takes 8 us
def _has(kind: type, protocol: type) -> bool:
    return issubclass(kind, protocol)


def _nothing() -> None:
    """Release an owner that was never held."""


def resolve(name: str) -> str:
    """Return the absolute graph name: `chatter` and `/chatter` are one topic.

    Args:
        name: relative or absolute name.

    Raises:
        GraphError: the name is empty, longer than 256 characters, or contains white space.
    """
    if not _NAME.fullmatch(name):
        shown = name if len(name) <= 80 else name[:77] + "..."  # noqa: PLR2004 - a line of a terminal
        raise GraphError(f"{shown!r} is not a valid graph name", reason=Reason.BAD_NAME)
    return name if name[0] == "/" else "/" + name


def size_of_body(value: object, body: object) -> int:
    """Return the estimated memory of a decoded body [bytes]."""
    if isinstance(body, (bytes, msgspec.Raw)):
        length = len(body)
        if length < _SHORT:
            return 0
        return size_of(value, length)
    return size_of(value)


_SHORT = 2_000
"""A shorter body is not counted [bytes]: `--max-calls` limits their number, and a thousand of them take at most 20 MB.
"""


def decode_body(
    message_type: MessageType | OpaqueType, body: OpBody, stamp_ns: int, giver: Participant | None = None
) -> object:
    """Return the checked and completed value of a body, which has fields by name, by position, or none.

    Args:
        stamp_ns: time for stamps that the body leaves open [ns].
        giver: is told about values by position for which there is no field; they are ignored, as in rosbridge_suite.

    Raises:
        FieldError: it does not fit the type.
    """
    if isinstance(body, (bytes, msgspec.Raw)):
        if body is ABSENT:
            return message_type.check({}, stamp_ns)
        try:
            return message_type.decode_json(body, stamp_ns)  # the usual case: an object with field names
        except FieldError:
            if is_absent(body):
                return message_type.check({}, stamp_ns)
            if bytes(memoryview(body)[:1]) != b"[":
                raise
        body = parse_by_position(message_type.name, body)
    if isinstance(body, list):
        return message_type.check(_by_name(message_type, body, giver), stamp_ns)
    return message_type.check({} if body is None else body, stamp_ns)


def _by_name(
    message_type: MessageType | OpaqueType, values: list[object], giver: Participant | None
) -> dict[str, object]:
    """Return the fields by name for values given by position; see `decode_body`.

    Raises:
        FieldError: the fields of the type are unknown.
    """
    if not values:
        return {}
    if isinstance(message_type, OpaqueType):
        raise FieldError(f"{message_type.name} is not known here, so its fields must be given by name, not in a list")
    names = [f.name for f in message_type.definition.fields]
    if len(values) > len(names) and giver is not None:
        has = f"; it has {listing(names)}" if names else ""
        text = f"{message_type.name} takes {len(names)} values, but got {len(values)}: the rest is ignored{has}"
        explain(giver, "warning", text, Reason.WRONG_VALUE)
    return dict(zip(names, values, strict=False))
