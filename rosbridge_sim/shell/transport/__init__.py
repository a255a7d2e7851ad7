"""Bytes of a socket, and the frames in them."""
