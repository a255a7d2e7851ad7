"""Messages of `visualization_msgs/MarkerArray`, for viewers such as RViz and Lichtblick; ROS 1 and ROS 2 alike.

All colours and sizes of the scene for viewers are here. A colour never stands alone: kinds differ in shape, and the
lamps of a light differ in height, so the scene can be read without seeing colours.
"""

from __future__ import annotations

from collections.abc import Sequence
from enum import IntEnum
from typing import Any, Final

from rosbridge_sim.loose_types import Struct
from rosbridge_sim.morai.messages.convert import maker
from rosbridge_sim.schema.store import Store
from rosbridge_sim.world.geometry.planar import FloatArray, Quaternion, Vector
from rosbridge_sim.world.roads.signal_plan import GREENS, Lamp
from rosbridge_sim.world.state.world import Kind

MARKER_ARRAY: Final = "visualization_msgs/MarkerArray"

Colour = tuple[float, float, float, float]
"""Red, green, blue and opacity, 0..1 each."""


class MarkerShape(IntEnum):
    """Shape of a marker; the numbers are those of visualization_msgs/Marker."""

    ARROW = 0
    CUBE = 1
    SPHERE = 2
    CYLINDER = 3
    LINE_LIST = 5
    SPHERE_LIST = 7
    TEXT = 9
    TRIANGLES = 11


_ADD: Final = 0
_DELETE: Final = 2
_DELETE_ALL: Final = 3

_DIGITS: Final = 3
"""Decimals of points: 1 mm, a third of the text."""

COLOURS: Final[dict[str, Colour]] = {
    "road": (0.27, 0.29, 0.32, 1.0),
    "inside": (0.34, 0.33, 0.30, 1.0),  # the road within an intersection
    "white": (0.93, 0.93, 0.93, 1.0),
    "yellow": (0.95, 0.75, 0.15, 1.0),
    "blue": (0.25, 0.50, 0.90, 1.0),
    "stop": (0.85, 0.15, 0.15, 1.0),
    "post": (0.60, 0.60, 0.60, 1.0),
    "label": (1.0, 1.0, 1.0, 1.0),
    "arrow": (1.0, 0.85, 0.20, 1.0),
}
"""Colours by name; readable on the dark background that RViz and Lichtblick begin with."""

KIND_LOOKS: Final[dict[int, tuple[str, MarkerShape, Colour]]] = {
    Kind.EGO: ("egos", MarkerShape.CUBE, (0.88, 0.10, 0.50, 0.9)),
    Kind.VEHICLE: ("vehicles", MarkerShape.CUBE, (0.35, 0.55, 0.95, 0.9)),
    Kind.PEDESTRIAN: ("pedestrians", MarkerShape.CYLINDER, (0.95, 0.55, 0.10, 0.9)),
    Kind.OBSTACLE: ("obstacles", MarkerShape.CUBE, (0.65, 0.45, 0.25, 0.9)),
}
"""Kind -> namespace, shape and colour."""

LAMPS: Final[tuple[tuple[int, float, Colour], ...]] = (
    (int(Lamp.RED), 0.4, (0.95, 0.10, 0.10, 1.0)),
    (int(Lamp.YELLOW), 0.0, (1.0, 0.80, 0.10, 1.0)),
    (int(Lamp.GREEN), -0.4, (0.10, 0.85, 0.35, 1.0)),
    (GREENS - int(Lamp.GREEN), -0.8, (0.20, 0.90, 0.80, 1.0)),  # arrows
)
"""Lamps, their height above the light's position [m], and their colour. The order is that of a real light."""


class MarkerMaker:
    """Maker of markers and of their messages."""

    def __init__(self, store: Store) -> None:
        """Look up all types, so that a thread may call the methods.

        Args:
            store: has the types.
        """
        names = "header ns id type action pose scale color"
        self._marker = maker(store, "visualization_msgs/Marker", names)
        self._marker_with_points = maker(store, "visualization_msgs/Marker", f"{names} points colors")
        self._marker_with_text = maker(store, "visualization_msgs/Marker", f"{names} text")
        self._array = maker(store, MARKER_ARRAY, "markers")
        self._pose = maker(store, "geometry_msgs/Pose", "position orientation")
        self._point = maker(store, "geometry_msgs/Point", "x y z")
        self._quaternion = maker(store, "geometry_msgs/Quaternion", "x y z w")
        self._vector = maker(store, "geometry_msgs/Vector3", "x y z")
        self._rgba = maker(store, "std_msgs/ColorRGBA", "r g b a")
        self._colours: dict[Colour, Any] = {}
        self._here = self.pose((0.0, 0.0, 0.0))
        self._no_size = self.size(0.0, 0.0, 0.0)
        self._no_colour = self.colour((0.0, 0.0, 0.0, 0.0))

    # Parts

    def pose(self, place: Vector, axes: Quaternion = (0.0, 0.0, 0.0, 1.0)) -> Struct:
        """Return a pose in the map frame [m]."""
        return self._pose(self._point(*place), self._quaternion(*axes))

    def size(self, x: float, y: float, z: float) -> Struct:
        """Return the size of a marker along its own axes [m]."""
        return self._vector(x, y, z)

    def colour(self, colour: Colour) -> Struct:
        """Return a colour; the same object each time."""
        found = self._colours.get(colour)
        if found is None:
            found = self._colours[colour] = self._rgba(*colour)
        return found

    def points(self, points: FloatArray) -> list[Struct]:
        """Return (k, 3) points of the map frame [m]."""
        make = self._point
        return [make(x, y, z) for x, y, z in points.round(_DIGITS).tolist()]

    # Markers

    def solid(
        self, header: Struct, ns: str, number: int, shape: MarkerShape, *, pose: Struct, size: Struct, colour: Struct
    ) -> Struct:
        """Return a marker of one body."""
        return self._marker(header, ns, number, int(shape), _ADD, pose, size, colour)

    def group(
        self,
        header: Struct,
        ns: str,
        number: int,
        shape: MarkerShape,
        *,
        size: Struct,
        colour: Struct,
        points: Sequence[Struct],
        colours: Sequence[Struct] = (),
    ) -> Struct:
        """Return a marker of many lines, triangles or spheres.

        Args:
            ns: namespace.
            number: id within the namespace.
            shape: of all.
            size: width of the lines in x, or size of the spheres.
            colour: of all, where `colours` is empty.
            points: ends of the lines, corners of the triangles or centres of the spheres.
            colours: of each point, or none.
        """
        return self._marker_with_points(
            header, ns, number, int(shape), _ADD, self._here, size, colour, list(points), list(colours)
        )

    def text(self, header: Struct, ns: str, number: int, text: str, *, pose: Struct, height: float) -> Struct:
        """Return a text that faces the viewer; `height` is that of a capital letter [m]."""
        size, colour = self.size(0.0, 0.0, height), self.colour(COLOURS["label"])
        return self._marker_with_text(header, ns, number, int(MarkerShape.TEXT), _ADD, pose, size, colour, text)

    def delete(self, header: Struct, ns: str, number: int) -> Struct:
        """Return the deletion of a marker."""
        return self._marker(header, ns, number, 0, _DELETE, self._here, self._no_size, self._no_colour)

    def delete_all(self, header: Struct) -> Struct:
        """Return the deletion of all markers of the topic."""
        return self._marker(header, "", 0, 0, _DELETE_ALL, self._here, self._no_size, self._no_colour)

    def array(self, markers: list[Struct]) -> Struct:
        """Return a message of markers."""
        return self._array(markers)
