"""Frames inside pictures, in and out, of any size, in slices."""

from __future__ import annotations

import base64
import json
import random
import zlib
from io import BytesIO
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from rosbridge_sim.errors import EncodingError, FrameError
from rosbridge_sim.protocol.png import PictureFrames, PngFrame, decode_png
from tests.support import finish

MAX_BYTES = 16 * 2**20


def make(frame: bytes) -> bytes:
    picture = PngFrame(frame)
    while not picture.work():
        pass
    assert picture.frame is not None
    return picture.frame


def read(data: str, max_bytes: int = MAX_BYTES) -> bytes:
    return finish(decode_png(data, max_bytes))


def drawn(frame: bytes, mode: str = "RGB", width: int = 997, **options: int) -> str:
    """A picture as Pillow makes it, with all of its filters; the text is in its red, green and blue."""
    height = len(frame) // 3 // width + 1
    image = Image.frombytes("RGB", (width, height), frame.ljust(3 * width * height, b"\n")).convert(mode)
    file = BytesIO()
    image.save(file, "PNG", **options)
    return base64.b64encode(file.getvalue()).decode()


def long_text(size: int, seed: int = 0) -> bytes:
    return base64.b64encode(random.Random(seed).randbytes(size))  # noqa: S311 - the same text each time


@given(st.text(max_size=200))
def test_png_gives_its_text_back(text: str) -> None:
    frame = json.dumps({"op": "publish", "msg": text}, ensure_ascii=False).encode()
    op = json.loads(make(frame))
    assert op["op"] == "png"
    assert read(op["data"]) == frame


@pytest.mark.parametrize("size", [1, 140_000, 145_000, 150_000, 400_000])
def test_png_of_any_size_is_read_as_by_pillow(size: int) -> None:
    frame = long_text(size)
    for data in (drawn(frame), drawn(frame, width=3), drawn(frame, width=100_000, compress_level=0)):
        assert read(data) == frame
    own = json.loads(make(frame))["data"]
    assert read(own) == frame
    with Image.open(BytesIO(base64.b64decode(own))) as image:
        assert image.tobytes().rstrip(b"\n") == frame


def test_long_png_is_read_and_made_in_slices() -> None:
    frame = long_text(1_200_000)
    assert sum(1 for _ in decode_png(drawn(frame), MAX_BYTES)) > 20
    picture = PngFrame(frame)
    num_slices = 1
    while not picture.work():
        num_slices += 1
    assert num_slices > 20


def test_two_subscribers_share_the_encoding_of_a_png() -> None:
    frame = long_text(600_000)
    picture = PngFrame(frame)
    first, second = PictureFrames(picture), PictureFrames(picture)
    taken: list[bytes] = []
    num_slices = 0
    while not first.is_finished:
        taken += first.take(2**16) + second.take(2**16)
        num_slices += 2
    taken += second.take(2**16)
    assert second.is_finished
    alone = PngFrame(frame)
    num_alone = 1
    while not alone.work():
        num_alone += 1
    assert num_slices - num_alone in {0, 1}
    assert all(a is b for a, b in pairwise(taken))


def test_png_that_failed_for_one_subscriber_is_not_sent_incomplete_to_another() -> None:
    picture = PngFrame(long_text(300_000))
    first, second = PictureFrames(picture), PictureFrames(picture)
    assert first.take(1) == []
    encoder, picture._encoder = picture._encoder, None  # type: ignore[assignment] # as good a bug as any
    with pytest.raises(EncodingError, match="a picture cannot be made: AttributeError"):
        first.take(1)
    picture._encoder = encoder
    for _ in range(2):
        with pytest.raises(EncodingError, match="a picture cannot be made: AttributeError"):
            second.take(1)


def test_png_without_valid_data_is_refused() -> None:
    bomb = base64.b64encode(
        b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR\0\1\0\0\0\1\0\0\x08\2\0\0\0" + b"\0" * 4 + b"\0\0\0\0IEND\xaeB`\x82"
    ).decode()
    for data in ("", "AAAA", "not base64!", base64.b64encode(b"x" * 99).decode(), bomb):
        with pytest.raises(FrameError, match="png"):
            read(data)


def file_of(width: int, height: int, *chunks: tuple[bytes, bytes]) -> str:
    parts = [(b"IHDR", width.to_bytes(4, "big") + height.to_bytes(4, "big") + b"\x08\2\0\0\0"), *chunks, (b"IEND", b"")]
    file = b"\x89PNG\r\n\x1a\n" + b"".join(
        len(data).to_bytes(4, "big") + kind + data + zlib.crc32(kind + data).to_bytes(4, "big") for kind, data in parts
    )
    return base64.b64encode(file).decode()


@pytest.mark.parametrize(("width", "height"), [(60_000, 60_000), (2**31 - 1, 1), (3_000, 2_000)])
def test_png_with_too_many_pixels_is_refused_by_its_header(width: int, height: int) -> None:
    with pytest.raises(FrameError, match="png: expected at most 16,000,000 bytes"):
        read(file_of(width, height, (b"IDAT", zlib.compress(bytes(1_000)))), 16_000_000)


def test_large_png_that_is_incomplete_or_of_another_format_is_refused() -> None:
    line = bytes(3 * 1_000 + 1)
    for data in (
        file_of(1_000, 1_000, (b"IDAT", zlib.compress(line * 999))),
        file_of(1_000, 1_000),
        file_of(1_000, 1_000, (b"IDAT", b"rubbish")),
        file_of(1_000, 1_000, (b"IDAT", zlib.compress((b"\x09" + line[1:]) * 1_000))),  # there is no filter 9
        drawn(long_text(600_000), "L"),
        drawn(long_text(600_000), "RGBA"),
    ):
        with pytest.raises(FrameError, match="png"):
            read(data)


def test_surplus_png_lines_are_ignored() -> None:
    line = b"\0" + b"x" * 3_000
    assert read(file_of(1_000, 200, (b"IDAT", zlib.compress(line * 1_000)))) == b"x" * 600_000


def test_ancillary_chunks_of_a_small_png_are_not_inflated() -> None:
    bomb = b"Comment\0\0" + zlib.compress(bytes(2_000_000))
    pixels = zlib.compress(b"\0{}\n")
    assert read(file_of(1, 1, *[(b"zTXt", bomb)] * 100, (b"IDAT", pixels))) == b"{}"


def test_many_empty_png_chunks_are_skipped_in_slices() -> None:
    data = file_of(1_000, 1_000, *[(b"IDAT", b"")] * 40_000)
    slices: list[None] = []
    with pytest.raises(FrameError, match="not whole"):
        slices.extend(decode_png(data, MAX_BYTES))
    assert len(slices) >= 40
