"""The sensors through a released client library: topics and saved files."""

from __future__ import annotations

import csv
from pathlib import Path

import pytest
from pyproj import Proj

from rosbridge_sim.world.geometry.planar import rotate
from tests.conftest import Connect, Serve, Simulate
from tests.end_to_end.programs import finish, start

pytestmark = pytest.mark.slow


def row(path: Path) -> dict[str, float]:
    """The one line of figures of a CSV file, by their names."""
    with path.open(newline="") as file:
        (line,) = csv.DictReader(file)
    return {name: float(text) for name, text in line.items()}


@pytest.mark.client
def test_client_moves_an_antenna_drives_and_saves_sensor_data(simulate: Simulate, tmp_path: Path) -> None:
    data = tmp_path / "data"
    place = simulate("--start", "sync", "--data-dir", str(data), "--rate", "/gps=5")
    seen = finish(start("roslibpy-twisted", "sensors", place.port, "save", str(data / "mine")))
    assert seen["counts"] == {"gps": 5, "imu": 50, "Ego_topic": 50}
    gps, imu, ego = seen["gps"], seen["imu"], seen["Ego_topic"]
    east, north = Proj(proj="utm", zone=52, ellps="WGS84")(gps["longitude"], gps["latitude"])
    # The body leans, and the antenna with it; the inertial unit is mounted straight.
    lean = tuple(imu["orientation"][axis] for axis in "xyzw")
    reach = rotate(lean, (1.5, 0.0, 1.75))
    antenna = tuple(ego["position"][axis] + part for axis, part in zip("xyz", reach, strict=True))
    assert (east - gps["eastOffset"], north - gps["northOffset"], gps["altitude"]) == pytest.approx(antenna, abs=1e-4)
    assert imu["angular_velocity"]["z"] > 0.01
    captured, saved = data / "SensorData", data / "mine"
    assert sorted(path.name for path in captured.iterdir()) == [
        "BOXES_frame_000050.txt",
        "GPS_frame_000050.csv",
        "IMU_frame_000050.csv",
    ]
    assert sorted(path.name for path in saved.iterdir()) == ["BOXES_shot.txt", "GPS_shot.csv", "IMU_shot.csv"]
    for path in captured.iterdir():
        assert path.read_bytes() == (saved / path.name.replace("frame_000050", "shot")).read_bytes()
    fix = row(saved / "GPS_shot.csv")
    assert (fix["frame"], fix["time"], fix["latitude"]) == (50.0, 1.0, gps["latitude"])
    assert row(saved / "IMU_shot.csv")["linear_acceleration_z"] == imu["linear_acceleration"]["z"]
    boxes = [line.split() for line in (saved / "BOXES_shot.txt").read_text().splitlines()]
    assert len(boxes) > 3
    assert {len(line) for line in boxes} == {11}


async def test_folder_outside_the_data_folder_is_refused_and_nothing_is_written(
    serve: Serve, connect: Connect, tmp_path: Path
) -> None:
    data, elsewhere = tmp_path / "data", tmp_path / "elsewhere"
    client = await connect(serve("--data-dir", str(data)).url)
    for folder in (str(elsewhere), "../elsewhere"):
        await client.send("publish", id="x", topic="/SaveSensorData", msg={"file_dir": folder})
        status = await client.take("status", id="x")
        assert status["msg"].startswith("morai_msgs/SaveSensorData: expected a folder within --data-dir, got '")
    assert await client.settle() == []
    assert not data.exists()
    assert not elsewhere.exists()
