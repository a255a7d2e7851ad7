"""The results of all checks: as lines for a terminal, Markdown for an issue, JSON, and JUnit XML for CI."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from itertools import groupby

from rosbridge_sim.doctor.examination import CheckResult, Verdict, shown
from rosbridge_sim.junit import Case, write_suite
from rosbridge_sim.loose_types import JsonValue
from rosbridge_sim.printable import printable
from rosbridge_sim.records import Record


class Report(Record):
    """The results of all checks.

    Attributes:
        server: what was checked, in words.
        outcomes: in the order of the checks.
        known: id of a check -> its verdict, of differences that are known.
    """

    server: str
    outcomes: Sequence[CheckResult]
    known: Mapping[str, str]

    @property
    def faults(self) -> list[CheckResult]:
        """Results that break the protocol and are not known."""
        return [one for one in self.outcomes if one.verdict.is_fault and not self.is_known(one)]

    def is_known(self, outcome: CheckResult) -> bool:
        """Return whether a difference is known."""
        return self.known.get(outcome.check.id) == outcome.verdict

    def sections(self) -> Iterator[tuple[str, list[CheckResult]]]:
        """Yield the sections with their results."""
        for section, outcomes in groupby(self.outcomes, lambda one: one.check.section):
            yield section, list(outcomes)


def summary(report: Report) -> str:
    """Return the numbers of all verdicts as a sentence."""
    text = f"{len(report.outcomes)} check{'s' * (len(report.outcomes) != 1)}: {_numbers(report.outcomes)}"
    num_known = sum(one.verdict.is_fault and report.is_known(one) for one in report.outcomes)
    return text + (f"; {num_known} of them known" if num_known else "")


def _numbers(outcomes: Sequence[CheckResult]) -> str:
    numbers = Counter(one.verdict for one in outcomes)
    words = {verdict: verdict.removesuffix("s") if numbers[verdict] != 1 else verdict for verdict in Verdict}
    return ", ".join(f"{numbers[verdict]} {words[verdict]}" for verdict in Verdict if numbers[verdict])


def terminal_lines(report: Report, *, is_verbose: bool = False) -> Iterator[str]:
    """Yield the lines for a terminal: a line for each section, and below it what does not conform.

    Args:
        report: the results.
        is_verbose: list all checks, each with the frames that were sent and that came.
    """
    yield report.server
    for section, outcomes in report.sections():
        yield f"{section:12} {_numbers(outcomes)}"
        for one in outcomes:
            if one.verdict is Verdict.CONFORMS and not is_verbose and not one.reason:
                continue
            mark = " (known)" if report.is_known(one) else ""
            yield f"  {one.verdict}{mark}: {one.check.id}: {one.check.says}"
            if one.reason:
                yield f"      {one.reason}"
            if one.verdict.is_fault:
                yield f"      source: {one.check.source}"
            if is_verbose:
                yield from (f"      {name} > {shown(frame)}" for name, frame in one.sent)
                yield from (f"      {name} < {shown(frame)}" for name, frame in one.came)
    yield summary(report)


def markdown(report: Report) -> str:
    """Return the results as Markdown: a table of the sections, and each fault with its frames."""
    lines = [f"Checked: {report.server}", "", "| section | result |", "|---|---|"]
    lines += [f"| {section} | {_numbers(outcomes)} |" for section, outcomes in report.sections()]
    for one in report.outcomes:
        if one.verdict.is_fault:
            mark = " (known)" if report.is_known(one) else ""
            lines += ["", f"**{one.check.id}** {one.verdict}{mark}: {one.check.says} ({one.check.source})", "", "```"]
            lines += [f"{name} > {shown(frame)}" for name, frame in one.sent]
            lines += [f"{name} < {shown(frame)}" for name, frame in one.came]
            lines += [printable(one.reason).replace("`", "'"), "```"]
    return "\n".join([*lines, "", summary(report), ""])


def to_json(report: Report) -> JsonValue:
    """Return the results as a value of JSON; `--baseline` reads it."""
    return {
        "server": report.server,
        "checks": [
            {
                "id": one.check.id,
                "says": one.check.says,
                "source": one.check.source,
                "verdict": str(one.verdict),
                "reason": one.reason,
                "known": report.is_known(one),
                "sent": [{name: frame} for name, frame in one.sent],
                "came": [{name: frame} for name, frame in one.came],
            }
            for one in report.outcomes
        ],
    }


def junit(report: Report) -> str:
    """Return the results as JUnit XML: a fault that is not known is a failure, what is not applicable is skipped."""
    faults = {one.check.id for one in report.faults}
    cases = []
    for one in report.outcomes:
        failure = f"{one.verdict}: {one.check.says}: {one.reason} ({one.check.source})"
        failure = failure if one.check.id in faults else ""
        skipped = one.reason if one.verdict is Verdict.NOT_APPLICABLE else ""
        cases.append(Case(one.check.section, one.check.id, failure, skipped))
    return write_suite("rosbridge", cases)


def read_baseline(text: str) -> dict[str, str]:
    """Return the known differences of an earlier report: id of a check -> verdict.

    Args:
        text: what `--json` printed.

    Raises:
        ValueError: it is something else.
    """
    try:
        return {one["id"]: one["verdict"] for one in json.loads(text)["checks"] if one["verdict"] != Verdict.CONFORMS}
    except (KeyError, TypeError, ValueError):
        raise ValueError("expected the output of `rosbridge-sim doctor --json`") from None
