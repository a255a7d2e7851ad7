"""Sensors of the egos: their topics, noise and files."""
