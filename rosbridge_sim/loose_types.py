"""Names for values whose type is known only when the program runs.

To the type checker each of them is `Any`; to a reader it says what stands there.
"""

from __future__ import annotations

from typing import Any, TypeAlias

__all__ = ["JsonValue", "LibraryArgument", "Struct"]

Struct: TypeAlias = Any
"""A struct of a class that `schema/compile.py` has made for a message type; its fields are those of the type."""

JsonValue: TypeAlias = Any
"""Whatever a JSON text, a CBOR item or a TOML file can hold."""

LibraryArgument: TypeAlias = Any
"""An argument that is handed on to a library as it is."""
