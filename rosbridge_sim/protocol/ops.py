"""The ops of rosbridge: each one a small frozen type with its fields.

The fields are those that this server uses; a frame may have others. `None` is *absent*: a JSON
null in an optional field means the same as leaving it out, because ROS# writes nulls for what is unset
(rosbridge_suite refuses those). Message bodies (`msg`, `args`, `values`) of plain frames stay JSON text that is not
read yet; `schema/` decodes them. Those of other frames (glued ones, CBOR) are Python objects, though declared as text:
a `OpBody` is either.
"""

from __future__ import annotations

from typing import Any, ClassVar, TypeAlias

import msgspec

__all__ = [
    "ABSENT",
    "OPS",
    "ActionFeedback",
    "ActionResult",
    "Advertise",
    "AdvertiseAction",
    "AdvertiseService",
    "Auth",
    "CallService",
    "CancelActionGoal",
    "Fragment",
    "Id",
    "Op",
    "OpBody",
    "Png",
    "Publish",
    "SendActionGoal",
    "ServiceResponse",
    "SetLevel",
    "Status",
    "Subscribe",
    "Unadvertise",
    "UnadvertiseAction",
    "UnadvertiseService",
    "Unsubscribe",
]

Id: TypeAlias = str | int | float | bool | None
"""An `id` as a client gave it: any JSON scalar, echoed unchanged."""

ABSENT = msgspec.Raw(b"")
"""A body that the frame did not hold."""


OpBody: TypeAlias = msgspec.Raw | bytes | dict[str, Any] | list[Any] | str | float | bool | None
"""A message body as the wire layer hands it on: JSON text that was not read yet, or the value read from it."""


class _Op(msgspec.Struct, frozen=True, tag_field="op"):
    """The base of all ops."""

    id: Id = None

    bodies: ClassVar[tuple[str, ...]] = ()
    """The fields that hold message bodies."""


class Advertise(_Op, frozen=True, tag="advertise", kw_only=True):
    """The client will publish on a topic. `id` is the key of this advertisement within the client and topic."""

    topic: str
    type: str
    latch: bool | None = None
    qos: dict[str, Any] | None = None


class Unadvertise(_Op, frozen=True, tag="unadvertise", kw_only=True):
    """The client no longer publishes on a topic; without an `id`, all of its advertisements there end."""

    topic: str


class Publish(_Op, frozen=True, tag="publish", kw_only=True):
    """A message. `type` lets it stand without an advertise (rosbridge_suite 2.2 and later)."""

    topic: str
    msg: msgspec.Raw = ABSENT
    latch: bool | None = None
    type: str | None = None
    qos: dict[str, Any] | None = None

    bodies: ClassVar[tuple[str, ...]] = ("msg",)


class Subscribe(_Op, frozen=True, tag="subscribe", kw_only=True):
    """The client wants the messages of a topic. The same `id` again replaces its settings."""

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
    """A call of a service. `timeout` is in seconds; 0 or less waits for ever."""

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

    `result` may be left out, since rosbridge_suite never looks at it.

    `reason` is the error text where `values` is no text: rosbridge_suite takes an object in `values` and nothing else,
    and lets a caller wait for ever if the provider sends a text. Other servers ignore the field.
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
    """A goal of an action; with `feedback`, the client wants its feedback."""

    action: str
    action_type: str | None = None
    args: msgspec.Raw = ABSENT
    feedback: bool | None = None
    fragment_size: float | None = None

    bodies: ClassVar[tuple[str, ...]] = ("args",)


class CancelActionGoal(_Op, frozen=True, tag="cancel_action_goal", kw_only=True):
    """A request to cancel the client's goal of this id."""

    id: str
    action: str


class ActionFeedback(_Op, frozen=True, tag="action_feedback", kw_only=True):
    """The feedback of a provider on a goal."""

    id: str
    action: str
    values: msgspec.Raw = ABSENT

    bodies: ClassVar[tuple[str, ...]] = ("values",)


class ActionResult(_Op, frozen=True, tag="action_result", kw_only=True):
    """The result of a provider for a goal.

    Some builds of roslib leave out `status`, or `status` and `values` where the goal failed.
    """

    id: str
    action: str
    result: bool
    status: int | None = None
    values: msgspec.Raw = ABSENT

    bodies: ClassVar[tuple[str, ...]] = ("values",)


class Fragment(_Op, frozen=True, tag="fragment", kw_only=True):
    """A piece of a frame. `total` may be a float: rosbridge_suite writes 3.4 for three pieces."""

    id: str | int | float
    data: str
    num: float
    total: float


class Png(_Op, frozen=True, tag="png", kw_only=True):
    """A frame inside a picture, in base64."""

    data: str


class SetLevel(_Op, frozen=True, tag="set_level", kw_only=True):
    """The client wants status frames of this level and graver ones."""

    level: str


class Status(_Op, frozen=True, tag="status", kw_only=True):
    """A status message of a client; it goes to the log."""

    level: str | None = None
    msg: str | None = None


class Auth(_Op, frozen=True, tag="auth", kw_only=True):
    """The token of a client, as its first message.

    The op of rosauth, which roslibpy can send, has the same name, other fields and no token.
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

OPS: dict[str, type[Op]] = {
    "advertise": Advertise,
    "unadvertise": Unadvertise,
    "publish": Publish,
    "subscribe": Subscribe,
    "unsubscribe": Unsubscribe,
    "call_service": CallService,
    "advertise_service": AdvertiseService,
    "unadvertise_service": UnadvertiseService,
    "service_response": ServiceResponse,
    "advertise_action": AdvertiseAction,
    "unadvertise_action": UnadvertiseAction,
    "send_action_goal": SendActionGoal,
    "cancel_action_goal": CancelActionGoal,
    "action_feedback": ActionFeedback,
    "action_result": ActionResult,
    "fragment": Fragment,
    "png": Png,
    "set_level": SetLevel,
    "status": Status,
    "auth": Auth,
}
