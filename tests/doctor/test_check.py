"""Checks are read, and made ready for a server."""

from __future__ import annotations

import json
import re

import pytest

from rosbridge_sim.doctor.check import Check, moves, plain_types, prepared, read_checks
from rosbridge_sim.doctor.check_frames import write_frame
from tests.vector_player import CHECKS


def check(*steps: object) -> Check:
    (one,) = read_checks(json.dumps({"id": "s/x", "source": "y", "says": "z", "steps": list(steps)}))
    return one


@pytest.mark.parametrize(
    ("sent", "expected"),
    [
        ({"op": "publish", "topic": "/t", "msg": {}}, {"op": "publish", "topic": "/p/t", "msg": {}}),
        ({"op": "publish", "topic": "chatter"}, {"op": "publish", "topic": "p/chatter"}),
        ({"op": "call_service", "service": "/s#7"}, {"op": "call_service", "service": "/p/s#7"}),
        (
            {"op": "call_service", "service": "/f/_action/cancel_goal"},
            {"op": "call_service", "service": "/p/f/_action/cancel_goal"},
        ),
        ({"op": "call_service", "service": "/rosapi/topics"}, {"op": "call_service", "service": "/rosapi/topics"}),
        (
            {"op": "call_service", "service": "rosapi/get_param", "args": {"name": "/a"}},
            {"op": "call_service", "service": "rosapi/get_param", "args": {"name": "/p/a"}},
        ),
        ({"op": "x", "topic": "/t", "type": "std_msgs/t"}, {"op": "x", "topic": "/p/t", "type": "std_msgs/t"}),
        ('{"op":"subscribe","topic":"/t"}', '{"op":"subscribe","topic":"/p/t"}'),
        ({"$cbor": {"op": "publish", "topic": "/t"}}, {"$cbor": {"op": "publish", "topic": "/p/t"}}),
    ],
)  # fmt: skip
def test_names_are_put_below_the_prefix(sent: object, expected: object) -> None:
    assert prepared(check({"a>": sent}), "/p", 1).steps == [{"a>": expected}]


def test_no_check_names_anything_of_the_server_but_rosapi() -> None:
    strange: list[tuple[str, str]] = []
    for one in (one for path in CHECKS.glob("*.jsonl") for one in read_checks(path.read_text("utf-8"))):
        for _, action, frame in moves(prepared(one, "/p", 1)):
            sent = write_frame(frame) if action == ">" else ""
            text = (sent if isinstance(sent, str) else sent.decode("latin-1")).replace('\\"', '"')
            named = re.findall(r'"(?:topic|service|action|node|name)"\s*:\s*"(/[^"]*)', text[:5_000])
            strange += [(one.id, name) for name in named if not name.startswith(("/p/", "/rosapi/"))]
    assert strange == []


def test_names_in_answers_and_ids_follow() -> None:
    steps = [
        {"a>": {"op": "advertise_service", "service": "/add", "type": "std_srvs/Empty"}},
        {"a<": {"op": "call_service", "service": "/add", "id": "service_request:/add:1"}},
        {"b<": {"op": "service_response", "service": "/add", "values": "Service /add does not exist"}},
    ]
    text = json.dumps(prepared(check(*steps), "/p", 1).steps)
    assert text.count("/p/add") == 5
    assert '"/add' not in text


def test_types_and_values_are_those_of_the_server_s_ros() -> None:
    steps = [
        {"a>": {"op": "advertise_service", "service": "/s", "type": "rospy_tutorials/AddTwoInts"}},
        {"a<": {"op": "publish", "topic": "/s", "msg": {"w": {"$ros": [0, 1]}}}},
    ]
    (first, _), (second, answer) = (prepared(check(*steps), "/p", ros).steps for ros in (1, 2))
    assert first["a>"]["type"] == "rospy_tutorials/AddTwoInts"
    assert second["a>"]["type"] == "example_interfaces/AddTwoInts"
    assert answer["a<"]["msg"] == {"w": 1}


def test_types_that_a_server_must_know_have_their_kind() -> None:
    one = check(
        {"a>": {"op": "advertise", "topic": "/t", "type": "std_msgs/msg/String"}},
        {"a>": {"op": "advertise_service", "service": "/s", "type": "std_srvs/Empty"}},
        {"a>": {"op": "send_action_goal", "action": "/f", "action_type": "example_interfaces/Fibonacci"}},
        {"a>": {"op": "advertise", "topic": "/u", "type": "my_msgs/Thing"}},
        {"a>": {"op": "advertise", "topic": "/u", "type": "std_msgs/Nonsense"}},
    )
    assert one.types == {
        ("topic", "std_msgs/String"),
        ("service", "std_srvs/Empty"),
        ("action", "example_interfaces/Fibonacci"),
    }


def test_types_are_written_as_ros_1_does() -> None:
    assert plain_types("a rosapi_msgs/srv/Topics of std_msgs/msg/String") == "a rosapi/Topics of std_msgs/String"
