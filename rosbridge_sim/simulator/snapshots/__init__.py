"""Snapshots: the whole state of the simulator as bytes, and back."""
