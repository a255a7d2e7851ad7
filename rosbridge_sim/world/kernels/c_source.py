"""The source of the loops: constants and rules of the package, the structure that all loops get, and the files in C.

A rule of drivers is written once, as a function of operators and numbers (`rule_operators`). It becomes a function in
C as it becomes one of single floats. A structure has 64 bits for each field: a whole number or an array's address. The
loops for drivers have one, those for pairs of boxes have another.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final

from rosbridge_sim.world import scoring
from rosbridge_sim.world.contacts import collisions, time_to_collision
from rosbridge_sim.world.drivers import (
    driver_model,
    driver_parameters,
    lane_entries,
    lane_wander,
    look_rules,
    right_of_way,
)
from rosbridge_sim.world.drivers.route_choice import NUM_AHEAD
from rosbridge_sim.world.followers import lane_following
from rosbridge_sim.world.geometry import near_pairs, segment_cells, segment_search
from rosbridge_sim.world.lane_changes import (
    lane_change_decision,
    lane_change_model,
    lane_change_motion,
    lane_change_passing,
    lane_changes,
)
from rosbridge_sim.world.people import people
from rosbridge_sim.world.roads import lane_conflicts, paths, roads, turn_shares
from rosbridge_sim.world.state.world import DT
from rosbridge_sim.world.state.written_equations import Script, Term

FILES: Final = (
    *("lanes.c", "perception.c", "right_of_way.c", "lane_changes.c", "motion.c", "pairs.c", "people.c"),
    "scores.c",
)
"""The files beside this one, in their order."""

LOOK_WORDS: Final = 32
"""Room for the look of one driver at the lanes beside, in 8 bytes."""

COLUMNS: Final[Mapping[str, str]] = {
    "D": "accel speed x y yaw z arc yaw_rate lateral_accel leg_start leg_end leg_x leg_y leg_z leg_dx leg_dy leg_dz"
    " desired_speed half_width lateral lateral_rate lateral_from lateral_to lateral_push lateral_bend lateral_left"
    " drift drift_rate wander wander_slope wander_slope_rate wander_x wander_y wander_x_rate wander_y_rate",
    "I": "turns claim held exit_lane point lane signal change change_since leaving came_from",
}
"""Columns of the world, by row."""

OF_ROADS: Final[Mapping[str, str]] = {
    "D": "length legs_per_metre s leg_end_of chain base points curve turn",
    "I": "first last_leg segment_of_point first_successor successor scale_of_lane",
}
OF_CONFLICTS: Final[Mapping[str, str]] = {
    "D": "wait_point clear_point shared speeds_ahead legs",
    "B": "gives_way rival_passes rival_right",
}
OF_NEIGHBOURS: Final[Mapping[str, str]] = {
    "D": "across",
    "I": "group place beside merge_side",
    "B": "may has_side keeps_right",
}
OF_JOINS: Final[Mapping[str, str]] = {"D": "narrow_from", "I": "join"}
"""Attributes of `Roads`, `LaneConflicts`, `LaneNeighbours` and `Joins`, by lane, point or link."""

OF_MAP: Final[Mapping[str, str]] = {
    "D": "segment_length sibling_figure rival_figure straight_end straight_yaw room",
    "I": "onward_first onward_other sibling_first sibling_other rival_first rival_other before_first before_other light"
    " bounds",
    "B": "may_enter",
}
"""More facts about lanes and points, about links of lanes and about lights."""

OF_DRIVERS: Final[Mapping[str, str]] = {
    "D": "nose rear body_length wheelbase speed_factor desired headway own_accel comfort own_lateral reaction"
    " politeness change_time most_lateral response half_room rates phases width",
    "I": "rows uid let_in_later route_length route_first route wandering",
    "B": "may_change is_loop is_ego",
    "uint64_t": "salt",
}
"""Figures of the drivers, of those that wander, and their routes."""

OF_ENTRIES: Final[Mapping[str, str]] = {
    "D": "other_s other_tail other_speed other_accel",
    "I": "other_lane",
    "B": "other_stands",
}
"""Entries of others."""

FOR_DRIVERS: Final[Mapping[str, str]] = {
    "D": "gap lead_speed lead_accel stop_distance safe_speed asked_distance wanted desired_now asking_place distance"
    " heading east north angle sine cosine lateral_now left_s left_tail left_speed left_accel",
    "I": "frame decision lead_at lead asked asked_exit asking looking at side shift_of shifted shifting left_lane"
    " left_source",
    "B": "is_shut_out is_blocked asked_again is_leaving is_clear is_tight is_second can_go",
}
"""Room for what is worked out for each driver."""

FOR_QUEUE: Final[Mapping[str, str]] = {
    "D": "q_s q_tail q_speed q_accel e_s e_tail e_speed e_accel",
    "I": "q_key q_lane q_source q_position e_lane e_source",
}
FOR_LANES: Final[Mapping[str, str]] = {
    "D": "reserved taken nearest",
    "I": "best q_first",
    "B": "stands has_long",
}
FOR_LOOKS: Final[Mapping[str, str]] = {"void": "looks"}

SCORE_COLUMNS: Final[Mapping[str, str]] = {
    "D": "x y yaw z speed accel lateral_speed lateral_accel centre half_length half_width score_distance jerk max_jerk"
    " jerk_square_sum max_lateral_accel lateral_accel_square_sum lane_offset lane_offset_sum max_lane_offset"
    " time_to_collision",
    "I": "uid score_frames road_frames off_road_frames num_lane_invasions near_lane open_line",
    "B": "alive has_passed_red is_off_road is_over_left is_over_right",
}
"""Columns of the world that scores need."""

SCORE_ROADS: Final[Mapping[str, str]] = {
    "D": "length legs_per_metre s leg_end_of chain base points curve border",
    "I": "first last_leg segment_of_point",
}
OF_SEGMENTS: Final[Mapping[str, str]] = {
    "D": "segment_start segment_direction segment_angle segment_height segment_slope edges_from edges_to lines"
    " edge_reach",
    "I": "segment_lane segment_point controller left_lane right_lane",
}
"""The lanes of the map as scores see them: segments, what is known of cells, edges that count, and stop lines."""

OF_BLOCKS: Final[Mapping[str, str]] = {
    "D": "block_low block_high block_away kept_cost",
    "I": "block_first block_size cells cell_segment used",
}
"""Boxes of segments, and what is kept of cells: the numbers of cells and of their segments last."""

PLACE_COLUMNS: Final[Mapping[str, str]] = {"D": "x y z"}
FOR_EGOS: Final[Mapping[str, str]] = {
    "D": "slope_below to_left to_right s_below lateral_below yaw_below beyond",
    "I": "lane_below",
    "B": "is_on",
}
OF_LOOKS: Final[Mapping[str, str]] = {"D": "ahead points_ahead", "I": "straight_on"}
"""Distances ahead of egos on their lanes, the places there, and for each lane the one straight on."""

OTHER_COLUMNS: Final[Mapping[str, str]] = {
    "D": "x y yaw speed lateral_speed centre half_length half_width",
    "B": "alive",
}
FOR_OTHERS: Final[Mapping[str, str]] = {"D": "away turn_by turn_cosine turn_sine seen", "I": "nearest_rows"}
"""Room for the nearest entities of egos: squared distances of one ego, and turns, figures and rows."""

OF_STEP: Final[Mapping[str, str]] = {"D": "poses before_accel across", "I": "before_uid pair_ego pair_row"}
"""Room for what is worked out for each ego, and what a step hands over."""

NUMBERS: Final = [
    *("n", "stride", "num_lanes", "num_in_map", "num_points", "num_others", "num_leaving", "num_moving"),
    *("num_entries", "num_bounds", "num_looks", "num_wandering", "num_shifted"),
    *("num_shifting", "is_possible", "has_route", "is_any", "has_passes", "has_long_legs", "scale_ticks"),
    *("num_rows", "num_worlds", "num_before", "num_curved", "num_lines", "is_flat", "has_across"),
    *("num_blocks", "cell_room", "num_ahead", "num_seen"),
]
"""Whole numbers of the structure."""

_TABLES: Final = (
    *(COLUMNS, OF_ROADS, OF_CONFLICTS, OF_NEIGHBOURS, OF_JOINS, OF_MAP, OF_DRIVERS, OF_ENTRIES),
    *(FOR_DRIVERS, FOR_QUEUE, FOR_LANES, FOR_LOOKS),
    *(SCORE_COLUMNS, SCORE_ROADS, OF_SEGMENTS, OF_BLOCKS, FOR_EGOS, OF_LOOKS, FOR_OTHERS, OF_STEP),
)
ARRAYS: Final = {name: kind for table in _TABLES for kind, names in table.items() for name in names.split()}
"""All arrays, with the type of their numbers in C."""


def names_in(table: Mapping[str, str]) -> list[str]:
    """Return the names of a table."""
    return " ".join(table.values()).split()


PLACE_OF: Final = {name: place for place, name in enumerate([*NUMBERS, *ARRAYS])}
"""Places of fields in the structure."""

PAIR_NUMBERS: Final = [
    *("n", "stride", "num_bodies", "is_small", "num_heads", "most_pairs"),
    *("num_pairs", "num_near", "num_wide", "num_visited"),
]
PAIR_COLUMNS: Final[Mapping[str, str]] = {"D": "half_length half_width centre"}
_PAIR_TABLES: Final[Sequence[Mapping[str, str]]] = (
    PAIR_COLUMNS,
    {"D": "now poses seen rate margin reach unit_x unit_y", "I": "rows world pairs wide head", "B": "is_car"},
    {"Pair": "pair", "Box": "box"},
)
PAIR_ARRAYS: Final = {name: kind for table in _PAIR_TABLES for kind, names in table.items() for name in names.split()}
PLACE_OF_PAIRS: Final = {name: place for place, name in enumerate([*PAIR_NUMBERS, *PAIR_ARRAYS])}
"""The same of the structure for pairs of boxes, by row, by body in order of ids, or by pair."""

PAIR_WORDS = BOX_WORDS = 17
"""Room for a pair of the list, and for a body as the list is made, in 8 bytes."""

PEOPLE_NUMBERS: Final = ["n", "num_keys"]
COLUMNS_OF_PEOPLE: Final[Mapping[str, str]] = {"D": "x y leg_start desired_speed start_within", "I": "yields"}
OF_PEOPLE: Final[Mapping[str, str]] = {
    "D": "path_length side stop_from start end",
    "I": "rows base first",
    "B": "is_loop",
}
"""Figures of those who walk, and of their crossings."""

FOR_PEOPLE: Final[Mapping[str, str]] = {"D": "arc nearest wish slower", "I": "next asks crossing", "B": "goes"}
FOR_PLACES: Final[Mapping[str, str]] = {"D": "goal course"}
"""Room for what is worked out for each of them; complex numbers in the last table."""

OF_PATHS: Final[Mapping[str, str]] = {"D": "segments", "I": "keys"}
_PEOPLE_ARRAYS: Final = {
    name: kind
    for table in (COLUMNS_OF_PEOPLE, OF_PEOPLE, FOR_PEOPLE, FOR_PLACES, OF_PATHS)
    for kind, names in table.items()
    for name in names.split()
}
PLACE_OF_PEOPLE: Final = {name: place for place, name in enumerate([*PEOPLE_NUMBERS, *_PEOPLE_ARRAYS])}
"""The same for the structure that the loops for people get."""

FUNCTIONS: Final = {
    **dict.fromkeys(("begin_decision", "perceive", "follow_wishes", "nudge", "find_places"), ""),
    **dict.fromkeys(("accelerate", "look_at_lanes_beside", "look_at_headings", "plan_aside", "steer"), "I"),
    **dict.fromkeys(("list_pairs", "look_at_kerbs"), "I"),
    **dict.fromkeys(("signal_changes", "take_headings", "watch_pairs", "judge_pairs"), "I I"),
    **dict.fromkeys(("mind_kerbs", "drive_cars"), " I"),
    **dict.fromkeys(("find_slants", "move"), " D"),
    **dict.fromkeys(("list_headings", "measure", "describe_others"), ""),
    **dict.fromkeys(("look_at_lanes", "judge_egos", "find_others"), "I"),
}
"""Functions of the library: the type of the result, and that of the argument after the structure's address."""

_CONSTANTS: Final = {
    collisions: "TOUCHING LIFE MARGIN TURN_MARGIN",
    near_pairs: "MAX_WIDE MUCH MAX_BOX_PAIRS PAIRS_EACH MAX_NEAR NEAR_EACH",
    driver_model: "GAP STOP_GAP BRAKE_FROM FIRM HARDEST CREEP",
    driver_parameters: "HEAVY_LENGTH",
    right_of_way: "SAME_DISTANCE FAR LEFT_TURN ROOM_TIME",
    lane_following: "LET_IN_EVERY LET_IN_FOR MAX_WAIT_DECISIONS MAX_LANES_ENTERED LONGEST_LEG MAX_STRETCH INTERVAL",
    look_rules: "MUCH_SLOWER",
    lane_conflicts: "FORESIGHT TURNS_AHEAD MIN_SAFE_SPEED MAX_LATERAL SETTLING_TIME",
    lane_entries: "CORRIDOR TICKS INDEX_BITS INDEX_MASK LAST_KEY",
    turn_shares: "ONE",
    lane_change_decision: "SIGNAL_FRAMES PATIENCE REST RETURN GOOD_REASON MUST_TIME MUST_WAY WAY_ON ENTRY_WAY"
    " SPEED_TOLERANCE LIGHT_QUEUE QUEUE_GAP BLOCKED_TIME BLOCKED_WAY PULL_OUT PULL_OUT_PER_LENGTH STUCK KIND_BRAKING"
    " COURTESY BEFORE_JOIN LOOK_BACK",
    lane_change_model: "SAFE_BRAKING THRESHOLD KEEP_RIGHT_BIAS MIN_GAP MIN_HEADWAY",
    lane_change_motion: "CAR_LENGTH SHORTEST",
    lane_change_passing: "SEEN STANDS",
    lane_changes: "LOOK_EVERY LOOK_PARTS SPARE_ROOM SLOW OFF_OLD_LANE OFF_OLD_LANE_LONG FASTER_SOON",
    lane_wander: "WAVES",
    people: "LOOK_AHEAD KERB_GAP AT_KERB BRAKE COMMITTED",
    paths: "KEYS_PER_METRE MAX_KEY",
    roads: "LEVEL",
    time_to_collision: "HORIZON",
    scoring: "BACK_INSIDE SIDEWAYS",
    segment_cells: "CELL SECTORS MAX_NUMBER MAX_LEVEL FARTHEST HIGHEST MAX_CELLS MORE",
    segment_search: "TURN_COST HEIGHT_COST SAME_HEIGHT",
}
CELL_PLACES: Final = 1 << 17
"""Places in the table of cells, of which half are used at most."""

CELL_WORDS: Final = 4
"""Whole numbers of a place: key, first segment, number of segments, and one that is free."""

AROUND_KEY: Final = 1 << 61
"""Added to the key of a cell, it is the key of the lanes around the cell; the key alone is that of the nearest ones."""

WITH_ARRAYS, NO_ROOM, NEAR_EDGES = -1, -2, -3
"""Answers of loops for scores: arrays must do it; there is no room for new cells; `across` is wanted to the bit."""

NUM_FIGURES: Final = 9
"""Figures of an entity near an ego, see `worlds.surroundings`."""

MORE_PAIRS: Final = 62
"""Pairs that may meet within the horizon, besides two for each ego, so that loops take them."""

_MORE_CONSTANTS: Final = {
    "DT": DT,
    "NUM_PLACES": CELL_PLACES,
    "CELL_WORDS": CELL_WORDS,
    "AROUND_KEY": AROUND_KEY,
    "MORE_PAIRS": MORE_PAIRS,
    "WITH_ARRAYS": WITH_ARRAYS,
    "NO_ROOM": NO_ROOM,
    "NEAR_EDGES": NEAR_EDGES,
    "NUM_FIGURES": NUM_FIGURES,
    "LANES_AHEAD": scoring.LANES_AHEAD,
    "NEAR_LANES": segment_cells.AROUND,
    "CORNER": math.sqrt(0.5) * segment_cells.CELL,
    "CELL_LEVEL": segment_cells.LEVEL,
    "BESIDE_LANE": segment_search.BESIDE,
    "BESIDE_END": scoring.BESIDE,
    "LINE_REACH": 50.0,  # a stop line and a step are shorter
    "TOLERANCE": 1e-3,  # rough answers are so much too large [m], [s]
    "NEAR_EDGE": 1e-9,  # sines of two libraries differ by less [m]
    "PI": math.pi,
    "FULL_TURN": 2.0 * math.pi,
    "NUM_LANES": NUM_AHEAD + 1,
    "LOOK_WORDS": LOOK_WORDS,
    "PAIR_WORDS": PAIR_WORDS,
    "BOX_WORDS": BOX_WORDS,
    "FAR_CELL": 1e9,
    "MAX_VISITS": 8,
    "LANE_WIDTH": lane_change_motion.LANE,
    "LEG_COLUMNS": paths.NUM_COLUMNS,
    **{f"LEG_{name}": getattr(paths, name) for name in ("START", "END", "X", "Y", "DX", "DY")},
    "SIGNAL_TIME": lane_change_decision.SIGNAL_FRAMES * DT,
}

_RULES: Final[Mapping[Callable[..., Any], int]] = {
    look_rules.foresee: 15,
    look_rules.slow_down: 10,
    driver_model.firm_stop: 3,
    driver_model.drive_free: 4,
    driver_model.stop: 3,
    driver_model.follow: 7,
    lane_change_model.mean_follow: 4,
    lane_change_motion.shift_time: 2,
    lane_change_motion.lateral_left: 4,
    lane_change_motion.shift_length: 2,
    lane_change_motion.tight_length: 3,
    lane_change_motion.place_in_shift: 5,
    lane_change_passing.side_in_shift: 6,
    lane_wander.wander_ahead: 5,
}
"""Rules, and how many numbers each gets."""

_HEAD: Final = """#include <math.h>
#include <stdint.h>
#ifdef _WIN32
#define EXPORT __declspec(dllexport)
#else
#define EXPORT
#endif
typedef int64_t I;
typedef double D;
typedef uint8_t B;
typedef struct { D x, y; } V;
typedef struct Pair Pair;
typedef struct Box Box;
"""


class COperators:
    """The functions of `rule_operators.RuleOperators` in C.

    Args:
        script: gets the lines.
    """

    def __init__(self, script: Script) -> None:
        self._script = script

    def least(self, a: Term, b: Term | float, /) -> Term:
        """Return the smaller one; 0 without a sign."""
        return self._script.write("({1} < {0} ? {1} : {0}) + 0.0", a, b)

    def most(self, a: Term, b: Term | float, /) -> Term:
        """Return the greater one; 0 without a sign."""
        return self._script.write("({1} > {0} ? {1} : {0}) + 0.0", a, b)

    def pick(self, condition: Term, if_positive: Term | float, otherwise: Term | float, /) -> Term:
        """Return the second argument where the first one is positive, else the third one."""
        return self._script.write("{0} > 0.0 ? {1} : {2}", condition, if_positive, otherwise)

    def root(self, a: Term, /) -> Term:
        """Return the square root of a number >= 0."""
        return self._script.write("sqrt({})", a)


def write_rule(rule: Callable[..., Any], num: int) -> str:
    """Return a rule as a function in C, which writes its results to an array.

    Args:
        rule: gets operators and `num` numbers; returns a number or several.
    """
    script = Script(num)
    found = rule(COperators(script), *script.given)
    results = found if isinstance(found, Sequence) else (found,)
    arguments = ", ".join(f"D {term.name}" for term in script.given)
    lines = [f"D {line};" for line in script.lines[1:]] + [f"o[{i}] = {term.name};" for i, term in enumerate(results)]
    body = "".join(f"  {line}\n" for line in lines)
    return f"static inline void {getattr(rule, '__name__', '')}(D *o, {arguments}) {{\n{body}}}\n"


def write_source(files: Sequence[str]) -> str:
    """Return the whole source.

    Args:
        files: texts of `FILES`.
    """
    constants = {name: getattr(module, name) for module, names in _CONSTANTS.items() for name in names.split()}
    defined = [f"#define {name} {_literal(value)}\n" for name, value in (constants | _MORE_CONSTANTS).items()]
    structs = [
        write_struct("K", NUMBERS, ARRAYS),
        write_struct("P", PAIR_NUMBERS, PAIR_ARRAYS),
        write_struct("W", PEOPLE_NUMBERS, _PEOPLE_ARRAYS),
    ]
    return "".join([_HEAD, *defined, *structs, *(write_rule(*rule) for rule in _RULES.items()), *files])


def write_struct(name: str, numbers: Sequence[str], arrays: Mapping[str, str]) -> str:
    """Return a structure of whole numbers and of arrays, which have the types of their numbers."""
    fields = [f"I {number};" for number in numbers] + [f"{kind} *{array};" for array, kind in arrays.items()]
    return "typedef struct {\n" + "".join(f"  {field}\n" for field in fields) + f"}} {name};\n"


def _literal(value: float) -> str:
    return repr(value) if isinstance(value, float) else f"{value}ll"
