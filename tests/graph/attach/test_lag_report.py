"""Log lines about a bridge that does not keep up: few, and each with the counts that it is made of."""

from __future__ import annotations

from rosbridge_sim.graph.attach.lag_report import LagReport


class Periods:
    """Periods of a hundred messages each."""

    def __init__(self) -> None:
        self.report = LagReport("topic messages", "do something")
        self._offered = self._dropped = 0

    def add(self, num_dropped: int, num: int = 100) -> str:
        self._offered += num
        self._dropped += num_dropped
        return self.report.note_period(self._offered, self._dropped, 0.25)


def test_line_about_a_slow_bridge_has_its_counts_and_advice() -> None:
    periods = Periods()
    assert periods.add(9) == ""
    assert periods.add(10) == (
        "it is too slow: 10 of 100 topic messages of the last 5 s were left out, and only the newest of each topic are"
        " sent; data was up to 0.25 s old there; do something"
    )
    assert periods.add(90) == ""
    assert periods.add(1) == (
        "it is fast enough again: 1 of 100 topic messages of the last 5 s were left out, 110 since it connected; data"
        " was up to 0.25 s old there"
    )


def test_bridge_that_is_slow_now_and_then_gives_ever_fewer_lines() -> None:
    periods = Periods()
    lines = [line for i in range(1_000) if (line := periods.add(50 if i % 40 == 0 else 0))]
    assert len(lines) <= 14


def test_period_without_messages_says_nothing() -> None:
    periods = Periods()
    assert periods.add(50)
    assert [periods.add(0, num=0) for _ in range(100)] == [""] * 100
    assert periods.add(0)


def test_counters_of_a_new_socket_are_counted_from_zero() -> None:
    report = LagReport("topic messages", "do something")
    assert report.note_period(1_000, 0, 0.0) == ""
    report.restart()
    assert report.note_period(100, 50, 0.0).startswith("it is too slow: 50 of 100 ")
