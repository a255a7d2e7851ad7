"""The sensors of one ego on the bus: their topics, and what is known of each."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from typing import Final

from rosbridge_sim.errors import PeerError
from rosbridge_sim.loose_types import Struct
from rosbridge_sim.simulator.bus.network_settings import InterfaceKind
from rosbridge_sim.simulator.bus.publisher_kinds import FRAME_RATE, PeriodicPublisher
from rosbridge_sim.simulator.egos.ego import Ego
from rosbridge_sim.simulator.sensors.sensor_context import SensorContext
from rosbridge_sim.simulator.sensors.sensor_specs import Rig, SensorSpec

MEASURED_FRAMES: Final = 100
"""Frames over which a rate is measured: two seconds."""


@dataclass(slots=True, eq=False)
class MountedSensor:
    """One sensor of an ego.

    Attributes:
        spec: as it was chosen; where it is now is in the ego's `mountings`.
        publishers: of its topics, in the order of `SensorSpec.topics`.
        frames: at which it was read last.
        num_skipped: messages that were left out because the worker had another job.
        is_owed: it was due while the worker had another job.
    """

    spec: SensorSpec
    publishers: list[PeriodicPublisher] = field(default_factory=list)
    frames: deque[int] = field(default_factory=lambda: deque(maxlen=MEASURED_FRAMES))
    num_skipped: int = 0
    is_owed: bool = False


class EgoRig:
    """The sensors of one ego.

    Attributes:
        prefix: of its topics.
        sensors: by number.
        behind: those of them whose messages come behind their frame.
    """

    def __init__(self, shared: SensorContext, ego: Ego, prefix: str, on_mount: Callable[[], object]) -> None:
        """Begin without sensors.

        Args:
            on_mount: called when it has other sensors.
        """
        self.ego = ego
        self.prefix = prefix
        self.sensors: list[MountedSensor] = []
        self.behind: list[MountedSensor] = []
        self._shared, self._context = shared, shared.simulator
        self._on_mount = on_mount
        self._publishers: dict[str, PeriodicPublisher] = {}  # by the default names of the topics, without the prefix

    @property
    def specs(self) -> Rig:
        """The specs of the sensors, in the order of their numbers."""
        return tuple(mounted.spec for mounted in self.sensors)

    def rate_of(self, mounted: MountedSensor) -> float:
        """Return the rate of a sensor: that of the network settings, if they have one for its topic [Hz]."""
        choice = self._context.interfaces.settings.choice(InterfaceKind.PUBLISHER, mounted.spec.topic, self.prefix)
        return min(choice.rate or mounted.spec.rate, FRAME_RATE)

    def has_topic_like(self, type_name: str) -> bool:
        """Return whether a sensor publishes messages of a type."""
        return any(one.topic is not None and one.type_name == type_name for one in self._publishers.values())

    @property
    def topics(self) -> set[str]:
        """The default names of its topics, without the prefix."""
        return set(self._publishers)

    def mount(self, specs: Rig, now: float) -> None:
        """Have other sensors; one that stays keeps its place and its figures.

        Raises:
            GraphError: a client has given one of the topics another type. Nothing has changed.
        """
        self._publishers = self._bind_topics(specs, now)
        before = {mounted.spec: mounted for mounted in self.sensors}
        self.sensors = [before.get(spec) or MountedSensor(spec) for spec in specs]
        for mounted in self.sensors:
            mounted.publishers = [self._publishers[name] for name, _ in mounted.spec.topics]
        self.behind = [mounted for mounted in self.sensors if not mounted.spec.is_on_each_ego]
        ego = self.ego
        ego.mountings = {
            spec.frame_id: ego.mountings[spec.frame_id] if spec in before else spec.mounting for spec in specs
        }
        self._on_mount()
        ego.optical_frames = tuple(spec.frame_id for spec in specs if spec.is_picture)

    def _bind_topics(self, specs: Rig, now: float) -> dict[str, PeriodicPublisher]:
        """Return the publishers that sensors need; those that are not needed any longer are gone.

        Raises:
            GraphError: see `mount`.
        """
        wanted = {topic: spec for spec in specs for topic in spec.topics}
        kept = {name: one for name, one in self._publishers.items() if (name, one.type_name) in wanted}
        gone = {name: one for name, one in self._publishers.items() if name not in kept}
        for publisher in gone.values():
            self._context.publishers.drop(publisher, now)
        new: dict[str, PeriodicPublisher] = {}
        try:
            for (name, type_name), spec in wanted.items():
                if name not in kept:
                    new[name] = self._add_topic(name, type_name, spec)
        except PeerError:
            for publisher in new.values():
                self._context.publishers.drop(publisher, now)
            specs_before = {topic: mounted.spec for mounted in self.sensors for topic in mounted.spec.topics}
            self._publishers = kept | {
                name: self._add_topic(name, one.type_name, specs_before[name, one.type_name])
                for name, one in gone.items()
            }
            for mounted in self.sensors:
                mounted.publishers = [self._publishers[name] for name, _ in mounted.spec.topics]
            raise
        return kept | new

    def _add_topic(self, name: str, type_name: str, spec: SensorSpec) -> PeriodicPublisher:
        return self._context.publishers.add(
            self.prefix + name[1:],
            type_name,
            partial(self._read_in_frame, spec),
            rate=spec.rate,
            is_sampled=True,
            is_second_name=name != spec.topic and type_name == spec.topics[0][1],
        )

    def _read_in_frame(self, spec: SensorSpec) -> Struct | None:
        """Return the message of a sensor, if it belongs to the frame; the others are delivered behind it."""
        message = spec.read(self._shared, self.ego, 0) if spec.is_on_each_ego else None
        if message is not None:
            for mounted in self.sensors:
                if mounted.spec is spec:
                    mounted.frames.append(self._context.world.frame)
        return message


def is_wanted(publisher: PeriodicPublisher) -> bool:
    """Return whether somebody wants the messages of a topic."""
    topic = publisher.topic
    return topic is not None and (topic.has_listener or bool(publisher.takers))
