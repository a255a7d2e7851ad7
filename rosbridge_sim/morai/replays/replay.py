"""The part of a node that shows recordings: `/Morai_SimProc`, `/ReplayInfo_topic` and the state of the process.

What follows from what is `replay_table`'s, and why; this file finds out what has happened, and carries the effects out.
"""

from __future__ import annotations

import logging
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any, Final

from msgspec.structs import astuple

from rosbridge_sim.errors import DocumentError, FieldError, GraphError
from rosbridge_sim.graph.participant import Participant
from rosbridge_sim.graph.topics_services import Call
from rosbridge_sim.loose_types import Struct
from rosbridge_sim.morai.component import Component
from rosbridge_sim.morai.convert import DEGREES, maker
from rosbridge_sim.morai.interfaces.publishers import Publishers
from rosbridge_sim.morai.interfaces.subscribers_services import SubscribersServices
from rosbridge_sim.morai.replays.command import ReplayCommand, ReplayResult, read_command
from rosbridge_sim.morai.replays.playback_actors import EGO, EVERYBODY, PlaybackActors
from rosbridge_sim.morai.replays.recording import Recording
from rosbridge_sim.morai.replays.recording_builder import RecordingBuilder, Recordings
from rosbridge_sim.morai.replays.state_machine import (
    REPLAY_TABLE,
    ReplayEffect,
    ReplayEvent,
    ReplayOutcome,
    ReplayState,
)
from rosbridge_sim.morai.scene import MAX_ENTITIES
from rosbridge_sim.world.geometry import quaternion
from rosbridge_sim.world.state import STEP_NS

if TYPE_CHECKING:
    from rosbridge_sim.morai.simulator_node import SimulatorNode

__all__ = ["Replay"]

STATUS: Final = "/sim/process/state/msg/MoraiSimProcStatus"
REPLAY_INFO: Final = "/ReplayInfo_topic"

MAX_ECHOES: Final = 15_000
"""Messages of ours that are known again when a far bridge gives them back: five minutes of them, longer than a bridge
stands still before its socket is given up. One that was not known would have the world follow itself."""

SILENCE: Final = 50
"""Frames without a message after which a source that was stopped is heard again: it has ended, and what comes then is
another replay. A far bridge, behind which many speak as one, never leaves."""

_log = logging.getLogger("rosbridge_sim.replay")

_SIMULATION_MODE, _REPLAY_MODE = 1, 16
_RUNNING, _PAUSED, _ENDED = 1, 16, 32


@dataclass(slots=True)
class _PlaybackState:
    """What is shown, of whom, from where on and how fast; `position_ns` is for the next frame."""

    recording: Recording
    targets: int = EVERYBODY
    start_ns: int = 0
    speed: int = 1
    position_ns: int = 0
    is_over: bool = False

    def seek(self, start_ns: int) -> None:
        self.start_ns = self.position_ns = start_ns
        self.is_over = False


class Replay(Component):
    """The part of a node that shows recordings.

    Attributes:
        state: where in the table it is.
    """

    def __init__(self, node: SimulatorNode, recordings: Recordings | None, *, is_showing_drives: bool = False) -> None:
        """Nothing is replayed yet.

        Args:
            node: whose part it is.
            recordings: where they come from; None for nowhere.
            is_showing_drives: publish ReplayInfo of any drive for everybody, far bridges and recordings of everything
                among them. Otherwise only for those who listen to it in particular.
        """
        self.state = ReplayState.SIMULATING
        self._recordings = recordings
        self._node = node
        self._actors = PlaybackActors(node.world, node.scene, node.find_ego)
        self._playback = _PlaybackState(Recording(""))
        self._was_paused = False
        self._source: Participant | None = None  # of network replay
        self._unheard: Participant | None = None
        self._unheard_at = 0  # the frame of his last message
        self._is_showing_drives = is_showing_drives
        self._said: dict[int, None] = {}  # prints of what we published ourselves, oldest first
        self._loading: Call | None = None
        self._result, self._commanded_ns = ReplayResult.NONE, 0
        self._told: tuple[object, ...] = ()
        self._settled_in: object = None  # the state of synchronous mode that was announced last
        self._is_obeying = False
        self._carry_out = {
            ReplayEffect.LEAVE: self._leave,
            ReplayEffect.ENTER: self._enter,
            ReplayEffect.TUNE: self._tune,
            ReplayEffect.SEEK: self._show,
            ReplayEffect.REWIND: self._rewind,
            ReplayEffect.RESUME: lambda now: node.follow(node.sync.resume(), now),
            ReplayEffect.HOLD: lambda now: node.follow(node.sync.pause(), now),
            ReplayEffect.AGAIN: lambda now: node.carry_out(node.scene.loaded, is_pausing=False, now=now),
            ReplayEffect.IGNORE: self._ignore,
        }
        store = node.bus.store
        self._make_status = maker(
            store,
            "morai_msgs/MoraiSimProcStatus",
            *("header", "latest_command_time", "command_result", "current_mode", "current_status"),
        )
        self._make_info = maker(
            store,
            "morai_msgs/ReplayInfo",
            *("header", "ego_acc", "ego_brake", "ego_steer", "orientation", "linear_acceleration", "angular_velocity"),
            *("num_of_npcs", "num_of_pedestrian", "num_of_obstacle", "npc_list", "pedestrian_list", "obstacle_list"),
        )
        self._vector = maker(store, "geometry_msgs/Vector3", "x", "y", "z")
        self._quaternion = maker(store, "geometry_msgs/Quaternion", "x", "y", "z", "w")
        self._make_result = maker(store, "morai_msgs/MoraiSrvResponse", "result")

    def show(self, outputs: Publishers) -> None:
        """Publish what the world has once."""
        self._outputs = outputs
        self._info = outputs.add(REPLAY_INFO, "morai_msgs/ReplayInfo", self._replay_info, is_exclusive=False)
        self._status = outputs.add(STATUS, "morai_msgs/MoraiSimProcStatus", self._process_status, depth=1)
        self._told = self._process()

    def bind(self, bindings: SubscribersServices) -> None:
        """What the world has once."""
        bindings.provide("Morai_SimProc", "MoraiSimProcSrv", self._command)
        bindings.listen("ReplayInfo_topic", "ReplayInfo", self._hear)
        self._bindings = bindings

    def place(self) -> None:
        """Within a step: put everybody where the recording has him at this frame."""
        if self.state is ReplayState.SIMULATING:
            return
        playback = self._playback
        duration_ns = playback.recording.duration_ns
        self._actors.show(playback.recording.scene(min(playback.position_ns, duration_ns)))
        playback.is_over = playback.position_ns >= duration_ns
        playback.position_ns += STEP_NS * playback.speed

    def settle(self, now: float) -> None:
        """A frame has gone out, or somebody has paused the simulator or ended the pause."""
        sync = self._node.sync
        if self.state is not ReplayState.SIMULATING:  # asked first: this is called at every frame
            if self.state is ReplayState.REPLAYING and self._playback.is_over:
                _log.info("%s: the end is reached", self._playback.recording.name)
                self._happen(ReplayEvent.RUN_OUT, now)
            elif self.state is ReplayState.AT_END and not sync.is_paused:
                self._happen(ReplayEvent.RUN_OUT, now)
            elif self.state is ReplayState.FOLLOWING and not self._publishes(self._source):
                self._lose(now)
        if self._unheard is not None:
            is_silent = self._node.world.frame - self._unheard_at >= SILENCE
            self._unheard = None if is_silent or not self._publishes(self._unheard) else self._unheard
        if sync.state is not self._settled_in:  # all else that the status tells of is announced where it happens
            self._settled_in = sync.state
            self._announce(now)

    def on_scene_change(self, now: float) -> None:
        """The world is to be its own again."""
        if self.state is not ReplayState.SIMULATING:
            _log.info("the replay has ended: the stage is needed")
        self._was_paused &= self._node.sync.is_paused  # whoever pressed play since then wants the new scene to run
        self._happen(ReplayEvent.EVICT, now)

    def on_leave(self, owner: Participant, now: float) -> None:
        """A peer has left the bus."""
        if owner is self._source and self.state is ReplayState.FOLLOWING:
            self._lose(now)
        if owner is self._unheard:
            self._unheard = None

    def forget(self) -> None:
        """The world has begun anew: no command has come yet."""
        if self._loading is not None:
            loading, self._loading = self._loading, None
            loading.refuse("The simulation was reset")
        self._result, self._commanded_ns = ReplayResult.NONE, 0
        self._told = ()
        self._settled_in = None
        self._said.clear()
        self._unheard = None

    # The table

    def _happen(self, event: ReplayEvent, now: float) -> ReplayOutcome:
        outcome = REPLAY_TABLE[self.state][event]
        self.state = outcome.state
        for effect in outcome.effects:
            self._carry_out[effect](now)
        if self.state is ReplayState.SIMULATING:
            self._playback = _PlaybackState(Recording(""))  # it may be large
        self._announce(now)
        return outcome

    def _enter(self, now: float) -> None:
        del now
        playback = self._playback
        self._was_paused = self._node.sync.is_paused
        self._actors.enter(
            playback.recording.egos, playback.targets, has_objects=playback.recording.objects is not None
        )
        self._show(0.0)

    def _leave(self, now: float) -> None:
        self._actors.leave()
        self._node.refresh()
        sync = self._node.sync
        if sync.is_paused and not self._was_paused:
            self._node.follow(sync.resume(), now)
        elif self._was_paused and not sync.is_paused:
            self._node.follow(sync.pause(), now)

    def _tune(self, now: float) -> None:
        """The targets may be others."""
        del now
        playback = self._playback
        self._actors.retarget(
            playback.recording.egos, playback.targets, has_objects=playback.recording.objects is not None
        )
        self._show(0.0)

    def _show(self, now: float) -> None:
        """Put everybody where he is to be now; nobody is met on the way there."""
        del now
        playback = self._playback
        self._actors.show(playback.recording.scene(min(playback.position_ns, playback.recording.duration_ns)))
        self._node.refresh()

    def _rewind(self, now: float) -> None:
        self._playback.seek(self._playback.start_ns)
        self._show(now)

    def _ignore(self, now: float) -> None:
        del now
        self._unheard, self._source = self._source, None
        self._unheard_at = self._node.world.frame

    def _lose(self, now: float) -> None:
        assert self._source is not None
        _log.info("%s publishes nothing of it any longer: the replay has ended", self._source.name)
        self._source = None
        self._happen(ReplayEvent.LOST, now)

    # Commands

    def _command(self, call: Call, now: float) -> None:
        if self._node.is_moving:
            raise GraphError("the world is moving")
        self._commanded_ns = self._node.bus.stamp_ns
        request: Any = call.request
        try:
            command = read_command(request.request)
        except FieldError as error:
            self._refuse(call, ReplayResult.REFUSED, str(error), now)
            return
        if self._loading is not None:
            self._refuse(call, ReplayResult.REFUSED, "a recording is being read", now)
        elif command.name is None:
            self._steer(call, command, now)
        elif self._recordings is None:
            self._refuse(call, ReplayResult.NOT_LOADED, "no recordings are kept here", now)
        else:
            self._loading = call
            reading = RecordingBuilder(command.name, self._node.convert)
            self._recordings.read(command.name, reading, partial(self._take, call, command))

    def _take(self, call: Call, command: ReplayCommand, outcome: Recording | DocumentError, now: float) -> None:
        """A recording has been read, or could not be."""
        if self._loading is not call:
            return
        self._loading = None
        if call.is_done:
            _log.info("%s was read for nobody: its caller is gone", command.name)
            self._announce(now)
        elif isinstance(outcome, DocumentError):
            self._refuse(call, ReplayResult.NOT_LOADED, str(outcome), now)
        else:
            self._load(call, command, outcome, now)

    def _load(self, call: Call, command: ReplayCommand, recording: Recording, now: float) -> None:
        targets = EVERYBODY if command.targets is None else command.targets
        why = self._why_unusable(recording, targets)
        if why:
            self._refuse(call, ReplayResult.UNUSABLE, f"{recording.name}: {why}", now)
            return
        start_ns = command.start_ns or 0
        if start_ns > recording.duration_ns:
            self._refuse(call, ReplayResult.REFUSED, _beyond(recording), now)
            return
        for note in [*recording.notes, *self._notes_on(recording, targets)]:
            call.caller.notify("info", f"{recording.name}: {note}")  # the command is obeyed: no mistake of the caller
            _log.warning("%s: %s", recording.name, note)
        seconds = recording.duration_ns / 1e9
        _log.info("%s: %.2f s are replayed for %s", recording.name, seconds, call.caller.name)
        self._playback = _PlaybackState(recording, targets, speed=command.speed or 1)
        self._playback.seek(start_ns)
        self._obey(call, command, now)

    def _why_unusable(self, recording: Recording, targets: int) -> str:
        if recording.is_empty:
            return "there is nothing in it that can be replayed: no ego, no objects"
        has_ego = any(self._node.find_ego(index) is not None for index in recording.egos)
        held = (EGO if has_ego else 0) | (EVERYBODY & ~EGO if recording.objects is not None else 0)
        return "" if held & targets else "it holds none of those that are to be replayed"

    def _notes_on(self, recording: Recording, targets: int) -> list[str]:
        if not targets & EGO:
            return []
        if not recording.egos:
            return ["it holds no ego: only the objects are replayed"]
        notes = [
            f"it holds an ego {index} and the world has none: that one is left out"
            for index in recording.egos
            if self._node.find_ego(index) is None
        ]
        if any(not track.has_place for track in recording.egos.values()):
            notes.append("it holds no position of the ego: objects and pedals are replayed")
        return notes

    def _steer(self, call: Call, command: ReplayCommand, now: float) -> None:
        playback = self._playback
        if self.state in {ReplayState.REPLAYING, ReplayState.AT_END}:
            targets = playback.targets if command.targets is None else command.targets
            why = self._why_unusable(playback.recording, targets)
            if command.start_ns is not None and command.start_ns > playback.recording.duration_ns:
                why = _beyond(playback.recording)
            if why:
                self._refuse(call, ReplayResult.REFUSED, why, now)
                return
            playback.targets, playback.speed = targets, command.speed or playback.speed
            if command.start_ns is not None:
                playback.seek(command.start_ns)
        self._obey(call, command, now)

    def _obey(self, call: Call, command: ReplayCommand, now: float) -> None:
        self._is_obeying = True  # what it goes through meanwhile is nobody's business
        why = ""
        try:
            for event in command.events:
                why = why or self._happen(event, now).why
        except DocumentError as error:  # the scenario that is to begin anew finds no room
            why = str(error)
        finally:
            self._is_obeying = False
        if why:
            self._refuse(call, ReplayResult.REFUSED, why, now)
            return
        _log.debug("%s by %s: %s", command, call.caller.name, self.state.name)
        self._end(call, ReplayResult.DONE, now)

    def _refuse(self, call: Call, result: ReplayResult, why: str, now: float) -> None:
        call.caller.notify("error", f"{call.service.name}: {why}")
        _log.warning("%s refused: %s", call.service.name, why)
        self._end(call, result, now)

    def _end(self, call: Call, result: ReplayResult, now: float) -> None:
        self._result = result
        self._told = ()  # whoever waits for a word on his command is to hear one, be it the same as before
        self._announce(now)
        call.answer(call.service.type.response.struct_type(self._make_result(result is ReplayResult.DONE)))

    # Network replay

    def _hear(self, message: Struct, sender: Participant, now: float) -> None:
        """A client tells what it replays.

        Raises:
            FieldError: more objects than the world can hold, or a figure that is no number or beyond all bounds.
                Nothing has changed.
        """
        node, topic = self._node, self._bindings.topic("ReplayInfo_topic")
        why = REPLAY_TABLE[self.state][ReplayEvent.MESSAGE].why
        if sender is node or _print_of(message) in self._said:
            return
        if not why and sender is self._unheard:
            why = "the replay was stopped"
            self._unheard_at = node.world.frame
        if not why and self.state is ReplayState.FOLLOWING and sender is not self._source:
            why = "another client replays already"
        if why:
            node.tell_once(sender, f"{topic} is ignored: {why}")
            return
        num = len(message.npc_list) + len(message.pedestrian_list) + len(message.obstacle_list)
        if num > MAX_ENTITIES:
            raise FieldError(f"{topic}: the world holds {MAX_ENTITIES:,} at most, got {num:,} objects")
        reading = RecordingBuilder(topic, node.convert)
        reading.take_pedals(message, (0, 0))
        reading.take_objects(message, (0, 0))
        recording = reading.finish()
        if recording.notes:
            raise FieldError(f"{topic}: {recording.notes[0]}")
        if self.state is ReplayState.SIMULATING:
            _log.info("%s replays a recording over %s", sender.name, topic)
        self._source, self._playback = sender, _PlaybackState(recording)
        self._happen(ReplayEvent.MESSAGE, now)

    def _publishes(self, owner: Participant | None) -> bool:
        """Whether somebody still publishes what he replays."""
        topic = self._node.bus.find_topic(self._bindings.topic("ReplayInfo_topic"))
        return topic is not None and owner in topic.publishers

    # Out

    def _process_status(self) -> Struct:
        node = self._node
        store = node.bus.store
        result, mode, status, commanded_ns = self._process()
        return self._make_status(
            node.convert.header(node.world.frame, "SimProcStatus"), store.time_value(commanded_ns), result, mode, status
        )

    def _process(self) -> tuple[int, int, int, int]:
        """ReplayResult, mode and status as MORAI numbers them, and the time of the last command [ns]."""
        status = _PAUSED if self._node.sync.is_paused else _RUNNING
        mode = _SIMULATION_MODE if self.state is ReplayState.SIMULATING else _REPLAY_MODE
        return self._result.value, mode, _ENDED if self.state is ReplayState.AT_END else status, self._commanded_ns

    def _announce(self, now: float) -> None:
        """Publish the status if it has changed; latched, so it is kept up to date whoever listens."""
        process = self._process()
        if process != self._told and not self._is_obeying:
            self._told = process
            self._outputs.show_now(self._status, now)

    def _replay_info(self) -> Struct:
        """The drive or what is being replayed, for others than ourselves, who listen there too.

        While the world follows somebody's messages on the same topic they are the ones to be heard.
        """
        if self.state is ReplayState.FOLLOWING:
            return None
        node = self._node
        assert self._info.topic is not None, "it is published"
        takes_all = self._is_showing_drives or self.state is not ReplayState.SIMULATING
        if not any(
            one.owner is not node and not one.is_idle and (takes_all or not one.is_general)
            for one in self._info.topic.subscriptions
        ):
            return None
        world, row = node.world, node.egos[0].row
        vector = self._vector
        info = self._make_info(
            node.convert.header(world.frame, "ReplayInfo"),
            world.throttle.item(row),
            world.brake.item(row),
            world.steer.item(row) * DEGREES,
            self._quaternion(*quaternion(world.roll.item(row), world.pitch.item(row), world.yaw.item(row))),
            vector(world.accel.item(row), world.lateral_accel.item(row), 0.0),
            vector(0.0, 0.0, world.yaw_rate.item(row)),
            *node.convert.object_lists(world),
        )
        self._said[_print_of(info)] = None
        if len(self._said) > MAX_ECHOES:
            del self._said[next(iter(self._said))]
        return info


def _print_of(info: Struct) -> int:
    """What tells one ReplayInfo from another; the stamp alone does not, since who leaves it open gets that of now."""
    header = info.header
    parts = [astuple(part) for part in (header.stamp, info.orientation, info.linear_acceleration)]
    return hash((*parts, header.frame_id, info.ego_acc, info.ego_steer))


def _beyond(recording: Recording) -> str:
    return f"start_time: {recording.name} lasts {recording.duration_ns // 1_000_000} ms"
