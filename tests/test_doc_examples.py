"""Code on the pages about the client and about tests runs as it stands there."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from rosbridge_sim.client import Client
from tests.conftest import Serve
from tests.support import PATIENCE, ROOT

pytestmark = pytest.mark.slow

CLIENT, TESTING, README = (ROOT / name for name in ("docs/client.md", "docs/testing.md", "README.md"))


def example(page: Path, mark: str) -> str:
    """The one block of a page under `<!-- run: mark -->`."""
    (script,) = re.findall(rf"<!-- run: {mark} -->\n```python\n(.*?)```\n", page.read_text("utf-8"), re.DOTALL)
    assert isinstance(script, str)
    return script


def run(words: list[str], folder: Path) -> str:
    done = subprocess.run(
        [sys.executable, "-W", "error", *words],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(ROOT), "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1"},
        capture_output=True,
        text=True,
        timeout=3 * PATIENCE,
        check=False,
    )
    assert (done.returncode, done.stderr) == (0, ""), done.stdout + done.stderr
    return done.stdout


@pytest.mark.parametrize(
    ("mark", "out"), [("drive", "after 5 s: 30 km/h\n"), ("messages", "moved, and told to stop\n")]
)
def test_programs_with_the_client_print_what_is_said(mark: str, out: str, serve: Serve, tmp_path: Path) -> None:
    program = tmp_path / "program.py"
    program.write_text(example(CLIENT, mark).replace("ws://127.0.0.1:9090", serve().url))
    assert run([str(program)], tmp_path) == out


def test_simulator_without_pytest_runs(tmp_path: Path) -> None:
    program = tmp_path / "program.py"
    program.write_text(example(TESTING, "simulator"))
    assert re.fullmatch(
        r"<Simulator ws://\S+ scenario='demo' seed=0 running> has \d+ topics\n", run([str(program)], tmp_path)
    )


@pytest.mark.parametrize("page", [TESTING, README], ids=lambda page: page.stem)
def test_tests_on_the_pages_pass(page: Path, tmp_path: Path) -> None:
    (tmp_path / "test_page.py").write_text(example(page, "pytest"))
    asyncio_options = ("asyncio_mode=auto", "asyncio_default_fixture_loop_scope=function")
    words = [
        "-m",
        "pytest",
        "-q",
        "--strict-markers",
        "-p",
        "rosbridge_sim.pytest_plugin",
        "-p",
        "pytest_asyncio.plugin",
    ]
    out = run([*words, *(word for option in asyncio_options for word in ("-o", option)), "."], tmp_path)
    assert re.search(r"^\d passed in", out, re.MULTILINE), out


def test_table_of_methods_is_complete() -> None:
    text = CLIENT.read_text("utf-8")
    named = set(re.findall(r"^\| `(\w+)", text[text.index("## Methods") :], re.MULTILINE))
    methods = {name for name in vars(Client) if not name.startswith("_")}
    assert named >= methods - {"close", "run", "url", "timeout", "is_connected"}
