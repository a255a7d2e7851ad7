"""Recordings on the disk: writing, reading, replaying and repairing them."""
