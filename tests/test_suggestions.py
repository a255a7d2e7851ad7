"""Suggestions of near names, at a bounded cost."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from rosbridge_sim.suggestions import MAX_CACHED, MAX_COMPARED_NAME, find_misspelt, hint, listing, name_some


@pytest.mark.parametrize(
    ("name", "known", "near"),
    [
        ("wat", ["what", "water"], "what"),
        ("/SyncModWaitForTick", ["/SyncModeCmd", "/SyncModeWaitForTick"], "/SyncModeWaitForTick"),
        ("longl_cmd_type", ["accel", "longlCmdType"], "longlCmdType"),
        ("LONGLCMDTYPE", ["accel", "longlCmdType"], "longlCmdType"),
        ("publsh", ["publish", "png"], "publish"),
        ("prot", ["host", "port"], "port"),
    ],
)
def test_nearest_name_is_suggested(name: str, known: list[str], near: str) -> None:
    assert hint(name, known) == f" (did you mean {near}?)"


@pytest.mark.parametrize("name", ["", "zzz", "x" * (MAX_COMPARED_NAME + 1), "\ud800", "a" * 10**7])
def test_unlike_or_overlong_name_gets_no_suggestion(name: str) -> None:
    assert hint(name, ["port", "host"]) == ""
    assert hint("port", [name]) == ""


@pytest.mark.parametrize(
    ("name", "known", "meant"),
    [
        ("Gear", "gear", "gear"),
        ("geer", "gear", "gear"),
        ("gera", "gear", "gear"),
        ("gaer", "gear", "gear"),
        ("gears", "gear", "gear"),
        ("lopp", "loop", "loop"),
        ("rote", "rot", ""),
        ("pot", "pos", ""),
        ("gaere", "gear", ""),
        ("gear", "gearbox", ""),
        ("z" * 10**6, "gear", ""),
        ("", "gear", ""),
    ],
)
def test_misspelling_is_one_slip_in_a_name(name: str, known: str, meant: str) -> None:
    assert find_misspelt(name, ["else", known]) == meant


def test_number_of_compared_names_is_bounded() -> None:
    looked_at = 0

    def names() -> Iterator[str]:
        nonlocal looked_at
        while True:
            looked_at += 1
            yield f"/topic_{looked_at}"

    assert hint("/topc_7", names()) == " (did you mean /topic_7?)"
    assert looked_at <= MAX_CACHED + 1


def test_listing_has_at_most_twelve_names_and_cuts_long_ones() -> None:
    assert listing([]) == ""
    assert listing(["a", "b"]) == "a, b"
    assert listing(map(str, range(12))) == "0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11"
    assert listing(map(str, range(13))) == "0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, ..."
    assert listing(["x" * 1000]) == "x" * 60 + "..."


def test_half_surrogate_pairs_are_escaped() -> None:
    assert listing(["a\ud800", "é"]) == "a\\ud800, é"
    assert hint("camera\ud800", ["camera\ud801"]).isprintable()


def test_long_list_of_names_is_cut() -> None:
    assert name_some(["a", "b"]) == "a, b"
    assert name_some(["a", "b", "c", "d", "e"]) == "a, b, c and 2 more"
