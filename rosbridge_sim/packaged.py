"""Files of the package itself: data that belong to the program as its modules do, and change as little."""

from __future__ import annotations

from pathlib import Path
from typing import Final

_PACKAGE: Final = Path(__file__).parent


def read_packaged(path: str) -> str:
    """Return the text of a file of the package.

    Args:
        path: relative to the package, such as `schema/definitions/standard.msgs`.
    """
    return (_PACKAGE / path).read_text(encoding="utf-8")
