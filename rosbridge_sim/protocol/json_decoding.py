"""Decoding of frames with JSON text, in text and binary frames, into ops.

Reading has two paths. The fast path decodes the whole frame once, with types, and leaves the bodies unread: half a
microsecond. If it fails, the slow path takes over. The slow path defines the full behaviour: it finds several JSON
objects in one frame, accepts the bare `NaN` that Python clients write, treats null as absent, and reports mistakes in
rosbridge_suite's own words. `tests/protocol/test_json_decoding.py` compares the two paths.
A long frame is weighed first (`weight.py`), because one call of a decoder can delay all other clients. Several ops in
one frame are read one by one, when the caller asks for the next.
One JSON object split over several frames is not joined: each part is a frame without valid JSON and is answered as
such. rosbridge_suite keeps the parts in a buffer that grows without limit.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable, Generator, Iterator, Mapping
from contextlib import suppress
from itertools import islice
from typing import Any, get_args, get_origin

import msgspec

from rosbridge_sim.errors import FrameError, Reason
from rosbridge_sim.long_text import LongText, find_long_text
from rosbridge_sim.loose_types import JsonValue
from rosbridge_sim.protocol.long_lists import has_more_values, put_in_lists, take_out_lists
from rosbridge_sim.protocol.ops import ABSENT, OPS, Op, is_absent
from rosbridge_sim.suggestions import hint, listing
from rosbridge_sim.weight import FULL, LIGHT, claim, weigh, weigh_exactly, weigh_in_slices

_SHOWN = 200
"""Characters of a client's text that an answer quotes: enough to recognise it, but too few to amplify an attack."""

HEAVY = 256 * 1024
"""A message with at least this much text is encoded later, when the outbox reaches it [bytes]. A shorter one takes at
most 20 ms in all encodings together."""

LONG = 16 * 1024
"""A frame of at least this length is weighed before it is decoded [bytes]. Decoding a shorter one takes at most 5 ms,
or 40 ms if it holds only numbers at the edge of float64."""

LONG_NUMBERS, FEW_VALUES = 2 * 2**20, 50_000
"""A frame of this size with so many values is decoded in parts, if nearly all of it is long lists of numbers."""

MANY_VALUES = 1_000_000
"""A frame with more values is refused if it cannot be decoded in parts: as many take one call 30 ms."""

MAX_OPS = 10_000
"""Largest number of ops in one frame. Each op is done by itself, and clients that put ops together send only a few."""
_ANSWER_OP = re.compile(r'"op"\s{0,8}:\s{0,8}"(service_response|action_result)"')
_ANSWER_ID = re.compile(r'"id"\s{0,8}:\s{0,8}"((?:service_request|action_goal):[^"\\]{1,300})"')
_OP = re.compile(r'"op"\s{0,8}:\s{0,8}"([a-z_]{1,30})"')
_SERVICE = re.compile(r'"service"\s{0,8}:\s{0,8}"([\x20-\x21\x23-\x5b\x5d-\x7e]{1,256})"')
_MAX_ANSWER_IDS = 100
_NAMED = 2_000
"""Characters at both ends of an unreadable frame that are searched for its op and its id."""


decode_op: Callable[[bytes | memoryview], Op] = msgspec.json.Decoder(Op).decode
"""Decodes the only op of a well-formed frame, or raises one of MALFORMED."""

MALFORMED = (msgspec.MsgspecError, UnicodeDecodeError, RecursionError)

_skip = msgspec.json.Decoder(msgspec.Raw).decode
_split = msgspec.json.Decoder(dict[str, msgspec.Raw]).decode
_scanner = json.JSONDecoder()

_TRAILING = re.compile(r"trailing characters \(byte (\d+)\)")
"""Text of the `msgspec` error for a value with something behind it; a test checks that this text does not change."""

_SPACE, _BYTE_SPACE = re.compile(r"[ \t\r\n]*"), re.compile(rb"[ \t\r\n]*")
_ID = re.compile(r'"id"\s*:\s*(?:"([\x20-\x21\x23-\x5b\x5d-\x7e]{1,200})"|(-?[0-9]{1,15})(?=\s*[,}]))')
_BODIES = frozenset(name for op in OPS.values() for name in op.bodies)


def _classes_of(kind: Any) -> tuple[type, ...]:  # noqa: ANN401 - a type form
    """Return the Python classes of the values of a field; a field for a number takes integers, too."""
    classes = tuple(get_origin(each) or each for each in get_args(kind) or (kind,) if each is not type(None))
    return (int, float) if classes == (float,) else classes


_CLASSES: dict[tuple[str, str], tuple[type, ...]] = {
    (name, field.name): _classes_of(field.type)
    for name, op in OPS.items()
    for field in msgspec.structs.fields(op)
    if field.name not in op.bodies
}
"""Allowed Python classes of the fields of each op; `schema/` checks message bodies."""

_FIELDS = frozenset({"op", *(field for _, field in _CLASSES)})


def decode_quickly(frame: bytes | memoryview) -> Op | None:
    """Return the only op of a well-formed frame; None if `decode_frame` must be used. Never raises.

    Args:
        frame: JSON text.
    """
    try:
        return decode_op(frame)
    except MALFORMED:
        return None


def decode_frame(frame: bytes) -> Iterator[Op | FrameError | None]:
    """Read the ops of a frame one by one, in order. Never raises.

    Args:
        frame: JSON text.

    Yields:
        An op; or the error to send to the peer, for a part that is not an op; or None after a slice of work, so that
        the caller can let others have their turn. A frame that is too heavy, or that holds too many ops, gives one
        error only.
    """
    if len(frame) >= LONG:
        quick = read_long_text(find_long_text(frame))
        if quick is not None:
            if len(frame) >= HEAVY:
                yield None
            yield quick
            return
        too_much = yield from _too_heavy(frame)
        if too_much is not None:
            error = FrameError(f"Received a frame that is too heavy: {too_much}")
            yield _name(error, _ends(frame))
            return
        claim(len(frame))
        if len(frame) >= HEAVY:
            yield None
        if len(frame) >= LONG_NUMBERS and frame.count(b",") >= FEW_VALUES and (yield from _decode_in_parts(frame)):
            return
    op = decode_quickly(frame)
    if op is not None:
        if len(frame) >= HEAVY:  # the op itself is another long step
            yield None
        yield op
    else:
        if len(frame) >= LONG:
            yield None
        yield from _decode_slowly(frame)


def read_long_text(long_text: LongText | None) -> Op | None:
    """Return the only op of a frame whose body is mostly one base64 text, which needs no weighing; None for others.

    Args:
        long_text: the frame, as `find_long_text` returns it.
    """
    op = None if long_text is None else decode_quickly(long_text.short)
    if op is None or long_text is None:
        return None
    for name in op.bodies:
        short = getattr(op, name)
        body = None if short is ABSENT else long_text.body(bytes(short))
        if body is not None:
            return msgspec.structs.replace(op, **{name: body})
    return None


def _too_heavy(frame: bytes) -> Generator[None, None, str | None]:
    """Return why a long frame is too heavy to be decoded in one call; None if it is not."""
    if len(frame) < HEAVY:
        if FULL.excess(weigh(frame)) is None:
            return None
    else:
        for weight in weigh_in_slices(frame):
            if FULL.excess(weight) is not None:
                break
            yield
        else:
            return None
    for weight in weigh_exactly(frame):
        too_much = FULL.excess(weight)
        if too_much is not None:
            return too_much
        yield
    return None


def _decode_in_parts(frame: bytes) -> Generator[Op | FrameError | None, None, bool]:
    """Read the only op of a frame with many values or long numbers, most of them in long lists.

    Returns:
        False if nothing was read, because one call of a decoder can read it.
    """
    try:
        short, lists = yield from take_out_lists(frame)
        too_much = LIGHT.excess(weigh(short))
        if too_much is None:
            yield None
            op = decode_op(short)
            yield None
            for name in op.bodies:
                body = getattr(op, name)
                if not is_absent(body):
                    op = msgspec.structs.replace(op, **{name: put_in_lists(msgspec.json.decode(body), lists)})
            yield op
            return True
        why = f"beside long lists of numbers {too_much}"
    except (msgspec.MsgspecError, ValueError, OverflowError, RecursionError) as error:
        why = f"as more than {MANY_VALUES:,} values it must be one plain op in JSON; {error}"
    if not (yield from has_more_values(frame, MANY_VALUES)):
        return False
    yield _name(FrameError(f"Received a frame that is too heavy: {why}"), _ends(frame))
    return True


def _decode_slowly(frame: bytes) -> Iterator[Op | FrameError | None]:
    """Read a frame with several objects, the words NaN or Infinity, or a mistake."""
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
    """Return the position where the JSON value at the start of a text ends; None if there is another mistake, too.

    Args:
        error: the error that `msgspec` raised for the whole text.
    """
    match = _TRAILING.search(str(error))
    return None if match is None else int(match[1]) - 1


def _find_end_of_value(view: memoryview) -> int | None:
    """Return the position where the JSON value at the start of a text ends; None if it is not plain JSON.

    The value is not decoded.

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
    """Return the op in a JSON text, or the error in it."""
    op = decode_quickly(part)
    if op is not None:
        return op
    try:
        return _op_or_error(json.loads(bytes(part)) if len(part) < LONG else _outline(part))
    except FrameError as error:
        return _name(error, _ends(part))
    except RecursionError:
        return FrameError("Received a message that is nested too deeply")
    except ValueError as error:  # an integer of thousands of digits
        return FrameError(f"Received a frame that is not valid JSON: {error}. The frame: {_shorten_bytes(part)}")


def _op_or_error(value: object) -> Op | FrameError:
    """Return the op for a JSON value, or the error in it together with the name of the op."""
    try:
        return op_from_value(value)
    except FrameError as error:
        name = value.get("op") if isinstance(value, dict) else None
        error.op = name if isinstance(name, str) else None
        return error


def _outline(part: memoryview) -> dict[str, Any]:
    """Return the fields of a long object: message bodies stay text, other long fields are left out.

    Raises:
        FrameError: the text is not an object.
    """
    try:
        fields = _split(part)
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError) as error:
        raise FrameError(f"Expected a JSON object with an op, but got something else: {error}") from None
    outline: dict[str, Any] = {}
    for name, value in fields.items():
        if name in _BODIES:
            outline[name] = value
        elif name in _FIELDS:
            text = bytes(value)
            if len(text) >= LONG and name != "data":  # a fragment may be long, and may end in half a surrogate pair
                raise FrameError(f"Expected less than {LONG:,} bytes in field {name}, but got {len(text):,}")
            outline[name] = json.loads(text)
    return outline


def _scan_words(frame: bytes, start: int, num_ops: int) -> Iterator[Op | FrameError | None]:
    """Read the rest of a frame with Python's JSON reader, which accepts NaN and Infinity."""
    rest = frame[start:]
    too_much = LIGHT.excess(weigh(rest))
    if too_much is not None:
        yield FrameError(f"Received a frame that is not plain JSON (NaN, Infinity or a mistake), and heavy: {too_much}")
        return
    is_long = len(rest) >= LONG
    lists: dict[str, Any] = {}
    if len(rest) >= HEAVY and rest.count(b",") >= FEW_VALUES:  # a picture of depths is one list: in parts
        with suppress(ValueError, OverflowError, RecursionError):  # the reader below finds the mistake, too
            rest, lists = yield from take_out_lists(rest, has_words=True)
    text = rest.decode()
    position = 0
    while position < len(text):
        if is_long:
            yield None
        try:
            value, position = _scanner.raw_decode(text, position)
            value = put_in_lists(value, lists) if lists else value
        except RecursionError:
            yield _name(FrameError("Received a message that is nested too deeply"), _ends(text[position:]))
            return
        except ValueError as error:  # JSONDecodeError, and integers of thousands of digits
            left_out = " (long lists of numbers not counted)" if lists else ""
            reason = f"Received a frame that is not valid JSON: {error}{left_out}. The frame: {_shorten(text)}"
            yield _name(FrameError(reason), _ends(text[position:]))
            return
        if is_long:  # the op itself is another long step
            yield None
        yield _op_or_error(value)
        position = _end_of(_SPACE.match(text, position))
        num_ops += 1
        if num_ops > MAX_OPS:
            yield FrameError(f"Received a frame with more than {MAX_OPS:,} ops; the rest of it is dropped")
            return


def _name(error: FrameError, text: str) -> FrameError:
    """Return the error with the op and the id of an unreadable call or answer, because a caller waits for it.

    The server itself made the ids of calls and goals, so they can be recognised anywhere in the text. If two different
    ids are found, none is taken.
    """
    op = _ANSWER_OP.search(text)
    ids = {found[1] for found in islice(_ANSWER_ID.finditer(text), _MAX_ANSWER_IDS)}
    if op is not None:
        error.op = op[1]
        error.op_id = ids.pop() if len(ids) == 1 else None
        return error
    if error.op_id is None and (match := _ID.search(text)) is not None:
        error.op_id = match[1] or int(match[2])
    services = {found[1] for found in islice(_SERVICE.finditer(text), _MAX_ANSWER_IDS)}
    if len(services) == 1 and {found[1] for found in islice(_OP.finditer(text), _MAX_ANSWER_IDS)} == {"call_service"}:
        error.op, error.service = "call_service", services.pop()
    return error


def _ends(text: bytes | memoryview | str) -> str:
    """Return both ends of a text that is not decoded: clients write op and id there."""
    if isinstance(text, str):
        return text[:_NAMED] + text[-_NAMED:]
    return (bytes(text[:_NAMED]) + bytes(text[-_NAMED:])).decode("latin-1")


def op_from_value(value: JsonValue) -> Op:
    """Return the op for a JSON value; message bodies stay as they are.

    Args:
        value: decoded JSON or CBOR; a body may still be JSON text.

    Raises:
        FrameError: the value is not an op; the text is in rosbridge_suite's words.
    """
    if not isinstance(value, dict):
        raise FrameError(f"Expected a JSON object with an op, but got {type(value).__name__}: {_shorten(str(value))}")
    op_id = value.get("id") if _is_id(value.get("id")) else None
    name = value.get("op")
    if name is None:
        if "receiver" in value:
            raise FrameError(
                "Received a rosbridge v1.0 message.  Please refer to rosbridge.org for the correct format of rosbridge"
                f" v2.0 messages.  Original message was: {_original(value)}",
                op_id,
            )
        raise FrameError(
            "Received a message without an op.  All messages require 'op' field with value one of:"
            f" {list(OPS)}.  Original message was: {_original(value)}",
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


def _original(value: Mapping[Any, object]) -> str:
    """Return the start of a message without an op, as Python writes it; a body that is not decoded as its JSON text."""
    texts = [
        f"{key!r}: {_shorten_bytes(memoryview(each)) if isinstance(each, msgspec.Raw) else repr(each)}"
        for key, each in value.items()
    ]
    return _shorten("{" + ", ".join(texts) + "}")


def _strange_fields(op: type[Op], value: Mapping[Any, object]) -> str:
    """Return a sentence about unknown fields of an op, since one may be misspelt; an empty text if there are none."""
    strange = sorted({str(key) for key in islice(value, _MAX_LOOKED_AT)} - {"op", *op.__struct_fields__})
    return f"  What came in place of it: {listing(strange)}" if strange else ""


_MAX_LOOKED_AT = 100
"""Fields of a wrong op that are searched: more than any op has."""


def _checked(given: JsonValue, op: str, field: str, op_id: object) -> JsonValue:
    classes = _CLASSES[op, field]
    # in Python, True is an int; rosbridge_suite accepts it, this server does not
    if not isinstance(given, classes) or (isinstance(given, bool) and bool not in classes):
        raise FrameError(
            f"{op}: Expected field {field} to be one of {classes}. Invalid value: {_shorten(str(given))}",
            op_id,
            reason=Reason.BAD_OP,
        )
    # half of a surrogate pair is allowed only at the ends of a fragment's data
    if not isinstance(given, dict) and field != "data" and not _is_id(given):
        raise FrameError(f"{op}: field {field} is no text or number that JSON knows", op_id, reason=Reason.BAD_OP)
    if isinstance(given, (int, float)) and classes == (int, float):
        try:
            return float(given)
        except OverflowError:  # a JSON integer may be larger than any float
            raise FrameError(f"{op}: field {field} is out of range", op_id, reason=Reason.BAD_OP) from None
    return given


def _is_unicode(text: str) -> bool:
    """Return True if a text has no half surrogate pair, which no encoder can send."""
    try:
        text.encode()
    except UnicodeEncodeError:
        return False
    return True


def _is_id(value: object) -> bool:
    """Return True if a value can be echoed as an id: a JSON scalar."""
    if isinstance(value, str):
        return _is_unicode(value)
    return isinstance(value, (bool, int)) or (isinstance(value, float) and math.isfinite(value))


_TOKEN = re.compile(r"""(['"]token['"]\s{0,8}:\s{0,8}['"])[^'"]*""", re.IGNORECASE)
"""The token in an `auth` op, as JSON and as Python write it."""


def _shorten(text: str) -> str:
    text = _TOKEN.sub(r"\1...", text[: 4 * _SHOWN])
    short = text if len(text) <= _SHOWN else text[:_SHOWN] + "..."
    return short.encode("utf-8", "replace").decode()


def _shorten_bytes(part: memoryview) -> str:
    return _shorten(bytes(part[: 4 * _SHOWN]).decode(errors="ignore"))
