"""Check that text messages are UTF-8 (RFC 6455 section 8.1), long ones in slices.

Python's own decoder is the judge. It reads a slice at a time, because the text of a whole message of 16 MB would need
as much memory again, and because other clients have their turn in between.
"""

from __future__ import annotations

from codecs import utf_8_decode

__all__ = ["SLICE", "TextCheck"]

SLICE = 64 * 1024
"""Bytes that are checked in one go: 70 us for text beyond ASCII."""


class TextCheck:
    """A text message on its way through the check.

    Attributes:
        message: what is checked [bytes].
        fault: why it is no UTF-8, once that is found; empty until then.
    """

    __slots__ = ("_position", "fault", "message")

    def __init__(self, message: bytes) -> None:
        self.message = message
        self.fault = ""
        self._position = 0

    def step(self) -> bool:
        """Check the next slice; return whether anything is left to check."""
        start, size = self._position, len(self.message)
        stop = min(start + SLICE, size)
        try:
            # a character that ends behind the slice is left for the next one
            _, num_read = utf_8_decode(memoryview(self.message)[start:stop], "strict", stop == size)
        except UnicodeDecodeError as error:
            self.fault = f"text is not UTF-8: {error.reason} at byte {start + error.start}"
            return False
        self._position += num_read
        return self._position < size
