"""The modules of the page: the tests of their pure parts; `scripts/lint_page` checks types and style."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.cpu_time import run as run_to_end
from tests.support import ROOT, require_tool

pytestmark = [pytest.mark.client, pytest.mark.slow]

TESTS = sorted((ROOT / "tests" / "page" / "js").glob("*.test.js"))


def run(*words: str) -> None:
    done = run_to_end(words, cwd=ROOT)
    assert done.returncode == 0, f"{done.stdout[-20_000:]}\n{done.stderr[-5_000:]}"


@pytest.mark.parametrize("path", TESTS, ids=lambda path: path.name)
def test_pure_parts_of_the_page_pass_their_tests(path: Path) -> None:
    require_tool("node")
    run("node", "--disable-warning=ExperimentalWarning", str(path))  # with --test it would start another Node


def test_page_sends_no_goals_of_actions() -> None:
    sources = "".join(path.read_text("utf-8") for path in (ROOT / "rosbridge_sim" / "page" / "js").rglob("*.js"))
    assert sorted(set(re.findall(r'\bop: "(\w+)"', sources))) == [
        *("advertise", "auth", "call_service", "publish", "subscribe", "unadvertise", "unsubscribe")
    ]
