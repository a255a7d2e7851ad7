"""Long frames cut into `fragment` ops, and put together again.

Out: only for a client that asked, each message under an id of its own (a non-empty text: roslib 2 takes the
number 0 for none), `num` and `total` integers, slices counted in characters of the JSON text. In: kept per
client, in order of `num` and not of arrival, with bounds on number, size and age.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import orjson

from rosbridge_sim.errors import FrameError
from rosbridge_sim.protocol.account import Account
from rosbridge_sim.protocol.ops import Fragment

__all__ = ["Characters", "Defragmenter", "Pieces"]

MAX_OPEN = 64
"""Fragmented messages that one client may have under way."""

MAX_PIECES = 10_000
"""Pieces of one message, in and out: 16 MiB in pieces of 1.6 kB, finer than any client cuts."""

MAX_AGE = 60.0
"""A message is forgotten when no piece of it has come for so long [s]; rosbridge_suite waits ten minutes."""

_OVERHEAD = 150
"""Memory of a piece beside its characters: the text, the number and the entry of a table [bytes]."""

MIN_SIZE = 10
"""A smaller fragment_size is taken for this one [characters]: each one in a frame of its own helps no client."""


class Characters:
    """The characters of a long frame, shared by all clients that get it in pieces; in ASCII they take no memory.

    Attributes:
        frame: in UTF-8.
    """

    __slots__ = ("_text", "frame")

    def __init__(self, frame: bytes) -> None:
        """Remember the frame; `cut` decodes it.

        Args:
            frame: JSON text.
        """
        self.frame = frame
        self._text: bytes | str = b""

    def __len__(self) -> int:
        return len(self._decoded())

    def cut(self, start: int, end: int) -> str:
        """The characters from `start` on, before `end`."""
        part = self._decoded()[start:end]
        return part if isinstance(part, str) else part.decode()

    def _decoded(self) -> bytes | str:
        if not self._text:
            self._text = self.frame if self.frame.isascii() else self.frame.decode()
        return self._text


class Pieces:
    """The pieces of a long frame, each made when it is taken: a peer that reads slowly holds the frame and no more.

    Attributes:
        num_bytes: what is held meanwhile [bytes].
        is_finished: all of them were taken.
    """

    __slots__ = ("_id", "_num", "_size", "_text", "_total", "is_finished", "num_bytes")

    def __init__(self, text: Characters, size: int, message_id: str) -> None:
        """Count the pieces; `take` makes them.

        Args:
            text: of the frame.
            size: longest slice [characters]; more where there would be more than MAX_PIECES of them. A frame that is
                not longer is its only piece, as it is.
            message_id: not used for another message of this client before.
        """
        self.num_bytes = len(text.frame)
        self.is_finished = False
        self._text = text
        self._size = max(MIN_SIZE, size)
        self._total = 0
        self._id = message_id
        self._num = 0

    @property
    def identity(self) -> int:
        """See `LateFrames`."""
        return id(self._text.frame)

    def take(self, max_bytes: int) -> list[bytes]:
        """Make the next pieces: one at least, and about `max_bytes` in all."""
        if not self._total:
            self._size = max(self._size, math.ceil(len(self._text) / MAX_PIECES))
            self._total = math.ceil(len(self._text) / self._size)
        if self._total <= 1:
            self.is_finished = True
            return [self._text.frame]
        pieces: list[bytes] = []
        total = 0
        while self._num < self._total and (total < max_bytes or not pieces):
            start = self._num * self._size
            data = self._text.cut(start, start + self._size)
            piece = {"op": "fragment", "id": self._id, "data": data, "num": self._num, "total": self._total}
            pieces.append(orjson.dumps(piece))
            total += len(pieces[-1])
            self._num += 1
        self.is_finished = self._num == self._total
        return pieces


def _size_of(text: str) -> int:
    """Memory of a piece, at most [bytes]."""
    return _OVERHEAD + len(text) * (1 if text.isascii() else 4)


class _Partial:
    __slots__ = ("last_at", "num_bytes", "num_text_bytes", "pieces", "total")

    def __init__(self, total: int) -> None:
        self.total = total
        self.pieces: dict[int, str] = {}
        self.num_bytes = 0
        self.num_text_bytes = 0
        self.last_at = 0.0


class Defragmenter:
    """The fragmented messages of one client that are not whole yet."""

    __slots__ = ("_account", "_max_bytes", "_partials")

    def __init__(self, max_bytes: int, account: Account | None = None) -> None:
        """Begin without any message.

        Args:
            max_bytes: of all pieces that wait together, in UTF-8 [bytes].
            account: has their memory.
        """
        self._max_bytes = max_bytes
        self._account = account or Account()
        self._partials: dict[object, _Partial] = {}

    def add(self, op: Fragment, now: float) -> bytes | None:
        """Take a piece; return the whole frame, if this was the last one missing.

        Raises:
            FrameError: the piece contradicts those before, or a bound is passed; the message is forgotten.
        """
        for old in list(self._expired(now)):
            self._drop(old)
        total, num = op.total, op.num
        # rosbridge_suite sends 3.4 for three pieces
        if not math.isfinite(total) or not math.isfinite(num) or not 0 <= num < math.floor(total) <= MAX_PIECES:
            self._drop(op.id)
            raise FrameError(f"fragment: num {num} of total {total} is not possible (at most {MAX_PIECES})", op.id)
        partial = self._partials.get(op.id)
        if partial is None:
            if len(self._partials) >= MAX_OPEN:
                raise FrameError(f"fragment: at most {MAX_OPEN} messages may be under way at once", op.id)
            partial = self._partials[op.id] = _Partial(math.floor(total))
        elif partial.total != math.floor(total) or int(num) in partial.pieces:
            self._drop(op.id)
            raise FrameError(f"fragment: piece {num} of {total} does not go with those before", op.id)
        size = _size_of(op.data)
        if not self._account.take(size):
            self._drop(op.id)
            raise FrameError("fragment: this client makes the server hold too much; the message is forgotten", op.id)
        partial.pieces[int(num)] = op.data
        partial.num_text_bytes += len(op.data) if op.data.isascii() else len(op.data.encode(errors="surrogatepass"))
        partial.num_bytes += size
        partial.last_at = now
        if sum(p.num_text_bytes for p in self._partials.values()) > self._max_bytes:
            self._drop(op.id)
            raise FrameError(f"fragment: the pieces that wait have more than {self._max_bytes} bytes", op.id)
        if len(partial.pieces) < partial.total:
            return None
        self._drop(op.id)
        whole = "".join(partial.pieces[i] for i in range(partial.total))
        try:
            return whole.encode()
        except UnicodeEncodeError:
            pass
        # JavaScript counts in UTF-16 and may cut a surrogate pair in two; a half that stays alone is a mistake
        return whole.encode("utf-16-le", "surrogatepass").decode("utf-16-le", "replace").encode()

    def forget(self) -> None:
        """Forget all that is not whole: its sender is gone."""
        for key in list(self._partials):
            self._drop(key)

    def _drop(self, key: object) -> None:
        partial = self._partials.pop(key, None)
        if partial is not None:
            self._account.give(partial.num_bytes)

    def _expired(self, now: float) -> Iterator[object]:
        return (key for key, partial in self._partials.items() if partial.last_at + MAX_AGE < now)
