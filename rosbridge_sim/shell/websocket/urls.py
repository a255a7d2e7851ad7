"""Addresses of rosbridges, as people write them and as a log shows them."""

from __future__ import annotations

import re
import urllib.parse
from collections.abc import Iterable

__all__ = ["DEFAULT_PORT", "check_url", "full_url", "hide", "hide_in_words", "port_of", "secrets_of", "shown_url"]

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
    """Return a URL without its secrets, for logs: the query, which may hold a token, and name and password."""
    scheme, mark, rest = url.partition("://")
    if not mark:
        scheme, rest = "", url
    rest = re.split(r"[?#]", rest, maxsplit=1)[0]
    netloc = rest.partition("/")[0]
    path = rest[len(netloc) :]
    return f"{scheme}{mark}{netloc.rpartition('@')[2]}{'' if path == '/' else path}"


LEAST_SECRET = 3
"""Characters of a secret that is looked for in texts: a shorter one stands in too many words to be one."""


def secrets_of(url: str) -> set[str]:
    """The parts that `shown_url` leaves out, in every spelling in which the far side may repeat them."""
    _, _, rest = url.partition("://")
    head, _, query = rest.partition("?")
    secrets = {part.partition("=")[2] for part in re.split(r"[&;#]", query)}
    name, _, password = head.partition("/")[0].rpartition("@")[0].partition(":")
    secrets |= {password or name, query}
    secrets |= {urllib.parse.unquote(one) for one in secrets} | {urllib.parse.unquote_plus(one) for one in secrets}
    return secrets | {urllib.parse.quote(one, safe="") for one in secrets}


def hide(text: str, secrets: Iterable[str]) -> str:
    """A text from the far side without the secrets that it repeats."""
    for secret in sorted(secrets, key=len, reverse=True):
        if len(secret) >= LEAST_SECRET:
            text = text.replace(secret, "...")
    return text


_SECRETS_IN_WORDS = re.compile(r"\?[^'\"\s]*=[^'\"\s]*|//[^'\"/@\s]*@|(?<=token[=:])[^'\"\s]+", re.IGNORECASE)


def hide_in_words(text: str) -> str:
    """Words of a command line or a file as a message may quote them: a query, a password or a token may stand there."""
    return _SECRETS_IN_WORDS.sub(lambda match: {"?": "?...", "/": "//...@"}.get(match[0][0], "..."), text)
