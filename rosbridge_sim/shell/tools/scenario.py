"""`scenario check`: what a scenario file holds, what of it is read, what is wrong with it and what looks odd."""

from __future__ import annotations

import math
import os
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.morai.catalogue import model_of_data_id
from rosbridge_sim.morai.convert import KMH
from rosbridge_sim.morai.maps.mgeo import Projection, RoadMap
from rosbridge_sim.morai.scenarios.scenario import Scenario, Spawn
from rosbridge_sim.morai.scenarios.scenario_check import find_oddities, keys_near, place_draft, read_draft
from rosbridge_sim.morai.stage import DEFAULT_MAP
from rosbridge_sim.shell.sources import PREFIX, hint, read_settings
from rosbridge_sim.shell.storage import DiskLibrary
from rosbridge_sim.shell.tools.text import put, put_json, put_table, safe
from rosbridge_sim.world.geometry import arc_lengths
from rosbridge_sim.world.roads import Roads
from rosbridge_sim.world.state import Kind

__all__ = ["check_scenario", "hint_at", "open_library", "show_keys"]

_VARIABLES: Final = frozenset(PREFIX + name for name in ("CONFIG", "MAP", "SCENARIO_PATH"))
"""What of the environment has to do with scenarios and maps; a mistake in the rest is none of ours."""

SURE: Final = 0.9
"""A key that is so like one that is read is a slip of the pen; MORAI's own keys are less alike."""

WIDTH: Final = 110
"""Of lines that hold many keys, as of our help."""

_LISTS: Final = ("egoVehicle", "vehicleList", "pedestrianList", "objectList", "waypointDataList", "tlList")

_Account = dict[str, Any]  # a JSON object


def open_library(own_map: str | None, folders: Sequence[str]) -> tuple[DiskLibrary, str | None]:
    """The scenarios and maps that a server started with these settings would find, and the map that stands for all.

    Raises:
        DocumentError: a setting or a folder that cannot be used.
    """
    flags = [f"--scenario-path={folder}" for folder in folders] + ([] if own_map is None else [f"--map={own_map}"])
    settings = read_settings(flags, {name: value for name, value in os.environ.items() if name in _VARIABLES})
    return DiskLibrary(settings.scenario_path, settings.map), settings.map


def check_scenario(
    name: str, own_map: str | None, folders: Sequence[str], picture: str | None, *, is_json: bool
) -> int:
    """Explain a scenario; the exit code is 1 if the file has mistakes.

    Args:
        name: a file, or the name of a scenario as clients and `serve --scenario` give it.
        own_map: name or folder of the map to check it on, in place of its own.
        folders: where scenarios are found by name.
        picture: where a picture of it on its map goes.
        is_json: for a program.

    Raises:
        DocumentError: no such file, a map that was named here cannot be used, or the picture cannot be written.
    """
    library, own_map = open_library(own_map, folders)
    text, source = library.opening_file(name)
    account, scenario, road_map = _account(text, source, library, own_map)
    if picture is not None and scenario is not None:
        from rosbridge_sim.shell.tools.map_picture import draw_map  # noqa: PLC0415 - with Pillow, for this alone

        ground = road_map or RoadMap(scenario.map_name or "", Projection(is_tm=False), (0.0, 0.0, 0.0), Roads())
        everybody = (*scenario.egos, *scenario.vehicles, *scenario.pedestrians, *scenario.obstacles)
        draw_map(ground, Path(picture), everybody)
    if is_json:
        put_json(account)
    else:
        _show(account)
    return 0 if account["is_good"] else 1


# The account


def _account(
    text: bytes, source: str, library: DiskLibrary, own_map: str | None
) -> tuple[_Account, Scenario | None, RoadMap | None]:
    """The account; and the scenario as far as it can be read, on its map if that is known."""
    draft = read_draft(text, source)
    mistakes, notes = list(draft.mistakes), []
    scenario = draft.scenario
    map_account: _Account = {"name": None, "is_known": False}
    road_map: RoadMap | None = None
    if scenario is not None:
        map_account, road_map = _find_map(scenario, library, own_map)
        if road_map is not None:
            scenario, more = place_draft(scenario, road_map)
            mistakes += more
        notes = [*scenario.notes, *find_oddities(scenario, None if road_map is None else road_map.roads)]
    prefixes = (f"{source}: ", "" if scenario is None else f"{scenario.name}: ")
    account = {
        "file": source,
        "is_good": not mistakes,
        "mistakes": [_without_prefix(line, prefixes) for line in mistakes],
        "notes": notes,
        "map": map_account,
        "holds": _count(draft.document),
        "items": [] if scenario is None else list(_items(scenario, draft.document)),
        "phases": [
            {"intersection": start.controller, "phase": start.phase, "elapsed": start.elapsed}
            for start in (scenario.phases if scenario is not None else ())
        ],
        "read": draft.read,
        "passed_over": draft.passed_over,
    }
    return account, scenario, road_map


def _without_prefix(line: str, prefixes: Sequence[str]) -> str:
    return next((line.removeprefix(prefix) for prefix in prefixes if prefix and line.startswith(prefix)), line)


def _find_map(scenario: Scenario, library: DiskLibrary, own_map: str | None) -> tuple[_Account, RoadMap | None]:
    """What there is to say about the map, and the map if there is one to check on."""
    asked = scenario.map_name
    account: _Account = {"name": asked, "is_known": True, "checked_on": own_map or asked or DEFAULT_MAP}
    try:
        road_map = library.map(asked or DEFAULT_MAP)
    except DocumentError as error:
        if own_map is not None:
            raise  # it was named on the command line
        why = str(error)
        return {"name": asked, "is_known": False, "checked_on": None, "why": why, "served_by": DEFAULT_MAP}, None
    return {
        **account,
        "lanes": len(road_map.roads),
        "lights": len(road_map.plan.lights) if road_map.plan else 0,
    }, road_map


def _count(document: object) -> dict[str, int]:
    """How many entries each part has that is there."""
    if not isinstance(document, dict):
        return {}
    parts = {key: document.get(key) for key in _LISTS}
    return {key: len(part) if isinstance(part, list) else 1 for key, part in parts.items() if part is not None}


def _items(scenario: Scenario, document: Any) -> Iterator[_Account]:  # noqa: ANN401 - a JSON value
    for spawn in (*scenario.egos, *scenario.vehicles, *scenario.pedestrians, *scenario.obstacles):
        key, _, number = spawn.where.rstrip("]").partition("[")
        item = document[key][int(number)] if number else document[key]
        data_id = item.get("DataID")
        yield {
            "at": spawn.where,
            "kind": spawn.kind.name.lower(),
            "model": spawn.name,
            "data_id": data_id,
            "is_replaced": _is_replaced(item, spawn.kind),
            "id": spawn.uid,
            "x": spawn.x if spawn.is_placed else None,
            "y": spawn.y if spawn.is_placed else None,
            "z": spawn.z if spawn.is_placed else None,
            "heading_deg": math.degrees(spawn.yaw) if spawn.is_placed else None,
            "link": spawn.link,
            "speed_kmh": spawn.speed * KMH,
            "way": _way(spawn),
        }


def _is_replaced(item: Mapping[str, Any], kind: Kind) -> bool:
    """Whether another model stands in for the one that the file means."""
    try:
        data_id = int(float(str(item.get("DataID")).replace(",", "")))
    except (ValueError, OverflowError):
        return False
    return not item.get("modelName") and model_of_data_id(data_id, kind) is None


def _way(spawn: Spawn) -> str:
    """Where it goes, in a few words."""
    driver = spawn.driver
    if spawn.kind is Kind.EGO:
        return f"driven from outside, in {spawn.gear.name.lower()}"
    if driver is not None:
        route = f"a route of {len(driver.links)} links" if driver.links else "lanes by chance"
        limit = "as is allowed" if math.isinf(driver.wish) else f"at most {driver.wish * KMH:.0f} km/h"
        return f"{route}{', round and round' if spawn.is_loop and driver.links else ''}, {limit}"
    if spawn.path is not None:
        length = float(arc_lengths(spawn.path)[-1])
        back = "" if not spawn.is_loop else ", round and round"
        return f"path of {len(spawn.path)} waypoints, {length:,.0f} m{back}"
    return "straight ahead" if spawn.speed else "stands"


# For a person


def _show(account: _Account) -> None:
    mistakes, notes = account["mistakes"], account["notes"]
    verdict = _plural(len(mistakes), "mistake") if mistakes else "good"
    put(f"{safe(account['file'])}: {verdict}{', ' + _plural(len(notes), 'note') if notes else ''}")
    if account["items"]:
        put(f"  map: {_map_line(account['map'])}")
    for key, count in account["holds"].items():
        put(f"  {key}: {count:,}")
    _show_lines("mistakes", mistakes)
    _show_lines("notes", notes)
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
    show_keys("passed over", {key: f"{key} ({n:,}){hint_at(key, keys_near(key))}" for key, n in passed_over.items()})


def _plural(num: int, what: str) -> str:
    return f"{num:,} {what}{'' if num == 1 else 's'}"


def hint_at(path: str, known: Sequence[str]) -> str:
    """The key that somebody may have meant by one that nobody reads."""
    return hint(path.rpartition(".")[2].removesuffix("[]"), known, SURE)


def show_keys(title: str, keys: Mapping[str, str]) -> None:
    """Keys by their path and as they are to be shown, those of one part of a document together."""
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


def _row(item: _Account) -> tuple[str, ...]:
    where = [f"{item[key]:.2f}" for key in "xy"] if item["x"] is not None else ["link", str(item["link"])]
    heading = "" if item["heading_deg"] is None else f"{item['heading_deg']:.1f}"
    model = f"{item['model']} (for {item['data_id']})" if item["is_replaced"] else item["model"]
    uid = "next" if item["id"] is None else str(item["id"])
    return (item["at"], model, uid, *where, heading, f"{item['speed_kmh']:g}", item["way"])


def _map_line(account: _Account) -> str:
    if account["is_known"]:
        named = safe(account["name"]) if account["name"] else "none is named; it would come onto the one in use"
        on = account["checked_on"]
        checked = "" if on == account["name"] else f"; checked on {safe(on)}"
        return f"{named}{checked} ({account['lanes']:,} lanes, {account['lights']:,} lights)"
    return (
        f"{safe(account['why'])}; {account['served_by']} would serve in its place. "
        "Roads, links and lights were not checked"
    )


def _show_lines(title: str, lines: Sequence[str]) -> None:
    if lines:
        put(f"\n{title}:")
        for line in lines:
            put(f"  {safe(line)}")
