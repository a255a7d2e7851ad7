"""The report on a failed test's simulator."""

from __future__ import annotations

import shlex
from collections.abc import Iterator
from pathlib import Path

import pytest

from rosbridge_sim import Simulator
from rosbridge_sim.client import Client
from rosbridge_sim.shell import failure_report
from rosbridge_sim.shell.config.loading import check_options, read_settings
from rosbridge_sim.shell.config.options import SimulatorOptions
from rosbridge_sim.shell.config.settings import Settings
from rosbridge_sim.shell.failure_report import MAX_REPORT, FailureReport, command_of


@pytest.fixture
def sim() -> Iterator[Simulator]:
    with Simulator(port=0, start="sync") as simulator:
        yield simulator


@pytest.mark.parametrize(
    "options",
    [
        {},
        {"scenario": "a file.json", "seed": 7, "start": "sync", "strict_types": True, "status": False},
        {"map": "town", "scenario_path": ["a b", "c"], "sync_lease": 2.5, "max_clients": None, "ping_timeout": None},
        {"max_frame_size": "1MiB", "data_quota": None, "object_limit": 0, "ros": 2, "deny_publish": ["/a", "/b*"]},
    ],
    ids=lambda options: "-".join(options) or "none",
)
def test_command_gives_the_settings_back(options: SimulatorOptions) -> None:
    settings = check_options(options)
    program, *words = shlex.split(command_of(settings))
    assert (program, words[0]) == ("rosbridge-sim", "serve")
    assert read_settings(words[1:], {}) == settings


def test_command_has_no_secrets_and_nothing_of_the_tests_own() -> None:
    settings = Settings(token="sesame", attach=("ws://a/?token=b",), port=1, data_dir="/x")  # noqa: S106 - opens nothing
    assert command_of(settings) == "rosbridge-sim serve --scenario demo --seed 0"


def test_report_changes_nothing_that_a_client_sees(sim: Simulator) -> None:
    with Client(sim.url) as client:
        seen = [client.call(f"/rosapi/{name}") for name in ("nodes", "topics", "services")]
        FailureReport(sim)
        assert [client.call(f"/rosapi/{name}") for name in ("nodes", "topics", "services")] == seen


@pytest.mark.slow  # loads Pillow, and draws
def test_last_message_wins_and_the_report_is_bounded(
    sim: Simulator, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("rosbridge_sim.shell.drawing.map_picture.SIZE", 300)  # the picture is not what this is about
    report = FailureReport(sim)
    with Client(sim.url) as client:
        for i in range(60):
            client.publish(f"/t{i:02}", {"data": f"old {i}"}, "std_msgs/String")
            client.publish(f"/t{i:02}", {"data": f"new {i} " + 1_000 * "한"})
        client.confirm()
    text = report.text(tmp_path / "a.png", "test_x.py::test_y")
    assert '\n  /t00 {"data":"new 0' in text
    assert "old" not in text
    assert "... (3,0" in text
    assert "more topics\n" in text
    assert len(text.encode()) < MAX_REPORT + 2_000


def test_topics_that_are_kept_are_bounded(sim: Simulator, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(failure_report, "MAX_TOPICS", 3)
    report = FailureReport(sim)
    with Client(sim.url) as client:
        for i in range(10):
            client.publish(f"/t{i}", {"data": "x"}, "std_msgs/String")
        client.confirm()
    assert len(report._last) == 3


def test_gateway_without_a_world_has_no_picture(tmp_path: Path) -> None:
    with Simulator(port=0, world=False) as sim:
        text = FailureReport(sim).text(tmp_path / "a.png", "test_x.py::test_y")
    assert "picture" not in text
    assert not list(tmp_path.iterdir())
    assert text.endswith(
        "  rosbridge-sim serve --no-world --scenario demo --seed 0\n  python -m pytest test_x.py::test_y"
    )
