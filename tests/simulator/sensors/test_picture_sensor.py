"""What a camera has drawn, and what its messages and files have of it."""

from __future__ import annotations

import base64
import json
from typing import Any

import numpy as np
import pytest

from rosbridge_sim.scenery.pictures import Channel
from rosbridge_sim.simulator.sensors.camera_sensor import CameraSpec
from rosbridge_sim.simulator.sensors.drawing import DrawingJob, Makers, draw
from rosbridge_sim.simulator.sensors.sensor_noise import read_noise
from tests.simulator.sensor_rigs.test_mounted_sensors import CAMERA, IMAGE, begin_tick, in_sync
from tests.simulator.sensors.analytic_makers import ManualWorker, make_makers

DEPTH = CameraSpec(picture="depth", encoding="raw", width=32, height=24, rate=50.0, x=1.8, z=2.0)


def channels_of(job: DrawingJob) -> list[Channel]:
    """The channels that are drawn for the sensors of a job."""
    makers, found = make_makers(), []

    class Pictures:
        def render(self, *args: Any) -> Any:  # noqa: ANN401 - as in `Makers`
            found.append(args[4].channels)
            return makers.pictures().render(*args)

        def close(self) -> None:
            pass

    draw(job, Makers(Pictures, makers.rays, makers.encode_jpeg, makers.build))
    return found


def job_of(spec: CameraSpec, *names: str, saves: bool = False) -> DrawingJob:
    """The job of a frame in which some topics of a camera have a listener."""
    worker = ManualWorker()
    harness, client = in_sync(spec, worker=worker)
    client.listen(*names)
    if saves:
        client.send("/SaveSensorData", "morai_msgs/SaveSensorData")
    else:
        begin_tick(harness, client)
    return worker.jobs[0][0]


def test_only_those_channels_are_drawn_that_somebody_needs() -> None:
    topic, boxes = DEPTH.topic, f"{DEPTH.base_topic}/boxes"
    whole = Channel.DEPTH | Channel.INSTANCE | Channel.LABEL
    assert channels_of(job_of(DEPTH, topic)) == [Channel.DEPTH]
    assert channels_of(job_of(DEPTH, boxes)) == [whole]
    assert channels_of(job_of(DEPTH, topic, boxes)) == [whole]
    assert channels_of(job_of(DEPTH, saves=True)) == [Channel.DEPTH | Channel.RGB]
    both = DEPTH.changed(detections=True)
    assert channels_of(job_of(both, f"{both.base_topic}/detections_3d")) == [whole]


def test_message_of_a_camera_has_the_bytes_of_its_jpeg_and_its_quality() -> None:
    _, client = in_sync(CAMERA.changed(rate=50.0, quality=77))
    client.listen(IMAGE)
    client.tick()
    (message,) = client.messages(IMAGE)
    data = base64.b64decode(message["data"])
    assert (data[0], len(data)) == (77, 1 + 32 * 24)


def test_raw_picture_is_little_endian_and_its_rows_follow_each_other() -> None:
    _, client = in_sync(DEPTH)
    client.listen(DEPTH.topic)
    client.tick()
    (message,) = client.messages(DEPTH.topic)
    assert (message["is_bigendian"], message["step"]) == (0, 4 * 32)
    data = np.frombuffer(base64.b64decode(message["data"]), "<f4").reshape(24, 32)
    assert data[23, 0] == pytest.approx(2.0 / (11.5 / 16.0), abs=1e-4)


def test_picture_without_colours_has_no_errors_of_colours() -> None:
    noise = read_noise(json.dumps({"camera": {"dark": 5, "light": 5}}).encode(), "own.json")
    pictures = []
    for each in (None, noise):
        _, client = in_sync(DEPTH, sensor_noise=each)
        client.listen(DEPTH.topic)
        client.tick()
        pictures += [message["data"] for message in client.messages(DEPTH.topic)]
    assert len(pictures) == 2
    assert pictures[0] == pictures[1]


@pytest.mark.parametrize(
    ("topic", "base"),
    [
        ("/front/compressed", "/front"),
        ("/front/compressedDepth", "/front"),
        ("/front/image", "/front/image"),
        ("/compressed", "/compressed"),
        ("/front", "/front"),
    ],
)
def test_other_topics_of_a_camera_are_below_the_name_without_that_of_the_encoding(topic: str, base: str) -> None:
    spec = CAMERA.changed(topic=topic)
    assert spec.base_topic == base
    assert [name for name, _ in spec.topics] == [topic, f"{base}/camera_info", f"{base}/boxes"]


def test_raw_picture_costs_its_bytes_and_a_jpeg_none() -> None:
    assert DEPTH.cost == (768, 0, 3072)
    assert CAMERA.cost == (768, 0, 0)
