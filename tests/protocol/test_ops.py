"""The table of ops is whole."""

from __future__ import annotations

import typing

import msgspec

from rosbridge_sim.protocol import json_decoding, ops


def test_every_op_is_in_the_table_under_its_tag() -> None:
    assert {op.__struct_config__.tag: op for op in typing.get_args(ops.Op)} == ops.OPS


def test_fields_have_the_classes_of_their_types() -> None:
    classes = json_decoding._CLASSES
    assert classes["subscribe", "topic"] == (str,)
    assert classes["subscribe", "id"] == (str, int, float, bool)
    assert classes["subscribe", "throttle_rate"] == classes["fragment", "num"] == (int, float)
    assert classes["subscribe", "qos"] == (dict,)
    assert classes["fragment", "id"] == (str, int, float)
    assert classes["action_result", "id"] == (str,)
    assert classes["action_result", "status"] == (int,)
    assert classes["action_result", "result"] == (bool,)
    bodies = {(name, body) for name, op in ops.OPS.items() for body in op.bodies}
    fields = {(name, field.name) for name, op in ops.OPS.items() for field in msgspec.structs.fields(op)}
    assert classes.keys() == fields - bodies


def test_ops_cannot_be_changed() -> None:
    assert all(op.__struct_config__.frozen for op in ops.OPS.values())
