"""Pictures of a camera behind the windscreen of egos, for observations; they need the extra `sensors`."""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from rosbridge_sim.scenery.camera_geometry import CameraModel, Pose, mount
from rosbridge_sim.scenery.pictures import Channel, PictureChoices
from rosbridge_sim.scenery.scene_frame import take_frame
from rosbridge_sim.scenery.static.static_mesh import static_mesh
from rosbridge_sim.shell.rendering.camera_renderer import CameraRenderer
from rosbridge_sim.world.state.world import Kind
from rosbridge_sim.worlds.stepped_worlds import SteppedWorlds

FOV_DEG: Final = 90.0

PLACE: Final = Pose(1.8, 0.0, 2.0, 0.0, math.radians(7.0), 0.0)
"""Ahead of the rear axle, above the ground, 7 deg down, as the camera of the server's preset `camera`."""


class EgoCameras:
    """A camera on each ego of some worlds of one map.

    Args:
        width: of the pictures [pixels].

    Raises:
        RenderingUnavailableError: the extra `sensors` or a graphics library is missing; the text says what to do.
    """

    def __init__(self, worlds: SteppedWorlds, width: int, height: int) -> None:
        self._worlds = worlds
        self._renderer = CameraRenderer()
        self._model = CameraModel(width, height, FOV_DEG)
        found = worlds.map_of(0)
        self._mesh = static_mesh(found.road_map, found.name, 0)

    def __reduce__(self) -> tuple[Any, ...]:
        """Return the arguments for a copy or pickle, which gets a renderer of its own."""
        return EgoCameras, (self._worlds, self._model.width, self._model.height)

    def draw(self) -> npt.NDArray[Any]:
        """Return the pictures, (num_worlds, num_egos, height, width, 3) uint8; black where there is no ego."""
        shape = (*self._worlds.has_ego.shape, self._model.height, self._model.width, 3)
        pictures = np.zeros(shape, dtype=np.uint8)
        for i in range(self._worlds.num_worlds):
            world = self._worlds.world(i)
            frame = take_frame(world)
            for j, row in enumerate(world.rows(Kind.EGO).tolist()):
                names = ("x", "y", "z", "roll", "pitch", "yaw")
                pose = mount(Pose(*(float(getattr(world, name)[row]) for name in names)), PLACE)
                without = int(world.uid[row])
                picture = self._renderer.render(
                    self._mesh, frame, self._model, pose, PictureChoices(without=without, channels=Channel.RGB)
                )
                assert picture.rgb is not None
                pictures[i, j] = picture.rgb
        return pictures
