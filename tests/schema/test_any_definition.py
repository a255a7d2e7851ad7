"""Damaged definitions: a usable type, or an error with its place."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import get_args

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rosbridge_sim.errors import DefinitionError, FieldError, TypeNameError
from rosbridge_sim.schema.definitions.names import Generation
from rosbridge_sim.schema.definitions.parse import parse_action, parse_message, parse_service
from rosbridge_sim.schema.store import Store
from tests.mutations import Flip, damage, examples, flips
from tests.schema.strategies import read_texts

TEXTS = read_texts()
PIECES = [
    *("int32 x", "string s", "Header header", "float64[3] v", "bool[] bs", "uint8[<=5] few", "string<=3 short"),
    *(
        "int8 A=1",
        "string B=it's # it",
        "float32 C=nan",
        "byte D=300",
        "int32 y 5",
        'string z "a\\"',
        "float64[2] w [1,2]",
    ),
    *("---", "---\n---", "time t", "duration[2] d", "char c", "wstring ws", "int32[99999999] many", "int32[-1] none"),
    *("uint8[" + "1" * 5_000 + "] many", "string<=" + "1" * 5_000 + " many", "int32[<=" + "0" * 5_000 + "1] many"),
    *(
        "geometry_msgs/Point p",
        "Point p",
        "Nothing n",
        "nothing/Nothing n",
        "T t",
        "x/T[] ts",
        "a/b/c d",
        "int32 class",
    ),
    *("int32 x x", "int32", "=", "int32 x=", "string q=", " ", "\t", "\x00", "\r", "\ufeff", "# only", "int32 \u00fc"),
    *("int64 E=" + "9" * 5_000, "float64 F=1e999", "int32[] l [" + "1," * 2_000 + "]", "int32 deep " + "[" * 500),
]
"""Lines that are right, wrong or odd."""

edited_texts = st.builds(
    lambda key, lines, changes: (key, _edit(TEXTS[key], lines), changes),
    st.sampled_from(sorted(TEXTS)),
    st.lists(st.tuples(st.integers(0, 60), st.sampled_from(["", *PIECES]), st.booleans()), max_size=3),
    st.just([]) | flips(2),
)


def _edit(text: str, edits: list[tuple[int, str, bool]]) -> str:
    """Put lines in, in place of others or before them."""
    lines = text.split("\n")
    for at, piece, is_new in edits:
        i = at % len(lines)
        lines[i : i + (not is_new)] = [piece]
    return "\n".join(lines)


@pytest.mark.parametrize("line", [piece for piece in PIECES if len(piece) > 1_000])
def test_error_about_an_overlong_line_is_short(line: str) -> None:
    with pytest.raises(DefinitionError) as caught:
        parse_message("p/T", line)
    assert len(str(caught.value)) < 400


@pytest.mark.slow
@examples(150)
@given(given_text=edited_texts, ros=st.sampled_from(get_args(Generation)))
def test_odd_definition_gives_a_type_or_an_error(
    given_text: tuple[tuple[str, str, str], str, list[Flip]], ros: Generation
) -> None:
    (package, kind, name), text, changes = given_text
    text = damage(text.encode(), changes).decode("utf-8", "replace")
    parsers: dict[str, Callable[[str, str], object]] = {
        "msg": partial(parse_message, ros=ros),
        "srv": parse_service,
        "action": parse_action,
    }
    try:
        parsers[kind](f"{package}/{name}", text)
    except DefinitionError as error:
        (line,) = str(error).splitlines()
        assert len(line) < 1_000
        assert 1 <= error.line <= len(text.split("\n")) + 1  # noqa: PT017 - either is right
    if kind != "msg":
        return
    store = Store({**TEXTS, (package, kind, name): text}, ros=ros)
    try:
        made = store.message(f"{package}/{name}")
    except (DefinitionError, TypeNameError):
        return
    value = made.default()
    assert made.decode_json(made.encode_json(value), 0) is not None
    made.encode_cbor(value)
    try:
        made.encode_raw(value)
    except FieldError:
        assert "wstring" in text
    again = Store({**TEXTS, (package, kind, name): store.full_text(f"{package}/{name}").partition("\n===")[0]}, ros=ros)
    assert again.message(f"{package}/{name}").encode_json(value) == made.encode_json(value)
