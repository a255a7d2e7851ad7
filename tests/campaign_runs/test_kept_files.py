"""Files that are kept of runs: by verdict, with or without a recording, up to the quota, and on a full disk."""

from __future__ import annotations

import json
import sys

import pytest

from rosbridge_sim.campaigns.run_results import Result
from rosbridge_sim.shell.bags.bag_reader import open_reader
from tests import fork_server
from tests.campaign_runs.conftest import CampaignFolder

PROGRAM = """
import sys
from rosbridge_sim.client import Client

with Client(sys.argv[1]) as client:
    client.start_sync(step_ms=20)
    client.step(20, commands={0: {"longlCmdType": 1, "accel": 1.0}})
"""
"""Goes on for ten frames after the end of the drive."""

RECORDED = """
scenario = "loop"
seconds = 0.2
seeds = 2
[drivers]
program = {{ command = ["{{python}}", "program.py", "{{url}}"] }}
[output]
record = true
keep = "{keep}"
[limits.own.first]
end = "seed == 1"
"""


SMALL_FILES = """
import resource, sys
from rosbridge_sim.__main__ import main
resource.setrlimit(resource.RLIMIT_FSIZE, (60_000, 60_000))
sys.exit(main())
"""


def names_of(folder: CampaignFolder, run: int) -> set[str]:
    place = folder.path / "out" / "runs" / f"{run:05d}"
    return {file.name for file in place.iterdir()} if place.is_dir() else set()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("keep", "kept"), [("failures", (True, False)), ("all", (True, True)), ("none", (False, False))]
)
def test_recordings_are_kept_as_the_campaign_says(folder: CampaignFolder, keep: str, kept: tuple[bool, bool]) -> None:
    """A recording has the ten frames of the drive, and none of those that the program asks for afterwards."""
    folder.write("program.py", PROGRAM)
    failed, passed = folder.drive(RECORDED.format(keep=keep))
    assert (failed.verdict, passed.verdict) == ("fail", "pass")
    whole = {"trace.csv", "scene.json", "log.txt", "drive.mcap"}
    assert [names_of(folder, 1), names_of(folder, 2)] == [whole if each else set() for each in kept]
    assert [{*result.files} for result in (failed, passed)] == [whole if each else set() for each in kept]
    if kept[0]:
        with open_reader(folder.path / "out" / "runs" / "00001" / "drive.mcap") as reader:
            frames = sum(c.msgcount for c in reader.connections if c.topic == "/Ego_topic")
            commands = sum(c.msgcount for c in reader.connections if c.topic == "/ctrl_cmd")
        assert (frames, commands) == (10, 0)  # commands came with the steps
    assert list((folder.path / "out" / ".work").iterdir()) == []


LOUD = """
def drive(seen):
    if seen.time == 0.0:
        print("x" * 300_000)
    return {"steering": 0.0, "accel": 1.0}
"""


@pytest.mark.slow
def test_files_beyond_the_quota_are_not_kept_and_the_campaign_goes_on(folder: CampaignFolder) -> None:
    """Each run would keep 131 kB of output; the quota is 1 MB."""
    folder.write("loud.py", LOUD)
    folder.write(
        "c.toml",
        'scenario = "loop"\nseconds = 0.1\nseeds = 12\n[drivers]\nf = "loud.py:drive"\n'
        '[output]\nkeep = "all"\nquota_mb = 1\n',
    )
    done = folder.command("run", "c.toml", "-o", "out", "--jobs", "2", "--json")
    assert json.loads(done.stdout)["pass"] == 12, done.stderr
    runs = folder.path / "out" / "runs"
    size = sum(file.stat().st_size for file in runs.rglob("*") if file.is_file())
    lines = (folder.path / "out" / "results.jsonl").read_text().splitlines()
    results = [Result.from_json(json.loads(line)) for line in lines]
    with_files = sorted(result.run.number for result in results if result.files)
    assert 5 <= len(with_files) < 12
    assert size <= 2**20
    assert sorted(int(place.name) for place in runs.iterdir()) == with_files
    assert all("quota of 1 MB" in result.trouble for result in results if not result.files)


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no such limit")
def test_disk_that_takes_no_more_is_told_in_the_row_and_the_campaign_goes_on(folder: CampaignFolder) -> None:
    """Each file ends at 60 kB, as on a disk that is full then; the output of a run has 131 kB."""
    folder.write("loud.py", LOUD)
    folder.write(
        "c.toml",
        'scenario = "loop"\nseconds = 0.1\nseeds = 3\n[drivers]\nf = "loud.py:drive"\n[output]\nkeep = "all"\n',
    )
    words = ["campaign", "run", "c.toml", "-o", "out", "--jobs", "1", "--json"]
    done = fork_server.run(["-c", SMALL_FILES, *words], cwd=folder.path)
    assert json.loads(done.stdout)["pass"] == 3, done.stderr
    lines = (folder.path / "out" / "results.jsonl").read_text().splitlines()
    results = [Result.from_json(json.loads(line)) for line in lines]
    told = "log.txt of the run, and what comes behind it, is not kept: File too large"
    assert {result.trouble for result in results} == {told}
    assert all("log.txt" not in result.files and "trace.csv" in result.files for result in results)
    assert not list((folder.path / "out" / "runs").rglob("log.txt"))
    assert told in folder.command("show", "out", "1").stdout
