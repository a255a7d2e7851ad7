"""The structures that loops get: the source in C and the arrays of numpy have the same types."""

from __future__ import annotations

from rosbridge_sim.world.kernels import c_source


def test_field_of_a_structure_has_one_type_in_all_tables() -> None:
    """A loop would read an array of the other type as numbers of its own."""
    for tables, kinds in ((c_source._TABLES, c_source.ARRAYS), (c_source._PAIR_TABLES, c_source.PAIR_ARRAYS)):
        assert all(kinds[name] == kind for table in tables for kind, names in table.items() for name in names.split())
