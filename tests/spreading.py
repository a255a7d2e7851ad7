"""How tests are spread over processes: one file at a time in each, those of one browser together, some test by test."""

from __future__ import annotations

from typing import TYPE_CHECKING

from xdist.scheduler import LoadFileScheduling

if TYPE_CHECKING:
    import pytest
    from xdist.remote import Producer
    from xdist.workermanage import WorkerController

__all__ = ["APART", "TOGETHER", "FilesTogether"]

_WITH_WEBGL = ("drawn", "map", "sensors", "views")
_WITHOUT = (
    *("campaign_report", "connection", "cost", "documentation", "driving", "graph", "language", "page"),
    *("panels", "replay", "start", "text_only", "timeline"),
)

TOGETHER = {
    **{f"tests/page/test_{name}.py": "pages with WebGL" for name in _WITH_WEBGL},
    **{f"tests/page/test_{name}.py": "pages without WebGL" for name in _WITHOUT},
}
"""Files whose tests share a Chromium: the first picture of one with WebGL takes as long as five tests."""

APART = {
    "tests/end_to_end/test_sensor_programs.py",
    "tests/simulator/test_town_traffic.py",
    "tests/world/many_worlds/test_batch.py",
}
"""Files whose tests share nothing, and of which some take minutes: together they would keep one process busy alone."""


class FilesTogether(LoadFileScheduling):  # type: ignore[misc]  # without type hints
    """Gives files of tests to processes, in their order, as `--dist loadfile` does."""

    def __init__(self, config: pytest.Config, log: Producer | None = None) -> None:
        super().__init__(config, log)
        self._places: dict[WorkerController, dict[str, int]] = {}

    def _split_scope(self, nodeid: str) -> str:
        """Return what is run in one process: the name of a file, of several, or of a test."""
        file: str = super()._split_scope(nodeid)
        return nodeid if file in APART else TOGETHER.get(file, file)

    def _assign_work_unit(self, node: WorkerController) -> None:
        """Give a process the next files. The library would search each of 13,000 tests in a list."""
        scope, tests = self.workqueue.popitem(last=False)
        self.assigned_work.setdefault(node, {})[scope] = tests
        if node not in self._places:
            self._places[node] = {name: i for i, name in enumerate(self.registered_collections[node])}
        places = self._places[node]
        node.send_runtest_some([places[name] for name, is_done in tests.items() if not is_done])
