"""CBOR frames: binary frames whose first byte opens a map (0xA0 to 0xBF; JSON text never starts so).

CBOR frames are sent only to subscribers that asked for them; `schema/` encodes their bodies. Incoming frames are
decoded into Python objects. Typed arrays (RFC 8746) of either byte order become numpy arrays. Byte strings become
base64 text, as in JSON. Every other tag is refused, because a client could use tags to build regular expressions,
dates, bignums and objects that contain themselves.
The decoder is one call of a C library, and nothing else runs during that call: 4 MB of empty lists take it a second. So
the items of a frame are counted first, in slices, and a frame with too many items is refused.
"""

from __future__ import annotations

import re
from collections.abc import Generator
from io import BytesIO
from typing import NoReturn

import cbor2
import numpy as np
import pybase64

from rosbridge_sim.errors import FrameError
from rosbridge_sim.loose_types import LibraryArgument
from rosbridge_sim.weight import LIGHT

MAX_CBOR_DEPTH = 100
"""Deepest nesting of a CBOR frame; the deepest ROS message of the standard packages has seven levels."""

MAX_CONTAINERS, MAX_TEXTS = LIGHT.containers, LIGHT.texts
"""Largest number of maps and lists in a frame, and of texts, byte strings and tags. Python checks these values one by
one."""

MAX_SCALAR_BYTES = 2**19
"""Largest number of bytes of plain numbers and truth values in a frame, one to nine bytes each. It takes 60 ms if all
numbers are small. Larger arrays should be typed arrays or byte strings, which cost almost nothing."""

_CALL, _SERVICE, _ID = b"\x62op\x6ccall_service", b"\x67service", b"\x62id"
"""CBOR of `"op": "call_service"`, and of two keys."""

_NAMED, _LONGEST_NAME = 2_000, 300
"""Bytes at both ends of an unreadable frame that are searched for its op; and of a name in them."""

_ARRAY_TYPES = {
    64: "u1", 65: ">u2", 66: ">u4", 67: ">u8", 68: "u1", 69: "<u2", 70: "<u4", 71: "<u8",
    72: "i1", 73: ">i2", 74: ">i4", 75: ">i8", 77: "<i2", 78: "<i4", 79: "<i8",
    80: ">f2", 81: ">f4", 82: ">f8", 84: "<f2", 85: "<f4", 86: "<f8",
}  # fmt: skip
"""RFC 8746 tags that numpy supports; it does not support floats of 128 bits."""

_BUILT_IN_TAGS = (0, 1, 2, 3, 4, 5, 25, 28, 29, 30, 35, 36, 37, 52, 54, 100, 256, 258, 260, 261, 1004, 43000, 55799)
"""Tags that the library decodes by itself."""


def is_cbor(frame: bytes) -> bool:
    """Return True if a frame starts as a CBOR map does.

    Args:
        frame: a binary frame.
    """
    return 0xA0 <= frame[0] <= 0xBF if frame else False  # noqa: PLR2004 - RFC 8949: major type 5


def is_bson(frame: bytes) -> bool:
    """Return True if a frame is as long as its first four bytes say, and ends with a zero: a document of BSON.

    No frame of JSON or CBOR is: those bytes of theirs stand for hundreds of megabytes.
    """
    return len(frame) >= _MIN_BSON and frame[-1] == 0 and int.from_bytes(frame[:4], "little") == len(frame)


_MIN_BSON = 5
"""Length of the empty document of BSON [bytes]."""


def decode_cbor(frame: bytes) -> Generator[None, None, object]:
    """Decode a CBOR frame; yield after each slice of work, and return the value at the end.

    Args:
        frame: a binary frame.

    Returns:
        Dicts, lists, texts, numbers, truth values and None; numpy arrays for typed arrays, base64 text for byte
        strings.

    Raises:
        FrameError: the frame is not CBOR, is too heavy, or holds a value that JSON does not have.
    """
    try:
        yield from _check_weight(frame)
        value = cbor2.loads(
            frame,
            tag_hook=_read_tag,
            semantic_decoders=_REFUSING,
            max_depth=MAX_CBOR_DEPTH,
            allow_duplicate_keys=False,
            strict_hashable_types=True,
        )
        yield
        return _plain(value)
    except (cbor2.CBORError, ValueError, OverflowError, RecursionError) as error:
        refusal = FrameError(f"Received a binary frame that is neither JSON nor plain CBOR: {error}")
        _name_call(refusal, frame[:_NAMED] + frame[-_NAMED:])
        raise refusal from None


def _name_call(error: FrameError, ends: bytes) -> None:
    """Give an error the id and the service of an unreadable call, because its caller waits for an answer.

    Args:
        ends: both ends of the frame, where clients write them.
    """
    if ends.count(_CALL) == 1 == ends.count(_SERVICE):
        service = _read_scalar(ends, _SERVICE)
        if isinstance(service, str):
            error.op, error.op_id, error.service = "call_service", _read_scalar(ends, _ID), service


def _read_scalar(ends: bytes, key: bytes) -> object:
    """Return the text or the natural number behind a key; None if there is none that can be read."""
    _, _, rest = ends.partition(key)
    if not rest or rest[0] >> 5 not in {0, 3}:
        return None
    try:
        return cbor2.CBORDecoder(BytesIO(rest[:_LONGEST_NAME])).decode()
    except (cbor2.CBORError, ValueError):
        return None


def _check_weight(frame: bytes) -> Generator[None, None, None]:
    """Count the items of a frame at any depth. The head of each item says how many bytes of content to skip.

    Raises:
        ValueError: there are too many items.
    """
    position = num_containers = num_texts = scalar_bytes = 0
    while position < len(frame):
        run = _SCALARS.match(frame, position)
        if run is not None:
            scalar_bytes += run.end() - position
            position = run.end()
            if scalar_bytes > MAX_SCALAR_BYTES:
                raise ValueError(f"at most {MAX_SCALAR_BYTES:,} bytes of plain numbers are taken; use typed arrays")
            continue
        major, info = frame[position] >> 5, frame[position] & 31
        head = 1 + _HEAD_SIZES.get(info, 0)
        if major in {2, 3} and info != _INDEFINITE:  # bytes, text
            number = info if head == 1 else int.from_bytes(frame[position + 1 : position + head], "big")
            position += number
        position += head
        is_container = major in {4, 5}
        num_containers += is_container
        num_texts += not is_container
        if num_containers > MAX_CONTAINERS or num_texts > MAX_TEXTS:
            raise ValueError(f"at most {MAX_CONTAINERS:,} maps and lists and {MAX_TEXTS:,} texts are taken")
        if (num_containers + num_texts) % _NUM_LOOKED_AT == 0:
            yield


_SCALARS = re.compile(
    rb"(?:[\x00-\x17\x20-\x37\xe0-\xf7]|[\x18\x38\xf8].|[\x19\x39\xf9]..|[\x1a\x3a\xfa].{4}|[\x1b\x3b\xfb].{8})"
    rb"{1,20000}+",
    re.DOTALL,
)
"""A run of integers, floats and truth values (RFC 8949 section 3), short enough to be matched in about 2 ms."""

_HEAD_SIZES = {24: 1, 25: 2, 26: 4, 27: 8}
_INDEFINITE = 31

_NUM_LOOKED_AT = 2_000
"""Number of items counted in one slice: 1 ms."""


def _read_tag(*args: LibraryArgument) -> object:  # the library also passes the decoder
    tag = args[-1] if isinstance(args[-1], cbor2.CBORTag) else args[0]
    kind = _ARRAY_TYPES.get(tag.tag)
    if kind is None or not isinstance(tag.value, bytes):
        raise ValueError(f"tag {tag.tag} is not accepted")
    if tag.tag in {64, 68}:
        return tag.value
    array = np.frombuffer(tag.value, kind)
    return array.astype(array.dtype.newbyteorder("="), copy=False)


def _refuse_tag(*_: object) -> NoReturn:
    raise ValueError("dates, bignums, shared values and other tags are not accepted")


_REFUSING = dict.fromkeys(_BUILT_IN_TAGS, _refuse_tag)


_PLAIN = frozenset({bool, int, float, str, type(None)})


def _plain(value: object) -> object:
    """Return the value with byte strings as base64 text; raise ValueError for a value that JSON does not have."""
    if isinstance(value, bytes):
        return pybase64.b64encode_as_string(value)
    if isinstance(value, dict):
        if not all(isinstance(key, str) for key in value):
            raise ValueError("the keys of a map must be texts")
        return {key: _plain(inner) for key, inner in value.items()}
    if isinstance(value, list):
        if _PLAIN.issuperset(map(type, value)):
            return value
        return [_plain(inner) for inner in value]
    if value is None or isinstance(value, (bool, int, float, str, np.ndarray)):
        return value
    raise ValueError(f"{type(value).__name__} is not accepted")


def cbor_head(topic: str) -> bytes:
    """Return the start of a CBOR data message, up to its body.

    Args:
        topic: name of the topic as the subscriber spells it.
    """
    return b"\xa3\x62op\x67publish\x65topic" + cbor2.dumps(topic) + b"\x63msg"


def cbor_raw_frame(head: bytes, stamp_ns: int, raw: bytes) -> bytes:
    """Return a `cbor-raw` data message; its keys are `secs` and `nsecs` in both ROS generations.

    Args:
        head: from `cbor_head`.
        stamp_ns: time of the message [ns].
        raw: the body in ROS's own serialization.
    """
    secs, nsecs = divmod(stamp_ns, 10**9)
    return head + cbor2.dumps({"secs": secs, "nsecs": nsecs, "bytes": raw})
