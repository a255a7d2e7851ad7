"""Test files that belong to changed files."""

from __future__ import annotations

from pathlib import Path

import pytest

from scripts.tests_for import find_tests, imports_of

FILES = {
    "rosbridge_sim/low.py": "",
    "rosbridge_sim/high.py": "def f():\n    from rosbridge_sim.low import x",
    "rosbridge_sim/alone/__init__.py": "",
    "rosbridge_sim/alone/thing.py": "from . import other",
    "rosbridge_sim/alone/other.py": "",
    "tests/harness.py": "import rosbridge_sim.high",
    "tests/test_harness.py": "from tests import harness",
    "tests/test_low.py": "from rosbridge_sim import low",
    "tests/test_pages.py": "PAGE = 'guide.md'",
    "tests/alone/test_thing.py": "",
    "scripts/draw.py": "",
}


@pytest.fixture
def root(tmp_path: Path) -> Path:
    for name, text in FILES.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    return tmp_path


@pytest.mark.parametrize(
    ("changed", "wanted"),
    [
        ("rosbridge_sim/low.py", ["tests/test_harness.py", "tests/test_low.py"]),
        ("rosbridge_sim/high.py", ["tests/test_harness.py"]),
        ("rosbridge_sim/alone/thing.py", ["tests/alone/test_thing.py"]),
        ("tests/harness.py", ["tests/test_harness.py"]),
        ("tests/test_low.py", ["tests/test_low.py"]),
        ("docs/guide.md", ["tests/test_pages.py"]),
        ("scripts/draw.py", []),
    ],
)
def test_tests_that_reach_a_changed_file_belong_to_it(root: Path, changed: str, wanted: list[str]) -> None:
    assert [str(path.relative_to(root)) for path in find_tests([root / changed], root)] == wanted


def test_relative_imports_have_whole_names() -> None:
    assert "rosbridge_sim.alone.other" in imports_of("from . import other", "rosbridge_sim.alone.thing")
    assert "rosbridge_sim.low" in imports_of("from ..low import x", "rosbridge_sim.alone.thing")
