"""Results with wrong values, and texts of the user's code that no file can hold: one line each, no traceback."""

from __future__ import annotations

import contextlib
import io
import json
import math
from pathlib import Path
from typing import Any

import pytest

from rosbridge_sim.campaign_runs.results_folder import ResultsFolder, run_folder
from rosbridge_sim.campaign_runs.writing import write_all
from rosbridge_sim.campaigns.campaign import read_campaign
from rosbridge_sim.campaigns.run_results import Breach, Result, Run
from rosbridge_sim.cli.campaigns.campaign_results import compare, list_runs, report, show
from rosbridge_sim.cli.command_table import TOOLS
from rosbridge_sim.errors import DocumentError
from tests.campaign_runs.conftest import CampaignFolder

CAMPAIGN = 'scenario = "loop"\nseconds = 0.1\n[parameters]\ngap = [1.5]\n[drivers]\nf = "lanes"\n'

GOOD = Result(
    Run(1, "loop", "f", 0, {"gap": 1.5}),
    "fail",
    "why",
    (Breach("speed", "too fast", 1.0, 2.0, 3.0),),
    {"distance": 1.0},
    5,
    "ab",
    ((0.0, 1.0),),
    (),
    ("trace.csv",),
).to_json()

WRONG: dict[str, list[Any]] = {
    "run": [None, "x", -1, 1.5, True, 10**30, [1]],
    "scenario": [None, 3, "\ud800"],
    "driver": [None, {}, "\udcff"],
    "seed": [None, "1", 2**64],
    "parameters": [None, [], {"gap": [1]}, {"gap": None}, {"gap": "\ud800"}, {"\ud800": 1}],
    "verdict": [None, "good", ["pass"], {}],
    "reason": [None, 7, "\ud800"],
    "breaches": [
        *(None, 1, [1], [[]], [["a", "b", "c", 1, 2]], [["a", 5, 1, 2, 3]]),
        *([["a", "b", value, 1, 2]] for value in (math.nan, math.inf, 1e300, True, 10**400)),
    ],
    "scores": [None, [], {"distance": "far"}, {"distance": math.nan}],
    "frames": [None, "5", -1],
    "state_hash": [None, 5],
    "path": [None, 5, [[1]], [[1, "x"]], [[1, None]], [["1", "2"]], [[1e300, 0]]],
    "verdicts": [None, "pass", ["good"]],
    "files": [None, [1], "trace.csv", ["\ud800"]],
    "trouble": [None, [1]],
    "wall": [None, "1", math.inf],
    "worker": [None, 1],
    "retries": [None, "1", -1],
}


def write_folder(path: Path, line: bytes) -> Path:
    path.mkdir(exist_ok=True)
    (path / "campaign.toml").write_text(CAMPAIGN)
    (path / "campaign.json").write_text(json.dumps({"source": "c.toml", "base": str(path)}))
    (path / "results.jsonl").write_bytes(line + b"\n")
    return path


def use_all(folder: Path) -> None:
    """Do all that reads a folder of results."""
    for is_json in (False, True):
        list_runs(str(folder), None, is_json=is_json)
        show(str(folder), 1, is_json=is_json)
        compare(str(folder), str(folder), may_lack=False, is_json=is_json)
    report(str(folder))


def test_missing_runs_make_a_comparison_fail_unless_they_are_allowed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    lines = [json.dumps({**GOOD, "run": number, "seed": number, "verdict": "pass"}).encode() for number in (1, 2, 3)]
    all_runs = write_folder(tmp_path / "all", b"\n".join(lines))
    one_run = write_folder(tmp_path / "one", lines[0])
    words = ("compare", str(all_runs), str(one_run))
    assert TOOLS["campaign"](words) == 1
    told = capsys.readouterr().out
    assert "missing: 2\n  run 2 f loop seed=2 gap=1.5\n  run 3 f loop seed=3 gap=1.5\n" in told
    assert TOOLS["campaign"]((*words, "--allow-missing")) == 0
    assert TOOLS["campaign"](("compare", str(one_run), str(all_runs))) == 0


def test_good_line_is_used(tmp_path: Path) -> None:
    use_all(write_folder(tmp_path, json.dumps(GOOD).encode()))
    assert "too fast" in (tmp_path / "report.html").read_text()


@pytest.mark.parametrize(
    ("name", "value"),
    [(name, value) for name, values in WRONG.items() for value in values],
    ids=lambda one: ascii(one)[:50],
)
def test_line_with_a_wrong_value_is_one_error_with_its_place(tmp_path: Path, name: str, value: object) -> None:
    folder = write_folder(tmp_path, json.dumps(GOOD | {name: value}).encode())
    with pytest.raises(DocumentError, match=r"results\.jsonl:1: expected a result of a run; ") as error:
        use_all(folder)
    assert len(str(error.value)) < 400 + len(str(folder))


@pytest.mark.parametrize("name", sorted(GOOD.keys() - {"trouble", "retries"}))
def test_line_without_a_value_names_it(tmp_path: Path, name: str) -> None:
    folder = write_folder(tmp_path, json.dumps({key: value for key, value in GOOD.items() if key != name}).encode())
    with pytest.raises(DocumentError, match=f"a result of a run; '{name}' is missing"):
        use_all(folder)


@pytest.mark.parametrize("line", [b"[" * 100_000, b"null", b"[]", b"7", b"\xff", b'{"run": ' + b"9" * 5_000 + b"}"])
def test_line_that_is_no_result_is_one_error(tmp_path: Path, line: bytes) -> None:
    with pytest.raises(DocumentError, match=r"results\.jsonl:1: expected a result of a run"):
        use_all(write_folder(tmp_path, line))


TRACE = "time,x,y,speed,distance,time_to_collision\n"
ROADS = ("5", "[[1]]", '[[["a", 2]]]')


@pytest.mark.parametrize(
    ("trace", "scene"),
    [
        *((TRACE + "1,1,1,1,1,1\n", scene) for scene in ("", "7", "[]", "{", *(f'{{"roads": {x}}}' for x in ROADS))),
        *((trace, "7") for trace in ("", "a,b\n1\n", TRACE, TRACE + "1,nan,1,1,1,1\n", "x" * 200_000, TRACE + "\0\n")),
    ],
)
def test_kept_files_with_wrong_values_are_left_out_of_the_page(tmp_path: Path, trace: str, scene: str) -> None:
    folder = write_folder(tmp_path, json.dumps(GOOD).encode())
    place = run_folder(folder, 1)
    place.mkdir(parents=True)
    (place / "trace.csv").write_text(trace)
    (place / "scene.json").write_text(scene)
    use_all(folder)
    assert "too fast" in (folder / "report.html").read_text()


def test_large_whole_numbers_stand_beside_fractions_in_a_column(tmp_path: Path) -> None:
    results = [Result(Run(i, "loop", "f", 0, {"gap": gap}), "pass") for i, gap in enumerate((2**62, 0.5, 1), 1)]
    campaign = read_campaign({"scenario": "loop", "drivers": {"f": "lanes"}, "parameters": {"gap": [1.5]}}, "c.toml")
    write_all(ResultsFolder(tmp_path), campaign, results, "c")
    assert str(2**62) in (tmp_path / "runs.csv").read_text()


STRANGE = """
class Strange(Exception):
    pass

class Unprintable(Exception):
    def __str__(self):
        raise SystemExit(3)

def judge(trace):
    print("judged \\ud800")
    raise Strange("half \\ud800 of it, " + "x" * 6_000_000)

def judge_in_silence(trace):
    raise Unprintable

def tell(trace):
    return "half \\udcff of it"

def drive(world):
    raise Strange("half \\ud800 of it, " + "x" * 6_000_000)
"""


@pytest.mark.parametrize(
    ("own", "driver", "told"),
    [
        ("judge", "lanes", "a limit's function failed: Strange: half \\ud800 of it"),
        ("judge_in_silence", "lanes", "a limit's function failed: Unprintable"),
        ("tell", "lanes", "half \\udcff of it"),
        ("", "strange.py:drive", "the driver failed: Strange: half \\ud800 of it"),
    ],
)
def test_halves_of_surrogate_pairs_of_the_user_s_code_are_written_as_escapes(
    folder: CampaignFolder, own: str, driver: str, told: str
) -> None:
    folder.write("strange.py", STRANGE)
    limit = f'[limits.own.mine]\npython = "strange.py:{own}"\n' if own else ""
    text = f'scenario = "loop"\nseconds = 0.1\n[drivers]\nf = "{driver}"\n{limit}[output]\nkeep = "all"\n'
    [result] = folder.drive(text)
    assert told in result.reason
    assert len(result.reason) < 500
    log = run_folder(folder.path / "out", 1) / "log.txt"
    if own != "tell":
        assert log.stat().st_size < 200_000
    write_folder(folder.path / "out", json.dumps(result.to_json()).encode())
    with contextlib.redirect_stdout(io.StringIO()) as printed:
        use_all(folder.path / "out")
    assert told.partition(":")[0] in printed.getvalue()


def test_import_that_fails_with_such_a_text_is_one_error(folder: CampaignFolder) -> None:
    folder.write("broken.py", 'raise ValueError("half \\ud800 of it, " + "x" * 6_000_000)\n')
    with pytest.raises(DocumentError, match=r"the import failed: ValueError: half \\ud800 of it") as error:
        folder.drive('scenario = "loop"\nseconds = 0.1\n[drivers]\nf = "broken.py:drive"\n')
    assert len(str(error.value)) < 500
