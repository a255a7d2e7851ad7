"""Values of fields of topics, from structs and tables; and what is told if there is no such field."""

from __future__ import annotations

import pytest

from rosbridge_sim.campaigns.topic_values import MAX_TEXT, TopicValues
from rosbridge_sim.expressions import Value, parse_expression
from rosbridge_sim.morai.releases import LENIENCY
from rosbridge_sim.schema.store import Store
from rosbridge_sim.shell.files.definitions import read_definitions

POSE = {"position": {"x": 3.0}, "names": ["a", "b"], "is_on": True, "text": "t" * 2000}


def read(text: str, message: object) -> tuple[dict[str, Value], str]:
    values = TopicValues(parse_expression(text, "f", is_followed=True).fields)
    for topic in values.topics:
        values.take(topic, message)
    return values.values, values.trouble


@pytest.mark.parametrize(
    ("field", "value"),
    [("position.x", 3.0), ("names[1]", "b"), ("is_on", True), ("text", "t" * MAX_TEXT), ("names[2]", None)],
)
def test_field_of_a_message_of_an_unknown_type(field: str, value: Value | None) -> None:
    found, trouble = read(f"/p.{field}", POSE)
    assert (found.get(f"/p.{field}"), trouble) == (value, "")


def test_field_of_a_struct_and_of_a_number_in_an_array() -> None:
    store = Store(read_definitions("22.R2"), leniency=LENIENCY, ros=1)
    imu = store.message("sensor_msgs/Imu")
    message = imu.decode_json(b'{"angular_velocity": {"z": 0.5}, "orientation_covariance": [1,2,3,4,5,6,7,8,9]}', 0)
    text = "/imu.angular_velocity.z + /imu.orientation_covariance[8]"
    assert read(text, message) == ({"/imu.angular_velocity.z": 0.5, "/imu.orientation_covariance[8]": 9.0}, "")


@pytest.mark.parametrize(
    ("field", "what"),
    [
        ("positoin.x", "no field 'positoin' (did you mean position?)"),
        ("position", "expected a number or a text; the message has a message with x"),
        ("names", "expected a number or a text; the message has a list"),
        ("position.x.real", "no field 'real'"),
        ("is_on[0]", "expected a list; the message has bool"),
        ("text[0]", "expected a list"),
    ],
)
def test_field_that_is_not_there_is_told(field: str, what: str) -> None:
    found, trouble = read(f"/p.{field}", POSE)
    assert found == {}
    assert trouble.startswith(f"/p.{field.partition('[')[0]}")
    assert what in trouble


def test_later_message_without_an_entry_takes_its_value_away() -> None:
    values = TopicValues(parse_expression("/p.names[1]", "f", is_followed=True).fields)
    for names, value in ((["a", "b"], "b"), (["a"], None)):
        values.take("/p", {"names": names})
        assert values.values.get("/p.names[1]") == value
