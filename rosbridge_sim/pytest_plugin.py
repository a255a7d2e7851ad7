"""The pytest plugin: simulators, mocks and clients as fixtures, and a report on them when a test fails.

pytest loads it by the entry point `rosbridge_sim`. The rest of the package is imported when a fixture is used, so a
test run without a simulator is not slower. `docs/testing.md` explains fixtures, markers and the report.
"""

from __future__ import annotations

import json
import re
from collections.abc import Generator, Iterator, Mapping
from contextlib import ExitStack
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Protocol, Unpack

import pytest

if TYPE_CHECKING:
    from rosbridge_sim import Simulator, SimulatorOptions
    from rosbridge_sim.client import Client
    from rosbridge_sim.shell.failure_report import FailureReport

__all__ = ["MockFactory", "RosbridgeMock", "SimulatorFactory"]

SECTION = "rosbridge_sim"
"""Title of the section in the report on a failed test."""

_REPORTS: pytest.StashKey[list[FailureReport]] = pytest.StashKey()
_FOLDER: pytest.StashKey[Path] = pytest.StashKey()

_MARKERS = (
    "rosbridge_scenario(name): scenario of the simulators that the test's fixtures start: a name or a file",
    "rosbridge_seed(n): random seed of these simulators",
    "rosbridge_options(**options): further keyword arguments of rosbridge_sim.Simulator for these simulators",
)


class SimulatorFactory(Protocol):
    """The value of the fixture `rosbridge_simulator_factory`."""

    def __call__(self, **options: Unpack[SimulatorOptions]) -> Simulator:
        """Start a simulator that runs until the end of the test.

        Args:
            options: as for `rosbridge_sim.Simulator`; they have priority over markers. By default, the port is a free
                one, and the data folder is in the test's `tmp_path`.

        Returns:
            The running simulator.
        """


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the option with the folder for pictures."""
    parser.getgroup("rosbridge_sim").addoption(
        "--rosbridge-pictures",
        metavar="DIR",
        help="folder for pictures of failed tests' scenes, such as one that CI keeps [tmp_path of the test]",
    )


def pytest_configure(config: pytest.Config) -> None:
    """Register the markers."""
    for line in _MARKERS:
        config.addinivalue_line("markers", line)


@pytest.fixture
def rosbridge_simulator_factory(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[SimulatorFactory]:
    """Return a function that starts simulators, each in its own thread; they are closed at the end of the test.

    Args:
        tmp_path: the test's temporary folder.
    """
    from rosbridge_sim import DocumentError, Simulator  # noqa: PLC0415 - a run without simulators does not need it
    from rosbridge_sim.shell.failure_report import FailureReport  # noqa: PLC0415 - the same

    item = request.node
    item.stash[_FOLDER] = tmp_path
    simulators: list[Simulator] = []
    ending = ExitStack()  # closes each, even if closing another one fails
    reports = item.stash.setdefault(_REPORTS, [])

    def start(**options: Unpack[SimulatorOptions]) -> Simulator:
        given: SimulatorOptions = {"port": 0, "data_dir": tmp_path / "SaveFile"}
        given.update(_options_of(item))
        given.update(options)
        try:
            simulator = Simulator(**given).open()
        except DocumentError as error:
            if options:  # the test's own line is part of the message
                raise
            pytest.fail(f"{item.nodeid}: {error}", pytrace=False)
        ending.callback(simulator.close)
        simulators.append(simulator)
        reports.append(FailureReport(simulator))
        return simulator

    with ending:
        yield start
    reports.clear()
    failures = ", ".join(repr(simulator) for simulator in simulators if simulator.num_bugs)
    assert not failures, f"internal errors of the simulator, with tracebacks in the log: {failures}"


@pytest.fixture
def rosbridge_simulator(rosbridge_simulator_factory: SimulatorFactory) -> Simulator:
    """Return a simulator for the test, with the scenario, seed and options of the test's markers."""
    return rosbridge_simulator_factory()


@pytest.fixture
def rosbridge_url(rosbridge_simulator: Simulator) -> str:
    """Return the URL of the fixture `rosbridge_simulator`."""
    return rosbridge_simulator.url


@pytest.fixture
def rosbridge_client(rosbridge_simulator: Simulator) -> Iterator[Client]:
    """Return a blocking client that is connected to the fixture `rosbridge_simulator`."""
    from rosbridge_sim.client import Client  # noqa: PLC0415 - as above

    with Client(rosbridge_simulator.url, token=rosbridge_simulator.settings.token) as client:
        yield client


class RosbridgeMock:
    """A mock of a robot that runs until the end of the test.

    Attributes:
        simulator: its server.
        url: URL for the clients that are tested.
    """

    def __init__(self, simulator: Simulator) -> None:
        """Know its server, which has a control port."""
        self.simulator = simulator
        self.url = simulator.url

    def fault(self, name: str, rule: Mapping[str, object] | None = None, *, is_on: bool = True) -> None:
        """Switch a fault, or add one, by the control port, which no fault touches.

        Args:
            name: of a fault of the mock's file, or of a new one.
            rule: of a new fault, as in a mock's file: `{"kind": "drop", "topics": ["/scan"]}`.
            is_on: switch it on, or off.

        Raises:
            ValueError: there is no such fault, or the rule has a mistake.
        """
        from rosbridge_sim.client import Client  # noqa: PLC0415 - a run without simulators does not need it

        mock = self.simulator.mock
        assert mock is not None, "it was started as a mock"
        assert mock.control is not None, "with a control port"
        with Client(f"ws://127.0.0.1:{mock.control.port}", token=self.simulator.settings.token) as client:
            request = {"name": name, "active": is_on, "rule": "" if rule is None else json.dumps(rule)}
            answer = client.call("/mock/set_fault", request)
        if not answer["success"]:
            raise ValueError(answer["message"])


class MockFactory(Protocol):
    """The value of the fixture `rosbridge_mock`."""

    def __call__(
        self, content: str | Path | Mapping[str, object], **options: Unpack[SimulatorOptions]
    ) -> RosbridgeMock:
        """Start a mock that runs until the end of the test.

        Args:
            content: the mock's file, or its content: `{"topics": {"/x": {"type": "std_msgs/Bool", "rate": 5}}}`.
            options: as for `rosbridge_sim.Simulator`, without a world.

        Returns:
            The running mock.
        """


@pytest.fixture
def rosbridge_mock(rosbridge_simulator_factory: SimulatorFactory, tmp_path: Path) -> MockFactory:
    """Return a function that starts mocks of robots.

    Args:
        tmp_path: the test's temporary folder; a mock without a file has one there.
    """
    numbers = count()

    def start(content: str | Path | Mapping[str, object], **options: Unpack[SimulatorOptions]) -> RosbridgeMock:
        if isinstance(content, Mapping):
            file = tmp_path / f"mock{next(numbers)}.yaml"
            file.write_text(json.dumps(content), encoding="utf-8")
        else:
            file = Path(content)
        given: SimulatorOptions = {"mock": str(file), "control_port": 0}
        given.update(options)
        return RosbridgeMock(rosbridge_simulator_factory(**given))

    return start


def _options_of(item: pytest.Item) -> SimulatorOptions:
    """Return the options in a test's markers; the nearest marker has priority.

    Raises:
        pytest.fail.Exception: a marker has wrong arguments; pytest shows the sentence alone.
    """
    options: SimulatorOptions = {}
    for marker in reversed(list(item.iter_markers("rosbridge_options"))):
        if marker.args:
            text = f'{item.nodeid}: rosbridge_options: expected keyword arguments, such as start="sync"'
            pytest.fail(text, pytrace=False)
        # `Simulator` checks the values, and its error names the option.
        options.update(marker.kwargs)  # type: ignore[typeddict-item]
    scenario, seed = _argument_of(item, "rosbridge_scenario"), _argument_of(item, "rosbridge_seed")
    if scenario is not None:
        options["scenario"] = scenario  # type: ignore[typeddict-item]
    if seed is not None:
        options["seed"] = seed  # type: ignore[typeddict-item]
    return options


def _argument_of(item: pytest.Item, name: str) -> object:
    """Return the argument of a test's nearest marker with that name; None without such a marker."""
    marker = item.get_closest_marker(name)
    if marker is None:
        return None
    values = [*marker.args, *marker.kwargs.values()]
    if len(values) != 1:
        pytest.fail(f"{item.nodeid}: {name}: expected one argument; got {len(values)}", pytrace=False)
    return values[0]


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(
    item: pytest.Item, call: pytest.CallInfo[None]
) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Add a section for each simulator of a failed test, while it still runs."""
    del call
    report = yield
    if report.failed and _REPORTS in item.stash:
        reports = item.stash[_REPORTS]
        for i, one in enumerate(reports):
            try:
                text = one.text(_picture_of(item, i), item.nodeid)
            except Exception as error:  # noqa: BLE001 - an error here must not hide the failure of the test
                text = f"no report: {error!r}"
            report.sections.append((SECTION, text))
    return report


def _picture_of(item: pytest.Item, number: int) -> Path:
    """Return the path for the picture of one of a test's simulators."""
    folder = item.config.getoption("--rosbridge-pictures") or item.stash[_FOLDER]
    name = re.sub(r"[^\w.-]+", "_", item.nodeid)[-MAX_NAME:].strip("_")
    return Path(folder).absolute() / f"{name}-{number}.png"


MAX_NAME = 150
"""Longest name of a picture's file [characters]: file systems allow 255 bytes."""
