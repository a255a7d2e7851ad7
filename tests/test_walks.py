"""A publish and a tick pass no more files and functions than they did; see `scripts/walks.py`."""

from __future__ import annotations

import pytest

from scripts.walks import PUBLISH, TICK, Figures, Visit, figures_of, measure_walks

HELD = {PUBLISH: Figures(calls=29, files=16, rooms=8, changes=24), TICK: Figures(107, 45, 22, 85)}
"""A walk may be longer by ROOM; write lower figures with a change that makes one shorter."""

ROOM = 1.1


def test_changes_of_file_are_counted_between_calls_one_after_the_other() -> None:
    walk = [
        Visit("a/x.py", "f"),
        Visit("a/x.py", "g"),
        Visit("a/y.py", "h"),
        Visit("a/x.py", "f"),
        Visit("b/z.py", "k"),
    ]
    assert figures_of(walk) == Figures(calls=5, files=3, rooms=2, changes=3)


@pytest.mark.slow
@pytest.mark.parametrize("name", HELD)
def test_walk_is_not_longer_than_it_was(name: str) -> None:
    found = figures_of(measure_walks()[name])
    too_long = {
        kind: f"{number} in place of {held}"
        for kind, number, held in zip(Figures._fields, found, HELD[name], strict=True)
        if number > ROOM * held
    }
    assert not too_long, "python scripts/walks.py shows the walk"
