"""The pytest plugin, as a user's test run has it: each of these runs pytest in a process of its own."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tomllib
from dataclasses import dataclass
from pathlib import Path

import pytest
from PIL import Image

from tests import fork_server
from tests.support import ROOT

pytestmark = pytest.mark.slow

PLUGINS = ("rosbridge_sim.pytest_plugin", "pytest_asyncio.plugin", "xdist.plugin")
"""Plugins by their modules: what else is installed plays no part, nor does an entry point of an older install."""


@dataclass(frozen=True)
class Run:
    """A test run of a user's.

    Attributes:
        counts: how many tests ended how, such as `{"passed": 1}`.
        out: what pytest printed.
    """

    code: int
    counts: dict[str, int]
    out: str


@pytest.fixture
def run_tests(tmp_path: Path) -> RunTests:
    return RunTests(tmp_path)


@dataclass(frozen=True)
class RunTests:
    """Runs pytest on a file in a folder of its own."""

    folder: Path

    def __call__(self, source: str, *flags: str, is_fresh: bool = False) -> Run:
        """Run it in a fork of a process that has imported the package, or in a fresh one."""
        (self.folder / "pytest.ini").write_text(
            "[pytest]\n"
            "addopts = --strict-markers --strict-config -ra\n"
            "filterwarnings = error\n"
            "asyncio_mode = auto\n"
            "asyncio_default_fixture_loop_scope = function\n"
        )
        (self.folder / "test_user.py").write_text(source)
        plugins = [word for plugin in PLUGINS for word in ("-p", plugin)]
        words = ["-m", "pytest", *plugins, "--basetemp", str(self.folder / "tmp"), *flags]
        env = {**os.environ, "PYTHONPATH": str(ROOT), "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1"}
        if is_fresh:
            command = [sys.executable, *words]
            done = subprocess.run(command, cwd=self.folder, env=env, capture_output=True, text=True, check=False)
        else:
            done = fork_server.run(words, cwd=self.folder, env=env)
        counts = {word: int(num) for num, word in re.findall(r"(\d+) (\w+)", done.stdout.splitlines()[-1])}
        return Run(done.returncode, counts, done.stdout + done.stderr)


ALL_KINDS = """
import threading
import unittest

import pytest

from rosbridge_sim.client import AsyncClient, Client, ConnectionLostError


@pytest.fixture(scope="session", autouse=True)
def nothing_is_left():
    yield
    names = [thread.name for thread in threading.enumerate() if thread.name.startswith("rosbridge_sim")]
    assert names == []


def test_blocking(rosbridge_client, rosbridge_simulator, rosbridge_url):
    assert rosbridge_client.url == rosbridge_url == rosbridge_simulator.url
    rosbridge_client.start_sync()
    frame = rosbridge_client.tick(3).frame
    assert rosbridge_simulator.run_inside(lambda: rosbridge_simulator.node.world.frame) == frame


async def test_async(rosbridge_url):
    async with AsyncClient(rosbridge_url) as client:
        await client.wait_for("/Ego_topic")


@pytest.mark.rosbridge_scenario("town")
@pytest.mark.rosbridge_seed(7)
@pytest.mark.rosbridge_options(start="sync", sync_frames="strict")
def test_markers(rosbridge_simulator, rosbridge_simulator_factory):
    settings = rosbridge_simulator.settings
    assert (settings.scenario, settings.seed, settings.start, settings.sync_frames) == ("town", 7, "sync", "strict")
    assert rosbridge_simulator_factory(seed=8).settings.seed == 8


def test_two_simulators_share_nothing(rosbridge_simulator_factory):
    first, second = rosbridge_simulator_factory(start="sync"), rosbridge_simulator_factory(start="sync")
    with Client(first.url) as one, Client(second.url) as other:
        one.start_sync()
        one.tick(5)
        assert other.start_sync() == 0


def test_server_that_dies(rosbridge_client, rosbridge_simulator):
    rosbridge_client.start_sync()
    rosbridge_simulator.close()
    with pytest.raises(ConnectionLostError, match="closed"):
        rosbridge_client.tick()


class TestUnit(unittest.TestCase):
    @pytest.fixture(autouse=True)
    def take_client(self, rosbridge_client):
        self.client = rosbridge_client

    def test_plain(self):
        self.assertTrue(self.client.wait_for("/Ego_topic"))
"""


@pytest.mark.parametrize("flags", [(), ("-n", "2")], ids=["alone", "xdist"])
def test_fixtures_serve_tests_of_all_kinds_and_leave_nothing(run_tests: RunTests, flags: tuple[str, ...]) -> None:
    run = run_tests(ALL_KINDS, "-W", "error::ResourceWarning", *flags)
    assert (run.code, run.counts.get("passed")) == (0, 6), run.out


FAILING = """
import unittest

import pytest


@pytest.mark.rosbridge_scenario("town")
@pytest.mark.rosbridge_seed(7)
@pytest.mark.rosbridge_options(start="sync", token="s3cret-token", max_clients=5)
@pytest.mark.parametrize("x", ["a b/한"])
def test_drive(rosbridge_client, x):
    rosbridge_client.start_sync()
    with rosbridge_client.subscribe("/Ego_topic"):
        rosbridge_client.tick(3)
    rosbridge_client.publish("/chatter", {"data": "\\x1b[2J" + 5_000 * "x"}, "std_msgs/String")
    rosbridge_client.confirm()
    raise AssertionError


def test_setup(rosbridge_simulator, no_such_fixture_value):
    pass


@pytest.fixture
def no_such_fixture_value(rosbridge_simulator):
    raise ValueError


class TestUnit(unittest.TestCase):
    @pytest.fixture(autouse=True)
    def take_client(self, rosbridge_client):
        self.client = rosbridge_client

    def test_plain(self):
        self.fail()


def test_closed(rosbridge_simulator):
    rosbridge_simulator.close()
    raise AssertionError


def test_good(rosbridge_simulator):
    pass


def test_without():
    raise AssertionError
"""


@pytest.mark.parametrize("flags", [(), ("-n", "1")], ids=["alone", "xdist"])
def test_failed_test_is_told_messages_picture_and_command(run_tests: RunTests, flags: tuple[str, ...]) -> None:
    run = run_tests(FAILING, *flags)
    assert run.counts | {"in": 0} == {"failed": 4, "passed": 1, "error": 1, "in": 0}, run.out
    sections = re.split(r"-+ rosbridge_sim -+\n", run.out)[1:]
    assert len(sections) == 4, run.out
    (drive,) = [section for section in sections if "scenario='town'" in section]
    assert "\n  /SyncModeInfo {" in drive
    assert re.search(r'\n  /Ego_topic \{"header":\{"seq":3,', drive)
    assert re.search(r"\n  /chatter \{.*\.\.\. \(5,\d+ bytes\)\n", drive)
    heard, _, unheard = drive.partition("topics without a subscriber, as they would be now:\n")
    assert "/Object_topic" in unheard
    assert "/Object_topic" not in heard
    assert "\n  rosbridge-sim serve --max-clients 5 --scenario town --start sync --seed 7\n" in drive
    assert "python -m pytest 'test_user.py::test_drive[" in drive
    assert "s3cret" not in drive.partition("python -m pytest")[0]  # pytest itself shows the lines of later tests
    assert "\x1b" not in drive
    (path,) = re.findall(r"picture of frame 3: (.*)\n", drive)
    with Image.open(path) as picture:
        assert picture.format == "PNG"
    assert "picture: none, because the simulator was closed" in "".join(sections)


def test_pytest_finds_the_plugin_by_an_entry_point() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    assert project["entry-points"]["pytest11"] == {"rosbridge_sim": PLUGINS[0]}
    assert not [one for one in project["dependencies"] if one.startswith("pytest")]


def test_pictures_go_where_the_run_wants_them(run_tests: RunTests) -> None:
    run = run_tests(FAILING, "--rosbridge-pictures", "kept/here", "-k", "TestUnit")
    assert run.counts["failed"] == 1
    (path,) = (run_tests.folder / "kept" / "here").iterdir()
    assert path.name == "test_user.py_TestUnit_test_plain-0.png"


def test_picture_that_cannot_be_written_leaves_the_rest_of_the_report(run_tests: RunTests) -> None:
    (run_tests.folder / "file").touch()
    run = run_tests(FAILING, "--rosbridge-pictures", "file", "-k", "TestUnit")
    assert run.counts["failed"] == 1
    assert "picture: none: " in run.out
    assert "rosbridge-sim serve --scenario demo --seed 0" in run.out


WRONG = """
import pytest


@pytest.mark.rosbridge_options(prot=0)
def test_name(rosbridge_simulator):
    pass


@pytest.mark.rosbridge_scenario("townn")
def test_scenario(rosbridge_simulator):
    pass


@pytest.mark.rosbridge_seed(1, 2)
def test_seed(rosbridge_simulator):
    pass


@pytest.mark.rosbridge_options("sync")
def test_positional(rosbridge_simulator):
    pass
"""


def test_wrong_marker_is_a_clear_error(run_tests: RunTests) -> None:
    run = run_tests(WRONG)
    assert run.counts["errors"] == 4, run.out
    assert "no such option: prot (did you mean port?)" in run.out
    assert "townn" in run.out
    assert "rosbridge_seed: expected one argument; got 2" in run.out
    assert 'rosbridge_options: expected keyword arguments, such as start="sync"' in run.out
    assert "pytest_plugin.py" not in run.out, "a frame of ours"
    assert "Traceback" not in run.out


def test_nothing_of_the_package_is_imported_before_a_fixture_is_used(run_tests: RunTests) -> None:
    run = run_tests(
        """
import sys

def test_nothing(pytestconfig):
    assert pytestconfig.pluginmanager.hasplugin("rosbridge_sim.pytest_plugin")
    ours = {name for name in sys.modules if name.partition(".")[0] == "rosbridge_sim"}
    assert ours == {"rosbridge_sim", "rosbridge_sim.version", "rosbridge_sim.pytest_plugin"}
    assert not {"numpy", "websockets", "pydantic", "msgspec", "orjson", "PIL"} & set(sys.modules)
""",
        is_fresh=True,
    )
    assert (run.code, run.counts.get("passed")) == (0, 1), run.out


def test_fault_of_the_simulator_fails_the_test_that_used_it(run_tests: RunTests) -> None:
    run = run_tests("""
import pytest
from rosbridge_sim.client import ServiceRefusedError

@pytest.mark.rosbridge_options(start="sync")
def test_world_that_fails(rosbridge_client, rosbridge_simulator):
    rosbridge_client.start_sync()
    rosbridge_simulator.run_inside(lambda: rosbridge_simulator.node.context.hooks.place.append(lambda: 1 // 0))
    with pytest.raises(ServiceRefusedError, match="the world has failed"):
        rosbridge_client.tick()
""")
    assert (run.counts.get("passed"), run.counts.get("error")) == (1, 1), run.out
    assert "internal errors of the simulator, with tracebacks in the log" in run.out


MOCKS = """
from pathlib import Path

import pytest

from rosbridge_sim.client import Client


def test_files_and_dicts_are_mocks_of_their_own(rosbridge_mock, tmp_path):
    content = {"services": {"/stop": {"type": "std_srvs/Trigger", "answers": [{"value": {"message": "one"}}]}}}
    file = tmp_path / "robot.yaml"
    file.write_text("services: {/stop: {type: std_srvs/Trigger, answers: [{value: {message: two}}]}}")
    mocks = [rosbridge_mock(one, token="word") for one in (content, file, str(file))]
    answers = []
    for mock in mocks:
        with Client(mock.url, token="word") as client:
            answers.append(client.call("/stop")["message"])
    assert answers == ["one", "two", "two"]
    mocks[0].fault("broken", {"kind": "fail", "text": "no"})
    with Client(mocks[0].url, token="word") as client, pytest.raises(Exception, match="no"):
        client.call("/stop")
    with Client(mocks[1].url, token="word") as client:
        assert client.call("/stop")["message"] == "two"


def test_mistake_in_a_fault_is_told(rosbridge_mock):
    mock = rosbridge_mock({"faults": {"slow": {"kind": "slow", "on": False}}})
    mock.fault("slow")
    with pytest.raises(ValueError, match="did you mean slow"):
        mock.fault("slwo")
    with pytest.raises(ValueError, match="kind"):
        mock.fault("new", {"kind": "nonsense"})


def test_mistake_in_the_content_fails(rosbridge_mock):
    rosbridge_mock({"topics": {"/a": {"tipe": "x"}}})


def test_missing_file_fails(rosbridge_mock):
    rosbridge_mock("nowhere.yaml")
"""


def test_mocks_run_until_the_end_of_a_test(run_tests: RunTests) -> None:
    run = run_tests(MOCKS, "-k", "not fails")
    assert (run.code, run.counts["passed"]) == (0, 2), run.out


def test_mistake_of_a_mock_is_the_reason_of_the_failure(run_tests: RunTests) -> None:
    run = run_tests(MOCKS, "-k", "fails")
    assert run.counts["failed"] == 2, run.out
    assert "mock0.yaml:1: topics./a.tipe: expected one of type, " in run.out
    assert "nowhere.yaml: cannot be read" in run.out
