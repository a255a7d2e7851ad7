"""The modules of the page: their types, their style and the tests of their pure parts."""

from __future__ import annotations

import subprocess
from functools import cache
from pathlib import Path

import pytest

from tests.support import PATIENCE, ROOT, miss, require_tool

pytestmark = [pytest.mark.client, pytest.mark.slow]

TESTS = sorted((ROOT / "tests" / "page" / "js").glob("*.test.js"))


def run(*words: str) -> None:
    done = subprocess.run(words, capture_output=True, text=True, timeout=12 * PATIENCE, check=False, cwd=ROOT)
    assert done.returncode == 0, f"{done.stdout[-20_000:]}\n{done.stderr[-5_000:]}"


@cache
def require_checkers() -> None:
    require_tool("node")
    if not (ROOT / "tests" / "page" / "node_modules" / "eslint" / "package.json").is_file():
        miss("needs the checkers of the page: npm ci --prefix tests/page (./scripts/test does it)")


@pytest.mark.parametrize("path", TESTS, ids=lambda path: path.name)
def test_pure_parts_of_the_page_pass_their_tests(path: Path) -> None:
    require_tool("node")
    run("node", "--disable-warning=ExperimentalWarning", "--test", str(path))


def test_types_and_style_of_the_page_have_no_mistake() -> None:
    require_checkers()
    run(str(ROOT / "scripts" / "lint_page"))
