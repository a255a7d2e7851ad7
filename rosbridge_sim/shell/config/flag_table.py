"""All flags by their keys: those of `Settings`, and the short forms beside them."""

from __future__ import annotations

from dataclasses import Field, fields
from typing import Any

from rosbridge_sim.shell.config.flag import Flag
from rosbridge_sim.shell.config.settings import Settings
from rosbridge_sim.shell.config.value_types import RATES

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


def flag_of(key: str) -> Flag:
    """Return group, values and help text of a setting or short form."""
    if key in SHORT_FORMS:
        return SHORT_FORMS[key]
    known: Flag = FIELDS[key].metadata["flag"]
    return known
