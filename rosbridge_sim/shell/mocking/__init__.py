"""Mocks of robots: their files on the disk, and faults of the wire."""
