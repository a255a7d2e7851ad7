"""Types as rosapi describes them."""

from __future__ import annotations

import pytest
from hypothesis import given

from rosbridge_sim.schema.definitions.names import Generation
from rosbridge_sim.schema.definitions.parse import parse_message
from rosbridge_sim.schema.definitions.typedefs import TypeDef, full_text, typedefs
from rosbridge_sim.schema.message_type import MessageType
from rosbridge_sim.schema.store import Store
from tests.schema.strategies import every_type, shared_store
from tests.schema.type_factory import make

TEXTS = {
    ("a_msgs", "msg", "Root"): (
        "int32 BIG=7\nstring WORD=hi there # kept\nHeader header\nInner[] inners\nInner one\nint8[3] three\n"
        "bool yes\nstring name\ntime when\nfloat64 x\n"
    ),
    ("a_msgs", "msg", "Inner"): "geometry_msgs/Point at\nuint8[] data\n",
}


def test_typedefs_list_the_root_first_and_each_type_once_depth_first() -> None:
    described = typedefs(Store(TEXTS).message("a_msgs/Root").spec)
    names = ["a_msgs/Root", "std_msgs/Header", "time", "a_msgs/Inner", "geometry_msgs/Point"]
    assert [d.type for d in described] == names


def test_typedefs_have_fields_lengths_examples_and_constants() -> None:
    root = typedefs(Store(TEXTS).message("a_msgs/Root").spec)[0]
    assert root == TypeDef(
        type="a_msgs/Root",
        fieldnames=["header", "inners", "one", "three", "yes", "name", "when", "x"],
        fieldtypes=["std_msgs/Header", "a_msgs/Inner", "a_msgs/Inner", "int8", "bool", "string", "time", "float64"],
        fieldarraylen=[-1, 0, -1, 3, -1, -1, -1, -1],
        examples=["{}", "[]", "{}", "[]", "False", "", "{}", "0.0"],
        constnames=["BIG", "WORD"],
        constvalues=["7", "hi there # kept"],
    )


def test_typedefs_spell_times_as_in_the_ros_version() -> None:
    text = "time a\nduration[] b\nstring<=5 c\nint8[<=3] d\nfloat32 e 0.5"
    first, *others = typedefs(make(text).spec)
    assert (first.fieldtypes, first.fieldarraylen) == (
        ["time", "duration", "string", "int8", "float32"],
        [-1, 0, -1, 0, -1],
    )
    assert first.examples == ["{}", "[]", "", "[]", "0.5"]
    assert [(d.type, d.fieldnames, d.fieldtypes) for d in others] == [
        ("time", ["secs", "nsecs"], ["uint32", "uint32"]),
        ("duration", ["secs", "nsecs"], ["int32", "int32"]),
    ]
    first, *others = typedefs(make(text, ros=2).spec)
    assert first.fieldtypes[:2] == ["builtin_interfaces/Time", "builtin_interfaces/Duration"]
    assert [(d.type, d.fieldnames, d.fieldtypes) for d in others] == [
        ("builtin_interfaces/Time", ["sec", "nanosec"], ["int32", "uint32"]),
        ("builtin_interfaces/Duration", ["sec", "nanosec"], ["int32", "uint32"]),
    ]


def test_parts_of_services_and_actions_are_types_too() -> None:
    store = shared_store()
    topics = typedefs(store.service("rosapi/Topics").response.spec)
    assert [(d.type, d.fieldnames) for d in topics] == [("rosapi/TopicsResponse", ["topics", "types"])]
    goal = typedefs(store.action("tf2_msgs/LookupTransform").goal.spec)
    assert [d.type for d in goal] == ["tf2_msgs/LookupTransformGoal", "time", "duration"]


@given(every_type())
def test_typedef_lists_have_equal_lengths_and_no_duplicates(message_type: MessageType) -> None:
    described = typedefs(message_type.spec)
    names = [d.type for d in described]
    assert (names[0], len(set(names))) == (message_type.name, len(names))
    for d in described:
        assert len({len(d.fieldnames), len(d.fieldtypes), len(d.fieldarraylen), len(d.examples)}) == 1
        assert len(d.constnames) == len(d.constvalues)
        assert all("/" not in kind or kind in names for kind in d.fieldtypes)
        assert not any(name.startswith("_") for name in d.fieldnames)


# Texts

BORDER = "=" * 80


def test_nested_types_are_listed_once_by_full_name() -> None:
    texts = {
        ("p", "msg", "T"): "# Other x\nOther[] x  # an Other\nHeader  h\nint32 K=1 # Other\n"
        "geometry_msgs/msg/Point p\n\tOther y",
        ("p", "msg", "Other"): "geometry_msgs/Point at",
        ("std_msgs", "msg", "Header"): "time stamp",
        ("geometry_msgs", "msg", "Point"): "float64 x\n",
    }
    nested = f"{BORDER}\nMSG: p/Other\ngeometry_msgs/Point at\n{BORDER}\nMSG: geometry_msgs/Point\nfloat64 x\n{BORDER}"
    assert full_text(Store(texts).message("p/T").spec) == (
        "# Other x\np/Other[] x  # an Other\nstd_msgs/Header  h\nint32 K=1  # Other\n"
        f"geometry_msgs/Point p\n\tp/Other y\n{nested}\nMSG: std_msgs/Header\ntime stamp"
    )


@pytest.mark.parametrize(
    ("line", "in_ros_1", "in_ros_2"),
    [
        ("time t # when", "time t # when", "builtin_interfaces/Time t # when"),
        ("duration[<=3] t", "duration[] t", "builtin_interfaces/Duration[<=3] t"),
        ("string<=5[<=2] s", "string[] s", "string<=5[<=2] s"),
        ("string<=5[2] s", "string[2] s", "string<=5[2] s"),
        ("wstring w", "string w", "wstring w"),
        ("int32 x 3 # three", "int32 x  # three", "int32 x 3  # three"),
        ("bool x True", "bool x", "bool x true"),
        ("float64 x nan", "float64 x", "float64 x"),
        ("int8[] x [1, -2]", "int8[] x", "int8[] x [1, -2]"),
        ("int8[] x []", "int8[] x", "int8[] x"),
        ("string x 'a # b' # c", "string x", 'string x "a # b"'),
        ("string[] x ['a', '#']", "string[] x", "string[] x"),
        ("int32 longlCmdType", "int32 longlCmdType", "int32 longl_cmd_type"),
        ("int32 longlCmdType  # why", "int32 longlCmdType  # why", "int32 longl_cmd_type  # why"),
        ("uint8 X=0x1F # hex", "uint8 X=31  # hex", "uint8 X=31  # hex"),
        ("int32 kOdd=1", "int32 kOdd=1", "int32 K_ODD=1"),
        ("string K=a # b", "string K=a # b", 'string K="a"'),
        ("wstring K='it\"s'", "string K='it\"s'", 'wstring K="it\\"s"'),
        ("bool K=True # yes", "bool K=True  # yes", "bool K=true  # yes"),
        ("float32 K=inf", "# float32 K=inf", "# float32 K=inf"),
        ("float32 K=1e3", "float32 K=1e3", "float32 K=1000.0"),
    ],
)
def test_definition_lines_follow_the_ros_version(line: str, in_ros_1: str, in_ros_2: str) -> None:
    for ros, expected in ((1, in_ros_1), (2, in_ros_2)):
        shown = full_text(make(f"{line}\nint8 last", ros=2 if ros == 2 else 1).spec)
        assert shown.split(BORDER)[0].strip() == f"{expected}\nint8 last"


@given(every_type())
def test_every_text_can_be_parsed_again(message_type: MessageType) -> None:
    ros: Generation = message_type.spec.dialect.ros
    root, *parts = full_text(message_type.spec).split(f"{BORDER}\n")
    named = dict([part.removeprefix("MSG: ").split("\n", 1) for part in parts]) | {message_type.name: root}
    for name, text in named.items():
        definition = parse_message(name, text, ros=ros)
        assert all("/" not in f.type or f.type in named for f in definition.fields)
        if name == message_type.name:
            types = [(f.type.replace("wstring", "string"), f.array and not f.is_bounded) for f in definition.fields]
            own = message_type.definition.fields
            assert types == [(f.type.replace("wstring", "string"), f.array and not f.is_bounded) for f in own]
