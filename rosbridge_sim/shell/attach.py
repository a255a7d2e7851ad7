"""Connections to another rosbridge, opened again after each loss.

An `Attachment` is one bridge. `graph/attach/mirror.py` decides what is sent there; this module has the sockets. A task
for each connection that the mirror wants dials, moves frames in both directions until the socket ends, waits, and dials
again. The wait (back-off) doubles from half a second up to a limit. It is short again after a connection that announced
everything and lasted for a while.
Frames are sent only as fast as the socket accepts them and as the remote bridge handles them
(`graph/attach/flow_control.py`).
"""

from __future__ import annotations

import asyncio
import errno
import ipaddress
import logging
import math
from collections.abc import Callable, Sequence
from urllib.parse import urlsplit

from websockets.asyncio.client import connect
from websockets.exceptions import WebSocketException

from rosbridge_sim.graph.attach.connection import PROBE, BridgeConnection, Values
from rosbridge_sim.graph.attach.mirror import Mirror
from rosbridge_sim.graph.attach.mirror_registry import MirrorChoices
from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.participant import Participant
from rosbridge_sim.link.client_connection import DialedConnection, why_gone, why_not
from rosbridge_sim.link.library_log import quiet
from rosbridge_sim.link.urls import port_of, shown_url
from rosbridge_sim.shell.websocket.dns import HostLookup, is_own

FIRST_WAIT = 0.5
"""Wait after the first failed attempt, or after a good connection [s]."""

HELD = 2.0
"""A connection that lasts at least this long counts as good [s]; a shorter one may fail each time."""

STOP_PATIENCE = 5.0
"""Longest wait for the answer to the handshake [s]."""

LAST_WORD = 0.5
"""Longest time for telling the remote bridge that everything ends [s]."""

CLOSE_TIMEOUT = 1.0
"""Longest wait for the closing handshake [s]."""

ATTACH_WRITE_SIZE = 8 * 1024
"""Bytes that are sent between two checks of the flow control."""

_log = logging.getLogger("rosbridge_sim.attach")


class AttachChoices(MirrorChoices):
    """Options of the connections to remote bridges, beside those of the mirror.

    Attributes:
        max_wait: longest wait between two attempts [s].
        ping_interval, ping_timeout: check for half-open connections [s]; None turns it off.
    """

    max_wait: float = 10.0
    ping_interval: float | None = 20.0
    ping_timeout: float | None = 20.0


class Attachment:
    """One bridge that we dial, with the mirror of our simulator there.

    Attributes:
        url: URL of the bridge without secrets, for people.
        mirror: the participant of our bus that represents the far side.
        attached: done when everything was announced there for the first time.
        connected_at: when the first connection got its present or last socket [s].
        lookup: resolves the host name, for all connections.
        full_url: the same with secrets, to dial.
        choices: options of all connections.
        on_change: called when the world or the mirror may have work earlier than planned.
        num_bugs: number of frames whose handling failed by an internal error; each is in the log with its traceback.
            Errors counted by the bus's guard are not included.
    """

    def __init__(
        self, bus: Bus, source: Participant, url: str, choices: AttachChoices, on_change: Callable[[], None]
    ) -> None:
        """Prepare the attachment; `start` connects.

        Args:
            source: the simulator.
            url: URL of the bridge.
            on_change: called when the world or the mirror may have work earlier than planned.
        """
        self.url = shown_url(url)
        self.num_bugs = 0
        self.attached: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        self.mirror = Mirror(bus, source, self.url, choices)
        self.lookup = HostLookup(urlsplit(url).hostname or "")
        self.connected_at = math.inf
        self._guard = bus.guard
        self.full_url = url
        self.choices = choices
        self.on_change = on_change
        self._carriers: dict[BridgeConnection, _ConnectionKeeper] = {}

    def start(self) -> None:
        """Start to dial; attempts go on for ever."""
        self.mirror.on_attached = self._note_attached
        self.mirror.on_connections_changed = self._look
        self.mirror.on_failure = self._fail
        self._look()

    async def stop(self) -> None:
        """Tell the remote bridge that everything ends, and close. A second call does nothing.

        It takes at most LAST_WORD + CLOSE_TIMEOUT.
        """
        self.mirror.on_connections_changed = lambda: None
        carriers, self._carriers = list(self._carriers.values()), {}
        if carriers:
            self.mirror.leave(asyncio.get_running_loop().time())
            await asyncio.gather(*(carrier.stop() for carrier in carriers))
        if not self.attached.done():
            self.attached.cancel()

    def _fail(self, error: Exception) -> None:
        """Connect again after an internal error in work for the bridge."""
        _log.error("%s: internal error; connecting again", self.url, exc_info=error)
        for carrier in self._carriers.values():
            carrier.cut()

    def contain(self, act: Callable[[], None]) -> None:
        """Call a function that concerns only this bridge. If it fails, the connections are opened again."""
        try:
            act()
        except Exception as error:  # noqa: BLE001 - an internal error
            self._guard.blame(self.mirror, error)

    def _note_attached(self) -> None:
        if not self.attached.done():
            self.attached.set_result(None)

    def _look(self) -> None:
        """Start a keeper for each new connection."""
        wanted = dict.fromkeys(self.mirror.connections.values())
        for line in [line for line in self._carriers if line not in wanted]:
            self._carriers.pop(line).let_go()
        for line in wanted:
            if line not in self._carriers:
                self._carriers[line] = _ConnectionKeeper(self, line)


class _ConnectionKeeper:
    """Keeps one connection open, and moves its frames."""

    def __init__(self, attachment: Attachment, line: BridgeConnection) -> None:
        self._attachment = attachment
        self._mirror = attachment.mirror
        self._line = line
        self._loop = asyncio.get_running_loop()
        self._socket: DialedConnection | None = None
        self._is_woken = False
        self._is_going_on = False
        self._is_reading = True
        self._is_stopped = False
        line.on_released = self._schedule
        self._lost_at: float | None = None
        self._task = self._loop.create_task(self._keep())

    async def stop(self) -> None:
        """Let the far side handle everything that was sent, close, and stop dialling."""
        self._is_stopped = True
        dialed = self._socket
        if dialed is not None:
            await self._settle()
            try:
                async with asyncio.timeout(CLOSE_TIMEOUT):
                    await dialed.close()
            except TimeoutError:  # the far side does not read
                dialed.transport.abort()
        self._task.cancel()
        await asyncio.wait([self._task])

    async def _settle(self) -> None:
        """Wait a moment for an answer, because rosbridge_suite drops unhandled frames when a socket closes."""
        heard: asyncio.Future[None] = self._loop.create_future()

        def note(_values: Values | None, _now: float) -> None:
            if not heard.done():
                heard.set_result(None)

        self._line.ask(PROBE, note, self._loop.time())
        self._carry()
        await asyncio.wait([heard, self._task], timeout=LAST_WORD, return_when=asyncio.FIRST_COMPLETED)
        heard.cancel()

    def cut(self) -> None:
        """End the connection at once; a new one is opened."""
        if self._socket is not None:
            self._socket.transport.abort()

    def let_go(self) -> None:
        """Call `stop` in a task, because the connection is not wanted any more."""
        self._closing = self._loop.create_task(self.stop())

    async def _keep(self) -> None:
        wait = FIRST_WAIT
        self._tell(logging.INFO, f"{self._attachment.url}: dialling")
        while not self._is_stopped:
            began = self._loop.time()
            try:
                was_ready, why = await self._connect_once()
            except Exception:  # noqa: BLE001 - an internal error: this connection is lost, and a new one follows
                self._attachment.num_bugs += 1
                _log.exception("internal error in a connection to %s; it was closed", self._attachment.url)
                was_ready, why = False, f"{self._attachment.url}: lost"
            if self._is_stopped:
                return
            if was_ready:
                self._lost_at = self._loop.time()
            if was_ready and self._loop.time() - began > HELD:
                wait = FIRST_WAIT
            # if all connections are lost, the first one's line in the log is enough
            self._tell(
                logging.INFO if was_ready and self._line.name else logging.WARNING, f"{why}; next try in {wait:g} s"
            )
            await asyncio.sleep(wait)
            wait = min(2 * wait, self._attachment.choices.max_wait)

    async def _connect_once(self) -> tuple[bool, str]:
        """Run one connection from start to end; return if all was announced on it, and why it ended."""
        url = self._attachment.full_url
        try:
            dialed = await self._dial()
        except (OSError, ValueError, WebSocketException) as error:
            return False, why_not(url, error, STOP_PATIENCE, flag="attach", token="?token=... in its URL")  # noqa: S106
        self._tell_connected()
        self._socket = dialed
        self._is_reading = True
        dialed.on_room = self._carry
        try:
            self._mirror.connected(self._line, self._wake, self._carry, self._loop.time())
            dialed.listen(self._receive)
            self._attachment.on_change()
            await dialed.wait_closed()
        finally:
            was_ready = self._line.is_ready
            self._socket = None
            self._mirror.lost(self._line, self._loop.time())
            self._attachment.on_change()
            dialed.transport.abort()
        return was_ready, why_gone(url, dialed.end)

    async def _dial(self) -> DialedConnection:
        """Return a connection to the first address of the host that accepts one.

        Raises:
            OSError: no address accepts a connection.
            ValueError: the URL is not valid.
            WebSocketException: the program there is not a WebSocket server.
        """
        choices = self._attachment.choices
        addresses = await self._attachment.lookup.addresses(STOP_PATIENCE)
        for address in addresses:
            try:
                dialed = await connect(
                    self._attachment.full_url,
                    host=address,
                    port=port_of(self._attachment.full_url),
                    create_connection=DialedConnection,
                    compression=None,
                    open_timeout=STOP_PATIENCE,
                    close_timeout=CLOSE_TIMEOUT,
                    ping_interval=choices.ping_interval,
                    ping_timeout=choices.ping_timeout,
                    max_size=choices.max_frame_size,
                    proxy=None,  # proxies from the environment are for web pages; a rosbridge is a local machine
                    logger=quiet,
                )
            except OSError:
                if address == addresses[-1]:
                    raise
            else:
                assert isinstance(dialed, DialedConnection)
                return dialed
        raise OSError(errno.EADDRNOTAVAIL, "the host has no address")

    def _tell(self, level: int, text: str) -> None:
        """Log an event of the first connection. Events of the others are logged only if they differ from it."""
        if not self._line.name:
            _log.log(level, "%s", text)
        elif level >= logging.WARNING and self._mirror.connections[""].is_ready:
            text = text.removeprefix(f"{self._attachment.url}: ")
            self._mirror.note(level, f"the socket of {self._line.name}: {text}", self._loop.time())

    def _tell_connected(self) -> None:
        """Log that there is a socket; for other connections than the first, only if they alone had lost theirs."""
        lost_at, self._lost_at = self._lost_at, None
        if not self._line.name:
            self._attachment.connected_at = self._loop.time()
            self._tell(logging.INFO, f"{self._attachment.url}: connected")
        elif lost_at is not None and self._attachment.connected_at < lost_at and self._mirror.connections[""].is_open:
            text = f"the socket of {self._line.name} was lost and made again"
            self._mirror.note(logging.INFO, text, self._loop.time())

    def _receive(self, message: bytes) -> None:
        self._handle(lambda now: self._mirror.receive(self._line, message, now))

    def _schedule(self) -> None:
        """Handle the waiting frames in the next turn."""
        if not self._is_going_on:
            self._is_going_on = True
            self._loop.call_soon(self._go_on)

    def _go_on(self) -> None:
        self._is_going_on = False
        self._handle(lambda now: self._mirror.go_on(self._line, now))

    def _handle(self, work: Callable[[float], bool]) -> None:
        """Do one turn of work on received frames; stop reading while too much waits."""
        try:
            is_more = work(self._loop.time())
        except Exception:  # noqa: BLE001 - an internal error: this message is lost, everything else goes on
            self._attachment.num_bugs += 1
            _log.exception("internal error in a frame of %s; the frame was dropped", self._attachment.url)
            is_more = True
        if is_more:
            self._schedule()
        dialed = self._socket
        if dialed is not None and self._is_reading is self._line.is_full:
            self._is_reading = not self._is_reading
            if self._is_reading:
                dialed.transport.resume_reading()
            else:
                dialed.transport.pause_reading()
        self._attachment.on_change()

    def _wake(self) -> None:
        if not self._is_woken:
            self._is_woken = True
            self._loop.call_soon(self._carry)

    def _carry(self) -> None:
        """Give waiting frames to the transport, as long as it accepts them and the flow control allows."""
        self._attachment.contain(self._carry_on)

    def _carry_on(self) -> None:
        self._is_woken = False
        dialed, line = self._socket, self._line
        if dialed is None:
            return
        due = line.flow_control.due
        while dialed.has_room:
            frames = line.take(ATTACH_WRITE_SIZE, self._loop.time())
            if not frames:
                break
            dialed.send_messages(frames)
        if line.flow_control.due != due:  # a probe was sent, and its time-out must be checked
            self._attachment.on_change()
        if line.outbox.is_overfull:
            _log.warning(
                "%s: the bridge reads too slowly, %d bytes wait for it: closing",
                self._attachment.url,
                line.outbox.num_bytes,
            )
            line.outbox.close()
            dialed.transport.abort()


# Our own address


async def is_own_address(url: str, port: int, addresses: Sequence[str]) -> bool:
    """Return True if a URL leads to this server.

    Args:
        url: URL to dial.
    """
    if port_of(url) != port:
        return False
    try:
        found = await HostLookup(urlsplit(url).hostname or "").addresses(STOP_PATIENCE)
    except (OSError, UnicodeError):
        return False
    ours = {ipaddress.ip_address(address) for address in addresses}
    is_everywhere = any(address.is_unspecified for address in ours)
    for text in found:
        address = ipaddress.ip_address(text.partition("%")[0])
        if address.version == 6 and address.ipv4_mapped is not None:  # noqa: PLR2004 - IP's version
            address = address.ipv4_mapped  # the system connects to this address
        # 0.0.0.0 cannot be dialled: the system uses loopback instead
        if address in ours or (address.is_unspecified and any(one.is_loopback or one.is_unspecified for one in ours)):
            return True
        if is_everywhere and is_own(str(address)):
            return True
    return False
