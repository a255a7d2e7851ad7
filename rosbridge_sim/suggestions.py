"""Suggestions at the end of an error: the known name that is nearest to a wrong one, and lists of known names.

Names come from clients, so the work is limited. A long name gets no suggestion. Of very many known names only the first
three hundred are compared, and `difflib` compares only `NUM_COMPARED` of them. A cheap measure selects these: the
number of common pairs of letters. A suggestion among 300 names takes 0.3 ms, and 5 us when it is repeated.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import lru_cache
from itertools import islice, pairwise

from rosbridge_sim.printable import printable

MAX_COMPARED_NAME = 80
"""Longest name that gets a suggestion [characters]: longer than any topic, type or field of this package."""

MAX_CACHED = 300
"""Known names that are compared. The server's own come first, and are about two hundred."""

NUM_COMPARED = 3
"""Known names that are compared letter by letter: about 30 us each."""

MAX_SUGGESTED = 12
"""Names in a list: one or two lines of a terminal."""

MAX_NAMED = 3
"""Names that a line lists before it only counts the rest."""

MAX_NAME_SHOWN = 60
"""Characters of a name in a list, because known names may come from clients."""


def hint(name: str, known: Iterable[str], cutoff: float = 0.7) -> str:
    """Return ` (did you mean ...?)` for the end of an error; an empty text if no known name is similar.

    Args:
        cutoff: least similarity, from 0 to 1. Upper or lower case, `_`, `-` and `/` make no difference.
    """
    if not name or len(name) > MAX_COMPARED_NAME:
        return ""
    near = _nearest(name, tuple(islice(known, MAX_CACHED)), cutoff)
    return f" (did you mean {printable(near)}?)" if near else ""


def find_misspelt(name: str, known: Iterable[str]) -> str:
    """Return the known name of which another name is surely a misspelling; an empty text if there is none.

    Surely means: case and `_`, `-`, `/` apart, one letter is missing, added, wrong or swapped with the next one; or the
    names are equal for the most part, as long ones with two such mistakes are. Names of fewer than four letters must be
    equal but for case, because `pos` and `rot` are different things.
    """
    if not name or len(name) > MAX_COMPARED_NAME:
        return ""
    names = tuple(islice(known, MAX_CACHED))
    near = _nearest(name, names, _SURE)
    return near or next((each for each in names if _is_one_slip(_key(name), _key(each))), "")


_SURE = 0.9
"""A name with this similarity to a known one is a misspelling; MORAI's own keys are less similar to each other."""

_MIN_SLIP_NAME = 4
"""Shortest name in which one other letter is taken for a misspelling [characters]."""


def _is_one_slip(name: str, known: str) -> bool:
    """Return whether two names differ by one letter that is missing, added, wrong or swapped with the next one."""
    if min(len(name), len(known)) < _MIN_SLIP_NAME or abs(len(name) - len(known)) > 1:
        return False
    first = next((i for i, (a, b) in enumerate(zip(name, known, strict=False)) if a != b), min(len(name), len(known)))
    rest, known_rest = name[first:], known[first:]
    is_swapped = rest[:2] == known_rest[1::-1] and rest[2:] == known_rest[2:]
    return is_swapped or any(rest[skip:] == known_rest[known_skip:] for skip, known_skip in ((1, 1), (1, 0), (0, 1)))


@lru_cache(maxsize=64)  # a program repeats its mistakes; a few MB if clients' names fill it
def _nearest(name: str, known: tuple[str, ...], cutoff: float) -> str:
    """Return the nearest known name, or an empty text."""
    pairs = _pairs(name)
    most = len(name) / (cutoff / 2) - len(name)  # a longer name cannot be similar enough, nor one shorter than
    least = len(name) / (2 / cutoff - 1)
    scores = [
        (-2 * len(pairs & other) / (len(pairs) + len(other)), each)
        for each in known
        if least - _SLACK <= len(each) <= most + _SLACK and not pairs.isdisjoint(other := _pairs(each))
    ]
    candidates = [each for _, each in sorted(scores)[:NUM_COMPARED]]
    import difflib  # noqa: PLC0415 - most processes suggest nothing

    close = difflib.get_close_matches(name, candidates, n=1, cutoff=cutoff)
    if not close:
        close = [each for each in candidates if _key(each) == _key(name)]
    return close[0] if close else ""


_SLACK = 3
"""Difference in length that `_`, `-` and `/` alone may cause [characters]."""


def listing(names: Iterable[str]) -> str:
    """Return names as a list for a sentence: the first dozen, and `...` for the rest."""
    first = list(islice(names, MAX_SUGGESTED + 1))
    escaped = [printable(name[: 2 * MAX_NAME_SHOWN]) for name in first[:MAX_SUGGESTED]]
    shown = [name if len(name) <= MAX_NAME_SHOWN else name[:MAX_NAME_SHOWN] + "..." for name in escaped]
    return ", ".join([*shown, "..."] if len(first) > MAX_SUGGESTED else shown)


def name_some(names: Sequence[str]) -> str:
    """Return the first three names of a list, and how many more there are: `/a, /b, /c and 4 more`."""
    shown, more = ", ".join(names[:MAX_NAMED]), len(names) - MAX_NAMED
    return f"{shown} and {more} more" if more > 0 else shown


@lru_cache(maxsize=1_024)  # known names are used again and again; at most 7 MB if clients fill it with long names
def _pairs(name: str) -> frozenset[int]:
    """Return the pairs of neighbouring letters as numbers, with both ends of the name; case is ignored."""
    codes = [_END, *map(ord, name.lower()[:MAX_COMPARED_NAME]), _END]
    return frozenset(first << 21 | second for first, second in pairwise(codes))


_END = 0x11_0000
"""Code for either end of a name: one more than any character has."""


def _key(name: str) -> str:
    return name.lower().translate(_IGNORED)


_IGNORED = str.maketrans("", "", "_-/ ")
