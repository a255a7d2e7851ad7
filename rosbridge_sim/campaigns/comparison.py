"""Changes between two campaigns, regressions first, for the CI of a driving stack."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Final

from rosbridge_sim.campaigns.run_results import BAD, Result

MAX_LINES: Final = 50
"""Most runs that are listed of each kind; JSON has all."""

Pair = tuple[Result, Result]


@dataclass(frozen=True, slots=True)
class Comparison:
    """Runs of two campaigns, by what happened to them. Runs are the same if scenario, driver, seed and parameters are.

    Attributes:
        regressions: passed or were skipped before, and do so no longer.
        fixed: the other way.
        others: another verdict or reason, and neither of these.
        moved: equal verdicts, but the world ended in another state.
        num_same: equal in all.
        added, missing: runs of one of them alone.
    """

    regressions: tuple[Pair, ...]
    fixed: tuple[Pair, ...]
    others: tuple[Pair, ...]
    moved: tuple[Pair, ...]
    num_same: int
    added: tuple[Result, ...]
    missing: tuple[Result, ...]

    def lines(self) -> Iterator[str]:
        """Yield the lines for people."""
        counts = {
            "regressions": self.regressions,
            "fixed": self.fixed,
            "other verdicts or reasons": self.others,
            "same verdict, other drive": self.moved,
        }
        for title, pairs in counts.items():
            yield f"{title}: {len(pairs):,}"
            for before, after in pairs[:MAX_LINES]:
                yield f"  run {after.run.number} {after.run.title}"
                if title == "same verdict, other drive":
                    yield f"    {_scores_changed(before, after)}"
                    continue
                yield f"    {before.verdict} -> {after.verdict}: {after.reason or before.reason}"
            if len(pairs) > MAX_LINES:
                yield f"  ... and {len(pairs) - MAX_LINES:,} more"
        if self.missing:
            yield f"missing: {len(self.missing):,}"
            yield from (f"  run {each.run.number} {each.run.title}" for each in self.missing[:MAX_LINES])
            if len(self.missing) > MAX_LINES:
                yield f"  ... and {len(self.missing) - MAX_LINES:,} more"
        yield f"the same: {self.num_same:,}; only before: {len(self.missing):,}; only after: {len(self.added):,}"

    def to_json(self) -> dict[str, Any]:
        """Return all of it for programs."""

        def told(pairs: Sequence[Pair]) -> list[dict[str, Any]]:
            return [
                {
                    "run": after.run.number,
                    "what": after.run.title,
                    "before": before.verdict,
                    "after": after.verdict,
                    "reason": after.reason,
                    "reason_before": before.reason,
                }
                for before, after in pairs
            ]

        return {
            **{kind: told(getattr(self, kind)) for kind in ("regressions", "fixed", "others", "moved")},
            "num_same": self.num_same,
            "added": [each.run.title for each in self.added],
            "missing": [each.run.title for each in self.missing],
        }


def compare_results(before: Sequence[Result], after: Sequence[Result]) -> Comparison:
    """Compare the results of two campaigns.

    Args:
        before: of the first one.
        after: of the second one.
    """
    old = {result.run.key: result for result in before}
    pairs = [(old[result.run.key], result) for result in after if result.run.key in old]
    new = {result.run.key for result in after}
    regressions, fixed, others, moved = [], [], [], []
    for pair in pairs:
        first, second = pair
        if first.verdict not in BAD and second.verdict in BAD:
            regressions.append(pair)
        elif first.verdict in BAD and second.verdict not in BAD:
            fixed.append(pair)
        elif (first.verdict, first.reason) != (second.verdict, second.reason):
            others.append(pair)
        elif first.state_hash != second.state_hash:
            moved.append(pair)
    return Comparison(
        tuple(regressions),
        tuple(fixed),
        tuple(others),
        tuple(moved),
        len(pairs) - sum(map(len, (regressions, fixed, others, moved))),
        tuple(result for result in after if result.run.key not in old),
        tuple(result for result in before if result.run.key not in new),
    )


def _scores_changed(before: Result, after: Result) -> str:
    parts = []
    for name in ("distance", "min_time_to_collision", "max_lane_offset", "mean_speed"):
        first, second = before.scores.get(name), after.scores.get(name)
        if first is not None and second is not None and first != second:
            parts.append(f"{name} {first:.4g} -> {second:.4g}")
    return ", ".join(parts) or "the scores are the same"
