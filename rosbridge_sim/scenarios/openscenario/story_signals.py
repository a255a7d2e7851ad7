"""Controllers of traffic signals in a story -> controllers of the map's lights, in place of the map's own plan.

A `TrafficSignalController` names lights of the map by their ids, which are those of the OpenDRIVE file. A light that a
phase does not name keeps the state of the phase before. Lights that the story does not name keep the map's plan.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterable, Mapping
from itertools import accumulate
from typing import Final

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.maps.road_map import RoadMap
from rosbridge_sim.printable import printable
from rosbridge_sim.scenarios.openscenario.story_records import StoryItem
from rosbridge_sim.suggestions import hint
from rosbridge_sim.world.roads.signal_plan import GREENS, Controller, Lamp, Light, Phase, SignalPlan
from rosbridge_sim.world.state.world import DT

MAX_PHASES: Final = 1_000
"""Most phases of all controllers of a story: each has a colour for each of its lights."""

_LAMPS: Final = {2: (Lamp.RED, Lamp.GREEN), 3: (Lamp.RED, Lamp.YELLOW, Lamp.GREEN)}
_WITH_STATE: Final = frozenset({"TrafficSignalState", "TrafficSignalStateAction", "TrafficSignalCondition"})
_COLOURS: Final = {"red": Lamp.RED, "yellow": Lamp.YELLOW, "green": Lamp.GREEN, "off": 0}


def lamps_of(text: str, lamps: int = int(Lamp.GREEN)) -> int:
    """Return the lamps that the state of a light names: `red`, or `on;off;off` from red to green.

    Args:
        lamps: those that the light has: its green may be an arrow.

    Raises:
        DocumentError: it names none.
    """
    words = text.lower().split(";")
    order = _LAMPS.get(len(words))
    if text.lower() in _COLOURS:
        lit = int(_COLOURS[text.lower()])
    elif order is not None and set(words) <= {"on", "off"}:
        lit = sum(int(lamp) for lamp, word in zip(order, words, strict=True) if word == "on")
    else:
        raise DocumentError(f"expected a state such as red, green or on;off;off, got {printable(text, 60)!r}")
    return lit & ~Lamp.GREEN | (lamps & GREENS or Lamp.GREEN) if lit & Lamp.GREEN else lit


def check_controllers(controllers: Mapping[str, StoryItem], mistakes: list[str]) -> None:
    """Add the mistakes in controllers to a list: a line each, with file and line."""
    if sum(len(item.parts) for item in controllers.values()) > MAX_PHASES:
        mistakes.append(f"TrafficSignalController: expected at most {MAX_PHASES:,} phases in all")
    for name, item in controllers.items():
        reference = item.get("reference", name)
        if reference not in controllers:
            shown = f"there is no {printable(reference, 60)!r}{hint(reference, controllers)}"
            mistakes.append(f"{item.where}: TrafficSignalController.reference: {shown}")
        if not item.parts:
            mistakes.append(f"{item.where}: TrafficSignalController: expected a Phase in it, got none")
        for phase in item.parts:
            if not phase["duration"] >= DT:
                mistakes.append(f"{phase.where}: Phase.duration: expected {DT:g} s or more, got {phase['duration']:g}")
            check_states(phase.parts, mistakes)


def check_states(items: Iterable[StoryItem], mistakes: list[str]) -> None:
    """Add those of the items that name no state of a light to a list: a line each, with file and line."""
    for item in items:
        try:
            if item.kind in _WITH_STATE:
                lamps_of(item["state"])
        except DocumentError as error:
            mistakes.append(f"{item.where}: {item.kind}.state: {error}")


def make_signal_plan(controllers: Mapping[str, StoryItem], road_map: RoadMap) -> SignalPlan:
    """Return the plan of a map with the controllers of a story.

    Raises:
        DocumentError: the map has no such light. The text has file and line.
    """
    plan = road_map.plan
    if not controllers:
        return plan
    rows = {light.name: row for row, light in enumerate(plan.lights)}
    first = 1 + max((each.number for each in plan.controllers), default=-1)
    own = [_controller(item, first + i, rows, plan.lights) for i, item in enumerate(controllers.values())]
    return plan.with_controllers(road_map.roads, [*own, *plan.controllers])


def _controller(item: StoryItem, number: int, rows: Mapping[str, int], lights: tuple[Light, ...]) -> Controller:
    states = [(phase, state) for phase in item.parts for state in phase.parts]
    for _, state in states:
        name = state["trafficSignalId"]
        if name not in rows:
            raise DocumentError(f"{state.where}: the map has no light {printable(name, 60)!r}{hint(name, rows)}")
    own = list(dict.fromkeys(state["trafficSignalId"] for _, state in states))
    # The last state of each light is that before the first phase; a light that has one in no phase is dark.
    now = {state["trafficSignalId"]: state["state"] for _, state in states}
    phases = []
    for phase in item.parts:
        now |= {state["trafficSignalId"]: state["state"] for state in phase.parts}
        phases.append(Phase(_frames(phase), tuple([lamps_of(now[name], lights[rows[name]].lamps) for name in own])))
    groups = tuple([(rows[name],) for name in own])
    return Controller(item["name"], number, groups, tuple(phases), (0,) * len(own))


def start_phase(name: str, controllers: Mapping[str, StoryItem]) -> tuple[int, int]:
    """Return the phase in which a controller is when the story begins, and for how long already [frames].

    It begins its first phase `delay` after the controller that it refers to, and that one after its own.
    """
    frames = [_frames(phase) for phase in controllers[name].parts]
    delay, seen = 0.0, set[str]()
    while name not in seen and "reference" in controllers[name].values:
        seen.add(name)
        delay, name = delay + controllers[name].get("delay", 0.0), controllers[name]["reference"]
    into = -round(delay / DT) % sum(frames)
    begins = [0, *accumulate(frames)]
    phase = bisect_right(begins, into) - 1
    return phase, into - begins[phase]


def _frames(phase: StoryItem) -> int:
    duration: float = phase["duration"]
    return max(1, round(duration / DT))
