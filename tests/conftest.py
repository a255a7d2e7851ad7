"""Fixtures of all tests: servers to talk to, and clients that are gone when the test is over."""

from __future__ import annotations

import gc
import os
import signal
import sys
from collections.abc import AsyncIterator, Awaitable, Callable, Generator, Iterator
from contextlib import AsyncExitStack, suppress
from importlib import import_module
from pathlib import Path
from typing import Any

import hypothesis
import pytest
import pytest_asyncio

from tests.deployment import Bridges, Place
from tests.long_tests import find_mistakes
from tests.long_tests import is_long as is_of_a_long_group
from tests.support import Client, ServerProcess, held_port, require_tool

__all__ = ["Connect", "Serve", "Simulate", "require_tool"]

# numpy drives all worlds, whatever is installed, but for tests with the fixture `loops` and those of `kernels`.
os.environ["ROSBRIDGE_SIM_CC"] = "none"

# How long an example takes is the machine's, not the code's. `--long` tries more of them.
_NO_TIMES: dict[str, Any] = {"deadline": None, "suppress_health_check": [hypothesis.HealthCheck.too_slow]}
hypothesis.settings.register_profile("ours", max_examples=10, **_NO_TIMES)
hypothesis.settings.register_profile("long", max_examples=200, **_NO_TIMES)
hypothesis.settings.load_profile("ours")


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add our options."""
    parser.addoption("--long", action="store_true", help="run what takes long, and more examples of hypothesis")
    parser.addoption("--processes", type=int, default=0, help="run files of tests in so many forks of this process")
    parser.addoption("--arrays", action="store_true", help="drive all worlds by arrays, as without a compiler")
    parser.addoption("--list-files", type=int, default=10, help="list so many files that took longest")


def pytest_configure(config: pytest.Config) -> None:
    """Choose how many examples hypothesis tries where a test does not say it, and where tests run."""
    if config.getoption("--long"):
        hypothesis.settings.load_profile("long")
    if processes := config.getoption("--processes"):
        from tests.forked_workers import ForkedWorkers  # noqa: PLC0415 - one process alone has no need of it

        config.pluginmanager.register(ForkedWorkers(processes, config.getoption("--list-files"), _prepare))


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """Search no garbage among the tests: there are millions of objects, and all of them stay to the end.

    Later it is searched more seldom than usual, which saves a fifteenth of the time of tests that start no program.
    """
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.set_threshold(20_000, 20, 50)
        gc.enable()


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Leave out the long tests; with `--long`, all but those and the ones of hypothesis."""
    if config.args_source == pytest.Config.ArgsSource.TESTPATHS and (mistakes := find_mistakes(map(_name, items))):
        raise pytest.UsageError("tests/long_tests.toml: " + "; ".join(mistakes))
    is_long = config.getoption("--long")
    chosen: list[pytest.Item] = []
    others: list[pytest.Item] = []
    for item in items:
        (chosen if is_in_run(item, is_long=is_long) else others).append(item)
    config.hook.pytest_deselected(items=others)
    items[:] = sorted(chosen, key=_turn_of)


def _prepare(session: pytest.Session) -> None:
    """Make what many tests need: compiled loops and, for many tests, maps and types."""
    if _may_have_loops(session.config) and any("loops" in getattr(item, "fixturenames", ()) for item in session.items):
        from rosbridge_sim.shell.kernels.compiler import NoKernelsError  # noqa: PLC0415 - most runs need none
        from tests.world.kernels.compiled_loops import compiler, library  # noqa: PLC0415 - likewise

        if compiler():
            with suppress(NoKernelsError):  # the tests will say it
                library()
    if len(session.items) > MANY_TESTS:
        import_module("tests.shared_worlds").prepare()


MANY_TESTS = 5_000
"""From so many on, nearly all forks have tests of worlds and simulators."""


LONGEST = (
    "page/test_panels.py",
    "end_to_end/test_soaks.py",
    "environments/test_driving_envs.py",
    "shell/test_attach.py",
    "end_to_end/test_manual_pages.py",
    "end_to_end/test_drawn_sensors.py",
    "test_packaging.py",
    "world/lane_changes/test_lane_changes.py",
    "world/followers/test_lane_following.py",
    "test_doc_examples.py",
    "shell/rendering/test_clear_lanes.py",
    "shell/bags/test_bag_recorder.py",
    "worlds/test_worlds.py",
    "end_to_end/test_bridges.py",
    "world/many_worlds/test_batch.py",
    "test_traffic_scripts.py",
    "simulator/sim_services/test_any_snapshot.py",
    "simulator/test_town_traffic.py",
    "world/drivers/test_right_of_way.py",
    "world/followers/test_told_in_bends.py",
    "shell/bags/test_any_file.py",
    "end_to_end/test_browser.py",
    "cli/test_command_line.py",
    "page/test_code.py",
    "campaign_runs/test_campaigns.py",
    "end_to_end/test_clients.py",
    "end_to_end/test_drive_sync.py",
)
"""Files in the order of their CPU time, from about 20 s to 5 s. Begun last, one of them would run alone at the end.

A file of `tests.forked_workers.TOGETHER` stands for all that run with it.
"""

LONGEST_LONG = (
    "world/many_worlds/test_batch.py",
    "end_to_end/test_sensor_programs.py",
    "simulator/test_town_traffic.py",
    "campaign_runs/test_same_table.py",
)
"""The same for the long tests, which take up to two minutes each."""

PROGRAMS = ("page", "end_to_end", "cli", "campaign_runs")
"""Folders whose tests start programs and wait for them. Their files come next, before many short ones."""


def _turn_of(item: pytest.Item) -> tuple[int, int]:
    """Place of a test's file in the run; files of the same place stay in their order."""
    file = _name(item).partition("::")[0]
    longest = LONGEST_LONG if item.config.getoption("--long") else LONGEST
    if file in longest:
        return 0, longest.index(file)
    return (1 if file.partition("/")[0] in PROGRAMS else 2), 0


def is_in_run(item: pytest.Item, *, is_long: bool) -> bool:
    """Whether a test is one of the long run, or of the ordinary one."""
    is_marked = item.get_closest_marker("long") is not None or is_of_a_long_group(_name(item))
    if not is_long:
        return not is_marked
    # Not by the mark `hypothesis`: its plugin sets it after our hook.
    return is_marked or (isinstance(item, pytest.Function) and hypothesis.is_hypothesis_test(item.obj))


def _name(item: pytest.Item) -> str:
    """A test as `file::test[PARAMETERS]` within this folder."""
    return item.nodeid.removeprefix("tests/")


Serve = Callable[..., ServerProcess]
"""`serve("--start", "sync")`: a server of the test's own."""

Simulate = Callable[..., Place]
"""`simulate("--start", "sync")`: a simulator of the test's own, in some place."""

Connect = Callable[..., Awaitable[Client]]
"""`await connect(url)`: a bare client that is closed at the end of the test."""


@pytest.fixture(autouse=True, scope="session")
def default_signals() -> Iterator[None]:
    """Give the programs started here the default action for signals that end them, whatever started the tests.

    nohup ignores SIGHUP, and a shell without job control ignores SIGINT for what it starts in the background. A signal
    that a program ignores is ignored by those that it starts; one that it handles is not.
    """
    names = [name for name in ("SIGHUP", "SIGINT") if hasattr(signal, name)]
    ignored = [number for name in names if signal.getsignal(number := getattr(signal, name)) is signal.SIG_IGN]
    for number in ignored:
        signal.signal(number, lambda *_: None)
    yield
    for number in ignored:
        signal.signal(number, signal.SIG_IGN)


@pytest.fixture(autouse=True, scope="session")
def shared_work() -> None:
    """Read the package's message types, scenarios and maps once for all simulators in the process of the tests."""
    if "rosbridge_sim.shell.app" in sys.modules:  # no test wants one otherwise, and its import takes half a second
        import_module("tests.kept_work").share_work()


def _may_have_loops(config: pytest.Config) -> bool:
    """Whether the fixture `loops` does something; `--long` drives by arrays what the quick run drives by loops."""
    return not (config.getoption("--arrays") or config.getoption("--long"))


@pytest.fixture(scope="module")
def loops(pytestconfig: pytest.Config) -> Iterator[None]:
    """Drive the worlds of a file by compiled loops if there is a compiler: a third of the time for vehicles.

    It is for tests of what is driven. Arrays give the same bits, which `world/kernels` tests on each map and from
    random states; tests that compare arrays with one vehicle after another, and known drives, have none of it.
    """
    from tests.world.kernels.compiled_loops import compiler, with_loops  # noqa: PLC0415 - most files need no world

    if not _may_have_loops(pytestconfig) or not compiler():
        yield
        return
    with with_loops():
        yield


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ServerProcess]:
    """One server for all tests of a file that leave it as they found it. Its world stands still."""
    yield from _one_server(tmp_path_factory, "--start", "sync")


@pytest.fixture(scope="module")
def moving_server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ServerProcess]:
    """The same with a world that moves, which costs time."""
    yield from _one_server(tmp_path_factory)


def _one_server(tmp_path_factory: pytest.TempPathFactory, *flags: str) -> Iterator[ServerProcess]:
    process = ServerProcess(tmp_path_factory.mktemp("server") / "log.txt", flags)
    yield process
    process.stop_cleanly()


@pytest.fixture
def serve(tmp_path: Path) -> Iterator[Serve]:
    """Starts servers with flags of the test's own; each must end cleanly."""
    processes: list[ServerProcess] = []

    def start(*flags: str, env: dict[str, str] | None = None) -> ServerProcess:
        process = ServerProcess(tmp_path / f"log-{len(processes)}.txt", flags, env)
        processes.append(process)
        return process

    yield start
    for process in processes:
        process.stop_cleanly()


@pytest.fixture
def kept_port() -> Iterator[int]:
    """A port for servers of a test that come and go; no other program gets it meanwhile."""
    with held_port() as port:
        yield port


@pytest.fixture(scope="session")
def bridges(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Bridges]:
    """Bridges that simulators dial, for all tests: each simulator takes with it what it brought."""
    kept = Bridges(tmp_path_factory.mktemp("bridges"))
    yield kept
    kept.stop_cleanly()


@pytest.fixture(scope="module", params=["serve", "attach"])
def simulator(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Place]:
    """One simulator for all tests of a file that leave it as they found it, in each place where clients find one."""
    folder = tmp_path_factory.mktemp(f"simulator-{request.param}")
    bridges = Bridges(folder)  # of its own: others come and go while it runs
    place = Place(request.param, folder / "log.txt", (), bridges)
    yield place
    place.simulator.stop_cleanly()
    bridges.stop_cleanly()


@pytest.fixture(params=["serve", "attach"])
def simulate(request: pytest.FixtureRequest, tmp_path: Path, bridges: Bridges) -> Iterator[Simulate]:
    """Starts simulators with flags of the test's own, in each place; a new one takes the place of the one before."""
    places: list[Place] = []

    def start(*flags: str) -> Place:
        if places:
            places[-1].simulator.stop_cleanly()
        places.append(Place(request.param, tmp_path / f"log-{len(places)}.txt", flags, bridges))
        return places[-1]

    yield start
    for place in places[-1:]:
        place.simulator.stop_cleanly()


@pytest_asyncio.fixture
async def connect() -> AsyncIterator[Connect]:
    """Connects bare clients."""
    async with AsyncExitStack() as stack:

        async def open_client(url: str, *, is_recording: bool = False) -> Client:
            return await stack.enter_async_context(await Client.open(url, is_recording=is_recording))

        yield open_client
