"""The storyboard of a story as a machine: states of its elements, triggers, priorities, delays, edges, executions.

The machine knows neither the world nor actions: a host measures conditions, begins and ends actions, and says which are
done. A frame is one call of `advance`. What decides the next frames is in `BoardState`, which is plain data, so a
saved machine goes on to the bit. A condition sees each transition once: those since its last look, and at its first
look those of the frame.

The rules are those of ASAM OpenSCENARIO 1.3, section 8:

- An edge needs a value before: at the first look `rising` and `falling` are false.
- A condition with a delay is what it was so long ago.
- An event with `override` (`overwrite` up to 1.1) ends the running events of its maneuver. With `skip` it does not
  start, and counts as executed, while another one runs.
- An element whose execution ends goes back to standby until `maximumExecutionCount`, then it is complete.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from enum import IntEnum
from functools import cache
from typing import Final, Protocol

from rosbridge_sim.records import Record
from rosbridge_sim.scenarios.openscenario.story_records import StoryItem

KINDS: Final = ("Storyboard", "Story", "Act", "ManeuverGroup", "Maneuver", "Event", "Action")

MAX_CHANGES: Final = 1_000
"""Most changes of a condition with a delay that are kept."""


class State(IntEnum):
    """State of an element."""

    STANDBY = 0
    RUNNING = 1
    COMPLETE = 2


class Transition(IntEnum):
    """Transition of an element within a frame."""

    NONE = 0
    START = 1
    END = 2
    STOP = 3
    SKIP = 4


STATE_WORDS: Final = {f"{each.name.lower()}State": each for each in State}
CHANGE_WORDS: Final = {f"{each.name.lower()}Transition": each for each in Transition}


class BoardPart(Record, eq=False):
    """An element of a storyboard.

    Attributes:
        kind: one of `KINDS`.
        parent: its number; -1 for the storyboard.
        children: numbers of the elements within it.
        start, stop: groups of numbers of conditions; all of a group must hold. None without a trigger.
    """

    kind: str
    name: str
    item: StoryItem
    parent: int
    children: list[int]
    start: tuple[tuple[int, ...], ...] | None
    stop: tuple[tuple[int, ...], ...] | None


class Host(Protocol):
    """The part of a simulator that judges the conditions of a story and carries out its actions."""

    def measure(self, condition: StoryItem) -> tuple[bool, float]:
        """Return whether a `Condition` holds now, and the figure that it compares (NaN for none)."""

    def begin(self, number: int) -> None:
        """Begin the action of a part."""

    def is_done(self, number: int) -> bool:
        """Return whether an action has ended."""

    def end(self, number: int) -> None:
        """End an action before it is done."""


@dataclass(slots=True)
class BoardState:
    """All that changes, by numbers of parts and of conditions.

    Attributes:
        states, changes, counts: of each part: `State`, last `Transition`, and number of executions.
        marks: of each part, the number of its last transition among all.
        mark, frame_mark: number of transitions so far, and before the last frame.
        looks: of each condition, the number of transitions at its last look; -1 before the first one.
        before: of each condition, whether it held at the last look; -1 before the first one.
        history: of each condition with a delay, frames and values: from the frame on it was so.
        figures: of each condition, the figure that it compared last; 0 before the first look.
        is_over: the storyboard's stop trigger has fired.
        verdict_group: number of the evaluation's group that held first; -1 before.
        verdict_frame: frame of the verdict.
    """

    states: list[int]
    changes: list[int]
    counts: list[int]
    marks: list[int]
    looks: list[int]
    before: list[int]
    history: list[list[tuple[int, bool]]]
    figures: list[float]
    mark: int = 0
    frame_mark: int = 0
    is_over: bool = False
    verdict_group: int = -1
    verdict_frame: int = 0


class StoryVerdict(Record):
    """Result of MORAI's evaluation.

    Attributes:
        result: `success`, `failure` or `undecided`; empty without an evaluation.
        group: the group that decided: its kind, and its number among those of its kind, from 1.
        time: since the story began; -1 while undecided [s].
        reason: file and line of the group, its conditions and the figures that they compared.
    """

    result: str = ""
    group: str = ""
    time: float = -1.0
    reason: str = ""


class Storyboard:
    """The machine of one story.

    Attributes:
        parts: all elements, each before those within it; number 0 is the storyboard.
        conditions: all `Condition` items of triggers.
        state: what changes.
    """

    def __init__(self, board: StoryItem, frame_time: float, evaluation: StoryItem | None = None) -> None:
        """Begin with all elements in standby.

        Args:
            frame_time: length of a frame [s].
            evaluation: MORAI's groups of conditions for a verdict; None for none.
        """
        self.parts: list[BoardPart] = []
        self.conditions: list[StoryItem] = []
        self._add(board, -1)
        self._groups = [(group, self._numbers(group)) for group in (() if evaluation is None else evaluation.parts)]
        self._frame_time = frame_time
        self._delay = [round(each.get("delay", 0.0) / frame_time) for each in self.conditions]
        self.find = cache(self._find)
        self._frame = self._since = 0
        self.state = self.fresh()

    def _add(self, item: StoryItem, parent: int) -> int:
        """Add an element and those within it; return its number."""
        number = len(self.parts)
        start, stop = (
            None if trigger is None else tuple([self._numbers(group) for group in trigger.parts])
            for trigger in map(item.find, ("StartTrigger", "StopTrigger"))
        )
        part = BoardPart(item.kind, item.get("name", ""), item, parent, [], start, stop)
        self.parts.append(part)
        part.children.extend(self._add(each, number) for each in item.parts if each.kind in KINDS)
        return number

    def _numbers(self, group: StoryItem) -> tuple[int, ...]:
        """Add the conditions of a group; return their numbers."""
        first = len(self.conditions)
        self.conditions.extend(group.parts)
        return tuple(range(first, len(self.conditions)))

    def fresh(self) -> BoardState:
        """Return the state at the start."""
        num, most = len(self.parts), len(self.conditions)
        nothing: list[list[tuple[int, bool]]] = [[] for _ in range(most)]
        return BoardState([0] * num, [0] * num, [0] * num, [0] * num, [-1] * most, [-1] * most, nothing, [0.0] * most)

    def fits(self, state: BoardState) -> bool:
        """Return whether a state from outside can be one of this machine."""
        parts = (state.states, state.changes, state.counts, state.marks)
        conditions = (state.looks, state.before, state.history, state.figures)
        return (
            all(len(each) == len(self.parts) for each in parts)
            and all(len(each) == len(self.conditions) for each in conditions)
            and set(state.states) <= set(State)
            and set(state.changes) <= set(Transition)
            and -1 <= state.verdict_group < len(self._groups)
            and state.verdict_frame >= 0
        )

    def advance(self, frame: int, host: Host) -> None:
        """Look at all triggers once, begin and end elements.

        Args:
            frame: number of the frame, from 1; it rises by one from call to call.
            host: judges conditions, and carries out actions.
        """
        state = self.state
        self._frame, state.frame_mark = frame, state.mark
        self._judge(host)
        if state.is_over:
            return
        board = self.parts[0]
        if self._fires(board.stop, host):
            self._stop(0, host)
            state.is_over = True
            return
        state.states[0] = State.RUNNING
        for story in board.children:
            self._step(story, host)

    def _judge(self, host: Host) -> None:
        """Give the verdict, once; in a frame with both it is `failure`."""
        if self.state.verdict_group >= 0:
            return
        looked_at = [[self._holds(number, host) for number in group] for _, group in self._groups]
        held = [number for number, each in enumerate(looked_at) if each and all(each)]
        if held:
            kinds = [group.kind for group, _ in self._groups]
            self.state.verdict_group = min(held, key=lambda number: (kinds[number] != "FailureConditionGroup", number))
            self.state.verdict_frame = self._frame

    def verdict(self) -> StoryVerdict:
        """Return the verdict. Conditions of the evaluation are not looked at behind it, so they tell its reason."""
        state = self.state
        if state.verdict_group < 0:
            return StoryVerdict("undecided" if self._groups else "")
        group, numbers = self._groups[state.verdict_group]
        place = [each for each, _ in self._groups if each.kind == group.kind].index(group) + 1
        conditions = [self.conditions[number] for number in numbers]
        shown = [
            f"{kind_of(each)} {each['name']!r} ({state.figures[number]:.6g})"
            for number, each in zip(numbers, conditions, strict=True)
        ]
        return StoryVerdict(
            "failure" if group.kind == "FailureConditionGroup" else "success",
            f"{group.kind} {place}",
            state.verdict_frame * self._frame_time,
            f"{group.where}: {' and '.join(shown)}",
        )

    def seen(self, kind: str, name: str, word: str) -> bool:
        """Return whether an element of this kind and name is in a state, or has made a transition since the last look.

        The look is that of the condition that is measured now.

        Args:
            kind: one of `KINDS`.
            name: with the names around it before `::`, or alone.
            word: of `STATE_WORDS` or `CHANGE_WORDS`.
        """
        state = self.state
        for number in self.find(kind, name):
            if word in STATE_WORDS:
                if state.states[number] == STATE_WORDS[word]:
                    return True
            elif state.changes[number] == CHANGE_WORDS[word] and state.marks[number] > self._since:
                return True
        return False

    def _find(self, kind: str, name: str) -> list[int]:
        """Return the numbers of the parts with a kind and name."""
        *around, own = name.split("::")
        return [
            number
            for number, part in enumerate(self.parts)
            if part.kind == kind and part.name == own and set(around) <= set(self._names_around(number))
        ]

    def _names_around(self, number: int) -> list[str]:
        names = []
        while number >= 0:
            names.append(self.parts[number].name)
            number = self.parts[number].parent
        return names

    def _step(self, number: int, host: Host) -> None:
        """Let a story, act, group, maneuver or event go on by a frame."""
        part, state = self.parts[number], self.state
        if state.states[number] == State.COMPLETE:
            return
        if part.kind == "Event":
            self._step_event(number, host)
            return
        if state.states[number] == State.STANDBY:
            if part.start and not self._fires(part.start, host):
                return
            self._enter(number)
        elif self._fires(part.stop, host):
            self._stop(number, host)
            return
        for child in part.children:
            self._step(child, host)
        if all(state.states[child] == State.COMPLETE for child in part.children):
            self._leave(number, Transition.END)
            if state.states[number] == State.STANDBY:  # a group that is executed again
                for inner in self._within(number):
                    state.states[inner], state.counts[inner] = State.STANDBY, 0

    def _step_event(self, number: int, host: Host) -> None:
        part, state = self.parts[number], self.state
        fires = not part.start or self._fires(part.start, host)
        if state.states[number] == State.RUNNING:
            if all(host.is_done(action) for action in part.children):
                for action in part.children:
                    self._leave(action, Transition.END)
                self._leave(number, Transition.END)
            return
        if not fires:
            return
        others = [each for each in self.parts[part.parent].children if state.states[each] == State.RUNNING]
        priority = part.item.get("priority", "parallel")
        if priority == "skip" and others:
            state.counts[number] += 1
            self._leave(number, Transition.SKIP)
            return
        if priority in {"override", "overwrite"}:
            for each in others:
                self._stop(each, host)
        self._enter(number)
        for action in part.children:
            self._enter(action)
            host.begin(action)

    def _enter(self, number: int) -> None:
        state = self.state
        state.states[number] = State.RUNNING
        self._mark(number, Transition.START)
        state.counts[number] += 1

    def _leave(self, number: int, change: Transition) -> None:
        """Leave an element: to standby if it may be executed again, else it is complete."""
        state, part = self.state, self.parts[number]
        most = part.item.get("maximumExecutionCount", 1) if part.kind in {"Event", "ManeuverGroup"} else 1
        state.states[number] = State.STANDBY if state.counts[number] < most else State.COMPLETE
        self._mark(number, change)

    def _mark(self, number: int, change: Transition) -> None:
        """Note a transition."""
        self.state.mark += 1
        self.state.changes[number], self.state.marks[number] = change, self.state.mark

    def _stop(self, number: int, host: Host) -> None:
        """End an element and all within it before they are done."""
        state = self.state
        for each in (*self._within(number), number):
            if self.parts[each].kind == "Action" and state.states[each] == State.RUNNING:
                host.end(each)
            was_running = state.states[each] == State.RUNNING
            if each == number and self.parts[each].kind == "Event":
                self._leave(each, Transition.STOP)
                continue
            state.states[each] = State.COMPLETE
            if was_running:
                self._mark(each, Transition.STOP)

    def _within(self, number: int) -> Iterator[int]:
        for child in self.parts[number].children:
            yield child
            yield from self._within(child)

    def _fires(self, groups: tuple[tuple[int, ...], ...] | None, host: Host) -> bool:
        """Return whether all conditions of one of the groups hold. Each is looked at, because edges need each frame."""
        held = [[self._holds(number, host) for number in group] for group in groups or ()]
        return any(all(each) for each in held)

    def _holds(self, number: int, host: Host) -> bool:
        state, condition = self.state, self.conditions[number]
        looked, state.looks[number] = state.looks[number], state.mark
        self._since = looked if looked >= 0 else state.frame_mark
        is_so, figure = host.measure(condition)
        before, state.before[number] = state.before[number], int(is_so)
        state.figures[number] = figure if math.isfinite(figure) else 0.0
        edge = condition.get("conditionEdge", "none")
        rises, falls = before == 0 and is_so, before == 1 and not is_so
        value = {"none": is_so, "rising": rises, "falling": falls, "risingOrFalling": rises or falls}[edge]
        delay = self._delay[number]
        if delay <= 0:
            return bool(value)
        history = state.history[number]
        if not history or history[-1][1] != value:
            history.append((self._frame, bool(value)))
        while len(history) > 1 and (history[1][0] <= self._frame - delay or len(history) > MAX_CHANGES):
            history.pop(0)
        since, was_so = history[0]
        return was_so and since <= self._frame - delay


def kind_of(condition: StoryItem) -> str:
    """Return the kind of a condition, such as SpeedCondition."""
    item = condition.part()
    return (item if item.kind == "ByValueCondition" else item.part("EntityCondition")).part().kind
