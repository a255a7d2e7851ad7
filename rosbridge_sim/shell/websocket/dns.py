"""Host names, resolved in a daemon thread, so that a dead DNS server never blocks shutdown; and own addresses.

The loop's own method blocks a thread until the system gives up, perhaps half a minute, and no process ends before it.
Here the thread is a daemon, so the process does not wait for it.
"""

from __future__ import annotations

import asyncio
import ipaddress
import socket
import threading
from contextlib import suppress
from typing import Final

MAX_THREADS: Final = 32
"""Most lookups at once: nodes of ROS 1 may name any number of hosts, and a dead DNS server holds each for some time."""

_THREAD: Final = "lookup of "


class HostLookup:
    """Resolves one host name, any number of times; requests at the same time share one answer."""

    def __init__(self, host: str) -> None:
        """Set the host; `addresses` resolves it.

        Args:
            host: name or address of the host.
        """
        self._host = host
        self._answer: asyncio.Future[list[str]] | None = None

    async def addresses(self, patience: float) -> list[str]:
        """Return the host's addresses, best first.

        Args:
            patience: longest wait [s].

        Raises:
            socket.gaierror: it has none, or there was no answer in time (EAI_AGAIN).
            UnicodeError: it cannot be a host name.
        """
        with suppress(ValueError):
            return [str(ipaddress.ip_address(self._host))]
        if self._answer is None or self._answer.done():
            self._answer = self._ask()
        try:
            async with asyncio.timeout(patience):
                return await asyncio.shield(self._answer)
        except TimeoutError:
            raise socket.gaierror(socket.EAI_AGAIN, "no name server answered in time") from None

    def _ask(self) -> asyncio.Future[list[str]]:
        loop = asyncio.get_running_loop()
        answer: asyncio.Future[list[str]] = loop.create_future()
        answer.add_done_callback(
            lambda done: done.cancelled() or done.exception()
        )  # so that asyncio does not log it if no task waits any more

        if sum(one.name.startswith(_THREAD) for one in threading.enumerate()) >= MAX_THREADS:
            answer.set_exception(socket.gaierror(socket.EAI_AGAIN, "too many host names are looked up at once"))
            return answer

        def settle(outcome: list[str] | Exception) -> None:
            if answer.cancelled():
                return
            if isinstance(outcome, Exception):
                answer.set_exception(outcome)
            else:
                answer.set_result(outcome)

        def look() -> None:
            outcome = _look_up(self._host)
            with suppress(RuntimeError):  # the loop has ended
                loop.call_soon_threadsafe(settle, outcome)

        threading.Thread(target=look, name=f"{_THREAD}{self._host}", daemon=True).start()
        return answer


def _look_up(host: str) -> list[str] | Exception:
    try:
        found = socket.getaddrinfo(host, None, type=socket.SOCK_STREAM)
    except (OSError, UnicodeError) as error:
        return error
    return list(dict.fromkeys(_address(*place) for *_, place in found))


def _address(host: str | int, _port: object, _flow: int = 0, scope: int = 0) -> str:
    """Return an address as text; a link-local address gets the number of its link."""
    return f"{host}%{scope}" if scope and "%" not in str(host) else str(host)


def is_own(address: str) -> bool:
    """Return True if an address belongs to this machine: only such an address can be bound."""
    with socket.socket(socket.AF_INET6 if ":" in address else socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.bind((address, 0))
        except OSError:
            return False
    return True
