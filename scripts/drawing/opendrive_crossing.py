"""A crossing in OpenDRIVE, for a picture: four roads with lights, stop lines, crosswalks, and a spiral to the east."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Final

ARM: Final = 80.0
INSIDE: Final = 12.0
"""Length of the roads, and their distance from the middle of the crossing [m]."""

TURNS: Final = {"straight": 0.0, "left": math.pi / 2, "right": -math.pi / 2}


def crossing_file() -> str:
    """Return the text of the file."""
    roads = [*map(_arm, range(4)), *_ways(), _exit()]
    header = '<header revMajor="1" revMinor="6" name="crossing"/>'
    links = "".join(
        f'<connection id="{arm}{turn}" incomingRoad="{arm}" connectingRoad="{arm}{turn}" contactPoint="start">'
        f'<laneLink from="-1" to="-1"/></connection>'
        for arm in range(4)
        for turn in TURNS
    )
    return f'<OpenDRIVE>{header}{"".join(roads)}<junction id="9" name="">{links}</junction></OpenDRIVE>\n'


def _lanes(*ids: int, link: Callable[[int], str] = lambda _: "") -> str:
    def lane(name: int) -> str:
        kind = "none" if name == 0 else "driving" if abs(name) == 1 else "sidewalk"
        width = 3.5 if abs(name) == 1 else 2.0
        mark = '<roadMark sOffset="0" type="broken" color="yellow"/>' if name == 0 else '<roadMark type="solid"/>'
        size = f'<width sOffset="0" a="{width}" b="0" c="0" d="0"/>' if name else ""
        return f'<lane id="{name}" type="{kind}">{link(name) if abs(name) == 1 else ""}{size}{mark}</lane>'

    parts = {"left": [n for n in ids if n > 0], "center": [0], "right": [n for n in ids if n < 0]}
    sides = "".join(f"<{side}>{''.join(map(lane, names))}</{side}>" for side, names in parts.items() if names)
    return f'<lanes><laneSection s="0">{sides}</laneSection></lanes>'


def _arm(arm: int) -> str:
    """Return a road that leads to the crossing, from the east, north, west or south."""
    away = arm * math.pi / 2
    x, y = ((ARM + INSIDE) * wave for wave in (math.cos(away), math.sin(away)))
    walk = f'<object id="w{arm}" type="crosswalk" s="{ARM - 4}" t="0" length="3" width="7"/>'
    stop = f'<object id="s{arm}" type="-1" name="StopLine" s="{ARM - 6.5}" t="-1.75" length="3.5"/>'
    light = f'<signal id="L{arm}" s="{ARM - 1}" t="-5" type="1000001" orientation="+" dynamic="yes"/>'
    before = '<predecessor elementType="road" elementId="exit" contactPoint="start"/>' if arm == 0 else ""
    return (
        f'<road name="" id="{arm}" length="{ARM}" junction="-1">'
        f'<link>{before}<successor elementType="junction" elementId="9"/></link>'
        f'<planView><geometry s="0" x="{x}" y="{y}" hdg="{away + math.pi}" length="{ARM}"><line/></geometry></planView>'
        f"{_lanes(2, 1, -1, -2, link=lambda name: _link(-name, None) if arm == 0 else '')}"
        f"<objects>{walk}{stop}</objects><signals>{light}</signals></road>"
    )


def _ways() -> Iterator[str]:
    """Yield the roads within the crossing: straight on, and arcs to both sides around the corners."""
    lanes = _lanes(-1, link=lambda _: _link(-1, 1)).replace("solid", "none").replace("broken", "none")
    for arm in range(4):
        away = arm * math.pi / 2
        x, y = INSIDE * math.cos(away), INSIDE * math.sin(away)
        for turn, angle in TURNS.items():
            length = INSIDE * (math.pi / 2 if angle else 2.0)
            shape = f'<arc curvature="{angle / length}"/>' if angle else "<line/>"
            other = (arm + 2 + round(angle / (math.pi / 2))) % 4
            yield (
                f'<road name="" id="{arm}{turn}" length="{length}" junction="9">'
                f'<link><predecessor elementType="road" elementId="{arm}" contactPoint="end"/>'
                f'<successor elementType="road" elementId="{other}" contactPoint="end"/></link>'
                f'<planView><geometry s="0" x="{x}" y="{y}" hdg="{away + math.pi}" length="{length}">{shape}</geometry>'
                f"</planView>{lanes}</road>"
            )


def _exit() -> str:
    """Return the road that goes on to the east, in a bend that becomes tighter."""
    x = ARM + INSIDE
    shape = '<spiral curvStart="0" curvEnd="-0.03"/>'
    return (
        '<road name="" id="exit" length="90" junction="-1">'
        '<link><predecessor elementType="road" elementId="0" contactPoint="start"/></link>'
        f'<planView><geometry s="0" x="{x}" y="0" hdg="0" length="90">{shape}</geometry></planView>'
        f"{_lanes(2, 1, -1, -2)}</road>"
    )


def _link(before: int | None, after: int | None) -> str:
    parts = (("predecessor", before), ("successor", after))
    return "<link>" + "".join(f'<{tag} id="{name}"/>' for tag, name in parts if name is not None) + "</link>"
