"""The programs with sensors of `scripts/examples/`, as a user runs them: in synchronous mode, on `town`."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from rosbridge_sim.client import Client
from rosbridge_sim.maps.road_map import RoadMap
from rosbridge_sim.shell.files.library import DiskLibrary
from tests import fork_server
from tests.cpu_time import communicate
from tests.fork_server import ForkedProgram
from tests.support import PATIENCE, ROOT, ServerProcess

pytest.importorskip("moderngl")
pytest.importorskip("embreex")
pytest.importorskip("simplejpeg")

pytestmark = [pytest.mark.client, pytest.mark.slow]

SENSORS = """
[[camera]]
x = 1.8
z = 2.0
pitch = 7
rate = 10

[[lidar3d]]
x = 2.0
z = 1.28

[[lidar2d]]
x = 3.8
z = 0.5
"""
"""MORAI-EDU's camera and lidar, and a 2D lidar at the front bumper, each ten times a second."""

SOUTH = -221.75
"""Northing of the outer lane of the town's southern street, eastbound."""


@cache
def town() -> RoadMap:
    return DiskLibrary().map("town")


@contextmanager
def alone_on(map_name: str, folder: Path, x: float, y: float, *flags: str) -> Iterator[ServerProcess]:
    """A server with a map on which nobody else drives; the ego stands at a place, and looks to the east."""
    sensors, scenario = folder / "sensors.toml", folder / "alone.json"
    sensors.write_text(SENSORS)
    ego = {"modelName": "2016_Hyundai_Ioniq", "initPosition": {"pos": {"x": x, "y": y, "z": 0}, "rot": {"yaw": 0}}}
    scenario.write_text(json.dumps({"mapInfo": {"mapName": map_name}, "egoVehicle": ego}))
    flags = ("--start", "sync", "--scenario", str(scenario), "--sensors", str(sensors), *flags)
    process = ServerProcess(folder / "log.txt", flags)
    yield process
    process.stop_cleanly()


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ServerProcess]:
    """A server with the town."""
    with alone_on("town", tmp_path_factory.mktemp("sensors"), 60.0, SOUTH) as process:
        yield process


@pytest.fixture
def client(server: ServerProcess) -> Iterator[Client]:
    """A client beside the program; the world is as at the start."""
    with Client(server.url, timeout=PATIENCE) as client:
        client.call("/sim/reset")
        yield client


def start(server: ServerProcess, name: str, *flags: str) -> ForkedProgram:
    return fork_server.popen([ROOT / "scripts" / "examples" / name, "--url", server.url, *flags])


def run(server: ServerProcess, name: str, *flags: str) -> str:
    """What a program prints; it ends well."""
    with start(server, name, *flags) as program:
        out, err = communicate(program)
    assert (program.returncode, err) == (0, "")
    return out


def figure_of(pattern: str, text: str) -> float:
    match = re.search(pattern, text)
    assert match is not None, text
    return float(match[1])


def follow_lane(
    server: ServerProcess, client: Client, metres: float, *flags: str, road_map: RoadMap | None = None
) -> float:
    """Drive by the camera; return the largest distance from the middle of a lane [m]."""
    status = client.subscribe("/Ego_topic", keep=100_000)
    out = run(server, "lane_camera.py", "--metres", str(metres), *flags)
    assert figure_of(r"drove (\d+) m", out) >= metres
    client.confirm()
    places = np.array([(one["position"]["x"], one["position"]["y"]) for one in status.take()])
    assert np.hypot(*np.diff(places, axis=0).T).sum() >= 0.98 * metres
    return float((road_map or town()).roads.nearest(places[:, 0], places[:, 1]).distance.max())


def test_camera_keeps_the_car_in_its_lane_around_a_corner(
    server: ServerProcess, client: Client, tmp_path: Path
) -> None:
    client.set_object(0, x=190.0, y=SOUTH, heading_deg=0.0)  # the corner begins at 206 m, its radius is 16 m
    picture = tmp_path / "seen.png"
    assert follow_lane(server, client, 45.0, "--save", str(picture)) < 0.6
    assert picture.stat().st_size > 10_000


@pytest.mark.long
def test_camera_keeps_the_car_in_its_lane_around_two_corners_of_the_town(server: ServerProcess, client: Client) -> None:
    assert follow_lane(server, client, 700.0) < 0.8  # 1,260 pictures, at 0.2 s of CPU time each


@pytest.mark.long
def test_camera_keeps_the_car_in_its_lane_on_the_loop_from_the_straight_through_a_bend(tmp_path: Path) -> None:
    road_map = DiskLibrary().map("loop")
    with (
        alone_on("loop", tmp_path, 970.0, -3.5) as server,  # the bend of 400 m begins at 1,000 m
        Client(server.url, timeout=PATIENCE) as client,
    ):
        assert follow_lane(server, client, 700.0, road_map=road_map) < 0.8


def test_each_car_at_10_20_and_40_m_is_a_cluster(server: ServerProcess, client: Client) -> None:
    """The lidar is 2 m ahead of the ego's reference point, the tail of a car 0.8 m behind its own."""
    cars = ((10.0, 3.5), (20.0, 0.0), (40.0, 3.5))
    for away, left in cars:
        client.spawn("2016_Hyundai_Ioniq", x=62.8 + away, y=SOUTH + left, heading_deg=0.0)
    program = start(server, "lidar_clusters.py")
    client.start_sync()
    while program.poll() is None:
        client.tick(5)
    client.stop_sync()
    with program:
        out, err = communicate(program)
    assert (program.returncode, err) == (0, "")
    rows = [[float(figure) for figure in re.findall(r"-?\d+\.\d", line)] for line in out.splitlines()]
    for away, left in cars:
        (box,) = [row[1:] for row in rows if abs(row[1] - row[3] / 2 - away) < 0.5 and abs(row[2] - left) < 0.6]
        assert 1.5 < box[3] < 2.3  # its width


def test_scan_stops_the_car_before_an_obstacle(tmp_path: Path) -> None:
    with (
        alone_on("track", tmp_path, 215.0, -1.75, "--no-dressing") as server,  # 85 m before a bend
        Client(server.url, timeout=PATIENCE) as client,
    ):
        client.spawn("Cargo_Box", x=245.0, y=-1.75, heading_deg=0.0)
        bumps = client.subscribe("/CollisionData", keep=100_000)
        out = run(server, "stop_by_scan.py")
        client.confirm()
        met = [message["collision_object"] for message in bumps.take()]
    assert 0.5 < figure_of(r"stopped (\d+\.\d) m before an obstacle", out) < 5.5
    assert met
    assert not any(met)


def test_camera_stops_the_car_at_red_and_lets_it_go_at_green(server: ServerProcess, client: Client) -> None:
    client.set_object(0, x=75.0, y=SOUTH, heading_deg=0.0)
    lights = [light.name for light in town().plan.lights if light.name.startswith("TL30W")]
    status = client.subscribe("/Ego_topic", keep=100_000)

    def show(state: int) -> None:
        for name in lights:
            client.publish("/SetTrafficLight", {"trafficLightIndex": name, "trafficLightStatus": state})
        client.confirm()

    show(1)
    with start(server, "stop_at_red.py") as program:
        assert program.stdout is not None
        stopped = program.stdout.readline()
        show(16)
        out, err = communicate(program)
    assert (program.returncode, err, out) == (0, "", "drove on at green\n")
    assert 0.3 < figure_of(r"stopped at red, (\d+\.\d) m before the line", stopped) < 1.5
    messages = status.take()
    stands = [
        one["position"]["x"] for one in messages if abs(one["velocity"]["x"]) < 0.05 and one["position"]["x"] > 80
    ]
    (stop_line,) = {float(border.line[0, 0]) for border in town().borders if border.name.startswith("S2030")}
    assert 0.2 < stop_line - 3.6 - stands[0] < 1.6  # the front of the car is 3.6 m ahead of its reference point
