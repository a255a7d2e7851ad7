"""Errors of pictures, of echoes of lidars, and of echoes of radars.

All random numbers come from a generator that follows from seed, vehicle, sensor and frame (`NoiseSource.generator`). So
there is no state, and the same frame has the same errors.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from rosbridge_sim.simulator.sensor_data.lidar_sweep import Echoes
from rosbridge_sim.simulator.sensors.radar_echoes import RadarBeams, RadarEchoes, own_velocity
from rosbridge_sim.simulator.sensors.sensor_noise import CameraNoise, LidarNoise, RadarNoise
from rosbridge_sim.world.geometry.planar import FloatArray
from rosbridge_sim.world.state.world import World
from rosbridge_sim.world.vehicle.sensor_readings import Mounting

GAMMA: Final = 2.2
"""Exponent between grey levels and light, near that of sRGB."""

CLUTTER_ROW: Final = -1
"""`RadarEchoes.rows` of an echo that no entity gives."""

CLUTTER_STRENGTH: Final = 4.0
"""Mean amplitude of clutter [dB], of an exponential distribution; our choice."""

_Carrier = tuple[World, int, Mounting]
"""World, row of the vehicle that carries a radar, and place of the radar on it."""


def disturb_picture(rgb: NDArray[np.uint8], noise: CameraNoise, chance: np.random.Generator) -> NDArray[np.uint8]:
    """Return a picture with the errors of a camera.

    First the lens blurs it, then the exposure multiplies the light by 2^exposure, then each colour of each pixel gets a
    normal error of variance dark^2 + light^2 v / 255, with its grey level v: a constant part, and one that grows with
    the light, as photons do (EMVA 1288, linear model; here on grey levels instead of light).

    Args:
        rgb: (h, w, 3).
        noise: how large the errors are.
    """
    gain = np.float32(2.0 ** (noise.exposure / GAMMA))
    found = np.empty_like(rgb)
    for channel in range(3):
        values = rgb[:, :, channel].astype(np.float32)
        if noise.blur > 0.0:
            values = _blurred(_blurred(values, noise.blur).T, noise.blur).T
        if noise.exposure:
            values = np.minimum(values * gain, np.float32(255.0))
        if noise.dark > 0.0 or noise.light > 0.0:
            sigma = np.sqrt(np.float32(noise.dark**2) + np.float32(noise.light**2 / 255.0) * values)
            values = values + sigma * chance.standard_normal(values.shape, dtype=np.float32)
        found[:, :, channel] = np.clip(np.rint(values), 0.0, 255.0)
    return found


def _blurred(values: NDArray[np.float32], sigma: float) -> NDArray[np.float32]:
    """Return an array (n, m) that is blurred along its first axis by a normal distribution; the edges go on."""
    reach = math.ceil(3.0 * sigma)
    weights = np.exp(-0.5 * (np.arange(-reach, reach + 1) / sigma) ** 2)
    weights = (weights / weights.sum()).astype(np.float32)
    num = len(values)
    wide = np.pad(values, ((reach, reach), (0, 0)), mode="edge")
    total = np.zeros_like(values)
    for i, weight in enumerate(weights):
        total += weight * wide[i : i + num]
    return total


def disturb_echoes(echoes: Echoes, max_range: float, noise: LidarNoise, chance: np.random.Generator) -> Echoes:
    """Return echoes with the errors of a lidar.

    An echo is lost with the probability 1 - (1 - a) (1 - b r^2 / R^2) (1 - c (1 - s)), with its range r, the longest
    range R, the cosine s of the angle of incidence, and a, b, c = `drop_out`, `drop_out_far`, `drop_out_grazing`.

    Args:
        max_range: of the lidar [m].
        noise: how large the errors are.
    """
    num = len(echoes.ranges)
    share = np.minimum(echoes.ranges / np.float32(max_range), np.float32(1.0))
    kept = np.float32(1.0 - noise.drop_out) * (1.0 - np.float32(noise.drop_out_far) * share * share)
    kept *= 1.0 - np.float32(noise.drop_out_grazing) * (1.0 - echoes.slants)
    is_lost = chance.random(num, dtype=np.float32) >= kept
    ranges = echoes.ranges + np.float32(noise.range) * chance.standard_normal(num, dtype=np.float32)
    intensities = echoes.intensities + np.float32(noise.intensity) * chance.standard_normal(num, dtype=np.float32)
    return Echoes(
        np.where(is_lost, np.float32(np.inf), np.maximum(ranges, np.float32(0.0))),
        np.clip(np.round(intensities), np.float32(0.0), np.float32(255.0)),
        echoes.slants,
    )


def disturb_radar(
    echoes: RadarEchoes, carrier: _Carrier, spec: RadarBeams, noise: RadarNoise, chance: np.random.Generator
) -> RadarEchoes:
    """Return echoes with the errors of a radar, and clutter among them, the nearest first.

    Clutter stands still, at a random place of one of the beams; their number has a Poisson distribution.

    Args:
        carrier: world, row of the vehicle with the radar, and mounting.
        noise: how large the errors are.
    """
    num = len(echoes.rows)
    is_kept = chance.random(num) >= noise.drop_out
    turn = noise.azimuth * chance.standard_normal(num)
    distance = np.maximum(echoes.distance + noise.range * chance.standard_normal(num), 0.0)
    rate = echoes.range_rate + noise.range_rate * chance.standard_normal(num)
    amplitude = echoes.amplitude + noise.amplitude * chance.standard_normal(num)
    grown = distance / echoes.distance
    (x, y, z), cos, sin = echoes.position.T, np.cos(turn), np.sin(turn)
    position = np.column_stack([grown * (cos * x - sin * y), grown * (sin * x + cos * y), grown * z])
    is_kept &= amplitude >= 0.0
    exact = RadarEchoes(echoes.rows, position, distance, echoes.azimuth + turn, rate, amplitude)
    parts = _pick(exact, is_kept), _clutter(carrier, spec, int(chance.poisson(noise.clutter)), chance)
    columns = [np.concatenate([getattr(part, name) for part in parts]) for name in RadarEchoes.__struct_fields__]
    every = RadarEchoes(*columns)
    return _pick(every, np.argsort(every.distance, kind="stable")[: spec.max_echoes])


def _pick(echoes: RadarEchoes, which: NDArray[np.bool_] | NDArray[np.int64]) -> RadarEchoes:
    return RadarEchoes(*(getattr(echoes, name)[which] for name in RadarEchoes.__struct_fields__))


def _clutter(carrier: _Carrier, spec: RadarBeams, num: int, chance: np.random.Generator) -> RadarEchoes:
    is_far = chance.random(num) < 0.5  # noqa: PLR2004 - each beam has as much
    reach = np.where(is_far, spec.far_range, spec.near_range)
    fov = np.radians(np.where(is_far, spec.far_fov, spec.near_fov))
    distance = np.maximum(chance.random(num), 0.01) * reach
    azimuth = (chance.random(num) - 0.5) * fov
    flat: FloatArray = np.column_stack([np.cos(azimuth), np.sin(azimuth), np.zeros(num)])
    rate = -(flat * own_velocity(*carrier)).sum(axis=1)
    amplitude = chance.exponential(CLUTTER_STRENGTH, num)
    return RadarEchoes(np.full(num, CLUTTER_ROW), flat * distance[:, None], distance, azimuth, rate, amplitude)
