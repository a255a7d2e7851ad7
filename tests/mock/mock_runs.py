"""A mock on a bus in memory, with a clock that the test moves."""

from __future__ import annotations

from typing import Any

import orjson
import pytest
from msgspec import Raw

from rosbridge_sim.documents.yaml_reading import read_yaml
from rosbridge_sim.graph.bus import Bus
from rosbridge_sim.mock.mock_node import Hook, MockNode
from rosbridge_sim.mock.mock_plan import MockFiles, MockPlan, plan_mock
from rosbridge_sim.schema.definitions.names import Generation
from tests.graph.bus_fixture import make_store
from tests.graph.participants import Somebody


class MockRun:
    """A mock, its bus and one listener; `now` is the time [s]."""

    def __init__(
        self, text: str, hook: Hook | None = None, ros: Generation = 1, files: MockFiles | None = None, seed: int = 0
    ) -> None:
        self.bus = Bus(make_store(ros))
        self.files = files or MockFiles()
        self.said: list[str] = []
        self.seed = seed
        self.node = MockNode(self.bus, hook)
        self.now = 100.0
        self.node.load(self.plan(text), self.now)
        self.listener = Somebody("/listener")
        self.turns = 0

    def plan(self, text: str) -> MockPlan:
        plan, mistakes = plan_mock(
            read_yaml(text, "robot.yaml"), self.bus.store, self.files, self.said.append, seed=self.seed
        )
        assert [mistake.text for mistake in mistakes] == []
        assert plan is not None
        return plan

    def listen(self, topic: str) -> Any:  # noqa: ANN401
        return self.bus.subscribe(self.listener, topic, self.listener.deliver)

    def run(self, seconds: float) -> None:
        """Let the time pass, with a turn whenever something is due."""
        until = self.now + seconds
        while (due := self.node.next_due(self.now)) is not None and due <= until:
            self.now = max(self.now, due)
            self.bus.stamp_ns = round(self.now * 1e9)
            self.node.advance(self.now)
            self.turns += 1
            if self.turns > 100_000:
                pytest.fail("the mock turns on the spot")
        self.now = until

    def heard(self, topic: str) -> list[Any]:
        return [value for name, value in self.listener.heard if name == topic]

    def call(self, service: str, **request: Any) -> None:  # noqa: ANN401
        self.bus.call(self.listener, service, Raw(orjson.dumps(request)), self.listener.answers.append, now=self.now)

    def response(self, index: int = 0) -> Any:  # noqa: ANN401
        """The response to a call, which succeeded."""
        values: Any = self.listener.answers[index].values
        return values.value
