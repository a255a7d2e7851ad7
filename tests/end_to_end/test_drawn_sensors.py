"""Cameras and lidars of a real server, with what draws them: skipped where the extra `sensors` is not installed."""

from __future__ import annotations

import base64
import hashlib
import io
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from rosbags.highlevel import AnyReader

from rosbridge_sim.shell.app import Simulator
from rosbridge_sim.simulator.sensor_data.lidar_sweep import POINT_TYPE
from tests import fork_server
from tests.conftest import Connect, Serve
from tests.support import Client

pytest.importorskip("moderngl")
pytest.importorskip("embreex")
pytest.importorskip("simplejpeg")

pytestmark = pytest.mark.slow

IMAGE, POINTS = "/image_jpeg/compressed", "/velodyne_points"


async def drive(client: Client, num: int) -> list[tuple[str, dict[str, Any]]]:
    """The messages of both sensors over some ticks; each is there before the answer of its tick."""
    await client.subscribe(IMAGE)
    await client.subscribe(POINTS)
    await client.ask("/SyncModeCmd", user_id="me", start_sync_mode=True, time_step=20)
    command = {"longlCmdType": 2, "velocity": 30.0, "steering": 0.0}
    await client.ask("/SyncModeCtrlCmd", frame=1, command=command)
    heard: list[tuple[str, dict[str, Any]]] = []
    for _ in range(num):
        await client.send(
            "call_service", service="/SyncModeWaitForTick", id="t", args={"request": {"user_id": "me", "frame": 0}}
        )
        while (frame := await client.read())["op"] != "service_response":
            if frame["op"] == "publish":
                heard.append((frame["topic"], frame["msg"]))
    return heard


def digests(heard: list[tuple[str, dict[str, Any]]]) -> list[str]:
    """One for each message."""
    return [hashlib.sha256(repr(one).encode()).hexdigest() for one in heard]


async def test_camera_and_lidar_come_before_the_answer_and_repeat_to_the_byte(serve: Serve, connect: Connect) -> None:
    runs, flags = [], ("--start", "sync", "--scenario", "loop", "--sensors", "teaching", "--no-dressing")
    for _ in range(2):
        client = await connect(serve(*flags).url)
        runs.append(await drive(client, 5))
    first, second = runs
    assert [(name, message["header"]["seq"]) for name, message in first] == [
        *((IMAGE, seq) for seq in (2, 4, 5)),
        (POINTS, 5),
    ]
    # Digests, since pytest would compare two lists of pictures for minutes.
    assert digests(first) == digests(second)
    picture = np.asarray(Image.open(io.BytesIO(base64.b64decode(first[0][1]["data"]))))
    assert picture.shape == (480, 640, 3)
    assert picture[20, 320, 2] > picture[20, 320, 0]  # the sky is blue
    cloud = first[3][1]
    points = np.frombuffer(base64.b64decode(cloud["data"]), dtype=POINT_TYPE)
    assert len(points) == cloud["width"] > 5_000
    near = points[(np.hypot(points["x"], points["y"]) < 8.0) & (points["ring"] < 4)]
    assert near["z"].min() == pytest.approx(-1.25, abs=0.2)  # the ground, as programs take it away by z > -1.3 or so


async def test_shot_and_list_of_a_running_server(serve: Serve, tmp_path: Path) -> None:
    server = serve("--scenario", "loop", "--sensors", "teaching", "--no-dressing")

    def run(*words: str) -> str:
        done = fork_server.run(["-m", "rosbridge_sim", *words, "--url", server.url])
        assert done.returncode == 0, done.stderr
        return done.stdout

    listed = run("sensor", "list")
    assert "Camera" in listed
    assert "/velodyne_points" in listed
    path = tmp_path / "out.png"
    assert "640 x 480" in run("shot", "--camera", "0", "-o", str(path), "--timeout", "100")
    with Image.open(path) as picture:
        assert picture.size == (640, 480)


@pytest.mark.parametrize("name", ["drive.bag", "drive.mcap"])
async def test_recording_has_the_pictures_and_points_that_a_client_hears(
    tmp_path: Path, connect: Connect, name: str
) -> None:
    path = tmp_path / name
    settings: dict[str, Any] = {"scenario": "loop", "sensors": "teaching", "dressing": False}
    async with Simulator(port=0, start="sync", record=path, **settings) as sim:
        heard = await drive(await connect(sim.url), 5)
    recorded = [(topic, message) for topic, message in read_recording(path) if topic in (IMAGE, POINTS)]
    assert [topic for topic, _ in recorded] == [topic for topic, _ in heard]
    for (_, message), (_, sent) in zip(recorded, heard, strict=True):
        assert bytes(message.data) == base64.b64decode(sent["data"])
        assert message.header.frame_id == sent["header"]["frame_id"]


def read_recording(path: Path) -> Iterator[tuple[str, Any]]:
    """Topic and message of all that was recorded, by a library of others."""
    with AnyReader([path]) as reader:
        for connection, _, data in reader.messages():
            yield connection.topic, reader.deserialize(data, connection.msgtype)


async def test_shot_of_a_scenario_is_the_picture_of_its_server(serve: Serve, connect: Connect, tmp_path: Path) -> None:
    client = await connect(serve("--start", "sync", "--scenario", "demo", "--sensors", "camera").url)
    await client.subscribe(IMAGE)
    await client.ask("/SyncModeCmd", user_id="me", start_sync_mode=True, time_step=200)
    await client.send(
        "call_service", service="/SyncModeWaitForTick", id="t", args={"request": {"user_id": "me", "frame": 0}}
    )
    message: dict[str, Any] = {}
    while (frame := await client.read())["op"] != "service_response":
        message = frame["msg"] if frame["op"] == "publish" else message
    path = tmp_path / "shot.png"
    words = ("shot", "--scenario", "demo", "--camera", "Camera", "--drive", "none", "--at", "0.2", "-o", str(path))
    done = fork_server.run(["-m", "rosbridge_sim", *words])
    assert done.returncode == 0, done.stderr
    served = np.asarray(Image.open(io.BytesIO(base64.b64decode(message["data"])))).astype(int)
    shot = np.asarray(Image.open(path)).astype(int)
    assert np.abs(served - shot).mean() < 2.0  # the server's is a JPEG
