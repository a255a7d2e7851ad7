"""Base of all kinds of sensors, with the bounds of their options.

A kind of sensor is one class in one file, and a row in `sensor_table`. An object of it is one sensor: its options, and
what follows from them. Places are in the frame of the vehicle: x forward, y left of the middle of the rear axle, z up
from the ground below it [m]. Angles in specifications are degrees, because files and MORAI's panels have degrees: roll,
pitch (positive is down), yaw (positive is left).

The `frame_id` is the name of a sensor: of its frame in `/tf_static`, in the headers of its messages, and for commands.
Several cameras may publish on one topic; their messages differ in the `frame_id`.
"""

from __future__ import annotations

import math
import re
from typing import Annotated, Any, ClassVar, Final, Literal, NamedTuple, TypeAlias

from rosbridge_sim.documents.document_model import Table, number_within, text_within
from rosbridge_sim.loose_types import Struct
from rosbridge_sim.simulator.bus.network_settings import USUAL_RATE
from rosbridge_sim.simulator.bus.publisher_kinds import FRAME_RATE
from rosbridge_sim.simulator.egos.ego import Ego
from rosbridge_sim.simulator.egos.tf_publisher import BASE, CENTER, MAP, ODOM, WHEEL_FRAMES
from rosbridge_sim.simulator.sensors.morai_items import Item, Reading, place_of
from rosbridge_sim.simulator.sensors.sensor_context import SensorContext
from rosbridge_sim.simulator.sensors.sensor_noise import SensorNoise
from rosbridge_sim.world.vehicle.sensor_readings import Mounting

MAX_FOV: Final = 170.0
"""Largest horizontal field of view [deg]: a plane picture of 180 has no width."""

MAX_RAYS: Final = 500_000
"""Rays of a turn of all lidars of one ego together; the largest lidars on the market have 262,144 (128 x 2048)."""

MAX_RANGE: Final = 1000.0
"""Longest range of a sensor [m]."""

MAX_LEVER: Final = 100.0
"""Largest distance of a sensor from its vehicle's rear axle along each axis [m]; longer than any road train."""

MIN_RATE: Final = 0.1
"""Lowest rate [Hz]."""

MAX_NAME: Final = 100
"""Longest frame and topic [characters]: the prefix of a further ego is added, and the bus takes 256."""

GPS_FRAME, IMU_FRAME = "gps_link", "imu_link"
"""Frames of the sensors that each ego has."""

_FRAME_ID: Final = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]*")
_TOPIC: Final = re.compile(r"(?:/[A-Za-z][A-Za-z0-9_]*)+")
_TAKEN_FRAMES: Final = frozenset({MAP, ODOM, BASE, CENTER, *WHEEL_FRAMES, GPS_FRAME, IMU_FRAME})


def _check_frame(value: str) -> None:
    if len(value) > MAX_NAME or not _FRAME_ID.fullmatch(value):
        raise ValueError("expected letters, digits, _, . and -, at most 100")
    if value in _TAKEN_FRAMES:
        raise ValueError(f"expected a name other than the vehicle's own frames {', '.join(sorted(_TAKEN_FRAMES))}")


def _check_topic(value: str) -> None:
    if len(value) > MAX_NAME or not _TOPIC.fullmatch(value):
        raise ValueError("expected the name of a topic, such as /lidar3D, at most 100 characters")


FrameId = Annotated[str, text_within(check=_check_frame, pattern=f"^{_FRAME_ID.pattern}$")]
TopicName = Annotated[str, text_within(check=_check_topic, pattern=f"^{_TOPIC.pattern}$")]
_Metres = Annotated[float, number_within(-MAX_LEVER, MAX_LEVER)]
_Degrees = Annotated[float, number_within(-360.0, 360.0)]
Rate = Annotated[float, number_within(MIN_RATE, FRAME_RATE)]
Range = Annotated[float, number_within(0.1, MAX_RANGE)]
Near = Annotated[float, number_within(0.0, MAX_RANGE)]
Fov = Annotated[float, number_within(1.0, MAX_FOV)]


class Cost(NamedTuple):
    """Cost of a message of a sensor.

    Attributes:
        num_pixels: of a picture.
        num_rays: of a turn.
        num_bytes: of a raw picture, or of all points of a turn.
    """

    num_pixels: int = 0
    num_rays: int = 0
    num_bytes: int = 0


class SensorSpec(Table, frozen=True, kw_only=True):
    """One sensor of an ego.

    Attributes:
        x, y, z: forward, left and up of the middle of the rear axle on the ground [m].
        roll, pitch, yaw: orientation [deg]; a positive pitch looks down, a positive yaw to the left.

        kind: name of the kind in files.
        type_name: type of the messages of a kind with one topic.
        is_on_each_ego: each ego has one, and it is published with the frame; `--rate` has its rate.
        is_picture: it has pictures, and so an optical frame.
        maker: field of `Makers` that draws it; empty if no scene is needed.
        has_turns: a frame reads a bounded number of them, so that each has its turn.
        noise_key: field of `SensorNoise` with a share of lost messages; empty for none.
        morai_noun: name of the kind in messages about MORAI's files.
        morai_lists: lists of the kind in such a file.
    """

    kind: ClassVar[str] = ""
    type_name: ClassVar[str] = ""
    is_on_each_ego: ClassVar[bool] = False
    is_picture: ClassVar[bool] = False
    maker: ClassVar[Literal["", "pictures", "rays"]] = ""
    has_turns: ClassVar[bool] = False
    noise_key: ClassVar[str] = ""
    morai_noun: ClassVar[str] = ""
    morai_lists: ClassVar[tuple[str, ...]] = ()
    x: _Metres = 0.0
    y: _Metres = 0.0
    z: _Metres = 0.0
    roll: _Degrees = 0.0
    pitch: _Degrees = 0.0
    yaw: _Degrees = 0.0

    @property
    def frame_id(self) -> str:
        """Name of the sensor and of its frame."""
        raise NotImplementedError

    @property
    def topic(self) -> str:
        """Its first topic; a further ego's has the ego's prefix."""
        raise NotImplementedError

    @property
    def rate(self) -> float:
        """Messages a second of simulated time [Hz]."""
        raise NotImplementedError

    @property
    def mounting(self) -> Mounting:
        """Place and orientation on the vehicle."""
        return Mounting(self.x, self.y, self.z, *map(math.radians, (self.roll, self.pitch, self.yaw)))

    @property
    def frames(self) -> list[str]:
        """Its frames: its own, and that of its picture."""
        return [self.frame_id, f"{self.frame_id}_optical"] if self.is_picture else [self.frame_id]

    @property
    def topics(self) -> list[tuple[str, str]]:
        """Its topics, each with its type; a later one with the type of the first is another name of its messages."""
        return [(self.topic, self.type_name)]

    @property
    def cost(self) -> Cost:
        """Cost of a message."""
        return Cost()

    @property
    def file_name(self) -> str:
        """Name of its file in a capture, with `{}` for the name of the capture; empty for none."""
        return ""

    def check(self) -> None:
        """Check that the options fit each other.

        Raises:
            FieldError: they do not.
        """

    def of_morai(self, item: Item, reading: Reading) -> dict[str, Any]:
        """Return the keys of a sensor in a file of MORAI; `self` has the defaults."""
        period = item.block.sensorPeriod
        if period is not None and period > 0.0:
            flag = f"--rate {self.topic}={1.0 / period:.3g}"
            reading.remarks.append(f"the rate of the {self.morai_noun} is that of the settings: {flag}")
        return place_of(item)

    def lost_share(self, noise: SensorNoise) -> float:
        """Return the share of the messages that are lost."""
        return getattr(noise, self.noise_key).lost if self.noise_key else 0.0

    def read(self, shared: SensorContext, ego: Ego, number: int) -> Struct | None:  # noqa: ARG002 - for kinds that have some
        """Return the message of this frame on one of the topics.

        Args:
            shared: of the simulator.
            ego: has the sensor.
            number: of the topic in `topics`.

        Returns:
            A generated struct; None if there is none, or none before the sensor is drawn.
        """
        return None

    def file(self, shared: SensorContext, ego: Ego) -> bytes:
        """Return the contents of `file_name` at this frame; a drawn sensor has them in its result."""
        raise NotImplementedError


class EgoSensorSpec(SensorSpec, frozen=True, kw_only=True):
    """A sensor that each ego has once; the settings of topics have its rate."""

    is_on_each_ego: ClassVar[bool] = True
    rate: ClassVar[float] = USUAL_RATE

    @staticmethod
    def as_text(frame: int, message: Struct) -> bytes:
        """Return the contents of the file of a capture."""
        raise NotImplementedError

    def measure(self, shared: SensorContext, ego: Ego) -> Struct:
        """Return the message of this frame."""
        raise NotImplementedError

    def file(self, shared: SensorContext, ego: Ego) -> bytes:
        """Return the file of a capture."""
        return self.as_text(shared.simulator.world.frame, self.measure(shared, ego))


class MountedSpec(SensorSpec, frozen=True, kw_only=True):
    """A sensor that an ego may have several of.

    Attributes:
        frame_id: name of the sensor and of its frame.
        topic: where it publishes; a further ego's has the ego's prefix.
        rate: messages a second of simulated time [Hz].
    """

    frame_id: FrameId
    topic: TopicName
    rate: Rate = 10.0

    def of_morai(self, item: Item, reading: Reading) -> dict[str, Any]:
        """Return the keys of a sensor in a file of MORAI; see `SensorSpec.of_morai`."""
        return reading.common(item, self.topic, self.frame_id)


Rig: TypeAlias = tuple[SensorSpec, ...]
"""The sensors of an ego, in the order of their numbers; `complete` adds a GPS and an IMU that nobody has moved."""
