"""The structure of the loops: each of its arrays has one type."""

from __future__ import annotations

from typing import get_args

from rosbridge_sim.shell.kernels.compiler import _EXPORTED, read_source
from rosbridge_sim.world.kernels.c_source import _TABLES, ARRAYS
from rosbridge_sim.world.kernels.loop_fields import LoopName
from rosbridge_sim.world.state.entity_arrays import BOOLS, FLOATS, INTS


def test_array_that_several_loops_have_has_one_type() -> None:
    """A loop would read an array of the other type as numbers of its own."""
    every = {(name, kind) for table in _TABLES for kind, names in table.items() for name in names.split()}
    assert len(every) == len(ARRAYS)


def test_columns_of_the_world_come_first_as_in_its_blocks() -> None:
    assert list(ARRAYS)[: len(FLOATS) + len(INTS) + len(BOOLS)] == [*FLOATS, *INTS, *BOOLS]


def test_each_loop_of_the_source_has_a_name_and_each_name_a_loop() -> None:
    """The type checker knows the names alone."""
    assert sorted(get_args(LoopName)) == sorted(name for _, name, _ in _EXPORTED.findall(read_source()))
