"""The arrays of the world: one block of memory for each type of number, with one line in it for each quantity (column).

One block has three advantages. Quantities that are read together lie together. `digest` and `snapshot` copy the whole
block, so they cannot forget a quantity. A run of neighbouring entities is a plain slice for numpy. `world.World` owns
the arrays and says who may write them.
"""

from __future__ import annotations

import mmap
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from rosbridge_sim.world.geometry.planar import BoolArray, FloatArray, IntArray

MIN_ROWS: Final = 32
"""Rows that memory is taken for at least: a small world then never grows its blocks."""

LARGE: Final = 1_024
RESERVED_ROWS: Final = 24_120
"""From so many rows on, addresses for the second number of them are reserved at once: more than a scene can have. The
system gives memory page by page as rows come into use. A larger copy at each growth would stop the world: where a
system must find 27 MB first, that takes 60 ms. The number is no multiple of a page, or columns would share cache
lines."""


class EntityArrays:
    """Arrays of equal length with one entry for each entity.

    All arrays are (n,) float64 unless noted; where `alive` is False they hold zeros. They are views that the world
    replaces: take them from it each time.

    Attributes:
        n: number of rows, those of removed entities included.

        alive: bool, the row is in use.
        uid: int64, id of the entity, unique and not given again until `reset`.
        kind: int64, a `Kind`.
        x, y, z: reference point [m].
        roll, pitch, yaw: [rad]; yaw within (-pi, pi].
        speed: along the heading, or along the path; negative when going backwards [m/s].

        accel, lateral_accel: of the reference point, forward and to the left, over the last step [m/s^2].
        yaw_rate: counter-clockwise, over the last step; of the single track model, at its end [rad/s].
        steer: angle of the front wheels, left positive [rad].
        throttle, brake: pedals 0..1, as commanded or as the controller of the mode presses them.
        gear, mode: `Gear` and `Mode`, int64.
        steer_cmd, speed_cmd, accel_cmd: last commands [rad, m/s, m/s^2].
            The attributes from `accel` to here are those of driven rows (EGO); lane followers have accelerations and
            yaw rate as well.

        loose: 1 for a vehicle that an impact has thrown off its lane and that slides with locked wheels or has come to
            rest so, and for an ego that spins, else 0; see `impacts`.

        arc: distance along the path or the lane; without either, since the row was placed; 0 for driven rows [m].
        lateral_speed, climb, climb_accel: velocity to the left [m/s] and up [m/s], acceleration up [m/s^2], of ghosts
            as their recording has them, and lateral_speed of a loose row and of a row of the single track model; 0 for
            all others.

        The following entries are those of driven rows in the single track model; see `single_track`.
        friction: of the ground below; see `ground`.
        grade: acceleration along the heading by the slope of the ground, negative uphill [m/s^2].
        ground_pitch, ground_roll: of the ground below [rad].
        drive_lag, brake_lag: pedals as engine and brakes follow them, 0..1.
        rear_steer_cmd, rear_steer: last command, and angle of the rear wheels, left positive [rad].
        yaw_accel: change of yaw_rate over the last step [rad/s^2].
        front_slip, rear_slip: direction of motion of the wheels of an axle, seen from where they point, left positive
            [rad].
        front_force, rear_force: sideways force on the wheels of an axle, left positive, for each kg of the car [N/kg].
        lean_pitch, lean_roll: of the body, relative to the ground [rad].
        pitch_rate, roll_rate: change of these over the last step [rad/s].
        has_path, is_loop: bool, the row follows a path; it begins again at the end of its path or route.
        path_length: 0 for rows without a path [m].
        yields: int64, not 0 for a row on a path that stops for what is ahead; see `people` and `careful_driving`.

        has_lane: bool, the row follows lanes. The next five entries have a meaning for such rows only.
        lane, ahead_1 ..: int64, rows of `roads`: the present lane and the five after it; -1 beyond a dead end.
        behind: int64, the lane before the present one; -1 if none is known.
        desired_speed: speed that the driver wants, inf for as fast as is allowed [m/s].
        turns: int64, how many lanes it has entered or chosen anew; see `route_choice`.
        claim, held, exit_lane, point: int64; see `lane_entries.Drivers`.

        lateral: offset of the reference point from the line of the lane, left positive [m].
        lateral_rate: its change until the next decision [m/s].
        drift, drift_rate: heading relative to the lane, left positive [rad], and its change [rad/s].
        lateral_from, lateral_to, lateral_push, lateral_bend, lateral_left: of a motion to another offset, its start,
            its end, its first slope and second derivative [m], and the share that is left; see `lane_change_motion`.
        lateral_bias: the offset that the driver keeps in its lane [m].
        signal: int64, of a driver on lanes: 0 none, 1 left, 2 right.
        change: int64, reason of the lane change that the driver makes or wants, 0 for none; see
            `lane_change_model.LaneChange`.
        change_since: int64, frame from which on it has wanted it; without a change, the frame at which the last one
            ended.
        leaving: int64, side on which the lane lies that the driver leaves, as in `signal`; 0 if it changes none.
        came_from: int64, side on which the lane lies that it left by its last change, as in `signal`; 0 before that.
        keeps_lane: bool, the driver never changes lanes.
        wander_width: standard deviation with which a driver wanders within its lane [m]; 0 for one that does not.
        wander: displacement by it at the next decision, left positive [m]; see `lane_wander`.
        wander_slope, wander_slope_rate: its slope now, and the change of that [1/s].
        wander_x, wander_y, wander_x_rate, wander_y_rate: displacement by it now, to the east and to the north [m], and
            its changes [m/s].

        start_within, start_speed: of a row that waits at rest for an ego, the distance at which it starts [m] and the
            speed with which it starts [m/s]; 0 for rows that do not wait. See `waiting`.

        is_ghost: bool, steps leave the row where it is, whatever its speed; see `placement.place_ghost`.

        half_length, half_width, height, centre: of the body's box; see `Body` [m].

        score_distance ..: of an EGO, while `World.is_scoring`; zeros before that and for all others. What they mean
            exactly is in `score`.
        score_distance: driven since `score_since` [m].
        time_to_collision, min_time_to_collision: at this frame, and the least so far; inf for none [s].
        lane_offset, lane_offset_sum, max_lane_offset: of the middle of the box from the line of its lane, left
            positive, at this frame; sum and greatest of its amounts over the `road_frames` [m].
        jerk, max_jerk, jerk_square_sum: change of `accel`, at this frame; greatest amount [m/s^3]; sum of its squares.
        max_lateral_accel, lateral_accel_square_sum: greatest amount of `lateral_accel` [m/s^2], sum of its squares.
        score_since: int64, the frame from which on all this counts.
        score_frames, road_frames, off_road_frames: int64, frames since then; those on a lane, those off the road.
        num_collisions, num_red_lights, num_stop_lines, num_lane_invasions: int64, counts since then.
        near_lane: int64, row of the nearest lane plus 1; 0 if none is known.
        open_line, open_reds: int64, the lane plus 1 whose stop line was passed where the lights differ for the lanes
            behind it, and which of these showed red (bit i for the i-th of `Roads.successors`); 0 for none.
        contact_1 ..: int64, ids of the latest new contacts plus 1, the latest first; 0 for none.
        has_collided, has_passed_red: bool, within the last frame.
        is_off_road: bool, at this frame.
        is_over_left, is_over_right: bool, the box reaches over that edge of its lane.

        The other columns follow from these: `control_columns` explains target, sense, drive, holding and the like,
        `path_following` explains leg_*.
    """

    # Columns by the type of number, in groups by the module or the subject that owns them. The order matters: the
    # columns that `dynamics` reads are one run, those that it writes are a run inside it, and likewise for
    # `path_following`. So one call gathers a run. Those modules name a run by its first and last column. The names are
    # no part of digests or snapshots; the order is.

    # Floats read by the single track model: bodies, commands and the ground below of egos
    front_load: FloatArray
    cg_height: FloatArray
    dynamic_index: FloatArray
    front_stiffness: FloatArray
    rear_stiffness: FloatArray
    grip: FloatArray
    grip_along: FloatArray
    front_drive: FloatArray
    pitch_gain: FloatArray
    roll_gain: FloatArray
    launch_accel: FloatArray
    power: FloatArray
    top_speed: FloatArray
    air_drag: FloatArray
    engine_drag: FloatArray
    rear_steer_cmd: FloatArray
    creep: FloatArray
    rolls: FloatArray
    jerk_limit: FloatArray
    friction: FloatArray
    grade: FloatArray
    ground_pitch: FloatArray
    ground_roll: FloatArray
    # From here on written by it
    rear_steer: FloatArray
    drive_lag: FloatArray
    brake_lag: FloatArray
    lateral_speed: FloatArray
    yaw_accel: FloatArray
    front_slip: FloatArray
    rear_slip: FloatArray
    front_force: FloatArray
    rear_force: FloatArray
    lean_pitch: FloatArray
    lean_roll: FloatArray
    pitch_rate: FloatArray
    roll_rate: FloatArray
    # Tilt of all rows
    pitch: FloatArray
    roll: FloatArray
    # Floats read by the kinematic model: controls and limits of egos
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
    # From here on written by it
    throttle: FloatArray
    brake: FloatArray
    steer: FloatArray
    accel: FloatArray
    lateral_accel: FloatArray
    yaw_rate: FloatArray
    # Pose of all rows; `path_following` writes from here on
    x: FloatArray
    y: FloatArray
    yaw: FloatArray
    speed: FloatArray
    z: FloatArray
    arc: FloatArray
    # The leg of a path
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
    # Paths
    path_length: FloatArray
    desired_speed: FloatArray
    # Last commands to egos
    speed_cmd: FloatArray
    accel_cmd: FloatArray
    max_steer: FloatArray
    speed_accel: FloatArray
    speed_decel: FloatArray
    # Rows that wait for an ego
    start_within: FloatArray
    start_speed: FloatArray
    # Motion of ghosts
    climb: FloatArray
    climb_accel: FloatArray
    # The box of all rows, and what `impacts` writes
    half_length: FloatArray
    half_width: FloatArray
    height: FloatArray
    centre: FloatArray
    loose: FloatArray
    # Lane followers: of `lane_change_motion`, whose first four are one run, of `lane_changes`, and of `lane_wander`
    lateral: FloatArray
    lateral_rate: FloatArray
    drift: FloatArray
    drift_rate: FloatArray
    lateral_from: FloatArray
    lateral_to: FloatArray
    lateral_push: FloatArray
    lateral_bend: FloatArray
    lateral_left: FloatArray
    lateral_bias: FloatArray
    wander_width: FloatArray
    wander: FloatArray
    wander_slope: FloatArray
    wander_slope_rate: FloatArray
    wander_x: FloatArray
    wander_y: FloatArray
    wander_x_rate: FloatArray
    wander_y_rate: FloatArray
    # Egos, while scores are kept
    score_distance: FloatArray
    time_to_collision: FloatArray
    min_time_to_collision: FloatArray
    lane_offset: FloatArray
    lane_offset_sum: FloatArray
    max_lane_offset: FloatArray
    jerk: FloatArray
    max_jerk: FloatArray
    jerk_square_sum: FloatArray
    max_lateral_accel: FloatArray
    lateral_accel_square_sum: FloatArray
    # Integers of all rows
    uid: IntArray
    kind: IntArray
    gear: IntArray
    mode: IntArray
    path_base: IntArray
    label: IntArray
    yields: IntArray
    # Lane followers; from `behind` on they are one run
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
    # Of `lane_changes`
    signal: IntArray
    change: IntArray
    change_since: IntArray
    leaving: IntArray
    came_from: IntArray
    # Egos, while scores are kept; the contacts are one run
    score_since: IntArray
    score_frames: IntArray
    road_frames: IntArray
    off_road_frames: IntArray
    num_collisions: IntArray
    num_red_lights: IntArray
    num_stop_lines: IntArray
    num_lane_invasions: IntArray
    near_lane: IntArray
    open_line: IntArray
    open_reds: IntArray
    contact_1: IntArray
    contact_2: IntArray
    contact_3: IntArray
    contact_4: IntArray
    contact_5: IntArray
    contact_6: IntArray
    contact_7: IntArray
    contact_8: IntArray
    # Truth values of all rows
    alive: BoolArray
    has_path: BoolArray
    is_loop: BoolArray
    has_lane: BoolArray
    is_ghost: BoolArray
    keeps_lane: BoolArray
    # Egos, while scores are kept
    has_collided: BoolArray
    has_passed_red: BoolArray
    is_off_road: BoolArray
    is_over_left: BoolArray
    is_over_right: BoolArray

    def __init__(self, n: int = 0) -> None:
        self._allocate(n)

    def block(self, first: str, last: str) -> FloatArray:
        """Return the float columns from `first` to `last`, given by name, as one (columns, n) view."""
        return self._floats[_FLOAT_LINES[first] : _FLOAT_LINES[last] + 1, : self.n]

    def int_block(self, first: str, last: str) -> IntArray:
        """Return the integer columns from `first` to `last`, given by name, as one (columns, n) view."""
        return self._ints[_INT_LINES[first] : _INT_LINES[last] + 1, : self.n]

    def bool_block(self) -> BoolArray:
        """Return all columns of truth values as one (columns, n) view."""
        return self._bools[:, : self.n]

    def _allocate(self, n: int) -> None:
        """Take new blocks, with n free rows."""
        self._floats, self._ints, self._bools = _blocks(n)
        self._bind(n)

    def _grow(self, num_rows: int) -> None:
        """Take blocks of at least twice the size, so that growth costs a constant time for each row."""
        blocks = _blocks(max(2 * self.n, num_rows))
        for new, old in zip(blocks, (self._floats, self._ints, self._bools), strict=True):
            new[:, : self.n] = old[:, : self.n]
        self._floats, self._ints, self._bools = blocks

    def _bind(self, n: int) -> None:
        """Set the number of rows, and renew the named views."""
        self.n = n
        for block, columns in ((self._floats, FLOATS), (self._ints, INTS), (self._bools, BOOLS)):
            for column, view in zip(columns, block[:, :n], strict=True):
                setattr(self, column, view)


def _columns(kind: str) -> tuple[str, ...]:
    """Return the columns of one type of number, in the order of the class."""
    return tuple(name for name, each in EntityArrays.__annotations__.items() if each == kind)


FLOATS: Final = _columns("FloatArray")
INTS: Final = _columns("IntArray")
BOOLS: Final = _columns("BoolArray")
_FLOAT_LINES: Final = {name: line for line, name in enumerate(FLOATS)}
_INT_LINES: Final = {name: line for line, name in enumerate(INTS)}


def _run(first: str, last: str) -> tuple[str, ...]:
    """Return the columns of floats from one to another."""
    return FLOATS[_FLOAT_LINES[first] : _FLOAT_LINES[last] + 1]


NUM_CORE: Final = (FLOATS.index("score_distance"), INTS.index("score_since"), BOOLS.index("has_collided"))
"""Columns of each block without those of `score`, which are zeros while no scores are kept."""

LEG_COLUMNS: Final = _run("leg_start", "leg_turn")

LANE_CHANGE_COLUMNS: Final = _run("lateral", "wander_y_rate")
"""They are zeros for all but lane followers, so that a digest needs them only where lanes are changed."""

LANE_CHANGE_CODES: Final = INTS[INTS.index("signal") : INTS.index("came_from") + 1]
"""Integers of `lane_changes`, and zeros likewise."""

_KINEMATIC: Final = (
    *(*_run("target", "desired_speed"), "roll", "pitch"),
    *(*_run("speed_cmd", "start_speed"), "lateral_speed", *_run("climb", "centre")),
)
KINEMATIC_CORE: Final = np.array([_FLOAT_LINES[name] for name in _KINEMATIC])
"""Rows of the float block that the kinematic model has, in its own order, without those of `score`: its digests do not
depend on the columns of other models."""

KINEMATIC_ALL: Final = np.array([*KINEMATIC_CORE, *range(NUM_CORE[0], len(FLOATS))])
"""The same, with those of `score`."""


def _blocks(capacity: int) -> tuple[FloatArray, IntArray, BoolArray]:
    """Return blocks of zeros for at least `capacity` rows."""
    make, capacity = (
        (np.zeros, max(MIN_ROWS, capacity)) if capacity < LARGE else (_reserve, max(RESERVED_ROWS, capacity))
    )
    return (
        make((len(FLOATS), capacity), np.float64),
        make((len(INTS), capacity), np.int64),
        make((len(BOOLS), capacity), np.bool_),
    )


def _reserve(shape: tuple[int, int], dtype: npt.DTypeLike) -> npt.NDArray[Any]:
    """Return zeros in memory that the system gives page by page, when it is first written to.

    numpy's own memory of this size comes in huge pages, of which each holds parts of many columns.
    """
    # Windows has neither these flags nor processes that would share the memory.
    private = {"flags": mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS} if hasattr(mmap, "MAP_PRIVATE") else {}
    memory = mmap.mmap(-1, shape[0] * shape[1] * np.dtype(dtype).itemsize, **private)
    return np.frombuffer(memory, dtype).reshape(shape)
