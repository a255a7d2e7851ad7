"""The user's own plan for the traffic lights of a map (`--signal-plan FILE`), in place of its junctions' plans.

The file is JSON: for each junction its phases in turn, each with the lights that are green and its length.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Final

from msgspec import Meta

from rosbridge_sim.documents.document_model import Document, DocumentType, number_within, text_within
from rosbridge_sim.documents.document_reading import read_document
from rosbridge_sim.errors import DocumentError
from rosbridge_sim.maps.road_map import RoadMap
from rosbridge_sim.records import replace
from rosbridge_sim.suggestions import hint, listing
from rosbridge_sim.world.roads.signal_plan import GREENS, Controller, Lamp, Phase, SignalPlan
from rosbridge_sim.world.state.world import in_frames

MAX_PLAN_BYTES: Final = 10_000_000

Name = Annotated[str, text_within(1_000)]


class _PhaseOfFile(Document, frozen=True, kw_only=True):
    green: Annotated[list[Name], Meta(max_length=1_000)] = []  # noqa: RUF012 - msgspec copies it
    seconds: Annotated[float, number_within(0.1, 3_600.0)]


class _JunctionOfFile(Document, frozen=True, kw_only=True):
    phases: Annotated[list[_PhaseOfFile], Meta(min_length=1, max_length=100)]
    yellow: Annotated[float, number_within(0.0, 60.0)] = 3.0
    all_red: Annotated[float, number_within(0.0, 60.0)] = 2.0


class _PlanFile(Document, frozen=True, kw_only=True):
    junctions: Annotated[dict[Name, _JunctionOfFile], Meta(max_length=10_000)]


PLAN_FILE: Final = DocumentType[_PlanFile](_PlanFile)


def set_signal_plan(road_map: RoadMap, content: bytes, source: str) -> RoadMap:
    """Return a map with the plan of a file; junctions that the file does not name keep theirs.

    Args:
        source: name of the file, for errors.

    Raises:
        DocumentError: one line: file, place in it, expected value, actual value.
    """
    document = read_document(PLAN_FILE, content, source, MAX_PLAN_BYTES)
    plan = road_map.plan
    rows = {one.name: row for row, one in enumerate(plan.controllers)}
    controllers = list(plan.controllers)
    for name, junction in document.junctions.items():
        where = f"{source}: junctions.{name}"
        if name not in rows:
            known = listing(rows) if rows else "none: the map has no traffic lights"
            raise DocumentError(f"{where}: expected a junction with lights, one of {known}{hint(name, rows)}")
        controllers[rows[name]] = _make_controller(plan, controllers[rows[name]], junction, where)
    made = plan.with_controllers(road_map.roads, controllers)
    note = f"{source} has the plan of {len(document.junctions):,} junctions"
    return replace(road_map, plan=made, notes=(*road_map.notes, note))


def _make_controller(plan: SignalPlan, one: Controller, junction: _JunctionOfFile, where: str) -> Controller:
    names = [[plan.lights[row].name for row in group] for group in one.groups]
    known = [name for group in names for name in group]
    phases = []
    for i, phase in enumerate(junction.phases):
        for name in phase.green:
            if name not in known:
                told = f"one of its lights ({listing(known)}), got {name[:60]!r}{hint(name, known)}"
                raise DocumentError(f"{where}.phases[{i}].green: expected {told}")
        colours = tuple(
            _colour(plan, group, bool(set(own) & set(phase.green)))
            for group, own in zip(one.groups, names, strict=True)
        )
        phases.append(Phase(max(1, in_frames(phase.seconds)), colours))
        if junction.all_red:
            phases.append(Phase(max(1, in_frames(junction.all_red)), (int(Lamp.RED),) * len(one.groups)))
    yellow = tuple(
        0 if all(plan.lights[row].is_pedestrian for row in group) else in_frames(junction.yellow)
        for group in one.groups
    )
    return Controller(one.name, one.number, one.groups, tuple(phases), yellow)


def _colour(plan: SignalPlan, group: Sequence[int], is_green: bool) -> int:  # noqa: FBT001 - one of two colours
    lamps = 0
    for row in group:
        lamps |= plan.lights[row].lamps
    return (lamps & GREENS or int(Lamp.GREEN)) if is_green else int(Lamp.RED)
