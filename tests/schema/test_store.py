"""Types by name: spellings, what is unknown, what is found in rosbags, texts for rosapi, messages."""

from __future__ import annotations

import subprocess
import sys

import pytest

from rosbridge_sim.errors import DefinitionError, TypeNameError, UnknownPackageError
from rosbridge_sim.schema.check import Time
from rosbridge_sim.schema.compile import OpaqueType
from rosbridge_sim.schema.store import Leniency, Message, Store
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
        "a//b",
        "ä/b",
        "a/msg/",
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
        assert str(caught.value).endswith(" is not a valid type string")
        assert str(caught.value).encode()


def test_an_unknown_package_is_told_from_an_unknown_type() -> None:
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


def test_a_users_package_may_use_standard_ones() -> None:
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
def test_a_broken_definition_is_a_peers_error_in_use_and_a_document_error_at_start(
    texts: dict[str, str], words: str
) -> None:
    store = store_of(**texts)
    for _ in range(2):
        with pytest.raises(TypeNameError, match=f"^Unable to resolve type p/T: {words}"):
            store.message("p/T")
        with pytest.raises(TypeNameError, match=r"^Unable to resolve type p/S: "):
            store.service("p/S")
        with pytest.raises(DefinitionError, match=f"^{words}"):
            store.verify(["p"])
    store.verify(["other"])
    assert store.message("std_msgs/String")


def test_a_type_that_failed_does_not_spoil_others() -> None:
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


def test_a_type_that_is_there_is_no_alias() -> None:
    texts = {("p", "msg", "T"): "int32 x", ("q", "msg", "T"): "int32 y"}
    store = Store(texts, leniency=Leniency(types={"q/T": "p/T", "q/U": "p/T"}))
    assert store.canonical("q/T") == "q/T"
    assert store.message("q/U") is store.message("p/T")


def test_rosapi_answers_to_the_names_of_both_generations() -> None:
    store = shared_store()
    assert store.service("rosapi_msgs/srv/Topics") is store.service("rosapi/Topics")
    assert store.service("rosapi/GetParam").request.decode_json(b'{"name":"a","default_value":"1"}', 0).default == "1"
    own = Store({("rosapi_msgs", "msg", "TypeDef"): "int8 x"})
    assert own.canonical("rosapi_msgs/TypeDef") == "rosapi_msgs/TypeDef"


# Texts and messages


def test_full_text_has_each_nested_type_once_and_by_its_full_name() -> None:
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


def test_time_value_is_a_time_of_the_personality() -> None:
    assert shared_store().time_value(1_500_000_000) == Time(1, 500_000_000)


def test_a_message_is_encoded_once() -> None:
    message_type = shared_store().message("std_msgs/String")
    message = Message(message_type, message_type.struct(data="x"))
    assert message.json == b'{"data":"x"}'
    assert message.json is message.json
    assert message.framed(b'{"msg":') == b'{"msg":{"data":"x"}}'
    assert message.framed(b'{"msg":') is message.framed(b'{"msg":')
    assert message.framed(b'{"m":') == b'{"m":{"data":"x"}}'
    assert Message(OpaqueType("who/Knows"), {"a": 1}).json == b'{"a":1}'


@pytest.mark.slow
def test_the_types_of_the_simulator_do_without_rosbags() -> None:
    code = (
        "import sys; from tests.schema.strategies import read_texts; from rosbridge_sim.schema.store import Store;"
        "Store(read_texts()).verify(); print('rosbags' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=SCHEMAS.parent)
    assert done.stdout.strip() == "False"
