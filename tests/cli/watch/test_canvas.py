"""The canvas of `watch`: dots, colours and texts in characters."""

from __future__ import annotations

import numpy as np
import pytest

from rosbridge_sim.cli.watch.canvas import Canvas, Ink, columns, fit


def plain(canvas: Canvas) -> list[str]:
    return canvas.rows(num_colours=0, has_braille=True)


def test_each_dot_is_one_of_eight_in_its_character() -> None:
    expected = {(0, 0): "⠁", (1, 0): "⠈", (0, 1): "⠂", (1, 1): "⠐", (0, 2): "⠄", (1, 2): "⠠", (0, 3): "⡀", (1, 3): "⢀"}
    for place, char in expected.items():
        canvas = Canvas(1, 1)
        canvas.dots(np.array([place]), Ink.ROAD)
        assert plain(canvas) == [char]


def test_line_has_no_gaps_and_ends_at_the_edge() -> None:
    canvas = Canvas(4, 1)
    canvas.lines(np.array([[-100.0, 0.5, 100.0, 0.5]]), Ink.ROAD)
    assert plain(canvas) == ["⠉⠉⠉⠉"]
    canvas.lines(np.array([[0.0, 0.0, 0.0, 0.0], [np.nan, 0.0, 1.0, 1.0], [0.0, 3.0, np.inf, 3.0]]), Ink.ROAD)
    assert plain(canvas) == ["⠉⠉⠉⠉"]


def test_lines_outside_and_too_long_ones_cost_nothing() -> None:
    canvas = Canvas(4, 1)
    canvas.lines(np.array([[10.0, 10.0, 20.0, 20.0], [-1e9, -1e9, 1e9, 1e9]]), Ink.ROAD)
    assert plain(canvas) == [""]
    canvas.lines(np.empty((0, 4)), Ink.ROAD)
    assert plain(canvas) == [""]


def test_later_lines_give_a_character_its_colour() -> None:
    canvas = Canvas(2, 1)
    canvas.lines(np.array([[0.0, 0.0, 3.0, 0.0]]), Ink.ROAD)
    canvas.dots(np.array([[0, 3]]), Ink.RED)
    (row,) = canvas.rows(num_colours=16, has_braille=True)
    assert row == "\x1b[0;31m⡉\x1b[0;90m⠉\x1b[0m"
    (row,) = canvas.rows(num_colours=256, has_braille=True)
    assert row == "\x1b[0;38;5;203m⡉\x1b[0;38;5;245m⠉\x1b[0m"


def test_terminal_without_braille_gets_characters_by_the_number_of_dots() -> None:
    canvas = Canvas(3, 1)
    canvas.dots(np.array([[0, 0]]), Ink.ROAD)
    canvas.dots(np.array([[4 + i % 2, i // 2] for i in range(8)]), Ink.ROAD)
    assert canvas.rows(num_colours=0, has_braille=False) == [". #"]


@pytest.mark.parametrize(("column", "row"), [(-2, 0), (3, 0), (0, -1), (0, 5)])
def test_text_beyond_the_edge_is_left_out(column: int, row: int) -> None:
    canvas = Canvas(3, 1)
    canvas.text(column, row, "ab", Ink.EGO)
    assert plain(canvas) == [""]


def test_wide_characters_keep_the_rows_within_their_width() -> None:
    canvas = Canvas(4, 1)
    canvas.text(0, 0, "차x", Ink.EGO)
    assert plain(canvas) == ["?x"]
    assert fit("서울 town", 6) == "서울 t"
    assert fit("서울", 3) == "서"
    assert columns("서울 town") == 9
