"""The example that trains a driver with numpy alone: its rounds, its curve and what a round does to a policy."""

from __future__ import annotations

import importlib.util
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
    spec.loader.exec_module(module)
    for name, value in (("DIRECTIONS", 8), ("BEST", 4), ("DURATION", 1.0), ("STARTS", (("L2_00", 900.0),))):
        monkeypatch.setattr(module, name, value)
    return module


@pytest.mark.slow
def test_round_writes_a_line_of_the_curve_and_the_policy(example: Any, tmp_path: Path) -> None:  # noqa: ANN401
    curve, policy = tmp_path / "curve.csv", tmp_path / "policy.npy"
    example.main(["--rounds", "2", "--curve", str(curve), "--policy", str(policy)])
    lines = curve.read_text(encoding="utf-8").splitlines()
    assert lines[0] == "round,cpu_seconds,reward,metres"
    assert [line.split(",")[0] for line in lines[1:]] == ["0", "1"]
    assert np.abs(np.load(policy)).max() > 0.0
