"""Faults: which ones hold when, by which chance, and messages that they change."""

from __future__ import annotations

import math
from typing import Any

import orjson
import pytest

from rosbridge_sim.documents.document_model import Mistake
from rosbridge_sim.documents.document_reading import check_values
from rosbridge_sim.documents.yaml_reading import read_yaml
from rosbridge_sim.errors import DocumentError
from rosbridge_sim.mock.faults import FaultTable, FaultyClient, changed
from rosbridge_sim.mock.mock_control import FAULTS, SET_FAULT, MockControl
from rosbridge_sim.mock.mock_model import FAULT, FaultWay, MockFault
from rosbridge_sim.schema.message import Message
from tests.graph.bus_fixture import make_store
from tests.mock.mock_runs import MockRun

SECOND = 1_000_000_000


def check_fault(rule: str, name: str = "rule") -> tuple[MockFault | None, list[Mistake]]:
    document = read_yaml(rule, name)
    return check_values(FAULT, document.value, document.where)


def table(seed: int = 0, **rules: str) -> FaultTable:
    faults = {}
    for name, rule in rules.items():
        fault, mistakes = check_fault(rule, name)
        assert mistakes == []
        assert fault is not None
        faults[name] = fault
    return FaultTable(faults, seed)


def test_fault_holds_between_its_times_for_its_topics() -> None:
    faults = table(a="{kind: drop, topics: [/a*], start: 2, end: 3}")
    assert [faults.judge("/ab", at * SECOND // 2, "message") is not None for at in range(8)] == [False] * 4 + [
        True
    ] * 2 + [False] * 2
    assert faults.judge("/b", 2 * SECOND, "message") is None


def test_faults_of_one_message_are_joined() -> None:
    faults = table(a="{kind: delay, seconds: 1}", b="{kind: delay, seconds: 2}", c="{kind: duplicate}", d="{kind: nan}")
    verdict = faults.judge("/x", 0, "message")
    assert verdict is not None
    assert (verdict.delay, verdict.num_copies, verdict.change) == (3.0, 2, "nan")
    dropped = table(a="{kind: duplicate}", b="{kind: drop}").judge("/x", 0, "message")
    assert dropped is not None
    assert dropped.num_copies == 0


def test_chance_and_jitter_come_from_the_seed() -> None:
    def run(seed: int) -> list[float]:
        faults = table(seed, a="{kind: drop, probability: 0.3}", b="{kind: delay, seconds: 1, jitter: 0.5}")
        verdicts = [faults.judge("/x", 0, "message") for _ in range(500)]
        return [-1.0 if each is None or not each.num_copies else each.delay for each in verdicts]

    first = run(1)
    assert first == run(1) != run(2)
    assert 100 < first.count(-1.0) < 200
    delays = [each for each in first if each >= 0]
    assert 0.5 <= min(delays) < 0.6
    assert 1.4 < max(delays) <= 1.5


def test_service_faults_spare_rosapi_unless_a_pattern_names_it_and_the_mock_always() -> None:
    faults = table(a="{kind: fail, text: no}", b="{kind: slow, services: ['*'], seconds: 3}")

    def of(name: str) -> Any:  # noqa: ANN401
        return faults.judge(name, 0, "call")

    assert (of("/x").fail, of("/x").answer_delay) == ("no", 3.0)
    assert (of("/rosapi/topics").fail, of("/rosapi/topics").answer_delay) == (None, 3.0)
    assert of("/mock/set_fault") is None
    assert faults.judge("/mock/faults", 0, "message") is None
    assert faults.judge("/x", 0, "message") is None


def test_faults_from_clients_concern_what_they_publish_and_call() -> None:
    faults = table(
        a="{kind: drop, direction: from_clients, topics: [/x]}",
        b="{kind: delay, direction: from_clients, services: [/s], seconds: 2}",
        c="{kind: fail, direction: from_clients, text: no}",
        d="{kind: duplicate, direction: from_clients}",
    )

    def of(name: str, way: FaultWay) -> Any:  # noqa: ANN401
        return faults.judge(name, 0, way)

    assert (of("/x", "publish").num_copies, of("/y", "publish").num_copies) == (0, 2)
    assert (of("/x", "publish").fail, of("/x", "call").fail, of("/rosapi/topics", "call")) == ("no", "no", None)
    assert [(of(name, "call").delay, of(name, "call").num_copies) for name in ("/s", "/x")] == [(2.0, 1), (0.0, 1)]
    assert of("/x", "message") is None


def test_faults_of_some_clients_are_judged_apart() -> None:
    faults = table(
        a="{kind: drop, clients: [2, '10.0.0.*']}",
        b="{kind: delay, seconds: 1}",
        c="{kind: delay, seconds: 3, clients: ['*:80']}",
    )
    first, second = FaultyClient(number=1, address="[::1]:80"), FaultyClient(number=2, address="[::1]:90")
    away = FaultyClient(number=3, address="10.0.0.7:5000")

    def of(client: FaultyClient) -> tuple[float, int] | None:
        own, all_ = faults.judge("/x", 0, "message", client), faults.judge("/x", 0, "message")
        assert all_ is not None
        verdict = all_ if own is None else all_.joined(own)
        return verdict.delay, verdict.num_copies

    assert [of(client) for client in (first, second, away)] == [(4.0, 1), (1.0, 0), (1.0, 0)]
    assert [faults.rules[name].count for name in "abc"] == [2, 3, 1]


@pytest.mark.parametrize(
    ("rule", "text"),
    [
        (
            "{kind: nan, direction: from_clients}",
            "expected kind delay, drop, duplicate, freeze, fail with direction from_clients",
        ),
        (
            "{kind: close, direction: from_clients}",
            "expected kind delay, drop, duplicate, freeze, fail with direction from_clients",
        ),
        ("{kind: delay, services: [/s]}", "expected topics: delay to_clients concerns no services"),
        ("{kind: freeze, direction: from_clients, services: [/s]}", "freeze from_clients concerns no services"),
        ("{kind: slow, topics: [/x]}", "expected services: slow to_clients concerns no topics"),
        ("{kind: close, topics: [/x]}", "expected services: close to_clients concerns no topics"),
        ("{kind: drop, clients: [0]}", "clients[0]: "),
        ("{kind: drop, direction: in}", "direction: expected one of to_clients, from_clients, got 'in'"),
    ],
)
def test_fault_whose_keys_do_not_fit_is_refused(rule: str, text: str) -> None:
    fault, mistakes = check_fault(rule)
    assert fault is None
    assert text in "\n".join(mistake.text for mistake in mistakes)


def test_connections_are_closed_once_or_every_few_seconds() -> None:
    def closes(rule: str) -> list[int]:
        faults = table(a=rule)
        return [at for at in range(20) if faults.rules["a"].close(at * SECOND)]

    assert closes("{kind: close, start: 3}") == [3]
    assert closes("{kind: close, start: 3, every: 5}") == [3, 8, 13, 18]
    assert closes("{kind: close, every: 5, end: 11}") == [0, 5, 10]
    assert closes("{kind: close, on: false}") == []
    assert table(a="{kind: drop}").next_close() == math.inf


def test_switching_begins_the_times_anew() -> None:
    faults = table(a="{kind: close, start: 1, on: false}", b="{kind: drop, end: 2}")
    faults.rules["a"].switch(is_on=True, now_ns=10 * SECOND)
    assert faults.next_close() == 11 * SECOND
    assert faults.judge("/x", 5 * SECOND, "message") is None
    faults.rules["b"].switch(is_on=True, now_ns=5 * SECOND)
    assert faults.judge("/x", 5 * SECOND, "message") is not None


def test_nan_and_wrong_types_leave_the_message_itself_unchanged() -> None:
    odometry = make_store().message("nav_msgs/Odometry")
    message = Message(odometry, odometry.check({"pose": {"pose": {"position": {"x": 3}}}, "child_frame_id": "base"}, 0))
    before = message.json
    nan = orjson.loads(changed(message, "nan").json)
    assert nan["pose"]["pose"]["position"] == {"x": None, "y": None, "z": None}
    assert nan["pose"]["covariance"] == [None] * 36
    assert nan["header"] == orjson.loads(before)["header"]
    wrong = orjson.loads(changed(message, "wrong_type").json)
    assert wrong["pose"]["pose"]["position"]["x"] == "3.0"
    assert (wrong["child_frame_id"], wrong["header"]["seq"]) == (4, "0")
    assert Message(odometry, message.value).json == before
    text = make_store().message("std_msgs/String")
    word = Message(text, text.check({"data": "abc"}, 0))
    assert changed(word, "nan") is word
    assert orjson.loads(changed(word, "wrong_type").json) == {"data": 3}


def test_nan_reaches_lists_of_messages() -> None:
    path = make_store().message("nav_msgs/Path")
    message = Message(path, path.check({"poses": [{}, {}]}, 0))
    assert [pose.pose.position.x for pose in changed(message, "nan").value.poses] == pytest.approx(
        [math.nan] * 2, nan_ok=True
    )


def control() -> tuple[MockRun, MockControl]:
    run = MockRun("{}")
    made = MockControl(run.bus, run.node, table(slow="{kind: delay, topics: [/x], on: false}"))
    made.show(run.now)
    return run, made


def latched(run: MockRun) -> list[tuple[str, bool]]:
    (message,) = run.bus.topics[FAULTS].latched
    return [(fault.name, fault.active) for fault in message.value.faults]


def test_faults_are_switched_and_shown() -> None:
    run, made = control()
    assert latched(run) == [("slow", False)]
    run.call(SET_FAULT, name="slow", active=True)
    run.call(SET_FAULT, name="lost", active=True, rule="{kind: drop, topics: [/a, /b]}")
    assert latched(run) == [("slow", True), ("lost", True)]
    assert made.faults.judge("/b", run.node.now_ns(run.now), "message") is not None
    run.call(SET_FAULT, name="lost", active=False)
    run.call(SET_FAULT)
    answers = [run.response(i) for i in range(4)]
    assert [answer.success for answer in answers] == [True] * 4
    lost = answers[-1].faults[1]
    assert (lost.name, lost.kind, lost.active, lost.patterns, lost.count) == ("lost", "drop", False, ["/a", "/b"], 1)


@pytest.mark.parametrize(
    ("name", "rule", "text"),
    [
        ("slwo", "", "no fault 'slwo' (did you mean slow?); there are slow"),
        ("x", "{kind: dropp}", "rule:1: kind: expected one of delay, drop, "),
        ("x", "kind: [", "rule:1:8: expected YAML"),
        ("x", "[1]", "rule:1: expected an object, got a list of 1"),
        ("a b", "{kind: drop}", "name: expected a name such as slow_scan"),
        ("", "{kind: drop}", "name: expected a name such as slow_scan"),
    ],
)
def test_mistake_of_a_command_is_told_and_changes_nothing(name: str, rule: str, text: str) -> None:
    run, made = control()
    run.call(SET_FAULT, name=name, active=True, rule=rule)
    assert not run.response().success
    assert run.response().message.startswith(text)
    assert list(made.faults.rules) == ["slow"]


def test_number_of_faults_is_bounded() -> None:
    run, made = control()
    for i in range(199):
        made.set(f"f{i}", "{kind: drop}", is_active=True, now=run.now)
    with pytest.raises(DocumentError, match="expected at most 200 faults"):
        made.set("one_more", "{kind: drop}", is_active=True, now=run.now)
    made.set("f3", "{kind: nan}", is_active=True, now=run.now)
