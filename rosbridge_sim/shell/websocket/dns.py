"""Where a host is, found without a name server that does not answer keeping anybody.

The loop's own way occupies a thread until the system gives up, half a minute perhaps, and no process ends before it.
Here that thread is one that nobody has to wait for.
"""

from __future__ import annotations

import asyncio
import ipaddress
import socket
import threading
from contextlib import suppress

__all__ = ["HostLookup"]


class HostLookup:
    """Finds the addresses of one host, as often as wanted; who asks while a question is open shares its answer."""

    def __init__(self, host: str) -> None:
        """Nobody is asked yet."""
        self._host = host
        self._answer: asyncio.Future[list[str]] | None = None

    async def addresses(self, patience: float) -> list[str]:
        """The host's addresses, best first.

        Args:
            patience: how long that may take [s].

        Raises:
            socket.gaierror: it has none, or nobody has said so in time (EAI_AGAIN).
            UnicodeError: no host can have that name.
        """
        with suppress(ValueError):
            return [str(ipaddress.ip_address(self._host))]
        if self._answer is None or self._answer.done():
            self._answer = self._ask()
        try:
            async with asyncio.timeout(patience):
                return await asyncio.shield(self._answer)
        except TimeoutError:
            raise socket.gaierror(socket.EAI_AGAIN, "nobody has answered in time") from None

    def _ask(self) -> asyncio.Future[list[str]]:
        loop = asyncio.get_running_loop()
        answer: asyncio.Future[list[str]] = loop.create_future()
        answer.add_done_callback(lambda done: done.cancelled() or done.exception())  # perhaps nobody waits any more

        def settle(outcome: list[str] | Exception) -> None:
            if answer.cancelled():
                return
            if isinstance(outcome, Exception):
                answer.set_exception(outcome)
            else:
                answer.set_result(outcome)

        def look() -> None:
            outcome = _look_up(self._host)
            with suppress(RuntimeError):  # the loop has ended meanwhile
                loop.call_soon_threadsafe(settle, outcome)

        threading.Thread(target=look, name=f"lookup of {self._host}", daemon=True).start()
        return answer


def _look_up(host: str) -> list[str] | Exception:
    try:
        found = socket.getaddrinfo(host, None, type=socket.SOCK_STREAM)
    except (OSError, UnicodeError) as error:
        return error
    return list(dict.fromkeys(_address(*place) for *_, place in found))


def _address(host: str | int, _port: object, _flow: int = 0, scope: int = 0) -> str:
    """An address as text; one of a link with the number of that link."""
    return f"{host}%{scope}" if scope and "%" not in str(host) else str(host)
