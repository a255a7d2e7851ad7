"""`map info`: checks of maps; the contents of a map's folder, the map read from it, and a picture on request.

A *mistake* makes loading the map fail. A *remark* is about a missing part, or about a value that is read in another way
than it is written.
"""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from rosbridge_sim.cli.files.verdicts import draw, put_lines, put_verdict, put_verdicts, put_whole
from rosbridge_sim.cli.tools.text import put, put_table
from rosbridge_sim.errors import DocumentError, SettingError, file_errors
from rosbridge_sim.link.terminal_text import safe
from rosbridge_sim.maps.map_check import describe_map, list_files
from rosbridge_sim.maps.map_formats import find_file_format, find_map_mistakes, is_map, read_map
from rosbridge_sim.maps.road_map import RoadMap
from rosbridge_sim.shell.files.library import DiskLibrary, map_is, read_folder, read_map_at, refuse_map_file
from rosbridge_sim.shell.files.other_formats import MAP_IS, find_other_formats

MAX_ROWS: Final = 60
"""Intersections that are listed for people."""

MAX_KINDS: Final = 10
"""Kinds of lanes that are listed for people."""

WIDTH: Final = 110
"""Width of lines with many names, as in the help texts."""

_Report = dict[str, Any]  # a JSON object


def show_maps(names: Sequence[str], picture: str | None, *, is_json: bool, is_strict: bool) -> int:
    """Explain a map, or print the result of checks of several.

    Args:
        names: folders or files of maps, folders of these, or names of built-in maps.
        picture: file for a picture; allowed for a single map.
        is_strict: remarks count like mistakes in the exit code.

    Returns:
        The exit code; see `put_verdicts`.

    Raises:
        DocumentError: there is no such folder, or the picture cannot be written.
    """
    folders = [folder for name in names for folder in _find_folders(name)]
    if picture is not None and len(folders) > 1:
        raise SettingError(f"--picture: expected a single map to draw, got {len(folders):,}")
    if len(folders) == 1:
        account, road_map = _account(folders[0])
        draw(picture, "map", road_map)
        return put_whole(account, _show, is_json=is_json, is_strict=is_strict)
    files = list(map(str, folders))
    return put_verdicts("map info", files, lambda file: _account(Path(file))[0], is_json=is_json, is_strict=is_strict)


def _find_folders(name: str) -> list[Path]:
    """Return the folder of a map; for another folder, the folders of maps in it.

    Raises:
        DocumentError: there is no such folder.
    """
    try:
        folder = DiskLibrary(own_map=name).map_path(name)
    except DocumentError:
        refuse_map_file(Path(name))
        raise DocumentError(f"{name}: {map_is()}; there is none") from None
    if folder.is_file() or is_map(_names_in(folder)):
        return [folder]
    inner = [at for at in sorted(folder.glob("*")) if is_map(_names_in(at)) or find_file_format(at.name)]
    if not inner and (other := find_other_formats(folder)):
        raise DocumentError(f"{name}: {other}; {MAP_IS}")
    return inner or [folder]


def _names_in(folder: Path) -> set[str]:
    """Return the names of the files in a folder; none if it cannot be read."""
    try:
        return {at.name for at in folder.iterdir()}
    except OSError:
        return set()


def _account(folder: Path) -> tuple[_Report, RoadMap | None]:
    """Return the report on a map, and the map if it can be read.

    Raises:
        DocumentError: the folder cannot be read.
    """
    if folder.is_file():
        return _account_of_file(folder)
    with file_errors(folder, "read"):
        names = [at.name for at in folder.iterdir()]
    files = read_folder(folder)
    account: _Report = {"file": str(folder), "folder": str(folder), "files": list_files(files, names)}
    try:
        road_map = read_map(files, str(folder))
    except DocumentError:
        mistakes = find_map_mistakes(files, str(folder))
        return {**account, "is_good": False, "mistakes": mistakes, "remarks": []}, None
    return _described(account, files, road_map), road_map


def _account_of_file(path: Path) -> tuple[_Report, RoadMap | None]:
    """Return the report on a map that is one file, and the map if it can be read."""
    one = {"name": path.name, "is_there": True, "is_read": True, "holds": None, "is_known": True}
    account: _Report = {"file": str(path), "folder": str(path.parent), "files": [one]}
    try:
        road_map = read_map_at(path)
    except DocumentError as error:
        return {**account, "is_good": False, "mistakes": [str(error)], "remarks": []}, None
    return _described(account, {}, road_map), road_map


def _described(account: _Report, files: Mapping[str, bytes], road_map: RoadMap) -> _Report:
    described = describe_map(files, road_map)
    remarks = [*described["notes"], *map(_gap, described["gaps"])]
    return {**account, "is_good": not remarks, "mistakes": [], "remarks": remarks, **described}


# Output for people


def _show(account: _Report) -> None:
    put_verdict(account)
    put_lines("mistakes", account["mistakes"])
    put_lines("remarks", account["remarks"])
    put("")
    files = account["files"]
    named = [f"{one['name']} ({one['holds']})" if one["holds"] else one["name"] for one in files if one["is_read"]]
    _put_names("read", named)
    _put_names("present, but not needed", [one["name"] for one in files if one["is_there"] and not one["is_read"]])
    _put_names("missing", [one["name"] for one in files if not one["is_there"] and one["is_known"]])
    if not account["mistakes"]:
        _show_figures(account)


def _put_names(title: str, names: Sequence[str]) -> None:
    if names:
        text = f"  {title}: {', '.join(map(safe, names))}"
        put(textwrap.fill(text, WIDTH, subsequent_indent="    ", break_long_words=False, break_on_hyphens=False))


def _show_figures(account: _Report) -> None:
    projection, lanes, lights = account["projection"], account["lanes"], account["lights"]
    east, north, up = account["origin"]
    (west, to_east), (south, to_north), (low, high) = account["extent"].values()
    put("")
    if account["version"]:
        put(f"version: {safe(account['version'])}")
    if projection["kind"] is None:
        put("projection: none")
    else:
        put(f"projection: {projection['kind']}, {safe(projection['ellipse'])} ({safe(projection['text'])})")
        put(f"origin: {east:,.3f} east, {north:,.3f} north, {up:,.3f} up")
    put(
        f"extent: {to_east - west:,.0f} m from west to east, {to_north - south:,.0f} m from south to north "
        f"(x {west:,.1f} to {to_east:,.1f}, y {south:,.1f} to {to_north:,.1f}, z {low:,.1f} to {high:,.1f})"
    )
    if account["nodes"]["num"]:
        put(f"nodes: {account['nodes']['num']:,}, {account['nodes']['on_stop_line']:,} of them on a stop line")
    is_mgeo = account["nodes"]["num"] > 0
    changes = f"; {lanes['num_links_for_changes']:,} links for lane changes" if is_mgeo else ""
    put(
        f"lanes: {lanes['num']:,}, {lanes['length_km']:.2f} km; {lanes['num_with_neighbours']:,} with a lane beside "
        f"it to change into, {lanes['num_to_stop_lines']:,} that end at a stop line{changes}"
    )
    limits = {name if name != "0" else "none": kind for name, kind in lanes["by_speed_limit"].items()}
    _put_lanes("speed limit [km/h]", limits)
    if is_mgeo:
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


def _put_lanes(title: str, kinds: Mapping[str, _Report]) -> None:
    """Print the lanes of each kind, the longest first; many small kinds as one."""
    shown = dict(list(kinds.items())[:MAX_KINDS])
    rest = list(kinds.values())[MAX_KINDS:]
    if rest:
        sums = {key: sum(kind[key] for kind in rest) for key in ("num", "length_km")}
        shown[f"{len(rest):,} others"] = sums
    parts = [f"{safe(name)} ({kind['num']:,}, {kind['length_km']:.2f} km)" for name, kind in shown.items()]
    put(f"  {title}: {'; '.join(parts)}")


def _counts(counts: Mapping[str, int], before: str = "") -> str:
    """Return the total, and the number of each kind."""
    return f" ({', '.join(f'{num:,} {before}{safe(name)}' for name, num in counts.items())})" if counts else ""


def _show_controllers(controllers: Sequence[_Report]) -> None:
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


def _gap(gap: _Report) -> str:
    more = "" if gap["num"] <= len(gap["examples"]) else ", ..."
    return f"{gap['num']:,} {gap['what']}: {', '.join(gap['examples'])}{more}"
