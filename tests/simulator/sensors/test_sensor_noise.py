from __future__ import annotations

import json
from typing import Any

import msgspec
import numpy as np
import pytest

from rosbridge_sim.errors import DocumentError
from rosbridge_sim.simulator.sensors.sensor_noise import TYPICAL, NoiseSource, SensorNoise, covariance, read_noise
from rosbridge_sim.world.geometry.planar import chain, quaternion, rotate
from rosbridge_sim.world.vehicle.sensor_readings import Inertia
from tests.simulator.sensors.test_sensors import in_sync, on_map
from tests.simulator.sim_harness import SimHarness
from tests.simulator.sim_services.snapshot_fixture import restore, snapshot
from tests.support import ROOT

STILL = Inertia((0.0, 0.0, 0.0, 1.0), (0.0, 0.0, 0.0), (0.0, 0.0, 9.80665))
HERE = (0.0, 0.0, 0.0)


def noise(**parts: Any) -> SensorNoise:  # noqa: ANN401 - a document
    return read_noise(json.dumps(parts).encode(), "own.json")


def easts(figures: dict[str, float], frames: range, uid: int = 0, seed: int = 0) -> np.ndarray[Any, Any]:
    """Errors to the east in some frames."""
    chosen = noise(gps={"horizontal": figures})
    places = [NoiseSource(chosen, seed, uid, frame).locate(HERE) for frame in frames]
    return np.array([place[0] for place in places if place is not None])


# Figures


def test_white_noise_has_its_deviation_and_no_memory() -> None:
    errors = easts({"white": 2.0}, range(2500))
    assert errors.std() == pytest.approx(2.0, rel=0.05)
    assert abs(errors.mean()) < 0.15
    assert abs(np.corrcoef(errors[1:], errors[:-1])[0, 1]) < 0.06


def test_bias_wanders_with_its_deviation_and_without_jumps() -> None:
    errors = easts({"wander": 2.0, "time": 1.0}, range(0, 20_000, 2))
    assert errors.std() == pytest.approx(2.0, rel=0.1)
    assert np.abs(np.diff(errors)).max() < 0.4
    assert abs(np.corrcoef(errors[75:], errors[:-75])[0, 1]) < 0.15


def test_offset_stays_for_the_whole_run() -> None:
    assert len(set(easts({"offset": 2.0}, range(100)).tolist())) == 1
    offsets = np.array([easts({"offset": 2.0}, range(1), seed=seed)[0] for seed in range(400)])
    assert offsets.std() == pytest.approx(2.0, rel=0.1)


def test_vehicles_seeds_and_axes_have_different_errors() -> None:
    figures = {"white": 1.0, "wander": 1.0, "offset": 1.0}
    first = easts(figures, range(5))
    assert first.tolist() != easts(figures, range(5), uid=1).tolist()
    assert first.tolist() != easts(figures, range(5), seed=1).tolist()
    place = NoiseSource(noise(gps={"horizontal": figures, "vertical": figures}), 0, 0, 0).locate(HERE)
    assert place is not None
    assert len(set(place)) == 3


def test_fix_is_lost_as_often_and_as_long_as_the_document_says() -> None:
    chosen = noise(gps={"drop_outs_per_hour": 360, "drop_out_time": 2.0})
    has_fix = [NoiseSource(chosen, 0, 0, frame).locate(HERE) is not None for frame in range(50 * 100)]
    assert has_fix.count(False) == pytest.approx(10 * 2 * 50, abs=10)


def test_even_one_drop_out_in_an_hour_is_there() -> None:
    chosen = noise(gps={"drop_outs_per_hour": 1, "drop_out_time": 900.0})
    has_fix = [NoiseSource(chosen, 0, 0, frame).locate(HERE) is not None for frame in range(0, 180_000, 500)]
    assert has_fix.count(False) == pytest.approx(90, abs=1)  # of 360 places, ten seconds apart
    first, last = has_fix.index(False), len(has_fix) - has_fix[::-1].index(False)
    assert not any(has_fix[first:last])


def test_reading_of_the_unit_has_errors_in_all_its_values() -> None:
    read = NoiseSource(TYPICAL, 0, 0, 7).feel(STILL)
    assert sum(part * part for part in read.orientation) == pytest.approx(1.0)
    assert 0.0 < abs(read.acceleration[2] - 9.80665) < 0.5
    assert all(0.0 < abs(rate) < 0.05 for rate in read.angular_velocity)
    assert read.orientation != STILL.orientation


def test_orientation_errors_are_about_the_axes_of_the_vehicle_and_yaw_about_that_of_the_map() -> None:
    upright = Inertia(quaternion(0.0, 0.0, 1.0), HERE, HERE)
    for name, axis in (("roll_pitch", (0, 1)), ("yaw", (2,))):
        errors = []
        for frame in range(400):
            read = NoiseSource(noise(imu={name: {"white": 0.02}}), 0, 0, frame).feel(upright).orientation
            errors.append(rotate(chain(read, quaternion(0.0, 0.0, -1.0)), (0.3, 0.5, 0.7)))
        moved = np.array(errors) - (0.3, 0.5, 0.7)
        if axis == (2,):
            assert np.abs(moved[:, 2]).max() < 1e-12
            assert moved[:, 0].std() == pytest.approx(0.5 * 0.02, rel=0.15)
        else:
            assert moved[:, 2].std() == pytest.approx(np.hypot(0.3, 0.5) * 0.02, rel=0.15)
            assert np.abs(moved[:, :2].mean(axis=0)).max() < 0.003  # no turn about the third axis


def test_covariance_has_the_variances_on_its_diagonal() -> None:
    assert covariance(1.0, 2.0, 3.0) == [1.0, 0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 3.0]


# Documents


@pytest.mark.parametrize(
    ("document", "why"),
    [
        (b"", "expected a JSON document"),
        (b"{", "not JSON"),
        (b"[]", "expected an object"),
        ({"gps": {"horizontal": {"white": -1}}}, "gps.horizontal.white: expected at least 0, got -1"),
        ({"gps": {"horizontal": {"white": "much"}}}, "gps.horizontal.white: expected a number, got 'much'"),
        ({"gps": {"horizontal": {"time": 0}}}, "gps.horizontal.time: expected at least 0.1"),
        ({"imu": {"lost": 1.5}}, "imu.lost: expected at most 1"),
        ({"imu": {"yaw": 3}}, "imu.yaw: expected an object, got 3"),
        ({"imu": {"yaw": {"whit": 3}}}, "imu.yaw.whit: expected one of white, wander, time, offset (did you mean"),
        ({"lidr": {}}, "lidr: expected one of gps, imu, camera, lidar, radar (did you mean lidar?)"),
        (b" " * 70_000, "expected at most"),
        (b'{"gps": NaN}', "expected an object"),
    ],
    ids=range(12),
)
def test_wrong_document_is_refused_with_its_place(document: Any, why: str) -> None:  # noqa: ANN401 - bytes or JSON
    text = document if isinstance(document, bytes) else json.dumps(document).encode()
    with pytest.raises(DocumentError) as raised:
        read_noise(text, "own.json")
    assert str(raised.value).startswith("own.json:")
    assert why in str(raised.value)


def test_typical_noise_can_be_written_into_a_document() -> None:
    assert read_noise(msgspec.json.encode(TYPICAL), "own.json") == TYPICAL


# On the wire


def readings(num: int = 20, **settings: Any) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:  # noqa: ANN401 - NodeSettings
    _, client = in_sync(**settings)
    client.listen("/gps", "/imu")
    client.control(1, longlCmdType=2, velocity=30.0)
    for _ in range(num):
        client.tick()
    return client.messages("/gps"), client.messages("/imu")


def test_readings_have_errors_and_repeat_to_the_bit() -> None:
    exact, first, again = readings(), readings(sensor_noise=TYPICAL), readings(sensor_noise=TYPICAL)
    assert first == again
    errors = [np.subtract(on_map(read), on_map(true)) for read, true in zip(first[0], exact[0], strict=True)]
    assert 0.1 < np.abs(errors).max() < 12.0
    assert first[1][5]["linear_acceleration"] != exact[1][5]["linear_acceleration"]


def test_covariances_tell_the_errors() -> None:
    message = readings(1, sensor_noise=TYPICAL)[1][-1]
    assert message["linear_acceleration_covariance"][0] == pytest.approx(TYPICAL.imu.acceleration.variance)
    assert message["orientation_covariance"][8] == pytest.approx(TYPICAL.imu.yaw.variance)
    variance = TYPICAL.imu.angular_velocity.variance
    assert message["angular_velocity_covariance"] == pytest.approx([variance, 0, 0, 0, variance, 0, 0, 0, variance])


def test_lost_fix_has_no_status_and_no_place() -> None:
    lost = noise(gps={"drop_outs_per_hour": 36_000, "drop_out_time": 5})
    fix = readings(1, sensor_noise=lost)[0][-1]
    assert (fix["status"], fix["latitude"], fix["longitude"]) == (0, 0.0, 0.0)


def test_lost_messages_of_the_unit_are_not_published() -> None:
    fixes, half = readings(60, sensor_noise=noise(imu={"lost": 0.5}))
    assert len(fixes) == 60
    assert 15 < len(half) < 45
    assert not readings(5, sensor_noise=noise(imu={"lost": 1}))[1]


def noisy(chosen: SensorNoise | None = TYPICAL) -> tuple[SimHarness, Any]:
    harness, client = in_sync(sensor_noise=chosen)
    client.listen("/gps", "/imu")
    return harness, client


def test_readings_go_on_from_a_snapshot_with_the_same_bits() -> None:
    _, client = noisy()
    client.tick()
    data = bytes(snapshot(client).data)
    for _ in range(5):
        client.tick()
    _, other = noisy()
    assert not restore(other, data).message
    for _ in range(5):
        other.tick()
    assert client.messages("/imu")[-5:] == other.messages("/imu")[-5:]


@pytest.mark.parametrize("chosen", [None, noise(imu={"lost": 0.5})], ids=["none", "other"])
def test_snapshot_of_other_noise_is_refused(chosen: SensorNoise | None) -> None:
    data = bytes(snapshot(noisy()[1]).data)
    answer = restore(noisy(chosen)[1], data)
    assert answer.message.endswith("expected a snapshot with the same --sensor-noise")


def test_example_of_the_docs_is_close_to_the_typical_noise() -> None:
    text = (ROOT / "docs" / "reference" / "sensors.md").read_text(encoding="utf-8")
    example = read_noise(text.partition("```json\n")[2].partition("```")[0].encode(), "sensors.md")
    for kind in ("gps", "camera", "lidar", "radar"):
        assert getattr(example, kind) == getattr(TYPICAL, kind)
    for name in ("angular_velocity", "acceleration", "roll_pitch", "yaw"):
        shown, exact = getattr(example.imu, name).variance, getattr(TYPICAL.imu, name).variance
        assert shown == pytest.approx(exact, rel=0.05)
