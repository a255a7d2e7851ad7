"""The line of a campaign's progress."""

from __future__ import annotations

import pytest

from rosbridge_sim.campaign_runs.running import Progress


@pytest.mark.parametrize(
    ("progress", "now", "line"),
    [
        (Progress(48, began=100.0), 100.0, "........................] 0 of 48  0.0/s  0 not passed  ..."),
        (Progress(48, 12, 3, began=100.0), 124.0, "######..................] 12 of 48  0.5/s  3 not passed  1:12 left"),
        # What a resumed campaign has at its start counts as done, and not in the rate.
        (Progress(48, 24, 0, 100.0, 12), 124.0, "############............] 24 of 48  0.5/s  0 not passed  0:48 left"),
        (Progress(0, began=100.0), 101.0, "........................] 0 of 0  0.0/s  0 not passed  ..."),
        (Progress(9_000, 9_000, 1_500, 0.0), 900.0, "#" * 24 + "] 9,000 of 9,000  10.0/s  1,500 not passed  0:00 left"),
    ],
)
def test_line_tells_counts_rate_and_time_left(progress: Progress, now: float, line: str) -> None:
    assert progress.line(now) == f"[{line}"
