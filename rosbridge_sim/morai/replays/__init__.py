"""Replay of recorded drives: recordings are read and shown in the world."""
