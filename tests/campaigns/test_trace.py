"""What is kept of a drive: figures of each frame, the end, the way, and the others around the ego."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
import pytest

from rosbridge_sim.campaigns.run_results import SCORES
from rosbridge_sim.campaigns.topic_values import TopicValues
from rosbridge_sim.campaigns.trace import FIGURES, Trace, TraceRecorder
from rosbridge_sim.errors import DocumentError
from rosbridge_sim.expressions import Value, parse_expression
from rosbridge_sim.world.state.world import Body, Kind, World

KNOWN = frozenset(FIGURES)


@dataclass
class Judge:
    """Keeps what it gets, while it wants frames."""

    is_judging: bool
    taken: list[Mapping[str, Value]] = field(default_factory=list)

    def take(self, values: Mapping[str, Value]) -> None:
        self.taken.append(values)


def recorder(
    seconds: float = 100.0, end_when: str | None = None, *, judge: Judge | None = None, fields: str = ""
) -> tuple[TraceRecorder, TopicValues]:
    topics = TopicValues(parse_expression(fields, "t", KNOWN, is_followed=True).fields if fields else ())
    condition = None if end_when is None else parse_expression(end_when, "e", KNOWN, is_followed=True)
    return TraceRecorder(seconds, condition, {"gap": 3.0}, judge or Judge(is_judging=False), topics), topics


def one_ego(**others: float) -> World:
    """A world with an ego at (5, 7), and others so many metres north of it."""
    world = World()
    world.spawn(Kind.EGO, Body(), name="ego", x=5.0, y=7.0)
    for name, north in others.items():
        world.spawn(Kind.VEHICLE, Body(), name=name, x=5.0, y=7.0 + north)
    return world


def drive(recorder: TraceRecorder, world: World, most: int = 1_000) -> int:
    """Number of frames until the recorder says that the drive has ended."""
    for num in range(1, most + 1):
        world.frame += 1
        if recorder.take(world):
            return num
    return most + 1


@pytest.mark.parametrize(("seconds", "num"), [(0.1, 5), (0.11, 6), (0.001, 1)])
def test_drive_ends_after_its_time(seconds: float, num: int) -> None:
    assert drive(recorder(seconds)[0], one_ego()) == num


@pytest.mark.parametrize(("end_when", "num"), [("time >= 0.06", 3), ("count(x > 0) > 3", 4), ("x < 0", 5)])
def test_drive_ends_when_its_condition_holds_or_after_its_time(end_when: str, num: int) -> None:
    assert drive(recorder(0.1, end_when)[0], one_ego()) == num


def test_a_frame_has_the_figures_of_the_first_ego_in_their_units() -> None:
    found, _ = recorder()
    world = one_ego(other=3.0)
    world.off_road_frames[0], world.num_collisions[0], world.speed[0] = 4, 2, 1.5
    drive(found, world, 1)
    frame = found.trace.at(-1)
    assert (
        frame | {"time": 0.02, "x": 5.0, "y": 7.0, "speed": 1.5, "off_road": 0.08, "collisions": 2, "gap": 3} == frame
    )
    assert frame.keys() == {*FIGURES, "gap"}


def test_judge_gets_figures_parameters_and_fields_of_topics_only_while_it_wants_them() -> None:
    judge = Judge(is_judging=True)
    found, topics = recorder(judge=judge, fields="/plan.speed < 3")
    topics.take("/plan", {"speed": 4})
    world = one_ego()
    drive(found, world, 1)
    judge.is_judging = False
    drive(found, world, 1)
    assert [(each["time"], each["gap"], each["/plan.speed"]) for each in judge.taken] == [(0.02, 3.0, 4)]
    topics.take("/plan", {"sped": 4})
    with pytest.raises(DocumentError, match="no field 'speed'"):
        drive(found, world, 1)


def test_frames_follow_each_other_in_a_world_with_an_ego() -> None:
    found, _ = recorder()
    world = one_ego()
    drive(found, world, 2)
    world.frame = 4
    with pytest.raises(DocumentError, match="expected frame 3 of the drive, got frame 4"):
        found.take(world)
    with pytest.raises(DocumentError, match="the scenario has no ego"):
        found.take(World())


def test_others_within_120_m_are_kept_ten_times_a_second_for_ten_seconds() -> None:
    found, _ = recorder()
    world = one_ego(near=-120.0, far=120.5, gone=3.0)
    world.remove(4)
    drive(found, world, 520)
    kept = list(found.trace.neighbours)
    assert [each.time for each in kept] == pytest.approx([0.5 + 0.1 * i for i in range(100)])
    body = Body()
    sizes = (body.length / 2, body.width / 2, body.length / 2 - body.rear_overhang)
    expected = [(1, 5, 7, 0, *sizes, Kind.EGO), (2, 5, -113, 0, *sizes, Kind.VEHICLE)]
    assert np.array(kept[-1].boxes) == pytest.approx(np.array(expected), abs=1e-3)


def test_way_has_both_ends_and_at_most_forty_places_evenly_in_time() -> None:
    def way(num: int) -> tuple[list[float], list[float]]:
        i, j = FIGURES.index("x"), FIGURES.index("y")
        figures = [{i: k + 0.04, j: -2.0 * k} for k in range(num)]
        rows = [tuple(each.get(c, 0.0) for c in range(len(FIGURES))) for each in figures]
        path = Trace(rows, {}, recorder()[0].trace.neighbours).path()
        return [x for x, _ in path], [y for _, y in path]

    assert way(0) == ([], [])
    assert way(3) == ([0.0, 1.0, 2.0], [0.0, -2.0, -4.0])
    along, across = way(79)
    assert along == [float(2 * k) for k in range(40)]
    assert across == [-2.0 * x for x in along]


def test_scores_are_those_of_the_last_frame_with_mean_and_greatest_speed() -> None:
    found, _ = recorder()
    world = one_ego()
    assert found.trace.scores() == {}
    for speed, distance in ((9.0, 0.5), (3.0, 1.0)):
        world.speed[0], world.score_distance[0], world.num_red_lights[0] = speed, distance, 1
        world.max_jerk[0] = 1.23456789
        drive(found, world, 1)
    scores = found.trace.scores()
    assert tuple(scores) == SCORES
    assert (
        scores | {"mean_speed": 25.0, "max_speed": 9.0, "time": 0.04, "red_lights": 1, "max_jerk": 1.234568} == scores
    )
    assert isinstance(scores["red_lights"], int)
