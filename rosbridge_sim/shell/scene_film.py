"""A scenario that moves in this process, without a server, and pictures of it: from behind an ego, or by its camera.

The world is that of a server with the same settings. It moves in simulated time, as fast as it can be computed.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Final

import numpy as np

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.morai.releases import LENIENCY
from rosbridge_sim.records import replace
from rosbridge_sim.scenery.camera_geometry import Pose
from rosbridge_sim.scenery.pictures import NOBODY
from rosbridge_sim.schema.store import Store
from rosbridge_sim.shell.assembly import make_simulator_node
from rosbridge_sim.shell.config.settings import Settings
from rosbridge_sim.shell.drawing.sensor_makers import make_makers
from rosbridge_sim.shell.files.definitions import Texts, read_definitions
from rosbridge_sim.shell.files.rig_file import read_sensors
from rosbridge_sim.shell.rendering.unavailable import RenderingUnavailableError
from rosbridge_sim.simulator.replays.recording_builder import RecordingBuilder
from rosbridge_sim.simulator.replays.replay import Replay
from rosbridge_sim.simulator.sensor_data.lidar_sweep import Motion
from rosbridge_sim.simulator.sensor_rigs.mounted_sensors import MountedSensors
from rosbridge_sim.simulator.sensors.camera_sensor import CameraSpec
from rosbridge_sim.simulator.sensors.drawing import Sight, draw
from rosbridge_sim.simulator.sensors.picture_sensor import PictureSpec, Shot
from rosbridge_sim.suggestions import hint
from rosbridge_sim.world.geometry.planar import wrap_angle
from rosbridge_sim.world.state.world import DT

CHASE: Final = "chase"
"""Name of the view from behind the ego; a camera of this name is taken first."""

VIEW_HEIGHT: Final = math.radians(50.0)
PITCH, DISTANCE = 0.26, 13.0
FOCUS_AHEAD, FOCUS_HEIGHT = 3.5, 1.1
TURN_TIME: Final = 0.22
"""View from behind, as on the page (`page/js/drawing/chase_camera.js`): angle from the lower to the upper edge [rad],
angle downwards [rad] and distance [m] of the camera, the point that it looks at [m], and the time in which it turns
with the vehicle [s]."""

CHASE_SIZE: Final = (1280, 720)
"""Width and height of that view, unless the user chooses them [pixels]."""


class FilmCamera:
    """A choice of view.

    Attributes:
        spec: of the camera, with raw pictures.
        is_chase: it is the view from behind, and not a sensor.
    """

    def __init__(self, name: str, sensors: str, size: tuple[int, int] | None) -> None:
        """Find the camera.

        Args:
            name: of a camera, its number among the cameras from 0, or `CHASE`.
            sensors: rig of the ego: a preset or a file, as for a server.
            size: width and height [pixels]; None for those of the camera.

        Raises:
            DocumentError: there is no such camera, or the rig cannot be read.
        """
        cameras = [spec for spec in read_sensors(sensors) if isinstance(spec, PictureSpec)]
        names = [spec.frame_id for spec in cameras]
        self.is_chase = name == CHASE and CHASE not in names
        if self.is_chase:
            width, height = size or CHASE_SIZE
            fov = math.degrees(2.0 * math.atan(math.tan(0.5 * VIEW_HEIGHT) * width / height))
            spec: PictureSpec = CameraSpec(frame_id=CHASE, width=width, height=height, fov=min(fov, 170.0))
        elif name in names:
            spec = cameras[names.index(name)]
        elif name.isdecimal() and int(name) < len(cameras):
            spec = cameras[int(name)]
        else:
            known = [CHASE, *names]
            none = "" if cameras else "; --sensors camera brings one"
            raise DocumentError(f"--camera: expected {', '.join(known)}, got {name[:80]!r}{hint(name, known)}{none}")
        if size is not None:
            spec = spec.changed(width=size[0], height=size[1])
        self.spec = spec.changed(encoding="raw") if spec.picture == "rgb" else spec

    @property
    def size(self) -> tuple[int, int]:
        """Width and height [pixels]."""
        return self.spec.width, self.spec.height


class SceneFilm:
    """A world that moves, and the pictures of one camera."""

    def __init__(
        self,
        settings: Settings,
        camera: FilmCamera,
        *,
        ego: int = 0,
        recording: Path | None = None,
        is_driving: bool = True,
    ) -> None:
        """Begin the scenario.

        Args:
            settings: scenario, map, sensors, weather, traffic and seed, as of a server.
            camera: takes the pictures.
            ego: number of the ego that is followed, or that carries the camera.
            recording: a bag that moves the world; None for none.
            is_driving: the ego drives itself; a recording moves it otherwise.

        Raises:
            DocumentError: nothing can be drawn here, a file cannot be used, there is no such ego, or it cannot drive.
        """
        self._makers = make_makers()
        try:
            self._makers.pictures()  # before the world, which may take a while
        except RenderingUnavailableError as error:
            raise DocumentError(str(error)) from None
        texts = read_definitions(settings.release, settings.schema_path)
        bus = Bus(Store(texts, leniency=LENIENCY, ros=settings.ros))
        # The cameras are drawn here, and nobody subscribes to them: the rig of the node stays empty.
        self._node = make_simulator_node(bus, replace(settings, sensors="none"), None, None)
        self._camera, self._now = camera, 0.0
        found = self._node.egos.find(ego)
        if found is None or not found.is_there:
            raise DocumentError(f"--ego: expected the number of an ego of the scenario, got {ego}")
        self._ego = found
        if recording is not None:
            self._show(recording, texts)
        elif is_driving:
            why = found.drive_itself()
            if why:
                raise DocumentError(f"--drive self: {why}; --drive none lets it stand")
        self._heading = self.pose[5]

    @property
    def frame(self) -> int:
        """Number of the frame that the world shows."""
        return self._node.world.frame

    @property
    def pose(self) -> Pose:
        """Pose of the ego."""
        world, row = self._node.world, self._ego.row
        place = (world.x, world.y, world.z, world.roll, world.pitch, world.yaw)
        return Pose(*(column.item(row) for column in place))

    def advance(self, frame: int) -> bool:
        """Move the world up to a frame; return False if it stands before, because a recording is over."""
        while self.frame < frame:
            if self._node.next_due(self._now) is None:
                return False
            self._now += DT
            self._node.advance(self._now)
            turn = float(wrap_angle(self.pose[5] - self._heading))
            self._heading += turn * (1.0 - math.exp(-DT / TURN_TIME))
        return True

    def shoot(self) -> bytes:
        """Return what the camera sees now: the bytes of a sensor_msgs/Image."""
        sensors = self._node.component(MountedSensors)
        sight = Sight(self._camera.spec, self._motion(), NOBODY if self._camera.is_chase else self._ego.index)
        (result,) = draw(sensors.job_of([sight]), self._makers)
        assert isinstance(result, Shot), "the sight is of a camera"
        return result.data

    def close(self) -> None:
        """Give back what draws."""
        self._makers.close()

    def _motion(self) -> Motion:
        if not self._camera.is_chase:
            mounting = self._camera.spec.mounting
            own = Pose(*mounting.place, mounting.roll, mounting.pitch, mounting.yaw)
            return Motion(self.pose, own, 0.0, 0.0)
        level = Pose(*self.pose[:3], yaw=self._heading)
        back, up = DISTANCE * np.cos(PITCH), DISTANCE * np.sin(PITCH)
        return Motion(level, Pose(FOCUS_AHEAD - back, 0.0, FOCUS_HEIGHT + up, pitch=PITCH), 0.0, 0.0)

    def _show(self, path: Path, texts: Texts) -> None:
        """Let a recording move the world.

        Raises:
            DocumentError: the bag cannot be read, or there is nothing in it that can be shown.
        """
        # Imported here, because the libraries for bags take a tenth of a second.
        from rosbridge_sim.shell.bags.bag_reader import read_recording  # noqa: PLC0415

        builder = RecordingBuilder(path.name, self._node.context.convert)
        recording = read_recording(path, builder, texts)
        why = self._node.component(Replay).play(recording, self._now)
        if why:
            raise DocumentError(f"--recording: {path}: {why}")
