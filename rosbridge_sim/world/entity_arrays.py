"""The columns of the world: one block of memory for each kind of number, a row in it for each quantity.

Why one block: what is read together lies together, the world's `digest` and `snapshot` copy the block and can forget
nothing, and a run of neighbouring entities is a plain slice for numpy. What the columns mean for whom, and who may
write them, is `state`.
"""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from rosbridge_sim.world.entity_types import Body
from rosbridge_sim.world.geometry import FloatArray, IntArray

__all__ = ["BOOLS", "FLOATS", "INTS", "LEG_COLUMNS", "BoolArray", "EntityArrays"]

BoolArray = npt.NDArray[np.bool_]

MIN_ROWS: Final = 32

NOBODY: Final = Body()  # in the rows that nobody has

# Columns of float64. The order is not free: what `dynamics` reads is one run, what it writes is a run inside it, and so
# for `walking`; so a gather is one call. Runs are named by their first and last column in those modules.
FLOATS: Final = (
    # read by dynamics
    *("target", "accel_max", "accel_min", "throttle_max", "sense", "drive", "holding", "steer_cmd"),
    *("wheelbase", "steer_rate", "max_accel", "max_decel", "rolling", "drag"),
    # written by dynamics
    *("throttle", "brake", "steer", "accel", "lateral_accel", "yaw_rate"),
    # written by both
    *("x", "y", "yaw", "speed"),
    # written by walking
    *("z", "arc", "leg_start", "leg_end", "leg_x", "leg_y", "leg_z", "leg_dx", "leg_dy", "leg_dz"),
    *("leg_yaw", "leg_turn"),
    # neither
    *(
        "path_length",
        "desired_speed",
        "roll",
        "pitch",
        "speed_cmd",
        "accel_cmd",
        "max_steer",
        "speed_accel",
        "speed_decel",
    ),
    # written by waiting
    *("start_within", "start_speed"),
    # read by motion
    *("lateral_speed", "climb", "climb_accel"),
    # read by contacts
    *("half_length", "half_width", "height", "centre"),
)
LEG_COLUMNS: Final = (
    *("leg_start", "leg_end", "leg_x", "leg_y", "leg_z", "leg_dx", "leg_dy", "leg_dz"),
    *("leg_yaw", "leg_turn"),
)
INTS: Final = (
    *("uid", "kind", "gear", "mode", "path_base", "label"),
    # of traffic; the lanes behind and ahead and `lane` between them are one run
    *("turns", "claim", "held", "exit_lane", "point", "behind"),
    *("lane", "ahead_1", "ahead_2", "ahead_3", "ahead_4", "ahead_5"),
)
BOOLS: Final = ("alive", "has_path", "is_loop", "has_lane", "is_ghost")


class EntityArrays:
    """Arrays of equal length, one entry for each entity.

    All arrays are (n,) float64 unless noted; where `alive` is False they hold zeros. They are views that the world
    replaces: take them from it each time.

    Attributes:
        n: rows, with the gaps that removed entities left.
        names, bodies: lists of length n.

        alive: row in use, bool.
        uid: its id, unique and never given again until `reset`, int64.
        kind: `Kind`, int64.
        x, y, z: reference point [m].
        roll, pitch, yaw: [rad]; yaw within (-pi, pi].
        speed: along the heading, or along the path; negative when going backwards [m/s].

        accel, lateral_accel: forward and to the left, over the last step [m/s^2].
        yaw_rate: counter-clockwise, over the last step [rad/s].
        steer: angle of the front wheels, left positive [rad].
        throttle, brake: pedals 0..1, as commanded or as the controller of the mode presses them.
        gear, mode: `Gear` and `Mode`, int64.
        steer_cmd, speed_cmd, accel_cmd: last commands [rad, m/s, m/s^2]. All of these are for driven rows (EGO).

        arc: distance along the path or the lane; without either, since the row was put where it is; 0 for driven
            rows [m].
        lateral_speed, climb, climb_accel: velocity to the left [m/s] and up [m/s], acceleration up [m/s^2], as a
            recording tells them of a ghost; 0 for all others.
        has_path, is_loop: follows a path; begins again at its end, bool.
        path_length: of the path, 0 for rows without one [m].

        has_lane: keeps to the lanes, bool. The rest means something for those alone.
        lane, ahead_1 ..: rows of `roads`: where it is, and where it will go from there; -1 beyond a dead end, int64.
        behind: the lane that it has come from, -1 if none is known, int64.
        wish: how fast it would like to go, inf for as fast as is allowed [m/s].
        turns, claim, held, exit_lane, point: see `traffic`.

        start_within, start_speed: of a row that waits at rest for an ego: the distance at which it starts [m], and how
            fast it goes then [m/s]; 0 for rows that do not wait. See `waiting`.

        is_ghost: steps leave it where it stands, whatever its speed; see `dynamics.place_ghost`, bool.

        The other columns (target, sense, drive, hold, leg_*, ...) follow from these and are the working memory of
        `dynamics` and `walking`, who explain them.
    """

    target: FloatArray
    accel_max: FloatArray
    accel_min: FloatArray
    throttle_max: FloatArray
    sense: FloatArray
    drive: FloatArray
    holding: FloatArray
    steer_cmd: FloatArray
    wheelbase: FloatArray
    steer_rate: FloatArray
    max_accel: FloatArray
    max_decel: FloatArray
    rolling: FloatArray
    drag: FloatArray
    throttle: FloatArray
    brake: FloatArray
    steer: FloatArray
    accel: FloatArray
    lateral_accel: FloatArray
    yaw_rate: FloatArray
    x: FloatArray
    y: FloatArray
    yaw: FloatArray
    speed: FloatArray
    z: FloatArray
    arc: FloatArray
    leg_start: FloatArray
    leg_end: FloatArray
    leg_x: FloatArray
    leg_y: FloatArray
    leg_z: FloatArray
    leg_dx: FloatArray
    leg_dy: FloatArray
    leg_dz: FloatArray
    leg_yaw: FloatArray
    leg_turn: FloatArray
    path_length: FloatArray
    desired_speed: FloatArray
    roll: FloatArray
    pitch: FloatArray
    speed_cmd: FloatArray
    accel_cmd: FloatArray
    max_steer: FloatArray
    speed_accel: FloatArray
    speed_decel: FloatArray
    start_within: FloatArray
    start_speed: FloatArray
    lateral_speed: FloatArray
    climb: FloatArray
    climb_accel: FloatArray
    half_length: FloatArray
    half_width: FloatArray
    height: FloatArray
    centre: FloatArray
    uid: IntArray
    kind: IntArray
    gear: IntArray
    mode: IntArray
    path_base: IntArray
    label: IntArray
    turns: IntArray
    claim: IntArray
    held: IntArray
    exit_lane: IntArray
    point: IntArray
    behind: IntArray
    lane: IntArray
    ahead_1: IntArray
    ahead_2: IntArray
    ahead_3: IntArray
    ahead_4: IntArray
    ahead_5: IntArray
    alive: BoolArray
    has_path: BoolArray
    is_loop: BoolArray
    has_lane: BoolArray
    is_ghost: BoolArray

    def __init__(self) -> None:
        self.names: list[str] = []
        self.bodies: list[Body] = []
        self._allocate(0)

    def block(self, first: str, last: str) -> FloatArray:
        """Return the columns from `first` to `last` as one (columns, n) view."""
        return self._floats[FLOATS.index(first) : FLOATS.index(last) + 1, : self.n]

    def int_block(self, first: str, last: str) -> IntArray:
        """Return the same of the columns of integers."""
        return self._ints[INTS.index(first) : INTS.index(last) + 1, : self.n]

    def _allocate(self, n: int) -> None:
        """Have n rows of zeros, whose names and bodies are nobody's."""
        self.names, self.bodies = [], []
        self._floats, self._ints, self._bools = _blocks(n)
        self._bind(n)

    def _grow(self, num_rows: int) -> None:
        """Have blocks for so many rows at least, and for many more: growing costs each row a constant amount."""
        blocks = _blocks(max(2 * self.n, num_rows))
        for new, old in zip(blocks, (self._floats, self._ints, self._bools), strict=True):
            new[:, : self.n] = old[:, : self.n]
        self._floats, self._ints, self._bools = blocks

    def _bind(self, n: int) -> None:
        """Set the number of rows, and the named views to it."""
        self.n = n
        self.names[n:] = [""] * (n - len(self.names))
        self.bodies[n:] = [NOBODY] * (n - len(self.bodies))
        for block, columns in ((self._floats, FLOATS), (self._ints, INTS), (self._bools, BOOLS)):
            for i, column in enumerate(columns):
                setattr(self, column, block[i, :n])


def _blocks(capacity: int) -> tuple[FloatArray, IntArray, BoolArray]:
    """Return blocks of zeros for at least so many rows."""
    capacity = max(MIN_ROWS, capacity)
    return (
        np.zeros((len(FLOATS), capacity)),
        np.zeros((len(INTS), capacity), dtype=np.int64),
        np.zeros((len(BOOLS), capacity), dtype=bool),
    )
