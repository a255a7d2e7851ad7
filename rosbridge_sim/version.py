"""Version of this package, in a separate module that every other module may import."""

from __future__ import annotations

__all__ = ["__version__"]

__version__ = "0.1.0"
