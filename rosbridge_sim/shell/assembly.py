"""Parts of a server made from its settings: the simulator's node, limits, policy, recording."""

from __future__ import annotations

import asyncio
import logging
import time
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import fields
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.graph.policy import Policy, Rule
from rosbridge_sim.graph.rosapi_services.rosapi import Rosapi
from rosbridge_sim.graph.stamps import Stamps
from rosbridge_sim.graph.tf.web_republisher import WebRepublisher
from rosbridge_sim.morai.releases import LENIENCY, SPEED_LIMITS, Profile, choose_profile
from rosbridge_sim.protocol.outbox import OutboxLimits
from rosbridge_sim.records import replace
from rosbridge_sim.scenery.pictures import Weather
from rosbridge_sim.schema.store import Store
from rosbridge_sim.shell.clocks.wall_clock import WallClock
from rosbridge_sim.shell.config.settings import Settings
from rosbridge_sim.shell.config.value_types import URLS
from rosbridge_sim.shell.drawing.sensor_thread import SensorThread
from rosbridge_sim.shell.files.definitions import Texts, read_definitions
from rosbridge_sim.shell.files.library import DiskLibrary, open_library
from rosbridge_sim.shell.files.network_files import DiskNetworks
from rosbridge_sim.shell.files.noise_file import read_sensor_noise
from rosbridge_sim.shell.files.quota import DataQuota
from rosbridge_sim.shell.files.rig_file import read_sensors
from rosbridge_sim.shell.files.sensor_data_store import DiskArchive
from rosbridge_sim.shell.monitoring.server_topics import TOPICS, WHO_IS_CONNECTED
from rosbridge_sim.shell.page.map_page import MapPage
from rosbridge_sim.shell.page.web_page import WebPage
from rosbridge_sim.shell.scenario_shelf import DiskShelf
from rosbridge_sim.shell.websocket.access import Access
from rosbridge_sim.shell.websocket.limits import ServerLimits
from rosbridge_sim.shell.websocket.memory_budget import default_budget
from rosbridge_sim.shell.websocket.origins import OriginRules
from rosbridge_sim.shell.websocket.server import Server
from rosbridge_sim.simulator.bus.interface_registry import ListedInterface
from rosbridge_sim.simulator.bus.network_settings import NetworkSettings
from rosbridge_sim.simulator.bus.simulator_ways import SimulatorWays
from rosbridge_sim.simulator.node_factory import make_node
from rosbridge_sim.simulator.plain.reading import Reader
from rosbridge_sim.simulator.replays.recording_builder import Recordings
from rosbridge_sim.simulator.scene.rehearsal import Rehearsal
from rosbridge_sim.simulator.sensors.drawing import DrawingJob, DrawnSpec, SensorWorker, Sighting, drawn_of
from rosbridge_sim.simulator.sim_services.road_services import RoadServices
from rosbridge_sim.simulator.simulator_node import NodeSettings, SimulatorNode
from rosbridge_sim.world.roads.turn_shares import TurnShares
from rosbridge_sim.world.state.world import Dynamics, World

if TYPE_CHECKING:  # saves start time: most servers attach to no bridge and record nothing
    from rosbridge_sim.shell.bags.bag_recorder import BagRecorder

_log = logging.getLogger("rosbridge_sim.app")


def list_items(settings: Settings) -> list[ListedInterface]:
    """Return the topics and services of a simulator with these settings. It is built in the built-in scene for that.

    Raises:
        DocumentError: a file cannot be used, or network settings are not valid.
    """
    bus = Bus(Store(read_definitions(settings.release, settings.schema_path), leniency=LENIENCY, ros=settings.ros))
    Rosapi(bus)
    WebRepublisher(bus)
    built_in = replace(
        settings,
        scenario=Settings().scenario,
        scenario_path=(),
        map=None,
        signal_plan=None,
        catalogue=None,
        sensor_noise="none",
    )
    return list(make_simulator_node(bus, built_in, None, None, worker=_Undrawn()).interfaces.listing())


class _Undrawn:
    """A worker of a simulator that is built for its names alone: no frame comes that it would have to draw."""

    is_busy = False

    def why_not(self, _specs: Sequence[DrawnSpec]) -> str:
        """Refuse nothing."""
        return ""

    def submit(self, job: DrawingJob, then: Callable[[Sequence[Sighting] | Exception, float], None]) -> None:
        """Draw nothing."""
        raise AssertionError(f"{job} and {then} of a simulator without frames")


def mistakes_of_items(settings: Settings) -> list[str]:
    """Return the mistakes in the choices about topics and services, one line each.

    The readers of settings use it when there are other mistakes, to show all of them together. Otherwise the simulator
    finds these mistakes itself at its start.
    """
    if not (settings.publishers or settings.subscribers or settings.services):
        return []
    try:
        list_items(settings)
    except DocumentError as error:
        return str(error).splitlines()
    return []


def make_simulator_node(
    bus: Bus,
    settings: Settings,
    recordings: Recordings | None,
    reader: Reader | None,
    quota: DataQuota | None = None,
    *,
    worker: SensorWorker | None = None,
    library: DiskLibrary | None = None,
    make_world: type[World] = World,
) -> SimulatorNode:
    """Return the node of a simulator, in its opening scene.

    Args:
        recordings: recorded drives of the user; None for none.
        reader: reads files in a thread; None to read at once.
        quota: limits the files that are written for clients; None for no limit.
        worker: draws what cameras and lidars see; None where nothing can.
        library: scenarios and maps; None for that of the settings.

    Raises:
        DocumentError: a file, a map or a setting cannot be used.
    """
    if library is None:
        library = open_library(settings)
    differing = {
        "profile": choose_profile(settings.profile, settings.release, **_same(Profile.__struct_fields__, settings)),
        "speed_limits": SPEED_LIMITS.get(settings.release),
        "network": NetworkSettings(settings.publishers, settings.subscribers, settings.services),
        "catalogue": library.catalogue,
        "sensor_noise": read_sensor_noise(settings.sensor_noise),
        "sensors": read_sensors(settings.sensors),
        "weather": Weather(settings.weather),
        "is_dressed": settings.dressing,
        "standard_topics": settings.standard_topics or settings.ros2_domain is not None,
        "command_deadline": settings.ros2_command_deadline if settings.ros2_wait_for_command else None,
    }
    choices = NodeSettings(**(_same(NodeSettings.__struct_fields__, settings) | differing))
    turn_shares = TurnShares(*map(float, settings.turn_shares.split(","))) if settings.turn_shares else None
    scenario = library.opening_scenario(settings.scenario)
    mistakes = taken_names(settings)
    try:
        node = make_node(
            bus,
            make_world(
                settings.seed,
                Dynamics[settings.dynamics.upper().replace("-", "_")],
                is_creeping=settings.creep,
                has_stability_control=settings.stability_control,
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
            worker=worker,
        )
    except DocumentError as error:
        if not mistakes:
            raise
        raise DocumentError("\n".join([*mistakes, str(error)])) from None
    if mistakes:
        raise DocumentError("\n".join(mistakes))
    # Before any client waits: the crossings of forty people would stop the loop for 60 ms in their first frame.
    Rehearsal(node.world.dynamics, has_traffic=settings.traffic > 0).rehearse(scenario, node.scene.road_map)
    node.limit_turns(time.perf_counter)
    return node


def start_worker(settings: Settings, loop: asyncio.AbstractEventLoop, on_done: Callable[[], None]) -> SensorThread:
    """Return what draws for cameras and lidars; a server that has some and cannot draw does not start.

    Args:
        loop: delivers what was drawn.
        on_done: called after each delivery.

    Raises:
        DocumentError: a library or a driver is missing, or the sensors cannot be read.
    """
    worker = SensorThread(loop)
    worker.on_done = on_done
    drawn = drawn_of(read_sensors(settings.sensors))
    if drawn:
        worker.open(drawn)
    return worker


def choose_stamps(settings: Settings, node: SimulatorNode) -> Stamps:
    """Choose the clock for stamps."""
    clock = WallClock()
    choice = settings.stamps or ("sim" if settings.listen and settings.ros1_master is None else "auto")
    if choice == "auto" and not settings.attach and settings.ros1_master is None:
        _log.info("--stamps auto follows a bridge or a master of ROS 1, but there is none: stamps are simulated time")
    return Stamps(choice, lambda now: node.use_wall_time(clock.read_ns, now))


def has_simulated_stamps(settings: Settings) -> bool:
    """Return True if stamps are simulated time, as far as the settings tell."""
    return settings.world and settings.stamps in {None, "sim"} and not settings.attach


def taken_names(settings: Settings) -> list[str]:
    """Return a mistake for each name that belongs to one of the server's own topics."""
    return [
        f"{choice.where}: expected another name than {choice.name}, which the server has"
        for choice in [*settings.publishers.values(), *settings.subscribers.values()]
        if choice.name in TOPICS
    ]


def start_recorder(settings: Settings, bus: Bus, node: SimulatorNode | None, texts: Texts) -> BagRecorder | None:
    """Start to record, if `--record` is set.

    Raises:
        DocumentError: the file cannot be created.
    """
    if settings.record is None:
        return None
    from rosbridge_sim.shell.bags.bag import open_bag  # noqa: PLC0415 - the import of rosbags' writers takes a tenth of a second
    from rosbridge_sim.shell.bags.bag_recorder import BagRecorder  # noqa: PLC0415
    from rosbridge_sim.shell.bags.message_writer import BagMessageWriter  # noqa: PLC0415

    path = Path(settings.record)
    if path.resolve().is_relative_to(Path(settings.data_dir).resolve()):  # the data folder is created when it is needed
        with suppress(OSError):  # opening the bag reports the error
            path.parent.mkdir(parents=True, exist_ok=True)
    bag = open_bag(path)
    store = bus.store if bag.ros == bus.store.ros else Store(texts, leniency=LENIENCY, ros=bag.ros)
    loop = asyncio.get_running_loop()
    owner = None if node is None else node.participant
    return BagRecorder(
        bus, BagMessageWriter(bag, store, bus.store), path, simulator=owner, patterns=settings.record_topics, loop=loop
    )


def web_page_of(settings: Settings, loop: asyncio.AbstractEventLoop) -> WebPage | None:
    """Return the web page, if the settings have one."""
    if not settings.page:
        return None

    def make_store() -> Store:
        return Store(read_definitions(settings.release), leniency=LENIENCY, ros=settings.ros)

    return WebPage(loop, make_store, settings.page_frame_ancestors)


def tell_of_world(server: Server, node: SimulatorNode | None, reader: Reader) -> None:
    """Have the pages of the server tell of the world: `/healthz` and `/map.json`."""
    server.pages.describe = partial(_describe, node)
    if node is not None:
        server.pages.why_unhealthy = lambda: node.context.failure.why
        server.pages.ask_map = MapPage(asyncio.get_running_loop(), node.component(RoadServices), reader).ask


def _describe(node: SimulatorNode | None) -> dict[str, object]:
    """Return the simulator's part of `/healthz`."""
    if node is None:
        return {"frame": None, "mode": "gateway", "paused": False}
    mode = "synchronous" if node.sync.is_on else "real_time"
    return {"frame": node.world.frame, "mode": mode, "paused": node.sync.is_paused}


def limits_of(settings: Settings) -> ServerLimits:
    """Return the limits of the server and of each client."""
    access = [one.name for one in fields(Access)]
    differing = {
        "is_compressing": settings.compression,
        "is_talkative": settings.status,
        "memory_budget": settings.memory_budget or default_budget(),
        "outbox": outbox_limits(settings),
        "access": Access(origins=OriginRules(settings.allow_origin, settings.allow_host), **_same(access, settings)),
        "policy": Policy(
            publish=Rule(settings.allow_publish, settings.deny_publish),
            subscribe=Rule(settings.allow_subscribe, settings.deny_subscribe),
            service=Rule(settings.allow_service, settings.deny_service),
            parameter=Rule(settings.allow_param, settings.deny_param),
            max_held=settings.max_held,
        ),
    }
    return ServerLimits(**(_same(ServerLimits.__struct_fields__, settings) | differing))


def _same(names: Iterable[str], settings: Settings) -> dict[str, Any]:
    """Return the settings that have one of these names, such as those of the fields of a record."""
    return {name: getattr(settings, name) for name in names if hasattr(settings, name)}


def complete_policy(policy: Policy, node: SimulatorNode | None, *, is_attaching: bool) -> None:
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


def outbox_limits(settings: Settings) -> OutboxLimits:
    """Return the limits of what may wait for one client."""
    return OutboxLimits(settings.outbox_burst, settings.outbox_size, settings.outbox_limit)


def check_sense(settings: Settings) -> None:
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
    _check_nodes(settings)
    if settings.mock is not None and settings.world:
        raise DocumentError("mock: expected no world beside it; --no-world switches it off")
    if settings.mock is None and (settings.control_port is not None or settings.hook is not None):
        raise DocumentError("control-port, hook: expected with a mock: rosbridge-sim mock run FILE")
    if settings.open and not (settings.listen and settings.page):
        raise DocumentError("open: expected a server that listens and has its page; got --no-listen or --no-page")
    if settings.port_file is not None and not settings.listen:
        raise DocumentError("port-file: expected a server that listens; one that only attaches has no port")
    if settings.scene and not settings.attach:
        raise DocumentError("scene: expected with --attach; clients of this server can subscribe to the scene anyway")
    if not settings.attach and not settings.listen:
        raise DocumentError(f"attach: expected {URLS.expects}; got none, and --no-listen accepts no clients")


def _check_nodes(settings: Settings) -> None:
    """Refuse settings of nodes on a graph of ROS that contradict each other; errors as for `check_sense`."""
    if settings.ros2_domain is not None and settings.token is not None and not settings.ros2_without_token:
        raise DocumentError(
            "ros2-domain: expected no --token, because DDS lets every program in the domain read and command without"
            " one; --ros2-without-token allows it"
        )
    if settings.ros1_master is not None and settings.token is not None and not settings.ros1_without_token:
        raise DocumentError(
            "ros1-master: expected no --token, because every program that reaches the node can read and command without"
            " one; --ros1-without-token allows it"
        )
    has_nodes = settings.ros2_domain is not None or settings.ros1_master is not None
    if settings.ros2_wait_for_command and not (has_nodes and settings.world):
        raise DocumentError(
            "ros2-wait-for-command: expected with --ros2-domain or --ros1-master and a world, which waits for the nodes"
        )
    if settings.cmd_vel != "Twist" and not (settings.standard_topics or settings.ros2_domain is not None):
        raise DocumentError("cmd-vel: expected with --standard-topics or --ros2-domain, which bring /cmd_vel")
