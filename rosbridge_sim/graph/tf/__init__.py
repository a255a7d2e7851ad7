"""Transforms: the known coordinate frames, and the clients that ask for them."""
