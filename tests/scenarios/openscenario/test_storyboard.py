"""The machine of a storyboard: states, priorities, edges, delays, executions."""

from __future__ import annotations

import math

import pytest

from rosbridge_sim.scenarios.openscenario.story import ELEMENT_TYPES, read_story
from rosbridge_sim.scenarios.openscenario.story_records import StoryItem, StoryText
from rosbridge_sim.scenarios.openscenario.storyboard import State, Storyboard, StoryVerdict, Transition
from rosbridge_sim.simulator.plain.typed_plain import as_plain, read_as
from tests.simulator.story.story_texts import by_value, event, group, speed, state_of, story, trigger

A_FRAME = 0.02


def probe(name: str, *, delay: float = 0.0, edge: str = "none") -> str:
    condition = f'<VariableCondition variableRef="{name}" value="1" rule="equalTo"/>'
    return by_value(condition, delay=delay, edge=edge)


class Stage:
    """A host whose conditions are switches, and whose actions go on until they are let go."""

    def __init__(self, *groups: str, stop: str = "", acts: str = "", end: str = "") -> None:
        names = "abcd"
        more = "".join(f'<VariableDeclaration name="{name}" variableType="double" value="0"/>' for name in names)
        more = f"<VariableDeclarations>{more}</VariableDeclarations>"
        text = story({"Ego": ""}, *groups, stop=stop, more=more, end=end).replace("</Story>", f"{acts}</Story>")
        told = read_story(StoryText("s.xosc", text.encode()))
        self.board = Storyboard(told.storyboard, A_FRAME, told.evaluation)
        self.figure = math.nan
        self.on: set[str] = set()
        self.going: set[int] = set()
        self.frame = 0

    def measure(self, condition: StoryItem) -> tuple[bool, float]:
        item = condition.part().part()
        if item.kind == "StoryboardElementStateCondition":
            kind = ELEMENT_TYPES[item["storyboardElementType"]]
            return self.board.seen(kind, item["storyboardElementRef"], item["state"]), math.nan
        return item["variableRef"] in self.on, self.figure

    def begin(self, number: int) -> None:
        self.going.add(number)

    def is_done(self, number: int) -> bool:
        return number not in self.going

    def end(self, number: int) -> None:
        self.going.discard(number)

    def step(self, *on: str, num: int = 1) -> None:
        self.on = set(on)
        for _ in range(num):
            self.board.advance(self.frame, self)
            self.frame += 1

    def state(self, name: str, kind: str = "Event") -> State:
        return State(self.board.state.states[self.board.find(kind, name)[0]])

    def count(self, name: str) -> int:
        return self.board.state.counts[self.board.find("Event", name)[0]]


def test_an_event_starts_by_its_trigger_runs_and_completes_with_all_around_it() -> None:
    stage = Stage(group("Ego", event("e", speed(1), probe("a"))))
    stage.step()
    assert (stage.state("e"), stage.state("act", "Act")) == (State.STANDBY, State.RUNNING)
    stage.step("a")
    assert (stage.state("e"), len(stage.going)) == (State.RUNNING, 1)
    stage.going.clear()
    stage.step()
    kinds = {"e": "Event", "maneuver": "Maneuver", "group": "ManeuverGroup", "act": "Act", "story": "Story"}
    assert all(stage.state(name, kind) is State.COMPLETE for name, kind in kinds.items())


@pytest.mark.parametrize(
    ("edge", "frames", "starts"),
    [
        ("none", ["a"], 0),
        ("rising", ["a", "a", "", "a"], 3),  # what holds at the first look has not risen
        ("falling", ["", "a", "a", ""], 3),
        ("risingOrFalling", ["", "", "a"], 2),
    ],
)
def test_an_edge_needs_a_value_before(edge: str, frames: list[str], starts: int) -> None:
    stage = Stage(group("Ego", event("e", speed(1), probe("a", edge=edge))))
    for i, on in enumerate(frames):
        assert stage.count("e") == 0, i
        stage.step(*on)
    assert stage.count("e") == 1
    assert len(frames) - 1 == starts


def test_a_delay_looks_at_what_was_so_long_ago() -> None:
    stage = Stage(group("Ego", event("e", speed(1), probe("a", delay=0.1, edge="rising"))))
    stage.step()
    stage.step("a")
    stage.step(num=4)
    assert stage.count("e") == 0
    stage.step()
    assert stage.count("e") == 1


def test_a_condition_that_flickers_keeps_a_bounded_past() -> None:
    stage = Stage(group("Ego", event("e", speed(1), probe("a", delay=1000.0))))
    for i in range(1_200):
        stage.step(*("a" if i % 2 else ""))
    assert len(stage.board.state.history[0]) <= 1_000


@pytest.mark.parametrize(
    ("priority", "states", "counts"),
    [
        ("override", (State.COMPLETE, State.RUNNING), (1, 1)),
        ("overwrite", (State.COMPLETE, State.RUNNING), (1, 1)),
        ("parallel", (State.RUNNING, State.RUNNING), (1, 1)),
        ("skip", (State.RUNNING, State.COMPLETE), (1, 1)),
    ],
)
def test_priorities(priority: str, states: tuple[State, State], counts: tuple[int, int]) -> None:
    first, second = event("one", speed(1), probe("a")), event("two", speed(2), probe("b"), priority=priority)
    stage = Stage(group("Ego", first, second))
    stage.step("a")
    stage.step("b")
    assert (stage.state("one"), stage.state("two")) == states
    assert (stage.count("one"), stage.count("two")) == counts
    assert len(stage.going) == sum(state is State.RUNNING for state in states)


def test_an_event_is_executed_as_often_as_it_says() -> None:
    stage = Stage(group("Ego", event("e", speed(1), probe("a", edge="rising"), count=2)))
    for _ in range(3):
        stage.step()
        stage.step("a")
        stage.going.clear()
        stage.step()
    assert stage.count("e") == 2
    assert stage.state("e") is State.COMPLETE


def test_a_group_begins_again_with_all_its_events() -> None:
    stage = Stage(group("Ego", event("e", speed(1), probe("a")), count=3))
    starts = 0
    for _ in range(20):
        stage.step("a")
        starts += len(stage.going)
        stage.going.clear()
    assert starts == 3
    assert stage.state("group", "ManeuverGroup") is State.COMPLETE


def test_the_stop_trigger_ends_running_actions_and_nothing_starts_again() -> None:
    stop = trigger(probe("b"), tag="x")[3:-4]
    stage = Stage(group("Ego", event("e", speed(1), probe("a"), count=5)), stop=stop)
    stage.step("a")
    stage.step("b")
    assert stage.board.state.is_over
    assert not stage.going
    stage.step("a", num=3)
    assert not stage.going


def waits(state: str, of: str = "e", kind: str = "event") -> str:
    return state_of(kind, of, state)


@pytest.mark.parametrize("is_first", [True, False])
def test_a_condition_sees_a_transition_once_whether_it_is_looked_at_before_or_behind(*, is_first: bool) -> None:
    own, other = event("e", speed(1), probe("a")), event("other", speed(1), waits("startTransition"), count=3)
    stage = Stage(group("Ego", *((other, own) if is_first else (own, other))))
    stage.step()
    stage.step("a")
    assert stage.count("other") == (0 if is_first else 1)
    for _ in range(5):
        stage.step()
        stage.going = {number for number in stage.going if stage.board.parts[number].name != "other action"}
    assert stage.count("other") == 1


def test_transition_that_was_the_last_one_before_a_look_is_seen_once() -> None:
    """The start of an action is the last transition of its frame, so that it has the number of the look behind it."""
    other = event("other", speed(1), waits("startTransition", "e action", "action") + probe("b"))
    for frames, count in (((("a", "b"),), 1), (("a", "ab"), 0)):
        stage = Stage(group("Ego", event("e", speed(1), probe("a")), other))
        for on in frames:
            stage.step(*on)
        assert stage.count("other") == count


def test_delay_counts_from_the_first_look_too() -> None:
    stage = Stage(group("Ego", event("e", speed(1), probe("a", delay=0.1))))
    stage.step("a", num=5)
    assert stage.count("e") == 0
    stage.step("a")
    assert stage.count("e") == 1


def test_all_conditions_of_one_group_start_an_event_and_it_is_executed_once_unless_it_says_more() -> None:
    both = f"<ConditionGroup>{probe('a')}{probe('b')}</ConditionGroup><ConditionGroup>{probe('c')}</ConditionGroup>"
    text = event("e", speed(1), probe("d")).replace(' maximumExecutionCount="1"', "")
    begin, end = text.index("<ConditionGroup>"), text.index("</StartTrigger>")
    stage = Stage(group("Ego", text[:begin] + both + text[end:]))
    stage.step("a")
    stage.step("b", "d")
    assert stage.count("e") == 0
    stage.step("a", "b")
    assert stage.count("e") == 1
    stage.going.clear()
    stage.step("c", num=3)
    assert (stage.count("e"), stage.state("e")) == (1, State.COMPLETE)


def test_names_around_an_element_tell_which_one_is_meant() -> None:
    stage = Stage(group("Ego", event("e", speed(1), probe("a"))))
    stage.step("a")
    assert stage.board.seen("Event", "act::e", "runningState")
    assert not stage.board.seen("Event", "other::e", "runningState")


def test_a_saved_machine_goes_on_as_the_first_one() -> None:
    groups = group("Ego", event("e", speed(1), probe("a", delay=0.06, edge="rising"), count=2))
    one, other = Stage(groups), Stage(groups)
    one.step()
    one.step("a", num=2)
    saved = read_as(type(one.board.state), as_plain(one.board.state), "state")
    assert other.board.fits(saved)
    other.board.state, other.frame = saved, one.frame
    for on in ("", "", "a", "", "", "", "", "a"):
        for stage in (one, other):
            stage.step(*on)
        assert as_plain(one.board.state) == as_plain(other.board.state)
    assert one.count("e") == 1


def test_a_state_of_another_story_does_not_fit() -> None:
    one, other = Stage(group("Ego")), Stage(group("Ego", event("e", speed(1), probe("a"))))
    assert not one.board.fits(other.board.fresh())
    wrong = one.board.fresh()
    wrong.states[0] = 7
    assert not one.board.fits(wrong)


def second_act(*groups: str, start: str = "", stop: str = "") -> str:
    triggers = (trigger(start) if start else "") + (trigger(stop, tag="StopTrigger") if stop else "")
    return f'<Act name="second">{"".join(groups)}{triggers}</Act>'


def test_act_waits_for_its_trigger_and_its_conditions_see_the_transitions_of_their_first_frame_alone() -> None:
    late = group("Ego", event("late", speed(1), waits("startTransition")), name="other")
    stage = Stage(group("Ego", event("e", speed(1), probe("a"))), acts=second_act(late, start=probe("b")))
    stage.step()
    assert stage.state("second", "Act") is State.STANDBY
    stage.step("a")
    assert stage.state("second", "Act") is State.STANDBY
    stage.step("b", num=3)
    assert (stage.state("e"), stage.state("second", "Act"), stage.count("late")) == (State.RUNNING, State.RUNNING, 0)
    both = Stage(group("Ego", event("e", speed(1), probe("a"))), acts=second_act(late, start=probe("b")))
    both.step()
    both.step("a", "b")
    assert (both.count("e"), both.count("late")) == (1, 1)


def test_stop_trigger_of_an_act_stops_what_runs_in_it_and_that_alone() -> None:
    events = (event("runs", speed(1), probe("a"), count=3), event("waits", speed(1), probe("b")))
    stage = Stage(group("Ego"), acts=second_act(group("Ego", *events, name="own"), start=probe("a"), stop=probe("c")))
    stage.step("a", num=2)
    assert (stage.state("runs"), len(stage.going)) == (State.RUNNING, 1)
    stage.step("c")
    assert [stage.state(name) for name in ("runs", "waits")] == [State.COMPLETE] * 2
    assert [stage.state("second", "Act"), stage.state("own", "ManeuverGroup")] == [State.COMPLETE] * 2
    assert not stage.going
    changes = {name: stage.board.state.changes[stage.board.find("Event", name)[0]] for name in ("runs", "waits")}
    assert changes == {"runs": Transition.STOP, "waits": Transition.NONE}
    stage.step("a", "b", num=3)
    assert not stage.going


def test_event_that_another_one_overrides_may_start_again() -> None:
    first = event("one", speed(1), probe("a"), count=2)
    second = event("two", speed(2), probe("b"), priority="override")
    stage = Stage(group("Ego", first, second, event("seen", speed(3), waits("stopTransition", "one"))))
    stage.step("a")
    stage.step("b")
    assert (stage.state("one"), stage.state("two"), stage.count("seen")) == (State.STANDBY, State.RUNNING, 1)
    (number,) = stage.board.find("Action", "one action")
    assert stage.board.state.changes[number] == Transition.STOP
    stage.step("a")
    assert (stage.state("one"), stage.count("one")) == (State.RUNNING, 2)
    assert (stage.board.state.states[number], stage.board.state.changes[number]) == (State.RUNNING, Transition.START)


def test_group_that_begins_again_counts_the_executions_of_its_events_anew() -> None:
    stage, starts = Stage(group("Ego", event("e", speed(1), probe("a"), count=2), count=2)), 0
    for _ in range(20):
        stage.step("a")
        starts += len(stage.going)
        stage.going.clear()
    assert starts == 4


def groups(*conditions: str, kind: str = "Success") -> str:
    return f"<{kind}ConditionGroup>{''.join(conditions)}</{kind}ConditionGroup>"


def test_verdict_is_that_of_the_first_group_whose_conditions_all_hold() -> None:
    end = groups() + groups(probe("a"), probe("b")) + groups(probe("c"), kind="Failure") + groups(probe("d"))
    stage = Stage(end=f"<Evaluation>{end}</Evaluation>")
    stage.step(num=2)
    stage.step("a")
    assert stage.board.verdict() == StoryVerdict("undecided")
    stage.figure = 1.25
    stage.step("a", "b")
    found = stage.board.verdict()
    assert (found.result, found.group, found.time) == ("success", "SuccessConditionGroup 2", 3 * A_FRAME)
    assert found.reason.endswith(": VariableCondition 'c' (1.25) and VariableCondition 'c' (1.25)")
    stage.step("c")
    assert stage.board.verdict() == found
    assert Stage().board.verdict() == StoryVerdict("")


def test_failure_comes_before_success_in_a_frame_with_both() -> None:
    end = groups(probe("a")) + groups(probe("b"), kind="Failure") + groups(probe("a"), kind="Failure")
    stage = Stage(end=f"<Evaluation>{end}</Evaluation>")
    stage.step("a")
    found = stage.board.verdict()
    assert (found.result, found.group, found.reason[-25:]) == (
        "failure",
        "FailureConditionGroup 2",
        "VariableCondition 'c' (0)",
    )


def test_figures_of_conditions_are_0_before_the_first_look_and_where_there_is_none() -> None:
    stage = Stage(group("Ego", event("e", speed(1), probe("a"))))
    assert stage.board.fresh().figures == [0.0]
    stage.step()
    assert stage.board.state.figures == [0.0]
    stage.figure = -2.5
    stage.step()
    assert stage.board.state.figures == [-2.5]


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("verdict_group", 1),
        ("verdict_group", -2),
        ("verdict_frame", -1),
        ("looks", []),
        ("marks", []),
        ("changes", [9] * 9),
    ],
)
def test_state_that_no_machine_has_does_not_fit(key: str, value: object) -> None:
    stage = Stage(group("Ego", event("e", speed(1), probe("a"))), end=f"<Evaluation>{groups(probe('b'))}</Evaluation>")
    state = stage.board.fresh()
    assert stage.board.fits(state)
    state.verdict_group, state.verdict_frame = 0, 7
    assert stage.board.fits(state)
    setattr(state, key, value)
    assert not stage.board.fits(state)
