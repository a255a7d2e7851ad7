"""A driving stack for MORAI works with either release: one server flag and one name differ."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rosbridge_sim.world.geometry.planar import nearest_on_polyline
from tests import fork_server
from tests.conftest import Connect, Simulate
from tests.fork_server import ForkedProgram
from tests.support import PATIENCE, ROOT, Client
from tests.world.road_factory import built_in

pytestmark = [pytest.mark.client, pytest.mark.slow]

PLANNER = ROOT / "tests" / "end_to_end" / "clients" / "planner.py"
NAME_OF = {"22.R2": 'STEERING = "steering"', "26.R1": 'STEERING = "front_steer"'}

NOSE = 3.58  # from the rear axle to the bumper of the Ioniq [m]

BEGIN = 215.0  # where the ego stands [m]

Plan = Callable[..., ForkedProgram]
"""`planner("22.R2", port, path, 40)`: the planner for that release, running."""

LANES = ("L2_00", "L2_01", "L2_02")
"""The outer lane of the track: 85 m straight on from the ego, a bend to the left of 97 m, and a straight."""


def scene(folder: Path) -> Path:
    """The ego at the beginning of the outer lane; a car goes ahead of it at 9 km/h on the inner one."""
    ego = {"initPosition": {"pos": {"x": BEGIN, "y": -1.75}}, "gear": 4}
    beside = {"initPosition": {"pos": {"x": BEGIN + 20.0, "y": 1.75}}, "constantVelocity": 9}
    file = folder / "scene.json"
    file.write_text(json.dumps({"mapInfo": {"mapName": "track"}, "egoVehicle": ego, "vehicleList": [beside]}))
    return file


def course(folder: Path, length: float) -> tuple[Path, np.ndarray[Any, np.dtype[np.float64]]]:
    """The middle of the lane from the ego on, so long [m], as a file for the planner and as points."""
    roads = built_in("track").roads
    points = []
    for name in LANES:
        s = np.arange(0.0, roads.length[roads.row(name)], 0.5)
        points += roads.at(np.full(len(s), roads.row(name)), s)[0][:, :2].tolist()
    line = np.array([point for point in points if point[0] >= BEGIN])[: int(length / 0.5) + 1]
    file = folder / "path.txt"
    file.write_text("".join(f"{x:.3f} {y:.3f} 0.0\n" for x, y in line))
    return file, line


@pytest.fixture
def planner(tmp_path: Path) -> Iterator[Plan]:
    """Starts the planner for a release; it is gone when the test is over."""
    started: list[ForkedProgram] = []

    def start(release: str, *words: object) -> ForkedProgram:
        text = PLANNER.read_text()
        assert text.count(NAME_OF["22.R2"]) == 1
        script = tmp_path / "planner.py"
        script.write_text(text.replace(NAME_OF["22.R2"], NAME_OF[release]))
        started.append(fork_server.popen([script, *words]))
        return started[-1]

    yield start
    for process in started:
        if process.poll() is None:
            process.kill()
        process.communicate()


def place(status: dict[str, Any]) -> tuple[float, float]:
    return status["position"]["x"], status["position"]["y"]


class EgoObserver:
    """Watches the ego on a client of its own."""

    def __init__(self, client: Client) -> None:
        self.client = client
        self.places: list[tuple[float, float]] = []
        self.top = 0.0

    async def listen(self) -> None:
        await self.client.subscribe("/Ego_topic", queue_length=0)
        await self.client.subscribe("/CollisionData")

    async def watch_until(self, what: Callable[[dict[str, Any]], bool]) -> dict[str, Any]:
        """The first status of the ego of which `what` is true; nobody is touched meanwhile."""
        while True:
            frame = await self.client.read()
            if frame["op"] != "publish":
                self.client.inbox.append(frame)
                continue
            message: dict[str, Any] = frame["msg"]
            if frame["topic"] == "/CollisionData":
                assert message["collision_object"] == [], "nobody is touched"
            elif frame["topic"] == "/Ego_topic":
                self.places.append(place(message))
                self.top = max(self.top, message["velocity"]["x"])
                if what(message):
                    return message


def lateral_error(line: np.ndarray[Any, np.dtype[np.float64]], places: list[tuple[float, float]]) -> float:
    """How far from the line somebody was at most [m]."""
    xs, ys = (np.array(column) for column in zip(*places, strict=True))
    return float(np.abs(nearest_on_polyline(line, xs, ys).lateral).max())


# What lies between knows nothing of the release: each place and each release once, and all four in the long run.
@pytest.mark.parametrize(
    ("simulate", "release"),
    [
        ("serve", "22.R2"),
        ("attach", "26.R1"),
        pytest.param("serve", "26.R1", marks=pytest.mark.long),
        pytest.param("attach", "22.R2", marks=pytest.mark.long),
    ],
    indirect=["simulate"],
)
async def test_driving_stack_drives_brakes_and_resumes_in_synchronous_mode(
    simulate: Simulate, connect: Connect, tmp_path: Path, planner: Plan, release: str
) -> None:
    harness = simulate("--release", release, "--start", "sync", "--scenario", str(scene(tmp_path)))
    path, line = course(tmp_path, 165.0)
    referee = EgoObserver(await connect(harness.url))
    client = referee.client
    at = BEGIN + 70.0
    box = {"name": "Cargo_Box", "position": {"x": at, "y": -1.75, "z": 0.0}, "heading": 0.0, "frame": 0}
    await change(client, release, "Add", box)
    await referee.listen()
    process = planner(release, harness.port, path, 40, "--sync")

    await referee.watch_until(lambda status: status["velocity"]["x"] > 10.0)
    status = await referee.watch_until(lambda status: status["velocity"]["x"] == 0.0)
    gap = at - 0.6 - NOSE - status["position"]["x"]
    assert 1.0 < gap < 5.0, "it has stopped before the box"
    seq = status["header"]["seq"]
    still = await referee.watch_until(lambda status: status["header"]["seq"] >= seq + 50)
    assert place(still) == place(status)

    objects = (await objects_of(client))["obstacle_list"]
    await change(client, release, "Remove", {"unique_id": objects[0]["unique_id"], "frame": 0})
    await referee.watch_until(
        lambda status: math.dist(place(status), line[-1]) < 2.0 and status["velocity"]["x"] < 0.05
    )
    assert process.wait(PATIENCE) == 0, process.communicate()
    assert referee.top == pytest.approx(40.0 / 3.6, rel=0.03)
    assert lateral_error(line, referee.places) < 0.3


async def change(client: Client, release: str, what: str, request: dict[str, Any]) -> None:
    """Bring or take an object away, by the release's own way."""
    if release == "22.R2":
        await client.send("publish", topic=f"/SyncMode{what}Obj", msg=request)
        return
    client.inbox.clear()
    assert (await client.ask(f"/SyncMode{what}Object", **request))["result"] is True


async def objects_of(client: Client) -> dict[str, Any]:
    """Who is there."""
    await client.send("subscribe", topic="/Object_topic")
    objects = await client.message("/Object_topic")
    await client.send("unsubscribe", topic="/Object_topic")
    return objects


@pytest.mark.parametrize("release", ["22.R2", pytest.param("26.R1", marks=pytest.mark.long)])
async def test_driving_stack_drives_brakes_and_resumes_in_real_time(
    simulate: Simulate, connect: Connect, tmp_path: Path, planner: Plan, release: str
) -> None:
    harness = simulate("--release", release, "--scenario", str(scene(tmp_path)))
    path, line = course(tmp_path, 32.0)
    referee = EgoObserver(await connect(harness.url))
    client = referee.client
    at = BEGIN + 22.0
    await put_van(client, x=at)
    await referee.listen()
    process = planner(release, harness.port, path, 25)
    await referee.watch_until(lambda status: status["velocity"]["x"] > 3.0)
    status = await referee.watch_until(lambda status: status["velocity"]["x"] == 0.0)
    rear = at - 1.07  # of the van, whose place is that of its rear axle
    assert 0.5 < rear - NOSE - status["position"]["x"] < 8.0
    await put_van(client, x=at, y=30.0)
    await referee.watch_until(
        lambda status: math.dist(place(status), line[-1]) < 2.0 and status["velocity"]["x"] < 0.05
    )
    assert process.wait(PATIENCE) == 0, process.communicate()
    assert lateral_error(line, referee.places) < 0.5


async def put_van(client: Client, x: float, y: float = -1.75) -> None:
    """Have a van stand there, as a ghost: a client may do that in real time."""
    van = {"unique_id": 77, "name": "Van", "position": {"x": x, "y": y, "z": 0.0}, "rpy": {"x": 0, "y": 0, "z": 0}}
    await client.send("publish", topic="/NpcGhost_Topic", msg={"npc_list": [van]})
