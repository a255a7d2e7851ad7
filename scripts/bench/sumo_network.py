"""Conversion of a map of ours into SUMO's plain XML: nodes, edges, connections and traffic lights.

Lanes beside one another become the lanes of one edge. Short lanes on which vehicles turn, cross or wait for a light
become connections through a junction. Shapes and speed limits are kept; edges keep their length, too. Each controller
becomes a static program: our intervals with a letter for each connection. SUMO itself works out who gives way.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from html import escape

import numpy as np

from rosbridge_sim.world.geometry.planar import FloatArray
from rosbridge_sim.world.roads.lane_conflicts import DEFAULT_SPEED_LIMIT, LaneConflicts
from rosbridge_sim.world.roads.roads import Roads
from rosbridge_sim.world.roads.signal_plan import Lamp, SignalPlan
from rosbridge_sim.world.state.world import DT

LONGEST_INSIDE = 60.0
"""Lanes with rivals or siblings that are longer than this are edges and not ways through a junction [m]: 60 m is the
widest crossing, and a ramp is longer."""

STRAIGHTER = 0.2
"""Of two green connections that cross, the one that turns by this much less has priority [rad]."""


TURN_ACCEL = 5.5
"""Lateral acceleration that SUMO's vehicles accept in junctions [m/s^2]: netconvert's default."""


@dataclass(frozen=True, slots=True)
class Edge:
    """Lanes of ours that are one edge of SUMO's.

    Attributes:
        name: in SUMO.
        lanes: rows of our lanes, the rightmost first, as SUMO counts.
        start, end: numbers of nodes.
    """

    name: str
    lanes: tuple[int, ...]
    start: int
    end: int


@dataclass(frozen=True, slots=True)
class Connection:
    """A way from a lane of an edge to a lane of another one.

    Attributes:
        lane, onward: rows of our lanes.
        inside: rows of our lanes between these; empty where one follows the other.
    """

    lane: int
    onward: int
    inside: tuple[int, ...]


class Network:
    """A map in SUMO's terms.

    Attributes:
        roads, plan: what it was made from.
        edges, connections: see their classes.
        edge_of_lane: (l,) for each of our lanes the number of its edge; -1 for those inside junctions.
        nodes: (n, 2) places [m].
        node_controllers: for each node the row of the controller of its lights; -1 for none.
    """

    def __init__(self, roads: Roads, plan: SignalPlan | None = None) -> None:
        self.roads = roads
        self.plan = SignalPlan(roads) if plan is None else plan
        self._conflicts = roads.derived(LaneConflicts)
        self._is_inside = _find_inside(roads, self.plan, self._conflicts)
        self.connections = [way for lane in self._outside() for way in self._ways_from(lane)]
        self._number_nodes()
        self._find_zippers()
        self._form_edges()

    def place(self, lane: int, s: float) -> tuple[str, int, float]:
        """Return the place in SUMO of a place of ours on a lane that is no way through a junction.

        Args:
            lane: row of the lane.
            s: arc length [m].

        Returns:
            Name of the edge, index of its lane, and distance from its start [m].
        """
        edge = self.edges[self.edge_of_lane[lane]]
        share = s / float(self.roads.length[lane])
        return edge.name, edge.lanes.index(lane), share * self.length_of(edge)

    def length_of(self, edge: Edge) -> float:
        """Return the length of an edge: SUMO has one for all its lanes [m]."""
        return float(self.roads.length[list(edge.lanes)].mean())

    def edges_along(self, lanes: Sequence[int]) -> list[str]:
        """Return the names of the edges along a row of lanes, each of which follows the one before."""
        numbers = [self.edge_of_lane[lane] for lane in lanes if self.edge_of_lane[lane] >= 0]
        return [self.edges[number].name for number in numbers]

    def files(self) -> dict[str, str]:
        """Return the content of netconvert's input files, by the end of their names."""
        return {
            "nod.xml": _document("nodes", self._write_nodes()),
            "edg.xml": _document("edges", self._write_edges()),
            "con.xml": _document("connections", self._write_connections()),
            "tll.xml": _document("tlLogics", self._write_lights()),
        }

    def _outside(self) -> list[int]:
        return np.flatnonzero(~self._is_inside).tolist()

    def _ways_from(self, lane: int) -> Iterator[Connection]:
        """Yield all ways from one lane through a junction, the shortest one to each lane behind it."""
        ahead: list[tuple[int, ...]] = [()]
        reached: set[int] = set()
        seen: set[int] = set()
        while ahead:
            inside = ahead.pop(0)
            for following in self.roads.successors(inside[-1] if inside else lane).tolist():
                if not self._is_inside[following]:
                    if following not in reached:
                        reached.add(following)
                        yield Connection(lane, following, inside)
                elif following not in seen:
                    seen.add(following)
                    ahead.append((*inside, following))

    def _number_nodes(self) -> None:
        """Give each group of lane ends that belong together a node: beside one another, or connected."""
        num = len(self.roads)
        groups = _Groups(2 * num)  # starts of lanes, then their ends
        for lane in self._outside():
            for beside in (int(self.roads.left[lane]), int(self.roads.right[lane])):
                if beside >= 0 and not self._is_inside[beside]:
                    groups.join(lane, beside)
                    groups.join(num + lane, num + beside)
        for way in self.connections:
            groups.join(num + way.lane, way.onward)
        first, last = self.roads.first[:-1], self.roads.first[1:] - 1
        ends = self.roads.points[np.concatenate([first, last]), :2]
        members: dict[int, list[int]] = {}
        for item in (each for lane in self._outside() for each in (lane, num + lane)):
            members.setdefault(groups.root(item), []).append(item)
        self.nodes = np.array([ends[items].mean(axis=0) for items in members.values()]).reshape(-1, 2)
        number_of_root = {item: number for number, item in enumerate(members)}
        self._node = [number_of_root.get(groups.root(item), -1) for item in range(2 * num)]
        self.node_controllers = [-1] * len(self.nodes)
        for way in self.connections:
            controller = self._controller_of(way)
            if controller >= 0:
                self.node_controllers[self._node[num + way.lane]] = controller

    def _find_zippers(self) -> None:
        """Find the nodes in which two lanes join without a right of way: vehicles pass them in turn, in SUMO, too."""
        joined = set(self._conflicts.joins.lanes.ravel().tolist())
        num = len(self.roads)
        self._zippers = {self._node[num + way.lane] for way in self.connections if joined & {way.lane, *way.inside}}

    def _controller_of(self, way: Connection) -> int:
        """Return the controller of the first light on a way that has one with phases; -1 for none."""
        plan = self.plan
        lights = [int(plan.light_of_lane[lane]) for lane in way.inside if plan.light_of_lane[lane] >= 0]
        controllers = [int(plan.controller[plan.group[light]]) for light in lights]
        return next((each for each in controllers if each >= 0 and plan.num_phases[each] > 0), -1)

    def _form_edges(self) -> None:
        """Join lanes beside one another to edges."""
        num = len(self.roads)
        self.edge_of_lane = [-1] * num
        self.edges: list[Edge] = []
        for lane in self._outside():
            if self.edge_of_lane[lane] >= 0:
                continue
            row = [lane]
            while (beside := int(self.roads.right[row[0]])) >= 0 and beside not in row and not self._is_inside[beside]:
                row.insert(0, beside)
            while (beside := int(self.roads.left[row[-1]])) >= 0 and beside not in row and not self._is_inside[beside]:
                row.append(beside)
            for each in row:
                self.edge_of_lane[each] = len(self.edges)
            self.edges.append(Edge(f"e{len(self.edges)}", tuple(row), self._node[lane], self._node[num + lane]))

    # XML

    def _write_nodes(self) -> Iterator[str]:
        for number, (x, y) in enumerate(self.nodes.tolist()):
            controller = self.node_controllers[number]
            kind = f'type="{"zipper" if number in self._zippers else "priority"}"'
            if controller >= 0:
                kind = f'type="traffic_light" tl="c{controller}"'
            yield f'<node id="n{number}" x="{x:.3f}" y="{y:.3f}" {kind}/>'

    def _write_edges(self) -> Iterator[str]:
        roads = self.roads
        for edge in self.edges:
            limit = max(self._limit(lane) for lane in edge.lanes)
            yield (
                f'<edge id="{edge.name}" from="n{edge.start}" to="n{edge.end}" numLanes="{len(edge.lanes)}"'
                f' priority="{len(edge.lanes)}" speed="{limit:.3f}" length="{self.length_of(edge):.3f}"'
                f' shape="{self._middle(edge.lanes)}">'
            )
            for index, lane in enumerate(edge.lanes):
                yield (
                    f'  <lane index="{index}" speed="{self._limit(lane):.3f}" width="{roads.width[lane]:.2f}"'
                    f' shape="{_shape(self._line(lane))}"/>'
                )
            yield "</edge>"

    def _write_connections(self) -> Iterator[str]:
        for way in self.connections:
            inside = ""
            if way.inside:
                line = np.concatenate([self._line(lane) for lane in way.inside])
                inside = f' speed="{self._speed_inside(way):.3f}" shape="{_shape(line)}"'
            yield f"<connection {self._ends(way)}{inside}/>"

    def _write_lights(self) -> Iterator[str]:
        for controller in sorted({number for number in self.node_controllers if number >= 0}):
            ways = self._ways_of(controller)
            yield f'<tlLogic id="c{controller}" type="static" programID="0" offset="0">'
            for seconds, state in self.phases(controller):
                yield f'  <phase duration="{seconds:g}" state="{state}"/>'
            yield "</tlLogic>"
            for index, way in enumerate(ways):
                yield f'<connection {self._ends(way)} tl="c{controller}" linkIndex="{index}"/>'

    def phases(self, controller: int) -> list[tuple[float, str]]:
        """Return the intervals of a controller: length [s], and SUMO's letter for each of its connections.

        Args:
            controller: its row in the plan.
        """
        plan = self.plan
        ways = self._ways_of(controller)
        base, cycle = int(plan.base[controller]), int(plan.cycle[controller])
        first, last = plan.interval_start.searchsorted([base, base + cycle]).tolist()
        phases: list[tuple[float, str]] = []
        for interval in range(first, last):
            frames = int(plan.interval_end[interval] - plan.interval_start[interval])
            letters = [self._letter(way, controller, interval) for way in ways]
            greens = [way for way, letter in zip(ways, letters, strict=True) if letter == "G"]
            state = "".join(
                "g" if letter == "G" and self._gives_way(way, greens) else letter
                for way, letter in zip(ways, letters, strict=True)
            )
            if phases and phases[-1][1] == state:  # only lights for people have changed
                phases[-1] = (phases[-1][0] + frames * DT, state)
            else:
                phases.append((frames * DT, state))
        return phases

    def _ways_of(self, controller: int) -> list[Connection]:
        num = len(self.roads)
        return [way for way in self.connections if self.node_controllers[self._node[num + way.lane]] == controller]

    def _letter(self, way: Connection, controller: int, interval: int) -> str:
        """Return what a connection shows: green, yellow or red. One without a light is always green."""
        plan = self.plan
        lit = [lane for lane in way.inside if plan.light_of_lane[lane] >= 0]
        if not lit:
            return "G"
        group = plan.group[plan.light_of_lane[lit[0]]]
        if plan.controller[group] != controller:
            return "G"
        shown = int(plan.colours[interval, plan.column[group]])
        if shown <= 0 or shown & int(plan.pass_of_lane[lit[0]]):
            return "G"
        return "y" if shown & Lamp.YELLOW else "r"

    def _gives_way(self, way: Connection, greens: Sequence[Connection]) -> bool:
        """Return whether some straighter way that is green crosses this one."""
        rivals = self._conflicts.rivals
        crossed = {
            int(other) for lane in way.inside for other in rivals.other[rivals.first[lane] : rivals.first[lane + 1]]
        }
        turn = self._turn(way)
        return any(crossed & set(other.inside) and self._turn(other) + STRAIGHTER < turn for other in greens)

    def _turn(self, way: Connection) -> float:
        return abs(float(self.roads.turn[list(way.inside)].sum()))

    def _speed_inside(self, way: Connection) -> float:
        """Return the speed limit of a way through a junction, as netconvert would set it, but never above the map's."""
        length = float(self.roads.length[list(way.inside)].sum())
        in_turn = math.sqrt(TURN_ACCEL * length / max(self._turn(way), 1e-3))
        return min(in_turn, *(self._limit(lane) for lane in way.inside))

    def _ends(self, way: Connection) -> str:
        a, b = (self.edges[self.edge_of_lane[lane]] for lane in (way.lane, way.onward))
        return (
            f'from="{a.name}" to="{b.name}" fromLane="{a.lanes.index(way.lane)}" toLane="{b.lanes.index(way.onward)}"'
        )

    def _limit(self, lane: int) -> float:
        return float(self.roads.speed_limit[lane]) or DEFAULT_SPEED_LIMIT

    def _line(self, lane: int) -> FloatArray:
        return self.roads.points[self.roads.first[lane] : self.roads.first[lane + 1], :2]

    def _middle(self, lanes: Sequence[int]) -> str:
        """Return the mean of the lines of some lanes."""
        count = max(len(self._line(lane)) for lane in lanes)
        share = np.linspace(0.0, 1.0, count)
        lines = [self.roads.at(np.full(count, lane), share * self.roads.length[lane])[0][:, :2] for lane in lanes]
        return _shape(np.mean(lines, axis=0))


class _Groups:
    """Numbers that are joined to groups.

    Args:
        num: of the numbers.
    """

    def __init__(self, num: int) -> None:
        self._parent = list(range(num))

    def root(self, item: int) -> int:
        """Return the number that stands for the group of an item."""
        while self._parent[item] != item:
            self._parent[item] = self._parent[self._parent[item]]
            item = self._parent[item]
        return item

    def join(self, one: int, other: int) -> None:
        """Make one group of two."""
        self._parent[self.root(other)] = self.root(one)


def convert(roads: Roads, plan: SignalPlan | None = None) -> Network:
    """Return a map in SUMO's terms.

    Args:
        plan: their lights; None for none.
    """
    return Network(roads, plan)


def _find_inside(
    roads: Roads, plan: SignalPlan, conflicts: LaneConflicts
) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    """Return which lanes lie within junctions, (l,); a lane without any way to it or from it is never one."""
    num_before = np.bincount(roads.successor, minlength=len(roads))
    is_between = (num_before > 0) & (np.diff(roads.first_successor) > 0)
    is_special = np.isfinite(conflicts.wait_point) | (conflicts.shared > 0.0) | (plan.light_of_lane >= 0)
    return np.asarray(is_special & is_between & (roads.length < LONGEST_INSIDE))


def _shape(line: FloatArray) -> str:
    return " ".join(f"{x:.3f},{y:.3f}" for x, y in line.tolist())


def _document(name: str, lines: Iterator[str]) -> str:
    return "\n".join([f"<{escape(name)}>", *lines, f"</{escape(name)}>", ""])
