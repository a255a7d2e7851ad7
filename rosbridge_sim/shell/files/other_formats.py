"""Formats of scenarios and maps that are not read, known by a file's name or its first bytes.

A user who has such a file is told so by name, because "not JSON" or "there is none" sends them looking for a mistake.
"""

from __future__ import annotations

import re
from itertools import islice
from pathlib import Path
from typing import Final

SCENARIO_IS: Final = (
    "expected a scenario of MORAI SIM in JSON, or of OpenSCENARIO 1.x, as in rosbridge-sim docs reference/scenarios"
)
"""Formats that are read, as the end of an error text."""

MAP_IS: Final = "expected a folder of MGeo files or an OpenDRIVE file (.xodr)"
"""The same of a map."""

_SUFFIXES: Final = {
    ".xosc": "OpenSCENARIO",
    ".osc": "OpenSCENARIO 2",
    ".xodr": "OpenDRIVE",
    ".net.xml": "SUMO net",
    ".net.xml.gz": "SUMO net",
    ".rou.xml": "SUMO routes",
    ".sumocfg": "SUMO configuration",
    ".osm": "OpenStreetMap",
    ".pbf": "OpenStreetMap",
    ".rrhd": "RoadRunner",
    ".rrscene": "RoadRunner",
    ".rrscenario": "RoadRunner",
}
"""End of a file's name -> the format."""

_ROOTS: Final = {
    "openscenario": "OpenSCENARIO",
    "opendrive": "OpenDRIVE",
    "net": "SUMO net",
    "routes": "SUMO routes",
    "configuration": "SUMO configuration",
    "sumoconfiguration": "SUMO configuration",
    "osm": "OpenStreetMap",
}
"""First element of an XML document -> the format."""

_ROOT: Final = re.compile(rb"<([A-Za-z_][\w:.-]{0,40})")

MAX_FILES: Final = 10_000
"""Files of a folder that are looked at, by their names."""

LOOKED_AT: Final = 4_096
"""Beginning of a file in which its first element stands [bytes]: behind a long licence text there may be none."""


def find_other_format(name: str, content: bytes = b"") -> str:
    """Return the format of a file that is not read; an empty text if it looks like none.

    Args:
        name: the file's name or path.
        content: its bytes, or the first of them; without any the name alone counts.
    """
    start = content[:LOOKED_AT].lstrip(b"\xef\xbb\xbf \t\r\n")
    named = next((form for suffix, form in _SUFFIXES.items() if name.lower().endswith(suffix)), "")
    if not content:
        return named
    if not start.startswith(b"<"):
        return ""  # a scenario may have any name
    names = (root.decode().lower() for root in _ROOT.findall(start))
    return next((_ROOTS[name] for name in names if name in _ROOTS), named or "XML")


def say_not_read(form: str) -> str:
    """Return the sentence about a format where a scenario is expected."""
    return "OpenDRIVE is a map, which --map takes" if form == "OpenDRIVE" else f"{form} is not read"


def find_other_formats(folder: Path) -> str:
    """Return which formats that are not read a folder has files of, with an example; an empty text if there are none.

    Args:
        folder: the folder; one that cannot be read has none.
    """
    try:
        names = sorted(at.name for at in islice(folder.iterdir(), MAX_FILES))
    except OSError:
        return ""
    read = {"", "OpenDRIVE", "OpenSCENARIO"}
    found = {form: name for name in reversed(names) if (form := find_other_format(name)) not in read}
    return "; ".join(f"{form} is not read ({name})" for form, name in sorted(found.items()))
