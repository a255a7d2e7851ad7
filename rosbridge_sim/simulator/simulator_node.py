"""The simulator as one ROS node: its topics and services on the bus, connected to the world and to its mode.

`SimulatorNode` joins a context and its components; the shell uses nothing else of them. The world moves in two ways,
and both end in `FrameStepper.compute`:

- real time: the shell calls `advance` at the time that `next_due` returns; `advance` computes the frames that are due;
- synchronous mode: a service call computes the frames of one time step within the call (`SyncDriver`).
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from typing import Literal, TypeVar

from rosbridge_sim.graph.participant import Participant
from rosbridge_sim.morai.releases import MANUAL, Profile, SpeedLimits, advise_release
from rosbridge_sim.records import Record
from rosbridge_sim.scenarios.catalogue import BUILT_IN, Catalogue
from rosbridge_sim.scenery.pictures import Weather
from rosbridge_sim.simulator.bus.network_settings import DEFAULTS, InterfaceKind, NetworkSettings
from rosbridge_sim.simulator.bus.subscribers_services import SubscribersServices
from rosbridge_sim.simulator.egos.ego import Ego
from rosbridge_sim.simulator.egos.tf_publisher import TfFrames
from rosbridge_sim.simulator.kernel.component import Component
from rosbridge_sim.simulator.kernel.context import SimulatorContext
from rosbridge_sim.simulator.kernel.real_time import RealTime, set_real_time_factor
from rosbridge_sim.simulator.markers.scene_markers import SCENE_MAP, SCENE_OBJECTS
from rosbridge_sim.simulator.sensor_rigs.mounted_sensors import MountedSensors
from rosbridge_sim.simulator.sensor_services.missing_sensors import advise
from rosbridge_sim.simulator.sensors.sensor_noise import SensorNoise
from rosbridge_sim.simulator.sensors.sensor_specs import Rig
from rosbridge_sim.simulator.standard_topics import CmdVel

_log = logging.getLogger("rosbridge_sim.morai")
C = TypeVar("C", bound=Component)


class NodeSettings(Record):
    """Options of the simulator; the fields are named after the program's flags.

    Attributes:
        profile: units and orders where the manual and client code disagree.
        start: run in real time, or stand at frame 0 until the first master starts synchronous mode.
        start_mode: external control in gear D, or keyboard control in gear P as MORAI starts.
        speed_limits: of the egos' speed mode; None for those of their models.
        network: names, switches and rates of the simulator's topics and services.
        sync_frames: `strict` requires that a tick names the frame that it will end on.
        sync_lease: silence after which a master is lost [s]; with None only its departure counts.
        sync_on_loss: state of the world after its master is lost.
        anyone_may_stop: let other clients than the master stop synchronous mode.
        catalogue: the models that clients name.
        real_time_factor: how fast the world runs while real time moves it; see `RealTimePacer`.
        replay_info: publish ReplayInfo of any drive for all subscribers, also for those that subscribe to every topic.
        score: keep scores of the egos from frame 0 on, with and without a listener.
        traffic: vehicles on the lanes besides those of the scenario, at most.
        traffic_wander: these vehicles wander within their lanes.
        sensor_noise: errors of GPS and IMU; None for exact readings.
        sensors: cameras, lidars and radars of each ego.
        weather: light and air of what cameras and lidars see, at the start.
        rain_friction: friction of the ground in rain, relative to a dry one; 0 for rain that changes none.
        is_dressed: they see buildings, trees and posts beside the roads.
        standard_topics: publish and take standard messages of ROS beside MORAI's.
        tf_frames: frames above `base_link` on `/tf`.
        cmd_vel: type of `/cmd_vel`.
        command_deadline: in real time each frame waits so long for a command [s]; None for no wait.
        on_world_failure: `exit` raises the exception of a failed step to the caller of `advance`; `serve` stops the
            world and refuses every call.
    """

    profile: Profile = MANUAL
    start: Literal["run", "sync"] = "run"
    start_mode: Literal["external", "keyboard"] = "external"
    speed_limits: SpeedLimits | None = None
    network: NetworkSettings = DEFAULTS
    sync_frames: Literal["lenient", "strict"] = "lenient"
    sync_lease: float | None = None
    sync_on_loss: Literal["run", "pause", "wait"] = "run"
    anyone_may_stop: bool = False
    catalogue: Catalogue = BUILT_IN
    real_time_factor: float = 1.0
    replay_info: bool = False
    score: bool = False
    traffic: int = 0
    traffic_wander: bool = True
    sensor_noise: SensorNoise | None = None
    sensors: Rig = ()
    weather: Weather = Weather.NOON
    rain_friction: float = 0.0
    is_dressed: bool = True
    on_world_failure: Literal["exit", "serve"] = "exit"
    standard_topics: bool = False
    tf_frames: TfFrames = "map"
    cmd_vel: CmdVel = "Twist"
    command_deadline: float | None = None


class SimulatorNode:
    """The simulator, as the shell sees it.

    Attributes:
        context: shared by its components.
        components: in the order in which their topics are published with a frame.
        participant: the owner of all topics and services of the simulator.
        interfaces: all of these, by name.
        world: the state of all entities.
        scene: the population and the map.
        sync: synchronous mode.
        egos: the egos, in order.
        advance, next_due: compute the frames that real time owes; see `RealTime`.
    """

    def __init__(self, context: SimulatorContext, components: Sequence[Component]) -> None:
        """Put all topics and services on the bus, and announce the opening scene.

        Args:
            components: made from this context; their topics are published in this order.

        Raises:
            DocumentError: the network settings name a missing item or cannot be used.
        """
        self.context = context
        self.components = tuple(components)
        self.participant, self.interfaces = context.participant, context.interfaces
        self.world, self.scene, self.sync, self.egos = context.world, context.scene, context.sync, context.egos
        self._real_time = RealTime(context)
        self.advance, self.next_due = self._real_time.advance, self._real_time.next_due
        bindings = SubscribersServices(context.interfaces)
        for component in self.components:
            component.publish_ego(context.egos.first, bindings.prefix, context.publishers)
            component.publish(context.publishers)
            component.bind(bindings)
            component.bind_ego(context.egos.first, bindings)
        context.hooks.on_new_ego.append(self._open_ego)
        context.interfaces.open()
        self._left: list[Participant] = []  # those that left while frames were computed
        context.hooks.after_move.append(self._tell_left)
        context.hooks.after_move.rest(self._tell_left)
        context.bus.on_leave.append(self._note_left)
        has_topic_like = self.component(MountedSensors).has_topic_like
        context.bus.unpublished.advise = lambda topic: advise(topic, has_topic_like)
        context.bus.unpublished.advise_name = self._advise_name
        context.time.follow()
        context.sync_info.announce(0.0)
        context.static_tf.announce(0.0)

    def _advise_name(self, name: str) -> str:
        """Return which release has a name that this one lacks; empty for one that is here under another name."""
        return advise_release(name) if not name.startswith("/") or self.context.interfaces.is_elsewhere(name) else ""

    def reset(self, seed: int | None, now: float) -> None:
        """Reset the world to its start; see `SceneChanges.reset`.

        Args:
            seed: random seed; None keeps the current one.
        """
        self.context.scene_changes.reset(seed, now)

    def use_wall_time(self, read_ns: Callable[[], int], now: float) -> None:
        """Stamp headers, /clock and tf with the time of day from now on, and publish the latched messages anew.

        Args:
            read_ns: returns the time of day [ns], which must never go back; called once for each frame.
        """
        context = self.context
        if context.pacer.factor != 1.0:
            _log.warning(
                "stamps are the time of day from now on: the real-time factor is 1, not %g", context.pacer.factor
            )
            set_real_time_factor(context, 1.0, now)
        context.time.use_wall_time(read_ns)
        context.egos.forget_statuses()
        context.publishers.show_latched(now)
        context.static_tf.announce_again(now)

    def real_time_lag(self, now: float) -> float:
        """Return the delay of the world behind real time.

        Returns:
            The delay [s]; 0.0 while real time does not move the world.
        """
        context = self.context
        if not (context.sync.is_free and context.pacer.is_started) or context.failure.why is not None:
            return 0.0
        return max(0.0, now - context.pacer.due_at) if context.pacer.factor else 0.0

    def limit_turns(self, read_clock: Callable[[], float]) -> None:
        """End each turn of work that is owed after a few milliseconds of this clock [s], so that others have theirs."""
        self.context.sync_driver.read_clock = self._real_time.read_clock = read_clock
        self.context.late_work.has_turns = True

    def scene_topics(self) -> tuple[str, ...]:
        """Return the present names of the topics for viewers; another bridge gets them on request alone."""
        name_of = self.context.interfaces.name_of
        return tuple(name_of(InterfaceKind.PUBLISHER, topic) for topic in (SCENE_MAP, SCENE_OBJECTS))

    def component(self, kind: type[C]) -> C:
        """Return the component of a class, of which there is one."""
        return next(each for each in self.components if isinstance(each, kind))

    def _open_ego(self, ego: Ego, bindings: SubscribersServices) -> None:
        """Add the topics and services of a further ego."""
        for component in self.components:
            component.publish_ego(ego, bindings.prefix, self.context.publishers)
            component.bind_ego(ego, bindings)

    def _note_left(self, participant: Participant, now: float) -> None:
        """Tell the components and synchronous mode of a departure: after a frame, if one is in progress.

        The population must not change within a frame, on a message of which a connection may fail.
        """
        context = self.context
        context.warnings.forget(participant)
        if context.failure.why is not None:
            return
        if context.stepper.is_moving:
            self._left.append(participant)
            context.hooks.after_move.wake(self._tell_left)
            return
        for act in context.hooks.on_leave:  # a failure here must not keep the world waiting for a lost master
            context.bus.guard.attempt("what follows an owner's end", act, participant, now)
        context.sync_driver.leave(participant, now)

    def _tell_left(self, now: float) -> None:
        self.context.hooks.after_move.rest(self._tell_left)
        left, self._left = self._left, []
        for participant in left:
            self._note_left(participant, now)
