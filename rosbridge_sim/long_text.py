"""JSON texts that are mostly one base64 text, such as that of an image: found at the speed of memory.

A decoder takes 30 us to pass over 100 kB of text, and as much again to make a `str` of it. Here the long text is found
by its quotes, decoded as base64, which also proves that it needs nothing of JSON (no escapes, no quotes, only ASCII),
and replaced by a short mark. What is left is decoded as any short text.
"""

from __future__ import annotations

import binascii

import pybase64

from rosbridge_sim.records import Record

MARK = "~long text 5c1d0e8b~"
"""Stands for the long text. A text that has this twice is decoded as usual."""

_MARK = MARK.encode()

LEAST, MOST = 16 * 1024, 2**20
"""Bounds of the length of such a text [bytes]. A shorter one costs little, a longer one is decoded in more steps."""

MAX_REST = 4 * 1024
"""Most bytes beside the long text: an image has some hundred."""


class LongText(Record, eq=False):
    """A JSON text without its long text.

    Attributes:
        text: the whole text.
        short: the text with the mark in the place of the long one.
        start, stop: place of the long text, without its quotes.
        data: what the long text says in base64.
    """

    text: bytes
    short: bytes
    start: int
    stop: int
    data: bytes

    @property
    def base64(self) -> memoryview | None:
        """The long text, if `data` in base64 is that text again: the unused bits of its last character are 0."""
        last = self.data[-(len(self.data) % 3 or 3) :]
        if self.text[self.stop - 4 : self.stop] != pybase64.b64encode(last):
            return None
        return memoryview(self.text)[self.start : self.stop]

    def body(self, short: bytes) -> LongBody | None:
        """Return the part of the text that a part of `short` stands for; None if that is without the mark.

        Args:
            short: a part of `short`.
        """
        at = short.find(_MARK)
        if at < 0:
            return None
        begin = self.start - at
        body = LongBody(memoryview(self.text)[begin : self.stop + len(short) - at - len(_MARK)])
        body.short, body.data, body.base64 = short, self.data, self.base64
        return body


class LongBody(bytes):
    """The JSON text of a body that holds a long text.

    Attributes:
        short: the body with the mark in the place of the long text.
        data, base64: those of the long text.
    """

    short: bytes
    data: bytes
    base64: memoryview | None = None


def find_long_text(text: bytes) -> LongText | None:
    """Find the base64 text that makes up nearly all of a JSON text; None if there is none.

    The text may be invalid JSON. If a bracket or a comma stood where a quote is found, `short` is invalid, too.

    Args:
        text: JSON text.
    """
    if not LEAST <= len(text) < MOST:
        return None
    middle = len(text) // 2
    start, stop = text.rfind(b'"', 0, middle) + 1, text.find(b'"', middle)
    if not start or stop < 0 or len(text) - (stop - start) > MAX_REST:
        return None
    try:
        data = pybase64.b64decode(memoryview(text)[start:stop], validate=True)
    except (binascii.Error, ValueError):
        return None
    short = b"".join((text[:start], _MARK, text[stop:]))
    return LongText(text, short, start, stop, data) if short.count(_MARK) == 1 else None


def put_back(short: bytes, base64: memoryview) -> tuple[bytes | memoryview, ...] | None:
    """Return the parts of a JSON text, end to end, with a long text in the place of the mark.

    Returns:
        The parts; None if the mark is not there, or more than once.
    """
    before, mark, after = short.partition(_MARK)
    return None if not mark or _MARK in after else (before, base64, after)
