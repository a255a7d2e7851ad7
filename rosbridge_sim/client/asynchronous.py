"""The asyncio client. The blocking client is built on it.

One task reads the socket as long as the connection is open. It gives answers to their calls and messages to their
subscriptions. So pings are answered while the program does something else, and several tasks may share one client.
"""

from __future__ import annotations

import asyncio
import base64
import itertools
import logging
import math
import ssl
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from types import TracebackType
from typing import Any, ClassVar, Final, Literal, Self, Unpack

import orjson
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed, InvalidStatus, InvalidURI, WebSocketException

from rosbridge_sim.client.frames import MAX_SIZE, Frame, FrameReader, Inbox, absolute
from rosbridge_sim.client.objects import (
    ObjectChange,
    ObjectOptions,
    RoadPoint,
    change_request,
    place_request,
    spawn_request,
)
from rosbridge_sim.errors import (
    AnswerTimeoutError,
    ClientError,
    ConnectError,
    ConnectionLostError,
    FrameError,
    OpRefusedError,
    ServiceRefusedError,
)
from rosbridge_sim.shell.terminal_text import safe
from rosbridge_sim.shell.websocket.client_connection import why_gone, why_not
from rosbridge_sim.shell.websocket.library_log import quiet
from rosbridge_sim.shell.websocket.urls import DEFAULT_PORT, full_url, shown_url

__all__ = [
    "DEFAULT_URL",
    "AsyncClient",
    "AsyncSubscription",
    "Command",
    "RealTimeFactor",
    "Snapshot",
    "Status",
    "Steps",
    "StopCondition",
    "Tick",
]

DEFAULT_URL = f"ws://127.0.0.1:{DEFAULT_PORT}"
"""URL of a server on this machine that was started without flags."""

DEFAULT_TIMEOUT = 5.0
"""Default of the longest wait for an answer [s]: the same as rosbridge_suite's time-out of a call."""

DEFAULT_KEEP = 1_000
"""Default number of messages that a subscription keeps until they are taken: 20 s of a topic at 50 Hz."""

DEFAULT_USER_ID = "rosbridge_sim.client"
"""Default name of the client as master of synchronous mode."""

CLOSE_TIMEOUT = 1.0
"""Longest wait for the other side to confirm that the connection closes [s]."""

MAX_STATUSES = 100
"""Number of status messages that are kept; the oldest are dropped first. A person reads fewer."""

FRAME_MS = 20
"""Simulated time of one frame [ms]; a tick is a multiple of it."""

_FINAL_STATUSES = (401, 403)
"""HTTP statuses after which a new attempt is useless: the token is wrong, or the server rejects this client."""

_log = logging.getLogger("rosbridge_sim.client")

Predicate = Callable[[Frame], object]
"""A function that takes a message and returns a true value if it is the wanted one."""

Command = Mapping[str, object]
"""The fields of a `morai_msgs/CtrlCmd` by name; those that are left out are 0."""

StopCondition = Literal["collision", "red_light", "off_road"]
"""An event of an ego that ends a call of `step`."""

_STOP_FIELDS: Final[Mapping[StopCondition, str]] = {
    "collision": "stop_on_collision",
    "red_light": "stop_on_red_light",
    "off_road": "stop_off_road",
}

StatusLevel = Literal["info", "warning", "error", "none"]
"""Lowest level of the status messages that the server sends."""


@dataclass(frozen=True, slots=True)
class Status:
    """A status message of the server, from a `status` frame.

    Attributes:
        level: `info`, `warning` or `error`.
        text: the message.
        op_id: id of the op that the message is about; None if the server does not name one.
    """

    level: str
    text: str
    op_id: str | None


@dataclass(frozen=True, slots=True)
class Tick:
    """The simulation after a tick of synchronous mode.

    Attributes:
        frame: number of the frame.
        time: simulated time [s].
        ego: a `morai_msgs/EgoVehicleStatus`: position [m, ENU], heading [deg], velocity in the car's frame [m/s].
    """

    frame: int
    time: float
    ego: Frame


@dataclass(frozen=True, slots=True)
class Steps:
    """The simulation after a call of `step`.

    Attributes:
        frame: number of the frame.
        steps: ticks that were carried out.
        stopped_by: the condition that ended the call: `collision`, `red_light`, `off_road`, `distance` or `place`;
            empty if all ticks were carried out.
        egos: a `morai_msgs/EgoVehicleStatus` of each ego, in the order of their numbers.
        topics: last message of each topic that was asked for; None where there was none.
    """

    frame: int
    steps: int
    stopped_by: str
    egos: list[Frame]
    topics: dict[str, Frame | None]

    @property
    def ego(self) -> Frame:
        """The first ego."""
        return self.egos[0] if self.egos else {}


@dataclass(frozen=True, slots=True)
class RealTimeFactor:
    """How fast the world runs while real time moves it.

    Attributes:
        factor: simulated seconds in a second; 0 for as fast as possible.
        measured: the same, as reached over the last seconds; 0 while real time does not move the world.
    """

    factor: float
    measured: float


@dataclass(frozen=True, slots=True)
class Snapshot:
    """A saved state of the simulator.

    Attributes:
        name: under which the server keeps it.
        frame: of the state that was saved.
        size: memory that it takes in the server [bytes].
        state_hash: of that state.
        data: all of it, for another process; empty if it was not asked for.
    """

    name: str
    frame: int
    size: int
    state_hash: str
    data: bytes = field(default=b"", repr=False)


@dataclass(slots=True)
class _SyncMode:
    """Settings of synchronous mode while this client is its master."""

    user_id: str
    step_ms: int
    frame: int
    is_member: bool = False  # of a barrier, in place of the master


class AsyncClient:
    """A connection to a rosbridge, for the tasks of one event loop.

        async with AsyncClient("ws://127.0.0.1:9090") as client:
            spec = await client.ask("/Service_MoraiVehicleSpec", unique_id=0)

    The client does not reconnect by itself: after `ConnectionLostError`, create a new one. Each method that waits takes
    `timeout` in seconds. None means the client's own `timeout`, and `math.inf` means no limit.

    Attributes:
        url: URL of the server.
        timeout: default of the longest wait for an answer or a message [s].
        statuses: latest status messages of the server, oldest first. They are also written to the log
            `rosbridge_sim.client`.
    """

    url_name: ClassVar[str] = "url"
    """Name of the URL's argument, for error texts."""

    token_name: ClassVar[str] = "token"  # noqa: S105 - a name, and no secret
    """Name of the token's argument, for error texts."""

    def __init__(
        self,
        url: str = DEFAULT_URL,
        *,
        token: str | None = None,
        timeout: float = DEFAULT_TIMEOUT,
        tls: ssl.SSLContext | None = None,
        status_level: StatusLevel | None = "warning",
    ) -> None:
        """Prepare a client; `open` or `async with` connects it.

        Args:
            url: `ws://HOST:PORT` or `wss://HOST:PORT`; `HOST` and `HOST:PORT` are accepted, too.
            token: the token that the server was started with (`--token`); None sends none.
            timeout: longest wait for an answer or a message [s].
            tls: certificates to trust for `wss://`; None trusts those of the system.
            status_level: lowest level of the status messages that the server is asked for; None keeps the server's
                default.
        """
        self.url = full_url(url)
        self.timeout = timeout
        self.statuses: deque[Status] = deque(maxlen=MAX_STATUSES)
        self._token = token
        self._tls = tls
        self._status_level = status_level
        self._connection: ClientConnection | None = None
        self._reading: asyncio.Task[None] | None = None
        self._lost: ConnectionLostError | None = None
        self._numbers = itertools.count(1)
        self._calls: dict[str, asyncio.Future[Frame]] = {}
        self._subscriptions: dict[str, list[AsyncSubscription]] = {}
        self._others: Inbox | None = None
        self._advertised: set[tuple[str, str]] = set()
        self._refusals: dict[str, Status] = {}  # errors not raised yet, by the ids of their ops
        self._num_statuses = 0
        self._sync: _SyncMode | None = None
        self._ticking = asyncio.Lock()

    def __repr__(self) -> str:
        """Return the URL without a token, and the state."""
        state = "connected" if self.is_connected else "not connected"
        return f"<{type(self).__name__} {shown_url(self.url)} {state}>"

    # The connection

    @property
    def is_connected(self) -> bool:
        """True while the connection is open, as far as this side knows."""
        return self._connection is not None and self._lost is None

    async def __aenter__(self) -> Self:
        """Connect."""
        return await self.open()

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Disconnect."""
        await self.close()

    async def open(self) -> Self:
        """Connect to the server; return the client itself. A client connects only once.

        Returns:
            The client itself.

        Raises:
            ConnectError: the connection cannot be made; the text says why.
        """
        if self._connection is not None:
            raise ClientError(f"{self!r}: expected a client that was never opened; make another one")
        headers = {} if not self._token else {"Authorization": f"Bearer {self._check_token(self._token)}"}
        if self._tls is not None and not self.url.startswith("wss://"):
            raise ConnectError(f"tls: expected a URL with wss://; got {shown_url(self.url)!r}", is_final=True)
        more: dict[str, Any] = {} if self._tls is None else {"ssl": self._tls}  # Any: arguments of the library
        try:
            self._connection = await connect(
                self.url,
                additional_headers=headers,
                compression=None,
                open_timeout=self._limit(None),
                close_timeout=CLOSE_TIMEOUT,
                ping_interval=None,  # a busy server does not answer pings, and this is not a fault
                max_size=MAX_SIZE,
                proxy=None,  # proxies from the environment are for web pages
                logger=quiet,
                **more,
            )
        except (OSError, ValueError, WebSocketException) as error:
            raise self._why_not(error) from error
        self._reading = asyncio.create_task(self._read(self._connection))
        if self._status_level is not None:
            await self.send("set_level", level=self._status_level)
        return self

    def _check_token(self, token: str) -> str:
        if not token.isascii() or not token.isprintable() or " " in token:
            raise ConnectError(f"{self.token_name}: expected printable ASCII without blanks", is_final=True)
        return token

    @property
    def _secrets(self) -> tuple[str, ...]:
        return (self._token,) if self._token else ()

    def _why_not(self, error: Exception) -> ConnectError:
        text = why_not(self.url, error, self.timeout, flag=self.url_name, token=self.token_name, secrets=self._secrets)
        status = error.response.status_code if isinstance(error, InvalidStatus) else None
        is_no_url = isinstance(error, (InvalidURI, ValueError)) and not isinstance(error, (UnicodeError, ssl.SSLError))
        return ConnectError(text, status=status, is_final=is_no_url or status in _FINAL_STATUSES)

    async def close(self) -> None:
        """Disconnect; the server then releases what it held for this client. A second call does nothing."""
        if self._connection is None or self._reading is None:
            return
        self._end(ConnectionLostError(f"{shown_url(self.url)}: this client was closed"))
        if not self._reading.done():  # else it is lost, and the library's `close` fails
            await self._connection.close()
            await asyncio.wait({self._reading})

    def _end(self, error: ConnectionLostError) -> None:
        """End all waits: no more frames come."""
        if self._lost is not None:
            return
        self._lost = error
        for future in list(self._calls.values()):
            if not future.done():
                future.set_exception(error)
                future.exception()  # no warning about a call that was given up
        for inbox in [one.inbox for some in self._subscriptions.values() for one in some]:
            inbox.end(error)
        if self._others is not None:
            self._others.end(error)

    # Frames

    async def send(self, op: str, **fields: object) -> str:
        """Send any op of the rosbridge protocol.

        Args:
            op: name of the op, such as `advertise`.
            fields: fields of the op.

        Returns:
            The `id` of the op: the given one, or a new one.

        Raises:
            ConnectionLostError: there is no connection.
            TypeError: a value cannot be written as JSON.
        """
        op_id = f"{op}:{next(self._numbers)}"
        await self._send(op_id, op, fields)
        return op_id

    async def _send(self, op_id: str, op: str, fields: Mapping[str, object]) -> None:
        text = orjson.dumps({"op": op, "id": op_id, **fields}, option=orjson.OPT_SERIALIZE_NUMPY).decode()
        connection = self._connection
        if connection is None:
            raise ConnectionLostError(f"{shown_url(self.url)}: not connected yet; use `with`, or call open() first")
        if self._lost is not None:
            raise self._lost
        try:
            await connection.send(text)
        except ConnectionClosed as closed:
            raise ConnectionLostError(why_gone(self.url, closed, self._secrets)) from None

    def collect_others(self) -> Inbox:
        """Return an inbox for all later frames that belong to no call and no subscription."""
        self._others = self._others or Inbox()
        return self._others

    def note(self, text: str) -> None:
        """Log a warning about input that cannot be used.

        Args:
            text: what came, and why it is not usable.
        """
        _log.warning("%s: %s", shown_url(self.url), text)

    async def _read(self, connection: ClientConnection) -> None:
        reader = FrameReader()
        now = asyncio.get_running_loop().time
        try:
            while True:
                data = await connection.recv()
                try:
                    frame = reader.read(data, now())
                except FrameError as error:
                    self.note(f"a fragment that cannot be used: {error}")
                else:
                    if frame is not None:
                        self._take(frame)
        except ConnectionClosed as closed:
            self._end(ConnectionLostError(why_gone(self.url, closed, self._secrets)))
        finally:  # after an internal error, too: no caller may wait for ever
            self._end(ConnectionLostError(f"{shown_url(self.url)}: the client has stopped reading"))

    def _take(self, frame: Frame) -> None:
        """Give a frame to the call or the subscription that waits for it."""
        op = frame.get("op")
        if op == "service_response":
            future = self._calls.get(str(frame.get("id")))
            if future is not None and not future.done():
                future.set_result(frame)
                return
        elif op == "publish":
            listeners = self._subscriptions.get(absolute(str(frame.get("topic"))), [])
            msg = frame.get("msg")
            for listener in listeners:
                listener.inbox.put(msg if isinstance(msg, dict) else {})
            if listeners:
                return
        elif op == "status" and self._others is None:
            self._note_status(frame)
        if self._others is not None:
            self._others.put(frame)

    def _note_status(self, frame: Frame) -> None:
        op_id = frame.get("id")
        status = Status(str(frame.get("level")), str(frame.get("msg")), None if op_id is None else str(op_id))
        self.statuses.append(status)
        self._num_statuses += 1
        op_name = (status.op_id or "").partition(":")[0]
        if status.level == "error" and op_name != "call_service" and len(self._refusals) < MAX_STATUSES:
            self._refusals.setdefault(status.op_id or f"status:{self._num_statuses}", status)
        if status.level in {"warning", "error"}:
            _log.warning("%s says: %s: %s", shown_url(self.url), safe(status.level), safe(status.text))

    def _limit(self, timeout: float | None) -> float | None:
        """Return the longest wait [s]; None means no limit."""
        limit = self.timeout if timeout is None else timeout
        return None if math.isinf(limit) else limit

    def _until(self, timeout: float | None) -> float | None:
        limit = self._limit(timeout)
        return None if limit is None else asyncio.get_running_loop().time() + limit

    # Services

    async def begin_call(
        self, service: str, args: object = None, *, server_timeout: float | None = None
    ) -> asyncio.Future[Frame]:
        """Send a call without waiting for its answer, so that many calls can run at once.

        Args:
            service: name of the service.
            args: the request, by field names or, as a list, by position.
            server_timeout: time after which the server gives up [s]; 0 means never, None means the server's default.

        Returns:
            A future of the `service_response` frame. Cancel it to wait no longer.

        Raises:
            ConnectionLostError: there is no connection.
        """
        call_id = f"call_service:{next(self._numbers)}"
        future: asyncio.Future[Frame] = asyncio.get_running_loop().create_future()
        self._calls[call_id] = future
        future.add_done_callback(lambda _: self._calls.pop(call_id, None))
        fields: dict[str, object] = {"service": service, "args": {} if args is None else args}
        if server_timeout is not None:
            fields["timeout"] = server_timeout
        try:
            await self._send(call_id, "call_service", fields)
        except BaseException:
            self._calls.pop(call_id, None)
            raise
        return future

    async def call(self, service: str, args: object = None, *, timeout: float | None = None) -> Frame:
        """Call any service and return its values.

        Args:
            service: name of the service.
            args: the request, by field names or, as a list, by position.
            timeout: longest wait [s].

        Returns:
            The `values` of the answer.

        Raises:
            ServiceRefusedError: the service failed or does not exist; the error has the reason.
            AnswerTimeoutError: no answer in time.
            ConnectionLostError: the connection has ended.
        """
        future = await self.begin_call(service, args)
        limit = self._limit(timeout)
        try:
            async with asyncio.timeout(limit):
                frame = await future
        except TimeoutError:
            raise AnswerTimeoutError(f"{service}: no answer within {limit:g} s") from None
        values = frame.get("values", {})
        if frame.get("result", True) is False:
            raise ServiceRefusedError(service, values if isinstance(values, str) else "", values)
        return values if isinstance(values, dict) else {}

    async def ask(self, service: str, /, *, timeout: float | None = None, **request: object) -> Frame:
        """Call a service of the simulator and return its `response`.

        Services of `morai_msgs` have one field `request` and one field `response`, each with a message. This method
        adds and removes these fields. For other services use `call`.

        Args:
            service: name of the service.
            timeout: longest wait [s].
            request: fields of the request; a field that is left out is 0.

        Returns:
            The message in the field `response`.

        Raises:
            ServiceRefusedError: the service failed or does not exist; the error has the reason.
            AnswerTimeoutError: no answer in time.
            ConnectionLostError: the connection has ended.
        """
        values = await self.call(service, {"request": request}, timeout=timeout)
        response = values.get("response")
        if not isinstance(response, dict):
            raise ServiceRefusedError(service, "the answer has no `response`; use call()", values)
        return response

    # Topics

    async def publish(self, topic: str, msg: Mapping[str, object], type_name: str | None = None) -> None:
        """Publish a message. The server reports a mistake later: use `confirm` to wait for that.

        Args:
            topic: name of the topic.
            msg: fields by name; a field that is left out is 0.
            type_name: type of the message, as `pkg/Type`. A new topic needs it once.

        Raises:
            ConnectionLostError: there is no connection.
        """
        if type_name is not None and (topic, type_name) not in self._advertised:
            await self.send("advertise", topic=topic, type=type_name)
            self._advertised.add((topic, type_name))
        await self.send("publish", topic=topic, msg=msg)

    async def confirm(self, *, timeout: float | None = None) -> None:
        """Wait until the server has handled everything that was sent before.

        Args:
            timeout: longest wait [s].

        Raises:
            OpRefusedError: the server refused an op since the last call of this method.
            AnswerTimeoutError: no answer in time.
            ConnectionLostError: the connection has ended.
        """
        await self._settle(timeout)
        refusals, self._refusals = self._refusals, {}
        if refusals:
            raise OpRefusedError("; ".join(status.text for status in refusals.values()))

    async def _settle(self, timeout: float | None) -> None:
        """Make a harmless call. The server handles frames in order, so its answer comes after all earlier ones."""
        with suppress(ServiceRefusedError):  # a refusal is also an answer: the server has no rosapi
            await self.call("/rosapi/get_time", timeout=timeout)

    async def subscribe(
        self, topic: str, type_name: str | None = None, *, throttle_ms: int = 0, keep: int = DEFAULT_KEEP
    ) -> AsyncSubscription:
        """Subscribe to a topic; return when the server has done it.

        The last message of a latched topic comes at once. A second subscription to this topic repeats that message for
        the first one, because a message does not name its subscription.

        Args:
            topic: name of the topic.
            type_name: type of its messages. None means the type of the topic, which must exist then.
            throttle_ms: shortest time between two messages [ms].
            keep: messages to keep until they are taken; if more come, the oldest are dropped first.

        Returns:
            The subscription; iterate over it, or call its `next`.

        Raises:
            ValueError: `keep` is less than 1.
            OpRefusedError: there is no such topic, or it has another type.
            AnswerTimeoutError: no answer in time.
            ConnectionLostError: the connection has ended.
        """
        if keep < 1:
            raise ValueError(f"keep: expected a number from 1 on; got {keep}")
        subscription = AsyncSubscription(self, absolute(topic), Inbox(keep), f"subscribe:{next(self._numbers)}")
        # A server sends each message twice for two spellings of one topic, so all subscriptions use one spelling.
        fields: dict[str, object] = {"topic": subscription.topic, "throttle_rate": throttle_ms}
        if type_name is not None:
            fields["type"] = type_name
        listeners = self._subscriptions.setdefault(subscription.topic, [])
        listeners.append(subscription)
        try:
            await self._send(subscription.op_id, "subscribe", fields)
            await self._settle(None)
        except BaseException:
            self._forget(subscription)
            raise
        refusal = self._refusals.pop(subscription.op_id, None)
        if refusal is not None:
            self._forget(subscription)
            raise OpRefusedError(refusal.text)
        return subscription

    def _forget(self, subscription: AsyncSubscription) -> None:
        listeners = self._subscriptions.get(subscription.topic, [])
        if subscription in listeners:
            listeners.remove(subscription)
        if not listeners:
            self._subscriptions.pop(subscription.topic, None)
        subscription.inbox.end(None)

    async def unsubscribe(self, subscription: AsyncSubscription) -> None:
        """End a subscription. A second call, or a call after the connection has ended, does nothing.

        Args:
            subscription: from `subscribe` of this client.
        """
        if subscription not in self._subscriptions.get(subscription.topic, []):
            return
        self._forget(subscription)
        if self.is_connected:
            with suppress(ConnectionLostError):  # the lost connection has ended it
                await self._send(subscription.op_id, "unsubscribe", {"topic": subscription.topic})

    async def wait_for(
        self,
        topic: str,
        predicate: Predicate | None = None,
        *,
        type_name: str | None = None,
        timeout: float | None = None,
    ) -> Frame:
        """Subscribe to a topic and return its first message that fits. A latched message counts.

        Messages from before the call are missed: to publish something and see its effect, `subscribe` first.

        Args:
            topic: name of the topic.
            predicate: takes a message and returns true if it fits; None accepts every message.
            type_name: as for `subscribe`.
            timeout: longest wait [s].

        Returns:
            The message.

        Raises:
            OpRefusedError: there is no such topic, or it has another type.
            AnswerTimeoutError: no message that fits came in time.
            ConnectionLostError: the connection has ended.
        """
        subscription = await self.subscribe(topic, type_name)
        try:
            return await subscription.wait_for(predicate, timeout=timeout)
        finally:
            await self.unsubscribe(subscription)

    async def next_of(
        self, subscription: AsyncSubscription, predicate: Predicate | None, timeout: float | None
    ) -> Frame:
        """Return the next message of a subscription that fits; see `AsyncSubscription.wait_for`.

        Args:
            subscription: from `subscribe` of this client.
            predicate: takes a message and returns true if it fits; None accepts every message.
            timeout: longest wait [s].

        Raises:
            ClientError: the subscription was closed.
            AnswerTimeoutError: no message that fits came in time.
            ConnectionLostError: the connection has ended.
        """
        until, num = self._until(timeout), 0
        while (msg := await subscription.inbox.next(until)) is not None:
            if predicate is None or predicate(msg):
                return msg
            num += 1
        if subscription.inbox.is_ended:
            raise ClientError(f"{subscription.topic}: expected an open subscription; this one was closed")
        why = f"; {num:,} came, but none of them fits" if num else ""
        if self._sync is not None and not num:
            why = "; in synchronous mode the world moves only by tick()"
        raise AnswerTimeoutError(f"{subscription.topic}: no message within {self._limit(timeout):g} s{why}")

    # Objects and roads

    async def spawn(self, model: str = "", *, timeout: float | None = None, **options: Unpack[ObjectOptions]) -> int:
        """Place one object into the world, between two frames; return its number.

        Args:
            model: name, as `catalogue` has it; empty for an ego like the first one, or with `data_id`.
            timeout: longest wait [s].
            options: place (`x`, `y`, `heading_deg`, or `link`, `distance`), `speed`, `behaviour`, `route`, `path`,
                `is_ego` and the other fields of `rosbridge_sim_msgs/SpawnObject`. Points of a path are `(x, y)` or
                `(x, y, z)` [m].

        Raises:
            TypeError: an argument that there is not, or no place.
            ServiceRefusedError: it cannot be placed; the error has the reason.
            AnswerTimeoutError: no answer in time.
            ConnectionLostError: the connection has ended.
        """
        (unique_id,) = await self.spawn_all([spawn_request(model, **options)], timeout=timeout)
        return unique_id

    async def spawn_all(self, objects: Sequence[Mapping[str, object]], *, timeout: float | None = None) -> list[int]:
        """Place several objects, all or none; return their numbers. Errors as for `spawn`.

        Args:
            objects: the fields of a `rosbridge_sim_msgs/SpawnObject` each.
            timeout: longest wait [s].
        """
        values = await self._call_sim("/sim/spawn", {"objects": list(objects)}, timeout)
        return [int(number) for number in values["unique_ids"]]

    async def remove(self, *unique_ids: int, timeout: float | None = None) -> None:
        """Take objects or further egos out of the world, all or none, between two frames. Errors as for `spawn`."""
        await self._call_sim("/sim/remove", {"unique_ids": list(unique_ids)}, timeout)

    async def set_object(
        self, unique_id: int, *, timeout: float | None = None, **options: Unpack[ObjectChange]
    ) -> None:
        """Change one object or ego, between two frames. What is not given stays. Errors as for `spawn`.

        Args:
            unique_id: its number; 0 is the first ego.
            timeout: longest wait [s].
            options: place, `speed`, `behaviour`, `route`, `path`, and of an ego `gear`, `ctrl_mode`, `turn_signal`,
                `emergency_signal`: the fields of `rosbridge_sim_msgs/ObjectState`, without its flags.
        """
        await self.set_objects([change_request(unique_id, **options)], timeout=timeout)

    async def set_objects(self, objects: Sequence[Mapping[str, object]], *, timeout: float | None = None) -> None:
        """Change several objects, all or none. Errors as for `spawn`.

        Args:
            objects: the fields of a `rosbridge_sim_msgs/ObjectState` each, with its flags.
            timeout: longest wait [s].
        """
        await self._call_sim("/sim/set", {"objects": list(objects)}, timeout)

    async def catalogue(self, *, timeout: float | None = None) -> list[Frame]:
        """Return the models that can be placed, a `rosbridge_sim_msgs/ModelInfo` each. Errors as for `call`."""
        models = (await self.call("/sim/catalogue", timeout=timeout)).get("models")
        return list(models) if isinstance(models, list) else []

    async def map(self, *, timeout: float | None = None) -> Frame:
        """Return all that a drawing of the map needs: what `/map.json` has. Errors as for `spawn`.

        Args:
            timeout: longest wait for each page [s].
        """
        whole = await self._call_sim("/sim/map", {"page": 0}, timeout)
        while (number := int(whole["page"]) + 1) < int(whole["num_pages"]):
            page = await self._call_sim("/sim/map", {"page": number}, timeout)
            if page["digest"] != whole["digest"]:
                raise ServiceRefusedError("/sim/map", "the map has changed while it was read; ask again", page)
            whole = {key: value + page[key] if isinstance(value, list) else page[key] for key, value in whole.items()}
        return {**whole, "page": 0, "num_pages": 1}

    async def route(self, start: RoadPoint, goal: RoadPoint, *, timeout: float | None = None) -> Frame:
        """Return the shortest way along the links: `links`, `points` and `length_m`. Errors as for `spawn`.

        Args:
            start: a link, `(link, distance)`, `(x, y)` or `(x, y, heading_deg)` [m, deg].
            goal: the same.
            timeout: longest wait [s].
        """
        return await self._call_sim("/sim/route", {"start": place_request(start), "goal": place_request(goal)}, timeout)

    async def nearest_lane(
        self, x: float, y: float, heading_deg: float | None = None, *, timeout: float | None = None
    ) -> Frame:
        """Return the lane nearest to a point: `link`, `distance`, `lateral`, `is_on_road` and more. Errors as above.

        Args:
            x: in the map's frame, east [m].
            y: in the map's frame, north [m].
            heading_deg: lanes of another direction count as farther away [deg]; None compares distances alone.
            timeout: longest wait [s].
        """
        request: Frame = {"x": x, "y": y}
        if heading_deg is not None:
            request |= {"use_heading": True, "heading_deg": heading_deg}
        return await self._call_sim("/sim/nearest_lane", request, timeout)

    async def _call_sim(self, service: str, args: Mapping[str, object], timeout: float | None) -> Frame:
        """Return the response of a service of ours, which begins with `result` and `message`.

        Raises:
            ServiceRefusedError: its result is false.
        """
        values = await self.call(service, args, timeout=timeout)
        if values.get("result") is not True:
            raise ServiceRefusedError(service, str(values.get("message", "")), values)
        return values

    # Synchronous mode

    async def start_sync(self, *, user_id: str = DEFAULT_USER_ID, step_ms: int = FRAME_MS) -> int:
        """Start synchronous mode with this client as its master; return the current frame number.

        Args:
            user_id: name of the master.
            step_ms: simulated time of a tick: a multiple of 20 [ms].

        Returns:
            Number of the frame at which the world has stopped.

        Raises:
            ServiceRefusedError: there is another master, or the mode cannot be started; the error has the reason.
            AnswerTimeoutError: no answer in time.
            ConnectionLostError: the connection has ended.
        """
        response = await self._ask_sync("result", "/SyncModeCmd", _sync_command(user_id, step_ms, is_on=True))
        self._sync = _SyncMode(user_id, step_ms, int(response.get("frame", 0)))
        return self._sync.frame

    async def stop_sync(self) -> None:
        """End synchronous mode: the world goes on in real time. Do nothing if this client has not started it.

        Raises:
            ServiceRefusedError: the simulator refuses; the error has the reason.
            AnswerTimeoutError: no answer in time.
            ConnectionLostError: the connection has ended.
        """
        if self._sync is not None:
            await self._ask_sync("result", "/SyncModeCmd", _sync_command(self._sync.user_id, self._sync.step_ms))
            self._sync = None

    async def tick(self, n: int = 1, *, timeout: float | None = None) -> Tick:
        """Move the world by `n` ticks. Ticks of several tasks do not overlap.

        Args:
            n: number of ticks, at least 1.
            timeout: longest wait for each tick [s].

        Returns:
            The simulation after the last tick.

        Raises:
            ValueError: `n` is less than 1.
            ClientError: synchronous mode was not started.
            ServiceRefusedError: the tick is refused; the error has the reason.
            AnswerTimeoutError: no answer in time.
            ConnectionLostError: the connection has ended.
        """
        if n < 1:
            raise ValueError(f"tick: expected a number from 1 on; got {n}")
        async with self._ticking:
            sync = self._sync
            if sync is None:
                raise ClientError("tick: expected synchronous mode; call start_sync() first, or join_barrier()")
            for _ in range(n):
                request = {"user_id": sync.user_id, "frame": sync.frame + sync.step_ms // FRAME_MS}
                response = await self._ask_sync("tick_status", "/SyncModeWaitForTick", request, timeout)
                sync.frame = int(response.get("frame", 0))
        return Tick(sync.frame, float(response.get("time") or "nan"), response.get("vehicle_status", {}))

    async def step(
        self,
        n: int = 1,
        *,
        commands: Mapping[int, Command | Sequence[Command]] | None = None,
        topics: Sequence[str] = (),
        stop_on: Sequence[StopCondition] = (),
        stop_after_m: float = 0.0,
        stop_at: tuple[float, float, float] | None = None,
        timeout: float | None = None,
    ) -> Steps:
        """Move the world by several ticks in one call of `/sim/step`, which a server of this project has.

        Args:
            n: number of ticks, 1 to 1,000.
            commands: number of an ego -> its command for all ticks, or a list with one for each tick.
            topics: topics of the simulator whose last message is wanted.
            stop_on: events that end the call.
            stop_after_m: end the call when an ego has driven so far in it [m]; 0 for no limit.
            stop_at: (x, y, radius), map frame [m]: end the call when an ego is within the radius; None for no place.
            timeout: longest wait [s].

        Raises:
            ClientError: synchronous mode was not started.
            ServiceRefusedError: the call is refused, or was interrupted by another client; the error has the reason.
            AnswerTimeoutError: no answer in time.
            ConnectionLostError: the connection has ended.
        """
        x, y, radius = stop_at or (0.0, 0.0, 0.0)
        request: Frame = {
            "n": n,
            "commands": [
                {"ego": ego, "commands": [given] if isinstance(given, Mapping) else list(given)}
                for ego, given in (commands or {}).items()
            ],
            "topics": list(topics),
            **{_STOP_FIELDS[condition]: True for condition in stop_on},
            "stop_after_m": stop_after_m,
            "stop_at_x": x,
            "stop_at_y": y,
            "stop_within_m": radius,
        }
        async with self._ticking:
            sync = self._sync
            if sync is None:
                raise ClientError("step: expected synchronous mode; call start_sync() first")
            values = await self.call("/sim/step", {"user_id": sync.user_id, **request}, timeout=timeout)
            sync.frame = int(values.get("frame", sync.frame))
        if values.get("result") is not True:
            raise ServiceRefusedError("/sim/step", str(values.get("message", "")), values)
        samples = {sample["topic"]: sample["message"] for sample in values["topics"]}
        return Steps(
            values["frame"],
            values["steps"],
            values["stopped_by"],
            values["egos"],
            {topic: orjson.loads(text) if text else None for topic, text in samples.items()},
        )

    async def real_time_factor(self, factor: float | None = None, *, timeout: float | None = None) -> RealTimeFactor:
        """Set how fast the world runs while real time moves it, or ask for it.

        Args:
            factor: simulated seconds in a second, 0.1 to 20; 0 for as fast as possible; None only asks.
            timeout: longest wait [s].

        Raises:
            ServiceRefusedError: the factor cannot be had; the error has the reason.
            AnswerTimeoutError: no answer in time.
            ConnectionLostError: the connection has ended.
        """
        request = {"factor": -1.0 if factor is None else factor}
        values = await self.call("/sim/real_time_factor", request, timeout=timeout)
        if values.get("result") is not True:
            raise ServiceRefusedError("/sim/real_time_factor", str(values.get("message", "")), values)
        return RealTimeFactor(values["factor"], values["measured"])

    # Snapshots

    async def snapshot(self, name: str = "", *, with_data: bool = False, timeout: float | None = None) -> Snapshot:
        """Save the state of the whole simulator; return what was saved.

        Args:
            name: of the snapshot; a name that is taken gets the new one; empty lets the server choose.
            with_data: return its bytes, too, which another process can restore.
            timeout: longest wait [s].

        Raises:
            ServiceRefusedError: there is no room, or it cannot be saved now; the error has the reason.
            AnswerTimeoutError: no answer in time.
            ConnectionLostError: the connection has ended.
        """
        answer = await self._ask_sim("/sim/snapshot", {"id": name, "with_data": with_data}, timeout)
        return _snapshot_of(answer, base64.b64decode(str(answer.get("data", ""))))

    async def restore(self, saved: str | bytes | Snapshot, *, timeout: float | None = None) -> int:
        """Return the simulator to a snapshot; return the frame that the world stands at.

        In synchronous mode only its master may do so: the client that has called `start_sync`.

        Args:
            saved: what `snapshot` returned, or its name or bytes. A snapshot with bytes is sent as these.
            timeout: longest wait [s].

        Raises:
            ServiceRefusedError: there is no such snapshot, or it cannot be restored; the error has the reason, and
                nothing has changed.
            AnswerTimeoutError: no answer in time.
            ConnectionLostError: the connection has ended.
        """
        if isinstance(saved, Snapshot):
            saved = saved.data or saved.name
        sync = self._sync
        request: dict[str, object] = {"user_id": DEFAULT_USER_ID if sync is None else sync.user_id}
        if isinstance(saved, bytes):
            request["data"] = base64.b64encode(saved).decode()
        else:
            request["id"] = saved
        frame = int((await self._ask_sim("/sim/restore", request, timeout)).get("frame", 0))
        if sync is not None:
            sync.frame = frame
        return frame

    async def snapshots(self, *, remove: Sequence[str] = (), timeout: float | None = None) -> list[Snapshot]:
        """Return the snapshots that the server keeps, oldest first, without their bytes.

        Args:
            remove: names of snapshots that it shall keep no longer.
            timeout: longest wait [s].

        Raises:
            ServiceRefusedError: one of these names is not there; none was removed.
            AnswerTimeoutError: no answer in time.
            ConnectionLostError: the connection has ended.
        """
        answer = await self._ask_sim("/sim/snapshots", {"remove": list(remove)}, timeout)
        return [_snapshot_of(one) for one in answer.get("snapshots", ())]

    async def state_hash(self, *, timeout: float | None = None) -> str:
        """Return a hash of all that decides what the simulator will do: equal states have equal hashes.

        Args:
            timeout: longest wait [s].

        Raises:
            ServiceRefusedError: there is no such service.
            AnswerTimeoutError: no answer in time.
            ConnectionLostError: the connection has ended.
        """
        return str((await self.call("/sim/state_hash", timeout=timeout)).get("hash", ""))

    async def _ask_sim(self, service: str, request: Mapping[str, object], timeout: float | None) -> Frame:
        """Return the values of a service of ours that can refuse.

        Raises:
            ServiceRefusedError: it does.
        """
        answer = await self.call(service, request, timeout=timeout)
        if answer.get("result") is not True:
            raise ServiceRefusedError(service, str(answer.get("message", "")), answer)
        return answer

    @property
    def next_frame(self) -> int:
        """Number of the frame that the next tick leads to, for requests that name a frame; 0 without `start_sync`."""
        return 0 if self._sync is None else self._sync.frame + self._sync.step_ms // FRAME_MS

    async def _ask_sync(
        self, key: str, service: str, request: Mapping[str, object], timeout: float | None = None
    ) -> Frame:
        """Call a service of synchronous mode and return its response; one of its fields says if the request was done.

        Raises:
            ServiceRefusedError: the request was not done. The reason comes from the server's status message, because
                the response has none.
        """
        num_before = self._num_statuses
        response = await self.ask(service, timeout=timeout, **request)
        if response.get(key) is not True:
            await self._settle(timeout)
            num_new = min(self._num_statuses - num_before, len(self.statuses))
            reasons = [status.text for status in list(self.statuses)[len(self.statuses) - num_new :]]
            raise ServiceRefusedError(service, reasons[-1] if reasons else "", response)
        return response

    # Time as a tool

    async def join_barrier(
        self, *, user_id: str = "", step_ms: int = 0, deadline: float = 0.0, timeout: float | None = None
    ) -> int:
        """Tick together with other clients; return the frame that the world stands at.

        The world moves when all members have called `tick`, or when the deadline has passed. The first member starts
        synchronous mode, and its `step_ms` and `deadline` hold for all.

        Args:
            user_id: name of the member; the server makes one if it is empty.
            step_ms: how far a tick of all moves the world, a multiple of 20; 0: that of the first member, or 20 [ms].
            deadline: longest wait for the others, from 0.01 to 60; 0 takes that of the first member, or 1 [s].
            timeout: longest wait for the answer [s].

        Raises:
            ServiceRefusedError: there is a master, or the first member has chosen otherwise; the error has the reason.
            AnswerTimeoutError: no answer in time.
            ConnectionLostError: the connection has ended.
        """
        request = {"user_id": user_id, "time_step": step_ms, "deadline_s": deadline}
        values = await self._ask_barrier("/sim/barrier/join", request, timeout)
        self._sync = _SyncMode(str(values["user_id"]), int(values["time_step"]), int(values["frame"]), is_member=True)
        return self._sync.frame

    async def leave_barrier(self, *, timeout: float | None = None) -> None:
        """Leave the barrier; the last member ends synchronous mode. Nothing if this client is no member.

        Args:
            timeout: longest wait for the answer [s].

        Raises:
            ServiceRefusedError: the simulator says no; the error has the reason.
            AnswerTimeoutError: no answer in time.
            ConnectionLostError: the connection has ended.
        """
        if self._sync is not None and self._sync.is_member:
            await self._ask_barrier("/sim/barrier/leave", {"user_id": self._sync.user_id}, timeout)
            self._sync = None

    async def _ask_barrier(self, service: str, request: Mapping[str, object], timeout: float | None) -> Frame:
        """Return the answer of a service of the barrier.

        Raises:
            ServiceRefusedError: it says no; the error has the reason.
        """
        values = await self.call(service, request, timeout=timeout)
        if values.get("result") is not True:
            raise ServiceRefusedError(service, str(values.get("message", "")), values)
        return values

    async def score(self, *, reset: bool = False, timeout: float | None = None) -> list[Frame]:
        """Return the scores of all egos, each a `rosbridge_sim_msgs/EgoScore`; the first call begins to keep them.

        Args:
            reset: all counts begin anew now; what is returned was counted until now.
            timeout: longest wait [s].

        Raises:
            ServiceRefusedError: the simulator says no; the error has the reason.
            AnswerTimeoutError: no answer in time.
            ConnectionLostError: the connection has ended.
        """
        values = await self.call("/sim/score", {"reset": reset}, timeout=timeout)
        return list(values.get("scores", ()))


def _snapshot_of(values: Frame, data: bytes = b"") -> Snapshot:
    return Snapshot(
        str(values.get("id", "")),
        int(values.get("frame", 0)),
        int(values.get("size", 0)),
        str(values.get("state_hash", "")),
        data,
    )


def _sync_command(user_id: str, step_ms: int, *, is_on: bool = False) -> Frame:
    return {"user_id": user_id, "start_sync_mode": is_on, "time_step": step_ms}


class AsyncSubscription:
    """Messages of a topic, from `AsyncClient.subscribe`.

        async with await client.subscribe("/Ego_topic") as egos:
            async for ego in egos:
                ...

    The loop ends when the subscription is closed. It raises `ConnectionLostError` when the connection ends.

    Attributes:
        topic: absolute name of the topic.
        inbox: messages that wait to be taken.
        op_id: id of the subscription on the wire.
    """

    def __init__(self, client: AsyncClient, topic: str, inbox: Inbox, op_id: str) -> None:
        self.topic = topic
        self.inbox = inbox
        self.op_id = op_id
        self._client = client

    @property
    def num_dropped(self) -> int:
        """Number of messages that were dropped because more came than the subscription keeps."""
        return self.inbox.num_dropped

    async def next(self, *, timeout: float | None = None) -> Frame:
        """Return the next message.

        Args:
            timeout: longest wait [s]; None means the client's own.

        Raises:
            AnswerTimeoutError: no message in time.
            ConnectionLostError: the connection has ended.
            ClientError: the subscription was closed.
        """
        return await self._client.next_of(self, None, timeout)

    async def wait_for(self, predicate: Predicate | None = None, *, timeout: float | None = None) -> Frame:
        """Return the next message that fits; skip those before it.

        Args:
            predicate: takes a message and returns true if it fits; None accepts every message.
            timeout: longest wait [s]; None means the client's own.

        Returns:
            The message.

        Raises:
            AnswerTimeoutError: no message that fits came in time.
            ConnectionLostError: the connection has ended.
            ClientError: the subscription was closed.
        """
        return await self._client.next_of(self, predicate, timeout)

    async def take(self) -> list[Frame]:
        """Return the messages that wait, oldest first, without waiting for more."""
        return self.inbox.take()

    async def close(self) -> None:
        """End the subscription. A second call does nothing."""
        await self._client.unsubscribe(self)

    def __aiter__(self) -> Self:
        """Iterate over the messages, without a time limit."""
        return self

    async def __anext__(self) -> Frame:
        """Return the next message."""
        msg = await self.inbox.next(None)
        if msg is None:
            raise StopAsyncIteration
        return msg

    async def __aenter__(self) -> Self:
        """Return the subscription itself."""
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End the subscription."""
        await self.close()
