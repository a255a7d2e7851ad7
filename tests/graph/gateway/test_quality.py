"""Qualities of service: what a setting chooses, and what fits what."""

from __future__ import annotations

import re

import pytest

from rosbridge_sim.graph.gateway.quality import PROFILES, Quality, read_choice, why_unheard


def test_choice_is_a_pattern_and_a_profile() -> None:
    assert read_choice("/camera*=sensor_data") == ("/camera*", Quality(is_reliable=False, is_latched=False, depth=5))
    assert read_choice("/a=b=latched") == ("/a=b", Quality(is_reliable=True, is_latched=True, depth=1))
    assert PROFILES["default"] == Quality(is_reliable=True, is_latched=False, depth=10)


@pytest.mark.parametrize("text", ["=latched", "latched", "/map=", "/map=often", ""])
def test_text_without_a_pattern_or_with_an_unknown_profile_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match="^" + re.escape(text) + "$"):
        read_choice(text)


def test_less_than_is_wanted_is_told_point_by_point() -> None:
    best, least = Quality(is_reliable=True, is_latched=True), Quality(is_reliable=False, is_latched=False)
    assert why_unheard(best, least) == why_unheard(best, best) == why_unheard(least, least) == []
    reliability, durability = why_unheard(least, best)
    assert reliability.startswith("reliability: best_effort is offered")
    assert durability.startswith("durability: volatile is offered")
    assert why_unheard(Quality(is_reliable=False, is_latched=True), best) == [reliability]
    assert why_unheard(Quality(), best) == [durability]
