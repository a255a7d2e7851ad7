"""Shapes of reference lines against plain integration, and polynomials from record to record."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rosbridge_sim.maps.opendrive.plan_view import Cubics, PlanShape, cubic_at, find_torn_joints, place_on, point_on
from rosbridge_sim.world.geometry.planar import FloatArray

S = np.linspace(0.0, 60.0, 121)


def integrate(heading: FloatArray, step: float) -> tuple[FloatArray, FloatArray]:
    """Sum up small steps, by Simpson's rule: headings at even steps and their middles -> places at the even ones."""
    x, y = (
        np.concatenate([[0.0], np.cumsum((wave[:-2:2] + 4.0 * wave[1:-1:2] + wave[2::2]) * step / 3.0)])
        for wave in (np.cos(heading), np.sin(heading))
    )
    return x, y


@pytest.mark.parametrize(
    ("kind", "figures", "curvature"),
    [
        ("line", (), lambda s: 0.0 * s),
        ("arc", (0.05,), lambda s: 0.05 + 0.0 * s),
        ("arc", (0.0,), lambda s: 0.0 * s),
        ("arc", (-1e-9,), lambda s: -1e-9 + 0.0 * s),
        ("spiral", (0.0, 0.02), lambda s: 0.02 * s / 60.0),
        ("spiral", (0.5, -0.4), lambda s: 0.5 - 0.9 * s / 60.0),
        ("spiral", (0.03, 0.03), lambda s: 0.03 + 0.0 * s),
    ],
)
def test_shape_agrees_with_its_integrated_curvature_to_a_micrometre(kind, figures, curvature) -> None:  # type: ignore[no-untyped-def]  # noqa: ANN001
    fine = np.linspace(0.0, 60.0, 24_001)
    turn = np.concatenate([[0.0], np.cumsum(curvature((fine[1:] + fine[:-1]) / 2.0) * np.diff(fine))])
    x, y = integrate(0.4 + turn, fine[1])
    shape = PlanShape(0.0, 5.0, -2.0, 0.4, 60.0, kind, figures)
    found_x, found_y, heading = place_on([shape], S)
    assert np.abs(found_x - 5.0 - x[::100]).max() < 1e-6
    assert np.abs(found_y + 2.0 - y[::100]).max() < 1e-6
    assert np.abs(heading - 0.4 - turn[::200]).max() < 1e-6


def test_spiral_is_the_same_from_any_of_its_places() -> None:
    shape = PlanShape(0.0, 0.0, 0.0, 0.0, 60.0, "spiral", (0.1, -0.2))
    whole = np.stack(place_on([shape], S))
    part = np.stack(place_on([shape], S[50:70]))
    assert np.abs(whole[:, 50:70] - part).max() < 1e-9


def test_spiral_goes_on_before_its_start_as_behind_it() -> None:
    """Its curvature changes evenly, so the way back is a spiral whose curvature changes by the same rate."""
    back = PlanShape(0.0, 0.0, 0.0, math.pi, 10.0, "spiral", (-0.1, -0.1 + 0.05))
    x, y, heading = place_on([PlanShape(10.0, 3.0, 4.0, 0.0, 60.0, "spiral", (0.1, 0.4))], np.array([0.0, 5.0, 10.0]))
    other_x, other_y, other = place_on([back], np.array([0.0, 5.0, 10.0]))
    assert x[::-1] - 3.0 == pytest.approx(other_x)
    assert y[::-1] - 4.0 == pytest.approx(other_y)
    assert heading[::-1] + math.pi == pytest.approx(other)


def test_length_of_a_poly3_counts_along_the_curve() -> None:
    shape = PlanShape(0.0, 0.0, 0.0, 0.0, 40.0, "poly3", (0.0, 0.1, 0.02, -0.0003))
    s = np.linspace(0.0, 40.0, 8_001)
    x, y, heading = place_on([shape], s)
    assert (x[0], y[0], heading[0]) == (0.0, 0.0, math.atan(0.1))
    assert np.abs(np.hypot(np.diff(x), np.diff(y)) - np.diff(s)).max() < 1e-6
    assert np.abs(y - (0.1 * x + 0.02 * x**2 - 0.0003 * x**3)).max() < 1e-9
    assert np.abs(np.unwrap(np.arctan2(np.diff(y), np.diff(x))) - 0.5 * (heading[1:] + heading[:-1])).max() < 1e-4


def test_parameter_of_a_param_poly3_is_normalized_or_metres() -> None:
    u, v = (0.0, 30.0, 2.0, 0.0), (0.0, 0.0, 8.0, -3.0)
    metres = [tuple(a / 30.0**n for n, a in enumerate(row)) for row in (u, v)]
    s = np.linspace(0.0, 30.0, 31)
    one = np.stack(place_on([PlanShape(0.0, 1.0, 2.0, 0.3, 30.0, "paramPoly3", (1.0, *u, *v))], s))
    other = np.stack(place_on([PlanShape(0.0, 1.0, 2.0, 0.3, 30.0, "paramPoly3", (0.0, *metres[0], *metres[1]))], s))
    assert np.abs(one - other).max() < 1e-12
    end = complex(32.0, 5.0) * complex(math.cos(0.3), math.sin(0.3)) + complex(1.0, 2.0)
    assert abs(complex(one[0, -1], one[1, -1]) - end) < 1e-12
    assert one[2, -1] == pytest.approx(0.3 + math.atan2(7.0, 34.0))


def test_shapes_hold_from_their_start_and_the_last_place_belongs_to_the_one_before() -> None:
    shapes = [PlanShape(0.0, 0.0, 0.0, 0.0, 10.0, "line"), PlanShape(10.0, 0.0, 100.0, 0.0, 10.0, "line")]
    assert place_on(shapes, np.array([0.0, 10.0, 20.0]))[1].tolist() == [0.0, 100.0, 100.0]
    assert place_on(shapes, np.array([0.0, 5.0, 10.0]))[1].tolist() == [0.0, 0.0, 0.0]
    assert place_on(shapes, np.array([10.0 - 1e-9, 12.0]))[1].tolist() == [100.0, 100.0]


def test_joints_with_a_gap_of_a_centimetre_or_a_kink_of_a_degree_are_found() -> None:
    def line(s: float, x: float, heading: float = 0.0) -> PlanShape:
        return PlanShape(s, x, 0.0, heading, 10.0, "line")

    joints = list(find_torn_joints([line(0.0, 0.0), line(10.0, 10.1), line(20.0, 20.109), line(30.0, 30.109, -0.02)]))
    assert [(round(joint.gap, 6), round(joint.kink, 6), joint.s) for joint in joints] == [
        (0.1, 0.0, 10.0),
        (0.0, 0.02, 30.0),
    ]
    arc = PlanShape(0.0, 0.0, 0.0, 0.0, 10.0, "arc", (0.1,))
    end = [float(each[0]) for each in place_on([arc], np.array([10.0]))]
    assert list(find_torn_joints([arc, PlanShape(10.0, end[0], end[1], end[2] - 6.0 * math.pi, 5.0, "line")])) == []


def test_polynomials_hold_from_their_start_with_their_own_variable() -> None:
    cubics = Cubics([np.array([[0.0, 1.0, 0.5, 0.0, 0.0], [10.0, 6.0, 0.0, 0.1, 0.01]]), np.zeros((0, 5))])
    assert cubics.at(np.array([0.0, 4.0, 10.0, 12.0])).tolist() == [[1.0, 3.0, 6.0, 6.0 + 0.4 + 0.08], [0.0] * 4]
    assert cubics.at(np.array([0.0, 10.0])).tolist() == [[1.0, 6.0], [0.0, 0.0]]


def test_tables_at_the_same_places_have_the_values_of_a_search_in_each() -> None:
    random = np.random.default_rng(4)
    for counts in ([1, 1], [3, 0, 1, 5], [0], [2, 7]):
        tables = [np.column_stack([np.sort(random.uniform(-5.0, 70.0, n)), random.normal(size=(n, 4))]) for n in counts]
        for table, values in zip(tables, Cubics(tables).at(S), strict=True):
            for s, value in zip(S[1:-1].tolist(), values[1:-1].tolist(), strict=True):
                held = [row for row in table.tolist() if row[0] <= s] or table[:1].tolist() or [[0.0] * 5]
                start, a, b, c, d = held[-1]
                assert value == pytest.approx(a + b * (s - start) + c * (s - start) ** 2 + d * (s - start) ** 3)


def test_one_place_has_the_bits_of_many() -> None:
    shapes = [PlanShape(0.0, 0.0, 0.0, 0.3, 10.0, "line"), PlanShape(10.0, 5.0, 100.0, 0.1, 10.0, "arc", (0.05,))]
    tables = [np.array([[0.0, 1.0, 0.5, 0.1, 0.2], [10.0, 6.0, 0.3, 0.1, 0.01], [10.0, 7.0, 0.3, 0.1, 0.01]])]
    tables += [tables[0][1:], np.zeros((0, 5))]
    for s in (-1.0, 0.0, 3.7, 10.0, 12.3, 21.0):
        at = np.array([s])
        assert point_on(shapes, s) == [float(each[0]) for each in place_on(shapes, at)]
        assert [cubic_at(table, s) for table in tables] == Cubics(tables).at(at)[:, 0].tolist()
