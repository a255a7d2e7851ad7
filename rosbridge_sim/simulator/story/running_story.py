"""A story that runs in a world: its storyboard, its actors and the actions that go on.

A story has steps of its own, of `STORY_STEP`. At the begin of each one, behind a frame, the triggers are looked at,
actions begin or end, and they move the actors to the end of the step (`step`). Each frame shows the actors where they
are between both ends (`move`). All that lasts is in `StoryState`, which is plain data.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Final, TypeAlias

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.printable import printable
from rosbridge_sim.records import replace
from rosbridge_sim.scenarios.openscenario.places import StoryMap
from rosbridge_sim.scenarios.openscenario.story import each_item
from rosbridge_sim.scenarios.openscenario.story_records import Story, StoryItem
from rosbridge_sim.scenarios.openscenario.story_signals import lamps_of, start_phase
from rosbridge_sim.scenarios.openscenario.story_weather import find_friction, find_weather
from rosbridge_sim.scenarios.openscenario.storyboard import BoardState, Storyboard, kind_of
from rosbridge_sim.scenarios.scenario import Driver, Spawn
from rosbridge_sim.simulator.scene.scene import Scene, lane_start
from rosbridge_sim.simulator.scene.scene_limits import FIRST_EGO, MAX_ENTITIES
from rosbridge_sim.simulator.story.conditions import measure
from rosbridge_sim.simulator.story.measures import Measures
from rosbridge_sim.simulator.story.motions import MOTIONS, Running
from rosbridge_sim.simulator.story.story_actors import (
    DRIVER,
    MODES,
    POSE,
    PROGRAM,
    STANDS,
    STORY,
    STORY_STEP,
    StoryActor,
    StoryActors,
)
from rosbridge_sim.simulator.story.story_context import StoryContext
from rosbridge_sim.world.contacts.contacts_without_cars import find_without_cars
from rosbridge_sim.world.state.placement import set_speed
from rosbridge_sim.world.state.world import DT, MAX_COORDINATE, MAX_SPEED, Kind

_WRAPPERS: Final = frozenset({"PrivateAction", "LongitudinalAction", "LateralAction", "RoutingAction"})
"""Elements around private actions that say only where they belong."""

SAME_TIME: Final = 1e-6
"""Times that differ by less, in steps, are the same."""

_log = logging.getLogger("rosbridge_sim.morai")


@dataclass(slots=True)
class StoryState:
    """All that changes in a story.

    Attributes:
        start: frame of the world at which it began.
        step: number of the present step, from 0.
        actors: by name.
        board: of its storyboard.
        running: actions that go on, in the order of their begin.
        values: of parameters and variables, by name.
        lights: states of lights that it has set, by name.
        touched: ids of the pairs that have touched since the present step began, if a condition asks for them.
    """

    start: int
    step: int
    actors: dict[str, StoryActor]
    board: BoardState
    running: list[Running] = field(default_factory=list)
    values: dict[str, str] = field(default_factory=dict)
    lights: dict[str, str] = field(default_factory=dict)
    touched: list[tuple[int, int]] = field(default_factory=list)


SetWeather: TypeAlias = Callable[[str, float | None], None]
"""Sets a weather, empty for the present one, and a friction, None for that of the weather."""


class RunningStory:
    """A story in a world. It is the host of its storyboard.

    Attributes:
        story: the parts of the file.
        board: its storyboard.
        state: all that changes.
    """

    def __init__(
        self, scene: Scene, story: Story, spawns: Iterable[Spawn], story_map: StoryMap, set_weather: SetWeather
    ) -> None:
        """Take the actors that are in the world, and begin nothing yet.

        Args:
            spawns: of all its entities, placed or not.
            set_weather: sets the weather of cameras and lidars, and the friction of the road.
        """
        self.story = story
        self._scene, self._world = scene, scene.world
        self._spawns = {spawn.name: spawn for spawn in spawns}
        self._set_weather = set_weather
        self._told: set[str] = set()
        self._controlled = {
            state["trafficSignalId"]
            for controller in story.controllers.values()
            for phase in controller.parts
            for state in phase.parts
        }
        self._begun: dict[int, None] = {}  # actions whose events have begun, while triggers are looked at
        self._init = [
            (action, [each["entityRef"]] if each.kind == "Private" else [])
            for each in story.init.parts
            for action in (each.parts if each.kind == "Private" else [each])
        ]
        self.board = Storyboard(story.storyboard, STORY_STEP, story.evaluation)
        self._looks_at = {kind_of(each) for each in self.board.conditions}
        actors = {name: StoryActor(mode=self._mode_of(name)) for name in story.entities}
        for name, (near, _) in story.holds.items():
            actors[name].waiting = 0.0 if near else None
        values = {**story.parameters, **story.variables}
        self.state = StoryState(self._world.frame, 0, actors, self.board.state, values=values)
        self._map = story_map
        self._use_state()
        self._link()

    def _mode_of(self, name: str) -> str:
        """Return what moves an entity; the items of a JSON scenario are moved by the world."""
        if name == self.story.ego and not self.story.text.drives_ego:
            return PROGRAM
        return DRIVER if self.story.is_of_blocks else STORY

    def _use_state(self) -> None:
        """Have everything look at the present state."""
        state = self.state
        self.board.state = state.board
        self._keep(list(state.running))
        bodies = {name: spawn.model.body for name, spawn in self._spawns.items()}
        self._actors = StoryActors(self._world, self._map, state.actors, bodies, self.story.holds)
        sees = self._shows, self._is_in_phase, self.time
        self._context = StoryContext(self._actors, Measures(self._actors), self.board, state.values, *sees)

    def _link(self) -> None:
        """Find the actors in the world, by their names."""
        world = self._world
        if self.story.is_of_blocks:  # their names are those of models: a scene has them in the order of its load
            others = [row for row in world.placed() if world.kind[row] != Kind.EGO]
            names = [name for name, spawn in self._spawns.items() if spawn.kind is not Kind.EGO]
            rows = dict(zip(names, others, strict=False))
        else:
            rows = {world.names[row]: row for row in reversed(list(world.placed()))}
        for name, actor in self.state.actors.items():
            is_ego = name == self.story.ego
            row = world.row(FIRST_EGO) if is_ego and FIRST_EGO in world else rows.get(name)
            if row is None:
                continue
            actor.uid = int(world.uid[row])
            self._actors.read(actor)

    def time(self) -> float:
        """Return the time from the start to the begin of the present step [s]."""
        return self.state.step * STORY_STEP

    def open(self) -> None:
        """Carry out the actions of `Init`, and look at the triggers for the first time."""
        for name in self.story.controllers:
            self._world.signals.set_phase(self._row_of_controller(name), *start_phase(name, self.story.controllers))
        for number, (action, names) in enumerate(self._init):
            is_placed = action.find("TeleportAction", "EntityAction") is not None
            if not (is_placed and all(self.state.actors[name].uid >= 0 for name in names)):
                self._begin(-1 - number, action, names)
        for actor in self.state.actors.values():
            if actor.uid >= 0 and actor.mode == STORY:
                self._actors.show(actor)
            elif actor.uid >= 0 and actor.mode == PROGRAM:
                set_speed(self._world, self._world.row(actor.uid), actor.speed)
        self._advance()

    def _advance(self) -> None:
        """Look at all triggers, begin the actions of the events that they start, and move the actors by a step."""
        self.board.advance(self.state.step, self)
        begun, self._begun = self._begun, {}
        for number in begun:
            actors = self.board.parts[self._group_of(number)].item.part("Actors")
            self._begin(number, self.board.parts[number].item.part(), [each["entityRef"] for each in actors.parts])
        self._move_actors()

    def _group_of(self, number: int) -> int:
        while self.board.parts[number].kind != "ManeuverGroup":
            number = self.board.parts[number].parent
        return number

    def _steps(self) -> float:
        """Return the steps from the start to the end of the world's next frame."""
        return (self._world.frame + 1 - self.state.start) * DT / STORY_STEP

    def step(self) -> None:
        """Begin the next step, behind a frame, if the next frame ends in it."""
        step, state = math.ceil(self._steps() - SAME_TIME) - 1, self.state
        if "CollisionCondition" in self._looks_at:
            found = *self._world.contacts.tolist(), *find_without_cars(self._world).tolist()
            pairs = ((one, other) for one, other in found)
            state.touched = list(dict.fromkeys((*state.touched, *pairs)))
        if step > state.step:
            state.step = step
            if self.story.is_of_blocks:
                self._hand_back()
            later = self.time() - (self._world.frame - state.start) * DT
            self._actors.observe(later, state.touched, minds_lanes="OffroadCondition" in self._looks_at)
            state.touched = []
            self._advance()
        for name, text in state.lights.items():
            if self._row_of_light(name) is not None:
                self._light(name, text)

    def _hand_back(self) -> None:
        """Have the world drive the vehicles whose events are over, as before; one that was told to stand stays so."""
        world, busy = self._world, {running.entity for running in self.state.running}
        for name, actor in self.state.actors.items():
            if actor.mode != STORY or actor.uid not in world or name in busy:
                continue
            spawn = self._spawns[name]
            driver = lane_start(world.row(actor.uid), spawn, spawn.driver or Driver(spawn.speed))
            if actor.travelled:
                driver = replace(driver, start_within=0.0)
            if actor.told_speed is not None:
                driver = replace(driver, desired_speed=actor.told_speed)
            if driver.desired_speed >= STANDS:
                self._actors.read(actor)  # where the last frame has shown it
                self._actors.hand_over(actor, driver)

    def move(self) -> None:
        """Show the actors where they are at the end of a frame, within the world's step."""
        self._actors.show_between(min(self._steps() - self.state.step, 1.0))

    def _move_actors(self) -> None:
        """Move the actors by a step of the story.

        Actions act in the order of the file. A lateral one moves its actor with the speed that it finds, as in esmini.
        """
        self._actors.begin_step()
        state = self.state
        going: list[Running] = []
        for running in sorted(state.running, key=lambda each: (each.number >= 0, abs(each.number))):
            item, actor = self._item_of(running.number), state.actors[running.entity]
            motion = MOTIONS[item.kind]
            if "lateral" in motion.domains:
                actor.way_speed = actor.speed
            try:
                if actor.uid >= 0 and not motion.advance(self._context, item, actor, running):
                    going.append(running)
            except DocumentError as error:
                self._tell(item, error)
        self._keep(going)
        self._actors.move()

    def _keep(self, going: list[Running]) -> None:
        """Have these actions go on, and no others."""
        self.state.running[:] = going
        self._going = {running.number for running in going}

    # The host of the storyboard

    def measure(self, condition: StoryItem) -> tuple[bool, float]:
        """See `Host`."""
        return measure(self._context, condition)

    def begin(self, number: int) -> None:
        """See `Host`. Global actions act at once, so that later triggers see it; private ones behind all triggers."""
        action = self.board.parts[number].item.part()
        if action.kind == "GlobalAction":
            self._begin(number, action, [])
        else:
            self._begun[number] = None

    def is_done(self, number: int) -> bool:
        """See `Host`."""
        return number not in self._begun and number not in self._going

    def end(self, number: int) -> None:
        """See `Host`."""
        self._begun.pop(number, None)
        self._keep([running for running in self.state.running if running.number != number])

    def _begin(self, number: int, item: StoryItem, names: list[str]) -> None:
        if item.kind == "GlobalAction":
            try:
                self._act(item.part())
            except (DocumentError, ValueError) as error:
                self._tell(item, error)
            return
        item = _leaf(item)
        for name in names:
            try:
                self._begin_private(number, item, name)
            except (DocumentError, ValueError) as error:
                self._tell(item, error)

    def _begin_private(self, number: int, item: StoryItem, name: str) -> None:
        motion = MOTIONS[item.kind]
        if item.kind == "TeleportAction" and self.state.actors[name].uid < 0:
            self._add(name, item.part("Position"))
            return
        actor = self._actors.on_lane(name)
        if actor.mode == PROGRAM and motion.domains and item.kind != "SpeedAction":
            return  # the user's program moves it
        running = Running(number, name)
        if motion.domains and actor.mode == DRIVER:
            actor.mode = STORY
            self._actors.show(actor)
        self.state.running[:] = [
            other
            for other in self.state.running
            if other.entity != name or not set(motion.domains) & set(MOTIONS[self._item_of(other.number).kind].domains)
        ]
        if not motion.begin(self._context, item, actor, running):
            self.state.running.append(running)

    def _item_of(self, number: int) -> StoryItem:
        """Return the private action of a part of the storyboard, or of `Init` for a negative number."""
        if number >= 0:
            return _leaf(self.board.parts[number].item.part())
        return _leaf(self._init[-1 - number][0])

    def _tell(self, item: StoryItem, error: Exception) -> None:
        """Log, once, why an action does nothing."""
        line = f"{item.where}: {item.kind}: {error}"
        if line not in self._told:
            self._told.add(line)
            _log.warning("story %s: it has no effect: %s", self.story.text.source, line)

    # Global actions

    def _act(self, item: StoryItem) -> None:
        """Carry out a global action.

        Raises:
            DocumentError: it cannot be done.
        """
        if item.kind == "EntityAction":
            name, action = item["entityRef"], item.part()
            if action.kind == "AddEntityAction":
                self._add(name, action.part("Position"))
            else:
                self._remove(name)
        elif item.kind in {"VariableAction", "ParameterAction"}:
            self._set(item["variableRef" if item.kind == "VariableAction" else "parameterRef"], item.part())
        elif item.kind == "EnvironmentAction":
            self._set_weather(find_weather(item.part()), find_friction(item.part()))
        elif item.kind == "InfrastructureAction":
            state = item.part("TrafficSignalAction").part()
            if state.kind == "TrafficSignalControllerAction":
                name = state["trafficSignalControllerRef"]
                names = [phase["name"] for phase in self.story.controllers[name].parts]
                self._world.signals.set_phase(self._row_of_controller(name), names.index(state["phase"]))
                return
            self._light(state["name"], state["state"])
            if state["name"] not in self._controlled:  # else it lasts until the next phase of its controller
                self.state.lights[state["name"]] = state["state"]

    def _add(self, name: str, position: StoryItem) -> None:
        actor = self.state.actors[name]
        if actor.uid >= 0:
            raise DocumentError(f"{printable(name, 60)} is in the world already")
        if len(self._world) >= MAX_ENTITIES:
            raise DocumentError(f"the world holds {MAX_ENTITIES:,} at most")
        place = self._map.find_place(position, self._actors.locate)
        spawn = self._spawns[name]
        actor.uid = self._scene.add_agent(replace(spawn, x=place.x, y=place.y, z=place.z, yaw=place.yaw, speed=0.0))
        actor.speed = 0.0
        self._actors.put(actor, place)
        self._actors.show(actor)

    def _remove(self, name: str) -> None:
        actor = self.state.actors[name]
        if name == self.story.ego:
            raise DocumentError("the ego stays in the world")
        if actor.uid < 0:
            raise DocumentError(f"{printable(name, 60)} is not in the world")
        self._world.remove(actor.uid)
        actor.uid = -1
        self._keep([running for running in self.state.running if running.entity != name])

    def _set(self, name: str, action: StoryItem) -> None:
        values = self.state.values
        if action.kind == "SetAction":
            values[name] = action["value"]
            return
        rule = action.part("Rule").part()
        try:
            number = float(values[name])
        except ValueError:
            raise DocumentError(f"{printable(name, 60)} is no number") from None
        number = number + rule["value"] if rule.kind == "AddValue" else number * rule["value"]
        values[name] = repr(max(-1e300, min(1e300, number)))

    # Lights

    def _light(self, name: str, text: str) -> None:
        """Have a light show a state, unless it does.

        Raises:
            DocumentError: it is no state.
        """
        row, signals = self._row_of_light(name), self._world.signals
        value = lamps_of(text, *([] if row is None else [signals.plan.lights[row].lamps]))
        if row is not None and int(signals.shown[row]) != value:
            signals.force(row, value)

    def _row_of_light(self, name: str) -> int | None:
        try:
            return self._world.signals.plan.light(name)
        except KeyError:
            return None

    def _shows(self, name: str, text: str) -> bool:
        """Return whether a light is in a state: the one that the story has set, or the one that it shows."""
        row, signals = self._row_of_light(name), self._world.signals
        lamps = () if row is None else (signals.plan.lights[row].lamps,)
        try:
            wanted = lamps_of(text, *lamps)
        except DocumentError:  # `--lenient` keeps a condition whose state is none
            return False
        if name in self.state.lights:
            return lamps_of(self.state.lights[name], *lamps) == wanted
        return row is not None and int(signals.shown[row]) == wanted

    def _row_of_controller(self, name: str) -> int:
        return list(self.story.controllers).index(name)  # those of the story are the first ones of the plan

    def _is_in_phase(self, name: str, phase: str) -> bool:
        """Return whether a controller of the story is in a phase."""
        at = int(self._world.signals.phase[self._row_of_controller(name)])
        return bool(self.story.controllers[name].parts[at]["name"] == phase)

    # State

    def restore(self, state: StoryState) -> None:
        """Become what was saved.

        Raises:
            ValueError: it is no state of this story.
        """
        world = self._world
        uids = [actor.uid for actor in state.actors.values() if actor.uid >= 0]
        actions = {number for number, part in enumerate(self.board.parts) if part.kind == "Action"}
        items = each_item(self.story.storyboard)
        lit = {(item["name"], item["state"]) for item in items if item.kind == "TrafficSignalStateAction"}
        is_good = (
            list(state.actors) == list(self.story.entities)
            and self.board.fits(state.board)
            and 0 <= state.start <= world.frame
            and 0 <= state.step < (world.frame + 1 - state.start) * DT / STORY_STEP
            and len(uids) == len(set(uids))
            and all(uid in world for uid in uids)
            and state.values.keys() == self.state.values.keys()
            and lit.issuperset(state.lights.items())
            and len({(running.number, running.entity) for running in state.running}) == len(state.running)
            and all(
                actor.mode in MODES
                and -1 <= actor.lane < len(self._map.roads)
                and 0.0 <= actor.s <= (self._map.roads.length[actor.lane] if actor.lane >= 0 else 0.0)
                and max(map(abs, (actor.x, actor.y, actor.z, actor.offset, *actor.shown[:3]))) <= MAX_COORDINATE
                and len(actor.shown) in {0, len(POSE)}
                and max(map(abs, (actor.speed, actor.way_speed or 0.0, actor.told_speed or 0.0))) <= MAX_SPEED
                and all(0 <= lane < len(self._map.roads) for lane in actor.route)
                for actor in state.actors.values()
            )
            and all(
                running.entity in state.actors and (running.number in actions or -len(self._init) <= running.number < 0)
                for running in state.running
            )
        )
        if not is_good:
            raise ValueError("expected a state of the story that is loaded")
        for running in state.running:
            motion = MOTIONS.get(self._item_of(running.number).kind)
            if motion is None or not motion.domains or not motion.fits(running):
                raise ValueError("expected running actions of the story that is loaded")
        self.state = state
        self._use_state()


def _leaf(item: StoryItem) -> StoryItem:
    """Return the private action within the elements around it."""
    while item.kind in _WRAPPERS:
        item = item.part()
    return item
