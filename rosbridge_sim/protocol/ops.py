"""The ops of rosbridge: each one is a small frozen type with its fields.

Each type has the fields that this server uses; a frame may have more. `None` means *absent*. A JSON null in an optional
field means the same, because ROS# writes nulls for unset fields (rosbridge_suite refuses those). Message bodies (`msg`,
`args`, `values`) of plain frames stay unread JSON text, which `schema/` decodes. Bodies of other frames (several ops in
one frame, CBOR) are Python objects. An `OpBody` is either of the two.
"""

from __future__ import annotations

from typing import Any, ClassVar, TypeAlias, get_args

import msgspec

Id: TypeAlias = str | int | float | bool | None
"""An `id` that a client gave: any JSON scalar, returned unchanged."""

ABSENT = msgspec.Raw(b"")
"""Stands for a body that the frame did not have."""


OpBody: TypeAlias = msgspec.Raw | bytes | dict[str, Any] | list[Any] | str | float | bool | None
"""A message body as the wire layer passes it on: unread JSON text, or the decoded value."""


class _Op(msgspec.Struct, frozen=True, tag_field="op"):
    """The base of all ops."""

    id: Id = None

    bodies: ClassVar[tuple[str, ...]] = ()
    """Names of the fields that hold message bodies."""


class Advertise(_Op, frozen=True, tag="advertise", kw_only=True):
    """The client will publish on a topic. `id` names this advertisement among those of the client and topic."""

    topic: str
    type: str
    latch: bool | None = None
    qos: dict[str, Any] | None = None


class Unadvertise(_Op, frozen=True, tag="unadvertise", kw_only=True):
    """The client no longer publishes on a topic; without an `id`, all of its advertisements there end."""

    topic: str


class Publish(_Op, frozen=True, tag="publish", kw_only=True):
    """A message. With `type`, no earlier advertise is needed (rosbridge_suite 2.2 and later)."""

    topic: str
    msg: msgspec.Raw = ABSENT
    latch: bool | None = None
    type: str | None = None
    qos: dict[str, Any] | None = None

    bodies: ClassVar[tuple[str, ...]] = ("msg",)


class Subscribe(_Op, frozen=True, tag="subscribe", kw_only=True):
    """The client wants the messages of a topic. A second subscribe with the same `id` replaces its settings."""

    topic: str
    type: str | None = None
    throttle_rate: float | None = None
    queue_length: float | None = None
    fragment_size: float | None = None
    compression: str | None = None
    qos: dict[str, Any] | None = None


class Unsubscribe(_Op, frozen=True, tag="unsubscribe", kw_only=True):
    """The client no longer wants the messages of a topic; without an `id`, all of its subscriptions there end."""

    topic: str


class CallService(_Op, frozen=True, tag="call_service", kw_only=True):
    """A service call. `timeout` is in seconds; 0 or less means no limit."""

    service: str
    args: msgspec.Raw = ABSENT
    timeout: float | None = None
    fragment_size: float | None = None

    bodies: ClassVar[tuple[str, ...]] = ("args",)


class AdvertiseService(_Op, frozen=True, tag="advertise_service", kw_only=True):
    """The client provides a service."""

    service: str
    type: str


class UnadvertiseService(_Op, frozen=True, tag="unadvertise_service", kw_only=True):
    """The client no longer provides a service."""

    service: str


class ServiceResponse(_Op, frozen=True, tag="service_response", kw_only=True):
    """The answer of a provider to a call. roslib 2 leaves `values` out when its handler failed.

    `result` may be missing, because rosbridge_suite never reads it.
    `reason` is the error text if `values` is not a text. rosbridge_suite accepts only an object in `values`; if the
    provider sends a text, the caller waits for ever. Other servers ignore this field.
    """

    service: str
    result: bool | None = None
    values: msgspec.Raw = ABSENT
    reason: str | None = None

    bodies: ClassVar[tuple[str, ...]] = ("values",)


class AdvertiseAction(_Op, frozen=True, tag="advertise_action", kw_only=True):
    """The client provides an action."""

    action: str
    type: str


class UnadvertiseAction(_Op, frozen=True, tag="unadvertise_action", kw_only=True):
    """The client no longer provides an action."""

    action: str


class SendActionGoal(_Op, frozen=True, tag="send_action_goal", kw_only=True):
    """A goal of an action. With `feedback`, the client wants feedback messages."""

    action: str
    action_type: str | None = None
    args: msgspec.Raw = ABSENT
    feedback: bool | None = None
    fragment_size: float | None = None

    bodies: ClassVar[tuple[str, ...]] = ("args",)


class CancelActionGoal(_Op, frozen=True, tag="cancel_action_goal", kw_only=True):
    """A request to cancel the client's goal with this id."""

    id: str
    action: str


class ActionFeedback(_Op, frozen=True, tag="action_feedback", kw_only=True):
    """Feedback of a provider about a goal."""

    id: str
    action: str
    values: msgspec.Raw = ABSENT

    bodies: ClassVar[tuple[str, ...]] = ("values",)


class ActionResult(_Op, frozen=True, tag="action_result", kw_only=True):
    """The result of a provider for a goal.

    Some builds of roslib leave out `status`, or both `status` and `values` if the goal failed.
    """

    id: str
    action: str
    result: bool
    status: int | None = None
    values: msgspec.Raw = ABSENT

    bodies: ClassVar[tuple[str, ...]] = ("values",)


class Fragment(_Op, frozen=True, tag="fragment", kw_only=True):
    """A part of a frame. `total` may be a float: rosbridge_suite writes 3.4 for three fragments."""

    id: str | int | float
    data: str
    num: float
    total: float


class Png(_Op, frozen=True, tag="png", kw_only=True):
    """A frame inside a PNG image, in base64."""

    data: str


class SetLevel(_Op, frozen=True, tag="set_level", kw_only=True):
    """The client wants status frames of this level and of more severe ones."""

    level: str


class Status(_Op, frozen=True, tag="status", kw_only=True):
    """A status message of a client; it goes to the log."""

    level: str | None = None
    msg: str | None = None


class Auth(_Op, frozen=True, tag="auth", kw_only=True):
    """The token of a client, in its first message.

    The op `auth` of rosauth, which roslibpy can send, has other fields and no token.
    """

    token: str | None = None


Op: TypeAlias = (
    Advertise
    | Unadvertise
    | Publish
    | Subscribe
    | Unsubscribe
    | CallService
    | AdvertiseService
    | UnadvertiseService
    | ServiceResponse
    | AdvertiseAction
    | UnadvertiseAction
    | SendActionGoal
    | CancelActionGoal
    | ActionFeedback
    | ActionResult
    | Fragment
    | Png
    | SetLevel
    | Status
    | Auth
)

OPS: dict[str, type[Op]] = {str(kind.__struct_config__.tag): kind for kind in get_args(Op)}
"""Name of an op on the wire -> its type."""


_NULL = b"null"


def is_absent(body: OpBody) -> bool:
    """Return True if a body was left out or is null, which means the same."""
    if isinstance(body, (bytes, msgspec.Raw)):
        return body is ABSENT or (len(body) <= len(_NULL) and bytes(body) in {b"", _NULL})  # a long one is not copied
    return body is None
