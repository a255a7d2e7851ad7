#!/usr/bin/env python3
"""Keep the car in its lane by the camera alone: masks of white and yellow, bird's-eye view, sliding windows.

    ./scripts/serve --scenario loop --sensors camera --rate /image_jpeg/compressed=10    # in one terminal
    python scripts/examples/lane_camera.py --metres 500                                  # in another

The camera stands where MORAI-EDU's lane programs have it, 2 m above the ground, 7 deg down; it is 640 x 480, 90 deg
wide. Its trapezoid is a rectangle on the road: 7.1 m wide, from 3.3 to 13 m before the camera.

Each round of the loop takes the newest picture and gives the next command:

    1. bird's-eye view of the road
    2. masks of the white and the yellow paint
    3. windows that climb along the line on either side of the car
    4. the middle of the lane, half a lane away from each line
    5. the wheels turn towards a point of this middle (pure pursuit)

Where no line is painted, as at crossings, the wheels go back to straight ahead. It needs numpy, Pillow and
rosbridge_sim, which has both.
"""

from __future__ import annotations

import argparse
import math
import sys
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pictures import WHITE, YELLOW, BirdsEye, Pixels, decode, hsv, in_range
from PIL import Image, ImageDraw

from rosbridge_sim.client import Client

WIDTH, HEIGHT = 640, 480
SHARES = [(0.01, 0.80), (0.36, 0.52), (0.64, 0.52), (0.99, 0.80)]  # the trapezoid of MORAI-EDU's programs
METRES_PER_PIXEL = 0.03
NEAR, FAR, BREADTH = 5.1, 14.84, 7.1  # the view, ahead of the rear axle: the camera is 1.8 m ahead of it [m]
VIEW = BirdsEye(
    [(x * WIDTH, y * HEIGHT) for x, y in SHARES],
    (round(BREADTH / METRES_PER_PIXEL), round((FAR - NEAR) / METRES_PER_PIXEL)),
)

LANE = 3.5  # width of a lane [m]
SIDES = (0.5 * LANE, -0.5 * LANE)  # its lines, to the left of its middle
WINDOW = 0.6  # half the width of a window [m]
WINDOWS = 12
ROWS = (FAR - NEAR) / WINDOWS  # height of a window [m]
LINE = (0.05, 0.4)  # a painted line is so wide; stop lines and crosswalks are wider [m]
MIN_WINDOWS = 3  # a line with fewer is none
WHEELBASE = 2.7  # [m]
LOOK_AHEAD = 7.0  # [m]
CENTRING = 0.3  # of the steering is left after a picture without lines

Points = NDArray[np.float64]


def paint(view: Pixels) -> NDArray[np.bool_]:
    """Return where a view has white or yellow paint."""
    colours = hsv(view)
    return np.logical_or(in_range(colours, WHITE), in_range(colours, YELLOW))


def find_line(mask: NDArray[np.bool_], start: float) -> Points:
    """Return points of a line, (n, 2): metres ahead of the rear axle, and to the left.

    Args:
        mask: of the paint.
        start: where the lowest window looks, to the left of the car [m].
    """
    height, width = mask.shape
    rows = height // WINDOWS
    left, slope = start, 0.0
    found: list[tuple[float, float]] = []
    for i in range(WINDOWS):
        bottom = height - i * rows
        middle = 0.5 * width - left / METRES_PER_PIXEL
        half = WINDOW / METRES_PER_PIXEL
        low, high = max(round(middle - half), 0), min(round(middle + half), width)
        part = mask[bottom - rows : bottom, low:high]
        widths = part.sum(axis=1) * METRES_PER_PIXEL
        is_line = (widths > LINE[0]) & (widths < LINE[1])
        if is_line.sum() > 0.3 * rows:
            column = low + 0.5 + np.nonzero(part[is_line])[1].mean()
            now = (0.5 * width - column) * METRES_PER_PIXEL
            if found:
                slope = 0.5 * slope + 0.5 * (now - left)
            left = now
            found.append((NEAR + (i + 0.5) * rows * METRES_PER_PIXEL, left))
        left += slope
    return np.array(found).reshape(-1, 2)


def middle_of(line: Points, side: float) -> Points:
    """Return the middle of the lane beside points of a line: half a lane to its right or left, square to the line."""
    along = np.gradient(line, axis=0)
    along /= np.maximum(np.hypot(*along.T), 1e-9)[:, None]
    return line - side * np.column_stack([-along[:, 1], along[:, 0]])


class LaneFinder:
    """Finds the middle of the lane, picture by picture.

    Attributes:
        lines: points of the left and of the right line: metres ahead of the rear axle, and to the left.
        middle: points of the middle of the lane; none while no line is seen.
    """

    def __init__(self) -> None:
        self.lines: list[Points] = []
        self.middle = np.zeros((0, 2))
        self._starts = list(SIDES)

    def look(self, picture: Pixels) -> None:
        """Find the lane in the next picture."""
        mask = paint(VIEW.of(picture))
        lines = [find_line(mask, start) for start in self._starts]
        self.lines = [line if len(line) >= MIN_WINDOWS else line[:0] for line in lines]
        middles = [middle_of(line, side) for line, side in zip(self.lines, SIDES, strict=True) if len(line)]
        self.middle = np.concatenate([np.zeros((0, 2)), *middles])
        self._starts = self._next_starts()

    def _next_starts(self) -> list[float]:
        """Return where the lowest windows of the next picture look."""
        low: list[float | None] = []
        for line in self.lines:
            is_low = len(line) > 0 and line[0, 0] < NEAR + 2.0
            low.append(float(line[0, 1] - (line[0, 0] - NEAR) * (line[1, 1] - line[0, 1]) / ROWS) if is_low else None)
        left, right = low
        if left is not None and right is not None and not 0.8 * LANE < left - right < 1.5 * LANE:
            jumps = [abs(now - before) for now, before in zip((left, right), self._starts, strict=True)]
            left, right = (None, right) if jumps[0] > jumps[1] else (left, None)
        if left is not None:
            return [left, left - LANE if right is None else right]
        if right is not None:
            return [right + LANE, right]
        return [0.5 * (start + side) for start, side in zip(self._starts, SIDES, strict=True)]

    def steering(self, before: float) -> float:
        """Return the angle of the wheels towards the middle of the lane, left positive [rad].

        Args:
            before: the angle until now.
        """
        if not len(self.middle):
            return CENTRING * before
        away = np.abs(np.hypot(*self.middle.T) - LOOK_AHEAD)
        x, y = self.middle[away <= away.min() + 0.5].mean(axis=0)
        return math.atan(2.0 * WHEELBASE * y / (x * x + y * y))

    def drawing(self, picture: Pixels) -> Image.Image:
        """Return the picture with the points of the lines and the middle of the lane, and the view beside it."""
        image = Image.fromarray(picture)
        draw = ImageDraw.Draw(image)
        for points, colour in [*((line, "red") for line in self.lines), (self.middle, "cyan")]:
            x = 0.5 * VIEW.size[0] - points[:, 1] / METRES_PER_PIXEL
            y = VIEW.size[1] - (points[:, 0] - NEAR) / METRES_PER_PIXEL
            for u, v in VIEW.in_picture(x, y):
                draw.ellipse((u - 4, v - 4, u + 4, v + 4), outline=colour, width=2)
        mask = Image.fromarray((paint(VIEW.of(picture)) * 255).astype(np.uint8))
        view = Image.fromarray(VIEW.of(picture))
        sheet = Image.new("RGB", (WIDTH + 2 * VIEW.size[0], HEIGHT))
        sheet.paste(image, (0, 0))
        sheet.paste(view, (WIDTH, 0))
        sheet.paste(mask, (WIDTH + VIEW.size[0], 0))
        return sheet


def drive(client: Client, metres: float, speed_kmh: float, save: Path | None) -> None:
    """Drive so far, and print how it went."""
    pictures = client.subscribe("/image_jpeg/compressed")
    client.start_sync()
    lane, steering, driven, blind, rounds = LaneFinder(), 0.0, 0.0, 0, 0
    picture = None
    while driven < metres:
        command = {"longlCmdType": 2, "velocity": speed_kmh, "steering": steering}
        car = client.step(5, commands={0: command}).ego
        driven += 0.1 * abs(car["velocity"]["x"])
        new = pictures.take()
        if not new:
            continue
        picture = decode(new[-1])
        lane.look(picture)
        steering = lane.steering(steering)
        rounds += 1
        blind += not len(lane.middle)
    client.step(100, commands={0: {"longlCmdType": 1, "brake": 1.0}})
    print(f"drove {driven:.0f} m by {rounds} pictures, {blind} of them without a line")
    if save is not None and picture is not None:
        lane.drawing(picture).save(save)


def main() -> int:
    """Read the command line and drive."""
    parser = argparse.ArgumentParser(description="Keep the car in its lane by the camera alone.")
    parser.add_argument("--url", default="ws://127.0.0.1:9090")
    parser.add_argument("--metres", type=float, default=500.0, help="distance [m] (%(default)s)")
    parser.add_argument("--speed-kmh", type=float, default=20.0, help="[km/h] (%(default)s)")
    parser.add_argument("--save", type=Path, help="save what the program saw at last, as a picture")
    args = parser.parse_args()
    with Client(args.url, timeout=60.0) as client:  # the first picture of a map takes seconds
        drive(client, args.metres, args.speed_kmh, args.save)
    return 0


if __name__ == "__main__":
    sys.exit(main())
