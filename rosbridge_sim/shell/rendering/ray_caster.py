"""Rays by Embree: what they meet first in a scene.

The static scene is prepared once, what moves for each frame anew: Embree ignores a mesh that is added after the first
ray. A ray is cast against both, and the nearer hit counts.

Paint has no height for rays: they go through it to the asphalt, and there a short ray from above tells whether it is
painted. Otherwise programs that keep all points above the road would keep lines and crosswalks.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rosbridge_sim.scenery.mesh import PAINTED, Label, Mesh
from rosbridge_sim.scenery.moving.moving_mesh import MovingScene
from rosbridge_sim.scenery.pictures import NOBODY, Hits
from rosbridge_sim.scenery.scene_frame import SceneFrame
from rosbridge_sim.shell.rendering.unavailable import missing_library
from rosbridge_sim.world.geometry.planar import FloatArray

if TYPE_CHECKING:
    from types import ModuleType

SAME_PLACE: Final = 25.0
"""Lidars in a square of this side share the triangles of what moves [m]."""

MAX_SIZE: Final = 20.0
"""The reference point of an entity may be so much farther away than what a ray meets [m]."""

FILM: Final = 0.03
"""Paint is within this height above or below the asphalt on which it lies [m]: on bends and hills both are cut into
different triangles."""


class RayCaster:
    """Casts rays; see `scenery.pictures.RayMaker`. One thread at a time may use it."""

    def __init__(self) -> None:
        """Load the library.

        Raises:
            RenderingUnavailableError: it is missing; the text says what to install.
        """
        self._embree = _load()
        self._moving_scene = MovingScene()
        self._static: tuple[Mesh, _Part, _Part] | None = None
        self._moving: tuple[SceneFrame, Mesh, tuple[float, ...], Mesh, Any] | None = None

    def cast(
        self,
        static: Mesh,
        frame: SceneFrame,
        origins: NDArray[np.float32],
        directions: NDArray[np.float32],
        max_range: float,
        *,
        without: int = NOBODY,
    ) -> Hits:
        """Return what rays meet first; see `scenery.pictures.RayMaker`."""
        directions = np.ascontiguousarray(directions, dtype=np.float32)
        origins = np.ascontiguousarray(np.broadcast_to(origins, directions.shape), dtype=np.float32)
        solid, paint = self._take_static(static)
        eye = origins.mean(axis=0, dtype=np.float64) + static.origin
        moving, moving_scene = self._take_moving(frame, static, without, eye, max_range)
        first = _run(solid.scene, origins, directions, np.full(len(directions), max_range, dtype=np.float32))
        second = _run(moving_scene, origins, directions, np.minimum(first[0], np.float32(max_range)))
        is_nearer = second[1] >= 0
        ranges = np.where(is_nearer, second[0], first[0])
        labels = np.zeros(len(ranges), dtype=np.uint8)
        instances = np.zeros(len(ranges), dtype=np.int32)
        normals = np.zeros((len(ranges), 3), dtype=np.float32)
        is_hit = np.isfinite(ranges)
        is_static = is_hit & ~is_nearer
        for mesh, rows, which in ((static, first[1], is_static), (moving, second[1], is_nearer)):
            triangle = solid.rows[rows[which]] if mesh is static else rows[which]
            labels[which], instances[which] = mesh.label[triangle], mesh.instance[triangle]
            # Normals of the static scene are kept; of what moves only those are needed that were met.
            normals[which] = static.normals[triangle] if mesh is static else mesh.pick(triangle).normals
        bare = np.flatnonzero(is_static & (labels == Label.ASPHALT))
        triangle = _find_paint(paint, origins[bare] + ranges[bare, None] * directions[bare])
        labels[bare[triangle >= 0]] = static.label[triangle[triangle >= 0]]
        away = np.einsum("ij,ij->i", normals, directions) > 0.0
        normals[away] *= -1.0
        return Hits(ranges, labels, instances, normals)

    def _take_static(self, static: Mesh) -> tuple[_Part, _Part]:
        """Return the solid part of the static scene and its paint, prepared once."""
        if self._static is None or self._static[0] is not static:
            is_paint = np.isin(static.label, PAINTED)
            rows = np.flatnonzero(~is_paint), np.flatnonzero(is_paint)
            solid, paint = (_Part(self._scene(static.pick(each)), each) for each in rows)
            self._static = static, solid, paint
        return self._static[1:]

    def _take_moving(
        self, frame: SceneFrame, static: Mesh, without: int, eye: FloatArray, reach: float
    ) -> tuple[Mesh, Any]:
        """Return the mesh and the scene of what moves, made once for all lidars of a carrier at a frame."""
        known = self._moving
        key = without, *(eye[:2] // SAME_PLACE).tolist(), reach
        if known is None or known[0] is not frame or known[1] is not static or known[2] != key:
            mesh = self._moving_scene.mesh(frame, static.origin, eye, reach + MAX_SIZE, near=0.0, has_lenses=False)
            if without != NOBODY:
                mesh = mesh.pick(mesh.instance != without + 1)
            known = self._moving = frame, static, key, mesh, self._scene(mesh)
        return known[3], known[4]

    def _scene(self, mesh: Mesh) -> Any:  # noqa: ANN401 - the library has no types
        """Return a scene of the library; None without triangles."""
        if not len(mesh):
            return None
        scene = self._embree.rtcore_scene.EmbreeScene()
        self._embree.mesh_construction.TriangleMesh(scene, mesh.vertices, mesh.triangles)
        return scene


class _Part(NamedTuple):
    """Some triangles of a mesh.

    Attributes:
        scene: of the library; None without triangles.
        rows: (k,) of the triangles in the mesh.
    """

    scene: Any  # the library has no types
    rows: NDArray[np.int64]


def _find_paint(paint: _Part, places: NDArray[np.floating]) -> NDArray[np.int64]:
    """Return the triangle of paint at each place (n, 3), (n,); -1 for none."""
    above = np.asarray(places + np.array((0.0, 0.0, FILM)), dtype=np.float32)
    down = np.tile(np.array([0.0, 0.0, -1.0], dtype=np.float32), (len(places), 1))
    _, rows = _run(paint.scene, above, down, np.full(len(places), 2.0 * FILM, dtype=np.float32))
    found = np.full(len(places), -1, dtype=np.int64)
    found[rows >= 0] = paint.rows[rows[rows >= 0]]
    return found


def _load() -> ModuleType:
    try:
        # Imported here, because a server without lidars never needs it.
        import embreex  # noqa: PLC0415
        import embreex.mesh_construction  # noqa: PLC0415
        import embreex.rtcore_scene  # noqa: PLC0415
    except ImportError as error:
        raise missing_library("lidars", "embreex") from error
    module: ModuleType = embreex
    return module


def _run(
    scene: Any,  # noqa: ANN401 - the library has no types
    origins: NDArray[np.float32],
    directions: NDArray[np.float32],
    reach: NDArray[np.float32],
) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
    """Return range and triangle of the nearest hit of each ray within its reach; inf and -1 for none."""
    if scene is None:
        return np.full(len(directions), np.inf, dtype=np.float32), np.full(len(directions), -1, dtype=np.int32)
    found = scene.run(origins, directions, dists=reach, query="INTERSECT", output=True)
    rows = found["primID"]
    return np.where(rows >= 0, found["tfar"], np.float32(np.inf)), rows
