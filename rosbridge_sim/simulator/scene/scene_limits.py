"""Numbers of egos, and limits of a scene."""

from __future__ import annotations

from typing import Final

FIRST_EGO: Final = 0
"""Id of the first ego."""


FIRST_UID: Final = 1
"""Smallest id of any other entity."""


MAX_FILE_UID: Final = 2**30
"""Largest id in a document that is kept, so that one document cannot use up all ids."""


FIRST_FREE_EGO: Final = 2
"""The first number of a further ego: MORAI's egos are 0, 2, 3, ..., and no program has seen a 1."""


MAX_EGOS: Final = 32
"""Largest number of egos, because each has a dozen topics and services."""


MAX_ENTITIES: Final = 20_000
"""Largest number of entities in the world: twice the number that one step is made for."""
