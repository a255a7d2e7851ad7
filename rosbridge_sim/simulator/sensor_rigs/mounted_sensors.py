"""The component of all sensors: their topics, and the jobs of those that are drawn.

All egos begin with the same rig. A sensor is read at the frames that its rate names, and only while somebody listens.
GPS and IMU are published with their frame. Radars are read at once behind it, at most `MAX_RADARS` in a frame: of more
each has its turn every second frame, every third one, and so on. The turns follow from the frame and from what is
mounted alone, so a repeated run has the same ones. What cameras and lidars see is drawn by the worker of the shell,
from copies of the frame:

- In synchronous mode the gate behind the frame stays closed until the messages are out. So they come before the answer
  of the tick, and before the next frame.
- In real time a job is given only while the worker has none. A sensor that was due meanwhile is read as soon as the
  worker is free, from the last frame, and has the stamp of that frame. So nothing waits, and no sensor starves beside
  another. To wait for the next frame would cost half a picture in three at 30 Hz.

These messages come behind all others of their frame, also behind `/SyncModeInfo`. Those of many egos come in several
turns of the loop, so that no client waits for all of them.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from typing import Final

from rosbridge_sim.errors import DocumentError, GraphError, Reason
from rosbridge_sim.graph.participant import Participant
from rosbridge_sim.scenery.camera_geometry import Pose
from rosbridge_sim.scenery.scene_frame import EgoLook, SceneFrame, take_frame
from rosbridge_sim.simulator.bus.network_settings import InterfaceKind
from rosbridge_sim.simulator.bus.publisher_kinds import FRAME_RATE, is_due, num_due
from rosbridge_sim.simulator.bus.publishers import Publishers
from rosbridge_sim.simulator.egos.ego import Ego, ego_prefix, lamps_of
from rosbridge_sim.simulator.kernel.component import Component
from rosbridge_sim.simulator.kernel.context import SimulatorContext
from rosbridge_sim.simulator.plain.plain_bytes import PlainData
from rosbridge_sim.simulator.plain.typed_plain import read_as
from rosbridge_sim.simulator.sensor_data.lidar_sweep import Motion
from rosbridge_sim.simulator.sensor_rigs.ego_rig import EgoRig, MountedSensor, is_wanted
from rosbridge_sim.simulator.sensor_rigs.sensor_presets import read_rig_text, text_of
from rosbridge_sim.simulator.sensor_rigs.weather import WeatherControl
from rosbridge_sim.simulator.sensors.drawing import DrawingJob, DrawnSpec, SensorWorker, Sight, Sighting, drawn_of
from rosbridge_sim.simulator.sensors.sensor_context import SensorContext
from rosbridge_sim.simulator.sensors.sensor_noise import SensorNoise
from rosbridge_sim.simulator.sensors.sensor_specs import Rig, SensorSpec
from rosbridge_sim.simulator.sensors.sensor_table import SENSOR_FRAMES, check_rig, complete

MAX_CAPTURES: Final = 4
"""Captures that are drawn at once: each has copies of its frame, and pictures of up to 25 MB."""

MAX_RADARS: Final = 32
"""Radars of all egos that are read in one frame: 16 ms among 300 entities, 31 ms with the widest beams."""

_log = logging.getLogger("rosbridge_sim.morai")


Finish = Callable[[Sighting, float], None]
"""Uses the result of a sight; takes monotonic time [s], too."""


_End = Callable[[Exception | None, float], None]
"""Called behind a job, with the error that prevented it."""

_Plan = list[tuple[Sight, Finish]]
"""A job that grows: what is to be seen, and what becomes of each result."""


class MountedSensors(Component):
    """The component of all sensors."""

    def __init__(
        self,
        context: SimulatorContext,
        rig: Rig = (),
        worker: SensorWorker | None = None,
        weather: WeatherControl | None = None,
        *,
        noise: SensorNoise | None = None,
        is_dressed: bool = True,
    ) -> None:
        """Read nothing yet.

        Args:
            worker: draws; None where nothing can, so that there are radars alone.
            weather: of what is drawn; None for noon.
            noise: errors of the readings; None for exact ones.
            is_dressed: buildings, trees and posts stand beside the roads.

        Raises:
            DocumentError: an ego cannot have these sensors here.
        """
        self._context = context
        self._start_rig = complete(rig)
        self._shared = SensorContext(context, noise)
        self._worker = worker
        self._weather = weather or WeatherControl(context)
        self._is_dressed = is_dressed
        self._rigs: dict[int, EgoRig] = {}  # by the egos' numbers
        self._epoch = 0  # number of resets and restores
        self._num_failures = 0
        self._num_turns_told = 1
        self._num_captures = 0  # being drawn
        why = self.why_no_worker(rig)
        if why:
            raise DocumentError(f"sensors: {why}")
        context.hooks.after_frame.append(self._after_frame)
        context.hooks.on_reset.append(self._reset)
        context.hooks.on_restore.append(self._forget_jobs)

    # The topics

    def publish_ego(self, ego: Ego, prefix: str, publishers: Publishers) -> None:  # noqa: ARG002 - those of the context
        """Give the ego the rig of the start."""
        wake = partial(self._context.hooks.after_frame.wake, self._after_frame)
        rig = self._rigs[ego.index] = EgoRig(self._shared, ego, prefix, wake)
        rig.mount(self._start_rig, 0.0)

    def has_topic_like(self, type_name: str) -> bool:
        """Return whether a sensor of the first ego publishes messages of a type."""
        return self.rig_of(self._context.egos.first).has_topic_like(type_name)

    def rig_of(self, ego: Ego) -> EgoRig:
        """Return the sensors of an ego."""
        return self._rigs[ego.index]

    def why_no_worker(self, specs: Sequence[SensorSpec]) -> str:
        """Return why some sensors cannot be served; empty if they can."""
        drawn = drawn_of(specs)
        if not drawn:
            return ""
        if self._worker is None:
            return "this simulator draws nothing: radars alone are possible"
        return self._worker.why_not(drawn)

    def check_topics(self, index: int, specs: Rig, caller: Participant) -> None:
        """Check that a client may have sensors publish on the topics that an ego does not have yet.

        They are the simulator's alone then. So nobody else may publish there, and the client needs the right to do so,
        unless the start of the server has put a sensor there.

        Args:
            index: number of the ego, which need not be there: it comes with the rig of the start.

        Raises:
            GraphError: it may not have them.
        """
        context = self._context
        at_start = {name for spec in self._start_rig for name, _ in spec.topics}
        had = at_start if context.egos.find(index) is None else self._rigs[index].topics
        for spec in specs:
            for default, type_name in spec.topics:
                name = context.interfaces.name_of(InterfaceKind.PUBLISHER, default, ego_prefix(index))
                if default in had or not name:  # an empty name: the network settings have it off
                    continue
                if default not in at_start:
                    caller.check_publish(name, type_name)
                topic = context.bus.find_topic(name)
                if topic is not None and topic.publishers:
                    owner = next(iter(topic.publishers))
                    text = f"{spec.frame_id}: topic {name} is published by {owner.name}; choose another one"
                    raise GraphError(text, reason=Reason.NAME_TAKEN)

    # The frames

    def _egos_with_sensors(self) -> Iterator[tuple[Ego, EgoRig]]:
        for ego in self._context.egos:
            rig = self._rigs.get(ego.index)
            if rig is not None and rig.behind and rig.ego is ego and ego.is_there:
                yield ego, rig

    def _after_frame(self, now: float) -> None:
        """Read the sensors that are due, or have them drawn."""
        if not any(rig.behind for rig in self._rigs.values()):
            self._context.hooks.after_frame.rest(self._after_frame)
            return
        frame, num_turns, i = self._context.world.frame, self._num_turns, 0
        if num_turns > self._num_turns_told:
            self._num_turns_told = num_turns
            _log.warning("%s", self.why_slow)
        for _, rig in self._egos_with_sensors():
            for mounted in rig.behind:
                if mounted.spec.has_turns:
                    i += 1
                    if (frame + i) % num_turns == 0:
                        num = num_due(rig.rate_of(mounted), frame, num_turns)
                        mounted.is_owed = num > 0
                        if num and is_wanted(mounted.publishers[0]):
                            mounted.num_skipped += num - 1
                elif is_due(rig.rate_of(mounted), frame):
                    mounted.num_skipped += mounted.is_owed
                    mounted.is_owed = True
        self._read_owed(now)

    @property
    def _num_radars(self) -> int:
        return sum(one.spec.has_turns for _, rig in self._egos_with_sensors() for one in rig.behind)

    @property
    def _num_turns(self) -> int:
        """Number of frames in which each radar has one turn."""
        return max(1, math.ceil(self._num_radars / MAX_RADARS))

    @property
    def why_slow(self) -> str:
        """Why radars are read at a lower rate than they have; empty if they are not."""
        num, num_turns = self._num_radars, self._num_turns
        if num_turns == 1:
            return ""
        return (
            f"{num} radars are mounted, and a frame reads at most {MAX_RADARS}:"
            f" each has a turn every {num_turns} frames, {FRAME_RATE / num_turns:.3g} Hz at most"
        )

    def _read_owed(self, now: float) -> None:
        """Read the sensors that are owed, or have them drawn."""
        worker = self._worker
        is_tick = not self._context.sync.is_free or self._context.command_wait.is_on
        is_free = is_tick or (worker is not None and not worker.is_busy)
        # A plan for each ego: a turn of the loop then has the messages of one ego alone.
        plans = [self._plan(ego, rig, is_free, now) for ego, rig in self._egos_with_sensors()]
        if worker is not None and any(plans):
            seen = self._look()
            for plan in plans:
                if plan:
                    self._submit(worker, plan, seen, is_tick=is_tick)

    def _plan(self, ego: Ego, rig: EgoRig, is_free: bool, now: float) -> _Plan:  # noqa: FBT001 - by position
        """Read the sensors of an ego that are owed; return what is to be drawn for them."""
        plan: _Plan = []
        for mounted in rig.behind:
            if not mounted.is_owed:
                continue
            spec = mounted.spec
            wanted = [is_wanted(publisher) for publisher in mounted.publishers]
            if not any(wanted) or self._is_lost(ego, spec):
                mounted.is_owed = False
            elif is_free or not spec.maker:
                mounted.is_owed = False
                self._read(plan, ego, mounted, wanted, now)
        return plan

    def _is_lost(self, ego: Ego, spec: SensorSpec) -> bool:
        """Return whether the noise of the settings loses the messages of a sensor in this frame."""
        errors = self._shared.errors(ego)
        return errors is not None and errors.is_lost(spec.frame_id, spec.lost_share(errors.noise))

    def _read(self, plan: _Plan, ego: Ego, mounted: MountedSensor, wanted: Sequence[bool], now: float) -> None:
        """Publish sensors that need no drawing; add the others to a job, each with a function that takes its result."""
        spec, shared, deliver = mounted.spec, self._shared, self._context.publishers.deliver
        frame, is_complete = self._context.world.frame, True
        for i, publisher in enumerate(mounted.publishers):
            message = spec.read(shared, ego, i) if wanted[i] else None
            if message is not None:
                deliver(publisher, message, now)
            elif wanted[i]:
                is_complete = False
        if is_complete or not isinstance(spec, DrawnSpec):
            mounted.frames.append(frame)
            return
        header = shared.header(ego, spec.frame_id)

        def finish(result: Sighting, now: float) -> None:
            mounted.frames.append(frame)
            for i, publisher in enumerate(mounted.publishers):
                message = spec.show(shared, i, header, result) if is_wanted(publisher) else None
                if message is not None:
                    deliver(publisher, message, now)

        plan.append((self._sight(ego, spec, wanted=wanted), finish))

    def _sight(self, ego: Ego, spec: DrawnSpec, *, wanted: Sequence[bool] = (), is_for_file: bool = False) -> Sight:
        world, row, mounting = self._context.world, ego.row, ego.mountings[spec.frame_id]
        place = (world.x, world.y, world.z, world.roll, world.pitch, world.yaw)
        vehicle = Pose(*(column.item(row) for column in place))
        own = Pose(*mounting.place, mounting.roll, mounting.pitch, mounting.yaw)
        motion = Motion(vehicle, own, world.speed.item(row), world.yaw_rate.item(row))
        return Sight(spec, motion, ego.index, wanted, is_for_file=is_for_file, errors=self._shared.errors(ego))

    def job_of(self, sights: Sequence[Sight], seen: SceneFrame | None = None) -> DrawingJob:
        """Return the job of drawing the scene as some sensors see it.

        Args:
            sights: the sensors; they need not be mounted.
            seen: what moves; None for a copy of what can be seen now.
        """
        found = self._context.scene.found_map
        return DrawingJob(
            found.road_map,
            found.name,
            self._context.world.seed,
            self._look() if seen is None else seen,
            tuple(sights),
            self._weather.weather,
            is_dressed=self._is_dressed,
        )

    def _look(self) -> SceneFrame:
        """Return a copy of what can be seen now."""
        context, world = self._context, self._context.world
        return take_frame(
            world, [EgoLook(ego.row, ego.index, lamps_of(ego, world)) for ego in context.egos if ego.is_there]
        )

    def _submit(
        self, worker: SensorWorker, plan: _Plan, seen: SceneFrame, *, is_tick: bool, end: _End | None = None
    ) -> None:
        context, epoch = self._context, self._epoch
        job = self.job_of([sight for sight, _ in plan], seen)

        def then(results: Sequence[Sighting] | Exception, now: float) -> None:
            try:
                if isinstance(results, Exception):
                    self._note_failure(results)
                elif epoch == self._epoch or end is not None:  # a file is of the frame that was asked for
                    for (_, finish), result in zip(plan, results, strict=True):
                        finish(result, now)
                if end is not None:
                    end(results if isinstance(results, Exception) else None, now)
            finally:
                if is_tick:
                    context.gate.open(now)
            if context.sync.is_free and not worker.is_busy:
                self._read_owed(now)

        if is_tick:
            context.gate.close()
        worker.submit(job, then)

    def _note_failure(self, error: Exception) -> None:
        """Log that pictures could not be made: the first time, since the next frame has the same problem."""
        if not self._num_failures:
            _log.error("cameras and lidars cannot be served: %s", error)
        self._num_failures += 1

    # Files

    def read_files(self, ego: Ego) -> dict[str, bytes]:
        """Return the files of the sensors of an ego that need no drawing, by their names; see `draw_files`."""
        prefix, specs = ego.frame_prefix, self.rig_of(ego).specs
        read = [spec for spec in specs if spec.file_name and not spec.maker]
        return {prefix + spec.file_name: spec.file(self._shared, ego) for spec in read}

    def draw_files(self, ego: Ego, then: Callable[[Mapping[str, bytes] | Exception, float], None]) -> bool:
        """Have the cameras and 3D lidars of an ego drawn for files: the frame of now.

        Args:
            then: called once with the contents by file names, and monotonic time [s]; `{}` in a name stands for the
                name of the capture. In synchronous mode the next tick waits for it.

        Returns:
            False if there is nothing to draw; then `then` is not called.

        Raises:
            DocumentError: too many captures are being drawn already.
        """
        rig, worker = self._rigs.get(ego.index), self._worker
        specs = [] if rig is None else [spec for spec in drawn_of(rig.specs) if spec.file_name]
        if worker is None or not specs:
            return False
        if self._num_captures >= MAX_CAPTURES:
            raise DocumentError(f"{MAX_CAPTURES} captures are being drawn already; expected fewer at once")
        self._num_captures += 1
        prefix = ego.frame_prefix
        files: dict[str, bytes] = {}
        plan: _Plan = [
            (self._sight(ego, spec, is_for_file=True), partial(_keep_file, files, prefix + spec.file_name))
            for spec in specs
        ]

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
            rig.mount(self._start_rig, 0.0)
            ego.mountings = {spec.frame_id: spec.mounting for spec in self._start_rig}

    def save_state(self) -> PlainData:
        """Return the cameras, lidars and radars of each ego that has some; the places are those of the egos."""
        rigs = [
            (ego.index, [text_of(mounted.spec) for mounted in rig.behind]) for ego, rig in self._egos_with_sensors()
        ]
        return rigs or None

    def check_state(self, data: PlainData, caller: Participant) -> None:
        """Check that the client may have the saved rigs mounted; see `Component.check_state`."""
        for index, specs in _saved_rigs(data).items():
            self.check_topics(index, specs, caller)

    def load_state(self, data: PlainData, now: float) -> None:
        """Have the saved rigs; see `Component.load_state`."""
        rigs = _saved_rigs(data)
        egos = {ego.index: ego for ego in self._context.egos}
        if not rigs.keys() <= egos.keys():
            raise ValueError("expected sensors of egos that are there")
        for index, ego in egos.items():
            rig, saved = self._rigs[index], dict(ego.mountings)
            specs = complete((*rig.specs[: len(SENSOR_FRAMES)], *rigs.get(index, ())))
            if list(saved) != [spec.frame_id for spec in specs]:
                raise ValueError(f"expected a place for each sensor of ego {index}")
            rig.mount(specs, now)
            ego.mountings = saved


def _saved_rigs(data: PlainData) -> dict[int, Rig]:
    """Return the saved cameras, lidars and radars by the numbers of the egos.

    Raises:
        DocumentError: it is no such data.
        FieldError: an ego cannot have these sensors together.
    """
    rigs: dict[int, Rig] = {}
    for index, texts in read_as(tuple[tuple[int, tuple[str, ...]], ...], () if data is None else data, "sensors"):
        rigs[index] = tuple(spec for text in texts for spec in read_rig_text(text, "sensors"))
        check_rig(rigs[index])
    return rigs


def _keep_file(files: dict[str, bytes], name: str, result: Sighting, _now: float) -> None:
    """Keep the bytes of a file."""
    files[name] = result.file
