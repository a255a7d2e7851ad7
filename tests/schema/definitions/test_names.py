"""Names in the spelling of either generation."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rosbridge_sim.errors import TypeNameError
from rosbridge_sim.schema.definitions.names import ros2_names, snake_case, spelled, split_name
from tests.schema.strategies import all_types, shared_store


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("longlCmdType", "longl_cmd_type"),
        ("trafficLightStatus", "traffic_light_status"),
        ("turnSignal", "turn_signal"),
        ("FL_wheel_speed", "fl_wheel_speed"),
        ("Left_Turn_input", "left_turn_input"),
        ("isPickup", "is_pickup"),
        ("position_X", "position_x"),
        ("K", "k"),
        ("HTTPServer", "http_server"),
        ("x1", "x1"),
        ("already_so", "already_so"),
        ("_two__scores_", "two_scores"),
    ],
)
def test_names_are_converted_to_snake_case(name: str, expected: str) -> None:
    assert snake_case(name) == expected


def test_only_names_invalid_in_ros_2_are_converted() -> None:
    assert ros2_names(["a", "b_c", "turnSignal", "_d", "K"]) == {"turn_signal": "turnSignal", "d": "_d", "k": "K"}
    # nothing that is taken, nothing that two would have, nothing that is no name
    assert ros2_names(["turnSignal", "turn_signal", "aB", "a_B", "_1", "__"]) == {}


@given(st.lists(st.from_regex(r"[A-Za-z_][A-Za-z0-9_]{0,5}", fullmatch=True), unique=True))
def test_converted_names_are_unambiguous(names: list[str]) -> None:
    found = ros2_names(names)
    assert not set(found) & set(names)
    assert len(set(found.values())) == len(found)
    assert set(found.values()) <= set(names)


@pytest.mark.parametrize("ros", [1, 2])
def test_every_morai_field_is_accepted_in_ros_2_spelling(ros: int) -> None:
    found = 0
    for message_type in all_types(2 if ros == 2 else 1):
        if message_type.name.startswith("morai_msgs/"):
            spec = message_type.spec
            for name in spec.fields:
                if name != name.lower():
                    assert spec.aliases[snake_case(name)] == name
                    found += 1
    assert found > 10


def test_types_are_spelled_as_in_the_ros_version() -> None:
    assert spelled("std_msgs/String", "msg", 1) == "std_msgs/String"
    assert spelled("std_msgs/String", "msg", 2) == "std_msgs/msg/String"
    assert spelled("rosapi/Topics", "srv", 1) == "rosapi/Topics"
    assert spelled("rosapi/Topics", "srv", 2) == "rosapi_msgs/srv/Topics"
    assert spelled("p/A", "action", 2) == "p/action/A"


@pytest.mark.parametrize("ros", [1, 2])
def test_store_reads_its_own_spelling(ros: int) -> None:
    store = shared_store(2 if ros == 2 else 1)
    for name in ("tf2_web_republisher/TFArray", "tf2_web_republisher_msgs/msg/TFArray", "std_msgs/msg/String"):
        assert store.message(store.spelled(name, "msg")) is store.message(name)
    for name in ("rosapi/Topics", "rosapi_msgs/srv/Topics"):
        assert store.service(store.spelled(name, "srv")) is store.service("rosapi/Topics")
    for name in ("tf2_web_republisher_interfaces/TFSubscription", "tf2_web_republisher/action/TFSubscription"):
        assert store.action(store.spelled(name, "action")).name == "tf2_web_republisher/TFSubscription"
    assert store.spelled("who/Knows", "msg") == ("who/Knows" if ros == 1 else "who/msg/Knows")
    with pytest.raises(TypeNameError, match="is not a valid type string"):
        store.spelled("who", "msg")


def test_type_name_is_split_in_every_spelling() -> None:
    for name in ("p/T", "p/msg/T", "p/srv/T", "p/action/T"):
        assert split_name(name) == ("p", "T")


@pytest.mark.parametrize("name", ["/p/T", "p//T", "p/T/", "//p///msg//T//", "/p/msg/T", "p/msg//T"])
def test_surplus_slashes_in_a_type_name_are_ignored(name: str) -> None:
    assert split_name(name) == ("p", "T")


@pytest.mark.parametrize(
    "name", ["", "/", "//", "p", "p/", "/p", "/T/", "p/T/U", "p/msg/T/U", "p/ T", "p/\nT", "p/T\n"]
)
def test_a_name_without_a_package_and_a_type_is_refused(name: str) -> None:
    with pytest.raises(TypeNameError, match="is not a valid type string"):
        split_name(name)
