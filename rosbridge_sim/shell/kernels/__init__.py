"""Compiled loops: a C compiler, the user's cache, and the library that the world takes."""
