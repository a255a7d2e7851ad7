"""Frames inside PNG images: rosbridge's `png` op, in both directions, in slices of one or two milliseconds.

The image format is rosbridge_suite's: the JSON text in UTF-8, padded with newlines, is the RGB data of a roughly square
PNG. An image of 16 kB can hold 16 MB. Reading or writing a large one in one library call takes a tenth of a second to
seconds, and nothing else runs meanwhile. So a large image is read in strips: a few lines are decompressed at a time,
and each strip, with the line above it, becomes a small image that Pillow reads. Images are written with zlib alone. PNG
filters are not used, because they help photographs and not text.
"""

from __future__ import annotations

import binascii
import math
import zlib
from collections.abc import Generator, Iterator
from io import BytesIO
from struct import Struct, unpack_from
from struct import error as StructError  # noqa: N812 - its name in the module is only `error`

import pybase64

from rosbridge_sim.errors import EncodingError, FrameError

_SIGNATURE = b"\x89PNG\r\n\x1a\n"
_HEADER = Struct(">IIBBBBB")  # width, height, bits a sample, colour type, compression, filter, interlace
_TRUECOLOUR = 2

_SMALL = 192 * 1024
"""Pillow reads an image of at most this size in one call: 1 ms. Larger ones are read in strips of this size [bytes]."""

_SLICE = 64 * 1024
"""Bytes compressed in one slice: 2 ms for text without repetition."""

_WIDE = 2**14
"""A line with more pixels than this is no padding: the image of 1 GB of text has lines of 18,918 pixels."""

_NUM_CHUNKS = 1_000
"""Chunks of a file skipped in one slice; a file of 16 MB can have a million empty chunks."""

_LEVEL = 1
"""The fastest level of zlib: it reduces JSON text to a quarter of its size, in a tenth of the time of the best level.
"""


def decode_png(data: str, max_bytes: int) -> Generator[None, None, bytes]:
    """Read the frame inside a PNG image; yield after each slice of work, and return the frame at the end.

    Args:
        data: the PNG file in base64.
        max_bytes: longest frame; needed because a small file can claim a huge image.

    Returns:
        The frame.

    Raises:
        FrameError: the data is not a PNG, holds no text, or is too large.
    """
    try:
        file = pybase64.b64decode(data, validate=True)
        width, height, *form = _read_header(file)
        size = width * height * 3
        if size > max_bytes + 3 * min(width, _WIDE):  # the last line may be padding
            raise FrameError(f"png: expected at most {max_bytes:,} bytes, but got {width} x {height} pixels")
        yield
        if size <= _SMALL:
            return _read_whole((yield from _critical_part(file))).rstrip(b"\n\0")
        if form != [8, _TRUECOLOUR, 0, 0, 0]:
            raise FrameError("png: a large picture must be RGB with 8 bits a channel, and not interlaced")
        return (yield from _read_strips(file, width, height)).rstrip(b"\n\0")
    except (binascii.Error, OSError, SyntaxError, ValueError, zlib.error, StructError) as error:
        raise FrameError(f"png: no picture that holds a message: {error}") from None


def _read_header(file: bytes) -> tuple[int, ...]:
    """Return width, height, bits per sample, colour type, compression, filter and interlace of an image.

    Raises:
        ValueError, struct.error: it is not a PNG.
    """
    if not file.startswith(_SIGNATURE) or file[12:16] != b"IHDR":
        raise ValueError("it does not begin as a PNG does")
    return _HEADER.unpack_from(file, 16)


def _read_whole(file: bytes) -> bytes:
    """Return the pixels of a small image of any form."""
    from PIL import Image  # noqa: PLC0415 - 30 ms that only images need

    with Image.open(BytesIO(file), formats=["PNG"]) as image:
        pixels: bytes = image.convert("RGB").tobytes()
        return pixels


def _read_strips(file: bytes, width: int, height: int) -> Generator[None, None, bytes]:
    """Return the pixels of an image, read a few lines at a time.

    Raises:
        ValueError, zlib.error, OSError, SyntaxError, struct.error: the image is broken.
    """
    line = 1 + 3 * width  # each line begins with its filter number
    num_lines = max(1, _SMALL // line)
    pixels = bytearray()
    above = bytes(line)
    lines = bytearray()
    for inflated in _inflate(file, _SMALL):
        lines += inflated
        left = height - len(pixels) // (line - 1)
        while len(lines) >= min(num_lines, left) * line:
            strip = bytes(lines[: min(num_lines, left) * line])
            del lines[: len(strip)]
            decoded = _read_whole(_small_file(width, above + strip))[line - 1 :]
            pixels += decoded
            above = b"\0" + decoded[1 - line :]
            left -= len(strip) // line
            if not left:
                return bytes(pixels)
            yield
        yield
    raise ValueError("it is not whole")


def _critical_part(file: bytes) -> Generator[None, None, bytes]:
    """Return the file without its optional chunks: texts and profiles in them may become larger than the image."""
    parts = [_SIGNATURE]
    for i, (kind, start, end) in enumerate(_chunks(file)):
        if kind[:1].isupper():
            parts.append(file[start:end])
        if i % _NUM_CHUNKS == 0:
            yield
    return b"".join(parts)


def _chunks(file: bytes) -> Iterator[tuple[bytes, int, int]]:
    """Yield type, start and end of each chunk: four bytes of length, four of type, the content, four of checksum."""
    position = len(_SIGNATURE)
    while position + 8 <= len(file):
        length, kind = unpack_from(">I4s", file, position)
        yield kind, position, position + 12 + length
        position += 12 + length


def _inflate(file: bytes, size: int) -> Iterator[bytes]:
    """Yield the decompressed image data, at most `size` bytes at a time; sometimes empty bytes between chunks."""
    decoder = zlib.decompressobj()
    for i, (kind, begin, end) in enumerate(_chunks(file)):
        if i % _NUM_CHUNKS == 0:
            yield b""
        if kind != b"IDAT":
            continue
        for start in range(begin + 8, end - 4, _SLICE):  # zlib copies its unused input, so keep the input short
            rest = file[start : min(start + _SLICE, end - 4)]
            while rest and not decoder.eof:
                yield decoder.decompress(rest, size)
                rest = decoder.unconsumed_tail
    yield decoder.flush()


def _small_file(width: int, lines: bytes) -> bytes:
    """Return an uncompressed image of some lines, each one behind its filter number."""
    header = _HEADER.pack(width, len(lines) // (1 + 3 * width), 8, _TRUECOLOUR, 0, 0, 0)
    return _file(header, zlib.compress(lines, 0))


def _file(header: bytes, image_data: bytes) -> bytes:
    chunks = ((b"IHDR", header), (b"IDAT", image_data), (b"IEND", b""))
    return _SIGNATURE + b"".join(
        len(content).to_bytes(4, "big") + kind + content + zlib.crc32(content, zlib.crc32(kind)).to_bytes(4, "big")
        for kind, content in chunks
    )


class PngFrame:
    """A `png` op that holds a frame: made in slices, once for all its subscribers.

    Attributes:
        frame: the finished op; None until `work` has finished it.
        num_bytes: length of the text [bytes]; the image is at most about as long.
    """

    def __init__(self, text: bytes) -> None:
        """Keep the text; `work` makes the image.

        Args:
            text: a frame of JSON text.
        """
        self.frame: bytes | None = None
        self.num_bytes = len(text)
        self._failure: Exception | None = None
        width = max(1, math.isqrt(len(text) // 3))
        height = max(1, math.ceil(len(text) / 3 / width))
        self._header = _HEADER.pack(width, height, 8, _TRUECOLOUR, 0, 0, 0)
        self._text = text
        self._position = 0
        self._encoder = zlib.compressobj(_LEVEL)
        self._done: list[bytes] = []
        self._line, self._height = 3 * width, height

    def work(self) -> bool:
        """Do the next slice.

        Returns:
            True if the frame is finished.

        Raises:
            EncodingError: a slice has failed, now or earlier; the image would be wrong without it.
        """
        if self.frame is not None:
            return True
        if self._failure is None:
            try:
                return self._do_slice()
            except Exception as error:  # noqa: BLE001 - an internal error, or one of zlib
                self._failure = error
                self._done, self._text = [], b""
        raise EncodingError(f"a picture cannot be made: {self._failure!r:.200}") from self._failure

    def _do_slice(self) -> bool:
        line, height = self._line, self._height
        lines: list[bytes] = []
        taken = 0
        while taken < _SLICE and self._position < line * height:
            part = self._text[self._position : self._position + line]
            lines += [b"\0", part.ljust(line, b"\n")]
            self._position += line
            taken += line
        self._done.append(self._encoder.compress(b"".join(lines)))
        if self._position < line * height:
            return False
        self._done.append(self._encoder.flush())
        file = _file(self._header, b"".join(self._done))
        self.frame = b'{"op":"png","data":"' + pybase64.b64encode(file) + b'"}'
        self._text = b""
        self._done = []
        return True


class PictureFrames:
    """A `png` op on its way to one subscriber. All its subscribers share the work; it is sent when it is finished.

    Attributes:
        num_bytes: memory held until then [bytes].
        is_finished: it was taken.
    """

    def __init__(self, picture: PngFrame) -> None:
        self._picture = picture
        self.num_bytes = picture.num_bytes
        self.is_finished = False

    @property
    def identity(self) -> int:
        """See `LateFrames`."""
        return id(self._picture)

    def take(self, max_bytes: int) -> list[bytes]:  # noqa: ARG002 - one frame, whatever its length
        """Do the next slice of work.

        Args:
            max_bytes: not used: there is only one frame.

        Returns:
            The frame if that was the last slice; else an empty list.
        """
        if not self._picture.work() or self._picture.frame is None:
            return []
        self.is_finished = True
        return [self._picture.frame]
