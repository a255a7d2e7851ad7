"""Small OpenDRIVE files, written by hand."""

from __future__ import annotations

from collections.abc import Iterable

from rosbridge_sim.documents.xml_documents import read_children
from rosbridge_sim.maps.opendrive.opendrive_map import read_opendrive
from rosbridge_sim.maps.opendrive.road_elements import Road, read_road
from rosbridge_sim.maps.road_map import RoadMap

LINE = "<line/>"
WIDTH = '<width sOffset="0" a="3.5" b="0" c="0" d="0"/>'


def lane(name: int, inner: str = "", kind: str = "driving", width: str = WIDTH) -> str:
    return f'<lane id="{name}" type="{kind}" level="false">{inner}{width if name else ""}</lane>'


def link(before: int | None = None, after: int | None = None) -> str:
    ends = (("predecessor", before), ("successor", after))
    return "<link>" + "".join(f'<{tag} id="{name}"/>' for tag, name in ends if name is not None) + "</link>"


def section(lanes: Iterable[str], s: float = 0.0) -> str:
    """Lanes on either side of lane 0, in any order."""
    sides: dict[str, str] = {"left": "", "center": "", "right": ""}
    for text in lanes:
        name = int(text.split('"')[1])
        sides["left" if name > 0 else "right" if name < 0 else "center"] += text
    return (
        f'<laneSection s="{s}">'
        + "".join(f"<{side}>{text}</{side}>" for side, text in sides.items())
        + "</laneSection>"
    )


def geometry(
    shape: str = LINE, length: float = 100.0, s: float = 0.0, *, x: float = 0.0, y: float = 0.0, hdg: float = 0.0
) -> str:
    return f'<geometry s="{s}" x="{x}" y="{y}" hdg="{hdg}" length="{length}">{shape}</geometry>'


def road(
    name: str = "1",
    plan: str | None = None,
    sections: str | None = None,
    length: float = 100.0,
    *,
    more: str = "",
    links: str = "",
    junction: str = "-1",
    rule: str = "",
    offsets: str = "",
) -> str:
    own_rule = f' rule="{rule}"' if rule else ""
    return (
        f'<road name="" length="{length}" id="{name}" junction="{junction}"{own_rule}>\n<link>{links}</link>'
        f"<planView>{plan or geometry(length=length)}</planView>{more}"
        f"<lanes>{offsets}{sections or section([lane(0), lane(-1)])}</lanes></road>\n"
    )


def joined(tag: str, kind: str, name: str, contact: str = "start") -> str:
    point = f' contactPoint="{contact}"' if kind == "road" else ""
    return f'<{tag} elementType="{kind}" elementId="{name}"{point}/>'


def document(*parts: str, header: str = "") -> bytes:
    begin = f'<?xml version="1.0"?>\n<OpenDRIVE><header revMajor="1" revMinor="6">{header}</header>\n'
    return (begin + "".join(parts) + "</OpenDRIVE>").encode()


def read(*parts: str, header: str = "") -> RoadMap:
    return read_opendrive([document(*parts, header=header)], "folder/small.xodr")


def follows(road_map: RoadMap) -> dict[str, list[str]]:
    """Names of the lanes that follow each lane, of those that lead anywhere."""
    roads = road_map.roads
    found = {name: [roads.ids[after] for after in roads.successors(row)] for row, name in enumerate(roads.ids)}
    return {name: sorted(after) for name, after in found.items() if after}


def record(text: str) -> Road:
    """The record of a road."""
    elements = read_children([document(text)], "a.xodr", "OpenDRIVE")
    return read_road(next(each for each in elements if each.tag == "road"))
