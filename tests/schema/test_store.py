"""Types by name: spellings, unknown names, standard packages from rosbags, texts for rosapi."""

from __future__ import annotations

import subprocess
import sys

import pytest

from rosbridge_sim.errors import FieldError, TypeNameError, UnknownPackageError
from rosbridge_sim.schema.definitions.dialect import Leniency, Time, Time2
from rosbridge_sim.schema.message_type import LateMessageType, MessageType
from rosbridge_sim.schema.store import Store
from tests.schema.strategies import SCHEMAS, shared_store

HEADER = "uint32 seq\ntime stamp\nstring frame_id\n"


def store_of(**texts: str) -> Store:
    """A store of messages of package `p`, and of the service `p/S`."""
    return Store({**{("p", "msg", name): text for name, text in texts.items()}, ("p", "srv", "S"): "T a\n---\nint8 b"})


@pytest.mark.parametrize("name", ["morai_msgs/CtrlCmd", "morai_msgs/msg/CtrlCmd"])
def test_both_spellings_of_a_message_are_one_type(name: str) -> None:
    store = shared_store()
    assert store.canonical(name) == "morai_msgs/CtrlCmd"
    assert store.message(name) is store.message(name) is store.message("morai_msgs/CtrlCmd")
    assert store.message(name).name == "morai_msgs/CtrlCmd"


@pytest.mark.parametrize("name", ["std_srvs/SetBool", "std_srvs/srv/SetBool"])
def test_both_spellings_of_a_service_are_one_type(name: str) -> None:
    service = shared_store().service(name)
    assert service is shared_store().service("std_srvs/SetBool")
    assert (service.name, service.request.name, service.response.name) == (
        "std_srvs/SetBool",
        "std_srvs/SetBoolRequest",
        "std_srvs/SetBoolResponse",
    )


@pytest.mark.parametrize(
    "name",
    [
        "",
        "x",
        "/",
        "a/",
        "/a",
        "a/b/c",
        "a/msg/b/c",
        "a b/c",
        "a/b ",
        "a/b\n",
        "1a/b",
        "ä/b",
        "\ud800/b",
        "p/T[]",
    ],
)
def test_a_malformed_name_is_refused(name: str) -> None:
    store = store_of(T="int32 x")
    for ask in (store.canonical, store.message, store.service, store.full_text):
        with pytest.raises(TypeNameError) as caught:
            ask(name)
        assert not isinstance(caught.value, UnknownPackageError)
        assert " is not a valid type string" in str(caught.value)
        assert str(caught.value).encode()


def test_unknown_package_and_unknown_type_have_different_errors() -> None:
    store = shared_store()
    with pytest.raises(
        UnknownPackageError, match=r"^Unable to import foo_msgs\.msg from package foo_msgs\. Caused by: "
    ):
        store.message("foo_msgs/Bar")
    with pytest.raises(
        UnknownPackageError, match=r"^Unable to import foo_msgs\.srv from package foo_msgs\. Caused by: "
    ):
        store.service("foo_msgs/srv/Bar")
    for name in ("morai_msgs/Nothing", "std_msgs/Nothing", "nav_msgs/Nothing", "std_srvs/SetBool"):
        with pytest.raises(TypeNameError, match=f"^Unable to resolve type {name}: ") as caught:
            store.message(name)
        assert not isinstance(caught.value, UnknownPackageError)
    with pytest.raises(
        TypeNameError, match=r"^Unable to resolve type std_msgs/String: package std_msgs has no such service$"
    ):
        store.service("std_msgs/String")


def test_standard_messages_come_from_rosbags() -> None:
    store = Store({})
    assert [f.full_type for f in store.message("geometry_msgs/PoseWithCovariance").definition.fields] == [
        "geometry_msgs/Pose",
        "float64[36]",
    ]
    assert store.message("std_msgs/Time").decode_json(b'{"data":"now"}', 5).data == Time(0, 5)
    assert store.message("std_msgs/Empty").definition.fields == ()
    constants = store.message("sensor_msgs/PointField").definition.constants
    assert ("FLOAT32", 7) in [(c.name, c.value) for c in constants]
    for name in store.names("msg"):
        assert store.message(name).default() is not None
    assert "builtin_interfaces" not in store.packages()


def test_a_folder_may_replace_and_extend_a_standard_package() -> None:
    store = Store({("std_msgs", "msg", "String"): "string text", ("std_msgs", "msg", "Mine"): "String s\nHeader h"})
    assert store.message("std_msgs/Mine").default().s.text == ""
    assert store.message("std_msgs/Mine").default().h.frame_id == ""


def test_user_package_may_use_standard_types() -> None:
    store = store_of(T="geometry_msgs/PoseStamped pose\nU[] us", U="Header header\nint32 x 3")
    value = store.message("p/T").decode_json(b'{"us":[{}]}', 7)
    assert (value.us[0].x, value.us[0].header.stamp, value.pose.header.stamp) == (3, Time(0, 7), Time(0, 7))
    assert "p" in store.packages()
    assert {"p/T", "p/U", "nav_msgs/Odometry"} <= set(store.names("msg"))
    assert store.names("srv") == ["p/S"]


@pytest.mark.parametrize(
    ("texts", "words"),
    [
        ({"T": "int32 x\nT t"}, r"p/msg/T\.msg:2:1: a message cannot contain itself: p/T > p/T"),
        (
            {"T": "U[] u", "U": "\nV v", "V": "T[] t"},
            r"p/msg/V\.msg:1:1: a message cannot contain itself: p/T > p/U > p/V > p/T",
        ),
        (
            {"T": "Gone g"},
            r"p/msg/T\.msg:1:1: unknown type p/Gone: Unable to resolve type p/Gone: package p has no such message",
        ),
        (
            {"T": "int8 a\ngone_msgs/Gone g"},
            r"p/msg/T\.msg:2:1: unknown type gone_msgs/Gone: Unable to import gone_msgs\.msg",
        ),
        ({"T": "int32"}, r"p/msg/T\.msg:1:1: expected a type and a name"),
        ({"T": "byte b 200"}, r"p/msg/T\.msg:1:1: the default of b is out of the range of byte"),
        ({"T": "uint8[] b [1, -1]"}, r"p/msg/T\.msg:1:\d+: -1 is out of the range of uint8"),
    ],
)
def test_a_broken_definition_is_a_peers_error(texts: dict[str, str], words: str) -> None:
    store = store_of(**texts)
    for _ in range(2):
        with pytest.raises(TypeNameError, match=f"^Unable to resolve type p/T: {words}"):
            store.message("p/T")
        with pytest.raises(TypeNameError, match=r"^Unable to resolve type p/S: "):
            store.service("p/S")
    assert store.message("std_msgs/String")


def test_type_of_checked_texts_is_compiled_when_it_is_first_used() -> None:
    store = Store(
        {("p", "msg", "T"): "U u", ("p", "msg", "U"): "int8 x 7", ("p", "srv", "S"): "T t\n---"}, is_checked=True
    )
    late, nested, request = store.message("p/T"), store.message("p/msg/U"), store.service("p/S").request
    assert [type(each) for each in (late, nested, request)] == [LateMessageType] * 3
    assert (late.name, request.name, repr(late)) == ("p/T", "p/SRequest", "MessageType(p/T)")
    assert late.encode_json(late.decode_json(b"{}", 0)) == b'{"u":{"x":7}}'
    assert store.message("p/T") is late
    assert [type(each) for each in (late, nested, request)] == [MessageType, LateMessageType, LateMessageType]
    assert type(late.default().u) is nested.struct_type
    assert type(request.default().t) is late.struct_type


def test_store_tells_whether_a_text_defines_a_type() -> None:
    store = store_of(T="int8 x")
    asked = [("p/T", "msg"), ("p/msg/T", "msg"), ("p/S", "srv"), ("p/S", "msg"), ("p/Gone", "msg"), ("q/T", "msg")]
    assert [store.has(name, kind) for name, kind in asked] == [True, True, True, False, False, False]  # type: ignore[arg-type]


def test_late_type_has_no_other_attributes() -> None:
    store = Store({("p", "msg", "T"): "int8 x"}, is_checked=True)
    with pytest.raises(AttributeError, match=r"^LateMessageType has no attribute 'spek'"):
        store.message("p/T").spek  # type: ignore[attr-defined] # noqa: B018
    assert type(store.message("p/T")) is LateMessageType


def test_type_that_is_asked_for_twice_at_once_is_compiled_once() -> None:
    store = Store({("p", "msg", "T"): "int8 x"}, is_checked=True)
    makers = [store._type("msg", "p/T", lambda: store.definition("p/T")) for _ in range(2)]
    assert makers[0].spec is makers[1].spec is store.message("p/T").spec


def test_unknown_types_are_refused_at_once_by_a_store_of_checked_texts() -> None:
    store = Store({("p", "msg", "T"): "int8 x"}, is_checked=True)
    for ask, what in ((store.message, "message"), (store.service, "service")):
        with pytest.raises(TypeNameError, match=f"package p has no such {what}"):
            ask("p/Gone")
    with pytest.raises(UnknownPackageError):
        store.message("gone_msgs/Gone")


def test_failed_type_does_not_affect_others() -> None:
    store = store_of(T="U u\nV v", U="int8 x", V="T t")
    with pytest.raises(TypeNameError):
        store.message("p/T")
    assert store.message("p/U").default().x == 0


# Names of documents and of the other generation


def test_documented_type_names_are_aliases() -> None:
    store = Store({("p", "msg", "T"): "int32 x"}, leniency=Leniency(types={"q/T": "p/T", "q/OldSrv": "p/S"}))
    for name in ("q/T", "q/msg/T", "p/T"):
        assert store.canonical(name) == "p/T"
        assert store.message(name) is store.message("p/T")
    assert store.canonical("q/srv/OldSrv") == "p/S"


def test_existing_type_is_not_an_alias() -> None:
    texts = {("p", "msg", "T"): "int32 x", ("q", "msg", "T"): "int32 y"}
    store = Store(texts, leniency=Leniency(types={"q/T": "p/T", "q/U": "p/T"}))
    assert store.canonical("q/T") == "q/T"
    assert store.message("q/U") is store.message("p/T")


def test_rosapi_types_have_the_names_of_both_ros_versions() -> None:
    store = shared_store()
    assert store.service("rosapi_msgs/srv/Topics") is store.service("rosapi/Topics")
    assert store.service("rosapi/GetParam").request.decode_json(b'{"name":"a","default_value":"1"}', 0).default == "1"
    own = Store({("rosapi_msgs", "msg", "TypeDef"): "int8 x"})
    assert own.canonical("rosapi_msgs/TypeDef") == "rosapi_msgs/TypeDef"


# Actions


@pytest.mark.parametrize("name", ["p/A", "p/action/A"])
def test_an_action_is_three_messages(name: str) -> None:
    store = Store({("p", "action", "A"): "int32 order\n---\nint32[] all\n---\nB last", ("p", "msg", "B"): "int8 x"})
    action = store.action(name)
    assert action is store.action("p/A")
    assert (action.name, action.goal.name, action.result.name) == ("p/A", "p/AGoal", "p/AResult")
    assert action.goal.decode_json(b'{"order":3}', 0).order == 3
    assert action.feedback is store.message("p/AFeedback")
    assert store.names("action") == ["p/A"]


def test_actionlib_messages_are_made_from_the_action() -> None:
    store = shared_store()
    goal = store.message("actionlib_tutorials/FibonacciActionGoal")
    value = goal.decode_json(b'{"goal_id":{"id":"x"},"goal":{"order":7}}', 5)
    assert (value.header.stamp, value.goal_id.id, value.goal.order) == (Time(0, 5), "x", 7)
    for part in ("Result", "Feedback"):
        fields = store.message(f"actionlib_tutorials/FibonacciAction{part}").definition.fields
        types = ["std_msgs/Header", "actionlib_msgs/GoalStatus", f"actionlib_tutorials/Fibonacci{part}"]
        assert [f.type for f in fields] == types
    whole = store.message("actionlib_tutorials/FibonacciAction").definition.fields
    assert [f.name for f in whole] == ["action_goal", "action_result", "action_feedback"]
    names = {f"tf2_msgs/LookupTransform{part}" for part in ("Goal", "ActionFeedback", "Action")}
    assert names <= set(store.names("msg"))
    assert not names & set(shared_store(2).names("msg"))
    assert shared_store(2).message("tf2_msgs/LookupTransformActionGoal").default().goal.advanced is False


def test_existing_message_is_not_made_from_an_action() -> None:
    texts = {("p", "action", "A"): "int32 x\n---\n---", ("p", "msg", "AGoal"): "int32 y", ("p", "msg", "AAction"): ""}
    store = Store(texts)
    assert list(store.message("p/AGoal").spec.fields) == ["y"]
    assert store.message("p/AAction").spec.fields == {}
    assert list(store.action("p/A").goal.spec.fields) == ["x"]
    assert list(store.message("p/AActionGoal").default().goal.__struct_fields__) == ["y"]


def test_missing_and_broken_actions_are_errors() -> None:
    store = Store({("p", "action", "A"): "int32\n---\n---", ("p", "action", "B"): "Gone g\n---\n---"})
    with pytest.raises(UnknownPackageError, match=r"^Unable to import q\.action from package q\."):
        store.action("q/A")
    with pytest.raises(TypeNameError, match=r"^Unable to resolve type p/C: package p has no such action$"):
        store.action("p/C")
    with pytest.raises(TypeNameError, match=r"^Unable to resolve type p/A: p/action/A\.action:1:1: expected a type"):
        store.action("p/A")
    for name in ("p/AGoal", "p/AAction", "p/BActionGoal"):
        with pytest.raises(TypeNameError, match="Unable to resolve type"):
            store.message(name)


# ROS 2


def test_ros_2_has_its_own_times_and_headers() -> None:
    store = shared_store(2)
    assert store.ros == 2
    assert store.time_value(1_500_000_000) == Time2(1, 500_000_000)
    t = store.message("morai_msgs/msg/EgoVehicleStatus")
    text = t.encode_json(t.decode_json(b'{"unique_id":1}', 2_000_000_003))
    assert text.startswith(b'{"header":{"stamp":{"sec":2,"nanosec":3},"frame_id":""},"unique_id":1,')
    header = b'{"header":{"seq":7,"stamp":{"secs":5,"nsecs":6},"frame_id":"map"}}'
    assert t.decode_json(header, 0).header.stamp == Time2(5, 6)
    clock = store.message("rosgraph_msgs/Clock")
    assert clock.encode_json(clock.decode_json(b'{"clock":"now"}', 7)) == b'{"clock":{"sec":0,"nanosec":7}}'


def test_snake_case_of_morai_fields_is_accepted_and_not_sent() -> None:
    for ros in (1, 2):
        t = shared_store(2 if ros == 2 else 1).message("morai_msgs/CtrlCmd")
        value = t.decode_json(b'{"longl_cmd_type":2,"velocity":3}', 0)
        assert value.longlCmdType == 2
        assert t.encode_json(value).startswith(b'{"longlCmdType":2,')
        assert t.decode_json(b'{"longl_cmd_type":2,"longlCmdType":1}', 0).longlCmdType == 1
        with pytest.raises(FieldError, match="does not have a field longl_cmd"):
            t.decode_json(b'{"longl_cmd":2}', 0)
    own = Leniency(fields={"p/T": {"longCmdType": "longlCmdType"}})
    t = Store({("p", "msg", "T"): "int32 longlCmdType"}, leniency=own).message("p/T")
    for name in ("longlCmdType", "longl_cmd_type", "longCmdType", "long_cmd_type"):
        assert t.check({name: 3}, 0).longlCmdType == 3


# Texts


def test_full_text_has_each_nested_type_once_by_full_name() -> None:
    store = Store(
        {
            ("p", "msg", "T"): "# T\nHeader header\nU[] us\nU one\n",
            ("p", "msg", "U"): "V v\nstd_msgs/Header h\n",
            ("p", "msg", "V"): "int8 x\n",
            ("std_msgs", "msg", "Header"): HEADER,
        }
    )
    border = "=" * 80
    assert store.full_text("p/msg/T") == (
        "# T\nstd_msgs/Header header\np/U[] us\np/U one"
        f"\n{border}\nMSG: std_msgs/Header\nuint32 seq\ntime stamp\nstring frame_id"
        f"\n{border}\nMSG: p/U\np/V v\nstd_msgs/Header h"
        f"\n{border}\nMSG: p/V\nint8 x"
    )
    assert store.full_text("p/T") is store.full_text("p/msg/T")  # rosapi asks for that of every topic
    with pytest.raises(UnknownPackageError):
        store.full_text("q/T")


def test_full_text_of_a_standard_message_can_be_parsed_again() -> None:
    store = Store({})
    parts = store.full_text("visualization_msgs/MarkerArray").split("=" * 80)
    texts = {("visualization_msgs", "msg", "MarkerArray"): parts[0]}
    for part in parts[1:]:
        name, _, text = part.strip().removeprefix("MSG: ").partition("\n")
        package, _, short = name.partition("/")
        texts[package, "msg", short] = text
    again = Store(texts)
    for name in again.names("msg"):
        assert again.message(name).definition.fields == store.message(name).definition.fields


def test_time_value_has_the_fields_of_the_ros_version() -> None:
    assert shared_store().time_value(1_500_000_000) == Time(1, 500_000_000)


def test_surplus_slashes_are_accepted_and_not_cached() -> None:
    store = Store({("p", "msg", "T"): "int8 a", ("p", "srv", "S"): "---\n"})
    known = store.message("p/T"), store.service("p/S")
    kept = len(store._spellings)
    for n in range(1, 50):
        slashes = "/" * n
        assert store.message(f"{slashes}p/{slashes}T{slashes}") is known[0]
        assert store.service(f"p{slashes}srv{slashes}S/") is known[1]
    assert len(store._spellings) <= kept + 1


@pytest.mark.slow
def test_types_of_the_simulator_do_not_import_rosbags() -> None:
    code = (
        "import sys; from rosbridge_sim.shell.files.definitions import read_definitions;"
        "from rosbridge_sim.schema.store import Store;"
        "from rosbridge_sim.schema.definitions.standard import PACKAGES; texts = read_definitions('22.R2');"
        "own = {p for p, *_ in texts} - PACKAGES[1] - PACKAGES[2] - {'composition_interfaces'};"
        "own = [name for name in texts if name[0] in own]; stores = [Store(texts, ros=ros) for ros in (1, 2)];"
        "ask = {'msg': Store.message, 'srv': Store.service, 'action': Store.action};"
        "[ask[kind](store, f'{p}/{name}') for store in stores for p, kind, name in own];"
        "[store.message(f'{p}/{name}') for store in stores for p, kind, name in texts if kind == 'msg'];"
        "print('rosbags' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=SCHEMAS.parent)
    assert done.stdout.strip() == "False"


def test_nearest_standard_type_and_package_are_suggested() -> None:
    store = shared_store()
    with pytest.raises(TypeNameError, match=r"geometry_msgs has no such message \(did you mean Twist\?\)$"):
        store.message("geometry_msgs/Twst")
    with pytest.raises(UnknownPackageError, match=r"has it \(did you mean geometry_msgs\?\)$"):
        store.message("geometry_msg/Twist")
    with pytest.raises(UnknownPackageError, match=r"has it$"):
        store.message("my_msgs/Twist")


def test_nearest_type_of_the_package_is_suggested() -> None:
    texts = {("p", "msg", "Control"): "int8 a", ("q", "msg", "Contrl"): "int8 a", ("p", "srv", "Switch"): "---"}
    with pytest.raises(TypeNameError, match=r"no such message \(did you mean Control\?\)$"):
        Store(texts).message("p/Contrl")
    with pytest.raises(TypeNameError, match=r"no such service \(did you mean Switch\?\)$"):
        Store(texts).service("p/Swich")
