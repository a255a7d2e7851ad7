"""Programs that run beside the long tests: those that fail are named, and their last words are printed last."""

from __future__ import annotations

import subprocess
from pathlib import Path

from tests.support import PATIENCE, ROOT

SCRIPT = """
set -euo pipefail
source scripts/beside.sh
start_beside "cat {folder}/good" "cat {folder}/good {folder}/missing"
failed=()
wait_beside
printf 'failed: %s\\n' "${{failed[@]}}"
"""


def test_failed_program_is_named_and_its_output_comes_last(tmp_path: Path) -> None:
    (tmp_path / "good").write_text("all is well\n")
    script = SCRIPT.format(folder=tmp_path)
    done = subprocess.run(
        ["bash", "-c", script], cwd=ROOT, capture_output=True, text=True, check=True, timeout=PATIENCE
    )
    good, bad = f"cat {tmp_path}/good", f"cat {tmp_path}/good {tmp_path}/missing"
    assert done.stdout.splitlines() == [
        f"== passed: {good}",
        "all is well",
        f"== failed: {bad}",
        "",
        f"== the last lines of {bad}",
        "all is well",
        f"cat: {tmp_path}/missing: No such file or directory",
        f"failed: {bad}",
    ]


def test_program_ends_with_the_tests(tmp_path: Path) -> None:
    script = f"""
        set -euo pipefail
        source scripts/beside.sh
        mkfifo {tmp_path}/started
        printf 'echo $$ >"$1"; exec sleep 1000' >{tmp_path}/program
        start_beside "bash {tmp_path}/program {tmp_path}/started"
        cat {tmp_path}/started
        exit 3
    """
    done = subprocess.run(
        ["bash", "-c", script], cwd=ROOT, capture_output=True, text=True, check=False, timeout=PATIENCE
    )
    assert done.returncode == 3
    assert not Path(f"/proc/{int(done.stdout)}").exists()
