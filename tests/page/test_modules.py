"""The modules of the page: the tests of their pure parts; `scripts/lint_page` checks types and style."""

from __future__ import annotations

import re

import pytest

from tests.cpu_time import run
from tests.support import ROOT, require_tool

pytestmark = [pytest.mark.client, pytest.mark.slow]

TESTS = sorted((ROOT / "tests" / "page" / "js").glob("*.test.js"))


def test_pure_parts_of_the_page_pass_their_tests() -> None:
    """All files in one Node, whose start takes as long as five of them; with `--test` it would start one for each."""
    words = [require_tool("node"), "--disable-warning=ExperimentalWarning", "--input-type=module", "--eval"]
    done = run([*words, "for (const file of process.argv.slice(1)) await import(file)", *map(str, TESTS)], cwd=ROOT)
    assert done.returncode == 0, f"{done.stdout[-20_000:]}\n{done.stderr[-5_000:]}"
    assert int(done.stdout.rpartition("# pass ")[2].split()[0]) > 100


def test_page_sends_no_goals_of_actions() -> None:
    sources = "".join(path.read_text("utf-8") for path in (ROOT / "rosbridge_sim" / "page" / "js").rglob("*.js"))
    assert sorted(set(re.findall(r'\bop: "(\w+)"', sources))) == [
        *("advertise", "auth", "call_service", "publish", "subscribe", "unadvertise", "unsubscribe")
    ]
