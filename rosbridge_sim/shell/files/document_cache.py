"""Documents that were read before, for as long as their files stay as they were.

A document is known again by what it was made from: path, time of change, size and inode of each of its files. So a file
that was changed or replaced is read anew, and nothing has to be said when one is. The same unchanged map is the same
object for all callers, however many ask at once: for the world that is no change of map.
"""

from __future__ import annotations

import threading
import time
from collections import OrderedDict
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Final, TypeVar

__all__ = ["DocumentCache"]

MAX_DOCUMENTS: Final = 64
"""Documents that are kept. A training run repeats some dozen scenarios on a few maps; further ones are read
again."""

MAX_CACHED_BYTES: Final = 32 * 2**20
"""Size of all source files together [bytes]. In memory a map takes two to four times as much as its files, so
this bounds the cache to some 100 MB. A document that is larger by itself is read anew each time."""

T = TypeVar("T")

_Signature = tuple[tuple[str, int, int, int], ...]
"""Path, time of change [ns], size [bytes] and inode of each file."""


class _Slot:
    """The place of one document.

    Attributes:
        lock: held while the document is read, so that other threads wait instead of reading it, too.
        signature: of the files that it was made from; None while nothing is kept.
        document: what was made from them.
    """

    __slots__ = ("document", "lock", "signature")

    def __init__(self) -> None:
        self.lock = threading.Lock()
        self.signature: _Signature | None = None
        self.document: Any = None  # of the type that goes with the key

    @property
    def num_bytes(self) -> int:
        return sum(size for _, _, size, _ in self.signature or ())


class DocumentCache:
    """The documents that were used last. All threads may use it."""

    def __init__(self, max_documents: int = MAX_DOCUMENTS, max_bytes: int = MAX_CACHED_BYTES) -> None:
        """An empty cache.

        Args:
            max_documents: how many are kept.
            max_bytes: of their source files together [bytes].
        """
        self._max_documents = max_documents
        self._max_bytes = max_bytes
        self._lock = threading.Lock()  # of the table; never held while a file is looked at
        self._slots: OrderedDict[tuple[str, str], _Slot] = OrderedDict()  # used last stands last

    def get(self, kind: str, path: Path, files: Sequence[Path], make: Callable[[], T], *, min_age: float = 0.0) -> T:
        """The document that `make` makes of some files, made only if they have changed or it is not kept.

        Args:
            kind: tells different documents of one path apart; there is one type of document for each kind.
            path: of the document: a file or a folder.
            files: all that it is made from.
            make: makes it; whatever it raises is passed on, and nothing is kept.
            min_age: how long ago the files must have been changed, for the document to be kept [s].
        """
        key = (kind, str(path))
        with self._lock:
            slot = self._slots.setdefault(key, _Slot())
            self._slots.move_to_end(key)
        try:
            with slot.lock:
                signature = _sign(files)
                if signature is not None and signature == slot.signature:
                    kept: T = slot.document
                    return kept
                slot.signature = slot.document = None
                began = time.time_ns()
                document = make()
                if signature is not None and signature == _sign(files) and _is_older(signature, began - min_age * 1e9):
                    slot.signature, slot.document = signature, document
                return document
        finally:
            self._shrink()

    def _shrink(self) -> None:
        """Forget the documents that were not used for longest, until the rest fits."""
        with self._lock:
            num_bytes = sum(slot.num_bytes for slot in self._slots.values())
            while len(self._slots) > self._max_documents or num_bytes > self._max_bytes:
                _, slot = self._slots.popitem(last=False)
                num_bytes -= slot.num_bytes


def _sign(files: Sequence[Path]) -> _Signature | None:
    """Return what tells that files are unchanged; None if one of them cannot be looked at."""
    signature = []
    try:
        for file in files:
            path = file.resolve()
            stat = path.stat()
            signature.append((str(path), stat.st_mtime_ns, stat.st_size, stat.st_ino))
    except (OSError, RuntimeError):  # not there, or links in a circle: reading it will say what is wrong
        return None
    return tuple(signature)


def _is_older(signature: _Signature, stamp_ns: float) -> bool:
    return all(changed_ns <= stamp_ns for _, changed_ns, _, _ in signature)
