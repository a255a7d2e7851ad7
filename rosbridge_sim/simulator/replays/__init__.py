"""Replays of recorded drives: files of the user, and messages of other simulators."""
