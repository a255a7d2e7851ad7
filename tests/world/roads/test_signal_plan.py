"""The tables of a signal plan, compared with a frame-by-frame reference."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rosbridge_sim.world.roads.roads import Roads
from rosbridge_sim.world.roads.signal_plan import FLASH, GREENS, UNSET, Controller, Lamp, Light, Phase, SignalPlan, Walk
from rosbridge_sim.world.roads.signals import Signals, light_ahead

R, Y, G, L = Lamp.RED, Lamp.YELLOW, Lamp.GREEN, Lamp.LEFT


def lane(*corners: tuple[float, float]) -> Any:  # noqa: ANN401 - an array
    return np.array([(x, y, 0.0) for x, y in corners])


def lights(num: int, **figures: Any) -> list[Light]:  # noqa: ANN401 - whatever a light has
    return [Light(f"T{i}", **figures) for i in range(num)]


def cycle(plan: SignalPlan, light: int, frames: int, start: int = 0) -> list[int]:
    """What a light shows, frame by frame."""
    signals = Signals(plan, start)
    shown = []
    for frame in range(start, start + frames):
        signals.advance(frame)
        shown.append(int(signals.shown[light]))
    return shown


def runs(values: list[int]) -> list[tuple[int, int]]:
    """(value, how often) of each run."""
    out: list[tuple[int, int]] = []
    for value in values:
        out[-1:] = [(value, out[-1][1] + 1)] if out and out[-1][0] == value else [*out[-1:], (value, 1)]
    return out


def simple(*phases: tuple[int, tuple[int, ...]], yellow: tuple[int, ...], walks: tuple[Walk, ...] = ()) -> Controller:
    num = len(yellow)
    groups = tuple((i,) for i in range(num))
    return Controller("IntTL0", 0, groups, tuple(Phase(d, c) for d, c in phases), yellow, walks)


def test_yellow_follows_the_phase_and_other_lights_keep_their_colour() -> None:
    plan = SignalPlan(Roads(), lights(2), [simple((100, (G, R)), (50, (R, G)), yellow=(15, 20))])
    assert plan.cycle.tolist() == [100 + 15 + 50 + 20]
    assert runs(cycle(plan, 0, 185)) == [(G, 100), (Y, 15), (R, 70)]
    assert runs(cycle(plan, 1, 185)) == [(R, 115), (G, 50), (Y, 20)]
    assert cycle(plan, 0, 185, start=185) == cycle(plan, 0, 185)


def test_continued_green_has_no_yellow() -> None:
    plan = SignalPlan(Roads(), lights(2), [simple((10, (G, R)), (10, (G | L, R)), (10, (R, G)), yellow=(3, 5))])
    assert runs(cycle(plan, 0, 38)) == [(G, 10), (G | L, 10), (Y, 3), (R, 15)]
    assert runs(cycle(plan, 1, 38)) == [(R, 23), (G, 10), (Y, 5)]


def test_ending_part_of_a_green_is_yellow_beside_the_continuing_part() -> None:
    plan = SignalPlan(Roads(), lights(1), [simple((10, (G | L,)), (10, (G,)), (5, (R,)), yellow=(3,))])
    assert runs(cycle(plan, 0, 31)) == [(G | L, 10), (Y | G, 3), (G, 10), (Y, 3), (R, 5)]


def test_short_yellow_is_red_until_a_longer_one_ends() -> None:
    plan = SignalPlan(Roads(), lights(3), [simple((10, (G, G, L | R)), (10, (R, L, R)), yellow=(2, 6, 0))])
    assert runs(cycle(plan, 0, 26)) == [(G, 10), (Y, 2), (R, 14)]
    assert runs(cycle(plan, 1, 32)) == [(G, 10), (Y, 6), (L, 10), (Y, 6)]
    assert runs(cycle(plan, 2, 26)) == [(L | R, 10), (R, 16)]


def test_single_phase_repeats() -> None:
    plan = SignalPlan(Roads(), lights(1), [simple((10, (G,)), yellow=(3,))])
    assert runs(cycle(plan, 0, 40)) == [(G, 40)]


def test_pedestrian_light_has_walk_flash_and_wait() -> None:
    people = [Light("car"), Light("man", is_pedestrian=True)]
    walks = (Walk(1, 0, 10, 100, 60),)
    controller = Controller("I1", 1, ((0, 1),), (Phase(50, (G,)), Phase(200, (R,))), (15,), walks)
    shown = cycle(SignalPlan(Roads(), people, [controller]), 1, 265)
    assert runs(shown) == [(R, 75), (G, 100), (0, FLASH), (G, FLASH), (0, 10), (R, 30)]
    assert runs(cycle(SignalPlan(Roads(), people, [controller]), 0, 265)) == [(G, 50), (Y, 15), (R, 200)]


def test_overlong_walk_ends_with_its_phase() -> None:
    people = [Light("man", is_pedestrian=True)]
    controller = Controller("I1", 1, ((0,),), (Phase(50, (R,)), Phase(50, (R,))), (15,), (Walk(0, 0, 20, 20, 500),))
    assert runs(cycle(SignalPlan(Roads(), people, [controller]), 0, 100)) == [(R, 20), (G, 20), (0, 10), (R, 50)]


def test_pedestrian_lights_without_a_walk_follow_their_group() -> None:
    both = [Light("car"), Light("man", is_pedestrian=True), Light("child", is_pedestrian=True)]
    controller = Controller("I1", 1, ((0, 1), (2,)), (Phase(50, (G, R)), Phase(50, (R, G))), (10, 10))
    plan = SignalPlan(Roads(), both, [controller])
    assert runs(cycle(plan, 1, 120)) == [(R, 120)]
    assert runs(cycle(plan, 2, 120)) == [(R, 60), (G, 50), (R, 10)]


def test_light_with_only_yellow_lamps_is_always_yellow() -> None:
    plan = SignalPlan(Roads(), [Light("a"), Light("b", lamps=Y)], [simple((10, (G,)), (10, (R,)), yellow=(3,))])
    assert runs(cycle(plan, 1, 23)) == [(Y, 23)]


def test_light_without_a_controller_is_unset() -> None:
    plan = SignalPlan(Roads(), lights(3), [Controller("I7", 7, ((0,),))], together=[(1, 2)])
    assert [cycle(plan, i, 3) for i in range(3)] == [[UNSET] * 3] * 3
    assert plan.group.tolist() == [0, 1, 1]
    assert SignalPlan(Roads()).num_groups == 0


def test_light_belongs_to_the_first_controller_that_names_it() -> None:
    first = simple((10, (G,)), yellow=(3,))
    second = Controller("I1", 1, ((0,), (1,)), (Phase(5, (R, R)),), (3, 3))
    plan = SignalPlan(Roads(), lights(2), [first, second])
    assert [int(plan.controller[plan.group[i]]) for i in range(2)] == [0, 1]
    assert runs(cycle(plan, 0, 20)) == [(G, 20)]


@pytest.mark.parametrize(
    ("controller", "message"),
    [
        (Controller("I", 0, ((0,),), (Phase(5, (R, G)),), (3,)), "a colour for each of 1 groups"),
        (Controller("I", 0, ((0,),), (Phase(0, (R,)),), (3,)), "a frame or more"),
        (Controller("I", 0, ((0,),), (Phase(5, (R,)),), ()), "a yellow for each of 1 groups"),
        (Controller("I", 0, ((0,),), (Phase(5, (R,)),), (3,), (Walk(1, 0, 0, 1, 1),)), "one of its phases"),
        (Controller("I", 0, ((0,),), (Phase(5, (R,)),), (3,), (Walk(0, 0, -1, 1, 1),)), "no negative times"),
    ],
)
def test_invalid_controllers_are_refused(controller: Controller, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        SignalPlan(Roads(), lights(1), [controller])


# Against a judge

COLOURS = st.sampled_from([0, R, Y, G, L, R | Y, G | L, R | L, G | Lamp.U_TURN])


@st.composite
def controllers(draw: st.DrawFn) -> Controller:
    num = draw(st.integers(1, 4))
    phase = st.builds(Phase, st.integers(1, 30), st.tuples(*[COLOURS.map(int)] * num))
    phases = draw(st.lists(phase, min_size=1, max_size=4))
    yellow = draw(st.tuples(*[st.integers(0, 9)] * num))
    return Controller("I", 0, tuple((i,) for i in range(num)), tuple(phases), yellow)


def judge(controller: Controller, group: int, frames: int) -> list[int]:
    """The rules by plain loops."""
    out: list[int] = []
    phases = controller.phases
    i = 0
    while len(out) < frames:
        phase, after = phases[i], phases[(i + 1) % len(phases)]
        is_ending = [bool(now & GREENS & ~then) for now, then in zip(phase.colours, after.colours, strict=True)]
        longest = max((y for y, ends in zip(controller.yellow, is_ending, strict=True) if ends), default=0)
        now, then = phase.colours[group], after.colours[group]
        out += [now] * phase.duration
        for k in range(longest):
            rest = now & then & GREENS
            if not is_ending[group]:
                out.append(now)
            elif k < controller.yellow[group]:
                out.append(rest | Y)
            else:
                out.append(rest or R)
        i = (i + 1) % len(phases)
    return out[:frames]


@given(st.lists(controllers(), min_size=1, max_size=3), st.integers(0, 10_000))
def test_tables_equal_a_frame_by_frame_reference(parts: list[Controller], start: int) -> None:
    all_lights: list[Light] = []
    laid = []
    for k, part in enumerate(parts):
        rows = range(len(all_lights), len(all_lights) + len(part.groups))
        all_lights += [Light(f"{k}.{row}") for row in rows]
        laid.append(Controller(f"I{k}", k, tuple((row,) for row in rows), part.phases, part.yellow))
    signals = Signals(SignalPlan(Roads(), all_lights, laid), start)
    expected = [judge(part, group, 130) for part in laid for group in range(len(part.groups))]
    for i in range(130):
        signals.advance(start + i)
        assert signals.shown.tolist() == [line[i] for line in expected]


# Lanes


def crossing() -> Roads:
    """in -> straight on, to the left, to the right; each goes on."""
    lines = [
        lane((0, 0), (50, 0)),
        lane((50, 0), (70, 0)),
        lane((50, 0), (60, 3), (60, 20)),
        lane((50, 0), (55, -3), (55, -20)),
        lane((70, 0), (300, 0)),
    ]
    return Roads(list("iSLRo"), lines, [[1, 2, 3], [4], [], [], []], [3.5] * 5, [10.0] * 5)


def test_lanes_know_their_light_and_their_intersection() -> None:
    roads = crossing()
    two = [Light("main", lanes=(1, 2)), Light("arrow", lamps=R | L, lanes=(2,)), Light("foot", is_pedestrian=True)]
    phases = (Phase(5, (G, R, R)), Phase(5, (R, R | L, R)))
    controller = Controller("I5", 5, ((0,), (1,), (2,)), phases, (3, 3, 3))
    plan = SignalPlan(roads, two, [controller], passes=[G, G, L, G, G])
    assert plan.light_of_lane.tolist() == [-1, 0, 1, -1, -1]  # of two lights the one that can let it go
    assert plan.controller_of_lane.tolist() == [-1, 0, 0, 0, -1]  # the turn without a light is inside, too
    assert plan.light("arrow") == 1
    with pytest.raises(KeyError):
        plan.light("none")


def test_green_allows_a_left_turn_if_no_arrow_exists() -> None:
    roads = crossing()
    arrow = [Light("main", lamps=R | Y | G | L, lanes=(1, 2))]
    assert SignalPlan(roads, arrow, passes=[L] * 5).pass_of_lane.tolist() == [L] * 5
    never = SignalPlan(roads, arrow, [simple((5, (G,)), (5, (R,)), yellow=(3,))], passes=[L] * 5)
    assert never.pass_of_lane.tolist() == [L, L | G, L | G, L, L]


def test_light_ahead_is_that_of_the_next_stop_line() -> None:
    roads = crossing()
    plan = SignalPlan(roads, [Light("main", lanes=(1, 3)), Light("arrow", lanes=(2,))])
    assert light_ahead(roads, plan, 0, 10.0, 100.0) == 0  # straight on tells
    assert light_ahead(roads, plan, 0, 10.0, 39.0) is None
    assert light_ahead(roads, plan, 0, 10.0, 40.0) == 0
    assert light_ahead(roads, plan, 1, 0.0, 1000.0) is None  # it has been passed


def test_the_light_ahead_is_found_through_forks_and_around_loops() -> None:
    lines = [lane((0, 0), (10, 0)), lane((10, 0), (40, 0)), lane((10, 0), (20, 5)), lane((20, 5), (0, 0))]
    lines.append(lane((40, 0), (50, 0)))
    roads = Roads(list("abcde"), lines, [[1, 2], [4], [3], [0], []], [3.5] * 5, [0.0] * 5)
    plan = SignalPlan(roads, [Light("x", lanes=(4,))])
    assert light_ahead(roads, plan, 0, 0.0, 100.0) == 0
    assert light_ahead(roads, plan, 2, 0.0, 100.0) == 0
    assert light_ahead(roads, plan, 4, 0.0, 1e9) is None
    assert math.isclose(roads.length[1], 30.0)


def test_different_plans_have_different_digests() -> None:
    def digest(*phases: tuple[int, tuple[int, ...]], passes: int = G) -> bytes:
        roads = Roads(["a"], [lane((0, 0), (9, 0))], [[]], [3.5], [0.0])
        return SignalPlan(roads, [Light("x", lanes=(0,))], [simple(*phases, yellow=(3,))], passes=[passes]).digest

    assert digest((5, (G,))) == digest((5, (G,)))
    assert len({digest((5, (G,))), digest((6, (G,))), digest((5, (R,))), digest((5, (G,)), passes=L)}) == 4
