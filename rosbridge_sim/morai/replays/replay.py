"""The simulator's component for replays, put together from its subjects.

- `state_machine`: which event is allowed when, and what follows from it
- `process`: the state, and the effects carried out
- `playback`: the recording that moves the world, and the position in it
- `process_service`: `/Morai_SimProc`: commands
- `process_status`: `MoraiSimProcStatus`: state of the process
- `network_replay`: `/ReplayInfo_topic` from a client, followed
- `replay_info`: `/ReplayInfo_topic` of the simulator
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from rosbridge_sim.graph.participant import Participant
from rosbridge_sim.morai.component import Component
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

if TYPE_CHECKING:
    from rosbridge_sim.morai.simulator_node import SimulatorNode

__all__ = ["Replay"]


class Replay(Component):
    """Component that shows recordings."""

    def __init__(self, node: SimulatorNode, recordings: Recordings | None, *, is_showing_drives: bool = False) -> None:
        """Nothing is replayed yet.

        Args:
            node: the simulator.
            recordings: reads recordings; None where there are none.
            is_showing_drives: publish ReplayInfo of a drive for every subscriber; see `ReplayInfoPublisher`.
        """
        bus, world, convert, sync = node.bus, node.world, node.convert, node.sync
        self._playback = Playback(world, node.scene, node.find_ego, node.refresh)
        self._process = ReplayProcess(
            self._playback,
            sync,
            follow=node.follow,
            begin_anew=lambda now: node.carry_out(node.scene.loaded, is_pausing=False, now=now),
        )
        self._status = ProcessStatus(self._process, bus, world, sync, convert)
        self._process.on_event.append(self._status.announce)
        self._service = ProcessService(
            self._process,
            self._playback,
            self._status,
            bus=bus,
            convert=convert,
            recordings=recordings,
            is_moving=lambda: node.is_moving,
        )
        self._info = ReplayInfoPublisher(
            self._process,
            owner=node,
            bus=bus,
            world=world,
            convert=convert,
            first_ego=node.egos[0],
            is_showing_drives=is_showing_drives,
        )
        self._network = NetworkReplay(
            self._process,
            self._playback,
            self._info,
            owner=node,
            bus=bus,
            world=world,
            convert=convert,
            tell_once=node.tell_once,
        )

    def show(self, outputs: Publishers) -> None:
        """Publish the replay and the state of the process."""
        self._info.show(outputs)
        self._status.show(outputs)

    def bind(self, bindings: SubscribersServices) -> None:
        """Take commands and network replay."""
        self._service.bind(bindings)
        self._network.bind(bindings)

    def place(self) -> None:
        """Within a step: put each entity of the recording at its recorded pose of this frame."""
        if self._process.state is not ReplayState.SIMULATING:
            self._playback.show_frame()

    def settle(self, now: float) -> None:
        """Follow the end of a frame, of a pause, or its begin."""
        if self._process.state is not ReplayState.SIMULATING:  # asked first: this is called at every frame
            self._process.check_end(now)
        self._network.settle(now)
        self._status.settle(now)

    def on_scene_change(self, now: float) -> None:
        """End the replay."""
        self._process.evict(now)

    def on_leave(self, owner: Participant, now: float) -> None:
        """End the network replay of a client that has left the bus."""
        self._network.on_leave(owner, now)

    def forget(self) -> None:
        """Forget all commands, because the world has begun anew."""
        self._service.forget()
        self._status.forget()
        self._info.forget()
        self._network.forget()
