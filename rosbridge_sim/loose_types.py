"""Names for values whose type is known only at run time.

For the type checker each of them is `Any`; for a reader the name says what the value is.
"""

from __future__ import annotations

from typing import Any, TypeAlias

Struct: TypeAlias = Any
"""A struct class that `schema/compile.py` has made for a message type; it has the fields of the type."""

JsonValue: TypeAlias = Any
"""Any value of a JSON text, a CBOR item or a TOML file."""

LibraryArgument: TypeAlias = Any
"""An argument that is passed on to a library unchanged."""
