"""The source of the loops: constants and rules of the package, the structure that all loops get, and the files in C.

A rule of drivers is written once, as a function of operators and numbers (`rule_operators`). It becomes a function in
C as it becomes one of single floats. The structure has 64 bits for each field: a whole number or an array's address.
Each kernel has one of its own, and fills in what its loops need: by driver, by ego, by body or by person.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from inspect import signature
from typing import Any, ClassVar, Final

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
from rosbridge_sim.world.state import world
from rosbridge_sim.world.state.entity_arrays import BOOLS, FLOATS, INTS
from rosbridge_sim.world.state.written_equations import Script, Term, WrittenOperators

FILES: Final = (
    *("lanes.c", "perception.c", "right_of_way.c", "lane_changes.c", "motion.c", "pairs.c", "people.c"),
    "scores.c",
)
"""The files beside this one, in their order."""

LOOK_WORDS: Final = 32
"""Room for the look of one driver at the lanes beside, in 8 bytes."""

OF_ROADS: Final[Mapping[str, str]] = {
    "D": "length legs_per_metre s leg_end_of chain base points curve border turn",
    "I": "first last_leg segment_of_point first_successor successor scale_of_lane",
}
OF_SEGMENTS: Final[Mapping[str, str]] = {"D": "angle height slope length", "V": "start direction", "I": "lane point"}
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
"""Attributes of `Roads`, `LaneSegments`, `LaneConflicts`, `LaneNeighbours` and `Joins`: by lane,
point, segment or link. Those of segments have `segment_` before their names in the structure."""

_MORE: Final[Mapping[str, str]] = {
    # Facts about lanes and points, about links of lanes and about lights
    "D": "sibling_figure rival_figure straight_end straight_yaw room"
    # Figures of drivers, and of those that wander; entries of others
    " nose rear body_length wheelbase speed_factor desired headway own_accel comfort own_lateral reaction politeness"
    " change_time most_lateral response half_room rates phases width other_s other_tail other_speed other_accel"
    # Edges that count, what is kept of cells, distances ahead of egos; what a step hands over, and what is worked out
    # for each ego
    " edges_from edges_to edge_reach block_away kept_cost ahead poses before_accel across"
    # Pairs of boxes, by row or by body in order of ids; those who walk, and their crossings; cars, by row of numbers
    " now seen rate margin reach unit_x unit_y side_of stop_from start end segments kept args found",
    # Stop lines, boxes of segments, places ahead of egos
    "V": "lines block_low block_high points_ahead",
    "I": "onward_first onward_other sibling_first sibling_other rival_first rival_other before_first before_other light"
    " bounds rows let_in_later route_length route_first route wandering other_lane"
    " controller left_lane right_lane block_first block_size cells cell_segment used straight_on"
    " before_uid pair_ego pair_row world pairs wide head keys",
    "B": "may_enter may_change is_ego other_stands is_car",
    "uint64_t": "salt",
    "Look": "looks",
    "Pair": "pair",
    "Box": "box",
}
"""More arrays that are taken from elsewhere. The numbers of cells and of their segments are the last of `used`."""

FOR_DRIVERS: Final[Mapping[str, str]] = {
    "D": "gap lead_speed lead_accel stop_distance safe_speed asked_distance wanted desired_now asking_place distance"
    " heading east north angle sine cosine lateral_now left_s left_tail left_speed left_accel",
    "I": "frame decision lead_at lead asked asked_exit asking alike next_best looking at side shift_of shifted shifting"
    " left_lane left_source",
    "B": "is_shut_out is_blocked asked_again is_leaving is_clear is_tight is_second can_go",
}
"""Room for what is worked out for each driver."""

FOR_QUEUE: Final[Mapping[str, str]] = {
    "D": "q_s q_tail q_speed q_accel e_s e_tail e_speed e_accel",
    "I": "q_key q_lane q_source q_position e_lane e_source",
}
FOR_LANES: Final[Mapping[str, str]] = {
    "D": "reserved taken taken_else nearest",
    "I": "best taken_by q_first",
    "B": "stands has_long",
}
FOR_EGOS: Final[Mapping[str, str]] = {
    "D": "slope_below to_left to_right s_below lateral_below yaw_below beyond",
    "I": "lane_below",
    "B": "is_on",
}
FOR_OTHERS: Final[Mapping[str, str]] = {"D": "away turn_by turn_cosine turn_sine", "I": "nearest_rows"}
"""Room for the nearest entities of egos: squared distances of one ego, and turns and rows."""

FOR_PEOPLE: Final[Mapping[str, str]] = {
    "D": "arc nearest wish slower",
    "V": "goal course",
    "I": "next asks crossing",
    "B": "goes",
}
"""Room for what is worked out for each of those who walk."""

NUMBERS: Final = [
    *("n", "stride", "num_lanes", "num_in_map", "num_points", "num_others", "num_leaving", "num_moving"),
    *("num_entries", "num_bounds", "num_looks", "num_wandering", "num_shifted"),
    *("num_shifting", "is_possible", "has_route", "is_any", "has_passes", "has_long_legs", "scale_ticks"),
    *("num_rows", "num_worlds", "num_before", "num_curved", "num_lines", "is_flat", "has_across"),
    *("num_blocks", "cell_room", "num_ahead", "num_seen", "num_keys"),
    *("is_small", "num_heads", "most_pairs", "num_pairs", "num_near", "num_wide", "num_visited"),
]
"""Whole numbers of the structure."""

_TABLES: Final = (
    {"D": " ".join(FLOATS), "I": " ".join(INTS), "B": " ".join(BOOLS)},
    *(OF_ROADS, {kind: f"segment_{names.replace(' ', ' segment_')}" for kind, names in OF_SEGMENTS.items()}),
    *(OF_CONFLICTS, OF_NEIGHBOURS, OF_JOINS, _MORE, FOR_DRIVERS, FOR_QUEUE, FOR_LANES),
    *(FOR_EGOS, FOR_OTHERS, FOR_PEOPLE),
)
ARRAYS: Final = {name: kind for table in _TABLES for kind, names in table.items() for name in names.split()}
"""All arrays, with the type of their numbers in C. The columns of the world are first, in the order of its blocks."""

PLACE_OF: Final = {name: place for place, name in enumerate([*NUMBERS, *ARRAYS])}
"""Places of fields in the structure."""


def names_in(table: Mapping[str, str]) -> list[str]:
    """Return the names of a table."""
    return " ".join(table.values()).split()


PAIR_WORDS, BOX_WORDS = 17, 16
"""Room for a pair of the list, and for a body as the list is made, in 8 bytes."""

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
    scoring: "BACK_INSIDE SIDEWAYS LANES_AHEAD",
    world: "DT",
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

_OWN_CONSTANTS: Final = (
    "LOOK_WORDS PAIR_WORDS BOX_WORDS CELL_PLACES CELL_WORDS AROUND_KEY WITH_ARRAYS NO_ROOM NEAR_EDGES NUM_FIGURES"
    " MORE_PAIRS"
)
_MORE_CONSTANTS: Final = {
    "NEAR_LANES": segment_cells.AROUND,
    "CORNER": math.sqrt(0.5) * segment_cells.CELL,
    "CELL_LEVEL": segment_cells.LEVEL,
    "BESIDE_LANE": segment_search.BESIDE,
    "BESIDE_END": scoring.BESIDE,
    "LINE_REACH": 50.0,  # a stop line is shorter
    "TOLERANCE": 1e-3,  # rough answers are so much too large [m], [s]
    "NEAR_EDGE": 1e-9,  # sines of two libraries differ by less [m]
    "PI": math.pi,
    "FULL_TURN": 2.0 * math.pi,
    "NUM_LANES": NUM_AHEAD + 1,
    "FAR_CELL": 1e9,
    "MAX_VISITS": 8,
    "LANE_WIDTH": lane_change_motion.LANE,
    "LEG_COLUMNS": paths.NUM_COLUMNS,
    **{f"LEG_{name}": getattr(paths, name) for name in ("START", "END", "X", "Y", "DX", "DY")},
    "SIGNAL_TIME": lane_change_decision.SIGNAL_FRAMES * world.DT,
}

_RULES: Final[Sequence[Callable[..., Any]]] = (
    *(look_rules.foresee, look_rules.slow_down),
    *(driver_model.firm_stop, driver_model.drive_free, driver_model.stop, driver_model.follow),
    *(lane_change_model.mean_follow, lane_change_motion.shift_time, lane_change_motion.lateral_left),
    *(lane_change_motion.shift_length, lane_change_motion.tight_length, lane_change_motion.place_in_shift),
    *(lane_change_passing.side_in_shift, lane_wander.wander_ahead),
)
"""Rules: functions of operators and numbers."""

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
typedef struct Look Look;
"""


class COperators(WrittenOperators):
    """The operators in C. What numpy computes is a mark for `car_source`."""

    forms: ClassVar[Mapping[str, str]] = {
        "least": "({1} < {0} ? {1} : {0}) + 0.0",
        "most": "({1} > {0} ? {1} : {0}) + 0.0",
        "pick": "{0} > 0.0 ? {1} : {2}",
        "magnitude": "fabs({})",
        "root": "sqrt({})",
        "wrap": "{0} > -PI && {0} <= PI ? {0} : wrap({0})",
    }

    def _by_numpy(self, function: str, a: Term) -> Term:
        return self._script.write(f"{function} {{}}", a)


def write_rule(rule: Callable[..., Any]) -> str:
    """Return a rule as a function in C, which returns its number, or writes several to an array.

    Args:
        rule: gets operators and numbers; returns a number or several.
    """
    script = Script(len(signature(rule).parameters) - 1)
    found = rule(COperators(script, is_any=True), *script.given)
    name, arguments = getattr(rule, "__name__", ""), ", ".join(f"D {term.name}" for term in script.given)
    lines = [f"D {line};" for line in script.lines[1:]]
    if isinstance(found, Sequence):
        head = f"void {name}(D *o, {arguments})"
        lines += [f"o[{i}] = {term.name};" for i, term in enumerate(found)]
    else:
        head = f"D {name}({arguments})"
        lines.append(f"return {found.name};")
    body = "".join(f"  {line}\n" for line in lines)
    return f"static inline {head} {{\n{body}}}\n"


def write_source(files: Sequence[str]) -> str:
    """Return the whole source.

    Args:
        files: texts of `FILES`.
    """
    constants = {name: getattr(module, name) for module, names in _CONSTANTS.items() for name in names.split()}
    constants |= {name: globals()[name] for name in _OWN_CONSTANTS.split()}
    defined = [f"#define {name} {_literal(value)}\n" for name, value in (constants | _MORE_CONSTANTS).items()]
    fields = [f"I {number};" for number in NUMBERS] + [f"{kind} *{array};" for array, kind in ARRAYS.items()]
    struct = ["typedef struct {\n", *(f"  {field}\n" for field in fields), "} K;\n"]
    return "".join([_HEAD, *defined, *struct, *(write_rule(rule) for rule in _RULES), *files])


def _literal(value: float) -> str:
    return repr(value) if isinstance(value, float) else f"{value}ll"
