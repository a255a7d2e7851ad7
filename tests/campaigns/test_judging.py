"""Limits against traces, tables, comparisons and the search: pure functions on a few frames."""

from __future__ import annotations

import csv
import io
import math
from collections import deque
from dataclasses import replace
from typing import Any
from xml.etree import ElementTree as ET

import pytest

from rosbridge_sim.campaign_runs.searching import load_strategy
from rosbridge_sim.campaigns.campaign import read_campaign
from rosbridge_sim.campaigns.comparison import compare_results
from rosbridge_sim.campaigns.drive_limits import OwnCheck, judge_trace
from rosbridge_sim.campaigns.own_limits import OwnLimits
from rosbridge_sim.campaigns.run_results import Breach, Result, Run, Verdict
from rosbridge_sim.campaigns.search import Search
from rosbridge_sim.campaigns.tables import write_junit, write_table, write_times
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
        ({"own": {"slow": {"always": "speed < 1.5", "after": 0.08}}}, [("slow", 0.08)]),
        ({"collisions": 0, "own": {"slow": {"always": "speed < 2.5"}}}, [("collisions", 0.06), ("slow", 0.06)]),
        ({"lane_error": 0.3}, []),  # a sum of frames that is not exact
        ({"time_to_collision": 0.5}, []),
        ({"distance": 2.5}, []),
        ({"arrival": {"x": 2.0, "y": 0.5, "radius": 0.5, "within": 0.06}}, []),
        ({"arrival": {"x": 0.0, "y": 0.0, "within": 0.01}}, [("arrival", 0.02)]),
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
        max_lane_offset=[0.1, 0.1, 0.1 + 0.2, 0.1 + 0.2],
    )
    assert breaches(limits, trace) == expected


@pytest.mark.parametrize(
    ("limits", "text"),
    [
        ({"lane_error": 1.0}, "expected at most 1 m, got 2.5 m"),
        ({"time_to_collision": 1.0}, "expected at least 1 s, got 0.5 s"),
        ({"distance": 3.0}, "expected at least 3 m, got 2 m"),
        ({"arrival": {"x": 3.0, "y": 4.0}}, "expected to be within 5 m of (3, 4), got 5.5 m at the nearest"),
        (
            {"arrival": {"x": 0.0, "y": 0.0, "radius": 1.0, "within": 0.03}},
            "expected to be within 1 m of (0, 0) within 0.03 s, got 2 m at the nearest",
        ),
        (
            {"arrival": {"x": 0.0, "y": 0.0, "within": 0.01}},
            "expected to be within 5 m of (0, 0) within 0.01 s, got nothing at the nearest",
        ),
    ],
)
def test_breach_tells_what_was_expected_and_what_came(limits: dict[str, object], text: str) -> None:
    trace = trace_of(
        y=[-2.0, -1.5, 9.5],
        x=[0.0, 3.0, 3.0],
        distance=[0.0, 1.0, 2.0],
        max_lane_offset=[0.0, 2.0, 2.5],
        min_time_to_collision=[math.inf, 0.75, 0.5],
    )
    (breach,) = judge_trace(trace, read_campaign({"scenario": "town", "limits": limits}, "c").limits, {})
    assert breach.text == text


def test_function_of_the_user_judges() -> None:
    limits: dict[str, object] = {"own": {"mine": {"python": "a.py:f"}}}
    trace = trace_of(speed=[1.0, 2.0, 1.5], x=[0.0, 0.0, 1.23456])
    assert breaches(limits, trace, mine=lambda _trace: None) == []
    assert breaches(limits, trace, mine=lambda trace: f"too fast: {trace.column('speed')[-1]}") == [("mine", 0.06)]
    told = judge_trace(trace, read_campaign({"scenario": "town"}, "c").limits, {"long": lambda _trace: "x" * 1_000})
    assert (told[0].time, told[0].x) == (0.06, 1.23)
    assert len(told[0].text) <= 203  # with the dots
    with pytest.raises(DocumentError, match=r"limits\.own\.mine: expected None, or a text"):
        breaches(limits, trace, mine=lambda _trace: 3)


def result(number: int, verdict: Verdict = "pass", *, gap: float = 1.0, reason: str = "", state: str = "a") -> Result:
    run = Run(number, "town", "ours", 0, {"gap": gap})
    found = (Breach("collisions", "expected at most 0, got 1", 1.0, 2.0, 3.0),) if verdict == "fail" else ()
    return Result(run, verdict, reason, found, {"distance": 5.0, "min_time_to_collision": math.inf}, 10, state)


def test_result_comes_back_from_its_line() -> None:
    for each in (result(1), result(2, "fail", reason="x")):
        assert Result.from_json(each.to_json()) == each
    counted = replace(result(1), scores={"distance": 0.0, "collisions": 0})
    assert repr(Result.from_json(counted.to_json()).scores) == repr(counted.scores)  # they differ in the table
    assert Result.from_json(replace(result(1), wall=1.23456, cpu=2.34567).to_json()).wall == 1.2346


WRONG: dict[str, list[object]] = {
    "run": [-1, 2**63, 1.0, True, "1"],
    "scenario": [3, "\ud800"],
    "parameters": [[], {"a": 2**63}, {"a": -(2**63)}, {"a": [1]}, {"\ud800": 1}],
    "verdict": ["passed", None],
    "breaches": [{}, [["a", "b", 1.0, 2.0, 2e12]], [["a", "b", math.nan, 2.0, 3.0]]],
    "scores": [[], {"distance": True}, {"distance": -2e12}],
    "path": ["ab", [[1.0, "2"]]],
    "verdicts": ["pass", ["good"]],
    "wall": ["long"],
    "retries": [-1],
}


@pytest.mark.parametrize(("key", "value"), [(key, value) for key, values in WRONG.items() for value in values])
def test_line_that_is_no_result_is_refused(key: str, value: object) -> None:
    with pytest.raises((TypeError, ValueError)):
        Result.from_json(result(1).to_json() | {key: value})


def test_largest_numbers_of_a_line_are_read_and_a_line_of_an_older_version_is_one() -> None:
    values = result(1).to_json() | {"run": 2**63 - 1, "wall": -1e12, "parameters": {"a": 1 - 2**63, "b": True}}
    del values["trouble"], values["retries"]
    found = Result.from_json(values)
    assert (found.run.number, found.wall, found.trouble, found.retries) == (2**63 - 1, -1e12, "", 0)
    assert found.run.parameters == {"a": 1 - 2**63, "b": True}


def test_table_has_no_times_and_no_formulas() -> None:
    table = write_table([result(1), *(result(2, "fail", reason=f"{sign}1+cmd()") for sign in "=+-@")], ["gap"])
    rows = list(csv.DictReader(io.StringIO(table)))
    assert [row["verdict"] for row in rows] == ["pass", *(["fail"] * 4)]
    assert rows[0]["min_time_to_collision"] == "inf"
    assert [row["reason"] for row in rows] == ["", *(f"'{sign}1+cmd()" for sign in "=+-@")]
    assert [rows[0][name] for name in ("limit", "at", "frames", "state_hash")] == ["", "", "10", "a"]
    assert (rows[1]["limit"], rows[1]["at"], rows[1]["x"], rows[1]["y"]) == ("collisions", "1.0", "2.0", "3.0")
    assert not {"wall", "cpu", "worker"} & rows[0].keys()


def test_numbers_and_switches_of_the_table_are_no_formulas_and_a_parameter_never_hides_a_column() -> None:
    run = Run(1, "town", "ours", 0, {"gap": -1.5, "wet": True, "seed": 7})
    (row,) = csv.DictReader(io.StringIO(write_table([Result(run, "skipped")], ["gap", "wet", "seed", "none"])))
    assert [row[name] for name in ("gap", "wet", "seed", "parameter_seed", "none")] == ["-1.5", "true", "0", "7", ""]


def test_times_stand_in_a_table_of_their_own() -> None:
    took = replace(result(3), wall=1.23456, cpu=0.5, worker="a:1", retries=2, trouble="disk full")
    assert write_times([took]) == "run,wall,cpu,worker,retries,trouble\n3,1.2346,0.5000,a:1,2,disk full\n"


def test_junit_tells_failures_errors_and_skipped_runs_apart() -> None:
    verdicts: list[Verdict] = ["pass", "fail", "error", "flaky", "skipped"]
    text = write_junit(
        [result(i, verdict, reason='a "<b>" \x00') for i, verdict in enumerate(verdicts, 1)], "night & day"
    )
    suites = ET.fromstring(text)  # noqa: S314 - our own text
    assert suites.attrib | {"tests": "5", "failures": "2", "errors": "1", "skipped": "1"} == suites.attrib
    cases = list(suites.iter("testcase"))
    tags = [[child.tag for child in case] for case in cases]
    assert tags == [[], ["failure"], ["error"], ["failure"], ["skipped"]]
    assert [child.get("type") for case in cases for child in case] == ["fail", "error", "flaky", None]
    assert cases[1][0].text == "collisions at 1 s, (2, 3): expected at most 0, got 1"
    assert cases[1][0].get("message") == 'a "<b>" ?'
    assert (cases[1].get("name"), cases[1].get("classname")) == ("run 2 seed=0 gap=1.0", "night & day.ours.town")
    (suite,) = suites
    assert (suite.get("name"), suite.get("tests"), suite.get("time")) == ("ours on town", "5", "0.000")


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


def test_long_comparison_is_cut_and_tells_the_scores_that_moved() -> None:
    num = 53
    before = [result(i, gap=float(i), state="a") for i in range(1, num + 1)]
    slower = [replace(each, state_hash="b", scores={"distance": 4.0, "min_time_to_collision": 2.5}) for each in before]
    lines = list(compare_results(before, slower).lines())
    assert lines[3] == "same verdict, other drive: 53"
    assert lines[4] == f"  run 1 {before[0].run.title}"
    assert lines[5] == "    distance 5 -> 4, min_time_to_collision inf -> 2.5"
    assert lines[-2:] == ["  ... and 3 more", "the same: 0; only before: 0; only after: 0"]
    gone = list(compare_results(before, []).lines())
    assert len(gone) == 4 + 1 + 50 + 1 + 1
    assert gone[-2:] == ["  ... and 3 more", "the same: 0; only before: 53; only after: 0"]
    exact = list(compare_results(before[:50], [replace(each, state_hash="b") for each in before[:50]]).lines())
    assert exact[5] == "    the scores are the same"
    assert exact[-2] == "    the scores are the same"
    assert "more" not in list(compare_results(before[:50], []).lines())[-2]


def test_verdicts_that_change_among_the_bad_ones_are_neither_better_nor_worse() -> None:
    found = compare_results(
        [result(1, "error"), result(2, "skipped", gap=2.0)], [result(1, "fail"), result(2, gap=2.0)]
    )
    assert (len(found.others), found.num_same) == (2, 0)
    told = found.to_json()["others"][0]
    assert (told["run"], told["before"], told["after"]) == (1, "error", "fail")


SEARCH = {
    "scenario": "town",
    "parameters": {"a": {"low": 0.0, "high": 10.0}, "b": {"low": -5.0, "high": 5.0}},
    "search": {"worst": "min_time_to_collision", "budget": 120},
}


class Strategy:
    """A strategy that asks for the same three places again and again, and keeps what it is told."""

    popsize = 3

    def __init__(self, first: list[float], step: float, options: dict[str, object]) -> None:
        self.first, self.step, self.options = first, step, options
        self.told: list[tuple[object, object]] = []
        self.is_done = False

    def ask(self) -> list[list[float]]:
        return [[0.0, 0.25], [0.5, 0.5], [1.0, 0.75]]

    def tell(self, places: object, values: object) -> None:
        self.told.append((places, values))

    def stop(self) -> bool:
        return self.is_done


def search_of(worst: str, **more: object) -> tuple[Search, Strategy]:
    made: list[Strategy] = []

    def make(*arguments: Any) -> Strategy:  # noqa: ANN401 - those of the library, which has no types
        made.append(Strategy(*arguments))
        return made[0]

    document = SEARCH | {"search": {"worst": worst, "budget": 7, "seed": 9}} | more
    return Search(read_campaign(document, "c").document, "c", make), made[0]


def test_search_asks_within_the_ranges_until_its_budget_is_spent_or_it_rests() -> None:
    search, strategy = search_of("distance")
    assert (strategy.first, strategy.step) == ([0.5, 0.5], 0.3)
    known = {"seed": 9, "bounds": [0.0, 1.0], "maxfevals": 7}
    assert strategy.options | known == strategy.options
    first = search.ask()
    assert first == [{"a": 0.0, "b": -2.5}, {"a": 5.0, "b": 0.0}, {"a": 10.0, "b": 2.5}]
    results = [result(i) for i in range(3)]
    search.tell(results)
    assert [len(search.ask()), len(search.ask()), search.num_asked] == [3, 1, 7]
    search.tell(results[:1])  # a part of a population teaches nothing
    assert len(strategy.told) == 1
    assert search.ask() == []
    search, strategy = search_of("distance")
    strategy.is_done = True
    assert search.ask() == []


@pytest.mark.parametrize(
    ("verdict", "scores", "value"),
    [
        ("pass", {"distance": 5.0}, 6.0),
        ("fail", {"distance": -5.0}, -4.0),
        ("flaky", {"distance": 0.0}, 1.0),
        ("error", {"distance": 0.0}, 1e6),  # so that the search does not end where nothing can be driven
        ("skipped", {"distance": 0.0}, 1e6),
        ("pass", {}, 1e6),
        ("pass", {"distance": math.inf}, 1e6),
        ("pass", {"distance": -math.inf}, -1e6),
        ("pass", {"distance": math.nan}, 1e6),
        ("pass", {"distance": 4.0}, 1e6),  # divided by zero
    ],
)
def test_search_learns_the_value_of_each_run(verdict: Verdict, scores: dict[str, float], value: float) -> None:
    search, strategy = search_of("distance + a / a if distance != 4 else 1 / (a - 2)")
    search.ask()
    run = Run(1, "town", "ours", 0, {"a": 2.0, "b": 0.0})
    search.tell([Result(run, verdict, scores=scores)] * 3)
    assert strategy.told == [([[0.0, 0.25], [0.5, 0.5], [1.0, 0.75]], [value] * 3)]


def test_search_of_one_parameter_has_a_second_dimension_that_changes_nothing() -> None:
    search, strategy = search_of("distance", parameters={"a": {"low": 0.0, "high": 10.0}})
    assert search.ask() == [{"a": 0.0}, {"a": 5.0}, {"a": 10.0}]
    assert strategy.first == [0.5, 0.5]


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
