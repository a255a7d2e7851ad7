"""Limits against traces, tables, comparisons and the search: pure functions on a few frames."""

from __future__ import annotations

import csv
import io
import math
from collections import deque
from xml.etree import ElementTree as ET

import pytest

from rosbridge_sim.campaign_runs.searching import load_strategy
from rosbridge_sim.campaigns.campaign import read_campaign
from rosbridge_sim.campaigns.comparison import compare_results
from rosbridge_sim.campaigns.drive_limits import OwnCheck, judge_trace
from rosbridge_sim.campaigns.own_limits import OwnLimits
from rosbridge_sim.campaigns.run_results import Breach, Result, Run, Verdict
from rosbridge_sim.campaigns.search import Search
from rosbridge_sim.campaigns.tables import write_junit, write_table
from rosbridge_sim.campaigns.trace import FIGURES, Trace
from rosbridge_sim.errors import DocumentError


def trace_of(**columns: list[float]) -> Trace:
    """A drive of some frames; figures that are not given are 0, times to collision inf."""
    num = max(map(len, columns.values()))
    given = {"time": [0.02 * (i + 1) for i in range(num)], **columns}
    for name in ("time_to_collision", "min_time_to_collision"):
        given.setdefault(name, [math.inf] * num)
    rows = [tuple(given.get(name, [0.0] * num)[i] for name in FIGURES) for i in range(num)]
    return Trace(rows, {"gap": 3.0, "seed": 0}, deque())


def breaches(limits: dict[str, object], trace: Trace, **checks: OwnCheck) -> list[tuple[str, float]]:
    values = {"scenario": "town", "parameters": {"gap": [1.0]}, "limits": limits}
    campaign = read_campaign(values, "c")
    own = OwnLimits(campaign.limits)
    for i in range(len(trace.rows)):
        own.take(trace.at(i))
    found = judge_trace(trace, campaign.limits, checks, own.end())
    assert own.trouble == ""
    return [(breach.limit, breach.time) for breach in found]


@pytest.mark.parametrize(
    ("limits", "expected"),
    [
        ({"collisions": 0}, [("collisions", 0.06)]),
        ({"collisions": 1}, []),
        ({"time_to_collision": 1.0}, [("time_to_collision", 0.04)]),
        ({"time_to_collision": 0.4}, []),
        ({"distance": 2.0}, []),
        ({"distance": 3.0}, [("distance", 0.08)]),
        ({"arrival": {"x": 3.0, "y": 0.0, "radius": 0.5}}, []),
        ({"arrival": {"x": 3.0, "y": 0.0, "radius": 0.5, "within": 0.05}}, [("arrival", 0.04)]),
        ({"arrival": {"x": 9.0, "y": 0.0}}, [("arrival", 0.08)]),
        ({"own": {"slow": {"always": "speed < 2.5"}}}, [("slow", 0.06)]),
        ({"own": {"slow": {"always": "speed < 1.5", "after": 0.07}}}, [("slow", 0.08)]),
        ({"own": {"slow": {"always": "max(speed) < 2.5"}}}, [("slow", 0.06)]),
        ({"own": {"slow": {"end": "max(speed) < 3.5 and mean(speed) == 2 and count(speed > 1) == 3"}}}, []),
        ({"own": {"slow": {"end": "max(speed) < 2.5"}}}, [("slow", 0.08)]),
        ({"own": {"slow": {"always": "max(speed) < 2.5", "after": 0.07}}}, []),
        ({"own": {"near": {"end": "distance < gap"}}}, []),
        ({"own": {"far": {"end": "distance > gap"}}}, [("far", 0.08)]),
        ({"collisions": 0, "time_to_collision": 1.0}, [("time_to_collision", 0.04), ("collisions", 0.06)]),
    ],
)
def test_limit_is_broken_at_its_first_frame(limits: dict[str, object], expected: list[tuple[str, float]]) -> None:
    trace = trace_of(
        speed=[1.0, 2.0, 3.0, 2.0],
        x=[0.0, 1.0, 2.0, 3.0],
        distance=[0.5, 1.0, 2.0, 2.5],
        collisions=[0, 0, 1, 1],
        time_to_collision=[math.inf, 0.5, 0.7, math.inf],
        min_time_to_collision=[math.inf, 0.5, 0.5, 0.5],
    )
    assert breaches(limits, trace) == expected


def test_function_of_the_user_judges() -> None:
    limits: dict[str, object] = {"own": {"mine": {"python": "a.py:f"}}}
    trace = trace_of(speed=[1.0, 2.0])
    assert breaches(limits, trace, mine=lambda _trace: None) == []
    assert breaches(limits, trace, mine=lambda trace: f"too fast: {trace.column('speed')[-1]}") == [("mine", 0.04)]
    with pytest.raises(DocumentError, match=r"limits\.own\.mine: expected None, or a text"):
        breaches(limits, trace, mine=lambda _trace: 3)


def result(number: int, verdict: Verdict = "pass", *, gap: float = 1.0, reason: str = "", state: str = "a") -> Result:
    run = Run(number, "town", "ours", 0, {"gap": gap})
    found = (Breach("collisions", "expected at most 0, got 1", 1.0, 2.0, 3.0),) if verdict == "fail" else ()
    return Result(run, verdict, reason, found, {"distance": 5.0, "min_time_to_collision": math.inf}, 10, state)


def test_result_comes_back_from_its_line() -> None:
    for each in (result(1), result(2, "fail", reason="x")):
        assert Result.from_json(each.to_json()) == each


def test_table_has_no_times_and_no_formulas() -> None:
    table = write_table([result(1), result(2, "fail", reason="=cmd()")], ["gap"])
    rows = list(csv.DictReader(io.StringIO(table)))
    assert [row["verdict"] for row in rows] == ["pass", "fail"]
    assert rows[0]["min_time_to_collision"] == "inf"
    assert rows[1]["reason"] == "'=cmd()"
    assert (rows[1]["limit"], rows[1]["at"], rows[1]["x"], rows[1]["y"]) == ("collisions", "1.0", "2.0", "3.0")
    assert not {"wall", "cpu", "worker"} & rows[0].keys()


def test_junit_tells_failures_errors_and_skipped_runs_apart() -> None:
    verdicts: list[Verdict] = ["pass", "fail", "error", "flaky", "skipped"]
    text = write_junit(
        [result(i, verdict, reason='a "<b>" \x00') for i, verdict in enumerate(verdicts, 1)], "night & day"
    )
    suites = ET.fromstring(text)  # noqa: S314 - our own text
    assert suites.attrib | {"tests": "5", "failures": "2", "errors": "1", "skipped": "1"} == suites.attrib
    tags = [[child.tag for child in case] for case in suites.iter("testcase")]
    assert tags == [[], ["failure"], ["error"], ["failure"], ["skipped"]]


def test_comparison_puts_regressions_first() -> None:
    before = [result(1), result(2, "fail", gap=2.0), result(3, gap=3.0), result(4, gap=4.0), result(5, gap=5.0)]
    after = [
        *(result(1, "fail", reason="collisions at 1 s"), result(2, gap=2.0), result(3, gap=3.0)),
        *(result(4, gap=4.0, state="b"), result(6, gap=6.0)),
    ]
    found = compare_results(before, after)
    assert [len(pairs) for pairs in (found.regressions, found.fixed, found.others, found.moved)] == [1, 1, 0, 1]
    assert (found.num_same, len(found.added), len(found.missing)) == (1, 1, 1)
    lines = list(found.lines())
    assert lines[0] == "regressions: 1"
    assert lines[2] == "    pass -> fail: collisions at 1 s"
    assert lines[-3:-1] == ["missing: 1", f"  run {found.missing[0].run.number} {found.missing[0].run.title}"]
    assert found.to_json()["regressions"][0]["reason"] == "collisions at 1 s"


SEARCH = {
    "scenario": "town",
    "parameters": {"a": {"low": 0.0, "high": 10.0}, "b": {"low": -5.0, "high": 5.0}},
    "search": {"worst": "min_time_to_collision", "budget": 120},
}


def search_until_done() -> list[tuple[float, float, float]]:
    search = Search(read_campaign(SEARCH, "c").document, "c", load_strategy())
    found = []
    number = 0
    while asked := search.ask():
        results = []
        for point in asked:
            number += 1
            a, b = float(point["a"]), float(point["b"])
            value = (a - 7.0) ** 2 + (b + 2.0) ** 2
            found.append((value, a, b))
            results.append(
                Result(Run(number, "town", "ours", 0, point), "pass", scores={"min_time_to_collision": value})
            )
        search.tell(results)
    return found


def test_search_finds_the_worst_within_its_budget_and_finds_it_again() -> None:
    found = search_until_done()
    assert len(found) <= 120
    assert min(found)[1:] == pytest.approx((7.0, -2.0), abs=0.5)
    assert all(0.0 <= a <= 10.0 and -5.0 <= b <= 5.0 for _, a, b in found)
    assert search_until_done() == found
