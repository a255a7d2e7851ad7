"""Texts checked in slices give the same result as Python's whole check."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rosbridge_sim.shell.transport.text_check import SLICE, TextCheck


def fault_of(message: bytes) -> str:
    check = TextCheck(message)
    num_steps = 1
    while check.step():
        num_steps += 1
    assert num_steps <= len(message) // (SLICE - 3) + 1
    return check.fault


def expected_fault(message: bytes) -> str:
    try:
        message.decode()
    except UnicodeDecodeError as error:
        return f"text is not UTF-8: {error.reason} at byte {error.start}"
    return ""


@given(
    st.binary(max_size=12),
    st.sampled_from([0, 1, 2, 3, 4, 5, 2 * SLICE]),
    st.sampled_from(["", "é", "가", "\U0001f697"]),
)
def test_bytes_at_a_slice_border_are_checked_as_by_python(odd: bytes, before: int, text: str) -> None:
    message = b"x" * max(SLICE - before, 0) + text.encode() + odd + text.encode()
    assert fault_of(message) == expected_fault(message)


@pytest.mark.parametrize("character", ["x", "é", "가", "\U0001f697"])
def test_long_texts_pass(character: str) -> None:
    assert fault_of(character.encode() * SLICE) == ""
    assert fault_of(b"") == ""


def test_incomplete_character_at_the_end_is_an_error() -> None:
    for length in (0, SLICE - 1, SLICE, 3 * SLICE):
        message = b"x" * length + "가".encode()[:2]
        assert fault_of(message) == expected_fault(message) != ""
