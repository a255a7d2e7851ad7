"""Rules for web pages that connect or read, based on the headers Origin and Host of a request.

A browser names the page that opens a WebSocket in the header Origin, and no page can change that. Without a rule, any
website that the user visits could drive the car and write files. The rules, in this order:
1. A handshake without an Origin passes, and its Host is not checked. It comes from a program, and a program could send
any header. So a container may use the server's name in Docker Compose.
2. An origin that `--allow-origin` names passes, and its Host is not checked: the user has named the page itself, and
DNS rebinding (see below) does not change an Origin.
3. Other origins pass if they are on the list below and the Host is a name that an attacker cannot choose:
   - http(s) pages of localhost, 127.0.0.1 and [::1], on any port. Such a page comes from the browser's own machine, and
   no website has such an origin. This also holds if the server is not on loopback: a server in a container listens on
   0.0.0.0, and the page and the published port are both on localhost.
   - Schemes that no website can have: vscode-webview://, file://, app:// and the like.
   - The server's own address, as in the Host, because Python's `websocket-client` sends that. If the server is not on
   loopback, other ports of the same host pass, too: a robot often has its dashboard on port 80 and rosbridge on 9090.
   On loopback the port must be the same: an address other than localhost is then a tunnel, and its other pages belong
   to another machine.
4. `null` and all other http(s) pages are refused. Every website can have the origin `null`, by a sandboxed frame.
The Host is checked because of DNS rebinding: a website lets its own name point to 127.0.0.1 for a moment, and calls the
server by that name; Origin and Host are then equal. So a Host must be an IP address, localhost, a name under
.localhost, one of the machine's own names, or one that `--allow-host` names. DNS is not used to find the machine's
names, because it takes time and an attacker may control its answers.

Plain HTTP has no rule for the Origin: no header lets other pages read an answer, so browsers keep it from them. But a
page reads its own server, without an Origin, and after DNS rebinding that is this one. So the Host is always checked
where an answer has data. It cannot be known that a request comes from a program: programs send a Host, too.
"""

from __future__ import annotations

import logging
import re
from collections.abc import Sequence
from fnmatch import fnmatchcase
from ipaddress import ip_address
from shlex import quote

from rosbridge_sim.records import Record

MAX_REFUSED_ORIGINS = 100
"""Refused origins that each get a warning. A website with its own DNS server can have any number of origins."""

MAX_HEADER = 300
"""Longest Origin or Host that is read [characters]; a host name has at most 253."""

MAX_ORIGIN_SHOWN = 100
"""Characters of a wrong header that a message quotes."""

_WEB_PORTS = {"http": "80", "https": "443", "ftp": "21"}
"""Schemes that a website can have, with their ports. Browsers before 2021 also showed pages from ftp://."""

_WHY_NOT_NULL = (
    "Pages opened from disk or in a sandboxed frame (Origin: null) may not connect here; serve the page from"
    " http://localhost, or add --allow-origin null, which also lets in every website that uses such a frame"
)

_LOCAL_HOSTS = frozenset({"localhost", "127.0.0.1", "::1"})

_NETLOC = re.compile(
    r"(?:\[(?P<ipv6>[0-9a-f]*:[0-9a-f:.]*(?:%[\w.~-]+)?)\]|(?P<name>[a-z0-9_.-]+))(?::(?P<port>[0-9]{0,5}))?", re.ASCII
)
"""Host and port in lower case, as in both headers. A name may have underscores, which Docker Compose uses."""

_ORIGIN = re.compile(r"(?P<scheme>[a-z][a-z0-9+.-]*)://(?P<netloc>[!-+\-.-~]*)", re.ASCII)
"""An origin in lower case (RFC 6454 section 6.2). Two origins in one header, with a blank or a comma, do not match."""


class OriginRules(Record):
    """Web pages that may connect.

    Attributes:
        origins: patterns of origins in addition to the module's own list, such as `https://*.example.org`.
        hosts: patterns of host names that pages may use for the server, such as `sim` or `*.lab.example`.
    """

    origins: tuple[str, ...] = ()
    hosts: tuple[str, ...] = ()

    def judge(
        self, origins: Sequence[str], hosts: Sequence[str], own_names: frozenset[str], *, is_loopback: bool
    ) -> str | None:
        """Return why a handshake is refused, with the flag that would allow it; None if it may go on.

        Args:
            own_names: names of this machine, from `own_names`.
            is_loopback: the server can only be reached from this machine.
        """
        if not origins or self._is_named(origins):
            return None
        try:
            page = _read_origin(origins)
            place = _read_host(hosts, " beside an Origin")
        except ValueError as error:
            return str(error)
        origin = origins[0].lower()
        if not page.is_of_this_machine and not page.is_at(place, is_any_port=not is_loopback):
            return f"Pages from {origin} may not connect here; --allow-origin {quote(origin)} would let them"
        if not self._is_known(place, own_names):
            return (
                f"Pages from {origin} may not call this server {place.host}, which might be a website's name for it;"
                f" --allow-host {quote(place.host)} would let them; a program can also leave the Origin out"
            )
        return None

    def judge_host(self, hosts: Sequence[str], own_names: frozenset[str]) -> str | None:
        """Return why a plain request gets no data, with the flag that would allow it; None if it may have them.

        Args:
            own_names: names of this machine, from `own_names`.
        """
        try:
            place = _read_host(hosts)
        except ValueError as error:
            return str(error)
        if self._is_known(place, own_names):
            return None
        return (
            f"Callers of {place.host} get no data without a token, because it might be a website's name for this"
            f" server; --allow-host {quote(place.host)} would let them; or call localhost or an IP address"
        )

    def open_flags(self) -> list[str]:
        """Return the flags that let in any website, such as `--allow-origin '*'`."""
        return [
            *(
                f"--allow-origin {quote(one)}"
                for one in self.origins
                if any(_matches_all(one, of) for of in _ANY_ORIGINS)
            ),
            *(f"--allow-host {quote(one)}" for one in self.hosts if _matches_all(one, _ANY_HOSTS)),
        ]

    def _is_named(self, origins: Sequence[str]) -> bool:
        """Return True if the user has named this origin."""
        origin = origins[0].lower()
        if len(origins) > 1 or len(origin) > MAX_HEADER:
            return False
        return any(_matches(origin, one) for one in self.origins)

    def _is_known(self, place: _Place, own_names: frozenset[str]) -> bool:
        """Return True if no website can have chosen the host."""
        host = place.host
        if place.is_address or host == "localhost" or host.endswith(".localhost") or host in own_names:
            return True
        names = (host, f"{host}:{place.port}")
        return any(_matches(name, one) for name in names for one in self.hosts)


def own_names(hostname: str) -> frozenset[str]:
    """Return the names of this machine in its network.

    Args:
        hostname: the system's name, with or without a domain.
    """
    name = hostname.lower().removesuffix(".")
    first = name.partition(".")[0]
    return frozenset({name, first, f"{first}.local"}) if first else frozenset()


class RefusedOrigins:
    """Refused origins, so that each gets only one warning. It stores MAX_REFUSED_ORIGINS of them."""

    def __init__(self) -> None:
        self._known: set[str] = set()

    @property
    def is_full(self) -> bool:
        """True if no further origins are stored."""
        return len(self._known) >= MAX_REFUSED_ORIGINS

    def add(self, origin: str) -> bool:
        """Store an origin, if there is room.

        Returns:
            True if it is new.
        """
        known = _show(origin.lower())
        if self.is_full or known in self._known:
            return False
        self._known.add(known)
        return True

    def log(self, log: logging.Logger, address: str, text: str, origin: str | None) -> None:
        """Log a warning for each web page once, not for each attempt: a page in a tab may try every second.

        Args:
            text: why it was refused.
            origin: the refused web page; None if the page is not the reason.
        """
        text = text.rstrip()
        if origin is None or not self.add(origin):
            log.info("%s refused: %s", address, text)
            return
        # A separate line of code: the log limits lines by their place, and one page must not hide another page.
        log.warning("%s refused: %s", address, text)
        if self.is_full:
            log.warning(
                "web pages of %d origins were refused; further ones are logged at level info", MAX_REFUSED_ORIGINS
            )


class _Place(Record):
    """Host and port of a header.

    Attributes:
        host: a name without a final dot, or an address without brackets, in the shortest form.
        port: digits of the port; empty if there is none.
        is_address: it is an IP address.
    """

    host: str
    port: str
    is_address: bool


class _Page(Record):
    """An origin.

    Attributes:
        scheme: such as `https`.
        place: its host and port; None if no website can have the scheme.
    """

    scheme: str
    place: _Place | None

    @property
    def is_of_this_machine(self) -> bool:
        """True if the page comes from the browser's own machine."""
        return self.place is None or self.place.host in _LOCAL_HOSTS

    def is_at(self, place: _Place, *, is_any_port: bool) -> bool:
        """Return True if the page has the host and port that the client uses for the server."""
        if self.place is None or self.place.host != place.host:
            return False
        default = _WEB_PORTS[self.scheme]
        return is_any_port or (self.place.port or default) == (place.port or default)


def _read_origin(origins: Sequence[str]) -> _Page:
    """Return the page in the header Origin.

    Raises:
        ValueError: it does not name a page; the text says what to do.
    """
    if len(origins) > 1:
        raise ValueError(f"Expected one Origin header; got {len(origins)}")
    origin = origins[0].lower()
    if origin == "null":
        raise ValueError(_WHY_NOT_NULL)
    match = _ORIGIN.fullmatch(origin) if len(origin) <= MAX_HEADER else None
    if match is not None:
        if match["scheme"] not in _WEB_PORTS:
            return _Page(match["scheme"], None)
        place = _read_place(match["netloc"])
        if place is not None:
            return _Page(match["scheme"], place)
    raise ValueError(f"Expected an Origin such as https://app.example.org, or none; got {_show(origins[0])}")


def _read_host(hosts: Sequence[str], where: str = "") -> _Place:
    """Return host and port in the header Host.

    Args:
        where: for the texts, such as " beside an Origin".

    Raises:
        ValueError: it is missing, given twice, or malformed.
    """
    if len(hosts) != 1:
        raise ValueError(f"Expected one Host header{where}; got {len(hosts)}")
    place = _read_place(hosts[0].lower())
    if place is None:
        raise ValueError(f"Expected a Host such as localhost:9090{where}; got {_show(hosts[0])}")
    return place


def _read_place(text: str) -> _Place | None:
    """Return host and port of a text in lower case; None if it is malformed."""
    match = _NETLOC.fullmatch(text) if len(text) <= MAX_HEADER else None
    if match is None:
        return None
    ipv6, name, port = match["ipv6"], (match["name"] or "").removesuffix("."), (match["port"] or "").lstrip("0")
    try:
        return _Place(str(ip_address(ipv6 or name)), port, is_address=True)
    except ValueError:
        return _Place(name, port, is_address=False) if name else None


def _matches(text: str, pattern: str) -> bool:
    """Return True if a text in lower case matches a user's pattern."""
    plain = _LABEL.sub(_to_ascii, pattern.lower()).removesuffix("/")
    return text == plain or fnmatchcase(text, _IPV6.sub("[[]", plain))


def _matches_all(pattern: str, texts: Sequence[str]) -> bool:
    return all(_matches(text, pattern) for text in texts)


_ANY_HOSTS = ("a.example", "b.test")
"""Hosts with nothing in common: a pattern that matches both matches all hosts."""

_ANY_ORIGINS = (("null",), *(tuple(f"{scheme}://{host}" for host in _ANY_HOSTS) for scheme in ("http", "https")))
"""Lists of origins; a pattern that matches a whole list lets in any website."""

_LABEL = re.compile(r"[^\s./:*?\[\]]*[^\x00-\x7f][^\s./:*?\[\]]*")
"""A part of a host name that is not ASCII."""

_IPV6 = re.compile(r"\[(?=[0-9a-f.]*:[0-9a-f:.*?]*\])")
"""Bracket before an IPv6 address, which is not a character set of a pattern."""


def _to_ascii(match: re.Match[str]) -> str:
    """Return a part of a name as on the wire (punycode)."""
    try:
        return match[0].encode("idna").decode()
    except UnicodeError:
        return match[0]  # such a name matches nothing


def _show(text: str) -> str:
    """Return a header for a message: short and in ASCII."""
    shown = repr(text[:MAX_ORIGIN_SHOWN].encode("ascii", "replace").decode())
    return shown if len(text) <= MAX_ORIGIN_SHOWN else f"{shown}..."
