"""Lanes, paths, stop lines and traffic lights, and searches in them."""
