"""Files of OpenSCENARIO written by hand, and simulators that tell them on a small map.

The map `lanes` has three lanes of 3.5 m that run east from x = 0 to 1,000 (`left`, `middle`, `right`; the line of
`middle` is y = 0), behind `middle` a bend of radius 50 to the left (`bend`), and there an end.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.maps.mgeo import NO_PROJECTION
from rosbridge_sim.maps.road_map import RoadMap
from rosbridge_sim.scenarios.openscenario.entities import story_scenario
from rosbridge_sim.scenarios.openscenario.story import read_story
from rosbridge_sim.scenarios.openscenario.story_records import StoryText
from rosbridge_sim.scenarios.scenario import Scenario
from rosbridge_sim.simulator.node_factory import make_node
from rosbridge_sim.simulator.simulator_node import NodeSettings, SimulatorNode
from rosbridge_sim.simulator.story.running_story import RunningStory
from rosbridge_sim.simulator.story.stories import Stories
from rosbridge_sim.world.roads.roads import Roads
from rosbridge_sim.world.roads.signal_plan import Lamp, Light, SignalPlan
from rosbridge_sim.world.state.world import World
from tests.simulator.sim_harness import make_store

CAR = """<Vehicle name="car" vehicleCategory="car"><BoundingBox><Center x="1.4" y="0" z="0.75"/>
<Dimensions length="5" width="2" height="1.5"/></BoundingBox>
<Performance maxSpeed="70" maxAcceleration="10" maxDeceleration="10"/></Vehicle>"""
WALKER = """<Pedestrian name="p" pedestrianCategory="pedestrian" mass="80" model3d=""><BoundingBox>
<Center x="0" y="0" z="0.9"/><Dimensions length="0.5" width="0.5" height="1.8"/></BoundingBox></Pedestrian>"""


def link(name: str, s: float, offset: float = 0.0) -> str:
    return f'<Position><LinkPosition linkId="{name}" s="{s}" offset="{offset}"/></Position>'


def at(x: float, y: float, h: float = 0.0) -> str:
    return f'<Position><WorldPosition x="{x}" y="{y}" z="0" h="{h}"/></Position>'


def teleport(position: str) -> str:
    return f"<PrivateAction><TeleportAction>{position}</TeleportAction></PrivateAction>"


def longitudinal(action: str) -> str:
    return f"<PrivateAction><LongitudinalAction>{action}</LongitudinalAction></PrivateAction>"


def lateral(action: str) -> str:
    return f"<PrivateAction><LateralAction>{action}</LateralAction></PrivateAction>"


def routing(action: str) -> str:
    return f"<PrivateAction><RoutingAction>{action}</RoutingAction></PrivateAction>"


def speed(value: float | str, shape: str = "step", dimension: str = "time", length: float = 0.0) -> str:
    goal = value if isinstance(value, str) else f'<AbsoluteTargetSpeed value="{value}"/>'
    dynamics = f'dynamicsShape="{shape}" dynamicsDimension="{dimension}" value="{length}"'
    return longitudinal(
        f"<SpeedAction><SpeedActionDynamics {dynamics}/><SpeedActionTarget>{goal}</SpeedActionTarget></SpeedAction>"
    )


def lane_change(target: str, shape: str = "sinusoidal", dimension: str = "time", length: float = 2.0) -> str:
    dynamics = f'dynamicsShape="{shape}" dynamicsDimension="{dimension}" value="{length}"'
    return lateral(
        f"<LaneChangeAction><LaneChangeActionDynamics {dynamics}/><LaneChangeTarget>{target}</LaneChangeTarget>"
        "</LaneChangeAction>"
    )


def by_value(condition: str, *, delay: float = 0.0, edge: str = "none") -> str:
    return f"""<Condition name="c" delay="{delay}" conditionEdge="{edge}"><ByValueCondition>{condition}
</ByValueCondition></Condition>"""


def after(time: float, *, delay: float = 0.0, edge: str = "none") -> str:
    return by_value(f'<SimulationTimeCondition value="{time}" rule="greaterOrEqual"/>', delay=delay, edge=edge)


def state_of(kind: str, name: str, state: str, *, delay: float = 0.0, edge: str = "none") -> str:
    attributes = f'storyboardElementType="{kind}" storyboardElementRef="{name}" state="{state}"'
    return by_value(f"<StoryboardElementStateCondition {attributes}/>", delay=delay, edge=edge)


def by_entity(name: str, condition: str, *, edge: str = "none", rule: str = "any", delay: float = 0.0) -> str:
    refs = "".join(f'<EntityRef entityRef="{each}"/>' for each in name.split())
    return f"""<Condition name="c" delay="{delay}" conditionEdge="{edge}"><ByEntityCondition>
<TriggeringEntities triggeringEntitiesRule="{rule}">{refs}</TriggeringEntities>
<EntityCondition>{condition}</EntityCondition></ByEntityCondition></Condition>"""


def trigger(*conditions: str, tag: str = "StartTrigger") -> str:
    return f"<{tag}><ConditionGroup>{''.join(conditions)}</ConditionGroup></{tag}>"


def event(name: str, action: str, start: str, *, priority: str = "parallel", count: int = 1) -> str:
    return f"""<Event name="{name}" priority="{priority}" maximumExecutionCount="{count}">
<Action name="{name} action">{action}</Action>{trigger(start)}</Event>"""


def group(actor: str, *events: str, name: str = "group", count: int = 1) -> str:
    return f"""<ManeuverGroup name="{name}" maximumExecutionCount="{count}"><Actors selectTriggeringEntities="false">
<EntityRef entityRef="{actor}"/></Actors><Maneuver name="maneuver">{"".join(events)}</Maneuver></ManeuverGroup>"""


def story(
    init: Mapping[str, str], *groups: str, more: str = "", stop: str = "", entities: str = "", end: str = ""
) -> str:
    """A scenario with an entity for each key of `init`; a name that begins with `walker` is a pedestrian."""
    objects = "".join(
        f'<ScenarioObject name="{name}">{WALKER if name.startswith("walker") else CAR}</ScenarioObject>'
        for name in init
    )
    private = "".join(f'<Private entityRef="{name}">{actions}</Private>' for name, actions in init.items())
    act = f'<Story name="story"><Act name="act">{"".join(groups)}</Act></Story>' if groups else ""
    return f"""<?xml version="1.0"?>
<OpenSCENARIO><FileHeader revMajor="1" revMinor="2" date="" description="" author=""/>{more}<RoadNetwork/>
<Entities>{objects}{entities}</Entities><Storyboard><Init><Actions>{private}</Actions></Init>{act}
<StopTrigger>{stop}</StopTrigger></Storyboard>{end}</OpenSCENARIO>"""


def lanes() -> RoadMap:
    x = np.linspace(0.0, 1000.0, 101)
    zero = np.zeros(len(x))
    turn = np.linspace(0.0, math.pi, 101)
    bend = np.stack([1000.0 + 50.0 * np.sin(turn), 50.0 - 50.0 * np.cos(turn), np.zeros(len(turn))], axis=1)
    lines = [np.stack([x, zero + y, zero], axis=1) for y in (3.5, 0.0, -3.5)]
    names = ["left", "middle", "right", "bend"]
    roads = Roads(
        names,
        [*lines, bend],
        [[], [3], [], []],
        [3.5] * 4,
        [20.0] * 4,
        left=[-1, 0, 1, -1],
        right=[1, 2, -1, -1],
    )
    plan = SignalPlan(roads, [Light("light", lanes=(3,)), Light("arrow", lamps=Lamp.RED | Lamp.YELLOW | Lamp.LEFT)])
    return RoadMap("lanes", NO_PROJECTION, (0.0, 0.0, 0.0), roads, plan)


class OneMap:
    """A library with this map alone."""

    def __init__(self) -> None:
        self.road_map = lanes()

    def scenario(self, name: str) -> Scenario:
        raise AssertionError(name)

    def map(self, name: str) -> RoadMap:
        assert name == "lanes"
        return self.road_map


def scenario_of(text: str, *, ego: str = "", drives_ego: bool = True, is_lenient: bool = False) -> Scenario:
    given = StoryText("story.xosc", text.encode(), ego=ego, drives_ego=drives_ego, is_lenient=is_lenient)
    return story_scenario(read_story(given), "story", "lanes")


class Telling:
    """A simulator that tells a story."""

    def __init__(self, text: str, *, drives_ego: bool = True, is_lenient: bool = False) -> None:
        scenario = scenario_of(text, drives_ego=drives_ego, is_lenient=is_lenient)
        self.node: SimulatorNode = make_node(Bus(make_store()), World(), OneMap(), scenario, NodeSettings(start="sync"))
        self.world = self.node.context.world

    @property
    def running(self) -> RunningStory:
        running = self.node.component(Stories).running
        assert running is not None
        return running

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds * 50)):
            self.node.context.stepper.compute(0.0, is_tick=True, is_last=True)

    def row(self, name: str) -> int:
        return self.world.row(self.running.state.actors[name].uid)

    def x(self, name: str) -> float:
        return float(self.world.x[self.row(name)])

    def y(self, name: str) -> float:
        return float(self.world.y[self.row(name)])

    def speed(self, name: str) -> float:
        return float(self.world.speed[self.row(name)])

    def began(self, kind: str, name: str) -> bool:
        board = self.running.board
        return any(self.running.state.board.counts[number] for number in board.find(kind, name))
