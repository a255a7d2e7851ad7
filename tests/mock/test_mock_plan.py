"""The plan of a mock's file: values of messages over time, and each mistake with its line."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any

import orjson
import pytest

from rosbridge_sim.documents.yaml_reading import read_yaml
from rosbridge_sim.mock.mock_model import MockRecording
from rosbridge_sim.mock.mock_plan import MockFiles, MockPlan, plan_mock
from rosbridge_sim.mock.recorded_topics import RecordedFile, RecordedTrack, choose_topics, without_stamps
from rosbridge_sim.mock.value_patterns import MessageTime
from rosbridge_sim.schema.store import Store
from rosbridge_sim.shell.files.definitions import read_definitions

DOCS = Path(__file__).parents[2] / "docs"
STORE = Store(read_definitions("22.R2"), ros=1)
STORE_2 = Store(read_definitions("22.R2"), ros=2)


class Files(MockFiles):
    """A few files."""

    def __init__(self) -> None:
        self.contents = {
            "front.jpg": b"\xff\xd8\xff",
            "drive.csv": b"time,speed\n0,1.5\n1,2.5\n",
            "note.txt": b"hello",
            "empty.csv": b"time,speed\n",
        }

    def read(self, path: str) -> bytes:
        return self.contents[path] if path in self.contents else super().read(path)

    def record(self, recording: MockRecording, others: Any) -> RecordedFile:  # noqa: ANN401
        names = choose_topics(["/scan", "/imu"], recording.topics, others)
        tracks = [
            RecordedTrack(name, "std_msgs/String", [0], [b"x"], lambda raw: {"data": raw.decode()}) for name in names
        ]
        return RecordedFile(1_000, tuple(tracks))


def plan_of(text: str, store: Store = STORE) -> MockPlan:
    plan, mistakes = plan_mock(read_yaml(text, "robot.yaml"), store, Files(), pytest.fail)
    assert [mistake.text for mistake in mistakes] == []
    assert plan is not None
    return plan


def mistakes_of(text: str) -> list[str]:
    return [mistake.text for mistake in plan_mock(read_yaml(text, "robot.yaml"), STORE, Files(), pytest.fail)[1]]


def message(plan: MockPlan, number: int, index: int = 0, store: Store = STORE) -> Any:  # noqa: ANN401
    topic = plan.topics[index]
    at = MessageTime(number, number * (topic.period_ns or 0), store.time_value(7_000_000_005))
    return orjson.loads(topic.type.encode_json(topic.make(at)))


def value_of(pattern: str, type_name: str = "std_msgs/Float64") -> list[Any]:
    plan = plan_of(f"topics: {{/x: {{type: {type_name}, rate: 10, value: {{data: {pattern}}}}}}}")
    return [message(plan, number)["data"] for number in range(6)]


@pytest.mark.parametrize(
    ("pattern", "values"),
    [
        ("3", [3.0] * 6),
        ("{$ramp: {start: 1, end: 3, seconds: 0.2}}", [1, 2, 1, 2, 1, 2]),
        ("{$ramp: {start: 1, end: 3, seconds: 0.2, repeat: false}}", [1, 2, 3, 3, 3, 3]),
        ("{$counter: {start: 5, step: 2, end: 9}}", [5, 7, 9, 5, 7, 9]),
        ("{$counter: {}}", [0, 1, 2, 3, 4, 5]),
        ("{$list: [1, 2.5, {$counter: {}}]}", [1, 2.5, 2, 1, 2.5, 5]),
        ("{$csv: {file: drive.csv, column: speed}}", [1.5, 2.5, 1.5, 2.5, 1.5, 2.5]),
        ("{$expression: 'round(time * 10) + tick'}", [0, 2, 4, 6, 8, 10]),
        ("{$expression: '/x.data * 2 + 1'}", [1] * 6),  # nothing is noted as the last message here
        ("{$expression: 'max(tick % 3)'}", [0, 1, 2, 2, 2, 2]),
    ],
)
def test_pattern_gives_these_values(pattern: str, values: list[float]) -> None:
    assert value_of(pattern) == pytest.approx(values)


def test_sine_has_amplitude_period_offset_and_phase() -> None:
    values = value_of("{$sine: {amplitude: 2, period: 0.4, offset: 1, phase: 0.5}}")
    assert values == pytest.approx([1 + 2 * math.sin(2 * math.pi * 0.1 * n / 0.4 + 0.5) for n in range(6)])


@pytest.mark.parametrize(
    ("type_name", "pattern", "values"),
    [
        ("std_msgs/Int8", "{$sine: {amplitude: 1000, period: 0.4}}", [0, 127, 0, -128, 0, 127]),
        ("std_msgs/Bool", "{$counter: {end: 1}}", [False, True] * 3),
        ("std_msgs/String", "{$list: [a, b]}", ["a", "b"] * 3),
        ("std_msgs/String", "{$file: note.txt}", ["hello"] * 6),
        ("std_msgs/String", "{$csv: {file: drive.csv, column: time}}", ["0", "1"] * 3),
        ("std_msgs/Float64MultiArray", "[1, {$counter: {}}]", [[1, n] for n in range(6)]),
        ("std_msgs/Float64MultiArray", "{$list: [[1], [2, 3]]}", [[1], [2, 3]] * 3),
        ("std_msgs/UInt8MultiArray", "{$file: front.jpg}", ["/9j/"] * 6),
    ],
)
def test_pattern_has_the_type_of_its_field(type_name: str, pattern: str, values: list[object]) -> None:
    assert value_of(pattern, type_name) == values


def test_random_walk_is_the_same_whether_messages_between_were_made_or_not() -> None:
    text = (
        "topics: {/x: {type: std_msgs/Float64, rate: 10, value: {data: {$random_walk: {step: 0.5, low: -1, high: 1}}}}}"
    )
    every, some = plan_of(text), plan_of(text)
    walk = [message(every, number)["data"] for number in range(400)]
    assert [message(some, number)["data"] for number in (0, 3, 399)] == [walk[0], walk[3], walk[399]]
    assert min(walk) >= -1
    assert max(walk) <= 1
    assert len(set(walk)) == 400
    other = plan_of("seed: 1\n" + text)
    assert message(other, 5) != message(plan_of(text), 5)


def test_headers_are_stamped_and_counted() -> None:
    text = "topics: {/p: {type: geometry_msgs/PointStamped, rate: 10, value: {header: {frame_id: map}, point: {x: 1}}}}"
    assert message(plan_of(text), 4)["header"] == {"seq": 4, "stamp": {"secs": 7, "nsecs": 5}, "frame_id": "map"}
    of_ros2 = message(plan_of(text, STORE_2), 4, store=STORE_2)
    assert of_ros2["header"] == {"stamp": {"sec": 7, "nanosec": 5}, "frame_id": "map"}
    assert of_ros2["point"] == {"x": 1, "y": 0, "z": 0}


def test_stamp_that_is_given_stays_and_headers_in_lists_are_stamped() -> None:
    text = """
    topics:
      /p:
        type: nav_msgs/Path
        rate: 10
        value:
          header: {stamp: {secs: 3}}
          poses: [{pose: {position: {x: {$counter: {}}}}}, {header: {frame_id: b}}]
    """
    made = message(plan_of(text), 2)
    assert made["header"]["stamp"] == {"secs": 3, "nsecs": 0}
    assert [pose["header"]["stamp"]["secs"] for pose in made["poses"]] == [7, 7]
    assert [pose["pose"]["position"]["x"] for pose in made["poses"]] == [2, 0]


def test_message_that_was_made_does_not_change_with_the_next_one() -> None:
    topic = plan_of(
        "topics: {/p: {type: geometry_msgs/PointStamped, rate: 10, value: {point: {x: {$counter: {}}}}}}"
    ).topics[0]
    first = topic.make(MessageTime(1, 0, STORE.time_value(1)))
    topic.make(MessageTime(2, 0, STORE.time_value(2)))
    assert (first.point.x, first.header.seq, first.header.stamp.secs) == (1, 1, 0)


def test_expression_reads_the_last_messages_of_topics() -> None:
    plan = plan_of(
        """
        topics:
          /speed: {type: std_msgs/Float64, rate: 10, value: {data: {$expression: "/cmd_vel.linear.x * 2"}}}
          /first: {type: std_msgs/Float64, rate: 10, value: {data: {$expression: "/list.data[1] + 1"}}}
        subscribers: {cmd_vel: geometry_msgs/Twist, /list: std_msgs/Float64MultiArray}
        """
    )
    assert plan.topics[0].reads == {"/cmd_vel"}
    assert message(plan, 0) == {"data": 0}
    plan.latest["/cmd_vel"] = STORE.message("geometry_msgs/Twist").check({"linear": {"x": 3}}, 0)
    assert message(plan, 1) == {"data": 6}
    assert message(plan, 1, 1) == {"data": 0}  # the list is too short
    plan.latest["/list"] = STORE.message("std_msgs/Float64MultiArray").check({"data": [4, 5]}, 0)
    assert message(plan, 2, 1) == {"data": 6}


def test_expression_that_fails_later_is_told_once_and_is_0() -> None:
    said: list[str] = []
    text = "topics:\n  /x: {type: std_msgs/Float64, rate: 10, value: {data: {$expression: 1 / (tick - 1)}}}"
    plan, _ = plan_mock(read_yaml(text, "robot.yaml"), STORE, Files(), said.append)
    assert plan is not None
    assert [message(plan, number)["data"] for number in (0, 1, 2, 1)] == [-1, 0, 1, 0]
    assert said == ["robot.yaml:2: topics./x.value.data.$expression: a division by zero in '1 / (tick - 1)'"]


def test_transforms_of_one_rate_are_one_message_and_those_without_are_static() -> None:
    plan = plan_of(
        """
        transforms:
        - {parent: map, child: odom, rate: 10, x: {$counter: {}}, yaw: 1.5707963267948966}
        - {parent: odom, child: base, rate: 10}
        - {parent: base, child: lidar, z: 2}
        """
    )
    assert [(topic.name, topic.period_ns, topic.is_latching) for topic in plan.topics] == [
        ("/tf", 100_000_000, False),
        ("/tf_static", None, True),
    ]
    first, second = message(plan, 3)["transforms"]
    assert first["header"] == {"seq": 3, "stamp": {"secs": 7, "nsecs": 5}, "frame_id": "map"}
    assert (first["child_frame_id"], first["transform"]["translation"]["x"]) == ("odom", 3)
    assert first["transform"]["rotation"] == pytest.approx({"x": 0, "y": 0, "z": math.sqrt(0.5), "w": math.sqrt(0.5)})
    assert second["transform"]["rotation"]["w"] == 1


def test_answers_fit_fields_or_an_expression_of_the_request() -> None:
    plan = plan_of(
        """
        services:
          /enable:
            type: std_srvs/SetBool
            answers:
            - {when: {data: true}, value: {success: true, message: {$list: [one, two]}}, delay: 0.25}
            - {when: data, fail: never}
            - {when: not data, fail: off}
        """
    )
    type_name, answers = plan.services["/enable"]
    service = STORE.service(type_name)
    yes, no = (service.request.check({"data": data}, 0) for data in (True, False))
    assert [answer.fits(yes) for answer in answers] == [True, True, False]
    assert [answer.fits(no) for answer in answers] == [False, False, True]
    assert (answers[0].delay_ns, answers[2].fail) == (250_000_000, "off")
    assert answers[0].make is not None
    assert answers[0].make(MessageTime(1, 0, None, yes)).message == "two"


def test_result_is_computed_from_the_goal() -> None:
    plan = plan_of(
        """
        actions:
          /count:
            type: actionlib_tutorials/Fibonacci
            goals: [{result: {sequence: [1, {$expression: order * 2}]}, outcome: aborted, when: {order: 4}}]
        """
        if "actionlib_tutorials/Fibonacci" in STORE.names("action")
        else "{}"
    )
    for type_name, goals in plan.actions.values():
        goal = STORE.action(type_name).goal.check({"order": 4}, 0)
        assert goals[0].fits(goal)
        assert goals[0].result(MessageTime(0, 0, None, goal)).sequence == [1, 8]


def test_recording_leaves_out_the_topics_of_the_file() -> None:
    plan = plan_of("topics: {imu: {type: std_msgs/String, rate: 1}}\nrecordings: [{file: drive.mcap}]")
    assert [track.name for track in plan.recordings[0].tracks] == ["/scan"]


def test_stamps_of_a_recorded_message_are_taken_out() -> None:
    header = {"seq": 1, "stamp": {"sec": 1}, "frame_id": "a"}
    value = {"header": header, "list": [{"header": header}], "stamp": 3}
    assert without_stamps(value) == {
        "header": {"frame_id": "a"},
        "list": [{"header": {"frame_id": "a"}}],
        "stamp": 3,
    }


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("3", "robot.yaml:1: expected an object, got 3"),
        ("topic: {}", "robot.yaml:1: topic: expected one of node, seed, topics, "),
        (
            "topics: {/x: {type: std_msgs/Float65, rate: 1}}",
            "package std_msgs has no such message (did you mean Float64",
        ),
        ("topics: {/x: {type: nav_msg/Odometry, rate: 1}}", "(did you mean nav_msgs?)"),
        (
            "topics: {/x: {type: std_msgs/Float64, rate: 1e9}}",
            "topics./x.rate: expected at most 1,000, got 1000000000.0",
        ),
        ("topics: {/x: {type: std_msgs/Float64, rate: 0}}", "topics./x.rate: expected more than 0, got 0"),
        ("topics: {/x y: {type: std_msgs/Float64}}", "expected a name such as /odom"),
        ("topics: {/mock/a: {type: std_msgs/Float64}}", "the mock's own names begin with /mock/"),
        ("services: {/rosapi/nodes: {type: std_srvs/Trigger}}", "the mock's own names begin with /rosapi/"),
        (
            "topics: {/rosout: {type: std_msgs/String}}",
            "expected rosgraph_msgs/Log, the type of /rosout in each server, got std_msgs/String",
        ),
        ("subscribers: {tf: std_msgs/String}", "expected tf2_msgs/TFMessage, the type of /tf in each server"),
        (
            "topics: {/a: {type: std_msgs/Bool}, a: {type: std_msgs/Bool}}",
            "topics.a: expected another name: it is there",
        ),
        (
            "topics: {/x: {type: std_msgs/Float64, value: {dat: 1}}}",
            "value.dat: std_msgs/Float64 does not have this field",
        ),
        ("topics: {/x: {type: std_msgs/Float64, value: {data: a}}}", "value.data: std_msgs/Float64 message requires a"),
        (
            "topics: {/x: {type: std_msgs/Float64, value: 3}}",
            "value: expected an object with fields of std_msgs/Float64",
        ),
        ("topics: {/x: {type: std_msgs/Int8, value: {data: 300}}}", "got 300, which is out of its range (-128 to 127)"),
        ("topics: {/x: {type: std_msgs/Int8, value: {data: {$sin: {}}}}}", "(did you mean $sine?)"),
        (
            "topics: {/x: {type: std_msgs/Int8, value: {data: {$sine: {perod: 1}}}}}",
            "topics./x.value.data.$sine.perod: expected one of amplitude, period, offset, phase (did you mean period?)",
        ),
        ("topics: {/x: {type: std_msgs/String, value: {data: {$sine: {}}}}}", "expected for a string another pattern"),
        ("topics: {/x: {type: std_msgs/Header, value: {stamp: {$sine: {}}}}}", "expected for a time another pattern"),
        (
            "topics: {/x: {type: std_msgs/Int8, value: {data: {$list: []}}}}",
            "$list: expected at least 1 entries, got a",
        ),
        ("topics: {/x: {type: std_msgs/String, value: {data: {$file: /etc/passwd}}}}", "expected a file in the folder"),
        ("topics: {/x: {type: std_msgs/String, value: {data: {$file: a/../../b}}}}", "expected a file in the folder"),
        ("topics: {/x: {type: std_msgs/String, value: {data: {$file: 'C:\\b'}}}}", "expected a file in the folder"),
        (
            "topics: {/x: {type: std_msgs/String, value: {data: {$file: no.txt}}}}",
            "$file: no.txt: expected no files here",
        ),
        (
            "topics: {/x: {type: std_msgs/String, value: {data: {$file: front.jpg}}}}",
            "front.jpg: expected a text in UTF-8",
        ),
        (
            "topics: {/x: {type: std_msgs/Int8, value: {data: {$csv: {file: drive.csv, column: sped}}}}}",
            "drive.csv: no column 'sped' (did you mean speed?); it has time, speed",
        ),
        (
            "topics: {/x: {type: std_msgs/Int8, value: {data: {$csv: {file: empty.csv, column: speed}}}}}",
            "empty.csv: expected rows below the names of the columns",
        ),
        (
            "topics: {/x: {type: std_msgs/Int8, value: {data: {$csv: {file: note.txt, column: hello}}}}}",
            "note.txt: expected rows",
        ),
        ("topics: {/x: {type: std_msgs/Int8, value: {data: {$expression: open('x')}}}}", "no function open()"),
        (
            "topics: {/x: {type: std_msgs/Int8, value: {data: {$expression: (1).real}}}}",
            "expected a name without points",
        ),
        ("topics: {/x: {type: std_msgs/Int8, value: {data: {$expression: /y.data}}}}", "no topic /y here"),
        ("topics: {/speed: {type: std_msgs/Int8, value: {data: {$expression: /sped.data}}}}", "(did you mean /speed?)"),
        (
            "topics: {/x: {type: std_msgs/Int8, value: {data: {$expression: /x.dta}}}}",
            "has no field dta (did you mean data?)",
        ),
        (
            "topics: {/x: {type: std_msgs/Header, value: {seq: {$expression: /x.stamp}}}}",
            "expected a single number or text",
        ),
        (
            "topics: {/x: {type: std_msgs/Header, value: {seq: {$expression: /x.seq.a}}}}",
            "expected a single number or text",
        ),
        (
            "topics: {/x: {type: nav_msgs/Odometry, value: {pose: {covariance: [{$sine: {}}]}}}}",
            "covariance: expected 36 entries, got 1",
        ),
        (
            "topics: {/x: {type: nav_msgs/Odometry, value: {pose: {covariance: [1]}}}}",
            "requires a float64[36] for field covariance, but got 1 elements",
        ),
        ("services: {/x: {type: std_srvs/SetBol}}", "(did you mean SetBool?)"),
        (
            "services: {/x: {type: std_srvs/SetBool, answers: [{when: {dat: 1}}]}}",
            "answers[0].when.dat: std_srvs/SetBoolRe",
        ),
        ("services: {/x: {type: std_srvs/SetBool, answers: [{when: dat}]}}", "no value 'dat' (did you mean data?)"),
        ("services: {/x: {type: std_srvs/SetBool, answers: [{when: {data: {$list: [true]}}}]}}", "expected constants"),
        (
            "services: {/x: {type: std_srvs/SetBool, answers: [{fail: a, value: {}}]}}",
            "expected value or fail, got both",
        ),
        ("recordings: [{file: a.bag, topics: [/sacn]}]", "no topic /sacn is recorded (did you mean /scan?)"),
        ("recordings: [{file: ../a.bag}]", "recordings[0].file: expected a file in the folder of the mock's file"),
        ("faults: {x: {kind: close, code: 1005}}", "faults.x: expected a code that a close frame may have"),
        ("faults: {x: {kind: dely}}", "(did you mean delay?)"),
        ("faults: {x: {kind: drop, start: 3, end: 2}}", "faults.x: expected start < end"),
        (
            "topics: {/x: {type: std_msgs/Int8, value: {data: {$random_walk: {low: 1}}}}}",
            "expected low and high, or neither",
        ),
        (
            "topics: {/x: {type: std_msgs/Int8, value: {data: {$counter: {end: -1}}}}}",
            "expected an end that the steps reach",
        ),
        (
            "topics: {" + ", ".join(f"/x{i}: {{type: std_msgs/Int8, rate: 1000}}" for i in range(101)) + "}",
            "topics: expected at most 100,000 messages a second, got 101,000",
        ),
        (
            "topics: {" + ", ".join(f"/x{i}: {{type: std_msgs/Int8}}" for i in range(2_001)) + "}",
            "topics: expected at most 2,000 entries",
        ),
    ],
)
def test_mistake_is_told_in_one_line_with_its_place(text: str, line: str) -> None:
    found = mistakes_of(text)
    assert len(found) == 1
    assert line in found[0]
    assert found[0].startswith("robot.yaml:1")
    assert "\n" not in found[0]


def test_all_mistakes_are_told_in_the_order_of_the_lines() -> None:
    text = "services:\n  /s: {type: a/B}\ntopics:\n  /x: {type: std_msgs/Int8, value: {dta: 1, data: b}}\n"
    assert [line.partition(": ")[0] for line in mistakes_of(text)] == ["robot.yaml:2", "robot.yaml:4", "robot.yaml:4"]


@pytest.mark.parametrize("page", ["guides/mock.md", "reference/mock.md"])
def test_examples_of_the_documentation_are_good(page: str) -> None:
    text = (DOCS / page).read_text()
    (example,) = re.findall(r"```yaml\n(topics:.*?)```", text, re.DOTALL)
    for store in (STORE, STORE_2):
        plan_of(example, store)
