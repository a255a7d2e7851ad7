"""Mistakes in requests of `/sim/sensors`. What the service does is in `sensors/test_mounted_sensors.py`."""

from __future__ import annotations

import json

import pytest

from rosbridge_sim.graph.topics_services import Answer
from rosbridge_sim.simulator.sensor_rigs import sensor_presets
from tests.simulator.sensors.analytic_makers import AtOnceWorker
from tests.simulator.sim_harness import ManualReader, SimHarness

WRONG = {"add": '{"camera": [{"fov": 180}]}'}


def test_first_mistake_is_worded_in_a_thread_of_the_reader(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sensor_presets.SENSOR_FILE, "knows_mistakes", False)
    reader = ManualReader()
    harness = SimHarness(reader=reader, worker=AtOnceWorker())
    client = harness.client()
    answers: list[Answer] = []
    harness.bus.call(client, "/sim/sensors", WRONG, answers.append, now=0.0)
    assert answers == []
    reader.hand_over()
    (answer,) = answers
    assert json.loads(answer.values.json)["message"] == "add: camera[0].fov: expected at most 170, got 180"  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    ("request_", "why"),
    [
        ({"move": ['{"frame_id": "gps"}'] * 65}, "move: expected at most 64 in one call, got 65"),
        ({"remove": ["gps"] * 65}, "remove: expected at most 64 in one call, got 65"),
        ({"add": "[" + "[]," * 3_000 + "[]]"}, "add: expected at most 5,000 objects, lists and values, got 6,002"),
        (
            {"move": ["[" + "[]," * 3_000 + "[]]"]},
            "move[0]: expected at most 5,000 objects, lists and values, got 6,002",
        ),
    ],
)
def test_request_with_too_much_is_refused_before_it_is_read(request_: dict[str, object], why: str) -> None:
    answer = SimHarness().client().call("/sim/sensors", request_)
    assert json.loads(answer.values.json)["message"] == why  # type: ignore[attr-defined]
