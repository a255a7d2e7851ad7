"""The blocking client: each method runs the method of the same name of an `AsyncClient` in its own thread.

The `websockets` library has a blocking client, too. It is not used, for two reasons. Its thread stops reading when a
few messages wait, so each connection would need a second thread. And each method would have to be written twice.
"""

from __future__ import annotations

import ssl
from collections.abc import Coroutine, Mapping, Sequence
from contextlib import suppress
from types import TracebackType
from typing import Any, Self, TypeVar, Unpack

from rosbridge_sim.client.async_subscription import AsyncSubscription
from rosbridge_sim.client.asynchronous import (
    DEFAULT_KEEP,
    DEFAULT_TIMEOUT,
    DEFAULT_URL,
    AsyncClient,
    Predicate,
    StatusLevel,
)
from rosbridge_sim.client.frames import Frame
from rosbridge_sim.client.objects import ObjectChange, ObjectOptions, RoadPoint
from rosbridge_sim.client.results import RealTimeFactor, Snapshot, Steps, Tick
from rosbridge_sim.client.simulator_requests import DEFAULT_USER_ID, FRAME_MS, Command, StopCondition
from rosbridge_sim.client.statuses import Status
from rosbridge_sim.errors import ClientError, ConnectionLostError
from rosbridge_sim.link.loop_thread import LoopStoppedError, LoopThread
from rosbridge_sim.link.urls import shown_url

__all__ = ["Client", "Subscription"]

T = TypeVar("T")


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

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
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

    def send(self, op: str, **fields: object) -> str:
        """Send any op of the rosbridge protocol; return its `id`. See `AsyncClient.send`."""
        return self.run(self._client.send(op, **fields))

    # Services

    def call(self, service: str, args: object = None, *, timeout: float | None = None) -> Frame:
        """Call any service and return its values. See `AsyncClient.call` for arguments and errors."""
        return self.run(self._client.call(service, args, timeout=timeout))

    def ask(self, service: str, /, *, timeout: float | None = None, **request: object) -> Frame:
        """Call a service of the simulator and return its `response`. See `AsyncClient.ask` for arguments and errors."""
        return self.run(self._client.ask(service, timeout=timeout, **request))

    # Topics

    def publish(self, topic: str, msg: Mapping[str, object], type_name: str | None = None) -> None:
        """Publish a message. See `AsyncClient.publish` for arguments and errors."""
        self.run(self._client.publish(topic, msg, type_name))

    def confirm(self, *, timeout: float | None = None) -> None:
        """Wait until the server has handled everything that was sent before. See `AsyncClient.confirm`."""
        self.run(self._client.confirm(timeout=timeout))

    def subscribe(
        self, topic: str, type_name: str | None = None, *, throttle_ms: int = 0, keep: int = DEFAULT_KEEP
    ) -> Subscription:
        """Subscribe to a topic and return the subscription. See `AsyncClient.subscribe` for arguments and errors."""
        inner = self.run(self._client.subscribe(topic, type_name, throttle_ms=throttle_ms, keep=keep))
        return Subscription(self, inner)

    def wait_for(
        self,
        topic: str,
        predicate: Predicate | None = None,
        *,
        type_name: str | None = None,
        timeout: float | None = None,
    ) -> Frame:
        """Subscribe to a topic and return its first message that fits. See `AsyncClient.wait_for`."""
        return self.run(self._client.wait_for(topic, predicate, type_name=type_name, timeout=timeout))

    # Objects and roads

    def spawn(self, model: str = "", *, timeout: float | None = None, **options: Unpack[ObjectOptions]) -> int:
        """See `AsyncClient.spawn`."""
        return self.run(self._client.spawn(model, timeout=timeout, **options))

    def spawn_all(self, objects: Sequence[Mapping[str, object]], *, timeout: float | None = None) -> list[int]:
        """See `AsyncClient.spawn_all`."""
        return self.run(self._client.spawn_all(objects, timeout=timeout))

    def remove(self, *unique_ids: int, timeout: float | None = None) -> None:
        """See `AsyncClient.remove`."""
        self.run(self._client.remove(*unique_ids, timeout=timeout))

    def set_object(self, unique_id: int, *, timeout: float | None = None, **options: Unpack[ObjectChange]) -> None:
        """See `AsyncClient.set_object`."""
        self.run(self._client.set_object(unique_id, timeout=timeout, **options))

    def set_objects(self, objects: Sequence[Mapping[str, object]], *, timeout: float | None = None) -> None:
        """See `AsyncClient.set_objects`."""
        self.run(self._client.set_objects(objects, timeout=timeout))

    def catalogue(self, *, timeout: float | None = None) -> list[Frame]:
        """See `AsyncClient.catalogue`."""
        return self.run(self._client.catalogue(timeout=timeout))

    def describe(self, number: int, *, timeout: float | None = None) -> Frame:
        """See `AsyncClient.describe`."""
        return self.run(self._client.describe(number, timeout=timeout))

    def scenarios(self, *, timeout: float | None = None) -> list[Frame]:
        """See `AsyncClient.scenarios`."""
        return self.run(self._client.scenarios(timeout=timeout))

    def scenario_picture(self, name: str, *, width: int = 0, height: int = 0, timeout: float | None = None) -> bytes:
        """See `AsyncClient.scenario_picture`."""
        return self.run(self._client.scenario_picture(name, width=width, height=height, timeout=timeout))

    def map(self, *, timeout: float | None = None) -> Frame:
        """See `AsyncClient.map`."""
        return self.run(self._client.map(timeout=timeout))

    def route(self, start: RoadPoint, goal: RoadPoint, *, timeout: float | None = None) -> Frame:
        """See `AsyncClient.route`."""
        return self.run(self._client.route(start, goal, timeout=timeout))

    def nearest_lane(
        self, x: float, y: float, heading_deg: float | None = None, *, timeout: float | None = None
    ) -> Frame:
        """See `AsyncClient.nearest_lane`."""
        return self.run(self._client.nearest_lane(x, y, heading_deg, timeout=timeout))

    # Synchronous mode

    def start_sync(self, *, user_id: str = DEFAULT_USER_ID, step_ms: int = FRAME_MS) -> int:
        """Start synchronous mode with this client as master; return the frame number. See `AsyncClient.start_sync`."""
        return self.run(self._client.start_sync(user_id=user_id, step_ms=step_ms))

    def stop_sync(self) -> None:
        """End synchronous mode. See `AsyncClient.stop_sync`."""
        self.run(self._client.stop_sync())

    def tick(self, n: int = 1, *, timeout: float | None = None) -> Tick:
        """Move the world by `n` ticks; return the simulation after the last one. See `AsyncClient.tick`."""
        return self.run(self._client.tick(n, timeout=timeout))

    def step(
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
        """See `AsyncClient.step`."""
        return self.run(
            self._client.step(
                n,
                commands=commands,
                topics=topics,
                stop_on=stop_on,
                stop_after_m=stop_after_m,
                stop_at=stop_at,
                timeout=timeout,
            )
        )

    def real_time_factor(self, factor: float | None = None, *, timeout: float | None = None) -> RealTimeFactor:
        """See `AsyncClient.real_time_factor`."""
        return self.run(self._client.real_time_factor(factor, timeout=timeout))

    # Snapshots

    def snapshot(self, name: str = "", *, with_data: bool = False, timeout: float | None = None) -> Snapshot:
        """See `AsyncClient.snapshot`."""
        return self.run(self._client.snapshot(name, with_data=with_data, timeout=timeout))

    def restore(self, saved: str | bytes | Snapshot, *, timeout: float | None = None) -> int:
        """See `AsyncClient.restore`."""
        return self.run(self._client.restore(saved, timeout=timeout))

    def snapshots(self, *, remove: Sequence[str] = (), timeout: float | None = None) -> list[Snapshot]:
        """See `AsyncClient.snapshots`."""
        return self.run(self._client.snapshots(remove=remove, timeout=timeout))

    def state_hash(self, *, timeout: float | None = None) -> str:
        """See `AsyncClient.state_hash`."""
        return self.run(self._client.state_hash(timeout=timeout))

    @property
    def next_frame(self) -> int:
        """Number of the frame that the next tick leads to. See `AsyncClient.next_frame`."""
        return self._client.next_frame

    # Time as a tool

    def join_barrier(
        self, *, user_id: str = "", step_ms: int = 0, deadline: float = 0.0, timeout: float | None = None
    ) -> int:
        """See `AsyncClient.join_barrier`."""
        return self.run(self._client.join_barrier(user_id=user_id, step_ms=step_ms, deadline=deadline, timeout=timeout))

    def leave_barrier(self, *, timeout: float | None = None) -> None:
        """See `AsyncClient.leave_barrier`."""
        self.run(self._client.leave_barrier(timeout=timeout))

    def score(self, *, reset: bool = False, timeout: float | None = None) -> list[Frame]:
        """See `AsyncClient.score`."""
        return self.run(self._client.score(reset=reset, timeout=timeout))


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

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End the subscription."""
        self.close()
