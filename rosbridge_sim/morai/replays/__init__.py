"""Recorded drives: read, and shown again."""
