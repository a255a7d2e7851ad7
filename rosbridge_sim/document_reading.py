"""JSON documents of the user: bytes -> a checked model, or one readable line with the place and the mistake.

The functions of `documents` read a document without a mistake. One that they refuse goes to `document_mistakes`, which
finds all mistakes and words them. It is imported only then: its library takes a fifth of the time and a seventh of the
memory of a server's start.
"""

from __future__ import annotations

from typing import Any, TypeVar

import msgspec

from rosbridge_sim.documents import DocumentType, Mistake
from rosbridge_sim.errors import DocumentError

T = TypeVar("T")


class MistakeNotReadyError(DocumentError):
    """A document has a mistake, and what words it is not there yet."""


def read_document(kind: DocumentType[T], text: bytes, source: str, max_bytes: int, *, is_quick: bool = False) -> T:
    """Read and check a document.

    Args:
        kind: what is expected.
        text: UTF-8, with or without a byte order mark.
        source: the file's name, for errors.
        max_bytes: largest length of `text`.
        is_quick: raise MistakeNotReadyError rather than take 60 ms; after `learn_mistakes` it is not raised.

    Returns:
        The model.

    Raises:
        DocumentError: one line. `demo.json:3:17: ...` where the text is not JSON (line and column, from 1);
            `demo.json: vehicleList[2].initPosition.pos.x: expected a number, got 'abc'` where a value does not fit.
            Of several mistakes the first is reported.
    """
    content = content_of(text, source, max_bytes)
    if not _is_odd(content):
        try:
            return kind.read(msgspec.json.decode(content))
        except (ValueError, RecursionError):
            pass
    if is_quick and not kind.knows_mistakes:
        raise MistakeNotReadyError(f"{source}: there is a mistake")
    from rosbridge_sim.document_mistakes import read_slowly  # noqa: PLC0415 - a large library, rarely needed

    return read_slowly(kind, content, source)


def learn_mistakes(kind: DocumentType[Any]) -> None:
    """Make what words the mistakes of a document: 60 ms in a thread, once in a process."""
    from rosbridge_sim.document_mistakes import adapter_of  # noqa: PLC0415 - as above

    adapter_of(kind)


def find_mistakes(kind: DocumentType[T], text: bytes, source: str, max_bytes: int) -> list[Mistake]:
    """Return all mistakes of a document, each in the words of `read_document`.

    Args:
        kind: what is expected.
        text: UTF-8, with or without a byte order mark.
        source: the file's name, for errors.
        max_bytes: largest length of `text`.

    Returns:
        The mistakes in the document's order; empty if there are none.
    """
    try:
        content = content_of(text, source, max_bytes)
    except DocumentError as error:
        return [Mistake((), str(error))]
    from rosbridge_sim.document_mistakes import list_mistakes  # noqa: PLC0415 - as above

    return list_mistakes(kind, content, source)


def document_schema(kind: DocumentType[Any]) -> dict[str, Any]:
    """Return the JSON Schema (draft 2020-12) of a document."""
    from rosbridge_sim.document_mistakes import schema_of  # noqa: PLC0415 - as above

    return schema_of(kind)


def content_of(text: bytes, source: str, max_bytes: int) -> bytes:
    """Return a document without its byte order mark.

    Args:
        text: UTF-8, with or without a byte order mark.
        source: the file's name, for errors.
        max_bytes: largest length of `text`.

    Raises:
        DocumentError: it is too long, or there is nothing.
    """
    if len(text) > max_bytes:
        raise DocumentError(f"{source}: expected at most {max_bytes:,} bytes, got {len(text):,}")
    if not text.strip():
        raise DocumentError(f"{source}: expected a JSON document, got nothing")
    return text.removeprefix(b"\xef\xbb\xbf")


def _is_odd(text: bytes) -> bool:
    """Tell whether a text has what the decoders judge differently: escapes, and broken UTF-8."""
    if b"\\u" in text:
        return True
    if text.isascii():
        return False
    try:
        text.decode()
    except UnicodeDecodeError:
        return True
    return False
