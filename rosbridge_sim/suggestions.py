"""Suggestions at the end of an error: the known name that is nearest to a wrong one, and the names that there are.

Names come from clients, so the work is bounded: a long name gets no suggestion, of very many known names only the first
three hundred are looked at, and `difflib` compares no more than `NUM_COMPARED` of them. The cheap measure that picks
those counts shared pairs of letters, which takes some 0.5 us for each known name.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from functools import lru_cache
from itertools import islice

__all__ = ["hint", "listing"]

MAX_NAME = 120
"""Characters of a name that gets a suggestion: twice the longest name of a topic or type of ours."""

MAX_KNOWN = 300
"""Known names that are looked at: some 0.3 ms. The server's own come first, and are some two hundred."""

NUM_COMPARED = 5
"""Known names that are compared letter by letter: some 30 us each."""

MAX_LISTED = 12
"""Names in a listing: a line of a terminal or two."""

MAX_SHOWN = 60
"""Characters of a name in a listing: known names may be clients' own."""


def hint(name: str, known: Iterable[str], cutoff: float = 0.7) -> str:
    """Return ` (did you mean ...?)` for the end of an error; an empty text where no known name comes near.

    Args:
        name: what was given.
        known: what there is.
        cutoff: least similarity, from 0 to 1. Case, `_`, `-` and `/` alone make no name dissimilar.
    """
    if not name or len(name) > MAX_NAME:
        return ""
    pairs = _pairs(name)
    scores = [
        (-2 * len(pairs & other) / (len(pairs) + len(other)), each)
        for each in islice(known, MAX_KNOWN)
        if len(each) <= MAX_NAME and not pairs.isdisjoint(other := _pairs(each))
    ]
    candidates = [each for _, each in sorted(scores)[:NUM_COMPARED]]
    close = difflib.get_close_matches(name, candidates, n=1, cutoff=cutoff)
    if not close:
        close = [each for each in candidates if _key(each) == _key(name)]
    return f" (did you mean {close[0]}?)" if close else ""


def listing(names: Iterable[str]) -> str:
    """Return names as a sentence has them: the first dozen, and `...` for the rest."""
    first = list(islice(names, MAX_LISTED + 1))
    shown = [name if len(name) <= MAX_SHOWN else name[:MAX_SHOWN] + "..." for name in first[:MAX_LISTED]]
    return ", ".join([*shown, "..."] if len(first) > MAX_LISTED else shown)


@lru_cache(maxsize=4_096)  # known names come again and again; those of clients push them out a few at a time
def _pairs(name: str) -> frozenset[str]:
    """Pairs of neighbouring letters, its two ends included, without regard to case."""
    text = f"^{name.lower()}$"
    return frozenset(text[i : i + 2] for i in range(len(text) - 1))


def _key(name: str) -> str:
    return name.lower().translate(_IGNORED)


_IGNORED = str.maketrans("", "", "_-/ ")
