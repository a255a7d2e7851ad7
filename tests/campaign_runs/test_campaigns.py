"""Campaigns with real workers and programs: each kind of driver, each way to fail, resuming, the same table."""

from __future__ import annotations

import csv
import json
import os
import re
import sys
from pathlib import Path

import pytest

from rosbridge_sim.campaign_runs.checking import check_job, find_scenario_mistakes
from rosbridge_sim.campaign_runs.job import Job, read_job
from rosbridge_sim.campaign_runs.outcome import HEAD, TAIL, KeptOutput
from rosbridge_sim.campaign_runs.results_folder import ResultsFolder
from rosbridge_sim.campaigns.run_results import Result
from rosbridge_sim.campaigns.tables import write_table
from rosbridge_sim.errors import DocumentError
from tests.campaign_runs.conftest import CampaignFolder

DRIVERS = """
import os, time

def keep_lane(seen):
    lane = seen.lane()
    return {"steering": -0.05 * lane["offset"] - 0.5 * lane["heading"], "accel": 1.0}

class Counting:
    def __init__(self):
        self.calls = 0

    def __call__(self, seen):
        self.calls += 1
        print("call", self.calls)
        return {"steering": 0.0, "throttle": 0.2, "brake": 0.0}

def policy(observation):
    assert observation.shape == (15,) and abs(observation).max() <= 1.0
    return [0.0, 0.5]

def raises_late(seen):
    if seen.seed == 1 and seen.time > 0.15:
        raise ValueError("no more")
    return keep_lane(seen)

def raises_together(seen):
    if 1 in seen.seed and seen.time > 0.15:
        raise ValueError("no more")
    return keep_lane(seen)

def hangs(seen):
    while True:
        time.sleep(0.01)

def dies(seen):
    os._exit(7)

def wrong(seen):
    return {"steering": float("nan"), "accel": 0.0}

def flips(seen):
    path = os.path.join(os.path.dirname(__file__), "flip")
    if seen.time == 0.0:
        if os.path.exists(path):
            os.remove(path)
            raise ValueError("second drive")
        open(path, "w").close()
    return keep_lane(seen)

def too_slow(trace):
    return None if trace.column("speed")[-1] > 100.0 else "too slow"
"""

PROGRAM = """
import sys
from rosbridge_sim.client import Client

with Client(sys.argv[1]) as client:
    client.start_sync(step_ms=100)
    print("driving", flush=True)
    while True:
        client.step(1, commands={0: {"longlCmdType": 3, "acceleration": 1.0}})
"""


@pytest.fixture
def base(tmp_path: Path) -> Path:
    (tmp_path / "drivers.py").write_text(DRIVERS)
    (tmp_path / "program.py").write_text(PROGRAM)
    return tmp_path


def job_of(base: Path, text: str) -> Job:
    return CampaignFolder(base).job(text)


def drive(base: Path, text: str) -> list[Result]:
    return CampaignFolder(base).drive(text)


SHORT = 'scenario = "loop"\nseconds = 0.4\nseeds = 2\n'


def test_each_kind_of_driver_in_python_drives(base: Path) -> None:
    results = drive(
        base,
        SHORT
        + """
        [drivers]
        ours = "lanes"
        function = "drivers.py:keep_lane"
        class = "drivers.py:Counting"
        policy = { policy = "drivers.py:policy" }
        batch = { python = "drivers.py:keep_lane", batch = 8 }
        """,
    )
    assert [result.verdict for result in results] == ["pass"] * 10, [result.reason for result in results]
    assert all(result.frames == 20 and result.scores["distance"] > 0.0 for result in results)
    by_driver = {(result.run.driver, result.run.seed): result for result in results}
    assert len({result.state_hash for result in results}) == 8
    for seed in (0, 1):
        alone, together = by_driver["function", seed], by_driver["batch", seed]
        assert (alone.state_hash, alone.scores) == (together.state_hash, together.scores)


def test_policy_without_gymnasium_is_refused_before_anything_runs(base: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "gymnasium", None)
    text = SHORT + '[drivers]\nlearned = { policy = "drivers.py:policy" }\n'
    with pytest.raises(DocumentError, match=re.escape("pip install 'rosbridge-sim[campaign,gym]'")):
        check_job(job_of(base, text))
    (result, _) = drive(base, SHORT + '[drivers]\nfunction = "drivers.py:keep_lane"\n')
    assert result.verdict == "pass"


def test_state_of_our_own_driver_is_that_of_a_server(base: Path) -> None:
    """The world at the end is the one that `rosbridge-sim` has with the same scenario and seed."""
    from rosbridge_sim import Simulator  # noqa: PLC0415
    from rosbridge_sim.client import Client  # noqa: PLC0415

    text = 'scenario = "loop"\nseconds = 0.4\nseeds = [3]\n[drivers]\nstraight = "drivers.py:Counting"\n'
    (result,) = drive(base, text)
    simulator = Simulator(port=0, scenario="loop", seed=3, start="sync", score=True, page=False)
    with simulator, Client(simulator.url) as client:
        client.start_sync(step_ms=20)
        client.step(20, commands={0: {"longlCmdType": 1, "accel": 0.2}})
        assert simulator.node is not None
        node = simulator.node
        speed = simulator.run_inside(lambda: node.world.speed.item(0))  # before the world runs without its master
    assert result.scores["max_speed"] == pytest.approx(speed, abs=1e-6)


def test_parameters_reach_scenario_settings_and_vehicle(base: Path) -> None:
    slow, fast = drive(
        base,
        """
        scenario = "loop"
        seconds = 0.1
        [parameters]
        kmh = [18, 36]
        [set]
        "scenario.egoVehicle.currentVelocity" = "kmh"
        "setting.traffic" = "kmh // 18"
        vehicle = "'Van'"
        """,
    )
    assert slow.scores["max_speed"] == pytest.approx(5.0, abs=0.3)
    assert fast.scores["max_speed"] == pytest.approx(10.0, abs=0.3)
    (shifted,) = drive(
        base, 'scenario = "loop"\nseconds = 0.1\n[set]\n"scenario.vehicleList[99].initPosition.pos.x" = 1\n'
    )
    assert shifted.verdict == "error"
    assert "expected an entry of a list" in shifted.reason


def test_drivers_that_fail_are_rows_with_their_reason(base: Path) -> None:
    results = drive(
        base,
        SHORT
        + """
        [drivers]
        alone = "drivers.py:raises_late"
        together = { python = "drivers.py:raises_together", batch = 2 }
        wrong = "drivers.py:wrong"
        """,
    )
    assert [result.verdict for result in results] == ["pass", "error", "pass", "error", "error", "error"]
    assert results[1].reason == results[3].reason == "the driver failed: ValueError: no more"
    assert results[1].frames == 10
    assert (results[1].state_hash, results[1].frames) == (results[3].state_hash, results[3].frames)
    assert results[4].reason == "the driver failed: ValueError: steering: expected finite numbers"
    log = (base / "out" / "runs" / "00002" / "log.txt").read_text()
    assert 'raise ValueError("no more")' in log


def test_scenario_that_cannot_be_read_is_a_row(base: Path) -> None:
    (base / "broken.json").write_text('{"egoVehicle": 3}')
    results = drive(base, 'scenario = ["broken.json", "nowhere", "loop"]\nseconds = 0.1\n')
    assert [result.verdict for result in results] == ["error", "error", "pass"]
    assert "egoVehicle: expected an object" in results[0].reason
    assert "no scenario 'nowhere'" in results[1].reason


def test_check_names_each_scenario_that_cannot_be_driven(base: Path) -> None:
    job = job_of(base, 'scenario = ["loop", "/dev/zero", "nosuch"]\n[set]\n"scenario.objectList[9].pos.x" = 1\n')
    check_job(job)
    loop, device, unknown = find_scenario_mistakes(job)
    assert loop.startswith("loop.json: objectList[9]")
    assert device.startswith("/dev/zero: expected a file")
    assert unknown.startswith("no scenario 'nosuch'")


def test_file_of_a_campaign_that_is_a_pipe_is_not_waited_for(base: Path) -> None:
    os.mkfifo(base / "pipe.toml")
    with pytest.raises(DocumentError, match=r"expected a TOML file; it is a folder, a pipe or a device"):
        read_job(base / "pipe.toml", base)


@pytest.mark.slow
def test_limits_judge_and_skipping_skips(base: Path) -> None:
    results = drive(
        base,
        SHORT
        + """
        skip_when = "seed == 1"
        [limits]
        distance = 1000.0
        [limits.own.mine]
        python = "drivers.py:too_slow"
        """,
    )
    assert [result.verdict for result in results] == ["fail", "skipped"]
    assert [breach.limit for breach in results[0].breaches] == ["distance", "mine"]
    assert results[0].breaches[1].text == "too slow"
    assert results[0].files == ("trace.csv", "scene.json")
    trace = rows_of(base / "out" / "runs" / "00001" / "trace.csv")
    assert len(trace) == 20
    assert float(trace[-1]["time"]) == pytest.approx(0.4)


def test_run_whose_drives_differ_is_flaky(base: Path) -> None:
    results = drive(base, 'scenario = "loop"\nseconds = 0.1\nrepeat = 3\n[drivers]\nflips = "drivers.py:flips"\n')
    assert results[0].verdict == "flaky"
    assert results[0].verdicts == ("pass", "error", "pass")
    assert results[0].reason == "2 of 3 drives passed; the driver failed: ValueError: second drive"


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ('[drivers]\na = "nowhere.py:f"', "there is no file"),
        ('[drivers]\na = "drivers.py:nobody"', "has no function or class 'nobody'"),
        ('[drivers]\na = "no_such_package.x:f"', "the import failed"),
        ('[drivers.a]\ncommand = ["no-such-program"]', "there is no program 'no-such-program'"),
        ('[set]\n"setting.max-clients" = 3', "drivers.ours: setting.max_clients: a driver in Python does not take it"),
        ('[set]\n"setting.sensors" = "\'camera\'"', "it sees numbers, no pictures. A driver with a command does"),
        ('[set]\n"setting.trafic" = 3', "there is no such setting (did you mean traffic?)"),
        ('[set]\n"setting.port" = 3', "this one belongs to the campaign"),
        ('[limits.own.a]\npython = "drivers.py:nobody"', "has no function"),
        ('[set]\n"scenario.egoVehicle.initPosition.pos.xx" = 3', "initPosition.pos.xx': expected one of x, y, z"),
        ('[set]\n"scenario.vehicleList[0].constantVelocty" = 3', "(did you mean constantVelocity?)"),
        ('[set]\n"scenario.egoVehicel.initPosition.pos.x" = 3', "(did you mean egoVehicle?)"),
        ('[set]\n"scenario.shadedAreaList" = 3', "set.'scenario.shadedAreaList': this key has no effect yet"),
        ('[set]\n"setting.traffic" = -1', "c.toml: run 1: setting.traffic: expected a whole number from 0 to 10,000"),
        (
            '[parameters]\nn = [0, 2, 3]\n[set]\n"setting.traffic" = "n / 2"',
            "c.toml: run 5: setting.traffic: expected a whole number from 0 to 10,000; got 1.5",
        ),
        ('[set]\n"setting.weather" = "\'hail\'"', "setting.weather: expected noon or dusk or night or rain or fog"),
        ("[set]\nvehicle = \"'Vann'\"", "run 1: vehicle: the catalogue has no 'Vann' (did you mean Van?)"),
        ("[set]\nvehicle = 3", "set.'vehicle': expected the name of a model"),
        (
            '[search]\n[parameters]\nn = { low = 2, high = 4 }\n[set]\n"setting.traffic" = "-n"',
            "setting.traffic: expected a whole number from 0 to 10,000; got -3",
        ),
    ],
)
def test_what_is_missing_is_told_before_anything_is_driven(base: Path, text: str, what: str) -> None:
    with pytest.raises(DocumentError) as caught:
        check_job(job_of(base, SHORT + text))
    assert what in str(caught.value)


def test_value_that_only_skipped_runs_have_is_no_mistake(base: Path) -> None:
    text = '[parameters]\nn = [-1, 2]\n[set]\n"setting.traffic" = "n"\n'
    check_job(job_of(base, f'skip_when = "n < 0"\n{SHORT}{text}'))


@pytest.mark.slow
def test_program_drives_and_ends_with_the_run(base: Path) -> None:
    (base / "leaves.py").write_text("import sys\nprint('bye')\nsys.exit(int(sys.argv[1]))\n")
    (base / "waits.py").write_text("import time\ntime.sleep(60)\n")
    (base / "forks.py").write_text(
        "import os, signal, time\nsignal.signal(signal.SIGTERM, signal.SIG_IGN)\nchild = os.fork()\n"
        "if not child:\n    time.sleep(60)\nopen('child', 'w').write(str(child))\nprint('x' * 3_000_000, flush=True)\n"
        f"{PROGRAM.replace('while True', 'for _ in range(4)')}    time.sleep(60)\n"
    )
    drivers = {
        "ticks": '{ command = ["{python}", "program.py", "{url}"] }',
        "leaves": '{ command = ["{python}", "leaves.py", "0"] }',
        "fails": '{ command = ["{python}", "leaves.py", "3"] }',
        "waits": '{ command = ["{python}", "waits.py"], timeout = 0.2 }',
        "forks": '{ command = ["{python}", "forks.py", "{url}"] }',
    }
    text = "".join(f"{name} = {value}\n" for name, value in drivers.items())
    results = drive(base, f'scenario = "loop"\nseconds = 0.4\n[output]\nkeep = "all"\n[drivers]\n{text}')
    assert [result.verdict for result in results] == ["pass", "error", "error", "error", "pass"]
    assert (results[0].frames, results[0].files) == (20, ("trace.csv", "scene.json", "log.txt"))
    assert "before the world has moved" in results[1].reason
    assert results[2].reason == "the program ended with code 3 after 0 frames"
    assert results[3].reason == "time-out: 0.2 s on the wall clock have passed after 0 frames"
    logs = [(base / "out" / "runs" / f"{number:05d}" / "log.txt").read_text() for number in (1, 2, 3, 4, 5)]
    assert logs[0].startswith("driving\n")
    assert logs[1].startswith("bye\n")
    assert "bytes are left out" in logs[4]
    assert len(logs[4]) < 2 * (HEAD + TAIL)
    assert not is_running(int((base / "child").read_text()))


def rows_of(path: Path) -> list[dict[str, str]]:
    return list(csv.DictReader(path.read_text().splitlines()))


def is_running(pid: int) -> bool:
    """Whether a process is there that was not killed; nobody may have read the end of a child's child."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False


END_TO_END = """
scenario = "loop"
seconds = 0.4
[parameters]
kmh = [18, 36]
[set]
"scenario.egoVehicle.currentVelocity" = "kmh"
[limits.own.slow]
always = "speed < 8"
[drivers]
ours = "lanes"
batch = { python = "drivers.py:keep_lane", batch = 3 }
hangs = { python = "drivers.py:hangs", timeout = 0.3 }
dies = "drivers.py:dies"
"""


@pytest.mark.slow
def test_campaign_goes_on_over_workers_that_hang_and_die_and_resumes_to_the_same_table(base: Path) -> None:
    (base / "night.toml").write_text(END_TO_END)
    campaign = CampaignFolder(base).command
    done = campaign("run", "night.toml", "--jobs", "2", "--json")
    assert done.returncode == 1, done.stderr
    counts = json.loads(done.stdout)
    assert [counts[name] for name in ("runs", "pass", "fail", "error")] == [8, 2, 2, 4]
    folder = base / "night_runs"
    rows = rows_of(folder / "runs.csv")
    assert {row["reason"] for row in rows if row["driver"] == "hangs"} == {"time-out: the worker hung, and was killed"}
    assert all("died with code 7" in row["reason"] for row in rows if row["driver"] == "dies")
    table = (folder / "runs.csv").read_bytes()
    page = (folder / "report.html").read_text()
    assert not re.search(r"(src|href)=\"(https?:)?//", page)

    again = campaign("run", "night.toml", "--jobs", "2")
    assert again.returncode == 2
    assert "--resume goes on" in again.stderr

    lines = (folder / "results.jsonl").read_bytes().splitlines(keepends=True)
    (folder / "results.jsonl").write_bytes(b"".join(lines[:3]) + lines[3][:40])
    assert campaign("run", "night.toml", "--jobs", "1", "--resume").returncode == 1
    assert (folder / "runs.csv").read_bytes() == table
    numbers = [json.loads(line)["run"] for line in (folder / "results.jsonl").read_bytes().splitlines()]
    assert sorted(numbers) == list(range(1, 9))

    listed = campaign("list", "night_runs", "--verdict", "fail", "--json").stdout.splitlines()
    failed = json.loads(listed[0])["run"]
    repeated = campaign("repeat", "night_runs", str(failed))
    assert repeated.returncode == 0, repeated.stdout
    assert repeated.stdout.rstrip().endswith("the same")
    assert "slow at" in campaign("show", "night_runs", str(failed)).stdout
    assert campaign("compare", "night_runs", "night_runs").returncode == 0


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
def test_full_disk_is_told_and_the_results_wait_for_room(base: Path) -> None:
    job = job_of(base, SHORT)
    results = drive(base, SHORT)
    folder = ResultsFolder(base / "out")
    folder.begin(job, is_resumed=False)
    assert folder.append(results[0]) == ""
    kept = folder._file
    with Path("/dev/full").open("ab", buffering=0) as full:
        folder._file = full
        assert folder.append(results[1]) == "No space left on device"
    folder._file = kept
    assert folder.append(results[1]) == ""
    folder.close()
    numbers = [result.run.number for result in ResultsFolder(base / "out").results()]
    assert numbers == [1, 2]


def test_output_keeps_its_beginning_and_its_end() -> None:
    output = KeptOutput()
    output.write("begin")
    for _ in range(100):
        output.take(b"x" * 65_536)
    output.write("end")
    assert output.text.startswith("beginx")
    assert output.text.endswith("xend")
    assert f"{100 * 65_536 + 8 - HEAD - TAIL:,} bytes are left out" in output.text


def test_table_is_the_same_for_one_world_and_many(base: Path) -> None:
    text = f'{SHORT}[parameters]\nkmh = [10, 20, 30]\n[set]\n"scenario.egoVehicle.currentVelocity" = "kmh"\n[drivers]\n'
    tables = []
    for num in (1, 4):
        results = drive(base, f'{text}d = {{ python = "drivers.py:keep_lane", batch = {num} }}\n')
        tables.append(write_table(results, ["kmh"]))
    assert tables[0] == tables[1]
