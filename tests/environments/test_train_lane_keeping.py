"""The example that trains a driver with numpy alone: its rounds, its curve and what a round does to a policy."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("gymnasium", reason="the extra rosbridge-sim[gym]")

SCRIPT = Path(__file__).resolve().parents[2] / "scripts" / "examples" / "train_lane_keeping.py"


@pytest.fixture
def example(monkeypatch: pytest.MonkeyPatch) -> Any:  # noqa: ANN401 - a module by its path
    spec = importlib.util.spec_from_file_location("train_lane_keeping", SCRIPT)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    monkeypatch.setitem(sys.modules, spec.name, module)
    spec.loader.exec_module(module)
    for name, value in (("DIRECTIONS", 4), ("BEST", 2), ("PLACES", 2), ("DURATION", 1.0)):
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
    policy = example.Policy(weights, np.zeros(15), np.ones(15))
    film = tmp_path / "lap.gif"
    example.register_all()
    metres, offset = example.drive_lap(example.ego_alone(tmp_path), policy, 1000.0, film)
    assert 0.0 < metres < 50.0
    assert 0.5 < offset < 2.5
    assert film.read_bytes()[:6] == b"GIF89a"


def test_figures_are_whitened_as_if_they_were_seen_at_once(example: Any) -> None:  # noqa: ANN401
    seen = np.random.default_rng(0).normal(3.0, 2.0, (500, 15))
    policy = example.Policy(np.zeros((2, 16)), np.zeros(15), np.ones(15))
    for part in (seen[:100], seen[100:160], seen[160:]):
        policy.whiten(part)
    assert policy.mean == pytest.approx(seen.mean(axis=0), rel=1e-3)
    assert policy.variance == pytest.approx(seen.var(axis=0), rel=1e-3)
