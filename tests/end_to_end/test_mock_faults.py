"""Every fault of a mock as roslibpy and roslib see it: the table of `docs/guides/mock.md`."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import pytest

from tests.end_to_end.programs import finish, is_python, start
from tests.support import ServerProcess

pytestmark = [pytest.mark.client, pytest.mark.slow]

NUM = 15

FAULTS = {
    "/dropped": "{kind: drop, probability: 0.5}",
    "/doubled": "{kind: duplicate}",
    "/frozen": "{kind: freeze}",
    "/nan": "{kind: nan}",
    "/wrong": "{kind: wrong_type}",
    "/late": "{kind: delay, seconds: 0.4, jitter: 0.1}",
}
TOPICS = ("/plain", *FAULTS)


def write_mock(path: Path) -> Path:
    lines = ["topics:"]
    lines += [f"  {name}: {{type: std_msgs/Float64, rate: 20, value: {{data: {{$counter: {{}}}}}}}}" for name in TOPICS]
    lines += ["services:"]
    lines += [
        f"  {name}: {{type: std_srvs/Trigger, answers: [{{value: {{success: true}}}}]}}"
        for name in ("/failing", "/slow")
    ]
    lines += ["faults:"]
    lines += [f"  {name[1:]}: {rule.replace('{', '{topics: [' + name + '], ', 1)}" for name, rule in FAULTS.items()]
    lines += [
        "  failing: {kind: fail, services: [/failing], text: the motor is off}",
        "  slow: {kind: slow, services: [/slow], seconds: 0.5}",
        "  lost: {kind: drop, direction: from_clients, topics: [/lost], clients: [1]}",
        "  twice: {kind: duplicate, direction: from_clients, topics: [/twice]}",
        "  close: {kind: close, code: 4001, text: bye, on: false}",
    ]
    path.write_text("\n".join(lines))
    return path


@pytest.mark.parametrize("library", ["roslibpy-twisted", "roslib2"])
def test_every_fault_is_seen_by_a_client(tmp_path: Path, library: str) -> None:
    server = ServerProcess(tmp_path / "log.txt", ["--mock", str(write_mock(tmp_path / "robot.yaml")), "--no-world"])
    try:
        seen = finish(start(library, "faults", server.port, "watch", str(NUM), *TOPICS))
    finally:
        server.stop_cleanly()
    heard = seen["heard"]
    steps = {
        name: [b - a for a, b in pairwise(values)] for name, values in heard.items() if name not in {"/nan", "/wrong"}
    }
    assert min(steps["/plain"]) >= 1
    assert max(steps["/dropped"]) > 1
    assert heard["/doubled"][::2][:7] == heard["/doubled"][1::2]
    assert set(steps["/frozen"]) == {0}
    assert heard["/nan"] == [None] * NUM
    assert all(isinstance(value, str) for value in heard["/wrong"])
    assert min(steps["/late"]) >= 1
    behind = [
        plain - late for plain, late in zip(seen["beside"]["/late"], heard["/late"], strict=True) if plain is not None
    ]
    assert behind[0] >= 5  # 0.3 s at 20 Hz, and one message of chance
    assert "the motor is off" in str(seen["answers"]["/failing"])
    assert seen["answers"]["/slow"]["success"] is True
    assert seen["answers"]["/slow seconds"] > 0.49
    assert seen["sent"]["/lost"] == []
    assert seen["sent"]["/twice"] == [value for value in range(NUM) for _ in range(2)]
    if not is_python(library):
        assert seen["closed"] == {"code": 4001, "reason": "bye"}
