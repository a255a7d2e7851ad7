"""`map info`: what a map's folder holds, what the reader makes of it and what it lacks; a picture if one is wanted."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.morai.maps.map_check import describe_map, list_files
from rosbridge_sim.morai.maps.mgeo import find_map_mistakes, read_map
from rosbridge_sim.shell.storage import DiskLibrary, map_names, read_folder
from rosbridge_sim.shell.tools.text import put, put_json, put_table, safe

__all__ = ["show_map"]

MAX_ROWS: Final = 60
"""Intersections that are listed for a person."""

WIDTH: Final = 110
"""Of lines that hold many names, as of our help."""

_Account = dict[str, Any]  # a JSON object


def show_map(name: str, picture: str | None, *, is_json: bool) -> int:
    """Explain a map; the exit code is 1 if it cannot be read.

    Args:
        name: a folder, or the name of a built-in map.
        picture: where a picture of it goes.
        is_json: for a program.

    Raises:
        DocumentError: there is no such folder, or the picture cannot be written.
    """
    try:
        folder = DiskLibrary(own_map=name).map_folder(name)
    except DocumentError:
        known = ", ".join(map_names())
        raise DocumentError(f"{name}: expected a folder of MGeo files, or one of {known}; there is none") from None
    try:
        names = [at.name for at in folder.iterdir()]
    except OSError as error:
        raise DocumentError(f"{folder}: cannot be read: {error.strerror}") from None
    files = read_folder(folder)
    account: _Account = {"folder": str(folder), "files": list_files(files, names)}
    try:
        road_map = read_map(files, str(folder))
    except DocumentError:
        account |= {"is_good": False, "mistakes": find_map_mistakes(files, str(folder))}
    else:
        account |= {"is_good": True, "mistakes": [], **describe_map(files, road_map)}
        if picture is not None:
            from rosbridge_sim.shell.tools.map_picture import draw_map  # noqa: PLC0415 - with Pillow, for this alone

            draw_map(road_map, Path(picture))
    if is_json:
        put_json(account)
    else:
        _show(account)
    return 0 if account["is_good"] else 1


# For a person


def _show(account: _Account) -> None:
    mistakes, gaps = account["mistakes"], account.get("gaps", [])
    verdict = f"{len(mistakes):,} mistake{'' if len(mistakes) == 1 else 's'}" if mistakes else "good"
    put(f"{safe(account['folder'])}: {verdict}" + (f", {len(gaps)} kinds of gaps" if gaps else ""))
    files = account["files"]
    named = [f"{one['name']} ({one['holds']})" if one["holds"] else one["name"] for one in files if one["is_read"]]
    _put_names("read", named)
    _put_names("there, but not needed", [one["name"] for one in files if one["is_there"] and not one["is_read"]])
    _put_names("not there", [one["name"] for one in files if not one["is_there"] and one["is_known"]])
    _put_lines("mistakes", mistakes)
    if account["is_good"]:
        _show_figures(account)


def _put_names(title: str, names: Sequence[str]) -> None:
    if names:
        text = f"  {title}: {', '.join(map(safe, names))}"
        put(textwrap.fill(text, WIDTH, subsequent_indent="    ", break_long_words=False, break_on_hyphens=False))


def _put_lines(title: str, lines: Sequence[str]) -> None:
    if lines:
        put(f"\n{title}:")
        for line in lines:
            put(f"  {safe(line)}")


def _show_figures(account: _Account) -> None:
    projection, lanes, lights = account["projection"], account["lanes"], account["lights"]
    east, north, up = account["origin"]
    (west, to_east), (south, to_north), (low, high) = account["extent"].values()
    put("")
    if account["version"]:
        put(f"version: {safe(account['version'])}")
    put(f"projection: {projection['kind']}, {safe(projection['ellipse'])} ({safe(projection['text'])})")
    put(f"origin: {east:,.3f} east, {north:,.3f} north, {up:,.3f} up")
    put(
        f"extent: {to_east - west:,.0f} m from west to east, {to_north - south:,.0f} m from south to north "
        f"(x {west:,.1f} to {to_east:,.1f}, y {south:,.1f} to {to_north:,.1f}, z {low:,.1f} to {high:,.1f})"
    )
    put(f"nodes: {account['nodes']['num']:,}, {account['nodes']['on_stop_line']:,} of them on a stop line")
    put(
        f"lanes: {lanes['num']:,}, {lanes['length_km']:.2f} km; {lanes['num_with_neighbours']:,} with a lane beside "
        f"that one may change into, {lanes['num_to_stop_lines']:,} that end at a stop line; "
        f"{lanes['num_links_for_changes']:,} links for lane changes"
    )
    _put_lanes("speed limit [km/h]", lanes["by_speed_limit"])
    _put_lanes("link type", lanes["by_link_type"])
    _put_lanes("width [m]", lanes["by_width"])
    put(f"borders: {account['borders']['num']:,}{_counts(account['borders']['by_type'], 'type ')}")
    put(f"lights: {lights['num']:,}{_counts(lights['by_type'])}; {lights['num_groups']:,} groups")
    for key, title in (("by_sub_type", "lamps"), ("by_type_on_the_wire", "trafficLightType")):
        if lights[key]:
            put(f"  {title}: {'; '.join(f'{safe(name)} ({num:,})' for name, num in lights[key].items())}")
    crosswalks = account["crosswalks"]
    put(f"crosswalks: {crosswalks['num']:,}, {crosswalks['num_with_lights']:,} of them with lights")
    _show_controllers(account["controllers"])
    _put_lines("notes", account["notes"])
    _put_lines("gaps", [_gap(gap) for gap in account["gaps"]])


def _put_lanes(title: str, kinds: Mapping[str, _Account]) -> None:
    parts = [f"{safe(name)} ({kind['num']:,}, {kind['length_km']:.2f} km)" for name, kind in kinds.items()]
    put(f"  {title}: {'; '.join(parts)}")


def _counts(counts: Mapping[str, int], before: str = "") -> str:
    """How many of each kind, behind how many there are."""
    return f" ({', '.join(f'{num:,} {before}{safe(name)}' for name, num in counts.items())})" if counts else ""


def _show_controllers(controllers: Sequence[_Account]) -> None:
    put(f"intersections with lights: {len(controllers):,}")
    if not controllers:
        return
    put("")
    rows = [
        (
            one["name"],
            str(one["number"]),
            str(len(one["groups"])),
            str(sum(map(len, one["groups"]))),
            "none" if one["cycle"] is None else f"{one['cycle']:g}",
            " ".join(f"{phase['duration']:g}" for phase in one["phases"]),
            " ".join(f"{seconds:g}" for seconds in one["yellow"]),
        )
        for one in controllers[:MAX_ROWS]
    ]
    put_table(("INTERSECTION", "NUMBER", "GROUPS", "LIGHTS", "CYCLE [s]", "PHASES [s]", "YELLOW [s]"), rows)
    if len(controllers) > MAX_ROWS:
        put(f"... and {len(controllers) - MAX_ROWS:,} more (--json has them all)")


def _gap(gap: _Account) -> str:
    more = "" if gap["num"] <= len(gap["examples"]) else ", ..."
    return f"{gap['num']:,} {gap['what']}: {', '.join(gap['examples'])}{more}"
