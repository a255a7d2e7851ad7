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

from rosbridge_sim.world.geometry.planar import FloatArray, IntArray
from rosbridge_sim.world.state.entity_types import Body

BoolArray = npt.NDArray[np.bool_]

MIN_ROWS: Final = 32
"""Rows that memory is taken for at least: a small world then never grows its blocks."""

LARGE: Final = 1_024
RESERVED_ROWS: Final = 24_120
"""From so many rows on, addresses for the second number of them are reserved at once: more than a scene can have. The
system gives memory page by page as rows come into use. A larger copy at each growth would stop the world: where a
system must find 27 MB first, that takes 60 ms. The number is no multiple of a page, or columns would share cache
lines."""

NO_BODY: Final = Body()
"""The body of a free row."""

# Groups of columns, by the module or the subject that owns them. The order matters: the columns that `dynamics` reads
# are one run, those that it writes are a run inside it, and likewise for `path_following`. So one call gathers a run.
# Those modules name a run by its first and last column. The names are no part of digests or snapshots; the order is.

# Egos: their bodies, what is commanded, and the ground below
_TYRE_BODY: Final = (
    *("front_load", "cg_height", "dynamic_index", "front_stiffness", "rear_stiffness", "grip", "grip_along"),
    *("front_drive", "pitch_gain", "roll_gain", "launch_accel", "power", "top_speed", "air_drag", "engine_drag"),
)
_TYRE_COMMANDS: Final = ("rear_steer_cmd", "creep", "rolls", "jerk_limit")
_GROUND: Final = ("friction", "grade", "ground_pitch", "ground_roll")
_CONTROLS: Final = ("target", "accel_max", "accel_min", "throttle_max", "sense", "drive", "holding", "steer_cmd")
_LIMITS: Final = ("wheelbase", "steer_rate", "max_accel", "max_decel", "rolling", "drag")
_COMMANDS: Final = ("speed_cmd", "accel_cmd", "max_steer", "speed_accel", "speed_decel")

# Egos: written by `single_track`, and by `dynamics`
_TYRES: Final = (
    *("rear_steer", "drive_lag", "brake_lag", "lateral_speed", "yaw_accel"),
    *("front_slip", "rear_slip", "front_force", "rear_force"),
    *("lean_pitch", "lean_roll", "pitch_rate", "roll_rate"),
)
_PEDALS: Final = ("throttle", "brake", "steer")

# All: pose and motion; the last group is that of ghosts
_TILT: Final = ("pitch", "roll")
_CHANGE_OF_MOTION: Final = ("accel", "lateral_accel", "yaw_rate")
_POSE: Final = ("x", "y", "yaw", "speed")
_CLIMB: Final = ("climb", "climb_accel")

# All but egos: of `path_following`, of paths, and of `waiting`
LEG_COLUMNS: Final = (
    *("leg_start", "leg_end", "leg_x", "leg_y", "leg_z", "leg_dx", "leg_dy", "leg_dz"),
    *("leg_yaw", "leg_turn"),
)
_PROGRESS: Final = ("z", "arc", *LEG_COLUMNS)
_PATH: Final = ("path_length", "desired_speed")
_WAITING: Final = ("start_within", "start_speed")

# All: the box, and what `impacts` writes
_BOX: Final = ("half_length", "half_width", "height", "centre")
_IMPACT: Final = ("loose",)

# Lane followers: of `lane_change_motion`, whose first four are one run, of `lane_changes`, and of `lane_wander`
LANE_CHANGE_COLUMNS: Final = (
    *("lateral", "lateral_rate", "drift", "drift_rate"),
    *("lateral_from", "lateral_to", "lateral_push", "lateral_bend", "lateral_left"),
    "lateral_bias",
    *("wander_width", "wander", "wander_slope", "wander_slope_rate"),
    *("wander_x", "wander_y", "wander_x_rate", "wander_y_rate"),
)
"""One run. They are zeros for all but lane followers, so that a digest needs them only where lanes are changed."""

LANE_CHANGE_CODES: Final = ("signal", "change", "change_since", "leaving", "came_from")
"""One run of integers of `lane_changes`, and zeros likewise."""

_LANES: Final = (
    *("turns", "claim", "held", "exit_lane", "point", "behind"),  # from `behind` on they are one run
    *("lane", "ahead_1", "ahead_2", "ahead_3", "ahead_4", "ahead_5"),
)

# Egos, while scores are kept; the contacts are one run
_SCORE: Final = (
    *("score_distance", "time_to_collision", "min_time_to_collision"),
    *("lane_offset", "lane_offset_sum", "max_lane_offset"),
    *("jerk", "max_jerk", "jerk_square_sum", "max_lateral_accel", "lateral_accel_square_sum"),
)
_SCORE_COUNTS: Final = (
    *("score_since", "score_frames", "road_frames", "off_road_frames"),
    *("num_collisions", "num_red_lights", "num_stop_lines", "num_lane_invasions"),
    *("near_lane", "open_line", "open_reds"),
    *("contact_1", "contact_2", "contact_3", "contact_4", "contact_5", "contact_6", "contact_7", "contact_8"),
)
_SCORE_STATES: Final = ("has_collided", "has_passed_red", "is_off_road", "is_over_left", "is_over_right")

FLOATS: Final = (
    # read by the single track model, from `_TYRES` on written by it; `path_following` writes from `x` on
    *(*_TYRE_BODY, *_TYRE_COMMANDS, *_GROUND, *_TYRES, *_TILT),
    # read by the kinematic model, from `_PEDALS` on written by it
    *(*_CONTROLS, *_LIMITS, *_PEDALS, *_CHANGE_OF_MOTION, *_POSE),
    *(*_PROGRESS, *_PATH, *_COMMANDS, *_WAITING, *_CLIMB, *_BOX, *_IMPACT),
    *LANE_CHANGE_COLUMNS,
    *_SCORE,
)
INTS: Final = (
    *("uid", "kind", "gear", "mode", "path_base", "label", "yields"),
    *_LANES,
    *LANE_CHANGE_CODES,
    *_SCORE_COUNTS,
)
BOOLS: Final = ("alive", "has_path", "is_loop", "has_lane", "is_ghost", "keeps_lane", *_SCORE_STATES)

NUM_CORE: Final = (FLOATS.index("score_distance"), INTS.index("score_since"), BOOLS.index("has_collided"))
"""Columns of each block without those of `score`, which are zeros while no scores are kept."""


_FLOAT_LINES: Final = {name: line for line, name in enumerate(FLOATS)}
_INT_LINES: Final = {name: line for line, name in enumerate(INTS)}

_KINEMATIC: Final = (
    *(*_CONTROLS, *_LIMITS, *_PEDALS, *_CHANGE_OF_MOTION, *_POSE, *_PROGRESS, *_PATH, "roll", "pitch"),
    *(*_COMMANDS, *_WAITING, "lateral_speed", *_CLIMB, *_BOX),
)
KINEMATIC_CORE: Final = np.array([FLOATS.index(name) for name in _KINEMATIC])
"""Rows of the float block that the kinematic model has, in its own order, without those of `score`: its digests do not
depend on the columns of other models."""

KINEMATIC_ALL: Final = np.array([FLOATS.index(name) for name in (*_KINEMATIC, *_SCORE)])
"""The same, with those of `score`."""


class EntityArrays:
    """Arrays of equal length with one entry for each entity.

    All arrays are (n,) float64 unless noted; where `alive` is False they hold zeros. They are views that the world
    replaces: take them from it each time.

    Attributes:
        n: number of rows, those of removed entities included.
        names, bodies: lists of length n.

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

    # Identity, and the box of the body
    alive: BoolArray
    uid: IntArray
    kind: IntArray
    label: IntArray
    half_length: FloatArray
    half_width: FloatArray
    height: FloatArray
    centre: FloatArray
    # Pose and motion
    x: FloatArray
    y: FloatArray
    yaw: FloatArray
    speed: FloatArray
    z: FloatArray
    pitch: FloatArray
    roll: FloatArray
    accel: FloatArray
    lateral_accel: FloatArray
    yaw_rate: FloatArray
    lateral_speed: FloatArray
    climb: FloatArray
    climb_accel: FloatArray
    is_ghost: BoolArray
    loose: FloatArray
    # Egos: bodies, commands and controls
    gear: IntArray
    mode: IntArray
    wheelbase: FloatArray
    steer_rate: FloatArray
    max_accel: FloatArray
    max_decel: FloatArray
    rolling: FloatArray
    drag: FloatArray
    speed_cmd: FloatArray
    accel_cmd: FloatArray
    max_steer: FloatArray
    speed_accel: FloatArray
    speed_decel: FloatArray
    target: FloatArray
    accel_max: FloatArray
    accel_min: FloatArray
    throttle_max: FloatArray
    sense: FloatArray
    drive: FloatArray
    holding: FloatArray
    steer_cmd: FloatArray
    throttle: FloatArray
    brake: FloatArray
    steer: FloatArray
    # Egos: the single track model
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
    rear_steer: FloatArray
    drive_lag: FloatArray
    brake_lag: FloatArray
    yaw_accel: FloatArray
    front_slip: FloatArray
    rear_slip: FloatArray
    front_force: FloatArray
    rear_force: FloatArray
    lean_pitch: FloatArray
    lean_roll: FloatArray
    pitch_rate: FloatArray
    roll_rate: FloatArray
    # Paths, and constant motion
    has_path: BoolArray
    is_loop: BoolArray
    path_base: IntArray
    yields: IntArray
    path_length: FloatArray
    desired_speed: FloatArray
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
    start_within: FloatArray
    start_speed: FloatArray
    # Lanes
    has_lane: BoolArray
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
    # Lane changes and wander
    signal: IntArray
    change: IntArray
    change_since: IntArray
    leaving: IntArray
    came_from: IntArray
    keeps_lane: BoolArray
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
    # Scores
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
    has_collided: BoolArray
    has_passed_red: BoolArray
    is_off_road: BoolArray
    is_over_left: BoolArray
    is_over_right: BoolArray

    def __init__(self) -> None:
        self.names: list[str] = []
        self.bodies: list[Body] = []
        self._allocate(0)

    def block(self, first: str, last: str) -> FloatArray:
        """Return the float columns from `first` to `last`, given by name, as one (columns, n) view."""
        return self._floats[_FLOAT_LINES[first] : _FLOAT_LINES[last] + 1, : self.n]

    def int_block(self, first: str, last: str) -> IntArray:
        """Return the integer columns from `first` to `last`, given by name, as one (columns, n) view."""
        return self._ints[_INT_LINES[first] : _INT_LINES[last] + 1, : self.n]

    def _allocate(self, n: int) -> None:
        """Take new blocks, with n free rows."""
        self.names, self.bodies = [], []
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
        self.names[n:] = [""] * (n - len(self.names))
        self.bodies[n:] = [NO_BODY] * (n - len(self.bodies))
        for block, columns in ((self._floats, FLOATS), (self._ints, INTS), (self._bools, BOOLS)):
            for i, column in enumerate(columns):
                setattr(self, column, block[i, :n])


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
