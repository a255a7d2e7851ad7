"""Quick Autobahn cases with our connection class; `scripts/autobahn.py` runs all of them."""

from __future__ import annotations

import logging

import pytest

from scripts.autobahn import compare, run

FRAMES = ["1.*", "2.*", "3.*", "4.*", *(f"5.{n}" for n in range(1, 19)), "7.*", "10.*"]
TEXTS = [f"6.{n}.*" for n in range(1, 24) if n != 4]
"""Groups 1 to 7 and 10, without the cases that wait by themselves; 9 measures, 12 and 13 compress for minutes."""


@pytest.mark.slow
@pytest.mark.client
@pytest.mark.parametrize(("cases", "num"), [(FRAMES, 90), (TEXTS, 130)], ids=["frames", "texts"])
async def test_autobahn_results_equal_those_of_the_library(cases: list[str], num: int) -> None:
    logging.getLogger("quiet").setLevel(logging.CRITICAL)
    reference, ours = [await run(cases, is_direct=is_direct) for is_direct in (False, True)]
    assert len(reference) > num
    assert compare(ours, reference) == []
    assert sum(not verdict.startswith("not") for verdict in ours.values()) >= len(ours) - 1


def test_lost_autobahn_case_is_detected() -> None:
    assert compare({"1": "OK", "2": "not passed"}, {"1": "OK", "2": "OK", "3": "OK", "4": "not passed"}) == [
        "2: not passed; the reference: OK",
        "3: not run; the reference: OK",
    ]
