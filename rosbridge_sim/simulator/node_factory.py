"""Builder of the simulator: first the context, then the components, then the node."""

from __future__ import annotations

from functools import partial
from operator import attrgetter

from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.morai.messages.convert import Converter
from rosbridge_sim.records import asdict
from rosbridge_sim.scenarios.scenario import Scenario
from rosbridge_sim.simulator.bus.interface_registry import InterfaceRegistry
from rosbridge_sim.simulator.bus.network_settings import Networks
from rosbridge_sim.simulator.bus.publishers import Publishers
from rosbridge_sim.simulator.bus.simulator_participant import SimulatorParticipant
from rosbridge_sim.simulator.bus.warn_once import WarnOnce
from rosbridge_sim.simulator.bus.world_failure import WorldFailure
from rosbridge_sim.simulator.egos.ego import CtrlMode
from rosbridge_sim.simulator.egos.ego_registry import EgoRegistry
from rosbridge_sim.simulator.egos.tf_publisher import TF, StaticTf, TfPublisher
from rosbridge_sim.simulator.kernel.command_wait import CommandWait
from rosbridge_sim.simulator.kernel.component import Component
from rosbridge_sim.simulator.kernel.context import SimulatorContext
from rosbridge_sim.simulator.kernel.ego_interfaces import EgoInterfaces
from rosbridge_sim.simulator.kernel.frame_gate import FrameGate
from rosbridge_sim.simulator.kernel.frame_stepper import FrameStepper
from rosbridge_sim.simulator.kernel.hooks import Hooks
from rosbridge_sim.simulator.kernel.late_work import LateWork
from rosbridge_sim.simulator.kernel.projection_import import ProjectionImport
from rosbridge_sim.simulator.kernel.real_time import set_real_time_factor
from rosbridge_sim.simulator.kernel.real_time_pacer import RealTimePacer
from rosbridge_sim.simulator.kernel.scene_changes import SceneChanges
from rosbridge_sim.simulator.kernel.simulation_time import SimulationTime
from rosbridge_sim.simulator.kernel.simulator_parts import SimulatorParts
from rosbridge_sim.simulator.kernel.sync_driver import SyncDriver
from rosbridge_sim.simulator.kernel.sync_info import SyncInfo
from rosbridge_sim.simulator.markers.scene_markers import SceneMarkers
from rosbridge_sim.simulator.morai_services.command_executor import CommandExecutor
from rosbridge_sim.simulator.morai_services.command_topics import CommandTopics
from rosbridge_sim.simulator.morai_services.loads import Loads
from rosbridge_sim.simulator.morai_services.morai_services import Services
from rosbridge_sim.simulator.morai_services.state_publishers import StatePublishers
from rosbridge_sim.simulator.morai_services.traffic_light_topics import TrafficLightTopics
from rosbridge_sim.simulator.plain.reading import AtOnce, Reader
from rosbridge_sim.simulator.replays.recording_builder import Recordings
from rosbridge_sim.simulator.replays.replay import Replay
from rosbridge_sim.simulator.robot_description import RobotDescription, find_wheels
from rosbridge_sim.simulator.scene.load import Library
from rosbridge_sim.simulator.scene.scene import Scene
from rosbridge_sim.simulator.scene.scene_commands import SceneCommand
from rosbridge_sim.simulator.sensor_data.sensor_files import SensorDataStore
from rosbridge_sim.simulator.sensor_rigs.mounted_sensors import MountedSensors
from rosbridge_sim.simulator.sensor_rigs.weather import WeatherControl
from rosbridge_sim.simulator.sensor_services.sensor_commands import Sensors
from rosbridge_sim.simulator.sensor_services.sensor_service import SensorService
from rosbridge_sim.simulator.sensors.drawing import SensorWorker
from rosbridge_sim.simulator.sensors.gps import GpsSpec
from rosbridge_sim.simulator.sensors.sensor_table import SENSOR_FRAMES
from rosbridge_sim.simulator.sim_services.barrier_services import BarrierServices
from rosbridge_sim.simulator.sim_services.contacts import Contacts
from rosbridge_sim.simulator.sim_services.control_lease import ControlLeases
from rosbridge_sim.simulator.sim_services.describe import Describe
from rosbridge_sim.simulator.sim_services.drivers import Drivers
from rosbridge_sim.simulator.sim_services.population import Population
from rosbridge_sim.simulator.sim_services.real_time_factor import RealTimeFactor
from rosbridge_sim.simulator.sim_services.road_services import RoadServices
from rosbridge_sim.simulator.sim_services.scenario_services import Scenarios, ScenarioShelf
from rosbridge_sim.simulator.sim_services.scene_mesh import SceneMesh
from rosbridge_sim.simulator.sim_services.scene_state import SceneState
from rosbridge_sim.simulator.sim_services.score_services import Scores
from rosbridge_sim.simulator.sim_services.step_service import StepService
from rosbridge_sim.simulator.sim_services.traffic_demand import Traffic
from rosbridge_sim.simulator.simulator_node import NodeSettings, SimulatorNode
from rosbridge_sim.simulator.snapshots.snapshots import Snapshots
from rosbridge_sim.simulator.standard_topics import StandardTopics
from rosbridge_sim.simulator.story.stories import Stories
from rosbridge_sim.simulator.sync.barrier import Barrier
from rosbridge_sim.simulator.sync.sync import Sync
from rosbridge_sim.world.state.world import Gear, World
from rosbridge_sim.world.step import step


def make_node(
    bus: Bus,
    world: World,
    library: Library,
    scenario: Scenario,
    settings: NodeSettings | None = None,
    *,
    archive: SensorDataStore | None = None,
    recordings: Recordings | None = None,
    networks: Networks | None = None,
    reader: Reader | None = None,
    shelf: ScenarioShelf | None = None,
    worker: SensorWorker | None = None,
) -> SimulatorNode:
    """Return the simulator with its opening scene, on the bus; clients see nothing of it before it is complete.

    Args:
        bus: gets its topics and services.
        world: empty.
        library: source of scenarios and maps.
        settings: None for the defaults.
        archive: saves sensor data; None if there is no folder for it.
        recordings: source of recordings for replays; None for no recordings.
        networks: source of scenarios' network settings; None for no such settings.
        reader: reads documents that clients load; with None all clients wait meanwhile.
        shelf: lists what can be loaded; None for no lists.
        worker: draws what cameras and lidars see; None where nothing can.

    Raises:
        DocumentError: the scenario does not fit its map, or the network settings do not fit.
    """
    chosen = settings or NodeSettings()
    context = _make_context(bus, world, library, scenario, chosen, reader or AtOnce())
    weather = WeatherControl(context, chosen.weather, rain_friction=chosen.rain_friction)
    mounted = MountedSensors(
        context, chosen.sensors, worker, weather, noise=chosen.sensor_noise, is_dressed=chosen.is_dressed
    )
    sensors = Sensors(context, archive, chosen.sensor_noise, mounted=mounted)
    CommandExecutor(context, sensors)
    replay = Replay(context, recordings, is_showing_drives=chosen.replay_info)
    road_services = RoadServices(context)
    forget = context.egos.forget_statuses
    traffic = Traffic(context.scene, context.hooks, forget, chosen.traffic, wanders=chosen.traffic_wander)
    commands = CommandTopics(context)
    components: list[Component] = [
        StatePublishers(context),
        TrafficLightTopics(context),
        sensors,
        mounted,
        SensorService(context, mounted),
        weather,
        Loads(context, networks, has_traffic=chosen.traffic > 0),
        Services(context),
        commands,
        replay,
        StepService(context),
        BarrierServices(context),
        RealTimeFactor(context),
        ControlLeases(context),  # before Drivers, which forgets who drove when a client leaves
        Population(context),
        road_services,
        SceneState(context, road_services),
        SceneMesh(context, road_services, is_dressed=chosen.is_dressed),
        Contacts(context),
        Drivers(context),
        Describe(context),
        SceneMarkers(context),
        Scenarios(context, shelf),
        traffic,
        stories := Stories(context, weather.set),
        Scores(context, stories.verdict, is_always=chosen.score),
    ]
    if chosen.standard_topics:
        components += [
            StandardTopics(context, commands, chosen.sensor_noise, frames=chosen.tf_frames, cmd_vel=chosen.cmd_vel),
            RobotDescription(context),
        ]
    # The last one: its hash covers what all others do behind a frame.
    components.append(Snapshots(context, components, replay, recordings))
    set_real_time_factor(context, chosen.real_time_factor, 0.0)
    return SimulatorNode(context, components)


def _make_context(  # noqa: PLR0917 - the arguments of `make_node`
    bus: Bus, world: World, library: Library, scenario: Scenario, settings: NodeSettings, reader: Reader
) -> SimulatorContext:
    """Return what the components share, with the opening scene in the world; nothing is on the bus yet.

    Raises:
        DocumentError: the scenario does not fit its map.
    """
    is_external = settings.start_mode == "external"
    participant = SimulatorParticipant()
    convert = Converter(bus.store, settings.profile)
    scene = Scene(
        world,
        library,
        scenario,
        ego_gear=Gear.DRIVE if is_external else Gear.PARK,
        speed_limits=settings.speed_limits,
        catalogue=settings.catalogue,
    )
    ctrl_mode = CtrlMode.EXTERNAL if is_external else CtrlMode.KEYBOARD
    roads = partial(attrgetter("road_map.roads"), scene)
    egos = EgoRegistry(world, convert, ctrl_mode, roads=roads, sensor_frames=SENSOR_FRAMES)
    sync: Sync[SceneCommand] = Sync(
        is_on=settings.start == "sync",
        on_loss=settings.sync_on_loss,
        lease=settings.sync_lease,
        is_strict=settings.sync_frames == "strict",
        may_anyone_stop=settings.anyone_may_stop,
    )
    barrier = Barrier(
        sync,
        lease=settings.sync_lease,
        is_strict=settings.sync_frames == "strict",
        may_anyone_stop=settings.anyone_may_stop,
    )
    hooks = Hooks()
    interfaces = InterfaceRegistry(participant, bus, settings.network)
    publishers = Publishers(participant, bus, interfaces)
    failure = WorldFailure(participant, bus, interfaces, is_serving_on=settings.on_world_failure == "serve")
    # These four have a topic each; it goes out in this order, before those of the components.
    time = SimulationTime(bus, world, convert, publishers)
    wheels = partial(find_wheels, world) if settings.standard_topics else None
    transforms = TfPublisher(bus.store, world, convert, settings.tf_frames, wheels)
    publishers.add("/tf", TF, lambda: transforms.moving(egos), is_exclusive=False)
    sync_info = SyncInfo(bus.store, world, sync, publishers)
    static_tf = StaticTf(transforms, egos, publishers)
    parts = SimulatorParts(
        bus=bus,
        participant=participant,
        world=world,
        library=library,
        convert=convert,
        scene=scene,
        egos=egos,
        sync=sync,
        barrier=barrier,
        hooks=hooks,
        warnings=WarnOnce(),
        interfaces=interfaces,
        publishers=publishers,
        failure=failure,
        time=time,
        pacer=RealTimePacer(),
        sync_info=sync_info,
        static_tf=static_tf,
        gate=FrameGate(),
        reader=reader,
    )
    stepper = FrameStepper(parts, step)
    sync_driver = SyncDriver(parts, stepper)
    ego_interfaces = EgoInterfaces(parts)
    return SimulatorContext(
        **asdict(parts),
        projection_import=ProjectionImport(parts, GpsSpec.load_library),
        command_wait=CommandWait(parts, settings.command_deadline),
        stepper=stepper,
        sync_driver=sync_driver,
        late_work=LateWork(sync_driver, bus.guard),
        ego_interfaces=ego_interfaces,
        scene_changes=SceneChanges(parts, stepper, sync_driver, ego_interfaces),
    )
