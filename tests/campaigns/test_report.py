"""The page of a campaign's results: what stands in each of its parts."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from typing import Any

import pytest

from rosbridge_sim.campaigns.report import MAX_PATHS, Details, PageParts, write_report
from rosbridge_sim.campaigns.run_results import Breach, Result, Run, Verdict

PARTS = ("title", "style", "outcome", "sentence", "counts", "limits", "failures", "data", "script")


def result(number: int, verdict: Verdict = "pass", **more: Any) -> Result:  # noqa: ANN401 - fields of a result
    return Result(Run(number, "town", "ours", 3, {"gap": number}), verdict, **more)


def page(results: list[Result], details: list[Details] | None = None) -> dict[str, str]:
    """The filled-in parts of the page."""
    parts = PageParts("\x00".join(f"{{{{{name}}}}}" for name in PARTS), "body {}", "run()")
    text = write_report(parts, "a < b", results, ["gap"], details or [])
    return dict(zip(PARTS, text.split("\x00"), strict=True))


def details(each: Result, **more: Any) -> Details:  # noqa: ANN401 - fields of details
    given: dict[str, Any] = {"result": each, "trace": {}, "scene": {}, "log": "", "files": {}, "command": "repeat it"}
    return Details(**(given | more))


@pytest.mark.parametrize(
    ("verdicts", "outcome", "sentence", "counts"),
    [
        ([], "pass", "No run was driven.", {}),
        (["pass"] * 1_200, "pass", "All 1,200 runs pass.", {"pass": 1_200}),
        (
            ["pass", "skipped", "error", "flaky", "fail", "fail"],
            "fail",
            "4 of 6 runs did not pass.",
            {"fail": 2, "error": 1, "flaky": 1, "skipped": 1, "pass": 1},
        ),
    ],
)
def test_head_of_the_page_tells_the_outcome(
    verdicts: list[Verdict], outcome: str, sentence: str, counts: dict[str, int]
) -> None:
    found = page([result(i, verdict) for i, verdict in enumerate(verdicts, 1)])
    assert (found["outcome"], found["sentence"]) == (outcome, sentence)
    items = [f'<li class="{name}"><strong>{num:,}</strong> {name}</li>' for name, num in counts.items()]
    assert found["counts"] == "".join(items)
    assert (found["title"], found["style"], found["script"]) == ("a &lt; b", "body {}", "run()")


def test_limits_are_counted_once_for_each_run_and_errors_by_reason() -> None:
    hit, slow = Breach("hit", "", 1.0, 0.0, 0.0), Breach("<slow>", "", 1.0, 0.0, 0.0)
    results = [
        *(result(1, "fail", breaches=(hit, hit, slow)), result(2, "fail", breaches=(hit,))),
        *(result(3, "error", reason="no <map>"), result(4, "flaky", reason="of no account")),
    ]
    assert page(results)["limits"] == (
        "<ul><li><strong>2</strong> hit</li><li><strong>1</strong> &lt;slow&gt;</li>"
        '<li class="error"><strong>1</strong> no &lt;map&gt;</li></ul>'
    )
    assert page([result(1)])["limits"] == "<p>Every limit was kept.</p>"


def test_list_of_limits_and_errors_has_the_twenty_most_frequent_of_each() -> None:
    results = [result(i, "fail", breaches=(Breach(f"limit{i:02}", "", 1.0, 0.0, 0.0),)) for i in range(25)]
    results += [result(i, "error", reason=f"reason{i:02}") for i in range(25)]
    told = page(results)["limits"]
    assert told.count("limit") == told.count("reason") == 20


@pytest.mark.parametrize(("num", "end"), [(1, "run 1."), (20, "run 19, run 20."), (1_021, "run 20 and 1,001 more.")])
def test_runs_that_were_driven_again_are_named(num: int, end: str) -> None:
    told = page([result(i + 1, retries=1) for i in range(num)] + [result(9_999)])["limits"]
    assert told.endswith(f"{end}</p>")
    assert told.startswith('<p>Every limit was kept.</p><p id="again">Driven again, because the worker was killed: run')
    assert "9999" not in told


def test_run_that_did_not_pass_has_a_section_with_all_that_is_known() -> None:
    breach = Breach("hit", "expected <1", 0.02, 2.0, -3.5)
    bad = replace(result(7, "fail", reason="<hit>", state_hash="abc"), breaches=(breach,))
    times = {name: [0.02, 0.04] for name in ("time", "x", "y", "speed", "distance")}
    whole = details(
        bad,
        trace={**times, "time_to_collision": [math.inf, math.inf]},
        log="x" * 10 + "y" * 5_999 + "\n",
        files={"trace.csv": "runs/7?a&b"},
        command="repeat <it>",
    )
    assert page([bad] * 3, [])["failures"] == "<p>The first 0 of 3.</p>"
    found = page([bad, bad, result(1)], [whole, details(result(8, "error", reason="none"), log=" \n")])["failures"]
    first, second = found.split("\n")
    assert first.startswith('<details id="run-7" open><summary>run 7 <strong class="fail">fail</strong> ours on town')
    assert "seed=3 gap=7: &lt;hit&gt;</summary>" in first
    assert "<ul><li>hit at 0.02 s, (2, -3.5): expected &lt;1</li></ul>" in first
    assert first.count("<svg") == 4
    assert first.count('class="mark"') == 2  # the line at the breach; of a time to collision that never was, nothing
    assert '<p>Files: <a href="runs/7?a&amp;b">trace.csv</a></p>' in first
    assert "to the state <code>abc</code>" in first
    assert ">repeat &lt;it&gt;</pre>" in first
    assert f">{'y' * 5_999}</pre></div></details>" in first
    assert second.startswith('<details id="run-8"><summary>')
    assert "to the state <code>-</code>" in second
    assert not any(part in second for part in ("<svg", "<ul>", "Files", "output"))
    assert page([result(1)])["failures"] == "<p>None.</p>"


def test_data_of_the_page_is_the_table_with_its_paths() -> None:
    results = [
        result(1, "fail", scores={"distance": 2.5, "min_time_to_collision": math.inf}, path=((1.0, 2.0), (3.0, 4.0))),
        result(2, reason="</script>"),
    ]
    text = page(results, [details(results[0])])["data"]
    assert "<" not in text
    data = json.loads(text)
    assert data["columns"]["gap"] == [1, 2]
    assert data["columns"]["distance"] == [2.5, None]
    assert data["columns"]["min_time_to_collision"] == [None, None]
    assert data["columns"]["reason"] == [None, "</script>"]
    assert (data["parameters"], data["strongest"], data["shown"]) == (["gap"], ["gap"], [1])
    assert data["paths"] == [[1.0, 2.0, 3.0, 4.0], None]
    assert data["scores"][0] == "distance"


def test_paths_of_very_many_runs_are_left_out() -> None:
    one = result(1, path=((1.0, 2.0),))
    assert json.loads(page([one] * (MAX_PATHS + 1))["data"])["paths"][-2:] == [[1.0, 2.0], None]
