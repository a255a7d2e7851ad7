"""Controllers of traffic signals in stories: phases, actions, conditions, and the lights of the next scenario."""

from __future__ import annotations

import pytest

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.records import replace
from rosbridge_sim.scenarios.openscenario.story_signals import lamps_of, make_signal_plan, start_phase
from rosbridge_sim.simulator.scene.load import WHOLE
from rosbridge_sim.simulator.sim_services.road_services import RoadServices
from rosbridge_sim.simulator.snapshots.node_state import NodeState
from rosbridge_sim.world.roads.signal_plan import Controller, Lamp, Phase
from tests.simulator.story.story_texts import (
    Telling,
    after,
    by_value,
    event,
    group,
    lanes,
    link,
    scenario_of,
    speed,
    story,
    teleport,
)

EGO = {"Ego": teleport(link("middle", 20)) + speed(10)}


def phase(name: str, seconds: float, **states: str) -> str:
    of = "".join(f'<TrafficSignalState trafficSignalId="{key}" state="{value}"/>' for key, value in states.items())
    return f'<Phase name="{name}" duration="{seconds}">{of}</Phase>'


def controller(name: str, *phases: str, more: str = "") -> str:
    return f'<TrafficSignalController name="{name}" {more}>{"".join(phases)}</TrafficSignalController>'


CYCLE = controller(
    "crossing",
    phase("go", 2, light="off;off;on", arrow="red"),
    phase("slow", 1, light="yellow"),
    phase("stop", 3, light="red", arrow="green"),
)


def with_signals(text: str, *controllers: str) -> str:
    signals = f"<RoadNetwork><TrafficSignals>{''.join(controllers)}</TrafficSignals></RoadNetwork>"
    return text.replace("<RoadNetwork/>", signals)


def infrastructure(action: str) -> str:
    inner = f"<TrafficSignalAction>{action}</TrafficSignalAction>"
    return f"<GlobalAction><InfrastructureAction>{inner}</InfrastructureAction></GlobalAction>"


def shown(telling: Telling) -> tuple[int, int]:
    light, arrow = telling.world.signals.shown.tolist()
    return light, arrow


GO, SLOW, STOP = (Lamp.GREEN, Lamp.RED), (Lamp.YELLOW, Lamp.RED), (Lamp.RED, Lamp.LEFT)


def test_a_controller_goes_through_its_phases_and_begins_again() -> None:
    telling = Telling(with_signals(story(EGO), CYCLE))
    seen = [shown(telling)]
    for _ in range(7):
        telling.run(1.0)
        seen.append(shown(telling))
    assert seen == [GO, GO, SLOW, STOP, STOP, STOP, GO, GO]


def test_an_action_sets_the_phase_and_conditions_see_it() -> None:
    jump = '<TrafficSignalControllerAction trafficSignalControllerRef="crossing" phase="stop"/>'
    is_stop = by_value('<TrafficSignalControllerCondition trafficSignalControllerRef="crossing" phase="stop"/>')
    is_red = by_value('<TrafficSignalCondition name="light" state="red"/>')
    events = (
        event("jump", infrastructure(jump), after(0.5)),
        event("seen", speed(5), is_stop),
        event("red", speed(7), is_red),
    )
    telling = Telling(with_signals(story(EGO, group("Ego", *events)), CYCLE))
    telling.run(0.4)
    assert not telling.began("Event", "seen")
    assert not telling.began("Event", "red")
    telling.run(0.2)
    assert shown(telling) == STOP
    assert telling.began("Event", "seen")
    assert telling.began("Event", "red")
    telling.run(3.0)
    assert shown(telling) == GO


def test_a_state_lasts_until_the_next_phase_of_the_controller_of_the_light() -> None:
    text = story(
        EGO,
        group("Ego", event("dark", infrastructure('<TrafficSignalStateAction name="light" state="off"/>'), after(0.5))),
    )
    telling = Telling(with_signals(text, CYCLE))
    telling.run(1.0)
    assert shown(telling) == (0, Lamp.RED)
    telling.run(1.5)
    assert shown(telling) == SLOW


def test_a_delay_shifts_a_controller_behind_the_one_it_refers_to() -> None:
    other = controller("other", phase("a", 2), phase("b", 4), more='reference="crossing" delay="3"')
    third = controller("third", phase("a", 2), phase("b", 4), more='reference="other" delay="2.5"')
    story_ = scenario_of(with_signals(story(EGO), CYCLE, other, third)).story
    assert story_ is not None
    starts = [start_phase(name, story_.controllers) for name in ("crossing", "other", "third")]
    assert starts == [
        (0, 0),
        (1, 50),
        (0, 25),
    ]  # 3 s before its start it is 1 s in `b`, 5.5 s before 0.5 s in `a`


def test_lights_that_the_story_does_not_name_keep_their_plan() -> None:
    road_map = lanes()
    own = Controller("own", 4, ((0,), (1,)), (Phase(50, (Lamp.RED, Lamp.LEFT)),), (0, 0))
    road_map = replace(road_map, plan=road_map.plan.with_controllers(road_map.roads, [own]))
    story_ = scenario_of(with_signals(story(EGO), controller("c", phase("p", 1, light="green")))).story
    assert story_ is not None
    plan = make_signal_plan(story_.controllers, road_map)
    assert [(each.name, each.number) for each in plan.controllers] == [("c", 5), ("own", 4)]
    assert plan.controller[plan.group].tolist() == [0, 1]


def test_a_restored_story_goes_on_with_its_lights() -> None:
    one, other = Telling(with_signals(story(EGO), CYCLE)), Telling(story(EGO))
    one.run(2.4)
    state = NodeState(one.node.context, one.node.components)
    there = NodeState(other.node.context, other.node.components)
    parsed = there.parse(state.save().to_plain(), lambda _: other.node.context.scene.road_map)
    there.restore(parsed, 0.0, expected_hash=state.hash(), before_undo=lambda: None)
    one.run(1.0)
    other.run(1.0)
    assert there.hash() == state.hash()
    assert shown(other) == STOP


def test_the_next_scenario_has_the_lights_of_the_map_and_a_part_of_one_keeps_those_of_the_story() -> None:
    telling = Telling(with_signals(story(EGO), CYCLE))
    context = telling.node.context
    drawing = telling.node.component(RoadServices)
    assert [each.name for each in context.world.signals.plan.controllers] == ["crossing"]
    before = drawing.drawing.digest
    plain = replace(scenario_of(story(EGO)), story=None)
    part = context.scene.prepare(replace(plain, egos=()), replace(WHOLE, delete_all=False))
    context.scene_changes.carry_out(part, is_pausing=False, now=0.0)
    telling.run(2.4)
    assert shown(telling) == SLOW
    context.scene_changes.carry_out(context.scene.prepare(plain, WHOLE), is_pausing=False, now=0.0)
    assert not context.world.signals.plan.controllers
    assert drawing.drawing.digest != before
    telling.node.context.scene_changes.reset(None, 0.0)
    assert [each.name for each in context.world.signals.plan.controllers] == ["crossing"]


@pytest.mark.parametrize(("shown", "asked"), [("red", "on;off;off"), ("on;off;off", "red"), ("off;off;on", "green")])
@pytest.mark.parametrize("light", ["light", "arrow", "elsewhere"])
def test_a_state_of_a_light_is_the_same_in_either_spelling(light: str, shown: str, asked: str) -> None:
    state, condition = (each.replace('"light"', f'"{light}"') for each in (STATE, IS_STATE))
    events = (
        event("show", infrastructure(state.format(shown)), after(0.1)),
        event("seen", speed(5), by_value(condition.format(asked))),
        event("other", speed(7), by_value(condition.format("yellow"))),
    )
    telling = Telling(story(EGO, group("Ego", *events)))
    telling.run(0.4)
    assert telling.began("Event", "seen")
    assert not telling.began("Event", "other")


STATE = '<TrafficSignalStateAction name="light" state="{}"/>'
IS_STATE = '<TrafficSignalCondition name="light" state="{}"/>'


@pytest.mark.parametrize(
    ("text", "told"),
    [
        (event("e", infrastructure(STATE.format("pink")), after(0.1)), "TrafficSignalStateAction"),
        (event("e", speed(3), by_value(IS_STATE.format("on;;on"))), "TrafficSignalCondition"),
    ],
)
def test_a_state_that_is_none_is_told_with_its_line_and_left_out_if_lenient(text: str, told: str) -> None:
    text = story(EGO, group("Ego", text))
    with pytest.raises(DocumentError, match=rf"story.xosc: line \d+: {told}.state: expected a state"):
        scenario_of(text)
    telling = Telling(text, is_lenient=True)
    telling.run(0.5)
    assert not telling.running.state.lights
    assert telling.speed("Ego") == pytest.approx(10.0)


@pytest.mark.parametrize(
    ("controllers", "told"),
    [
        (controller("c", phase("p", 0)), r"Phase.duration: expected 0.02 s or more, got 0"),
        (controller("c"), "expected a Phase in it, got none"),
        (controller("c", phase("p", 1)) * 2, "TrafficSignals: two controllers have the same name"),
        (controller("c", phase("p", 1, light="pink")), "TrafficSignalState.state: expected a state such as red"),
        (controller("c", phase("p", 1), more='reference="d" delay="1"'), "reference: there is no 'd'"),
        (controller("c", *[phase("p", 1)] * 1001), "expected at most 1,000 phases in all"),
        (
            controller("c", '<Phase name="p" duration="1"><TrafficSignalGroupState state="x"/></Phase>'),
            "TrafficSignalGroupState is not supported",
        ),
    ],
)
def test_mistakes_in_a_controller_are_told(controllers: str, told: str) -> None:
    with pytest.raises(DocumentError, match=told):
        scenario_of(with_signals(story(EGO), controllers))


@pytest.mark.parametrize(
    ("name", "at", "told"),
    [
        ("crossing", "halt", "phase: there is no 'halt'"),
        ("crosing", "stop", "there is no 'crosing' .did you mean crossing"),
    ],
)
def test_an_action_on_a_phase_that_is_not_there_is_a_mistake(name: str, at: str, told: str) -> None:
    jump = f'<TrafficSignalControllerAction trafficSignalControllerRef="{name}" phase="{at}"/>'
    with pytest.raises(DocumentError, match=told):
        scenario_of(with_signals(story(EGO, group("Ego", event("jump", infrastructure(jump), after(1)))), CYCLE))


def test_a_light_that_the_map_lacks_is_refused_before_anything_moves() -> None:
    telling = Telling(story(EGO))
    scenario = scenario_of(with_signals(story(EGO), controller("c", phase("p", 1, lihgt="red"))))
    with pytest.raises(DocumentError, match=r"story.xosc: line \d+: the map has no light 'lihgt' .did you mean light"):
        telling.node.context.scene.prepare(scenario, WHOLE)


def test_green_of_a_light_with_an_arrow_is_its_arrow() -> None:
    assert lamps_of("green", Lamp.RED | Lamp.LEFT) == Lamp.LEFT
    assert lamps_of("on;off;on", Lamp.RED | Lamp.LEFT | Lamp.RIGHT) == Lamp.RED | Lamp.LEFT | Lamp.RIGHT
    assert (lamps_of("green"), lamps_of("off"), lamps_of("off;on")) == (Lamp.GREEN, 0, Lamp.GREEN)
