"""A mock within a running server: its node and faults, its second port, and its file, which is read when it changes."""

from __future__ import annotations

import asyncio
import logging
import math
import sys
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from ssl import SSLContext
from typing import Final, cast

from rosbridge_sim.errors import DocumentError, SettingError
from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.peers.peer import Peer
from rosbridge_sim.mock.faults import FaultTable, FaultyClient
from rosbridge_sim.mock.mock_control import MockControl
from rosbridge_sim.mock.mock_node import Hook, MockNode
from rosbridge_sim.mock.mock_plan import MockPlan, plan_mock
from rosbridge_sim.mock.value_patterns import SECOND_NS
from rosbridge_sim.shell.config.settings import Settings
from rosbridge_sim.shell.files.definitions import Texts
from rosbridge_sim.shell.mocking.fault_bus import FaultBus
from rosbridge_sim.shell.mocking.mock_files import DiskMockFiles, read_mock
from rosbridge_sim.shell.websocket.connected_client import Client
from rosbridge_sim.shell.websocket.server import Server

_log = logging.getLogger("rosbridge_sim.mock")

LOOK_PERIOD: Final = 0.5
"""Time between two looks at the file [s]."""

SHOW_PERIOD: Final = 1.0
"""Time between two looks at the faults for `/mock/faults` [s]."""

MAX_TOLD: Final = 20
"""Mistakes of a file that are told at once: a screen of a terminal."""


class MockServer:
    """A mock of a running server.

    Attributes:
        server: the server whose clients are subject to faults.
        control: the server of the second port; None without one.
    """

    def __init__(self, settings: Settings, bus: Bus, texts: Texts, server: Server) -> None:
        """Read the mock's file, and offer what it describes.

        Args:
            server: its clients are subject to faults.

        Raises:
            DocumentError: the file, the hook, or a name cannot be used; a line for each mistake.
        """
        assert settings.mock is not None, "there is a mock"
        assert isinstance(bus, FaultBus), "a mock has a bus with faults"
        self.server = server
        self.control: Server | None = None
        self._path = Path(settings.mock)
        self._settings, self._bus, self._texts = settings, bus, texts
        self._loop = asyncio.get_running_loop()
        self._state = _state_of(self._path)
        plan = self._read()
        self.node = MockNode(bus, None if settings.hook is None else _find_hook(settings.hook))
        self.node.load(plan, self._loop.time())
        bus.faults = self._table(plan)
        bus.now_ns = self.node.now_ns
        bus.find_client = self._find_client
        self._panel = MockControl(bus, self.node, bus.faults)
        self._panel.show(self._loop.time())
        self._watching: asyncio.Task[None] | None = None
        self._show_at = 0.0

    async def start(self, control: Server, certificate: SSLContext | None) -> None:
        """Watch the file, and listen on the second port if the settings say so.

        Args:
            control: the server of the second port.
            certificate: of both; None without TLS.

        Raises:
            SettingError: the port cannot be used.
        """
        port = self._settings.control_port
        if port is not None:
            try:
                await control.start("127.0.0.1", port, certificate)
            except OSError as error:
                raise SettingError(f"control-port: cannot listen on 127.0.0.1 port {port}: {error.strerror}") from None
            self.control = control
            scheme = "ws" if certificate is None else "wss"
            _log.info("faults are switched at %s://127.0.0.1:%d, which no fault touches", scheme, control.port)
        self._watching = self._loop.create_task(self._watch())

    async def stop(self) -> None:
        """Stop watching the file, and close the second port."""
        if self._watching is not None:
            self._watching.cancel()
        if self.control is not None:
            await self.control.stop()

    def _find_client(self, owner: Peer) -> FaultyClient | None:
        return next((_faulty(client) for client in self.server.clients if client.peer is owner), None)

    # The file

    def _read(self) -> MockPlan:
        """Return the plan of the file.

        Raises:
            DocumentError: it has mistakes, a line for each.
        """
        files = DiskMockFiles(self._path.parent, self._texts)
        seed = self._settings.seed
        plan, mistakes = plan_mock(read_mock(self._path), self._bus.store, files, _tell, seed=seed)
        if plan is None:
            more = (
                [f"{self._path.name}: {len(mistakes) - MAX_TOLD:,} more mistakes"] if len(mistakes) > MAX_TOLD else []
            )
            raise DocumentError("\n".join([*(mistake.text for mistake in mistakes[:MAX_TOLD]), *more]))
        return plan

    def _table(self, plan: MockPlan) -> FaultTable:
        return FaultTable(plan.document.faults, plan.document.seed + (self._settings.seed << 32))

    async def _watch(self) -> None:
        """Read the file anew when it changes; after a mistake all goes on as before."""
        while True:
            await asyncio.sleep(LOOK_PERIOD)
            state = _state_of(self._path)
            if state == self._state or state is None:
                continue
            self._state = state
            try:
                plan = await asyncio.to_thread(self._read)
                self.node.load(plan, self._loop.time())
            except DocumentError as error:
                for line in str(error).splitlines():
                    _log.error("%s", line)
                _log.error("%s has changed, but has mistakes: the mock goes on as it was", self._path)
            except Exception:  # noqa: BLE001 - an internal error; the mock goes on
                _log.exception("internal error: %s was not read anew", self._path)
            else:
                self._panel.faults = self._bus.faults = self._table(plan)
                self._panel.show(self._loop.time())
                _log.info("%s has changed: the mock begins anew", self._path)

    # Faults that close connections, as a clock of the scheduler

    def next_due(self, now: float) -> float | None:
        """Return when connections are closed, or the faults may have changed [s]."""
        if not self._bus.faults.rules:
            return None
        close_ns = self._bus.faults.next_close()
        close = math.inf if close_ns == math.inf else now + (close_ns - self.node.now_ns(now)) / SECOND_NS
        return min(close, self._show_at)

    def advance(self, now: float) -> None:
        """Close connections, and show the faults, if it is time."""
        now_ns = self.node.now_ns(now)
        for rule in self._bus.faults.rules.values():
            if rule.close(now_ns):
                rule.count += 1
                clients = [client for client in self.server.clients if rule.concerns(_faulty(client))]
                _log.info("the fault %s closes %d connections", rule.name, len(clients))
                for client in clients:
                    client.cut(rule.fault.code, rule.fault.text)
        if now >= self._show_at:
            self._show_at = now + SHOW_PERIOD
            self._panel.show(now)

    def end(self, error: Exception) -> None:
        """End, because it has failed; the server goes on without faults."""
        _log.error("internal error: the faults of the mock have ended", exc_info=error)
        self._bus.faults = FaultTable({}, 0)


def _faulty(client: Client) -> FaultyClient:
    return FaultyClient(client.number, client.peer.address)


def _tell(text: str) -> None:
    _log.warning("%s; the value is 0", text)


def _state_of(path: Path) -> tuple[int, int, int] | None:
    """Return what tells whether a file has changed; None while it is not there, as when an editor replaces it."""
    try:
        found = path.stat()
    except OSError:
        return None
    return found.st_mtime_ns, found.st_size, found.st_ino


def _find_hook(place: str) -> Hook:
    """Return the function of a hook. Its module is looked for in the present folder, too.

    Raises:
        SettingError: there is none.
    """
    name, _, function = place.partition(":")
    sys.path.insert(0, str(Path.cwd()))
    try:
        found: Callable[..., object] = getattr(import_module(name), function)
    except Exception as error:  # noqa: BLE001 - a module of the user
        raise SettingError(f"hook: expected MODULE:FUNCTION, got {place!r}: {error}") from None
    finally:
        sys.path.pop(0)
    if not callable(found):
        raise SettingError(f"hook: expected a function, but {place} is {type(found).__name__}")
    return cast("Hook", found)
