"""Counters of a running simulator in Prometheus's format, for `/metrics`.

Nothing is counted only for `/metrics`: other objects have plain integer counters, which are read at each scrape. The
one exception is the CPU time of frames. Its clock costs half a microsecond per frame, so it starts at the first scrape.
`prometheus_client` writes the format; it is imported at the first scrape, too, because that takes 20 ms.
Names follow Prometheus's rules: base units (seconds, bytes), and the suffix `_total` for values that never go down. No
label has values from clients, so the length of a scrape is limited.
"""

from __future__ import annotations

import asyncio
import importlib
import time
from bisect import bisect_left
from collections.abc import Iterator, Mapping
from itertools import accumulate
from typing import TYPE_CHECKING, Final

from rosbridge_sim.shell.monitoring.refusal_log import RefusalLog
from rosbridge_sim.shell.websocket.server import Server
from rosbridge_sim.simulator.simulator_node import SimulatorNode
from rosbridge_sim.version import __version__

if TYPE_CHECKING:
    from collections.abc import Callable

    from prometheus_client import CollectorRegistry
    from prometheus_client.metrics_core import CounterMetricFamily, GaugeMetricFamily, Metric

FRAME_BOUNDS: Final = (0.0001, 0.00025, 0.0005, 0.001, 0.0025, 0.005, 0.01, 0.02, 0.05, 0.1)
"""Upper bounds of the histogram [s]: from an empty scene (0.1 ms) to more than a frame may take in real time (20 ms).
"""


OPENMETRICS: Final = "application/openmetrics-text"
"""Format for programs that ask for it; all others get Prometheus's older format."""


class FrameHistogram:
    """CPU time of frames, counted in buckets.

    Attributes:
        counts: frames for each of `FRAME_BOUNDS`, and at the end those above the last one.
        total: sum over all frames [s].
    """

    def __init__(self, clock: Callable[[], float] = time.thread_time) -> None:
        """Create an empty histogram.

        Args:
            clock: CPU time of this thread, which computes all frames [s].
        """
        self.counts = [0] * (len(FRAME_BOUNDS) + 1)
        self.total = 0.0
        self._clock = clock
        self._begun_at = 0.0

    def begin(self) -> None:
        """Start the time of a frame."""
        self._begun_at = self._clock()

    def end(self) -> None:
        """Count the frame that was started last."""
        spent = self._clock() - self._begun_at
        self.total += spent
        self.counts[bisect_left(FRAME_BOUNDS, spent)] += 1


class Metrics:
    """Metrics of one simulator, in its own registry."""

    def __init__(
        self,
        loop: asyncio.AbstractEventLoop,
        server: Server,
        node: SimulatorNode | None,
        refusals: RefusalLog,
        num_bugs: Callable[[], int],
        *,
        ages: Callable[[float], Mapping[str, float]] = lambda _now: {},
    ) -> None:
        """Prepare the metrics; the first scrape starts them.

        Args:
            loop: the event loop; its clock is real time.
            node: the simulator's node; None without a world.
            refusals: counts the refused requests of clients.
            num_bugs: returns the number of internal errors.
            ages: returns, at a monotonic time [s], how old the topic messages at each bridge are [s], by its URL.
        """
        self.frames = FrameHistogram()
        self._loop = loop
        self._server = server
        self._node = node
        self._refusals = refusals
        self._num_bugs = num_bugs
        self._ages = ages
        self._registry: CollectorRegistry | None = None

    async def render(self, accept: str) -> tuple[bytes, str]:
        """Return all metrics as text, and its content type.

        Args:
            accept: the request's `Accept` header: the formats that the asking program accepts.
        """
        if self._registry is None:
            # In a thread, because the import takes as long as a frame.
            await self._loop.run_in_executor(None, importlib.import_module, "prometheus_client")
        import prometheus_client as text  # noqa: PLC0415 - see the head of this file
        from prometheus_client.openmetrics import exposition as openmetrics  # noqa: PLC0415

        registry = self._registry
        if registry is None:
            registry = self._registry = text.CollectorRegistry()
            registry.register(self)
            text.ProcessCollector(registry=registry)  # memory, CPU time and descriptors of the whole process
            if self._node is not None:
                self._node.context.stepper.meter = self.frames
        # The library's own choice fails if a program asks for a version that is not a number.
        if OPENMETRICS in (kind.partition(";")[0].strip().lower() for kind in accept.split(",")):
            body: bytes = openmetrics.generate_latest(registry)  # type: ignore[no-untyped-call] # it has no types
            return body, f"{OPENMETRICS}; version=1.0.0; charset=utf-8"
        return text.generate_latest(registry), "text/plain; version=0.0.4; charset=utf-8"

    def describe(self) -> list[Metric]:
        """Return no names. The registry belongs to this simulator alone, so no name can occur twice."""
        return []

    def collect(self) -> Iterator[Metric]:
        """Yield all metrics. The registry calls this."""
        from prometheus_client.metrics_core import GaugeMetricFamily, InfoMetricFamily  # noqa: PLC0415 - as above

        yield InfoMetricFamily("rosbridge_sim_build", "Version of the server.", {"version": __version__})
        yield from self._of_clients()
        text = "How old topic messages are when a bridge handles them."
        ages = GaugeMetricFamily("rosbridge_sim_bridge_age_seconds", text, labels=["bridge"])
        yield _fill(ages, self._ages(self._loop.time()))
        yield _counter("faults", "Internal errors of the server, each with a traceback in its log.", self._num_bugs())
        if self._node is not None:
            yield from self._of_world(self._node)

    def _of_clients(self) -> Iterator[Metric]:
        from prometheus_client.metrics_core import CounterMetricFamily  # noqa: PLC0415 - as above

        server, clients = self._server, list(self._server.clients)
        traffic = server.traffic
        yield _gauge("clients", "Clients that are connected now.", len(clients))
        yield _counter("clients_connected", "Clients that have connected since the start.", traffic.num_clients)
        yield _gauge("strangers", "Connections that have not sent the token yet.", server.num_strangers)
        yield _counter(
            "received_bytes", "Bytes received over all connections, HTTP requests included.", server.num_bytes_received
        )
        yield _counter("sent_bytes", "Bytes of messages given to sockets.", traffic.num_bytes_sent)
        yield _counter("received_frames", "WebSocket messages received from clients.", traffic.num_frames_received)
        yield _counter("sent_messages", "Topic messages put into clients' queues.", traffic.num_messages_sent)
        yield _counter(
            "dropped_messages",
            "Topic messages dropped from queues because their client did not read.",
            traffic.num_messages_dropped,
        )
        waiting = [client.num_bytes_waiting for client in clients]
        yield _gauge("queue_bytes", "Bytes that wait in clients' send queues.", sum(waiting))
        yield _gauge("queue_largest_bytes", "The same for the client with the longest queue.", max(waiting, default=0))
        held = sum(client.num_bytes_held for client in clients)
        yield _gauge("held_bytes", "Memory held for clients, as --client-memory counts it, queues included.", held)
        text = "Requests of clients that were refused, by reason."
        counts = {reason.value: count for reason, count in self._refusals.counts.items()}
        yield _fill(CounterMetricFamily("rosbridge_sim_refusals", text, labels=["reason"]), counts)

    def _of_world(self, node: SimulatorNode) -> Iterator[Metric]:
        from prometheus_client.metrics_core import HistogramMetricFamily  # noqa: PLC0415 - as above

        context = node.context
        yield _gauge(
            "world_failed", "1 after an internal error has ended the world, else 0.", context.failure.why is not None
        )
        yield _gauge("frame", "Number of the world's last frame; a reset sets it to 0.", node.world.frame)
        yield _counter("frames", "Frames of 20 ms computed since the start.", context.stepper.num_frames)
        yield _counter("ticks", "Ticks of synchronous mode that were done.", context.sync_driver.num_ticks)
        yield _gauge("synchronous_mode", "1 while synchronous mode is on, else 0.", node.sync.is_on)
        yield _gauge("paused", "1 while the simulation is paused, else 0.", node.sync.is_paused)
        lag = node.real_time_lag(self._loop.time())
        yield _gauge("real_time_lag_seconds", "Time by which the world is behind real time now.", lag)
        yield _counter("real_time_stalls", "Stalls after which the world skipped real time.", context.pacer.num_stalls)
        yield _counter("real_time_lost_seconds", "Real time that was skipped after stalls.", context.pacer.lost_time)
        bounds = [*map(str, FRAME_BOUNDS), "+Inf"]
        yield HistogramMetricFamily(
            "rosbridge_sim_frame_cpu_seconds",
            "CPU time of a frame, its step and its messages, since the first scrape.",
            list(zip(bounds, accumulate(self.frames.counts), strict=True)),
            self.frames.total,
        )


def _fill(family: GaugeMetricFamily | CounterMetricFamily, values: Mapping[str, float]) -> Metric:
    """Return a family of metrics with a value for each label."""
    for label, value in values.items():
        family.add_metric([label], value)
    return family


def _gauge(name: str, text: str, value: float) -> Metric:
    from prometheus_client.metrics_core import GaugeMetricFamily  # noqa: PLC0415 - as above

    return GaugeMetricFamily(f"rosbridge_sim_{name}", text, float(value))


def _counter(name: str, text: str, value: float) -> Metric:
    """Return a counter; the format appends `_total` to its name."""
    from prometheus_client.metrics_core import CounterMetricFamily  # noqa: PLC0415 - as above

    return CounterMetricFamily(f"rosbridge_sim_{name}", text, float(value))
