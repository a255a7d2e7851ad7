"""Mutants of a file: which there are, and that each is another program."""

from __future__ import annotations

import ast

import pytest

from scripts.mutate import PACKAGE, ROOT, TESTS, mutants_of, mutate

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


@pytest.mark.parametrize("file", TESTS)
def test_files_and_tests_of_the_mutation_table_exist(file: str) -> None:
    source = (ROOT / PACKAGE / file).read_text()
    found = mutants_of(source)
    assert len(found) > 10
    compile(mutate(source, found[-1]), file, "exec")
    assert [test for tests in TESTS[file] for test in tests.split() if not (ROOT / "tests" / test).exists()] == []
