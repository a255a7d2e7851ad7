"""All flags by their keys: those of `Settings`, and the short forms beside them."""

from __future__ import annotations

from dataclasses import Field, fields
from typing import Any, get_args

from rosbridge_sim.shell.config.flag import Flag
from rosbridge_sim.shell.config.settings import Settings
from rosbridge_sim.shell.config.value_types import RATES, choice_of, or_none

FIELDS: dict[str, Field[Any]] = {one.name.replace("_", "-"): one for one in fields(Settings)}
"""Key, which is the flag without its dashes, -> field."""


SHORT_FORMS: dict[str, Flag] = {
    "rate": Flag(
        FIELDS["publishers"].metadata["flag"].group,
        RATES,
        "publishing rate of one of the simulator's topics, such as /Ego_topic=10; it beats the file; repeatable",
    ),
}
"""Flags and variables that set a part of a table: `rate` sets one of `publishers`."""


def _flag_of(one: Field[Any]) -> Flag:
    if "flag" in one.metadata:
        flag: Flag = one.metadata["flag"]
        return flag
    group, text, none = one.metadata["choice"]
    parts = (one.type, *get_args(one.type))  # Literal[...], or Literal[...] | None
    kind = choice_of(*(word for part in parts for word in get_args(part) if isinstance(word, str)))
    return Flag(group, or_none(kind, none) if none else kind, text)


FLAGS: dict[str, Flag] = {key: _flag_of(one) for key, one in FIELDS.items()} | SHORT_FORMS
"""Key of a setting or short form -> its flag."""
