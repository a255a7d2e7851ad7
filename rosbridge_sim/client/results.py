"""Results of requests to the simulator: what a tick, a call of `step`, a snapshot and a change of pace give."""

from __future__ import annotations

from dataclasses import dataclass, field

from rosbridge_sim.client.frames import Frame
from rosbridge_sim.records import Record


class Tick(Record):
    """The simulation after a tick of synchronous mode.

    Attributes:
        frame: number of the frame.
        time: simulated time [s].
        ego: a `morai_msgs/EgoVehicleStatus`: position [m, ENU], heading [deg], velocity in the car's frame [m/s].
    """

    frame: int
    time: float
    ego: Frame


class Steps(Record):
    """The simulation after a call of `step`.

    Attributes:
        frame: number of the frame.
        steps: ticks that were carried out.
        stopped_by: the condition that ended the call: `collision`, `red_light`, `off_road`, `distance` or `place`;
            empty if all ticks were carried out.
        egos: a `morai_msgs/EgoVehicleStatus` of each ego, in the order of their numbers.
        topics: last message of each topic that was asked for; None where there was none.
    """

    frame: int
    steps: int
    stopped_by: str
    egos: list[Frame]
    topics: dict[str, Frame | None]

    @property
    def ego(self) -> Frame:
        """The first ego."""
        return self.egos[0] if self.egos else {}


class RealTimeFactor(Record):
    """Speed of the world while real time moves it, as set and as measured.

    Attributes:
        factor: simulated seconds in a second; 0 for as fast as possible.
        measured: the same, as reached over the last seconds; 0 while real time does not move the world.
    """

    factor: float
    measured: float


@dataclass(frozen=True, slots=True)
class Snapshot:
    """A saved state of the simulator.

    Attributes:
        name: under which the server keeps it.
        frame: of the state that was saved.
        size: memory that it takes in the server [bytes].
        state_hash: of that state.
        data: all of it, for another process; empty if it was not asked for.
    """

    name: str
    frame: int
    size: int
    state_hash: str
    data: bytes = field(default=b"", repr=False)
