"""Version of this package, in a module of its own that everything may import."""

from __future__ import annotations

__all__ = ["__version__"]

__version__ = "0.1.0"
