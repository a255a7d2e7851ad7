"""Long frames split into `fragment` ops, and joined again.

Outgoing frames are split only for a client that asked for it. Each message has its own id, a non-empty text, because
roslib 2 treats the number 0 as no id. `num` and `total` are integers, and slices are counted in characters of the JSON
text. Incoming fragments are kept per client and joined in order of `num`, whatever the order of arrival. Their number,
size and age are limited.
"""

from __future__ import annotations

import math

import orjson

from rosbridge_sim.errors import FrameError
from rosbridge_sim.protocol.client_memory import Account
from rosbridge_sim.protocol.ops import Fragment

MAX_OPEN = 64
"""Largest number of unfinished fragmented messages of one client."""

MAX_PIECES = 10_000
"""Largest number of fragments of one message, in both directions: 16 MiB in fragments of 1.6 kB, smaller than any
client uses."""

MAX_AGE = 60.0
"""An unfinished message is dropped after so long without a new fragment [s]; rosbridge_suite waits ten minutes."""

_OVERHEAD = 150
"""Memory of a fragment beside its characters: the string object, the number and the table entry [bytes]."""

MIN_SIZE = 10
"""A smaller fragment_size is raised to this [characters]: tiny fragments help no client."""


class Characters:
    """The characters of a long frame, shared by all clients that get it in fragments. ASCII text needs no extra memory.

    Attributes:
        frame: the frame in UTF-8.
    """

    __slots__ = ("_text", "frame")

    def __init__(self, frame: bytes) -> None:
        """Keep the frame; `cut` decodes it.

        Args:
            frame: JSON text.
        """
        self.frame = frame
        self._text: bytes | str = b""

    def __len__(self) -> int:
        return len(self._decoded())

    def cut(self, start: int, end: int) -> str:
        """Return the characters from `start` up to, not including, `end`.

        Args:
            start: first character.
            end: character behind the last one.
        """
        part = self._decoded()[start:end]
        return part if isinstance(part, str) else part.decode()

    def _decoded(self) -> bytes | str:
        if not self._text:
            self._text = self.frame if self.frame.isascii() else self.frame.decode()
        return self._text


class Pieces:
    """The fragments of a long frame, each made when it is taken, so a slow reader holds the frame only once.

    Attributes:
        num_bytes: memory held until then [bytes].
        is_finished: all of them were taken.
    """

    __slots__ = ("_id", "_num", "_size", "_text", "_total", "is_finished", "num_bytes")

    def __init__(self, text: Characters, size: int, message_id: str) -> None:
        """Count the fragments; `take` makes them.

        Args:
            text: characters of the frame.
            size: longest slice [characters]. It is raised if it would give more than MAX_PIECES fragments. A frame that
                is not longer is sent whole.
            message_id: an id that this client was not sent before.
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
        """Make the next fragments.

        Args:
            max_bytes: about how much to return [bytes]; at least one fragment is returned.
        """
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


class _Partial:
    __slots__ = ("last_at", "num_bytes", "num_text_bytes", "pieces", "total")

    def __init__(self, total: int) -> None:
        self.total = total
        self.pieces: dict[int, str] = {}
        self.num_bytes = 0
        self.num_text_bytes = 0
        self.last_at = 0.0


class Defragmenter:
    """The unfinished fragmented messages of one client."""

    def __init__(self, max_bytes: int, account: Account | None = None) -> None:
        """Create one without messages.

        Args:
            max_bytes: limit for all waiting fragments together, in UTF-8 [bytes].
            account: pays for their memory.
        """
        self._max_bytes = max_bytes
        self._account = account or Account()
        self._partials: dict[object, _Partial] = {}

    def add(self, op: Fragment, now: float) -> bytes | None:
        """Add a fragment.

        Returns:
            The whole frame if no fragment is missing now; else None.

        Raises:
            FrameError: the fragment contradicts earlier ones, or a limit is exceeded. The message is dropped.
        """
        for old in [key for key, partial in self._partials.items() if partial.last_at + MAX_AGE < now]:
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
        size = _OVERHEAD + len(op.data) * (1 if op.data.isascii() else 4)  # its memory at most
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
        # JavaScript counts in UTF-16 and may split a surrogate pair; a half without its other half is a mistake
        return whole.encode("utf-16-le", "surrogatepass").decode("utf-16-le", "replace").encode()

    def forget(self) -> None:
        """Drop all unfinished messages, because their sender is gone."""
        for key in list(self._partials):
            self._drop(key)

    def _drop(self, key: object) -> None:
        partial = self._partials.pop(key, None)
        if partial is not None:
            self._account.give(partial.num_bytes)
