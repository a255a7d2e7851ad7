"""`/tf` and `/tf_static`: poses of the egos, and of the points and sensors that are fixed to them.

    map                  the map's own frame: ENU metres
      base_link          the first ego: the middle of its rear axle on the ground, x forward, y left, z up
        vehicle_center   the middle of its bounding box; static, and different for each model
        gps_link         its GPS antenna; static until a client moves it
        imu_link         its inertial unit, the same
        Camera           a camera of --sensors, for example; lidars and radars likewise
          Camera_optical its picture: x right, y down, z ahead (REP 103)
        front_left_wheel its wheels, if it has a `/robot_description`: they turn with the steering, and do not roll
      Ego-2/base_link    a further ego, and so on
        Ego-2/vehicle_center, ...

With `--tf-frames map-odom` there is `odom` between `map` and `base_link`, as REP 105 has it; see `odometry`. With
`odom` there is no transform from `map` to `odom`: a localization of the user publishes it.

MORAI writes `/map` and `/base_link`, as old ROS did. tf2 refuses names that begin with a slash, and most programs use
tf2. So the names have no slash.

A static message holds all static frames and is latched, so a late subscriber gets all of them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Final, Literal, NamedTuple, TypeAlias

from rosbridge_sim.loose_types import Struct
from rosbridge_sim.morai.messages.convert import Converter, maker
from rosbridge_sim.records import Record
from rosbridge_sim.schema.store import Store
from rosbridge_sim.simulator.bus.publishers import Publishers
from rosbridge_sim.simulator.egos.ego import Ego
from rosbridge_sim.simulator.egos.ego_registry import EgoRegistry
from rosbridge_sim.simulator.egos.odometry import seen_from
from rosbridge_sim.world.geometry.planar import Quaternion, Vector, quaternion
from rosbridge_sim.world.state.world import World
from rosbridge_sim.world.vehicle.sensor_readings import Mounting

TF: Final = "tf2_msgs/TFMessage"

MAP: Final = "map"
ODOM: Final = "odom"
BASE: Final = "base_link"
CENTER: Final = "vehicle_center"
WHEEL_FRAMES: Final = ("front_left_wheel", "front_right_wheel", "rear_left_wheel", "rear_right_wheel")

TfFrames: TypeAlias = Literal["map", "map-odom", "odom"]
"""`--tf-frames`: frames above `base_link`, beginning with the one that has no parent on `/tf`."""

_OPTICAL: Final = Mounting(roll=-0.5 * math.pi, yaw=-0.5 * math.pi)
"""From x forward, y left, z up to x right, y down, z ahead."""


class Mount(Record):
    """A frame that is fixed to a vehicle.

    Attributes:
        parent, name: names of the frames.
        mounting: pose of `name` in `parent`.
    """

    parent: str
    name: str
    mounting: Mounting


class Wheel(NamedTuple):
    """A wheel of an ego, in `base_link`.

    Attributes:
        name: of its frame, without the prefix of the ego.
        place: of its middle [m].
        radius, width: [m].
        max_steer: greatest angle to either side [rad].
    """

    name: str
    place: Vector
    radius: float
    width: float
    max_steer: float


class TfPublisher:
    """Maker of the messages of both topics; structs of tf2_msgs/TFMessage."""

    def __init__(
        self,
        store: Store,
        world: World,
        convert: Converter,
        frames: TfFrames = "map",
        wheels: Callable[[Ego], Iterable[Wheel]] | None = None,
    ) -> None:
        """Read nothing yet.

        Args:
            frames: above `base_link`.
            wheels: those of an ego; None for no frames of wheels.
        """
        self._world = world
        self._convert = convert
        self._frames = frames
        self._wheels = wheels
        self._message = maker(store, TF, "transforms")
        self._stamped = maker(store, "geometry_msgs/TransformStamped", "header child_frame_id transform")
        self._transform = maker(store, "geometry_msgs/Transform", "translation rotation")
        self._vector = maker(store, "geometry_msgs/Vector3", "x y z")
        self._quaternion = maker(store, "geometry_msgs/Quaternion", "x y z w")

    def moving(self, egos: Iterable[Ego]) -> Struct:
        """Return the poses of the egos and of their moving frames, in the order of the egos.

        Returns:
            A TFMessage with a transform for each frame.
        """
        world = self._world
        frame, header = world.frame, self._convert.header
        transforms = []
        for ego in egos:
            prefix = ego.frame_prefix
            if self._frames == "map-odom":
                *place, yaw = ego.odom_origin
                pose = self._pose((place[0], place[1], place[2]), quaternion(0.0, 0.0, yaw))
                transforms.append(self._stamped(header(frame, MAP), prefix + ODOM, pose))
            parent, place_of_base, axes = pose_of_base(world, ego, self._frames)
            transforms.append(self._stamped(header(frame, parent), prefix + BASE, self._pose(place_of_base, axes)))
            if self._wheels is not None:
                transforms += self._turned(prefix, ego.row, self._wheels(ego))
        return self._message(transforms)

    def _turned(self, prefix: str, row: int, wheels: Iterable[Wheel]) -> Iterator[Struct]:
        world = self._world
        header = self._convert.header(world.frame, prefix + BASE)
        front, rear = [quaternion(0.0, 0.0, angle.item(row)) for angle in (world.steer, world.rear_steer)]
        for wheel in wheels:
            axes = front if wheel.name.startswith("front") else rear
            yield self._stamped(header, prefix + wheel.name, self._pose(wheel.place, axes))

    def mounts(self, egos: Iterable[Ego]) -> tuple[Mount, ...]:
        """Return the frames that are fixed to the egos.

        Returns:
            The middle of the bounding box and the sensors of each ego, in the egos' order, and the pictures' frames.
        """
        found = []
        for ego in egos:
            body, prefix = self._world.bodies[ego.row], ego.frame_prefix
            mountings = {CENTER: Mounting(x=body.centre, z=0.5 * body.height)} | ego.mountings
            found += [Mount(prefix + BASE, prefix + name, mounting) for name, mounting in mountings.items()]
            found += [Mount(prefix + name, f"{prefix}{name}_optical", _OPTICAL) for name in ego.optical_frames]
        return tuple(found)

    def static(self, mounts: Sequence[Mount]) -> Struct:
        """Return a message with frames that `mounts` found.

        Args:
            mounts: the frames; none is no error.

        Returns:
            A TFMessage with a transform for each.
        """
        frame = self._world.frame
        transforms = []
        for mount in mounts:
            pose = self._pose(mount.mounting.place, mount.mounting.orientation)
            transforms.append(self._stamped(self._convert.header(frame, mount.parent), mount.name, pose))
        return self._message(transforms)

    def _pose(self, place: Vector, axes: Quaternion) -> Struct:
        return self._transform(self._vector(*place), self._quaternion(*axes))


class StaticTf:
    """Publisher of `/tf_static`; latched.

    Attributes:
        on_announce: `(now)` after each look at the frames, whether they differ or not: an ego may have another model.
    """

    def __init__(self, transforms: TfPublisher, egos: EgoRegistry, publishers: Publishers) -> None:
        """Create the topic; nothing is published before the first `announce`.

        Args:
            egos: the vehicles that the frames are fixed to.
        """
        self._transforms = transforms
        self._egos = egos
        self._publishers = publishers
        self._topic = publishers.keep("/tf_static", TF, is_exclusive=False)
        self._mounts: tuple[Mount, ...] | None = None
        self.on_announce: list[Callable[[float], object]] = []

    def announce(self, now: float) -> None:
        """Publish the fixed frames, if they differ from the ones published last."""
        mounts = self._transforms.mounts(self._egos)
        if mounts != self._mounts:
            self._mounts = mounts
            self._publishers.update(self._topic, self._transforms.static(mounts), now)
        for follow in self.on_announce:
            follow(now)

    def mounts_of(self, ego: Ego) -> tuple[Mount, ...]:
        """Return the frames that are fixed to an ego, as they are on the topic."""
        return self._transforms.mounts([ego])

    def announce_again(self, now: float) -> None:
        """Publish the fixed frames even if they have not changed, because their stamp has."""
        self._mounts = None
        self.announce(now)


def pose_of_base(world: World, ego: Ego, frames: TfFrames) -> tuple[str, Vector, Quaternion]:
    """Return the frame above `base_link` of an ego, and the place [m] and the orientation of `base_link` in it."""
    row, (x, y, z, yaw) = ego.row, ego.pose
    parent = MAP
    if frames != "map":
        parent = ego.frame_prefix + ODOM
        x, y, z, yaw = seen_from(ego.odom_origin, (x, y, z, yaw))
    return parent, (x, y, z), quaternion(world.roll.item(row), world.pitch.item(row), yaw)
