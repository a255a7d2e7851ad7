"""SUMO's side of the comparison: networks by netconvert, runs through libsumo, with SUMO's default car.

It needs the environment that `traffic.py` makes.
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from rosbridge_sim.world.geometry.planar import FloatArray
from scripts.bench.sumo_network import Network
from scripts.bench.traffic_cases import CAR, QUEUE_LINE, Demand, Flow

NOSE = CAR.length / 2 + CAR.centre
"""From our reference point to the front bumper, which is SUMO's [m]."""


def build(network: Network, folder: Path, name: str) -> Path:
    """Convert a map with netconvert, and return the file of the network.

    Args:
        network: the map.
        folder: for all files.
        name: of the files.

    Raises:
        RuntimeError: netconvert has refused it.
    """
    paths = {}
    for end, content in network.files().items():
        paths[end] = folder / f"{name}.{end}"
        paths[end].write_text(content, encoding="utf-8")
    net = folder / f"{name}.net.xml"
    netconvert = Path(sys.executable).with_name("netconvert")
    flags = {"-n": "nod.xml", "-e": "edg.xml", "-x": "con.xml", "-i": "tll.xml"}
    command = [str(netconvert), *(word for flag, end in flags.items() for word in (flag, str(paths[end])))]
    done = subprocess.run(  # noqa: S603 - our own words
        [*command, "-o", str(net), "--no-warnings"], capture_output=True, text=True, check=False
    )
    if done.returncode:
        raise RuntimeError(f"netconvert: {done.stderr}")
    return net


@contextmanager
def _running(
    net: Path, network: Network, demand: Demand, *, step: float, seed: int, flags: tuple[str, ...] = ()
) -> Iterator[Any]:
    """Yield libsumo, which is Any because it has no types, with a loaded run."""
    routes = net.with_suffix(".rou.xml")
    routes.write_text(_routes(network, demand), encoding="utf-8")
    sumo = import_module("libsumo")
    sumo.start(
        [
            *("sumo", "-n", str(net), "-r", str(routes), "--no-step-log", "--no-warnings", "--seed", str(seed)),
            *("--step-length", str(step), "--duration-log.disable", *flags),
        ]
    )
    try:
        yield sumo
    finally:
        sumo.close()


def _routes(network: Network, demand: Demand) -> str:
    """Return the vehicles as SUMO's file of routes."""
    lines = ["<routes>"]
    for i, start in enumerate(demand):
        _, index, s = network.place(start.lane, start.s)
        edge = network.edges[network.edge_of_lane[start.lane]]
        front = min(s + NOSE, network.length_of(edge) - 0.1)
        lines.append(
            f'<vehicle id="{i}" depart="0" departLane="{index}" departPos="{front:.2f}"'
            f' departSpeed="{start.speed:.2f}" insertionChecks="none">'
            f'<route edges="{" ".join(network.edges_along(start.route))}"/></vehicle>'
        )
    return "\n".join([*lines, "</routes>", ""])


def measure_flow(
    net: Path, network: Network, demand: Demand, *, settle: float, seconds: float, step: float = 1.0, seed: int = 0
) -> Flow:
    """Return the figures of SUMO's traffic.

    Args:
        net: the network.
        network: the map that it was made from.
        demand: the vehicles, with routes that are long enough.
        settle: time before the measurement [s].
        seconds: time of the measurement.
        step: length of a step [s]; 1 is SUMO's default.
        seed: of SUMO's chance.
    """
    removed = 0
    with _running(net, network, demand, step=step, seed=seed) as sumo:
        for _ in range(round(settle / step)):
            sumo.simulationStep()
        names = sumo.vehicle.getIDList()
        before = {name: (sumo.vehicle.getDistance(name), sumo.vehicle.getRouteIndex(name)) for name in names}
        for _ in range(round(seconds / step)):
            sumo.simulationStep()
            removed += sumo.simulation.getStartingTeleportNumber()
        left = [name for name in sumo.vehicle.getIDList() if name in before]
        driven = sum(sumo.vehicle.getDistance(name) - before[name][0] for name in left)
        passed = sum(sumo.vehicle.getRouteIndex(name) - before[name][1] for name in left)
    return Flow(driven / seconds / len(left), passed * 3600.0 / seconds, removed)


def discharge(
    net: Path, network: Network, demand: Demand, *, red: float, step: float = 1.0, seed: int = 0
) -> FloatArray:
    """Return when the front bumpers pass the stop line after the light turns green, (n,) [s]; see `traffic_cases`.

    Args:
        net: the network of `queue_roads`.
        network: the map.
        demand: the queue.
        red: length of the red [s].
        step: length of a step [s].
        seed: of SUMO's chance.
    """
    times = np.full(len(demand), np.nan)
    with _running(net, network, demand, step=step, seed=seed) as sumo:
        line = sumo.simulation.convert2D("e0", 0.0)[0] + QUEUE_LINE  # netconvert may move the origin
        before = np.full(len(demand), -np.inf)
        while np.isnan(times).any() and sumo.simulation.getTime() < red + 200.0:
            sumo.simulationStep()
            now = sumo.simulation.getTime() - red
            for name in sumo.vehicle.getIDList():
                i, x = int(name), sumo.vehicle.getPosition(name)[0]
                if before[i] < line <= x:
                    times[i] = now - step * (x - line) / (x - before[i])
                before[i] = x
    return times


@contextmanager
def stepping(
    net: Path, network: Network, demand: Demand, *, settle: float, step: float, flags: tuple[str, ...] = ()
) -> Iterator[tuple[Callable[[], None], Callable[[], int]]]:
    """Run SUMO step by step, to measure its cost.

    Args:
        net: the network.
        network: the map.
        demand: the vehicles.
        settle: time to simulate first [s].
        step: length of a step [s].
        flags: more options of SUMO.

    Yields:
        A function that does one step, and one that returns the number of vehicles.
    """
    with _running(net, network, demand, step=step, seed=0, flags=flags) as sumo:
        for _ in range(round(settle / step)):
            sumo.simulationStep()
        yield sumo.simulationStep, sumo.vehicle.getIDCount
