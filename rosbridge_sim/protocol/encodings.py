"""What a frame can be besides JSON text: a CBOR map, or a picture that holds a JSON text.

CBOR comes in as a binary frame whose first byte opens a map (0xA0 to 0xBF; JSON text never starts so) and goes out
only to listeners who asked, whose bodies `schema/` encodes. Numbers in typed arrays (RFC 8746) are read in either
byte order. Every other tag is refused: a stranger's tags would be decoded into patterns, dates, bignums and objects
that contain themselves.

The picture is rosbridge_suite's: the JSON text in UTF-8, padded with newlines, as the RGB bytes of a PNG that is
about square.
"""

from __future__ import annotations

import base64
import binascii
import json
import math
from io import BytesIO
from typing import Any, NoReturn

import cbor2
import numpy as np
import orjson

from rosbridge_sim.errors import FrameError

__all__ = ["cbor_head", "cbor_raw_frame", "decode_cbor", "decode_png", "is_cbor", "png_frame"]

MAX_DEPTH = 100
"""Nesting of a CBOR frame; the deepest ROS message of the standard packages has seven levels."""

MAX_PIXELS = 16 * 2**20 // 3
"""A picture may hold as many bytes as a frame may have; a small file can claim a huge one."""

_ARRAY_TYPES = {
    64: "u1", 65: ">u2", 66: ">u4", 67: ">u8", 68: "u1", 69: "<u2", 70: "<u4", 71: "<u8",
    72: "i1", 73: ">i2", 74: ">i4", 75: ">i8", 77: "<i2", 78: "<i4", 79: "<i8",
    80: ">f2", 81: ">f4", 82: ">f8", 84: "<f2", 85: "<f4", 86: "<f8",
}  # fmt: skip
"""Tags of RFC 8746 that numpy knows; floats of 128 bit it does not."""

_BUILT_IN_TAGS = (0, 1, 2, 3, 4, 5, 25, 28, 29, 30, 35, 36, 37, 52, 54, 100, 256, 258, 260, 261, 1004, 43000, 55799)
"""Tags that the library would decode by itself."""


def is_cbor(frame: bytes) -> bool:
    """Whether a frame starts as a CBOR map does."""
    return 0xA0 <= frame[0] <= 0xBF if frame else False  # noqa: PLR2004 - RFC 8949: major type 5


def decode_cbor(frame: bytes) -> bytes:
    """The JSON text that says the same, with NaN and infinities as Python's json writes them; bytes as base64.

    Raises:
        FrameError: it is no CBOR, or holds what JSON has no word for.
    """
    try:
        value = cbor2.loads(
            frame,
            tag_hook=_read_tag,
            semantic_decoders=_REFUSING,
            max_depth=MAX_DEPTH,
            allow_duplicate_keys=False,
            strict_hashable_types=True,
        )
        return json.dumps(_plain(value)).encode()
    except (cbor2.CBORError, ValueError, OverflowError, RecursionError) as error:
        raise FrameError(f"Received a binary frame that is neither JSON nor plain CBOR: {error}") from None


def _read_tag(*args: Any) -> object:  # noqa: ANN401 - the library passes the decoder too, of no known type
    tag = args[-1] if isinstance(args[-1], cbor2.CBORTag) else args[0]
    kind = _ARRAY_TYPES.get(tag.tag)
    if kind is None or not isinstance(tag.value, bytes):
        raise ValueError(f"tag {tag.tag} is not accepted")
    if tag.tag in {64, 68}:
        return tag.value
    return np.frombuffer(tag.value, kind).tolist()


def _refuse_tag(*_: object) -> NoReturn:
    raise ValueError("dates, bignums, shared values and other tags are not accepted")


_REFUSING = dict.fromkeys(_BUILT_IN_TAGS, _refuse_tag)


def _plain(value: object) -> object:
    """The value with bytes as base64 text; anything that JSON has no word for raises ValueError."""
    if isinstance(value, bytes):
        return base64.b64encode(value).decode()
    if isinstance(value, dict):
        if not all(isinstance(key, str) for key in value):
            raise ValueError("the keys of a map must be texts")
        return {key: _plain(inner) for key, inner in value.items()}
    if isinstance(value, list):
        return value if value and isinstance(value[0], (int, float)) else [_plain(inner) for inner in value]
    if value is None or isinstance(value, (bool, int, float, str)):
        return value
    raise ValueError(f"{type(value).__name__} is not accepted")


def cbor_head(topic: str) -> bytes:
    """Everything of a CBOR data message that stands before its body; `topic` in the listener's own spelling."""
    return b"\xa3\x62op\x67publish\x65topic" + cbor2.dumps(topic) + b"\x63msg"


def cbor_raw_frame(head: bytes, stamp_ns: int, raw: bytes) -> bytes:
    """A data message with the bytes of ROS's own wire; the keys are secs and nsecs in both generations."""
    secs, nsecs = divmod(stamp_ns, 10**9)
    return head + cbor2.dumps({"secs": secs, "nsecs": nsecs, "bytes": raw})


def png_frame(frame: bytes) -> bytes:
    """A `png` op that holds a frame of JSON text."""
    from PIL import Image  # noqa: PLC0415 - 30 ms that nobody pays who asks for no picture

    width = max(1, math.isqrt(len(frame) // 3))
    height = max(1, math.ceil(len(frame) / 3 / width))
    pixels = frame.ljust(width * height * 3, b"\n")
    file = BytesIO()
    Image.frombytes("RGB", (width, height), pixels).save(file, "PNG")
    return orjson.dumps({"op": "png", "data": base64.b64encode(file.getvalue()).decode()})


def decode_png(data: str) -> bytes:
    """The frame inside a picture.

    Raises:
        FrameError: it is no picture, or none that holds a text.
    """
    from PIL import Image  # noqa: PLC0415 - as above

    try:
        with Image.open(BytesIO(base64.b64decode(data, validate=True)), formats=["PNG"]) as image:
            if image.width * image.height > MAX_PIXELS:
                raise FrameError(f"png: the picture has more than {MAX_PIXELS} pixels")
            return image.convert("RGB").tobytes().rstrip(b"\n\0")
    except (binascii.Error, OSError, SyntaxError, ValueError) as error:
        raise FrameError(f"png: no picture that holds a message: {error}") from None
