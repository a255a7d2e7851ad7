"""The log of the `websockets` library, without the secrets that it would write.

At debug level the library logs each request line, each header and the text of frames. A token stands in all of them:
`GET /?token=...`, `Authorization: Bearer ...`, `{"op": "auth", "token": ...}`. So a line of the library is let through
by what it is, and not by what a pattern finds in it: an unknown line loses its values, and no exception is written out
with its text. `--log-level debug` still tells how a handshake goes.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping
from http import HTTPMethod
from typing import Any

from rosbridge_sim.loose_types import LibraryArgument

__all__ = ["quiet"]

_HARMLESS_HEADERS = frozenset(
    [
        "connection",
        "content-length",
        "content-type",
        "date",
        "host",
        "origin",
        "sec-websocket-accept",
        "sec-websocket-extensions",
        "sec-websocket-version",
        "server",
        "user-agent",
        "www-authenticate",
    ]
)
"""Headers whose values are shown. Of others, such as Authorization, Cookie and Referer, the name alone is."""

_UPGRADE = ("upgrade", "websocket")
"""The one value of this header that is shown, since a client may write anything there."""


def _header(name: object, value: object) -> tuple[object, ...]:
    is_harmless = str(name).lower() in _HARMLESS_HEADERS or (str(name).lower(), str(value).lower()) == _UPGRADE
    return name, value if is_harmless else "..."


def _path(path: object) -> tuple[object, ...]:
    bare, mark, _ = str(path).partition("?")
    return (f"{bare}{mark}{'...' if mark else ''}",)


def _request(method: object, path: object, protocol: object) -> tuple[object, ...]:
    """A request line; a method that is none of HTTP's may be anything."""
    return (method if method in set(HTTPMethod) else "...", *_path(path), protocol)


def _frame(frame: object) -> tuple[object, ...]:
    """Kind and size of a frame, and not its text."""
    opcode, data = getattr(frame, "opcode", None), getattr(frame, "data", b"")
    return (f"{getattr(opcode, 'name', 'a frame')} [{len(data):,} bytes]",)


def _as_it_is(*values: object) -> tuple[object, ...]:
    return values


_SHOWN: Mapping[str, Callable[..., tuple[object, ...]]] = {
    "< %s %s %s": _request,
    "< GET %s HTTP/1.1": _path,  # the same, in version 16
    "> GET %s HTTP/1.1": _path,
    "< %s: %s": _header,
    "> %s: %s": _header,
    "< %s": _frame,
    "> %s": _frame,
    "< HTTP/1.1 %d %s": _as_it_is,
    "> HTTP/1.1 %d %s": _as_it_is,
    "< [body] (%d bytes)": _as_it_is,
    "> [body] (%d bytes)": _as_it_is,
    "= connection is %s": _as_it_is,
    "server listening on %s": _as_it_is,
}
"""The library's lines whose values are shown, and how. A test holds it to these words."""


class _Quiet(logging.LoggerAdapter[Any]):
    """The library's lines, all at debug and without tracebacks.

    By itself it logs a traceback for each handshake that a port scanner breaks off. Its text may quote what came.
    """

    def log(self, level: int, msg: object, *args: LibraryArgument, **kwargs: LibraryArgument) -> None:
        show = _SHOWN.get(str(msg))
        if args and show is None:
            msg, args = "%s", (f"{msg} (values are not shown)",)
        elif show is not None:
            args = show(*args)
        kwargs.pop("exc_info", None)
        # The log has a limit for each place in the code: the library's places, and not this one.
        kwargs["stacklevel"] = kwargs.get("stacklevel", 1) + 1
        super().log(min(level, logging.DEBUG), msg, *args, **kwargs)


quiet = _Quiet(logging.getLogger("rosbridge_sim.websockets"), {})
"""For the library's argument `logger`."""
