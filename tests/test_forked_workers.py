"""Tests in forks: what pytest tells of them is what it tells of tests in one process."""

from __future__ import annotations

import os
import subprocess
import textwrap
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast
from xml.etree import ElementTree as ET

import pytest

from tests import fork_server
from tests.forked_workers import APART, TOGETHER, ForkedWorkers
from tests.support import ROOT

pytestmark = pytest.mark.slow

CONFTEST = """
    import os
    from tests.forked_workers import ForkedWorkers

    def pytest_configure(config):
        config.pluginmanager.register(ForkedWorkers(2, 2))
        config.begun = os.pipe()
"""
"""The pipe is that of all forks: by it the first file waits for the second, so that each of them has a fork."""

TESTS = {
    "first": """
        import os, signal, warnings, pytest

        @pytest.fixture(scope="session", autouse=True)
        def whole_session(pytestconfig):
            os.read(pytestconfig.begun[0], 1)
            yield
            raise RuntimeError("at the end of all")

        @pytest.fixture(scope="module", params=["one", "two"])
        def part(request):
            print("begins", request.param)
            return os.getpid()

        def test_runs_in_a_fork(part):
            assert part == os.getpid() != int(os.environ["FIRST"])

        def test_fails(tmp_path):
            print("said before")
            (tmp_path / "kept").touch()
            warnings.warn("of this test", stacklevel=1)
            assert [1, 2] == [1, 3]
    """,
    "second": """
        import os, signal, pytest

        def test_is_skipped(pytestconfig):
            os.write(pytestconfig.begun[1], b"x")
            pytest.skip("for a reason")

        def test_dies():
            os.kill(os.getpid(), signal.SIGKILL)

        def test_comes_after_it():
            pass
    """,
}


def run(folder: Path, *flags: str) -> subprocess.CompletedProcess[str]:
    """Run the tests of a folder in two forks."""
    (folder / "conftest.py").write_text(textwrap.dedent(CONFTEST))
    for name, text in TESTS.items():
        file = folder / f"test_{name}.py"
        file.write_text(f"import os\nos.environ.setdefault('FIRST', str(os.getpid()))\n{textwrap.dedent(text)}")
    words = ["-m", "pytest", "-p", "no:cacheprovider", "-p", "no:rosbridge_sim", "--rootdir", folder, folder, *flags]
    return fork_server.run(words, env={**os.environ, "PYTHONPATH": str(ROOT)})


def test_reports_of_forks_are_those_of_the_tests(tmp_path: Path) -> None:
    done = run(tmp_path, "-rs", f"--junitxml={tmp_path / 'results.xml'}")
    assert done.returncode == 1
    for text in (
        "said before",
        "assert [1, 2] == [1, 3]",
        "UserWarning: of this test",
        "for a reason",
        "the process of the test ended with -9",
        "RuntimeError: at the end of all",
        "2 files that took longest",
        "2 failed, 3 passed, 1 skipped",
    ):
        assert text in done.stdout
    cases = ET.parse(tmp_path / "results.xml").getroot().iter("testcase")  # noqa: S314 - pytest's own file
    found = {(case.attrib["name"], *(part.tag for part in case if "system" not in part.tag)) for case in cases}
    assert found == {
        ("test_runs_in_a_fork[one]",),
        ("test_runs_in_a_fork[two]",),
        ("test_fails", "failure"),
        ("test_fails", "error"),  # of the fixture that ends behind it
        ("test_is_skipped", "skipped"),
        ("test_dies", "failure"),
        ("test_comes_after_it",),
    }


def test_first_failure_ends_the_run_and_what_it_started(tmp_path: Path) -> None:
    done = run(tmp_path, "-x", "-k", "dies or comes_after")
    assert "1 failed, 4 deselected" in done.stdout, done.stdout
    assert done.returncode == 1


def test_files_that_share_a_process_or_nothing_exist() -> None:
    assert [name for name in (*TOGETHER, *APART) if not (ROOT / name).is_file()] == []


@pytest.mark.parametrize(("num_workers", "takes_last"), [(1, [False]), (2, [False] * 2), (4, [False] * 3 + [True])])
def test_one_of_many_forks_begins_at_the_end(num_workers: int, takes_last: list[bool]) -> None:
    workers, found = ForkedWorkers(num_workers, 0), list[bool]()
    for i in range(num_workers):
        found.append(workers._lacks_last_taker())
        workers._workers[cast("Any", i)] = SimpleNamespace(takes_last=found[-1])  # type: ignore[assignment]
    assert found == takes_last
