"""Verdicts about what came, by a play with clients in memory."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import pytest

from rosbridge_sim.doctor.check import Check
from rosbridge_sim.doctor.examination import CheckResult, Verdict, examine

ASK = {"op": "call_service", "service": "/s", "id": "x"}
ANSWER = {"op": "service_response", "service": "/s", "values": {"a": 1}, "result": True, "id": "x"}
STATUS = {"op": "status", "level": "error", "msg": "no"}


class Told:
    """Clients to which these frames come.

    Attributes:
        sent: the frames that were sent.
        waits: numbers of frames that had been sent when all clients waited for the server.
    """

    def __init__(self, frames: Sequence[Any]) -> None:
        self._frames = list(frames)
        self.sent: list[str | bytes] = []
        self.waits: list[int] = []

    async def send(self, _name: str, frame: str | bytes) -> None:
        self.sent.append(frame)

    async def settle(self) -> None:
        self.waits.append(len(self.sent))

    async def next(self, _name: str, *, is_status: bool) -> Any:  # noqa: ANN401 - a frame
        found = next((frame for frame in self._frames if (frame.get("op") == "status") == is_status), None)
        if found is not None:
            self._frames.remove(found)
        return found

    async def rest(self, _name: str) -> Sequence[Any]:
        return self._frames

    async def close(self, _name: str) -> None: ...


Frames = Sequence[dict[str, Any]]


async def judge(
    expected: Frames, came: Frames, source: str = "protocol text", section: str = "s", ros: int = 1
) -> CheckResult:
    check = Check(f"{section}/x", source, "z", [{"a>": ASK}, *({"a<": frame} for frame in expected)])
    return await examine(check, Told(came), ros)


@pytest.mark.parametrize(
    ("expected", "came"),
    [
        ([ANSWER], [ANSWER]),
        ([STATUS], [STATUS | {"msg": "in other words"}]),
        ([ANSWER | {"values": "no", "result": False}], [ANSWER | {"values": "in other words", "result": False}]),
        ([{"type": "std_msgs/String"}], [{"type": "std_msgs/msg/String"}]),
        ([{"stamp": {"secs": 1, "nsecs": 2}}], [{"stamp": {"sec": 1, "nanosec": 2}}]),
        ([{"header": {"seq": 1, "frame_id": "m"}}], [{"header": {"frame_id": "m"}}]),
        ([{"secs": {"$now": 0}}], [{"secs": 1_700_000_000}]),
        ([ASK | {"id": "service_request:/s:1"}], [ASK | {"id": "anything"}]),
    ],
)  # fmt: skip
async def test_what_a_server_may_choose_conforms(expected: Frames, came: Frames) -> None:
    assert (await judge(expected, came)).verdict is Verdict.CONFORMS


@pytest.mark.parametrize(
    ("expected", "came", "verdict", "words"),
    [
        ([ANSWER], [], Verdict.MISSING, "got nothing"),
        ([ANSWER], [ANSWER | {"result": False}], Verdict.DEVIATES, '"result": false'),
        ([ANSWER], [ANSWER | {"more": 1}], Verdict.DEVIATES, '"more"'),
        ([ANSWER], [ANSWER, ANSWER], Verdict.DEVIATES, "also got"),
        ([], [STATUS], Verdict.DEVIATES, "also got"),
        ([STATUS], [], Verdict.DIFFERS, "as rosbridge_suite, which sends no status"),
        ([STATUS, ANSWER], [ANSWER], Verdict.DIFFERS, "as rosbridge_suite, which sends no status"),
        ([STATUS], [STATUS | {"level": "info"}], Verdict.DEVIATES, '"level": "info"'),
        ([{"$either": [ANSWER, ["a known server", STATUS]]}], [STATUS | {"op": "other"}], Verdict.DEVIATES, "other"),
    ],
)  # fmt: skip
async def test_what_breaks_the_protocol_is_told(expected: Frames, came: Frames, verdict: Verdict, words: str) -> None:
    found = await judge(expected, came)
    assert found.verdict is verdict
    assert words in found.reason


async def test_what_nothing_prescribes_only_differs() -> None:
    found = await judge([ANSWER], [], "our decision; the reference is silent")
    assert found.verdict is Verdict.DIFFERS
    assert "the reference is silent" in found.reason


async def test_what_a_reference_sends_differs_by_its_name() -> None:
    known = ANSWER | {"values": {"_a": 1}}
    found = await judge([{"$either": [ANSWER, ["rosbridge_suite 2.1.0", known]]}], [known])
    assert (found.verdict, found.reason) == (Verdict.DIFFERS, "as rosbridge_suite 2.1.0")


@pytest.mark.parametrize(("ros", "verdict"), [(1, Verdict.DIFFERS), (2, Verdict.MISSING)])
async def test_server_of_ros_1_need_not_know_actions(ros: int, verdict: Verdict) -> None:
    assert (await judge([ANSWER], [], "rosbridge_suite 2.1.0", "actions", ros)).verdict is verdict


async def test_id_that_the_server_has_chosen_is_used_in_the_answer() -> None:
    request = {"op": "call_service", "service": "/s", "args": {}, "id": "service_request:/s:1"}
    clients = Told([request | {"id": "theirs"}])
    check = Check("s/x", "y", "z", [{"a<": request}, {"a>": {"op": "service_response", "id": "service_request:/s:1"}}])
    found = await examine(check, clients, 1)
    assert found.verdict is Verdict.CONFORMS
    assert clients.sent == ['{"op": "service_response", "id": "theirs"}']


async def test_pieces_are_joined_whatever_their_lengths() -> None:
    def piece(data: str, num: int, total: float) -> dict[str, Any]:
        return {"op": "fragment", "id": "f", "data": data, "num": num, "total": total}

    expected = [piece('{"a":', 0, 2), piece("1}", 1, 2)]
    assert (
        await judge(expected, [piece('{"a', 0, 3.4), piece('": ', 1, 3.4), piece("1}", 2, 3.4)])
    ).verdict is Verdict.CONFORMS
    assert (await judge(expected, [piece('{"a', 0, 2), piece("2}", 1, 2)])).verdict is Verdict.DEVIATES


@pytest.mark.parametrize(
    ("first", "second", "waits"),
    [
        ("a advertise", "a subscribe", [2]),
        ("a advertise", "a publish", [1, 2]),
        ("a advertise", "b subscribe", [1, 2]),
        ("a publish", "a publish", [1, 2]),
        ("a call_service", "b publish", [2]),
    ],
)
async def test_what_has_no_answer_has_worked_before_anything_that_may_depend_on_it(
    first: str, second: str, waits: list[int]
) -> None:
    clients = Told([])
    steps = [{f"{name}>": {"op": op}} for name, op in (first.split(), second.split())]
    await examine(Check("s/x", "y", "z", steps), clients, 1)
    assert (clients.waits, len(clients.sent)) == (waits, 2)


async def test_lists_are_compared_as_ros_1_writes_them() -> None:
    expected = {"types": ["std_msgs/String"], "stamps": [{"secs": 1, "nsecs": 2}]}
    came = {"types": ["std_msgs/msg/String"], "stamps": [{"sec": 1, "nanosec": 2}]}
    assert (await judge([expected], [came])).verdict is Verdict.CONFORMS
    assert (await judge([expected], [came | {"types": []}])).verdict is Verdict.DEVIATES


async def test_wrong_answer_about_an_action_deviates_though_a_server_of_ros_1_need_not_know_actions() -> None:
    found = await judge([ANSWER], [ANSWER | {"result": False}], "rosbridge_suite 2.1.0", "actions", 1)
    assert found.verdict is Verdict.DEVIATES


async def test_answer_that_is_no_object_is_told_and_not_taken_for_one() -> None:
    class Odd(Told):
        async def next(self, _name: str, *, is_status: bool) -> Any:  # noqa: ANN401 - any frame
            return None if is_status else ["odd"]

    check = Check("s/x", "protocol text", "z", [{"a>": ASK}, {"a<": ASK}])
    found = await examine(check, Odd([]), 1)
    assert found.verdict is Verdict.DEVIATES
    assert "odd" in found.reason
