"""The simulator's component for replays, put together from its subjects.

- `state_machine`: the allowed events of each state, and their effects
- `process`: the state, and the effects carried out
- `playback`: the recording that moves the world, and the position in it
- `process_service`: `/Morai_SimProc`: commands
- `process_status`: `MoraiSimProcStatus`: state of the process
- `network_replay`: `/ReplayInfo_topic` from a client, followed
- `replay_info`: `/ReplayInfo_topic` of the simulator
"""

from __future__ import annotations

from typing import NamedTuple

from rosbridge_sim.simulator.bus.publishers import Publishers
from rosbridge_sim.simulator.bus.subscribers_services import SubscribersServices
from rosbridge_sim.simulator.kernel.component import Component
from rosbridge_sim.simulator.kernel.context import SimulatorContext
from rosbridge_sim.simulator.plain.plain_bytes import PlainData
from rosbridge_sim.simulator.replays.network_replay import NetworkReplay
from rosbridge_sim.simulator.replays.playback import Playback
from rosbridge_sim.simulator.replays.playback_actors import ALL_TARGETS
from rosbridge_sim.simulator.replays.process import ReplayProcess
from rosbridge_sim.simulator.replays.process_service import ProcessService
from rosbridge_sim.simulator.replays.process_status import ProcessStatus
from rosbridge_sim.simulator.replays.recorded_drive import Recording, from_plain, to_plain
from rosbridge_sim.simulator.replays.recording_builder import Recordings
from rosbridge_sim.simulator.replays.replay_info import ReplayInfoPublisher
from rosbridge_sim.simulator.replays.replayed_plans import ReplayedPlans
from rosbridge_sim.simulator.replays.state_machine import ReplayEvent, ReplayState


class RecordingKey(NamedTuple):
    """A bag as snapshots name it.

    Attributes:
        name: as clients call it.
        digest: of its tracks.
    """

    name: str
    digest: bytes


class Replay(Component):
    """Component that shows recordings."""

    def __init__(
        self, context: SimulatorContext, recordings: Recordings | None, *, is_showing_drives: bool = False
    ) -> None:
        """Nothing is replayed yet.

        Args:
            recordings: reads recordings; None where there are none.
            is_showing_drives: publish ReplayInfo of a drive for every subscriber; see `ReplayInfoPublisher`.
        """
        self._playback = Playback(context.world, context.scene, context.egos)
        self._process = ReplayProcess(context, self._playback)
        self._status = ProcessStatus(self._process)
        self._process.on_event.append(self._status.announce)
        self._service = ProcessService(self._process, self._status, recordings)
        self._info = ReplayInfoPublisher(self._process, is_showing_drives=is_showing_drives)
        self._network = NetworkReplay(self._process, self._info)
        self._plans = ReplayedPlans(self._process)
        self._process.on_event.append(self._plans.settle)
        self._restored = Recording("")
        hooks = self._hooks = context.hooks
        hooks.place.append(self._place)
        hooks.after_frame.append(self._settle)
        self._process.on_event.append(self._wake)
        hooks.on_mode_change.append(self._settle)
        hooks.on_scene_change.append(self._process.evict)
        hooks.on_leave.append(self._network.on_leave)
        for forget in (self._service.forget, self._status.forget, self._info.forget, self._network.forget):
            hooks.on_reset.append(forget)
        hooks.on_restore.append(lambda: self._service.forget("The simulation was restored"))
        hooks.on_restore.append(self._network.forget)
        for moment in (hooks.on_reset, hooks.on_restore):
            moment.append(self._wake)

    def publish(self, publishers: Publishers) -> None:
        """Publish the replay and the state of the process."""
        self._info.publish(publishers)
        self._status.publish(publishers)

    def bind(self, bindings: SubscribersServices) -> None:
        """Take commands and network replay."""
        self._service.bind(bindings)
        self._network.bind(bindings)

    def play(self, recording: Recording, now: float) -> str:
        """Show a recording from its beginning, with all that it has.

        Returns:
            Why it cannot be shown; empty if it is.
        """
        why = self._playback.why_unusable(recording, ALL_TARGETS)
        if not why:
            self._playback.choose(recording)
            for event in (ReplayEvent.LOAD, ReplayEvent.PLAY):
                why = why or self._process.happen(event, now).why
        return why

    @property
    def recording_key(self) -> RecordingKey | None:
        """Return the bag that moves the world, by name and digest; None for none."""
        if self._process.state not in {ReplayState.REPLAYING, ReplayState.AT_END}:
            return None
        recording = self._playback.recording
        return RecordingKey(recording.name, recording.digest)

    @property
    def recording(self) -> Recording:
        """Return the recording that moves the world; an empty one for none."""
        return self._playback.recording

    def find_recording(self, key: RecordingKey) -> Recording | None:
        """Return the recording of a key, if it is the one that moves the world now."""
        return self._playback.recording if self.recording_key == key else None

    def hand_over(self, recording: Recording) -> None:
        """Give the recording that the next `load_state` is to take."""
        self._restored = recording

    def save_state(self) -> PlainData:
        """Return the state of the replay; a bag is in it by name and digest alone."""
        is_following = self._process.state is ReplayState.FOLLOWING
        return {
            "process": self._process.save_state(),
            "playback": self._playback.save_state(),
            "status": self._status.save_state(),
            "message": to_plain(self._playback.recording) if is_following else None,
        }

    def load_state(self, data: PlainData, now: float) -> None:
        """See `Component`; `hand_over` must have been called if a bag is needed."""
        self._wake()
        handed_over, self._restored = self._restored, Recording("")
        self._process.load_state(data["process"])
        state = self._process.state
        if state is ReplayState.SIMULATING:
            recording = Recording("")
        elif state is ReplayState.FOLLOWING:
            recording = from_plain(data["message"])
        else:
            recording = handed_over
        if (state is ReplayState.SIMULATING) != recording.is_empty:
            raise ValueError("replay: expected a recording")
        if state is not ReplayState.FOLLOWING and data["message"] is not None:
            raise ValueError("replay: expected no message")
        self._playback.load_state(data["playback"], recording)
        if self._playback.actors.is_entered != (state is not ReplayState.SIMULATING):
            raise ValueError("replay: expected entities of the recording")
        if state is ReplayState.FOLLOWING:
            self._network.resume()
        self._status.load_state(data["status"], now)

    def _wake(self, _now: float = 0.0) -> None:
        """Act in the frames that follow, because the state may be another one."""
        self._hooks.place.wake(self._place)
        self._hooks.after_frame.wake(self._settle)

    def _place(self) -> None:
        """Within a step: put each entity of the recording at its recorded pose of this frame."""
        if self._process.state is ReplayState.SIMULATING:
            self._hooks.place.rest(self._place)
        else:
            self._playback.show_frame()

    def _settle(self, now: float) -> None:
        """Act on the end of a frame, and on the begin or end of a pause."""
        is_replaying = self._process.state is not ReplayState.SIMULATING
        if is_replaying:
            self._process.check_end(now)
            self._plans.settle(now)
        self._network.settle(now)
        self._status.settle(now)
        if not is_replaying and not self._network.is_ignoring:
            self._hooks.after_frame.rest(self._settle)
