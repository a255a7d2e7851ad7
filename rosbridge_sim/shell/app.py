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
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from ssl import SSLContext
from types import TracebackType
from typing import TYPE_CHECKING, Self, TypeVar, Unpack

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.policy import Policy, Rule
from rosbridge_sim.graph.rosapi import Rosapi
from rosbridge_sim.graph.stamps import Stamps
from rosbridge_sim.graph.tf.web_republisher import WebRepublisher
from rosbridge_sim.morai.interfaces.network_settings import NetworkSettings
from rosbridge_sim.morai.interfaces.registry import ListedInterface
from rosbridge_sim.morai.node_factory import make_node
from rosbridge_sim.morai.reading import Reader
from rosbridge_sim.morai.releases import LENIENCY, SPEED_LIMITS, choose_profile
from rosbridge_sim.morai.replays.recording_builder import Recordings
from rosbridge_sim.morai.sim_services.road_services import RoadServices
from rosbridge_sim.morai.simulator_node import NodeSettings, SimulatorNode
from rosbridge_sim.morai.ways import SimulatorWays
from rosbridge_sim.protocol.outbox import OutboxLimits
from rosbridge_sim.schema.store import Store
from rosbridge_sim.shell.bags.recordings import DiskRecordings
from rosbridge_sim.shell.config.loading import check_options
from rosbridge_sim.shell.config.options import SimulatorOptions
from rosbridge_sim.shell.config.settings import Settings
from rosbridge_sim.shell.config.value_types import URLS, SettingError
from rosbridge_sim.shell.files.access_rights import is_writable, why_not_writable
from rosbridge_sim.shell.files.definitions import Texts, read_definitions
from rosbridge_sim.shell.files.library import DiskLibrary
from rosbridge_sim.shell.files.network_files import DiskNetworks
from rosbridge_sim.shell.files.noise_file import read_sensor_noise
from rosbridge_sim.shell.files.quota import DataQuota, in_thread
from rosbridge_sim.shell.files.sensor_data_store import DiskArchive
from rosbridge_sim.shell.files.thread_reader import ThreadReader
from rosbridge_sim.shell.loop_thread import LoopStoppedError, LoopThread
from rosbridge_sim.shell.map_page import MapPage
from rosbridge_sim.shell.monitoring.descriptors import DescriptorWatch
from rosbridge_sim.shell.monitoring.log_limits import LineLimiter
from rosbridge_sim.shell.monitoring.masking import mask_of
from rosbridge_sim.shell.monitoring.metrics import Metrics
from rosbridge_sim.shell.monitoring.refusals import RefusalLog
from rosbridge_sim.shell.monitoring.server_topics import TOPICS, WHO_IS_CONNECTED, ServerTopics
from rosbridge_sim.shell.page.page_address import open_browser, page_urls
from rosbridge_sim.shell.page.web_page import WebPage
from rosbridge_sim.shell.port_file import PortFile
from rosbridge_sim.shell.scenario_shelf import DiskShelf
from rosbridge_sim.shell.scheduler import Clock, Scheduler
from rosbridge_sim.shell.wall_clock import WallClock
from rosbridge_sim.shell.websocket.access import Access, load_certificate
from rosbridge_sim.shell.websocket.limits import ServerLimits
from rosbridge_sim.shell.websocket.memory_budget import default_budget
from rosbridge_sim.shell.websocket.origins import OriginRules
from rosbridge_sim.shell.websocket.server import Server
from rosbridge_sim.shell.websocket.urls import shown_url
from rosbridge_sim.suggestions import listing
from rosbridge_sim.world.state import Dynamics, World
from rosbridge_sim.world.turn_shares import TurnShares

if TYPE_CHECKING:  # saves start time: most servers attach to no bridge and record nothing
    from rosbridge_sim.shell.attach import Attachment
    from rosbridge_sim.shell.bags.recording import Recorder

__all__ = ["AddressError", "Simulator", "list_items", "mistakes_of_items"]

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
        attachments: the bridges that it connects to; empty before the start.
        descriptors: logs a line when no file descriptor is left; None before the start.
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
        self.attachments: tuple[Attachment, ...] = ()
        self._server: Server | None = None
        self._scheduler: Scheduler | None = None
        self.descriptors: DescriptorWatch | None = None
        self._limiter: LineLimiter | None = None
        self._reports: ServerTopics | None = None
        self._recorder: Recorder | None = None
        self._port_file: PortFile | None = None
        self._recordings: DiskRecordings | None = None
        self._quota: DataQuota | None = None
        self._reader: ThreadReader | None = None
        self._stopping: asyncio.Task[None] | None = None
        self._thread: LoopThread | None = None
        self._is_stopped = False

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
        num_loads = sum(reader.num_bugs for reader in (self._reader, self._recordings) if reader is not None)
        is_standing = self.node is not None and self.node.failure is not None
        num_guarded = self.bus.guard.num_faults if self.bus is not None else 0
        return num_frames + num_loads + num_guarded + (self._scheduler.is_failed or is_standing)

    def __enter__(self) -> Self:
        return self.open()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
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
        return self._thread.call(function)

    async def __aenter__(self) -> Self:
        await self.start()
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
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
        _check_sense(settings)
        certificate = load_certificate(settings.certfile, settings.keyfile)
        texts = read_definitions(settings.release, settings.schema_path)
        store = Store(texts, leniency=LENIENCY, ros=settings.ros)
        make_bus = Bus if settings.world else _WallClockBus
        bus = make_bus(
            store,
            is_strict=settings.strict_types,
            service_timeout=settings.service_timeout,
            max_calls=settings.max_calls,
        )
        limits = _limits(settings)
        Rosapi(bus, limits.policy)
        loop = asyncio.get_running_loop()
        recordings = DiskRecordings(settings.data_dir, texts, loop)
        reader = ThreadReader(loop)
        republisher = WebRepublisher(bus)
        node: SimulatorNode | None = None
        if settings.world:
            self._quota = DataQuota(
                settings.data_dir, settings.data_quota, settings.data_quota_files, aside=in_thread(loop)
            )
            node = _make_node(bus, settings, recordings, reader, self._quota)
        _complete_policy(limits.policy, node, is_attaching=bool(settings.attach))
        stamps = None if node is None else _choose_stamps(settings, node)
        clocks: list[Clock] = [republisher] if node is None else [node, republisher]
        scheduler = Scheduler(loop, bus, clocks, self._give_up)
        recordings.on_done = reader.on_done = scheduler.look
        server = Server(bus, limits, scheduler.turn)
        _tell_of_world(server, node, reader)
        server.page = WebPage(loop, settings.page_frame_ancestors) if settings.page else None
        await self._listen(server, certificate)
        try:
            await _check_bridges(settings.attach, server)
            if settings.port_file is not None:
                self._port_file = PortFile(settings.port_file, server.port)
            self._recorder = _start_recording(settings, bus, node, texts)
        except DocumentError:
            self._remove_port_file()
            await server.stop()
            raise
        self._limiter = LineLimiter(loop, mask=mask_of(settings.token))
        self._limiter.start()
        self.descriptors = DescriptorWatch(loop)
        frame = (lambda: -1) if node is None else (lambda: node.world.frame)
        refusals = RefusalLog(loop, frame, is_quiet=settings.quiet_clients, mask=mask_of(settings.token))
        self._reports = ServerTopics(bus, server, loop, refusals, limits.policy)
        server.render_metrics = Metrics(loop, server, node, refusals, lambda: self.num_bugs).render
        self._recordings, self._reader = recordings, reader
        self.bus, self.node, self._server, self._scheduler = bus, node, server, scheduler
        self._warn(server, limits)
        self._open_page()
        if node is not None:
            self._attach(bus, node, scheduler, stamps)
        scheduler.look()

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

    def _open_page(self) -> None:
        """Open the page in a browser, if the settings say so."""
        if self.settings.open:
            open_browser(self.page_url)

    def _attach(self, bus: Bus, node: SimulatorNode, scheduler: Scheduler, stamps: Stamps | None) -> None:
        """Connect to the bridges."""
        settings = self.settings
        if not settings.attach:
            return
        from rosbridge_sim.shell.attach import AttachLimits, Attachment  # noqa: PLC0415 - most servers attach to no bridge

        if settings.sync_lease is None:
            _log.info("without --sync-lease, a crashed master behind a bridge cannot be detected; set --sync-lease")
        limits = AttachLimits(
            has_connection_each=settings.attach_sockets == "per-topic",
            has_scene=settings.scene,
            max_wait=settings.attach_retry,
            max_frame_size=settings.max_frame_size,
            ping_interval=settings.ping_interval,
            ping_timeout=settings.ping_timeout,
            outbox=_outbox_limits(settings),
        )
        self.attachments = tuple(
            Attachment(bus, node.participant, url, limits, scheduler.look, scene=node.scene_topics)
            for url in settings.attach
        )
        for attachment in self.attachments:
            attachment.mirror.stamps = stamps
            attachment.mirror.why_gone = node.why_gone
            scheduler.add(attachment.mirror)
            attachment.start()

    async def stop(self) -> None:
        """Close every connection (code 1001) and stop the world, within two seconds. A second call does nothing."""
        self._remove_port_file()  # before another server can take the port
        self._is_stopped = self.bus is not None
        if self._scheduler is not None:
            self._scheduler.stop()
        if self._recordings is not None:
            self._recordings.stop()
        if self._quota is not None:
            self._quota.stop()
        if self.descriptors is not None:
            self.descriptors.stop()
        if self._reader is not None:
            self._reader.stop()
        if self._reports is not None:
            self._reports.stop()
        try:
            if self._server is not None:
                await asyncio.gather(self._server.stop(), *(attachment.stop() for attachment in self.attachments))
        finally:  # also after an error above
            self.close_recording()
            if self._limiter is not None:
                self._limiter.stop()

    def close_recording(self) -> None:
        """Finish the recording now. `stop` does it at its end; a second call does nothing."""
        if self._recorder is not None:
            self._recorder.stop()

    def _remove_port_file(self) -> None:
        if self._port_file is not None:
            self._port_file.remove()

    async def wait(self) -> None:
        """Wait until the world fails, which should never happen; with `on_world_failure="serve"`, wait for ever.

        Raises:
            WorldFailedError: the world has failed.
        """
        assert self._scheduler is not None, "start it first"
        await asyncio.shield(self._scheduler.failure)

    def _give_up(self) -> None:
        """Stop, because the world has failed; the connections of clients are closed."""
        self._stopping = asyncio.get_running_loop().create_task(self.stop())


def list_items(settings: Settings) -> list[ListedInterface]:
    """Return the topics and services of a simulator with these settings. It is built in the built-in scene for that.

    Args:
        settings: the settings.

    Raises:
        DocumentError: a file cannot be used, or network settings are not valid.
    """
    bus = Bus(Store(read_definitions(settings.release, settings.schema_path), leniency=LENIENCY, ros=settings.ros))
    Rosapi(bus)
    WebRepublisher(bus)
    built_in = replace(
        settings, scenario=Settings().scenario, scenario_path=(), map=None, catalogue=None, sensor_noise="none"
    )
    return list(_make_node(bus, built_in, None, None).interfaces.listing())


def mistakes_of_items(settings: Settings) -> list[str]:
    """Return the mistakes in the choices about topics and services, one line each.

    The readers of settings use it when there are other mistakes, to show all of them together. Otherwise the simulator
    finds these mistakes itself at its start.

    Args:
        settings: the settings.
    """
    if not (settings.publishers or settings.subscribers or settings.services):
        return []
    try:
        list_items(settings)
    except DocumentError as error:
        return str(error).splitlines()
    return []


def _make_node(
    bus: Bus,
    settings: Settings,
    recordings: Recordings | None,
    reader: Reader | None,
    quota: DataQuota | None = None,
) -> SimulatorNode:
    library = DiskLibrary(settings.scenario_path, settings.map, settings.catalogue)
    profile = choose_profile(
        settings.profile,
        settings.release,
        wheel_angle_unit=settings.wheel_angle_unit,
        object_size_order=settings.object_size_order,
        object_limit=settings.object_limit,
        object_range=settings.object_range,
        object_velocity_unit=settings.object_velocity_unit,
    )
    choices = NodeSettings(
        profile=profile,
        start=settings.start,
        start_mode=settings.start_mode,
        speed_limits=SPEED_LIMITS.get(settings.release),
        network=NetworkSettings(settings.publishers, settings.subscribers, settings.services),
        sync_frames=settings.sync_frames,
        sync_lease=settings.sync_lease,
        sync_on_loss=settings.sync_on_loss,
        anyone_may_stop=settings.anyone_may_stop,
        catalogue=library.catalogue,
        real_time_factor=settings.real_time_factor,
        replay_info=settings.replay_info,
        score=settings.score,
        traffic=settings.traffic,
        traffic_wander=settings.traffic_wander,
        sensor_noise=read_sensor_noise(settings.sensor_noise),
        on_world_failure=settings.on_world_failure,
    )
    turn_shares = TurnShares(*map(float, settings.turn_shares.split(","))) if settings.turn_shares else None
    scenario = library.opening_scenario(settings.scenario)
    mistakes = _taken_names(settings)
    try:
        node = make_node(
            bus,
            World(
                settings.seed,
                Dynamics[settings.dynamics.upper().replace("-", "_")],
                is_creeping=settings.creep,
                has_impacts=settings.on_collision == "impact",
                turn_shares=turn_shares,
            ),
            library,
            scenario,
            choices,
            archive=DiskArchive(settings.data_dir, quota),
            recordings=recordings,
            networks=DiskNetworks(settings.data_dir),
            reader=reader,
            shelf=DiskShelf(library, settings.data_dir),
        )
    except DocumentError as error:
        if not mistakes:
            raise
        raise DocumentError("\n".join([*mistakes, str(error)])) from None
    if mistakes:
        raise DocumentError("\n".join(mistakes))
    node.limit_turns(time.perf_counter)
    return node


def _tell_of_world(server: Server, node: SimulatorNode | None, reader: Reader) -> None:
    """Have the pages of the server tell of the world: `/healthz` and `/map.json`."""
    server.describe = partial(_describe, node)
    if node is not None:
        server.why_unhealthy = lambda: node.failure
        server.ask_map = MapPage(asyncio.get_running_loop(), node.component(RoadServices), reader).ask


def _describe(node: SimulatorNode | None) -> dict[str, object]:
    """Return the simulator's part of `/healthz`."""
    if node is None:
        return {"frame": None, "mode": "gateway", "paused": False}
    mode = "synchronous" if node.sync.is_on else "real_time"
    return {"frame": node.world.frame, "mode": mode, "paused": node.sync.is_paused}


def _choose_stamps(settings: Settings, node: SimulatorNode) -> Stamps:
    """Choose the clock for stamps."""
    clock = WallClock()
    choice = settings.stamps or ("sim" if settings.listen else "auto")
    if choice == "auto" and not settings.attach:
        _log.info("--stamps auto follows a bridge, but no --attach is given: stamps are simulated time")
    return Stamps(choice, lambda now: node.use_wall_time(clock.read_ns, now))


def _taken_names(settings: Settings) -> list[str]:
    """Return a mistake for each name that belongs to one of the server's own topics."""
    return [
        f"{choice.where}: expected another name than {choice.name}, which the server has"
        for choice in [*settings.publishers.values(), *settings.subscribers.values()]
        if choice.name in TOPICS
    ]


def _start_recording(settings: Settings, bus: Bus, node: SimulatorNode | None, texts: Texts) -> Recorder | None:
    """Start to record, if `--record` is set.

    Raises:
        DocumentError: the file cannot be created.
    """
    if settings.record is None:
        return None
    from rosbridge_sim.shell.bags.bag import open_bag  # noqa: PLC0415 - the import of rosbags' writers takes a tenth of a second
    from rosbridge_sim.shell.bags.message_writer import BagMessageWriter  # noqa: PLC0415
    from rosbridge_sim.shell.bags.recording import Recorder  # noqa: PLC0415

    path = Path(settings.record)
    if path.resolve().is_relative_to(Path(settings.data_dir).resolve()):  # the data folder is created when it is needed
        with suppress(OSError):  # opening the bag reports the error
            path.parent.mkdir(parents=True, exist_ok=True)
    bag = open_bag(path)
    store = bus.store if bag.ros == bus.store.ros else Store(texts, leniency=LENIENCY, ros=bag.ros)
    loop = asyncio.get_running_loop()
    owner = None if node is None else node.participant
    return Recorder(
        bus, BagMessageWriter(bag, store, bus.store), path, simulator=owner, patterns=settings.record_topics, loop=loop
    )


def _limits(settings: Settings) -> ServerLimits:
    return ServerLimits(
        max_frame_size=settings.max_frame_size,
        ping_interval=settings.ping_interval,
        ping_timeout=settings.ping_timeout,
        is_compressing=settings.compression,
        is_direct=settings.websocket_io == "direct",
        is_talkative=settings.status,
        client_memory=settings.client_memory,
        memory_budget=settings.memory_budget or default_budget(),
        outbox=_outbox_limits(settings),
        access=Access(
            token=settings.token,
            origins=OriginRules(settings.allow_origin, settings.allow_host),
            max_clients=settings.max_clients,
            max_strangers=settings.max_strangers,
            max_rate=settings.max_rate,
        ),
        policy=Policy(
            publish=Rule(settings.allow_publish, settings.deny_publish),
            subscribe=Rule(settings.allow_subscribe, settings.deny_subscribe),
            service=Rule(settings.allow_service, settings.deny_service),
            parameter=Rule(settings.allow_param, settings.deny_param),
            max_held=settings.max_held,
        ),
    )


def _complete_policy(policy: Policy, node: SimulatorNode | None, *, is_attaching: bool) -> None:
    """Apply patterns to all names of the simulator's things, and log ways that they leave open."""
    ways = SimulatorWays(None if node is None else node.interfaces)
    policy.ways.add(ways.effects, ways.others)
    policy.ways.add(lambda: (WHO_IS_CONNECTED,))
    if node is not None:
        node.interfaces.on_change = policy.ways.change
    for line in policy.left_open():
        _log.warning("%s", line)
    if is_attaching and not policy.is_open:
        _log.warning(
            "--allow and --deny patterns apply only to clients of this server, not to programs behind a bridge;"
            " set rules at the bridge"
        )


def _outbox_limits(settings: Settings) -> OutboxLimits:
    return OutboxLimits(settings.outbox_burst, settings.outbox_size, settings.outbox_limit)


def _check_sense(settings: Settings) -> None:
    """Refuse settings that leave nothing to do.

    Raises:
        DocumentError: the text says what is missing.
    """
    if settings.attach and not settings.world:
        raise DocumentError("attach: expected a world; without one there is nothing to advertise at a bridge")
    if settings.stamps == "wall" and settings.real_time_factor != 1.0:
        raise DocumentError(
            f"real-time-factor: expected 1 with --stamps wall; got {settings.real_time_factor:g};"
            " --stamps sim allows any factor"
        )
    if settings.open and not (settings.listen and settings.page):
        raise DocumentError("open: expected a server that listens and has its page; got --no-listen or --no-page")
    if settings.port_file is not None and not settings.listen:
        raise DocumentError("port-file: expected a server that listens; one that only attaches has no port")
    if settings.scene and not settings.attach:
        raise DocumentError("scene: expected with --attach; clients of this server can subscribe to the scene anyway")
    if not settings.attach and not settings.listen:
        raise DocumentError(f"attach: expected {URLS.expects}; got none, and --no-listen accepts no clients")


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


class _WallClockBus(Bus):
    """A bus without a simulation: stamps that a message leaves open get the time of day."""

    @property
    def time_ns(self) -> int:
        """The time of day [ns]."""
        return time.time_ns()

    @time_ns.setter
    def time_ns(self, time_ns: int) -> None:
        """Ignore it: the time of day cannot be set."""

    @property
    def stamp_ns(self) -> int:
        return time.time_ns()

    @stamp_ns.setter
    def stamp_ns(self, stamp_ns: int) -> None:
        """Ignore it: the time of day cannot be set."""
