"""What a Python that is too old is told, wherever it meets the project. An older one is played by this one."""

from __future__ import annotations

import ast
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from tests.support import PATIENCE, ROOT

OLD = "import sys; sys.version_info = (3, 10, 14, 'final', 0); sys.version = '3.10.14 (main)'"

FAKE = f"""\
#!/bin/sh
[ "$1" = -c ] || exit 9
exec {sys.executable} -c "{OLD}; exec(sys.argv[1])" "$2"
"""


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    """As much of a checkout as its scripts need, without an environment."""
    (tmp_path / "scripts").mkdir()
    for name in ("scripts/serve", "scripts/test", "scripts/environment.sh", "pyproject.toml"):
        shutil.copy(ROOT / name, tmp_path / name)
    return tmp_path


def make_old(path: Path) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(FAKE)
    path.chmod(0o755)
    return path


def refusal(script: Path, env: dict[str, str]) -> str:
    done = subprocess.run([script], env=env, capture_output=True, text=True, timeout=PATIENCE, check=False)
    assert (done.returncode, done.stdout) == (1, "")
    return done.stderr


@pytest.mark.parametrize("name", ["serve", "test"])
def test_script_refuses_an_old_python_in_one_line(checkout: Path, name: str) -> None:
    old = make_old(checkout / "python3.10")
    text = refusal(checkout / "scripts" / name, {"PATH": "/usr/bin:/bin", "PYTHON": str(old)})
    assert text == (
        f"{name}: needs Python 3.11 or newer; {old} is older; install it, or name it: PYTHON=/path/to/python3\n"
    )


@pytest.mark.parametrize("name", ["serve", "test"])
def test_script_refuses_an_environment_of_an_old_python_in_one_line(checkout: Path, name: str) -> None:
    make_old(checkout / ".venv" / "bin" / "python")
    text = refusal(checkout / "scripts" / name, {"PATH": "/usr/bin:/bin"})
    assert text == (
        f"{name}: needs Python 3.11 or newer; {checkout}/.venv was made with an older one;"
        " remove that folder and start again\n"
    )


def test_module_refuses_an_old_python_in_one_line() -> None:
    done = subprocess.run(
        [sys.executable, "-c", f"{OLD}; import runpy; runpy.run_module('rosbridge_sim', run_name='__main__')"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=PATIENCE,
        check=False,
    )
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr == (
        f"rosbridge-sim: expected Python 3.11 or newer; this is 3.10.14 ({sys.executable}):"
        " install a newer one and start with it\n"
    )


def test_what_runs_before_the_refusal_is_python_that_an_old_one_can_read() -> None:
    for name in ("__init__.py", "__main__.py", "version.py"):
        source = (ROOT / "rosbridge_sim" / name).read_text()
        ast.parse(source, feature_version=(3, 8))


def test_all_places_ask_for_the_version_that_the_package_asks_for() -> None:
    wanted = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["requires-python"]
    minor = wanted.removeprefix(">=3.")
    for name in ("scripts/environment.sh", "scripts/serve.ps1", "rosbridge_sim/__main__.py"):
        text = (ROOT / name).read_text()
        assert set(re.findall(r"\(3, (\d+)\)", text)) == {minor}, name
        assert f"Python 3.{minor} or newer" in text, name
