"""Recordings on the disk: written, read, replayed and repaired."""
