"""Clocks: the time of day, and the calls of a running server at their times."""
