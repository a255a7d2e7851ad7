"""A mesh in the memory of the graphics library, in cells of which only those in view are drawn."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rosbridge_sim.scenery.camera_geometry import rotation
from rosbridge_sim.scenery.mesh import PAINTED, Label, Mesh
from rosbridge_sim.scenery.scene_frame import SceneFrame
from rosbridge_sim.shell.rendering.shaders import ASPHALT_FADES, GRASS_FADES, Coat
from rosbridge_sim.world.geometry.planar import FloatArray

if TYPE_CHECKING:
    import moderngl

CELL: Final = 60.0
"""Side of a cell [m]."""


class _Group(NamedTuple):
    """Classes that are drawn alike.

    Attributes:
        labels: the classes.
        coat: what is drawn onto them.
        reach: how far they are drawn [m].
        later: how much later than nearer things they are drawn, as a distance [m].
        fades: distance from which on nothing is seen of the coat [m]; see the shader.
    """

    labels: tuple[Label, ...]
    coat: Coat
    reach: float
    later: float
    fades: float = math.inf


_GROUPS: Final = (
    _Group((Label.TREE, Label.POLE, Label.TRAFFIC_LIGHT, Label.SIGN), Coat.PLAIN, 220.0, 0.0),
    _Group((Label.BUILDING,), Coat.WALL, 500.0, 0.0),
    _Group((Label.KERB,), Coat.PLAIN, 150.0, 0.0),
    _Group((Label.PAVEMENT,), Coat.SLABS, 260.0, 0.0),
    _Group(PAINTED, Coat.PLAIN, 400.0, 0.0),
    _Group((Label.ASPHALT,), Coat.ASPHALT, 2_000.0, 20.0, fades=ASPHALT_FADES),
    _Group((Label.GROUND,), Coat.GRASS, 2_000.0, 80.0, fades=GRASS_FADES),
)
"""Order of drawing. The lowest surfaces come last: most of their pixels are hidden then, and cost nothing."""

Part = tuple[Coat, int, int]
"""For each pattern its first vertex and its number of vertices."""

VERTEX: Final = np.dtype([("place", "<f4", 3), ("look", "u1", 4), ("normal", "i1", 4), ("instance", "<i4")])

FORMAT: Final = "3f 4u1 4i1 1i"
NAMES: Final = ("place", "look", "normal", "instance")


def pack_vertices(mesh: Mesh) -> NDArray[np.void]:
    """Return three vertices for each triangle, (3 m,), as the shaders take them."""
    corner = np.empty((len(mesh), 3), dtype=VERTEX)
    corner["place"] = mesh.vertices[mesh.triangles]
    look = np.empty((len(mesh), 4), dtype=np.uint8)
    look[:, :3], look[:, 3] = mesh.colour, mesh.label
    corner["look"] = look[:, None]
    normal = np.empty((len(mesh), 4), dtype=np.int8)
    normal[:, :3], normal[:, 3] = np.rint(127.0 * mesh.normals), mesh.lit
    corner["normal"] = normal[:, None]
    corner["instance"] = mesh.instance[:, None]
    return corner.reshape(-1)


def planes_of(view: FloatArray) -> FloatArray:
    """Return the four side planes and the near plane of a view, (5, 4): a place is inside where all are positive.

    Args:
        view: (4, 4) from the scene to the picture.
    """
    rows = np.array([view[3] + view[0], view[3] - view[0], view[3] + view[1], view[3] - view[1], view[3] + view[2]])
    return np.asarray(rows / np.linalg.norm(rows[:, :3], axis=1)[:, None])


class _Buffer:
    """Vertices in the memory of the graphics library, and how each program reads them."""

    def __init__(self, context: moderngl.Context, data: bytes, *, is_dynamic: bool = False) -> None:
        self._context = context
        self.vertices = context.buffer(data or bytes(VERTEX.itemsize), dynamic=is_dynamic)
        self._arrays: dict[moderngl.Program, moderngl.VertexArray] = {}

    def array(self, program: moderngl.Program) -> moderngl.VertexArray:
        """Return the vertices for a program, which may not use all of their attributes."""
        if program not in self._arrays:
            pairs = zip(FORMAT.split(), NAMES, strict=True)
            used = [(word if name in program else f"{VERTEX[name].itemsize}x", name) for word, name in pairs]
            content = (
                self.vertices,
                " ".join(word for word, _ in used),
                *(name for _, name in used if name in program),
            )
            self._arrays[program] = self._context.vertex_array(program, [content])
        return self._arrays[program]

    def release(self) -> None:
        """Free its memory."""
        for array in self._arrays.values():
            array.release()
        self.vertices.release()


class _Runs:
    """Runs of triangles of a buffer, each with a ball around it."""

    def __init__(
        self, places: NDArray[np.floating], first: NDArray[np.int64], reach: FloatArray | float, later: FloatArray
    ) -> None:
        """Find the balls.

        Args:
            places: (3 n, 3) corners of the triangles.
            first: (m,) the first triangle of each run.
            reach: up to which distance a run is drawn [m].
            later: (m,) what is added to its distance in the order of drawing [m].
        """
        self.first = 3 * first
        self.num = np.diff(np.append(self.first, len(places)))
        low = np.minimum.reduceat(places, self.first) if len(first) else np.zeros((0, 3))
        high = np.maximum.reduceat(places, self.first) if len(first) else np.zeros((0, 3))
        self._middle, self._radius = 0.5 * (low + high), 0.5 * np.linalg.norm(high - low, axis=1)
        self._reach = reach
        self._later = later

    def visible(self, view: FloatArray, eye: FloatArray) -> tuple[NDArray[np.intp], FloatArray]:
        """Return which runs are in view, the nearest first, and their distances [m].

        Args:
            view: (4, 4) from the scene to the picture.
            eye: (3,) place of the camera.
        """
        planes = planes_of(view)
        away = np.linalg.norm(self._middle - eye, axis=1) - self._radius
        inside = (self._middle @ planes[:, :3].T + planes[:, 3] > -self._radius[:, None]).all(axis=1)
        rows = np.flatnonzero(inside & (away < self._reach))
        rows = rows[np.argsort(away[rows] + self._later[rows], kind="stable")]
        return rows, away[rows]


class CellMesh:
    """A mesh that does not move, in the memory of the graphics library."""

    def __init__(self, context: moderngl.Context, mesh: Mesh) -> None:
        middle = mesh.vertices[mesh.triangles].mean(axis=1)
        group = np.zeros(256, dtype=np.int64)
        for i, each in enumerate(_GROUPS):
            group[list(each.labels)] = i
        groups = group[mesh.label]
        cell = np.floor(middle[:, :2] / CELL).astype(np.int64)
        key = (groups * 2_000_003 + cell[:, 0]) * 4_000_037 + cell[:, 1]
        order = np.argsort(key, kind="stable")
        sorted_mesh, key = mesh.pick(order), key[order]
        first = np.flatnonzero(np.diff(key, prepend=key[:1] - 1)) if len(key) else np.zeros(0, dtype=np.int64)
        self._group = groups[order][first]
        reach, later = np.array([(each.reach, each.later) for each in _GROUPS])[self._group].T
        packed = pack_vertices(sorted_mesh)
        self._runs = _Runs(packed["place"].astype(np.float64), first, reach, later)
        self._buffer = _Buffer(context, packed.tobytes())

    def visible(self, view: FloatArray, eye: FloatArray) -> list[Part]:
        """Return what is in view, the nearest first.

        Args:
            view: (4, 4) from the scene to the picture.
            eye: (3,) place of the camera.
        """
        rows, away = self._runs.visible(view, eye)
        groups, distances = self._group[rows].tolist(), away.tolist()
        coats = [
            _GROUPS[i].coat if distance < _GROUPS[i].fades else Coat.PLAIN
            for i, distance in zip(groups, distances, strict=True)
        ]
        return list(zip(coats, self._runs.first[rows].tolist(), self._runs.num[rows].tolist(), strict=True))

    def draw(self, parts: list[Part], programs: Mapping[Coat, moderngl.Program]) -> None:
        """Draw parts by the programs of their coats."""
        arrays = {coat: self._buffer.array(program) for coat, program in programs.items()}
        for coat, first, num in parts:
            arrays[coat].render(vertices=num, first=first)

    def release(self) -> None:
        """Free its memory."""
        self._buffer.release()


SHADOW_MARGIN: Final = 0.3
"""A shadow reaches so far beyond the box of its entity [m]."""

SHADOW_LIFT: Final = 0.02
"""It is so high above the ground [m], above all paint."""


class MovingBuffer:
    """Triangles that are written anew for each frame, and the shadows below entities."""

    def __init__(self, context: moderngl.Context, shadow: moderngl.Program) -> None:
        self._buffer = _Buffer(context, bytes(MIN_BYTES), is_dynamic=True)
        self._shadows = context.buffer(reserve=MIN_BYTES, dynamic=True)
        self._shadow_array = context.vertex_array(shadow, [(self._shadows, "3f 2f", "place", "edge")])
        self._num_shadows = 0
        self._runs = _Runs(np.zeros((0, 3)), np.zeros(0, dtype=np.int64), REACH, np.zeros(0))

    def write(self, mesh: Mesh, frame: SceneFrame, origin: FloatArray) -> None:
        """Take the triangles and shadows of a frame.

        Args:
            origin: (3,) of the mesh.
        """
        packed = pack_vertices(mesh)
        _write(self._buffer.vertices, packed.tobytes())
        # Pieces that are drawn or left out: each entity is one, and the lenses of lights are several.
        step = np.arange(len(mesh)) // PIECE
        first = np.flatnonzero(np.diff(mesh.instance, prepend=-1) | ((mesh.instance == 0) & np.diff(step, prepend=0)))
        self._runs = _Runs(packed["place"], first, REACH, np.zeros(len(first)))
        shadows = _shadows(frame, origin).astype("<f4").tobytes()
        _write(self._shadows, shadows)
        self._num_shadows = len(shadows) // 20

    def visible(self, view: FloatArray, eye: FloatArray) -> list[tuple[int, int]]:
        """Return first vertex and number of vertices of what is in view, the nearest first."""
        rows, _ = self._runs.visible(view, eye)
        return list(zip(self._runs.first[rows].tolist(), self._runs.num[rows].tolist(), strict=True))

    def draw(self, parts: list[tuple[int, int]], program: moderngl.Program) -> None:
        """Draw parts by a program."""
        array = self._buffer.array(program)
        for first, num in parts:
            array.render(vertices=num, first=first)

    def draw_shadows(self) -> None:
        """Draw the shadows."""
        if self._num_shadows:
            self._shadow_array.render(vertices=self._num_shadows)


def _write(buffer: moderngl.Buffer, data: bytes) -> None:
    """Write into a buffer, which grows where it must."""
    if len(data) > buffer.size:
        buffer.orphan(2 * len(data))
    buffer.write(data)


PIECE: Final = 96
"""Triangles of lenses of lights that are drawn or left out together."""

REACH: Final = 400.0
"""Entities are drawn up to here [m]: a car is then three pixels high in a picture of 640 x 480."""

MIN_BYTES: Final = 1 << 16
"""Memory that is taken at first [bytes]."""

_SQUARE: Final = np.array([(-1, -1), (1, -1), (1, 1), (-1, -1), (1, 1), (-1, 1)], dtype=np.float64)


def _shadows(frame: SceneFrame, origin: FloatArray) -> FloatArray:
    """Return two triangles below each entity, (6 n, 5): place, and place within the shadow from -1 to 1."""
    half = 0.5 * frame.sizes[:, None, :2] + SHADOW_MARGIN
    local = np.concatenate([_SQUARE * half, np.full((len(frame), 6, 1), SHADOW_LIFT)], axis=2)
    local[:, :, 0] += frame.centres[:, None]
    turn = rotation(*frame.poses[:, 3:].T)
    placed = np.einsum("ijn,nkj->nki", turn, local) + (frame.poses[:, None, :3] - origin)
    return np.concatenate([placed, np.broadcast_to(_SQUARE, (len(frame), 6, 2))], axis=2).reshape(-1, 5)
