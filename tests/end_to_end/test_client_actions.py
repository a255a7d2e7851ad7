"""Actions between real clients: actionlib's five topics of ROS 1, and the ops of ROS 2."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from tests.end_to_end.programs import finish, is_python, start
from tests.support import Frame, ServerProcess, read_line

pytestmark = [pytest.mark.client, pytest.mark.slow]

TYPE = "actionlib_tutorials/Fibonacci"

STEPS = [[0, 1, 1], [0, 1, 1, 2], [0, 1, 1, 2, 3], [0, 1, 1, 2, 3, 5]]

WHOLE = {"feedback": STEPS, "sequence": STEPS[-1]}
CANCELLED = {"feedback": STEPS[:1], "sequence": []}
"""Over topics: no client library puts a result into a message of preemption."""

OVER_TOPICS = (  # each library performs once and asks once
    ("roslibpy-twisted", "roslib2"),
    ("roslib2", "roslib1"),
    ("roslib1", "roslibpy-asyncio"),
    ("roslibpy-asyncio", "roslibpy-twisted"),
)


@contextmanager
def performing(library: str, role: str, port: int, name: str) -> Iterator[None]:
    """A program that performs an action as long as this lasts, and ends well."""
    program = start(library, "actions", port, role, name, TYPE)
    try:
        assert json.loads(read_line(program)) == {"ready": name}
        yield
    finally:
        finish(program)


def name_of(*libraries: str) -> str:
    return "/" + "_".join(libraries).replace("-", "_") + "/fibonacci"


@pytest.mark.parametrize(("performer", "asker"), OVER_TOPICS)
def test_action_works_over_the_topics_of_actionlib(server: ServerProcess, performer: str, asker: str) -> None:
    name = name_of(performer, asker)
    with performing(performer, "perform_over_topics", server.port, name):
        seen = finish(start(asker, "actions", server.port, "ask_over_topics", name, TYPE))
    whole: Frame = {**WHOLE} if is_python(asker) else {**WHOLE, "status": 3}  # succeeded; roslibpy does not say
    cancelled: Frame = {**CANCELLED} if is_python(asker) else {**CANCELLED, "status": 2}  # preempted
    assert seen == {"whole": whole, "cancelled": cancelled, "cancelled_by_all": cancelled, "is_listed": True}


def test_action_ops_work_between_two_roslib_clients(server: ServerProcess) -> None:
    name = name_of("roslib2", "roslib2")
    with performing("roslib2", "perform", server.port, name):
        seen = finish(start("roslib2", "actions", server.port, "send", name, TYPE))
    cancelled = {"feedback": STEPS[:1], "error": 'GoalError: Action was canceled: {"sequence":[0,1,1]}'}
    assert seen == {
        "whole": WHOLE,
        "cancelled": cancelled,
        "cancelled_by_all": cancelled,
        "failed": {"feedback": [], "error": 'GoalError: Action was aborted: {"sequence":[]}'},
        "is_listed": True,
    }


@pytest.mark.parametrize("asker", ["roslibpy-twisted", "roslibpy-asyncio"])
def test_action_ops_work_between_roslib_and_roslibpy(server: ServerProcess, asker: str) -> None:
    name = name_of("roslib2", asker)
    with performing("roslib2", "perform", server.port, name):
        seen = finish(start(asker, "actions", server.port, "send", name, TYPE.replace("/", "/action/")))
    assert seen == {
        "whole": {"feedback": STEPS, "values": {"sequence": STEPS[-1]}, "status": "SUCCEEDED"},
        "cancelled": {"feedback": STEPS[:1], "values": {"sequence": STEPS[0]}, "status": "CANCELED"},
        "failed": {"feedback": [], "values": {"sequence": []}, "status": "ABORTED"},
        "is_listed": True,
    }
