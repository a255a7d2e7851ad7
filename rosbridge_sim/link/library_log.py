"""The log of the `websockets` library, without the secrets in it.

At debug level the library logs each request line, each header and the text of frames. All of them may contain a token:
`GET /?token=...`, `Authorization: Bearer ...`, `{"op": "auth", "token": ...}`. So a line of the library is allowed by
its kind, not by a search for secrets: an unknown line loses its values, and no exception is written with its text.
`--log-level debug` still shows how a handshake goes.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping
from http import HTTPMethod
from typing import Any

from rosbridge_sim.loose_types import LibraryArgument

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
"""Headers whose values are shown. Of others, such as Authorization, Cookie and Referer, only the name is shown."""

_UPGRADE = ("upgrade", "websocket")
"""The only value of this header that is shown, because a client may write anything there."""


def _header(name: object, value: object) -> tuple[object, ...]:
    is_harmless = str(name).lower() in _HARMLESS_HEADERS or (str(name).lower(), str(value).lower()) == _UPGRADE
    return name, value if is_harmless else "..."


def _path(path: object) -> tuple[object, ...]:
    bare, mark, _ = str(path).partition("?")
    return (f"{bare}{mark}{'...' if mark else ''}",)


def _request(method: object, path: object, protocol: object) -> tuple[object, ...]:
    """Return the values of a request line; an unknown method is hidden, because it may be any text."""
    return (method if method in set(HTTPMethod) else "...", *_path(path), protocol)


def _frame(frame: object) -> tuple[object, ...]:
    """Return kind and size of a frame, not its text."""
    opcode, data = getattr(frame, "opcode", None), getattr(frame, "data", b"")
    return (f"{getattr(opcode, 'name', 'a frame')} [{len(data):,} bytes]",)


def _as_it_is(*values: object) -> tuple[object, ...]:
    return values


_SHOWN: Mapping[str, Callable[..., tuple[object, ...]]] = {
    "< %s %s %s": _request,
    "< GET %s HTTP/1.1": _path,  # the same line in version 16 of the library
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
"""The library's lines whose values are shown, and how. A test checks that the library has these texts."""


class _Quiet(logging.LoggerAdapter[Any]):
    """The library's lines, all at level debug and without tracebacks.

    The library logs a traceback for each handshake that a port scanner breaks off, and its text may quote received
    data.
    """

    def log(self, level: int, msg: object, *args: LibraryArgument, **kwargs: LibraryArgument) -> None:
        if not self.isEnabledFor(logging.DEBUG):  # each connection has some lines
            return
        show = _SHOWN.get(str(msg))
        if args and show is None:
            msg, args = "%s", (f"{msg} (values are not shown)",)
        elif show is not None:
            args = show(*args)
        kwargs.pop("exc_info", None)
        # The log's limit per place in the code must use the library's places, not this one.
        kwargs["stacklevel"] = kwargs.get("stacklevel", 1) + 1
        super().log(min(level, logging.DEBUG), msg, *args, **kwargs)


quiet = _Quiet(logging.getLogger("rosbridge_sim.websockets"), {})
"""Value for the library's argument `logger`."""
