"""Results of cameras and lidars, and the interfaces of what draws them. They know no library.

`shell/rendering/` has the implementations. All of them see the same scene: a static `Mesh`, and the `SceneFrame` of
what moves.
"""

from __future__ import annotations

from enum import IntFlag, StrEnum
from typing import Final, Protocol

import numpy as np
from numpy.typing import NDArray

from rosbridge_sim.records import Record
from rosbridge_sim.scenery.camera_geometry import CameraModel, Pose
from rosbridge_sim.scenery.mesh import Mesh
from rosbridge_sim.scenery.scene_frame import SceneFrame

NOBODY = -1
"""No entity: nothing is left out of a picture."""


class Weather(StrEnum):
    """Light and air of a picture."""

    NOON = "noon"
    DUSK = "dusk"
    NIGHT = "night"
    RAIN = "rain"
    FOG = "fog"


EXTINCTION: Final = {
    Weather.NOON: 0.0006,
    Weather.DUSK: 0.0012,
    Weather.NIGHT: 0.0015,
    Weather.RAIN: 0.0055,
    Weather.FOG: 0.028,
}
"""Share of light that each metre of air takes [1/m]; our choice. What the eye sees ends at 3.912 over it (Koschmieder
1924): 140 m in this fog, 710 m in this rain."""


class Channel(IntFlag):
    """Parts of a picture."""

    RGB = 1
    DEPTH = 2
    LABEL = 4
    INSTANCE = 8
    ALL = 15


class Picture(Record, eq=False):
    """A picture of h rows and w columns, the upper left pixel first. A part that was not asked for is None.

    Attributes:
        rgb: (h, w, 3) uint8, antialiased if it was wanted so.
        depth: (h, w) float32, along the optical axis [m]; inf for the sky. Not antialiased, as the parts below.
        label: (h, w) uint8, see `mesh.Label`; 0 for the sky.
        instance: (h, w) int32, id of the entity plus 1; 0 for what is none.
    """

    rgb: NDArray[np.uint8] | None
    depth: NDArray[np.float32] | None
    label: NDArray[np.uint8] | None
    instance: NDArray[np.int32] | None


class Hits(Record, eq=False):
    """The first thing that each ray meets; arrays are (k,) unless told otherwise.

    Attributes:
        ranges: float32 [m]; inf for a ray that met nothing within its range.
        labels: uint8, see `mesh.Label`; 0 for none.
        instances: int32, id of the entity plus 1; 0 for none.
        normals: (k, 3) float32, unit normals that look towards the ray's origin; 0 for none.
    """

    ranges: NDArray[np.float32]
    labels: NDArray[np.uint8]
    instances: NDArray[np.int32]
    normals: NDArray[np.float32]


class PictureChoices(Record):
    """Choices for a picture.

    Attributes:
        weather: light and air.
        without: id of the entity that is left out, the one that carries the camera; `NOBODY` for none.
        channels: the parts of the picture that are wanted.
        is_smooth: colours are the mean of several samples of a pixel.
    """

    weather: Weather = Weather.NOON
    without: int = NOBODY
    channels: Channel = Channel.ALL
    is_smooth: bool = True


USUAL: Final = PictureChoices()


class PictureMaker(Protocol):
    """Draws pictures. It belongs to the thread that made it."""

    def render(
        self, static: Mesh, frame: SceneFrame, camera: CameraModel, pose: Pose, choices: PictureChoices = USUAL
    ) -> Picture:
        """Return the picture of a scene.

        Args:
            static: what does not move. It is prepared once and kept while the same object is given.
            camera: size, field of view and distortion.
            pose: of the camera in the map frame.
        """
        ...

    def close(self) -> None:
        """Give back what it holds."""
        ...


class RayMaker(Protocol):
    """Casts rays. It may be used by one thread at a time."""

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
        """Return what rays meet first.

        Args:
            static: what does not move. It is prepared once and kept while the same object is given.
            origins: (k, 3) or (1, 3) for all, map frame minus `static.origin` [m].
            directions: (k, 3) unit vectors, map frame.
            max_range: length of the rays [m].
            without: id of the entity that is left out; `NOBODY` for none.
        """
        ...
