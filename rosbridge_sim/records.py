"""Records: small groups of fields that never change.

A class of them is `class Point(Record):` with annotated fields, as in a frozen dataclass: fields are given by position
or name, compared and hashed by their values, and written as `Point(x=1.0)`. `eq=False` compares by identity, where
fields are arrays. Python compiles six functions for a frozen dataclass, which takes forty times as long as this: with
two hundred classes that was an eighth of the CPU time of a server's start. What changes is a dataclass, and so is what
leaves a field out of its comparison or its text, or checks its fields, and what help and lists of the command line
import, which start faster without this module.
"""

from __future__ import annotations

import dataclasses
from typing import TypeVar, dataclass_transform

from msgspec import Struct, field, structs
from msgspec.structs import asdict

__all__ = ["Record", "asdict", "field", "replace"]

One = TypeVar("One")
"""A record or a dataclass."""


@dataclass_transform(frozen_default=True, field_specifiers=(field,))
class Record(Struct, frozen=True):
    """Base of records that never change. To assign a field is an `AttributeError`."""


def replace(one: One, **changes: object) -> One:
    """Copy a record, or a dataclass, with other values of some fields.

    Raises:
        TypeError: there is no such field.
    """
    if isinstance(one, Struct):
        return structs.replace(one, **changes)
    return dataclasses.replace(one, **changes)  # type: ignore[type-var] # it is one of the two
