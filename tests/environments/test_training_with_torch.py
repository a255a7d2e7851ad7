"""Training with a real stable-baselines3 on Debian's torch, which `./scripts/test --long` installs into .venv/torch."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.cpu_time import run
from tests.support import ROOT, miss
from tests.test_doc_examples import example, shown

PYTHON = ROOT / ".venv" / "torch" / "bin" / "python"

pytestmark = pytest.mark.long


def run_with_torch(*words: str | Path) -> str:
    """Return what a program prints."""
    if not PYTHON.exists():
        miss("needs torch in .venv/torch (./scripts/test --long installs it as root on Debian)")
    command = [PYTHON, ROOT / "tests" / "environments" / "with_debian_torch.py", *words]
    done = run(command, cwd=ROOT)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_program_of_the_page_prints_what_the_page_says(tmp_path: Path) -> None:
    program = tmp_path / "program.py"
    program.write_text(example("stable-baselines3"))
    assert run_with_torch(program) == shown("stable-baselines3")


def test_trained_driver_keeps_its_lane_and_an_untrained_one_does_not(tmp_path: Path) -> None:
    policy = tmp_path / "driver.zip"
    program = ROOT / "scripts" / "examples" / "train_ppo.py"
    printed = run_with_torch(program, "--policy", policy)
    before, after = (float(figure) for figure in re.findall(r"mean reward (-?[\d.]+)", printed))
    assert before < 10.0
    assert after > 50.0
    assert policy.stat().st_size > 0
