"""Limits of requests and messages for this server's own services and input topics, checked before they are converted.

A decoder is one call of a C library, and what is done with a list takes microseconds for each element. So what one
frame may bring is bounded by its raw bytes, and by the objects, lists, texts and values in them. A body that came as
CBOR is decoded already; what it holds is counted instead.
"""

from __future__ import annotations

from typing import Final

import msgspec
import numpy as np

from rosbridge_sim.errors import FieldError, Reason
from rosbridge_sim.protocol.ops import OpBody
from rosbridge_sim.records import Record
from rosbridge_sim.weight import FEW, Weight, count_few, weigh, weigh_exactly

LIGHT: Final = 4 * 1024
"""From this size on, what a body holds is counted [bytes]; a smaller one is within all limits."""

_EXACT: Final = 256 * 1024
"""Up to this size, brackets and quotes inside texts are left out of the count, if it is too high [bytes]: 1 ms."""

MAX_ESCAPES: Final = 100_000
"""Backslashes in a long body. Decoders take 10 to 100 ns for each; JSON inside a text has one for each quote."""

_BACKSLASH: Final = ord("\\")

_MARKS: Final = (b"{", b"[", b'"', b",", b"\\")
"""Bytes that are counted. A body with fewer than `FEW` of each is within all limits. A search for rare bytes takes half
as long as a full count."""


class BodyLimits(Record):
    """The largest request of one service, or message of one topic.

    Attributes:
        num_bytes: of its JSON text.
        containers: objects and lists in it. Each takes 1 us to decode, and a few more to look at.
        texts: texts in it, with the names of fields.
        values: everything that a comma follows.
    """

    num_bytes: int = 64 * 1024
    containers: int = 5_000
    texts: int = 10_000
    values: int = 10_000

    def check(self, name: str, body: OpBody, what: str = "request") -> None:
        """Check a body that is not converted yet.

        Args:
            name: of the service or topic, for the error text.
            body: the fields by name or by position.
            what: the word for the body.

        Raises:
            FieldError: it is too large.
        """
        if isinstance(body, (bytes, msgspec.Raw)):
            size = len(body)
            if size < LIGHT:
                return
            why = "" if size > self.num_bytes else self._excess_of_text(bytes(body))
        elif isinstance(body, (dict, list)):
            size, weight = _weigh_values(body, self.num_bytes)
            why = self._excess(weight)
        else:
            return
        if size > self.num_bytes:
            why = f"{self.num_bytes:,} bytes"
        if why:
            raise FieldError(f"{name}: expected a {what} of at most {why}", reason=Reason.TOO_MUCH)

    def _excess_of_text(self, text: bytes) -> str:
        """Return the limit that a JSON text exceeds, with its unit; empty if none."""
        if all(count_few(text, mark) < FEW for mark in _MARKS):  # such as the bytes of a snapshot
            return ""
        num = int(np.count_nonzero(np.frombuffer(text, np.uint8) == _BACKSLASH)) if len(text) > MAX_ESCAPES else 0
        if num > MAX_ESCAPES:
            return f"{MAX_ESCAPES:,} escapes in texts, got {num:,}"
        why = self._excess(weigh(text))
        if why and len(text) <= _EXACT:
            *_, weight = weigh_exactly(text)
            return self._excess(weight)
        return why

    def _excess(self, weight: Weight) -> str:
        """Return the limit that a weight exceeds, with its unit; empty if none."""
        if weight.containers > self.containers:
            return f"{self.containers:,} objects and lists, got {weight.containers:,}"
        if weight.texts > self.texts:
            return f"{self.texts:,} texts with the names of fields, got {weight.texts:,}"
        if weight.commas > self.values:
            return f"{self.values:,} values, got {weight.commas:,}"
        return ""


def _weigh_values(body: object, most: int) -> tuple[int, Weight]:
    """Return the least length of a decoded body as JSON [bytes], and its weight; stop where it is longer than `most`.

    Args:
        body: dicts, lists, texts, numbers and arrays.
        most: in bytes.
    """
    size = containers = texts = values = 0
    waiting: list[object] = [body]
    while waiting and size <= most:
        value = waiting.pop()
        if isinstance(value, str):
            size += len(value)
            texts += 1
        elif isinstance(value, np.ndarray):
            size += 2 * value.size
            values += value.size
        elif isinstance(value, (dict, list)):
            containers += 1
            size += 2 * len(value)
            values += len(value)
            if isinstance(value, dict):
                texts += len(value)
                size += sum(map(len, value))
            if size <= most:
                waiting += value.values() if isinstance(value, dict) else value
    return size, Weight(containers, texts, values)
