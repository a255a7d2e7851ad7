"""Pictures of impacts from behind and from the side, for docs/modelling.md.

    python scripts/bench/impacts.py [--images DIR]

It needs matplotlib. An ego hits a vehicle on a lane. Both are drawn from above every 0.2 s, with speeds and yaw rates.
"""

from __future__ import annotations

import argparse
import math
import sys
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from rosbridge_sim.scenarios.catalogue import DEFAULT_EGO
from rosbridge_sim.world.drivers.lane_position import LaneStart, keep_lanes
from rosbridge_sim.world.roads.roads import Roads
from rosbridge_sim.world.state.commands import command
from rosbridge_sim.world.state.world import DT, Dynamics, Kind, Mode, World
from rosbridge_sim.world.step import step

ROOT = Path(__file__).resolve().parents[2]

SECONDS = 3.0
EVERY = 10
"""Steps from one outline to the next."""

COLOURS = ("tab:red", "tab:blue")


@dataclass(frozen=True)
class Case:
    """An impact.

    Attributes:
        name: title of the picture.
        place: x, y [m] and heading [rad] of the ego at the start.
        speed: of the ego [m/s].
        other: speed of the vehicle on the lane [m/s], which starts at x = 100 m.
    """

    name: str
    place: tuple[float, float, float]
    speed: float
    other: float


CASES = (
    Case("from behind, 25 m/s into 10 m/s", (88.0, 0.0, 0.0), 25.0, 10.0),
    Case("from behind beside the middle", (88.0, 0.9, 0.0), 25.0, 10.0),
    Case("from the side, 15 m/s into 10 m/s", (107.0, -12.0, math.pi / 2), 15.0, 10.0),
)


def drive(case: Case) -> dict[str, Any]:
    """Return columns of both vehicles, (2, steps) each, the ego first."""
    world = World(0, Dynamics.SINGLE_TRACK, has_impacts=True)
    line = np.array([[0.0, 0.0, 0.0], [1000.0, 0.0, 0.0]])
    world.lay_roads(Roads(["a"], [line], [[]], [3.5], [15.0]))
    x, y, yaw = case.place
    body = DEFAULT_EGO.body
    ego = world.row(world.spawn(Kind.EGO, body, name="ego", x=x, y=y, yaw=yaw, speed=case.speed))
    other = world.row(world.spawn(Kind.VEHICLE, body, name="other", x=0.0, y=0.0, speed=case.other))
    keep_lanes(world, [LaneStart(other, 0, 100.0, desired_speed=case.other)])
    rows = [ego, other]
    names = ("x", "y", "yaw", "speed", "lateral_speed", "yaw_rate")
    found: dict[str, list[Any]] = {name: [] for name in names}
    for _ in range(round(SECONDS / DT)):
        if len(world.contacts):
            command(world, ego, mode=Mode.PEDALS, steer=0.0, brake=1.0)
        step(world)
        for name in names:
            found[name].append(getattr(world, name)[rows])
    return {name: np.array(values).T for name, values in found.items()}


def draw(images: Path) -> None:
    """Draw all cases into `impacts.png`."""
    import_module("matplotlib").use("Agg")
    pyplot: Any = import_module("matplotlib.pyplot")
    figure, axes = pyplot.subplots(3, len(CASES), figsize=(16, 11), height_ratios=(2, 1, 1))
    body = DEFAULT_EGO.body
    half = np.array([[1, 1], [1, -1], [-1, -1], [-1, 1], [1, 1]]) * (body.length / 2, body.width / 2)
    for (above, speeds, rates), case in zip(axes.T, CASES, strict=True):
        found = drive(case)
        times = DT * np.arange(1, found["x"].shape[1] + 1)
        for which, colour in enumerate(COLOURS):
            for i in range(0, len(times), EVERY):
                x, y, yaw = (found[name][which, i] for name in ("x", "y", "yaw"))
                corner = (half[:, 0] + body.centre + 1j * half[:, 1]) * np.exp(1j * yaw) + x + 1j * y
                above.plot(corner.real, corner.imag, color=colour, alpha=0.25 + 0.75 * i / len(times))
            total = np.hypot(found["speed"][which], found["lateral_speed"][which])
            speeds.plot(times, total, color=colour)
            rates.plot(times, found["yaw_rate"][which], color=colour)
        above.set_aspect("equal", adjustable="datalim")
        above.set_title(case.name)
        above.set_xlabel("x [m]")
        above.set_ylabel("y [m]")
        speeds.set_ylabel("speed of the rear axle [m/s]")
        rates.set_ylabel("yaw rate [rad/s]")
        rates.set_xlabel("time [s]")
    figure.tight_layout()
    figure.savefig(images / "impacts.png", dpi=60)


def main() -> int:
    """Run the command line, and return its exit code."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--images", type=Path, default=ROOT / "docs" / "images", help="folder [%(default)s]")
    draw(parser.parse_args().images)
    return 0


if __name__ == "__main__":
    sys.exit(main())
