"""Pictures and points at full rate for the released client libraries; `scripts/bench/sensors.py` has figures."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from rosbridge_sim.client import Client
from tests.conftest import Serve
from tests.end_to_end.programs import finish, start

pytest.importorskip("moderngl")
pytest.importorskip("embreex")
pytest.importorskip("simplejpeg")

pytestmark = [pytest.mark.client, pytest.mark.slow]

IMAGE, POINTS = "/image_jpeg/compressed", "/velodyne_points"
TOPICS = (f"{IMAGE}=sensor_msgs/CompressedImage", f"{POINTS}=sensor_msgs/PointCloud2")

SENSORS = "[[camera]]\nx = 1.8\nz = 2\npitch = 7\nantialiasing = false\n[[lidar3d]]\nx = 2\nz = 1.28\n"


def test_libraries_hear_each_picture_at_30_hz_and_each_turn_at_10_hz(serve: Serve, tmp_path: Path) -> None:
    sensors = tmp_path / "sensors.toml"
    sensors.write_text(SENSORS)
    server = serve("--scenario", "loop", "--sensors", str(sensors), "--start", "sync", "--no-dressing")
    programs = []
    for library, words in (("roslibpy-asyncio", ()), ("roslib2", ("none",)), ("roslib2", ("cbor",))):
        programs.append(start(library, "rates", server.port, "count", *words, *TOPICS))
        assert programs[-1].stdout is not None
        assert json.loads(programs[-1].stdout.readline()) == {"ready": True}, library
    with Client(server.url, timeout=100.0) as client:
        client.start_sync()
        client.tick(20)
        for program in programs:  # without a master the world would run on in real time meanwhile
            assert finish(program)["counts"] == {IMAGE: 12, POINTS: 4}
