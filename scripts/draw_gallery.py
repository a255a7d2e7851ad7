#!/usr/bin/env python3
"""Draw the gallery of docs/reference/sensors.md: what the ego's camera sees on each built-in map, at each weather.

    python scripts/draw_gallery.py [MAP ...]

Each picture of docs/images/gallery_MAP.jpg has the five weathers and the classes, after three seconds of the scenario
of the same name (`demo` for `track`). It needs the extra `sensors` and EGL. The pictures depend on the driver of
OpenGL, so no test compares them.
"""

from __future__ import annotations

import argparse
import base64
import io
import subprocess
import sys
import tempfile
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np
from PIL import Image, ImageDraw

from rosbridge_sim.client import Client
from rosbridge_sim.scenery.mesh import Label
from rosbridge_sim.scenery.pictures import Weather

ROOT = Path(__file__).resolve().parents[1]
MAPS = ("town", "loop", "motorway", "roundabout", "parking", "hills", "track")
SCENARIOS = {"track": "demo"}

SIZE = (640, 360)
QUALITY = 72
"""Of the JPEG: all seven are 1.5 MB."""

TICKS = 150
CAMERA = f"[[camera]]\nx = 1.8\nz = 2\npitch = 5\nwidth = {SIZE[0]}\nheight = {SIZE[1]}\nquality = 95\nrate = 50\n"
RIG = f'{CAMERA}{CAMERA}frame_id = "classes"\npicture = "semantic"\n'
IMAGE, CLASSES = "/image_jpeg/compressed", "/image_semantic"

COLOURS = {
    Label.NONE: (112, 160, 214),
    Label.ASPHALT: (96, 96, 104),
    Label.PAINT_WHITE: (255, 255, 255),
    Label.PAINT_YELLOW: (250, 200, 40),
    Label.CROSSWALK: (220, 220, 255),
    Label.STOP_LINE: (255, 90, 90),
    Label.KERB: (190, 170, 150),
    Label.PAVEMENT: (214, 140, 190),
    Label.GROUND: (110, 170, 90),
    Label.BUILDING: (150, 110, 80),
    Label.TREE: (30, 110, 50),
    Label.POLE: (230, 230, 120),
    Label.TRAFFIC_LIGHT: (250, 140, 20),
    Label.SIGN: (200, 60, 200),
    Label.VEHICLE: (40, 60, 220),
    Label.PEDESTRIAN: (220, 20, 60),
    Label.OBSTACLE: (140, 60, 160),
}


def draw(name: str) -> Image.Image:
    """Return the five weathers of a map, two beside one another."""
    with tempfile.TemporaryDirectory() as folder:
        rig, port_file = Path(folder) / "rig.toml", Path(folder) / "port"
        rig.write_text(RIG)
        words = ["--scenario", SCENARIOS.get(name, name), "--sensors", str(rig), "--data-dir", folder, "--port", "0"]
        command = [sys.executable, "-m", "rosbridge_sim", "serve", *words, "--port-file", str(port_file)]
        command += ["--start", "sync", "--log-level", "error"]
        with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.DEVNULL) as server:  # noqa: S603 - this program
            try:
                while not (port_file.exists() and port_file.read_text().strip()):
                    if server.poll() is not None:
                        raise SystemExit(f"{name}: the server has ended with {server.returncode}")
                    time.sleep(0.1)
                with Client(f"ws://127.0.0.1:{port_file.read_text().strip()}", timeout=300.0) as client:
                    return _arrange(_shoot(client))
            finally:
                server.terminate()


def _shoot(client: Client) -> dict[str, Image.Image]:
    client.set_object(0, ctrl_mode=6)  # it drives itself
    client.start_sync()
    client.tick(TICKS)
    pictures: dict[str, Image.Image] = {}
    shots = client.subscribe(IMAGE, "sensor_msgs/CompressedImage")
    for weather in Weather:
        client.call("/sim/weather", {"weather": weather.value})
        shots.take()
        client.tick()
        pictures[weather.value] = Image.open(io.BytesIO(base64.b64decode(shots.next()["data"])))
    classes = client.subscribe(CLASSES, "sensor_msgs/Image")
    client.tick()
    colours = np.zeros((256, 3), dtype=np.uint8)
    for label, colour in COLOURS.items():
        colours[label] = colour
    labels = np.frombuffer(base64.b64decode(classes.next()["data"]), dtype=np.uint8).reshape(SIZE[::-1])
    pictures["classes"] = Image.fromarray(colours[labels])
    return pictures


def _arrange(pictures: dict[str, Image.Image]) -> Image.Image:
    width, height = SIZE
    whole = Image.new("RGB", (2 * width, 3 * height), (244, 242, 236))
    pen = ImageDraw.Draw(whole)
    for i, (weather, picture) in enumerate(pictures.items()):
        left, top = width * (i % 2), height * (i // 2)
        whole.paste(picture, (left, top))
        pen.text(
            (left + 12, top + 10), weather, fill=(255, 255, 255), stroke_fill=(0, 0, 0), stroke_width=2, font_size=22
        )
    return whole


def main() -> None:
    """Draw and save."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("maps", nargs="*", default=MAPS, metavar="MAP", help="maps to draw (all)")
    for name in parser.parse_args().maps:
        path = ROOT / "docs" / "images" / f"gallery_{name}.jpg"
        draw(name).save(path, quality=QUALITY, optimize=True)
        print(f"{path}: {path.stat().st_size / 1e3:.0f} kB")


if __name__ == "__main__":
    main()
