"""The asyncio client. The blocking client is built on it.

The connection hands over each frame as it comes, with no task in between: answers go to their calls, messages to their
subscriptions. So pings are answered while the program does something else, and several tasks may share one client.
"""

from __future__ import annotations

import asyncio
import itertools
import logging
import math
import ssl
from collections.abc import Mapping
from contextlib import suppress
from typing import Any, ClassVar, Literal, Self

from websockets.asyncio.client import connect
from websockets.exceptions import ConnectionClosed, InvalidStatus, InvalidURI, WebSocketException

from rosbridge_sim.client.async_subscription import AsyncSubscription, Predicate
from rosbridge_sim.client.frames import MAX_SIZE, Frame, FrameReader, Inbox, absolute
from rosbridge_sim.client.simulator_requests import SimulatorRequests
from rosbridge_sim.client.statuses import Statuses
from rosbridge_sim.errors import (
    AnswerTimeoutError,
    ClientError,
    ConnectError,
    ConnectionLostError,
    FrameError,
    OpRefusedError,
    ServiceRefusedError,
)
from rosbridge_sim.link.client_connection import CheckedConnection, why_gone, why_not
from rosbridge_sim.link.json_with_words import to_json
from rosbridge_sim.link.library_log import quiet
from rosbridge_sim.link.terminal_text import safe
from rosbridge_sim.link.urls import DEFAULT_PORT, full_url, shown_url

DEFAULT_URL = f"ws://127.0.0.1:{DEFAULT_PORT}"
"""URL of a server on this machine that was started without flags."""

DEFAULT_TIMEOUT = 5.0
"""Default of the longest wait for an answer [s]: the same as rosbridge_suite's time-out of a call."""

DEFAULT_KEEP = 1_000
"""Default number of messages that a subscription keeps until they are taken: 20 s of a topic at 50 Hz."""

CLOSE_TIMEOUT = 1.0
"""Longest wait for the other side to confirm that the connection closes [s]."""

SHORT = 2**15
"""A frame up to this length is given to the transport at once while that has room; a longer one waits until the
transport has room again [bytes]."""

_FINAL_STATUSES = (401, 403)
"""HTTP statuses after which a new attempt is useless: the token is wrong, or the server rejects this client."""

_log = logging.getLogger("rosbridge_sim.client")

StatusLevel = Literal["info", "warning", "error", "none"]
"""Lowest level of the status messages that the server sends."""


class AsyncClient(SimulatorRequests):
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
        super().__init__()
        self.url = full_url(url)
        self.timeout = timeout
        self._statuses = Statuses()
        self.statuses = self._statuses.latest
        self._token = token
        self._tls = tls
        self._status_level = status_level
        self._connection: CheckedConnection | None = None
        self._reader = FrameReader()
        self._lost: ConnectionLostError | None = None
        self._numbers = itertools.count(1)
        self._calls: dict[str, asyncio.Future[Frame]] = {}
        self._subscriptions: dict[str, list[AsyncSubscription]] = {}
        self._others: Inbox | None = None
        self._advertised: set[tuple[str, str]] = set()

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

    async def __aexit__(self, *_: object) -> None:
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
            connection = await connect(
                self.url,
                create_connection=CheckedConnection,
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
        assert isinstance(connection, CheckedConnection)
        self._connection = connection
        connection.lost.add_done_callback(self._note_loss)
        connection.listen(self._receive)
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
        connection = self._connection
        if connection is None:
            return
        self._end(ConnectionLostError(f"{shown_url(self.url)}: this client was closed"))
        if not connection.lost.done():  # else the library's `close` fails
            try:
                async with asyncio.timeout(2 * CLOSE_TIMEOUT):  # the library waits for room without limit
                    await connection.close()
            except TimeoutError:
                connection.transport.abort()
            await asyncio.wait({connection.lost})

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

    async def send(self, /, op: str, **fields: object) -> str:
        """Send any op of the rosbridge protocol.

        Args:
            op: name of the op, such as `advertise`.

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
        text = to_json({"op": op, "id": op_id, **fields})
        connection = self._connection
        if connection is None:
            raise ConnectionLostError(f"{shown_url(self.url)}: not connected yet; use `with`, or call open() first")
        if self._lost is not None:
            raise self._lost
        if connection.has_room and len(text) <= SHORT:
            connection.send_messages([text])
            return
        try:
            await connection.send(text.decode())
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

    def _receive(self, data: bytes) -> None:
        try:
            frame = self._reader.read(data, asyncio.get_running_loop().time())
        except FrameError as error:
            self.note(f"a fragment that cannot be used: {error}")
        else:
            if frame is not None:
                self._take(frame)

    def _note_loss(self, _lost: asyncio.Future[None]) -> None:
        connection = self._connection
        if connection is not None:
            why = why_gone(self.url, connection.end, self._secrets)
            if connection.why_given_up:
                why = f"{shown_url(self.url)}: the connection was given up: {connection.why_given_up}"
            self._end(ConnectionLostError(why))

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
        status = self._statuses.note(frame)
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
            args: the request, by field names or, as a list, by position.
            timeout: longest wait [s].

        Returns:
            The `values` of the answer.

        Raises:
            ServiceRefusedError: the service failed or does not exist; the error has the reason.
            AnswerTimeoutError: no answer in time.
            ConnectionLostError: the connection has ended.
        """
        try:
            async with asyncio.timeout_at(self._until(timeout)):  # a server that does not read delays the sending, too
                frame = await (await self.begin_call(service, args))
        except TimeoutError:
            raise AnswerTimeoutError(f"{service}: no answer within {self._limit(timeout):g} s") from None
        values = frame.get("values", {})
        if frame.get("result", True) is False:
            raise ServiceRefusedError(service, values if isinstance(values, str) else "", values)
        return values if isinstance(values, dict) else {}

    async def ask(self, service: str, /, *, timeout: float | None = None, **request: object) -> Frame:
        """Call a service of the simulator and return its `response`.

        Services of `morai_msgs` have one field `request` and one field `response`, each with a message. This method
        adds and removes these fields. For other services use `call`.

        Args:
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
        if refusals := self._statuses.take_refusals():
            raise OpRefusedError("; ".join(status.text for status in refusals))

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
        refusal = self._statuses.take_refusal(subscription.op_id)
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
        until = self._until(timeout)
        try:
            async with asyncio.timeout_at(until):
                subscription = await self.subscribe(topic, type_name)
        except AnswerTimeoutError:
            raise
        except TimeoutError:
            raise AnswerTimeoutError(f"{topic}: no answer within {self._limit(timeout):g} s") from None
        try:
            return await self.next_of(subscription, predicate, timeout, until)
        finally:
            await self.unsubscribe(subscription)

    async def next_of(
        self,
        subscription: AsyncSubscription,
        predicate: Predicate | None,
        timeout: float | None,
        until: float | None = None,
    ) -> Frame:
        """Return the next message of a subscription that fits; see `AsyncSubscription.wait_for`.

        Args:
            subscription: from `subscribe` of this client.
            predicate: takes a message and returns true if it fits; None accepts every message.
            timeout: longest wait [s].
            until: its end, by the loop's clock [s]; None counts from now.

        Raises:
            ClientError: the subscription was closed.
            AnswerTimeoutError: no message that fits came in time.
            ConnectionLostError: the connection has ended.
        """
        until, num = self._until(timeout) if until is None else until, 0
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

    async def _ask_sync(
        self, key: str, service: str, request: Mapping[str, object], timeout: float | None = None
    ) -> Frame:
        """Call a service of synchronous mode and return its response; one of its fields says if the request was done.

        Raises:
            ServiceRefusedError: the request was not done. The reason comes from the server's status message, because
                the response has none.
        """
        num_before = self._statuses.num
        until = self._until(timeout)
        response = await self.ask(service, timeout=timeout, **request)
        if response.get(key) is not True:
            now = asyncio.get_running_loop().time()
            await self._settle(timeout if until is None else max(0.0, until - now))
            latest = self._statuses.latest[-1].text if self._statuses.num > num_before else ""
            raise ServiceRefusedError(service, latest, response)
        return response
