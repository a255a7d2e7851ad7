"""Folders of results at addresses of fsspec."""

from __future__ import annotations

import zipfile
from contextlib import ExitStack
from pathlib import Path

import pytest

from rosbridge_sim.campaign_runs.stored_folder import open_results
from rosbridge_sim.cli.command_table import TOOLS
from rosbridge_sim.errors import DocumentError
from tests.campaign_runs.conftest import CampaignFolder

CAMPAIGN = """\
scenario = "demo"
seconds = 0.2
seeds = 2
[output]
keep = "all"
[drivers]
ours = "lanes"
"""


@pytest.mark.slow
def test_results_at_an_address_are_those_of_a_folder(folder: CampaignFolder, tmp_path: Path) -> None:
    folder.write("night.toml", CAMPAIGN)
    address = f"file://{tmp_path}/store/deep"
    local = folder.command("run", "night.toml", "--jobs", "1", "--output", "local")
    stored = folder.command("run", "night.toml", "--jobs", "1", "--output", f"{address}/a", "--shard", "1/2")
    assert (local.returncode, stored.returncode) == (0, 0), local.stderr + stored.stderr
    assert "error" not in local.stderr + stored.stderr  # a drive of more than 10 s is told there
    assert stored.stdout.endswith(f"report: {address}/a/report.html\n")
    assert not (tmp_path / "store" / "deep" / "a" / ".lock").exists()

    again = folder.command("run", "night.toml", "--output", f"{address}/a")
    assert (again.returncode, again.stderr.count("\n")) == (2, 1)
    assert f"{address}/a: there are results already" in again.stderr
    rest = folder.command("run", "night.toml", "--jobs", "1", "--output", f"{address}/a", "--resume")
    assert (rest.returncode, rest.stdout.splitlines()[0]) == (0, "2 runs: 2 pass")

    merged = folder.command("merge", f"{address}/a", "--output", f"{address}/all")
    assert merged.returncode == 0, merged.stderr
    of_local, of_store = tmp_path / "local", tmp_path / "store" / "deep" / "all"
    assert (of_store / "runs.csv").read_text() == (of_local / "runs.csv").read_text()
    assert sorted(file.relative_to(of_store) for file in of_store.rglob("runs/*/*")) == sorted(
        file.relative_to(of_local) for file in of_local.rglob("runs/*/*")
    )
    assert folder.command("compare", "local", f"{address}/all").returncode == 0
    assert f"file: {address}/all/runs/00001/trace.csv" in folder.command("show", f"{address}/all", "1").stdout
    assert folder.command("repeat", f"{address}/all", "2").stdout.splitlines()[-1] == "the same"


@pytest.mark.parametrize(
    ("address", "why"),
    [
        ("nothing://bucket/night", "Protocol not known: nothing"),
        ("memory://nowhere", "expected a folder of results"),
    ],
)
def test_address_that_cannot_be_read_is_one_sentence(
    address: str, why: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert TOOLS["campaign"](["list", address]) == 2
    told = capsys.readouterr().err
    assert told.count("\n") == 1
    assert address in told
    assert why in told


def test_address_that_takes_no_files_is_told_before_a_drive(folder: CampaignFolder) -> None:
    folder.write("night.toml", CAMPAIGN)
    refused = folder.command("run", "night.toml", "--output", "file:///proc/store")
    assert (refused.returncode, refused.stdout, refused.stderr.count("\n")) == (2, "", 1)
    assert "file:///proc/store: cannot be written" in refused.stderr


def test_results_that_a_store_does_not_take_stay_on_the_disk(tmp_path: Path) -> None:
    with ExitStack() as stack:
        folder = stack.enter_context(open_results(f"file://{tmp_path}/store", tell=print))
        folder.path.mkdir()
        (folder.path / "results.jsonl").write_text("{}\n")
        (tmp_path / "store").rmdir()
        (tmp_path / "store").touch()
        with pytest.raises(DocumentError, match=r"/store: cannot be written: .*; the results are in ") as told:
            stack.close()
    kept = Path(str(told.value).rpartition(" ")[2])
    assert (kept / "results.jsonl").read_text() == "{}\n"


def test_ctrl_c_while_results_are_stored_leaves_them_on_the_disk(monkeypatch: pytest.MonkeyPatch) -> None:
    from fsspec.implementations.memory import MemoryFileSystem  # noqa: PLC0415 - of an extra

    def hang(*_: object) -> None:
        raise KeyboardInterrupt

    with ExitStack() as stack:
        folder = stack.enter_context(open_results("memory://night", tell=print))
        folder.path.mkdir()
        (folder.path / "results.jsonl").write_text("{}\n")
        monkeypatch.setattr(MemoryFileSystem, "put_file", hang)
        with pytest.raises(DocumentError, match="memory://night: not all is stored; the results are in ") as told:
            stack.close()
    assert (Path(str(told.value).rpartition(" ")[2]) / "results.jsonl").read_text() == "{}\n"


def test_password_of_an_address_is_in_no_title_and_no_error(folder: CampaignFolder) -> None:
    with open_results("memory://me:se%40cret:1@night") as opened:
        assert opened.title == "memory://me:***@night"
    refused = folder.command("list", "ftp://me:se%40cret@[")
    assert (refused.returncode, refused.stderr.count("\n")) == (2, 1)
    assert "ftp://me:***@[: cannot be opened: " in refused.stderr
    assert "cret" not in refused.stderr


def test_names_in_a_store_do_not_leave_the_copy(tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "evil.zip", "w") as file:
        file.writestr("campaign.json", "{}")
        file.writestr("runs/../../escaped", "x")
        file.writestr("../escaped", "x")
    with open_results(f"zip://::file://{tmp_path}/evil.zip", fetch=None) as folder:
        found = [file.relative_to(folder.path.parent).as_posix() for file in folder.path.parent.rglob("*")]
    assert sorted(found) == ["results", "results/campaign.json"]
