"""The blocking client: each method runs the method of the same name of an `AsyncClient` in its own thread.

The `websockets` library has a blocking client, too. It is not used, for two reasons. Its thread stops reading when a
few messages wait, so each connection would need a second thread. And each method would have to be written twice.
"""

from __future__ import annotations

import ssl
from collections.abc import Callable, Coroutine
from contextlib import suppress
from functools import wraps
from typing import Any, Concatenate, ParamSpec, Self, TypeVar

from rosbridge_sim.client.async_subscription import AsyncSubscription, Predicate
from rosbridge_sim.client.asynchronous import (
    DEFAULT_KEEP,
    DEFAULT_TIMEOUT,
    DEFAULT_URL,
    AsyncClient,
    StatusLevel,
)
from rosbridge_sim.client.frames import Frame
from rosbridge_sim.client.statuses import Status
from rosbridge_sim.errors import ClientError, ConnectionLostError
from rosbridge_sim.link.loop_thread import LoopStoppedError, LoopThread
from rosbridge_sim.link.urls import shown_url

P = ParamSpec("P")
T = TypeVar("T")


def _blocking(
    method: Callable[Concatenate[AsyncClient, P], Coroutine[Any, Any, T]],
) -> Callable[Concatenate[Client, P], T]:
    """Return the blocking form of a method, with its arguments, errors and description."""

    @wraps(method, assigned=("__name__", "__doc__"))
    def run(self: Client, /, *args: P.args, **kwargs: P.kwargs) -> T:
        return self.run(method(self._client, *args, **kwargs))

    run.__qualname__ = f"Client.{method.__name__}"
    return run


class Client:
    """A connection to a rosbridge, for programs without asyncio. Every method may be called from any thread.

        with Client("ws://127.0.0.1:9090") as client:
            spec = client.ask("/Service_MoraiVehicleSpec", unique_id=0)

    The client does not reconnect by itself: after `ConnectionLostError`, create a new one. Each method that waits takes
    `timeout` in seconds. None means the client's own `timeout`, and `math.inf` means no limit. A predicate runs in the
    client's thread, so it must not call the client. In a coroutine use `AsyncClient`, because this class blocks the
    event loop.
    """

    def __init__(
        self,
        url: str = DEFAULT_URL,
        *,
        token: str | None = None,
        timeout: float = DEFAULT_TIMEOUT,
        tls: ssl.SSLContext | None = None,
        status_level: StatusLevel | None = "warning",
    ) -> None:
        """Prepare a client; `open` or `with` connects it. The arguments are those of `AsyncClient`.

        Args:
            url: `ws://HOST:PORT` or `wss://HOST:PORT`; `HOST` and `HOST:PORT` are accepted, too.
            token: the token that the server was started with (`--token`); None sends none.
            timeout: longest wait for an answer or a message [s].
            tls: certificates to trust for `wss://`; None trusts those of the system.
            status_level: lowest level of the status messages that the server is asked for; None keeps the server's
                default.
        """
        self._client = AsyncClient(url, token=token, timeout=timeout, tls=tls, status_level=status_level)
        self._thread: LoopThread | None = None

    def __repr__(self) -> str:
        """Return the URL without a token, and the state."""
        return repr(self._client).replace(AsyncClient.__name__, type(self).__name__, 1)

    def run(self, work: Coroutine[Any, Any, T]) -> T:
        """Run a coroutine of the inner client in the client's thread.

        Args:
            work: a coroutine of the inner `AsyncClient`.

        Returns:
            The result of the coroutine.

        Raises:
            ConnectionLostError: the client is not open.
        """
        url = shown_url(self._client.url)
        if self._thread is None:
            work.close()
            raise ConnectionLostError(f"{url}: not connected yet; use `with`, or call open() first")
        try:
            return self._thread.run(work)
        except LoopStoppedError:
            raise ConnectionLostError(f"{url}: this client was closed") from None

    # The connection

    @property
    def url(self) -> str:
        """The URL of the server."""
        return self._client.url

    @property
    def timeout(self) -> float:
        """Default of the longest wait for an answer or a message [s]."""
        return self._client.timeout

    @property
    def statuses(self) -> list[Status]:
        """Latest status messages of the server, oldest first. The log `rosbridge_sim.client` has them, too."""
        return list(self._client.statuses)

    @property
    def is_connected(self) -> bool:
        """True while the connection is open, as far as this side knows."""
        return self._client.is_connected

    def __enter__(self) -> Self:
        """Connect."""
        return self.open()

    def __exit__(self, *_: object) -> None:
        """Disconnect."""
        self.close()

    def open(self) -> Self:
        """Connect to the server; return the client itself. See `AsyncClient.open`."""
        if self._thread is not None:
            raise ClientError(f"{self!r}: expected a client that was never opened; make another one")
        self._thread = LoopThread("rosbridge_sim.client")
        try:
            self.run(self._client.open())
        except BaseException:
            self._thread.stop()
            raise
        return self

    def close(self) -> None:
        """Disconnect. See `AsyncClient.close`."""
        if self._thread is not None and self._thread.is_alive:
            try:
                with suppress(ConnectionLostError):  # another thread may have closed it already
                    self.run(self._client.close())
            finally:
                self._thread.stop()

    # The methods of `AsyncClient`, which are described there

    send = _blocking(AsyncClient.send)
    call = _blocking(AsyncClient.call)
    ask = _blocking(AsyncClient.ask)
    publish = _blocking(AsyncClient.publish)
    confirm = _blocking(AsyncClient.confirm)

    def subscribe(
        self, topic: str, type_name: str | None = None, *, throttle_ms: int = 0, keep: int = DEFAULT_KEEP
    ) -> Subscription:
        """Subscribe to a topic and return the subscription. See `AsyncClient.subscribe` for arguments and errors."""
        inner = self.run(self._client.subscribe(topic, type_name, throttle_ms=throttle_ms, keep=keep))
        return Subscription(self, inner)

    wait_for = _blocking(AsyncClient.wait_for)
    spawn = _blocking(AsyncClient.spawn)
    spawn_all = _blocking(AsyncClient.spawn_all)
    remove = _blocking(AsyncClient.remove)
    set_object = _blocking(AsyncClient.set_object)
    set_objects = _blocking(AsyncClient.set_objects)
    catalogue = _blocking(AsyncClient.catalogue)
    describe = _blocking(AsyncClient.describe)
    scenarios = _blocking(AsyncClient.scenarios)
    scenario_picture = _blocking(AsyncClient.scenario_picture)
    map = _blocking(AsyncClient.map)
    route = _blocking(AsyncClient.route)
    nearest_lane = _blocking(AsyncClient.nearest_lane)
    start_sync = _blocking(AsyncClient.start_sync)
    stop_sync = _blocking(AsyncClient.stop_sync)
    tick = _blocking(AsyncClient.tick)
    step = _blocking(AsyncClient.step)
    real_time_factor = _blocking(AsyncClient.real_time_factor)
    snapshot = _blocking(AsyncClient.snapshot)
    restore = _blocking(AsyncClient.restore)
    snapshots = _blocking(AsyncClient.snapshots)
    state_hash = _blocking(AsyncClient.state_hash)

    @property
    def next_frame(self) -> int:
        """Number of the frame that the next tick leads to. See `AsyncClient.next_frame`."""
        return self._client.next_frame

    join_barrier = _blocking(AsyncClient.join_barrier)
    leave_barrier = _blocking(AsyncClient.leave_barrier)
    score = _blocking(AsyncClient.score)


class Subscription:
    """Messages of a topic, from `Client.subscribe`.

        with client.subscribe("/Ego_topic") as egos:
            for ego in egos:
                ...

    The loop ends when the subscription is closed. It raises `ConnectionLostError` when the connection ends.
    """

    def __init__(self, client: Client, inner: AsyncSubscription) -> None:
        self._client = client
        self._inner = inner

    @property
    def topic(self) -> str:
        """Absolute name of the topic."""
        return self._inner.topic

    @property
    def num_dropped(self) -> int:
        """Number of messages that were dropped because more came than the subscription keeps."""
        return self._inner.num_dropped

    def next(self, *, timeout: float | None = None) -> Frame:
        """Return the next message. See `AsyncSubscription.next`."""
        return self._client.run(self._inner.next(timeout=timeout))

    def wait_for(self, predicate: Predicate | None = None, *, timeout: float | None = None) -> Frame:
        """Return the next message that fits; skip those before it. See `AsyncSubscription.wait_for`."""
        return self._client.run(self._inner.wait_for(predicate, timeout=timeout))

    def take(self) -> list[Frame]:
        """Return the messages that wait, oldest first, without waiting for more."""
        return self._client.run(self._inner.take())

    def close(self) -> None:
        """End the subscription. A second call does nothing."""
        with suppress(ConnectionLostError):  # the lost connection has ended it
            self._client.run(self._inner.close())

    def __iter__(self) -> Self:
        """Iterate over the messages, without a time limit."""
        return self

    def __next__(self) -> Frame:
        """Return the next message."""
        try:
            return self._client.run(anext(self._inner))
        except StopAsyncIteration:
            raise StopIteration from None

    def __enter__(self) -> Self:
        """Return the subscription itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """End the subscription."""
        self.close()
