#!/usr/bin/env python3
"""Stop at the stop line of a red light, and go on at green, by the camera alone.

    ./scripts/serve --scenario town --sensors camera --rate /image_jpeg/compressed=10      # in one terminal
    python scripts/examples/stop_at_red.py --save seen.png                                 # in another

The lane is followed as in `lane_camera.py`. The stop line is the first row of the bird's-eye view that is white over
most of the lane. The colour of the light is that of the most pixels that shine above the road: hue, saturation and
value within the limits of a lamp. It needs numpy, Pillow and rosbridge_sim.
"""

from __future__ import annotations

import argparse
import math
import sys
from pathlib import Path
from typing import Any

import numpy as np
from lane_camera import FAR, HEIGHT, LANE, METRES_PER_PIXEL, NEAR, VIEW, WIDTH, LaneFinder
from pictures import Pixels, decode, hsv, in_range
from PIL import Image, ImageDraw

from rosbridge_sim.client import Client

LAMPS = {  # hue 0 to 180, saturation and value of a lamp that shines
    "red": ((160, 130, 200), (180, 255, 255)),
    "yellow": ((30, 130, 200), (40, 255, 255)),
    "green": ((50, 120, 200), (70, 255, 255)),
}
SKY = (round(0.35 * WIDTH), round(0.10 * HEIGHT), round(0.75 * WIDTH), round(0.44 * HEIGHT))  # where lights hang
LEAST_LAMP = 2  # a lamp has so many pixels at least: 30 cm at 40 m
STOP_LINE = ((0, 0, 180), (180, 80, 255))
MIN_SHARE = 0.7  # of the lane is white at a stop line
MIN_DEPTH = 0.15  # of a stop line along the road [m]
FRONT = 3.6  # of the car, ahead of its rear axle [m]
SPARE = 0.8  # between car and line [m]
BRAKING = 1.5  # [m/s2]


def seconds_of(message: dict[str, Any]) -> float:
    """Return the stamp of a message [s]."""
    stamp = message["header"]["stamp"]
    return float(stamp["secs"] + 1e-9 * stamp["nsecs"])


def light_of(picture: Pixels) -> str:
    """Return the colour of the light ahead: red, yellow or green; empty if none is seen."""
    left, top, right, bottom = SKY
    colours = hsv(picture[top:bottom, left:right])
    counts = {name: int(in_range(colours, limits).sum()) for name, limits in LAMPS.items()}
    name = max(counts, key=lambda name: counts[name])
    return name if counts[name] >= LEAST_LAMP else ""


def stop_line_of(picture: Pixels) -> float | None:
    """Return how far ahead of the rear axle the next stop line is [m]; None if none is seen."""
    view = in_range(hsv(VIEW.of(picture)), STOP_LINE)
    half = round(0.4 * LANE / METRES_PER_PIXEL)
    lane = view[:, view.shape[1] // 2 - half : view.shape[1] // 2 + half]
    is_white = (lane.mean(axis=1) > MIN_SHARE)[::-1]  # from the car on
    rows = round(MIN_DEPTH / METRES_PER_PIXEL)
    starts = np.flatnonzero(np.convolve(is_white, np.ones(rows), "valid") > rows - 0.5)
    return NEAR + float(starts[0]) * METRES_PER_PIXEL if len(starts) else None


class Driver:
    """Drives along the lane, and stops where it must.

    Attributes:
        light: as seen last.
        line: distance of the stop line from the front of the car [m]; None if there is none near.
    """

    def __init__(self) -> None:
        self.light = ""
        self.line: float | None = None
        self._lane = LaneFinder()
        self._steering = 0.0

    def move(self, driven: float) -> None:
        """Count the way on by so many metres: near the car the line is below the view."""
        if self.line is not None:
            self.line -= driven
            if self.line < -FRONT:
                self.line = None

    def look(self, picture: Pixels, driven: float) -> None:
        """Take the next picture; since it was taken the car has driven so many metres."""
        self._lane.look(picture)
        self._steering = self._lane.steering(self._steering)
        self.light = light_of(picture)
        seen = stop_line_of(picture)
        if seen is not None:
            self.line = seen - FRONT - driven

    def command(self, speed_kmh: float) -> dict[str, float]:
        """Return the command for the car."""
        if self.line is not None and self.line > -1.0 and self.light in {"red", "yellow"}:
            way = self.line - SPARE
            if way < 0.1:
                return {"longlCmdType": 1, "brake": 1.0, "steering": self._steering}
            speed_kmh = min(speed_kmh, 3.6 * math.sqrt(2.0 * BRAKING * way))
        return {"longlCmdType": 2, "velocity": speed_kmh, "steering": self._steering}

    def drawing(self, picture: Pixels) -> Image.Image:
        """Return what was seen, drawn into the picture."""
        image = Image.fromarray(picture)
        draw = ImageDraw.Draw(image)
        draw.rectangle(SKY, outline=self.light or "white")
        draw.text((SKY[0] + 4, SKY[1] + 4), f"light: {self.light or 'none'}", fill="white")
        if self.line is not None and NEAR - FRONT <= self.line < FAR - FRONT:
            row = VIEW.size[1] - (self.line + FRONT - NEAR) / METRES_PER_PIXEL
            ends = VIEW.in_picture(np.array([0.0, VIEW.size[0]]), np.array([row, row]))
            draw.line([tuple(end) for end in ends.tolist()], fill="red", width=3)
            draw.text(tuple((ends[0] + (8.0, -16.0)).tolist()), f"stop line in {self.line:.1f} m", fill="white")
        return image


def main() -> int:
    """Drive to the light, wait for green, and pass it."""
    parser = argparse.ArgumentParser(description="Stop at the stop line of a red light, by the camera alone.")
    parser.add_argument("--url", default="ws://127.0.0.1:9090")
    parser.add_argument("--speed-kmh", type=float, default=20.0, help="[km/h] (%(default)s)")
    parser.add_argument("--seconds", type=float, default=120.0, help="longest drive, in simulated time (%(default)s)")
    parser.add_argument("--save", type=Path, help="save what the program saw when it stopped")
    args = parser.parse_args()
    with Client(args.url, timeout=60.0) as client:  # the first picture of a map takes seconds
        pictures = client.subscribe("/image_jpeg/compressed")
        client.start_sync()
        driver, speed, has_stopped = Driver(), 0.0, False
        for _ in range(round(args.seconds / 0.1)):
            car = client.step(5, commands={0: driver.command(args.speed_kmh)}).ego
            before, speed = speed, abs(car["velocity"]["x"])
            driver.move(0.1 * 0.5 * (before + speed))
            new = pictures.take()
            if new:
                picture = decode(new[-1])
                driver.look(picture, speed * (seconds_of(car) - seconds_of(new[-1])))
            if not has_stopped and driver.light == "red" and driver.line is not None and speed < 0.05:
                has_stopped = True
                print(f"stopped at red, {driver.line:.1f} m before the line", flush=True)
                if args.save is not None:
                    driver.drawing(picture).save(args.save)
            elif has_stopped and driver.light == "green" and speed > 2.0:
                print("drove on at green", flush=True)
                return 0
    print("no red light was met" if not has_stopped else "the light stayed red")
    return 1


if __name__ == "__main__":
    sys.exit(main())
