"""Pictures of the report: where things are in the map, and what a curve shows."""

from __future__ import annotations

import math
import re
from xml.etree import ElementTree as ET

import numpy as np
import pytest

from rosbridge_sim.campaigns.report_pictures import draw_curve, draw_scene

PER_METRE = 420 / 120
"""The map is 420 pixels wide and shows 60 m to each side."""


def shapes(svg: str) -> dict[str, list[list[tuple[float, float]]]]:
    """Points of the lines and boxes of a picture, by class."""
    found: dict[str, list[list[tuple[float, float]]]] = {}
    for each in ET.fromstring(svg).iter():  # noqa: S314 - our own text
        if "points" in each.attrib:
            points = [(float(x), float(y)) for x, y in (pair.split(",") for pair in each.attrib["points"].split())]
            found.setdefault(each.attrib["class"], []).append(points)
    return found


def scene(num: int = 3, **more: object) -> dict[str, list[list[tuple[float, float]]]]:
    """The map of a drive of so many seconds that ends at (100, 50)."""
    trace = {
        "time": [float(i) for i in range(num)],
        "x": [100.0 - (num - 1 - i) for i in range(num)],
        "y": [50.0] * num,
    }
    return shapes(draw_scene(trace, more, 'run "1"'))


def test_ego_ends_in_the_middle_a_bit_below_with_north_up_and_its_way_of_ten_seconds() -> None:
    (way,) = scene(30)["way"]
    assert way[-1] == pytest.approx((210.0, 157.5), abs=0.06)
    assert way[0] == pytest.approx((210.0 - 10 * PER_METRE, 157.5), abs=0.06)
    assert len(way) == 12  # the last place is drawn in any case


def test_long_way_has_few_points() -> None:
    trace = {name: [i / 100 for i in range(1_000)] for name in ("time", "x", "y")}
    (way,) = shapes(draw_scene(trace, {}, ""))["way"]
    assert 250 <= len(way) <= 335
    assert way[-1] == pytest.approx((210.0, 157.5), abs=0.06)


def test_roads_are_drawn_as_far_as_they_are_near() -> None:
    lines = [[(100.0, 50.0), (110.0, 60.0), (300.0, 50.0)], [(500.0, 50.0)]]
    (lane,) = scene(roads=lines)["lane"]
    assert np.allclose(lane, [(210.0, 157.5), (210.0 + 35.0, 157.5 - 35.0)], atol=0.06)


def test_boxes_are_those_of_the_last_moment_turned_about_their_reference_points() -> None:
    def box(uid: int, yaw: float) -> tuple[float, ...]:
        return uid, 100.0, 50.0, yaw, 2.0, 1.0, 1.5, 0

    found = scene(neighbours=[(1.0, [box(7, 0.0)]), (2.0, [box(0, 0.0), box(4, math.pi / 2)])])
    sides = [(3.5, 1.0), (3.5, -1.0), (-0.5, -1.0), (-0.5, 1.0)]  # forward and left of the reference point
    expected = [(210.0 + x * PER_METRE, 157.5 - y * PER_METRE) for x, y in sides]
    assert np.allclose(found["ego"], [expected], atol=0.06)
    expected = [(210.0 - y * PER_METRE, 157.5 - x * PER_METRE) for x, y in sides]
    assert np.allclose(found["other"], [expected], atol=0.06)
    assert scene(neighbours=[]).keys() == scene().keys() == {"way"}


def test_map_has_a_scale_and_a_name_for_readers_of_screens() -> None:
    svg = draw_scene({"time": [0.0], "x": [0.0], "y": [0.0]}, {"roads": [[(0.0, 0.0)]]}, 'run "1"')
    assert ET.fromstring(svg).attrib["aria-label"] == 'run "1"'  # noqa: S314 - our own text
    assert '<path class="axis" d="M8 307h70"/><text x="8" y="303">20 m</text>' in svg
    assert 'viewBox="0 0 420 315"' in svg
    assert 'class="lane" stroke-width="10.5"' in svg  # three metres


def curve(times: list[float], values: list[float], mark: float | None = None) -> tuple[list[str], list[str], str]:
    """Pieces of the curve, texts, and the whole picture."""
    svg = draw_curve(times, values, "speed", "m/s", mark)
    found = re.search(r'class="curve" d="([^"]*)"', svg)
    texts = [each.text or "" for each in ET.fromstring(svg).iter() if each.tag == "text"]  # noqa: S314 - our own
    return re.findall(r"[ML][^ML]*", found[1]) if found else [], texts, svg


def test_curve_goes_from_axis_to_edge_with_its_ends_named() -> None:
    pieces, texts, svg = curve([1.0, 2.0, 3.0], [0.5, 4.0, 2.0])
    assert pieces == ["M56.0 83.0", "L236.0 20.0", "L416.0 56.0"]
    assert texts == ["speed [m/s]", "4", "0", "3 s"]
    assert 'class="axis" d="M56 20V92H416"' in svg
    assert "mark" not in svg


@pytest.mark.parametrize(
    ("values", "expected"),
    [
        ([math.inf, 1.0, math.inf, 1.0, 1.0], ["M146.0 20.0", "M326.0 20.0", "L416.0 20.0"]),
        ([-2.0, 2.0, 0.0, 0.0, 0.0], ["M56.0 92.0", "L146.0 20.0", "L236.0 56.0", "L326.0 56.0", "L416.0 56.0"]),
        ([0.0] * 5, ["M56.0 92.0", "L146.0 92.0", "L236.0 92.0", "L326.0 92.0", "L416.0 92.0"]),
        ([math.inf] * 5, []),
    ],
)
def test_curve_has_gaps_where_nothing_is_known_and_always_shows_zero(values: list[float], expected: list[str]) -> None:
    pieces, texts, _ = curve([0.0, 1.0, 2.0, 3.0, 4.0], values)
    assert pieces == expected
    assert ("none" in texts) == (expected == [])


def test_curve_of_one_frame_or_of_very_many_is_drawn_with_its_mark() -> None:
    assert curve([2.0], [3.0])[0] == ["M56.0 20.0"]
    pieces, _, svg = curve([i / 50 for i in range(1_000)], [1.0] * 1_000, mark=5.0)
    assert len(pieces) == 250
    assert {each[0] for each in pieces[1:]} == {"L"}
    assert f'class="mark" d="M{56 + 360 * 5 / 19.98:.1f} 20V92"' in svg
