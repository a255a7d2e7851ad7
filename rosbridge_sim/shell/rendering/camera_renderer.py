"""Pictures by OpenGL, without a window: on a graphics card where there is one, on the processor where there is none.

A picture has two passes. The first one draws colours with four samples a pixel, or one if that is enough, the second
one classes, instances and depth with one, so that no pixel mixes two things.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from rosbridge_sim.scenery.camera_geometry import CameraModel, Pose, rotation
from rosbridge_sim.scenery.mesh import Mesh
from rosbridge_sim.scenery.moving.moving_mesh import MovingScene
from rosbridge_sim.scenery.pictures import EXTINCTION, USUAL, Channel, Picture, PictureChoices
from rosbridge_sim.scenery.scene_frame import SceneFrame, Shape
from rosbridge_sim.shell.rendering.gl_mesh import REACH, CellMesh, MovingBuffer, planes_of
from rosbridge_sim.shell.rendering.lens import Lens
from rosbridge_sim.shell.rendering.shaders import MAX_BEAMS, Coat, scene_fragment, source_of
from rosbridge_sim.shell.rendering.targets import Targets
from rosbridge_sim.shell.rendering.unavailable import RenderingUnavailableError, missing_library
from rosbridge_sim.shell.rendering.weather_looks import LOOKS, WeatherLook
from rosbridge_sim.world.geometry.planar import FloatArray

if TYPE_CHECKING:
    import moderngl

NEAR, FAR = 0.1, 3_000.0
"""Depths that are drawn [m]."""

SAMPLES: Final = 4
"""Samples a pixel of the colours: what every driver has."""

SAME_PLACE: Final = 10.0
"""Cameras nearer to each other than this may share the triangles of what moves [m]."""

BEAM_REACH: Final = 90.0
"""Vehicles nearer than this light the road at night [m]."""


class CameraRenderer:
    """Draws pictures of a scene. It belongs to the thread that made it; see `scenery.pictures.PictureMaker`."""

    def __init__(self) -> None:
        """Open the graphics library.

        Raises:
            RenderingUnavailableError: it is missing; the text says what to install.
        """
        context = self._context = open_context()
        self._scenes: dict[tuple[Coat, bool, bool], moderngl.Program] = {}
        self._classes = context.program(vertex_shader=source_of("class.vert"), fragment_shader=source_of("class.frag"))
        self._shadow = context.program(vertex_shader=source_of("shadow.vert"), fragment_shader=source_of("shadow.frag"))
        self._sky = context.program(vertex_shader=source_of("sky.vert"), fragment_shader=source_of("sky.frag"))
        corners = context.buffer(np.array([-1, -1, 3, -1, -1, 3], dtype="<f4").tobytes())
        self._sky_array = context.vertex_array(self._sky, [(corners, "2f", "corner")])
        self._static: tuple[Mesh, CellMesh] | None = None
        self._moving_scene = MovingScene()
        self._moving = MovingBuffer(context, self._shadow)
        self._frame: tuple[SceneFrame, Mesh, FloatArray, NDArray[np.bool_]] | None = None
        self._targets: dict[tuple[int, int, int], Targets] = {}
        self._lens: Callable[[CameraModel], Lens] = lru_cache(maxsize=MAX_LENSES)(Lens)

    @property
    def device(self) -> str:
        """Name of the renderer, as the graphics library tells it."""
        return str(self._context.info["GL_RENDERER"])

    @property
    def sizes(self) -> list[tuple[int, int, int]]:
        """Width, height and samples of the pictures that are prepared, the one that was made first at the front."""
        return list(self._targets)

    def render(
        self, static: Mesh, frame: SceneFrame, camera: CameraModel, pose: Pose, choices: PictureChoices = USUAL
    ) -> Picture:
        """Return the picture of a scene; see `scenery.pictures.PictureMaker`."""
        with self._context:  # another renderer of this thread may have been used since
            place, axes = np.array(pose[:3]), rotation(*pose[3:])
            lens = self._lens(camera) if camera.is_distorted else None
            planes = [(camera, axes)] if lens is None else [(view.camera, view.axes(axes)) for view in lens.views]
            sights = [(plane, *_matrices(plane, turn, place - static.origin)) for plane, turn in planes]
            which = np.any([_is_in_view(frame, static.origin, view) for _, view, _ in sights], axis=0)
            self._take_moving(frame, static, place, which)
            pictures = [self._draw(static, frame, sight, place - static.origin, choices) for sight in sights]
            return pictures[0] if lens is None else lens.bend(pictures)

    def _draw(
        self,
        static: Mesh,
        frame: SceneFrame,
        sight: tuple[CameraModel, FloatArray, FloatArray],
        eye: FloatArray,
        choices: PictureChoices,
    ) -> Picture:
        """Return a picture without distortion; what moves is there already."""
        channels, without, look = choices.channels, choices.without, LOOKS[choices.weather]
        cells = self._take_static(static)
        camera, view, back = sight
        targets = self._target(camera, SAMPLES if choices.is_smooth else 0)
        parts, movers = cells.visible(view, eye), self._moving.visible(view, eye)
        rgb = None
        rest: dict[Channel, NDArray[Any]] = {}
        if Channel.RGB in channels:
            programs = self._programs(choices, frame, view, eye, static.origin)
            targets.begin_colours(look.horizon)
            self._context.enable_only(self._context.DEPTH_TEST)
            self._moving.draw(movers, programs[Coat.PLAIN])
            cells.draw(parts, programs)
            self._draw_sky_and_shadows(targets, look, view, back)
            rgb = targets.read_rgb()
        if channels & ~Channel.RGB:
            self._classes["view"].write(_bytes_of(view))
            self._classes["without"] = without + 1
            targets.begin_classes()
            self._context.enable_only(self._context.DEPTH_TEST)
            self._moving.draw(movers, self._classes)
            cells.draw(parts, dict.fromkeys(Coat, self._classes))
            rest = {channel: targets.read(channel) for channel in channels & ~Channel.RGB}
        return Picture(rgb, rest.get(Channel.DEPTH), rest.get(Channel.LABEL), rest.get(Channel.INSTANCE))

    def close(self) -> None:
        """Free the memory of the graphics library."""
        with self._context:
            if self._static is not None:
                self._static[1].release()
                self._static = None
            for targets in self._targets.values():
                targets.release()
            self._targets.clear()
        self._context.release()

    def _draw_sky_and_shadows(self, targets: Targets, look: WeatherLook, view: FloatArray, back: FloatArray) -> None:
        context = self._context
        context.depth_func = "<="
        self._sky["back"].write(_bytes_of(back))
        self._sky["zenith"], self._sky["horizon"] = look.zenith, look.horizon
        width, height = targets.colours.size
        targets.colours.scissor = 0, 0, width, _sky_rows(back, height)
        self._sky_array.render(vertices=3)
        targets.colours.scissor = None
        context.depth_func = "<"
        context.enable_only(context.DEPTH_TEST | context.BLEND)
        targets.colours.depth_mask = False
        self._shadow["view"].write(_bytes_of(view))
        self._shadow["strength"] = look.shadow
        self._moving.draw_shadows()
        targets.colours.depth_mask = True

    def _programs(
        self, choices: PictureChoices, frame: SceneFrame, view: FloatArray, eye: FloatArray, origin: FloatArray
    ) -> dict[Coat, moderngl.Program]:
        """Return the programs for colours in a weather, all set for a picture."""
        look = LOOKS[choices.weather]
        sun = np.array(look.sun) / np.linalg.norm(look.sun)
        places, ways = _beams(frame, eye + origin) if look.is_dark else (np.zeros((0, 3)), np.zeros((0, 3)))
        rest = np.zeros((MAX_BEAMS - len(places), 3))
        values: dict[str, object] = {
            "view": tuple(view.T.reshape(-1).tolist()),
            "eye": tuple(eye.tolist()),
            "sun": tuple(sun.tolist()),
            "direct": look.direct,
            "ambient": look.ambient,
            "is_dark": look.is_dark,
            "haze_colour": look.horizon,
            "haze": EXTINCTION[choices.weather],
            "zenith": look.zenith,
            "without": choices.without + 1,
            "num_beams": len(places),
            "beam": look.beam,
            "beam_place": list(map(tuple, np.concatenate([places - origin, rest]).tolist())),
            "beam_way": list(map(tuple, np.concatenate([ways, rest]).tolist())),
        }
        programs = {}
        for coat in Coat:
            key = coat, look.is_dark, look.is_wet
            if key not in self._scenes:
                fragment = scene_fragment(coat, is_dark=look.is_dark, is_wet=look.is_wet)
                self._scenes[key] = self._context.program(
                    vertex_shader=source_of("scene.vert"), fragment_shader=fragment
                )
            program = programs[coat] = self._scenes[key]
            for name, value in values.items():
                if name in program:  # the library leaves out what a program does not use
                    program[name] = value
        return programs

    def _take_static(self, static: Mesh) -> CellMesh:
        if self._static is None or self._static[0] is not static:
            if self._static is not None:
                self._static[1].release()
            self._static = static, CellMesh(self._context, static)
        return self._static[1]

    def _take_moving(self, frame: SceneFrame, static: Mesh, eye: FloatArray, which: NDArray[np.bool_]) -> None:
        """Upload what moves in a picture; cameras at one place that see the same share it."""
        known = self._frame
        if (
            known is None
            or known[0] is not frame
            or known[1] is not static
            or np.hypot(*(known[2] - eye)[:2]) > SAME_PLACE
            or (which & ~known[3]).any()
        ):
            mesh = self._moving_scene.mesh(frame, static.origin, eye, REACH, which=which)
            self._moving.write(mesh, frame, static.origin)
            self._frame = frame, static, eye, which

    def _target(self, camera: CameraModel, samples: int) -> Targets:
        size = camera.width, camera.height
        key = *size, samples
        if key not in self._targets:
            pixels = camera.width * camera.height
            while self._targets and sum(w * h for w, h, _ in self._targets) + pixels > MAX_TARGET_PIXELS:
                self._targets.pop(next(iter(self._targets))).release()
            self._targets[key] = Targets(self._context, size, samples)
        return self._targets[key]


MAX_TARGET_PIXELS: Final = 4_000_000
"""Pixels of all sizes of pictures that are kept prepared beside one that is larger: 60 bytes each, 240 MB."""

MAX_LENSES: Final = 8
"""Lenses that are kept prepared."""


def _is_in_view(frame: SceneFrame, origin: FloatArray, view: FloatArray) -> NDArray[np.bool_]:
    """Return which entities may be in a picture, (n,): those whose sphere is not outside of it."""
    # A two-wheeler has its axles, and a bent leg is no farther away than the body is high.
    radius = np.abs(frame.centres) + frame.wheelbases + np.linalg.norm(frame.sizes, axis=1) + 1.0
    planes = planes_of(view)
    distances = (frame.poses[:, :3] - origin) @ planes[:, :3].T + planes[:, 3]
    return np.asarray((distances > -radius[:, None]).all(axis=1))


def _matrices(camera: CameraModel, axes: FloatArray, eye: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the matrix from the scene to the picture, its first row at the top, and that from the picture to rays.

    Args:
        axes: (3, 3) its directions forward, left and up, a column each.
        eye: its place in the scene [m].
    """
    look = np.array([-axes[:, 1], -axes[:, 2], axes[:, 0]])  # right, down, ahead
    half_x = camera.width / (2.0 * camera.focal)
    half_y = camera.height / (2.0 * camera.focal)
    view = np.zeros((4, 4))
    view[0, :3], view[1, :3] = look[0] / half_x, look[1] / half_y
    view[2, :3] = look[2] * (FAR + NEAR) / (FAR - NEAR)
    view[3, :3] = look[2]
    view[:, 3] = -view[:, :3] @ eye
    view[2, 3] -= 2.0 * FAR * NEAR / (FAR - NEAR)
    back = np.zeros((4, 4))
    back[:3, 0], back[:3, 1], back[:3, 2] = look[0] * half_x, look[1] * half_y, look[2]
    return view, back


def _sky_rows(back: FloatArray, height: int) -> int:
    """Return the number of rows, from the top, that show something above the horizon.

    Args:
        back: (4, 4) from the picture to rays.
        height: rows of the picture.
    """
    across, down, ahead = back[2, :3].tolist()  # height of a ray, by its place in the picture, -1 to 1 each
    if down >= -LEAST_TILT:  # the camera lies on its side, or is upside down
        return height
    lowest = (abs(across) + ahead) / -down
    return int(min(max(math.ceil(0.5 * height * (lowest + 1.0)) + 1, 1), height))


LEAST_TILT: Final = 0.05
"""A picture whose columns are less upright than this, as the height of a ray at its edge, may have sky everywhere."""


def _bytes_of(matrix: FloatArray) -> bytes:
    """Return a matrix column by column."""
    return np.asarray(matrix.T, dtype="<f4").tobytes()


def _beams(frame: SceneFrame, eye: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return places and directions of the head lamps of the nearest vehicles, (k, 3) each."""
    is_lit = frame.shapes < Shape.PERSON
    away = np.linalg.norm(frame.poses[:, :3] - eye, axis=1)
    rows = np.flatnonzero(is_lit & (away < BEAM_REACH))
    rows = rows[np.argsort(away[rows], kind="stable")][:MAX_BEAMS]
    ahead: NDArray[np.float64] = rotation(*frame.poses[rows, 3:].T)[:, 0].T if len(rows) else np.zeros((0, 3))
    nose = frame.centres[rows] + 0.5 * frame.sizes[rows, 0]
    places = frame.poses[rows, :3] + ahead * nose[:, None] + (0.0, 0.0, 0.65)
    ways = ahead - (0.0, 0.0, 0.06)
    return places, ways / np.maximum(np.linalg.norm(ways, axis=1), 1e-9)[:, None]


def open_context() -> moderngl.Context:
    """Return a context of OpenGL 3.3, which belongs to this thread.

    Raises:
        RenderingUnavailableError: a library is missing; the text says what to install.
    """
    try:
        # Imported here, because a server without cameras never needs it.
        import moderngl  # noqa: PLC0415
    except ImportError as error:
        raise missing_library("cameras", "moderngl") from error
    try:
        context = moderngl.create_context(require=330, standalone=True, backend="egl")
    except Exception as error:  # the library raises plain Exception
        raise RenderingUnavailableError(
            f"cameras need OpenGL 3.3 by EGL, and it cannot be opened: {error}. On Debian and Ubuntu:"
            " apt-get install libegl1 libgl1 libgl1-mesa-dri"
        ) from error
    context.gc_mode = "auto"  # what Python drops is freed, also the parts of framebuffers
    return context
