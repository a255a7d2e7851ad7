"""The file of a contract, key by key: topics with type, rate and fields, and services."""

from __future__ import annotations

from typing import Annotated, Final

from msgspec import Meta, field

from rosbridge_sim.contracts.seen_system import MAX_FIELDS, MAX_PATH
from rosbridge_sim.documents.document_model import DocumentType, Table, about

MAX_TOPICS: Final = 1_000
"""Most topics, and most services, of a contract."""

MAX_LISTED: Final = 100
"""Most values of a field that a contract lists."""

TOLERANCE: Final = 0.2
"""Default of the share by which a rate may differ: a loaded machine of CI is within it."""


def _read_word(value: object) -> object:
    if not isinstance(value, bool | str):
        raise ValueError("expected a text, true or false; `min` and `max` are for numbers")  # noqa: TRY004 - as all mistakes
    return value


_Word = Annotated[str | bool, Meta(extra={"read": _read_word})]


def _check_name(value: str) -> None:
    if not value.startswith("/"):
        raise ValueError(f"expected a name with a slash in front, such as /{value or 'odom'}")


_Name = Annotated[str, Meta(max_length=MAX_PATH, extra={"check": _check_name})]
_Path = Annotated[str, Meta(max_length=MAX_PATH)]
_Words = Annotated[list[_Word], Meta(max_length=MAX_LISTED)]
_Rate = Annotated[float, Meta(gt=0.0, le=1e5)]
_Length = Annotated[int, Meta(ge=0)]


class FieldTerms(Table, frozen=True, kw_only=True, omit_defaults=True):
    """Terms of a field. Without any, the field must be there."""

    low: Annotated[float | None, about("least number")] = field(name="min", default=None)
    high: Annotated[float | None, about("largest number")] = field(name="max", default=None)
    nan: Annotated[bool, about("NaN, infinity and null are accepted, too")] = False
    values: Annotated[_Words | None, about("the only texts or flags")] = None
    min_length: Annotated[_Length | None, about("of a list")] = None
    max_length: Annotated[_Length | None, about("of a list")] = None

    def __post_init__(self) -> None:
        """Check that the terms fit together."""
        for low, high, name in ((self.low, self.high, ""), (self.min_length, self.max_length, "_length")):
            if low is not None and high is not None and low > high:
                raise ValueError(f"expected min{name} of at most max{name}, got {low:g} and {high:g}")
        if self.has_range + (self.values is not None) + self.has_length > 1:
            raise ValueError("expected one of: min and max, values, min_length and max_length")

    @property
    def has_range(self) -> bool:
        """True if the field must be a number."""
        return (self.low, self.high) != (None, None)

    @property
    def has_length(self) -> bool:
        """True if the field must be a list."""
        return (self.min_length, self.max_length) != (None, None)


class TopicTerms(Table, frozen=True, kw_only=True, omit_defaults=True):
    """Terms of a topic."""

    type: Annotated[str, about("type, as either generation of ROS writes it", max_length=MAX_PATH)]
    rate: Annotated[_Rate | None, about("messages per second [Hz]")] = None
    tolerance: Annotated[float, about("share by which the rate may differ", ge=0.0)] = TOLERANCE
    fields: Annotated[
        dict[_Path, FieldTerms], about("by path: `pose.x`; `ranges[]` is each element", max_length=MAX_FIELDS)
    ] = field(default_factory=dict)


class Contract(Table, frozen=True, kw_only=True, omit_defaults=True):
    """A contract."""

    topics: Annotated[dict[_Name, TopicTerms], about("by name", max_length=MAX_TOPICS)] = field(default_factory=dict)
    services: Annotated[
        dict[_Name, Annotated[str, Meta(max_length=MAX_PATH)]],
        about("name: type; an empty type may be any", max_length=MAX_TOPICS),
    ] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Check that it says something."""
        if not self.topics and not self.services:
            raise ValueError("expected topics, services or both; a contract without them is always kept")


CONTRACT: Final = DocumentType[Contract](Contract)
