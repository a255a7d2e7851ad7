"""Transforms: what is known of frames, and who wants to hear of it."""
