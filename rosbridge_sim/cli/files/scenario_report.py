"""`scenario check`: checks of scenario files, and the contents of one: its items, and the keys that are used.

A *mistake* makes loading fail. A *remark* is about a value that loads but is probably not intended, or that is read in
another way than it is written. A file without either is *good*. A *note* tells of keys of ours, which MORAI ignores.
"""

from __future__ import annotations

import math
import textwrap
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from rosbridge_sim.cli.files.verdicts import CheckReport, draw, put_lines, put_verdict, put_verdicts, put_whole
from rosbridge_sim.cli.tools.text import put, put_table
from rosbridge_sim.errors import DocumentError, SettingError
from rosbridge_sim.link.terminal_text import safe
from rosbridge_sim.loose_types import JsonValue
from rosbridge_sim.maps.map_check import UNREAD_FILES
from rosbridge_sim.maps.map_formats import MAP_FILES
from rosbridge_sim.maps.road_map import Projection, RoadMap
from rosbridge_sim.scenarios.catalogue import Catalogue, default_model
from rosbridge_sim.scenarios.openscenario.entities import place_entities
from rosbridge_sim.scenarios.openscenario.places import StoryMap
from rosbridge_sim.scenarios.openscenario.story import each_item
from rosbridge_sim.scenarios.openscenario.story_records import Findings
from rosbridge_sim.scenarios.openscenario.story_signals import make_signal_plan
from rosbridge_sim.scenarios.openscenario.storyboard import KINDS
from rosbridge_sim.scenarios.scenario import PhaseStart, Scenario, Spawn
from rosbridge_sim.scenarios.scenario_check import (
    Draft,
    find_misspelt_key,
    find_misspelt_keys,
    find_oddities,
    place_draft,
    read_draft,
)
from rosbridge_sim.scenarios.scenario_model import UNTIL_EVENT
from rosbridge_sim.scenarios.scenario_reader import sort_phases
from rosbridge_sim.shell.config.loading import read_world
from rosbridge_sim.shell.config.settings_file import looks_like_path
from rosbridge_sim.shell.files.library import DiskLibrary, open_library
from rosbridge_sim.shell.files.other_formats import LOOKED_AT, find_other_formats
from rosbridge_sim.shell.files.story_files import is_story
from rosbridge_sim.simulator.scene.scene import DEFAULT_MAP
from rosbridge_sim.units import MPS_TO_KMH
from rosbridge_sim.world.geometry.planar import arc_lengths
from rosbridge_sim.world.roads.roads import Roads
from rosbridge_sim.world.state.world import Kind

WIDTH: Final = 110
"""Width of lines with many keys, as in the help texts."""

_LISTS: Final = (
    *("egoVehicle", "vehicleList", "pedestrianList", "objectList", "waypointDataList", "tlList"),
    *("spawnPointList", "pedspawnPointList", "frictionChangeMaterialList", "shadedAreaList"),
)

_Report = dict[str, Any]  # a JSON object


def _open_library(words: Sequence[str]) -> tuple[DiskLibrary, str | None]:
    """Return the scenarios and maps of a server with these flags, and the map that replaces all others."""
    settings = read_world(words)
    library = open_library(settings)
    if settings.map is not None:
        library.map(settings.map)  # else its mistakes would be those of each file
    return library, settings.map


def check_scenarios(
    names: Sequence[str], picture: str | None, words: Sequence[str], *, is_json: bool, is_strict: bool
) -> int:
    """Explain a scenario, or print the results of checks of several.

    Args:
        names: files, folders of them, or names of scenarios as for clients and `serve --scenario`.
        picture: file for a picture; allowed for a single scenario.
        words: flags of `serve` about scenarios, maps and models.
        is_strict: remarks count like mistakes in the exit code.

    Returns:
        The exit code; see `put_verdicts`.

    Raises:
        DocumentError: there is no such file, a setting cannot be used, or the picture cannot be written.
    """
    library, own_map = _open_library(words)
    files = [file for name in names for file in _expand(name, library)]
    if files == list(names) and len(files) == 1:
        account, scenario, road_map = _account(*library.opening_file(files[0]), library, own_map)
        if scenario is not None and road_map is None:
            road_map = RoadMap(scenario.map_name or "", Projection(is_tm=False), (0.0, 0.0, 0.0), Roads())
        draw(picture, "file", None if scenario is None else road_map, () if scenario is None else _spawns(scenario))
        return put_whole(account, _show, is_json=is_json, is_strict=is_strict)
    if picture is not None:
        raise SettingError(f"--picture: expected a single scenario to draw, got {len(files):,}")

    def account_of(file: str) -> CheckReport:
        return _account(*library.opening_file(file), library, own_map)[0]

    return put_verdicts("scenario check", files, account_of, is_json=is_json, is_strict=is_strict)


def _expand(name: str, library: DiskLibrary) -> list[str]:
    """Return the scenario files in a folder and its subfolders; for another name, the name itself.

    MORAI has a subfolder for each map.

    Raises:
        DocumentError: the folder has no scenarios.
    """
    folder = Path(name)
    if not folder.is_dir() or (not looks_like_path(name) and library.has_scenario(name)):
        return [name]
    of_maps = {*MAP_FILES, *UNREAD_FILES}
    paths = sorted(path for pattern in ("*.json", "*/*.json", "*.xosc", "*/*.xosc") for path in folder.glob(pattern))
    found = [path for path in paths if path.name not in of_maps and not _is_catalogue(path)]
    if not found:
        other = find_other_formats(folder)
        aside = f"; {other}" if other else ""
        where = "(*.json or *.xosc, in it or in its subfolders)"
        raise DocumentError(f"{name}: expected a folder with scenarios {where}; there is none{aside}")
    return [str(path) for path in found]


def _is_catalogue(path: Path) -> bool:
    """Return whether a file of OpenSCENARIO has no story, by its beginning."""
    return path.suffix == ".xosc" and b"<Catalog " in path.read_bytes()[:LOOKED_AT]


# The report


def _account(
    text: bytes, source: str, library: DiskLibrary, own_map: str | None
) -> tuple[_Report, Scenario | None, RoadMap | None]:
    """Return the report, the scenario as far as it can be read, and its map if that is known."""
    if is_story(source, text):
        return _account_story(text, source, library, own_map)
    draft = read_draft(text, source, library.catalogue)
    mistakes, remarks = list(draft.mistakes), find_misspelt_keys(draft.keys)
    scenario = draft.scenario
    map_account: _Report = {"name": None, "is_known": False}
    road_map: RoadMap | None = None
    if scenario is not None:
        map_account, road_map = _find_map(scenario, library, own_map)
        if road_map is None:
            mistakes.append(f"mapInfo.mapName: {map_account['why']}. Roads, links and lights were not checked")
        else:
            scenario, more = place_draft(scenario, road_map)
            mistakes += more
        remarks += [*scenario.notes, *find_oddities(scenario, None if road_map is None else road_map.roads)]
    prefixes = (f"{source}: ", "" if scenario is None else f"{scenario.name}: ")
    account = {
        "file": source,
        "is_good": not mistakes and not remarks,
        "mistakes": [_without_prefix(line, prefixes) for line in mistakes],
        "remarks": remarks,
        "notes": list(_notes(draft)),
        "map": map_account,
        "holds": _count(draft.document),
        "items": [] if scenario is None else list(_items(scenario, draft.document, library.catalogue)),
        "phases": [
            {"intersection": start.controller, "phase": start.phase, "elapsed": start.elapsed}
            for start in (() if scenario is None else _phases(scenario, road_map))
        ],
        "read": draft.keys.read,
        "without_effect": draft.keys.idle,
        "passed_over": draft.keys.passed_over,
    }
    return account, scenario, road_map


def _account_story(
    text: bytes, source: str, library: DiskLibrary, own_map: str | None
) -> tuple[_Report, Scenario | None, RoadMap | None]:
    """Return the same for a file of OpenSCENARIO."""
    found: list[str] = []
    scenario, findings, road_map = None, Findings(), None
    map_account: _Report = {"name": None, "is_known": False}
    try:
        scenario, findings = library.examine_story(text, Path(source))
    except DocumentError as error:
        found.append(str(error))
    if scenario is not None:
        map_account, road_map = _find_map(scenario, library, own_map)
        if road_map is None:
            why = f"{map_account['why']}. Positions were not checked"
            found.append(f"the map: {why}")
        else:
            try:
                scenario = place_entities(scenario, StoryMap.of(road_map))
                if scenario.story is not None:
                    make_signal_plan(scenario.story.controllers, road_map)
            except DocumentError as error:
                found.append(str(error))
    story = None if scenario is None else scenario.story
    is_lenient = story is not None and story.text.is_lenient
    refused = [f"{line}; left out" for line in findings.refused] if is_lenient else []
    remarks = [*refused, *findings.notes, *findings.idle]
    mistakes = [*findings.mistakes, *([] if is_lenient else findings.refused), *found]
    kinds = Counter(item.kind for item in (() if story is None else each_item(story.storyboard)))
    account = {
        "file": source,
        "is_good": not mistakes and not remarks,
        "mistakes": mistakes,
        "remarks": remarks,
        "map": map_account,
        "holds": {kind: kinds[kind] for kind in (*KINDS[1:], "Condition") if kinds[kind]},
        "ego": "" if story is None else story.ego,
        "parameters": {} if story is None else dict(story.parameters),
        "items": [] if scenario is None else [_story_row(each) for each in _spawns(scenario)],
        "phases": [],
        "read": sorted(kinds),
        "without_effect": {},
        "passed_over": {},
    }
    return account, scenario, road_map


def _story_row(spawn: Spawn) -> _Report:
    way = "the ego" if spawn.kind is Kind.EGO else "by the story"
    return {**_placed_row(spawn, spawn.name), "model": spawn.model.name, "way": way}


def _placed_row(spawn: Spawn, at: str) -> _Report:
    """Return what is reported of each item."""
    body, is_placed = spawn.model.body, spawn.is_placed
    return {
        "at": at,
        "kind": spawn.kind.name.lower(),
        "model": spawn.name,
        "is_replaced": False,
        "is_scaled": False,
        "id": spawn.uid,
        **{axis: getattr(spawn, axis) if is_placed else None for axis in "xyz"},
        "heading_deg": math.degrees(spawn.yaw) if is_placed else None,
        "roll_deg": math.degrees(spawn.roll),
        "pitch_deg": math.degrees(spawn.pitch),
        "size": [body.length, body.width, body.height],
        "link": spawn.link,
        "speed_kmh": spawn.speed * MPS_TO_KMH,
    }


def _spawns(scenario: Scenario) -> tuple[Spawn, ...]:
    return (*scenario.egos, *scenario.vehicles, *scenario.pedestrians, *scenario.obstacles)


def _phases(scenario: Scenario, road_map: RoadMap | None) -> Sequence[PhaseStart]:
    """Return the first phases of intersections, by the controllers' ids if the map is known."""
    return scenario.phases if road_map is None else sort_phases(scenario, road_map.plan)[0]


def _notes(draft: Draft) -> Iterator[str]:
    """Yield a line about the blocks `rosbridge_sim` of a document, if it has some."""
    num = sum(count for key, count in draft.keys.read.items() if key.endswith("rosbridge_sim"))
    story = None if draft.scenario is None else draft.scenario.story
    events = sum(item.kind == "Event" for item in (() if story is None else each_item(story.storyboard)))
    if num:
        yield f"rosbridge_sim: blocks: {num:,}, triggers: {events:,}; MORAI SIM ignores this key"


def _without_prefix(line: str, prefixes: Sequence[str]) -> str:
    return next((line.removeprefix(prefix) for prefix in prefixes if prefix and line.startswith(prefix)), line)


def _find_map(scenario: Scenario, library: DiskLibrary, own_map: str | None) -> tuple[_Report, RoadMap | None]:
    """Return the report on the map, and the map itself if there is one to check on."""
    asked = scenario.map_name
    account: _Report = {"name": asked, "is_known": True, "checked_on": own_map or asked or DEFAULT_MAP}
    try:
        road_map = library.map(asked or DEFAULT_MAP)
    except DocumentError as error:
        return {"name": asked, "is_known": False, "checked_on": None, "why": str(error)}, None
    return {
        **account,
        "lanes": len(road_map.roads),
        "lights": len(road_map.plan.lights),
    }, road_map


def _count(document: object) -> dict[str, int]:
    """Count the entries of each part that the file has."""
    if not isinstance(document, dict):
        return {}
    parts = {key: document.get(key) for key in _LISTS}
    return {key: len(part) if isinstance(part, list) else 1 for key, part in parts.items() if part is not None}


def _items(scenario: Scenario, document: JsonValue, catalogue: Catalogue) -> Iterator[_Report]:
    for spawn in _spawns(scenario):
        key, _, number = spawn.where.rstrip("]").partition("[")
        item = document[key][int(number)] if number else document[key]
        data_id = item.get("DataID")
        yield {
            **_placed_row(spawn, spawn.where),
            "data_id": data_id,
            "is_replaced": _is_replaced(item, spawn.kind, catalogue),
            "is_scaled": spawn.model.body != (catalogue.find(spawn.name) or default_model(spawn.kind)).body,
            "way": _way(spawn),
            "starts_within": spawn.start_within or None,
            "without_effect": list(spawn.kept),
        }


def _is_replaced(item: Mapping[str, Any], kind: Kind, catalogue: Catalogue) -> bool:
    """Return True if the model in the file is unknown, and only its class is known."""
    try:
        data_id = int(float(str(item.get("DataID")).replace(",", "")))
    except (ValueError, OverflowError):
        return False
    return not item.get("modelName") and catalogue.of_data_id(data_id, kind) is None


def _way(spawn: Spawn) -> str:
    """Describe the path of an item in a few words."""
    way = _way_once_it_goes(spawn)
    waits = spawn.start_within > 0.0 and (spawn.speed != 0.0 or spawn.driver is not None)
    if not waits:
        return way
    until = "it is triggered" if spawn.start_within <= UNTIL_EVENT else f"an ego is within {spawn.start_within:g} m"
    return f"{way}, when {until}"


def _way_once_it_goes(spawn: Spawn) -> str:
    driver = spawn.driver
    if spawn.kind is Kind.EGO:
        return f"driven from outside, in {spawn.gear.name.lower()}"
    if driver is not None:
        route = f"a route of {len(driver.links)} links" if driver.links else "random lanes"
        limit = (
            "at the speed limit"
            if math.isinf(driver.desired_speed)
            else f"at most {driver.desired_speed * MPS_TO_KMH:.0f} km/h"
        )
        return f"{route}{', repeated' if spawn.is_loop and driver.links else ''}, {limit}"
    if spawn.path is not None:
        length = float(arc_lengths(spawn.path)[-1])
        back = "" if not spawn.is_loop else ", repeated"
        return f"path of {len(spawn.path)} waypoints, {length:,.0f} m{back}"
    return "straight ahead" if spawn.speed else "stands"


# Output for people


def _show(account: _Report) -> None:
    put_verdict(account)
    put_lines("mistakes", account["mistakes"])
    put_lines("remarks", account["remarks"])
    put_lines("notes", account.get("notes", ()))
    put("")
    if account["map"]["is_known"]:
        put(f"map: {_map_line(account['map'])}")
    for key, count in account["holds"].items():
        put(f"{safe(key)}: {count:,}")
    if account.get("ego"):
        others = [item["at"] for item in account["items"] if item["at"] != account["ego"]]
        moved = f"; moved by the story, without a driver model: {', '.join(others)}" if others else ""
        put(safe(f"ego: {account['ego']}, driven by your program (by the file with --ego story){moved}"))
    if account["items"]:
        put("")
        put_table(_HEADER, [_row(item) for item in account["items"]])
    if account["phases"]:
        put("")
        rows = [(one["intersection"], str(one["phase"]), f"{one['elapsed']:g}") for one in account["phases"]]
        put_table(("INTERSECTION", "PHASE", "FOR [s]"), rows)
    read, passed_over = account["read"], account["passed_over"]
    is_inner = {key: any(other.startswith((f"{key}.", f"{key}[]")) for other in read) for key in read}
    show_keys("read", {key: key for key in read if not is_inner[key]})
    show_keys("known, but without effect", {key: f"{key} ({n:,})" for key, n in account["without_effect"].items()})
    show_keys("ignored", {key: f"{key} ({n:,}){_hint_at(key)}" for key, n in passed_over.items()})


def _hint_at(path: str) -> str:
    """Return a suggestion for an unknown key: the known key that was probably meant."""
    meant = find_misspelt_key(path)
    return f" (did you mean {meant}?)" if meant else ""


def show_keys(title: str, keys: Mapping[str, str]) -> None:
    """Print keys, grouped by the part of the document.

    Args:
        keys: path of each key -> text to print.
    """
    if not keys:
        return
    parts: dict[str, list[str]] = {}
    for key, text in keys.items():
        part, dot, _ = key.partition(".")
        parts.setdefault(part if dot else "", []).append(safe(text.removeprefix(part + dot if dot else "")))
    put(f"\n{title}:")
    for part, texts in parts.items():
        head = f"  {safe(part)}: " if part else "  "
        put(
            textwrap.fill(
                ", ".join(texts), WIDTH, initial_indent=head, subsequent_indent="    ", break_long_words=False
            )
        )


_HEADER: Final = ("ITEM", "MODEL", "ID", "X [m]", "Y [m]", "HEADING", "KM/H", "WAY")


def _row(item: _Report) -> tuple[str, ...]:
    where = [f"{item[key]:.2f}" for key in "xy"] if item["x"] is not None else ["link", str(item["link"])]
    heading = "" if item["heading_deg"] is None else f"{item['heading_deg']:.1f}"
    tilt = [f"{axis} {item[f'{axis}_deg']:.1f}" for axis in ("roll", "pitch") if round(item[f"{axis}_deg"], 1)]
    heading += f" ({', '.join(tilt)})" if tilt else ""
    model = f"{item['model']} (size by class)" if item["is_replaced"] else item["model"]
    model += f" ({' x '.join(f'{size:g}' for size in item['size'])} m)" if item["is_scaled"] else ""
    uid = "next" if item["id"] is None else str(item["id"])
    return (item["at"], model, uid, *where, heading, f"{item['speed_kmh']:g}", item["way"])


def _map_line(account: _Report) -> str:
    named = safe(account["name"]) if account["name"] else "none is named; the server's current map would be used"
    on = account["checked_on"]
    checked = "" if on == account["name"] else f"; checked on {safe(on)}"
    return f"{named}{checked} ({account['lanes']:,} lanes, {account['lights']:,} lights)"
