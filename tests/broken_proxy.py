"""TCP proxy that splits, delays, stalls, half-closes and resets connections as planned.

Each connection has a fate, taken from the plan in the order of the connections; those after its end have a good line. A
fate is told in bytes and drawn from a seed, so that a plan breaks the same bytes each time, however fast the machine.
"""

from __future__ import annotations

import asyncio
import random
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from types import TracebackType
from typing import Literal, Self

__all__ = ["BrokenProxy", "Fate", "draw_fates"]

PATIENCE = 60.0
"""How long an event is waited for [s]; here once more, for scripts that use the proxy have no pytest at hand."""

Way = Literal["up", "down"]
"""Towards the server, or towards the client."""


@dataclass(frozen=True)
class Fate:
    """What becomes of a connection.

    Attributes:
        piece: the most that is passed on at once [bytes].
        pause: the longest wait before a piece [s]; what comes meanwhile is joined, up to `piece`.
        reset_at: after so many bytes, both ways together, both ends see a reset.
        finish_at: after so many bytes towards the server, it sees the end of what the client says (FIN); the way back
            stays open.
        stall_at: after so many bytes, nothing more is taken on the way `stalled`, while the other goes on.
        seed: of the pieces and pauses.
    """

    piece: int = 1 << 16
    pause: float = 0.0
    reset_at: int | None = None
    finish_at: int | None = None
    stall_at: int | None = None
    stalled: Way = "up"
    seed: int = 0


def draw_fates(seed: int, num: int, longest: int) -> list[Fate]:
    """Some fates, resets and stalls by turns.

    Args:
        seed: of everything in them.
        num: how many.
        longest: bytes that the luckiest sees before its end.
    """
    chance = random.Random(seed)  # noqa: S311 - no secret
    fates = []
    for i in range(num):
        end = chance.randrange(longest)
        piece, pause = chance.choice((1, 7, 1000, 1 << 16)), chance.choice((0.0, 0.0, 0.001))
        if i % 3 == 2:
            way: Way = "up" if chance.random() < 0.5 else "down"
            fates.append(Fate(piece, pause, stall_at=end, stalled=way, seed=seed + i))
        else:
            fates.append(Fate(piece, pause, reset_at=end, seed=seed + i))
    return fates


class BrokenProxy:
    """Listens, and passes on what it gets as the plan has it.

    Attributes:
        port: where clients connect.
        num_connections: there ever were, and `num_ended` those which a fate has reset or stalled.
    """

    def __init__(self, target: int, fates: Iterable[Fate] = ()) -> None:
        """A proxy that does not listen yet.

        Args:
            target: the server's port, on this machine.
            fates: of the connections, in their order.
        """
        self.port = 0
        self.num_connections = self.num_ended = 0
        self._target = target
        self._fates = list(fates)
        self._has_changed = asyncio.Event()
        self._lines: set[asyncio.Task[None]] = set()
        self._server: asyncio.Server | None = None

    @property
    def url(self) -> str:
        return f"ws://127.0.0.1:{self.port}"

    async def __aenter__(self) -> Self:
        self._server = await asyncio.start_server(self._greet, "127.0.0.1", 0)
        self.port = self._server.sockets[0].getsockname()[1]
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        assert self._server is not None
        self._server.close()
        for line in self._lines:
            line.cancel()
        await asyncio.gather(*self._lines, return_exceptions=True)

    @property
    def is_used_up(self) -> bool:
        """Whether a connection has come that has no fate in the plan."""
        return self.num_connections > len(self._fates)

    async def until(self, question: Callable[[], bool]) -> None:
        """Come back once the answer is yes; asked anew after each connection and each end of one."""
        async with asyncio.timeout(PATIENCE):
            while not question():
                self._has_changed.clear()
                await self._has_changed.wait()

    def note_end(self) -> None:
        """A fate has struck."""
        self.num_ended += 1
        self._has_changed.set()

    def _greet(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        fate = self._fates[self.num_connections] if self.num_connections < len(self._fates) else Fate()
        self.num_connections += 1
        self._has_changed.set()
        line = asyncio.get_running_loop().create_task(self._carry(fate, reader, writer))
        self._lines.add(line)
        line.add_done_callback(self._lines.discard)

    async def _carry(self, fate: Fate, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        writers = [writer]
        try:
            server_reader, server_writer = await asyncio.open_connection("127.0.0.1", self._target)
            writers.append(server_writer)
            line = _Line(fate, self)
            ways = [
                asyncio.ensure_future(line.pass_on("up", reader, server_writer)),
                asyncio.ensure_future(line.pass_on("down", server_reader, writer)),
            ]
            try:
                await asyncio.wait(ways, return_when=asyncio.FIRST_COMPLETED)
            finally:
                for way in ways:
                    way.cancel()
                await asyncio.gather(*ways, return_exceptions=True)
        except OSError:
            pass  # nobody listens there: so this end is reset too
        finally:
            for one in writers:
                one.transport.abort()


class _Line:
    """Both ways of one connection."""

    def __init__(self, fate: Fate, proxy: BrokenProxy) -> None:
        self._fate = fate
        self._proxy = proxy
        self._chance = random.Random(fate.seed)  # noqa: S311 - no secret
        self._num_bytes = 0
        self._has_struck = False

    async def pass_on(self, way: Way, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Carry one way until an end leaves or the fate strikes."""
        fate = self._fate
        num_bytes = 0
        try:
            while True:
                if fate.stall_at is not None and way == fate.stalled and self._num_bytes >= fate.stall_at:
                    self._strike()
                    await asyncio.Event().wait()  # until the other way ends
                most = self._chance.randint(1, fate.piece)
                if way == "up" and fate.finish_at is not None:
                    most = min(most, fate.finish_at - num_bytes)
                    if most <= 0:
                        self._strike()
                        writer.write_eof()
                        await asyncio.Event().wait()  # until the server has said all
                if fate.reset_at is not None:
                    most = min(most, fate.reset_at - self._num_bytes)
                if most <= 0:
                    self._strike()
                    return
                data = await reader.read(most)
                if not data:
                    return
                if fate.pause:
                    await asyncio.sleep(self._chance.uniform(0.0, fate.pause))
                num_bytes += len(data)
                self._num_bytes += len(data)
                writer.write(data)
                await writer.drain()
        except OSError:
            return

    def _strike(self) -> None:
        if not self._has_struck:
            self._has_struck = True
            self._proxy.note_end()
