"""Participants of the bus, names and message bodies: the parts that topics, services and actions share."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Literal, Protocol, TypeAlias, runtime_checkable

import msgspec
import orjson

from rosbridge_sim.errors import FieldError, GraphError, Reason
from rosbridge_sim.protocol.codec import is_absent
from rosbridge_sim.protocol.ops import ABSENT, OpBody
from rosbridge_sim.schema.message_type import MessageType
from rosbridge_sim.schema.opaque_types import OpaqueType
from rosbridge_sim.schema.sizes import size_of
from rosbridge_sim.suggestions import listing

__all__ = [
    "Correlating",
    "Explaining",
    "Guest",
    "Holdable",
    "Notify",
    "OfferKind",
    "Participant",
    "Remarkable",
    "decode_body",
    "explain",
    "gives_way",
    "hold",
    "notifier",
    "remark",
    "resolve",
    "size_of_body",
    "take_over",
]

_NAME = re.compile(r"[^\s\x00-\x1f\x7f]{1,256}")


class Participant(Protocol):
    """An owner of topics and services. Compared by identity.

    Attributes:
        name: the ROS node name that rosapi shows, e.g. `/morai_sim`.
    """

    @property
    def name(self) -> str:
        """The ROS node name that rosapi shows."""

    def notify(self, level: str, text: str) -> None:
        """Say something that answers no request: `info`, `warning` or `error`, a line of text."""


@runtime_checkable
class Holdable(Protocol):
    """An owner whose input can wait: what it sends next is handled later, in its order."""

    def hold(self) -> Callable[[], None]:
        """Handle nothing more of this owner until the returned function is called. Several holds count.

        Returns:
            Releases this hold; a second call does nothing.
        """


OfferKind: TypeAlias = Literal["topic", "service", "action"]
"""Things that an owner offers to others under a name."""


@runtime_checkable
class Guest(Protocol):
    """An owner that gives way to the server's own parts: a client.

    The server's parts have precedence, so that no client can keep one of them, such as an ego that comes later, from
    its names and types. The types that a guest subscribes with hold for that subscription alone.
    """

    def lose(self, kind: OfferKind, name: str, why: str) -> None:
        """Hear that another owner has taken an offer of this one; called just before it is struck off the bus.

        Args:
            kind: of the offer.
            name: absolute.
            why: a line of text for the user of the client.
        """


Notify = Callable[[str, str], None]
"""`(level, text)`, as `notify`."""


@runtime_checkable
class Correlating(Protocol):
    """An owner that can be told later which of its requests a text is about."""

    def notifier(self) -> Notify:
        """Return a function that does what `notify` does, with the id of the request that is handled right now."""


@runtime_checkable
class Explaining(Protocol):
    """An owner that is told, with a text about its request, which kind of mistake it made."""

    def explain(self, level: str, text: str, reason: Reason) -> None:
        """Do what `notify` does, for a reason that the log and `/sim/refusals` name."""


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
    """Tell an owner why its request was refused; one that keeps no account of reasons only hears the text."""
    if isinstance(owner, Explaining):
        owner.explain(level, text, reason)
    else:
        owner.notify(level, text)


def gives_way(old: Participant, new: Participant) -> bool:
    """Return whether an owner must leave a name to another one, even a name that it has to itself."""
    return isinstance(old, Guest) and not isinstance(new, Guest)


def take_over(old: Participant, kind: OfferKind, name: str, new: Participant) -> None:
    """Tell an owner that its offer is another one's from now on; called before it is struck off the bus."""
    why = f"{kind.capitalize()} {name} is provided by {new.name} from now on: this client's offer has ended"
    if isinstance(old, Guest):
        old.lose(kind, name, why)
    else:
        old.notify("error", why)


def hold(owner: Participant) -> Callable[[], None]:
    """Hold an owner's input, so that what it sends next waits for something that takes time.

    An owner in this process that cannot be held only gets its answer later.

    Returns:
        Releases the owner; must be called in the end, and a second call does nothing.
    """
    return owner.hold() if isinstance(owner, Holdable) else _nothing


def notifier(owner: Participant) -> Notify:
    """Return a function that tells an owner something about the request that is handled right now, perhaps later."""
    return owner.notifier() if isinstance(owner, Correlating) else owner.notify


def _nothing() -> None:
    """Release an owner that was never held."""


def resolve(name: str) -> str:
    """The absolute graph name: `chatter` and `/chatter` are one topic.

    Raises:
        GraphError: the name is empty, longer than 256 characters or holds white space.
    """
    if not _NAME.fullmatch(name):
        shown = name if len(name) <= 80 else name[:77] + "..."  # noqa: PLR2004 - a line of a terminal
        raise GraphError(f"{shown!r} is not a valid graph name", reason=Reason.BAD_NAME)
    return name if name[0] == "/" else "/" + name


def size_of_body(value: object, body: object) -> int:
    """Estimate what a decoded body costs while it is held [bytes]."""
    if isinstance(body, (bytes, msgspec.Raw)):
        length = len(body)
        if length < _SHORT:
            return 0
        return size_of(value, length)
    return size_of(value)


_SHORT = 2_000
"""A shorter body is not counted [bytes]: `--max-calls` bounds how many there are, a thousand to 20 MB at most."""


def decode_body(message_type: MessageType | OpaqueType, body: OpBody, stamp_ns: int) -> object:
    """The checked and filled value of a body, given by name, by position or not at all.

    Raises:
        FieldError: it does not fit the type.
    """
    if isinstance(body, (bytes, msgspec.Raw)):
        if body is ABSENT:
            return message_type.check({}, stamp_ns)
        try:
            return message_type.decode_json(body, stamp_ns)  # an object by name, as nearly always
        except FieldError:
            if is_absent(body):
                return message_type.check({}, stamp_ns)
            if bytes(memoryview(body)[:1]) != b"[":
                raise
        try:
            body = orjson.loads(bytes(body))
        except orjson.JSONDecodeError as error:
            raise FieldError(f"{message_type.name}: {error}") from None
    if isinstance(body, list):
        return message_type.check(_by_name(message_type, body), stamp_ns)
    return message_type.check({} if body is None else body, stamp_ns)


def _by_name(message_type: MessageType | OpaqueType, values: list[object]) -> dict[str, object]:
    """The fields that values given by position stand for.

    Raises:
        FieldError: nothing is known of the fields.
        GraphError: there are fewer.
    """
    if not values:
        return {}
    if isinstance(message_type, OpaqueType):
        raise FieldError(f"{message_type.name} is not known here, so its fields must be given by name, not in a list")
    names = [f.name for f in message_type.definition.fields]
    if len(values) > len(names):
        text = f"{message_type.name} takes {len(names)} arguments, but got {len(values)}; it has {listing(names)}"
        raise GraphError(text, reason=Reason.WRONG_VALUE)
    return dict(zip(names, values, strict=False))
