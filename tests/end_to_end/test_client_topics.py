"""Topics between real clients and bare listeners: in every encoding, throttled, and in any mix of them."""

from __future__ import annotations

import asyncio
import base64
import json
from io import BytesIO
from typing import Any

import pytest
from PIL import Image

from tests.conftest import Connect
from tests.end_to_end.programs import LIBRARIES, finish, is_python, start
from tests.schema.reference_readers import Rosbags, as_json, read_cbor
from tests.schema.strategies import shared_store
from tests.support import PATIENCE, Client, Frame, ServerProcess

pytestmark = [pytest.mark.client, pytest.mark.slow]

TERMS: dict[str, dict[str, Any]] = {
    "none": {},
    "png": {"compression": "png"},
    "cbor": {"compression": "cbor"},
    "cbor-raw": {"compression": "cbor-raw"},
    "pieces": {"fragment_size": 300},
    "queued": {"queue_length": 5},
    "throttled": {"throttle_rate": 10, "queue_length": 1, "compression": "cbor"},
}

HEADER = {"seq": 3, "stamp": {"secs": 1_700_000_000, "nsecs": 123_456_789}, "frame_id": "map"}
LAYOUT = {"dim": [{"label": "row", "size": 2, "stride": 2}], "data_offset": 0}
POSE = {"position": {"x": 1.5, "y": -2.25, "z": 1e-300}, "orientation": {"x": 0.0, "y": 0.0, "z": 0.6, "w": 0.8}}
STATUS = {"level": 2, "name": "brake", "message": "", "hardware_id": "브레이크"}
IMAGE = {"height": 1, "width": 2, "encoding": "rgb8", "is_bigendian": 0, "step": 6, "data": "AAEC/v+A"}
SCAN = {
    "angle_min": -0.5,
    "angle_max": 0.5,
    "angle_increment": 0.25,
    "time_increment": 0.0,
    "scan_time": 0.125,
    "range_min": 0.0,
    "range_max": 128.0,
    "ranges": [0.5, None, 1.25],
    "intensities": [],
}

BODIES: dict[str, Frame] = {
    "std_msgs/String": {"data": '안녕 \\ " \n {' + "}" * 2_000},
    "std_msgs/Time": {"data": HEADER["stamp"]},
    "std_msgs/UInt16MultiArray": {"layout": LAYOUT, "data": [0, 65_535]},
    "std_msgs/Int8MultiArray": {"layout": LAYOUT, "data": [-128, 127]},
    "std_msgs/Int64MultiArray": {"layout": LAYOUT, "data": [2**53 - 1, -(2**40), 0]},
    "sensor_msgs/Image": {"header": HEADER, **IMAGE},
    "sensor_msgs/LaserScan": {"header": HEADER, **SCAN},
    "geometry_msgs/PoseWithCovariance": {"pose": POSE, "covariance": [i / 8 for i in range(36)]},
    "diagnostic_msgs/DiagnosticArray": {
        "header": HEADER,
        "status": [{**STATUS, "values": [{"key": "wear", "value": "0.2"}]}, {**STATUS, "values": []}],
    },
}
"""A message of each kind, whole: what is not given would be filled in. Floats are float32s; null is NaN."""


def messages_under(prefix: str) -> list[Frame]:
    """Each message, with a topic of its own."""
    return [{"topic": f"{prefix}/{name}", "type": name, "msg": msg} for name, msg in BODIES.items()]


def read_picture(data: str) -> Frame:
    """The frame in a png op."""
    with Image.open(BytesIO(base64.b64decode(data))) as image:
        frame: Frame = json.loads(image.tobytes())
        return frame


async def next_publish(client: Client) -> Frame:
    """The next data message off the socket, out of whatever it is wrapped in."""
    pieces: list[str] = []
    while True:
        async with asyncio.timeout(PATIENCE):
            data = await client.socket.recv()
        frame: Frame = read_cbor(data) if isinstance(data, bytes) else json.loads(data)
        if frame["op"] == "fragment":
            assert frame["num"] == len(pieces)
            pieces.append(frame["data"])
            if len(pieces) < frame["total"]:
                continue
            frame = json.loads("".join(pieces))
        elif frame["op"] == "png":
            frame = read_picture(frame["data"])
        assert frame["op"] == "publish"
        return frame


async def hear(client: Client, messages: list[Frame]) -> list[Any]:
    """One message of each topic, as JSON, in the order of the topics."""
    heard: dict[str, Any] = {}
    for _ in messages:
        frame = await next_publish(client)
        heard[frame["topic"]] = frame["msg"]
    for message in messages:
        msg = heard[message["topic"]]
        if msg.keys() == {"secs", "nsecs", "bytes"}:
            msg = Rosbags(1).read(shared_store().message(message["type"]).spec, msg["bytes"])
        heard[message["topic"]] = as_json(msg)
    return [heard[message["topic"]] for message in messages]


@pytest.mark.parametrize("library", LIBRARIES)
async def test_messages_reach_subscribers_in_every_mix_of_encodings(
    server: ServerProcess, connect: Connect, library: str
) -> None:
    messages = messages_under(f"/mix/{library}".replace("-", "_"))
    listeners = {name: await connect(server.url) for name in TERMS}
    for name, listener in listeners.items():
        for message in messages:
            await listener.send("subscribe", topic=message["topic"], type=message["type"], **TERMS[name])
        await listener.settle()
    told = await asyncio.to_thread(finish, start(library, "topics", server.port, "talk", json.dumps(messages)))
    bodies = list(BODIES.values())
    assert told.keys() == ({"none"} if is_python(library) else {"none", "png", "cbor"})
    for name, heard in told.items():
        assert heard == bodies, f"{library}, as {name}"
    for name, listener in listeners.items():
        assert await hear(listener, messages) == bodies, f"a bare listener, as {name}"


@pytest.mark.parametrize("library", LIBRARIES)
def test_throttled_client_receives_the_last_message_of_a_burst(server: ServerProcess, library: str) -> None:
    """The first at once, the newest three one by one; between them whatever there was time for."""
    topic = f"/burst/{library}".replace("-", "_")
    heard = finish(start(library, "topics", server.port, "burst", topic, "40"))["heard"]
    assert heard[0] == 1
    assert heard[-3:] == [38, 39, 40]
    assert heard == sorted(set(heard))
    assert len(heard) < 40
