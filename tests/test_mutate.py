"""Mutants of a file: which there are, and that each is another program."""

from __future__ import annotations

import ast
import sys
from types import SimpleNamespace
from typing import Any, cast

import pytest

from scripts.mutate import FEW, TESTS, are_enough, files_of, known_survivors
from scripts.mutation.mutants import mutants_of, mutate
from scripts.mutation.warm_tests import PACKAGE, ROOT, Target, _SharedFixtures
from tests.cpu_time import run

SOURCE = """
WIDTH: float = 2.5
NEAR, FAR = 1, 2 << 16
NAMES = ["a", 7]

def keep(x: int = 0) -> int:
    '''Doc.'''
    assert x != 7, "no"
    if x >= 1 and not x > 5:
        raise ValueError(f"{x + 1}")
    return min(x, 300)
"""


def test_mutants_change_function_bodies_and_constant_numbers_of_the_module() -> None:
    changes = [mutant.change for mutant in mutants_of(SOURCE)]
    assert changes == [
        "2.5  ->  5.0",
        "1  ->  2",
        "2  ->  3",
        "16  ->  32",
        "x >= 1 and (not x > 5)  ->  not (x >= 1 and (not x > 5))",
        "x >= 1 and (not x > 5)  ->  False",
        "x >= 1 and (not x > 5)  ->  x >= 1 or not x > 5",
        "x >= 1 and (not x > 5)  ->  not x > 5",
        "x >= 1 and (not x > 5)  ->  x >= 1",
        "x >= 1  ->  x > 1",
        "1  ->  2",
        "not x > 5  ->  x > 5",
        "x > 5  ->  x >= 5",
        "5  ->  10",
        "raise ValueError(f'{x + 1}')  ->  pass",
        "return min(x, 300)  ->  return None",
        "min  ->  max",
        "300  ->  600",
    ]


def test_each_mutant_is_the_file_with_one_change() -> None:
    original = ast.unparse(ast.parse(SOURCE))
    programs = [ast.unparse(mutate(SOURCE, mutant)) for mutant in mutants_of(SOURCE)]
    assert len({original, *programs}) == len(programs) + 1
    for program in programs:
        compile(program, "x", "exec")
        changed = [pair for pair in zip(original.splitlines(), program.splitlines(), strict=True) if pair[0] != pair[1]]
        assert len(changed) == 1


def test_files_and_tests_of_the_mutation_table_exist() -> None:
    assert [room for room in TESTS if not (ROOT / PACKAGE / room).exists()] == []
    named = {test for tests in TESTS.values() for test in tests.split()}
    assert [test for test in named if not (ROOT / "tests" / test).exists()] == []


def is_small(room: str) -> bool:
    return room == "simulator/sync"


@pytest.mark.parametrize(
    "room", [pytest.param(room, marks=[] if is_small(room) else [pytest.mark.long]) for room in TESTS]
)
def test_files_of_a_room_have_mutants_that_compile(room: str) -> None:
    files = files_of(room)
    assert files
    for source in ((ROOT / PACKAGE / file).read_text() for file in files):
        compile(mutate(source, mutants_of(source)[-1]), room, "exec")


def test_only_a_changed_number_of_the_module_reaches_beyond_its_own_statement() -> None:
    target = Target("world/drivers/zip_merge.py")
    constant_lines = _constant_lines(target.source)
    for mutant in target.mutants:
        lines, names = target.reach(mutant)
        assert mutant.line in lines
        assert bool(names) == (min(lines) in constant_lines)


def test_each_line_of_a_mutant_that_lives_for_a_reason_stands_in_its_file() -> None:
    survivors = known_survivors()
    gone = {(file, line) for file, line, _ in survivors} - {
        (file, line.strip())
        for file in {file for file, _, _ in survivors}
        for line in (ROOT / PACKAGE / file).read_text().splitlines()
    }
    assert gone == set()
    assert all(len(reason) > 20 for reason in survivors.values())


def test_each_mutant_that_lives_for_a_reason_is_one_of_its_file() -> None:
    survivors = known_survivors()
    targets = [Target(file) for file in {file for file, _, _ in survivors}]
    changes = {(target.file, target.line_of(mutant), mutant.change) for target in targets for mutant in target.mutants}
    assert set(survivors) - changes == set()


def test_lines_of_a_fixture_of_a_module_count_for_each_test_that_uses_it() -> None:
    ran = {"a.py": {1}}
    shared = _SharedFixtures(ran)
    fixture: Any = object()
    first, second, other = (cast("Any", SimpleNamespace()) for _ in range(3))
    setup = shared.pytest_fixture_setup(fixture)
    next(setup)
    ran.setdefault("a.py", set()).add(7)
    ran.setdefault("b.py", set()).add(2)
    with pytest.raises(StopIteration):
        setup.send(None)
    assert ran == {"a.py": {1, 7}, "b.py": {2}}
    for item, used in ((first, {"town": fixture}), (second, {"town": fixture}), (other, {})):
        item._request = SimpleNamespace(_fixture_defs=used)
        ran.clear()
        ran["a.py"] = {3}
        shared.pytest_runtest_teardown(item)
        assert ran == ({"a.py": {3, 7}, "b.py": {2}} if used else {"a.py": {3}})


def test_share_below_the_least_one_is_a_failure_unless_few_were_tried() -> None:
    assert [are_enough(100, good, 80.0) for good in (79, 80, 100)] == [False, True, True]
    assert are_enough(FEW - 1, 0, 80.0)
    assert not are_enough(FEW, 0, 80.0)
    assert are_enough(FEW, 0, 0.0)


def _constant_lines(source: str) -> set[int]:
    return {node.lineno for node in ast.parse(source).body if isinstance(node, (ast.Assign, ast.AnnAssign))}


@pytest.mark.slow
def test_a_fault_that_a_test_notices_is_counted_and_one_that_it_does_not_is_printed() -> None:
    command = [sys.executable, str(ROOT / "scripts" / "mutate.py"), "graph/guard.py", "--killers"]
    command += ["--tests", "graph/test_guard.py", "--num", "20"]
    done = run(command)
    assert done.returncode == 0, done.stderr
    noticed = [line for line in done.stdout.splitlines() if line.startswith("noticed by tests/graph/test_guard.py::")]
    survivors = [line for line in done.stdout.splitlines() if "  (reached by" in line]
    assert any("self.num_faults += 1  ->  self.num_faults -= 1" in line for line in noticed)
    assert f"noticed {len(noticed)} of 20 tried" in done.stdout
    assert len(noticed) + len(survivors) == 20
