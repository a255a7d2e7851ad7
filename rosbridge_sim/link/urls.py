"""URLs of rosbridges, as people write them and as a log shows them."""

from __future__ import annotations

import re
import urllib.parse
from collections.abc import Iterable

DEFAULT_PORT = 9090


def full_url(text: str) -> str:
    """Return `ws://HOST:PORT` for `HOST` or `HOST:PORT`; return other texts unchanged, for a later check.

    Args:
        text: a URL, or a part of one.
    """
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
    """Return the full URL.

    Args:
        text: a URL, or a part of one.

    Raises:
        ValueError: it is not the URL of a WebSocket.
    """
    url = full_url(text.strip())
    parts = urllib.parse.urlsplit(url)
    if parts.scheme not in {"ws", "wss"} or not parts.hostname or parts.port == 0 or parts.fragment:
        raise ValueError
    if not url.isprintable() or " " in url or (parts.username is None) != (parts.password is None):
        raise ValueError
    return url


def port_of(url: str) -> int:
    """Return the port of a full URL."""
    parts = urllib.parse.urlsplit(url)
    return parts.port or {"ws": 80, "wss": 443}[parts.scheme]


def shown_url(url: str) -> str:
    """Return a URL without its secrets, for logs: without the query, which may hold a token, and user and password."""
    scheme, mark, rest = url.partition("://")
    if not mark:
        scheme, rest = "", url
    rest = re.split(r"[?#]", rest, maxsplit=1)[0]
    netloc = rest.partition("/")[0]
    path = rest[len(netloc) :]
    return f"{scheme}{mark}{netloc.rpartition('@')[2]}{'' if path == '/' else path}"


LEAST_SECRET = 3
"""Shortest secret that is searched in texts [characters]; a shorter one is part of too many words."""


def secrets_of(url: str) -> set[str]:
    """Return the parts that `shown_url` leaves out, in every spelling that the far side may use."""
    _, _, rest = url.partition("://")
    head, _, query = rest.partition("?")
    secrets = {part.partition("=")[2] for part in re.split(r"[&;#]", query)}
    name, _, password = head.partition("/")[0].rpartition("@")[0].partition(":")
    secrets |= {password or name, query}
    secrets |= {urllib.parse.unquote(one) for one in secrets} | {urllib.parse.unquote_plus(one) for one in secrets}
    return secrets | {urllib.parse.quote(one, safe="") for one in secrets}


def hide(text: str, secrets: Iterable[str]) -> str:
    """Return a text from the far side without secrets."""
    for secret in sorted(secrets, key=len, reverse=True):
        if len(secret) >= LEAST_SECRET:
            text = text.replace(secret, "...")
    return text


_SECRETS_IN_WORDS = re.compile(r"\?[^'\"\s]*=[^'\"\s]*|//[^'\"/@\s]*@|(?<=token[=:])[^'\"\s]+", re.IGNORECASE)


def hide_in_words(text: str) -> str:
    """Return words of a command line or file for an error text, without a query, password or token."""
    return _SECRETS_IN_WORDS.sub(lambda match: {"?": "?...", "/": "//...@"}.get(match[0][0], "..."), text)
