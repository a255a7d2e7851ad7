"""A map in a form that knows no file format: projection, lanes, traffic lights, crosswalks and painted lines.

Each reader of a format makes one of these (`map_formats` has the readers); everything else of the simulator uses this
form alone. All places are in the map frame [m].
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from hashlib import blake2b

import numpy as np

from rosbridge_sim.maps.road_positions import RoadPositions
from rosbridge_sim.records import Record
from rosbridge_sim.world.geometry.planar import BoolArray, FloatArray
from rosbridge_sim.world.roads.roads import Roads
from rosbridge_sim.world.roads.signal_plan import SignalPlan


class Projection(Record):
    """Position of the map's coordinates on the globe, as in `MapSpec`.

    Attributes:
        is_tm: a transverse Mercator with its own figures (`plane_coordinate_system` 1) instead of a UTM zone (0).
        zone: UTM zone 1..60; 0 for a TM, and for `NO_PROJECTION`.
        is_south: a UTM zone of the southern hemisphere (MapSpec has no field for it).
        ellipse: e.g. "WGS84".
        central_latitude, central_meridian: [deg]. A UTM zone is also a transverse Mercator and has all these figures.
        scale_factor: on the central meridian.
        false_easting, false_northing: [m].
        text: as the map has it.
    """

    is_tm: bool
    zone: int = 0
    is_south: bool = False
    ellipse: str = "WGS84"
    central_latitude: float = 0.0
    central_meridian: float = 0.0
    scale_factor: float = 1.0
    false_easting: float = 0.0
    false_northing: float = 0.0
    text: str = ""

    @property
    def is_known(self) -> bool:
        """False for `NO_PROJECTION`."""
        return self.is_tm or self.zone > 0


class Border(Record, eq=False, gc=False):
    """A line that is painted on the road, or a kerb: for drawings.

    Attributes:
        name: as the map has it.
        line: (k, 3) its points, map frame [m].
        type: MGeo's `lane_type`, such as 501 for a centre line and 530 for a stop line; 0 where the map has no number.
        shape: MGeo's `lane_shape`: "Solid" or "Broken", of each of its lines.
        colour: MGeo's `lane_color`.
    """

    name: str
    line: FloatArray
    type: int = 0
    shape: tuple[str, ...] = ()
    colour: tuple[str, ...] = ()


class Crosswalk(Record, eq=False):
    """A crosswalk.

    Attributes:
        name: as the map spells it.
        outlines: corners of its parts, (k, 3) each [m].
        lights: rows of the lights that belong to it.
    """

    name: str
    outlines: tuple[FloatArray, ...]
    lights: tuple[int, ...] = ()


def open_outline(outline: FloatArray) -> FloatArray:
    """Return the corners of an outline, (k, 3), without the first one again at the end."""
    return outline[:-1] if len(outline) > 1 and np.array_equal(outline[0], outline[-1]) else outline


def stripes_of(outline: FloatArray, begin: float = 0.25) -> FloatArray | None:
    """Return the stripes of a part of a crosswalk: as wide as the gaps, 0.5 m, along the driving direction.

    Args:
        outline: (k, 2 or 3) corners; the first may stand again at the end [m].
        begin: of a stripe, in its metre of the crosswalk.

    Returns:
        (m, 4, 2 or 3) corners of the stripes in the order of the outline's; None if it has not four corners.
    """
    outline = open_outline(outline)
    if len(outline) != 4:  # noqa: PLR2004 - a rectangle's
        return None
    sides = np.hypot(*(np.roll(outline, -1, axis=0) - outline)[:, :2].T)
    # People walk from a to b, and in parallel from d to c.
    a, b, c, d = np.roll(outline, -1, axis=0) if sides[0] + sides[2] < sides[1] + sides[3] else outline
    num = max(1, round(float(np.hypot(*(b - a)[:2]))))
    start, end = (((np.arange(num) + share) / num)[:, None] for share in (begin, begin + 0.5))
    return np.stack([a + start * (b - a), a + end * (b - a), d + end * (c - d), d + start * (c - d)], axis=1)


class Marking(Record, eq=False):
    """An area that is painted on the road, such as an arrow: for drawings.

    Attributes:
        name: as the map has it.
        outline: (k, 3) its corners, map frame [m].
    """

    name: str
    outline: FloatArray


class Sign(Record):
    """A traffic sign: for drawings.

    Attributes:
        name: as the map has it.
        x, y, z: its place [m].
        yaw: direction that it faces [rad].
        kind: "1" warns, "2" regulates, "3" directs, "4" adds to another sign; anything else is not known.
        width, height: of its plate [m].
    """

    name: str
    x: float
    y: float
    z: float
    yaw: float
    kind: str = ""
    width: float = 0.6
    height: float = 0.6


@dataclass(frozen=True, eq=False)  # without slots, because the digest is kept
class RoadMap:
    """A map in a form that knows no file format.

    Attributes:
        name: of its folder.
        projection: of its plane coordinates; `NO_PROJECTION` if the map does not tell.
        origin: east, north and up of the map's (0, 0, 0) in that projection [m].
        roads: its lanes, in the order of the file.
        plan: its traffic lights; None given stands for a plan of no lights.
        borders: painted lines and kerbs.
        markings: what is painted on the roads beside lines and crosswalks.
        signs: traffic signs.
        positions: its lanes by the roads of the file; None for a format without roads.
        notes: remarks about ignored or reinterpreted entries: a line each, for the log.
    """

    name: str
    projection: Projection
    origin: tuple[float, float, float]
    roads: Roads
    plan: SignalPlan = None  # type: ignore[assignment] # `__post_init__` makes one
    crosswalks: tuple[Crosswalk, ...] = ()
    notes: tuple[str, ...] = ()
    borders: tuple[Border, ...] = ()
    markings: tuple[Marking, ...] = ()
    signs: tuple[Sign, ...] = ()
    positions: RoadPositions | None = None

    def __post_init__(self) -> None:
        if self.plan is None:
            object.__setattr__(self, "plan", SignalPlan(self.roads))

    def find_inside(self) -> BoolArray:
        """Return which lanes lie within an intersection: behind a stop line, or controlled by lights; (lanes,)."""
        roads, is_inside = self.roads, np.zeros(len(self.roads), dtype=bool)
        is_inside[roads.successor[roads.is_stop[roads.predecessor]]] = True
        return is_inside | (self.plan.controller_of_lane >= 0)

    @cached_property
    def digest(self) -> bytes:
        """16 bytes that stand for all of the map that decides what a simulator does."""
        state = blake2b(repr((self.name, self.projection, self.origin)).encode(), digest_size=16)
        state.update(self.roads.digest)
        if self.plan.lights:
            state.update(self.plan.digest)
        return state.digest()
