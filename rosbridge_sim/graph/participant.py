"""Participants of the bus, names and message bodies, as topics, services and actions share them."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from typing import Literal, TypeAlias

import msgspec

from rosbridge_sim.errors import FieldError, GraphError, Reason
from rosbridge_sim.protocol.ops import ABSENT, OpBody, is_absent
from rosbridge_sim.schema.json_text import parse_by_position
from rosbridge_sim.schema.message_type import MessageType
from rosbridge_sim.schema.opaque_types import OpaqueType
from rosbridge_sim.schema.sizes import size_of
from rosbridge_sim.suggestions import listing

_NAME = re.compile(r"[^\s\x00-\x1f\x7f]{1,256}")


OfferKind: TypeAlias = Literal["topic", "service", "action"]
"""Kinds of things that an owner offers under a name."""

NodeRole: TypeAlias = Literal["publisher", "subscriber", "provider", "any"]
"""Parts that a node has in a topic or a service; `any` is for all nodes, whatever the thing."""

Notify = Callable[[str, str], None]
"""`(level, text)`, as for `Participant.notify`."""


class Participant:
    """An owner of topics and services; compared by identity.

    Its methods do what a part of the server does. Clients, bridges and nodes of another graph override those in which
    they differ.

    Attributes:
        name: ROS node name in rosapi's lists, e.g. `/morai_sim`.
        address: `host:port` of a client, which tells clients apart; empty for a part of the server.
        is_guest: it must give names to the server's own parts, as a client does. The server's parts come first, so that
            no client can take names and types that one of them needs, such as an ego that is added later. A type in a
            guest's subscription applies only to that subscription.
    """

    name: str
    address = ""
    is_guest = False

    @property
    def where(self) -> str:
        """The address of a client; of a part of the server, the name of its node."""
        return self.address or self.name

    def notify(self, level: str, text: str) -> None:
        """Receive a notice that is not an answer to a request; it is ignored by a part that makes no requests.

        Args:
            level: `info`, `warning` or `error`.
        """

    def explain(self, level: str, text: str, reason: Reason) -> None:  # noqa: ARG002 - for those that record it
        """Receive the news that a request was refused, with the kind of the mistake.

        Args:
            level: `warning` or `error`.
        """
        self.notify(level, text)

    def remark(self, level: str, text: str) -> None:
        """Receive the news of what others have done, which is no mistake of this owner."""
        self.notify(level, text)

    def notifier(self) -> Notify:
        """Return a function that tells this owner something about its current request, now or later."""
        return self.notify

    def hold(self) -> Callable[[], None]:
        """Handle no more input of this owner, because its current request takes time. Several holds are counted.

        An owner inside this process cannot be held; it only gets its answer later.

        Returns:
            Ends this hold; a second call does nothing.
        """
        return _nothing

    def lose(self, kind: OfferKind, name: str, why: str) -> None:  # noqa: ARG002 - for guests
        """Receive the news that another owner takes an offer of this one, before it is removed from the bus.

        Args:
            name: absolute name.
            why: a line of text for the user of the client.
        """
        self.notify("error", why)

    def nodes(self, role: NodeRole, name: str) -> Iterable[str]:  # noqa: ARG002 - for owners that stand for many nodes
        """Return the names of the nodes that this owner is or stands for, as far as they have a part in a thing.

        Args:
            name: that of the topic or service.
        """
        return (self.name,)

    def check_subscribe(self, topic: str, type_name: str) -> None:
        """Raise GraphError if this owner must not have the messages of a topic, by a subscription or in an answer."""

    def check_publish(self, topic: str, type_name: str) -> None:
        """Raise GraphError if this owner must not publish on a topic, or have messages published there."""

    def gives_way(self, other: Participant) -> bool:
        """Return True if this owner must leave even an exclusive name to another one."""
        return self.is_guest and not other.is_guest


def take_over(old: Participant, kind: OfferKind, name: str, new: Participant) -> None:
    """Tell an owner that another one takes its offer; called before the offer is removed from the bus.

    Args:
        name: absolute name.
    """
    why = f"{kind.capitalize()} {name} is provided by {new.name} from now on: this client's offer has ended"
    old.lose(kind, name, why)


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
        giver.explain("warning", text, Reason.WRONG_VALUE)
    return dict(zip(names, values, strict=False))
