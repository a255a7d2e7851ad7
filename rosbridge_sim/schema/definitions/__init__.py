"""Definitions of messages as texts, and what is read from them."""
