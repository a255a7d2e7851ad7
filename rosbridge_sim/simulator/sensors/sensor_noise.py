"""Errors of real sensors: noise, a bias that wanders, drop-outs and lost messages.

A reading of one axis of GPS and IMU gets

    error(t) = offset n_0 + wander b(t) + white n(t)

with independent normal numbers n. The bias b has the variance 1 and forgets its past after about `time`: between
knots that are `time` apart, b = cos(p) n_i + sin(p) n_i+1, with p from 0 to pi/2.

All normal numbers are hashes of the world's seed, the ego's id, the axis and the frame. So there is no state: readings
repeat to the bit after a reset, from a snapshot and in every process, however often they are read. Another seed gives
other errors. `drawn_errors` has the errors of cameras, lidars and radars, from a generator with such a hash as seed.

`TYPICAL` has the figures of usual units: a GPS receiver without corrections (u-blox NEO-M8, data sheet: 2.5 m CEP), and
an inertial unit of the kind that is built into drones and cars (Bosch BMI088, data sheet: 0.014 deg/s and 175 ug for
each root of a hertz, zero offsets up to 1 deg/s and 20 mg) with an orientation filter (Xsens MTi-3, data sheet: 0.8 and
2 deg). Ranges of a lidar have those of a VLP-16 (data sheet: +-3 cm, taken as two standard deviations). The figures of
cameras and radars, and those of drop-outs, are our choice.
"""

from __future__ import annotations

import math
from hashlib import blake2b
from typing import Annotated, Final

import numpy as np

from rosbridge_sim.documents.document_model import DocumentType, Ratio, Table, number_within
from rosbridge_sim.documents.document_reading import read_document
from rosbridge_sim.world.geometry.planar import Vector, chain, quaternion
from rosbridge_sim.world.state.world import DT
from rosbridge_sim.world.vehicle.sensor_readings import Inertia

MAX_NOISE_BYTES: Final = 1 << 16
"""Longest document [bytes]; all keys together take less than 1 kB."""

MAX_SIGMA: Final = 1e4
"""Largest standard deviation, in the unit of the axis."""

MIN_TIME: Final = 0.1
MAX_TIME: Final = 1e6
"""Bounds of durations [s]."""

MAX_RATE: Final = 36_000.0
"""Most drop-outs in an hour: ten in a second."""


MAX_BLUR: Final = 5.0
"""Largest blur [pixels]: it costs 31 products a pixel and side."""

MAX_EXPOSURE: Final = 8.0
"""Largest exposure: 256 times the light."""

MAX_CLUTTER: Final = 100.0
"""Most echoes in a scan that nothing gives."""


_Sigma = Annotated[float, number_within(0.0, MAX_SIGMA)]
_Time = Annotated[float, number_within(MIN_TIME, MAX_TIME)]
_Grey = Annotated[float, number_within(0.0, 255.0)]
_Blur = Annotated[float, number_within(0.0, MAX_BLUR)]
_Exposure = Annotated[float, number_within(-MAX_EXPOSURE, MAX_EXPOSURE)]
_Clutter = Annotated[float, number_within(0.0, MAX_CLUTTER)]
_Rate = Annotated[float, number_within(0.0, MAX_RATE)]


class AxisNoise(Table, frozen=True, kw_only=True):
    """Error of one axis; standard deviations in its unit.

    Attributes:
        white: of the noise that is new in each frame.
        wander: of the bias that changes slowly.
        time: the bias forgets its past after this time [s].
        offset: of the error that stays for the whole run.
    """

    white: _Sigma = 0.0
    wander: _Sigma = 0.0
    time: _Time = 100.0
    offset: _Sigma = 0.0

    @property
    def variance(self) -> float:
        """Mean square of the error."""
        return float(self.white * self.white + self.wander * self.wander + self.offset * self.offset)


class GpsNoise(Table, frozen=True, kw_only=True):
    """Errors of `/gps`.

    Attributes:
        horizontal: to the east and to the north [m].
        vertical: [m].
        drop_outs_per_hour: how often the fix is lost.
        drop_out_time: for how long [s].
    """

    horizontal: AxisNoise = AxisNoise()
    vertical: AxisNoise = AxisNoise()
    drop_outs_per_hour: _Rate = 0.0
    drop_out_time: _Time = 5.0


class ImuNoise(Table, frozen=True, kw_only=True):
    """Errors of `/imu`, along the axes of the sensor.

    Attributes:
        angular_velocity: [rad/s].
        acceleration: [m/s^2].
        roll_pitch: of the orientation [rad].
        yaw: of the orientation [rad].
        lost: share of the messages that are lost.
    """

    angular_velocity: AxisNoise = AxisNoise()
    acceleration: AxisNoise = AxisNoise()
    roll_pitch: AxisNoise = AxisNoise()
    yaw: AxisNoise = AxisNoise()
    lost: Ratio = 0.0


class CameraNoise(Table, frozen=True, kw_only=True):
    """Errors of the colours of cameras. Depth, classes, instances and boxes stay exact.

    Attributes:
        dark: standard deviation of the noise of a black pixel [grey levels of 255].
        light: of the noise that light adds to a white pixel [grey levels].
        blur: standard deviation of the blur [pixels].
        exposure: each 1 doubles the light, each -1 halves it.
        lost: share of the pictures that are lost.
    """

    dark: _Grey = 0.0
    light: _Grey = 0.0
    blur: _Blur = 0.0
    exposure: _Exposure = 0.0
    lost: Ratio = 0.0


class LidarNoise(Table, frozen=True, kw_only=True):
    """Errors of 3D and 2D lidars.

    Attributes:
        range: standard deviation of ranges [m].
        intensity: of intensities, which are 0 to 255.
        drop_out: share of the echoes that are lost.
        drop_out_far: further share at the longest range; it grows with the square of the range.
        drop_out_grazing: further share where the beam grazes a surface; it grows with 1 - cos of the incidence.
        lost: share of the messages that are lost.
    """

    range: _Sigma = 0.0
    intensity: _Grey = 0.0
    drop_out: Ratio = 0.0
    drop_out_far: Ratio = 0.0
    drop_out_grazing: Ratio = 0.0
    lost: Ratio = 0.0


class RadarNoise(Table, frozen=True, kw_only=True):
    """Errors of radars.

    Attributes:
        range: standard deviation of distances [m].
        azimuth: of directions [rad].
        range_rate: [m/s].
        amplitude: [dB].
        drop_out: share of the echoes that are lost.
        clutter: mean number of echoes in a scan that nothing gives.
        lost: share of the messages that are lost.
    """

    range: _Sigma = 0.0
    azimuth: _Sigma = 0.0
    range_rate: _Sigma = 0.0
    amplitude: _Sigma = 0.0
    drop_out: Ratio = 0.0
    clutter: _Clutter = 0.0
    lost: Ratio = 0.0


class SensorNoise(Table, frozen=True, kw_only=True):
    """Errors of the sensors; all are 0 unless they are given."""

    gps: GpsNoise = GpsNoise()
    imu: ImuNoise = ImuNoise()
    camera: CameraNoise = CameraNoise()
    lidar: LidarNoise = LidarNoise()
    radar: RadarNoise = RadarNoise()


_MG: Final = 9.80665e-3
_BAND: Final = 5.0  # root of the 25 Hz that readings at 50 Hz can show

TYPICAL: Final = SensorNoise(
    gps=GpsNoise(
        # 2.5 m CEP is 2.1 m along each axis; nearly all of it changes within minutes only. Heights are half as good.
        horizontal=AxisNoise(white=0.3, wander=2.1),
        vertical=AxisNoise(white=0.6, wander=4.2),
        drop_outs_per_hour=6.0,
    ),
    imu=ImuNoise(
        # The limits of the offsets count as three standard deviations.
        angular_velocity=AxisNoise(
            white=math.radians(0.014) * _BAND, wander=math.radians(2.0 / 3600.0), offset=math.radians(1.0 / 3.0)
        ),
        acceleration=AxisNoise(white=0.175 * _BAND * _MG, wander=0.1 * _MG, offset=20.0 / 3.0 * _MG),
        roll_pitch=AxisNoise(wander=math.radians(0.8)),
        yaw=AxisNoise(wander=math.radians(2.0)),
    ),
    camera=CameraNoise(dark=1.0, light=4.0),
    lidar=LidarNoise(range=0.015, intensity=2.0, drop_out=0.002, drop_out_far=0.1, drop_out_grazing=0.1),
    radar=RadarNoise(range=0.25, azimuth=0.005, range_rate=0.1, amplitude=2.0, drop_out=0.02, clutter=1.0),
)
"""See the head of this file. Drop-outs are our estimate for a town."""

NOISE: Final = DocumentType[SensorNoise](SensorNoise)


def read_noise(text: bytes, source: str) -> SensorNoise:
    """Read a document of sensor noise.

    Args:
        text: JSON.
        source: its name, for errors.

    Raises:
        DocumentError: it is no such document; the text has the place and the mistake.
    """
    return read_document(NOISE, text, source, MAX_NOISE_BYTES)


class NoiseSource:
    """Errors of the sensors of one vehicle in one frame.

    Args:
        noise: how large they are.

    Attributes:
        noise: how large they are.
    """

    def __init__(self, noise: SensorNoise, seed: int, uid: int, frame: int) -> None:
        self.noise = noise
        self._key = blake2b(f"{seed} {uid}".encode(), digest_size=32).digest()
        self._frame = frame

    def locate(self, place: Vector) -> Vector | None:
        """Return a place with the errors of the GPS [m]; None without a fix."""
        gps = self.noise.gps
        if gps.drop_outs_per_hour > 0.0:
            # At most one drop-out within each stretch of this length, which begins at a random moment in it.
            stretch = max(3600.0 / gps.drop_outs_per_hour, gps.drop_out_time)
            number, into = divmod(self._frame * DT, stretch)
            start = self._uniform("drop-out", int(number)) * (stretch - gps.drop_out_time)
            if start <= into < start + gps.drop_out_time:
                return None
        x, y, z = place
        return (
            x + self._error("east", gps.horizontal),
            y + self._error("north", gps.horizontal),
            z + self._error("up", gps.vertical),
        )

    def feel(self, exact: Inertia) -> Inertia:
        """Return a reading of the inertial unit with its errors."""
        imu = self.noise.imu
        lean = [self._error(axis, imu.roll_pitch) for axis in ("roll", "pitch")]
        axes = chain(exact.orientation, quaternion(lean[0], lean[1], 0.0))
        return Inertia(
            chain(quaternion(0.0, 0.0, self._error("yaw", imu.yaw)), axes),
            self._shift("rate", exact.angular_velocity, imu.angular_velocity),
            self._shift("accel", exact.acceleration, imu.acceleration),
        )

    def is_imu_lost(self) -> bool:
        """Return whether the message of the inertial unit is lost in this frame."""
        share = float(self.noise.imu.lost)
        return share > 0.0 and self._uniform("lost", self._frame) < share

    def is_lost(self, name: str, share: float) -> bool:
        """Return whether the message of a sensor is lost in this frame.

        Args:
            name: of the sensor.
        """
        return share > 0.0 and self._uniform(f"lost {name}", self._frame) < share

    def generator(self, name: str) -> np.random.Generator:
        """Return random numbers for a sensor in this frame."""
        seed = blake2b(f"array {name} {self._frame}".encode(), digest_size=16, key=self._key).digest()
        return np.random.default_rng(int.from_bytes(seed))

    def _shift(self, what: str, exact: Vector, noise: AxisNoise) -> Vector:
        """Return a vector with the errors of its axes."""
        x, y, z = (value + self._error(f"{what} {axis}", noise) for axis, value in zip("xyz", exact, strict=True))
        return x, y, z

    def _error(self, axis: str, noise: AxisNoise) -> float:
        error = 0.0
        if noise.offset > 0.0:
            error += noise.offset * self._normal(axis + " offset", 0)
        if noise.wander > 0.0:
            knot, part = divmod(self._frame * DT / noise.time, 1.0)
            angle = 0.5 * math.pi * part
            first, second = (self._normal(axis + " wander", int(knot) + i) for i in (0, 1))
            error += noise.wander * (math.cos(angle) * first + math.sin(angle) * second)
        if noise.white > 0.0:
            error += noise.white * self._normal(axis + " white", self._frame)
        return error

    def _uniform(self, name: str, number: int) -> float:
        """Return a number within [0, 1) that stands for a name and a number."""
        return self._draw(name, number)[0]

    def _normal(self, name: str, number: int) -> float:
        """Return a number of the standard normal distribution (Box and Muller 1958)."""
        first, second = self._draw(name, number)
        return math.sqrt(-2.0 * math.log(1.0 - first)) * math.cos(2.0 * math.pi * second)

    def _draw(self, name: str, number: int) -> tuple[float, float]:
        bits = blake2b(f"{name} {number}".encode(), digest_size=16, key=self._key).digest()
        return int.from_bytes(bits[:8]) / 2**64 * (1.0 - 2.0**-53), int.from_bytes(bits[8:]) / 2**64


def covariance(*variances: float) -> list[float]:
    """Return a 3 x 3 covariance with these variances, row by row."""
    x, y, z = variances
    return [x, 0.0, 0.0, 0.0, y, 0.0, 0.0, 0.0, z]
