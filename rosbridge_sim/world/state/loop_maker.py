"""Places for makers of compiled loops, which do the work of arrays to the last bit."""

from __future__ import annotations

from typing import Generic, TypeVar

Make = TypeVar("Make")
"""The type of a maker."""


class LoopMaker(Generic[Make]):
    """The place for the maker of one kind of loops, for all worlds.

    Attributes:
        make: returns the loops for one set of rows; None while arrays do the work. It may be set between two steps.
    """

    def __init__(self) -> None:
        self.make: Make | None = None
