"""No modules of the shell import each other in a circle, those imports counted that run late or never.

An import within a function, or for the type checker alone, breaks a circle at run time and leaves it in the design.
"""

from __future__ import annotations

import ast
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

from tests.support import ROOT


def imports_of(path: Path, modules: set[str]) -> set[str]:
    """The modules of the tree that a source names in any of its import statements."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            found |= {f"{node.module}.{alias.name}" for alias in node.names} | {node.module}
    return found & modules


def check(root: Path, package: str) -> None:
    """Raise CycleError where modules below `root / package` import each other in a circle."""
    sources = {}
    for path in (root / package).rglob("*.py"):
        if path.name != "__init__.py":
            sources[".".join(path.relative_to(root).with_suffix("").parts)] = path
    TopologicalSorter({name: imports_of(path, set(sources)) for name, path in sources.items()}).prepare()


@pytest.mark.slow  # some sixty files are parsed
def test_shell_and_command_line_have_no_circle() -> None:
    check(ROOT, "rosbridge_sim/shell")
    check(ROOT, "rosbridge_sim/cli")


@pytest.mark.parametrize(
    "late",
    [
        "def f():\n    from house.a import A",
        "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from house.a import A",
        "import house.a",
        "from house import a",
    ],
)
def test_circle_is_found_however_it_is_imported(tmp_path: Path, late: str) -> None:
    (tmp_path / "house").mkdir()
    (tmp_path / "house" / "a.py").write_text("from house.b import B")
    (tmp_path / "house" / "b.py").write_text(late)
    with pytest.raises(CycleError):
        check(tmp_path, "house")
