"""Topics with the state of the simulation process as MORAI has it, and with the position of a replay: `/sim/replay`."""

from __future__ import annotations

from typing import Final

from rosbridge_sim.loose_types import Struct
from rosbridge_sim.simulator.bus.publishers import Publishers
from rosbridge_sim.simulator.plain.plain_bytes import PlainData
from rosbridge_sim.simulator.replays.process import ReplayProcess
from rosbridge_sim.simulator.replays.recorded_drive import MAX_STAMP
from rosbridge_sim.simulator.replays.replay_command import ReplayResult
from rosbridge_sim.simulator.replays.state_machine import ReplayState

STATUS: Final = "/sim/process/state/msg/MoraiSimProcStatus"
POSITION: Final = "/sim/replay"

RATE: Final = 10.0
"""Messages of `POSITION` in a second of simulated time: a slider moves smoothly enough."""

_SIMULATION_MODE, _REPLAY_MODE = 1, 16
_RUNNING, _PAUSED, _ENDED = 1, 16, 32


class ProcessStatus:
    """Publisher of the process status, latched, when it changes; and of the position of a replay.

    Attributes:
        is_held: publish nothing, because a command is being carried out and only its result matters.
    """

    def __init__(self, process: ReplayProcess) -> None:
        """Nothing is published before `publish`.

        Args:
            process: gives the mode, and whether the end is reached.
        """
        self.is_held = False
        self._process, self._context, self._sync = process, process.context, process.context.sync
        self._result, self._commanded_ns = ReplayResult.NONE, 0
        self._published: tuple[int, ...] = ()  # the last status; empty if the next one goes out in any case
        self._sync_state: object = None  # the one that was published last
        self._make_status = process.context.maker(
            "morai_msgs/MoraiSimProcStatus", "header latest_command_time command_result current_mode current_status"
        )
        self._make_position = process.context.maker(
            "rosbridge_sim_msgs/Replay", "header state name duration position speed targets"
        )

    def publish(self, publishers: Publishers) -> None:
        """Advertise the topics; the first status is there from the start."""
        self._publishers = publishers
        self._publisher = publishers.add(STATUS, "morai_msgs/MoraiSimProcStatus", self._message, depth=1)
        self._published = self._status()
        make, version = self._position_message, self._position
        publishers.add(POSITION, "rosbridge_sim_msgs/Replay", make, rate=RATE, is_sampled=True, version=version)

    def begin_command(self) -> None:
        """Note the time of a command; it is published with the next change."""
        self._commanded_ns = self._context.bus.stamp_ns

    def end_command(self, result: ReplayResult, now: float) -> None:
        """Publish the result of a command, even if nothing has changed, because its sender may wait for a message."""
        self._result = result
        self._published = ()
        self.announce(now)

    def forget(self) -> None:
        """Return to the state before the first command, because the world has been reset."""
        self._result, self._commanded_ns = ReplayResult.NONE, 0
        self._published = ()
        self._sync_state = None

    def save_state(self) -> PlainData:
        """Return the end of the last command, its time, and whether the next frame publishes in any case."""
        return (self._result.value, self._commanded_ns, not self._published)

    def load_state(self, data: PlainData, now: float) -> None:
        """Become what was saved, and publish it.

        Raises:
            ValueError: it is no such data.
        """
        result, commanded_ns, is_due = data
        if type(commanded_ns) is not int or not 0 <= commanded_ns < MAX_STAMP or type(is_due) is not bool:
            raise ValueError("replay: expected the time of a command")
        self._result, self._commanded_ns = ReplayResult(result), commanded_ns
        self._published, self._sync_state = (), self._sync.state
        self.announce(now)
        if is_due:
            self._published, self._sync_state = (), None

    def settle(self, now: float) -> None:
        """Publish a pause or its end; called after each frame. All other changes are announced where they happen."""
        state = self._sync.state
        if state is not self._sync_state:
            self._sync_state = state
            self.announce(now)

    def announce(self, now: float) -> None:
        """Publish the status if it has changed. The topic is latched, so it is published even without subscribers."""
        status = self._status()
        if status != self._published and not self.is_held:
            self._published = status
            self._publishers.show_now(self._publisher, now)

    def _message(self) -> Struct:
        result, mode, status, commanded_ns = self._status()
        return self._make_status(
            self._context.convert.header(self._context.world.frame, "SimProcStatus"),
            self._context.bus.store.time_value(commanded_ns),
            *(result, mode, status),
        )

    def _status(self) -> tuple[int, int, int, int]:
        """Return ReplayResult, mode and status as MORAI numbers them, and the time of the last command [ns]."""
        state = self._process.state
        status = _PAUSED if self._sync.is_paused else _RUNNING
        mode = _SIMULATION_MODE if state is ReplayState.SIMULATING else _REPLAY_MODE
        return self._result.value, mode, _ENDED if state is ReplayState.AT_END else status, self._commanded_ns

    def _position_message(self) -> Struct:
        return self._make_position(self._context.convert.header(self._context.world.frame), *self._position())

    def _position(self) -> tuple[object, ...]:
        """Return the fields of the position's message behind the header."""
        state, playback = self._process.state, self._process.playback
        if state not in {ReplayState.REPLAYING, ReplayState.AT_END}:
            return "none", "", 0.0, 0.0, 0, 0
        word = "ended" if state is ReplayState.AT_END else "paused" if self._sync.is_paused else "playing"
        recording = playback.recording
        times = recording.duration_ns / 1e9, playback.shown_ns / 1e9
        return word, recording.name, *times, playback.speed, playback.targets
