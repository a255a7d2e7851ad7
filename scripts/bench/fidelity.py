"""The single track model beside commonroad-vehicle-models, and beside the published figures of a Hyundai Ioniq.

    python scripts/bench/fidelity.py [--images DIR] [--env DIR] [--pages FILE]

It makes an environment of its own (`.venv-fidelity`) with the PyPI packages commonroad-vehicle-models, matplotlib and
msgspec, runs itself there, prints Markdown tables, and writes plots.

Our car has that package's parameters of vehicle 2 (a BMW 320i). The reference gets the same steering and the same
acceleration as ours in each step, and is integrated with a hundredth of our step. Below 0.5 g ours must be within 10 %
of ST, the package's linear single track model; at the limit within 20 % of STD, its single track model with drift. A
deviation is the root mean square of the difference, divided by the greatest amount in the reference; for the path it is
the distance between both ends, divided by the length of the path.

Another table has braking in turns, with stability control, beside MB, the package's multi-body model. Both get the same
steering and the same commanded deceleration, from the speed of the turn down to 3 m/s. MB has neither stability control
nor ABS: where it locks its wheels, it goes straight on. Ours must keep the slip of its rear axle below 8 degrees, and
leave the circle of the turn to the outside by no more than MB does, and half a metre.
"""

from __future__ import annotations

import argparse
import math
import subprocess
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from rosbridge_sim.records import replace
from rosbridge_sim.scenarios.catalogue import CATALOGUE, DEFAULT_EGO
from rosbridge_sim.world.state.commands import command
from rosbridge_sim.world.state.entity_types import ROAD_FRICTION
from rosbridge_sim.world.state.world import DT, Body, Dynamics, Kind, Mode, World
from rosbridge_sim.world.step import step

ROOT = Path(__file__).resolve().parents[2]

PACKAGES = ("commonroad-vehicle-models==3.0.2", "matplotlib", "msgspec", "numpy")

BELOW_LIMIT = 0.10
AT_LIMIT = 0.20
"""Wanted deviations from ST and STD."""

SUBSTEPS = 100
"""Steps of the reference in one of ours. The wheels of STD have time constants of a millisecond."""

HALF_G = 0.5 * 9.80665


def run_inside(env: Path, arguments: Sequence[str]) -> int:
    """Make the environment if there is none, and run this file in it.

    Args:
        env: folder of the environment.
        arguments: of the command line.
    """
    python = env / "bin" / "python"
    if not python.exists():
        subprocess.run([sys.executable, "-m", "venv", str(env)], check=True)  # noqa: S603 - our own words
        subprocess.run([str(python), "-m", "pip", "install", "-q", *PACKAGES], check=True)  # noqa: S603 - the same
    return subprocess.run([str(python), __file__, "--inside", *arguments], check=False).returncode  # noqa: S603 - the same


@dataclass(frozen=True)
class Manoeuvre:
    """One drive.

    Attributes:
        name: for tables and plots.
        speed: at the start [m/s].
        seconds: length.
        steer: wanted wheel angle by time [rad].
        accel: wanted acceleration by time [m/s^2]; None for no pedals.
        settle: seconds before the manoeuvre, in which the car drives with `steer(0)`; they are not compared.
    """

    name: str
    speed: float
    seconds: float
    steer: Callable[[float], float]
    accel: Callable[[float], float] | None = None
    settle: float = 0.0


def manoeuvres(lane_change: float, turn: float) -> list[Manoeuvre]:
    """Return all drives.

    Args:
        lane_change: amplitude of the sine of steering that moves the car 3.5 m to the left [rad].
        turn: wheel angle of a turn of 50 m radius at 15 m/s [rad].
    """

    def step_to(angle: float) -> Callable[[float], float]:
        return lambda t: angle if t >= 0.2 else 0.0

    steps = [
        Manoeuvre(f"step steer {angle:g} rad at {speed:g} m/s", speed, 3.0, step_to(angle))
        for speed in (5.0, 15.0, 25.0)
        for angle in (0.02, 0.1)
    ]
    period = 3.0
    return [
        *steps,
        Manoeuvre(
            "3.5 m lane change at 20 m/s",
            20.0,
            4.5,
            lambda t: lane_change * math.sin(2 * math.pi * (t - 0.2) / period) if 0.2 <= t < 0.2 + period else 0.0,
        ),
        Manoeuvre(
            "braking in a turn of 50 m at 15 m/s",
            15.0,
            3.0,
            lambda _: turn,
            lambda t: -4.0 if t >= 0.2 else 0.0,
            settle=3.0,
        ),
        Manoeuvre("full lock at 20 m/s", 20.0, 3.0, step_to(1.0)),
    ]


def vehicle_2() -> tuple[Any, Body]:
    """Return the package's parameters of vehicle 2, and our body with these."""
    p = import_module("vehiclemodels.parameters_vehicle2").parameters_vehicle2()
    wheelbase = p.a + p.b
    body = Body(
        length=p.l,
        width=p.w,
        wheelbase=wheelbase,
        front_overhang=0.8,
        rear_overhang=p.l - 0.8 - wheelbase,
        max_steer=p.steering.max,
        max_steer_rate=p.steering.v_max,
        max_accel=p.longitudinal.a_max,
        max_decel=p.longitudinal.a_max,
        rolling=0.0,
        air_drag=0.0,
        engine_drag=0.0,
        mass=p.m,
        front_load=p.b / wheelbase,
        cg_height=p.h_s,
        dynamic_index=p.I_z / (p.m * p.a * p.b),
        front_stiffness=-p.tire.p_ky1,
        rear_stiffness=-p.tire.p_ky1,
        grip=p.tire.p_dy1 / ROAD_FRICTION,
        grip_along=p.tire.p_dy1 / ROAD_FRICTION,  # a friction circle: ST has this friction alone
        front_drive=p.T_se,
    )
    return p, body


def drive_ours(body: Body, drive: Manoeuvre) -> dict[str, list[float]]:
    """Return traces of our car, at its centre of gravity, and the steering and acceleration of each step.

    Args:
        body: the car.
        drive: the manoeuvre.
    """
    world = World(0, Dynamics.SINGLE_TRACK, has_stability_control=False)  # as the references
    world.spawn(Kind.EGO, body, name="ego", x=0.0, y=0.0, speed=drive.speed)
    to_rear = body.front_load * body.wheelbase
    names = ("t", "x", "y", "v", "yaw", "yaw_rate", "slip", "lateral_accel", "steer", "accel", "roll", "pitch")
    trace: dict[str, list[float]] = {name: [] for name in names}

    def note(t: float) -> None:
        yaw, rate = world.yaw.item(0), world.yaw_rate.item(0)
        u, w = world.speed.item(0), world.lateral_speed.item(0) + to_rear * rate
        values = (
            *(t, world.x.item(0) + to_rear * math.cos(yaw), world.y.item(0) + to_rear * math.sin(yaw)),
            *(math.hypot(u, w), yaw, rate, math.atan2(w, u)),
            world.lateral_accel.item(0) + to_rear * world.yaw_accel.item(0),
            *(world.steer.item(0), world.accel.item(0), world.roll.item(0), world.pitch.item(0)),
        )
        for name, value in zip(names, values, strict=True):
            trace[name].append(value)

    settle = round(drive.settle / DT)
    for i in range(-settle, round(drive.seconds / DT) + 1):
        t = max(0.0, i * DT)
        if i >= 0:
            note(t)
        accel = drive.accel(t) if drive.accel else 0.0
        if i < 0:  # hold the speed until the manoeuvre begins
            command(world, 0, mode=Mode.SPEED, steer=drive.steer(0.0), speed=drive.speed)
        elif accel < 0.0:
            command(world, 0, mode=Mode.ACCEL, steer=drive.steer(t), accel=accel)
        else:
            command(world, 0, mode=Mode.PEDALS, steer=drive.steer(t))
        step(world)
    return trace


def drive_reference(  # p is an object of the package
    p: Any,  # noqa: ANN401
    model: str,
    ours: dict[str, list[float]],
    drive: Manoeuvre,
) -> dict[str, list[float]]:
    """Return traces of the reference, which gets our steering and our braking.

    Args:
        p: parameters.
        model: `ST` or `STD`.
        ours: our traces.
        drive: the manoeuvre.
    """
    name = f"vehicle_dynamics_{model.lower()}"
    derive = getattr(import_module(f"vehiclemodels.{name}"), name)
    core = [ours[name][0] for name in ("x", "y", "steer", "v", "yaw", "yaw_rate", "slip")]
    state = np.array(import_module("vehiclemodels.init_std").init_std(core, p) if model == "STD" else core)
    trace: dict[str, list[float]] = {name: [] for name in ("t", "x", "y", "v", "yaw_rate", "lateral_accel")}
    dt = 0.02 / SUBSTEPS
    times = ours["t"]
    for i, t in enumerate(times):
        rate = (ours["steer"][i + 1] - ours["steer"][i]) / 0.02 if i + 1 < len(times) else 0.0
        braking = ours["accel"][i + 1] if drive.accel and i + 1 < len(times) else 0.0
        change = np.array(derive(list(state), [rate, braking], p))
        lateral = state[3] * (state[5] + change[6]) * math.cos(state[6]) + change[3] * math.sin(state[6])
        for name, value in zip(trace, (t, state[0], state[1], state[3], state[5], lateral), strict=True):
            trace[name].append(float(value))
        for _ in range(SUBSTEPS if i + 1 < len(times) else 0):
            change = np.array(derive(list(state), [rate, braking], p))
            state = state + dt * change
    return trace


def compare(ours: dict[str, list[float]], other: dict[str, list[float]]) -> tuple[float, float, float]:
    """Return the deviations of yaw rate, lateral acceleration and path, as the head of this file has them."""
    found = []
    for name in ("yaw_rate", "lateral_accel"):
        mine, its = np.array(ours[name]), np.array(other[name])
        found.append(float(np.sqrt(np.mean((mine - its) ** 2)) / np.abs(its).max()))
    length = float(np.hypot(np.diff(other["x"]), np.diff(other["y"])).sum())
    found.append(math.hypot(ours["x"][-1] - other["x"][-1], ours["y"][-1] - other["y"][-1]) / length)
    return found[0], found[1], found[2]


def main() -> int:
    """Compare, print, plot."""
    parser = argparse.ArgumentParser(description="fidelity of the single track model")
    parser.add_argument("--images", type=Path, default=ROOT / "docs" / "images", help="folder of the plots")
    parser.add_argument("--env", type=Path, default=ROOT / ".venv-fidelity", help="environment for the packages")
    parser.add_argument("--inside", action="store_true", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if not arguments.inside:
        return run_inside(arguments.env, [f"--images={arguments.images}"])
    is_good = compare_all(arguments.images)
    print()
    is_good &= compare_braking()
    print()
    measure_ioniq(arguments.images)
    print()
    measure_stops()
    return 0 if is_good else 1


TURN_SPEEDS = (15.0, 20.0, 25.0, 30.0)
TURN_LATERALS = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6)
TURN_BRAKING = (-2.0, -4.0, -6.0, -8.0)
"""The table of braking in turns: speed [m/s], lateral acceleration [g] and commanded acceleration [m/s^2]."""

TURN_SETTLE = 2.0
"""Time in which the cars come into the turn [s]."""

MAX_SLIP = math.radians(8.0)
MAX_BEYOND = 0.5
"""Wanted of our car: slip of the rear axle, and how much farther than MB it may leave the turn [m]."""

MB_SUBSTEPS = 20
"""Steps of MB in one of ours; with a hundred its path ends 3 cm from there."""


@dataclass(frozen=True)
class Braking:
    """Result of braking in a turn.

    Attributes:
        slip: greatest slip angle of the rear axle [rad].
        outside: farthest place outside the circle of the turn [m].
        decel: mean deceleration down to 3 m/s [m/s^2].
    """

    slip: float
    outside: float
    decel: float


def judge(trace: list[tuple[float, float, float, float, float, float, float]]) -> Braking:
    """Return the result of a trace: time, x, y, speed ahead, yaw, yaw rate and slip of the rear axle of each step."""
    t, x, y, speed, yaw, rate, slip = np.array(trace).T
    course = yaw[0]
    radius = speed[0] / rate[0]
    middle = complex(x[0], y[0]) + 1j * radius * np.exp(1j * course)
    away = np.abs(x + 1j * y - middle) - radius
    return Braking(float(np.abs(slip).max()), float(away.max()), float((speed[0] - speed[-1]) / (t[-1] - t[0])))


def brake_ours(body: Body, speed: float, steer: float, accel: float) -> Braking:
    """Brake our car in a turn, with stability control; places are those of its rear axle."""
    world = World(0, Dynamics.SINGLE_TRACK)
    world.spawn(Kind.EGO, body, name="ego", x=0.0, y=0.0, speed=speed)
    trace = []
    frame = 0
    while world.speed.item(0) > 3.0:
        t = frame * DT
        is_braking = t >= TURN_SETTLE
        if is_braking:
            columns = (world.x, world.y, world.speed, world.yaw, world.yaw_rate, world.rear_slip)
            x, y, ahead, yaw, rate, slip = (column.item(0) for column in columns)
            trace.append((t, x, y, ahead, yaw, rate, slip))
            command(world, 0, mode=Mode.ACCEL, steer=steer, accel=accel)
        else:
            command(world, 0, mode=Mode.SPEED, steer=steer, speed=speed)
        step(world)
        frame += 1
    return judge(trace)


def brake_mb(p: Any, speed: float, steer: float, accel: float) -> Braking:  # noqa: ANN401 - p is an object of the package
    """Brake MB in the same turn; places are those of the middle of its rear axle."""
    derive = import_module("vehiclemodels.vehicle_dynamics_mb").vehicle_dynamics_mb
    state = np.array(import_module("vehiclemodels.init_mb").init_mb([0.0, 0.0, 0.0, speed, 0.0, 0.0, 0.0], p))
    dt = DT / MB_SUBSTEPS
    trace = []
    i = 0
    while state[3] > 3.0:
        t = i * dt
        if t >= TURN_SETTLE and i % MB_SUBSTEPS == 0:
            x, y, _, ahead, yaw, rate = state[:6]
            across = state[10] - p.b * rate
            place = complex(x, y) - p.b * np.exp(1j * yaw)
            trace.append((t, place.real, place.imag, ahead, yaw, rate, math.atan2(across, ahead)))
        turn = float(np.clip((steer - state[2]) / dt, p.steering.v_min, p.steering.v_max))
        wanted = accel if t >= TURN_SETTLE else 2.0 * (speed - math.hypot(state[3], state[10]))
        state = state + dt * np.array(derive(list(state), [turn, wanted], p))
        i += 1
    return judge(trace)


def compare_braking() -> bool:
    """Compare braking in turns with MB."""
    p, body = vehicle_2()
    print("| speed | turn | " + " | ".join(f"{accel:g} m/s²" for accel in TURN_BRAKING) + " |")
    print("|---" * (2 + len(TURN_BRAKING)) + "|")
    is_good = True
    for speed in TURN_SPEEDS:
        for lateral in TURN_LATERALS:
            steer = math.atan(body.wheelbase * lateral * 9.81 / speed**2)
            cells = []
            for accel in TURN_BRAKING:
                ours, other = brake_ours(body, speed, steer, accel), brake_mb(p, speed, steer, accel)
                is_held = ours.slip < MAX_SLIP and ours.outside <= max(other.outside, 0.0) + MAX_BEYOND
                is_good &= is_held
                cells.append(
                    f"{math.degrees(ours.slip):.1f}° ({math.degrees(other.slip):.1f}°), "
                    f"{ours.outside:.1f} m ({other.outside:.1f} m), {ours.decel:.1f} ({other.decel:.1f})"
                    + ("" if is_held else " **!**")
                )
            print(f"| {speed:g} m/s | {lateral:g} g | " + " | ".join(cells) + " |", flush=True)
    return is_good


def plotting() -> Any:  # noqa: ANN401 - a module
    """Return matplotlib's pyplot, which draws into files here."""
    import_module("matplotlib").use("Agg")
    return import_module("matplotlib.pyplot")


def find_steering(body: Body) -> tuple[float, float]:
    """Return the amplitude of the lane change and the wheel angle of the turn, by bisection on our model."""

    def bisect(reached: Callable[[float], float], wanted: float) -> float:
        low, high = 0.0, 0.3
        for _ in range(40):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if reached(middle) < wanted else (low, middle)
        return 0.5 * (low + high)

    change = bisect(lambda a: drive_ours(body, manoeuvres(a, 0.0)[6])["y"][-1], 3.5)
    turn = bisect(lambda a: drive_ours(body, replace(manoeuvres(0.0, a)[7], seconds=0.1))["yaw_rate"][0], 15.0 / 50.0)
    return change, turn


def compare_all(images: Path) -> bool:
    """Compare all manoeuvres with the reference."""
    p, body = vehicle_2()
    drives = manoeuvres(*find_steering(body))
    figure, axes = plotting().subplots(3, len(drives), figsize=(3.2 * len(drives), 8.0), constrained_layout=True)
    print("| manoeuvre | peak | reference | yaw rate | lateral acceleration | path | wanted |")
    print("|---|---|---|---|---|---|---|")
    is_good = True
    for column, drive in zip(axes.T, drives, strict=True):
        ours = drive_ours(body, drive)
        references = {model: drive_reference(p, model, ours, drive) for model in ("ST", "STD")}
        peak = max(map(abs, references["STD"]["lateral_accel"]))
        model, wanted = ("ST", BELOW_LIMIT) if peak < HALF_G else ("STD", AT_LIMIT)
        found = compare(ours, references[model])
        is_good &= max(found) <= wanted
        cells = " | ".join(f"{100 * value:.1f} %" for value in found)
        print(f"| {drive.name} | {peak / 9.80665:.2f} g | {model} | {cells} | {100 * wanted:.0f} % |")
        for name, trace, style in (("rosbridge-sim", ours, "-"), *((m, t, "--") for m, t in references.items())):
            if name == "ST" and model == "STD":
                continue  # a linear tyre says nothing here
            column[0].plot(trace["t"], trace["yaw_rate"], style, label=name)
            column[1].plot(trace["t"], trace["lateral_accel"], style)
            column[2].plot(trace["x"], trace["y"], style)
        column[0].set_title(drive.name.replace(" at ", "\nat "), fontsize=10)
        column[0].legend(fontsize=8)
        column[2].set_aspect("equal", adjustable="datalim")
    for row, label in zip(axes[:, 0], ("yaw rate [rad/s]", "lateral acceleration [m/s²]", "path [m]"), strict=True):
        row.set_ylabel(label)
    images.mkdir(parents=True, exist_ok=True)
    figure.savefig(images / "fidelity.png", dpi=70)
    return is_good


PUBLISHED = {
    "0..100 km/h": "10.8 s (maker, 1.6 GDI hybrid)",
    "100..0 km/h": "36 to 38 m (magazines)",
    "top speed": "185 km/h (maker)",
    "turning circle, kerb to kerb": "10.6 m (maker)",
}
"""Of the Hyundai Ioniq of 2016."""


USUAL_STOPS = {
    "2021_VW_Golf_GTI": "34 to 36 m",
    "2020_Kia_Stinger": "35 to 37 m",
    "Van": "40 to 44 m",
    "Truck": "50 to 60 m",
    "Bus": "55 to 65 m",
    "Motorcycle": "40 to 48 m",
    "Bicycle": "70 to 100 m",
}
USUAL_STOP = "36 to 38 m"
"""Stops from 100 km/h; the last is that of all other cars. Cars, the van and the motorcycle: tests of magazines. Truck
and bus: 6 to 7 m/s^2, where UN Regulation 13 wants 5. Bicycle: 4 to 5 m/s^2, before its rider goes over the front."""


def stop(body: Body) -> World:
    """Return a world whose ego has begun to brake with all its brakes at 100 km/h."""
    world = World(0, Dynamics.SINGLE_TRACK)
    world.spawn(Kind.EGO, body, name="ego", x=0.0, y=0.0, speed=100 / 3.6)
    command(world, 0, mode=Mode.PEDALS, brake=1.0, steer=0.0)
    return world


def measure_stops() -> None:
    """Print how far all vehicles of the catalogue that have a name go from 100 km/h to a stand."""
    print("| model | `grip_along` | `grip` | `max_decel` | 100..0 km/h | usual |")
    print("|---|---|---|---|---|---|")
    for model in CATALOGUE:
        name, body = model.name, model.body
        if model.kind is not Kind.VEHICLE or name.startswith("Vehicle_"):
            continue
        world = stop(body)
        while world.speed.item(0) > 0.0:
            step(world)
        figures = f"{body.grip_along:g} | {body.grip:g} | {body.max_decel:g} m/s² | {world.x.item(0):.1f} m"
        print(f"| {name} | {figures} | {USUAL_STOPS.get(name, USUAL_STOP)} |")


def measure_ioniq(images: Path) -> None:
    """Measure what makers and magazines publish of an Ioniq, print it, and plot the pedals and the lean.

    Args:
        images: folder of the plots.
    """
    body = DEFAULT_EGO.body
    world = World(0, Dynamics.SINGLE_TRACK)
    world.spawn(Kind.EGO, body, name="ego", x=0.0, y=0.0)
    command(world, 0, mode=Mode.PEDALS, throttle=1.0, steer=0.0)
    trace: list[tuple[float, ...]] = []

    def go_on(until: Callable[[], bool]) -> None:
        while not until():
            step(world)
            figures = (world.speed, world.accel, world.pitch, world.roll)
            trace.append((world.frame * DT, *(column.item(0) for column in figures)))

    go_on(lambda: world.speed.item(0) >= 100 / 3.6)
    found = {"0..100 km/h": f"{world.frame * DT:.1f} s"}
    go_on(lambda: world.frame * DT >= 150.0)
    top = f"{world.speed.item(0) * 3.6:.0f} km/h"
    world = stop(body)
    num = len(trace)
    go_on(lambda: world.speed.item(0) == 0.0)
    found["100..0 km/h"] = f"{world.x.item(0):.1f} m"
    found["top speed"] = top
    world = World(0, Dynamics.SINGLE_TRACK)
    world.spawn(Kind.EGO, body, name="ego", x=0.0, y=0.0)
    command(world, 0, mode=Mode.SPEED, speed=2.0, steer=body.max_steer)
    for _ in range(500):  # until it drives a circle
        step(world)
    north = []
    for _ in range(1500):
        step(world)
        north.append(world.y.item(0))
    radius = 0.5 * (max(north) - min(north))
    wheel = math.hypot(radius + 0.5 * body.width - 0.12, body.wheelbase)  # middle of the outer front wheel
    found["turning circle, kerb to kerb"] = f"{2.0 * wheel:.1f} m"
    print("| Ioniq | here | published |")
    print("|---|---|---|")
    for name, value in found.items():
        print(f"| {name} | {value} | {PUBLISHED[name]} |")
    brakes = np.array(trace[num:])
    figure, axes = plotting().subplots(1, 3, figsize=(12.0, 3.2), constrained_layout=True)
    starts = np.array(trace[: round(15.0 / DT)])
    axes[0].plot(starts[:, 0], starts[:, 1] * 3.6, label="speed, full throttle [km/h]")
    axes[1].plot(brakes[:, 0], brakes[:, 2], label="acceleration, full brake [m/s²]")
    axes[2].plot(brakes[:, 0], np.degrees(brakes[:, 3]), label="pitch, full brake [deg]")
    for each in axes:
        each.set_xlabel("time [s]")
        each.legend(fontsize=8)
    figure.savefig(images / "fidelity_pedals.png", dpi=70)


if __name__ == "__main__":
    sys.exit(main())
