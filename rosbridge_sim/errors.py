"""Every error this package raises on purpose.

    RosbridgeSimError
    ├── PeerError              somebody else broke a rule: a status frame or `result: false`
    │   ├── FrameError         bytes that are no op
    │   ├── TypeNameError      a type name that is malformed or that nobody knows
    │   │   └── UnknownPackageError  ... because its whole package is unknown (relayed unchecked)
    │   ├── FieldError         a message that does not fit its type
    │   ├── EncodingError      a message that cannot be written in some encoding, by a bug of ours
    │   └── GraphError         a topic, service or name that cannot be had
    └── DocumentError          a file or setting of the user's: one readable line, exit code 2
        └── DefinitionError    a .msg, .srv or .action text, with line and column

A `PeerError` never ends a connection and leaves everything as it was. Whatever is not in this tree is a
bug of ours: it is raised, logged with its traceback and counted.
"""

from __future__ import annotations

import difflib
from collections.abc import Collection

__all__ = [
    "DefinitionError",
    "DocumentError",
    "EncodingError",
    "FieldError",
    "FrameError",
    "GraphError",
    "PeerError",
    "RosbridgeSimError",
    "TypeNameError",
    "UnknownPackageError",
    "hint",
]


class RosbridgeSimError(Exception):
    """The root of the tree."""


class PeerError(RosbridgeSimError):
    """Somebody else's fault; the text is fit to be sent to them."""


class FrameError(PeerError):
    """A frame, or an object in it, that is no op.

    Attributes:
        op_id: the `id` that the sender gave, as it came, or None.
        op: the `op` that it named, as far as it could be read, or None.
    """

    def __init__(self, text: str, op_id: object = None, op: str | None = None) -> None:
        super().__init__(text)
        self.op_id = op_id
        self.op = op


class TypeNameError(PeerError):
    """A type name that is malformed, or a type that its (known) package lacks."""


class UnknownPackageError(TypeNameError):
    """A well-formed type name from a package that no schema folder holds."""


class FieldError(PeerError):
    """A message that does not fit its type; the text names the path of the field."""


class EncodingError(PeerError):
    """A message that fits its type and cannot be written all the same; the cause is what its encoder raised.

    The bug is ours, yet it concerns that message alone: its publisher is told, and no connection is closed.
    """


class GraphError(PeerError):
    """A topic, a service or a name that cannot be had: conflict, unknown, denied, limit."""


class DocumentError(RosbridgeSimError):
    """A file or a setting that cannot be used: what, where, what was expected, in one line."""


class DefinitionError(DocumentError):
    """A definition text that cannot be parsed.

    Attributes:
        line, column: where, counted from 1.
    """

    def __init__(self, source: str, line: int, column: int, text: str) -> None:
        super().__init__(f"{source}:{line}:{column}: {text}")
        self.line = line
        self.column = column


def hint(name: str, known: Collection[str], cutoff: float = 0.7) -> str:
    """For the end of an error: ` (did you mean ...?)`, or nothing where no known name comes near."""
    close = difflib.get_close_matches(name, sorted(known), n=1, cutoff=cutoff)
    return f" (did you mean {close[0]}?)" if close else ""
