"""Traffic lights of an MGeo map: lights, groups, controllers and schedules -> the world's signal plan.

There are five kinds of documents, with more than five file names. A name does not always tell the kind: some maps have
the schedule in `synced_traffic_light_set.json`. So the kind is found from the entries of each file. A reference to
something that the map lacks is ignored with a note, because a map with half its lights is better than none.

Schedules use seconds; the world uses frames.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import reduce
from operator import or_
from typing import Annotated, Any, Final, TypeVar

from msgspec import Meta

from rosbridge_sim.documents.document_model import (
    Coordinate,
    Document,
    DocumentType,
    Number,
    Whole,
    number_within,
)
from rosbridge_sim.documents.document_reading import read_document
from rosbridge_sim.loose_types import JsonValue
from rosbridge_sim.maps.mgeo_links import MAX_LINKS, MAX_MAP_BYTES, Identifier, Lanes, read_line
from rosbridge_sim.maps.road_map import Crosswalk
from rosbridge_sim.world.geometry.planar import FloatArray
from rosbridge_sim.world.roads.signal_plan import Controller, Lamp, Light, Phase, SignalPlan, Walk
from rosbridge_sim.world.state.world import in_frames

T = TypeVar("T")

LIGHT_FILES: Final = (
    "traffic_light_set.json",
    "synced_traffic_light_set.json",
    "intersection_controller_set.json",
    "intersection_controller_state.json",
    "intersection_controller_data.json",
    "synced_traffic_light_state.json",
)
"""Files with lights; all are optional. If several files hold one kind of entry, the first one that is not empty is
used."""

CROSSWALK_FILES: Final = ("singlecrosswalk_set.json", "crosswalk_set.json")

DEFAULT_YELLOW: Final = 3.0
"""Duration of yellow for a group whose schedule gives none [s]."""

LEFT_TURN: Final = math.radians(40.0)
"""Smallest turn of a lane that is a left or right turn, if the map names no movement [rad]."""

Seconds = Annotated[float, number_within(0.0, 100_000.0)]
Names = Annotated[list[Identifier], Meta(max_length=MAX_LINKS)]
Point = tuple[Coordinate, Coordinate, Coordinate]


class _Light(Document, frozen=True, kw_only=True):
    idx: Identifier
    link_id_list: Names | None = None
    type: Identifier | None = None
    sub_type: Names | Identifier | None = None
    point: Point | None = None
    heading: Number | None = None


class _Synced(Document, frozen=True, kw_only=True):
    idx: Identifier
    signal_id_list: Names
    intersection_controller_id: Identifier | None = None


class _Controller(Document, frozen=True, kw_only=True):
    idx: Identifier
    TL: Annotated[list[Names], Meta(max_length=1_000)]


class _Phase(Document, frozen=True, kw_only=True):
    """A phase. Colours are in the order of a controller's groups, or named by group (`groups`)."""

    duration: Seconds
    lightcolor: Names
    groups: Names = []  # noqa: RUF012 - msgspec copies it

    @classmethod
    def prepare(cls, value: JsonValue) -> JsonValue:
        """Part colours that are named by group into both lists."""
        colours = value.get("lightcolor") if isinstance(value, dict) else None
        if not isinstance(colours, dict):
            return {**value, "groups": []} if isinstance(value, dict) else value
        return {**value, "lightcolor": list(colours.values()), "groups": list(colours)}


class _Schedule(Document, frozen=True, kw_only=True):
    idx: Identifier
    TLState: Annotated[list[_Phase], Meta(max_length=1_000)]
    yelloduration: Annotated[list[Seconds], Meta(max_length=1_000)] | None = None
    PSState: Annotated[list[tuple[Whole, Identifier, Seconds, Seconds, Seconds]], Meta(max_length=1_000)] | None = None


class _Crosswalk(Document, frozen=True, kw_only=True):
    idx: Identifier
    single_crosswalk_list: Names | None = None
    ref_traffic_light_list: Names | None = None


class _Stripe(Document, frozen=True, kw_only=True):
    idx: Identifier
    points: list[tuple[Number, Number, Number]]
    ref_crosswalk_id: Identifier | None = None


_LIGHTS: Final = DocumentType[list[_Light]](Annotated[list[_Light], Meta(max_length=MAX_LINKS)])
_SYNCED: Final = DocumentType[list[_Synced]](Annotated[list[_Synced], Meta(max_length=MAX_LINKS)])
_CONTROLLERS: Final = DocumentType[list[_Controller]](Annotated[list[_Controller], Meta(max_length=MAX_LINKS)])
_SCHEDULES: Final = DocumentType[list[_Schedule]](Annotated[list[_Schedule], Meta(max_length=MAX_LINKS)])
_CROSSWALKS: Final = DocumentType[list[_Crosswalk]](Annotated[list[_Crosswalk], Meta(max_length=MAX_LINKS)])
_STRIPES: Final = DocumentType[list[_Stripe]](Annotated[list[_Stripe], Meta(max_length=MAX_LINKS)])
LIGHT_KINDS: Final[dict[str, DocumentType[Any]]] = {
    "lights": _LIGHTS,
    "synced": _SYNCED,
    "controllers": _CONTROLLERS,
    "schedules": _SCHEDULES,
    "stripes": _STRIPES,
    "crosswalks": _CROSSWALKS,
}
"""Form of each kind of file with lights or crosswalks."""


# Colours and types

_WORDS: Final[dict[int, tuple[str, str]]] = {
    Lamp.RED: ("r red", "red"),
    Lamp.YELLOW: ("y yellow", "yellow"),
    Lamp.GREEN: ("g sg green", "straight green"),  # SG: straight green
    Lamp.LEFT: ("gleft lg left", "left"),
    Lamp.RIGHT: ("gright rg", "right"),
    Lamp.U_TURN: ("guturn ug uturn", "uturn"),
    Lamp.UP_LEFT: ("gupleft", "upperleft"),
    Lamp.UP_RIGHT: ("gupright", "upperright"),
    Lamp.DOWN_LEFT: ("gdownleft", "lowerleft"),
    Lamp.DOWN_RIGHT: ("gdownright", "lowerright"),
}
"""Words for each lamp: those of colours in schedules, and those of sub-types of lights."""

_COLOURS, _SUB_TYPES = ({word: lamp for lamp, each in _WORDS.items() for word in each[i].split()} for i in (0, 1))
_COLOURS.update(dict.fromkeys(("", "none", "off"), 0))


def colour_of(name: str) -> int | None:
    """Return the sum of lamps for a colour of a schedule.

    Args:
        name: `R`, `SG`, `R_with_GLeft` and the like, or the sum as a number.

    Returns:
        The sum of `Lamp`; None for an unknown name.
    """
    text = name.strip().casefold()
    known = sum(int(lamp) for lamp in Lamp)
    if text.isdecimal():
        return int(text) if len(text) <= 4 and not int(text) & ~known else None  # noqa: PLR2004  # 4095 at most
    lamps = [_COLOURS.get(part, -1) for part in text.split("_with_")]
    return None if -1 in lamps else reduce(or_, lamps)


def light_type(light: Light) -> int:
    """Return the `trafficLightType` on the wire.

    Returns:
        0 red, yellow, green; 1 a left arrow instead of green; 2 both; 100 only yellow.
    """
    if light.is_warning:
        return 100
    if not light.lamps & Lamp.LEFT:
        return 0
    return 2 if light.lamps & Lamp.GREEN else 1


def _lamps(light: _Light) -> int:
    """Return the lamps of a light; red, yellow and green if the map does not name them."""
    words = light.sub_type if isinstance(light.sub_type, list) else re.split(r"[,_\s]+", light.sub_type or "")
    lamps = reduce(or_, (_SUB_TYPES.get(re.sub(r"[^a-z]", "", word.casefold()), 0) for word in words), 0)
    return int(lamps or Lamp.RED | Lamp.YELLOW | Lamp.GREEN)


# Files


def read_lights(files: Mapping[str, tuple[bytes, str]], lanes: Lanes, notes: list[str]) -> SignalPlan:
    """Read the lights of a map.

    Args:
        files: content and name for errors, by kind; all are optional.
        notes: gets a line for each ignored entry.

    Raises:
        DocumentError: one line: file, place in it, expected value, actual value.
    """
    entries = _entries(_LIGHTS, files, "lights")
    rows: dict[str, int] = {}
    lights: list[Light] = []
    for entry in entries:
        if entry.idx in rows:
            notes.append(f"traffic light {entry.idx!r} is listed twice; the first one is used")
            continue
        rows[entry.idx] = len(lights)
        lights.append(_light(entry, lanes))
    synced = _entries(_SYNCED, files, "synced")
    groups = [_known(entry.signal_id_list, rows) for entry in synced]
    plans = _entries(_CONTROLLERS, files, "controllers")
    first_note = len(notes)
    named = [(plan.idx, [_known(names, rows) for names in plan.TL]) for plan in plans]
    controllers = named or list(_controllers_of(synced, groups))
    by_name = {schedule.idx: schedule for schedule in _entries(_SCHEDULES, files, "schedules")}
    synced_rows = {entry.idx: group for entry, group in zip(synced, groups, strict=True)}
    laid = [_controller(name, members, by_name.pop(name, None), synced_rows, notes) for name, members in controllers]
    for schedule in by_name.values():
        found = _run_by_group(schedule, synced)
        what = f"schedule {schedule.idx!r}: the map has no such intersection controller"
        if found is None:
            notes.append(f"{what} and no group of lights that the schedule names; it runs nothing")
            continue
        names, schedule = found  # noqa: PLW2901 - with its colours in the groups' order
        notes.append(f"{what}; it runs the groups that it names, {', '.join(names)}")
        laid.append(_controller(schedule.idx, [synced_rows[name] for name in names], schedule, synced_rows, notes))
    if lights and not plans and "controllers" in files:
        what = "no group and schedule runs a light instead"
        if any(controller.phases for controller in laid):
            what = "lights are run by their groups and schedules"
        notes.insert(first_note, f"the set of intersection controllers is empty; {what}")
    return SignalPlan(lanes.roads, lights, laid, together=groups, passes=list(_passes(lanes)))


def _entries(kind: DocumentType[list[T]], files: Mapping[str, tuple[bytes, str]], key: str) -> list[T]:
    return read_document(kind, *files[key], MAX_MAP_BYTES) if key in files else []


def sort_files(files: Mapping[str, tuple[bytes, str]]) -> dict[str, tuple[bytes, str]]:
    """Find the files of `lights`, `synced` groups, `controllers` and `schedules`, by a key that only such entries have.

    Args:
        files: content and name for errors, by file name.

    Returns:
        Content and name for errors, by kind.
    """
    found: dict[str, tuple[bytes, str]] = {}
    for name in LIGHT_FILES:
        if name not in files:
            continue
        content = files[name][0]
        # A file without entries gets its kind from its name; it must still be JSON.
        kind = next((kind for key, kind in _MARKS if key in content), _BY_NAME.get(name, "schedules"))
        if kind not in found or found[kind][0].strip() == b"[]":
            found[kind] = files[name]
    return found


_MARKS: Final = (
    (b'"TLState"', "schedules"),
    (b'"TL"', "controllers"),
    (b'"signal_id_list"', "synced"),
    (b'"sub_type"', "lights"),
)
_BY_NAME: Final = {
    "traffic_light_set.json": "lights",
    "synced_traffic_light_set.json": "synced",
    "intersection_controller_set.json": "controllers",
}


def _light(entry: _Light, lanes: Lanes) -> Light:
    served = []
    for name in entry.link_id_list or ():
        try:
            served.append(lanes.roads.row(name))
        except KeyError:
            continue  # a lane-change link, or a link that was cut out of the map
    x, y, z = entry.point or (0.0, 0.0, 0.0)
    is_pedestrian = (entry.type or "").strip().casefold() == "pedestrian"
    yaw = math.radians(math.remainder(entry.heading or 0.0, 360.0))
    return Light(entry.idx, _lamps(entry), is_pedestrian, tuple(served), x, y, z, yaw)


def _known(names: Iterable[str], rows: Mapping[str, int]) -> tuple[int, ...]:
    return tuple(rows[name] for name in names if name in rows)


def _controllers_of(
    synced: Sequence[_Synced], groups: Sequence[tuple[int, ...]]
) -> Iterator[tuple[str, list[tuple[int, ...]]]]:
    """Yield controllers made from the synced groups, for maps without controllers; groups in the file's order."""
    of: dict[str, list[tuple[int, ...]]] = {}
    for entry, group in zip(synced, groups, strict=True):
        if entry.intersection_controller_id:
            of.setdefault(entry.intersection_controller_id, []).append(group)
    yield from of.items()


def _run_by_group(schedule: _Schedule, synced: Sequence[_Synced]) -> tuple[list[str], _Schedule] | None:
    """Return the groups that a schedule without a controller runs, and the schedule with its colours in their order.

    Some maps have an empty set of controllers. Their groups are found, in this order of trust: by the controller that a
    group names; by the group names beside the colours; by the schedule's own name, if it is a group's; by the group
    names in `PSState`, if there are as many as colours, in the order of the set. Otherwise the result is None.
    """
    known = [entry.idx for entry in synced]
    own = [entry.idx for entry in synced if entry.intersection_controller_id == schedule.idx]
    beside = list(dict.fromkeys(name for state in schedule.TLState for name in state.groups if name in known))
    if own and not beside:
        return own, schedule
    if beside:
        phases = []
        for state in schedule.TLState:
            colours = dict(zip(state.groups, state.lightcolor, strict=False))
            phases.append(state.changed(lightcolor=[colours.get(name, "red") for name in beside]))
        return beside, schedule.changed(TLState=phases)
    if schedule.idx in known:
        return [schedule.idx], schedule
    walked = {target for _, target, *_ in schedule.PSState or ()}
    named = [name for name in known if name in walked]
    num_colours = max((len(state.lightcolor) for state in schedule.TLState), default=0)
    return (named, schedule) if named and len(named) == num_colours else None


def _controller(
    name: str,
    groups: Sequence[tuple[int, ...]],
    schedule: _Schedule | None,
    synced: Mapping[str, tuple[int, ...]],
    notes: list[str],
) -> Controller:
    number = re.search(r"\d+$", name)
    plain = Controller(name, int(number[0]) % 2**31 if number else 0, tuple(groups))
    if schedule is None or not schedule.TLState:
        notes.append(f"intersection controller {name!r} has no schedule; its lights are not lit")
        return plain
    phases = []
    for i, state in enumerate(schedule.TLState):
        colours = [colour_of(colour) for colour in state.lightcolor[: len(groups)]]
        where = f"schedule {name!r}, phase {i}"
        for colour, text in zip(colours, state.lightcolor, strict=False):
            if colour is None:
                notes.append(f"{where}: {text[:40]!r} is no colour that is known; it is read as red")
        if len(colours) < len(groups):
            notes.append(f"{where}: {len(colours)} colours for {len(groups)} groups; the others are red")
        lit = [int(Lamp.RED) if colour is None else colour for colour in colours]
        lit += [int(Lamp.RED)] * (len(groups) - len(lit))
        phases.append(Phase(max(1, in_frames(state.duration)), tuple(lit)))
    given = [in_frames(seconds) for seconds in (schedule.yelloduration or ())[: len(groups)]]
    yellow = given + [in_frames(DEFAULT_YELLOW)] * (len(groups) - len(given))
    walks = []
    for phase, target, *times in schedule.PSState or ():
        group = _group_number(target, groups, synced)
        if group is None or not 0 <= phase < len(phases):
            notes.append(f"schedule {name!r}: PSState of phase {phase} and group {target!r}, which are not there")
            continue
        walks.append(Walk(phase, group, *map(in_frames, times)))
    return Controller(plain.name, plain.number, plain.groups, tuple(phases), tuple(yellow), tuple(walks))


def _group_number(target: str, groups: Sequence[tuple[int, ...]], synced: Mapping[str, tuple[int, ...]]) -> int | None:
    """Return the index of a controller's group from a number or from the name of a synced group."""
    number = re.fullmatch(r"(\d{1,4})(\.0*)?", target)
    if number:
        return int(number[1]) if int(number[1]) < len(groups) else None
    lights = set(synced.get(target, ()))
    return next((i for i, group in enumerate(groups) if lights & set(group)), None)


def _passes(lanes: Lanes) -> Iterator[int]:
    """Yield for each lane the lamps of its light that allow to enter it.

    A left turn needs the arrow, unless the map says that it is not protected.
    """
    for signal, turn in zip(lanes.related_signal, lanes.roads.turn.tolist(), strict=True):
        movement = signal or ("left" if turn > LEFT_TURN else "right" if turn < -LEFT_TURN else "straight")
        if movement.startswith("left"):
            yield Lamp.LEFT | (Lamp.GREEN if movement != "left" else 0)
        elif movement.startswith("right"):
            yield Lamp.RIGHT | Lamp.GREEN
        elif movement.startswith("uturn"):
            yield Lamp.U_TURN | Lamp.LEFT
        else:
            yield Lamp.GREEN | Lamp.UP_LEFT | Lamp.UP_RIGHT


# Crosswalks


def read_crosswalks(files: Mapping[str, tuple[bytes, str]], plan: SignalPlan) -> tuple[Crosswalk, ...]:
    """Read the crosswalks of a map.

    Args:
        files: content and name for errors, by kind; `stripes` and `crosswalks` are optional.

    Returns:
        The crosswalks, in the order of the file.

    Raises:
        DocumentError: one line: file, place in it, expected value, actual value.
    """
    stripes = _entries(_STRIPES, files, "stripes")
    outlines: dict[str, FloatArray] = {}
    for i, stripe in enumerate(stripes):
        if len(stripe.points) > 2:  # noqa: PLR2004  # an area has three corners
            outlines[stripe.idx] = read_line(stripe.points, f"{files['stripes'][1]}: [{i}].points")
    entries = _entries(_CROSSWALKS, files, "crosswalks")
    rows = {light.name: row for row, light in enumerate(plan.lights)}
    crosswalks = []
    taken: set[str] = set()
    for entry in entries:
        own = [stripe.idx for stripe in stripes if stripe.ref_crosswalk_id == entry.idx]
        parts = [name for name in dict.fromkeys([*(entry.single_crosswalk_list or ()), *own]) if name in outlines]
        taken.update(parts)
        lights = _known(entry.ref_traffic_light_list or (), rows)
        if parts:
            crosswalks.append(Crosswalk(entry.idx, tuple(outlines[name] for name in parts), lights))
    crosswalks += [Crosswalk(name, (outline,)) for name, outline in outlines.items() if name not in taken]
    return tuple(crosswalks)
