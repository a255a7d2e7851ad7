#!/usr/bin/env python3
"""Print the test files that belong to changed files, one a line: `./scripts/test --for FILE...` runs them.

To a module belong the test files whose imports reach it, however many modules lie between, and `test_NAME.py` in the
folder of `tests/` that mirrors its own. To a file that is no module belong the test files that contain its name.
A module that is only started, in a server's process, is not imported: tests of servers run with all tests.
"""

from __future__ import annotations

import ast
import sys
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
SOURCES = ("rosbridge_sim", "tests", "scripts")


def find_tests(changed: Iterable[Path], root: Path) -> list[Path]:
    """The test files below `root` that belong to changed files, sorted; both are absolute paths."""
    modules = _modules(root)
    arrows = {path: imports_of(path.read_text(), name) for name, path in modules.items()}
    importers: dict[Path, list[Path]] = {}
    for path, names in arrows.items():
        for name in names & modules.keys():
            importers.setdefault(modules[name], []).append(path)
    found: set[Path] = set()
    for file in changed:
        if file.suffix == ".py":
            found |= _reached(file, importers) | _mirrors(file, modules)
        else:
            found |= {path for path in modules.values() if file.name in path.read_text()}
    return sorted(path for path in found if path.name.startswith("test_"))


def imports_of(source: str, module: str) -> set[str]:
    """Names of modules that a module's source imports, wherever it does so, and names that may be modules."""
    names: set[str] = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            base = ".".join([*module.split(".")[: -node.level], *filter(None, [node.module])])
            base = base if node.level else node.module or ""
            names |= {base, *(f"{base}.{alias.name}" for alias in node.names)}
    return names


def _modules(root: Path) -> dict[str, Path]:
    """Each module of the repository by its name."""
    found = {}
    for path in sorted(path for top in SOURCES for path in (root / top).rglob("*.py")):
        if "node_modules" not in path.parts:
            parts = path.relative_to(root).with_suffix("").parts
            found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


def _reached(file: Path, importers: Mapping[Path, Sequence[Path]]) -> set[Path]:
    """A module and all that import it, directly or not."""
    reached, waiting = {file}, [file]
    while waiting:
        for path in importers.get(waiting.pop(), ()):
            if path not in reached:
                reached.add(path)
                waiting.append(path)
    return reached


def _mirrors(file: Path, modules: Mapping[str, Path]) -> set[Path]:
    """The test file of the same name, in a folder of the same name."""
    return {
        path for path in modules.values() if (path.name, path.parent.name) == (f"test_{file.name}", file.parent.name)
    }


def _main(words: Sequence[str]) -> int:
    files = [Path(word).resolve() for word in words]
    for file in files:
        if not file.is_relative_to(ROOT):
            print(f"{file}: expected a file below {ROOT}", file=sys.stderr)
            return 2
    found = find_tests(files, ROOT)
    if not found:
        print(f"no test file belongs to {' '.join(words) or 'no file'}; ./scripts/test runs all", file=sys.stderr)
        return 2
    for path in found:
        print(path.relative_to(ROOT))
    return 0


if __name__ == "__main__":
    sys.exit(_main(sys.argv[1:]))
