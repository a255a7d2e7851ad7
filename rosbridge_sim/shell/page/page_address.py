"""The address of the web page, for a person: in the log, and in a browser that `--open` starts."""

from __future__ import annotations

import logging
import os
import socket
import sys
import threading
import webbrowser
from collections.abc import Mapping
from contextlib import suppress
from ipaddress import ip_address

_log = logging.getLogger("rosbridge_sim.page")

_FAR_ADDRESSES = {socket.AF_INET: "192.0.2.1", socket.AF_INET6: "2001:db8::1"}
"""Addresses of documentation (RFC 5737, RFC 3849): nothing is sent there, the system only chooses the way."""


def page_urls(host: str, port: int, *, is_tls: bool) -> tuple[str, ...]:
    """Return the URLs of the page: the first one for this machine; if the server listens on all addresses, one more.

    Args:
        host: host name or address on which the server listens.
    """
    hosts = [host]
    with suppress(ValueError):  # a name
        address = ip_address(host)
        if address.is_unspecified:
            family = socket.AF_INET if address.version == 4 else socket.AF_INET6  # noqa: PLR2004 - IPv4
            hosts = ["127.0.0.1" if family == socket.AF_INET else "::1", *_own_address(family)]
    scheme = "https" if is_tls else "http"
    return tuple(f"{scheme}://{f'[{host}]' if ':' in host else host}:{port}/" for host in hosts)


def _own_address(family: socket.AddressFamily) -> list[str]:
    """Return the address of this machine in its network; empty if it has none."""
    try:
        with socket.socket(family, socket.SOCK_DGRAM) as far:
            far.connect((_FAR_ADDRESSES[family], 9))
            address = str(far.getsockname()[0])
    except OSError:
        return []
    return [] if ip_address(address.partition("%")[0]).is_loopback else [address]


def has_desktop(platform: str = sys.platform, environment: Mapping[str, str] = os.environ) -> bool:
    """Return True if a browser has a window to open. A browser for terminals would take the server's own terminal.

    Args:
        platform: as `sys.platform`.
    """
    if platform in {"win32", "darwin"}:
        return True
    return bool(environment.get("DISPLAY") or environment.get("WAYLAND_DISPLAY"))


def open_browser(url: str) -> None:
    """Open a page in the user's browser, if there is a desktop, in a thread, because some browsers take seconds."""
    if not has_desktop():
        _log.warning("--open: there is no desktop here to open a browser on; open %s yourself", url)
        return
    threading.Thread(target=_open, args=(url,), name="browser", daemon=True).start()


def _open(url: str) -> None:
    try:
        is_open = webbrowser.open(url)
    except (OSError, webbrowser.Error):
        is_open = False
    if not is_open:
        _log.warning("--open: no browser could be started; open %s yourself", url)
