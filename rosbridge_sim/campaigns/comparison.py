"""Changes between two campaigns, regressions first, for the CI of a driving stack."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Final

from rosbridge_sim.campaigns.run_results import BAD, Result

MAX_LINES: Final = 50
"""Most runs that are listed of each kind; JSON has all."""

Pair = tuple[Result, Result]

_TITLES: Final = {
    "regressions": "regressions",
    "fixed": "fixed",
    "others": "other verdicts or reasons",
    "moved": "same verdict, other drive",
}


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
        for kind, title in _TITLES.items():
            pairs: tuple[Pair, ...] = getattr(self, kind)
            yield f"{title}: {len(pairs):,}"
            for before, after in pairs[:MAX_LINES]:
                yield f"  run {after.run.number} {after.run.title}"
                change = f"{before.verdict} -> {after.verdict}: {after.reason or before.reason}"
                yield f"    {_scores_changed(before, after) if kind == 'moved' else change}"
            yield from _rest(len(pairs))
        if self.missing:
            yield f"missing: {len(self.missing):,}"
            yield from (f"  run {each.run.number} {each.run.title}" for each in self.missing[:MAX_LINES])
            yield from _rest(len(self.missing))
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
            **{kind: told(getattr(self, kind)) for kind in _TITLES},
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
    kinds = [tuple(pair for pair in pairs if _kind_of(*pair) == kind) for kind in ("", *_TITLES)]
    same, regressions, fixed, others, moved = kinds
    added = tuple(result for result in after if result.run.key not in old)
    missing = tuple(result for result in before if result.run.key not in new)
    return Comparison(regressions, fixed, others, moved, len(same), added, missing)


def _kind_of(before: Result, after: Result) -> str:
    """Return the name of what happened to a run: a key of `_TITLES`, or nothing."""
    if (before.verdict in BAD) != (after.verdict in BAD):
        return "regressions" if after.verdict in BAD else "fixed"
    if (before.verdict, before.reason) != (after.verdict, after.reason):
        return "others"
    return "moved" if before.state_hash != after.state_hash else ""


def _rest(num: int) -> Iterator[str]:
    if num > MAX_LINES:
        yield f"  ... and {num - MAX_LINES:,} more"


def _scores_changed(before: Result, after: Result) -> str:
    parts = []
    for name in ("distance", "min_time_to_collision", "max_lane_offset", "mean_speed"):
        first, second = before.scores.get(name), after.scores.get(name)
        if first is not None and second is not None and first != second:
            parts.append(f"{name} {first:.4g} -> {second:.4g}")
    return ", ".join(parts) or "the scores are the same"
