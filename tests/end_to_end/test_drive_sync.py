"""`scripts/examples/drive_sync.py` as a user runs it: follows a path, and cleans up at any end."""

from __future__ import annotations

import math
import os
import re
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from tests import fork_server
from tests.conftest import Connect, Serve, Simulate
from tests.cpu_time import communicate
from tests.deployment import Place
from tests.fork_server import ForkedProgram
from tests.support import PATIENCE, ROOT, ServerProcess, read_line

pytestmark = [pytest.mark.client, pytest.mark.slow]

EXAMPLE = ROOT / "scripts" / "examples" / "drive_sync.py"

Figure = tuple[tuple[float, float], ...]
"""(length [m], radius [m]) one after another; a radius is positive to the left, and 0 is straight."""

QUARTER = math.pi / 2
COURSE: Figure = (
    (30.0, 0.0),
    (QUARTER * 20.0, 20.0),
    (20.0, 0.0),
    (QUARTER * 20.0, -20.0),
    (50.0, 0.0),
    (QUARTER * 30.0, -30.0),  # the S
    (QUARTER * 30.0, 30.0),
    (30.0, 0.0),
    (2 * QUARTER * 20.0, 20.0),  # a hairpin
    (50.0, 0.0),
    (QUARTER * 20.0, -20.0),
    (100.0, 0.0),
)


def draw(figure: Figure, x: float, y: float, yaw: float, spacing: float = 0.5) -> list[tuple[float, float]]:
    """Points along a figure that starts at a pose."""
    points = [(x, y)]
    for length, radius in figure:
        num_pieces = math.ceil(length / spacing)
        for _ in range(num_pieces):
            piece = length / num_pieces
            turn = piece / radius if radius else 0.0
            chord = 2.0 * radius * math.sin(turn / 2.0) if radius else piece
            x, y = x + chord * math.cos(yaw + turn / 2.0), y + chord * math.sin(yaw + turn / 2.0)
            yaw += turn
            points.append((x, y))
    return points


def write(points: list[tuple[float, float]], file: Path) -> Path:
    file.write_text("".join(f"{x:.4f}\t{y:.4f}\t0.0\n" for x, y in points))
    return file


def start(place: Place | ServerProcess, *flags: str) -> ForkedProgram:
    return fork_server.popen([EXAMPLE, "--port", place.port, *flags])


def run(place: Place | ServerProcess, *flags: str) -> tuple[int, str, str]:
    """Exit code, stdout and stderr."""
    with start(place, *flags) as example:
        out, err = communicate(example)
    return example.wait(), out, err


def figure_of(pattern: str, text: str) -> float:
    match = re.search(pattern, text)
    assert match is not None, text
    return float(match[1])


# A left and a right bend; a left one in the other place; and all of it in the long run.
@pytest.mark.parametrize(
    ("simulate", "num_pieces", "length"),
    [
        ("serve", 4, 110.0),
        ("attach", 2, 60.0),
        pytest.param("serve", len(COURSE), 530.0, marks=pytest.mark.long),
        pytest.param("attach", len(COURSE), 530.0, marks=pytest.mark.long),
    ],
    indirect=["simulate"],
)
async def test_script_follows_a_path_in_map_coordinates(
    simulate: Simulate, connect: Connect, tmp_path: Path, num_pieces: int, length: float
) -> None:
    place = simulate("--start", "sync")
    client = await connect(place.url)
    await client.ask("/SyncModeCmd", user_id="look", start_sync_mode=True, time_step=20)
    car = (await client.ask("/SyncModeWaitForTick", user_id="look", frame=1))["vehicle_status"]
    await client.ask("/SyncModeCmd", user_id="look", start_sync_mode=False, time_step=20)
    points = draw(COURSE[:num_pieces], car["position"]["x"], car["position"]["y"], math.radians(car["heading"]))
    step_ms = "20" if num_pieces == len(COURSE) else "40"
    code, out, err = run(place, "--path", str(write(points, tmp_path / "path.txt")), "--step-ms", step_ms)
    assert (code, err) == (0, "")
    assert figure_of(r"drove ([\d.]+) m", out) >= length
    assert figure_of(r"slowest after the run-up: ([\d.]+) km/h", out) >= 30.0
    assert figure_of(r"largest lateral error: ([\d.]+) m", out) < 0.3


async def test_interrupted_script_ends_synchronous_mode(simulator: Place, connect: Connect, tmp_path: Path) -> None:
    client = await connect(simulator.url)
    await client.subscribe("/SyncModeInfo", type="morai_msgs/SyncModeInfo")
    path = write([(0.0, 0.0), (10_000.0, 0.0)], tmp_path / "path.txt")
    with start(simulator, "--path", str(path), "--from-car") as example:
        assert read_line(example).startswith("path of 10000.0 m")
        await client.message_where("/SyncModeInfo", lambda info: info["master_id"] == "drive_sync")
        example.send_signal(signal.SIGINT)
        _, err = example.communicate(timeout=PATIENCE)
    assert (example.returncode, err) == (130, "drive_sync: interrupted; synchronous mode is off\n")
    info = await client.message_where("/SyncModeInfo", lambda info: not info["master_id"])
    assert info["status"] is False


async def test_script_names_the_present_master(simulator: Place, connect: Connect, tmp_path: Path) -> None:
    client = await connect(simulator.url)
    await client.ask("/SyncModeCmd", user_id="the_other", start_sync_mode=True, time_step=20)
    code, _, err = run(simulator, "--path", str(write([(0.0, 0.0), (9.0, 0.0)], tmp_path / "path.txt")))
    await client.ask("/SyncModeCmd", user_id="the_other", start_sync_mode=False, time_step=20)
    assert (code, err) == (1, "drive_sync: synchronous mode was refused: 'the_other' is its master\n")


def test_script_reports_a_refused_time_step(simulator: Place, tmp_path: Path) -> None:
    path = write([(0.0, 0.0), (9.0, 0.0)], tmp_path / "path.txt")
    code, _, err = run(simulator, "--path", str(path), "--step-ms", "30")
    assert (code, err) == (1, "drive_sync: synchronous mode was refused: a tick of 30 ms is not possible\n")


def test_script_reports_a_lost_server(serve: Serve, tmp_path: Path) -> None:
    process = serve()
    path = write([(0.0, 0.0), (10_000.0, 0.0)], tmp_path / "path.txt")
    with start(process, "--path", str(path), "--from-car") as example:
        read_line(example)
        assert process.stop() == 0
        _, err = communicate(example)
    assert example.returncode == 1
    last = err.splitlines()[-1]  # roslibpy may have a word of its own about the lost socket
    no_answer = r"no answer from 127.0.0.1:\d+; is the server running\?"
    assert re.fullmatch(rf"drive_sync: ({no_answer}|the connection to the server is lost)", last)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("1.0 2.0 0.0\n1.0 north 0.0\n", "path.txt:2: expected `x y z`, got '1.0 north 0.0'"),
        ("# nothing\n", "path.txt: expected a path of two points at least, got 0"),
    ],
)
def test_unreadable_path_file_gives_one_error_line(tmp_path: Path, text: str, told: str) -> None:
    path = tmp_path / "path.txt"
    path.write_text(text)
    done = fork_server.run([EXAMPLE, "--path", path])
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == f"drive_sync: {path.parent}/{told}\n"


def test_a_path_far_away_is_refused(simulator: Place, tmp_path: Path) -> None:
    code, _, err = run(simulator, "--path", str(write([(5e5, 5e5), (6e5, 6e5)], tmp_path / "path.txt")))
    assert code == 1
    assert re.fullmatch(r"drive_sync: the path starts \d+ m away from the car; --from-car starts it at the car\n", err)


def test_script_without_its_library_says_what_to_install(tmp_path: Path) -> None:
    (tmp_path / "roslibpy.py").write_text("raise ModuleNotFoundError\n")
    done = subprocess.run(
        [sys.executable, str(EXAMPLE), "--path", "none"],
        env={**os.environ, "PYTHONPATH": str(tmp_path)},
        capture_output=True,
        text=True,
        timeout=PATIENCE,
        check=False,
    )
    assert done.returncode == 1
    assert done.stderr == "drive_sync: needs roslibpy; install it: python -m pip install roslibpy\n"
