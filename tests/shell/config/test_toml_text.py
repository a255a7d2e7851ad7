"""The line of each key, however a TOML file writes it."""

from __future__ import annotations

import pytest

from rosbridge_sim.shell.config.toml_text import lines_of, place_of

TEXT = """# a comment = 1
port = 1
 "host" = "x" # y
[publishers]
"/a.b" = { name = "/c", rate = 5 }
'/d' = { on = true }

[ publishers . "/e" ]
on = false
[services]
"/f".name = "/g"
schema-path = [
  "x",
]
"""


@pytest.mark.parametrize(
    ("path", "line"),
    [
        (("port",), 2),
        (("host",), 3),
        (("publishers",), 4),
        (("publishers", "/a.b"), 5),
        (("publishers", "/a.b", "rate"), 5),
        (("publishers", "/d", "on"), 6),
        (("publishers", "/e"), 8),
        (("publishers", "/e", "on"), 9),
        (("services", "/f"), 11),
        (("services", "/f", "name"), 11),
        (("services", "schema-path"), 12),
    ],
)
def test_line_of_every_key_is_found(path: tuple[str, ...], line: int) -> None:
    lines = lines_of(TEXT)
    assert lines[path] == line
    assert place_of(lines, path) == f":{line}"


def test_missing_key_gives_the_line_of_its_table_or_none() -> None:
    assert place_of(lines_of(TEXT), ("services", "/f", "on")) == ":11"
    assert place_of(lines_of(TEXT), ("nowhere",)) == ""


def test_line_of_a_key_in_a_list_of_tables_is_found() -> None:
    assert lines_of("[[a]]\nb = 1\n")["a", "b"] == 2
