"""Addresses of rosbridges, as people write them and as a log shows them."""

from __future__ import annotations

import urllib.parse

__all__ = ["DEFAULT_PORT", "check_url", "full_url", "port_of", "shown_url"]

DEFAULT_PORT = 9090


def full_url(text: str) -> str:
    """`HOST` or `HOST:PORT` as `ws://HOST:PORT`; whatever else as it is, for others to refuse."""
    scheme, mark, rest = text.rpartition("://")
    scheme = {"": "ws", "http": "ws", "https": "wss"}.get(scheme, scheme)
    url = f"{scheme}://{rest}"
    try:
        parts = urllib.parse.urlsplit(url)
        has_port = parts.port is not None
    except ValueError:
        has_port = True
    else:
        if not mark and not has_port:
            url = urllib.parse.urlunsplit(parts._replace(netloc=f"{parts.netloc}:{DEFAULT_PORT}"))
    return url


def check_url(text: str) -> str:
    """The full URL.

    Raises:
        ValueError: it is none of a WebSocket.
    """
    url = full_url(text.strip())
    parts = urllib.parse.urlsplit(url)
    if parts.scheme not in {"ws", "wss"} or not parts.hostname or parts.port == 0 or parts.fragment:
        raise ValueError
    if not url.isprintable() or " " in url or (parts.username is None) != (parts.password is None):
        raise ValueError
    return url


def port_of(url: str) -> int:
    """The port that a full URL leads to."""
    parts = urllib.parse.urlsplit(url)
    return parts.port or {"ws": 80, "wss": 443}[parts.scheme]


def shown_url(url: str) -> str:
    """The URL without what nobody should read in a log: a token in its query, a name and password."""
    scheme, mark, rest = url.partition("://")
    netloc = rest.partition("/")[0].partition("?")[0]
    path = rest[len(netloc) :].partition("?")[0]
    return f"{scheme}{mark}{netloc.rpartition('@')[2]}{'' if path == '/' else path}"
