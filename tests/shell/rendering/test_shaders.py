"""Programs for pixels: what each is told of the weather and of its class."""

from __future__ import annotations

import re

import pytest

from rosbridge_sim.shell.rendering.shaders import ASPHALT_FADES, GRASS_FADES, Coat, scene_fragment


@pytest.mark.parametrize("is_dark", [False, True])
@pytest.mark.parametrize("is_wet", [False, True])
def test_program_knows_the_class_and_whether_it_is_dark_and_wet(is_dark: bool, is_wet: bool) -> None:  # noqa: FBT001 - parameters
    for coat in Coat:
        words = re.findall(r"^#define (\w+)$", scene_fragment(coat, is_dark=is_dark, is_wet=is_wet), re.MULTILINE)
        assert words == [coat.value, *["DARK"] * is_dark, *["WET"] * is_wet]


def test_patterns_fade_where_the_class_says() -> None:
    for coat, fades in ((Coat.ASPHALT, ASPHALT_FADES), (Coat.GRASS, GRASS_FADES)):
        found = re.search(r"^#define FADES2 (\S+)$", scene_fragment(coat, is_dark=False, is_wet=False), re.MULTILINE)
        assert found is not None
        assert float(found[1]) == pytest.approx(fades**2, abs=0.05)
