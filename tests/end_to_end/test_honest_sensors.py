"""Large sensor messages pass complete with default settings, in every encoding."""

from __future__ import annotations

import base64
from typing import Any

import cbor2
import numpy as np
import pytest

from tests.conftest import Connect
from tests.support import Client, ServerProcess

pytestmark = pytest.mark.slow

IMAGE = bytes(range(256)) * (1920 * 1080 * 3 // 256)
POINTS = bytes(range(256)) * (130_000 * 32 // 256)
CELLS = [0, 100, -1, 50] * 1_000_000


async def relay(client: Client, listener: Client, frame: str | bytes | None, type_name: str, msg: Any) -> Any:  # noqa: ANN401 - any message
    """What a listener gets of one message."""
    topic = "/" + type_name.replace("/", "_").lower()
    await client.send("advertise", topic=topic, type=type_name)
    await client.settle()
    await listener.subscribe(topic)
    if frame is None:
        await client.send("publish", topic=topic, msg=msg)
    else:
        await client.send_raw(frame)
    got = await listener.message(topic)
    assert [one for one in await client.settle() if one["op"] == "status"] == []
    await listener.send("unsubscribe", topic=topic)
    return got


def image() -> dict[str, object]:
    return {"height": 1080, "width": 1920, "encoding": "rgb8", "step": 5760}


async def test_full_hd_image_in_base64_passes(server: ServerProcess, connect: Connect) -> None:
    client, listener = await connect(server.url), await connect(server.url)
    msg = {**image(), "data": base64.b64encode(IMAGE).decode()}
    got = await relay(client, listener, None, "sensor_msgs/Image", msg)
    assert base64.b64decode(got["data"]) == IMAGE


async def test_full_hd_image_in_cbor_passes(server: ServerProcess, connect: Connect) -> None:
    client, listener = await connect(server.url), await connect(server.url)
    frame = cbor2.dumps({"op": "publish", "topic": "/sensor_msgs_image", "msg": {**image(), "data": IMAGE}})
    got = await relay(client, listener, frame, "sensor_msgs/Image", None)
    assert base64.b64decode(got["data"]) == IMAGE


async def test_point_cloud_of_130_000_points_passes(server: ServerProcess, connect: Connect) -> None:
    client, listener = await connect(server.url), await connect(server.url)
    msg = {"height": 1, "width": 130_000, "point_step": 32, "data": base64.b64encode(POINTS).decode()}
    got = await relay(client, listener, None, "sensor_msgs/PointCloud2", msg)
    assert base64.b64decode(got["data"]) == POINTS


async def test_occupancy_grid_of_4_million_plain_integers_passes(server: ServerProcess, connect: Connect) -> None:
    client, listener = await connect(server.url), await connect(server.url)
    msg = {"info": {"width": 2_000, "height": 2_000}, "data": CELLS}
    got = await relay(client, listener, None, "nav_msgs/OccupancyGrid", msg)
    assert got["data"] == CELLS


async def test_occupancy_grid_as_a_typed_array_passes(server: ServerProcess, connect: Connect) -> None:
    client, listener = await connect(server.url), await connect(server.url)
    numbers = CELLS[:1_000_000]
    cells = cbor2.CBORTag(72, np.array(numbers, np.int8).tobytes())
    msg = {"info": {"width": 1_000, "height": 1_000}, "data": cells}
    frame = cbor2.dumps({"op": "publish", "topic": "/nav_msgs_occupancygrid", "msg": msg})
    got = await relay(client, listener, frame, "nav_msgs/OccupancyGrid", None)
    assert got["data"] == numbers


async def test_five_thousand_markers_pass(server: ServerProcess, connect: Connect) -> None:
    client, listener = await connect(server.url), await connect(server.url)
    point, colour = {"x": 1.0, "y": 2.0, "z": 3.0}, {"r": 0.1, "g": 0.2, "b": 0.3, "a": 1.0}
    turn = {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}
    marker = {
        "header": {"seq": 0, "stamp": {"secs": 1, "nsecs": 2}, "frame_id": "map"},
        "ns": "lane",
        "id": 7,
        "type": 4,
        "action": 0,
        "pose": {"position": point, "orientation": turn},
        "scale": point,
        "color": colour,
        "lifetime": {"secs": 0, "nsecs": 0},
        "frame_locked": False,
        "points": [point] * 2,
        "colors": [colour] * 2,
        "text": "",
        "mesh_resource": "",
        "mesh_use_embedded_materials": False,
    }
    got = await relay(client, listener, None, "visualization_msgs/MarkerArray", {"markers": [marker] * 5_000})
    assert got["markers"] == [marker] * 5_000


async def test_depth_image_with_bare_nan_passes(server: ServerProcess, connect: Connect) -> None:
    client, listener = await connect(server.url), await connect(server.url)
    depths = [0.5, float("nan"), 1.25, float("inf")] * (160 * 120 // 4)
    got = await relay(client, listener, None, "std_msgs/Float32MultiArray", {"data": depths})
    assert got["data"] == [0.5, None, 1.25, None] * (160 * 120 // 4)
