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

from rosbridge_sim.morai.component import Component
from rosbridge_sim.morai.context import SimulatorContext
from rosbridge_sim.morai.interfaces.publishers import Publishers
from rosbridge_sim.morai.interfaces.subscribers_services import SubscribersServices
from rosbridge_sim.morai.replays.network_replay import NetworkReplay
from rosbridge_sim.morai.replays.playback import Playback
from rosbridge_sim.morai.replays.process import ReplayProcess
from rosbridge_sim.morai.replays.process_service import ProcessService
from rosbridge_sim.morai.replays.process_status import ProcessStatus
from rosbridge_sim.morai.replays.recording_builder import Recordings
from rosbridge_sim.morai.replays.replay_info import ReplayInfoPublisher
from rosbridge_sim.morai.replays.state_machine import ReplayState

__all__ = ["Replay"]


class Replay(Component):
    """Component that shows recordings."""

    def __init__(
        self, context: SimulatorContext, recordings: Recordings | None, *, is_showing_drives: bool = False
    ) -> None:
        """Nothing is replayed yet.

        Args:
            context: of the simulator.
            recordings: reads recordings; None where there are none.
            is_showing_drives: publish ReplayInfo of a drive for every subscriber; see `ReplayInfoPublisher`.
        """
        self._playback = Playback(context.world, context.scene, context.egos)
        self._process = ReplayProcess(context, self._playback)
        self._status = ProcessStatus(context, self._process)
        self._process.on_event.append(self._status.announce)
        self._service = ProcessService(context, self._process, self._playback, self._status, recordings)
        self._info = ReplayInfoPublisher(context, self._process, is_showing_drives=is_showing_drives)
        self._network = NetworkReplay(context, self._process, self._playback, self._info)
        hooks = context.hooks
        hooks.place.append(self._place)
        hooks.after_frame.append(self._settle)
        hooks.on_mode_change.append(self._settle)
        hooks.on_scene_change.append(self._process.evict)
        hooks.on_leave.append(self._network.on_leave)
        for forget in (self._service.forget, self._status.forget, self._info.forget, self._network.forget):
            hooks.on_reset.append(forget)

    def publish(self, publishers: Publishers) -> None:
        """Publish the replay and the state of the process."""
        self._info.publish(publishers)
        self._status.publish(publishers)

    def bind(self, bindings: SubscribersServices) -> None:
        """Take commands and network replay."""
        self._service.bind(bindings)
        self._network.bind(bindings)

    def _place(self) -> None:
        """Within a step: put each entity of the recording at its recorded pose of this frame."""
        if self._process.state is not ReplayState.SIMULATING:
            self._playback.show_frame()

    def _settle(self, now: float) -> None:
        """Act on the end of a frame, and on the begin or end of a pause."""
        if self._process.state is not ReplayState.SIMULATING:  # checked first, because this is called at every frame
            self._process.check_end(now)
        self._network.settle(now)
        self._status.settle(now)
