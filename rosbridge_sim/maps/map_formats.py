"""The formats of maps: folders of files, whose names tell the format, and single files, whose suffix or root tells it.

A new format is a module beside this one and a row in `FORMATS` or `FILE_FORMATS`.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterable, Mapping
from typing import Final

from rosbridge_sim.maps import mgeo
from rosbridge_sim.maps.road_map import RoadMap
from rosbridge_sim.records import Record


class MapFormat(Record):
    """A format of maps that are folders.

    Attributes:
        name: as people know it.
        needed: names of the files that a map of this format needs.
        files: names of all files that are read.
        read: `(files, source)`: contents by file name -> the map. It raises DocumentError with one line.
        find_mistakes: the same arguments -> a line for each mistake in files that `read` refuses.
    """

    name: str
    needed: tuple[str, ...]
    files: tuple[str, ...]
    read: Callable[[Mapping[str, bytes], str], RoadMap]
    find_mistakes: Callable[[Mapping[str, bytes], str], list[str]]


class MapFileFormat(Record):
    """A format of maps that are one XML file each.

    Attributes:
        name: as people know it.
        suffix: of its files, in lower case.
        root: name of the first element of its files.
        read: `(pieces, source)`: the file's bytes in pieces -> the map. It raises DocumentError with one line.
    """

    name: str
    suffix: str
    root: str
    read: Callable[[Iterable[bytes], str], RoadMap]


FORMATS: Final = (MapFormat("MGeo", mgeo.FILES, mgeo.MAP_FILES, mgeo.read_mgeo, mgeo.find_mgeo_mistakes),)
"""All formats. If a folder has files of several, the first one is taken."""


def _read_opendrive(pieces: Iterable[bytes], source: str) -> RoadMap:
    # Imported here, so that a start without such a file is faster.
    from rosbridge_sim.maps.opendrive.opendrive_map import read_opendrive  # noqa: PLC0415

    return read_opendrive(pieces, source)


FILE_FORMATS: Final = (MapFileFormat("OpenDRIVE", ".xodr", "OpenDRIVE", _read_opendrive),)
"""All formats of single files."""

MAP_FILES: Final = tuple(dict.fromkeys(file for each in FORMATS for file in each.files))
"""Names of all files that some reader reads."""


def is_map(names: Collection[str]) -> bool:
    """Return True if a folder with these files is a map, perhaps an incomplete one."""
    return any(file in names for each in FORMATS for file in each.needed)


def choose_format(names: Collection[str]) -> MapFormat:
    """Return the format of a folder with these files; the first format if they belong to none, for its error."""
    return next((each for each in FORMATS if any(file in names for file in each.needed)), FORMATS[0])


def read_map(files: Mapping[str, bytes], source: str) -> RoadMap:
    """Read a map of any format.

    Args:
        files: contents by file name.
        source: the map's folder, for errors; its last part is the map's name.

    Raises:
        DocumentError: one line: file, place in it, expected value, actual value.
    """
    return choose_format(files).read(files, source)


def find_map_mistakes(files: Mapping[str, bytes], source: str) -> list[str]:
    """Return a line for each mistake in a map that `read_map` refuses; see there."""
    return choose_format(files).find_mistakes(files, source)


def find_file_format(name: str, content: bytes = b"") -> MapFileFormat | None:
    """Return the format of a map file; None if it is none that is read.

    Args:
        name: the file's name or path.
        content: its first bytes, in which the root is looked for; without any the suffix alone counts.
    """
    roots = set(_ROOT.findall(content.decode("utf-8", "replace")))
    return next((each for each in FILE_FORMATS if name.lower().endswith(each.suffix) or each.root in roots), None)


_ROOT: Final = re.compile(r"<(?:[\w.-]+:)?([A-Za-z_][\w.-]*)[\s>]")
