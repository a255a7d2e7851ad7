"""Frames to ops and back: JSON text, in text and binary frames alike.

Reading has a fast path (one typed decode of the whole frame, bodies left unread: half a microsecond) and a
slow one that takes over whenever the fast one objects. The slow path is the full meaning: it finds glued
objects, accepts the bare `NaN` that Python clients write, takes null for absent and names what is wrong in
rosbridge_suite's own words. `tests/protocol/test_codec.py` holds the two against each other.

A long frame is weighed first (`weight.py`): one call of a decoder can delay all other clients. Glued ops are read one
by one, as their reader asks for them.

One JSON object split over several frames is not joined (rosbridge_suite keeps the halves in a buffer that
grows without bound): each half is a frame that holds no JSON, and is answered as such.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable, Generator, Iterator, Mapping
from itertools import islice
from typing import Any, Protocol, TypeVar

import msgspec
import orjson

from rosbridge_sim.errors import FrameError, Reason
from rosbridge_sim.loose_types import JsonValue
from rosbridge_sim.printable import printable
from rosbridge_sim.protocol.ops import ABSENT, OPS, Id, Op, OpBody
from rosbridge_sim.suggestions import hint, listing
from rosbridge_sim.weight import FULL, LIGHT, claim, weigh, weigh_exactly

__all__ = [
    "HEAVY",
    "LONG",
    "Encoded",
    "decode_frame",
    "decode_quickly",
    "end_of_value",
    "is_absent",
    "op_frame",
    "op_from_value",
    "publish_head",
    "response_frame",
    "status_frame",
]

_SHOWN = 200
"""Characters of a client's text that an answer quotes: enough to recognise it, too few to be an amplifier."""

HEAVY = 256 * 1024
"""A message whose text is as long as this is encoded when its listener's turn has come [bytes]; less takes 20 ms at
most, in all encodings together."""

LONG = 16 * 1024
"""A frame from here on is weighed before it is decoded [bytes]; decoding less takes 5 ms at most, or 40 ms where it
holds nothing but numbers at the edge of float64."""

MAX_OPS = 10_000
"""Ops that one frame may hold: each is done by itself, but what is glued together should be a handful."""
_ANSWER_OP = re.compile(r'"op"\s{0,8}:\s{0,8}"(service_response|action_result)"')
_ANSWER_ID = re.compile(r'"id"\s{0,8}:\s{0,8}"((?:service_request|action_goal):[^"\\]{1,300})"')
_MAX_ANSWER_IDS = 100
_NAMED = 2_000
"""Characters at both ends of an unreadable frame in which its op and its id are looked for."""


_decode = msgspec.json.Decoder(Op).decode
_skip = msgspec.json.Decoder(msgspec.Raw).decode
_split = msgspec.json.Decoder(dict[str, msgspec.Raw]).decode
_scanner = json.JSONDecoder()

_TRAILING = re.compile(r"trailing characters \(byte (\d+)\)")
"""Words by which `msgspec` says that a value has ended and something follows; a test holds it to these words."""

_SPACE, _BYTE_SPACE = re.compile(r"[ \t\r\n]*"), re.compile(rb"[ \t\r\n]*")
_ID = re.compile(r'"id"\s*:\s*"([\x20-\x21\x23-\x5b\x5d-\x7e]{1,200})"')
_BODIES = frozenset(name for op in OPS.values() for name in op.bodies)

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
"""Classes that a field may have, in any op; bodies are judged by `schema/`."""

_ID_CLASSES: dict[str, tuple[type, ...]] = {
    "fragment": (str, int, float),
    "cancel_action_goal": (str,),
    "action_feedback": (str,),
    "action_result": (str,),
}
"""Ops whose id must be more than any scalar."""


T = TypeVar("T")


class Encoded(Protocol):
    """A message whose encodings are made once and shared by all subscribers."""

    @property
    def text_length(self) -> int:
        """Length of the text that it came as, if that was long [bytes]."""

    @property
    def num_bytes(self) -> int:
        """An estimate of what holding it costs [bytes]."""

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

    def shared(self, key: object, make: Callable[[], T]) -> T:
        """Return what `make` gives, made once for all calls with this key."""


def decode_quickly(frame: bytes | memoryview) -> Op | None:
    """Return the one op that a clean frame holds; None where `decode_frame` has to look more closely. Never raises."""
    try:
        op: Op = _decode(frame)
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError):
        return None
    return op


def decode_frame(frame: bytes) -> Iterator[Op | FrameError | None]:
    """Read the ops of a frame one by one, in order. Never raises.

    Args:
        frame: JSON text.

    Yields:
        An op; or, for what is no op, the error to be told to its sender; or None after a slice of work without one,
        so that the caller can let others have their turn. A frame that is too heavy, or that holds too many ops, is
        one error and no more.
    """
    if len(frame) >= LONG:
        too_much = yield from _too_heavy(frame)
        if too_much is not None:
            error = FrameError(f"Received a frame that is too heavy: {too_much}")
            yield _name(error, _ends(frame))
            return
        claim(len(frame))
        if len(frame) >= HEAVY:
            yield None
    op = decode_quickly(frame)
    if op is not None:
        if len(frame) >= HEAVY:  # what it asks for is a long step of its own
            yield None
        yield op
    else:
        if len(frame) >= LONG:
            yield None
        yield from _decode_slowly(frame)


def _too_heavy(frame: bytes) -> Generator[None, None, str | None]:
    """Say what a long frame has too much of to be decoded at once; None where that can be done."""
    too_much = FULL.excess(weigh(frame))
    if too_much is None:
        return None
    for weight in weigh_exactly(frame):
        too_much = FULL.excess(weight)
        if too_much is not None:
            return too_much
        yield
    return None


def _decode_slowly(frame: bytes) -> Iterator[Op | FrameError | None]:
    """Read a frame that holds glued objects, the words NaN or Infinity, or a mistake."""
    try:
        frame.decode()
    except UnicodeDecodeError as error:
        yield _name(FrameError(f"Received a frame that is neither JSON text nor UTF-8: {error}"), _ends(frame))
        return
    view = memoryview(frame)
    position = _end_of(_BYTE_SPACE.match(frame))
    if position == len(frame):
        yield FrameError("Received an empty frame")
    num_ops = 0
    while position < len(frame):
        num_ops += 1
        if num_ops > MAX_OPS:
            yield FrameError(f"Received a frame with more than {MAX_OPS:,} ops; the rest of it is dropped")
            return
        try:
            end = _find_end_of_value(view[position:])
        except FrameError as error:
            yield _name(error, _ends(view[position:]))
            return
        if end is None:
            yield from _scan_words(frame, position, num_ops)
            return
        if end >= LONG:
            yield None
        yield _read_op(view[position : position + end])
        position = _end_of(_BYTE_SPACE.match(frame, position + end))


def _end_of(match: re.Match[Any] | None) -> int:
    assert match is not None, "white space may be none"
    return match.end()


def end_of_value(error: Exception) -> int | None:
    """Return where the JSON value ends that a text begins with; None where more is wrong than what follows it.

    Args:
        error: what `msgspec` raised for the whole text.
    """
    match = _TRAILING.search(str(error))
    return None if match is None else int(match[1]) - 1


def _find_end_of_value(view: memoryview) -> int | None:
    """Find where the JSON value ends that a text begins with, without decoding it; None where it is not plain JSON.

    Raises:
        FrameError: it is nested too deeply.
    """
    try:
        _skip(view)
    except msgspec.DecodeError as error:
        return end_of_value(error)
    except UnicodeDecodeError:
        return None
    except RecursionError:
        raise FrameError("Received a message that is nested too deeply") from None
    return len(view)


def _read_op(part: memoryview) -> Op | FrameError:
    """Return the op that a JSON value spells, or what is wrong with it."""
    op = decode_quickly(part)
    if op is not None:
        return op
    try:
        return _op_or_error(json.loads(bytes(part)) if len(part) < LONG else _outline(part))
    except FrameError as error:
        return _name(error, _ends(part))
    except RecursionError:
        return FrameError("Received a message that is nested too deeply")
    except ValueError as error:  # integers of thousands of digits
        return FrameError(f"Received a frame that is not valid JSON: {error}. The frame: {_shorten_bytes(part)}")


def _op_or_error(value: object) -> Op | FrameError:
    """Return the op that a JSON value spells, or what is wrong with it, with the op that it names."""
    try:
        return op_from_value(value)
    except FrameError as error:
        name = value.get("op") if isinstance(value, dict) else None
        error.op = name if isinstance(name, str) else None
        return error


def _outline(part: memoryview) -> dict[str, Any]:
    """Return the fields of a long object: its bodies stay text, what else is long is left out.

    Raises:
        FrameError: it is no object.
    """
    try:
        fields = _split(part)
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError) as error:
        raise FrameError(f"Expected a JSON object with an op, but got something else: {error}") from None
    outline: dict[str, Any] = {}
    for name, value in fields.items():
        if name in _BODIES:
            outline[name] = value
        elif name in _CLASSES or name == "op":
            text = bytes(value)
            if len(text) >= LONG and name != "data":  # a piece may be long, and end in half a surrogate pair
                raise FrameError(f"Expected less than {LONG:,} bytes in field {name}, but got {len(text):,}")
            outline[name] = json.loads(text)
    return outline


def _scan_words(frame: bytes, start: int, num_ops: int) -> Iterator[Op | FrameError]:
    """Read the rest of a frame as Python's JSON has it, with NaN and Infinity; each value becomes Python objects."""
    rest = frame[start:]
    too_much = LIGHT.excess(weigh(rest))
    if too_much is not None:
        yield FrameError(f"Received a frame that is not plain JSON (NaN, Infinity or a mistake), and heavy: {too_much}")
        return
    text = rest.decode()
    position = 0
    while position < len(text):
        try:
            value, position = _scanner.raw_decode(text, position)
        except RecursionError:
            yield _name(FrameError("Received a message that is nested too deeply"), _ends(text[position:]))
            return
        except ValueError as error:  # JSONDecodeError, and integers of thousands of digits
            problem = FrameError(f"Received a frame that is not valid JSON: {error}. The frame: {_shorten(text)}")
            yield _name(problem, _ends(text[position:]))
            return
        yield _op_or_error(value)
        position = _end_of(_SPACE.match(text, position))
        num_ops += 1
        if num_ops > MAX_OPS:
            yield FrameError(f"Received a frame with more than {MAX_OPS:,} ops; the rest of it is dropped")
            return


def _name(error: FrameError, text: str) -> FrameError:
    """Return the error, with the op and the id that an unreadable answer of a provider names: a caller waits for it.

    The ids of calls and goals are ours, so they are known wherever they stand; two different ones are none.
    """
    op = _ANSWER_OP.search(text)
    ids = {found[1] for found in islice(_ANSWER_ID.finditer(text), _MAX_ANSWER_IDS)}
    if op is not None:
        error.op = op[1]
        error.op_id = ids.pop() if len(ids) == 1 else None
    elif error.op_id is None and (match := _ID.search(text)) is not None:
        error.op_id = match[1]
    return error


def _ends(text: bytes | memoryview | str) -> str:
    """Both ends of a text that is not decoded, where clients write its op and its id."""
    if isinstance(text, str):
        return text[:_NAMED] + text[-_NAMED:]
    return (bytes(text[:_NAMED]) + bytes(text[-_NAMED:])).decode("latin-1")


def op_from_value(value: JsonValue) -> Op:
    """Return the op that a JSON value spells; its bodies stay as they are.

    Args:
        value: decoded JSON or CBOR; a body may still be JSON text.

    Raises:
        FrameError: it is none, in rosbridge_suite's words.
    """
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
            reason=Reason.UNKNOWN_OP,
        )
    op = OPS.get(name) if isinstance(name, str) else None
    if op is None:
        near = hint(name, OPS, cutoff=0.6) if isinstance(name, str) else ""
        raise FrameError(
            f"Unknown operation: {_shorten(str(name))}.  Allowed operations: {list(OPS)}{near}",
            op_id,
            reason=Reason.UNKNOWN_OP,
        )
    fields: dict[str, Any] = {}
    for field in msgspec.structs.fields(op):
        given = value.get(field.name)
        if given is None:
            if field.required:
                text = f"{name}: Expected a {field.name} field but none was found.{_strange_fields(op, value)}"
                raise FrameError(text, op_id, reason=Reason.BAD_OP)
        elif field.name in op.bodies:
            fields[field.name] = given
        else:
            fields[field.name] = _checked(given, name, field.name, op_id)
    made: Op = op(**fields)
    return made


def _strange_fields(op: type[Op], value: Mapping[Any, object]) -> str:
    """Return a sentence on the fields that mean nothing in an op, one of which is perhaps misspelt; or nothing."""
    strange = sorted({str(key) for key in islice(value, _MAX_LOOKED_AT)} - {"op", *op.__struct_fields__})
    return f"  What came in place of it: {listing(strange)}" if strange else ""


_MAX_LOOKED_AT = 100
"""Fields of a wrong op that are looked at: more than any op has."""


def _checked(given: JsonValue, op: str, field: str, op_id: object) -> JsonValue:
    classes = _ID_CLASSES.get(op, _CLASSES["id"]) if field == "id" else _CLASSES[field]
    # Python would let True pass for 1; rosbridge_suite does, we do not
    if not isinstance(given, classes) or (isinstance(given, bool) and bool not in classes):
        raise FrameError(
            f"{op}: Expected field {field} to be one of {classes}. Invalid value: {_shorten(str(given))}",
            op_id,
            reason=Reason.BAD_OP,
        )
    # halves of a surrogate pair may stand at the ends of a fragment's data, and nowhere else
    if not isinstance(given, dict) and field != "data" and not _is_id(given):
        raise FrameError(f"{op}: field {field} is no text or number that JSON knows", op_id, reason=Reason.BAD_OP)
    if isinstance(given, (int, float)) and classes == (int, float):
        try:
            return float(given)
        except OverflowError:  # JSON has integers beyond any float
            raise FrameError(f"{op}: field {field} is out of range", op_id, reason=Reason.BAD_OP) from None
    return given


def _is_unicode(text: str) -> bool:
    """Tell whether a text has no half of a surrogate pair, which no encoder could send on."""
    try:
        text.encode()
    except UnicodeEncodeError:
        return False
    return True


def _is_id(value: object) -> bool:
    """Tell whether a value can be echoed as an id: a scalar that JSON has."""
    if isinstance(value, str):
        return _is_unicode(value)
    return isinstance(value, (bool, int)) or (isinstance(value, float) and math.isfinite(value))


_TOKEN = re.compile(r"""(['"]token['"]\s{0,8}:\s{0,8}['"])[^'"]*""", re.IGNORECASE)
"""Token of an `auth`, as JSON and as Python write it."""


def _shorten(text: str) -> str:
    text = _TOKEN.sub(r"\1...", text[: 4 * _SHOWN])
    short = text if len(text) <= _SHOWN else text[:_SHOWN] + "..."
    return short.encode("utf-8", "replace").decode()


def _shorten_bytes(part: memoryview) -> str:
    return _shorten(bytes(part[: 4 * _SHOWN]).decode(errors="ignore"))


def is_absent(body: OpBody) -> bool:
    """Tell whether a body was left out, or null, which means the same."""
    if isinstance(body, (bytes, msgspec.Raw)):
        return body is ABSENT or bytes(body) in {b"", b"null"}
    return body is None


def publish_head(topic: str) -> bytes:
    """Return a data message up to its body; `topic` is in the subscriber's own spelling."""
    return b'{"op":"publish","topic":' + orjson.dumps(topic) + b',"msg":'


def response_frame(service: str, values: bytes, *, is_ok: bool, op_id: Id) -> bytes:
    """Return the answer to a call. It has an `id` if and only if the call had one."""
    tail = b"}" if op_id is None else b',"id":' + _encode_id(op_id) + b"}"
    result = b',"result":true' if is_ok else b',"result":false'
    return b'{"op":"service_response","service":' + orjson.dumps(service) + b',"values":' + values + result + tail


def op_frame(op: str, bodies: Mapping[str, bytes], **fields: object) -> bytes:
    """Return the frame of any op: its fields without those that are None, and its bodies, which are JSON text."""
    parts = [b'{"op":' + orjson.dumps(op)]
    for name, value in fields.items():
        if value is not None:
            parts.append(orjson.dumps(name) + b":" + (_encode_id(value) if name == "id" else orjson.dumps(value)))
    parts += [orjson.dumps(name) + b":" + body for name, body in bodies.items()]
    return b",".join(parts) + b"}"


def status_frame(level: str, text: str, op_id: object) -> bytes:
    """A remark of ours; `op_id` names the frame that it is about. Half surrogate pairs of a peer's are escaped."""
    return op_frame("status", {}, level=level, msg=printable(text), id=op_id)


def _encode_id(op_id: object) -> bytes:
    """An id as it came; the standard library writes integers of any size."""
    return orjson.dumps(op_id) if isinstance(op_id, str) else json.dumps(op_id).encode()
