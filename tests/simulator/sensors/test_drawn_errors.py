from __future__ import annotations

import json
import math
from typing import Any

import numpy as np
import pytest

from rosbridge_sim.records import replace
from rosbridge_sim.simulator.sensor_data.lidar_sweep import Echoes
from rosbridge_sim.simulator.sensors.camera_sensor import CameraSpec
from rosbridge_sim.simulator.sensors.drawn_errors import (
    CLUTTER_STRENGTH,
    disturb_echoes,
    disturb_picture,
    disturb_radar,
)
from rosbridge_sim.simulator.sensors.lidar_2d import Lidar2dSpec
from rosbridge_sim.simulator.sensors.lidar_3d import Lidar3dSpec
from rosbridge_sim.simulator.sensors.radar import RadarSpec
from rosbridge_sim.simulator.sensors.radar_echoes import find_echoes
from rosbridge_sim.simulator.sensors.sensor_noise import (
    TYPICAL,
    CameraNoise,
    LidarNoise,
    NoiseSource,
    RadarNoise,
    SensorNoise,
)
from tests.simulator.sensor_rigs.test_mounted_sensors import in_sync
from tests.simulator.sensors.test_radar_echoes import FRONT, rear_of, scene

RADAR = RadarSpec()
GREY = np.full((200, 200, 3), 100, dtype=np.uint8)


def chance(frame: int = 0, name: str = "a") -> np.random.Generator:
    return NoiseSource(TYPICAL, 0, 0, frame).generator(name)


def echoes(*ranges: float, intensity: float = 60.0, slant: float = 1.0) -> Echoes:
    num = len(ranges)
    return Echoes(
        np.array(ranges, dtype=np.float32), np.full(num, intensity, np.float32), np.full(num, slant, np.float32)
    )


# Cameras


def test_noise_of_pixels_grows_with_their_light() -> None:
    noise = CameraNoise(dark=3.0, light=8.0)
    for level in (50, 200):
        found = disturb_picture(np.full((200, 200, 3), level, dtype=np.uint8), noise, chance()).astype(float)
        assert found.std() == pytest.approx(math.sqrt(9.0 + 64.0 * level / 255.0), rel=0.02)
        assert found.mean() == pytest.approx(level, abs=0.1)


def test_pixels_of_another_frame_or_camera_have_other_noise() -> None:
    noise = CameraNoise(dark=3.0)
    first = disturb_picture(GREY, noise, chance())
    assert np.array_equal(first, disturb_picture(GREY, noise, chance()))
    assert not np.array_equal(first, disturb_picture(GREY, noise, chance(frame=1)))
    assert not np.array_equal(first, disturb_picture(GREY, noise, chance(name="b")))


def test_blur_spreads_a_point_by_its_deviation_and_keeps_its_light() -> None:
    picture = np.zeros((41, 41, 3), dtype=np.uint8)
    picture[20, 20] = 255
    found = disturb_picture(picture, CameraNoise(blur=1.5), chance())[:, :, 0].astype(float)
    column = np.arange(41) - 20.0
    assert found.sum() == pytest.approx(255.0, rel=0.05)
    for axis in (0, 1):
        spread = math.sqrt((found.sum(axis=axis) * column**2).sum() / found.sum())
        assert spread == pytest.approx(1.5, rel=0.05)
    assert np.array_equal(disturb_picture(GREY, CameraNoise(blur=5.0), chance()), GREY)  # the edges, too


def test_exposure_doubles_the_light() -> None:
    brighter = disturb_picture(GREY, CameraNoise(exposure=1.0), chance())[0, 0, 0]
    assert (brighter / 255.0) ** 2.2 == pytest.approx(2.0 * (100.0 / 255.0) ** 2.2, rel=0.02)
    assert disturb_picture(GREY, CameraNoise(exposure=8.0), chance()).min() == 255


def test_camera_without_errors_gives_the_picture_as_it_is() -> None:
    assert np.array_equal(disturb_picture(GREY, CameraNoise(), chance()), GREY)


# Lidars


def test_ranges_and_intensities_have_their_deviations() -> None:
    found = disturb_echoes(echoes(*[20.0] * 5000), 100.0, LidarNoise(range=0.1, intensity=5.0), chance())
    assert found.ranges.mean() == pytest.approx(20.0, abs=0.01)
    assert found.ranges.std() == pytest.approx(0.1, rel=0.05)
    assert found.intensities.std() == pytest.approx(5.0, rel=0.05)


@pytest.mark.parametrize(
    ("noise", "away", "slant", "share"),
    [
        (LidarNoise(drop_out=0.2), 50.0, 1.0, 0.2),
        (LidarNoise(drop_out_far=0.4), 50.0, 1.0, 0.1),
        (LidarNoise(drop_out_far=0.4), 100.0, 1.0, 0.4),
        (LidarNoise(drop_out_far=0.4), 150.0, 1.0, 0.4),
        (LidarNoise(drop_out_grazing=0.5), 50.0, 0.2, 0.4),
        (LidarNoise(drop_out=0.5, drop_out_far=0.4, drop_out_grazing=0.5), 100.0, 0.0, 1.0 - 0.5 * 0.6 * 0.5),
    ],
)
def test_echoes_are_lost_by_range_and_angle(noise: LidarNoise, away: float, slant: float, share: float) -> None:
    found = disturb_echoes(echoes(*[away] * 20_000, slant=slant), 100.0, noise, chance())
    assert np.isinf(found.ranges).mean() == pytest.approx(share, abs=0.012)


def test_ranges_and_intensities_stay_within_their_bounds() -> None:
    found = disturb_echoes(
        echoes(*[0.5] * 2000, intensity=200.0), 100.0, LidarNoise(range=1.0, intensity=200.0), chance()
    )
    assert (found.ranges.min(), found.intensities.min(), found.intensities.max()) == (0.0, 0.0, 255.0)


def test_ray_without_an_echo_stays_without_one() -> None:
    found = disturb_echoes(echoes(math.inf, math.inf, intensity=0.0), 100.0, TYPICAL.lidar, chance())
    assert np.isinf(found.ranges).all()


# Radars


def test_radar_errors_move_an_echo_as_a_whole() -> None:
    world = scene(rear_of(50.0))
    carrier = (world, 0, FRONT)
    exact = find_echoes(*carrier, RADAR)
    noise = RadarNoise(range=0.5, azimuth=0.01, range_rate=0.2, amplitude=1.0)
    found = [disturb_radar(exact, carrier, RADAR, noise, chance(i)) for i in range(250)]
    for name, sigma in (("distance", 0.5), ("azimuth", 0.01), ("range_rate", 0.2), ("amplitude", 1.0)):
        errors = np.array([getattr(one, name)[0] - getattr(exact, name)[0] for one in found])
        assert errors.std() == pytest.approx(sigma, rel=0.12), name
    for one in found:
        x, y, z = one.position[0]
        assert math.sqrt(x * x + y * y + z * z) == pytest.approx(one.distance[0])
        assert math.atan2(y, x) == pytest.approx(one.azimuth[0])


def test_clutter_stands_still_in_the_beams() -> None:
    world = scene()
    world.speed[0] = 20.0
    carrier = (world, 0, FRONT)
    noise = RadarNoise(clutter=5.0)
    scans = [disturb_radar(find_echoes(*carrier, RADAR), carrier, RADAR, noise, chance(i)) for i in range(150)]
    assert np.mean([len(scan.rows) for scan in scans]) == pytest.approx(5.0, rel=0.1)
    for i, scan in enumerate(scans):
        assert (scan.rows == -1).all()
        assert (np.diff(scan.distance) >= 0.0).all()
        assert scan.range_rate == pytest.approx(-20.0 * np.cos(scan.azimuth))
        is_near = (scan.distance <= RADAR.near_range) & (np.abs(scan.azimuth) <= math.radians(RADAR.near_fov / 2))
        is_far = (scan.distance <= RADAR.far_range) & (np.abs(scan.azimuth) <= math.radians(RADAR.far_fov / 2))
        assert (is_near | is_far).all()
        flat = np.column_stack([np.cos(scan.azimuth), np.sin(scan.azimuth), 0.0 * scan.azimuth])
        assert scan.position == pytest.approx(scan.distance[:, None] * flat)
        few = disturb_radar(find_echoes(*carrier, RADAR), carrier, replace(RADAR, max_echoes=3), noise, chance(i))
        assert few.distance.tolist() == scan.distance.tolist()[:3]
    azimuth, distance, amplitude = (
        np.concatenate([getattr(scan, name) for scan in scans]) for name in ("azimuth", "distance", "amplitude")
    )
    assert abs(azimuth.mean()) < 0.03
    assert np.abs(azimuth).max() == pytest.approx(math.radians(RADAR.near_fov / 2), rel=0.02)
    assert (distance > RADAR.near_range).mean() == pytest.approx(0.5 * (1.0 - 60.0 / 174.0), abs=0.04)
    assert distance.min() >= 0.01 * RADAR.near_range
    assert amplitude.mean() == pytest.approx(CLUTTER_STRENGTH, rel=0.1)


def test_lost_and_weakened_echoes_are_not_there() -> None:
    world = scene(rear_of(50.0))
    carrier = (world, 0, FRONT)
    exact = find_echoes(*carrier, RADAR)
    scans = [disturb_radar(exact, carrier, RADAR, RadarNoise(drop_out=0.3), chance(i)) for i in range(250)]
    assert np.mean([len(scan.rows) for scan in scans]) == pytest.approx(0.7, abs=0.07)
    weak = replace(exact, amplitude=np.array([0.0]))
    scans = [disturb_radar(weak, carrier, RADAR, RadarNoise(amplitude=3.0), chance(i)) for i in range(400)]
    assert np.mean([len(scan.rows) for scan in scans]) == pytest.approx(0.5, abs=0.07)


# On the bus

CAMERA = CameraSpec(width=32, height=24, x=1.8, z=2.0, pitch=7.0, rate=25.0)
LIDAR = Lidar3dSpec(columns=36, x=2.0, z=1.25, rate=25.0)
SCAN = Lidar2dSpec(x=3.8, z=0.5, num_values=36, ahead=18, rate=25.0)
BUMPER = RadarSpec(x=3.8, z=0.5, rate=25.0)
TOPICS = ("/image_jpeg/compressed", "/lidar3D", "/lidar2D", "/radar")


def driven(**settings: Any) -> list[bytes]:  # noqa: ANN401 - those of a node
    """Bytes of the messages of six frames behind a snapshot; they come again after a restore."""
    _, client = in_sync(CAMERA, LIDAR, SCAN, BUMPER, **settings)
    client.control(1, longlCmdType=2, velocity=40.0, steering=0.1)
    for _ in range(4):
        client.tick()
    client.call("/sim/snapshot", {"id": "here"})
    client.listen(*TOPICS)
    for _ in range(6):
        client.tick()
    first = list(client.raw)
    client.raw.clear()
    answer = client.call("/sim/restore", {"id": "here", "user_id": "me"})
    assert json.loads(answer.values.json)["result"]  # type: ignore[attr-defined]
    client.raw.clear()
    for _ in range(6):
        client.tick()
    assert client.raw == first
    return first


def test_errors_repeat_to_the_byte_also_from_a_snapshot() -> None:
    exact, noisy = driven(), driven(sensor_noise=TYPICAL)
    assert noisy == driven(sensor_noise=TYPICAL)
    assert noisy != exact


def test_lost_messages_are_not_published() -> None:
    lost = SensorNoise(camera=CameraNoise(lost=1.0), lidar=LidarNoise(lost=0.5), radar=RadarNoise(lost=1.0))
    _, client = in_sync(CAMERA, LIDAR, BUMPER, sensor_noise=lost)
    client.listen(*(topic for topic in TOPICS if topic != "/lidar2D"))
    for _ in range(40):
        client.tick()
    assert not client.messages("/image_jpeg/compressed")
    assert not client.messages("/radar")
    assert 4 <= len(client.messages("/lidar3D")) <= 16
