"""Entities that move without commands: on lanes, on paths, and self-driving egos."""
