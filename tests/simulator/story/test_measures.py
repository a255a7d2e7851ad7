"""Distances of stories: free ways between boxes, along lanes beside each other and around a ring, and their cost."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
import pytest

from rosbridge_sim.scenarios.openscenario.places import MapPlace, StoryMap
from rosbridge_sim.simulator.story.measures import Measures
from rosbridge_sim.simulator.story.story_actors import StoryActor, StoryActors
from rosbridge_sim.world.roads.roads import Roads
from rosbridge_sim.world.state.world import World
from tests.simulator.story.story_texts import Telling, after, at, by_entity, event, group, speed, story, teleport

EGO = {"Ego": teleport(at(20, 0)) + speed(10)}
EUCLIDEAN = 'relativeDistanceType="euclidianDistance" freespace="true" value="1000" rule="lessThan"'


def free_way(pose: tuple[float, float, float]) -> float:
    """The free distance from the ego to a car with this place and heading."""
    near = by_entity("Ego", f'<RelativeDistanceCondition entityRef="Car" {EUCLIDEAN}/>')
    telling = Telling(story({**EGO, "Car": teleport(at(*pose))}, group("Car", event("near", speed(1), near))))
    return telling.running.state.board.figures[0]


def outline(x: float, y: float, h: float) -> npt.NDArray[np.complex128]:
    """Points on the sides of a car of 5 x 2 m, whose middle is 1.4 m ahead, as complex numbers."""
    corners = np.array([3.9 + 1j, 3.9 - 1j, -1.1 - 1j, -1.1 + 1j, 3.9 + 1j])
    share = np.linspace(0.0, 1.0, 201)[:, None]
    points: npt.NDArray[np.complex128] = (
        complex(x, y) + np.exp(1j * h) * (corners[:-1] + share * np.diff(corners)).ravel()
    )
    return points


@pytest.mark.parametrize(
    "pose", [(30, 0, 0), (20, 5, 0), (30, 6, math.pi / 2), (31.4, 9, math.pi / 4), (28, -4, 2.5), (12, 3, -0.4)]
)
def test_free_distance_of_boxes_is_that_of_their_sides(pose: tuple[float, float, float]) -> None:
    expected = np.abs(outline(20, 0, 0)[:, None] - outline(*pose)).min()
    assert free_way(pose) == pytest.approx(expected, abs=0.01)


@pytest.mark.parametrize("pose", [(21.4, -1.4, math.pi / 2), (22, 0.5, 0.3), (20, 0, 0), (20.5, 1.9, 0)])
def test_boxes_that_meet_have_no_distance(pose: tuple[float, float, float]) -> None:
    assert free_way(pose) == 0.0  # of the first, a cross, no corner is within the other one


def ring() -> StoryMap:
    """A ring of four lanes with 157 m in all, to the left."""
    angle = np.linspace(0.0, 0.5 * math.pi, 41)
    lines = [
        25.0 * np.stack([np.cos(a), np.sin(a), 0.0 * a], axis=1) for a in (angle + i * 0.5 * math.pi for i in range(4))
    ]
    return StoryMap(Roads(["a", "b", "c", "d"], lines, [[1], [2], [3], [0]], [3.5] * 4, [10.0] * 4))


@pytest.mark.parametrize("angle", [0.3, 1.5, -0.3, -1.5])
def test_on_a_ring_what_is_nearer_behind_is_behind(angle: float) -> None:
    here, there = StoryActor(uid=1), StoryActor(uid=2)
    actors = StoryActors(World(), ring(), {"here": here, "there": there}, {}, {})
    for actor, turn in ((here, 0.2), (there, 0.2 + angle)):
        actors.put(actor, MapPlace(25.0 * math.cos(turn), 25.0 * math.sin(turn), 0.0, turn + 0.5 * math.pi))
    assert Measures(actors).along("here", "there", "road") == pytest.approx(25.0 * angle, abs=0.1)


def test_hundreds_of_conditions_about_the_ego_look_for_its_lane_once_a_step() -> None:
    near = '<TimeHeadwayCondition entityRef="Ego" value="0.01" rule="lessThan" freespace="true" alongRoute="true"/>'
    cars = {f"C{i}": teleport(at(30.0 + 4.0 * i, 3.5 * (i % 3 - 1))) + speed(10) for i in range(60)}
    groups = [group(name, event(f"e{name}", speed(1), by_entity(name, near)), name=f"g{name}") for name in cars]
    telling = Telling(story({**EGO, **cars}, *groups, group("Ego", event("x", speed(10), after(0)), name="g")))
    story_map = telling.running._map
    telling.run(0.1)
    before = story_map.project.cache_info().misses
    telling.run(0.5)
    assert story_map.project.cache_info().misses - before <= 0.5 / 0.05
