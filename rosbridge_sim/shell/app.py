"""The simulator and its server, built from settings.

Only this module builds the parts and connects them. `Simulator` is the same for the command line, for tests and for
notebooks; two simulators share nothing. If the world fails (see `scheduler.py`), `wait` raises the error, and the
command line ends with code 1.
"""

from __future__ import annotations

import asyncio
import errno
import logging
import os
import uuid
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from ssl import SSLContext
from typing import TYPE_CHECKING, Self, TypeVar, Unpack

from rosbridge_sim.errors import DocumentError, SettingError
from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.rosapi_services.node_parameters import provide_node_parameters
from rosbridge_sim.graph.rosapi_services.rosapi import Rosapi
from rosbridge_sim.graph.stamps import Stamps
from rosbridge_sim.graph.tf.web_republisher import WebRepublisher
from rosbridge_sim.link.loop_thread import LoopStoppedError, LoopThread
from rosbridge_sim.link.urls import shown_url
from rosbridge_sim.morai.releases import RELEASES
from rosbridge_sim.schema.store import Store
from rosbridge_sim.shell.assembly import (
    check_sense,
    choose_stamps,
    complete_policy,
    has_simulated_stamps,
    limits_of,
    make_simulator_node,
    mistakes_of_items,
    outbox_limits,
    start_recorder,
    start_worker,
    tell_of_world,
    web_page_of,
)
from rosbridge_sim.shell.bags.recordings import DiskRecordings
from rosbridge_sim.shell.clocks.scheduler import Scheduler
from rosbridge_sim.shell.clocks.wall_clock import WallClockBus
from rosbridge_sim.shell.config.loading import check_options
from rosbridge_sim.shell.config.options import SimulatorOptions
from rosbridge_sim.shell.config.settings import Settings
from rosbridge_sim.shell.drawing.sensor_thread import SensorThread
from rosbridge_sim.shell.files.access_rights import is_writable, why_not_writable
from rosbridge_sim.shell.files.definitions import Texts, read_definitions
from rosbridge_sim.shell.files.library import DiskLibrary
from rosbridge_sim.shell.files.message_types import MessageTypes, read_types
from rosbridge_sim.shell.files.port_file import PortFile
from rosbridge_sim.shell.files.quota import DataQuota, in_thread
from rosbridge_sim.shell.files.thread_reader import ThreadReader
from rosbridge_sim.shell.kernels.backend import start_kernels
from rosbridge_sim.shell.monitoring.descriptors import DescriptorWatch
from rosbridge_sim.shell.monitoring.log_limits import LineLimiter
from rosbridge_sim.shell.monitoring.masking import mask_of
from rosbridge_sim.shell.monitoring.metrics import Metrics
from rosbridge_sim.shell.monitoring.refusal_log import RefusalLog
from rosbridge_sim.shell.monitoring.server_topics import ServerTopics
from rosbridge_sim.shell.page.page_address import open_browser, page_urls
from rosbridge_sim.shell.websocket.access import load_certificate
from rosbridge_sim.shell.websocket.limits import ServerLimits
from rosbridge_sim.shell.websocket.server import Server
from rosbridge_sim.simulator.simulator_node import SimulatorNode
from rosbridge_sim.suggestions import listing

if TYPE_CHECKING:  # saves start time: most servers attach to no bridge and record nothing
    from rosbridge_sim.shell.attach import Attachment
    from rosbridge_sim.shell.bags.bag_recorder import BagRecorder
    from rosbridge_sim.shell.mocking.mock_server import MockServer
    from rosbridge_sim.shell.ros1.ros1_node import Ros1Node
    from rosbridge_sim.shell.ros2.joining import JoinedRos2

__all__ = ["AddressError", "Simulator"]

T = TypeVar("T")

_log = logging.getLogger("rosbridge_sim.app")


class AddressError(DocumentError):
    """The server cannot listen on its host and port."""


class Simulator:
    """A rosbridge server with a driving world inside.

        async with Simulator(port=0, scenario="demo") as sim:
            print(sim.url)

    In a program without asyncio, `with Simulator(port=0) as sim:` does the same in its own thread; `open` and `close`
    do, too. The parts of a simulator in another thread may only be used through `run_inside`. `url`, `port` and
    `settings` may be read anywhere.

    Attributes:
        settings: the settings that it was made with.
        bus: the topics and services that all participants share; None before the start.
        node: the simulator's node; None before the start, and without a world.
        library: scenarios and maps; one that is kept saves the next simulators reading them. Set it before the start,
            if at all, and only with the settings' own folders, map and catalogue.
        types: message types; those that are kept save the next simulators compiling them. Set them before the start.
        attachments: the bridges that it connects to; empty before the start.
        descriptors: logs a line when no file descriptor is left; None before the start.
        mock: the mock that is run in place of the world; None before the start, and without one.
    """

    def __init__(self, settings: Settings | None = None, /, **options: Unpack[SimulatorOptions]) -> None:
        """Check the settings; nothing runs yet.

        Args:
            settings: all settings; None uses the options.
            options: fields of `Settings` by name, and `rate`. Environment variables are ignored.

        Raises:
            SettingError: an unknown option, a bad value, or both settings and options. It is a DocumentError.
        """
        if settings is not None and options:
            raise SettingError(f"Simulator: expected settings or options; got both, with {listing(options)}")
        self.settings = check_options(options, mistakes_of_items) if settings is None else settings
        self.bus: Bus | None = None
        self.node: SimulatorNode | None = None
        self.library: DiskLibrary | None = None
        self.types: MessageTypes | None = None
        self.attachments: tuple[Attachment, ...] = ()
        self._server: Server | None = None
        self._scheduler: Scheduler | None = None
        self.descriptors: DescriptorWatch | None = None
        self._limiter: LineLimiter | None = None
        self._reports: ServerTopics | None = None
        self._recorder: BagRecorder | None = None
        self._port_file: PortFile | None = None
        self._quota: DataQuota | None = None
        self._readers: tuple[ThreadReader, ...] = ()
        self._worker: SensorThread | None = None
        self._stopping: asyncio.Task[None] | None = None
        self._thread: LoopThread | None = None
        self._is_stopped = False
        self._wrong_release: asyncio.Future[None] | None = None
        self._ros1: Ros1Node | None = None
        self._ros2: JoinedRos2 | None = None
        self.mock: MockServer | None = None

    def __repr__(self) -> str:
        """Return the address, the world and the state."""
        settings = self.settings
        state = "stopped" if self._is_stopped else "not started" if self.bus is None else "running"
        where = self.url if self.port else f"{settings.host} port {settings.port}"
        world = f"scenario={settings.scenario!r} seed={settings.seed}" if settings.world else "without a world"
        return f"<Simulator {where} {world} {state}>"

    @property
    def port(self) -> int:
        """The port that it listens on; 0 while it does not listen."""
        return self._server.port if self._server is not None else 0

    @property
    def url(self) -> str:
        """URL for clients."""
        host = self.settings.host
        scheme = "ws" if self.settings.certfile is None else "wss"
        return f"{scheme}://[{host}]:{self.port}" if ":" in host else f"{scheme}://{host}:{self.port}"

    @property
    def page_url(self) -> str:
        """URL of the web page on this machine; empty without a page, and while it does not listen."""
        return self.page_urls[0] if self.page_urls else ""

    @property
    def page_urls(self) -> tuple[str, ...]:
        """The same; if the server listens on all addresses, one more for other machines."""
        settings = self.settings
        if not (settings.page and self.port):
            return ()
        return page_urls(settings.host, self.port, is_tls=settings.certfile is not None)

    @property
    def num_bugs(self) -> int:
        """Number of internal errors; each is in the log with its traceback.

        It counts failed frames, loads and replays, the errors counted by the bus's guard, and one more if the world has
        failed.
        """
        if self._server is None or self._scheduler is None:
            return 0
        num_frames = self._server.num_bugs + sum(attachment.num_bugs for attachment in self.attachments)
        num_loads = sum(reader.num_bugs for reader in (*self._readers, self._worker) if reader is not None)
        is_standing = self.node is not None and self.node.context.failure.why is not None
        num_guarded = self.bus.guard.num_faults if self.bus is not None else 0
        return num_frames + num_loads + num_guarded + (self._scheduler.is_failed or is_standing)

    def __enter__(self) -> Self:
        return self.open()

    def __exit__(self, _kind: object, error: BaseException | None, _trace: object) -> None:
        self.close()
        if error is None and self._scheduler is not None and self._scheduler.is_failed:
            self._scheduler.failure.result()

    def open(self) -> Self:
        """Start in a new thread with its own event loop; return the simulator itself when it serves clients.

        Returns:
            The simulator itself.

        Raises:
            DocumentError: as for `start`; the thread has ended then.
            RuntimeError: it was started before.
        """
        if self._thread is not None or self.bus is not None:
            raise RuntimeError(f"{self!r}: expected a simulator that was never started; make another one")
        self._thread = LoopThread("rosbridge_sim.simulator")
        try:
            self._thread.run(self.start())
        except BaseException:
            self._thread.stop()
            self._thread = None
            raise
        return self

    def close(self) -> None:
        """Stop what `open` has started, and end its thread, within two seconds. A second call does nothing."""
        if self._thread is not None and self._thread.is_alive:
            try:
                with suppress(LoopStoppedError):  # another thread may have closed it already
                    self._thread.run(self.stop())
            finally:
                self._thread.stop()

    def run_inside(self, function: Callable[[], T]) -> T:
        """Run a function in the simulator's own thread, between two frames.

        Args:
            function: may use `bus` and `node`; the world and all clients wait for it.

        Returns:
            The result of the function.

        Raises:
            RuntimeError: it was not started by `open` or `with`, it was closed, or the caller is in that thread
                already.
        """
        if self._thread is None:
            raise RuntimeError(f"{self!r}: expected a simulator that runs in a thread of its own; use `with` or open()")
        return self._thread.call(lambda: self._run_and_look(function))

    def _run_and_look(self, function: Callable[[], T]) -> T:
        """Run a function that may have changed what moves the world, or when."""
        try:
            return function()
        finally:
            self._look()

    async def __aenter__(self) -> Self:
        await self.start()
        return self

    async def __aexit__(self, _kind: object, error: BaseException | None, _trace: object) -> None:
        await self.stop()
        if error is None and self._scheduler is not None and self._scheduler.is_failed:
            await self.wait()

    async def start(self) -> None:
        """Build everything, listen, and connect to the bridges. From now on, clients are served.

        Raises:
            DocumentError: a file cannot be used.
            AddressError: the server cannot listen there, or `attach` names the server itself.
        """
        settings = self.settings
        check_sense(settings)
        certificate = load_certificate(settings.certfile, settings.keyfile)
        texts, store = read_types(settings) if self.types is None else self.types.read(settings)
        bus = _kind_of_bus(settings)(
            store,
            is_strict=settings.strict_types,
            service_timeout=settings.service_timeout,
            max_calls=settings.max_calls,
        )
        limits = limits_of(settings)
        Rosapi(bus, limits.policy, str(uuid.uuid4()))
        loop = asyncio.get_running_loop()
        recordings = DiskRecordings(settings.data_dir, texts, loop)
        reader = ThreadReader(loop)
        republisher = WebRepublisher(bus)
        node: SimulatorNode | None = None
        if settings.world:
            node = self._make_node(bus, recordings, reader, loop)
        complete_policy(limits.policy, node, is_attaching=bool(settings.attach))
        stamps = None if node is None else choose_stamps(settings, node)
        scheduler = Scheduler(loop, bus, [] if node is None else [node], self._give_up, announcing=[republisher])
        recordings.reader.on_done = reader.on_done = scheduler.look
        server = Server(bus, limits, scheduler.turn)
        self.mock = _make_mock(settings, bus, texts, scheduler, server)
        tell_of_world(server, node, reader)
        server.pages.page = web_page_of(settings, loop)
        await self._listen(server, certificate)
        try:
            await _check_bridges(settings.attach, server)
            if settings.port_file is not None:
                self._port_file = PortFile(settings.port_file, server.port)
            self._recorder = start_recorder(settings, bus, node, texts)
            await self._join_ros(bus, limits, texts, scheduler, stamps)
            if self.mock is not None:
                await self.mock.start(Server(bus, limits, scheduler.turn), certificate)
        except DocumentError:
            self._remove_port_file()
            await server.stop()
            raise
        self._limit_log(loop)
        self.descriptors = DescriptorWatch(loop)
        frame = (lambda: -1) if node is None else (lambda: node.world.frame)
        refusals = RefusalLog(loop, frame, is_quiet=settings.quiet_clients, mask=mask_of(settings.token))
        self._reports = ServerTopics(bus, server, loop, refusals, limits.policy, ages=self._bridge_ages)
        provide_node_parameters(bus, limits.policy, is_simulated=has_simulated_stamps(settings))
        server.pages.render_metrics = Metrics(
            loop, server, node, refusals, lambda: self.num_bugs, ages=self._bridge_ages
        ).render
        self._readers = (recordings.reader, reader)
        self.bus, self.node, self._server, self._scheduler = bus, node, server, scheduler
        self._warn(server, limits)
        await self._finish_start()
        if node is not None:
            self._attach(bus, node, scheduler, stamps)
        scheduler.look()

    def _limit_log(self, loop: asyncio.AbstractEventLoop) -> None:
        self._limiter = LineLimiter(loop, mask=mask_of(self.settings.token))
        self._limiter.start()

    async def prepare_page(self) -> None:
        """Make the files of the web page, so that the first request does not wait for them."""
        if self._server is not None and self._server.pages.page is not None:
            await self._server.pages.page.prepare()

    def _make_node(
        self, bus: Bus, recordings: DiskRecordings, reader: ThreadReader, loop: asyncio.AbstractEventLoop
    ) -> SimulatorNode:
        """Return the simulator, with what writes its files and what draws for its sensors.

        Raises:
            DocumentError: a file, a map or a setting cannot be used.
        """
        settings = self.settings
        self._quota = DataQuota(
            settings.data_dir, settings.data_quota, settings.data_quota_files, aside=in_thread(loop)
        )
        self._worker = start_worker(settings, loop, self._look)
        return make_simulator_node(
            bus, settings, recordings, reader, self._quota, worker=self._worker, library=self.library
        )

    def _look(self) -> None:
        """Compute the next event anew, because the world may go on."""
        if self._scheduler is not None:
            self._scheduler.look()

    async def _listen(self, server: Server, certificate: SSLContext | None) -> None:
        """Listen, if the settings say so.

        Raises:
            AddressError: host and port cannot be used.
        """
        settings = self.settings
        if settings.listen:
            try:
                await server.start(settings.host, settings.port, certificate)
            except (OSError, UnicodeError) as error:
                raise AddressError(_why_not(settings, error)) from None

    def _warn(self, server: Server, limits: ServerLimits) -> None:
        """Log a warning about access that may be wider than expected, and about a data folder without write access."""
        settings = self.settings
        if settings.listen and settings.token is None:
            if not server.is_loopback:
                _log.warning(
                    "no token is set: every program that can reach %s may connect; set one with --token", self.url
                )
            for flag in limits.access.origins.open_flags():
                _log.warning(
                    "%s lets every website that the user visits connect, because no token is set; set one with --token",
                    flag,
                )
        if settings.world and not is_writable(folder := Path(settings.data_dir)):
            _log.warning("--data-dir %s: clients can save nothing there: %s", folder, why_not_writable(folder))

    async def _finish_start(self) -> None:
        """Show all topics to ROS, open the page in a browser, and start the compiled loops, if the settings say so."""
        if self.settings.world:
            start_kernels()
        if self._ros2 is not None:
            self._ros2.settle()
        if self._ros1 is not None:
            await self._ros1.start()
        if self.settings.open:
            open_browser(self.page_url)

    def _attach(self, bus: Bus, node: SimulatorNode, scheduler: Scheduler, stamps: Stamps | None) -> None:
        """Connect to the bridges."""
        settings = self.settings
        if not settings.attach:
            return
        from rosbridge_sim.shell.attach import AttachChoices, Attachment  # noqa: PLC0415 - most servers attach to no bridge

        if settings.sync_lease is None:
            _log.info("without --sync-lease, a crashed master behind a bridge cannot be detected; set --sync-lease")
        choices = AttachChoices(
            has_connection_each=settings.attach_sockets == "per-topic",
            limits=outbox_limits(settings),
            max_frame_size=settings.max_frame_size,
            extras=node.scene_topics,
            has_extras=settings.scene,
            second_names=node.context.publishers.second_names,
            max_wait=settings.attach_retry,
            ping_interval=settings.ping_interval,
            ping_timeout=settings.ping_timeout,
        )
        self.attachments = tuple(
            Attachment(bus, node.participant, url, choices, scheduler.look) for url in settings.attach
        )
        for attachment in self.attachments:
            attachment.mirror.stamps = stamps
            attachment.mirror.why_gone = node.context.ego_interfaces.why_gone
            attachment.mirror.is_synchronous = lambda: not node.sync.is_free
            self._watch_release(attachment)
            scheduler.add(attachment.mirror)
            attachment.start()

    async def _join_ros(
        self, bus: Bus, limits: ServerLimits, texts: Texts, scheduler: Scheduler, stamps: Stamps | None
    ) -> None:
        """Become a node on the graph of ROS 2, and prepare one on that of ROS 1, if the settings say so.

        Raises:
            DocumentError: the DDS library is missing, or refuses the domain; or the master, host or name of ROS 1
                cannot be used.
        """
        if self.settings.ros2_domain is not None:
            from rosbridge_sim.shell.ros2.joining import join_ros2  # noqa: PLC0415 - most servers join no domain

            self._ros2 = join_ros2(self.settings, bus, limits.policy, texts, scheduler)
        if self.settings.ros1_master is not None:
            from rosbridge_sim.shell.ros1.ros1_joining import join_ros1  # noqa: PLC0415 - as above

            self._ros1 = await join_ros1(self.settings, bus, limits.policy, texts, scheduler, stamps=stamps)

    def _bridge_ages(self, now: float) -> dict[str, float]:
        """Return how old topic messages are when each bridge handles them [s], by its URL."""
        return {attachment.url: attachment.mirror.age(now) for attachment in self.attachments}

    def _watch_release(self, attachment: Attachment) -> None:
        """Give a bridge's comparison of `morai_msgs` the releases; a mismatch ends `wait` if the setting says so."""
        settings, check = self.settings, attachment.mirror.release_check
        check.releases = lambda: {
            release: Store(read_definitions(release, settings.schema_path), ros=settings.ros) for release in RELEASES
        }
        if settings.strict_release:
            self._wrong_release = self._wrong_release or asyncio.get_running_loop().create_future()
            check.on_mismatch = lambda text: self._refuse_release(f"{attachment.url}: {text}")

    def _refuse_release(self, text: str) -> None:
        if self._wrong_release is not None and not self._wrong_release.done():
            self._wrong_release.set_exception(SettingError(f"strict-release: {text}"))
            self._wrong_release.exception()  # it is logged already

    async def stop(self) -> None:
        """Close every connection (code 1001) and stop the world, within two seconds. A second call does nothing."""
        self._remove_port_file()  # before another server can take the port
        self._is_stopped = self.bus is not None
        parts = (
            self._scheduler,
            self._quota,
            self.descriptors,
            *self._readers,
            self._worker,
            self._reports,
            self._ros2,
        )
        for part in parts:
            if part is not None:
                part.stop()
        try:
            if self._server is not None:
                leaving = [] if self._ros1 is None else [self._ros1.stop()]
                ends = [part.stop() for part in (*self.attachments, self.mock) if part is not None]
                await asyncio.gather(self._server.stop(), *ends, *leaving)
        finally:  # also after an error above
            self.close_recording()
            if self._limiter is not None:
                self._limiter.stop()

    def close_recording(self) -> None:
        """Finish the recording now. `stop` does it at its end; a second call does nothing."""
        if self._recorder is not None:
            self._recorder.stop()

    @property
    def has_lost_recording(self) -> bool:
        """True if the recording has ended early, or without its index; the log says why."""
        return self._recorder is not None and self._recorder.has_failed

    def _remove_port_file(self) -> None:
        if self._port_file is not None:
            self._port_file.remove()

    async def wait(self) -> None:
        """Wait until the world fails, which should never happen; with `on_world_failure="serve"`, wait for ever.

        Raises:
            WorldFailedError: the world has failed.
            SettingError: with `strict_release`: a bridge has other fields in `morai_msgs`.
        """
        assert self._scheduler is not None, "start it first"
        ends = (self._scheduler.failure, self._wrong_release)
        done, _ = await asyncio.wait([end for end in ends if end is not None], return_when=asyncio.FIRST_COMPLETED)
        for end in done:
            end.result()

    def _give_up(self) -> None:
        """Stop, because the world has failed; the connections of clients are closed."""
        self._stopping = asyncio.get_running_loop().create_task(self.stop())


def _kind_of_bus(settings: Settings) -> type[Bus]:
    """Return the class of the bus: its time, and whether faults stand before clients."""
    if settings.mock is None:
        return Bus if settings.world else WallClockBus
    from rosbridge_sim.shell.mocking.fault_bus import FaultBus  # noqa: PLC0415 - most servers are no mocks

    return FaultBus


def _make_mock(settings: Settings, bus: Bus, texts: Texts, scheduler: Scheduler, server: Server) -> MockServer | None:
    """Offer what the file of a mock describes, if the settings name one.

    Raises:
        DocumentError: it cannot be used.
    """
    if settings.mock is None:
        return None
    from rosbridge_sim.shell.mocking.mock_server import MockServer  # noqa: PLC0415 - as above

    mock = MockServer(settings, bus, texts, server)
    scheduler.add(mock.node)
    scheduler.add(mock)
    return mock


async def _check_bridges(urls: Sequence[str], server: Server) -> None:
    """Refuse to attach to this server itself, where every name is already taken.

    Raises:
        AddressError: one of the URLs is that of this server.
    """
    if not urls or not server.port:
        return
    from rosbridge_sim.shell.attach import is_own_address  # noqa: PLC0415 - as above

    for url in urls:
        if await is_own_address(url, server.port, server.addresses):
            raise AddressError(
                f"attach: expected another rosbridge; {shown_url(url)} is this server itself, and its clients already"
                " have everything"
            )


def _why_not(settings: Settings, error: OSError | UnicodeError) -> str:
    """Return why the server cannot listen there, and what to do."""
    where = f"cannot listen on {settings.host} port {settings.port}"
    if isinstance(error, UnicodeError):
        return f"{where}: expected a host name or address"
    if error.errno == errno.EADDRINUSE:
        return f"{where}: the port is in use, perhaps by a server that still runs; --port 0 takes a free one"
    if error.errno == errno.EACCES:
        return f"{where}: not allowed; expected a port from 1024 on"
    return f"{where}: {os.strerror(error.errno) if error.errno and error.errno > 0 else error.strerror or error}"
