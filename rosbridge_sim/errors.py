"""All errors that this package raises on purpose.

    RosbridgeSimError
    ├── PeerError              a client or another peer broke a rule: a status frame or `result: false`
    │   ├── FrameError         bytes that are not an op
    │   ├── TypeNameError      a type name that is malformed or unknown
    │   │   └── UnknownPackageError  ... because its whole package is unknown (relayed unchecked)
    │   ├── FieldError         a message that does not fit its type
    │   ├── EncodingError      a message that cannot be encoded because of an internal error
    │   └── GraphError         a topic, service or name that cannot be used
    ├── DocumentError          a file or setting of the user that cannot be used: one line, exit code 2
    │   └── DefinitionError    a .msg, .srv or .action text, with line and column
    └── ClientError            a call of `rosbridge_sim.client` that cannot be done
        ├── ConnectError         the connection cannot be made
        ├── ConnectionLostError  the connection has ended
        ├── ServiceRefusedError  a service refused, or does not exist
        ├── OpRefusedError       the server refused a message or a subscription
        └── AnswerTimeoutError   an answer or a message did not come in time; it is also a TimeoutError

A `PeerError` never ends a connection and leaves everything as it was. Any other error is an internal error: it is
raised, logged with its traceback and counted.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from enum import Enum

__all__ = [
    "AnswerTimeoutError",
    "ClientError",
    "ConnectError",
    "ConnectionLostError",
    "DefinitionError",
    "DocumentError",
    "EncodingError",
    "FieldError",
    "FrameError",
    "GraphError",
    "OpRefusedError",
    "PeerError",
    "Reason",
    "RosbridgeSimError",
    "ServiceRefusedError",
    "SettingError",
    "TypeNameError",
    "UnknownPackageError",
    "file_errors",
]


class RosbridgeSimError(Exception):
    """The base class of all these errors."""


class Reason(Enum):
    """Reasons for refusing a request, as fixed words: the log counts by them, and programs can compare them.

    A client's text never becomes a reason, so there are no more reasons than these.
    """

    # the frame
    BAD_FRAME = "bad_frame"
    UNKNOWN_OP = "unknown_op"
    BAD_OP = "bad_op"
    # the message
    UNKNOWN_TYPE = "unknown_type"
    UNKNOWN_FIELD = "unknown_field"
    WRONG_TYPE = "wrong_type"
    WRONG_VALUE = "wrong_value"
    NOT_ENCODABLE = "not_encodable"
    # topics, services, actions
    UNKNOWN_TOPIC = "unknown_topic"
    NO_SUCH_SERVICE = "no_such_service"
    NO_SUCH_ACTION = "no_such_action"
    TYPE_CONFLICT = "type_conflict"
    NAME_TAKEN = "name_taken"
    NOT_ADVERTISED = "not_advertised"
    BAD_NAME = "bad_name"
    STRAY_ANSWER = "stray_answer"
    # access and limits
    NO_TOKEN = "no_token"  # noqa: S105 - a word, not a secret
    WRONG_TOKEN = "wrong_token"  # noqa: S105 - the same
    NOT_ALLOWED = "not_allowed"
    TOO_MUCH = "too_much"
    TOO_FAST = "too_fast"
    # synchronous mode
    SYNC_OFF = "sync_off"
    NOT_MASTER = "not_master"
    NO_MASTER = "no_master"
    NOT_MEMBER = "not_member"
    PAUSED = "paused"
    LATE_FRAME = "late_frame"
    FAR_FRAME = "far_frame"
    LATE_TICK = "late_tick"
    # all other reasons
    WARNING = "warning"  # the request was carried out, or its text says what was left out
    NOT_NOW = "not_now"
    REFUSED = "refused"


class PeerError(RosbridgeSimError):
    """A mistake of a client or of another peer; the text may be sent to it.

    Attributes:
        reason: kind of mistake.
    """

    reason = Reason.REFUSED

    def __init__(self, text: str, *, reason: Reason | None = None) -> None:
        super().__init__(text)
        if reason is not None:
            self.reason = reason


class FrameError(PeerError):
    """A frame, or an object in it, that is not an op.

    Attributes:
        op_id: the `id` that the sender gave, unchanged, or None.
        op: the `op` that the sender gave, if it could be read, or None.
        service: of a call, the service's name as the sender gave it, or None.
    """

    reason = Reason.BAD_FRAME
    service: str | None = None

    def __init__(self, text: str, op_id: object = None, op: str | None = None, *, reason: Reason | None = None) -> None:
        super().__init__(text, reason=reason)
        self.op_id = op_id
        self.op = op


class TypeNameError(PeerError):
    """A type name that is malformed, or a type that its (known) package does not have."""

    reason = Reason.UNKNOWN_TYPE


class UnknownPackageError(TypeNameError):
    """A well-formed type name from a package that is in no schema folder."""


class FieldError(PeerError):
    """A message that does not fit its type; the text has the path of the field."""

    reason = Reason.WRONG_VALUE


class EncodingError(PeerError):
    """A message that fits its type but cannot be encoded; the cause is the encoder's error.

    It is an internal error that concerns only this message: its publisher is told, and no connection is closed.
    """

    reason = Reason.NOT_ENCODABLE


class GraphError(PeerError):
    """A topic, a service or a name that cannot be used: conflict, unknown, denied, or a limit."""


class DocumentError(RosbridgeSimError):
    """A file or a setting that cannot be used: place, mistake and expected value in one line."""


@contextmanager
def file_errors(path: object, done: str) -> Iterator[None]:
    """Turn an error of the disk into a `DocumentError` that names the file and the reason.

    Args:
        path: of the file, if the error names none.
        done: what was tried, such as "written".
    """
    try:
        yield
    except OSError as error:
        raise DocumentError(f"{error.filename or path}: cannot be {done}: {error.strerror or error}") from None


class DefinitionError(DocumentError):
    """A definition text that cannot be parsed.

    Attributes:
        line, column: position, counted from 1.
    """

    def __init__(self, source: str, line: int, column: int, text: str) -> None:
        super().__init__(f"{source}:{line}:{column}: {text}")
        self.line = line
        self.column = column


class SettingError(DocumentError):
    """A flag, variable, key or option that cannot be used."""


class ClientError(RosbridgeSimError):
    """A call of a client (`rosbridge_sim.client`) that cannot be done."""


class ConnectError(ClientError):
    """A connection that cannot be made.

    Attributes:
        status: HTTP status of the other side's answer; None without an answer.
        is_final: no later attempt with the same arguments can succeed: the URL or the token is not valid, or the server
            refuses the token.
    """

    def __init__(self, text: str, *, status: int | None = None, is_final: bool = False) -> None:
        super().__init__(text)
        self.status = status
        self.is_final = is_final


class ConnectionLostError(ClientError):
    """A connection that has ended or was never opened; the text says why."""


class ServiceRefusedError(ClientError):
    """A service that refused, or that does not exist.

    Attributes:
        service: its name.
        reason: the server's text; empty if it gave no reason.
        answer: the values of the refusal, unchanged.
    """

    def __init__(self, service: str, reason: str, answer: object = None) -> None:
        text = reason or "refused without a reason"
        super().__init__(text if text.startswith(f"{service}: ") else f"{service}: {text}")
        self.service = service
        self.reason = reason
        self.answer = answer


class OpRefusedError(ClientError):
    """A message, an advertisement or a subscription that the server refused, by a status frame."""


class AnswerTimeoutError(ClientError, TimeoutError):
    """An answer or a message that did not come in time."""
