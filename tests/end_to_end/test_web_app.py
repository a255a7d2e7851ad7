"""Web apps against mocks: libraries of npm, and the guide "Test a web app without a robot" as a user follows it."""

from __future__ import annotations

import asyncio
import json
import os
import shutil
import subprocess
import sys
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import pytest

from rosbridge_sim import Simulator
from tests.cli.tool_fixture import run
from tests.end_to_end.test_browser import open_browser, page_at, until
from tests.support import PATIENCE, ROOT, held_port, require_chromium, require_node_modules, require_tool
from tests.test_doc_examples import example

pytestmark = [pytest.mark.client, pytest.mark.slow]


class _Handler(SimpleHTTPRequestHandler):
    def log_message(self, *_: object) -> None:
        """Say nothing."""


@contextmanager
def site_of(folder: Path) -> Iterator[int]:
    """The port of a server of a folder's files."""
    with ThreadingHTTPServer(("127.0.0.1", 0), partial(_Handler, directory=str(folder))) as server:
        serving = threading.Thread(target=server.serve_forever, args=(0.01,))
        serving.start()
        yield server.server_port
        server.shutdown()
        serving.join()


def pages_of(folder: Path) -> None:
    modules = require_node_modules()
    for name, file in {
        "roslib.min.js": "roslib1/build/roslib.min.js",
        "ros3d.min.js": "ros3d/build/ros3d.min.js",
        "react.js": "react/umd/react.production.min.js",
        "react-dom.js": "react-dom/umd/react-dom.production.min.js",
        "react-ros.js": "react-ros/dist/index.js",
    }.items():
        shutil.copy(modules / file, folder / name)
    shutil.copy(ROOT / "tests" / "end_to_end" / "clients" / "web_app.html", folder / "index.html")


MARKS = {"robot.yaml": "mock", "playwright.config.js": "config", "mock.setup.js": "setup", "robot.spec.js": "spec"}
"""File of the guide's npm project -> its mark in the guide."""


@pytest.fixture
def project(tmp_path: Path) -> Path:
    """The project of the guide, with the packages of our tests."""
    modules = require_node_modules()
    for file, mark in {**MARKS, "index.html": "page", "test_page.py": "pytest"}.items():
        (tmp_path / file).write_text(example(f"web-app-{mark}"))
    (tmp_path / "package.json").write_text('{"type": "module"}')
    (tmp_path / "node_modules").symlink_to(modules)
    shutil.copy(modules / "roslib1" / "build" / "roslib.min.js", tmp_path)
    return tmp_path


def environment(**more: str) -> Mapping[str, str]:
    """Variables of a user who has installed this package."""
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    return {**os.environ, "PATH": path, "CHROMIUM": require_chromium(), **more}


def run_in(folder: Path, *command: str, **more: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        command, cwd=folder, env=environment(**more), capture_output=True, text=True, check=False, timeout=4 * PATIENCE
    )


PATIENT = f"""
import config from "./playwright.config.js";
export default {{ ...config, timeout: {4e3 * PATIENCE}, expect: {{ timeout: {1e3 * PATIENCE} }} }};
"""
"""The guide's configuration with more than the five seconds in which a page must show something, and thirty in all."""

PATIENT_PYTHON = f"from playwright.sync_api import expect\nexpect.set_options(timeout={1e3 * PATIENCE})\n"
"""The same in Python."""


def run_playwright(project: Path, *words: str) -> subprocess.CompletedProcess[str]:
    """Run the tests of the project, which serve the page at a port of our choice."""
    command = (require_node_modules() / "@playwright" / "test" / "cli.js", "test", "--workers=1", *words)
    with held_port() as port:
        return run_in(project, require_tool("node"), *map(str, command), PAGE_PORT=str(port))


def test_guides_npm_project_passes(project: Path) -> None:
    (project / "patient.config.js").write_text(PATIENT)
    done = run_playwright(project, "--config=patient.config.js")
    assert (done.returncode, "3 passed" in done.stdout) == (0, True), done.stdout + done.stderr


def test_guides_npm_project_fails_if_the_page_does(project: Path) -> None:
    page = project / "index.html"
    page.write_text(page.read_text().replace('"no data"', '"live"'))
    done = run_playwright(project, "-g", "no data come")
    assert (done.returncode, "1 failed" in done.stdout) == (1, True), done.stdout + done.stderr


def test_guides_python_test_passes(project: Path) -> None:
    (project / "conftest.py").write_text(PATIENT_PYTHON)
    with site_of(project) as port:
        words = ("-m", "pytest", "-q", "-p", "rosbridge_sim.pytest_plugin", "test_page.py")
        more = {"PAGE_PORT": str(port), "PYTHONPATH": str(ROOT), "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1"}
        done = run_in(project, sys.executable, *words, **more)
    assert (done.returncode, "1 passed" in done.stdout) == (0, True), done.stdout + done.stderr


async def capture_simulator(file: str) -> None:
    """Write a mock of the simulator."""
    topics = ("/Ego_topic", "/SyncModeInfo", "/sim/scene/objects", "/tf*")
    async with Simulator(port=0) as simulator:
        patterns = [word for topic in topics for word in ("--topic", topic)]
        words = ("mock", "capture", simulator.url, "-o", file, "--duration", "3", *patterns, "--call", "/sim/describe")
        done = await asyncio.to_thread(run, *words)
    assert done.code == 0, done
    assert run("mock", "check", file).code == 0


@pytest.mark.parametrize("library", ["roslib", "roslib1"])
async def test_roslib_in_node_uses_a_mock_of_the_simulator(library: str, tmp_path: Path) -> None:
    file, clients = str(tmp_path / "simulator.yaml"), require_node_modules().parent / "clients"
    await capture_simulator(file)
    async with Simulator(port=0, mock=file) as mock:
        words = (require_tool("node"), "mock.mjs", library, str(mock.port), "see")
        done = await asyncio.to_thread(run_in, clients, *words)
    seen = {"has_markers": True, "x": 40.0, "frame": "base_link", "model": "2016_Hyundai_Ioniq"}
    assert json.loads(done.stdout) == seen, done.stdout + done.stderr


async def test_roslib_ros3d_and_react_ros_show_a_mock_of_the_simulator(tmp_path: Path) -> None:
    file = str(tmp_path / "simulator.yaml")
    await capture_simulator(file)
    folder = tmp_path / "site"
    folder.mkdir()
    pages_of(folder)
    async with Simulator(port=0, mock=file) as mock, open_browser() as browser:
        assert mock.node is None
        with site_of(folder) as port:
            async with page_at(f"http://127.0.0.1:{port}/?ros={mock.url}", tmp_path, browser) as page:
                await until(page, "at('x') === '40.0' && at('answer') === '2016_Hyundai_Ioniq'")
                await until(page, "at('topics').includes('/sim/scene/objects')")
                await until(page, "at('markers') > 10 && at('transform') === '40.0'")
                await until(page, "/^[1-9]\\d* topics, frame \\d+$/.test(at('react'))")
