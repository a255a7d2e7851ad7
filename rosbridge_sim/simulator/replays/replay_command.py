"""Replay commands: a MoraiSimProcHandle, read and checked as a whole, and the results of commands."""

from __future__ import annotations

from enum import IntEnum
from typing import Final

from rosbridge_sim.errors import FieldError
from rosbridge_sim.loose_types import Struct
from rosbridge_sim.records import Record
from rosbridge_sim.simulator.replays.playback_actors import ALL_TARGETS
from rosbridge_sim.simulator.replays.state_machine import ReplayEvent

MAX_PLAYBACK_SPEED: Final = 10
"""Largest speed that MORAI's dialog offers."""


class ReplayResult(IntEnum):
    """Result of a command, as `command_result` numbers it."""

    NONE = 0
    DONE = 1
    REFUSED = 16
    NOT_LOADED = 32
    UNUSABLE = 48


_COMMANDS: Final = {1: ReplayEvent.PLAY, 2: ReplayEvent.PAUSE, 32: ReplayEvent.STOP}
_FILE, _TARGETS, _START, _SPEED = 1, 2, 4, 8
_OPTIONS: Final = _FILE | _TARGETS | _START | _SPEED

_HEX_SPELLING: Final = {0x10: 2, 0x100: 4, 0x1000: 8}
"""Hexadecimal spelling of a bit -> the bit. MORAI's own comment writes the bits of both sums as 0x1, 0x10, 0x100,
0x1000, but means binary digits. These numbers have no other meaning, so they are accepted as well."""


class ReplayCommand(Record):
    """A MoraiSimProcHandle that has been read; None for an option that was not chosen.

    Attributes:
        event: PLAY, PAUSE or STOP.
        name: of the recording to load.
        targets: entities to replay, a sum of EGO, VEHICLES and PEDESTRIANS.
        start_ns: start position [ns].
        speed: recorded time for each simulated time.
    """

    event: ReplayEvent
    name: str | None
    targets: int | None
    start_ns: int | None
    speed: int | None

    @property
    def events(self) -> list[ReplayEvent]:
        """Events that the command causes, in this order."""
        if self.event is ReplayEvent.STOP:
            return [ReplayEvent.STOP]
        if self.name is not None:
            return [ReplayEvent.LOAD, self.event]
        tuned = [ReplayEvent.TUNE] if self.targets is not None or self.speed is not None else []
        return [*tuned, *([ReplayEvent.SEEK] if self.start_ns is not None else []), self.event]


def read_command(request: Struct) -> ReplayCommand:
    """Read a MoraiSimProcHandle. A stop has no options, so they are ignored.

    Returns:
        The command, with the start in nanoseconds.

    Raises:
        FieldError: a command or option that does not exist, or a value out of range.
    """
    where, option = "morai_msgs/MoraiSimProcHandle", _decode_bits(request.replay_option)
    event = _COMMANDS.get(request.sim_process_status)
    if event is None:
        got = request.sim_process_status
        raise FieldError(f"{where}.sim_process_status: expected 1 (play), 2 (pause) or 32 (stop), got {got}")
    if event is ReplayEvent.STOP:
        option = 0
    if option & ~_OPTIONS:
        raise FieldError(f"{where}.replay_option: expected a sum of 1, 2, 4 and 8, got {option}")
    targets, start_ms, speed = _decode_bits(request.replay_target_option), request.start_time, request.replay_speed
    if option & _TARGETS and (not targets or targets & ~ALL_TARGETS):
        raise FieldError(f"{where}.replay_target_option: expected a sum of 1, 2 and 4, got {targets}")
    if option & _START and start_ms < 0:
        raise FieldError(f"{where}.start_time: expected 0 or more, got {start_ms}")
    if option & _SPEED and not 1 <= speed <= MAX_PLAYBACK_SPEED:
        raise FieldError(f"{where}.replay_speed: expected 1..{MAX_PLAYBACK_SPEED}, got {speed}")
    return ReplayCommand(
        event,
        request.rosbag_file_name if option & _FILE else None,
        targets if option & _TARGETS else None,
        start_ms * 1_000_000 if option & _START else None,
        speed if option & _SPEED else None,
    )


def _decode_bits(bits: int) -> int:
    """Return a sum of bits in its binary spelling; bits of no known spelling stay as they are."""
    for literal, bit in _HEX_SPELLING.items():
        if bits > 0 and bits & literal:
            bits = bits & ~literal | bit
    return bits
