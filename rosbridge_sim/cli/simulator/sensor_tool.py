"""`sensor list` and `shot`: the sensors of a running simulator, and a picture of a camera."""

from __future__ import annotations

import base64
import binascii
import io
from pathlib import Path

from rosbridge_sim.cli.tools.picture_files import picture_of, save
from rosbridge_sim.cli.tools.text import put, put_json, put_table
from rosbridge_sim.cli.tools.tool_client import Bridge, Frame, frames_in
from rosbridge_sim.cli.tools.tool_subscription import Listener
from rosbridge_sim.link.bridge_errors import BridgeError, RefusedError
from rosbridge_sim.link.terminal_text import safe
from rosbridge_sim.suggestions import hint

SERVICE = "/sim/sensors"

JPEG_SUFFIXES = (".jpg", ".jpeg")
"""Suffixes of files that get the bytes of the camera as they are."""


async def list_sensors(bridge: Bridge, ego: int, *, is_json: bool) -> None:
    """Show the sensors of an ego.

    Raises:
        RefusedError: the simulator says no, or there is none.
        BridgeError: there is no answer.
    """
    sensors = await _ask(bridge, ego)
    if is_json:
        put_json(sensors)
        return
    names = ("x", "y", "z", "roll", "pitch", "yaw")
    put_table(
        ("NUMBER", "KIND", "NAME", "HZ", "MEASURED", "PLACE AND ANGLES", "TOPICS"),
        [
            [
                str(one.get("number")),
                safe(str(one.get("kind"))),
                safe(str(one.get("frame_id"))),
                f"{one.get('rate', 0.0):g}",
                f"{one.get('measured', 0.0):.1f}",
                " ".join(f"{one.get(name, 0.0):g}" for name in names),
                safe(" ".join(map(str, one.get("topics") or ()))),
            ]
            for one in sensors
        ],
    )
    if all(one.get("kind") in {"gps", "imu"} for one in sensors):
        put("no cameras, lidars or radars; the server's --sensors brings them")


async def take_shot(bridge: Bridge, ego: int, camera: str, path: Path) -> None:
    """Save the next picture of a camera.

    Args:
        camera: name of the camera, or its number among the cameras, from 0; empty for the first one.
        path: of the file; its suffix says the format.

    Raises:
        RefusedError: there is no such camera, or no picture comes.
        BridgeError: there is no answer.
        DocumentError: the file cannot be written.
    """
    cameras = [one for one in await _ask(bridge, ego) if "/camera_info" in str(one.get("topics"))]
    names = [str(one.get("frame_id")) for one in cameras]
    if not cameras:
        raise RefusedError("the simulator has no camera; the server's --sensors camera brings one")
    if camera in names:
        chosen = names.index(camera)
    elif camera.isdecimal() and int(camera) < len(cameras):
        chosen = int(camera)
    elif camera:
        raise RefusedError(f"--camera: expected one of {safe(', '.join(names))}, got {camera!r}{hint(camera, names)}")
    else:
        chosen = 0
    topic, name = str((cameras[chosen].get("topics") or [""])[0]), names[chosen]
    listener = await Listener.open(bridge, topic, None)
    until = bridge.now() + bridge.patience
    while True:
        message = await listener.expect(max(0.001, until - bridge.now()))
        header = message.get("header")
        frame = str(header.get("frame_id")) if isinstance(header, dict) else ""
        if frame.rpartition("/")[2] == name:
            break
    data, size = _write(message, path)
    put(f"{safe(str(path))}  {size[0]} x {size[1]}  {data:,} bytes  {safe(frame)}")


def _write(message: Frame, path: Path) -> tuple[int, tuple[int, int]]:
    """Write a picture; return the size of the file [bytes], and width and height."""
    from PIL import Image  # noqa: PLC0415 - it takes a while, and only this command needs it

    try:
        raw = base64.b64decode(str(message.get("data", "")))
    except binascii.Error:
        raise BridgeError("expected base64 in the `data` of the picture") from None
    if "format" not in message:
        size = (int(message.get("width") or 0), int(message.get("height") or 0))
        picture = picture_of(raw, size, str(message.get("encoding")))
    else:
        try:
            picture = Image.open(io.BytesIO(raw))
            picture.load()
        except (OSError, ValueError):
            raise BridgeError("expected a JPEG in the `data` of the picture") from None
    if "format" in message and path.suffix.lower() in JPEG_SUFFIXES:
        return save(path, lambda: path.write_bytes(raw)), picture.size
    return save(path, lambda: picture.save(path)), picture.size


async def _ask(bridge: Bridge, ego: int) -> list[Frame]:
    values = await bridge.request(SERVICE, {"ego": ego})
    if values.get("result") is not True:
        raise RefusedError(safe(str(values.get("message"))))
    return frames_in(values, "sensors")
