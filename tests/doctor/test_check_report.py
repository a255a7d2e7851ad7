"""Reports of checks: as lines, Markdown, JSON and JUnit XML, to the letter."""

from __future__ import annotations

import json
from xml.etree import ElementTree as ET

import pytest

from rosbridge_sim.doctor.check import Check
from rosbridge_sim.doctor.check_report import (
    Report,
    junit,
    markdown,
    read_baseline,
    summary,
    terminal_lines,
    to_json,
)
from rosbridge_sim.doctor.examination import CheckResult, Verdict


def result(id_: str, verdict: Verdict, reason: str = "", *, frames: bool = False) -> CheckResult:
    check = Check(id_, f"source of {id_}", f"says {id_}", [])
    sent, came = ((("a", {"op": "x"}),), (("b", {"op": "y"}),)) if frames else ((), ())
    return CheckResult(check, verdict, reason, sent, came)


REPORT = Report(
    "a server",
    [
        result("topics/one", Verdict.CONFORMS, frames=True),
        result("topics/two", Verdict.DEVIATES, "got `x`", frames=True),
        result("topics/three", Verdict.MISSING, "got nothing"),
        result("services/four", Verdict.DIFFERS, "as the reference"),
        result("services/five", Verdict.DIFFERS, "as another one"),
        result("services/six", Verdict.NOT_APPLICABLE, "ROS 2 alone"),
    ],
    {"topics/three": "missing", "topics/two": "missing"},
)


def test_lines_have_each_section_and_what_does_not_conform() -> None:
    assert list(terminal_lines(REPORT)) == [
        "a server",
        "topics       1 conforms, 1 deviates, 1 missing",
        "  deviates: topics/two: says topics/two",
        "      got `x`",
        "      source: source of topics/two",
        "  missing (known): topics/three: says topics/three",
        "      got nothing",
        "      source: source of topics/three",
        "services     2 differ, 1 not applicable",
        "  differs: services/four: says services/four",
        "      as the reference",
        "  differs: services/five: says services/five",
        "      as another one",
        "  not applicable: services/six: says services/six",
        "      ROS 2 alone",
        "6 checks: 1 conforms, 2 differ, 1 deviates, 1 missing, 1 not applicable; 1 of them known",
    ]


def test_all_checks_and_their_frames_are_listed_if_that_is_wanted() -> None:
    assert list(terminal_lines(REPORT, is_verbose=True))[2:10] == [
        "  conforms: topics/one: says topics/one",
        '      a > {"op": "x"}',
        '      b < {"op": "y"}',
        "  deviates: topics/two: says topics/two",
        "      got `x`",
        "      source: source of topics/two",
        '      a > {"op": "x"}',
        '      b < {"op": "y"}',
    ]


def test_single_check_is_told_as_one() -> None:
    one = Report("s", [result("a/b", Verdict.CONFORMS)], {})
    assert summary(one) == "1 check: 1 conforms"
    assert summary(Report("s", [*one.outcomes, *one.outcomes], {})) == "2 checks: 2 conform"
    assert [found.check.id for found in REPORT.faults] == ["topics/two"]


def test_markdown_has_a_table_and_each_fault_with_its_frames() -> None:
    assert markdown(REPORT).splitlines() == [
        *("Checked: a server", "", "| section | result |", "|---|---|"),
        "| topics | 1 conforms, 1 deviates, 1 missing |",
        "| services | 2 differ, 1 not applicable |",
        *("", "**topics/two** deviates: says topics/two (source of topics/two)", "", "```"),
        *('a > {"op": "x"}', 'b < {"op": "y"}', "got 'x'", "```"),
        *("", "**topics/three** missing (known): says topics/three (source of topics/three)", "", "```"),
        *("got nothing", "```"),
        *("", summary(REPORT)),
    ]


def test_report_as_json_is_a_baseline() -> None:
    told = to_json(REPORT)
    assert told["server"] == "a server"
    assert told["checks"][1] == {
        "id": "topics/two",
        "says": "says topics/two",
        "source": "source of topics/two",
        "verdict": "deviates",
        "reason": "got `x`",
        "known": False,
        "sent": [{"a": {"op": "x"}}],
        "came": [{"b": {"op": "y"}}],
    }
    assert [one["known"] for one in told["checks"]] == [False, False, True, False, False, False]
    assert read_baseline(json.dumps(told)) == {
        "topics/two": "deviates",
        "topics/three": "missing",
        "services/four": "differs",
        "services/five": "differs",
        "services/six": "not applicable",
    }


@pytest.mark.parametrize("text", ["", "{}", "[]", '{"checks": [{"id": "a"}]}', '{"checks": 3}', "7"])
def test_what_is_no_report_is_no_baseline(text: str) -> None:
    with pytest.raises(ValueError, match="expected the output of `rosbridge-sim doctor --json`"):
        read_baseline(text)


def test_junit_fails_what_is_not_known_and_skips_what_is_not_applicable() -> None:
    cases = list(ET.fromstring(junit(REPORT)).iter("testcase"))  # noqa: S314 - our own
    assert [case.get("name") for case in cases] == [one.check.id for one in REPORT.outcomes]
    failures = {case.get("name"): found.get("message") for case in cases if (found := case.find("failure")) is not None}
    assert failures == {"topics/two": "deviates: says topics/two: got `x` (source of topics/two)"}
    assert [case.get("name") for case in cases if case.find("skipped") is not None] == ["services/six"]
