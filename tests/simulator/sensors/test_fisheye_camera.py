"""The fisheye camera: its options, messages and boxes."""

from __future__ import annotations

import base64
import json
import math
from typing import Any

import numpy as np
import pytest

from rosbridge_sim.errors import FieldError
from rosbridge_sim.simulator.sensors.fisheye_camera import FisheyeSpec
from rosbridge_sim.simulator.sensors.sensor_table import check_rig
from tests.simulator.sensors.analytic_makers import AtOnceWorker
from tests.simulator.sim_harness import SimHarness


def test_fisheye_publishes_the_equidistant_model_depths_along_rays_and_boxes_to_the_side() -> None:
    options: dict[str, Any] = {"width": 160, "height": 120, "rate": 50, "z": 2, "yaw": -60, "picture": "depth"}
    options["distortion"] = [0.02, -0.01, 0, 0]
    harness = SimHarness(start="sync", worker=AtOnceWorker())
    client = harness.client()
    client.start()
    client.listen("/tf_static")
    added = client.call("/sim/sensors", {"add": json.dumps({"fisheye": [options]})})
    assert json.loads(added.values.json)["message"] == ""  # type: ignore[attr-defined]
    client.listen("/fisheye/image", "/fisheye/image/camera_info", "/fisheye/image/boxes")
    client.tick()
    (info,) = client.messages("/fisheye/image/camera_info")
    assert (info["distortion_model"], info["D"]) == ("equidistant", [0.02, -0.01, 0.0, 0.0])
    assert info["K"] == pytest.approx([160 / math.pi, 0, 80, 0, 160 / math.pi, 60, 0, 0, 1])
    (picture,) = client.messages("/fisheye/image")
    depth = np.frombuffer(base64.b64decode(picture["data"]), "<f4").reshape(120, 160)
    down = FisheyeSpec(width=160, height=120, distortion=(0.02, -0.01, 0.0, 0.0)).model.rays[:, 2].reshape(120, 160)
    assert depth[119, 80] == pytest.approx(-2.0 / down[119, 80], rel=1e-5)  # the ground, along the ray
    assert np.isinf(depth[0, 0])  # beyond the circle
    (boxes,) = client.messages("/fisheye/image/boxes")
    angles = [math.degrees(math.atan2(abs(box["center"]["x"]), box["center"]["z"])) for box in boxes["boxes"]]
    assert max(angles) > 60.0
    frames = {one["child_frame_id"] for one in client.messages("/tf_static")[-1]["transforms"]}
    assert {"Fisheye", "Fisheye_optical"} <= frames


def test_lens_that_folds_the_picture_is_refused() -> None:
    check_rig([FisheyeSpec(distortion=(0.05, -0.01, 0.002, -0.0005))])
    with pytest.raises(FieldError, match=r"^Fisheye.distortion: .*grows with the angle, up to 90 deg; got \[-0.5, "):
        check_rig([FisheyeSpec(distortion=(-0.5, 0.0, 0.0, 0.0))])
