"""Types as rosapi describes them."""

from __future__ import annotations

from rosbridge_sim.schema.store import Store
from rosbridge_sim.schema.typedefs import TypeDef, typedefs

TEXTS = {
    ("a_msgs", "msg", "Root"): (
        "int32 BIG=7\nstring WORD=hi there # kept\nHeader header\nInner[] inners\nInner one\nint8[3] three\n"
        "bool yes\nstring name\ntime when\nfloat64 x\n"
    ),
    ("a_msgs", "msg", "Inner"): "geometry_msgs/Point at\nuint8[] data\n",
}


def test_root_first_then_each_type_once_depth_first() -> None:
    described = typedefs(Store(TEXTS).message("a_msgs/Root").shape)
    names = ["a_msgs/Root", "std_msgs/Header", "time", "a_msgs/Inner", "geometry_msgs/Point"]
    assert [d.type for d in described] == names


def test_fields_lengths_examples_and_constants() -> None:
    root = typedefs(Store(TEXTS).message("a_msgs/Root").shape)[0]
    assert root == TypeDef(
        type="a_msgs/Root",
        fieldnames=["header", "inners", "one", "three", "yes", "name", "when", "x"],
        fieldtypes=["std_msgs/Header", "a_msgs/Inner", "a_msgs/Inner", "int8", "bool", "string", "time", "float64"],
        fieldarraylen=[-1, 0, -1, 3, -1, -1, -1, -1],
        examples=["{}", "[]", "{}", "[]", "False", "", "{}", "0.0"],
        constnames=["BIG", "WORD"],
        constvalues=["7", "hi there # kept"],
    )
