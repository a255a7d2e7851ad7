"""Mistakes in requests of `/sim/sensors`. What the service does is in `sensors/test_mounted_sensors.py`."""

from __future__ import annotations

import json

import pytest

from rosbridge_sim.graph.topics_services import Answer
from rosbridge_sim.simulator.sensors import sensor_presets
from tests.simulator.sensors.analytic_makers import AtOnceWorker
from tests.simulator.sim_harness import ManualReader, SimHarness

WRONG = {"add": '{"camera": [{"fov": 180}]}'}


def test_first_mistake_is_worded_in_a_thread_of_the_reader(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sensor_presets._DOCUMENT, "knows_mistakes", False)
    reader = ManualReader()
    harness = SimHarness(reader=reader, worker=AtOnceWorker())
    client = harness.client()
    answers: list[Answer] = []
    harness.bus.call(client, "/sim/sensors", WRONG, answers.append, now=0.0)
    assert answers == []
    reader.hand_over()
    (answer,) = answers
    assert json.loads(answer.values.json)["message"] == "add: camera[0].fov: expected at most 170, got 180"  # type: ignore[attr-defined]
