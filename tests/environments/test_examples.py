"""The examples that drive the environments, and train with numpy alone: rounds, curves, films, and what rules reach."""

from __future__ import annotations

import importlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("gymnasium", reason="the extra rosbridge-sim[gym]")

EXAMPLES = Path(__file__).resolve().parents[2] / "scripts" / "examples"


def load(name: str, monkeypatch: pytest.MonkeyPatch) -> Any:  # noqa: ANN401 - a module by its path
    monkeypatch.syspath_prepend(str(EXAMPLES))
    return importlib.import_module(name)


@pytest.fixture
def example(monkeypatch: pytest.MonkeyPatch) -> Any:  # noqa: ANN401 - as above
    module = load("train_lane_keeping", monkeypatch)
    for name, value in (("DIRECTIONS", 4), ("BEST", 2), ("PLACES", 2), ("STEPS", 10)):
        monkeypatch.setattr(module, name, value)
    return module


@pytest.mark.slow
def test_round_writes_a_line_of_the_curve_and_the_policy(example: Any, tmp_path: Path) -> None:  # noqa: ANN401
    curve, policy = tmp_path / "curve.csv", tmp_path / "policy.npz"
    example.main(["--rounds", "2", "--curve", str(curve), "--policy", str(policy)])
    lines = curve.read_text(encoding="utf-8").splitlines()
    assert lines[0] == "round,cpu_seconds,reward,metres,offset"
    assert [line.split(",")[0] for line in lines[1:]] == ["0", "1"]
    saved = np.load(policy)
    assert np.abs(saved["weights"]).max() > 0.0
    assert (saved["variance"] < 1.0).all()


@pytest.mark.slow
def test_lap_is_filmed_until_the_lane_is_left(example: Any, tmp_path: Path) -> None:  # noqa: ANN401
    weights = np.zeros((2, 16))
    weights[:, 15] = 0.3, 0.5  # to the left, faster
    policy = example.Policy(2, 15)
    policy.weights = weights
    film = tmp_path / "lap.gif"
    example.register_all()
    metres, offset = example.drive_lap(example.ego_alone(tmp_path), policy, 1000.0, film)
    assert 0.0 < metres < 50.0
    assert 0.5 < offset < 2.5
    assert film.read_bytes()[:6] == b"GIF89a"


def test_figures_are_whitened_as_if_they_were_seen_at_once(example: Any) -> None:  # noqa: ANN401
    seen = np.random.default_rng(0).normal(3.0, 2.0, (500, 15))
    policy = example.Policy(2, 15)
    for part in (seen[:100], seen[100:160], seen[160:]):
        policy.whiten(part)
    assert policy.mean == pytest.approx(seen.mean(axis=0), rel=1e-3)
    assert policy.variance == pytest.approx(seen.var(axis=0), rel=1e-3)


def test_random_search_finds_the_best_weights(example: Any) -> None:  # noqa: ANN401
    rng, policy = np.random.default_rng(0), example.Policy(1, 3)
    figures = rng.normal(size=(200, 3))
    wanted = figures @ [1.0, -2.0, 0.5]

    def drive(weights: Any) -> Any:  # noqa: ANN401
        outputs = np.stack([policy.apply(each, figures)[:, 0] for each in weights])
        return -np.square(outputs - wanted).mean(axis=1), figures

    rewards = [example.improve(policy, drive, rng, directions=8, best=4, step=0.1, noise=0.05) for _ in range(60)]
    assert rewards[0] < -4.0
    assert rewards[-1] > -0.2


@pytest.mark.slow
def test_highway_driver_is_compared_with_all_others(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    module = load("train_highway", monkeypatch)
    for name, value in (("DIRECTIONS", 2), ("BEST", 1), ("PLACES", 1)):
        monkeypatch.setattr(module, name, value)
    monkeypatch.setitem(module.OPTIONS, "max_episode_steps", 4)
    module.main(["--rounds", "1", "--episodes", "2", "--policy", str(tmp_path / "driver.npz")])
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines[-2:]] == ["untrained", "trained"]
    assert 20.0 < float(lines[-2].split()[1]) < 30.0
    assert np.load(tmp_path / "driver.npz")["weights"].shape == (5, 14)


def test_gaps_are_those_of_the_next_vehicles_on_each_lane(monkeypatch: pytest.MonkeyPatch) -> None:
    figures_of = load("train_highway", monkeypatch).figures_of
    seen = np.zeros((1, 15 + 3 * 9))
    seen[0, 0] = 20.0
    others = seen[0, 15:].reshape(3, 9)
    others[0, :4] = 1.0, 30.0, 0.2, -4.0  # ahead, slower
    others[1, :4] = 1.0, 50.0, 0.0, 2.0  # behind the first one
    others[2, :4] = 1.0, -12.0, 3.4, 3.0  # behind on the left, faster
    assert figures_of(seen)[0].tolist() == [20.0, 100.0, 0.0, 12.0, -3.0, 30.0, -4.0, *(100.0, 0.0) * 3]


@pytest.mark.slow
def test_rule_parks_between_other_cars(monkeypatch: pytest.MonkeyPatch) -> None:
    module = load("drive_environments", monkeypatch)
    module.register_all()
    found = module.drive("rosbridge_sim/Parking-v1", module.ParkByRule(3), 3)
    assert (found["arrived"], found["failed"]) == (1.0, 0.0)


@pytest.mark.slow
def test_rule_crosses_the_junction_and_no_red_light(monkeypatch: pytest.MonkeyPatch) -> None:
    module = load("drive_environments", monkeypatch)
    module.register_all()
    name = "rosbridge_sim/Intersection-v1"
    found = module.drive(name, lambda seen: module.by_rule(seen, module.TASKS[name]), 2)
    assert found["failed"] == 0.0
    assert found["metres"] > 50.0


@pytest.mark.slow
@pytest.mark.parametrize("num", [2, pytest.param(16, marks=pytest.mark.long)])
@pytest.mark.parametrize("name", ["Merge-v0", "Roundabout-v1", "Drive-v0"])
def test_rule_drives_without_a_failure(name: str, num: int, monkeypatch: pytest.MonkeyPatch) -> None:
    module = load("drive_environments", monkeypatch)
    module.register_all()
    task = module.TASKS[f"rosbridge_sim/{name}"]
    found = module.drive(f"rosbridge_sim/{name}", lambda seen: module.by_rule(seen, task), num)
    assert (found["failed"], found["seconds"]) == (0.0, 40.0)
    assert found["metres"] > 20.0 * task.target_speed


STRAIGHT = [[5.0, 0.0], [10.0, 0.0], [20.0, 0.0], [40.0, 0.0]]


def test_rule_slows_down_for_a_bend_and_not_on_a_straight(monkeypatch: pytest.MonkeyPatch) -> None:
    module = load("drive_environments", monkeypatch)
    angles = np.array([5.0, 10.0, 20.0, 40.0]) / 25.0
    bend = 25.0 * np.stack([np.sin(angles), 1.0 - np.cos(angles)], axis=1)
    straight, fast, slow = module.slow_down_for_bends(np.array([STRAIGHT, bend, bend]), np.array([12.0, 12.0, 5.0]))
    assert straight > module.MAX_ACCEL
    assert fast < -module.MAX_ACCEL
    assert slow > 0.0


@pytest.mark.parametrize(
    ("x", "y", "speed", "yaw", "brakes"),
    [
        (25.0, 0.0, 0.0, 0.0, True),  # stands ahead
        (25.0, 3.5, 0.0, 0.0, False),  # stands in the next lane
        (25.0, 12.0, 8.0, -0.5 * np.pi, True),  # will cross before the ego is there
        (25.0, 30.0, 8.0, -0.5 * np.pi, False),  # will cross behind it
        (-10.0, 0.0, 15.0, 0.0, False),  # behind, faster
    ],
)
def test_rule_gives_way_to_those_who_come_first(
    x: float, y: float, speed: float, yaw: float, *, brakes: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    module = load("drive_environments", monkeypatch)
    ego = 10.0
    vx, vy = speed * np.cos(yaw) - ego, speed * np.sin(yaw)
    others = np.array([[[1.0, x, y, vx, vy, np.cos(yaw), np.sin(yaw), 4.5, 1.8], [0.0] * 9]])
    accel = module.follow(np.array([STRAIGHT]), np.array([ego]), others)[0]
    assert (accel < -1.0) == brakes
