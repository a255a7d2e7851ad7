"""Jobs and results of drawn sensors. A job is for one frame, and runs in a thread or a process of its own.

`draw` does a job. It touches nothing of the simulator's state: a job has copies. So it may run in any thread, and the
same job gives the same bytes.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from rosbridge_sim.loose_types import Struct
from rosbridge_sim.maps.road_map import RoadMap
from rosbridge_sim.records import Record
from rosbridge_sim.scenery.mesh import Mesh
from rosbridge_sim.scenery.pictures import PictureMaker, RayMaker, Weather
from rosbridge_sim.scenery.scene_frame import SceneFrame
from rosbridge_sim.simulator.sensor_data.lidar_sweep import Motion
from rosbridge_sim.simulator.sensors.sensor_context import SensorContext
from rosbridge_sim.simulator.sensors.sensor_noise import NoiseSource
from rosbridge_sim.simulator.sensors.sensor_specs import MountedSpec, SensorSpec


class Sighting(Record, eq=False):
    """Result of one reading of a drawn sensor."""

    @property
    def file(self) -> bytes:
        """Contents of its file; empty if it was not wanted."""
        return b""


class Makers(Record):
    """A renderer; it is made and used in one thread.

    Attributes:
        pictures: returns the maker of pictures, which is created at the first call.
        rays: the same for the maker of rays.
        encode_jpeg: `(picture, quality)`: returns the bytes of a JPEG.
        build: `(map, its name, seed, is_dressed)`: returns the static mesh; the same object as long as the arguments
            are the same.
        close: releases all resources.
    """

    pictures: Callable[[], PictureMaker]
    rays: Callable[[], RayMaker]
    encode_jpeg: Callable[[NDArray[np.uint8], int], bytes]
    build: Callable[[RoadMap, str, int, bool], Mesh]
    close: Callable[[], None] = lambda: None


class DrawnSpec(MountedSpec, frozen=True, kw_only=True):
    """A sensor that needs the scene as triangles: it has a `maker`."""

    def see(self, sight: Sight, static: Mesh, job: DrawingJob, makers: Makers) -> Sighting:
        """Return the result of a reading.

        Args:
            sight: of this sensor.
            static: mesh of everything that does not move.
            job: everything that moves, and the weather.
        """
        raise NotImplementedError

    def show(self, shared: SensorContext, number: int, header: Struct, result: Sighting) -> Struct | None:
        """Return the message of a result on one of the topics.

        Args:
            shared: of the simulator.
            number: of the topic in `topics`.
            header: of the frame that was drawn.
            result: of `see`.

        Returns:
            A generated struct; None if the result has none for this topic.
        """
        raise NotImplementedError


class Sight(Record):
    """One sensor of a job.

    Attributes:
        spec: of the sensor.
        motion: of its vehicle.
        carrier: id of the vehicle, which the sensor does not see.
        wanted: for each of its topics whether somebody wants the messages.
        is_for_file: the bytes of a file are wanted.
        errors: of the sensor; None for none.
    """

    spec: DrawnSpec
    motion: Motion
    carrier: int
    wanted: Sequence[bool] = ()
    is_for_file: bool = False
    errors: NoiseSource | None = None


class DrawingJob(Record, eq=False):
    """All that can be seen at one frame.

    Attributes:
        map_name: its name, which decides about what stands beside the roads, with the seed.
        seed: of the world.
        frame: what moves.
        sights: the sensors.
        weather: light and air.
        is_dressed: buildings, trees and posts stand beside the roads.
    """

    road_map: RoadMap
    map_name: str
    seed: int
    frame: SceneFrame
    sights: Sequence[Sight]
    weather: Weather = Weather.NOON
    is_dressed: bool = True


class SensorWorker(Protocol):
    """Does jobs one after the other, beside the simulator."""

    @property
    def is_busy(self) -> bool:
        """True if a job waits or is being done."""

    def why_not(self, specs: Sequence[DrawnSpec]) -> str:
        """Return why it cannot draw for some sensors, and what to do; empty if it can, as far as is known."""

    def submit(self, job: DrawingJob, then: Callable[[Sequence[Sighting] | Exception, float], None]) -> None:
        """Do a job.

        Args:
            then: called once with the results in the order of the sights, or what has gone wrong, and monotonic time
                [s]; between two frames, perhaps before this method returns.
        """


def drawn_of(specs: Sequence[SensorSpec]) -> list[DrawnSpec]:
    """Return the drawn ones of some sensors."""
    return [spec for spec in specs if isinstance(spec, DrawnSpec)]


def draw(job: DrawingJob, makers: Makers) -> list[Sighting]:
    """Return what the sensors of a job see, in their order."""
    static = makers.build(job.road_map, job.map_name, job.seed, job.is_dressed)
    return [sight.spec.see(sight, static, job, makers) for sight in job.sights]
