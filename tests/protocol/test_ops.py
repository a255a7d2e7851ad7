"""The table of ops is whole."""

from __future__ import annotations

import typing

import msgspec

from rosbridge_sim.protocol import json_decoding, ops


def test_every_op_is_in_the_table_under_its_tag() -> None:
    assert {op.__struct_config__.tag: op for op in typing.get_args(ops.Op)} == ops.OPS


def test_every_field_except_bodies_has_a_type() -> None:
    for op in ops.OPS.values():
        for field in msgspec.structs.fields(op):
            assert field.name in json_decoding._CLASSES or field.name in op.bodies, (op, field.name)


def test_ops_cannot_be_changed() -> None:
    assert all(op.__struct_config__.frozen for op in ops.OPS.values())
