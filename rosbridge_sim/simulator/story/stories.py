"""The component of stories: it tells the story of the loaded scenario, and offers `/sim/story`, topic and service.

Its state is that of the story. A load that leaves the scene as it was leaves the story going on.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.graph.topics_services import Call
from rosbridge_sim.loose_types import Struct
from rosbridge_sim.morai.messages.convert import late_maker
from rosbridge_sim.printable import printable
from rosbridge_sim.records import replace
from rosbridge_sim.simulator.bus.publishers import Publishers
from rosbridge_sim.simulator.bus.subscribers_services import SubscribersServices
from rosbridge_sim.simulator.kernel.component import Component
from rosbridge_sim.simulator.kernel.context import SimulatorContext
from rosbridge_sim.simulator.plain.plain_bytes import PlainData
from rosbridge_sim.simulator.plain.typed_plain import as_plain, check_finite, read_as
from rosbridge_sim.simulator.scene.load import Load

if TYPE_CHECKING:  # imported with the first story
    from rosbridge_sim.simulator.story.running_story import RunningStory, SetWeather

STORY_TOPIC: Final = "/sim/story"
RATE: Final = 10.0
"""Default rate of the topic [Hz]: a message has all elements and conditions."""

_MESSAGES: Final = {
    "StoryElement": "kind name state transition executions parent",
    "StoryCondition": "name kind is_looked_at holds value",
    "StoryVerdict": "result group time reason",
    "StoryState": "header name time is_over verdict elements conditions entities ids",
}
"""Fields of our messages, in the order in which they are made."""

NOWHERE: Final = 2**32 - 1
"""Id of an entity that is not in the world."""


class Stories(Component):
    """The component of stories.

    Attributes:
        running: the story of the scene; None for none.
    """

    def __init__(self, context: SimulatorContext, set_weather: SetWeather) -> None:
        """Begin the story of the opening scene, if it has one.

        Args:
            set_weather: sets the weather of cameras and lidars, and the friction of the road.
        """
        self._set_weather = set_weather
        self._context = context
        self.running: RunningStory | None = None
        self._load: Load | None = None
        hooks = context.hooks
        hooks.place.append(self._move)
        hooks.after_frame.append(self._tell)
        hooks.on_new_scene.append(self._follow)
        hooks.on_reset.append(self._forget)
        self._make_element, self._make_condition, self._make_verdict, self._make_state = (
            late_maker(context.bus.store, f"rosbridge_sim_msgs/{name}", fields) for name, fields in _MESSAGES.items()
        )
        self._follow(0.0)

    def publish(self, publishers: Publishers) -> None:
        """Publish the topic that exists once, not for each ego."""
        publishers.add(
            STORY_TOPIC,
            "rosbridge_sim_msgs/StoryState",
            lambda: None if self.running is None else self._message(),
            rate=RATE,
            is_shown_in_pause=True,
        )

    def bind(self, bindings: SubscribersServices) -> None:
        """Offer the service that exists once, not for each ego."""
        bindings.provide(STORY_TOPIC[1:], "rosbridge_sim_msgs/Story", self._answer)

    def verdict(self) -> Struct:
        """Make the message of the verdict of the story's evaluation."""
        if self.running is None:
            return self._make_verdict("", "", -1.0, "")
        verdict = self.running.board.verdict()
        return self._make_verdict(verdict.result, verdict.group, verdict.time, printable(verdict.reason))

    # The story

    def _forget(self) -> None:
        """Begin anew with the next scene: the world is that of frame 0."""
        self._load = None

    def _follow(self, _now: float) -> None:
        """Begin the story of a new scene."""
        loaded = self._context.scene.loaded
        if loaded is self._load:
            return
        self._take(loaded)
        if self.running is not None:
            self.running.open()

    def _take(self, loaded: Load) -> None:
        """Have the story of a load, without beginning it."""
        self._load = loaded
        if self.running is not None:
            self._hold_ego(is_held=False)
        context, story = self._context, loaded.story
        self.running = None
        hooks = context.hooks
        (hooks.place.rest if story is None else hooks.place.wake)(self._move)
        (hooks.after_frame.rest if story is None else hooks.after_frame.wake)(self._tell)
        if story is None:
            return
        from rosbridge_sim.scenarios.openscenario.entities import story_scenario  # noqa: PLC0415 - few scenes have a story
        from rosbridge_sim.scenarios.openscenario.places import StoryMap  # noqa: PLC0415 - few scenes have a story
        from rosbridge_sim.simulator.story.running_story import RunningStory  # noqa: PLC0415 - few scenes have a story

        if story.is_of_blocks:
            spawns = tuple([replace(spawn, name=spawn.where) for spawn in (*loaded.egos, *loaded.others)])
        else:
            scenario = story_scenario(story, loaded.name, None, context.scene.catalogue)
            spawns = (*scenario.egos, *scenario.vehicles, *scenario.pedestrians, *scenario.obstacles)
        self.running = RunningStory(context.scene, story, spawns, StoryMap.of(loaded.road_map), self._set_weather)
        self._hold_ego(is_held=story.text.drives_ego)

    def _hold_ego(self, *, is_held: bool) -> None:
        """Have the first ego ignore commands while the story moves it."""
        self._context.egos.first.moved_by = "story" if is_held else ""

    def _move(self) -> None:
        if self.running is not None and not self._context.scene.is_replaying:
            if self.running.story.text.drives_ego:
                self._hold_ego(is_held=True)  # the end of a replay gives it back to clients
            self.running.move()

    def _tell(self, _now: float) -> None:
        if self.running is not None and not self._context.scene.is_replaying:
            self.running.step()

    # The state

    def save_state(self) -> PlainData:
        """Return the state of the story; None without one."""
        return None if self.running is None else as_plain(self.running.state)

    def load_state(self, data: PlainData, now: float) -> None:  # noqa: ARG002 - the interface has it
        """Become what was saved."""
        self._take(self._context.scene.loaded)
        if self.running is None:
            if data is not None:
                raise ValueError("expected no state of a story")
            return
        from rosbridge_sim.simulator.story.running_story import StoryState  # noqa: PLC0415 - few scenes have a story

        check_finite(data, "story")
        try:
            self.running.restore(read_as(StoryState, data, "story"))
        except DocumentError as error:
            raise ValueError(str(error)) from None

    # The messages

    def _message(self) -> Struct:
        context, running = self._context, self.running
        header = context.convert.header(context.world.frame)
        if running is None:
            return self._make_state(header, "", 0.0, False, self.verdict(), [], [], [], [])  # noqa: FBT003 - not over
        from rosbridge_sim.scenarios.openscenario.storyboard import State, Transition, kind_of  # noqa: PLC0415 - few scenes have a story

        state, board = running.state.board, running.board
        now = [State(each).name.lower() for each in state.states]
        new = [
            Transition(each * (mark > state.frame_mark)) for each, mark in zip(state.changes, state.marks, strict=True)
        ]
        elements = [
            self._make_element(part.kind, part.name, *(now[i], new[i].name.lower(), state.counts[i], part.parent))
            for i, part in enumerate(board.parts)
        ]
        conditions = [
            self._make_condition(each["name"], kind_of(each), before >= 0, before == 1, figure)
            for each, before, figure in zip(board.conditions, state.before, state.figures, strict=True)
        ]
        world, egos = context.world, context.egos
        ids = [
            egos.unique_id(world.row(actor.uid)) if actor.uid in world else NOWHERE
            for actor in running.state.actors.values()
        ]
        return self._make_state(
            *(header, context.scene.loaded.name, running.time(), state.is_over, self.verdict(), elements, conditions),
            *(list(running.state.actors), ids),
        )

    def _answer(self, call: Call, _now: float) -> None:
        has_story = self.running is not None
        message = "" if has_story else "the loaded scenario has no story: no OpenSCENARIO, and no events"
        call.respond(result=has_story, message=message, story=self._message())
