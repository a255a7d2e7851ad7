"""All that conditions and actions of a story may read and change."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from rosbridge_sim.records import Record
from rosbridge_sim.scenarios.openscenario.storyboard import Storyboard
from rosbridge_sim.simulator.story.measures import Measures
from rosbridge_sim.simulator.story.story_actors import StoryActors


class StoryContext(Record, eq=False):
    """Actors, distances, storyboard, variables, lights and time of a running story.

    Attributes:
        values: of variables and parameters, by name.
        light: returns whether the light of a name is in a state.
        phase: returns whether the controller of a name is in a phase.
        time: since the start of the story [s].
    """

    actors: StoryActors
    measures: Measures
    board: Storyboard
    values: Mapping[str, str]
    light: Callable[[str, str], bool]
    phase: Callable[[str, str], bool]
    time: Callable[[], float]
