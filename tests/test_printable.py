"""Text of a peer's is repeated in part, and as any encoder can send it."""

from __future__ import annotations

import pytest

from rosbridge_sim.printable import MAX_QUOTED, printable


@pytest.mark.parametrize("text", ["", "plain", "ö 한 🚗", "line\n\x1b[2J"])
def test_text_that_can_be_encoded_stays_as_it_is(text: str) -> None:
    assert printable(text) == printable(text, len(text)) == text


def test_half_of_a_surrogate_pair_is_escaped() -> None:
    assert printable("\ud800") == "\\ud800"
    assert printable("한\udfff") == "한\\udfff"


@pytest.mark.parametrize("char", [*"\x80\x9b\u061c\u200e\u200f\u2028\u2029\u202a\u202e\u2066\u2069"])
def test_character_that_reorders_or_splits_a_line_is_escaped(char: str) -> None:
    assert printable(f"no topic {char}name") == "no topic " + char.encode("ascii", "backslashreplace").decode() + "name"


def test_long_text_is_cut_where_a_limit_is_given() -> None:
    assert printable("x" * 1000) == "x" * 1000
    assert printable("x" * 1000, MAX_QUOTED) == "x" * 200 + "..."
    assert printable("\ud800" * 1000, 2) == "\\ud800\\ud800..."
