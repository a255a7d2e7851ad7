"""The component of cameras, lidars and radars: their topics, their jobs, and `/sim/sensors`.

All egos begin with the same rig. A sensor is read at the frames that its rate names, and only while somebody listens. A
radar is read at once. What cameras and lidars see is drawn by the worker of the shell, from copies of the frame:

- In synchronous mode the gate behind the frame stays closed until the messages are out. So they come before the answer
  of the tick, and before the next frame.
- In real time a job is given only while the worker has none. A sensor that was due meanwhile is read at the next frame
  at which the worker is free, and has the stamp of that frame. So nothing waits, and no sensor starves beside another.

These messages come behind all others of their frame, also behind `/SyncModeInfo`.
"""

from __future__ import annotations

import json
import logging
import math
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any, Final

from rosbridge_sim.errors import DocumentError, FieldError, PeerError
from rosbridge_sim.graph.topics_services import Call
from rosbridge_sim.loose_types import Struct
from rosbridge_sim.morai.messages.convert import maker
from rosbridge_sim.scenery.camera_geometry import Pose
from rosbridge_sim.scenery.scene_frame import EgoLook, SceneFrame, take_frame
from rosbridge_sim.simulator.bus.network_settings import InterfaceKind
from rosbridge_sim.simulator.bus.publisher_kinds import PeriodicPublisher
from rosbridge_sim.simulator.bus.publishers import Publishers
from rosbridge_sim.simulator.bus.subscribers_services import SubscribersServices
from rosbridge_sim.simulator.kernel.component import Component
from rosbridge_sim.simulator.kernel.context import SimulatorContext
from rosbridge_sim.simulator.kernel.ego import Ego
from rosbridge_sim.simulator.kernel.ego_lamps import lamps_of
from rosbridge_sim.simulator.kernel.tf_publisher import frame_prefix
from rosbridge_sim.simulator.plain.plain_bytes import PlainData
from rosbridge_sim.simulator.plain.typed_plain import read_as
from rosbridge_sim.simulator.sensors.drawing import Cloud, DrawingJob, Result, Scan, SensorWorker, Shot, Sight
from rosbridge_sim.simulator.sensors.lidar_sweep import Motion
from rosbridge_sim.simulator.sensors.radar_echoes import find_echoes
from rosbridge_sim.simulator.sensors.sensor_messages import SensorMessages
from rosbridge_sim.simulator.sensors.sensor_presets import parse_object, read_rig, read_text
from rosbridge_sim.simulator.sensors.sensor_specs import (
    FRAME_RATE,
    CameraSpec,
    Lidar2dSpec,
    Lidar3dSpec,
    RadarSpec,
    Rig,
    SensorSpec,
    check_rig,
    is_due,
    topics_of,
)
from rosbridge_sim.simulator.sensors.sensor_table import SENSOR_FRAMES
from rosbridge_sim.suggestions import hint
from rosbridge_sim.world.vehicle.sensor_readings import Mounting

__all__ = ["MountedSensors"]

MAX_CAPTURES: Final = 4
"""Captures that are drawn at once: each has copies of its frame, and pictures of up to 25 MB."""

MEASURED_FRAMES: Final = 100
"""Frames over which a rate is measured: two seconds."""

_log = logging.getLogger("rosbridge_sim.morai")


@dataclass(slots=True, eq=False)
class _Mounted:
    """One sensor of an ego.

    Attributes:
        spec: as it was chosen; where it is now is in the ego's `mountings`.
        publishers: of its topics, in the order of `topics_of`.
        frames: at which it was read last.
        num_skipped: messages that were left out because the worker had another job.
        is_owed: it was due while the worker had another job.
    """

    spec: SensorSpec
    publishers: list[PeriodicPublisher]
    frames: deque[int] = field(default_factory=lambda: deque(maxlen=MEASURED_FRAMES))
    num_skipped: int = 0
    is_owed: bool = False


@dataclass(slots=True, eq=False)
class _EgoRig:
    """The sensors of one ego.

    Attributes:
        ego: the ego.
        prefix: of its topics.
        sensors: by number, behind GPS and IMU.
        publishers: by the default names of the topics, without the prefix.
    """

    ego: Ego
    prefix: str
    sensors: list[_Mounted] = field(default_factory=list)
    publishers: dict[str, PeriodicPublisher] = field(default_factory=dict)


Finish = Callable[[Result, float], None]
"""Uses the result of a sight; takes monotonic time [s], too."""


@dataclass(slots=True)
class _Plan:
    """A job that grows: what is to be seen, and what becomes of each result."""

    sights: list[Sight] = field(default_factory=list)
    finishes: list[Finish] = field(default_factory=list)


class MountedSensors(Component):
    """The component of cameras, lidars and radars."""

    def __init__(self, context: SimulatorContext, rig: Rig = (), worker: SensorWorker | None = None) -> None:
        """Read nothing yet.

        Args:
            context: of the simulator.
            rig: of each ego at the start.
            worker: draws; None where nothing can, so that there are radars alone.

        Raises:
            DocumentError: an ego cannot have these sensors here.
        """
        self._context = context
        self._start_rig = rig
        self._worker = worker
        self._rigs: dict[int, _EgoRig] = {}  # by the egos' numbers
        self._messages = SensorMessages(context.bus.store)
        self._epoch = 0  # number of resets and restores
        self._num_failures = 0
        self._num_captures = 0  # being drawn
        store = context.bus.store
        self._make_info = maker(
            store,
            "rosbridge_sim_msgs/SensorInfo",
            *("number", "kind", "frame_id", "topics", "rate", "measured", "skipped"),
            *("x", "y", "z", "roll", "pitch", "yaw", "settings"),
        )
        why = self._why_no_worker(rig)
        if why:
            raise DocumentError(f"sensors: {why}")
        context.hooks.after_frame.append(self._after_frame)
        context.hooks.on_reset.append(self._reset)
        context.hooks.on_restore.append(self._forget_jobs)

    # The topics and the service

    def publish_ego(self, ego: Ego, prefix: str, publishers: Publishers) -> None:  # noqa: ARG002 - those of the context
        """Give the ego the rig of the start."""
        self._rigs[ego.index] = _EgoRig(ego, prefix)
        self._mount(self._rigs[ego.index], self._start_rig, 0.0)

    def bind(self, bindings: SubscribersServices) -> None:
        """Offer the service."""
        bindings.provide("sim/sensors", "rosbridge_sim_msgs/Sensors", self._serve)

    def has_topic_like(self, type_name: str) -> bool:
        """Return whether a sensor of the first ego publishes messages of a type."""
        rig = self._rigs[self._context.egos.first.index]
        return any(one.topic is not None and one.type_name == type_name for one in rig.publishers.values())

    def _mount(self, rig: _EgoRig, specs: Rig, now: float) -> None:
        """Give an ego another rig; a sensor that stays keeps its figures.

        Raises:
            GraphError: a client has given one of the topics another type. Nothing has changed.
        """
        rig.publishers = self._bind_topics(rig, specs, now)
        before = {mounted.spec: mounted for mounted in rig.sensors}
        rig.sensors = []
        for spec in specs:
            own = [rig.publishers[name] for name, _ in topics_of(spec)]
            mounted = before.get(spec) or _Mounted(spec, own)
            mounted.publishers = own
            rig.sensors.append(mounted)
        ego = rig.ego
        usual = {frame: ego.mountings[frame] for frame in SENSOR_FRAMES}
        ego.mountings = usual | {
            spec.frame_id: ego.mountings[spec.frame_id] if spec in before else spec.mounting for spec in specs
        }
        ego.optical_frames = tuple(spec.frame_id for spec in specs if isinstance(spec, CameraSpec))

    def _bind_topics(self, rig: _EgoRig, specs: Rig, now: float) -> dict[str, PeriodicPublisher]:
        """Return the publishers that a rig needs; those that it does not need any longer are gone.

        Raises:
            GraphError: see `_mount`.
        """
        wanted = {topic: spec.rate for spec in specs for topic in topics_of(spec)}
        kept = {name: one for name, one in rig.publishers.items() if (name, one.type_name) in wanted}
        gone = {name: one for name, one in rig.publishers.items() if name not in kept}
        for publisher in gone.values():
            self._context.publishers.drop(publisher, now)
        new: dict[str, PeriodicPublisher] = {}
        try:
            for (name, type_name), rate in wanted.items():
                if name not in kept:
                    new[name] = self._add_topic(rig, name, type_name, rate)
        except PeerError:
            for publisher in new.values():
                self._context.publishers.drop(publisher, now)
            rig.publishers = kept | {
                name: self._add_topic(rig, name, one.type_name, one.rate or FRAME_RATE) for name, one in gone.items()
            }
            for mounted in rig.sensors:
                mounted.publishers = [rig.publishers[name] for name, _ in topics_of(mounted.spec)]
            raise
        return kept | new

    def _add_topic(self, rig: _EgoRig, name: str, type_name: str, rate: float) -> PeriodicPublisher:
        full = rig.prefix + name[1:]
        return self._context.publishers.add(full, type_name, _nothing, rate=rate, is_sampled=True)

    def _why_no_worker(self, specs: Sequence[SensorSpec]) -> str:
        """Return why some sensors cannot be served; empty if they can."""
        drawn = [spec for spec in specs if not isinstance(spec, RadarSpec)]
        if not drawn:
            return ""
        if self._worker is None:
            return "this simulator draws nothing: radars alone are possible"
        return self._worker.why_not(drawn)

    # The frames

    def _egos_with_sensors(self) -> Iterator[tuple[Ego, _EgoRig]]:
        for ego in self._context.egos:
            rig = self._rigs.get(ego.index)
            if rig is not None and rig.sensors and rig.ego is ego and ego.is_there:
                yield ego, rig

    def _after_frame(self, now: float) -> None:
        """Read the sensors that are due, or have them drawn."""
        worker, is_tick = self._worker, not self._context.sync.is_free
        is_free = is_tick or (worker is not None and not worker.is_busy)
        # A plan for each ego: a turn of the loop then has the messages of one ego alone.
        plans = [self._plan(ego, rig, is_free, now) for ego, rig in self._egos_with_sensors()]
        if worker is not None and any(plan.sights for plan in plans):
            seen = self._look()
            for plan in plans:
                if plan.sights:
                    self._submit(worker, plan, seen, is_tick=is_tick)

    def _plan(self, ego: Ego, rig: _EgoRig, is_free: bool, now: float) -> _Plan:  # noqa: FBT001 - by position
        """Read the radars of an ego that are due; return what is to be drawn for its other sensors."""
        plan, frame = _Plan(), self._context.world.frame
        for mounted in rig.sensors:
            spec = mounted.spec
            is_now = is_due(self._rate_of(rig, mounted), frame)
            if not (is_now or mounted.is_owed):
                continue
            wanted = [_is_wanted(publisher) for publisher in mounted.publishers]
            if not any(wanted):
                mounted.is_owed = False
            elif isinstance(spec, RadarSpec):
                self._read_radar(ego, mounted, spec, now)
            elif self._worker is None:
                continue
            elif is_free:
                mounted.is_owed = False
                self._add(plan, ego, mounted, wanted, now)
            else:
                mounted.num_skipped += is_now and mounted.is_owed
                mounted.is_owed = True
        return plan

    def _rate_of(self, rig: _EgoRig, mounted: _Mounted) -> float:
        """Return the rate of a sensor: that of the network settings, if they have one for its topic [Hz]."""
        choice = self._context.interfaces.settings.choice(InterfaceKind.PUBLISHER, mounted.spec.topic, rig.prefix)
        return min(choice.rate or mounted.spec.rate, FRAME_RATE)

    def _read_radar(self, ego: Ego, mounted: _Mounted, spec: RadarSpec, now: float) -> None:
        world = self._context.world
        echoes = find_echoes(world, ego.row, ego.mountings[spec.frame_id], spec)
        mounted.frames.append(world.frame)
        self._context.publishers.deliver(
            mounted.publishers[0], self._messages.detections(self._header(ego, spec), echoes), now
        )

    def _header(self, ego: Ego, spec: SensorSpec) -> Struct:
        return self._context.convert.header(self._context.world.frame, frame_prefix(ego) + spec.frame_id)

    def _add(self, plan: _Plan, ego: Ego, mounted: _Mounted, wanted: Sequence[bool], now: float) -> None:
        """Add what a sensor sees to a job, and what becomes of it."""
        spec = mounted.spec
        assert not isinstance(spec, RadarSpec), "it is read at once"
        header, frame = self._header(ego, spec), self._context.world.frame
        has_boxes = False
        if isinstance(spec, CameraSpec):
            if wanted[1]:
                self._context.publishers.deliver(mounted.publishers[1], self._messages.camera_info(spec, header), now)
            if not (wanted[0] or wanted[2]):
                mounted.frames.append(frame)
                return
            has_boxes = wanted[2]

        def finish(result: Result, now: float) -> None:
            mounted.frames.append(frame)
            self._publish(mounted, header, result, now)

        plan.sights.append(Sight(spec, self._motion(ego, spec), ego.index, has_boxes=has_boxes))
        plan.finishes.append(finish)

    def _motion(self, ego: Ego, spec: SensorSpec) -> Motion:
        world, row, mounting = self._context.world, ego.row, ego.mountings[spec.frame_id]
        place = (world.x, world.y, world.z, world.roll, world.pitch, world.yaw)
        vehicle = Pose(*(column.item(row) for column in place))
        own = Pose(*mounting.place, mounting.roll, mounting.pitch, mounting.yaw)
        return Motion(vehicle, own, world.speed.item(row), world.yaw_rate.item(row))

    def _look(self) -> SceneFrame:
        """Return a copy of what can be seen now."""
        context, world = self._context, self._context.world
        return take_frame(
            world, [EgoLook(ego.row, ego.index, lamps_of(ego, world)) for ego in context.egos if ego.is_there]
        )

    def _submit(
        self,
        worker: SensorWorker,
        plan: _Plan,
        seen: SceneFrame,
        *,
        is_tick: bool,
        end: Callable[[Exception | None, float], None] | None = None,
    ) -> None:
        context, epoch = self._context, self._epoch
        found = context.scene.found_map
        job = DrawingJob(found.road_map, found.name, context.world.seed, seen, tuple(plan.sights))

        def then(results: Sequence[Result] | Exception, now: float) -> None:
            try:
                if isinstance(results, Exception):
                    self._note_failure(results)
                elif epoch == self._epoch or end is not None:  # a file is of the frame that was asked for
                    for finish, result in zip(plan.finishes, results, strict=True):
                        finish(result, now)
                if end is not None:
                    end(results if isinstance(results, Exception) else None, now)
            finally:
                if is_tick:
                    context.gate.open(now)

        if is_tick:
            context.gate.close()
        worker.submit(job, then)

    def _note_failure(self, error: Exception) -> None:
        """Log that pictures could not be made: the first time, since the next frame has the same problem."""
        if not self._num_failures:
            _log.error("cameras and lidars cannot be served: %s", error)
        self._num_failures += 1

    def _publish(self, mounted: _Mounted, header: Struct, result: Result, now: float) -> None:
        """Publish what a sensor has seen, on those of its topics that are still there."""
        spec, messages, deliver = mounted.spec, self._messages, self._context.publishers.deliver
        own = mounted.publishers
        if isinstance(result, Shot):
            assert isinstance(spec, CameraSpec), "a picture is of a camera"
            if _is_wanted(own[0]):
                deliver(own[0], messages.picture(spec, header, result), now)
            if result.boxes is not None:
                deliver(own[2], messages.boxes(header, result.boxes), now)
        elif isinstance(result, Scan):
            assert isinstance(spec, Lidar2dSpec), "ranges are of a 2D lidar"
            deliver(own[0], messages.scan(spec, header, result), now)
        elif isinstance(result, Cloud):
            cloud = messages.cloud(header, result)
            for publisher in own:
                if _is_wanted(publisher):
                    deliver(publisher, cloud, now)

    # Files

    def draw_files(self, ego: Ego, then: Callable[[Mapping[str, bytes] | Exception, float], None]) -> bool:
        """Have the cameras and 3D lidars of an ego drawn for files: the frame of now.

        Args:
            ego: the ego.
            then: called once with the contents by file names, and monotonic time [s]; `{}` in a name stands for the
                name of the capture. In synchronous mode the next tick waits for it.

        Returns:
            False if there is nothing to draw; then `then` is not called.

        Raises:
            DocumentError: too many captures are being drawn already.
        """
        rig, worker = self._rigs.get(ego.index), self._worker
        specs = (
            [] if rig is None else [one.spec for one in rig.sensors if isinstance(one.spec, CameraSpec | Lidar3dSpec)]
        )
        if worker is None or not specs:
            return False
        if self._num_captures >= MAX_CAPTURES:
            raise DocumentError(f"{MAX_CAPTURES} captures are being drawn already; expected fewer at once")
        self._num_captures += 1
        prefix = frame_prefix(ego)
        plan, files = _Plan(), dict[str, bytes]()
        for spec in specs:
            plan.sights.append(Sight(spec, self._motion(ego, spec), ego.index, is_for_file=True))
            is_camera = isinstance(spec, CameraSpec)
            kind, suffix = ("CAMERA", "jpeg") if is_camera else ("LIDAR", "bin")
            plan.finishes.append(partial(_keep_file, files, f"{prefix}{kind}_{spec.frame_id}_{{}}.{suffix}"))

        def end(error: Exception | None, now: float) -> None:
            self._num_captures -= 1
            then(files if error is None else error, now)

        self._submit(worker, plan, self._look(), is_tick=not self._context.sync.is_free, end=end)
        return True

    # Reset and snapshots

    def _forget_jobs(self) -> None:
        """Drop what is being drawn of the world before."""
        self._epoch += 1
        for rig in self._rigs.values():
            for mounted in rig.sensors:
                mounted.frames.clear()
                mounted.is_owed, mounted.num_skipped = False, 0

    def _reset(self) -> None:
        """Give all egos the rig of the start, where it was."""
        self._forget_jobs()
        for ego in self._context.egos:
            rig = self._rigs[ego.index]
            self._mount(rig, self._start_rig, 0.0)
            ego.mountings |= {spec.frame_id: spec.mounting for spec in self._start_rig}

    def save_state(self) -> PlainData:
        """Return the rig of each ego, where it is not that of no sensors; the places are those of the egos."""
        rigs = [
            (ego.index, [_text_of(mounted.spec) for mounted in rig.sensors]) for ego, rig in self._egos_with_sensors()
        ]
        return rigs or None

    def load_state(self, data: PlainData, now: float) -> None:
        """Have the saved rigs; see `Component.load_state`."""
        saved_rigs = read_as(tuple[tuple[int, tuple[str, ...]], ...], () if data is None else data, "sensors")
        rigs: dict[int, Rig] = {}
        for index, texts in saved_rigs:
            rig = tuple(spec for text in texts for spec in read_text(text, "sensors"))
            check_rig(rig)
            rigs[index] = rig
        egos = {ego.index: ego for ego in self._context.egos}
        if not rigs.keys() <= egos.keys():
            raise ValueError("expected sensors of egos that are there")
        for index, ego in egos.items():
            specs, saved = rigs.get(index, ()), dict(ego.mountings)
            if list(saved) != [*SENSOR_FRAMES, *(spec.frame_id for spec in specs)]:
                raise ValueError(f"expected a place for each sensor of ego {index}")
            self._mount(self._rigs[index], specs, now)
            ego.mountings = saved

    # /sim/sensors

    def _serve(self, call: Call, now: float) -> None:
        request: Any = call.request
        respond = call.service.type.response.struct_type
        ego = self._context.egos.find(request.ego)
        if ego is None:
            numbers = ", ".join(str(one.index) for one in self._context.egos)
            message = f"ego: expected the number of an ego, one of {numbers}; got {request.ego}"
            call.answer(respond(result=False, message=message))
            return
        rig, message = self._rigs[ego.index], ""
        try:
            if request.remove or request.add or request.move:
                self._change(rig, request, now)
        except (PeerError, DocumentError) as error:
            message = str(error)
        call.answer(respond(result=not message, message=message, sensors=self._list(rig)))

    def _change(self, rig: _EgoRig, request: Any, now: float) -> None:  # noqa: ANN401 - a generated struct
        """Remove, add and move sensors.

        Raises:
            DocumentError: a text is no sensor, or no place.
            PeerError: an ego cannot have these sensors together, or there is no such sensor. Nothing has changed.
        """
        ego = rig.ego
        specs = [mounted.spec for mounted in rig.sensors]
        for name in request.remove:
            specs = [spec for spec in specs if spec.frame_id != self._find(rig, name, "remove").spec.frame_id]
        added = read_text(request.add, "add") if request.add else ()
        specs += added
        check_rig(specs)
        why = self._why_no_worker(added)
        if why:
            raise FieldError(f"add: {why}")
        moved = self._read_moves(request.move, {spec.frame_id: spec for spec in specs}, ego)
        self._mount(rig, tuple(specs), now)
        ego.mountings |= moved
        self._context.static_tf.announce(now)
        _log.info("ego %d: %d cameras, lidars and radars", ego.index, len(specs))

    def _find(self, rig: _EgoRig, name: str, where: str) -> _Mounted:
        for mounted in rig.sensors:
            if mounted.spec.frame_id == name:
                return mounted
        known = [mounted.spec.frame_id for mounted in rig.sensors]
        raise FieldError(
            f"{where}: expected one of {', '.join(known) or 'no sensors'}, got {name[:80]!r}{hint(name, known)}"
        )

    def _read_moves(self, texts: Sequence[str], specs: dict[str, SensorSpec], ego: Ego) -> dict[str, Mounting]:
        """Return new places by frame.

        Raises:
            DocumentError: one of them is none, or names no sensor.
        """
        moved: dict[str, Mounting] = {}
        for i, text in enumerate(texts):
            where = f"move[{i}]"
            values = parse_object(text, where)
            name = values.pop("frame_id", None)
            spec = specs.get(name) if isinstance(name, str) else None
            if spec is None:
                known = ", ".join(specs) or "no sensors"
                raise DocumentError(f"{where}.frame_id: expected one of {known}, got {str(name)[:80]!r}")
            keys = ("x", "y", "z", "roll", "pitch", "yaw")
            unknown = [key for key in values if key not in keys]
            if unknown:
                raise DocumentError(
                    f"{where}.{unknown[0][:40]}: expected one of {', '.join(keys)}{hint(unknown[0], keys)}"
                )
            here = ego.mountings.get(spec.frame_id, spec.mounting)
            table = _place_of(here) | values
            (checked,) = read_rig({spec.kind: [spec.model_dump(mode="json") | table]}, where)
            moved[spec.frame_id] = checked.mounting
        return moved

    def _list(self, rig: _EgoRig) -> list[Struct]:
        frame, infos = self._context.world.frame, []
        for i, mounted in enumerate(rig.sensors):
            spec = mounted.spec
            place = _place_of(rig.ego.mountings[spec.frame_id])
            num = sum(one > frame - MEASURED_FRAMES for one in mounted.frames)
            infos.append(
                self._make_info(
                    len(SENSOR_FRAMES) + i,
                    spec.kind,
                    spec.frame_id,
                    [one.topic.name for one in mounted.publishers if one.topic is not None],
                    self._rate_of(rig, mounted),
                    num * FRAME_RATE / min(MEASURED_FRAMES, max(frame, 1)),
                    mounted.num_skipped,
                    *place.values(),
                    json.dumps(spec.model_dump(mode="json") | place),
                )
            )
        return infos


def _keep_file(files: dict[str, bytes], name: str, result: Result, _now: float) -> None:
    """Keep the bytes of a file."""
    assert not isinstance(result, Scan), "it has no file"
    files[name] = result.file


def _nothing() -> None:
    """Return no message: those of these topics are delivered behind the frame."""


def _is_wanted(publisher: PeriodicPublisher) -> bool:
    """Return whether somebody wants the messages of a topic."""
    topic = publisher.topic
    return topic is not None and (topic.has_listener or bool(publisher.takers))


def _place_of(mounting: Mounting) -> dict[str, float]:
    """Return a place as specifications have it, with angles in degrees."""
    angles = {name: round(math.degrees(getattr(mounting, name)), 9) for name in ("roll", "pitch", "yaw")}
    return {"x": mounting.x, "y": mounting.y, "z": mounting.z, **angles}


def _text_of(spec: SensorSpec) -> str:
    """Return a specification as the text of a file."""
    return json.dumps({spec.kind: [spec.model_dump(mode="json")]})
