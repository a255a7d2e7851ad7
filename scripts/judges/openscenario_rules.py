"""Judge sample stories without logs by figures that are worked out by hand: `openscenario_rules.py FOLDER`.

`FOLDER` has `xosc/`, `alks/` and `morai/`. The stories are told with `--ego story`, in frames of the server.
Synchronized entities must arrive when the master does; in ALKS's scenarios events come in order and at the times that
distances, speeds and accelerations of the file give; MORAI's have no event, and are told on `town` in place of their
map.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from scripts.judges.openscenario_logs import Run, tell

Figure = tuple[str, float, float, float]
"""What is measured, the measured and the expected figure, and the largest good difference."""

EGO_SPEED = 60.0 / 3.6
"""Of the ego in ALKS's scenarios [m/s]."""

CHANGE = 0.5 * math.pi * 3.5 / 2.0
"""Duration of a sinusoidal lane change of 3.5 m with at most 2 m/s to the side [s]."""

STEP = 0.06
"""An event begins up to so much later than its condition holds: a step of the story, and rounding [s]."""


def arrival(run: Run, name: str, x: float, y: float) -> tuple[float, float]:
    """Return when an entity is nearest to a place [s], and its speed then [m/s]."""
    rows = run.rows[name]
    row = int(np.hypot(rows[:, 1] - x, rows[:, 2] - y).argmin())
    return float(rows[row, 0]), float(rows[row, 4])


def along(run: Run, name: str, way: float) -> tuple[float, float]:
    """Return when an entity has come so far from its start [s], and its speed then [m/s]."""
    rows = run.rows[name]
    ways = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(rows[:, 1:3], axis=0).T))])
    row = int(np.searchsorted(ways, way))
    return float(rows[row, 0]), float(rows[row, 4])


def gap(run: Run, behind: str, ahead: str, time: float) -> float:
    """Return the free way between two entities, one behind the other [m]."""
    row, (one, other) = round(time / 0.02), (run.bodies[behind], run.bodies[ahead])
    apart = float(np.hypot(*(run.rows[ahead][row, 1:3] - run.rows[behind][row, 1:3])))
    return apart - (one.length - one.rear_overhang) - other.rear_overhang


def synchronize(run: Run) -> Iterator[Figure]:
    """The ego has 200 m at 20 m/s to its first place; each other one its own way in the same 10 s."""
    yield "Ego arrives", along(run, "Ego", 200.0)[0], 10.0, 0.05
    for name, way in (("NPC1", 305.0 - 150.0), ("NPC2", 285.0 - 20.0), ("NPC3", 297.0 - 70.0), ("NPC4", 330.0 - 170.0)):
        time, speed = along(run, name, way)
        yield f"{name} arrives", time, 10.0, 0.1
        yield f"{name}'s speed there", speed, 20.0, 0.2


def ltap_od(run: Run) -> Iterator[Figure]:
    """The ego has 56 m at 10 m/s to its place; the other one is 53 m before its own, where it has 7 m/s."""
    time, speed = along(run, "NPC", 53.0)
    yield "Ego arrives", along(run, "Ego", 56.0)[0], 5.6, 0.05
    yield "NPC arrives", time, 5.6, 0.15
    yield "NPC's speed there", speed, 7.0, 0.2


def distance_test(run: Run) -> Iterator[Figure]:
    """The ego is 198 m farther, at 15 m/s, when it is within 2 m of its place."""
    begins = 198.0 / 15.0
    yield "gap before", gap(run, "Dummy", "Ego", 13.0), 10.0, 0.1
    yield "second gap begins", run.events["DistManeuver/NonContinuousDistEvent"], begins, STEP
    yield "gap behind", gap(run, "Dummy", "Ego", run.over), 4.0, 0.1


def free_driving(run: Run) -> Iterator[Figure]:
    """The ego keeps its speed on a road of 5 km."""
    yield "controller begins", run.events["ActivateALKSControllerManeuver/ActivateALKSControllerEvent"], 3.0, STEP
    yield "over", run.over, 5000.0 / EGO_SPEED, STEP


def swerving_lead(run: Run) -> Iterator[Figure]:
    """Each shift of 1.5 m with 0.3 m/s^2 takes pi sqrt(1.5 / 0.6) s."""
    shift, y = math.pi * math.sqrt(1.5 / 0.6), run.rows["LeadVehicle"][:, 2]
    yield "first gap", gap(run, "Ego", "LeadVehicle", 0.0), 2.0 * EGO_SPEED, 0.01
    begins = (10.0, 15.0 + shift, 15.0 + 2.0 * shift, 20.0 + 3.0 * shift)
    for number, expected in zip(("", "2", "3", "4"), begins, strict=True):
        yield f"shift {number or 1} begins", run.events[f"SwerveManeuver/SwerveEvent{number}"], expected, 4.0 * STEP
    yield "to the left", float(y.max() - y[0]), 1.5, 0.01
    yield "to the right", float(y.min() - y[0]), -1.5, 0.01
    yield "back", float(y[-1] - y[0]), 0.0, 0.01
    yield "over", run.over, 50.0, STEP


def emergency_brake(run: Run) -> Iterator[Figure]:
    """The lead car brakes with 9.81 m/s^2."""
    rows, stop = run.rows["LeadVehicle"], EGO_SPEED / 9.81
    stands = float(rows[np.flatnonzero(rows[:, 4] == 0.0)[0], 0])
    yield "first gap", gap(run, "Ego", "LeadVehicle", 0.0), 2.0 * EGO_SPEED, 0.01
    yield "brakes", run.events["BrakeManeuver/BrakeEvent"], 10.0, STEP
    yield "stands", stands, 10.0 + stop, STEP + 0.02
    way = float(rows[-1, 1] - rows[round(10.0 / 0.02), 1])
    yield "way to the stop", way, 0.5 * EGO_SPEED * stop, 0.5 * EGO_SPEED * STEP + 0.01
    yield "over", run.over, 20.0 + stop, 3.0 * STEP


def cut_in(run: Run) -> Iterator[Figure]:
    """The ego closes with 20 km/h from 85.6 m to 30 m of free way."""
    ego, car = run.bodies["Ego"], run.bodies["CutInVehicle"]
    begins = (10.0 * 20.0 / 3.6 - (ego.length - ego.rear_overhang) - car.rear_overhang) / (20.0 / 3.6)
    y = {name: rows[:, 2] for name, rows in run.rows.items()}
    yield "cuts in", run.events["CutInManeuver/CutInEvent"], begins, STEP
    yield "to the side at first", float(y["CutInVehicle"][0] - y["Ego"][0]), -3.5, 0.01
    yield "to the side at last", float(y["CutInVehicle"][-1] - y["Ego"][-1]), 0.0, 0.01
    yield "over", run.over, begins + CHANGE + 10.0, 4.0 * STEP
    yield "its speed", float(run.rows["CutInVehicle"][-1, 4]), 40.0 / 3.6, 0.01


def cut_out(run: Run) -> Iterator[Figure]:
    """The lead car cuts out where its front is 50 m before the pedestrian at 500 m."""
    ego, car, person = (run.bodies[name] for name in ("Ego", "LeadVehicle", "TargetBlocking"))
    start = 5.0 + (ego.length - ego.rear_overhang) + 2.0 * EGO_SPEED + car.length  # of its front
    begins = (500.0 - person.rear_overhang - 50.0 - start) / EGO_SPEED
    y = run.rows["LeadVehicle"][:, 2]
    yield "first gap", gap(run, "Ego", "LeadVehicle", 0.0), 2.0 * EGO_SPEED, 0.01
    yield "cuts out", run.events["CutOutManeuver/CutOutEvent"], begins, STEP
    yield "to the side", float(y[-1] - y[0]), 3.5, 0.01
    yield "over", run.over, 500.0 / EGO_SPEED + 10.0, STEP


def stays(run: Run) -> Iterator[Figure]:
    """No entity of MORAI's three moves from where the file has it."""
    for name, rows in run.rows.items():
        yield f"{name} moves", float(np.abs(rows[:, 1:4] - rows[0, 1:4]).max()), 0.0, 1e-6


JUDGES: dict[str, tuple[float, Callable[[Run], Iterator[Figure]], str | None]] = {
    "xosc/synchronize.xosc": (16.0, synchronize, None),
    "xosc/ltap-od.xosc": (8.0, ltap_od, None),
    "xosc/distance_test.xosc": (21.0, distance_test, None),
    "alks/alks_scenario_4_1_1_free_driving_template.xosc": (300.2, free_driving, None),
    "alks/alks_scenario_4_1_2_swerving_lead_vehicle_template.xosc": (50.2, swerving_lead, None),
    "alks/alks_scenario_4_3_2_follow_lead_vehicle_emergency_brake_template.xosc": (22.0, emergency_brake, None),
    "alks/alks_scenario_4_4_1_cut_in_no_collision_template.xosc": (22.5, cut_in, None),
    "alks/alks_scenario_4_5_1_cut_out_fully_blocking_template.xosc": (40.2, cut_out, None),
    "morai/001.xosc": (1.0, stays, "town"),
    "morai/002.xosc": (1.0, stays, "town"),
    "morai/003.xosc": (1.0, stays, "town"),
}
"""File -> time that it is told for [s], its figures, and the map in place of its own."""


def main() -> int:
    """Print each figure; return 1 if one differs by more than it may."""
    is_good = True
    for file, (seconds, judge, map_name) in JUDGES.items():
        print(file)
        for what, figure, expected, most in judge(tell(Path(sys.argv[1]) / file, seconds, map_name)):
            verdict = "good" if abs(figure - expected) <= most else "differs"
            is_good &= verdict == "good"
            print(f"  {what}: {verdict}, {figure:.3f}, expected {expected:.3f} within {most:g}")
    return 0 if is_good else 1


if __name__ == "__main__":
    sys.exit(main())
