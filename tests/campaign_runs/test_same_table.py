"""The table of a campaign is the same, byte for byte, whoever drives its runs, and with how many processes."""

from __future__ import annotations

import shutil
import sys

import pytest

from rosbridge_sim.cli.command_table import TOOLS
from tests.campaign_runs.conftest import CampaignFolder
from tests.cpu_time import run

NUMBERS = """
def drive(seen):
    lane = seen.lane()
    return {"steering": -0.05 * lane["offset"] - 0.5 * lane["heading"], "accel": 1.0 + 0.1 * seen.seed}

def fails(seen):
    if seen.seed == 1 and seen.time > 0.05:
        raise ValueError("no more")
    return drive(seen)
"""

ARRAYS = NUMBERS.replace("0.1 * seen.seed", "0.1 * np.array(seen.seed)").replace("seen.seed == 1", "1 in seen.seed")
ARRAYS = f"import numpy as np\n{ARRAYS}"
"""The same for many worlds at once."""

PROGRAM = """
import sys
from rosbridge_sim.client import Client

with Client(sys.argv[1]) as client:
    client.start_sync(step_ms=20)
    for _ in range(10):
        client.step(1, commands={0: {"longlCmdType": 3, "acceleration": 1.0}})
"""

CAMPAIGN = """
scenario = SCENARIO
seconds = 0.2
seeds = 2
skip_when = "kmh > 30 and seed == 1"
[parameters]
kmh = [18, 36]
[set]
"scenario.egoVehicle.currentVelocity" = "kmh"
"setting.traffic" = 3
[limits]
jerk = 30.0
[limits.own.slow]
always = "max(speed) < 8"
[drivers]
ours = "lanes"
function = { python = "function.py:drive", batch = BATCH }
fails = { python = "function.py:fails", batch = BATCH }
"""

LARGE = '["motorway", "loop"]'
PROGRAM_DRIVES = 'program = { command = ["{python}", "program.py", "{url}"] }\n'


def table(
    folder: CampaignFolder, batch: int, *words: str, is_large: bool = False, before: tuple[str, ...] = ()
) -> bytes:
    """Drive the campaign, and return its table; a large one has a second scenario and a program."""
    folder.write("function.py", ARRAYS if batch else NUMBERS)
    folder.write("program.py", PROGRAM)
    text = CAMPAIGN.replace("BATCH", str(batch)).replace("SCENARIO", LARGE if is_large else '"loop"')
    folder.write("c.toml", text + PROGRAM_DRIVES * is_large)
    shutil.rmtree(folder.path / "out", ignore_errors=True)
    words = ("run", "c.toml", "-o", "out", *words)
    if before:
        command = [*before, sys.executable, "-m", "rosbridge_sim", "campaign", *words]
        done = run(command, cwd=folder.path)
    else:
        done = folder.command(*words)
    assert done.returncode == 1, done.stderr
    return (folder.path / "out" / "runs.csv").read_bytes()


@pytest.mark.slow
def test_table_is_the_same_with_processes_and_with_batches(folder: CampaignFolder) -> None:
    one = table(folder, 0, "--jobs", "1")
    assert len(one.splitlines()) == 1 + 3 * 2 * 2
    assert {line.split(b",")[5] for line in one.splitlines()[1:]} == {b"pass", b"fail", b"error", b"skipped"}
    assert table(folder, 3, "--jobs", "3") == one


@pytest.mark.slow
def test_table_of_merged_shards_is_that_of_all_runs(folder: CampaignFolder, capsys: pytest.CaptureFixture[str]) -> None:
    whole = table(folder, 0, "--jobs", "2")
    shards = [str(folder.path / f"s{i}") for i in (1, 2, 3)]
    for i, shard in enumerate(shards, 1):
        assert folder.command("run", "c.toml", "-o", shard, "--shard", f"{i}/3", "--jobs", "1").returncode in {0, 1}
    assert [len((folder.path / f"s{i}" / "runs.csv").read_bytes().splitlines()) for i in (1, 2, 3)] == [5, 5, 5]
    merged = folder.path / "merged"
    assert TOOLS["campaign"](("merge", *shards, shards[0], "--output", str(merged))) == 1  # a shard may come twice
    assert (merged / "runs.csv").read_bytes() == whole
    assert "no result" not in capsys.readouterr().err
    out = folder.path / "out"
    kept = {path.relative_to(out): path.read_bytes() for path in out.glob("runs/*/trace.csv")}
    assert kept
    assert {path: (merged / path).read_bytes() for path in kept} == kept
    assert TOOLS["campaign"](("merge", *shards[:2], "--output", str(folder.path / "two"))) == 1
    assert "4 runs have no result, the first is run 3" in capsys.readouterr().err
    assert TOOLS["campaign"](("merge", *shards, "--output", str(merged))) == 2
    assert "there are results already" in capsys.readouterr().err
    results = folder.path / "s2" / "results.jsonl"
    results.write_text(results.read_text().replace('"verdict":"pass"', '"verdict":"fail"'))
    assert TOOLS["campaign"](("merge", *shards, str(folder.path / "out"), "--output", str(folder.path / "x"))) == 2
    assert "ended in another way than in" in capsys.readouterr().err
    (folder.path / "s3" / "campaign.toml").write_text('scenario = "loop"')
    assert TOOLS["campaign"](("merge", *shards, "--output", str(folder.path / "x"))) == 2
    assert "expected results of the same campaign as" in capsys.readouterr().err


@pytest.mark.parametrize("shard", ["0/3", "4/3", "3", "1/0", "-1/2", "a/b"])
def test_shard_that_there_is_not_is_refused(shard: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert TOOLS["campaign"](("run", "c.toml", f"--shard={shard}")) == 2
    assert f"expected I/N with I from 1 to N, such as 3/50; got '{shard}'" in capsys.readouterr().err


@pytest.mark.long
def test_table_with_programs_is_the_same_with_one_process_eight_and_a_ray_cluster(folder: CampaignFolder) -> None:
    """Ray sends a packet outward to learn its address, and listens everywhere, so it has a network of its own."""
    one = table(folder, 0, "--jobs", "1", is_large=True)
    assert len(one.splitlines()) == 1 + 4 * 2 * 2 * 2
    assert table(folder, 2, "--jobs", "8", is_large=True) == one
    before = ("unshare", "--net", "sh", "-c", 'ip link set lo up && exec "$@"', "sh")
    assert table(folder, 3, "--ray", "local", "--jobs", "2", is_large=True, before=before) == one
