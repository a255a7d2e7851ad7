"""A file that a browser gets, with its compressed form and its ETag."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable

from rosbridge_sim.records import Record

LEVEL = 6
"""Of the compression: the usual one; the highest takes twice the time for half a per cent less."""


class PageFile(Record):
    """A file of the page.

    Attributes:
        kind: its content type.
        gzipped: the same, compressed.
        etag: stands for the body, with its quotes.
    """

    kind: str
    body: bytes
    gzipped: bytes
    etag: str


def is_known(etag: str, known: Iterable[str]) -> bool:
    """Return True if a client has what an ETag stands for, by its `If-None-Match` headers."""
    names = [name.strip().removeprefix("W/") for name in ",".join(known).split(",")]
    return etag in names or "*" in names


def make_page_file(kind: str, body: bytes) -> PageFile:
    """Return a file with its compressed form and its ETag."""
    etag = f'"{hashlib.sha256(body).hexdigest()[:32]}"'
    import gzip  # noqa: PLC0415 - for the first reader of a page

    return PageFile(kind, body, gzip.compress(body, LEVEL, mtime=0), etag)
