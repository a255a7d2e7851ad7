"""Frames to ops and back: JSON text, in text and binary frames alike.

Reading has a fast path (one typed decode of the whole frame, bodies left unread: half a microsecond) and a
slow one that takes over whenever the fast one objects. The slow path is the full meaning: it finds glued
objects, accepts the bare `NaN` that Python clients write, takes null for absent and names what is wrong in
rosbridge_suite's own words. `tests/protocol/test_codec.py` holds the two against each other.

One JSON object split over several frames is not joined (rosbridge_suite keeps the halves in a buffer that
grows without bound): each half is a frame that holds no JSON, and is answered as such.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterator, Mapping
from itertools import islice
from typing import Any, Protocol

import msgspec
import orjson

from rosbridge_sim.errors import FrameError
from rosbridge_sim.protocol.ops import ABSENT, OPS, Id, Op

__all__ = [
    "Encoded",
    "decode_frame",
    "decode_quickly",
    "is_absent",
    "op_frame",
    "publish_head",
    "response_frame",
    "status_frame",
]

_SHOWN = 200
"""Characters of a stranger's text that an answer quotes: enough to recognise it, too few to be an amplifier."""

_ANSWER_OP = re.compile(r'"op"\s{0,8}:\s{0,8}"(service_response|action_result)"')
_ANSWER_ID = re.compile(r'"id"\s{0,8}:\s{0,8}"((?:service_request|action_goal):[^"\\]{1,300})"')
_MAX_ANSWER_IDS = 100

_decode = msgspec.json.Decoder(Op).decode
_scanner = json.JSONDecoder()

_CLASSES: dict[str, tuple[type, ...]] = {
    "topic": (str,),
    "type": (str,),
    "service": (str,),
    "level": (str,),
    "msg": (str,),
    "compression": (str,),
    "latch": (bool,),
    "result": (bool,),
    "reason": (str,),
    "throttle_rate": (int, float),
    "queue_length": (int, float),
    "fragment_size": (int, float),
    "timeout": (int, float),
    "id": (str, int, float, bool),
    "action": (str,),
    "action_type": (str,),
    "feedback": (bool,),
    "status": (int,),
    "data": (str,),
    "token": (str,),
    "num": (int, float),
    "total": (int, float),
    "qos": (dict,),
}
"""What a field may be, in any op; bodies are judged by `schema/`."""

_ID_CLASSES: dict[str, tuple[type, ...]] = {
    "fragment": (str, int, float),
    "cancel_action_goal": (str,),
    "action_feedback": (str,),
    "action_result": (str,),
}
"""Ops whose id must be more than any scalar."""


class Encoded(Protocol):
    """A message whose encodings are made once and shared by all who listen."""

    @property
    def json(self) -> bytes:
        """The body as JSON text."""

    @property
    def cbor(self) -> bytes:
        """The body as a CBOR map, numeric arrays as typed arrays."""

    @property
    def raw(self) -> bytes:
        """The body as ROS itself sends it: ROS 1 bytes, or CDR with its four bytes in front."""

    def framed(self, head: bytes) -> bytes:
        """`head`, the body as JSON text, and a closing brace; the last such frame is kept for the next listener."""


def decode_quickly(frame: bytes) -> Op | None:
    """The one op that a clean frame holds; None where `decode_frame` has to look more closely. Never raises."""
    try:
        op: Op = _decode(frame)
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError):
        return None
    return op


def decode_frame(frame: bytes) -> Iterator[Op | FrameError]:
    """The ops in a frame, in order; what is no op comes as the error to be told to its sender. Never raises."""
    op = decode_quickly(frame)
    if op is not None:
        yield op
    else:
        yield from _decode_slowly(frame)


def _decode_slowly(frame: bytes) -> Iterator[Op | FrameError]:
    try:
        text = frame.decode()
    except UnicodeDecodeError as error:
        yield _name(
            FrameError(f"Received a frame that is neither JSON text nor UTF-8: {error}"), frame.decode("latin-1")
        )
        return
    position = _skip_space(text, 0)
    if position == len(text):
        yield FrameError("Received an empty frame")
    while position < len(text):
        try:
            value, position = _scanner.raw_decode(text, position)
        except RecursionError:
            yield _name(FrameError("Received a message that is nested too deeply"), text[position:])
            return
        except ValueError as error:  # JSONDecodeError, and integers of thousands of digits
            problem = FrameError(f"Received a frame that is not valid JSON: {error}. The frame: {_shorten(text)}")
            yield _name(problem, text[position:])
            return
        try:
            yield _to_op(value)
        except FrameError as error:
            name = value.get("op") if isinstance(value, dict) else None
            error.op = name if isinstance(name, str) else None
            yield error
        position = _skip_space(text, position)


def _name(error: FrameError, text: str) -> FrameError:
    """The error, with the op and the id that an unreadable answer of a provider names: somebody waits for it.

    The ids of calls and goals are ours, so they are known wherever they stand; two different ones are none.
    """
    op = _ANSWER_OP.search(text)
    ids = {found[1] for found in islice(_ANSWER_ID.finditer(text), _MAX_ANSWER_IDS)}
    if op is not None:
        error.op = op[1]
        error.op_id = ids.pop() if len(ids) == 1 else None
    return error


def _skip_space(text: str, position: int) -> int:
    while position < len(text) and text[position] in " \t\r\n":
        position += 1
    return position


def _to_op(value: Any) -> Op:  # noqa: ANN401 - any JSON value
    """The op that a JSON value spells, or a FrameError in rosbridge_suite's words."""
    if not isinstance(value, dict):
        raise FrameError(f"Expected a JSON object with an op, but got {type(value).__name__}: {_shorten(str(value))}")
    op_id = value.get("id") if _is_id(value.get("id")) else None
    name = value.get("op")
    if name is None:
        if "receiver" in value:
            raise FrameError(
                "Received a rosbridge v1.0 message.  Please refer to rosbridge.org for the correct format of rosbridge"
                f" v2.0 messages.  Original message was: {_shorten(str(value))}",
                op_id,
            )
        raise FrameError(
            "Received a message without an op.  All messages require 'op' field with value one of:"
            f" {list(OPS)}.  Original message was: {_shorten(str(value))}",
            op_id,
        )
    op = OPS.get(name) if isinstance(name, str) else None
    if op is None:
        raise FrameError(f"Unknown operation: {_shorten(str(name))}.  Allowed operations: {list(OPS)}", op_id)
    fields: dict[str, Any] = {}
    for field in msgspec.structs.fields(op):
        given = value.get(field.name)
        if given is None:
            if field.required:
                raise FrameError(f"{name}: Expected a {field.name} field but none was found.", op_id)
        elif field.name in op.bodies:
            fields[field.name] = _raw(given, f"{name}: {field.name}", op_id)
        else:
            fields[field.name] = _checked(given, name, field.name, op_id)
    made: Op = op(**fields)
    return made


def _checked(given: Any, op: str, field: str, op_id: object) -> Any:  # noqa: ANN401 - any JSON value
    classes = _ID_CLASSES.get(op, _CLASSES["id"]) if field == "id" else _CLASSES[field]
    # Python would let True pass for 1; rosbridge_suite does, we do not
    if not isinstance(given, classes) or (isinstance(given, bool) and bool not in classes):
        raise FrameError(
            f"{op}: Expected field {field} to be one of {classes}. Invalid value: {_shorten(str(given))}", op_id
        )
    # halves of a surrogate pair may stand at the ends of a fragment's data, and nowhere else
    if not isinstance(given, dict) and field != "data" and not _is_id(given):
        raise FrameError(f"{op}: field {field} is no text or number that JSON knows", op_id)
    if isinstance(given, (int, float)) and classes == (int, float):
        try:
            return float(given)
        except OverflowError:  # JSON has integers beyond any float
            raise FrameError(f"{op}: field {field} is out of range", op_id) from None
    return given


def _is_unicode(text: str) -> bool:
    """Whether text has no half of a surrogate pair, which no encoder could send on."""
    try:
        text.encode()
    except UnicodeEncodeError:
        return False
    return True


def _is_id(value: object) -> bool:
    """Whether a value can be echoed as an id: a JSON scalar that JSON can say."""
    if isinstance(value, str):
        return _is_unicode(value)
    return isinstance(value, (bool, int)) or (isinstance(value, float) and math.isfinite(value))


def _raw(value: Any, where: str, op_id: object) -> msgspec.Raw:  # noqa: ANN401 - any JSON value
    """A body back as text, bare NaN and Infinity included: `schema/` knows what they mean."""
    try:
        return msgspec.Raw(json.dumps(value).encode())
    except (RecursionError, ValueError) as error:
        raise FrameError(f"{where} is nested too deeply", op_id) from error


def _shorten(text: str) -> str:
    short = text if len(text) <= _SHOWN else text[:_SHOWN] + "..."
    return short.encode("utf-8", "replace").decode()


def is_absent(body: msgspec.Raw | bytes) -> bool:
    """Whether a body was left out, or null, which means the same."""
    return body is ABSENT or bytes(body) in {b"", b"null"}


def publish_head(topic: str) -> bytes:
    """Everything of a data message that stands before its body; `topic` in the listener's own spelling."""
    return b'{"op":"publish","topic":' + orjson.dumps(topic) + b',"msg":'


def response_frame(service: str, values: bytes, *, is_ok: bool, op_id: Id) -> bytes:
    """The answer to a call. `id` is there if and only if the call had one."""
    tail = b"}" if op_id is None else b',"id":' + _encode_id(op_id) + b"}"
    result = b',"result":true' if is_ok else b',"result":false'
    return b'{"op":"service_response","service":' + orjson.dumps(service) + b',"values":' + values + result + tail


def op_frame(op: str, bodies: Mapping[str, bytes], **fields: object) -> bytes:
    """Any op of ours: its fields, of which `None` is left out, and its bodies, which are JSON text already."""
    parts = [b'{"op":' + orjson.dumps(op)]
    for name, value in fields.items():
        if value is not None:
            parts.append(orjson.dumps(name) + b":" + (_encode_id(value) if name == "id" else orjson.dumps(value)))
    parts += [orjson.dumps(name) + b":" + body for name, body in bodies.items()]
    return b",".join(parts) + b"}"


def status_frame(level: str, text: str, op_id: object) -> bytes:
    """A remark of ours; `op_id` names the frame that it is about."""
    return op_frame("status", {}, level=level, msg=text, id=op_id)


def _encode_id(op_id: object) -> bytes:
    """An id as it came; the standard library writes integers of any size."""
    return orjson.dumps(op_id) if isinstance(op_id, str) else json.dumps(op_id).encode()
