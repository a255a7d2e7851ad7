"""Replay: recorded drives are read and shown again."""
