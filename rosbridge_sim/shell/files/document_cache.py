"""A cache of documents, valid as long as their files do not change.

A document is identified by path, modification time, size and inode of each of its files. So a changed or replaced file
is read again without a command. All callers get the same object for an unchanged map, even if they ask at the same
time; the world treats that as no change of map.
"""

from __future__ import annotations

import threading
import time
from collections import OrderedDict
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Final, TypeVar

MAX_DOCUMENTS: Final = 64
"""Largest number of documents. A training run repeats some dozen scenarios on a few maps; further ones are read again.
"""

MAX_CACHED_BYTES: Final = 32 * 2**20
"""Largest size of all source files together [bytes]. In memory a map takes two to four times as much as its files, so
the cache takes about 100 MB at most. A larger document is read again each time."""

T = TypeVar("T")

_Signature = tuple[tuple[str, int, int, int], ...]
"""Path, modification time [ns], size [bytes] and inode of each file."""


class _Slot:
    """The entry of one document.

    Attributes:
        lock: held while the document is read, so that other threads wait and do not read it, too.
        signature: signature of its files; None if nothing is stored.
    """

    def __init__(self) -> None:
        self.lock = threading.Lock()
        self.signature: _Signature | None = None
        self.document: Any = None  # its type belongs to the key

    @property
    def num_bytes(self) -> int:
        return sum(size for _, _, size, _ in self.signature or ())


class DocumentCache:
    """The most recently used documents. Any thread may use it."""

    def __init__(self, max_documents: int = MAX_DOCUMENTS, max_bytes: int = MAX_CACHED_BYTES) -> None:
        """Create an empty cache.

        Args:
            max_bytes: largest size of their source files together.
        """
        self._max_documents = max_documents
        self._max_bytes = max_bytes
        self._lock = threading.Lock()  # protects the table; never held during file access
        self._slots: OrderedDict[tuple[str, str], _Slot] = OrderedDict()  # the most recently used is at the end

    def get(self, kind: str, path: Path, files: Sequence[Path], make: Callable[[], T], *, min_age: float = 0.0) -> T:
        """Return a document; make it only if its files have changed or it is not stored.

        Args:
            kind: distinguishes different documents of one path; each kind has one type of document.
            path: path of the document: a file or a folder.
            make: makes it; errors that it raises are passed on, and nothing is stored.
            min_age: time since the last change of the files that is needed to store the document [s].
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
        """Remove the least recently used documents until the rest fits."""
        with self._lock:
            num_bytes = sum(slot.num_bytes for slot in self._slots.values())
            while len(self._slots) > self._max_documents or num_bytes > self._max_bytes:
                _, slot = self._slots.popitem(last=False)
                num_bytes -= slot.num_bytes


def _sign(files: Sequence[Path]) -> _Signature | None:
    """Return the signature of files; None if one of them cannot be accessed."""
    signature = []
    try:
        for file in files:
            path = file.resolve()
            stat = path.stat()
            signature.append((str(path), stat.st_mtime_ns, stat.st_size, stat.st_ino))
    except (OSError, RuntimeError):  # missing, or a loop of links: reading it reports the error
        return None
    return tuple(signature)


def _is_older(signature: _Signature, stamp_ns: float) -> bool:
    return all(changed_ns <= stamp_ns for _, changed_ns, _, _ in signature)
