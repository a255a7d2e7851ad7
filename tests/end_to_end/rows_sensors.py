"""Rows: sensors."""

from __future__ import annotations

import csv
import math
from pathlib import Path

import pyproj
import pytest

from tests.end_to_end.table_rows import SceneClient, Table

__all__ = ["TABLE"]

TABLE = Table()


@TABLE.row(
    "/SensorPosControl",
    done="the antenna (0) is put 2 m ahead and 1 m to the left of the axle, the inertial unit (1) turned by 90 degrees",
    seen="/gps moves by just that on the ground, /imu turns; with plain numbers as the manual has them, and with lists",
)
async def _(play: SceneClient) -> None:
    await play.put(100.0, 300.0, 90.0)
    await play.listen("/gps", "/imu")
    project = pyproj.Transformer.from_crs("EPSG:4326", "EPSG:32652", always_xy=True)

    async def look() -> tuple[float, float, float]:
        """Where the antenna is on the map [m], and where the inertial unit looks [deg]."""
        await play.tick()
        fix, turn = play.last("/gps"), play.last("/imu")["orientation"]
        east, north = project.transform(fix["longitude"], fix["latitude"])
        return east - fix["eastOffset"], north - fix["northOffset"], 2 * math.degrees(math.atan2(turn["z"], turn["w"]))

    assert await look() == pytest.approx((100.0, 300.0, 90.0), abs=1e-3)
    await play.send("/SensorPosControl", sensor_index=0, pose_x=2.0, pose_y=1.0, pose_z=0.5, roll=0, pitch=0, yaw=0)
    assert await look() == pytest.approx((99.0, 302.0, 90.0), abs=1e-3)
    zeros = {name: [0.0, 0.0] for name in ("pose_x", "pose_y", "pose_z", "roll", "pitch")}
    await play.send("/SensorPosControl", sensor_index=[0, 1], yaw=[0.0, math.pi / 2], **zeros)
    assert await look() == pytest.approx((100.0, 300.0, 180.0), abs=1e-3)
    await play.send_badly("/SensorPosControl", "sensor_index", sensor_index=77)


@TABLE.row(
    "/SaveSensorData",
    done="the sensors of a frame are saved under a name of one's own, then by the frame; then outside the folder",
    seen="files with that frame's fix, readings and boxes; a path outside is told by a status and writes nothing",
)
async def _(play: SceneClient) -> None:
    await play.put(285.0, 300.0)
    await play.listen("/gps")
    await play.tick()
    await play.send("/SaveSensorData", is_custom_file_name=True, custom_file_name=play.release, file_dir="")
    (file,) = play.data.rglob(f"GPS_{play.release}.csv")
    (fix,) = csv.DictReader(file.read_text().splitlines())
    said = play.last("/gps")
    assert (float(fix["latitude"]), float(fix["longitude"])) == pytest.approx((said["latitude"], said["longitude"]))
    (boxes,) = play.data.rglob(f"BOXES_{play.release}.txt")
    nearest = boxes.read_text().splitlines()[0].split()
    assert (int(nearest[0]), int(nearest[-1])) == (2, 15), "the barrier"
    assert float(nearest[1]) == pytest.approx(15.0)

    await play.send("/SaveSensorData", file_dir=f"{play.release}/run")
    assert {file.name.partition("_")[0] for file in _files(play.data, "frame_000001")} == {"GPS", "IMU", "BOXES"}
    before = _files(play.data.parent, "")
    await play.send_badly("/SaveSensorData", "SaveSensorData", file_dir="../..")
    assert _files(play.data.parent, "") == before


def _files(folder: Path, part: str) -> set[Path]:
    return {file for file in folder.rglob(f"*{part}*") if file.is_file()}
