"""The page of the environments: options, observation by row, reward and end of each, and results of drivers.

Options and bounds come from the sources; the figures from `environment_figures.json`, which
`scripts/examples/drive_environments.py --json` writes; the pictures from `scripts/draw_environments.py`.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from dataclasses import fields
from pathlib import Path
from typing import Final

import gymnasium

from rosbridge_sim.environments.action_kinds import MAX_ACCEL, MAX_STEER, META_ACTIONS
from rosbridge_sim.environments.driving_task import DrivingTask
from rosbridge_sim.environments.observations import (
    AHEAD,
    GOAL_FIGURES,
    GRID_BOUNDS,
    LANE_FIGURES,
    LIGHT_FIGURES,
    OTHER_BOUNDS,
    RAY_SPEED,
)
from rosbridge_sim.environments.registration import TASKS, register_all
from rosbridge_sim.worlds.occupancy import GRID_FIGURES
from rosbridge_sim.worlds.rays import RAY_FIGURES
from rosbridge_sim.worlds.surroundings import OTHER_FIGURES

FIGURES: Final = Path(__file__).parent / "environment_figures.json"

EXAMPLES: Final = Path(__file__).parents[1] / "examples"

UNITS: Final = {
    **dict.fromkeys(("speed", "vx", "vy"), "m/s"),
    **dict.fromkeys(("offset", "to_left", "to_right", "to_light", "x", "y", "length", "width", "distance"), "m"),
    **{f"{axis}_{int(each)}": "m" for each in AHEAD for axis in "xy"},
    "heading": "rad",
    "steering": "rad",
    "yaw_rate": "rad/s",
}
"""Units of figures; the others are 0 or 1, or a cosine or sine."""

MEANINGS: Final = {
    "speed": "speed along the heading",
    "offset": "from the line of the lane, left positive",
    "heading": "relative to the lane, left positive",
    "to_left": "to the left edge of the lane",
    "to_right": "to the right edge of the lane",
    "steering": "angle of the front wheels, left positive",
    "yaw_rate": "left positive",
    **{f"x_{int(each)}": f"of the lane's line {each:g} m ahead, forward" for each in AHEAD},
    **{f"y_{int(each)}": f"of the lane's line {each:g} m ahead, to the left" for each in AHEAD},
    "to_light": "to the end of the lane before the next light straight on",
    "must_stop": "1 if that light is red or yellow",
    "is_there": "1 if there is an entity, else all nine are 0",
    "x": "of the middle of its box, forward",
    "y": "of the middle of its box, to the left",
    "vx": "velocity relative to the ego's, forward",
    "vy": "velocity relative to the ego's, to the left",
    "cos": "of its heading relative to the ego's",
    "sin": "of its heading relative to the ego's",
    "length": "of its box",
    "width": "of its box",
    "presence": "1 if an entity is in the cell",
    "on_road": "1 if the middle of the cell is on the road",
    "distance": "to the first box or border of the road",
}

TERMS: Final = {
    "speed": "max(0, 1 - abs(v cos h / {target_speed:g} - 1)), with the speed v [m/s] and the heading h",
    "offset": "-min(abs(offset) / 2 m, 1)",
    "steering": "-a², with the first number a of the action; with `DiscreteMeta` 1 for each change of lanes",
    "failure": "-1 in the step of a failure",
    "red_light": "-1 for each red light passed in the step",
    "near_miss": "-max(0, 1 - time to collision / 1.5 s), while the ego is faster than 0.5 m/s",
    "arrived": "1 in the step in which the ego arrives",
    "goal": "-√(Σ w abs(achieved - desired)), with w = 1 for x and y, 0 for the velocity, 0.02 for cosine and sine",
}

TITLES: Final = {
    "LaneKeeping-v1": "Keep to a lane of `loop`, from anywhere on the lap.",
    "Highway-v1": "Drive in the traffic of a motorway with three lanes, from anywhere at 25 m/s.",
    "Merge-v0": "Join the traffic of a motorway from the entry lane.",
    "Roundabout-v1": "Drive through roundabouts and a crossing without lights, with traffic.",
    "Intersection-v1": "Cross a junction with lights, traffic and people, from 40 m before it.",
    "Parking-v1": "Reverse into a free bay between parked cars.",
    "Drive-v0": "Drive in any scenario; as it is, in the town.",
}

REASONS: Final = {
    "LaneKeeping-v1": (
        "It begins anywhere, because the first 600 m of the scenario are straight: there a driver that sees "
        "nothing (`blind`) earned more than the rule."
    ),
    "Highway-v1": (
        "It begins in the traffic: from a stop on a free lane, a driver that ignores others (`careless`) met "
        "none. A failure costs 10 and all later rewards of the episode, which are most of them."
    ),
    "Merge-v0": (
        "A failure costs 10 and all later rewards of the episode. The entry lane ends, so neither standing "
        "nor ignoring other vehicles pays."
    ),
    "Roundabout-v1": (
        "Other drivers brake for one that never gives way (`careless`), so it gains 3 s of driving, and has "
        "few collisions. So `near_miss` is a cost in each step with a short time to collision, high enough that "
        "it does not pay with discounted rewards, either. 1.5 s is the bound for serious conflicts in "
        "studies of traffic."
    ),
    "Intersection-v1": (
        "Behind the light a driver can earn 40 for the way, and 10 for arriving. `red_light` costs as much, so "
        "passing it never pays, whatever the discount, though a red light lasts up to 20 s."
    ),
    "Parking-v1": (
        "Each step costs up to 0.02, so that a shorter way is better. A whole episode costs less than a "
        "failure, so that a crash never pays. `arrived` is needed because a stop beside the bay is nearly as "
        "near as a stop in it."
    ),
    "Drive-v0": "A failure costs 10 and all later rewards of the episode.",
}
"""Reasons for the rewards: drivers that earned more than the task before."""

HEAD: Final = """\
# Environments

Details beside the guide [Environments for Gymnasium](../guides/gymnasium.md): for each environment its options, its
observation by row, its reward and its end, and results of drivers. `RemoteDrive-v0` is `Drive-v0` in the world of a
server.

*Random* draws each action anew. *By rule* is the driver of `scripts/examples/drive_environments.py`: it steers to the
lane's line 10 m ahead, drives at the target speed, slows down for bends, keeps gaps, stops at red lights, gives way to
entities that will reach its way first, and in `Parking-v1` reverses in an arc. The others are in
`scripts/examples/exploit_environments.py`. They try to earn rewards without the task. A test checks that none of them
earns more than the rule:

| driver | what it does |
|---|---|
{exploits}

Figures are means over 16 episodes with the seeds 0 to 15: sum of rewards; the same with a discount of 0.99 a step;
time and distance until the end; shares of episodes that ended by arriving and by a failure. To measure anew:

    python scripts/examples/drive_environments.py --episodes 16 --json scripts/docs_pages/environment_figures.json
    python scripts/write_docs.py

A number behind a name changes when results change. `gymnasium.make` refuses an older one, and names the newer one.
"""


def write_environments() -> str:
    """Return the page."""
    register_all()
    figures = json.loads(FIGURES.read_text("utf-8"))
    lines = [HEAD.format(exploits="\n".join(_exploits()))]
    for name, task in TASKS.items():
        short = name.partition("/")[2]
        lines += [f"## {short}\n", f"{TITLES[short]}\n"]
        lines += [f"![{short} from above](../images/env_{short[:-3].lower()}.png)\n"]
        lines += ["| option | value |", "|---|---|", *_options(task), ""]
        lines += ["| term of the reward | weight | value |", "|---|---|---|", *_terms(task), ""]
        lines += [_end(task, gymnasium.spec(name).max_episode_steps) + "\n"]
        seen = f"`{task.observation}`, see [below](#observations)"
        lines += [f"Observation: {seen}{' with the light ahead' if task.lights else ''}. Action: `{task.action}`.\n"]
        lines += [REASONS[short] + "\n"]
        lines += [
            "| driver | reward | discounted | time | distance | arrived | failed |",
            "|---|---|---|---|---|---|---|",
        ]
        for driver, each in figures[name].items():
            cells = (driver, each["reward"], each["discounted"], f"{each['seconds']} s", f"{each['metres']} m")
            shares = (f"{each['arrived']:.0%}", f"{each['failed']:.0%}")
            lines.append(f"| {' | '.join(str(cell) for cell in (*cells, *shares))} |")
        lines.append("")
    lines += _observations()
    lines += _actions()
    return "\n".join(lines)


def _exploits() -> Iterator[str]:
    """Yield the rows of the list in the head of the example."""
    for line in (EXAMPLES / "exploit_environments.py").read_text("utf-8").splitlines():
        if line.startswith("`"):
            name, _, rest = line[1:].partition("`")
            yield f"| {name} | {rest.strip()} |"


def _options(task: DrivingTask) -> Iterator[str]:
    """Return the rows of the options that differ from the default."""
    plain = DrivingTask(task.scenario)
    for each in fields(DrivingTask):
        value = getattr(task, each.name)
        if each.name in {"weights", "reward"}:
            continue
        if each.name == "scenario" or value != getattr(plain, each.name):
            yield f"| `{each.name}` | {value!r} |"


def _terms(task: DrivingTask) -> Iterator[str]:
    for name, weight in task.all_weights.items():
        if weight:
            yield f"| `{name}` | {weight:g} | {TERMS[name].format(target_speed=task.target_speed)} |"


def _end(task: DrivingTask, steps: int | None) -> str:
    failures = "a collision, off the road" + ("" if task.goal == "bay" else ", the wrong way")
    goals = {
        "": "",
        "lane": f" It arrives {task.goal_s:g} m along the first lane that `goal_lane` names behind the junction.",
        "bay": " It arrives when it stands within 0.5 m and 0.2 rad of the pose in its bay.",
    }
    offset = "" if math.isinf(task.max_offset) else f", or {task.max_offset:g} m from the line of the lane"
    away = "" if math.isinf(task.max_distance) else f", {task.max_distance:g} m from the bay"
    rest = f"{goals[task.goal]} It is truncated after {steps} steps."
    return f"Failures that end an episode: {failures}{offset}{away}.{rest}"


def _observations() -> list[str]:
    lines = ["## Observations\n", "`float32`, cut at the bounds. Normalised figures are divided by them.\n"]
    begin = 0
    lines += ["| row of `Lane` | figure | bound | meaning |", "|---|---|---|---|"]
    for figure, bound in (*LANE_FIGURES.items(), *LIGHT_FIGURES.items()):
        lines.append(_row(str(begin), figure, bound))
        begin += 1
    lines += ["", f"Rows {begin - len(LIGHT_FIGURES)} and {begin - 1} are there with the option `lights`.\n"]
    lines += ["| column of `Others` | figure | bound | meaning |", "|---|---|---|---|"]
    lines += [_row(str(i), *each) for i, each in enumerate(zip(OTHER_FIGURES, OTHER_BOUNDS, strict=True))]
    lines += [
        "",
        "`Kinematics` has the rows of `Lane`, and behind them the rows of `Others`, one entity after another.\n",
    ]
    lines += ["| layer of `OccupancyGrid` | figure | bound | meaning |", "|---|---|---|---|"]
    lines += [_row(str(i), *each) for i, each in enumerate(zip(GRID_FIGURES, GRID_BOUNDS, strict=True))]
    lines += ["", "| column of `Lidar` | figure | bound | meaning |", "|---|---|---|---|"]
    lines += [_row("0", RAY_FIGURES[0], "`lidar_range`")]
    lines += [f"| 1 | `{RAY_FIGURES[1]}` | {RAY_SPEED:g} m/s | at which that moves away along the ray |", ""]
    lines += ["| figure of goals | divided by | meaning |", "|---|---|---|"]
    goal = (
        "east of the middle of the body",
        "north of it",
        "velocity to the east",
        "to the north",
        "of the heading",
        "",
    )
    for (figure, bound), meaning in zip(GOAL_FIGURES.items(), goal, strict=True):
        lines.append(
            f"| `{figure}` | {bound:g} {UNITS.get(figure, '')} | {meaning or 'of the heading'} |".replace("  ", " ")
        )
    return [*lines, ""]


def _row(place: str, figure: str, bound: float | str) -> str:
    amount = bound if isinstance(bound, str) else f"{bound:.4g} {UNITS.get(figure, '')}".rstrip()
    return f"| {place} | `{figure}` | {amount} | {MEANINGS[figure]} |"


def _actions() -> list[str]:
    names = ", ".join(f"{i} {name}" for i, name in enumerate(META_ACTIONS))
    return [
        "## Actions\n",
        f"`Continuous`: steering, times {MAX_STEER:g} rad, left positive; acceleration, times {MAX_ACCEL:g} m/s².",
        "`Pedals`: the same steering; throttle 0 to 1 or, negative, brake. Both are `Box(-1, 1, (2,))`.\n",
        f"`DiscreteMeta`: {names}.\n",
    ]
